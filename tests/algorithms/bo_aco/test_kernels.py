"""Ants keep the rules of trails, and choose and learn as the paper says."""

from collections import Counter
from itertools import pairwise
from math import inf

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from botohe_moo import Kind, Mission, load_mission
from botohe_moo.algorithms.bo_aco.algorithm import Colony, ColonySettings
from botohe_moo.algorithms.bo_aco.kernels import LEAST, Depositors, LearnRule, Pheromone, learn
from botohe_moo.problem import BOTOHE
from botohe_moo.trails import TrailPlan
from tests import twins
from tests.examples import examples
from tests.strategies import lengths, mission_of, missions, team_missions


def colony(mission, *, n_ants, seed=0, n_threads=1, world=None, **changes):
    return Colony(
        mission,
        world or twins.alike(mission),
        ColonySettings(n_ants=n_ants, **changes),
        n_threads=n_threads,
        random_state=np.random.default_rng(seed),
    )


@examples(300)
@given(
    missions(max_nodes=9, lengths=lengths) | team_missions(lengths=lengths),
    st.fixed_dictionaries(
        {
            "heuristic": st.booleans(),
            "pheromone": st.booleans(),
            "pheromone_per_robot": st.booleans(),
            "unvisited_bonus": st.sampled_from([0.0, 0.05]),
            "exploration": st.sampled_from([0.0, 0.01, 2.0]),
            "allocation": st.sampled_from(["sequential", "concurrent"]),
        }
    ),
    st.sampled_from([0.0, 0.0, 0.05, 0.3, 0.7, 1.0]),
    st.sampled_from([inf, inf, 9.0, 5.0, 2.0, 0.0]),
    st.integers(0, 2**32),
)
def test_plans_are_valid_and_keep_limits(mission, changes, least, longest, seed):
    """One-way missions, safe arcs and arcs without length among them, so that ways home tie."""
    try:
        problem = BOTOHE(mission, min_survival=least, max_length=longest)
    except ValueError:  # a kind has no way to its end that is within them
        assume(False)
    ants = colony(mission, n_ants=7, seed=seed, world=problem.world, **changes)
    for _ in range(3):
        batch = ants.construct(7)
        objectives = mission.evaluate(batch)  # raises PlanError for any trail that is not valid
        assert len(batch) == 7
        assert (objectives <= [mission.total_reward + 1e-9, mission.robots]).all()
        assert (mission.robot_survival(batch) >= problem.limits.floors).all()
        assert (mission.trail_lengths(batch) <= problem.limits.budgets).all()
        exponents = np.random.default_rng(seed).uniform(-250, 1, ants.pheromone.shape)
        ants.pheromone[...] = 10.0**exponents


def crossing(robots):
    """Base 0, a loop 0-1-2, a spur 1-3, and a node 2 with more arcs in than out.

    No two ways are as safe or as long; from node 1 the safest one home is longer than another.
    """
    arcs = [(0, 1, 0.9, 1.0), (1, 2, 0.7, 2.0), (2, 0, 0.8, 1.5), (1, 3, 0.6, 0.7)]
    arcs += [(3, 1, 0.95, 2.2), (0, 2, 0.5, 1.1), (3, 2, 0.85, 0.4)]
    return mission_of(arcs, [0.0, 1.0, 3.0, 0.5], robots=robots)


def crossing_of_kinds():
    """The same for a drone, and a rover that goes from 3 to 2 and cannot get from 1 to 3.

    A depot, where the rover gets half of what there is, and a node that pays on return, where the
    rover has been.
    """
    graph = crossing(2).graph.copy()
    for arc, attributes in graph.edges.items():
        survival = attributes["survival"]
        attributes["survival"] = {"drone": survival, "rover": (1 - survival / 3) * (arc != (1, 3))}
    graph.nodes[1].update(share={"rover": 0.5}, depot=True)
    graph.nodes[2].update(share={"drone": 0.8}, pays="return")
    rover = Kind("rover", 1, start=3, end=2, min_survival=0.4, max_length=6.5, aboard=(2,))
    return Mission(graph, base=0, kinds=[Kind("drone", 1), rover])


def levels_of(mission, pheromone):
    """Pheromone of each robot, by arc."""
    graph = mission.world.graph
    loops = dict.fromkeys(twins.ends_of(mission, robot)[1] for robot in range(mission.robots))
    arcs = [*zip(graph.tail.tolist(), graph.head.tolist(), strict=True), *((v, v) for v in loops)]
    levels = [dict(zip(arcs, map(tuple, one.tolist()), strict=True)) for one in pheromone]
    return levels * mission.robots if len(levels) == 1 else levels


KINDS, CONCURRENT = crossing_of_kinds(), {"allocation": "concurrent"}
slow = pytest.mark.slow


@pytest.mark.compiled_only
@pytest.mark.parametrize(
    ("mission", "limits", "changes"),
    [
        (crossing(2), None, {}),
        (crossing(2), None, {"exploration": 0.5, "unvisited_bonus": 0.05, **CONCURRENT}),
        (crossing(1), None, {"heuristic": False, "exploration": 0.01}),
        (crossing(2), None, {"pheromone_per_robot": True}),
        pytest.param(crossing(1), (0.45,), {"exploration": 0.5}, marks=slow),
        (crossing(2), (0.3,), {"exploration": 0.5, **CONCURRENT}),
        (crossing(2), (0.0, 3.8), {"exploration": 0.5}),
        pytest.param(crossing(2), (0.35, 7.0), {"exploration": 0.5, **CONCURRENT}, marks=slow),
        (KINDS, "their own", {"exploration": 0.5}),
        pytest.param(KINDS, None, {"exploration": 0.5, **CONCURRENT}, marks=slow),
    ],
)
def test_ants_choose_as_the_paper_says_among_what_keeps_limits(mission, limits, changes):
    """How often each whole plan is built, for λ = 0, 1/2 and 1, against its exact probability."""
    world = mission.world if limits == "their own" else twins.alike(mission, *(limits or ()))
    ants = colony(mission, n_ants=3, seed=5, world=world, **changes)
    ants.pheromone[...] = np.random.default_rng(2).uniform(0.3, 3, ants.pheromone.shape)
    levels, seen = levels_of(mission, ants.pheromone), [Counter(), Counter(), Counter()]
    for _ in range(8_000):
        for ant, plan in enumerate(ants.construct(3)):
            seen[ant][plan.nodes.tobytes(), plan.offsets.tobytes()] += 1
    free = twins.Ant(mission, ants.settings, levels, 0.5).plan_probabilities()
    for weight, built in zip((0.0, 0.5, 1.0), seen, strict=True):
        counted = Counter({TrailPlan._wrap(*plan).trails: n for plan, n in built.items()})
        ant = twins.Ant(mission, ants.settings, levels, weight, world)
        expected = ant.plan_probabilities()
        twins.assert_frequencies(counted, expected)
        assert (len(expected) < len(free)) == (limits is not None)


@pytest.mark.parametrize(("allocation", "ends"), [("sequential", 1 / 12), ("concurrent", 1 / 7)])
def test_what_the_first_robot_knows_of_the_second(allocation, ends):
    """The twin by hand, for λ = 0: one robot visits each of two leaves.

    A leaf that nobody reaches weighs 0.05 + 0.5, one that the other robot reaches with
    probability 1/2 weighs 0.05 + 0.25, and the end of the trail 0.05. When the first robot is
    back, the second one has visited the other leaf only where they are out concurrently.
    """
    mission = mission_of([(0, 1, 0.5), (0, 2, 0.5), (1, 0, 1), (2, 0, 1)], [1] * 3, robots=2)
    first, second, second_ends = 0.55 / 1.15, 0.55 / 0.9, 0.05 / 0.35
    levels = [dict.fromkeys([*mission.graph.edges, (0, 0)], (1.0, 1.0))] * 2
    settings = ColonySettings(n_ants=2, allocation=allocation)
    found = twins.Ant(mission, settings, levels, 0.0).plan_probabilities()
    probability = first * ends * second * second_ends
    assert found[(0, 1, 0), (0, 2, 0)] == pytest.approx(probability, rel=1e-12)


def test_long_trails_outgrow_the_first_room():
    mission = load_mission("terrain", nodes=300, seed=1)
    flat = {"heuristic": False, "pheromone": False, "allocation": "concurrent"}
    ants = colony(mission, n_ants=20, **flat)
    batch = ants.construct(20)
    assert len(batch.nodes) > 2 * 4096
    mission.evaluate(batch)


N_ROBOTS = 2
WORLD = load_mission("complete", nodes=4, robots=N_ROBOTS).world
GRAPH = WORLD.graph
OF_WORLD = GRAPH, len(WORLD.team.reward)
N_ARCS = GRAPH.n_arcs + 1  # the base's self-loop, which ends every trail, is the last


def walked(trail):
    """The arcs of a trail, as indices; the twin of what the kernel finds."""
    hops = list(zip(GRAPH.tail.tolist(), GRAPH.head.tolist(), strict=True))
    return [*(hops.index(hop) for hop in pairwise(trail)), N_ARCS - 1]


def learned(pheromone, evaporation, pooled, iteration, archived):
    """The twin, by (map, arc): [τ_R, τ_S]; the sets are lists of ((E[R], E[S]), trails)."""
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


trails = st.lists(st.integers(0, 3), min_size=1, max_size=6).filter(
    lambda nodes: all(one != other for one, other in pairwise(nodes))
)
plans = st.tuples(
    st.tuples(st.floats(0, 9), st.floats(0, 3)),
    st.lists(trails, min_size=N_ROBOTS, max_size=N_ROBOTS),
)


def depositors(plans, members=None):
    trails = [trail for _, trails in plans for trail in trails]
    return Depositors(
        np.array([objectives for objectives, _ in plans]),
        np.arange(len(plans)) if members is None else members,
        np.array([node for trail in trails for node in trail], np.int32),
        np.cumsum([0, *map(len, trails)]),
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
    expected = learned(before, evaporation, pooled, [batch[i] for i in members], archived)
    pheromone, rule = new_pheromone(levels), LearnRule(evaporation, pooled)
    pheromone.deposits[:], pheromone.archive_deposits[:] = 7.0, 7.0  # of iterations before
    learn(*OF_WORLD, rule, depositors(batch, members), depositors(archived), True, pheromone)
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
