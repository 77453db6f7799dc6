"""The table ``comparisons``: pairwise tests of algorithms on each mission, and verdicts."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from botohe_moo._base.checks import check_number, nearest_first
from botohe_moo._base.types import FloatArray
from botohe_moo.study.judge.scores import as_table, merge_ties, samples_of, sign_of
from botohe_moo.study.judge.statistics import a12, a12_interval, holm, mann_whitney, smallest_p

_DECIMALS = 12  # to which an effect is rounded: it is computed, and 0.56 may be 0.5599999
_EFFECTS = ((0.71, "large"), (0.64, "medium"), (0.56, "small"), (0.0, "negligible"))


def compare_algorithms(
    indicators: pd.DataFrame,
    *,
    runs: pd.DataFrame,
    algorithms: Sequence[str],
    control: str | None,
    significance: float,
) -> pd.DataFrame:
    """Make the table ``comparisons``: algorithms in pairs on each mission, by each indicator.

    Two-sided Mann-Whitney tests, corrected by Holm over the tests of a mission by an indicator,
    with the effect size A12, its interval, and a verdict in words. Differences up to 1e-12 count
    as ties. With a ``control``, all others are compared with it; without one, all pairs are
    compared. If one side has no run, as in a study that was interrupted, there is no row; if it has
    a single one, there is no test, and the pair does not count for Holm's correction.
    """
    level = check_number("significance", significance, above=0.0, below=1.0)
    if control is not None and control not in algorithms:
        known = ", ".join(nearest_first(control, algorithms))
        raise ValueError(f"Expected control among {known}, got {control!r}.")
    if control is None:
        pairs = list(combinations(algorithms, 2))
    else:
        pairs = [(label, control) for label in algorithms if label != control]
    without_front = runs.loc[runs["front_size"] == 0, ["mission", "algorithm"]].value_counts()
    lost: dict[Any, int] = without_front.to_dict()
    rows: list[dict[str, Any]] = []
    for (mission, indicator), samples in samples_of(indicators).items():
        sign = sign_of(indicator)
        if not sign:
            continue
        found = [
            Pair(
                algorithm=one,
                other=other,
                values=samples[one],
                other_values=samples[other],
                sign=sign,
                level=level,
                lost=lost.get((mission, one), 0),
                other_lost=lost.get((mission, other), 0),
            )
            for one, other in pairs
            if one in samples and other in samples
        ]
        rows += [
            {"mission": mission, "indicator": indicator, **row} for row in compare_family(found)
        ]
    return as_table("comparisons", rows)


@dataclass(frozen=True, kw_only=True)
class Pair:
    """The runs of two algorithms on a mission, compared by an indicator."""

    algorithm: str
    other: str
    values: FloatArray  # of the indicator, one for each run, at least one
    other_values: FloatArray
    sign: int  # 1 where more is better, -1 where less is
    level: float  # of significance
    lost: int  # runs without a front
    other_lost: int

    @cached_property
    def sides(self) -> tuple[FloatArray, FloatArray]:
        """Both samples, transformed so that more is better and ties are equal."""
        merged = self.sign * merge_ties(np.concatenate([self.values, self.other_values]))
        return merged[: len(self.values)], merged[len(self.values) :]

    @property
    def is_tested(self) -> bool:
        """Whether both have at least two runs, without which there is no spread."""
        return min(len(self.values), len(self.other_values)) >= 2

    @cached_property
    def p_value(self) -> float:
        """The p-value of the Mann-Whitney test; 1 where there is no test."""
        return mann_whitney(*self.sides) if self.is_tested else 1.0

    def row(self, p_holm: float, smallest_holm: float, n_tests: int) -> dict[str, Any]:
        """Give the row of the table ``comparisons``, without mission and indicator.

        ``p_holm`` is corrected for ``n_tests``; ``smallest_holm`` is the least that it can be.
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
        """Say why so few runs cannot show a difference; empty if they can."""
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
        """Say how many runs have no front, which says more than a low value."""
        sides = (
            (self.algorithm, self.lost, len(self.values)),
            (self.other, self.other_lost, len(self.other_values)),
        )
        counted = [f"{lost} of {n} runs of {label}" for label, lost, n in sides if lost]
        if not counted:
            return ""
        return f"; without a front, and scored as bringing nothing back: {', '.join(counted)}"


def compare_family(pairs: Sequence[Pair]) -> list[dict[str, Any]]:
    """Give the rows of a mission and an indicator; pairs that are tested are corrected together."""
    tested = [pair for pair in pairs if pair.is_tested]
    corrected = iter(holm([pair.p_value for pair in tested]).tolist())
    # Holm's correction of a p-value grows with every other one: at best all are at their smallest.
    sizes = ((len(pair.values), len(pair.other_values)) for pair in tested)
    smallest = iter(holm([smallest_p(n, m) for n, m in sizes]).tolist())
    return [
        pair.row(next(corrected), next(smallest), len(tested))
        if pair.is_tested
        else pair.row(1.0, 1.0, len(tested))
        for pair in pairs
    ]


def effect_size(effect: float) -> str:
    """Give Vargha and Delaney's word for the size of an A12, whichever side is better.

    >>> effect_size(0.5), effect_size(0.44), effect_size(0.64), effect_size(0.0)
    ('negligible', 'small', 'medium', 'large')
    """
    distance = round(max(effect, 1.0 - effect), _DECIMALS)
    return next(word for least, word in _EFFECTS if distance >= least)


def p_text(value: float) -> str:
    """Give a p-value as text."""
    return "p < 0.0001" if value < 0.0001 else f"p {value:.2g}"
