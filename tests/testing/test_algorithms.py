"""Conformance of algorithms: those of this package, and those that break a promise."""

import json
import re
from importlib.metadata import distribution

import pytest
from typer.testing import CliRunner

from botohe_moo import RandomTrails
from botohe_moo.cli.app import app
from botohe_moo.testing import algorithms, check_plugin
from botohe_moo.testing.rules import rules_of
from tests.testing import broken

RULES = [rule.__name__ for rule in rules_of(algorithms)]
OURS = distribution("botohe-moo").entry_points.select(group="botohe_moo.algorithms").names
# They differ from NSGA-II in what pymoo does.
PYMOOS = ["sms-emoa", "spea2", "pymoo.algorithms.moo.nsga3:NSGA3"]
NAMES = [*sorted(OURS - set(PYMOOS)), *PYMOOS]


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", [*NAMES, broken.Walks, broken.Plain, broken.AlikeAndSaysSo])
def test_conforms(algorithm):
    assert [each for each in check_plugin(algorithm) if each.status != "passed"] == []


RESUMES = "resumes_when_pickled"
CLAIMS = ("own_objectives", "one_way_mission", "one_robot", "limits", "kinds")
# Each with what is said of the first rule that it breaks, and all that it breaks.
BROKEN = {
    broken.MakesNothing: ("not a pymoo Algorithm", "can_be_made"),
    broken.Untyped: ("no type is stated of n", "parameters_stated"),
    broken.Teleports: ("arc 0 -> 7 is missing", "valid_plans", *CLAIMS),
    broken.OwnWay: ("it claims E[R] and E[S]", "own_objectives"),
    broken.Forgetful: ("lacks a plan that it found", "front_of_all_evaluated"),
    broken.WholeGenerations: ("spent 20 of 1 evaluations", "exact_budget"),
    broken.LeavesSome: ("spent 40 of 45 evaluations, 80 of twice as many", "exact_budget"),
    broken.Secret: ("lacks a plan that it found", "front_of_all_evaluated", "true_budget"),
    broken.Unseeded: ("runs with the same seed differ", "same_seed_same_front", RESUMES),
    broken.OneSeed: ("two seeds give the same plans", "other_seed_other_front"),
    broken.SaysDeterministic: ("says that it is deterministic", "other_seed_other_front"),
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


class Endless(RandomTrails):
    """Goes on without evaluations when half of its budget is spent."""

    def next(self):
        if self.evaluator.n_eval < 150:
            super().next()


class Asserting(RandomTrails):
    """Breaks a promise of its own."""

    def next(self):
        assert self is None, "two\nlines"


@pytest.mark.parametrize(
    ("algorithm", "said"),
    [
        (Endless, "it goes on after 4,001 generations"),
        (Asserting, r"AssertionError: two lines .*\(test_algorithms.py, line \d+\)"),
        (broken.Loud, r"ValueError: Too loud \(broken.py, line \d+\)"),
    ],
)
def test_a_run_that_does_not_end_well_is_the_last_that_is_checked(algorithm, said):
    results = check_plugin(algorithm)
    assert [result.rule for result in results] == RULES[:2] == ["can_be_made", "runs_end"]
    assert [result.status for result in results] == ["passed", "failed"]
    assert re.fullmatch(said, results[-1].message)


def check(*given):
    ran = CliRunner().invoke(app, ["check", *given])
    return ran.exit_code, " ".join(ran.output.split()), ran


@pytest.mark.parametrize(
    ("given", "status", "said"),
    [
        (["tests.testing.broken:Walks", "-p", "n=9"], 0, f"{len(RULES)} passed"),
        (["tests.testing.broken:Secret"], 1, "evaluated 1200 plans, and counted 300"),
        (["tests.testing.broken:Secret"], 1, f"{len(RULES) - 2} passed, 2 failed"),
        (["tests.testing.test_missions:fork"], 0, "passed"),
        (["botohe_moo.mission.generators:random", "-p", "nodes=5"], 0, "file_round_trip"),
        (["no-such"], 2, "no such algorithm"),
        (["no_such:mission"], 2, "no_such"),
        (["bo-aco", "-p", "n_ants=0"], 1, "got 0. To keep it"),
    ],
)
def test_the_command(given, status, said):
    found, output, _ = check(*given)
    assert (found, said in output) == (status, True), output


def test_what_an_algorithm_prints_is_not_among_the_results():
    status, _, ran = check("tests.testing.broken:Loud", "--json")
    good, failed = json.loads(ran.stdout)
    assert good.keys() == failed.keys() == {"rule", "status", "message", "remedy"}
    assert (status, failed["rule"], failed["status"]) == (1, "runs_end", "failed")
    assert "hello" in ran.stderr


def test_what_cannot_be_called_is_refused():
    with pytest.raises(TypeError, match="Expected a class, a function or a name, got 3"):
        check_plugin(3)
