"""Conformance of algorithms: those of this package, and those that break a promise."""

import json
import sys
from importlib.metadata import distribution

import pytest
from typer.testing import CliRunner

from botohe_moo.cli.app import app
from botohe_moo.testing import algorithms, check_algorithm, parametrize_with_checks
from botohe_moo.testing.rules import rules_of
from tests.forked import run_forked
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
    assert [each for each in check_algorithm(algorithm) if each.status != "passed"] == []


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
    "survival_floor",
    "travel_budget",
    "kinds",
)
BROKEN = {
    broken.MakesNothing: ("not a pymoo Algorithm", "can_be_made"),
    broken.Idle: ("no evaluation in 1,000 generations", "runs_end"),
    broken.Untyped: ("no type is stated of n", "parameters_stated"),
    broken.Teleports: ("arc 0 -> 7 is missing", "valid_plans", *CLAIMS),
    broken.Boasts: ("of a plan that has", "valid_plans", *CLAIMS),
    broken.OwnWay: ("of a plan that has", "own_objectives"),
    broken.Forgetful: ("lacks a plan that it found", "front_of_all_evaluated"),
    broken.WholeGenerations: ("spent 20 of 1 evaluations", "exact_budget"),
    broken.LeavesSome: ("spent 40 of 45 evaluations, 80 of twice as many", "exact_budget"),
    broken.Secret: ("evaluated 1200 plans, and counted 300", "true_budget"),
    broken.Unseeded: ("runs with the same seed differ", "same_seed_same_front", RESUMES),
    broken.OneSeed: ("two seeds give the same plans", "other_seed_other_front"),
    broken.SaysDeterministic: ("says that it is deterministic", "other_seed_other_front"),
    broken.Lambda: ("Can't pickle", RESUMES),
    broken.LosesItsState: ("pickled after 8 of 17 generations differs", RESUMES),
    broken.BackTheSameWay: (
        "arc 4 -> 0 is missing",
        "same_seed_same_front",
        "one_way_mission",
        "kinds",
    ),
    broken.Pairs: ("IndexError: tuple index out of range (broken.py, line", "one_robot"),
    broken.Alike: ("got 'roof' of kind 'drone'", "kinds"),
    broken.Reckless: ("a limit is broken", "survival_floor", "travel_budget", "kinds"),
}


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", BROKEN, ids=lambda algorithm: algorithm.__name__)
def test_each_fails_for_its_reason_and_for_no_other(algorithm):
    said, *rules = BROKEN[algorithm]
    results = check_algorithm(algorithm)
    failed = [result for result in results if result.status == "failed"]
    assert [result.rule for result in failed] == rules
    assert said in failed[0].message
    assert all(result.remedy for result in failed)
    skipped = [result.rule for result in results if result.status == "not run"]
    if rules[0] in ("can_be_made", "runs_end"):
        at = RULES.index(rules[0])
        assert skipped == RULES[at + 1 :]
    else:
        assert skipped == []


def test_every_rule_is_broken_by_one():
    assert {*RULES} == {name for _, *names in BROKEN.values() for name in names}


def test_what_cannot_be_imported_fails():
    with pytest.raises(ValueError, match=r"no_such_package.*cannot be imported"):
        check_algorithm("no_such_package:Algorithm")
    with pytest.raises(TypeError, match="Expected a class or function that makes an algorithm"):
        check_algorithm(3)
    with pytest.raises(TypeError, match="Expected factories to be a list"):
        parametrize_with_checks("bo-aco")


def test_expected_failures_are_rules_of_algorithms_and_missions_together():
    with pytest.raises(ValueError, match="There is no rule 'one_robott'; known are one_robot, "):
        parametrize_with_checks(["random"], expected_failed_checks={"one_robott": "no"})
    marks = parametrize_with_checks(["random", "toy"], expected_failed_checks={"one_robot": "no"})
    expected = [case.id for case in marks.args[1] if case.marks]
    assert expected == ["random-one_robot"]


AUTHORS_TESTS = """
from botohe_moo.testing import parametrize_with_checks
from tests.testing.broken import Pairs

@parametrize_with_checks([Pairs], expected_failed_checks={{{expected}: "by design"}})
def test_conforms(check):
    check()
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("expected", "outcome"),
    [("'one_robot'", "1 xfailed"), ("'runs_end'", "2 failed")],
)
def test_expected_failures_are_strict(tmp_path, expected, outcome):
    path = tmp_path / "test_mine.py"
    path.write_text(AUTHORS_TESTS.format(expected=expected))
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(path)]
    command += ["-k", "runs_end or one_robot", "--rootdir", str(tmp_path)]
    assert outcome in run_forked(command).stdout


class TestCommand:
    def check(self, *given):
        return CliRunner().invoke(app, ["check", *given])

    def test_a_conforming_algorithm(self):
        ran = self.check("tests.testing.broken:Walks")
        assert ran.exit_code == 0, ran.output
        assert f"{len(RULES)} passed" in ran.output

    def test_broken_ones_say_why(self):
        ran = self.check("tests.testing.broken:Secret")
        said, rule = BROKEN[broken.Secret]
        assert ran.exit_code == 1
        assert rule in ran.output
        assert said in " ".join(ran.output.split())
        assert f"{len(RULES) - 1} passed, 1 failed" in ran.output

    def test_json(self):
        ran = self.check("tests.testing.broken:Pairs", "--json")
        assert ran.exit_code == 1
        results = json.loads(ran.stdout)
        assert [each["rule"] for each in results] == RULES
        failed = [each for each in results if each["status"] == "failed"]
        assert [each["rule"] for each in failed] == ["one_robot"]
        assert failed[0].keys() == {"rule", "status", "seconds", "message", "remedy"}

    def test_what_an_algorithm_prints_is_not_among_the_results(self):
        ran = self.check("tests.testing.broken:Loud", "--json")
        assert [each["rule"] for each in json.loads(ran.stdout)] == RULES
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
