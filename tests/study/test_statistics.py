"""Statistics against numbers that are found by hand."""

import math
import warnings

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy import stats

from botohe_moo.indicators import TIE
from botohe_moo.study.statistics import (
    a12,
    a12_interval,
    compare_algorithms,
    compare_ranks,
    effect_size,
    friedman,
    mann_whitney,
    median_interval,
    merge_ties,
    nemenyi,
    rank_algorithms,
    smallest_p,
)
from botohe_moo.study.tables import as_table
from tests.examples import examples

samples = st.lists(
    st.one_of(st.sampled_from([0.0, 0.5, 1.0]), st.floats(0, 1)), min_size=1, max_size=12
)
levels = st.floats(0.5, 0.999)


def test_median_intervals_by_hand():
    # Of 27 resamples 7 have the median 1, 13 the median 2, 7 the median 3.
    assert median_interval([3, 1, 2], confidence=0.95) == (1, 3)
    assert median_interval([3, 1, 2], confidence=0.40) == (2, 2)
    for values in ([0.3], [0.3, 0.3], [0.0] * 30):
        assert median_interval(values, confidence=0.95) == (values[0],) * 2


@given(samples, levels, st.randoms(use_true_random=False))
@examples(30)
def test_median_intervals_hold_the_median_and_the_order_does_not_count(values, level, random):
    low, high = median_interval(values, confidence=level)
    assert min(values) <= low <= np.median(values) <= high <= max(values)
    shuffled = random.sample(values, len(values))
    assert median_interval(shuffled, confidence=level) == (low, high)


@pytest.mark.parametrize(
    ("x", "y", "p_value"),
    [
        # Of 70 arrangements one has U = 16, and 12 have U >= 12.
        ([5, 6, 7, 8], [1, 2, 3, 4], 2 / 70),
        ([5, 6, 7, 8], [1, 2, 3, 9], 24 / 70),
        # 2 of 20 arrangements; the approximation that scipy takes for ties gives 0.047.
        ([1] * 3, [0] * 3, 0.1),
        ([1, 1], [1, 1], 1.0),
    ],
)
def test_mann_whitney_by_hand(x, y, p_value):
    assert mann_whitney(x, y) == pytest.approx(p_value, rel=1e-12)
    assert mann_whitney(y, x) == pytest.approx(p_value, rel=1e-12)


class TestA12:
    @given(samples, samples)
    def test_it_counts_pairs(self, x, y):
        won = sum((a > b) + (a == b) / 2 for a in x for b in y)
        assert a12(x, y) == pytest.approx(won / (len(x) * len(y)), abs=1e-15)

    def test_words(self):
        words = {0.5: "negligible", 0.56: "small", 0.64: "medium", 0.71: "large", 1.0: "large"}
        for least, word in words.items():
            assert effect_size(least) == effect_size(1 - least) == word
        between = {0.559: "negligible", 0.361: "small", 0.7099: "medium"}
        assert {effect: effect_size(effect) for effect in between} == between

    @given(samples, samples, levels)
    def test_the_ends_of_intervals_solve_the_equation(self, x, y, level):
        estimate, n, m = a12(x, y), len(x), len(y)
        z = stats.norm.ppf((1 + level) / 2)
        low, high = a12_interval(x, y, confidence=level)
        assert 0 <= low <= estimate + 1e-12
        assert estimate - 1e-12 <= high <= 1
        assert low < 0.999
        assert high > 0.001
        for t in (low, high):
            # Hanley and McNeil: Q1 = t / (2 - t), Q2 = 2 t² / (1 + t).
            q1, q2, mean = t / (2 - t), 2 * t**2 / (1 + t), (n + m) / 2
            variance = (t * (1 - t) + (mean - 1) * (q1 + q2 - 2 * t**2)) / (n * m)
            assert (estimate - t) ** 2 == pytest.approx(z**2 * variance, abs=1e-9)


@pytest.mark.parametrize("n", [2, 3, 4, 5])
def test_friedman_of_one_order_on_all_blocks_by_hand(n):
    # Rank sums n, 2n, 3n: 12 / (12 n) × 14 n² - 12 n = 2 n. 6 of 6^n permutations agree.
    assert friedman([[1, 2, 3]] * n) == pytest.approx((2 * n, 6 / 6**n), rel=1e-12)


def test_friedman_of_many_blocks_by_the_example_of_scipy():
    statistic, p_value = friedman(np.random.default_rng(seed=18).random((6, 10)).T)
    assert statistic == pytest.approx(11.428571428571416, rel=1e-12)
    # The approximation gives 0.0435; 9 999 permutations know p to about 0.002.
    assert 0.025 < p_value < 0.05


class TestNemenyi:
    def test_the_critical_values_of_demsar(self):
        """Table 5 of his paper, at 0.05."""
        for k, value in {2: 1.960, 3: 2.343, 4: 2.569, 6: 2.850, 10: 3.164}.items():
            critical, _ = nemenyi(np.arange(k), k, 7, significance=0.05)
            assert critical / math.sqrt(k * (k + 1) / 42) == pytest.approx(value, abs=1e-3)

    def test_p_values_cross_the_level_at_the_critical_difference(self):
        critical, _ = nemenyi(np.arange(5.0), 5, 12, significance=0.05)
        _, p = nemenyi(critical * np.array([1, -0.99, 1.01, 0]), 5, 12, significance=0.05)
        assert p[0] == pytest.approx(0.05, rel=1e-4)
        assert p[2] < 0.05 < p[1] < p[3] == 1.0

    def test_pairs_are_those_of_the_ranks(self):
        found = compare_ranks(ranked(FIVE), significance=0.05)
        pairs = found[["algorithm", "other", "difference", "significant"]].values.tolist()
        assert pairs == [["A", "B", -1, False], ["A", "C", -2, True], ["B", "C", -1, False]]
        # 2.343 sqrt(3 · 4 / 30)
        assert found["critical_difference"].tolist() == pytest.approx([1.4818] * 3, abs=6e-4)
        nothing = compare_ranks(ranked(FIVE).assign(p_value=0.2), significance=0.05)
        assert not nothing["significant"].any()  # where Friedman finds no difference


@given(st.lists(st.floats(-2, 2)))
@example([0.5, 0.5 + 0.9e-12, 0.5 + 1.7e-12, 0.5 + 3e-12])
def test_neighbours_are_merged_and_others_are_not(values):
    merged = merge_ties(values)
    assert (np.abs(merged - values) <= len(values) * TIE).all()
    assert (np.diff(np.unique(merged)) > TIE).all()
    assert (merge_ties(merged) == merged).all()


def indicator_table(values, indicator="area"):
    """The table from {mission: {algorithm: values}}."""
    rows = [
        {"run": f"{mission}/{algorithm}/{seed}", "mission": mission, "algorithm": algorithm,
         "seed": seed, "indicator": indicator, "value": value}
        for mission, of_mission in values.items()
        for algorithm, of_algorithm in of_mission.items()
        for seed, value in enumerate(of_algorithm, 1)
    ]  # fmt: skip
    return as_table("indicators", rows)


def compared(values, *, control=None, level=0.05):
    algorithms = list(next(iter(values.values())))
    options = {"algorithms": algorithms, "control": control, "significance": level}
    return compare_algorithms(indicator_table(values), **options)


TINY = {"m": {"A": [0.5, 0.6, 0.7, 0.8], "B": [0.1, 0.2, 0.3, 0.4], "C": [0.15, 0.25, 0.35, 0.9]}}
NONE = "no difference found"
FEW = "too few runs"
LONG = {"A": range(10, 40), "B": [], "C": [1, 2, 3]}
BY_C = {"control": "C", "level": 0.15}


class TestCompare:
    def test_the_tiny_table_by_hand(self):
        table = compared(TINY, level=0.1)
        assert table[["algorithm", "other"]].values.tolist() == [["A", "B"], ["A", "C"], ["B", "C"]]
        medians = table[["median", "median_other"]].to_numpy().ravel()
        assert medians == pytest.approx([0.65, 0.25, 0.65, 0.3, 0.25, 0.3])
        assert table["a12"].tolist() == [1.0, 12 / 16, 6 / 16]
        # U = 16, 12 and 6: 1, 12 and 24 of 70 arrangements are at least as far out on a side.
        assert table["p_value"].tolist() == pytest.approx([2 / 70, 24 / 70, 48 / 70])
        assert table["p_holm"].tolist() == pytest.approx([6 / 70, 48 / 70, 48 / 70])
        assert table["significant"].tolist() == [True, False, False]
        assert set(table["n"]) == set(table["n_other"]) == {4}
        ends = a12_interval(TINY["m"]["A"], TINY["m"]["B"], confidence=0.9)
        assert (table["a12_low"][0], table["a12_high"][0]) == ends
        assert table["verdict"].tolist() == ["better, large", NONE, NONE]
        against_b = compared(TINY, control="B")
        assert against_b[["algorithm", "other"]].values.tolist() == [["A", "B"], ["C", "B"]]
        assert against_b["a12"].tolist() == [1.0, 10 / 16]

    @pytest.mark.parametrize(
        ("values", "options", "verdicts", "p_holm"),
        [
            (TINY["m"], {}, [FEW] * 3, [6 / 70, 48 / 70, 48 / 70]),
            (TINY["m"], {"control": "B"}, [FEW] * 2, [4 / 70, 48 / 70]),  # 4 / 70 at least
            # 3 against 3 reach 0.1, and the other comparison comes before it in Holm's steps.
            ({**LONG, "B": [4, 5, 6]}, BY_C, ["better, large"] * 2, [None, 0.1]),
            ({**LONG, "B": [0, 5, 6]}, BY_C, ["better, large", NONE], [None, None]),
            ({"A": range(10), "B": range(20, 30)}, {}, ["worse, large"], [None]),
            ({"A": [0.3] * 4, "B": [0.3] * 9}, {}, [NONE], [1.0]),
            # A single run is not tested, and costs the others nothing.
            (
                {"A": [1, 2, 3, 4], "B": [5, 6, 7, 8], "greedy": [9]},
                {"control": "A"},
                ["better, large", FEW],
                [2 / 70, 1.0],
            ),
        ],
    )
    def test_verdicts(self, values, options, verdicts, p_holm):
        table = compared({"m": values}, **options)
        assert table["verdict"].tolist() == verdicts
        assert table["significant"].tolist() == ["," in verdict for verdict in verdicts]
        for found, expected in zip(table["p_holm"], p_holm, strict=True):
            assert expected is None or found == pytest.approx(expected)

    def test_holm_is_by_mission_and_less_is_better_of_epsilon(self):
        table = compared({"m": TINY["m"], "n": TINY["m"]}, level=0.1)
        assert table["p_holm"].tolist() == pytest.approx([6 / 70, 48 / 70, 48 / 70] * 2)
        assert table["mission"].tolist() == [*"mmmnnn"]
        both = pd.concat([indicator_table(TINY), indicator_table(TINY, "epsilon")])
        options = {"algorithms": [*"ABC"], "control": None, "significance": 0.1}
        table = compare_algorithms(both, **options)
        assert table["p_holm"].tolist() == pytest.approx([6 / 70, 48 / 70, 48 / 70] * 2)
        assert table["a12"].tolist() == [1, 12 / 16, 6 / 16, 0, 4 / 16, 10 / 16]

    @given(st.lists(samples, min_size=2, max_size=4), st.booleans(), st.sampled_from([0.05, 0.3]))
    @examples(60)
    def test_rows_are_sound(self, values, controlled, level):
        labels = "ABCD"[: len(values)]
        drawn = {"m": dict(zip(labels, values, strict=True))}
        table = compared(drawn, control="A" if controlled else None, level=level)
        n = len(labels)
        assert len(table) == (n - 1 if controlled else n * (n - 1) // 2)
        assert (table["p_holm"] >= table["p_value"]).all()
        assert (table["p_holm"] <= 1).all()
        for row in table.to_dict("records"):
            assert row["a12_low"] - 1e-12 <= row["a12"] <= row["a12_high"] + 1e-12
            assert row["significant"] == (row["p_holm"] < level)
            word = row["verdict"].partition(",")[0]
            assert row["significant"] == (word in {"better", "worse"})
            if row["significant"]:
                assert row["p_value"] >= smallest_p(row["n"], row["n_other"])
                assert (word == "better") == (row["a12"] > 0.5)


def ranked(values, *, indicator="area", algorithms=None, digests=None):
    return rank_algorithms(
        indicator_table(values, indicator),
        algorithms=algorithms or list(next(iter(values.values()))),
        significance=0.05,
        digests=digests or {label: label for label in values},
    )


FIVE = {f"m{i}": {"A": [0.3, 0.9, 0.9], "B": [0.5], "C": [0.1, 0.2]} for i in range(5)}
LATE = {"late": {"A": [0.1]}}


class TestRanks:
    def test_by_hand(self):
        # Medians 0.9, 0.5 and 0.15 everywhere; where an algorithm has no runs, there is no block.
        table = ranked({**FIVE, **LATE})
        assert table["algorithm"].tolist() == ["A", "B", "C"]
        assert table["average_rank"].tolist() == [1, 2, 3]
        assert table["statistic"].tolist() == pytest.approx([10] * 3)
        assert table["p_value"].tolist() == pytest.approx([6 / 6**5] * 3)
        assert set(table["n_missions"]) == {5}
        assert set(table["note"]) == {"the algorithms differ: Friedman over 5 missions, p 0.00077"}

    def test_ties_share_their_ranks(self):
        values = {
            "m": {"A": [0.5], "B": [0.5 + 1e-16], "C": [0.1]},
            "n": {"A": [1], "B": [0], "C": [0]},
        }
        assert ranked(values)["average_rank"].tolist() == [1.25, 2, 2.75]

    @pytest.mark.parametrize(
        ("values", "options", "said"),
        [
            (FIVE, {"digests": dict(zip(FIVE, "aabcd", strict=True))}, "here are 3 and 4"),
            ({"m0": FIVE["m0"]}, {"algorithms": ["A"]}, "here are 1 and 1"),
            (
                {f"m{i}": {label: [i, i] for label in "ABC"} for i in range(6)},
                {},
                "all algorithms have the same median on every mission",
            ),
        ],
    )
    def test_why_there_is_no_test(self, values, options, said):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            table = ranked(values, **options)
        assert table[["statistic", "p_value"]].isna().all(axis=None)
        [note] = set(table["note"])
        assert note.startswith("no Friedman test: ")
        assert note.endswith(said)

    def test_what_has_no_ranks(self):
        assert ranked(LATE, algorithms=["A", "B"]).empty
        assert ranked(FIVE, indicator="front_size").empty  # it does not judge
