"""What factories can be given, and what is wrong with what they are given."""

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Annotated, Any, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BeforeValidator, Field

from botohe_moo.base.messages import ParameterError
from botohe_moo.base.parameters import (
    Parameter,
    SameResult,
    accepted_parameters,
    call_factory,
    changes_nothing,
    checked,
    plain_value,
    raised_faults,
    takes_any_name,
    type_text,
)


def value_faults(name, value, hint):
    return Parameter(name, hint=hint).checked(value)[1]


def range_text(hint):
    return Parameter("x", hint=hint).range


def faults_of(factory, values):
    """What is wrong with the values that a factory is called with."""
    call = functools.partial(call_factory, "X", factory, accepted_parameters(factory))
    return raised_faults(lambda **given: call(given), values)


class Rope:
    """Nothing that a text can say."""


Positive = Annotated[float, Field(gt=0)]
Share = Annotated[float, Field(gt=0, lt=1)]
Few = Annotated[int, Field(ge=1, le=5)]


class TestValues:
    def test_right_ones(self):
        for hint, value in [
            (int, np.int64(3)),
            (int, 10**400),
            (float, 3),
            (bool, np.True_),
            (int | None, None),
            (float | Literal["bounds"], "bounds"),
            (Mapping[str, float], {"a": 1}),
            (Sequence[int], [1, 2]),
            (Rope | str, "rope"),
            (np.ndarray, np.zeros(2)),
            ("a name that leads nowhere", 3),
        ]:
            assert value_faults("x", value, hint) == []

    @pytest.mark.parametrize(
        ("hint", "value", "message"),
        [
            (int, "100", "Expected x to be an integer, got '100'."),
            (int, 1.0, "Expected x to be an integer, got 1.0."),
            (int | None, np.True_, "Expected x to be an integer, got True."),
            (bool, 1, "Expected x to be true or false, got 1."),
            (float | Literal["a"], "c", "Expected x to be a number or 'a', got 'c'."),
            (Share, "much", "Expected x to be a number in (0, 1), got 'much'."),
            (Few | None, 0, "Expected x in [1, 5], got 0."),
            (Positive | Literal["a"], -1, "Expected x > 0 or 'a', got -1."),
            (Annotated[int, Field(multiple_of=3)], 4, "Expected x to be a multiple of 3, got 4."),
            (
                Annotated[float, Field(allow_inf_nan=False)],
                float("inf"),
                "Expected x to be a finite number, got inf.",
            ),
            (Rope | str, 3, "Expected x to be an instance of Rope or a text, got 3."),
            (
                dict[str, list[int]],
                {"a": [1, "2"]},
                "Expected x['a'][1] to be an integer, got '2'.",
            ),
            (str | Mapping[str, float], {"a": "b"}, "Expected x['a'] to be a number, got 'b'."),
            (
                Annotated[str, Field(min_length=3)],
                "ab",
                "Expected x to have at least 3 characters, got 'ab'.",
            ),
        ],
    )
    def test_wrong_ones(self, hint, value, message):
        assert value_faults("x", value, hint) == [message]

    def test_validators_of_others(self):
        def refuse(value):
            raise value

        def check(value):
            return value_faults("x", value, Annotated[Any, BeforeValidator(refuse)])

        assert check(ValueError("Odd.")) == ["x: Odd."]
        with pytest.raises(KeyError, match="odd"):
            check(KeyError("odd"))

    @given(
        st.integers()
        | st.floats()
        | st.text()
        | st.booleans()
        | st.none()
        | st.lists(st.integers())
    )
    def test_types_are_told_apart_as_python_does(self, value):
        kind = type(value)
        assert (value_faults("x", value, int) == []) == (kind is int)
        assert (value_faults("x", value, bool) == []) == (kind is bool)
        assert (value_faults("x", value, str) == []) == (kind is str)
        assert (value_faults("x", value, list) == []) == (kind is list)
        assert (value_faults("x", value, float) == []) == (kind in (int, float))

    @given(st.integers(-20, 20), st.integers(-10, 10), st.integers(-10, 10))
    def test_ranges_hold_exactly(self, value, low, high):
        for bounds, inside in (
            ({"ge": low, "le": high}, low <= value <= high),
            ({"gt": low, "lt": high}, low < value < high),
        ):
            hint = Annotated[int, Field(**bounds)]
            expected = f"Expected x {Parameter('x', hint=hint).range}, got {value}."
            assert value_faults("x", value, hint) == ([] if inside else [expected])


class TestTypes:
    def test_ranges(self):
        for hint, text in [
            (int, ""),
            (Share, "in (0, 1)"),
            (Few | None, "in [1, 5]"),
            (Annotated[float, Field(ge=0.5, lt=1)], "in [0.5, 1)"),
            (Annotated[Few, Field(description="How many.")], "in [1, 5]"),
            (Annotated[int, "of no meaning here"], ""),
        ]:
            assert range_text(hint) == text

    def test_texts(self):
        for hint, text in [
            (Few, "int"),
            (Share | None, "float | None"),
            (Mapping[str, Positive] | str, "Mapping[str, float] | str"),
            (Literal["a", 1], "Literal['a', 1]"),
            (tuple[int, ...], "tuple[int, ...]"),
            (Callable[[int], str], "Callable[[int], str]"),
            (Any, "Any"),
            (Rope, "Rope"),
        ]:
            assert type_text(hint) == text

    def test_what_texts_can_say(self):
        for hint, plain in [
            (int, True),
            (Few | None, True),
            (Any, True),
            (Mapping[str, float], True),
            (Sequence[Few], True),
            (list, True),
            (Literal["a"], True),
            (Rope | str, True),
            (Rope, False),
            (Rope | None, False),
            (Iterable[Rope], False),
            (Mapping[str, Rope], False),
            (Callable[[int], float], False),
        ]:
            assert Parameter("x", hint=hint).plain is plain


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
        assert (n.default, n.annotation, n.range, n.description) == (
            2,
            "int",
            "in [1, 5]",
            "As usual.",
        )
        assert (share.required, share.annotation, share.range) == (True, "float", "in (0, 1)")
        assert (rope.plain, lost.plain, lost.hint) == (False, True, Any)
        assert takes_any_name(climb)
        assert accepted_parameters(climb, hidden={"n", "rope"}) == (share, lost)

    def test_of_what_is_wrapped(self):
        @functools.wraps(climb)
        def wrapper(**values):
            return climb(**values)

        for factory in (wrapper, functools.partial(climb, share=0.5)):
            assert accepted_parameters(factory)[0].range == "in [1, 5]"

    def test_only_what_a_factory_states_itself_is_its_own(self):
        found = {p.name: (p.default, p.own) for p in accepted_parameters(Wide.narrow)}
        assert found == {"a": (3, True), "b": (2, False)}
        assert all(p.own for p in accepted_parameters(Wide))


class TestCheckValues:
    def test_all_faults_at_once(self):
        faults = faults_of(climb, {"m": 1, "n": 6, "rope": 3})
        assert [name for name, _ in faults] == ["m", "n", "rope"]
        unknown, low, rope = (message for _, message in faults)
        assert unknown == "there is no parameter 'm'; known are lost, n, rope, share."
        assert low == "Expected n in [1, 5], got 6."
        assert rope == "Expected rope to be an instance of Rope, got 3."

    def test_other_names(self):
        [(blamed, _)] = faults_of(climb, {"share": 0.5, "m": 1})
        assert blamed == "m"  # whatever it would take
        assert faults_of(lambda: 0, {"m": 1}) == [
            ("m", "there is no parameter 'm'; known are none.")
        ]

    def test_a_default_is_always_in_order(self):
        def odd(*, n: int = None, m: Few = 0): ...  # noqa: RUF013

        assert faults_of(odd, {"n": None, "m": 0}) == []
        assert len(faults_of(odd, {"n": "", "m": 9})) == 2

    names = st.sampled_from(["n", "share", "rope", "lost", "m"])
    values = st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
        lambda inner: (
            st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3)
        ),
        max_leaves=5,
    )

    @given(st.dictionaries(names, values, max_size=5))
    def test_no_value_is_too_odd(self, values):
        faults = faults_of(climb, values)
        assert {name for name, _ in faults} <= {*values, None}  # Python names what is missing
        assert all(message for _, message in faults)


class TestChecked:
    @staticmethod
    @checked
    def swim(x=None, /, *, n: Few = 2, share: Share | Literal["all"] = 0.5, rope: "Rope" = None):
        """Swim."""
        return x, n, share, rope

    def test_defaults_and_what_is_positional_are_left_alone(self):
        assert self.swim() == (None, 2, 0.5, None)
        assert self.swim("n") == ("n", 2, 0.5, None)

    def test_numbers_of_all_kinds_become_pythons(self):
        _, n, share, _ = self.swim(n=np.int64(3), share=np.float32(0.5))
        assert (n, share, type(n), type(share)) == (3, 0.5, int, float)
        assert self.swim(share="all")[2] == "all"

    def test_what_is_wrong_is_said(self):
        with pytest.raises(ParameterError) as error:
            self.swim(share=1, n=2)
        assert str(error.value) == "Expected share in (0, 1) or 'all', got 1."
        assert error.value.parameter == "share"


class TestCall:
    def test_values_are_handed_over_as_they_are(self):
        accepted = accepted_parameters(climb)
        rope, share = Rope(), np.float64(0.5)
        made = call_factory("X", climb, accepted, {"share": share, "rope": rope})
        assert made == (2, 0.5, rope, 3, {})
        assert made[1] is share

    def test_all_that_is_wrong_is_said(self):
        with pytest.raises(ParameterError) as caught:
            call_factory("X", climb, accepted_parameters(climb), {"m": 1, "n": 9, "share": 2})
        assert str(caught.value) == (
            "X: there is no parameter 'm'; known are lost, n, rope, share. "
            "Expected n in [1, 5], got 9. Expected share in (0, 1), got 2."
        )
        assert caught.value.parameter == "m"

    def test_who_knows_the_range_is_heard(self):
        called = []

        def dive(*, depth: int, breath: float = 1.0):
            if depth == 31:
                raise ValueError("Expected depth in [1, 30], got 31.")
            if breath < 0:
                raise KeyError("breath")
            called.append(depth)

        def call(**values):
            return call_factory("X", dive, accepted_parameters(dive), values)

        with pytest.raises(ParameterError, match=r"^X: Expected depth in \[1, 30\], got 31\.$"):
            call(depth=31)
        with pytest.raises(ValueError, match=r"^X: Expected depth to be an integer, got 'deep'\.$"):
            call(depth="deep")
        with pytest.raises(ValueError, match=r"^X: Expected depth to be an integer, got '3'\.$"):
            call(depth="3")
        with pytest.raises(ValueError, match=r"^X: Expected depth to be an integer, got '3'\.$"):
            call(depth="3", breath=0)
        with pytest.raises(KeyError, match="breath"):
            call(depth=3, breath=-1)
        assert called == []
        call(depth=3)
        assert called == [3]

    def test_what_was_raised(self):
        def fault(error):
            def fall(*, n=1, share=2):
                raise error

            [found] = faults_of(fall, {"n": 1, "share": 2})
            return found

        assert fault(ParameterError("X: A small share.", "share")) == ("share", "A small share.")
        assert fault(ValueError("X: Expected n >= 1, got 0.")) == (None, "Expected n >= 1, got 0.")
        assert fault(ValueError("")) == (None, "")


class TestResults:
    def test_parameters_that_change_no_result_are_marked(self):
        def search(
            *,
            n: int = 1,
            a: Annotated[int, SameResult()] = 1,
            b: Annotated[int, Field(ge=1), SameResult] = 1,
            c: Annotated[int, SameResult()] | None = None,
            d: "Annotated[int, SameResult()]" = 1,
            e: "Annotated[int, NowhereToBeFound()]" = 1,  # noqa: F821
        ): ...

        found = {p.name: changes_nothing(p.hint) for p in accepted_parameters(search)}
        assert found == {"n": False, "a": True, "b": True, "c": True, "d": True, "e": False}
        assert accepted_parameters(search)[2].range == ">= 1"
        assert faults_of(search, {"a": 3, "b": 2, "c": None}) == []

    def test_plain_values(self):
        for value, plain in [
            (None, None),
            (np.float64(0.5), 0.5),
            (np.True_, True),
            (((1, "reef"), ()), [[1, "reef"], []]),
            ({"a": (1,)}, {"a": [1]}),
            (Rope(), NotImplemented),
            ([Rope()], NotImplemented),
            ({"a": {1}}, NotImplemented),
            (1j, NotImplemented),
        ]:
            found = plain_value(value)
            assert found == plain
            assert type(found) is type(plain)
