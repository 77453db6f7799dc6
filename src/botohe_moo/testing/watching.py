"""Small missions that algorithms are checked on, and what an algorithm did in a run on one."""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from typing import Any

import networkx as nx
import numpy as np
from pymoo.core.algorithm import Algorithm

from botohe_moo.base.types import FloatArray
from botohe_moo.mission.generators import random
from botohe_moo.mission.model import Mission
from botohe_moo.mission.rules import Kind
from botohe_moo.problem import BOTOHE
from botohe_moo.testing.rules import expect
from botohe_moo.trails import PlanBatch, TrailPlan


def streets() -> Mission:
    """Make a mission of eight nodes, with arcs there and back, for two robots."""
    return random(nodes=8, arc_probability=0.4, robots=2, seed=3)


def one_way() -> Mission:
    """Make a mission of six nodes on two rings that share the base; no arc has a reverse."""
    graph: nx.DiGraph[Any] = nx.DiGraph()
    graph.add_nodes_from((node, {"reward": float(node)}) for node in range(6))
    nx.add_cycle(graph, [0, 1, 2, 3], survival=0.9)
    nx.add_cycle(graph, [0, 4, 5], survival=0.8)
    graph.add_edge(2, 4, survival=0.95)
    return Mission(graph, base=0, robots=2, name="one-way")


def measured() -> Mission:
    """Make the mission of streets with lengths."""
    plain = streets()
    graph: nx.DiGraph[Any] = nx.DiGraph(plain.graph)
    rng = np.random.default_rng(3)
    lengths = {arc: float(rng.uniform(0.5, 1.5)) for arc in sorted(graph.edges)}
    nx.set_edge_attributes(graph, lengths, "length")
    return Mission(graph, base=plain.base, robots=2, name="measured")


def kinds_of_robots() -> Mission:
    """Make the mission of streets for drones and a rover, whose rewards count on return.

    Drones leave from a depot and end at the base. Each kind has a node that it cannot get to.
    """
    plain = streets()
    graph: nx.DiGraph[Any] = nx.DiGraph(plain.graph)
    for _, head, arc in graph.edges(data=True):
        drone, rover = 0.0 if head == 2 else arc["survival"], 0.0 if head == 6 else 0.9
        arc["survival"] = {"drone": drone, "rover": rover}
    graph.nodes[5]["depot"] = True
    graph.nodes[3]["share"] = {"drone": 0.5}
    drones = Kind("drone", 2, start=5, min_survival=0.3)
    kinds = [drones, Kind("rover", 1, max_length=6)]
    return Mission(graph, base=plain.base, kinds=kinds, pays="return", name="kinds")


# Generations in a row without an evaluation, after which an algorithm is taken for endless.
_MOST_IDLE = 1_000


@dataclass
class Run:
    """What is known of a run that ended."""

    plans: list[TrailPlan]  # of its result
    objectives: FloatArray  # E[R] and E[S] of these as the algorithm says (n, 2)
    fronts: list[FloatArray]  # E[R] and E[S] after each generation
    spent: int  # evaluations, by the algorithm's own count

    @property
    def trails(self) -> list[tuple[tuple[int, ...], ...]]:
        """The trails of the plans of the result."""
        return [plan.trails for plan in self.plans]


class Watched(BOTOHE):
    """Remembers all plans that it evaluates, their E[R] and E[S], and whether they are feasible."""

    def __init__(self, mission: Mission, **limits: Any) -> None:
        super().__init__(mission, **limits)
        self.seen: list[tuple[TrailPlan, list[float], bool]] = []

    def evaluate_batch(self, batch: PlanBatch) -> FloatArray:
        """Evaluate plans, and remember them."""
        F = super().evaluate_batch(batch)
        feasible = np.asarray((self.constrain_batch(batch) <= 0).all(axis=1)).tolist()
        self.seen += zip(batch, (-F).tolist(), feasible, strict=True)
        return F

    def __deepcopy__(self, memo: dict[int, object]) -> Watched:
        return self


class Counted(Mission):
    """Counts all plans that are evaluated."""

    n_evaluated = 0

    def evaluate(self, plans: Any) -> FloatArray:
        """Evaluate plans, and count them."""
        values = super().evaluate(plans)
        self.n_evaluated += len(values)
        return values


class Halved(BOTOHE):
    """A problem with another objective: half of E[R]."""

    def evaluate_batch(self, batch: PlanBatch) -> FloatArray:
        """Halve E[R]."""
        return super().evaluate_batch(batch) * [0.5, 1.0]


def run(
    algorithm: Algorithm,
    problem: BOTOHE,
    evaluations: int,
    *,
    seed: int = 1,
    pickled_after: int | None = None,
) -> Run:
    """Run an algorithm until its budget is spent, as pymoo's ``minimize`` does.

    After the generation ``pickled_after``, or before its setup where that is 0, the algorithm is
    pickled, and the run goes on with what was unpickled.
    """
    if pickled_after == 0:
        algorithm = revived(algorithm)
    algorithm.setup(problem, termination=("n_eval", evaluations), seed=seed)
    idle, spent, fronts = 0, 0, []
    while algorithm.has_next():
        algorithm.next()
        fronts.append(_objectives(algorithm))
        idle = idle + 1 if algorithm.evaluator.n_eval == spent else 0
        spent = algorithm.evaluator.n_eval
        expect(idle < _MOST_IDLE, f"it spent no evaluation in {idle:,} generations in a row")
        if len(fronts) == pickled_after:
            algorithm = revived(algorithm)
    result = algorithm.result()
    plans = [] if result.X is None else list(np.asarray(result.X, object).ravel())
    for plan in plans:
        expect(isinstance(plan, TrailPlan), f"its result holds {plan!r}, which is not a TrailPlan")
    F = np.empty((0, 2)) if result.F is None else -np.atleast_2d(result.F)
    expect(len(F) == len(plans), f"its result has {len(plans)} plans, and F of {len(F)}")
    return Run(plans, F, fronts, spent)


def _objectives(algorithm: Algorithm) -> FloatArray:
    """Return E[R] and E[S] of the feasible plans of an algorithm's optimum."""
    optimum = algorithm.opt
    if optimum is None or len(optimum) == 0:
        return np.empty((0, 2))
    feasible = optimum[optimum.get("feas").ravel().astype(bool)]
    return -feasible.get("F").astype(float) if len(feasible) else np.empty((0, 2))


def refuses(algorithm: Algorithm, problem: BOTOHE) -> bool:
    """Return whether an algorithm refuses a problem with another evaluation by its name."""
    try:
        algorithm.setup(problem, termination=("n_eval", 1), seed=1)
    except TypeError as error:
        if type(problem).__name__ in str(error):
            return True
        raise
    return False


def revived(thing: Any) -> Any:
    """Return a copy of something that has been pickled and unpickled."""
    return pickle.loads(pickle.dumps(thing))


def missing(points: FloatArray, front: FloatArray) -> FloatArray:
    """Return the points (n, 2) that no point of a front is as good as, to rounding."""
    least = points - 1e-12 * (1.0 + np.abs(points))
    as_good = np.asarray(front >= least[:, None]).all(axis=2)
    return np.asarray(points[~np.any(as_good, axis=1)])
