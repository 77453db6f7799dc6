"""The table ``comparisons``: pairwise tests of algorithms on each mission, and verdicts."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from statsmodels.stats.multitest import multipletests

from botohe_moo._base.types import FloatArray
from botohe_moo._base.words import counted
from botohe_moo.study.judge.scores import as_table, merge_ties, samples_of, sign_of
from botohe_moo.study.judge.statistics import a12, a12_interval, mann_whitney, smallest_p

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
    """Return the table ``comparisons``: algorithms in pairs on each mission, by each indicator.

    Two-sided Mann-Whitney tests, corrected by Holm over the tests of a mission by an indicator,
    with the effect size A12, its interval, and a verdict in words. Differences up to 1e-12 count
    as ties. With a ``control``, all others are compared with it; without one, all pairs are
    compared. If one side has no run, as in a study that was interrupted, there is no row; if it has
    a single one, there is no test, and the pair does not count for Holm's correction.
    """
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
                labels=pair,
                values=(samples[pair[0]], samples[pair[1]]),
                lost=(lost.get((mission, pair[0]), 0), lost.get((mission, pair[1]), 0)),
                sign=sign,
            )
            for pair in pairs
            if samples.keys() >= set(pair)
        ]
        rows += [
            {"mission": mission, "indicator": indicator, **row}
            for row in compare_family(found, significance)
        ]
    return as_table("comparisons", rows)


@dataclass(frozen=True)
class Pair:
    """The runs of two algorithms on a mission, compared by an indicator."""

    labels: tuple[str, str]
    values: tuple[FloatArray, FloatArray]  # one for each run, at least one
    lost: tuple[int, int]  # runs without a front
    sign: int  # 1 where more is better, -1 where less is

    @cached_property
    def sides(self) -> tuple[FloatArray, FloatArray]:
        """Both samples, transformed so that more is better and ties are equal."""
        merged = self.sign * merge_ties(np.concatenate(self.values))
        return merged[: len(self.values[0])], merged[len(self.values[0]) :]

    @property
    def sizes(self) -> tuple[int, int]:
        """The number of runs of both."""
        return len(self.values[0]), len(self.values[1])

    @property
    def is_equal(self) -> bool:
        """Whether all runs have the same value."""
        return bool(np.ptp(np.concatenate(self.sides)) == 0)


def compare_family(pairs: Sequence[Pair], level: float) -> list[dict[str, Any]]:
    """Return the rows of a mission and an indicator, without these.

    Pairs of which both have at least two runs are tested, and their p-values corrected together.
    """
    tested = np.array([min(pair.sizes) >= 2 for pair in pairs], bool)
    p_values = np.array([mann_whitney(*pair.sides) for pair in pairs])
    # Holm's correction of a p-value grows with every other one: at best all are at their smallest.
    smallest = np.array([smallest_p(*pair.sizes) for pair in pairs])
    p_values[~tested] = smallest[~tested] = 1.0
    corrected = p_values.copy()
    for values in (corrected, smallest):
        values[tested] = multipletests(values[tested], method="holm")[1]
    return [
        _row(
            pair,
            p_value,
            p_holm,
            level=level,
            too_few=_too_few(pair, least, level, int(tested.sum())),
        )
        for pair, p_value, p_holm, least in zip(
            *(pairs, p_values.tolist(), corrected.tolist(), smallest.tolist()), strict=True
        )
    ]


def _too_few(pair: Pair, smallest_holm: float, level: float, n_tests: int) -> str:
    """Return why so few runs cannot show a difference; empty if they can."""
    sizes = "{} and {} runs".format(*pair.sizes)
    if min(pair.sizes) < 2:
        return f"too few runs to test: {sizes}"
    if smallest_holm < level or pair.is_equal:
        return ""
    return (
        f"{sizes} cannot reach {level:g} in {counted(n_tests, 'comparison')}: even if every run of "
        f"one were better than all of the other, p would be {smallest_holm:.2g}"
    )


def _row(
    pair: Pair, p_value: float, p_holm: float, *, level: float, too_few: str
) -> dict[str, Any]:
    effect = a12(*pair.sides)
    low, high = a12_interval(*pair.sides, confidence=1.0 - level)
    shown = f"A12 {effect:.2f} [{low:.2f}, {high:.2f}], {effect_size(effect)}"
    one, other = pair.labels
    if p_holm < level:
        word = "better" if effect > 0.5 else "worse"
        verdict = f"{one} is {word} than {other}: {shown}, {p_text(p_holm)}"
    elif too_few:
        verdict = f"{too_few}; {shown}"
    elif pair.is_equal:
        verdict = "equal: all runs have the same value"
    else:
        verdict = f"no difference found: {shown}, {p_text(p_holm)}"
    # How many runs have no front says more than a low value.
    lost = [
        f"{lost} of {n} runs of {label}"
        for lost, n, label in zip(pair.lost, pair.sizes, pair.labels, strict=True)
        if lost
    ]
    if lost:
        verdict += f"; without a front, and scored as bringing nothing back: {', '.join(lost)}"
    return {
        "algorithm": one,
        "other": other,
        "n": pair.sizes[0],
        "n_other": pair.sizes[1],
        "median": float(np.median(pair.values[0])),
        "median_other": float(np.median(pair.values[1])),
        "p_value": p_value,
        "p_holm": p_holm,
        "a12": effect,
        "a12_low": low,
        "a12_high": high,
        "significant": p_holm < level,
        "verdict": verdict,
    }


def effect_size(effect: float) -> str:
    """Return Vargha and Delaney's word for the size of an A12, whichever side is better.

    >>> effect_size(0.5), effect_size(0.44), effect_size(0.64), effect_size(0.0)
    ('negligible', 'small', 'medium', 'large')
    """
    distance = round(max(effect, 1.0 - effect), _DECIMALS)
    return next(word for least, word in _EFFECTS if distance >= least)


def p_text(value: float) -> str:
    """Return a p-value as text."""
    return "p < 0.0001" if value < 0.0001 else f"p {value:.2g}"
