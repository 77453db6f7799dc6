"""Targets reached, average ranks, grids of parameters, and small multiples for many algorithms."""

from __future__ import annotations

from itertools import combinations
from typing import ClassVar

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.plots import (
    plot_attainment,
    plot_curves,
    plot_fronts,
    plot_heat,
    plot_ranks,
    plot_reached,
    save_figure,
)
from botohe_moo.plots.study.ranks import groups_alike, overruled
from botohe_moo.plots.study.reached import reached_shares
from tests.plots.test_study_plots import TWO, drawn, fronts_of, only, trace_of, words


@pytest.fixture(autouse=True)
def _close_figures():
    mpl.use("Agg")
    yield
    plt.close("all")


def runs_of(keys):
    return pd.DataFrame([{"algorithm": a, "seed": s} for a, s in keys])


def boxes(fig, gid):
    fig.canvas.draw()
    return [
        child.get_window_extent()
        for ax in fig.axes
        for child in ax.get_children()
        if child.get_gid() == gid
    ]


def assert_apart(found):
    assert found
    assert not any(one.overlaps(other) for one, other in combinations(found, 2))


class TestReached:
    def test_shares_of_runs_and_targets(self):
        # A, 1 reaches 0.2 at 10 and 0.4 at 100; A, 2 reaches 0.1 at 20, 0.3 at 50, 0.5 at 100.
        shares = reached_shares(trace_of(TWO), runs_of(TWO), [0.1, 0.2, 0.3, 0.5])
        expected = [[10, 2 / 8], [20, 3 / 8], [50, 5 / 8], [100, 7 / 8]]
        np.testing.assert_allclose(shares["A"], expected)
        np.testing.assert_allclose(shares["B"], [[10, 1.0]])

    def test_runs_without_a_record_count(self):
        shares = reached_shares(trace_of(TWO), runs_of([*TWO, ("B", 2), ("C", 1)]), [0.1])
        np.testing.assert_allclose(shares["B"], [[10, 0.5]])
        assert shares["C"].shape == (0, 2)

    @given(
        st.dictionaries(
            st.tuples(st.sampled_from("AB"), st.integers(1, 4)),
            st.dictionaries(st.integers(1, 50), st.floats(0, 1), max_size=5),
            min_size=1,
            max_size=6,
        ),
        st.lists(st.floats(0.01, 1), min_size=1, max_size=6),
    )
    def test_it_is_the_share_of_pairs(self, runs, targets):
        trace = trace_of({key: list(records.items()) for key, records in runs.items()})
        for label, points in reached_shares(trace, runs_of(runs), targets).items():
            own = [records for (algorithm, _), records in runs.items() if algorithm == label]
            assert (np.diff(points[:, 0]) > 0).all()
            for x, share in points:
                pairs = [
                    any(area >= target - 1e-12 for at, area in run.items() if at <= x)
                    for run in own
                    for target in targets
                ]
                assert share == pytest.approx(np.mean(pairs))

    def test_lines_begin_at_nothing_and_end_at_the_edge(self):
        ax = plot_reached(trace_of(TWO), runs_of([*TWO, ("C", 1)]), [0.1, 0.9], title="A\nB")
        for line in drawn(ax, "reached"):
            x, y = line.get_data()
            assert (x[0], y[0], x[-1]) == (10, 0, 100)
            assert ((np.diff(x) == 0) | (np.diff(y) == 0)).all()
            assert (np.diff(y) >= 0).all()
        assert {text.get_text() for text in drawn(ax, "name")} == set("ABC")
        assert words(ax) == "2 targets for each run"
        assert only(ax, "subtitle").get_text() == "B"

    @pytest.mark.parametrize("targets", [[], [0.5, np.nan]])
    def test_targets_are_numbers(self, targets):
        with pytest.raises(ValueError, match="at least one target, all finite"):
            plot_reached(trace_of(TWO), runs_of(TWO), targets)


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

    def test_bars_join_what_does_not_differ(self):
        posthoc = posthoc_of(self.RANKS, 1.0)
        assert groups_alike("ABCD", posthoc) == [["A", "B"], ["B", "C"], ["C", "D"]]
        assert groups_alike("ABCD", posthoc_of(self.RANKS, 3.0)) == [["A", "B", "C", "D"]]
        assert groups_alike("ABCD", posthoc_of(self.RANKS, 0.1)) == []

    @given(st.lists(st.floats(1, 9), min_size=2, max_size=9), st.floats(0, 4))
    def test_groups_are_the_largest_without_a_difference(self, values, difference):
        ranks = dict(zip("ABCDEFGHI", sorted(values), strict=False))
        labels, n = list(ranks), len(ranks)
        groups = groups_alike(labels, posthoc_of(ranks, difference))
        runs = [labels[i:j] for i in range(n) for j in range(i + 2, n + 1)]
        alike = [run for run in runs if ranks[run[-1]] - ranks[run[0]] <= difference]
        largest = [r for r in alike if not any(set(r) < set(other) for other in alike)]
        assert groups == largest

    def test_the_diagram(self):
        shuffled = {label: self.RANKS[label] for label in "CADB"}
        ax = plot_ranks(self.table(shuffled), posthoc_of(self.RANKS, 1.0), title="A study")
        assert [line.get_xdata()[0] for line in drawn(ax, "rank")] == [1.2, 2.0, 3.9, 2.9]
        bars = [line.get_xdata() for line in drawn(ax, "alike")]
        np.testing.assert_allclose(bars, [[1.16, 2.04], [1.96, 2.94], [2.86, 3.94]])
        start, end = only(ax, "difference").get_xdata()
        assert end - start == pytest.approx(1.0)
        assert {text.get_text() for text in drawn(ax, "name")} == {
            "A  (1.20)",
            "B  (2.00)",
            "C  (2.90)",
            "D  (3.90)",
        }
        assert words(ax).startswith("average ranks over 5 missions, 1 is best")

    def test_what_friedman_overrules_has_no_ruler(self):
        posthoc = posthoc_of(self.RANKS, 1.0)
        assert not overruled(posthoc)
        posthoc["significant"] = False
        assert overruled(posthoc)
        ax = plot_ranks(self.table(self.RANKS), posthoc)
        assert drawn(ax, "difference") == []
        [bar] = drawn(ax, "alike")
        np.testing.assert_allclose(bar.get_xdata(), [1.16, 3.94])

    @pytest.mark.parametrize("n", [2, 14, 40])
    def test_names_stand_apart(self, n):
        ranks = {f"BO-ACO (n_ants={i}, evaporation=0.0{i}, q=1)": 1.0 + i * 0.9 for i in range(n)}
        ax = plot_ranks(self.table(ranks), posthoc_of(ranks, 2.0), title="A study")
        above = [only(ax, "words").get_window_extent()]
        assert_apart(above + boxes(ax.figure, "name"))

    def test_one_alone_has_no_ranks(self):
        with pytest.raises(ValueError, match="at least two algorithms, got 1"):
            plot_ranks(self.table({"A": 1.0}), posthoc_of({"A": 1.0}, 1.0))


class TestHeat:
    MEDIANS = pd.DataFrame(
        [[0.1, 0.25], [0.5, np.nan]],
        index=pd.Index([50, 100], name="n_ants"),
        columns=pd.Index([0.04, 0.1], name="evaporation"),
    )

    def test_every_cell_says_its_median(self):
        ax = plot_heat(self.MEDIANS, title="A site")
        told = {text.get_position(): text.get_text() for text in drawn(ax, "median")}
        assert told == {(0, 0): "0.1000", (1, 0): "0.2500", (0, 1): "0.5000"}
        assert ax.get_xlabel() == "evaporation"
        assert ax.get_ylabel() == "n_ants"
        assert [t.get_text() for t in ax.get_xticklabels()] == ["0.04", "0.1"]
        assert [t.get_text() for t in ax.get_yticklabels()] == ["50", "100"]
        assert ax.get_ylim()[0] > ax.get_ylim()[1]

    def test_the_larger_the_darker(self):
        cells = drawn(plot_heat(self.MEDIANS), "cell")
        shades = [np.asarray(cell.get_facecolor())[:3] @ [0.21, 0.72, 0.07] for cell in cells]
        assert shades[0] > shades[1] > shades[2]

    def test_texts_lie_in_their_cells_and_apart(self):
        values = pd.DataFrame(np.arange(48).reshape(6, 8) / 50)
        ax = plot_heat(values.rename_axis("a").rename_axis("b", axis=1))
        assert_apart(boxes(ax.figure, "median"))

    def test_nothing_is_no_grid(self):
        with pytest.raises(ValueError, match="at least one combination, got none"):
            plot_heat(self.MEDIANS * np.nan)


def many(n):
    return [f"BO-ACO (n_ants={i}, evaporation={e})" for i in range(n) for e in (0.04, 0.1)][:n]


PANELS = {
    "curves": lambda labels: plot_curves(
        trace_of({(a, s): [(1, 0.1), (50, 0.5 + s / 10)] for a in labels for s in (1, 2)}),
        title="mission\nA site",
    ),
    "reached": lambda labels: plot_reached(
        trace_of({(a, 1): [(1, 0.1), (50, 0.5)] for a in labels}),
        runs_of([(a, 1) for a in labels]),
        [0.2],
        title="mission\nA site",
    ),
    "fronts": lambda labels: plot_fronts(
        *fronts_of({(a, 1): [(1, 2), (2, 1)] for a in labels}),
        reference=pd.DataFrame({"reward": [3.0], "survivors": [3.0]}),
        title="mission\nA site",
    ),
    "attainment": lambda labels: plot_attainment(
        *fronts_of({(a, s): [(s, 2), (2, s)] for a in labels for s in (1, 2)}),
        title="mission\nA site",
    ),
}
OWN = {"curves": "curve", "reached": "reached", "fronts": "stairs", "attainment": "median"}


class TestPanels:
    @pytest.mark.parametrize("kind", PANELS)
    @pytest.mark.parametrize("n", [12, 26])
    def test_from_twelve_on_each_has_one(self, kind, n):
        labels = many(n)
        fig = PANELS[kind](labels).figure
        assert len(fig.axes) == n
        for ax, label in zip(fig.axes, labels, strict=True):
            assert len(drawn(ax, OWN[kind])) == 1
            assert len(only(ax, "others").get_paths()) == n - 1
            name = " ".join(only(ax, "name").get_text().split())
            assert name.startswith(label)
            assert ax.get_xlim() == fig.axes[0].get_xlim()
            assert ax.get_ylim() == fig.axes[0].get_ylim()
        assert fig.axes[0].get_title(loc="left") == "mission"
        assert "in grey all others" in words(fig.axes[0])

    @pytest.mark.parametrize("kind", PANELS)
    def test_eleven_share_one_plot(self, kind):
        assert len(PANELS[kind](many(11)).figure.axes) == 1

    @pytest.mark.parametrize("kind", PANELS)
    @pytest.mark.parametrize("n", [13, 40])
    def test_nothing_lies_over_another(self, kind, n):
        fig = PANELS[kind](many(n)).figure
        names = boxes(fig, "name")
        assert_apart([*names, *boxes(fig, "words"), *boxes(fig, "subtitle")])
        frames = [ax.get_window_extent() for ax in fig.axes]
        assert not any(name.overlaps(frame) for name in names for frame in frames)
        width, height = fig.get_size_inches()
        assert width < 16
        assert height < 25

    @pytest.mark.parametrize("kind", PANELS)
    def test_names_of_several_lines_have_room(self, kind):
        labels = [f"BO-ACO, memetic (n_ants={i}, evaporation=0.0{i})" for i in range(10, 23)]
        fig = PANELS[kind](labels).figure
        assert all("\n" in only(ax, "name").get_text() for ax in fig.axes)
        names = boxes(fig, "name")
        assert_apart([*names, *boxes(fig, "words"), *boxes(fig, "subtitle")])
        frames = [ax.get_window_extent() for ax in fig.axes]
        assert not any(name.overlaps(frame) for name in names for frame in frames)

    def test_given_axes_take_all(self):
        _, ax = plt.subplots()
        trace = trace_of({(a, 1): [(1, 0.1), (50, 0.5)] for a in many(12)})
        assert plot_curves(trace, ax=ax) is ax
        assert len(drawn(ax, "curve")) == 12


LONG = {
    "a grid": many(11),
    "long words": ["x" * 90, "y" * 200, "z"],
    "long texts": [f"{i} " + "an algorithm that somebody described at length, " * 3 for i in "abc"],
    "far away": ["蟻コロニー最適化", "遺伝的アルゴリズム", "焼きなまし法"],
}


class TestNames:
    @pytest.mark.parametrize("labels", LONG.values(), ids=LONG)
    @pytest.mark.parametrize("kind", ["curves", "reached"])
    def test_names_right_of_a_plot_are_whole_and_apart(self, kind, labels):
        ax = PANELS[kind](labels)
        names = boxes(ax.figure, "name")
        assert len(names) == len(labels)
        assert_apart([*names, *boxes(ax.figure, "words"), *boxes(ax.figure, "subtitle")])
        assert all(name.x0 > ax.get_window_extent().x1 for name in names)
        assert not any("…" in text.get_text() for text in drawn(ax, "name"))

    @pytest.mark.parametrize("kind", PANELS)
    def test_the_label_of_the_mission_is_the_title(self, kind):
        ax = PANELS[kind](["A", "B"])
        assert ax.get_title(loc="left") == "mission"
        assert only(ax, "subtitle").get_text() == "A site"

    @pytest.mark.parametrize("kind", PANELS)
    def test_files_are_the_same_every_time(self, tmp_path, kind):
        for folder in ("one", "two"):
            (tmp_path / folder).mkdir()
            ends = ("png", "pdf", "svg")
            paths = [tmp_path / folder / f"{kind}.{end}" for end in ends]
            save_figure(PANELS[kind](["A", "漢字"]).figure, *paths)
        for path in (tmp_path / "one").iterdir():
            assert path.read_bytes() == (tmp_path / "two" / path.name).read_bytes()
