"""What the pictures of a study show; progress, targets and attainment beside readable twins."""

from __future__ import annotations

from itertools import combinations
from typing import ClassVar

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
import seaborn as sns
from hypothesis import example, given
from hypothesis import strategies as st
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.colors import to_rgb

from botohe_moo.plots import (
    plot_areas,
    plot_attainment,
    plot_attainment_difference,
    plot_curves,
    plot_fronts,
    plot_heat,
    plot_ranks,
    plot_reached,
    plot_shortfalls,
)
from botohe_moo.plots.curves import first_reached, progress
from botohe_moo.plots.front import attainment, attainment_surface
from botohe_moo.plots.shared import log_axis
from tests.examples import examples


@pytest.fixture(autouse=True)
def _close_figures():
    mpl.use("Agg")
    yield
    plt.close("all")


def trace_of(runs):
    """``{(algorithm, seed): [(evaluations, area), ...]}`` as rows of a trace."""
    return pd.DataFrame(
        [
            {
                "algorithm": algorithm,
                "seed": seed,
                "evaluations": evaluations,
                "seconds": evaluations / 100,
                "area": area,
            }
            for (algorithm, seed), records in runs.items()
            for evaluations, area in records
        ],
        columns=["algorithm", "seed", "evaluations", "seconds", "area"],
    )


def fronts_of(runs):
    """``{(algorithm, seed): [(reward, survivors), ...]}`` as rows of plans, and of runs."""
    plans = [
        {"algorithm": algorithm, "seed": seed, "reward": reward, "survivors": survivors}
        for (algorithm, seed), points in runs.items()
        for reward, survivors in points
    ]
    rows = [
        {
            "algorithm": algorithm,
            "seed": seed,
            "status": "done" if points else "failed",
            "area": sum(map(sum, points)) / 100,
        }
        for (algorithm, seed), points in runs.items()
    ]
    columns = ["algorithm", "seed", "reward", "survivors"]
    return pd.DataFrame(plans, columns=columns), pd.DataFrame(rows)


def runs_of(keys):
    return pd.DataFrame([{"algorithm": a, "seed": s} for a, s in keys])


def lines_of(ax):
    """Return the lines that are named, by name."""
    return {line.get_label(): line for line in ax.lines if not line.get_label().startswith("_")}


def legend_texts(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def of_kind(ax, kind):
    return [artist for artist in ax.get_children() if type(artist) is kind]


TWO = {
    ("A", 1): [(10, 0.2), (100, 0.4)],
    ("A", 2): [(20, 0.1), (50, 0.3), (100, 0.5)],
    ("B", 1): [(10, 0.6)],
}

# The theme


class TestTheme:
    def test_palettes_are_those_of_seaborn(self):
        for palette, wanted in (
            ("Set2", sns.color_palette("Set2", 2)),
            ({"A": "red", "B": "lime"}, ["red", "lime"]),
        ):
            lines = lines_of(plot_curves(trace_of(TWO), palette=palette))
            for label, colour in zip("AB", wanted, strict=True):
                assert to_rgb(lines[label].get_color()) == pytest.approx(to_rgb(colour))

    def test_ticks_are_few_and_whole_numbers(self):
        runs, summary = areas_of({"A": [0.1884501, 0.1884583], "B": [0.1884567, 0.1884589]})
        axis = plot_areas(runs, summary).xaxis
        assert axis.get_major_formatter().get_useOffset() is False
        assert 2 <= len(axis.get_major_locator().tick_values(0.0, 0.9)) <= 8

    def test_a_theme_that_is_set_is_respected(self):
        with mpl.rc_context():
            sns.set_theme(style="whitegrid", palette="deep")
            ax = plot_curves(trace_of(TWO))
            bars = plot_areas(*areas_of(VALUES))
        deep = sns.color_palette("deep")
        lines = lines_of(ax)
        assert to_rgb(lines["A"].get_color()) == pytest.approx(deep[0])
        assert to_rgb(lines["B"].get_color()) == pytest.approx(deep[1])
        assert ax.spines["right"].get_visible()  # as whitegrid has it
        assert to_rgb(ax.get_xgridlines()[0].get_color()) == to_rgb("0.8")
        assert tuple(of_kind(bars, PathCollection)[0].get_facecolor()[0][:3]) == deep[0]

    def test_without_one_the_pictures_bring_their_own(self):
        before = dict(mpl.rcParams)
        ax = plot_curves(trace_of(TWO))
        own = sns.color_palette("colorblind")
        assert to_rgb(lines_of(ax)["A"].get_color()) == pytest.approx(own[0])
        assert not ax.spines["right"].get_visible()
        assert dict(mpl.rcParams) == before


# Curves


class TestIndicators:
    def test_ties_with_0_lie_below_the_axis(self):
        trace = trace_of(TWO).assign(epsilon=[0.4, 0.2, 0.5, 0.3, 0.1, 1e-13])
        assert plot_curves(trace, value="epsilon").get_ylim()[0] > 1e-3


class TestProgress:
    def test_rows_without_a_value_do_not_count(self):
        trace = trace_of(TWO).assign(igd_plus=[0.4, 0.2, 0.5, 0.3, 0.1, np.nan])
        assert set(progress(trace, value="igd_plus")["algorithm"]) == {"A"}

    @given(
        st.dictionaries(
            st.tuples(st.sampled_from("AB"), st.integers(1, 4)),
            st.dictionaries(st.integers(1, 500), st.floats(0, 1), min_size=1, max_size=6),
            min_size=1,
            max_size=6,
        ),
        st.randoms(use_true_random=False),
    )
    def test_every_point_is_the_last_record(self, runs, chance):
        trace = trace_of({key: list(records.items()) for key, records in runs.items()})
        rows = list(range(len(trace)))
        chance.shuffle(rows)
        found = progress(trace.iloc[rows])
        assert found["evaluations"].max() == max(max(records) for records in runs.values())
        for label, rows in found.groupby("algorithm"):
            own = [records for (algorithm, _), records in runs.items() if algorithm == label]
            assert rows["evaluations"].min() == max(min(records) for records in own)
        for algorithm, seed, x, area in found.itertuples(index=False):
            records = runs[algorithm, seed]
            assert area == records[max(at for at in records if at <= x)]

    def test_what_it_refuses(self):
        for change, options, message in (
            ({}, {"x": "hours"}, "Expected x among seconds, evaluations, got 'hours'"),
            ({"epsilon": np.nan}, {"value": "epsilon"}, "at least one row of trace, got none"),
            ({}, {"algorithms": ["a"]}, "an algorithm of trace among A, B, got 'a'"),
            ({}, {"algorithms": []}, "Expected at least one algorithm, got none"),
            ({"mission": list("xxxxxy")}, {}, "trace of one mission, got 'x', 'y'"),
            ({}, {"bound": 0.5, "value": "igd_plus"}, "no bound, which is of areas, with igd_plus"),
        ):
            with pytest.raises(ValueError, match=message):
                plot_curves(trace_of(TWO).assign(**change), **options)
        assert plt.get_fignums() == []


class TestPlotCurves:
    def test_bands_are_what_they_say(self):
        areas = [0.9, 0.1, 0.4, 0.2, 0.8]
        trace = trace_of({("A", seed): [(1, area), (9, area)] for seed, area in enumerate(areas)})
        for band, ends in (
            ("quartiles", (0.2, 0.4, 0.8)),
            ("range", (0.1, 0.4, 0.9)),
        ):
            ax = plot_curves(trace, band=band)
            (filled,) = ax.collections
            y = filled.get_paths()[0].vertices[:, 1]
            middle = lines_of(ax)["A"].get_ydata()[-1]
            assert (y.min(), middle, y.max()) == pytest.approx(ends, abs=0.001)

    def test_medians_and_bands(self):
        ax = plot_curves(trace_of(TWO), title="A site")
        lines = lines_of(ax)
        assert lines["A"].get_ydata()[-1] == pytest.approx(0.45)
        assert lines["A"].get_drawstyle() == "steps-post"
        assert set(lines["B"].get_ydata()) == {0.6}
        assert lines["B"].get_xdata()[[0, -1]].tolist() == [10, 100]
        assert ax.get_xscale() == "log"
        assert ax.get_title(loc="left") == "A site"
        assert legend_texts(ax) == ["B", "A"]  # as the curves end

    def test_a_long_low_start_is_cut_off(self):
        runs = {
            ("A", 1): [(1, 0.0), (1000, 0.5), (2000, 0.52)],
            ("B", 1): [(1, 0.4), (2000, 0.48)],
        }
        low, high = plot_curves(trace_of(runs)).get_ylim()
        assert 0.2 < low < 0.27
        assert 0.52 < high < 0.55

    def test_a_curve_of_one_point_is_marked(self):
        runs = {("A", 1): [(1, 0.1), (50, 0.5)], ("late", 1): [(50, 0.4)]}
        late = lines_of(plot_curves(trace_of(runs)))["late"]
        assert late.get_xdata().tolist() == [50]
        assert late.get_marker() != "None"
        assert late.get_markevery()[0] == 0


class TestLogAxis:
    @given(st.floats(1e-4, 1e7), st.floats(1.01, 1e7))
    @example(1.05, 6.4)
    @example(0.9999, 6.6)
    @examples(30)
    def test_at_least_two_plain_numbers_are_in_sight(self, low, ratio):
        fig, ax = plt.subplots(figsize=(4, 2), dpi=50)
        ax.set_xlim(low, low * ratio)
        log_axis(ax)
        ticks = [t for t in ax.get_xticks() if low <= t <= low * ratio * (1 + 1e-9)]
        assert len(ticks) >= 2
        shown = ax.xaxis.get_major_formatter().format_ticks(ticks)
        assert not any("$" in text or "e" in text for text in shown)
        plt.close(fig)

    def test_numbers_are_plain(self):
        _, ax = plt.subplots()
        log_axis(ax)
        shown = ax.xaxis.get_major_formatter()
        values = (0.2, 50, 10_000, 2e6)
        assert [shown(value) for value in values] == ["0.2", "50", "10,000", "2,000,000"]


# Areas


def areas_of(values, lost=()):
    """``{algorithm: areas}`` as runs and their summary."""
    runs = pd.DataFrame(
        [
            {
                "algorithm": label,
                "seed": seed,
                "status": "failed" if (label, seed) in lost else "done",
                "area": area,
            }
            for label, areas in values.items()
            for seed, area in enumerate(areas, start=1)
        ]
    )
    summary = pd.DataFrame(
        [
            {
                "algorithm": label,
                "area_median": float(np.median(areas)),
                "area_low": min(areas),
                "area_high": max(areas),
            }
            for label, areas in values.items()
        ]
    )
    return runs, summary


VALUES = {"A": [0.3, 0.1, 0.2], "B": [0.5], "C": [0.0, 0.4]}


class TestPlotAreas:
    def test_points_medians_and_intervals(self):
        ax = plot_areas(*areas_of(VALUES, lost={("C", 1)}), title="A site")
        found = np.concatenate([c.get_offsets() for c in of_kind(ax, PathCollection)])
        by_row = {row: sorted(found[found[:, 1].round() == row, 0].round(9)) for row in range(3)}
        assert by_row == {0: [0.1, 0.2, 0.3], 1: [0.5], 2: [0.0, 0.4]}
        medians = next(line for line in ax.lines if line.get_marker() == "d")
        assert medians.get_xdata() == pytest.approx([0.2, 0.5, 0.2])
        (bars,) = of_kind(ax, LineCollection)
        ends = [bar[:, 0].tolist() for bar in bars.get_segments()]
        assert ends == [pytest.approx(pair) for pair in ([0.1, 0.3], [0.5, 0.5], [0, 0.4])]
        assert [label.get_text() for label in ax.get_yticklabels()] == ["A", "B", "C"]
        assert ax.get_ylim()[0] > ax.get_ylim()[1]  # the first is on top
        assert ax.get_title(loc="left") == "A site"

    def test_a_bound_is_a_dashed_line_unless_it_is_too_far(self):
        near = plot_areas(*areas_of(VALUES), bound=0.7)
        assert set(lines_of(near)["no front exceeds 0.7000"].get_xdata()) == {0.7}
        assert near.get_xlim()[1] >= 0.7
        narrow = plot_areas(*areas_of({"A": [0.3, 0.31]}), bound=0.4)
        assert not any(line.get_linestyle() == "--" for line in narrow.lines)


# Fronts


RUNS = {
    ("A", 1): [(1, 1)],
    ("A", 2): [(2, 2), (1, 3), (1, 1)],  # sums to 10: the largest
    ("A", 3): [(3, 1), (1, 2)],  # sums to 7: the median
    ("B", 1): [],
    ("B", 2): [],
    ("B", 3): [(4, 4)],
}


class TestPlotFronts:
    def test_the_median_run_is_drawn_as_stairs(self):
        lines = lines_of(plot_fronts(*fronts_of(RUNS)))
        assert list(lines) == ["A (seed 3)", "B (seed 2): no plans"]
        stairs = lines["A (seed 3)"]
        assert stairs.get_xydata().tolist() == [[0, 2], [1, 2], [1, 1], [3, 1], [3, 0]]
        start, step = stairs.get_markevery()
        assert stairs.get_xydata()[start::step].tolist() == [[1, 2], [3, 1]]  # the plans
        assert lines["B (seed 2): no plans"].get_xydata().tolist() == []

    def test_reference_and_bound(self):
        points = pd.DataFrame({"reward": [5.0, 2.0], "survivors": [1.0, 3.0]})
        ax = plot_fronts(*fronts_of(RUNS), reference=points, bound=points)
        assert legend_texts(ax)[-2:] == ["reference front", "no plan lies beyond"]
        for name in legend_texts(ax)[-2:]:
            line = lines_of(ax)[name].get_xydata().tolist()
            assert line == [[0, 3], [2, 3], [2, 1], [5, 1], [5, 0]]


# Attainment

points = st.tuples(st.integers(0, 4), st.integers(0, 4))
sets_of_points = st.lists(st.lists(points, max_size=4), min_size=1, max_size=5)


def as_fronts(sets):
    return [np.array(points, float).reshape(-1, 2) for points in sets]


def share_reaching(sets, x, y):
    """How many of the runs have a plan with at least this reward and these survivors."""
    return sum(any(r >= x and s >= y for r, s in run) for run in sets) / len(sets)


def inside(surface, x, y):
    return any(r >= x and s >= y for r, s in surface)


CELLS = [(x + 0.5, y + 0.5) for x in range(4) for y in range(4)]


THREE = [[(1, 3), (3, 1)], [(2, 2)], []]


class TestAttainment:
    @given(sets_of_points, st.sampled_from([0, 25, 50, 75, 100]))
    def test_it_bounds_what_so_many_runs_reach(self, sets, percent):
        surface = attainment_surface(as_fronts(sets), percent)
        for x, y in CELLS:
            share = share_reaching(sets, x, y)
            assert inside(surface, x, y) == (share > 0 and share >= percent / 100)

    def test_lines_and_bands(self):
        runs = {("A", seed): run for seed, run in enumerate(THREE)}
        ax = plot_attainment(*fronts_of({**runs, ("B", 1): [(1, 1)]}))
        lines = lines_of(ax)
        assert lines["A"].get_xydata().tolist() == [[0, 2], [1, 2], [1, 1], [2, 1], [2, 0]]
        assert lines["B"].get_xydata().tolist() == [[0, 1], [1, 1], [1, 0]]
        # From what one run reaches to what all do, which is nothing.
        (band,) = ax.patches
        assert [1, 3] in band.get_xy().tolist()
        assert [0, 0] in band.get_xy().tolist()
        assert legend_texts(ax) == ["A", "B"]


class TestDifference:
    @given(sets_of_points, sets_of_points)
    @example([[(1, 1)]], [[(1, 1)], []])
    @example([[]], [[], []])
    @example([[(2, 2)]] * 3, [[(2, 2)]] * 2)
    @example([[(1, 2), (2, 1)]], [[(1, 2), (2, 1)]])
    @examples(300)
    def test_it_is_that_of_the_shares_everywhere(self, mine, theirs):
        middles = np.arange(4) + 0.5
        shares = (attainment(as_fronts(sets), middles, middles) for sets in (mine, theirs))
        difference = next(shares) - next(shares)
        for x, y in CELLS:
            expected = share_reaching(mine, x, y) - share_reaching(theirs, x, y)
            assert difference[int(y), int(x)] == pytest.approx(expected)

    def test_both_panels(self):
        plans, runs = fronts_of({("A", 1): [(2, 1)], ("B", 1): [(1, 2)], ("B", 2): [(1, 2)]})
        left, right = plot_attainment_difference(plans, runs, "A", "B", title="A site")
        for ax, (x, y) in ((left, (1.5, 0.5)), (right, (0.5, 1.5))):
            [image] = ax.images
            assert image.get_extent() == [0, 2, 0, 2]
            # Only one of the four quarters is filled, with the largest difference.
            steps = image.get_array()
            row, column = int(y / 2 * len(steps)), int(x / 2 * len(steps))
            assert steps[row, column] == 5
            assert steps.count() == steps.size // 4
        for ax, median in ((left, [[0, 1], [2, 1], [2, 0]]), (right, [[0, 2], [1, 2], [1, 0]])):
            any_run, half = ax.lines
            assert half.get_xydata().tolist() == median
            assert any_run.get_xydata().tolist() == [[0, 2], [1, 2], [1, 1], [2, 1], [2, 0]]
        assert left.get_title(loc="left") == "A reaches more often"
        assert right.get_title(loc="left") == "B reaches more often"


class TestReached:
    @given(
        st.dictionaries(
            st.tuples(st.sampled_from("AB"), st.integers(1, 4)),
            st.dictionaries(st.integers(1, 50), st.floats(0, 1), max_size=5),
            min_size=1,
            max_size=6,
        ),
        st.lists(st.floats(0.01, 1), min_size=1, max_size=6),
    )
    def test_it_is_the_first_record_that_reaches(self, runs, targets):
        trace = trace_of({key: list(records.items()) for key, records in runs.items()})
        for label, spent in first_reached(trace, runs_of(runs), targets).items():
            expected = [
                min((at for at, area in run.items() if area >= t - 1e-12), default=np.inf)
                for (algorithm, _), run in runs.items()
                for t in sorted(targets)
                if algorithm == label
            ]
            assert spent.tolist() == expected

    def test_curves_end_at_the_share_that_is_reached(self):
        ax = plot_reached(trace_of(TWO), runs_of([*TWO, ("C", 1)]), [0.1, 0.9], title="A site")
        for label, share in {"A": 0.5, "B": 0.5, "C": 0.0}.items():
            x, y = lines_of(ax)[label].get_data()
            assert y[x <= 100][-1] == pytest.approx(share)
        assert ax.get_xlim()[1] < 200  # what is never reached is out of sight
        assert ax.get_title(loc="left") == "A site"


def posthoc_of(ranks, difference):
    return pd.DataFrame(
        [
            {
                "algorithm": a,
                "other": b,
                "difference": ranks[a] - ranks[b],
                "critical_difference": difference,
                "significant": abs(ranks[a] - ranks[b]) > difference,
            }
            for a, b in combinations(ranks, 2)
        ],
        columns=["algorithm", "other", "difference", "critical_difference", "significant"],
    )


class TestRanks:
    RANKS: ClassVar = {"A": 1.2, "B": 2.0, "C": 2.9, "D": 3.9}

    def table(self, ranks):
        rows = [{"algorithm": a, "average_rank": r, "n_missions": 5} for a, r in ranks.items()]
        return pd.DataFrame(rows)

    def bars(self, ax):
        """Return the ends of the bars that join algorithms."""
        bars = [line.get_xdata() for line in ax.lines if line.get_linewidth() == 2]
        return sorted((min(bar), max(bar)) for bar in bars)

    def test_bars_join_what_does_not_differ(self):
        shuffled = {label: self.RANKS[label] for label in "CADB"}
        ax = plot_ranks(self.table(shuffled), posthoc_of(self.RANKS, 1.0), title="A study")
        assert self.bars(ax) == [(1.2, 2.0), (2.0, 2.9), (2.9, 3.9)]
        assert {text.get_text() for text in ax.texts} == {
            "A  (1.20)",
            "B  (2.00)",
            "(2.90)  C",
            "(3.90)  D",
        }
        assert ax.get_title(loc="left") == "A study"

    def test_what_friedman_overrules(self):
        posthoc = posthoc_of(self.RANKS, 1.0)
        posthoc["significant"] = False
        assert self.bars(plot_ranks(self.table(self.RANKS), posthoc)) == [(1.2, 3.9)]


class TestShortfalls:
    SUMMARY = pd.DataFrame(
        [
            ("site", "ants", 0.4, 0.8),
            ("site", "greedy", 0.45, 0.9),
            ("mine", "ants", 0.2, 1.0),
        ],
        columns=["mission", "algorithm", "area_mean", "area_share"],
    )
    MISSIONS = pd.DataFrame(
        {"mission": ["mine", "other", "site"], "bound_area": [np.nan, 0.9, 0.505]}
    )

    def test_points_are_shares_of_the_reference_and_bars_certified_gaps(self):
        ax = plot_shortfalls(self.SUMMARY, self.MISSIONS, title="A study")
        # Missions without runs are left out; the first is on top.
        assert [tick.get_text() for tick in ax.get_yticklabels()] == ["mine", "site"]
        [points] = [c for c in ax.collections if len(c.get_offsets()) == 3]
        shown = sorted(tuple(np.round(point, 9)) for point in points.get_offsets().tolist())
        assert shown == [(0.0, 0.0), (10.0, 1.0), (20.0, 1.0)]
        assert [bar.get_width() for bar in ax.patches][1] == pytest.approx(1.0)  # 0.505 / 0.5
        assert ax.get_xlim()[0] == 0.0
        assert ax.get_title(loc="left") == "A study"

    def test_algorithms_are_chosen(self):
        ax = plot_shortfalls(self.SUMMARY, self.MISSIONS, algorithms=["greedy"])
        [points] = [c for c in ax.collections if len(c.get_offsets())]
        assert points.get_offsets().tolist() == [[pytest.approx(10.0), 1.0]]
        with pytest.raises(ValueError, match="an algorithm of summary"):
            plot_shortfalls(self.SUMMARY, self.MISSIONS, algorithms=["bees"])

    def test_missing_columns_are_named(self):
        for column in ("mission", "bound_area"):
            with pytest.raises(ValueError, match=f"missions .* it lacks .'{column}'"):
                plot_shortfalls(self.SUMMARY, self.MISSIONS.drop(columns=column))
        for column in ("mission", "area_share"):
            with pytest.raises(ValueError, match=f"summary .* it lacks .'{column}'"):
                plot_shortfalls(self.SUMMARY.drop(columns=column), self.MISSIONS)


class TestHeat:
    MEDIANS = pd.DataFrame(
        [[0.1, 0.25], [0.5, np.nan]],
        index=pd.Index([50, 100], name="n_ants"),
        columns=pd.Index([0.04, 0.1], name="evaporation"),
    )

    def test_every_cell_says_its_median_and_the_largest_is_bold(self):
        ax = plot_heat(self.MEDIANS, title="A site")
        shown = {text.get_text(): text.get_fontweight() for text in ax.texts}
        assert shown == {"0.1000": "normal", "0.2500": "normal", "0.5000": "bold"}
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("evaporation", "n_ants")
        assert [t.get_text() for t in ax.get_xticklabels()] == ["0.04", "0.1"]
        assert [t.get_text() for t in ax.get_yticklabels()] == ["50", "100"]


def many(n):
    return [f"BO-ACO (n_ants={i}, evaporation={e})" for i in range(n) for e in (0.04, 0.1)][:n]


PICTURES = {
    "curves": lambda labels: plot_curves(
        trace_of({(a, s): [(1, 0.1), (50, 0.5 + s / 10)] for a in labels for s in (1, 2)}),
        title="A site",
    ),
    "fronts": lambda labels: plot_fronts(
        *fronts_of({(a, 1): [(1, 2), (2, 1)] for a in labels}),
        reference=pd.DataFrame({"reward": [3.0], "survivors": [3.0]}),
        title="A site",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["curves", "fronts"])
def test_a_long_legend_is_beside_the_plot(kind):
    ax = PICTURES[kind](many(15))
    assert ax.figure.axes == [ax]
    ax.figure.canvas.draw()
    assert ax.get_legend().get_window_extent().x0 >= ax.get_window_extent().x1
    assert ax.get_title(loc="left") == "A site"
