"""Pareto local search through pymoo: budgets, floors, resuming, and true fronts."""

import networkx as nx
import numpy as np
import pytest
from pymoo.core.callback import Callback
from pymoo.optimize import minimize

from botohe_moo import BOTOHE, Mission, ParetoLocalSearch, area_indicator, load_mission
from botohe_moo.algorithms.exact.front import exact_front
from botohe_moo.algorithms.local_search.engine import DEFAULT_MOVES, RUIN_AND_RECREATE
from tests.algorithms.local_search.made import keeps_limits

pytestmark = pytest.mark.compiled_only


@pytest.fixture(scope="module")
def museum():
    return load_mission("art_museum")


def solve(
    mission, n_eval, *, seed=1, callback=None, min_survival=0.0, max_length=None, **parameters
):
    problem = BOTOHE(mission, min_survival=min_survival, max_length=max_length)
    options = {"seed": seed} if callback is None else {"seed": seed, "callback": callback}
    return minimize(problem, ParetoLocalSearch(**parameters), ("n_eval", n_eval), **options)


def same(one, other):
    return one.F.tobytes() == other.F.tobytes() and [p.trails for p in one.X[:, 0]] == [
        p.trails for p in other.X[:, 0]
    ]


def random_mission(seed):
    """A mission of 4 to 7 nodes for 1 to 3 robots; of five in a row three have one-way arcs."""
    rng, graph = np.random.default_rng(seed), nx.DiGraph()
    n_nodes, one_way = int(rng.integers(4, 8)), seed % 5 < 3
    graph.add_node(0, reward=rng.choice([0.0, 0.0, 1.0]))
    for node in range(1, n_nodes):
        graph.add_node(node, reward=5.0 * rng.random() * (rng.random() > 0.2))
        entry = int(rng.integers(node))
        graph.add_edge(entry, node)
        graph.add_edge(node, int(rng.integers(node)) if one_way else entry)
    for _ in range(int(rng.integers(n_nodes))):
        tail, head = rng.choice(n_nodes, 2, replace=False).tolist()
        graph.add_edge(tail, head)
        if not one_way:
            graph.add_edge(head, tail)
    for tail, head in graph.edges:
        drawn = (1.0, 1.0 - 0.9 * rng.random() ** 2, rng.uniform(0.05, 1.0))
        graph.edges[tail, head]["survival"] = rng.choice(drawn, p=[0.1, 0.45, 0.45])
    return Mission(graph, base=0, robots=int(rng.integers(1, 4)))


def weakly_dominates(found, others):
    """Whether for each of the others there is one found that is as good in both objectives."""
    return (found[:, None] >= others).all(axis=2).any(axis=0).all()


class TestTrueFronts:
    @pytest.mark.slow
    def test_small_missions_are_solved(self):
        """Nearly all of them within 50 000 evaluations of the first seed.

        Mission 165 needs the fifth: two robots have to change together, to trails off the cheapest
        paths.
        """
        late = one_way = again = 0
        for number in range(0, 200, 3):
            mission = random_mission(number)
            one_way += not mission.balanced
            true = mission.evaluate(exact_front(mission))
            near = 1e-9 * np.array([mission.total_reward, mission.robots])
            for seed in range(1, 6):
                algorithm = ParetoLocalSearch(
                    evaluations_per_generation=10_000, greedy_start=number % 2 == 0
                )
                algorithm.setup(BOTOHE(mission), termination=("n_eval", 200_000), seed=seed)
                solved = False
                while not solved and algorithm.has_next():
                    algorithm.next()
                    found = algorithm.archive.objectives
                    solved = weakly_dominates(found + near, true)
                # Nothing is better than the truth.
                assert weakly_dominates(true + near, found), number
                again += seed > 1
                late += algorithm.evaluator.n_eval > 50_000
                if solved:
                    break
            assert solved, number
        assert one_way > 30
        assert again <= 4
        assert late <= 8

    @pytest.mark.slow
    def test_the_area_after_a_million_evaluations(self, museum):
        result = solve(museum, 1_000_000, seed=3)
        assert area_indicator(-result.F, museum) >= 0.5329
        assert result.algorithm.evaluator.n_eval == 1_000_000


class TestFront:
    @pytest.mark.parametrize(("floor", "budget", "prob_recreate"), [(0.3, 9, 0.06), (1.0, 30, 1.0)])
    def test_every_generation_keeps_floor_and_budget(self, museum, floor, budget, prob_recreate):
        seen = []

        class Noted(Callback):
            def notify(self, algorithm):
                batch = algorithm.archive.plans
                assert keeps_limits(museum, batch, floor, budget)
                seen.append(len(batch))

        problem = BOTOHE(museum, min_survival=floor, max_length=budget)
        algorithm = ParetoLocalSearch(evaluations_per_generation=400, prob_recreate=prob_recreate)
        result = minimize(problem, algorithm, ("n_eval", 4_000), seed=1, callback=Noted())
        assert len(seen) > 5
        assert (result.G <= 0).all()
        assert np.array_equal(-result.F, museum.evaluate(result.X))
        assert (len(result.X) > 5) == (floor < 1)

    def test_the_archive_is_read_when_somebody_looks(self, museum):
        algorithm = ParetoLocalSearch(evaluations_per_generation=100)
        algorithm.setup(BOTOHE(museum), termination=("n_eval", 2_000), seed=1)
        algorithm.next()
        archive, sizes = algorithm.archive, set()
        while algorithm.has_next():
            algorithm.next()
            objectives, n = archive.objectives, len(archive)
            assert objectives.shape == (n, 2)
            assert objectives.tolist() == museum.evaluate(archive.plans).tolist()
            assert [tuple(one.F) for one in archive.population()] == list(map(tuple, -objectives))
            sizes.add(n)
        assert len(sizes) > 5
        assert algorithm.archive is archive

    def test_plans_that_differ_by_rounding_alone(self):
        """Where many trails survive alike, the last bits do not keep a worse plan in the front."""
        graph = nx.DiGraph()
        graph.add_node(0, reward=0.0)
        for node, reward in ((1, 1.3), (2, 1.7), (3, 1.1)):
            graph.add_node(node, reward=reward)
            for arc in ((0, node), (node, 0)):
                graph.add_edge(*arc, survival=0.93)
        mission = Mission(graph, base=0, robots=9)
        found = -solve(mission, 50_000).F
        assert (np.diff(found[:, 1]) > 1e-12 * found[1:, 1]).all()
        assert (np.diff(found[:, 0]) < -1e-12 * found[1:, 0]).all()

    @pytest.mark.parametrize(
        ("floor", "budget"), [pytest.param(0.0, 6, marks=pytest.mark.slow), (0.3, 5)]
    )
    def test_budgets_give_the_true_front(self, floor, budget):
        for seed in range(12):
            mission = random_mission(seed)
            limits = {"min_survival": floor, "max_length": budget}
            true = mission.evaluate(exact_front(mission, **limits))
            found = -solve(mission, 30_000, **limits).F
            near = 1e-9 * np.array([mission.total_reward, mission.robots])
            assert weakly_dominates(true + near, found)
            covered = (found[:, None] + near >= true).all(axis=2).any(axis=0)
            assert covered.mean() > 0.9


class TestRuns:
    @pytest.mark.slow
    @pytest.mark.parametrize(("robots", "as_if"), [(9, 0.02), (10, 0.0)])
    def test_of_more_than_a_thousand_nodes_times_robots_no_plan_is_ruined(self, robots, as_if):
        mission = load_mission("terrain", nodes=101, robots=robots)
        found, other = solve(mission, 3_000), solve(mission, 3_000, prob_recreate=0.02 - as_if)
        assert same(found, solve(mission, 3_000, prob_recreate=as_if))
        assert not same(found, other)


class TestOddMissions:
    def mission(self, rewards, arcs, robots=2):
        graph = nx.DiGraph()
        graph.add_nodes_from((node, {"reward": reward}) for node, reward in enumerate(rewards))
        graph.add_weighted_edges_from(arcs, weight="survival")
        return Mission(graph, base=0, robots=robots)

    @pytest.mark.parametrize(("robots", "reward"), [(1, 0.0), (3, 2.5)])
    def test_nothing_but_the_base(self, robots, reward):
        result = solve(self.mission([reward], [], robots), 10_000)
        assert result.F.tolist() == [[-reward, -robots]]
        assert result.algorithm.evaluator.n_eval <= 3

    def test_a_base_with_reward_by_hand(self):
        mission = self.mission([3.0, 4.0], [(0, 1, 0.5), (1, 0, 0.8)])
        result = solve(mission, 3_000)
        by_hand = [[3 + 4 * 0.75, 0.8], [3 + 4 * 0.5, 1.4], [3.0, 2.0]]
        assert np.allclose(-result.F, by_hand, rtol=1e-12)


class TestErrors:
    def test_moves_by_name(self, museum):
        result = solve(museum, 3_000, moves={"visit": 2, "splice": 1})
        tried = result.algorithm.statistics["tried"].drop(RUIN_AND_RECREATE)
        assert set(tried.index[tried > 0]) == {"visit", "splice"}
        weights = np.diff(result.algorithm._search.first._weights, prepend=0.0)
        given = dict(zip(DEFAULT_MOVES, weights.tolist(), strict=True))
        assert {name: weight for name, weight in given.items() if weight} == {
            "visit": 2,
            "splice": 1,
        }
