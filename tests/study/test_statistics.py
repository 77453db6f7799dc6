"""Statistics against numbers found by hand, against scipy's examples, and on drawn studies."""

import itertools
import math
import warnings

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from botohe_moo.bounds import FrontBound
from botohe_moo.indicators import INDICATORS, TIE, area_indicator
from botohe_moo.study.scores import points_by_mission, reference_fronts, score_runs, summarise
from botohe_moo.study.statistics import (
    a12,
    a12_interval,
    compare_algorithms,
    compare_ranks,
    effect_size,
    friedman,
    generator_for,
    mann_whitney,
    median_interval,
    merge_ties,
    nemenyi,
    rank_algorithms,
    smallest_p,
)
from botohe_moo.study.tables import as_table
from tests.examples import examples
from tests.study.test_scores import quay, studies, tables

# The example of scipy.stats.mannwhitneyu.
MALES, FEMALES = [19, 22, 16, 29, 24], [20, 11, 17, 12]

samples = st.lists(
    st.one_of(st.sampled_from([0.0, 0.5, 1.0]), st.floats(0, 1)), min_size=1, max_size=12
)
levels = st.floats(0.5, 0.999)


def rng(seed=1):
    return np.random.default_rng(seed)


class TestMedianInterval:
    def test_of_three_by_hand(self):
        # 27 resamples: 7 have the median 1, 13 the median 2, 7 the median 3.
        assert median_interval([3, 1, 2], confidence=0.95) == (1, 3)
        assert median_interval([3, 1, 2], confidence=0.40) == (2, 2)

    def test_it_is_that_of_scipy(self):
        values = np.sort(rng(5).random(9))
        expected = stats.bootstrap(
            (values,),
            np.median,
            method="percentile",
            confidence_level=0.9,
            rng=generator_for(values),
        ).confidence_interval
        assert median_interval(values, confidence=0.9) == (expected.low, expected.high)

    @pytest.mark.filterwarnings("error")
    def test_equal_values_have_no_width(self):
        for values in ([0.3], [0.3, 0.3], [0.0] * 30):
            assert median_interval(values, confidence=0.95) == (values[0],) * 2

    @given(samples, levels, st.randoms(use_true_random=False))
    @examples(30)
    def test_it_holds_the_median_and_the_order_does_not_count(self, values, level, random):
        low, high = median_interval(values, confidence=level)
        assert min(values) <= low <= np.median(values) <= high <= max(values)
        shuffled = random.sample(values, len(values))
        assert median_interval(shuffled, confidence=level) == (low, high)

    def test_the_generator_depends_on_the_values_alone(self):
        def drawn(values):
            return generator_for(values).random()

        assert drawn([1, 2]) == drawn(np.array([1.0, 2.0])) == drawn(np.array([1, 9, 2])[::2])
        assert len({drawn(v) for v in ([1, 2], [2, 1], [1, 2, 2], [1])}) == 4


class TestMannWhitney:
    def test_the_example_of_scipy(self):
        assert mann_whitney(MALES, FEMALES) == pytest.approx(0.1111111111111111, rel=1e-14)
        assert a12(MALES, FEMALES) == 17 / 20

    def test_four_against_four_by_hand(self):
        # Of 70 arrangements one has U = 16, and 12 have U >= 12.
        assert mann_whitney([5, 6, 7, 8], [1, 2, 3, 4]) == pytest.approx(2 / 70, rel=1e-12)
        assert mann_whitney([5, 6, 7, 8], [1, 2, 3, 9]) == pytest.approx(24 / 70, rel=1e-12)

    def test_ties_are_no_way_below_what_arrangements_allow(self):
        assert stats.mannwhitneyu([1] * 3, [0] * 3).pvalue < 0.05
        assert mann_whitney([1] * 3, [0] * 3) == 0.1  # 2 of 20 arrangements

    @given(samples, samples)
    def test_it_is_that_of_scipy_and_symmetrical(self, x, y):
        found = mann_whitney(x, y)
        assert mann_whitney(y, x) == pytest.approx(found, rel=1e-12)
        assert smallest_p(len(x), len(y)) <= found <= 1
        if len({*x, *y}) > 1:
            assert found == max(
                stats.mannwhitneyu(x, y).pvalue, 2 / math.comb(len(x) + len(y), len(x))
            )


class TestA12:
    def test_by_hand(self):
        assert a12([2], [1]) == 1
        assert a12([1], [2]) == 0
        assert a12([1], [1]) == a12([1, 3], [2]) == a12([1, 2, 3], [2, 2]) == 0.5
        # 3 > 1, 3 > 2, 2 > 1 and one tie, of 6.
        assert a12([2, 3], [1, 2, 9]) == pytest.approx(3.5 / 6, abs=1e-15)

    @given(samples, samples)
    def test_it_counts_pairs(self, x, y):
        won = sum((a > b) + (a == b) / 2 for a in x for b in y)
        assert a12(x, y) == pytest.approx(won / (len(x) * len(y)), abs=1e-15)
        assert a12(x, y) + a12(y, x) == pytest.approx(1, abs=1e-15)

    def test_words(self):
        bounds = {0.5: "negligible", 0.56: "small", 0.64: "medium", 0.71: "large", 1.0: "large"}
        for least, word in bounds.items():
            assert effect_size(least) == effect_size(1 - least) == word
        assert effect_size(0.559) == "negligible"
        assert effect_size(0.361) == "small"
        assert effect_size(0.7099) == "medium"


class TestA12Interval:
    Z2 = 3.841458820694124  # the square of 1.96

    def test_of_one_run_each_by_hand(self):
        # V = t (1 - t): 1 - t = z² t.
        low, high = a12_interval([2], [1], confidence=0.95)
        assert (low, high) == (pytest.approx(1 / (1 + self.Z2), abs=1e-11), 1.0)
        assert a12_interval([1], [2], confidence=0.95) == pytest.approx((0, 1 - low), abs=1e-11)

    def test_of_a_tie_by_hand(self):
        # (0.5 - t)² = z² t (1 - t), a quadratic in t.
        half = 0.5 * math.sqrt(self.Z2 / (1 + self.Z2))
        found = a12_interval([1], [1], confidence=0.95)
        assert found == pytest.approx((0.5 - half, 0.5 + half), abs=1e-11)

    @given(samples, samples, levels)
    def test_the_ends_solve_the_equation(self, x, y, level):
        estimate = a12(x, y)
        n, m = len(x), len(y)
        z = stats.norm.ppf((1 + level) / 2)
        ends = a12_interval(x, y, confidence=level)
        assert 0 <= ends[0] <= estimate + 1e-12
        assert estimate - 1e-12 <= ends[1] <= 1
        assert ends[0] < 0.999
        assert ends[1] > 0.001
        for t in ends:
            # Hanley and McNeil: Q1 = t / (2 - t), Q2 = 2 t² / (1 + t).
            q1, q2, mean = t / (2 - t), 2 * t**2 / (1 + t), (n + m) / 2
            variance = (t * (1 - t) + (mean - 1) * (q1 - t**2) + (mean - 1) * (q2 - t**2)) / (n * m)
            assert (estimate - t) ** 2 == pytest.approx(z**2 * variance, abs=1e-9)


class TestFriedman:
    def test_the_example_of_scipy(self):
        x = np.random.default_rng(seed=18).random((6, 10))
        statistic, p_value = friedman(x.T)
        assert statistic == pytest.approx(11.428571428571416, rel=1e-12)
        # The approximation gives 0.0435; 9 999 permutations know p to about 0.002.
        assert 0.025 < p_value < 0.05

    def test_one_order_on_all_blocks_by_hand(self):
        for n in (2, 3, 4, 5):
            # Rank sums n, 2n, 3n: 12 / (12 n) × 14 n² - 12 n = 2 n. 6 of 6^n permutations agree.
            statistic, p_value = friedman([[1, 2, 3]] * n)
            assert statistic == pytest.approx(2 * n, rel=1e-12)
            assert p_value == pytest.approx(6 / 6**n, rel=1e-12)

    @given(
        st.lists(st.tuples(*[st.sampled_from([0.0, 0.5, 1.0])] * 3), min_size=2, max_size=4),
        st.sampled_from([1, -1]),
    )
    @examples(30)
    def test_against_all_permutations_one_by_one(self, blocks, sign):
        blocks = sign * np.array(blocks)
        statistic, p_value = friedman(blocks)
        if statistic is None:
            assert (blocks == blocks[:, :1]).all()
            return
        assert statistic == stats.friedmanchisquare(*blocks.T).statistic
        orders = itertools.product(*(list(itertools.permutations(block)) for block in blocks))
        others = [stats.rankdata(order, axis=1).sum(axis=0) for order in orders]
        spread = np.array([(sums**2).sum() for sums in others])
        observed = (stats.rankdata(blocks, axis=1).sum(axis=0) ** 2).sum()
        assert p_value == pytest.approx(np.mean(spread >= observed), rel=1e-12)


class TestNemenyi:
    def test_the_critical_values_of_demsar(self):
        """Table 5 of his paper, at 0.05."""
        for k, value in {2: 1.960, 3: 2.343, 4: 2.569, 6: 2.850, 10: 3.164}.items():
            critical, _ = nemenyi(np.arange(k), k, 7, significance=0.05)
            assert critical / math.sqrt(k * (k + 1) / 42) == pytest.approx(value, abs=1e-3)

    def test_p_values_cross_the_level_at_the_critical_difference(self):
        critical, _ = nemenyi(np.arange(5.0), 5, 12, significance=0.05)
        differences = critical * np.array([1.0, 0.99, 1.01, 0.0])
        _, p_values = nemenyi(differences, 5, 12, significance=0.05)
        assert p_values[0] == pytest.approx(0.05, rel=1e-4)
        assert p_values[2] < 0.05 < p_values[1]
        assert p_values[3] == 1.0
        _, others = nemenyi(-differences, 5, 12, significance=0.05)
        assert (p_values == others).all()

    def test_pairs_are_those_of_the_ranks(self):
        table = ranked(FIVE)
        found = compare_ranks(table, significance=0.05)
        as_table("posthoc", found)
        assert found[["algorithm", "other"]].values.tolist() == [
            ["A", "B"],
            ["A", "C"],
            ["B", "C"],
        ]
        assert found["difference"].tolist() == [-1, -2, -1]
        # 2.343 sqrt(3 · 4 / 30)
        assert found["critical_difference"].tolist() == pytest.approx([1.4818] * 3, abs=6e-4)
        assert found["significant"].tolist() == [False, True, False]

    def test_where_friedman_finds_nothing_no_pair_is_significant(self):
        table = ranked(FIVE).assign(p_value=0.2)
        assert not compare_ranks(table, significance=0.05)["significant"].any()


class TestTies:
    @given(st.lists(st.floats(-2, 2)))
    def test_neighbours_are_merged_and_others_are_not(self, values):
        merged = merge_ties(values)
        assert (np.abs(merged - values) <= len(values) * TIE).all()
        apart = np.diff(np.unique(merged))
        assert (apart > TIE).all()
        assert (merge_ties(merged) == merged).all()

    def test_by_hand(self):
        chain = [0.5, 0.5 + 0.9e-12, 0.5 + 1.7e-12]
        assert merge_ties([*chain, 0.5 + 3e-12]).tolist() == [chain[2]] * 3 + [0.5 + 3e-12]


def indicator_table(values, indicator="area"):
    """The table from {mission: {algorithm: values}}."""
    rows = [
        {
            "run": f"{mission}/{algorithm}/{seed}",
            "mission": mission,
            "algorithm": algorithm,
            "seed": seed,
            "indicator": indicator,
            "value": value,
        }
        for mission, of_mission in values.items()
        for algorithm, of_algorithm in of_mission.items()
        for seed, value in enumerate(of_algorithm, 1)
    ]
    return as_table("indicators", rows)


def compared(values, *, indicator="area", algorithms=None, control=None, level=0.05):
    algorithms = algorithms or list(next(iter(values.values())))
    table = compare_algorithms(
        indicator_table(values, indicator),
        algorithms=algorithms,
        control=control,
        significance=level,
    )
    as_table("comparisons", table)
    return table


def ten(start):
    return [start + i / 1000 for i in range(10)]


TINY = {
    "m": {
        "A": [0.5, 0.6, 0.7, 0.8],
        "B": [0.1, 0.2, 0.3, 0.4],
        "C": [0.15, 0.25, 0.35, 0.9],
    }
}


class TestCompare:
    def test_the_tiny_table_by_hand(self):
        table = compared(TINY, level=0.1)
        assert table[["algorithm", "other"]].values.tolist() == [["A", "B"], ["A", "C"], ["B", "C"]]
        assert table["median"].tolist() == pytest.approx([0.65, 0.65, 0.25])
        assert table["median_other"].tolist() == pytest.approx([0.25, 0.3, 0.3])
        assert table["a12"].tolist() == [1.0, 12 / 16, 6 / 16]
        # U = 16, 12 and 6: 1, 12 and 24 of 70 arrangements are at least as far out on a side.
        assert table["p_value"].tolist() == pytest.approx([2 / 70, 24 / 70, 48 / 70])
        assert table["p_holm"].tolist() == pytest.approx([6 / 70, 48 / 70, 48 / 70])
        assert table["significant"].tolist() == [True, False, False]
        assert set(table["n"]) == set(table["n_other"]) == {4}
        low, high = a12_interval(TINY["m"]["A"], TINY["m"]["B"], confidence=0.9)
        assert (table["a12_low"][0], table["a12_high"][0]) == (low, high)
        assert table["verdict"].tolist() == ["better, large", *["no difference found"] * 2]

    def test_where_runs_are_too_few_it_is_said(self):
        table = compared(TINY)
        assert not table["significant"].any()
        assert set(table["verdict"]) == {"too few runs"}  # 6 / 70 at least

    def test_against_a_control(self):
        table = compared(TINY, control="B")
        assert table[["algorithm", "other"]].values.tolist() == [["A", "B"], ["C", "B"]]
        assert table["a12"].tolist() == [1.0, 10 / 16]
        assert table["p_holm"].tolist() == pytest.approx([4 / 70, 48 / 70])
        assert set(table["verdict"]) == {"too few runs"}

    def test_what_few_runs_can_reach_depends_on_the_others(self):
        # 3 against 3 reach 0.1, and the other comparison comes before it in Holm's steps.
        many = [10 + i for i in range(30)]
        table = compared(
            {"m": {"A": many, "B": [4, 5, 6], "C": [1, 2, 3]}}, control="C", level=0.15
        )
        assert table["significant"].tolist() == [True, True]
        assert table["p_holm"][1] == pytest.approx(0.1)
        mixed = {"m": {"A": many, "B": [0, 5, 6], "C": [1, 2, 3]}}
        table = compared(mixed, control="C", level=0.15)
        assert table["verdict"][1] == "no difference found"

    def test_worse_is_said_too(self):
        table = compared({"m": {"A": ten(0.1), "B": ten(0.5)}})
        assert table["a12"].tolist() == [0.0]
        assert table["verdict"][0] == "worse, large"
        assert table["p_value"][0] == stats.mannwhitneyu(ten(0.1), ten(0.5)).pvalue

    def test_equal_values_are_equal(self):
        [row] = compared({"m": {"A": [0.3] * 4, "B": [0.3] * 9}}).to_dict("records")
        assert (row["p_value"], row["p_holm"], row["a12"]) == (1.0, 1.0, 0.5)
        assert row["verdict"] == "no difference found"
        assert not row["significant"]

    def test_a_single_run_is_not_tested_and_costs_the_others_nothing(self):
        values = {"m": {"A": [1, 2, 3, 4], "B": [5, 6, 7, 8], "greedy": [9]}}
        table = compared(values, control="A")
        assert table["p_holm"].tolist() == [pytest.approx(2 / 70), 1.0]
        assert table["p_value"][1] == 1.0
        assert table["verdict"][1] == "too few runs"

    def test_holm_is_by_mission_and_by_indicator(self):
        by_area = indicator_table({"m": TINY["m"], "n": TINY["m"]})
        by_epsilon = indicator_table(TINY, "epsilon")
        table = compare_algorithms(
            pd.concat([by_area, by_epsilon]),
            algorithms=["A", "B", "C"],
            control=None,
            significance=0.1,
        )
        families = table.groupby(["mission", "indicator"], sort=False)
        assert [key for key, _ in families] == [("m", "area"), ("n", "area"), ("m", "epsilon")]
        for _, family in families:
            assert family["p_holm"].tolist() == pytest.approx([6 / 70, 48 / 70, 48 / 70])


def ranked(values, *, indicator="area", algorithms=None, level=0.05, digests=None):
    algorithms = algorithms or list(next(iter(values.values())))
    table = rank_algorithms(
        indicator_table(values, indicator),
        algorithms=algorithms,
        significance=level,
        digests=digests or {label: label for label in values},
    )
    as_table("ranks", table)
    return table


FIVE = {f"m{i}": {"A": [0.3, 0.9, 0.9], "B": [0.5], "C": [0.1, 0.2]} for i in range(5)}


class TestRanks:
    def test_by_hand(self):
        # Medians 0.9, 0.5 and 0.15 everywhere.
        table = ranked(FIVE)
        assert table["algorithm"].tolist() == ["A", "B", "C"]
        assert table["average_rank"].tolist() == [1, 2, 3]
        assert table["statistic"].tolist() == pytest.approx([10] * 3)
        assert table["p_value"].tolist() == pytest.approx([6 / 6**5] * 3)
        assert set(table["n_missions"]) == {5}
        assert set(table["note"]) == {"the algorithms differ: Friedman over 5 missions, p 0.00077"}

    def test_one_mission_under_several_labels_is_one_block(self):
        digests = {"m0": "a", "m1": "a", "m2": "b", "m3": "c", "m4": "d"}
        table = ranked(FIVE, digests=digests)
        assert table["p_value"].isna().all()
        assert table["average_rank"].tolist() == [1, 2, 3]
        [note] = set(table["note"])
        assert note.endswith("3 algorithms and 5 missions, each under one label; here are 3 and 4")

    def test_ties_share_their_ranks(self):
        values = {
            "m": {"A": [0.5], "B": [0.5 + 1e-16], "C": [0.1]},
            "n": {"A": [1], "B": [0], "C": [0]},
        }
        assert values["m"]["B"] >= values["m"]["A"]
        assert ranked(values)["average_rank"].tolist() == [1.25, 2, 2.75]

    def test_why_there_is_no_test(self):
        table = ranked({"m0": FIVE["m0"]}, algorithms=["A"])
        assert len(table) == 1
        assert table[["statistic", "p_value"]].isna().all(axis=None)
        assert table["note"][0] == (
            "no Friedman test: it needs at least 3 algorithms and 5 missions, each under one "
            "label; here are 1 and 1"
        )

    def test_all_equal(self):
        values = {f"m{i}": {label: [i, i] for label in "ABC"} for i in range(6)}
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            table = ranked(values)
        assert table["average_rank"].tolist() == [2, 2, 2]
        assert table["statistic"].isna().all()
        [note] = set(table["note"])
        assert note == "no Friedman test: all algorithms have the same median on every mission"

    def test_missions_that_lack_an_algorithm_are_left_out(self):
        values = {**FIVE, "late": {"A": [0.1]}}
        table = ranked(values)
        assert set(table["n_missions"]) == {5}
        assert len(ranked({"late": {"A": [0.1]}}, algorithms=["A", "B"])) == 0

    def test_the_number_of_plans_does_not_judge(self):
        assert len(ranked(FIVE, indicator="front_size")) == 0


class Most:
    """A bound of a given area."""

    gap_of_area = FrontBound.gap_of_area

    def __init__(self, area):
        self.area = area


def areas_of(references):
    return {
        label: area_indicator(of, quay()) for label, of in points_by_mission(references).items()
    }


def pipeline(missions, algorithms, found, *, control=None, level=0.05, bounds=None):
    runs, final = tables(found)
    references = reference_fronts(runs, final, {})
    known = dict.fromkeys(missions, quay())
    scores = score_runs(runs, final, references, missions=known, indicators=list(INDICATORS))
    options = {"algorithms": algorithms, "significance": level}
    digests = {mission: mission for mission in missions}
    most = {mission: Most(area) for mission, area in (bounds or {}).items()}
    made = {
        "comparisons": compare_algorithms(scores, control=control, **options),
        "ranks": rank_algorithms(scores, digests=digests, **options),
        "summary": summarise(runs, scores, areas_of(references), significance=level, bounds=most),
    }
    for name, table in made.items():
        as_table(name, table)
    return made


# Areas 0.5, 0.25, 0 and 0.1 of A; of B 0.2 twice.
FOUND = [
    ("m", "A", 1, [(10, 1)]),
    ("m", "A", 2, [(5, 1)]),
    ("m", "A", 3, [], "failed"),
    ("m", "A", 4, [(1, 2)], "timeout"),
    ("m", "B", 1, [(4, 1)]),
    ("m", "B", 2, [(4, 1)]),
]


class TestSummary:
    def summary(self, found=None, **options):
        missions, algorithms = ["m"], ["A", "B"]
        return pipeline(missions, algorithms, found or FOUND, **options)["summary"]

    def test_by_hand(self):
        a, b = self.summary().to_dict("records")
        assert (a["mission"], a["algorithm"], b["algorithm"]) == ("m", "A", "B")
        assert (a["n"], a["n_not_done"], b["n"], b["n_not_done"]) == (4, 2, 2, 0)
        assert a["area_median"] == pytest.approx((0.25 + 0.1) / 2)
        assert a["area_mean"] == pytest.approx(0.85 / 4)
        # Deviations from 0.2125: 0.2875, 0.0375, -0.2125, -0.1125.
        squares = 0.2875**2 + 0.0375**2 + 0.2125**2 + 0.1125**2
        assert a["area_sd"] == pytest.approx(math.sqrt(squares / 3))
        assert a["area_best"] == 0.5
        assert (a["area_low"], a["area_high"]) == (0.0, 0.5)
        assert (b["area_median"], b["area_low"], b["area_high"]) == (0.2, 0.2, 0.2)
        assert b["area_sd"] == 0.0
        assert (a["rank"], b["rank"]) == (2, 1)
        assert (a["front_size_median"], b["front_size_median"]) == (1, 1)
        assert (a["evaluations_median"], a["seconds_median"]) == (250, 1.25)

    def test_gaps_by_hand(self):
        a, b = self.summary(bounds={"m": 0.6}).to_dict("records")
        assert a["area_gap"] == pytest.approx(0.6 / (0.85 / 4) - 1)
        assert b["area_gap"] == pytest.approx(2)
        lost = [("m", "A", 1, [], "failed"), ("m", "B", 1, [(4, 1)])]
        assert self.summary(lost, bounds={"m": 0.2})["area_gap"].tolist() == [np.inf, 0]
        assert self.summary(lost[:1], bounds={"m": 0.0})["area_gap"].tolist() == [0]
        assert self.summary(bounds={"other": 0.6})["area_gap"].isna().all()

    def test_distances_by_hand(self):
        # The union is (1, 0.5) and (0.1, 1) as shares; B's (0.4, 0.5) lacks 0.6 and 0.5 of them.
        b = self.summary().to_dict("records")[1]
        assert b["igd_plus_median"] == pytest.approx((0.6 + 0.5) / 2)
        assert b["epsilon_median"] == pytest.approx(0.6)

    def test_shares_of_the_reference_front_by_hand(self):
        # The area of the union, of (1, 0.5) and (0.1, 1) as shares, is 0.5 + 0.05.
        shares = self.summary()["area_share"]
        assert shares.tolist() == pytest.approx((self.summary()["area_mean"] / 0.55).tolist())
        nothing = self.summary([("m", "A", 1, []), ("m", "B", 1, [])])
        assert nothing["area_share"].isna().all()

    def test_what_is_not_computed_is_missing(self):
        runs, final = tables(FOUND)
        options = {"missions": {"m": quay()}, "indicators": ["epsilon"]}
        references = reference_fronts(runs, final, {})
        scores = score_runs(runs, final, references, **options)
        table = summarise(runs, scores, areas_of(references), significance=0.05, bounds={})
        as_table("summary", table)
        assert table["igd_plus_median"].isna().all()
        assert table["epsilon_median"].notna().all()
        assert table["area_median"].tolist() == pytest.approx([0.175, 0.2])

    def test_another_algorithm_does_not_move_the_intervals(self):
        areas = rng(8).random(40)
        found = [("m", "AB"[i % 2], i, [(10 * area, 2)]) for i, area in enumerate(areas)]
        alone = self.summary(found[::2], bounds={"m": 1.0})
        both = self.summary(found[::-1], bounds={"m": 1.0})
        columns = [name for name in alone if name.startswith("area") and name != "area_share"]
        both = both.set_index("algorithm")
        assert both.loc["A", columns].tolist() == alone.loc[0, columns].tolist()
        assert alone["area_low"][0] < alone["area_median"][0] < alone["area_high"][0]

    def test_what_has_not_run_has_no_row(self):
        table = pipeline(["m", "n"], ["A", "B"], FOUND[:4])["summary"]
        assert table[["mission", "algorithm"]].values.tolist() == [["m", "A"]]


class TestDrawnStudies:
    @given(studies(), st.booleans(), st.sampled_from([0.01, 0.05, 0.3]))
    @examples(60)
    def test_tables_fit_and_are_sound(self, study, controlled, level):
        missions, algorithms, found = study
        control = algorithms[-1] if controlled else None
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            made = pipeline(missions, algorithms, found, control=control, level=level)
        n = len(algorithms)
        n_pairs = n - 1 if controlled else n * (n - 1) // 2
        comparisons, ranks, summary = made["comparisons"], made["ranks"], made["summary"]
        assert len(comparisons) == 3 * len(missions) * n_pairs
        self.check_comparisons(comparisons, level)
        assert len(ranks) == 3 * n
        averages = ranks.groupby("indicator")["average_rank"].mean()
        assert averages.tolist() == pytest.approx([(n + 1) / 2] * 3)
        assert ranks["p_value"].dropna().between(0, 1, inclusive="right").all()
        assert summary[["mission", "algorithm"]].values.tolist() == [
            [mission, algorithm] for mission in missions for algorithm in algorithms
        ]
        assert (summary["area_low"] <= summary["area_median"]).all()
        assert (summary["area_median"] <= summary["area_high"]).all()
        assert (summary["area_high"] <= summary["area_best"]).all()
        not_done = sum(status != "done" for *_, status in found)
        assert summary["n_not_done"].sum() == not_done

    def check_comparisons(self, table, level):
        assert (table["p_holm"] >= table["p_value"]).all()
        assert table["p_holm"].between(0, 1).all()
        assert (table["a12_low"] <= table["a12"] + 1e-12).all()
        assert (table["a12"] <= table["a12_high"] + 1e-12).all()
        for row in table.to_dict("records"):
            assert row["significant"] == (row["p_holm"] < level)
            word = row["verdict"].partition(",")[0]
            assert row["significant"] == (word in {"better", "worse"})
            if row["significant"]:
                assert row["p_value"] >= smallest_p(row["n"], row["n_other"])
                assert (word == "better") == (row["a12"] > 0.5)
            if row["n"] == 1:
                assert row["verdict"] == "too few runs"
