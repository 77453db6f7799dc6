"""The runs of a study that are there, and how long the others will take."""

import pytest

from botohe_moo.study.folder import StudyFolder
from botohe_moo.study.loading import load_study
from botohe_moo.study.runner import Estimate, estimate_times, plan_study, run_study, time_left

MADE = "tests.study.algorithms_made"
STUDY = {
    "name": "s",
    "missions": ["toy"],
    "algorithms": ["random", "greedy"],
    "budget": {"evaluations": 100},
    "seeds": 2,
}


def estimated(source, folder):
    store = StudyFolder(folder)
    plan = plan_study(load_study(source), store)
    return plan, {estimate.algorithm: estimate for estimate in estimate_times(plan, store)}


def made(n_runs=1, seconds=1.0):
    return Estimate("m", "a", n_runs, 0, 0, seconds, at_most=False)


@pytest.mark.usefixtures("in_process")
class TestEstimates:
    def test_they_are_of_the_runs_that_are_there(self, tmp_path):
        runs = run_study({**STUDY, "seeds": 3}, tmp_path).runs
        more = {**STUDY, "algorithms": ["random", "nsga2"], "seeds": [2, 3, 4]}
        plan, found = estimated(more, tmp_path)
        there = runs[(runs["algorithm"] == "random") & (runs["seed"] > 1)]
        assert plan.finished == set(there["run"])
        assert [(run.algorithm.label, run.seed) for run in plan.missing] == [
            ("random", 4),
            *(("nsga2", seed) for seed in (2, 3, 4)),
        ]
        assert (found["random"].n_finished, found["random"].n_left) == (2, 1)
        assert found["random"].seconds == there["seconds"].median()
        assert found["nsga2"].seconds is None

    def test_a_folder_that_is_not_there_stays_so(self, tmp_path):
        plan, found = estimated(STUDY, tmp_path / "none")
        assert len(plan.missing) == 4
        assert [estimate.seconds for estimate in found.values()] == [None, None]
        assert not (tmp_path / "none").exists()

    def test_where_none_is_there_the_budget_may_say_it(self, tmp_path):
        _, found = estimated({**STUDY, "budget": {"seconds": 60}}, tmp_path)
        assert (found["random"].seconds, found["random"].at_most) == (60, True)

    def test_failures_are_counted(self, tmp_path):
        source = {**STUDY, "algorithms": {"bad": f"{MADE}:Raising"}}
        with pytest.warns(UserWarning, match="all 2 runs failed, the first with: RuntimeError"):
            run_study(source, tmp_path)
        plan, found = estimated(source, tmp_path)
        assert (found["bad"].n_failed, len(plan.missing)) == (2, 2)


def test_time_left_by_hand():
    assert time_left([made(4, 1.0), made(2, 3.0)], 2) == 5.0
    assert time_left([made(3, 1.0)], 8) == 1.0  # runs are not cut to pieces
    assert time_left([made(4, 1.0), made(9, None)], 2) == 2.0  # what is unknown is not in it
    assert time_left([made(4, 1.0)], 2, n_bounds=3, bound_seconds=10.0) == 22.0
    assert time_left([], 2) == 0.0
