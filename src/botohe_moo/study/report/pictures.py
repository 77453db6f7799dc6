"""The pictures of one mission in a report, with their captions."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from botohe_moo._base.types import FloatArray
from botohe_moo.indicators import INDICATORS, area_indicator, further_indicators
from botohe_moo.plots.draw.algorithms import AlgorithmStyle
from botohe_moo.plots.draw.panels import MANY, names_room, study_axes
from botohe_moo.plots.study.areas import plot_areas
from botohe_moo.plots.study.attainment import plot_attainment
from botohe_moo.plots.study.curves import Progress, plot_curves
from botohe_moo.plots.study.difference import plot_attainment_difference
from botohe_moo.plots.study.fronts import plot_fronts
from botohe_moo.plots.study.heat import plot_heat, two_parameter_grids
from botohe_moo.plots.study.reached import plot_reached
from botohe_moo.study.report.words import level
from botohe_moo.study.store.tables import StudyTables

_SHARES = np.arange(50, 100) / 100  # of the reference front's area: the targets


Picture = tuple[str, "Axes", str, str]


def rivals(tables: StudyTables, mission: str) -> tuple[str, str] | None:
    """Give the two algorithms whose attainment is compared; None if there is only one.

    They are the control and the best other one, or without a control the two with the largest
    median areas, in the order of the study file.
    """
    rows = tables.summary[tables.summary["mission"] == mission]
    order = [label for label in tables.algorithm_labels if label in set(rows["algorithm"])]
    if len(order) < 2:
        return None
    medians = rows.set_index("algorithm")["area_median"]
    ranked = sorted(order, key=lambda label: -float(medians[label]))
    if tables.control in order:
        other = next(label for label in ranked if label != tables.control)
        return tables.control, other
    first, second = sorted(ranked[:2], key=order.index)
    return first, second


class MissionPictures:
    """The pictures of one mission, drawn one by one: kind, axes, caption, alternative text."""

    def __init__(
        self, tables: StudyTables, mission: str, styles: Mapping[str, AlgorithmStyle]
    ) -> None:
        self._tables, self._mission, self._styles = tables, mission, styles
        self._model = tables.mission(mission)
        self._title = f"{mission}\n{self._model.title}" if self._model.title != mission else mission
        self._look: dict[str, Any] = {"styles": styles, "title": self._title}
        self._own = tables.manifest["missions"][mission].get("objective_bounds")
        self._runs = self._rows(tables.runs)
        known = set(self._runs["algorithm"])
        self._labels = [label for label in tables.algorithm_labels if label in known]
        self._names = ", ".join(self._labels)
        most = self._rows(tables.missions)["bound_area"].iloc[0]
        self._most = None if pd.isna(most) else float(most)
        self._many = len(self._labels) >= MANY

    def _rows(self, table: pd.DataFrame) -> pd.DataFrame:
        return table[table["mission"] == self._mission]

    def __iter__(self) -> Iterator[Picture]:
        if self._labels:
            trace = self._rows(self._tables.trace)
            if not trace.empty:
                yield from self._curves(trace)
                yield from self._reached(trace)
                yield from self._distances(trace)
            yield from self._areas()
            yield from self._grids()
        # Their axes are E[R] and E[S].
        if self._own is None and not self._rows(self._tables.plans).empty:
            yield from self._fronts()
            yield from self._difference()

    def _without_front(self, table: pd.DataFrame) -> list[str]:
        """Say which algorithms have runs without a row in a table."""
        found = table.groupby("algorithm")["run"].nunique()
        runs = self._runs.groupby("algorithm")["run"].nunique()
        missing = {label: runs[label] - found.get(label, 0) for label in self._labels}
        return [f"{n} of {label}" for label, n in missing.items() if n]

    def _recorded(self, rows: pd.DataFrame) -> list[str]:
        recorded = set(rows["algorithm"])
        return [label for label in self._labels if label in recorded]

    def _curves(self, trace: pd.DataFrame) -> Iterator[Picture]:
        labels = self._recorded(trace)
        absent = self._without_front(trace)
        lost = f" Runs without any recorded front are not in it: {', '.join(absent)}."
        reading = (
            "Lines are medians over runs, bands reach from their lower to their upper quartile; a "
            "single run has no band. Between two records the area is that of the last one. A curve "
            "begins where all runs have a record, and is thin where all have "
            f"ended.{lost if absent else ''}"
        )
        captions: dict[Progress, str] = {
            "evaluations": f"The area of the front over the number of evaluations. {reading}",
            "seconds": "The same over the algorithms' own time, without recording.",
        }
        for (x, caption), kind in zip(captions.items(), ("curves", "seconds"), strict=True):
            ax = plot_curves(trace, x=x, algorithms=labels, bound=self._most, **self._look)
            yield kind, ax, caption, f"Area over {x} of {', '.join(labels)}"

    def _stacked(self, *, share: bool) -> Sequence[Axes]:
        """Open a figure with two axes that have room for all names."""
        height, right = names_room(self._labels, self._styles)
        return study_axes(6.0, max(2.6, height), right=right, n_rows=2, share=share)

    def _reached(self, trace: pd.DataFrame) -> Iterator[Picture]:
        reference = self._rows(self._tables.references)[["reward", "survivors"]].to_numpy(float)
        scale = self._model if self._own is None else tuple(self._own)
        whole = area_indicator(reference, scale) if len(reference) else 0.0
        if not whole > 0:
            return
        targets: FloatArray = _SHARES * whole
        caption = (
            "How much of what can be reached is reached by when: the share of all pairs of a run "
            f"and a target. Targets are the {len(_SHARES)} whole percents from 50 to 99 of the "
            f"reference front's area, {whole:.4f}. All runs count, also those that never get there."
        )
        what = f"Targets reached by {self._names}"
        chosen: dict[str, Any] = {"algorithms": self._labels, "styles": self._styles}
        if self._many:
            kinds: dict[Progress, str] = {"evaluations": "reached", "seconds": "reached_seconds"}
            for x, kind in kinds.items():
                ax = plot_reached(trace, self._runs, targets, x=x, title=self._title, **chosen)
                yield kind, ax, caption, what
            return
        axes = self._stacked(share=False)
        plot_reached(trace, self._runs, targets, title=self._title, ax=axes[0], **chosen)
        plot_reached(trace, self._runs, targets, x="seconds", ax=axes[1], **chosen)
        above = f"{caption} Above over evaluations, below over the algorithms' own time."
        yield "reached", axes[0], above, what

    def _distances(self, trace: pd.DataFrame) -> Iterator[Picture]:
        found: dict[str, list[str]] = {}
        for value in further_indicators():
            if INDICATORS[value].is_distance and trace[value].notna().any():
                found[value] = self._recorded(trace[trace[value].notna()])
        if not found:
            return
        caption = (
            "How far fronts are from the reference front, less is better: {}, on a logarithmic "
            "axis. Lines are medians over runs, bands reach from their lower to their upper "
            "quartile."
        )
        shared = not self._many and len(found) == 2  # above each other
        if not shared:
            for value, labels in found.items():
                named = INDICATORS[value].label
                ax = plot_curves(trace, value=value, algorithms=labels, **self._look)
                yield value, ax, caption.format(named), f"{named} of {', '.join(labels)}"
            return
        above, below = self._stacked(share=True)
        titles = {above: self._title, below: None}
        for (value, labels), (ax, title) in zip(found.items(), titles.items(), strict=True):
            look = {**self._look, "title": title}
            plot_curves(trace, value=value, algorithms=labels, ax=ax, **look)
        above.set_xlabel("")
        named = " above, ".join(INDICATORS[value].label for value in found) + " below"
        yield "distances", above, caption.format(named), f"Distances of {self._names}"

    def _areas(self) -> Iterator[Picture]:
        summary = self._rows(self._tables.summary)
        ax = plot_areas(
            self._runs, summary, algorithms=self._labels, bound=self._most, **self._look
        )
        caption = (
            "The area of every run's final front, a point each. Above them the median (diamond) "
            f"and its {level(self._tables)} bootstrap interval (line)."
        )
        if (self._runs["status"] != "done").any():
            caption += " Crosses are runs that are not done; without a front their area is 0."
        yield "areas", ax, caption, f"Final areas of the runs of {self._names}"

    def _grids(self) -> Iterator[Picture]:
        found = two_parameter_grids(self._tables.algorithms)
        medians = self._rows(self._tables.summary).set_index("algorithm")["area_median"]
        for i, (family, grid) in enumerate(found.items()):
            values = grid.apply(lambda column: column.map(medians)).astype(float)
            if not values.notna().any(axis=None):
                continue
            row, column = grid.index.name, grid.columns.name
            ax = plot_heat(values, name=f"area of {family}", title=self._title)
            caption = (
                f"The median area of {family} for each combination of {row} (rows) and {column} "
                "(columns), as in the summary; the largest is bold."
            )
            kind = "grid" if i == 0 else f"grid_{i + 1}"
            yield kind, ax, caption, f"Median areas of {family} by {row} and {column}"

    def _fronts(self) -> Iterator[Picture]:
        plans, reference = self._rows(self._tables.plans), self._rows(self._tables.references)
        chosen = {"algorithms": self._labels, **self._look}
        bound = None if self._most is None else self._rows(self._tables.bounds)
        ax = plot_fronts(plans, self._runs, reference=reference, bound=bound, **chosen)
        caption = (
            "For each algorithm the final front of the run with the median area, of the middle two "
            "the one with less; its seed stands beside the name. The thin line is the reference "
            "front: what all runs on this mission found together."
        )
        if bound is not None:
            caption += " No plan whatsoever lies beyond the dashed line: that is proved."
        yield "fronts", ax, caption, f"Final fronts of the median runs of {self._names}"
        ax = plot_attainment(plans, self._runs, **chosen)
        caption = (
            "Empirical attainment surfaces. What lies below and left of a line, at least half of "
            "the runs reach; bands lie between what a quarter and what three quarters of them "
            "reach."
        )
        if absent := self._without_front(plans):
            caption += f" Runs without a front reach nothing: {', '.join(absent)}."
        yield "attainment", ax, caption, f"Attainment surfaces of {self._names}"

    def _difference(self) -> Iterator[Picture]:
        pair = rivals(self._tables, self._mission)
        if pair is None:
            return
        first, second = pair
        plans = self._rows(self._tables.plans)
        left, _ = plot_attainment_difference(plans, self._runs, first, second, **self._look)
        why = (
            "the control and the best of the others"
            if first == self._tables.control
            else "the two with the largest median areas"
        )
        caption = (
            f"Where {first} reaches more often than {second} (left), and less often (right): {why}."
            " The darker, the larger the difference between the shares of their runs. The solid "
            "line bounds what any run of both reaches, the dashed one what half of the panel's "
            "algorithm's runs reach."
        )
        alternative = f"Differences between the attainment of {first} and {second}"
        yield "difference", left, caption, alternative
