"""BO-ACO through pymoo: pheromone, what deposits, extremes, and the published curves in short."""

import itertools

import networkx as nx
import numpy as np
import pytest
from pymoo.optimize import minimize

from botohe_moo import BOACO, BOTOHE, Mission, RandomTrails, area_indicator, load_mission

MUSEUM = load_mission("art_museum")
VARIANTS = {
    "paper": BOACO,
    "journal": BOACO.journal,
    "per robot": lambda **options: BOACO.journal(pheromone_per_robot=True, **options),
    "all of it": lambda **options: BOACO(
        allocation="concurrent", pheromone_per_robot=True, exploration=0.5, **options
    ),
    "random": RandomTrails,
}


@pytest.mark.slow
@pytest.mark.parametrize("make", VARIANTS.values(), ids=VARIANTS.keys())
def test_extreme_rewards_and_survivals(make):
    """Weights must stay above 0 and finite: an ant that cannot draw would leave the graph."""
    for reward, survival in itertools.product((5e-324, 1e307), (5e-324, 1.0)):
        graph = nx.complete_graph(5, nx.DiGraph)
        rewards = {node: 0.0 if node % 2 else reward for node in graph}
        nx.set_node_attributes(graph, rewards, "reward")
        nx.set_edge_attributes(graph, survival, "survival")
        mission = Mission(graph, base=0, robots=3)
        result = minimize(BOTOHE(mission), make(n_ants=20), ("n_gen", 100), seed=1)
        assert np.array_equal(-result.F, mission.evaluate(result.X))


def begun(algorithm, n_gen, *, problem=None, seed=1):
    problem = BOTOHE(MUSEUM) if problem is None else problem
    return algorithm.setup(problem, termination=("n_gen", n_gen), seed=seed)


def test_an_iteration_in_which_nobody_looks_makes_no_individuals():
    algorithm = begun(BOACO(n_ants=10), 50)
    for _ in range(49):
        algorithm.next()
    assert algorithm.archive._individuals == {}
    assert len(algorithm.result().F) == len(algorithm.archive) == len(algorithm.opt) > 0


@pytest.mark.parametrize("per_robot", [False, True])
def test_plans_to_start_from_deposit_in_the_first_iteration(per_robot):
    plan = MUSEUM.plan([[1], [1], [1, 2, 21, 27, 25, 27, 21, 2, 1]])
    maps = []
    for sampling in (None, [plan]):
        algorithm = BOACO(sampling=sampling, pheromone_per_robot=per_robot, n_ants=2)
        begun(algorithm, 5, seed=4).next()
        assert (plan in set(algorithm.archive.plans)) == (sampling is not None)
        levels = algorithm.pheromone_maps
        levels = levels[levels["robot"] == 2] if per_robot else levels
        maps.append(levels.set_index(["tail", "head"])["survival"])
    assert maps[1][27, 25] > maps[0][27, 25]


def test_pheromone_maps():
    algorithm = begun(BOACO.journal(), 30)
    algorithm.run()
    maps, loop = algorithm.pheromone_maps, (MUSEUM.base, MUSEUM.base)
    assert list(maps.columns) == ["tail", "head", "reward", "survival"]
    levels = maps.set_index(["tail", "head"])
    assert sorted(levels.index) == sorted([*MUSEUM.graph.edges, loop])
    # Every plan ends three trails with the self-loop, and those that go out pass one door.
    assert levels["reward"].idxmax() == loop
    assert levels.loc[(1, 2), "reward"] > levels["reward"].median()


@pytest.mark.parametrize(
    ("algorithm", "levels"),
    [
        (BOACO(), [1.0, 1.0]),
        (BOACO.journal(), [MUSEUM.total_reward, 3.0]),
        (BOACO(initial_pheromone=2.5), [2.5, 2.5]),
        (BOACO.journal(pheromone=False), [1.0, 1.0]),
    ],
)
def test_pheromone_at_the_start(algorithm, levels):
    assert (begun(algorithm, 1).pheromone_maps[["reward", "survival"]] == levels).all(axis=None)


class Pairs(BOTOHE):
    """Feasible are plans in which at least two robots are expected to come back."""

    def __init__(self, mission):
        super().__init__(mission)
        self.n_ieq_constr = 1

    def constrain_batch(self, batch):
        return 2.0 - self.mission.evaluate(batch)[:, 1:]


@pytest.mark.parametrize("problem", [BOTOHE(MUSEUM, min_survival=0.7), Pairs(MUSEUM)])
def test_only_what_is_feasible_deposits(problem):
    algorithm = begun(BOACO(n_ants=30, allocation="concurrent"), 15, problem=problem)
    algorithm.run()
    assert len(algorithm.archive)
    assert (problem.constrain_batch(algorithm.archive.plans) <= 0).all()


@pytest.mark.compiled_only
@pytest.mark.parametrize(
    ("options", "published", "tolerance"),
    [
        ({}, (0.4128, 0.4646, 0.5007), (0.02, 0.01, 0.01)),
        ({"heuristic": False}, (0.3061, 0.3583, 0.4049), 0.02),
        ({"pheromone": False}, (0.4232, 0.4611, 0.4833), 0.02),
        ({"heuristic": False, "pheromone": False}, (0.3061, 0.3736, 0.4118), 0.02),
    ],
)
def test_the_published_curves_in_short(options, published, tolerance):
    """Means of four runs at 1, 10 and 100 iterations; `make bench` runs all 10 000.

    PeerJ Computer Science 2025, read off the figure, and how far four other runs may be off.
    """
    curves = []
    for seed in range(1, 5):
        algorithm, areas = begun(BOACO.journal(**options), 100, seed=seed), []
        while algorithm.has_next():
            algorithm.next()
            areas.append(area_indicator(algorithm.archive.objectives, MUSEUM))
        curves.append([areas[0], areas[9], areas[99]])
    assert (np.abs(np.mean(curves, axis=0) - published) <= tolerance).all()


@pytest.mark.compiled_only
def test_local_search_improves_the_front():
    areas = []
    for share in (0.0, 0.3):
        algorithm = BOACO.journal(local_search=share)
        result = minimize(BOTOHE(MUSEUM), algorithm, ("n_eval", 20_000), seed=1)
        areas.append(area_indicator(-result.F, MUSEUM))
    assert areas[1] > areas[0] + 0.01
