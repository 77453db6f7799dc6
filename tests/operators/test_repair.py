"""Repairs: hand-made drafts, their readable twin, and what holds for every draft."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import BOTOHE, Kind, TrailPlan
from botohe_moo.operators import PenaltyOnly, SafestPathRepair, TruncateRepair
from botohe_moo.trails import PlanBatch
from tests.examples import examples
from tests.strategies import mission_of, missions, plans, team_missions
from tests.twins import Repairer, ends_of

REPAIRS = [SafestPathRepair, TruncateRepair]


# Base 0 in a ring 0-1-2-3-0 whose arcs lead both ways, 1-2 the most dangerous.
ARCS = [(0, 1, 0.9), (1, 2, 0.5), (2, 3, 0.8), (3, 0, 0.95)]
RING = mission_of(ARCS, [1] * 4, both_ways=True, robots=1)
# 0 -> 1 -> 2 -> 0, and 1 -> 3 -> 1: whoever walks 0, 1, 3, 1, 2 gets home, 3 once only.
ENDS = [(0, 1), (1, 2), (2, 0), (1, 3), (3, 1), (2, 4), (4, 1)]
ONE_WAY = mission_of([(*ends, 0.9) for ends in ENDS], [1] * 5, robots=1)


BY_HAND = {
    SafestPathRepair: [
        (RING, [0], [0]),
        (RING, [0, 1, 0], [0, 1, 0]),  # valid
        (RING, [0, 2, 0], [0, 3, 2, 3, 0]),  # by 3 both ways: 2-3 is another arc than 3-2
        (RING, [2], [0, 3, 2, 3, 0]),
        (RING, [0, 1, 0, 1, 0], [0, 1, 0]),  # the loop that uses 0-1 again is cut
        (RING, [0, 3, 2, 1, 0, 3, 2], [0, 3, 2, 3, 0]),  # with all its nodes
        (RING, [1, 1, 1], [0, 1, 0]),  # nobody stays where he is
        (RING, [0, 1, 2, 3], [0, 1, 2, 3, 0]),  # goes home at the end
        (RING, [99, 1], [0, 1, 0]),  # there is no such node
        (RING, [3, 0, 1], [0, 3, 0, 1, 0]),  # out again
        # From 3 the safest way to 1 is 3-0-1. With 0-1 used it is 3-2-1, and home not by 1-0.
        (RING, [0, 1, 0, 3, 1], [0, 1, 0, 3, 2, 1, 2, 3, 0]),
        # Nodes from which no way leads home are left out: 1-2 is the only one.
        (ONE_WAY, [0, 1, 2, 4], [0, 1, 2, 0]),
        (ONE_WAY, [0, 4, 0], [0]),
        (ONE_WAY, [0, 3, 2], [0, 1, 3, 1, 2, 0]),
    ],
    TruncateRepair: [
        (RING, [0], [0]),
        (RING, [0, 1, 0], [0, 1, 0]),
        (RING, [0, 2, 0], [0]),  # 0-2 is no arc
        (RING, [2, 1, 0], [0]),  # does not begin at base
        (RING, [0, 1, 2], [0, 1, 2, 3, 0]),  # safest way home
        (RING, [0, 1, 0, 1, 2], [0, 1, 0]),  # up to the arc that is used again
        (RING, [0, 0, 1], [0]),  # nobody stays where he is
        (RING, [0, 1, 99], [0, 1, 0]),
        (ONE_WAY, [0, 1, 2, 4], [0, 1, 2, 0]),  # from 4 all that is left never leads home
    ],
}


@pytest.mark.parametrize("repair", REPAIRS)
def test_by_hand(repair):
    for mission, draft, expected in BY_HAND[repair]:
        batch = PlanBatch.from_plans([TrailPlan([draft])], 1)  # labels are indices
        plan = repair().repair_batch(mission, batch)[0]
        assert [list(trail) for trail in plan.trails] == [expected], draft


@st.composite
def drafts(draw, mission):
    """Any sequences of node indices, some of them unknown."""
    nodes = st.integers(0, mission.world.graph.n_nodes + 1)
    trails = st.lists(nodes, min_size=1, max_size=10)
    return TrailPlan([draw(trails) for _ in range(mission.robots)])


@pytest.mark.parametrize("repair", REPAIRS)
@examples(300)
@given(data=st.data())
def test_any_draft_becomes_valid_and_stays_as_it_is(repair, data):
    mission = data.draw(missions(max_nodes=8) | team_missions())
    plan = data.draw(drafts(mission))
    batch = PlanBatch.from_plans([plan], mission.robots)
    once = repair().repair_batch(mission, batch)
    mission.evaluate(once)  # raises PlanError for any trail that is not valid
    twice = repair().repair_batch(mission, once)
    assert twice[0].trails == once[0].trails
    assert batch[0].trails == plan.trails


@pytest.mark.parametrize("repair", [*REPAIRS, PenaltyOnly])
@examples(200)
@given(data=st.data())
def test_a_valid_plan_passes_unchanged(repair, data):
    mission, made = data.draw(missions(max_nodes=8) | team_missions()), repair()
    plan = TrailPlan(data.draw(plans(mission)))
    assert made.repair_batch(mission, mission.batch([plan]))[0].trails == plan.trails
    assert (made.counts.plans, made.counts.repaired, made.counts.arcs_changed) == (1, 0, 0)


@examples(24)
@given(st.integers(0, 2**32), st.booleans())
def test_repairs_are_their_readable_twins(seed, has_kinds):
    # Survivals that are drawn from a continuum leave no two paths equally safe.
    rng = np.random.default_rng(seed)
    cycle = rng.permutation(7).tolist()
    arcs = set(zip(cycle, cycle[1:] + cycle[:1], strict=True))
    while len(arcs) < 14:
        u, v = rng.choice(7, 2, replace=False).tolist()
        arcs |= {(u, v), (v, u)} if seed % 2 else {(u, v)}
    kinds = [Kind("robot", 1)]
    if has_kinds:
        start, end = rng.integers(7, size=2).tolist()
        kinds = [Kind("drone", 1, start=start, end=end), Kind("rover", 1)]
    survivals = []
    for _ in arcs:
        by_kind = rng.uniform(0.3, 1.0, 3) * [1, 1, rng.random() < 0.8]
        named = zip(("robot", "drone", "rover"), by_kind.tolist(), strict=True)
        survivals.append({name: s for name, s in named if name in {kind.name for kind in kinds}})
    arcs = [(*arc, survival) for arc, survival in zip(sorted(arcs), survivals, strict=True)]
    mission = mission_of(arcs, [1] * 7, kinds=kinds)
    for _ in range(30):
        plan = []
        for robot in range(mission.robots):
            draft = rng.integers(mission.world.graph.n_nodes + 1, size=rng.integers(1, 12)).tolist()
            start, end = ends_of(mission, robot)
            plan.append([start, *draft, end] if rng.random() < 0.5 else draft)
        batch = PlanBatch.from_plans([TrailPlan(plan)], mission.robots)
        twins = {SafestPathRepair: Repairer.safest, TruncateRepair: Repairer.truncate}
        for repair, twin in twins.items():
            expected = [tuple(twin(Repairer(mission, k), draft)) for k, draft in enumerate(plan)]
            assert list(repair().repair_batch(mission, batch)[0].trails) == expected


def test_counts_by_hand():
    repair = SafestPathRepair()
    plans = [TrailPlan([trail]) for trail in ([0, 1, 0], [0, 2, 0], [0, 1, 0, 1, 0])]
    repair.repair_batch(RING, PlanBatch.from_plans(plans, 1))
    # Two hops dropped and four arcs added; two hops dropped.
    counts = repair.counts
    assert (counts.plans, counts.repaired, counts.arcs_changed) == (3, 2, 6 + 2)
    assert counts.seconds > 0
    # Single nodes and empty trails are repaired, too; operators may share one repair.
    drafts = PlanBatch(np.array([99, -5], np.int32), np.array([0, 1, 2, 2]), 1)
    assert [plan.trails for plan in repair.repair_batch(RING, drafts)] == [((0,),)] * 3
    assert (counts.plans, counts.repaired, counts.arcs_changed) == (6, 5, 8 + 3)
    assert len(repair.repair_batch(RING, PlanBatch.from_plans([], 1))) == 0


def test_short_drafts_of_long_trails_get_the_room_that_they_need():
    corridor = mission_of([(n, n + 1, 0.9) for n in range(10)], [1] * 11, both_ways=True, robots=1)
    there = [*range(11), *range(9, -1, -1)]
    drafts = PlanBatch(np.full(60, 10, np.int32), np.arange(61), 1)
    repaired = SafestPathRepair().repair_batch(corridor, drafts)
    assert [plan.trails for plan in repaired] == [(tuple(there),)] * 60


def test_penalty_only_needs_a_problem_that_allows_it():
    drafts = np.array([[TrailPlan([[0, 2, 0]])], [TrailPlan([[0, 1, 0, 1, 0]])]], dtype=object)
    assert (PenaltyOnly()._do(BOTOHE(RING), drafts) == drafts).all()
    with pytest.raises(ValueError, match="arc 0 -> 2 is missing"):
        BOTOHE(RING).evaluate(drafts)
    out = BOTOHE(RING, allow_invalid=True).evaluate(drafts, return_as_dictionary=True)
    assert out["G"].tolist() == [[2.0], [2.0]]
    # Nobody survives a hop that is none; the second robot gets to 1 and back before it.
    assert np.allclose(out["F"], [[-1.0, 0.0], [-1.0 - 0.9, 0.0]])
