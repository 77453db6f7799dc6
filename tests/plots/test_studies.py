"""Pictures of studies: what is drawn equals the tables, beside readable twins."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from matplotlib.collections import LineCollection, PathCollection

from botohe_moo import plots
from botohe_moo.plots.comparisons import first_reached, progress
from botohe_moo.plots.front import attainment, attainment_surface
from botohe_moo.plots.style import log_axis
from tests.examples import examples
from tests.plots import made, read


def records(most, areas=1):
    """Runs of two algorithms, each with areas by evaluations."""
    of_run = st.dictionaries(st.integers(1, most), st.floats(0, 1), min_size=areas, max_size=6)
    runs = st.tuples(st.sampled_from("AB"), st.integers(1, 4))
    return st.dictionaries(runs, of_run, min_size=1, max_size=6)


class TestCurves:
    @given(records(500), st.randoms(use_true_random=False))
    def test_every_point_is_the_last_record(self, runs, chance):
        trace = made.trace_of({key: list(of_run.items()) for key, of_run in runs.items()})
        rows = list(range(len(trace)))
        chance.shuffle(rows)
        found = progress(trace.iloc[rows])
        assert found["evaluations"].max() == max(max(of_run) for of_run in runs.values())
        for label, rows in found.groupby("algorithm"):
            own = [of_run for (algorithm, _), of_run in runs.items() if algorithm == label]
            assert rows["evaluations"].min() == max(min(of_run) for of_run in own)
        for algorithm, seed, x, area in found.itertuples(index=False):
            of_run = runs[algorithm, seed]
            assert area == of_run[max(at for at in of_run if at <= x)]

    def test_medians_and_bands(self):
        areas = [0.9, 0.1, 0.4, 0.2, 0.8]
        runs = {("A", seed): [(1, area), (9, area)] for seed, area in enumerate(areas)}
        trace = made.trace_of({**runs, ("B", 1): [(1, 0.6)]})
        for band, ends in (("quartiles", (0.2, 0.4, 0.8)), ("range", (0.1, 0.4, 0.9))):
            ax = plots.plot_curves(trace, band=band)
            y = ax.collections[read.legend_texts(ax).index("A")].get_paths()[0].vertices[:, 1]
            middle = read.lines_of(ax)["A"].get_ydata()[-1]
            assert (y.min(), middle, y.max()) == pytest.approx(ends, abs=0.001)
        assert read.lines_of(ax)["A"].get_drawstyle() == "steps-post"
        assert read.lines_of(ax)["B"].get_xdata()[[0, -1]].tolist() == [1, 9]
        assert set(read.lines_of(ax)["B"].get_ydata()) == {0.6}
        assert ax.get_xscale() == "log"
        assert read.legend_texts(ax) == ["B", "A"]  # as the curves end

    def test_a_long_low_start_is_cut_off_and_a_curve_of_one_point_is_marked(self):
        long = [(1, 0.0), (1000, 0.5), (2000, 0.52)]
        low, high = plots.plot_curves(
            made.trace_of({("A", 1): long, ("B", 1): [(1, 0.4), (2000, 0.48)]})
        ).get_ylim()
        assert 0.2 < low < 0.27
        assert 0.52 < high < 0.55
        late = read.lines_of(
            plots.plot_curves(made.trace_of({("A", 1): long, ("B", 1): [(2000, 0.4)]}))
        )["B"]
        assert late.get_xdata().tolist() == [2000]
        assert late.get_marker() != "None"
        assert late.get_markevery()[0] == 0

    def test_other_indicators(self):
        values = [0.4, 0.2, 0.5, 0.3, 0.1]
        trace = made.trace_of(made.TWO).assign(igd_plus=[*values, np.nan], epsilon=[*values, 1e-13])
        assert set(progress(trace, value="igd_plus")["algorithm"]) == {"A"}
        # Ties with 0 lie below the axis.
        assert plots.plot_curves(trace, value="epsilon").get_ylim()[0] > 1e-3

    def test_what_is_refused(self):
        for change, options, message in (
            ({}, {"x": "hours"}, "Expected x among seconds, evaluations, got 'hours'"),
            ({"epsilon": np.nan}, {"value": "epsilon"}, "at least one row of trace, got none"),
            ({}, {"algorithms": ["a"]}, "an algorithm of trace among A, B, got 'a'"),
            ({}, {"algorithms": []}, "Expected at least one algorithm, got none"),
            ({"mission": list("xxxxxy")}, {}, "trace of one mission, got 'x', 'y'"),
            ({}, {"bound": 0.5, "value": "igd_plus"}, "no bound, which is of areas, with igd_plus"),
        ):
            with pytest.raises(ValueError, match=message):
                plots.plot_curves(made.trace_of(made.TWO).assign(**change), **options)
        assert plt.get_fignums() == []


@given(st.floats(1e-4, 1e7), st.floats(1.01, 1e7))
@example(1.05, 6.4)
@example(0.9999, 6.6)
@examples(30)
def test_logarithmic_axes_show_at_least_two_plain_numbers(low, ratio):
    fig, ax = plt.subplots(figsize=(4, 2), dpi=50)
    ax.set_xlim(low, low * ratio)
    log_axis(ax)
    ticks = [t for t in ax.get_xticks() if low <= t <= low * ratio * (1 + 1e-9)]
    assert len(ticks) >= 2
    shown = ax.xaxis.get_major_formatter()
    assert not any("$" in text or "e" in text for text in shown.format_ticks(ticks))
    values = (0.2, 50, 10_000, 2e6)
    assert [shown(value) for value in values] == ["0.2", "50", "10,000", "2,000,000"]
    plt.close(fig)


class TestReached:
    @given(records(50, areas=0), st.lists(st.floats(0.01, 1), min_size=1, max_size=6))
    def test_it_is_the_first_record_that_reaches(self, runs, targets):
        trace = made.trace_of({key: list(of_run.items()) for key, of_run in runs.items()})
        keys = pd.DataFrame(list(runs), columns=["algorithm", "seed"])
        for label, spent in first_reached(trace, keys, targets).items():
            expected = [
                min((at for at, area in run.items() if area >= t - 1e-12), default=np.inf)
                for (algorithm, _), run in runs.items()
                for t in sorted(targets)
                if algorithm == label
            ]
            assert spent.tolist() == expected

    def test_curves_end_at_the_share_that_is_reached(self):
        keys = pd.DataFrame([*made.TWO, ("C", 1)], columns=["algorithm", "seed"])
        ax = plots.plot_reached(made.trace_of(made.TWO), keys, [0.1, 0.9])
        for label, share in {"A": 0.5, "B": 0.5, "C": 0.0}.items():
            x, y = read.lines_of(ax)[label].get_data()
            assert y[x <= 100][-1] == pytest.approx(share)
        assert ax.get_xlim()[1] < 200  # what is never reached is out of sight


class TestAreas:
    def test_points_medians_and_intervals(self):
        ax = plots.plot_areas(*made.areas_of(made.AREAS, lost={("C", 1)}))
        found = np.concatenate([c.get_offsets() for c in read.of_kind(ax, PathCollection)])
        by_row = {row: sorted(found[found[:, 1].round() == row, 0].round(9)) for row in range(3)}
        assert by_row == {0: [0.1, 0.2, 0.3], 1: [0.5], 2: [0.0, 0.4]}
        medians = next(line for line in ax.lines if line.get_marker() == "d")
        assert medians.get_xdata() == pytest.approx([0.2, 0.5, 0.2])
        (bars,) = read.of_kind(ax, LineCollection)
        ends = [bar[:, 0].tolist() for bar in bars.get_segments()]
        assert ends == [pytest.approx(pair) for pair in ([0.1, 0.3], [0.5, 0.5], [0, 0.4])]
        assert [label.get_text() for label in ax.get_yticklabels()] == ["A", "B", "C"]
        assert ax.get_ylim()[0] > ax.get_ylim()[1]  # the first is on top

    def test_a_bound_is_a_dashed_line_unless_it_is_too_far(self):
        near = plots.plot_areas(*made.areas_of(made.AREAS), bound=0.7)
        assert set(read.lines_of(near)["no front exceeds 0.7000"].get_xdata()) == {0.7}
        assert near.get_xlim()[1] >= 0.7
        narrow = plots.plot_areas(*made.areas_of({"A": [0.3, 0.31]}), bound=0.4)
        assert not any(line.get_linestyle() == "--" for line in narrow.lines)

    def test_ticks_are_few_and_whole_numbers(self):
        values = {"A": [0.1884501, 0.1884583], "B": [0.1884567, 0.1884589]}
        axis = plots.plot_areas(*made.areas_of(values)).xaxis
        assert axis.get_major_formatter().get_useOffset() is False
        assert 2 <= len(axis.get_major_locator().tick_values(0.0, 0.9)) <= 8


class TestFronts:
    def test_the_median_run_is_drawn_as_stairs(self):
        lines = read.lines_of(plots.plot_fronts(*made.fronts_of(made.RUNS)))
        assert list(lines) == ["A (seed 3)", "B (seed 2): no plans"]
        stairs = lines["A (seed 3)"]
        assert stairs.get_xydata().tolist() == [[0, 2], [1, 2], [1, 1], [3, 1], [3, 0]]
        start, step = stairs.get_markevery()
        assert stairs.get_xydata()[start::step].tolist() == [[1, 2], [3, 1]]  # the plans
        assert lines["B (seed 2): no plans"].get_xydata().tolist() == []

    def test_reference_and_bound(self):
        points = pd.DataFrame({"reward": [5.0, 2.0], "survivors": [1.0, 3.0]})
        ax = plots.plot_fronts(*made.fronts_of(made.RUNS), reference=points, bound=points)
        assert read.legend_texts(ax)[-2:] == ["reference front", "no plan lies beyond"]
        for name in read.legend_texts(ax)[-2:]:
            line = read.lines_of(ax)[name].get_xydata().tolist()
            assert line == [[0, 3], [2, 3], [2, 1], [5, 1], [5, 0]]


points = st.tuples(st.integers(0, 4), st.integers(0, 4))
sets_of_points = st.lists(st.lists(points, max_size=4), min_size=1, max_size=5)
CELLS = [(x + 0.5, y + 0.5) for x in range(4) for y in range(4)]


def as_fronts(sets):
    return [np.array(points, float).reshape(-1, 2) for points in sets]


def share_reaching(sets, x, y):
    """How many of the runs have a plan with at least this reward and these survivors."""
    return sum(any(r >= x and s >= y for r, s in run) for run in sets) / len(sets)


class TestAttainment:
    @given(sets_of_points, st.sampled_from([0, 25, 50, 75, 100]))
    def test_it_bounds_what_so_many_runs_reach(self, sets, percent):
        surface = attainment_surface(as_fronts(sets), percent)
        for x, y in CELLS:
            share = share_reaching(sets, x, y)
            inside = any(r >= x and s >= y for r, s in surface)
            assert inside == (share > 0 and share >= percent / 100)

    def test_lines_and_bands(self):
        three = [[(1, 3), (3, 1)], [(2, 2)], []]
        runs = {("A", seed): run for seed, run in enumerate(three)}
        ax = plots.plot_attainment(*made.fronts_of({**runs, ("B", 1): [(1, 1)]}))
        lines = read.lines_of(ax)
        assert lines["A"].get_xydata().tolist() == [[0, 2], [1, 2], [1, 1], [2, 1], [2, 0]]
        assert lines["B"].get_xydata().tolist() == [[0, 1], [1, 1], [1, 0]]
        # From what one run reaches to what all do, which is nothing.
        (band,) = ax.patches
        assert [1, 3] in band.get_xy().tolist()
        assert [0, 0] in band.get_xy().tolist()

    @given(sets_of_points, sets_of_points)
    @example([[(1, 1)]], [[(1, 1)], []])
    @example([[]], [[], []])
    @example([[(2, 2)]] * 3, [[(2, 2)]] * 2)
    @examples(200)
    def test_differences_are_those_of_the_shares_everywhere(self, mine, theirs):
        middles = np.arange(4) + 0.5
        shares = (attainment(as_fronts(sets), middles, middles) for sets in (mine, theirs))
        difference = next(shares) - next(shares)
        for x, y in CELLS:
            expected = share_reaching(mine, x, y) - share_reaching(theirs, x, y)
            assert difference[int(y), int(x)] == pytest.approx(expected)

    def test_both_panels_of_a_difference(self):
        plans, runs = made.fronts_of({("A", 1): [(2, 1)], ("B", 1): [(1, 2)], ("B", 2): [(1, 2)]})
        panels = plots.plot_attainment_difference(plans, runs, "A", "B")
        medians = [[[0, 1], [2, 1], [2, 0]], [[0, 2], [1, 2], [1, 0]]]
        for ax, (x, y), median in zip(panels, ((1.5, 0.5), (0.5, 1.5)), medians, strict=True):
            [image] = ax.images
            assert image.get_extent() == [0, 2, 0, 2]
            # Only one of the four quarters is filled, with the largest difference.
            steps = image.get_array()
            row, column = int(y / 2 * len(steps)), int(x / 2 * len(steps))
            assert steps[row, column] == 5
            assert steps.count() == steps.size // 4
            any_run, half = ax.lines
            assert half.get_xydata().tolist() == median
            assert any_run.get_xydata().tolist() == [[0, 2], [1, 2], [1, 1], [2, 1], [2, 0]]
        assert [read.title(ax) for ax in panels] == [f"{a} reaches more often" for a in "AB"]


class TestRanks:
    def bars(self, ax):
        """Return the ends of the bars that join algorithms."""
        bars = [line.get_xdata() for line in ax.lines if line.get_linewidth() == 2]
        return sorted((min(bar), max(bar)) for bar in bars)

    def test_bars_join_what_does_not_differ(self):
        ranks, posthoc = made.ranks_of(made.RANKS, 1.0)
        ax = plots.plot_ranks(ranks.iloc[[2, 0, 3, 1]], posthoc)
        assert self.bars(ax) == [(1.2, 2.0), (2.0, 2.9), (2.9, 3.9)]
        names = {text.get_text() for text in ax.texts}
        assert names == {"A  (1.20)", "B  (2.00)", "(2.90)  C", "(3.90)  D"}
        # Where Friedman's test overrules the pairs, nothing differs.
        assert self.bars(plots.plot_ranks(*made.ranks_of(made.RANKS, 9.0))) == [(1.2, 3.9)]
        with pytest.raises(ValueError, match="at least two algorithms, got 1"):
            plots.plot_ranks(ranks[:1], posthoc)


class TestShortfalls:
    def test_points_are_shares_of_the_reference_and_bars_certified_gaps(self):
        ax = plots.plot_shortfalls(*made.SHORTFALLS)
        # Missions without runs are left out; the first is on top.
        assert [tick.get_text() for tick in ax.get_yticklabels()] == ["mine", "site"]
        [points] = [c for c in ax.collections if len(c.get_offsets()) == 3]
        shown = sorted(tuple(np.round(point, 9)) for point in points.get_offsets().tolist())
        assert shown == [(0.0, 0.0), (10.0, 1.0), (20.0, 1.0)]
        assert [bar.get_width() for bar in ax.patches][1] == pytest.approx(1.0)  # 0.505 / 0.5
        assert ax.get_xlim()[0] == 0.0
        chosen = plots.plot_shortfalls(*made.SHORTFALLS, algorithms=["greedy"])
        [points] = [c for c in chosen.collections if len(c.get_offsets())]
        assert points.get_offsets().tolist() == [[pytest.approx(10.0), 1.0]]

    def test_what_is_refused(self):
        summary, missions = made.SHORTFALLS
        with pytest.raises(ValueError, match="an algorithm of summary"):
            plots.plot_shortfalls(summary, missions, algorithms=["bees"])
        with pytest.raises(ValueError, match=r"missions .* it lacks .'bound_area'"):
            plots.plot_shortfalls(summary, missions.drop(columns="bound_area"))
        with pytest.raises(ValueError, match=r"summary .* it lacks .'area_share'"):
            plots.plot_shortfalls(summary.drop(columns="area_share"), missions)


def test_every_cell_of_a_grid_says_its_median_and_the_largest_is_bold():
    ax = plots.plot_heat(made.MEDIANS)
    shown = {text.get_text(): text.get_fontweight() for text in ax.texts}
    assert shown == {"0.1000": "normal", "0.2500": "normal", "0.5000": "bold"}
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("evaporation", "n_ants")
    assert [t.get_text() for t in ax.get_xticklabels()] == ["0.04", "0.1"]
    assert [t.get_text() for t in ax.get_yticklabels()] == ["50", "100"]
    with pytest.raises(ValueError, match="at least one combination"):
        plots.plot_heat(made.MEDIANS * np.nan)
