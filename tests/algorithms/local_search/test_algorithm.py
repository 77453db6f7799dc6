"""Pareto local search through pymoo: true fronts, its archive, large missions, moves by name."""

import numpy as np
import pytest
from pymoo.optimize import minimize

from botohe_moo import BOTOHE, ParetoLocalSearch, area_indicator, load_mission
from botohe_moo.algorithms.exact.front import exact_front
from botohe_moo.algorithms.local_search.engine import DEFAULT_MOVES, RUIN_AND_RECREATE
from tests.strategies import mission_of

pytestmark = pytest.mark.compiled_only
MUSEUM = load_mission("art_museum")


def solve(mission, n_eval, *, seed=1, limits=(), **parameters):
    problem = BOTOHE(mission, **dict(limits))
    return minimize(problem, ParetoLocalSearch(**parameters), ("n_eval", n_eval), seed=seed)


def random_mission(seed):
    """A mission of 4 to 7 nodes for 1 to 3 robots; of five in a row three have one-way arcs."""
    rng, arcs = np.random.default_rng(seed), {}
    n_nodes, one_way = int(rng.integers(4, 8)), seed % 5 < 3
    ends = [(int(rng.integers(node)), node) for node in range(1, n_nodes)]
    ends += [(node, int(rng.integers(node))) if one_way else (node, u) for u, node in ends]
    more = [rng.choice(n_nodes, 2, replace=False).tolist() for _ in range(rng.integers(n_nodes))]
    for u, v in [*ends, *more, *([] if one_way else [arc[::-1] for arc in more])]:
        drawn = (1.0, 1.0 - 0.9 * rng.random() ** 2, rng.uniform(0.05, 1.0))
        arcs[u, v] = rng.choice(drawn, p=[0.1, 0.45, 0.45])
    rewards = 5.0 * rng.random(n_nodes) * (rng.random(n_nodes) > 0.2)
    arcs = [(*ends, survival) for ends, survival in arcs.items()]
    return mission_of(arcs, rewards, robots=int(rng.integers(1, 4)))


@pytest.mark.parametrize(
    ("floor", "budget"), [(0.0, None), pytest.param(0.0, 6, marks=pytest.mark.slow), (0.3, 5)]
)
def test_small_missions_are_nearly_solved(floor, budget):
    for seed in range(12):
        mission, limits = random_mission(seed), {"min_survival": floor, "max_length": budget}
        true = mission.evaluate(exact_front(mission, **limits))
        found = -solve(mission, 30_000, limits=limits).F
        near = 1e-9 * np.array([mission.total_reward, mission.robots])
        assert (true[:, None] + near >= found).all(axis=2).any(axis=0).all()
        assert (found[:, None] + near >= true).all(axis=2).any(axis=0).mean() > 0.9


@pytest.mark.slow
def test_the_area_after_a_million_evaluations():
    result = solve(MUSEUM, 1_000_000, seed=3)
    assert area_indicator(-result.F, MUSEUM) >= 0.5329
    assert result.algorithm.evaluator.n_eval == 1_000_000


def test_the_archive_is_read_when_somebody_looks():
    algorithm = ParetoLocalSearch(evaluations_per_generation=100)
    algorithm.setup(BOTOHE(MUSEUM), termination=("n_eval", 2_000), seed=1)
    algorithm.next()
    archive, sizes = algorithm.archive, set()
    while algorithm.has_next():
        algorithm.next()
        objectives = archive.objectives.tolist()
        assert objectives == MUSEUM.evaluate(archive.plans).tolist()
        assert [(-one.F).tolist() for one in archive.population()] == objectives
        assert len(archive) == len(objectives)
        sizes.add(len(archive))
    assert len(sizes) > 5
    assert algorithm.archive is archive


def test_plans_that_differ_by_rounding_alone():
    """Where many trails survive alike, the last bits do not keep a worse plan in the front."""
    arcs = [(0, node, 0.93) for node in (1, 2, 3)]
    found = -solve(mission_of(arcs, [0, 1.3, 1.7, 1.1], both_ways=True, robots=9), 50_000).F
    assert (np.diff(found[:, 1]) > 1e-12 * found[1:, 1]).all()
    assert (np.diff(found[:, 0]) < -1e-12 * found[1:, 0]).all()


@pytest.mark.slow
@pytest.mark.parametrize(("robots", "as_if"), [(9, 0.02), (10, 0.0)])
def test_of_more_than_a_thousand_nodes_times_robots_no_plan_is_ruined(robots, as_if):
    mission = load_mission("terrain", nodes=101, robots=robots)
    fronts = [
        solve(mission, 3_000, **options).F.tolist()
        for options in ({}, {"prob_recreate": as_if}, {"prob_recreate": 0.02 - as_if})
    ]
    assert fronts[0] == fronts[1] != fronts[2]


def test_where_there_is_nothing_but_the_base_the_search_ends():
    result = solve(mission_of([], [2.5], robots=3), 10_000)
    assert result.F.tolist() == [[-2.5, -3]]
    assert result.algorithm.evaluator.n_eval <= 3


def test_moves_by_name():
    algorithm = solve(MUSEUM, 3_000, moves={"visit": 2, "splice": 1}).algorithm
    tried = algorithm.statistics["tried"].drop(RUIN_AND_RECREATE)
    assert set(tried.index[tried > 0]) == {"visit", "splice"}
    weights = np.diff(algorithm._search.first._weights, prepend=0.0)
    given = {name: w for name, w in zip(DEFAULT_MOVES, weights, strict=True) if w}
    assert given == {"visit": 2, "splice": 1}
