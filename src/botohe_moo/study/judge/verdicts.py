"""Comparisons of two algorithms on a mission, and what they say in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from botohe_moo._base.types import FloatArray
from botohe_moo.study.judge.pairs import a12, a12_interval, holm, mann_whitney, smallest_p
from botohe_moo.study.judge.ties import merge_ties

__all__ = ["Pair", "compare_family", "effect_size", "p_text"]

_DECIMALS = 12  # of an effect: 0.56 is a share of pairs, and computed
_EFFECTS = ((0.71, "large"), (0.64, "medium"), (0.56, "small"), (0.0, "negligible"))


@dataclass(frozen=True, kw_only=True)
class Pair:
    """The runs of two algorithms on a mission, judged by an indicator.

    Attributes
    ----------
    algorithm, other
        Labels of the two.
    values, other_values
        The indicator of their runs, at least one each.
    sign
        1 where more is better, -1 where less is.
    level
        Significance level.
    lost, other_lost
        How many of the runs have no front.
    """

    algorithm: str
    other: str
    values: FloatArray
    other_values: FloatArray
    sign: int
    level: float
    lost: int
    other_lost: int

    @cached_property
    def sides(self) -> tuple[FloatArray, FloatArray]:
        """Both samples, so that more is better and ties are equal."""
        merged = self.sign * merge_ties(np.concatenate([self.values, self.other_values]))
        return merged[: len(self.values)], merged[len(self.values) :]

    @property
    def is_tested(self) -> bool:
        """Whether both have the two runs without which there is no spread to speak of."""
        return min(len(self.values), len(self.other_values)) >= 2

    @cached_property
    def p_value(self) -> float:
        """That of the Mann-Whitney test; 1 where there is none."""
        return mann_whitney(*self.sides) if self.is_tested else 1.0

    @property
    def smallest_p(self) -> float:
        """What so many runs can reach at best."""
        return smallest_p(len(self.values), len(self.other_values))

    def row(self, p_holm: float, smallest_holm: float, n_tests: int) -> dict[str, Any]:
        """Give the row of the table ``comparisons``, without mission and indicator.

        Parameters
        ----------
        p_holm
            The corrected p-value.
        smallest_holm
            What it could be at best.
        n_tests
            Tests that it is corrected for.
        """
        effect = a12(*self.sides)
        low, high = a12_interval(*self.sides, confidence=1.0 - self.level)
        shown = f"A12 {effect:.2f} [{low:.2f}, {high:.2f}], {effect_size(effect)}"
        if p_holm < self.level:
            word = "better" if effect > 0.5 else "worse"
            verdict = f"{self.algorithm} is {word} than {self.other}: {shown}, {p_text(p_holm)}"
        elif reason := self._no_test(smallest_holm, n_tests):
            verdict = f"{reason}; {shown}"
        elif np.ptp(np.concatenate(self.sides)) == 0:
            verdict = "equal: all runs have the same value"
        else:
            verdict = f"no difference found: {shown}, {p_text(p_holm)}"
        return {
            "algorithm": self.algorithm,
            "other": self.other,
            "n": len(self.values),
            "n_other": len(self.other_values),
            "median": float(np.median(self.values)),
            "median_other": float(np.median(self.other_values)),
            "p_value": self.p_value,
            "p_holm": p_holm,
            "a12": effect,
            "a12_low": low,
            "a12_high": high,
            "significant": p_holm < self.level,
            "verdict": verdict + self._losses(),
        }

    def _no_test(self, smallest_holm: float, n_tests: int) -> str:
        """Say why so few runs cannot show a difference; empty where they could."""
        sizes = f"{len(self.values)} and {len(self.other_values)} runs"
        if not self.is_tested:
            return f"too few runs to test: {sizes}"
        if smallest_holm < self.level or np.ptp(np.concatenate(self.sides)) == 0:
            return ""
        among = "1 comparison" if n_tests == 1 else f"{n_tests} comparisons"
        return (
            f"{sizes} cannot reach {self.level:g} in {among}: even if every run of one were better "
            f"than all of the other, p would be {smallest_holm:.2g}"
        )

    def _losses(self) -> str:
        """Say how many runs brought no front, which is more than a low value."""
        sides = (
            (self.algorithm, self.lost, len(self.values)),
            (self.other, self.other_lost, len(self.other_values)),
        )
        counted = [f"{lost} of {n} runs of {label}" for label, lost, n in sides if lost]
        if not counted:
            return ""
        return f"; without a front, and scored as bringing nothing back: {', '.join(counted)}"


def compare_family(pairs: Sequence[Pair]) -> list[dict[str, Any]]:
    """Give the comparisons of a mission by an indicator, corrected together.

    Parameters
    ----------
    pairs
        Those to compare; those with too few runs for a test do not count for the correction.
    """
    tested = [pair for pair in pairs if pair.is_tested]
    corrected = iter(holm([pair.p_value for pair in tested]).tolist())
    # Holm's correction of a p-value grows with every other one: at best all are at their smallest.
    smallest = iter(holm([pair.smallest_p for pair in tested]).tolist())
    return [
        pair.row(next(corrected), next(smallest), len(tested))
        if pair.is_tested
        else pair.row(1.0, 1.0, len(tested))
        for pair in pairs
    ]


def effect_size(effect: float) -> str:
    """Give the word of Vargha and Delaney for an A12, whichever side is better.

    Parameters
    ----------
    effect
        A12, in [0, 1].

    Examples
    --------
    >>> effect_size(0.5), effect_size(0.44), effect_size(0.64), effect_size(0.0)
    ('negligible', 'small', 'medium', 'large')
    """
    distance = round(max(effect, 1.0 - effect), _DECIMALS)
    return next(word for least, word in _EFFECTS if distance >= least)


def p_text(value: float) -> str:
    """Give a p-value as text."""
    return "p < 0.0001" if value < 0.0001 else f"p {value:.2g}"
