"""How long runs will take: measured, tried, and put together for several workers."""

from dataclasses import replace

from botohe_moo.study.estimate import Estimate, estimate_times, time_left
from botohe_moo.study.file.loading import load_study
from botohe_moo.study.planning import plan_study
from botohe_moo.study.runner import run_study
from botohe_moo.study.store.folder import StudyFolder

MADE = "tests.study.algorithms_made"


def study_of(algorithms, evaluations=100, **changes):
    return {
        "name": "s",
        "missions": ["toy"],
        "algorithms": algorithms,
        "budget": {"evaluations": evaluations},
        "seeds": 2,
        **changes,
    }


def estimated(source, folder):
    told = []
    found = list(estimate_times(plan_study(load_study(source), StudyFolder(folder)), told.append))
    return {estimate.algorithm: estimate for estimate in found}, told


def made(n_runs=1, seconds=1.0, start_seconds=0.0):
    return Estimate("m", "a", n_runs, 0, 0, seconds, start_seconds, False, False)


class TestTrials:
    def test_what_is_compiled_does_not_count(self, tmp_path):
        compiling = 8.0
        parameters = {"path": str(tmp_path / "compiled"), "seconds": compiling}
        source = study_of({"x": {"algorithm": f"{MADE}:Compiling", "parameters": parameters}})
        found, told = estimated(source, tmp_path / "out")
        assert (tmp_path / "compiled").exists()
        assert found["x"].each < compiling
        assert told == ["trying x on toy (1 of 1)"]

    def test_processes_that_each_run_starts_count(self, tmp_path):
        """Other packages' runs have each their own; ours share theirs."""
        source = study_of({"mine": "random", "theirs": f"{MADE}:Sampler"})
        before, _ = estimated(source, tmp_path)
        run_study(source, tmp_path)
        source["seeds"] = 3
        after, told = estimated(source, tmp_path)
        for found in (before, after):
            assert found["mine"].start_seconds == 0
            # It imports pandas, to begin with, which its run does not wait for.
            assert found["theirs"].start_seconds > found["theirs"].seconds
            assert found["theirs"].each > found["theirs"].seconds
        assert [e.measured for e in before.values()] == [False, False]
        assert [e.measured for e in after.values()] == [True, True]
        assert told == ["trying theirs on toy (2 of 2)"]

    def test_so_do_those_that_workers_start(self, tmp_path):
        found, _ = estimated(study_of({"mine": "random", "greedy": "greedy"}), tmp_path)
        # A process imports pymoo and numba, which takes far longer than 100 evaluations.
        assert found["mine"].shared_start_seconds > found["mine"].each
        assert found["greedy"].shared_start_seconds == found["mine"].shared_start_seconds
        assert time_left(found.values(), 2) > found["mine"].shared_start_seconds

    def test_nothing_is_tried_where_nothing_is_missing(self, tmp_path):
        source = study_of({"mine": "random", "theirs": f"{MADE}:Sampler"})
        run_study(source, tmp_path)
        found, told = estimated(source, tmp_path)
        assert told == []
        assert [estimate.n_left for estimate in found.values()] == [0, 0]
        assert time_left(found.values(), 2) == 0

    def test_what_fails_is_unknown(self, tmp_path):
        source = study_of({"bad": f"{MADE}:Raising", "good": "random"})
        found, _ = estimated(source, tmp_path)
        assert found["bad"].seconds is None
        assert found["good"].seconds is not None


class TestTimeLeft:
    def test_runs_are_not_cut_to_pieces(self):
        assert time_left([made(3, 1.0)], 2) == 2.0
        assert time_left([made(3, 1.0)], 2, n_bounds=3, bound_seconds=10.0) == 22.0
        assert time_left([], 2, n_bounds=1, bound_seconds=10.0) == 10.0
        assert time_left([made(3, 1.0)], 3) == time_left([made(3, 1.0)], 8) == 1.0

    def test_workers_take_the_next_when_they_are_free(self):
        assert time_left([made(1, 5.0), made(4, 1.0), made(1, 2.0)], 2) == 6.0

    def test_starts_count(self):
        assert time_left([made(4, 1.0, 2.0)], 2) == 6.0

    def test_a_worker_starts_its_process_once(self):
        first, second = (replace(made(3, 1.0), shared_start_seconds=s) for s in (2.0, 0.0))
        assert time_left([first, second], 2) == 5.0
        assert time_left([replace(first, n_there=3)], 2) == 0.0

    def test_what_is_unknown_takes_nothing(self):
        assert time_left([made(2, None, 0.0), made(1, 1.0)], 1) == 1.0
