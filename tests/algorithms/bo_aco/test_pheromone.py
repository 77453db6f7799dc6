"""Deposit and evaporation against a readable twin."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Kind, Mission, load_mission
from botohe_moo.algorithms.bo_aco.kernels import LEAST, Depositors, LearnRule, Pheromone, learn

N_ROBOTS = 2
WORLD = load_mission("complete", nodes=4, robots=N_ROBOTS).world
GRAPH = WORLD.graph
OF_WORLD = GRAPH, len(WORLD.team.reward)
N_ARCS = GRAPH.n_arcs + 1  # the base's self-loop, which ends every trail, is the last


def walked(trail):
    """The arcs of a trail, as indices; the twin of what the kernel finds."""
    hops = list(zip(GRAPH.tail.tolist(), GRAPH.head.tolist(), strict=True))
    return [*(hops.index(hop) for hop in pairwise(trail)), N_ARCS - 1]


def twin(pheromone, evaporation, pooled, iteration, archived):
    """Dicts of (map, arc) -> [τ_R, τ_S]; the sets are lists of ((E[R], E[S]), trails)."""
    n_maps = 1 + max(m for m, _ in pheromone)
    after = {key: [(1 - evaporation) * level for level in both] for key, both in pheromone.items()}
    for plans in (iteration, archived):
        size = len(iteration) + len(archived) if pooled else len(plans)
        for objectives, trails in plans:
            for robot, trail in enumerate(trails):
                for arc in walked(trail):
                    for species in range(2):
                        key = (robot if n_maps > 1 else 0, arc)
                        after[key][species] += objectives[species] / size
    return after


def hops(nodes):
    return all(one != other for one, other in pairwise(nodes))


trails = st.lists(st.integers(0, 3), min_size=1, max_size=6).filter(hops)
plans = st.tuples(
    st.tuples(st.floats(0, 9), st.floats(0, 3)),
    st.lists(trails, min_size=N_ROBOTS, max_size=N_ROBOTS),
)


def depositors(plans, members=None):
    trails = [trail for _, trails in plans for trail in trails]
    offsets = np.zeros(len(trails) + 1, np.int64)
    np.cumsum([len(trail) for trail in trails], out=offsets[1:])
    return Depositors(
        np.array([objectives for objectives, _ in plans]),
        np.arange(len(plans)) if members is None else members,
        np.array([node for trail in trails for node in trail], np.int32),
        offsets,
    )


def new_pheromone(levels):
    return Pheromone(levels, *np.zeros((2, *levels.shape)))


@given(
    st.lists(plans, min_size=1, max_size=4),
    st.sets(st.integers(0, 3), min_size=1),
    st.lists(plans, min_size=1, max_size=4),
    st.sampled_from([1, N_ROBOTS]),
    st.floats(0.01, 0.99),
    st.booleans(),
    st.integers(0, 2**32),
)
def test_learn(batch, chosen, archived, n_maps, evaporation, pooled, seed):
    members = np.array(sorted(i for i in chosen if i < len(batch)) or [0])
    levels = np.random.default_rng(seed).uniform(0.1, 5, (n_maps, N_ARCS, 2))
    before = {(m, a): levels[m, a].tolist() for m in range(n_maps) for a in range(N_ARCS)}
    expected = twin(before, evaporation, pooled, [batch[i] for i in members], archived)
    iteration, archive = depositors(batch, members), depositors(archived)
    pheromone = new_pheromone(levels)
    pheromone.deposits[:], pheromone.archive_deposits[:] = 7.0, 7.0  # of iterations before
    learn(
        WORLD.graph,
        len(WORLD.team.reward),
        LearnRule(evaporation, pooled),
        iteration,
        archive,
        True,
        pheromone,
    )
    for (m, arc), levels_expected in expected.items():
        assert pheromone.levels[m, arc] == pytest.approx(levels_expected, rel=1e-12)


def test_what_the_archive_deposits_is_kept_as_long_as_it_is_the_same():
    levels = np.random.default_rng(1).uniform(0.1, 5, (1, N_ARCS, 2))
    nobody = depositors([((0.0, 0.0), [[0], [0]])], np.empty(0, np.int64))
    archive = depositors([((2.0, 1.0), [[0], [0]])])
    pheromone = new_pheromone(levels.copy())
    for is_new in (True, False, False):
        learn(*OF_WORLD, LearnRule(0.0, False), nobody, archive, is_new, pheromone)
        archive = archive._replace(objectives=np.full((1, 2), 9.0))
    assert np.array_equal(pheromone.levels[0, :-1], levels[0, :-1])
    assert pheromone.levels[0, -1] == pytest.approx(levels[0, -1] + 3 * 2 * np.array([2.0, 1.0]))


def test_each_kind_has_a_loop_where_its_trails_end():
    graph = load_mission("complete", nodes=3).graph
    kinds = [Kind("drone", 1, end=1), Kind("rover", 2)]
    world = Mission(graph, base=0, kinds=kinds).world
    # Behind the drone's three nodes come the rovers'.
    plan = depositors([((2.0, 5.0), [[0, 2, 1], [3, 5, 3], [3]])])
    levels = np.ones((1, world.graph.n_arcs + 2, 2))
    rule, pheromone = LearnRule(0.0, True), new_pheromone(levels)
    learn(world.graph, len(world.team.reward), rule, plan, plan, True, pheromone)
    arcs = zip(world.graph.tail.tolist(), world.graph.head.tolist(), strict=True)
    arcs = [*arcs, "drone", "rover"]
    deposits = dict(zip(arcs, (levels[0] - 1).tolist(), strict=True))
    once = {(0, 2), (2, 1), "drone", (3, 5), (5, 3)}
    assert {arc for arc, deposit in deposits.items() if deposit == [2.0, 5.0]} == once
    assert deposits.pop("rover") == [4.0, 10.0]
    assert all(deposits[arc] == [0.0, 0.0] for arc in deposits.keys() - once)


def test_pheromone_never_vanishes():
    """Thousands of iterations without deposit underflow to 0 otherwise, and 0 has no logarithm."""
    plans = depositors([((1.0, 1.0), [[0], [0]])])
    pheromone = new_pheromone(np.full((1, N_ARCS, 2), 1e-249))
    for _ in range(10_000):
        learn(*OF_WORLD, LearnRule(0.5, False), plans, plans, True, pheromone)
    assert (pheromone.levels[0, :-1] == LEAST).all()
    assert (pheromone.levels[0, -1] > 1).all()
