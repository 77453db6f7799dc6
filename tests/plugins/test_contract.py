"""What holds for every parameter of this package's algorithms and generators of missions."""

import inspect
import math
import re
from importlib.metadata import distribution
from typing import Annotated, get_args, get_origin

import pytest
from typer.testing import CliRunner

from botohe_moo import load_mission, make_algorithm
from botohe_moo._plugins.types import UNIONS, is_scalar
from botohe_moo.algorithms.registry import algorithm_faults, algorithm_parameters
from botohe_moo.cli.app import app
from botohe_moo.mission.library import mission_faults, mission_parameters

OURS = distribution("botohe-moo").entry_points
ALGORITHMS = sorted(OURS.select(group="botohe_moo.algorithms").names)
GENERATORS = ["complete", "random", "terrain", "two_communities"]

PARAMETERS = [
    *((make_algorithm, name, p) for name in ALGORITHMS for p in algorithm_parameters(name)),
    *((load_mission, name, p) for name in GENERATORS for p in mission_parameters(name)),
]

# At their bounds these take memory for arrays, or more than other parameters allow.
COSTLY = {"nodes", "n_colonies"}


def numbers(hint):
    """The types in a hint that are numbers, with their constraints."""
    if get_origin(hint) in UNIONS:
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


NUMBERS = [
    pytest.param(make, name, p, hint, id=f"{name}-{p.name}")
    for make, name, p in PARAMETERS
    for hint in numbers(p.hint)
]
BOUNDS = [
    pytest.param(make, name, p, get_args(hint)[0], kind, bound, id=f"{name}-{p.name}-{kind}")
    for make, name, p, hint in (param.values for param in NUMBERS)
    for kind, bound in bounds(hint)
]


def outside(kind, bound, number):
    """The value just outside a bound."""
    if kind in ("gt", "lt"):
        return number(bound)
    way = -1 if kind == "ge" else 1
    return bound + way if number is int else math.nextafter(bound, way * math.inf)


def shown(*command):
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0
    return done.output


def test_there_are_many():
    assert len(PARAMETERS) > 90
    assert len(NUMBERS) > 50
    assert len(BOUNDS) > 80


@pytest.mark.parametrize(("make", "name", "parameter", "hint"), NUMBERS)
def test_each_number_states_its_range(make, name, parameter, hint):
    assert get_origin(hint) is Annotated
    assert bounds(hint)
    assert parameter.range


@pytest.mark.parametrize(("make", "name", "parameter", "number", "kind", "bound"), BOUNDS)
def test_what_is_just_outside_is_refused(make, name, parameter, number, kind, bound):
    value = outside(kind, bound, number)
    check = algorithm_faults if make is make_algorithm else mission_faults
    expected = f"Expected {parameter.name} {parameter.range}"
    [(blamed, said)] = check(name, {parameter.name: value}, plain=True)
    assert blamed == parameter.name
    assert said.startswith(expected)
    assert said.endswith(f", got {value!r}.")
    with pytest.raises(ValueError, match=re.escape(said)) as caught:
        make(name, **{parameter.name: value})
    assert caught.value.parameter == parameter.name


@pytest.mark.parametrize(("make", "name", "parameter", "number", "kind", "bound"), BOUNDS)
def test_closed_bounds_are_in_range(make, name, parameter, number, kind, bound):
    if kind in ("gt", "lt"):
        assert parameter.checked(number(bound))[1]
        return
    assert parameter.checked(number(bound)) == (bound, [])
    if parameter.name not in COSTLY or kind == "ge":
        assert make(name, **{parameter.name: number(bound)})


@pytest.mark.parametrize("name", ALGORITHMS)
def test_the_command_line_shows_each_range(name):
    text = shown("algorithms", name)
    for parameter in algorithm_parameters(name):
        if parameter.range:
            line = next(x for x in text.splitlines() if re.match(rf"  {parameter.name}\b", x))
            assert line.endswith(f", {parameter.range})")
            assert not re.search(r"\bat (least|most) [\d.]", parameter.description)


@pytest.mark.parametrize("name", GENERATORS)
def test_the_command_line_shows_each_range_of_a_mission(name):
    text = shown("missions", "show", name)
    for parameter in mission_parameters(name):
        line = next(x for x in text.splitlines() if x.startswith(f"  {parameter.name} = "))
        assert line.endswith(f", {parameter.range})")


@pytest.mark.parametrize("name", ALGORITHMS)
def test_scalars_are_checked_by_the_constructor_itself(name):
    make = OURS.select(group="botohe_moo.algorithms", name=name)[name].load()
    for parameter in algorithm_parameters(name):
        assert parameter.name in inspect.signature(make).parameters
        if is_scalar(parameter.hint):
            with pytest.raises(ValueError, match=f"^Expected {parameter.name} "):
                make(**{parameter.name: object()})


def test_lists_read_as_descriptions():
    for command in ("missions", "algorithms"):
        for line in shown(command).splitlines():
            assert not re.search(r"^\S+ +(Give|Draw|Make|Take)\b", line)
