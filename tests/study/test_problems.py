"""Studies of objectives of your own: ``problem: module:Class``."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pymoo.optimize import minimize

from botohe_moo import area_indicator, load_mission, make_algorithm
from botohe_moo.indicators import igd_plus_indicator
from botohe_moo.study import StudyError, load_study, make_tables, merge_studies, read_study
from botohe_moo.study import run_study as run
from botohe_moo.study.model import check_code
from botohe_moo.study.perform import Outcome, perform, verify
from botohe_moo.study.pool import checked_outcome
from botohe_moo.study.report import write_report
from tests.study import problems_made
from tests.study.problems_made import Weakest

MADE = problems_made.__name__
FOREIGN = "tests.study.algorithms_made:Sampler"
IN_KERNEL = "tests.study.algorithms_made:InKernel"
STUDY = {
    "name": "weakest",
    "missions": ["toy"],
    "algorithms": {"ants": "bo-aco", "few": {"algorithm": "nsga2", "parameters": {"pop_size": 20}},
                   "foreign": FOREIGN},
    "problem": f"{MADE}:Weakest",
    "budget": {"evaluations": 120},
    "seeds": 1,
}  # fmt: skip
PLAIN = {key: value for key, value in STUDY.items() if key != "problem"}


@pytest.fixture(scope="module")
def studied(tmp_path_factory, in_process):
    folder = tmp_path_factory.mktemp("weakest")
    return folder, run(load_study(STUDY), folder, workers=1)


def fault(content):
    with pytest.raises(StudyError) as caught:
        load_study(content)
    (line,) = str(caught.value).splitlines()
    return line


def of_problem(name, **changes):
    return {**STUDY, "problem": f"{MADE}:{name}", **changes}


def performed(content):
    """The outcome of a study's first run, the run and its records."""
    run, records = load_study(content).runs()[0], []
    return perform(run, records.append), run, records


def with_problem(run, path):
    algorithm = replace(run.algorithm, origin={**run.algorithm.origin, "problem": path})
    return replace(run, algorithm=algorithm)


class TestRun:
    def test_fronts_are_those_of_the_problem(self, studied):
        _, tables = studied
        assert tables.runs["status"].tolist() == ["done"] * 3
        assert tables.runs["evaluations"].tolist() == [120] * 3
        problem = Weakest(tables.mission("toy"))
        rows = tables.plans
        plans = [tables.plan(row["run"], row["plan_id"]) for row in rows.to_dict("records")]
        F = problem.evaluate_batch(problem.mission.batch(plans))
        assert np.allclose(rows[["reward", "least"]], -F, rtol=1e-12)
        assert rows["least"].max() == 1.0

    def test_indicators_are_shares_of_its_bounds(self, studied):
        _, tables = studied
        most = Weakest(tables.mission("toy")).objectives
        assert tables.objectives("toy") == most
        assert most.bounds == (10.0, 1.0)
        reference = tables.references[["reward", "least"]].to_numpy()
        found = tables.indicators.set_index(["run", "indicator"])["value"]
        for row in tables.runs.to_dict("records"):
            of_run = tables.plans[tables.plans["run"] == row["run"]]
            points = of_run[["reward", "least"]].to_numpy()
            assert row["area"] == area_indicator(points, most) > 0
            igd_plus = igd_plus_indicator(points, reference, most)
            assert found[row["run"], "igd_plus"] == pytest.approx(igd_plus)
        assert tables.targets["n_reached"].max() > 0

    def test_the_folder_is_read_again(self, studied):
        folder, tables = studied
        assert read_study(folder).runs.equals(tables.runs)
        assert run(load_study(STUDY), folder).runs["began"].equals(tables.runs["began"])
        assert make_tables(folder).indicators.equals(tables.indicators)
        assert tables.manifest["problem"]["problem"] == STUDY["problem"]

    @pytest.mark.slow
    def test_the_report_says_what_objectives_are(self, studied):
        folder, tables = studied
        write_report(tables)
        page = (folder / "report" / "report.html").read_text("utf-8")
        assert f"{MADE}:Weakest, with the objectives E[R], least survival" in page
        assert "total reward times robots" not in page
        assert list((folder / "report").rglob("fronts-toy*"))
        assert list((folder / "report").rglob("areas-toy*"))

    def test_parts_are_merged_if_they_have_one_problem(self, studied, tmp_path):
        folder, _ = studied
        run(load_study({**STUDY, "seeds": [3]}), tmp_path / "b")
        both = merge_studies([folder, tmp_path / "b"], tmp_path / "both")
        assert len(both.runs) == 6
        run(load_study(PLAIN), tmp_path / "c")
        with pytest.raises(StudyError, match=r"expected the study of .* but for its seeds"):
            merge_studies([folder, tmp_path / "c"], tmp_path / "none")

    def test_the_same_is_found_by_minimize(self):
        for name in ("moead", "greedy"):
            outcome, run, records = performed({**STUDY, "algorithms": [name]})
            assert (outcome.status, outcome.error) == ("done", None)
            plans, objectives = records[-1].plans
            verify(run, plans, objectives)
            result = minimize(
                Weakest(run.mission.mission), make_algorithm(name), ("n_eval", 120), seed=1
            )
            assert sorted(map(tuple, -result.F)) == sorted(map(tuple, objectives))

    @pytest.mark.parametrize("algorithm", ["simulated-annealing", IN_KERNEL])
    def test_what_kernels_evaluate_overrides_nothing(self, algorithm):
        for content in (PLAIN, {**STUDY, "problem": f"{MADE}:Same"}):
            outcome, *_ = performed({**content, "algorithms": [algorithm]})
            assert (outcome.status, outcome.evaluations) == ("done", 120)

    def test_constraints_are_its_own(self):
        outcome, run, records = performed(of_problem("Strict", algorithms=["random"]))
        assert outcome.status == "done"
        plans, objectives = records[-1].plans
        assert (np.ptp(run.mission.mission.trail_lengths(plans), axis=1) == 0).all()
        _, plain, records = performed({**STUDY, "algorithms": ["random"]})
        plans, objectives = records[-1].plans
        verify(plain, plans, objectives)
        with pytest.raises(ValueError, match=r"breaks constraints of .*:Strict"):
            verify(run, plans, objectives)

    def test_runs_depend_on_it(self):
        own, of_all = load_study(STUDY), load_study(PLAIN)
        assert not {run.digest for run in own.runs()} & {run.digest for run in of_all.runs()}
        run = own.runs()[0]
        origin = run.algorithm.origin
        assert origin["source"] is not None
        check_code(run)
        changed = replace(run.algorithm, origin={**origin, "source": "0"})
        with pytest.raises(ValueError, match="the worker has 'bo-aco' "):
            check_code(replace(run, algorithm=changed))
        with pytest.raises(ValueError, match="'no_such_module:X'"):
            check_code(with_problem(run, "no_such_module:X"))


class TestRefused:
    def test_algorithms_that_cannot_heed_it(self):
        for algorithm in ("exact", "pareto-local-search", "simulated-annealing"):
            with pytest.raises(TypeError) as caught:
                minimize(Weakest(load_mission("toy")), make_algorithm(algorithm), ("n_eval", 9))
            line = fault({**STUDY, "algorithms": {"good": "greedy", "bad": algorithm}})
            assert line == f"algorithms.bad.algorithm: {algorithm!r}: TypeError: {caught.value}"

    def test_what_is_not_one(self):
        for name, said in (
            (
                "Unbounded",
                "problem: Unbounded overrides evaluate_batch, and does not state its obje",
            ),
            ("Endless", "missions.toy.mission: 'toy': Expected the bound of an objecti"),
            ("Unheard", "problem: Unheard overrides _evaluate, which not all algorithms call: ov"),
            ("Nobody", f"problem: Problem '{MADE}:Nobody': it cannot be imported (AttributeError:"),
            ("np", f"problem: Problem '{MADE}:np': expected a class derived from BOTOHE, or a fu"),
            ("Unmakeable", "missions.toy.mission: 'toy': TypeError: "),
        ):
            assert fault(of_problem(name)).startswith(said)
        missions = {"one": "toy", "two": {"mission": "toy", "robots": 3}}
        assert fault(of_problem("Changing", missions=missions)) == (
            f"problem: '{MADE}:Changing': expected the same objectives for all missions."
        )
        assert "cannot be imported" in fault({**STUDY, "problem": "no_such_module:X"})
        assert "Expected problem to be a text" in fault({**STUDY, "problem": 3})

    def test_bounds_and_best_known_fronts_are_of_other_objectives(self):
        for key, value in (("bounds", {"seconds": 1}), ("reference", "best-known")):
            line = fault({**STUDY, key: value})
            assert line == f"{key}: expected E[R] and E[S], not the objectives of '{MADE}:Weakest'."

    @pytest.mark.parametrize("algorithm", ["random", FOREIGN])
    def test_objectives_outside_their_bounds_fail_the_run(self, algorithm):
        for name in ("Misjudged", "Negative"):
            outcome, run, records = performed(of_problem(name, algorithms=[algorithm]))
            outcome = checked_outcome(run, outcome, records)
            assert outcome.status == "failed"
            assert f"{MADE}:{name} says by its objectives that" in outcome.error

    @pytest.mark.parametrize("algorithm", ["random", FOREIGN])
    def test_what_it_raises_fails_the_run(self, algorithm):
        outcome, *_ = performed(of_problem("Raising", algorithms=[algorithm]))
        assert (outcome.status, outcome.error) == ("failed", "ZeroDivisionError: out of luck")
        assert "in evaluate_batch" in outcome.traceback
        assert Path(problems_made.__file__).name in outcome.traceback

    def test_what_it_raises_when_a_front_is_checked_fails_the_run(self):
        """Its code may know of things that only the run's own process has."""
        _, run, records = performed({**STUDY, "algorithms": ["random"]})
        raising = with_problem(run, f"{MADE}:Raising")
        outcome = checked_outcome(raising, Outcome("done", "evaluations", 120, 1.0, 0.0), records)
        assert (outcome.status, outcome.records) == ("failed", ())
        assert outcome.error == "ZeroDivisionError: out of luck"

    def test_fronts_of_other_objectives(self):
        _, run, records = performed({**STUDY, "algorithms": ["random"]})
        plain = with_problem(run, None)
        with pytest.raises(ValueError, match="is claimed to bring"):
            verify(plain, *records[-1].plans)
