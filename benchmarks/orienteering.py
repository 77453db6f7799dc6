"""Pareto local search beside PyVRP where a mission is the team orienteering problem.

Where survival falls with length alone, and hardly at all, a floor on it is a travel budget, and the
end of the front with the most reward is the optimum of the (team) orienteering problem.
"""

import time
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import networkx as nx
import numpy as np
import pandas as pd
from pymoo.core.termination import Termination
from pymoo.optimize import minimize

from botohe_moo import BOTOHE, Mission, ParetoLocalSearch, load_mission

SECONDS = (2.0, 10.0)
SEEDS = (1, 2, 3)
SIZES, ROBOTS, SHARES = (50, 100, 150, 200), (1, 2, 4), (0.2, 0.35, 0.5)
# Risk of a trail that spends the whole budget: so little that rewards are hardly discounted.
_RISK = 1e-6
# Length of a shortest tour through n random points of a square, over the root of its area and n.
# Beardwood, Halton and Hammersley, Mathematical Proceedings 55(4), 1959.
_TOUR = 0.7124
_SIDE = 1_000.0


class Instance(NamedTuple):
    """An orienteering problem: places (n, 2), rewards (n), and the budget of each robot."""

    name: str
    places: Any
    rewards: Any
    budget: int
    robots: int

    @property
    def lengths(self) -> Any:
        """Distances, rounded to integers (n, n)."""
        return np.rint(np.hypot(*(self.places[:, None] - self.places).transpose(2, 0, 1)))

    def problem(self) -> BOTOHE:
        """Make the mission whose floor is the budget."""
        graph: nx.DiGraph[Any] = nx.DiGraph(base=0, robots=self.robots)
        for node, (reward, place) in enumerate(zip(self.rewards, self.places, strict=True)):
            graph.add_node(node, reward=float(reward), pos=place.tolist())
        scale, lengths = _RISK / self.budget, np.maximum(self.lengths, 1e-9)
        for tail, head in zip(*np.nonzero(~np.eye(len(lengths), dtype=bool)), strict=True):
            survival = float(np.exp(-lengths[tail, head] * scale))
            graph.add_edge(int(tail), int(head), survival=survival)
        floor = float(np.exp(-(self.budget + 1e-4) * scale))  # all lengths are integers
        return BOTOHE(Mission(graph), min_survival=floor)


def instances() -> list[Instance]:
    """Draw instances: uniform and clustered, the budgets of a team from a fifth to half a tour."""
    found = []
    seed = count(100)
    for nodes in SIZES:
        for i, robots in enumerate(ROBOTS):
            number = next(seed)
            random = np.random.default_rng(number)
            clustered = number % 2 == 1
            places = random.uniform(0, _SIDE, (nodes, 2))
            if clustered:
                centres = random.uniform(0.1 * _SIDE, 0.9 * _SIDE, (5, 2))
                places = centres[random.integers(5, size=nodes)]
                places = places + random.normal(0, 0.08 * _SIDE, (nodes, 2))
            rewards = random.integers(1, 101, nodes)
            rewards[0] = 0
            share = SHARES[(i + SIZES.index(nodes)) % len(SHARES)]
            budget = int(share * _TOUR * _SIDE * np.sqrt(nodes) / robots)
            kind = "clustered" if clustered else "uniform"
            name = f"{nodes} {kind}, {robots} robots, {share:g} of a tour"
            found.append(Instance(name, np.rint(places), rewards, budget, robots))
    return found


class _Clock(Termination):  # type: ignore[misc]
    """Keeps the most reward at some times of the process, and ends with the last."""

    def __init__(self) -> None:
        super().__init__()
        self.began = time.process_time()
        self.rewards: dict[float, float] = {}

    def _update(self, algorithm: Any) -> float:
        passed = time.process_time() - self.began
        for seconds in SECONDS:
            if passed <= seconds or seconds not in self.rewards:
                # Rewards are integers, discounted by less than a hundredth.
                self.rewards[seconds] = round(algorithm.archive.objectives[0, 0])
        return float(passed >= SECONDS[-1])


def run(out: Path) -> bool:
    """Print and keep the rewards of both, and how many plans of trade-off there are beside."""
    minimize(BOTOHE(load_mission("toy")), ParetoLocalSearch(), ("n_eval", 300), seed=1)  # compiles
    rows = []
    for instance in instances():
        problem = instance.problem()
        ours, theirs, sizes = [], [], []
        for seed in SEEDS:
            search = ParetoLocalSearch(evaluations_per_generation=1_000)
            result = minimize(problem, search, _Clock(), seed=seed)
            ours.append([result.algorithm.termination.rewards[seconds] for seconds in SECONDS])
            sizes.append(len(result.algorithm.archive))
            theirs.append([_pyvrp(instance, seconds, seed) for seconds in SECONDS])
        row: dict[str, Any] = {"instance": instance.name}
        for i, seconds in enumerate(SECONDS):
            row[f"PyVRP, {seconds:g} s"] = np.mean(theirs, axis=0)[i]
            row[f"ours, {seconds:g} s"] = np.mean(ours, axis=0)[i]
            row[f"gap, {seconds:g} s, %"] = 100 * (
                row[f"ours, {seconds:g} s"] / row[f"PyVRP, {seconds:g} s"] - 1
            )
        row["plans"] = np.mean(sizes)
        print(*row.values(), flush=True)
        rows.append(row)
    table = pd.DataFrame(rows).round(2)
    print(table.to_string(index=False))
    table.to_csv(out / "orienteering.csv", index=False)
    good = True
    for seconds in SECONDS:
        gaps = table[f"gap, {seconds:g} s, %"]
        good &= bool(gaps.mean() >= -0.5 and gaps.min() >= -2.0 and (gaps > 0).mean() >= 1 / 3)
    return good


def _pyvrp(instance: Instance, seconds: float, seed: int) -> float:
    """Give the rewards that PyVRP collects: prizes that outweigh all lengths."""
    from pyvrp import Model
    from pyvrp.stop import MaxRuntime

    model = Model()
    places = [model.add_location(x=int(x), y=int(y)) for x, y in instance.places]
    depot = model.add_depot(places[0])
    for place, reward in zip(places[1:], instance.rewards[1:].tolist(), strict=True):
        model.add_client(place, prize=1_000 * reward, required=False)
    model.add_vehicle_type(
        instance.robots, start_depot=depot, end_depot=depot, max_distance=instance.budget
    )
    for tail, row in zip(places, instance.lengths.astype(int).tolist(), strict=True):
        for head, length in zip(places, row, strict=True):
            if tail is not head:
                model.add_edge(tail, head, distance=length)
    best = model.solve(MaxRuntime(seconds), seed=seed, display=False).best
    return float(best.prizes()) / 1_000 if best.is_feasible() else 0.0
