"""An algorithm that keeps all promises, and others of which each breaks some."""

from dataclasses import replace
from typing import Annotated

import numpy as np
from pydantic import Field
from pymoo.core.algorithm import Algorithm
from pymoo.core.population import Population

from botohe_moo import BOTOHE, Mission, TrailPlan
from botohe_moo.algorithms import RandomTrailSampling
from botohe_moo.algorithms.base import ArchiveAlgorithm
from botohe_moo.trails import PlanBatch


class Walks(ArchiveAlgorithm):  # random walks: keeps all promises
    def __init__(self, *, n: Annotated[int, Field(ge=1)] = 20, **options):
        super().__init__(**options)
        self.n = n

    def rng(self):
        return self.random_state

    def walks(self, n):
        return RandomTrailSampling().sample_batch(self.problem, n, self.rng())

    def _advance(self, **_):
        self.evaluate_plans(self.walks(min(self.n, self.n_left)))


class Loud(Walks):  # prints, and raises
    def _advance(self, **_):
        print("hello")
        raise ValueError("Too loud.")


class MakesNothing:
    """Is not an algorithm of pymoo's."""


class Untyped(Walks):  # states a parameter without its type
    def __init__(self, *, n=20):
        super().__init__(n=n)


class Teleports(Walks):  # reports plans in which robots jump from the base to the last node
    def result(self):
        found = super().result()
        mission = self.problem.mission
        base = mission.index(mission.base)
        jump = [base, mission.world.graph.n_nodes - 1, base]
        found.X = np.array([[TrailPlan([jump] * mission.robots)]] * len(found.F), object)
        return found


class OwnWay(Walks):  # computes objectives itself, whatever the problem says
    def evaluate_plans(self, batch):
        self.evaluator.n_eval += len(batch)
        batch = batch.take(np.flatnonzero((self.problem.constrain_batch(batch) <= 0).all(axis=1)))
        objectives = self.problem.mission.evaluate(batch)
        return objectives, self.archive.insert(batch, objectives)


class Forgetful(Walks):  # reports the last generation only
    def _advance(self, **_):
        self.archive = type(self.archive)(self.problem.mission.robots)
        super()._advance()


class WholeGenerations(Walks):  # evaluates twenty plans a generation, whatever the budget
    def _advance(self, **_):
        self.evaluate_plans(self.walks(20))


class LeavesSome(Walks):  # does not begin a generation that it cannot end
    def _advance(self, **_):
        if self.n_left < 20:
            self.termination.terminate()
        else:
            super()._advance()


class Secret(Walks):  # looks at more plans than it counts
    def _advance(self, **_):
        drawn = self.walks(3 * self.n)
        worth = self.problem.mission.evaluate(drawn)[:, 0]
        best = np.argsort(-worth, kind="stable")[: min(self.n, self.n_left)]
        self.evaluate_plans(drawn.take(best))


class Unseeded(Walks):  # draws from a generator that no seed determines
    def rng(self):
        return np.random.default_rng()


class OneSeed(Walks):  # draws from a generator with a seed of its own
    def _setup(self, problem, **options):
        super()._setup(problem, **options)
        self.own = np.random.default_rng(0)

    def rng(self):
        return self.own


class SaysDeterministic(Walks):  # says that no seed matters, and draws random numbers
    deterministic = True


class LosesItsState(Walks):  # leaves out of its pickle what the run needs
    def _advance(self, **_):
        self.turn = getattr(self, "turn", 0) + 1
        self.n = 10 + self.turn
        super()._advance()

    def __getstate__(self):
        return {name: value for name, value in vars(self).items() if name != "turn"}


class BackTheSameWay(
    Walks
):  # leads each robot to a neighbour and back, as if every arc had a reverse
    def walks(self, n):
        mission = self.problem.mission
        graph, base = mission.world.graph, mission.index(mission.base)
        there = graph.head[graph.first[base] : graph.first[base + 1]]
        drawn = self.random_state.choice(there, (n, mission.robots)).tolist()
        plans = [TrailPlan([[base, node, base] for node in nodes]) for nodes in drawn]
        return PlanBatch.from_plans(plans, mission.robots)


class Pairs(Walks):  # takes for granted that there is a second robot
    def walks(self, n):
        walks = super().walks(n)
        for plan in walks:
            plan.trails[1]
        return walks


class Alike(Walks):  # takes all robots to be alike: they go where the first one goes
    def walks(self, n):
        plans = [TrailPlan([plan.trails[0]] * plan.n_robots) for plan in super().walks(n)]
        return PlanBatch.from_plans(plans, self.problem.mission.robots)


class AlikeAndSaysSo(Alike):  # keeps all promises, since it makes none for kinds of robots
    @classmethod
    def supports(cls, mission):
        return mission.is_plain


class Reckless(Walks):  # does not look at constraints
    def evaluate_plans(self, batch):
        self.evaluator.n_eval += len(batch)
        objectives = -self.problem.evaluate_batch(batch)
        return objectives, self.archive.insert(batch, objectives)

    def walks(self, n):
        mission = self.problem.mission
        kinds = [replace(kind, min_survival=0.0, max_length=None) for kind in mission.kinds]
        free = BOTOHE(Mission(mission.graph, base=mission.base, kinds=kinds), max_length=np.inf)
        return RandomTrailSampling().sample_batch(free, n, self.random_state)


class Plain(Algorithm):  # not of this package, and fine: it evaluates its population
    def __init__(self, *, n: Annotated[int, Field(ge=1)] = 20):
        super().__init__()
        self.n = n

    def _infill(self):
        n = min(self.n, self.termination.n_max_evals - self.evaluator.n_eval)
        return RandomTrailSampling().do(self.problem, n, random_state=self.random_state)

    _initialize_infill = _infill

    def _advance(self, infills=None, **_):
        self.pop = Population.merge(self.pop, infills) if self.pop is not None else infills

    _initialize_advance = _advance
