"""What holds for every parameter of this package's algorithms and generators of missions."""

import inspect
import math
import re
from importlib.metadata import distribution
from types import UnionType
from typing import Annotated, Union, get_args, get_origin

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

# At their bounds these take memory for arrays.
COSTLY = {"nodes"}


def stated(name, kind):
    return (algorithm_parameters if kind == "algorithm" else mission_parameters)(name)


def numbers(hint):
    """The types in a hint that are numbers, with their constraints."""
    if get_origin(hint) in (Union, UnionType):
        return [number for member in get_args(hint) for number in numbers(member)]
    inner = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    return [hint] if inner in (int, float) else []


def bounds(hint):
    """The bounds that a type states: pairs of ``gt``, ``ge``, ``lt`` or ``le`` and a number."""
    parts = [part for mark in hint.__metadata__ for part in getattr(mark, "metadata", [])]
    named = [
        (name, getattr(part, name, None)) for part in parts for name in ("gt", "ge", "lt", "le")
    ]
    return [(name, bound) for name, bound in named if bound is not None]


def outside(kind, bound, hint):
    """The value just outside a bound."""
    number = get_args(hint)[0]
    if kind in ("gt", "lt"):
        return number(bound)
    way = -1 if kind == "ge" else 1
    parts = [part for mark in hint.__metadata__ for part in getattr(mark, "metadata", [])]
    step = next((part.multiple_of for part in parts if hasattr(part, "multiple_of")), 1)
    return bound + way * step if number is int else math.nextafter(bound, way * math.inf)


@pytest.mark.parametrize(("name", "kind"), BOTH)
def test_each_number_states_its_range_and_keeps_it(name, kind):
    algorithm = kind == "algorithm"
    make, check = (
        (make_algorithm, algorithm_faults) if algorithm else (load_mission, mission_faults)
    )
    for parameter in stated(name, kind):
        for hint in numbers(parameter.hint):
            assert get_origin(hint) is Annotated, parameter
            assert bounds(hint), parameter
            number = get_args(hint)[0]
            for side, bound in bounds(hint):
                value = outside(side, bound, hint)
                [(blamed, said)] = check(name, {parameter.name: value})
                assert blamed == parameter.name
                assert said.startswith(f"Expected {parameter.name} {parameter.range}")
                assert said.endswith(f", got {value!r}.")
                with pytest.raises(ValueError, match=re.escape(said)) as caught:
                    make(name, **{parameter.name: value})
                assert caught.value.parameter == parameter.name
                if side in ("ge", "le"):
                    assert parameter.checked(number(bound)) == (bound, [])
                    if parameter.name not in COSTLY or side == "ge":
                        assert make(name, **{parameter.name: number(bound)})


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
