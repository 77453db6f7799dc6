"""What the pictures of a study show; curves and attainment are compared with readable twins."""

from __future__ import annotations

from itertools import pairwise

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from matplotlib.colors import to_rgb

from botohe_moo.plots import (
    algorithm_styles,
    plot_areas,
    plot_attainment,
    plot_attainment_difference,
    plot_curves,
    plot_fronts,
    save_figure,
)
from botohe_moo.plots.draw.scales import log_axis, plain_number, spread
from botohe_moo.plots.study.attainment import attainment_difference, attainment_surface
from botohe_moo.plots.study.curves import progress_curves
from botohe_moo.plots.study.fronts import median_run
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


def drawn(ax, gid):
    return [artist for artist in ax.get_children() if artist.get_gid() == gid]


def only(ax, gid):
    (artist,) = drawn(ax, gid)
    return artist


def words(ax):
    return " ".join(only(ax, "words").get_text().split())


def legend_texts(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


TWO = {
    ("A", 1): [(10, 0.2), (100, 0.4)],
    ("A", 2): [(20, 0.1), (50, 0.3), (100, 0.5)],
    ("B", 1): [(10, 0.6)],
}


# Styles


class TestStyles:
    def test_forty_algorithms_differ_in_colour_or_line(self):
        styles = algorithm_styles([f"a{i}" for i in range(40)])
        assert len({(style.colour, style.line) for style in styles.values()}) == 40

    def test_two_of_one_colour_differ_in_marker_and_line(self):
        first, *_, eleventh = algorithm_styles("abcdefghijk").values()
        assert first.colour == eleventh.colour
        assert first.marker != eleventh.marker
        assert first.line != eleventh.line

    def test_a_style_comes_from_the_place_among_all(self):
        assert algorithm_styles(["A", "B", "A"]) == algorithm_styles(["A", "B"])
        assert algorithm_styles("ABC")["B"] == algorithm_styles("XB")["B"]

    def test_one_without_style_is_named(self):
        with pytest.raises(ValueError, match="missing: B"):
            plot_curves(trace_of(TWO), styles=algorithm_styles("A"))


# Curves


class TestProgressCurves:
    def test_records_hold_until_the_next_one(self):
        curve = progress_curves(trace_of(TWO), n_points=3)["A"]
        # The grid is 10, 31.6, 100; both runs have a record from 20 on.
        np.testing.assert_allclose(curve.x, [20, 10**1.5, 100])
        np.testing.assert_allclose(curve.middle, [0.15, 0.15, 0.45])
        assert curve.n_runs == 2
        assert curve.ended == 100

    def test_a_run_that_ended_keeps_its_area(self):
        curve = progress_curves(trace_of(TWO), n_points=3)["B"]
        np.testing.assert_allclose(curve.x, [10, 10**1.5, 100])
        np.testing.assert_allclose(curve.middle, [0.6, 0.6, 0.6])
        assert curve.ended == 10

    def test_the_band_lies_between_the_quartiles_around_the_median(self):
        areas = [0.9, 0.1, 0.4, 0.2, 0.8]
        trace = trace_of({("A", seed): [(1, area)] for seed, area in enumerate(areas)})
        curve = progress_curves(trace, n_points=2)["A"]
        np.testing.assert_allclose(curve.middle, 0.4)
        np.testing.assert_allclose(curve.low, 0.2)
        np.testing.assert_allclose(curve.high, 0.8)

    def test_distances_over_evaluations(self):
        trace = trace_of(TWO).assign(igd_plus=[0.4, 0.2, 0.5, 0.3, 0.1, np.nan])
        curves = progress_curves(trace, value="igd_plus", n_points=3)
        assert list(curves) == ["A"]  # B has none
        np.testing.assert_allclose(curves["A"].middle, [0.45, 0.45, 0.15])

    def test_the_band_is_one_standard_deviation_where_runs_are(self):
        trace = trace_of({("A", seed): [(1, area)] for seed, area in enumerate([0.0, 0.0, 0.3])})
        curve = progress_curves(trace, band="sd", n_points=2)["A"]
        np.testing.assert_allclose(curve.middle, 0.1)
        np.testing.assert_allclose(curve.low, 0.0)  # not 0.1 - 0.1732
        np.testing.assert_allclose(curve.high, 0.1 + 0.3 / np.sqrt(3))

    def test_the_band_is_the_range(self):
        curve = progress_curves(trace_of(TWO), band="range", n_points=3)["A"]
        np.testing.assert_allclose(curve.low, [0.1, 0.1, 0.4])
        np.testing.assert_allclose(curve.high, [0.2, 0.2, 0.5])

    def test_records_at_no_time_count_from_the_first_moment(self):
        trace = trace_of({("A", 1): [(0, 0.1), (200, 0.3)], ("A", 2): [(0, 0.2), (400, 0.5)]})
        curve = progress_curves(trace, x="seconds", n_points=2)["A"]
        np.testing.assert_allclose(curve.x, [2, 4])
        np.testing.assert_allclose(curve.middle, [(0.3 + 0.2) / 2, (0.3 + 0.5) / 2])

    def test_only_records_at_no_time(self):
        curve = progress_curves(trace_of({("A", 1): [(0, 0.1)]}), x="seconds")["A"]
        assert set(curve.middle) == {0.1}

    def test_the_later_of_two_records_at_once_counts(self):
        curve = progress_curves(trace_of({("A", 1): [(5, 0.1), (5, 0.2)]}))["A"]
        assert set(curve.middle) == {0.2}

    def test_those_asked_for_in_their_order(self):
        trace = trace_of(TWO)
        assert list(progress_curves(trace)) == ["A", "B"]
        assert list(progress_curves(trace, algorithms=["B", "A"])) == ["B", "A"]
        # The grid is that of what is drawn.
        assert progress_curves(trace, algorithms=["B"])["B"].x.max() == 10

    @given(
        st.dictionaries(
            st.tuples(st.sampled_from("AB"), st.integers(1, 4)),
            st.dictionaries(st.integers(1, 500), st.floats(0, 1), min_size=1, max_size=6),
            min_size=1,
            max_size=6,
        ),
        st.randoms(use_true_random=False),
    )
    def test_every_point_is_the_median_of_the_last_records(self, runs, chance):
        trace = trace_of({key: list(records.items()) for key, records in runs.items()})
        rows = list(range(len(trace)))
        chance.shuffle(rows)
        last = max(max(records) for records in runs.values())
        for label, curve in progress_curves(trace.iloc[rows], n_points=7).items():
            own = [records for (algorithm, _), records in runs.items() if algorithm == label]
            assert curve.x[0] == max(min(records) for records in own)
            assert curve.x[-1] == last
            assert (np.diff(curve.x) > 0).all()
            for x, middle, low, high in zip(
                curve.x, curve.middle, curve.low, curve.high, strict=True
            ):
                areas = [r[max(at for at in r if at <= x)] for r in own]
                lower, median, upper = np.quantile(areas, [0.25, 0.5, 0.75])
                assert (low, middle, high) == pytest.approx((lower, median, upper))

    @pytest.mark.parametrize(
        ("change", "options", "message"),
        [
            ({}, {"x": "hours"}, "Expected x to be evaluations or seconds, got 'hours'"),
            ({}, {"band": "se"}, "Expected band to be quartiles or sd or range, got 'se'"),
            ({}, {"value": "hv"}, "Expected value to be area or igd_plus or epsilon, got 'hv'"),
            ({"epsilon": np.nan}, {"value": "epsilon"}, "at least one row of trace, got none"),
            ({}, {"algorithms": ["a"]}, "an algorithm of trace, got 'a'; known are A, B"),
            ({}, {"algorithms": []}, "at least one row of trace, got none"),
            ({"mission": list("xxxxxy")}, {}, "trace of one mission, got 'x', 'y'"),
            ({"evaluations": [1, 2, np.nan, 4, 5, 6]}, {}, r"evaluations in \[0, inf\), got nan"),
            ({"evaluations": -1}, {}, r"evaluations in \[0, inf\), got -1"),
            ({}, {"bound": 1.5}, r"bound in \[0, 1\], got 1\.5"),
            ({}, {"bound": 0.5, "value": "igd_plus"}, "no bound, which is of areas, with igd_plus"),
        ],
    )
    def test_what_it_refuses(self, change, options, message):
        with pytest.raises(ValueError, match=message):
            plot_curves(trace_of(TWO).assign(**change), **options)

    def test_a_missing_column_is_named(self):
        with pytest.raises(ValueError, match=r"it lacks \['area'\]"):
            plot_curves(trace_of(TWO).drop(columns="area"))


class TestPlotCurves:
    def test_lines_and_bands(self):
        ax = plot_curves(trace_of(TWO), title="A site")
        styles = algorithm_styles("AB")
        a, b = drawn(ax, "curve")
        assert to_rgb(a.get_color()) == pytest.approx(styles["A"].colour)
        # Steps: level or upright.
        assert ((np.diff(a.get_xdata()) == 0) | (np.diff(a.get_ydata()) == 0)).all()
        assert a.get_ydata()[-1] == pytest.approx(0.45)
        assert len(drawn(ax, "band")) == 1  # one run has none
        # B has one record: a point, and a thinner line to the end.
        assert b.get_xdata().tolist() == [10]
        assert only(ax, "marks").get_xdata().tolist() == [10]
        assert only(ax, "marks").get_marker() == styles["B"].marker
        held = only(ax, "held")
        assert held.get_xdata() == pytest.approx([10, 100])
        assert held.get_ydata() == pytest.approx([0.6, 0.6])
        assert held.get_linewidth() < b.get_linewidth()
        assert ax.get_xscale() == "log"
        assert ax.get_title(loc="left") == "A site"
        assert words(ax).startswith("median of 1 to 2 runs and quartiles")

    @pytest.mark.parametrize(
        ("runs", "options", "said"),
        [
            ({("A", 1): [(1, 0.5)]}, {}, "one run of each"),
            ({("A", s): [(1, 0.5)] for s in (1, 2)}, {}, "median of 2 runs and quartiles"),
            (
                {("A", s): [(1, 0.5)] for s in (1, 2)},
                {"band": "sd"},
                "mean of 2 runs ± 1 standard deviation",
            ),
            (
                {("A", s): [(1, 0.5)] for s in (1, 2)},
                {"band": "range"},
                "median of 2 runs and range",
            ),
        ],
    )
    def test_it_says_what_the_band_is(self, runs, options, said):
        assert words(plot_curves(trace_of(runs), **options)) == said

    def test_a_bound_is_a_dashed_line_in_sight(self):
        ax = plot_curves(trace_of(TWO), bound=0.6)
        line = only(ax, "bound")
        assert (set(line.get_ydata()), line.get_linestyle()) == ({0.6}, "--")
        assert ax.get_ylim()[1] > 0.6
        assert words(ax).endswith("; dashed: no front reaches more than 0.6000")

    def test_one_that_is_too_far_is_only_told(self):
        runs = {("A", 1): [(1, 0.1), (9, 0.12)]}
        ax = plot_curves(trace_of(runs), bound=0.9)
        assert not drawn(ax, "bound")
        assert ax.get_ylim() == plot_curves(trace_of(runs)).get_ylim()
        assert words(ax).endswith("; no front reaches more than 0.9000, off the axis")

    def test_panels_have_it_each(self):
        runs = {(f"a{i}", 1): [(1, 0.1), (9, 0.5)] for i in range(12)}
        ax = plot_curves(trace_of(runs), bound=0.6)
        assert all(drawn(panel, "bound") for panel in ax.figure.axes)

    def test_a_long_low_start_is_cut_off_and_said_to_be(self):
        runs = {
            ("A", 1): [(1, 0.0), (1000, 0.5), (2000, 0.52)],
            ("B", 1): [(1, 0.4), (2000, 0.48)],
        }
        ax = plot_curves(trace_of(runs))
        low, high = ax.get_ylim()
        assert 0.2 < low < 0.27
        assert 0.52 < high < 0.55
        assert words(ax).endswith(f"; areas below {low:.2f} cut off")

    def test_nothing_is_cut_off_from_one_that_ends_low(self):
        ax = plot_curves(trace_of({("A", 1): [(1, 0.5), (9, 0.6)], ("B", 1): [(1, 0.0)]}))
        assert ax.get_ylim()[0] <= 0
        assert "cut off" not in words(ax)

    def test_many_curves_have_markers_too(self):
        runs = {(f"a{i}", 1): [(1, 0.1 * i), (50, 0.11 * i)] for i in range(7)}
        markers = [line.get_marker() for line in drawn(plot_curves(trace_of(runs)), "marks")]
        assert len(set(markers)) == 7
        assert "None" not in markers
        few = {key: runs[key] for key in list(runs)[:6]}
        assert not drawn(plot_curves(trace_of(few)), "marks")

    def test_names_of_curves_that_end_together_do_not_overlap(self):
        runs = {(f"algorithm {i}", 1): [(1, 0.1), (50, 0.5)] for i in range(11)}
        ax = plot_curves(trace_of(runs))
        ax.figure.canvas.draw()
        boxes = sorted((t.get_window_extent() for t in drawn(ax, "name")), key=lambda b: b.y0)
        assert len(boxes) == 11
        assert all(low.y1 < high.y0 for low, high in pairwise(boxes))
        assert all(box.x0 > ax.get_window_extent().x1 for box in boxes)
        above = only(ax, "words").get_window_extent()
        assert not any(box.overlaps(above) for box in boxes)

    def test_names_are_in_the_order_of_the_curves(self):
        ends = {"A": 0.5, "B": 0.7, "C": 0.5001}
        ax = plot_curves(trace_of({(k, 1): [(1, 0.1), (9, v)] for k, v in ends.items()}))
        heights = {text.get_text(): text.xy[1] for text in drawn(ax, "name")}
        assert sorted(heights, key=heights.get) == ["A", "C", "B"]

    def test_labels_are_no_mathematics(self, tmp_path):
        label = r"$\frac{$ <b>&_^"
        ax = plot_curves(trace_of({(label, 1): [(1, 0.1)]}), title="$x")
        save_figure(ax.figure, tmp_path / "a.png")
        assert only(ax, "name").get_text() == label

    def test_given_axes_are_used(self):
        _, ax = plt.subplots()
        assert plot_curves(trace_of(TWO), ax=ax) is ax


class TestScales:
    @given(st.floats(1e-4, 1e7), st.floats(1.0, 1e7))
    @example(10.0, 1.0)
    @example(1.05, 6.4)
    @example(0.9999, 6.6)
    @examples(30)
    def test_at_least_two_plain_numbers_are_in_sight(self, low, ratio):
        fig, ax = plt.subplots(figsize=(4, 2), dpi=50)
        log_axis(ax, low, low * ratio)
        left, right = ax.get_xlim()
        assert left <= low
        assert low * ratio <= right
        ticks = [t for t in ax.get_xticks() if left <= t <= right]
        assert len(ticks) >= 2
        shown = ax.xaxis.get_major_formatter().format_ticks(ticks)
        assert not any("$" in text or "e" in text for text in shown)
        plt.close(fig)

    @pytest.mark.parametrize(
        ("value", "text"),
        [
            (1e-4, "0.0001"),
            (0.2, "0.2"),
            (1, "1"),
            (50, "50"),
            (10_000, "10,000"),
            (500_000, "500,000"),
            (2e6, "2M"),
            (1e9, "1,000M"),
        ],
    )
    def test_numbers_are_plain(self, value, text):
        assert plain_number(value) == text

    def test_places_move_no_more_than_needed(self):
        assert spread([0.9, 0.5, 0.5], 0.2).tolist() == pytest.approx([0.9, 0.4, 0.6])
        assert spread([0.1, 0.9], 0.2).tolist() == pytest.approx([0.1, 0.9])
        assert spread([1.0, 1.0], 0.2).tolist() == pytest.approx([0.8, 1.0])
        assert spread([], 0.1).tolist() == []

    @given(st.lists(st.floats(0, 1), min_size=1, max_size=20), st.floats(0.001, 0.2))
    def test_places_are_apart_in_order_and_within(self, wanted, gap):
        places = spread(wanted, gap)
        order = np.argsort(wanted, kind="stable")
        assert (np.diff(places[order]) >= gap - 1e-9).all()
        assert (places >= -1e-9).all()
        if gap * (len(wanted) - 1) <= 1:
            assert (places <= 1 + 1e-9).all()


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
        runs = drawn(ax, "runs")
        assert [sorted(points.get_xdata()) for points in runs] == [[0.1, 0.2, 0.3], [0.5], [0.4]]
        crosses = drawn(ax, "not done")
        assert [points.get_xdata().tolist() for points in crosses] == [[], [], [0.0]]
        assert [m.get_xdata()[0] for m in drawn(ax, "median")] == [0.2, 0.5, 0.2]
        ends = [list(line.get_xdata()) for line in drawn(ax, "interval")]
        assert ends == [[0.1, 0.3], [0.5, 0.5], [0, 0.4]]
        assert [label.get_text() for label in ax.get_yticklabels()] == ["A", "B", "C"]
        assert ax.get_ylim()[0] > ax.get_ylim()[1]  # the first is on top
        assert "crosses: runs that are not done" in words(ax)

    def test_a_bound_is_a_dashed_line_unless_it_is_too_far(self):
        near, far = (plot_areas(*areas_of(VALUES), bound=bound) for bound in (0.7, 1.0))
        assert set(only(near, "bound").get_xdata()) == {0.7}
        assert near.get_xlim()[1] > 0.7
        assert "dashed: no front reaches more than 0.7000" in words(near)
        assert set(only(far, "bound").get_xdata()) == {1.0}
        narrow = plot_areas(*areas_of({"A": [0.3, 0.31]}), bound=0.4)
        assert not drawn(narrow, "bound")
        assert narrow.get_xlim()[1] < 0.32
        assert "no front reaches more than 0.4000, off the axis" in words(narrow)

    def test_without_lost_runs_nothing_is_said_of_them(self):
        assert "crosses" not in words(plot_areas(*areas_of(VALUES)))

    def test_points_of_thirty_runs_lie_apart_and_in_their_row(self):
        ax = plot_areas(*areas_of({"A": [0.2] * 30, "B": [0.2] * 30}))
        for row, points in enumerate(drawn(ax, "runs")):
            heights = np.sort(points.get_ydata())
            assert np.diff(heights).min() > 0.005
            assert heights[0] > row - 0.3
            assert heights[-1] < row + 0.5

    def test_the_order_of_rows_changes_nothing(self):
        runs, summary = areas_of(VALUES)
        there = plot_areas(runs, summary, algorithms=list("ABC"))
        back = plot_areas(runs.iloc[::-1], summary.iloc[::-1], algorithms=list("ABC"))
        for one, other in zip(drawn(there, "runs"), drawn(back, "runs"), strict=True):
            np.testing.assert_array_equal(one.get_xydata(), other.get_xydata())

    def test_areas_that_are_all_alike_are_not_blown_up(self):
        ax = plot_areas(*areas_of({"A": [0.25, 0.25]}))
        left, right = ax.get_xlim()
        assert left < 0.25 < right
        assert right - left >= 0.009

    def test_one_without_summary_is_named(self):
        runs, summary = areas_of(VALUES)
        with pytest.raises(ValueError, match="an algorithm of summary, got 'B'"):
            plot_areas(runs, summary[summary["algorithm"] != "B"])


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
    def test_the_median_run_is_drawn(self):
        ax = plot_fronts(*fronts_of(RUNS))
        a, b = drawn(ax, "front")
        assert a.get_xydata().tolist() == [[1, 2], [3, 1]]
        assert b.get_xydata().tolist() == []
        assert legend_texts(ax) == ["A (seed 3)", "B (seed 2): no plans"]

    def test_stairs_end_at_the_axes(self):
        ax = plot_fronts(*fronts_of(RUNS), algorithms=["A"])
        stairs = only(ax, "stairs").get_xydata().tolist()
        assert stairs == [[0, 2], [1, 2], [1, 1], [3, 1], [3, 0]]

    def test_the_reference_front(self):
        reference = pd.DataFrame({"reward": [5.0, 2.0], "survivors": [1.0, 3.0]})
        ax = plot_fronts(*fronts_of(RUNS), reference=reference)
        line = only(ax, "reference").get_xydata().tolist()
        assert line == [[0, 3], [2, 3], [2, 1], [5, 1], [5, 0]]
        assert legend_texts(ax)[0] == "all runs together"

    def test_the_bound(self):
        bound = pd.DataFrame({"reward": [5.0, 2.0], "survivors": [1.0, 3.0]})
        ax = plot_fronts(*fronts_of(RUNS), bound=bound)
        line = only(ax, "bound")
        assert line.get_xydata().tolist() == [[0, 3], [2, 3], [2, 1], [5, 1], [5, 0]]
        assert line.get_linestyle() == "--"
        assert legend_texts(ax)[0] == "no plan lies beyond"

    @pytest.mark.parametrize(
        ("areas", "seed"), [([0.5], 1), ([0.1, 0.3], 1), ([0.3, 0.1, 0.2], 3), ([0.2, 0.2], 1)]
    )
    def test_of_the_middle_two_the_lower(self, areas, seed):
        runs = pd.DataFrame({"seed": range(1, len(areas) + 1), "area": areas})
        assert median_run(runs) == seed
        assert median_run(runs.iloc[::-1]) == seed


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
    @pytest.mark.parametrize(
        ("percent", "surface"),
        [
            (0, [[1, 3], [2, 2], [3, 1]]),
            (33, [[1, 3], [2, 2], [3, 1]]),
            (50, [[1, 2], [2, 1]]),  # two of three
            (66, [[1, 2], [2, 1]]),
            (67, [[0, 0]]),  # three, of which one reaches nothing
            (100, [[0, 0]]),
        ],
    )
    def test_of_three_runs(self, percent, surface):
        assert sorted(attainment_surface(as_fronts(THREE), percent).tolist()) == surface

    @given(sets_of_points, st.sampled_from([0, 25, 50, 75, 100]))
    def test_it_bounds_what_so_many_runs_reach(self, sets, percent):
        surface = attainment_surface(as_fronts(sets), percent)
        for x, y in CELLS:
            share = share_reaching(sets, x, y)
            assert inside(surface, x, y) == (share > 0 and share >= percent / 100)

    def test_no_runs_are_refused(self):
        with pytest.raises(ValueError, match="at least one run, got none"):
            attainment_surface([], 50)

    def test_lines_and_bands(self):
        runs = {("A", seed): run for seed, run in enumerate(THREE)}
        ax = plot_attainment(*fronts_of({**runs, ("B", 1): [(1, 1)]}))
        a, b = drawn(ax, "median")
        assert a.get_xydata().tolist() == [[0, 2], [1, 2], [1, 1], [2, 1], [2, 0]]
        assert b.get_xydata().tolist() == [[0, 1], [1, 1], [1, 0]]
        # From what one run reaches to what all do, which is nothing.
        outline = only(ax, "band").get_paths()[0].vertices.tolist()
        assert [1, 3] in outline
        assert [0, 0] in outline
        assert legend_texts(ax) == ["A", "B"]


class TestDifference:
    @given(sets_of_points, sets_of_points)
    @example([[(1, 1)]], [[(1, 1)], []])
    @example([[]], [[], []])
    @example([[(2, 2)]] * 3, [[(2, 2)]] * 2)
    @example([[(1, 2), (2, 1)]], [[(1, 2), (2, 1)]])
    @examples(300)
    def test_it_is_that_of_the_shares_everywhere(self, mine, theirs):
        rectangles, difference = attainment_difference(as_fronts(mine), as_fronts(theirs))
        for x, y in CELLS:
            expected = share_reaching(mine, x, y) - share_reaching(theirs, x, y)
            found = [
                ahead
                for (left, low, right, top), ahead in zip(rectangles, difference, strict=True)
                if left < x < right and low < y < top
            ]
            assert len(found) <= 1
            assert sum(found) == pytest.approx(expected)

    def test_of_one_and_two_runs(self):
        rectangles, difference = attainment_difference(
            as_fronts([[(2, 1)]]), as_fronts([[(1, 1)], []])
        )
        found = dict(zip(map(tuple, rectangles.tolist()), difference.tolist(), strict=True))
        assert found == {(0, 0, 1, 1): 0.5, (1, 0, 2, 1): 1.0}

    def test_of_numbers_of_runs_without_a_small_common_multiple(self):
        mine = [[(2, 2)]] * 11 + [[]] * 3  # 14 runs
        theirs = [[(2, 2)]] * 5 + [[(1, 1)]] * 8  # 13 runs: 182 is their least common multiple
        rectangles, difference = attainment_difference(as_fronts(mine), as_fronts(theirs))
        for x, y in [(0.5, 0.5), (1.5, 0.5), (1.5, 1.5)]:
            expected = share_reaching(mine, x, y) - share_reaching(theirs, x, y)
            inside_of = (rectangles[:, :2] < (x, y)).all(1) & (rectangles[:, 2:] > (x, y)).all(1)
            (found,) = difference[inside_of]
            assert found == pytest.approx(expected, abs=1 / 13)

    def test_both_panels(self):
        plans, runs = fronts_of({("A", 1): [(2, 1)], ("B", 1): [(1, 2)], ("B", 2): [(1, 2)]})
        left, right = plot_attainment_difference(plans, runs, "A", "B", title="A site")
        (mine,) = only(left, "ahead").get_paths()
        (theirs,) = only(right, "ahead").get_paths()
        assert mine.get_extents().bounds == (1, 0, 1, 1)
        assert theirs.get_extents().bounds == (0, 1, 1, 1)
        for ax, median in ((left, [[0, 1], [2, 1], [2, 0]]), (right, [[0, 2], [1, 2], [1, 0]])):
            assert only(ax, "median").get_xydata().tolist() == median
            best = only(ax, "best").get_xydata().tolist()
            assert best == [[0, 2], [1, 2], [1, 1], [2, 1], [2, 0]]
        assert left.get_title() == "A reaches more often"
        assert right.get_title() == "B reaches more often"

    @pytest.mark.parametrize(("n_ahead", "shade"), [(1, 1), (2, 2), (5, 5)])
    def test_the_larger_the_darker(self, n_ahead, shade):
        runs = {("A", s): [(1, 1)] if s <= n_ahead else [] for s in range(1, 6)}
        plans, rows = fronts_of({**runs, **{("B", s): [] for s in range(1, 6)}})
        left, right = plot_attainment_difference(plans, rows, "A", "B")
        (colour,) = only(left, "ahead").get_facecolor()
        key = left.get_legend().get_patches()[shade - 1].get_facecolor()
        assert tuple(colour) == pytest.approx(key)
        assert len(only(right, "ahead").get_paths()) == 0

    def test_nobody_is_ahead_of_his_like(self):
        plans, runs = fronts_of({("A", 1): [(1, 2), (2, 1)], ("B", 1): [(1, 2), (2, 1)]})
        for ax in plot_attainment_difference(plans, runs, "A", "B"):
            assert len(only(ax, "ahead").get_paths()) == 0

    def test_given_axes_are_used(self):
        _, axes = plt.subplots(1, 2)
        plans, runs = fronts_of({("A", 1): [(1, 1)], ("B", 1): []})
        assert plot_attainment_difference(plans, runs, "A", "B", axes=axes) == tuple(axes)

    def test_an_unknown_algorithm_is_named(self):
        with pytest.raises(ValueError, match="an algorithm of runs, got 'C'; known are A, B"):
            plot_attainment_difference(*fronts_of({("A", 1): [], ("B", 1): []}), "A", "C")


PICTURES = {
    "curves": lambda: plot_curves(trace_of(TWO)),
    "areas": lambda: plot_areas(*areas_of({"A": [0.1, 0.2], "B": [0.3]})),
    "fronts": lambda: plot_fronts(*fronts_of(RUNS)),
    "attainment": lambda: plot_attainment(*fronts_of(RUNS)),
    "difference": lambda: plot_attainment_difference(*fronts_of(RUNS), "A", "B")[0],
}


@pytest.mark.parametrize("draw", PICTURES.values(), ids=list(PICTURES))
def test_the_same_bytes_every_time(tmp_path, draw):
    for name in ("a.png", "b.png"):
        save_figure(draw().figure, tmp_path / name)
        plt.close("all")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
