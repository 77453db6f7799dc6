"""Missions under way: what is left of them after some events."""

import math
from dataclasses import replace
from itertools import pairwise, product
from math import prod

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from botohe_moo import Event, Mission, MissionError, load_mission
from botohe_moo.mission import PlanError
from botohe_moo.mission.model import numbers_digest
from botohe_moo.mission.underway import apply_events, robots_at_start, settle_rewards
from botohe_moo.underway import EventError, under_way
from tests import twins
from tests.examples import examples
from tests.strategies import missions_with_plans, team_missions_with_plans

LOST, HOME = "lost", "home"


@st.composite
def moments(draw, trails):
    """Where each robot is at a moment: (position, how it is), and the events that say so."""
    states, events = [], []
    for robot, trail in enumerate(trails):
        at, end = draw(st.integers(0, len(trail) - 1)), len(trail) - 1
        how = draw(st.sampled_from(["out", "out", LOST, HOME]))
        if how == LOST and at == end:
            how = "out"
        positions = range(1, at + 1)
        if how == HOME:
            at = end
        events += [Event("reached", robot, trail[i]) for i in positions]
        if how != "out":
            events.append(Event(how, robot, trail[at + 1] if how == LOST else None))
        states.append((at, how))
    return states, events


def expected(mission, trails, states):
    """E[R] and E[S] of a plan, given what is known of each robot, by enumeration."""
    robots = list(zip(mission.kind_of, trails, states, strict=True))
    possible = []
    for kind, trail, (at, how) in robots:
        fates = list(twins.fates(mission, kind, trail))
        if how == LOST:
            fates = [(1.0, *fates[at][1:])]
        elif how == HOME:
            fates = [(1.0, *fates[-1][1:])]
        else:  # lost on a later arc, or never
            hops = (mission.graph.edges[hop]["survival"] for hop in pairwise(trail[: at + 1]))
            alive = prod(twins.of_kind(survival, kind) for survival in hops)
            fates = [(chance / alive, *rest) for chance, *rest in fates[at:]]
        possible.append(fates)
    reward = survivors = 0.0
    for joint in product(*possible):
        chance, missed = prod(fate[0] for fate in joint), {}
        for (kind, *_), (_, paid, survives) in zip(robots, joint, strict=True):
            survivors += chance * survives
            for node in paid:
                share = twins.share_of(mission, kind, node)
                missed[node] = missed.get(node, 1.0) * (1 - share)
        nodes = mission.graph.nodes
        reward += chance * sum(nodes[v]["reward"] * (1 - m) for v, m in missed.items())
    return [reward, survivors]


def keeps_limits(mission, plan):
    """Whether a plan keeps the limits of each kind."""
    [lengths], [survivals] = mission.trail_lengths([plan]), mission.robot_survival([plan])
    return all(
        (kind.max_length is None or length <= kind.max_length) and survival >= kind.min_survival
        for kind, length, survival in zip(mission.kind_of, lengths, survivals, strict=True)
    )


@examples(400)
@given(missions_with_plans(max_robots=3) | team_missions_with_plans(), st.data())
def test_what_is_left_is_what_enumeration_gives(case, data):
    mission, plan = case
    trails = mission.labels(plan)
    states, events = data.draw(moments(trails))
    if not events and keeps_limits(mission, plan):
        assert mission.after(plan, events) is mission
        return
    if keeps_limits(mission, plan) and all(how == LOST for _, how in states):
        with pytest.raises(MissionError, match="all robots are lost"):
            mission.after(plan, events)
        return
    if not keeps_limits(mission, plan):
        with pytest.raises(PlanError, match=r"^Plan 0, robot \d: expected a (survival|length) of "):
            under_way(mission, plan, events)
        return
    left = under_way(mission, plan, events)
    reward, survivors = expected(mission, trails, states)
    [found] = left.mission.evaluate([left.plan])
    assert left.banked + found[0] == pytest.approx(reward, rel=1e-12, abs=1e-12)
    assert found[1] == pytest.approx(survivors, rel=1e-12)
    ends = [trail[-1] for trail in left.mission.labels(left.plan)]
    assert [trails[robot][-1] for robot in left.robots] == ends


@pytest.mark.filterwarnings("ignore:.*no kind of robots can collect")
@given(missions_with_plans(max_robots=3) | team_missions_with_plans(), st.data())
def test_two_cuts_are_as_good_as_one_and_what_is_left_is_valid(case, data):
    mission, plan = case
    states, events = data.draw(moments(mission.labels(plan)))
    assume(keeps_limits(mission, plan) and any(how != LOST for _, how in states))
    cut = data.draw(st.integers(0, len(events)))
    whole, first = under_way(mission, plan, events), under_way(mission, plan, events[:cut])
    row = {old: new for new, old in enumerate(first.robots)}
    later = [replace(event, robot=row[event.robot]) for event in events[cut:]]
    second = under_way(first.mission, first.plan, later)
    assert first.banked + second.banked == pytest.approx(whole.banked, abs=1e-9)
    [once], [twice] = (left.mission.evaluate([left.plan]) for left in (whole, second))
    assert twice == pytest.approx(once, abs=1e-9)
    left = whole.mission  # which is not checked when it is made
    again = Mission(left.graph, base=left.base, kinds=left.kinds, pays=left.pays)
    assert numbers_digest(again) == numbers_digest(left)


def test_limits_are_kept_without_any_event():
    museum = load_mission("art_museum")
    home = museum.stay_home()
    left = under_way(museum, home, [], min_survival=0.5, max_length=10)
    assert [(kind.min_survival, kind.max_length) for kind in left.mission.kinds] == [(0.5, 10)]
    assert museum.after(home, [], max_length=10).robots == 3


def test_no_budget_is_no_budget():
    """inf takes the place of the mission's own budget, in what is left, too."""
    graph = load_mission("toy").graph.copy()
    graph.graph["max_length"] = 4
    toy = Mission(graph, base=1, robots=2)
    plan = toy.plan([[1, 2, 4, 2, 1], [1]])
    kinds = toy.after(plan, [Event("reached", 0, 4)]).kinds
    assert [kind.max_length for kind in kinds] == [2, 4]
    left = toy.after(plan, [Event("reached", 0, 4)], max_length=math.inf)
    assert [kind.max_length for kind in left.kinds] == [None, None]
    assert left.max_length is None

    # Robots keep their names.
    assert [kind.name for kind in kinds] == ["robot 0", "robot"]
    first = under_way(toy, plan, [Event("reached", 0, 2)])
    rest = first.mission.after(first.plan, [Event("reached", "robot 0", 4)])
    assert ([kind.name for kind in rest.kinds], rest.kinds[0].start) == (["robot 0", "robot"], 4)


def test_rewards_by_hand():
    """The lab pays on return; each robot collects the reef with probability 0.5."""
    graph = nx.DiGraph(base="dock")
    graph.add_nodes_from(["dock", "pier"], reward=0.0, depot=True)
    graph.add_node("reef", reward=4.0, share=0.5)
    graph.add_node("lab", reward=8.0, pays="return")
    trail = ["dock", "reef", "lab", "pier", "dock"]
    graph.add_edges_from(pairwise(trail), survival=0.5)
    mission = Mission(graph, robots=2)
    start = robots_at_start(mission, mission.plan([trail, trail]), mission.limits())
    out = apply_events(start, [Event("reached", 0, "lab"), Event("lost", 1, "lab")])
    settled = settle_rewards(mission, out)
    banked = settled.banked(mission)
    assert (settled.left["reef"], settled.left["lab"], banked) == (1.0, 8.0, 3.0)
    assert settled.paid == (["dock", "reef"], ["dock", "reef"])
    assert settled.aboard == ((), ())  # the lab is where robot 0 still is
    at_pier = settle_rewards(mission, apply_events(out, [Event("reached", 0, "pier")]))
    assert (at_pier.left["lab"], at_pier.banked(mission)) == (0.0, 11.0)
    assert [robot.at for robot in start] == [0, 0]  # events give new states


def test_limits_are_named():
    toy = load_mission("toy")
    plan = toy.plan([[1], [1, 2, 4, 2, 1]])
    [[_, survival]] = toy.robot_survival([plan])
    for limit, expected in (
        ({"min_survival": 1.0}, f"a survival of at least 1 in mission 'toy', got {survival:g}."),
        ({"max_length": 3}, "a length of at most 3 in mission 'toy', got 4."),
    ):
        with pytest.raises(PlanError) as caught:
            toy.after(plan, [], **limit)
        assert str(caught.value) == f"Plan 0, robot 1: expected {expected}"


def test_bad_events():
    toy = load_mission("toy")
    plan = toy.plan([[1, 2, 4, 2, 1], [1]])
    reached, lost = Event("reached", 0, 4), Event("lost", 0)
    others = [Event("reached", 1, 2), Event("home", 2), Event("arrived", 1), Event("home", 1, 2)]
    others += [Event("lost", "robot"), Event("home", np.int64(1))]
    with pytest.raises(EventError) as caught:
        toy.after(plan, [reached, reached, lost, lost, *others])
    assert str(caught.value).splitlines() == [
        "Event 1: robot 0 reached 4: expected a node of the rest of its trail, 2, 1.",
        "Event 3: robot 0 lost: it is lost already.",
        "Event 4: robot 1 reached 2: expected a node of the rest of its trail, which has ended.",
        "Event 5: robot 2 home: expected a row of the plan, 0 to 1.",
        "Event 6: expected one of ['reached', 'lost', 'home'], got 'arrived'.",
        "Event 7: robot 1 home at 2: expected the end of its trail, 1.",
        "Event 8: robot robot lost: expected a row of the plan, 0 to 1.",
    ]
    with pytest.raises(TypeError, match=r"^Expected events to be of type Event, got '1,lost'\.$"):
        toy.after(plan, ["1,lost"])
