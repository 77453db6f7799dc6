"""The table ``comparisons``: pairwise tests of algorithms on each mission, and verdicts."""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

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
    n_lost: dict[Any, int] = without_front.to_dict()
    rows: list[dict[str, Any]] = []
    for (mission, indicator), samples in samples_of(indicators).items():
        sign = sign_of(indicator)
        known = [pair for pair in pairs if sign and samples.keys() >= set(pair)]
        sides = {pair: _sides(samples[pair[0]], samples[pair[1]], sign) for pair in known}
        for (one, other), found in _compared(sides, significance).items():
            lost = [
                f"{n} of {len(samples[label])} runs of {label}"
                for label in (one, other)
                if (n := n_lost.get((mission, label)))
            ]
            if lost:  # which says more than a low value
                ending = "; without a front, and scored as bringing nothing back: "
                found["verdict"] += ending + ", ".join(lost)
            rows.append(
                {
                    "mission": mission,
                    "indicator": indicator,
                    "algorithm": one,
                    "other": other,
                    "n": len(samples[one]),
                    "n_other": len(samples[other]),
                    "median": float(np.median(samples[one])),
                    "median_other": float(np.median(samples[other])),
                    **found,
                }
            )
    return as_table("comparisons", rows)


def _sides(values: FloatArray, others: FloatArray, sign: int) -> tuple[FloatArray, FloatArray]:
    """Return both samples, transformed so that more is better and ties are equal."""
    merged = sign * merge_ties(np.concatenate([values, others]))
    return merged[: len(values)], merged[len(values) :]


def _compared(
    sides: Mapping[tuple[str, str], tuple[FloatArray, FloatArray]], level: float
) -> dict[tuple[str, str], dict[str, Any]]:
    """Return the outcome for each pair; pairs that are tested are corrected together."""
    tested = [pair for pair, both in sides.items() if min(map(len, both)) >= 2]
    p_values = {pair: mann_whitney(*sides[pair]) for pair in tested}
    corrected = _holm(p_values)
    # Holm's correction of a p-value grows with every other one: at best all are at their smallest.
    smallest = _holm({pair: smallest_p(*map(len, sides[pair])) for pair in tested})
    rows = {}
    for pair, (x, y) in sides.items():
        effect, p_holm = a12(x, y), corrected.get(pair, 1.0)
        low, high = a12_interval(x, y, confidence=1.0 - level)
        shown = f"A12 {effect:.2f} [{low:.2f}, {high:.2f}], {effect_size(effect)}"
        sizes = f"{len(x)} and {len(y)} runs"
        if p_holm < level:
            word = "better" if effect > 0.5 else "worse"
            verdict = f"{pair[0]} is {word} than {pair[1]}: {shown}, {p_text(p_holm)}"
        elif pair not in p_values:
            verdict = f"too few runs to test: {sizes}; {shown}"
        elif np.ptp(np.concatenate([x, y])) == 0:
            verdict = "equal: all runs have the same value"
        elif smallest[pair] >= level:
            verdict = (
                f"{sizes} cannot reach {level:g} in {counted(len(tested), 'comparison')}: even if "
                "every run of one were better than all of the other, p would be "
                f"{smallest[pair]:.2g}; {shown}"
            )
        else:
            verdict = f"no difference found: {shown}, {p_text(p_holm)}"
        rows[pair] = {
            "p_value": p_values.get(pair, 1.0),
            "p_holm": p_holm,
            "a12": effect,
            "a12_low": low,
            "a12_high": high,
            "significant": p_holm < level,
            "verdict": verdict,
        }
    return rows


def _holm(p_values: Mapping[tuple[str, str], float]) -> dict[tuple[str, str], float]:
    """Correct p-values for the number of tests, by Holm.

    The smallest of n is multiplied by n, the next by n - 1 and so on; none becomes smaller than one
    before it. (statsmodels' function collects garbage at each call, which takes as long as all else
    that comparisons do.)

    Holm, "A simple sequentially rejective multiple test procedure", Scandinavian Journal of
    Statistics 6(2), 1979.
    """
    ascending = sorted(p_values, key=lambda pair: p_values[pair])
    corrected, largest = {}, 0.0
    for i, pair in enumerate(ascending):
        largest = max(largest, min(1.0, p_values[pair] * (len(ascending) - i)))
        corrected[pair] = largest
    return corrected


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
