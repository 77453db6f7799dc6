"""Every message of the parameter checks, and the kinds of numbers they take."""

import math
import pickle

import numpy as np
import pytest
from pydantic import FiniteFloat

from botohe_moo.base.messages import (
    ParameterError,
    check_choice,
    nearest_first,
    quoted,
    unknown_parameter,
)
from botohe_moo.base.parameters import NotNegative, Positive, check, check_weights


class TestInteger:
    def test_integers_of_any_kind_become_int(self):
        for value in [3, np.int8(3), np.uint64(3), np.array([3])[0]]:
            assert check("n_ants", value, int, ge=3) == 3
            assert type(check("n_ants", value, int, ge=3)) is int

    def test_too_small(self):
        for value in [2, -5, np.int64(2), -(10**30)]:
            with pytest.raises(ValueError, match=rf"^Expected n_ants >= 3, got {value}\.$"):
                check("n_ants", value, int, ge=3)

    def test_no_integer(self):
        for value in (3.0, True, "3", None):
            with pytest.raises(ValueError, match=r"^Expected") as error:
                check("n_ants", value, int, ge=0)
            assert str(error.value) == f"Expected n_ants to be an integer >= 0, got {value!r}."


class TestNumber:
    def test_numbers_of_any_kind_become_float(self):
        for value in [0.5, np.float64(0.5), np.float32(0.5)]:
            assert check("evaporation", value, float) == 0.5
            assert type(check("evaporation", value, float)) is float

    @pytest.mark.parametrize(
        ("bounds", "expected", "inside", "outside"),
        [
            ({"gt": 0, "lt": 1}, "in (0, 1)", [5e-324, 0.5, 1 - 2**-53], [0, 1, -1, 2]),
            ({"gt": 0}, "> 0", [5e-324, 1e300], [0.0, -0.0, -1]),
            ({"ge": 0}, ">= 0", [0, -0.0, 1e300], [-5e-324]),
        ],
    )
    def test_bounds(self, bounds, expected, inside, outside):
        for value in inside:
            assert check("x", value, FiniteFloat, **bounds) == value
        for value in outside:
            with pytest.raises(ValueError, match=r"^Expected") as error:
                check("x", value, FiniteFloat, **bounds)
            assert str(error.value) == f"Expected x {expected}, got {value!r}."
        for value in [None, "1", True, 1j, [1]]:
            with pytest.raises(ValueError, match=r"^Expected") as error:
                check("x", value, FiniteFloat, **bounds)
            assert str(error.value) == f"Expected x to be a number {expected}, got {value!r}."

    def test_infinity(self):
        for value in [math.inf, np.float32("inf"), math.nan]:
            with pytest.raises(ValueError, match=r"^Expected x to be a finite number > 0, got "):
                check("x", value, Positive)
            with pytest.raises(ValueError, match=r"^Expected x to be a finite number >= 0, got "):
                check("x", value, NotNegative)


class TestChoice:
    def test_known_names(self):
        assert check_choice("move", "visit", {"visit": 1, "splice": 2}) is None

    def test_others_list_the_known_ones_nearest_first(self):
        for name in ["visti", 3, None, ["visit"]]:
            with pytest.raises(ParameterError, match=r"^Expected move among ") as error:
                check_choice("move", name, ["splice", "visit"])
            assert str(error.value).endswith(f", got {name!r}.")
            assert error.value.parameter == "move"
            assert name != "visti" or "among visit, splice" in str(error.value)


class TestWeights:
    def test_numbers_of_any_kind_become_float(self):
        weights = check_weights("moves", {"a": np.float64(2), "b": 0}, ["a", "b", "c"])
        assert weights == {"a": 2.0, "b": 0.0}
        assert {type(weight) for weight in weights.values()} == {float}
        assert check_weights("moves", {}, ["a"]) == {}

    def test_wrong_ones(self):
        for given, message in (
            ("a", "Expected moves to be a mapping, got 'a'."),
            ({"d": 1}, "Expected moves among a, b, got 'd'."),
            ({"a": -1}, "Expected moves['a'] >= 0, got -1."),
        ):
            with pytest.raises(ParameterError) as error:
                check_weights("moves", given, ["a", "b"])
            assert str(error.value) == message


class TestParameterError:
    def test_it_holds_the_name_as_data_also_in_another_process(self):
        with pytest.raises(ParameterError) as error:
            check("n_ants", 0, int, ge=1)
        assert error.value.parameter == "n_ants"
        copied = pickle.loads(pickle.dumps(error.value))
        assert (str(copied), copied.parameter) == ("Expected n_ants >= 1, got 0.", "n_ants")


class TestQuoted:
    def test_short_values_are_whole(self):
        for value in ["a" * 120, 3, None, 2.5, [1, "a"], {"a": 1}, (), np.int8(3)]:
            assert quoted(value) == repr(value)

    def test_long_and_deep_ones_are_shortened(self):
        for value in [
            "a" * 121,
            10**400,
            list(range(10**4)),
            {str(i): i for i in range(99)},
            [[[[1]]]],
        ]:
            assert "..." in quoted(value)
            assert len(quoted(value)) < 200


def test_known_parameters_are_listed_nearest_first():
    message = unknown_parameter("nods", iter(["seed", "radius", "nodes", "robots"]))
    assert message == "there is no parameter 'nods'; known are nodes, radius, robots, seed."


class TestNearestFirst:
    def test_the_most_alike_comes_first(self):
        names = ["toy", "terrain", "terrain_200", "power_plant"]
        assert nearest_first("terain", names) == ["terrain", "terrain_200", "power_plant", "toy"]
