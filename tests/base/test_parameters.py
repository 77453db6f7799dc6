"""What factories can be given, how values are checked, and what is said of wrong ones."""

import functools
import math
import pickle
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, BeforeValidator, Field

from botohe_moo.base import parameters
from botohe_moo.base.messages import (
    FaultsError,
    ParameterError,
    check_choice,
    nearest_first,
    quoted,
    unknown_parameter,
)
from botohe_moo.base.parameters import (
    Parameter,
    SameResult,
    accepted_parameters,
    call_factory,
    changes_nothing,
    check_weights,
    checked,
    plain_value,
    raised_faults,
    takes_any_name,
    type_text,
    validated,
)


def value_faults(value, hint):
    return Parameter("x", hint=hint).checked(value)[1]


def faults_of(factory, values):
    """What is wrong with the values that a factory is called with."""
    call = functools.partial(call_factory, "X", factory, accepted_parameters(factory))
    return raised_faults(lambda **given: call(given), values)


class Rope:
    """Nothing that a text can say."""


Positive = Annotated[float, Field(gt=0)]
Share = Annotated[float, Field(gt=0, lt=1)]
Few = Annotated[int, Field(ge=1, le=5)]
Long = Annotated[str, Field(min_length=3)]


class TestValues:
    def test_right_ones_arrive_as_pythons_types(self):
        for hint, value, expected in [
            (int, np.int64(3), 3),
            (int, 10**400, 10**400),
            (float, np.float32(0.5), 0.5),
            (bool, np.True_, True),
            (int | None, None, None),
            (float | Literal["bounds"], "bounds", "bounds"),
            (Mapping[str, float], {"a": 1}, {"a": 1.0}),
            (Rope | str, "rope", "rope"),
            ("a name that leads nowhere", 3, 3),
        ]:
            found, faults = Parameter("x", hint=hint).checked(value)
            assert (found, type(found), faults) == (expected, type(expected), [])

    @pytest.mark.parametrize(
        ("hint", "value", "message"),
        [
            (int, "100", "Expected x to be an integer, got '100'."),
            (int | None, np.True_, "Expected x to be an integer, got True."),
            (bool, 1, "Expected x to be true or false, got 1."),
            (float | Literal["a"], "c", "Expected x to be a number or 'a', got 'c'."),
            (Share, "much", "Expected x to be a number in (0, 1), got 'much'."),
            (Few | None, 0, "Expected x in [1, 5], got 0."),
            (Positive | Literal["a"], -1, "Expected x > 0 or 'a', got -1."),
            (parameters.Positive, math.inf, "Expected x to be a finite number > 0, got inf."),
            (Annotated[int, Field(multiple_of=3)], 4, "Expected x to be a multiple of 3, got 4."),
            (Rope | str, 3, "Expected x to be an instance of Rope or a text, got 3."),
            (dict[str, list[int]], {"a": ["2"]}, "Expected x['a'][0] to be an integer, got '2'."),
            (Long, "ab", "Expected x to have at least 3 characters, got 'ab'."),
        ],
    )
    def test_wrong_ones(self, hint, value, message):
        assert value_faults(value, hint) == [message]

    def test_validators_of_others(self):
        def refuse(value):
            raise value

        hint = Annotated[Any, BeforeValidator(refuse)]
        assert value_faults(ValueError("Odd."), hint) == ["x: Odd."]
        with pytest.raises(KeyError, match="odd"):
            value_faults(KeyError("odd"), hint)


class TestNames:
    def test_unknown_ones_list_the_known_ones_nearest_first(self):
        assert check_choice("move", "visit", {"visit": 1, "splice": 2}) is None
        for name in ["visti", 3, None, ["visit"]]:
            with pytest.raises(ParameterError, match=r"^Expected move among ") as error:
                check_choice("move", name, ["splice", "visit"])
            assert str(error.value).endswith(f", got {name!r}.")
            assert error.value.parameter == "move"
            assert name != "visti" or "among visit, splice" in str(error.value)
        names = ["toy", "terrain", "terrain_200", "power_plant"]
        assert nearest_first("terain", names) == ["terrain", "terrain_200", "power_plant", "toy"]
        message = unknown_parameter("nods", iter(["seed", "radius", "nodes", "robots"]))
        assert message == "there is no parameter 'nods'; known are nodes, radius, robots, seed."

    def test_weights(self):
        weights = check_weights("moves", {"a": np.float64(2), "b": 0}, ["a", "b", "c"])
        assert weights == {"a": 2.0, "b": 0.0}
        assert {type(weight) for weight in weights.values()} == {float}
        for weights, needed, message in (
            ("a", "", "Expected moves to be a mapping, got 'a'."),
            ({"d": 1}, "", "Expected moves among a, b, got 'd'."),
            ({"a": -1}, "", "Expected moves['a'] >= 0, got -1."),
            ({"a": 0}, "move", "Expected a move of weight above 0, got {'a': 0}."),
        ):
            with pytest.raises(ParameterError) as error:
                check_weights("moves", weights, ["a", "b"], needed=needed)
            assert str(error.value) == message

    def test_a_hundred_faults_are_listed(self):
        for n, more in ((2, []), (100, []), (103, ["and 3 more"])):
            error = pickle.loads(pickle.dumps(FaultsError(map(str, range(n)), "site.json")))
            shown = [f"site.json has {n} faults:", *map(str, range(min(n, 100))), *more]
            assert (error.faults, str(error)) == (tuple(map(str, range(n))), "\n  - ".join(shown))
        assert str(FaultsError(["alone"], "site.json")) == "site.json: alone"

    def test_short_values_are_quoted_whole_and_long_ones_are_not(self):
        for value in ["a" * 120, 3, None, 2.5, [1, "a"], {"a": 1}, (), np.int8(3)]:
            assert quoted(value) == repr(value)
        many = {str(i): i for i in range(99)}
        for value in ["a" * 121, 10**400, list(range(10**4)), many, [[[[1]]]]]:
            assert "..." in quoted(value)
            assert len(quoted(value)) < 200


@pytest.mark.parametrize(
    ("hint", "text", "range_", "is_plain"),
    [
        (int, "int", "", True),
        (Few | None, "int | None", "in [1, 5]", True),
        (Share | None, "float | None", "in (0, 1)", True),
        (Annotated[Few, Field(description="How many.")], "int", "in [1, 5]", True),
        (Mapping[str, Positive] | str, "Mapping[str, float] | str", "", True),
        (Sequence[Few], "Sequence[int]", "", True),
        (Rope | None, "Rope | None", "", False),
        (Mapping[str, Rope], "Mapping[str, Rope]", "", False),
        (Callable[[int], str], "Callable[[int], str]", "", False),
    ],
)
def test_types_as_texts(hint, text, range_, is_plain):
    """How a type is written, its range, and whether a text can say its values."""
    found = Parameter("x", hint=hint)
    assert (type_text(hint), found.range, found.plain) == (text, range_, is_plain)


class Zone(BaseModel, strict=True, extra="forbid"):
    rate: Positive


class Site(BaseModel, strict=True, extra="forbid"):
    name: str
    zones: list[Zone] = []


def test_all_faults_of_a_file_are_named_with_their_place():
    assert validated(b'{"name": "pier"}', Site).name == "pier"
    content = {"zones": [{"rate": -1}, {"rat": 2}]}
    for line, places in ((None, ("", "zones.0: ")), (len, ("line 1: ", "line 3: "))):
        with pytest.raises(FaultsError, match=r"^site\.yaml has 4 faults") as error:
            validated(content, Site, line, "site.yaml")
        first, negative, *_, last = error.value.faults
        assert first == f"{places[0]}expected the key 'name', which is missing"
        assert negative == f"{places[1]}expected rate > 0, got -1"
        assert last.endswith("there is no key 'rat'")


def climb(*, n: Few = 2, share: "Share", rope: "Rope | None" = None, lost: "Nowhere" = 3, **rest):  # noqa: F821
    """Climb.

    Parameters
    ----------
    n, share
        As usual.
    """
    return n, share, rope, lost, rest


class Wide:
    def __init__(self, *, a=1, b=2): ...

    @classmethod
    def narrow(cls, *, a=3, **others):
        return cls(a=a, **others)


class TestAccepted:
    def test_of_a_signature(self):
        n, share, rope, lost = accepted_parameters(climb)
        stated = n.default, n.annotation, n.range, n.description
        assert stated == (2, "int", "in [1, 5]", "As usual.")
        assert (share.required, rope.plain, lost.plain, lost.hint) == (True, False, True, Any)
        assert takes_any_name(climb)
        wrapped = functools.wraps(climb)(lambda **values: climb(**values))
        for factory in (wrapped, functools.partial(climb, share=0.5)):
            assert accepted_parameters(factory)[0].range == "in [1, 5]"
        assert accepted_parameters(climb, hidden={"n", "rope"}) == (share, lost)

    def test_only_what_a_factory_states_itself_is_its_own(self):
        found = {p.name: (p.default, p.own) for p in accepted_parameters(Wide.narrow)}
        assert found == {"a": (3, True), "b": (2, False)}
        assert all(p.own for p in accepted_parameters(Wide))

    def test_those_that_change_no_result_are_marked(self):
        def search(
            *,
            n: int = 1,
            a: Annotated[int, SameResult()] = 1,
            b: Annotated[int, Field(ge=1), SameResult] = 1,
            c: Annotated[int, SameResult()] | None = None,
            e: "Annotated[int, NowhereToBeFound()]" = 1,  # noqa: F821
        ): ...

        found = {p.name: changes_nothing(p.hint) for p in accepted_parameters(search)}
        assert found == {"n": False, "a": True, "b": True, "c": True, "e": False}
        assert accepted_parameters(search)[2].range == ">= 1"
        assert faults_of(search, {"a": 3, "b": 2, "c": None}) == []


class TestCall:
    def test_values_are_handed_over_as_they_are(self):
        rope, share = Rope(), np.float64(0.5)
        accepted = accepted_parameters(climb)
        made = call_factory("X", climb, accepted, {"share": share, "rope": rope})
        assert made == (2, 0.5, rope, 3, {})
        assert made[1] is share

    def test_all_that_is_wrong_is_said_at_once(self):
        said = [
            ("m", "there is no parameter 'm'; known are lost, n, rope, share."),
            ("n", "Expected n in [1, 5], got 6."),
            ("rope", "Expected rope to be an instance of Rope, got 3."),
        ]
        given = {"m": 1, "n": 6, "rope": 3}
        assert faults_of(climb, given) == said
        with pytest.raises(ParameterError) as caught:
            call_factory("X", climb, accepted_parameters(climb), given)
        error = pickle.loads(pickle.dumps(caught.value))  # the name is data
        assert str(error) == "X: " + " ".join(each for _, each in said)
        assert (error.parameter, error.faults) == ("m", tuple(said))
        nothing = [("m", "there is no parameter 'm'; known are none.")]
        assert faults_of(lambda: 0, {"m": 1}) == nothing

    def test_a_default_is_always_in_order(self):
        def odd(*, n: int = None, m: Few = 0): ...  # noqa: RUF013

        assert faults_of(odd, {"n": None, "m": 0}) == []
        assert len(faults_of(odd, {"n": "", "m": 9})) == 2

    scalars = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)
    values = scalars | st.lists(scalars) | st.dictionaries(st.text(), scalars)

    @given(st.dictionaries(st.sampled_from(["n", "share", "rope", "lost", "m"]), values))
    def test_no_value_is_too_odd(self, values):
        faults = faults_of(climb, values)
        assert {name for name, _ in faults} <= {*values, None}  # Python names what is missing
        assert all(message for _, message in faults)

    def test_what_a_factory_raises_is_translated_where_it_is_of_values(self):
        for error, expected in (
            (ParameterError("X: A small share.", "share"), ("share", "A small share.")),
            (ValueError("X: Expected n >= 1, got 0."), (None, "Expected n >= 1, got 0.")),
            (ValueError(""), (None, "")),
            (KeyError("n"), (None, "KeyError: 'n'")),
        ):

            def fall(*, n=1, error=error):
                raise error

            assert faults_of(fall, {"n": 1}) == [expected]


@checked
def swim(x=None, /, *, n: Few = 2, share: Share | Literal["all"] = 0.5, rope: "Rope" = None):
    """Swim."""
    return x, n, share, rope


def test_what_is_given_by_keyword_to_a_checked_function_is_checked():
    assert swim("n") == ("n", 2, 0.5, None)
    _, n, share, _ = swim(n=np.int64(3), share=np.float32(0.5))
    assert (n, share, type(n), type(share)) == (3, 0.5, int, float)
    assert swim(share="all")[2] == "all"
    with pytest.raises(ParameterError) as error:
        swim(share=1, n=2)
    expected = "Expected share in (0, 1) or 'all', got 1."
    assert (str(error.value), error.value.parameter) == (expected, "share")


def test_plain_values():
    for value, plain in [
        (None, None),
        (np.float64(0.5), 0.5),
        (np.True_, True),
        (((1, "reef"), ()), [[1, "reef"], []]),
        ({"a": (1,)}, {"a": [1]}),
        ([Rope()], NotImplemented),
        ({"a": {1}}, NotImplemented),
        (1j, NotImplemented),
    ]:
        found = plain_value(value)
        assert found == plain
        assert type(found) is type(plain)
