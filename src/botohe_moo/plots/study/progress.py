"""The progress of runs: medians and bands over a common grid."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import pandas as pd

from botohe_moo._base.checks import check_integer
from botohe_moo._base.types import FloatArray
from botohe_moo.plots.draw.algorithms import chosen_algorithms

Progress = Literal["evaluations", "seconds"]
Value = Literal["area", "igd_plus", "epsilon"]
Band = Literal["quartiles", "sd", "range"]

NAMES = {"evaluations": "evaluations", "seconds": "seconds of the algorithm's own time"}

_N_POINTS = 400


@dataclass(frozen=True, eq=False)
class Curve:
    """The progress of the runs of one algorithm on one mission."""

    x: FloatArray  # evaluations or seconds, ascending; each value holds until the next
    middle: FloatArray  # median over runs, or mean if the band is of standard deviations
    low: FloatArray  # edges of the band
    high: FloatArray
    n_runs: int
    ended: float  # where the last record of any run is; later values are held


def progress_curves(
    trace: pd.DataFrame,
    *,
    x: Progress = "evaluations",
    value: Value = "area",
    algorithms: Sequence[str] | None = None,
    band: Band = "quartiles",
    n_points: int = _N_POINTS,
) -> dict[str, Curve]:
    """Give the curves that ``plot_curves`` draws, on a logarithmic grid.

    The grid spans the records of all algorithms. An algorithm's curve begins where all of its runs
    have a record, and ends where the grid does. Algorithms without a value are left out. Options
    and errors are those of ``plot_curves``.
    """
    for name, given, kind in (("x", x, Progress), ("value", value, Value), ("band", band, Band)):
        if given not in get_args(kind):
            raise ValueError(f"Expected {name} to be {' or '.join(get_args(kind))}, got {given!r}.")
    check_integer("n_points", n_points, at_least=2)
    labels = chosen_algorithms("trace", trace, ("algorithm", "seed", x, value), algorithms)
    runs = records_of(trace, x, value, labels)
    if not runs:
        raise ValueError("Expected at least one row of trace, got none.")
    everything = np.concatenate([run[:, 0] for found in runs.values() for run in found])
    low, high = everything.min(), everything.max()
    # Rounding could put the ends beside the records there.
    grid = np.unique(np.clip(np.geomspace(low, high, n_points), low, high))
    return {label: _curve(found, grid, band) for label, found in runs.items()}


def records_of(
    trace: pd.DataFrame, x: Progress, value: Value, labels: Sequence[str]
) -> dict[str, list[FloatArray]]:
    """Give the records of every run, pairs of x and value, for each label that has any, by seed."""
    number = {label: i for i, label in enumerate(labels)}
    owner = trace["algorithm"].map(number).to_numpy(float, na_value=np.nan)
    values = trace[value].to_numpy(float, na_value=np.nan)
    rows = np.flatnonzero(~np.isnan(owner) & ~np.isnan(values))
    at = trace[x].to_numpy(float, na_value=np.nan)[rows]
    if not (np.isfinite(at).all() and (at >= 0).all()):
        raise ValueError(f"Expected {x} in [0, inf), got {at[~(np.isfinite(at) & (at >= 0))][0]}.")
    if not len(at):
        return {}
    if at.max() == 0:
        at = at + 1.0
    at = np.maximum(at, at[at > 0].min())  # a logarithmic axis has no 0
    seeds = trace["seed"].to_numpy(np.int64)[rows]
    order = np.lexsort((at, seeds, owner[rows]))
    records = np.column_stack([at, values[rows]])[order]
    owner, seeds = owner[rows][order], seeds[order]
    first = np.flatnonzero((np.diff(owner) != 0) | (np.diff(seeds) != 0)) + 1
    runs: dict[str, list[FloatArray]] = {}
    owners = owner[np.concatenate([[0], first])].astype(int)
    for i, run in zip(owners.tolist(), np.split(records, first), strict=True):
        runs.setdefault(labels[i], []).append(run)
    return runs


def _curve(runs: Sequence[FloatArray], grid: FloatArray, band: Band) -> Curve:
    start = max(run[0, 0] for run in runs)
    at = np.concatenate([[start], grid[grid > start]])
    values = np.array([run[np.searchsorted(run[:, 0], at, side="right") - 1, 1] for run in runs])
    if band == "sd":
        middle = values.mean(axis=0)
        sd = values.std(axis=0, ddof=1) if len(values) > 1 else np.zeros(len(at))
        # The band must not exceed what runs have reached.
        low = np.maximum(middle - sd, values.min(axis=0))
        high = np.minimum(middle + sd, values.max(axis=0))
    else:
        percent = (25, 50, 75) if band == "quartiles" else (0, 50, 100)
        low, middle, high = np.percentile(values, percent, axis=0)
    return Curve(at, middle, low, high, len(runs), max(float(run[-1, 0]) for run in runs))


def stairs(x: FloatArray, y: FloatArray) -> FloatArray:
    """Points (n, 2) of the steps through values that each hold until the next, without repeats."""
    kept = np.concatenate([[True], y[1:] != y[:-1]])
    kept[-1] = True
    x, y = x[kept], y[kept]
    return np.column_stack([np.repeat(x, 2)[1:], np.repeat(y, 2)[:-1]])
