"""Conformance of algorithms: those of this package, and those that break a promise."""

import contextlib
import json
import sys
import time
from importlib.metadata import distribution

import numpy as np
import pytest
from typer.testing import CliRunner

from botohe_moo import BOTOHE
from botohe_moo.cli.app import app
from botohe_moo.operators import RandomTrailSampling
from botohe_moo.testing import BrokenRuleError, check_algorithm, parametrize_with_checks
from botohe_moo.testing.algorithms import RULES
from tests.forked import run_forked
from tests.testing import broken

OURS = distribution("botohe-moo").entry_points.select(group="botohe_moo.algorithms").names
DOTTED = ("pymoo.algorithms.moo.age:AGEMOEA", "pymoo.algorithms.moo.nsga3:NSGA3")


@parametrize_with_checks([*sorted(OURS), *DOTTED, broken.Walks, broken.Plain])
def test_conforms(check):
    check()


CLAIMS = ("objectives_of_the_problem", "own_objectives", "one_way_mission", "one_robot")
CLAIMS += ("survival_floor", "travel_budget")
UNSTEADY = ("same_seed_same_front", "runs_are_independent", "resumes_when_pickled")

# Each with the rules that it breaks, and what is said of the first.
BROKEN = {
    broken.MakesNothing: ("not a pymoo Algorithm", "can_be_made"),
    broken.Idle: ("no evaluation in 1,000 generations", "runs_end"),
    broken.Endless: ("did not return within 0.2 s", "runs_end"),
    broken.Untyped: ("no type is stated of n", "parameters_stated"),
    broken.Described: ("describes width; the signature does not", "parameters_stated"),
    broken.Teleports: ("arc 0 -> 7 is missing", "valid_plans", *CLAIMS),
    broken.Boasts: ("of a plan that has", *CLAIMS),
    broken.OwnWay: ("of a plan that has", "own_objectives"),
    broken.Forgetful: ("lacks a plan that it found", "front_of_all_evaluated"),
    broken.WholeGenerations: ("spent 20 of 1 evaluations", "exact_budget"),
    broken.LeavesSome: ("spent 40 of 45 evaluations, 80 of twice as many", "exact_budget"),
    broken.Secret: ("evaluated 1200 plans, and counted 300", "true_budget"),
    broken.Unseeded: ("two runs with the same seed differ", *UNSTEADY),
    broken.Remembers: ("two runs with the same seed differ", *UNSTEADY),
    broken.OneSeed: ("two seeds give the same plans", "other_seed_other_front"),
    broken.SaysDeterministic: ("says that it is deterministic", "other_seed_other_front"),
    broken.Shared: ("a generator that all share", "shared_generators_untouched"),
    broken.Meddles: ("changes the graph", "inputs_unchanged"),
    broken.Lambda: ("Can't pickle", "resumes_when_pickled"),
    broken.LosesItsState: ("pickled after 8 of 17 generations differs", "resumes_when_pickled"),
    broken.BackTheSameWay: ("arc 4 -> 0 is missing", "runs_are_independent", "one_way_mission"),
    broken.Pairs: ("IndexError: tuple index out of range (broken.py, line", "one_robot"),
    broken.Restless: ("staying home, all do", "staying_home"),
    broken.Reckless: ("a robot survives with", "survival_floor", "travel_budget"),
}


@pytest.mark.parametrize("algorithm", BROKEN, ids=lambda algorithm: algorithm.__name__)
def test_each_fails_for_its_reason_and_for_no_other(algorithm):
    said, *rules = BROKEN[algorithm]
    limit = 0.2 if algorithm is broken.Endless else 60
    results = check_algorithm(algorithm, time_limit=limit)
    failed = [result for result in results if result.status == "failed"]
    assert [result.rule for result in failed] == rules
    assert said in failed[0].message
    assert all(result.remedy for result in failed)
    skipped = [result.rule for result in results if result.status == "not run"]
    if rules[0] in ("can_be_made", "runs_end"):
        at = [rule.name for rule in RULES].index(rules[0])
        assert skipped == [rule.name for rule in RULES[at + 1 :]]
    else:
        assert skipped == []


def test_every_rule_is_broken_by_one():
    assert {rule.name for rule in RULES} == {
        name for _, *names in BROKEN.values() for name in names
    }


def test_what_cannot_be_imported_fails():
    with pytest.raises(ValueError, match=r"no_such_package.*cannot be imported"):
        check_algorithm("no_such_package:Algorithm")
    with pytest.raises(TypeError, match="Expected a class or function that makes an algorithm"):
        check_algorithm(3)
    with pytest.raises(ValueError, match="Expected time_limit > 0"):
        check_algorithm(broken.Walks, time_limit=0)


def test_a_raised_error_tells_the_rule_and_the_remedy():
    marks = parametrize_with_checks([broken.Restless]).args[1]
    check = next(case.values[0] for case in marks if case.id == "Restless-staying_home")
    with pytest.raises(BrokenRuleError, match=r"Restless, staying_home: .*all do") as raised:
        check()
    assert "The rule: Where leaving gains nothing" in str(raised.value)
    assert "To keep it: Let robots stay at base" in str(raised.value)


class Stubborn(broken.Walks):
    """Goes on for ever, whatever is raised."""

    def _advance(self, **_):
        while True:
            with contextlib.suppress(Exception):
                time.sleep(0.01)


def test_what_swallows_errors_ends_all_the_same():
    results = {each.rule: each for each in check_algorithm(Stubborn, time_limit=0.3)}
    assert results["runs_end"].status == "failed"
    assert results["runs_end"].message == "it did not return within 0.3 s"


class Homeless(broken.Walks):
    """Takes in nothing but plans that break the floor."""

    def walks(self, n):
        if self.problem.min_survival == 0:
            return super().walks(n)
        drawn = RandomTrailSampling().sample_batch(BOTOHE(self.problem.mission), 200, self.rng())
        kept = (self.problem.constrain_batch(drawn) > 0).any(axis=1)
        return drawn.take(np.flatnonzero(kept)[:n])


def test_a_front_without_a_plan_is_not_blamed_for_one_that_nobody_found():
    results = {each.rule: each for each in check_algorithm(Homeless)}
    assert results["front_of_all_evaluated"].status == "passed"


@pytest.mark.parametrize(
    ("arguments", "error", "said"),
    [
        ({"factories": "bo-aco"}, TypeError, "Expected factories to be a list, got 'bo-aco'"),
        ({"factories": broken.Walks}, TypeError, "Expected factories to be a list"),
        ({"factories": [], "expected_failed_checks": ["one_robot"]}, TypeError, "to map rules to"),
        ({"factories": [], "kind": "algo"}, ValueError, "Expected kind to be 'algorithm' or"),
    ],
)
def test_arguments_of_parametrizing_are_checked(arguments, error, said):
    with pytest.raises(error, match=said):
        parametrize_with_checks(**arguments)


def test_expected_failures_are_rules_of_algorithms_and_missions_together():
    marks = parametrize_with_checks(["random", "toy"], expected_failed_checks={"one_robot": "no"})
    expected = [case.id for case in marks.args[1] if case.marks]
    assert expected == ["random-one_robot"]


AUTHORS_TESTS = """
from botohe_moo.testing import parametrize_with_checks
from tests.testing.broken import Restless

@parametrize_with_checks([Restless], expected_failed_checks={{{expected}: "by design"}})
def test_conforms(check):
    check()
"""


@pytest.mark.parametrize(
    ("expected", "outcome"),
    [("'staying_home'", "1 xfailed"), ("'one_robot'", "2 failed"), ("'one_robott'", "no rule")],
)
def test_expected_failures_are_strict(tmp_path, expected, outcome):
    path = tmp_path / "test_mine.py"
    path.write_text(AUTHORS_TESTS.format(expected=expected))
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(path)]
    command += ["-k", "staying_home or one_robot", "--rootdir", str(tmp_path)]
    assert outcome in run_forked(command).stdout


class TestCommand:
    def check(self, *given):
        return CliRunner().invoke(app, ["check", *given])

    def test_a_conforming_algorithm(self):
        ran = self.check("tests.testing.broken:Walks")
        assert ran.exit_code == 0, ran.output
        assert f"{len(RULES)} passed" in ran.output

    @pytest.mark.parametrize("algorithm", [broken.Secret, broken.Lambda], ids=lambda a: a.__name__)
    def test_broken_ones_say_why(self, algorithm):
        ran = self.check(f"tests.testing.broken:{algorithm.__name__}")
        said, rule = BROKEN[algorithm]
        assert ran.exit_code == 1
        assert rule in ran.output
        assert said in " ".join(ran.output.split())
        assert f"{len(RULES) - 1} passed, 1 failed" in ran.output

    def test_json(self):
        ran = self.check("tests.testing.broken:Restless", "--json")
        assert ran.exit_code == 1
        results = json.loads(ran.stdout)
        assert [each["rule"] for each in results] == [rule.name for rule in RULES]
        failed = [each for each in results if each["status"] == "failed"]
        assert [each["rule"] for each in failed] == ["staying_home"]
        assert failed[0].keys() == {"rule", "status", "seconds", "message", "remedy"}

    def test_what_an_algorithm_prints_is_not_among_the_results(self):
        ran = self.check("tests.testing.broken:Loud", "--json")
        assert [each["rule"] for each in json.loads(ran.stdout)] == [rule.name for rule in RULES]
        assert "hello" in ran.stderr
        assert "ValueError: Too loud (broken.py, line" in ran.stdout

    def test_parameters_and_missions(self):
        assert self.check("bo-aco", "-p", "n_ants=20").exit_code == 0
        assert self.check("terrain", "-p", "nodes=20").exit_code == 0
        assert self.check("tests.testing.test_missions:fork").exit_code == 0
        assert "file_round_trip" in self.check("random", "--mission").output

    @pytest.mark.parametrize(
        ("given", "named"),
        [
            (["no-such"], "there is no such algorithm"),
            (["no-such", "--mission"], "there is no such mission"),
            (["bo-aco", "-p", "n_antz=3"], "there is no parameter 'n_antz'"),
            (["bo-aco", "-p", "n_ants=0"], "Expected n_ants in"),
            (["tests.testing.broken:Walks", "-p", "n"], "NAME=VALUE"),
        ],
    )
    def test_bad_input(self, given, named):
        ran = self.check(*given)
        assert ran.exit_code == 2
        assert named in " ".join(ran.output.split())
