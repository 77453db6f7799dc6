"""Studies of objectives of your own: ``problem: module:Class``."""

from dataclasses import replace

import numpy as np
import pytest
from pymoo.optimize import minimize

from botohe_moo import area_indicator, load_mission, make_algorithm
from botohe_moo.indicators import igd_plus_indicator
from botohe_moo.study import StudyError, load_study, make_tables, run_study
from botohe_moo.study.model import check_code
from botohe_moo.study.perform import Outcome, perform, verify
from botohe_moo.study.pool import checked_outcome
from botohe_moo.study.report import write_report
from tests.study import problems_made
from tests.study.problems_made import Weakest

MADE = problems_made.__name__
FOREIGN = "tests.study.algorithms_made:Sampler"
STUDY = {
    "name": "weakest",
    "missions": ["toy"],
    "algorithms": {"ants": "bo-aco", "foreign": FOREIGN},
    "problem": f"{MADE}:Weakest",
    "budget": {"evaluations": 120},
    "seeds": 1,
}
PLAIN = {key: value for key, value in STUDY.items() if key != "problem"}


@pytest.fixture(scope="module")
def studied(tmp_path_factory, in_process):
    folder = tmp_path_factory.mktemp("weakest")
    return folder, run_study(STUDY, folder)


def fault(**changes):
    with pytest.raises(StudyError) as caught:
        load_study({**STUDY, **changes})
    (line,) = str(caught.value).splitlines()
    return line


def performed(algorithm, problem="Weakest"):
    """The outcome of a run, the run and its records."""
    changes = {"algorithms": [algorithm], "problem": problem and f"{MADE}:{problem}"}
    [run], records = load_study({**STUDY, **changes}).runs(), []
    return perform(run, records.append), run, records


def with_problem(run, path):
    algorithm = replace(run.algorithm, origin={**run.algorithm.origin, "problem": path})
    return replace(run, algorithm=algorithm)


class TestRun:
    def test_fronts_and_indicators_are_those_of_the_problem(self, studied):
        _, tables = studied
        assert tables.runs[["status", "evaluations"]].values.tolist() == [["done", 120]] * 2
        problem = Weakest(tables.mission("toy"))
        most = problem.objectives
        assert tables.objectives("toy") == most
        assert most.bounds == (10.0, 1.0)
        reference = tables.references[["reward", "least"]].to_numpy()
        found = tables.indicators.set_index(["run", "indicator"])["value"]
        for row in tables.runs.to_dict("records"):
            of_run = tables.plans[tables.plans["run"] == row["run"]]
            points = of_run[["reward", "least"]].to_numpy()
            plans = [tables.plan(row["run"], plan_id) for plan_id in of_run["plan_id"]]
            F = problem.evaluate_batch(problem.mission.batch(plans))
            assert np.allclose(points, -F, rtol=1e-12)
            assert row["area"] == area_indicator(points, most) > 0
            igd_plus = igd_plus_indicator(points, reference, most)
            assert found[row["run"], "igd_plus"] == pytest.approx(igd_plus)
        assert tables.plans["least"].max() == 1.0
        assert tables.targets["n_reached"].max() > 0

    @pytest.mark.usefixtures("sketched")
    def test_the_folder_is_read_again_and_reported(self, studied):
        folder, tables = studied
        assert run_study(STUDY, folder).runs["began"].equals(tables.runs["began"])
        assert make_tables(folder).indicators.equals(tables.indicators)
        paths = write_report(tables)
        page = paths[0].read_text("utf-8")
        assert f"{MADE}:Weakest, with the objectives E[R], least survival" in page
        assert "total reward times robots" not in page
        assert {"fronts-toy.png", "areas-toy.png"} <= {path.name for path in paths}

    @pytest.mark.parametrize("problem", [None, "Same"])
    def test_what_kernels_evaluate_overrides_nothing(self, problem):
        for algorithm in ("simulated-annealing", "tests.study.algorithms_made:InKernel"):
            outcome, *_ = performed(algorithm, problem)
            assert (outcome.status, outcome.evaluations) == ("done", 120)

    def test_constraints_are_its_own(self):
        outcome, run, records = performed("random", "Strict")
        assert outcome.status == "done"
        plans, _ = records[-1].plans
        assert (np.ptp(run.mission.mission.trail_lengths(plans), axis=1) == 0).all()
        _, _, records = performed("random")
        with pytest.raises(ValueError, match=r"breaks constraints of .*:Strict"):
            verify(run, *records[-1].plans)

    def test_runs_depend_on_it(self):
        own, plain = ({run.digest for run in load_study(of).runs()} for of in (STUDY, PLAIN))
        assert not own & plain
        run = load_study(STUDY).runs()[0]
        assert run.algorithm.origin["source"] is not None
        check_code(run)
        changed = replace(run.algorithm, origin={**run.algorithm.origin, "source": "0"})
        with pytest.raises(ValueError, match="the worker has 'bo-aco' "):
            check_code(replace(run, algorithm=changed))
        with pytest.raises(ValueError, match="'no_such_module:X'"):
            check_code(with_problem(run, "no_such_module:X"))


class TestRefused:
    @pytest.mark.parametrize("name", ["exact", "pareto-local-search", "simulated-annealing"])
    def test_algorithms_that_cannot_heed_it(self, name):
        with pytest.raises(TypeError) as caught:
            minimize(Weakest(load_mission("toy")), make_algorithm(name), ("n_eval", 9))
        line = fault(algorithms={"good": "greedy", "bad": name})
        assert line == f"algorithms.bad.algorithm: {name!r}: TypeError: {caught.value}"

    @pytest.mark.parametrize(
        ("name", "said"),
        [
            ("Unbounded", "problem: Unbounded overrides evaluate_batch, and does not state its"),
            ("Endless", "missions.toy.mission: 'toy': Expected the bound of an objective"),
            ("Unheard", "problem: Unheard overrides _evaluate, which not all algorithms call"),
            ("Nobody", f"problem: Problem '{MADE}:Nobody': it cannot be imported (AttributeError"),
            ("np", f"problem: Problem '{MADE}:np': expected a class derived from BOTOHE"),
            ("Unmakeable", "missions.toy.mission: 'toy': TypeError: "),
            ("Changing", f"problem: '{MADE}:Changing': expected the same objectives for all"),
        ],
    )
    def test_what_is_not_one(self, name, said):
        more = {"two": {"mission": "toy", "robots": 3}} if name == "Changing" else {}
        line = fault(problem=f"{MADE}:{name}", missions={"toy": "toy", **more})
        assert line.startswith(said)

    def test_bounds_and_best_known_fronts_are_of_other_objectives(self):
        for key, value in (("bounds", {"seconds": 1}), ("reference", "best-known")):
            said = f"{key}: expected E[R] and E[S], not the objectives of '{MADE}:Weakest'."
            assert fault(**{key: value}) == said

    @pytest.mark.parametrize("algorithm", ["random", FOREIGN])
    def test_what_it_gives_or_raises_fails_the_run(self, algorithm):
        for name in ("Misjudged", "Negative"):
            outcome, run, records = performed(algorithm, name)
            outcome = checked_outcome(run, outcome, records)
            assert outcome.status == "failed"
            assert f"{MADE}:{name} says by its objectives that" in outcome.error
        outcome, *_ = performed(algorithm, "Raising")
        assert (outcome.status, outcome.error) == ("failed", "ZeroDivisionError: out of luck")
        assert "in evaluate_batch" in outcome.traceback

    def test_what_it_raises_when_a_front_is_checked_fails_the_run(self):
        """Its code may know of things that only the run's own process has."""
        _, run, records = performed("random")
        raising = with_problem(run, f"{MADE}:Raising")
        outcome = checked_outcome(raising, Outcome("done", "evaluations", 120, 1.0, 0.0), records)
        assert (outcome.status, outcome.records) == ("failed", ())
        assert outcome.error == "ZeroDivisionError: out of luck"
        with pytest.raises(ValueError, match="is claimed to bring"):
            verify(with_problem(run, None), *records[-1].plans)
