"""Conformance of missions: those of this package, and those that break a promise."""

import itertools

import networkx as nx
import pytest

from botohe_moo import Mission
from botohe_moo.testing import check_plugin, missions, parametrize_with_checks
from botohe_moo.testing.rules import rules_of
from tests.strategies import mission_of

RULES = [rule.__name__ for rule in rules_of(missions)]
NAMES = ("art_museum", "building", "complete", "lattice", "orienteering", "random", "town", "toy")


@pytest.mark.parametrize("name", [*NAMES, "two_communities"])
def test_conforms(name):
    assert [each for each in check_plugin(name) if each.status != "passed"] == []


def fork(*, seed: int = 0, robots: int = 2) -> Mission:
    """Conforming: a base, and two nodes, of which the seed makes one worth more."""
    rewards = [0.0, 1.0 + seed, 2.0]
    return mission_of([(0, 1, 0.9), (0, 2, 0.9)], rewards, both_ways=True, robots=robots)


@parametrize_with_checks([fork])
def test_what_says_that_it_makes_a_mission_is_checked_as_one(check):
    assert check.rule in RULES
    check()


def nothing() -> Mission:
    return None


def untyped(*, seed=0) -> Mission:
    return fork(seed=seed)


def swallows(**others) -> Mission:
    return fork()


counter = itertools.count()


def another_each_time() -> Mission:
    return fork(seed=next(counter))


def odd_labels() -> Mission:
    return Mission(nx.relabel_nodes(fork().graph, {1: frozenset("a")}), base=0, robots=2)


def unpicklable() -> Mission:
    return Mission(nx.DiGraph(fork().graph, made_by=lambda: None), base=0, robots=2)


def pointless() -> Mission:
    return mission_of([(0, 1, 0.9)], [0.0, 0.0], both_ways=True, robots=2)


BROKEN = {
    nothing: ("not a Mission", {"can_be_made"}),
    untyped: ("no type is stated of seed", {"parameters_stated"}),
    swallows: ("takes keywords that it does not state", {"parameters_stated"}),
    another_each_time: ("same parameters differ", {"same_twice", "file_round_trip"}),
    odd_labels: ("", {"file_round_trip"}),
    unpicklable: ("pickle", {"can_be_pickled", "file_round_trip"}),
    pointless: ("no robot can collect anything", {"something_to_gain"}),
}


@pytest.mark.parametrize("mission", BROKEN, ids=lambda mission: mission.__name__)
def test_each_fails_for_its_reason(mission):
    said, rules = BROKEN[mission]
    failed = {r.rule: r.message for r in check_plugin(mission) if r.status == "failed"}
    assert failed.keys() <= rules
    assert min(rules, key=RULES.index) in failed or len(rules) > 1
    assert any(said in message for message in failed.values())


def test_every_rule_is_broken_by_one():
    assert {*RULES} == set().union(*(rules for _, rules in BROKEN.values()))
