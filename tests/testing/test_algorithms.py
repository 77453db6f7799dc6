"""Conformance of algorithms: those of this package, and those that break a promise."""

import json
import re
from importlib.metadata import distribution

import pytest
from typer.testing import CliRunner

from botohe_moo import RandomTrails
from botohe_moo.cli.app import app
from botohe_moo.testing import algorithms, check_plugin, parametrize_with_checks
from botohe_moo.testing.rules import rules_of
from tests.testing import broken

RULES = [rule.__name__ for rule in rules_of(algorithms)]
OURS = distribution("botohe-moo").entry_points.select(group="botohe_moo.algorithms").names
# They differ from NSGA-II in what pymoo does.
PYMOOS = [
    "sms-emoa",
    "spea2",
    "pymoo.algorithms.moo.nsga3:NSGA3",
]
NAMES = [*sorted(OURS - set(PYMOOS)), *PYMOOS]


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", [*NAMES, broken.Plain, broken.AlikeAndSaysSo])
def test_conforms(algorithm):
    assert [each for each in check_plugin(algorithm) if each.status != "passed"] == []


@pytest.mark.slow
@parametrize_with_checks([broken.Walks])
def test_each_rule_is_a_test(check):
    check()


RESUMES = "resumes_when_pickled"
# Each with the rules that it breaks, and what is said of the first.
CLAIMS = (
    "own_objectives",
    "one_way_mission",
    "one_robot",
    "limits",
    "kinds",
)
BROKEN = {
    broken.MakesNothing: ("not a pymoo Algorithm", "can_be_made"),
    broken.Untyped: ("no type is stated of n", "parameters_stated"),
    broken.Teleports: ("arc 0 -> 7 is missing", "valid_plans", *CLAIMS),
    broken.Boasts: ("it claims E[R] and E[S]", "valid_plans", *CLAIMS),
    broken.OwnWay: ("it claims E[R] and E[S]", "own_objectives"),
    broken.Forgetful: ("lacks a plan that it found", "front_of_all_evaluated"),
    broken.WholeGenerations: ("spent 20 of 1 evaluations", "exact_budget"),
    broken.LeavesSome: ("spent 40 of 45 evaluations, 80 of twice as many", "exact_budget"),
    broken.Secret: ("lacks a plan that it found", "front_of_all_evaluated", "true_budget"),
    broken.Unseeded: ("runs with the same seed differ", "same_seed_same_front", RESUMES),
    broken.OneSeed: ("two seeds give the same plans", "other_seed_other_front"),
    broken.SaysDeterministic: ("says that it is deterministic", "other_seed_other_front"),
    broken.Lambda: ("Can't pickle", RESUMES),
    broken.LosesItsState: ("before each generation differs", RESUMES),
    broken.BackTheSameWay: (
        "arc 4 -> 0 is missing",
        "same_seed_same_front",
        "one_way_mission",
        "kinds",
    ),
    broken.Pairs: ("IndexError: tuple index out of range (broken.py, line", "one_robot"),
    broken.Alike: ("got 'roof' of kind 'drone'", "kinds"),
    broken.Reckless: ("expected a survival of at least 0.5", "limits", "kinds"),
}


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", BROKEN, ids=lambda algorithm: algorithm.__name__)
def test_each_fails_for_its_reason_and_for_no_other(algorithm):
    said, *rules = BROKEN[algorithm]
    results = check_plugin(algorithm)
    failed = [result for result in results if result.status == "failed"]
    assert [result.rule for result in failed] == rules
    assert said in failed[0].message
    assert all(result.remedy for result in failed)
    if rules[0] not in ("can_be_made", "runs_end"):  # else nothing more can be checked
        assert [result.rule for result in results] == RULES


def test_every_rule_is_broken_by_one():
    assert {*RULES} - {"runs_end"} == {name for _, *names in BROKEN.values() for name in names}


def test_what_cannot_be_imported_fails():
    with pytest.raises(ValueError, match=r"no_such_package.*cannot be imported"):
        check_plugin("no_such_package:Algorithm")
    with pytest.raises(TypeError, match="Expected a class, a function or a name, got 3"):
        check_plugin(3)


class TestCommand:
    def check(self, *given):
        return CliRunner().invoke(app, ["check", *given])

    def test_a_conforming_algorithm(self):
        ran = self.check("tests.testing.broken:Walks")
        assert ran.exit_code == 0, ran.output
        assert f"{len(RULES)} passed" in ran.output

    def test_broken_ones_say_why(self):
        ran = self.check("tests.testing.broken:Secret")
        assert ran.exit_code == 1
        assert "true_budget" in ran.output
        assert "evaluated 1200 plans, and counted 300" in " ".join(ran.output.split())
        assert f"{len(RULES) - 2} passed, 2 failed" in ran.output

    def test_json(self):
        ran = self.check("tests.testing.broken:Pairs", "--json")
        assert ran.exit_code == 1
        results = json.loads(ran.stdout)
        assert [each["rule"] for each in results] == RULES
        failed = [each for each in results if each["status"] == "failed"]
        assert [each["rule"] for each in failed] == ["one_robot"]
        assert failed[0].keys() == {"rule", "status", "message", "remedy"}

    def test_what_an_algorithm_prints_is_not_among_the_results(self):
        ran = self.check("tests.testing.broken:Loud", "--json")
        assert [each["rule"] for each in json.loads(ran.stdout)] == RULES[:2]
        assert "hello" in ran.stderr
        assert "ValueError: Too loud (broken.py, line" in ran.stdout

    def test_parameters_and_missions(self):
        assert self.check("bo-aco", "-p", "n_ants=20").exit_code == 0
        assert "Expected n_ants in" in self.check("bo-aco", "-p", "n_ants=0").output
        assert self.check("terrain", "-p", "nodes=20").exit_code == 0
        assert self.check("tests.testing.test_missions:fork").exit_code == 0
        made = "botohe_moo.mission.generators:random"
        assert "file_round_trip" in self.check(made, "-p", "nodes=5").output

    @pytest.mark.parametrize(
        ("given", "named"),
        [
            (["no-such"], "there is no such algorithm"),
            (["no_such:mission"], "no_such"),
        ],
    )
    def test_bad_input(self, given, named):
        ran = self.check(*given)
        assert ran.exit_code == 2
        assert named in " ".join(ran.output.split())


class Endless(RandomTrails):
    """Goes on without evaluations when half of its budget is spent."""

    def next(self):
        if self.evaluator.n_eval < 150:
            super().next()


def test_a_run_without_end_is_a_broken_rule():
    *_, last = check_plugin(Endless)
    assert (last.rule, last.status) == ("runs_end", "failed")
    assert "it goes on after 4,001 generations" in last.message


class Asserting(RandomTrails):
    """Breaks a promise of its own."""

    def next(self):
        assert self is None, "two\nlines"


def test_an_assertion_of_the_algorithm_is_told_with_its_place():
    *_, last = check_plugin(Asserting)
    assert re.fullmatch(
        r"AssertionError: two lines .*\(test_algorithms.py, line \d+\)", last.message
    )
