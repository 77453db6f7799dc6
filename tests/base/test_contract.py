"""What holds for every parameter of this package's algorithms and generators of missions."""

import inspect
import math
import re
from importlib.metadata import distribution

import pytest
from typer.testing import CliRunner

from botohe_moo import load_mission, make_algorithm
from botohe_moo.algorithms.registry import algorithm_parameters
from botohe_moo.cli.app import app
from botohe_moo.mission.loading import mission_parameters
from tests.faults import algorithm_faults, mission_faults

pytestmark = pytest.mark.slow

OURS = distribution("botohe-moo").entry_points
ALGORITHMS = sorted(OURS.select(group="botohe_moo.algorithms").names)
GENERATORS = [
    name
    for name in sorted(OURS.select(group="botohe_moo.missions").names)
    if any(parameter.name == "seed" for parameter in mission_parameters(name))
]
BOTH = [*((name, "algorithm") for name in ALGORITHMS), *((name, "mission") for name in GENERATORS)]

# Where a value is just outside: on a bound that is excluded, or below or above it.
SIDES = {"minimum": -1, "maximum": 1, "exclusiveMinimum": 0, "exclusiveMaximum": 0}
# At their upper bounds these take memory for arrays.
COSTLY = {"nodes"}


def stated(name, kind):
    return (algorithm_parameters if kind == "algorithm" else mission_parameters)(name)


def bounds_of(parameter):
    """Yield side, bound and the value just outside, of all numbers that it may be."""
    for kind in parameter.schema.get("anyOf", [parameter.schema]):
        number = {"integer": int, "number": float}.get(kind.get("type"))
        assert number is None or SIDES.keys() & kind, f"{parameter.name} states no range"
        for side in SIDES.keys() & kind:
            bound, way = number(kind[side]), SIDES[side]
            if number is int:
                yield side, bound, bound + way * kind.get("multipleOf", 1)
            else:
                yield side, bound, math.nextafter(bound, way * math.inf) if way else bound


@pytest.mark.parametrize(("name", "kind"), BOTH)
def test_each_number_states_its_range_and_keeps_it(name, kind):
    of_algorithms = kind == "algorithm"
    make = make_algorithm if of_algorithms else load_mission
    check = algorithm_faults if of_algorithms else mission_faults
    for parameter in stated(name, kind):
        for side, bound, outside in bounds_of(parameter):
            [(blamed, said)] = check(name, {parameter.name: outside})
            assert blamed == parameter.name
            assert said.startswith(f"Expected {parameter.name} {parameter.range}")
            assert said.endswith(f", got {outside!r}.")
            with pytest.raises(ValueError, match=re.escape(said)) as caught:
                make(name, **{parameter.name: outside})
            assert caught.value.parameter == parameter.name
            if SIDES[side]:
                assert parameter.checked(bound) == (bound, [])
                if parameter.name not in COSTLY or side == "minimum":
                    assert make(name, **{parameter.name: bound})


@pytest.mark.parametrize(("name", "kind"), BOTH)
def test_the_command_line_shows_each_range(name, kind):
    command = ("algorithms", name) if kind == "algorithm" else ("missions", "show", name)
    text = CliRunner().invoke(app, command).output
    for parameter in stated(name, kind):
        if parameter.range:
            line = next(x for x in text.splitlines() if x.startswith(f"  {parameter.name} = "))
            assert line.endswith(f", {parameter.range})")


def test_scalars_are_checked_by_the_constructor_itself():
    for entry in OURS.select(group="botohe_moo.algorithms"):
        make = entry.load()
        for parameter in algorithm_parameters(entry.name):
            assert parameter.name in inspect.signature(make).parameters
            if parameter.is_scalar:
                with pytest.raises(ValueError, match=f"^Expected {parameter.name} "):
                    make(**{parameter.name: object()})
