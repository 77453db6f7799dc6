"""Bi-objective ant colony optimisation."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Literal, Self

import numpy as np
import pandas as pd
from pymoo.core.algorithm import Algorithm
from pymoo.core.population import Population
from pymoo.termination.max_eval import MaximumFunctionCallTermination

from botohe_moo._types import IntArray, ObjectArray
from botohe_moo.algorithms.archive import PlanArchive
from botohe_moo.algorithms.colony import Colony, ColonyRule
from botohe_moo.problem import BOTOHE, FrontOutput
from botohe_moo.trails import PlanBatch, TrailPlan

__all__ = ["BOACO"]


class BOACO(Algorithm):
    def __init__(
        self,
        *,
        n_ants: int = 100,
        evaporation: float = 0.04,
        heuristic: bool = True,
        pheromone: bool = True,
        pheromone_per_robot: bool = False,
        initial_pheromone: float | Literal["bounds"] = 1.0,
        reward_epsilon: float = 0.05,
        survival_epsilon: float = 0.01,
        unvisited_bonus: float = 0.0,
        exploration: float = 0.0,
        pooled_deposit: bool = True,
        n_threads: int = 1,
        sampling: Iterable[TrailPlan] | ObjectArray | None = None,
        **options: Any,
    ) -> None:
        super().__init__(**{"output": FrontOutput(), **options})
        self.n_ants = n_ants
        self.evaporation = evaporation
        self.heuristic = heuristic
        self.pheromone = pheromone
        self.pheromone_per_robot = pheromone_per_robot
        self.initial_pheromone = initial_pheromone
        self.reward_epsilon = reward_epsilon
        self.survival_epsilon = survival_epsilon
        self.unvisited_bonus = unvisited_bonus
        self.exploration = exploration
        self.pooled_deposit = pooled_deposit
        self.n_threads = n_threads
        self.sampling = sampling

    @classmethod
    def journal(cls, **overrides: Any) -> Self:
        return cls(
            **{
                "evaporation": 0.1,
                "initial_pheromone": "bounds",
                "unvisited_bonus": 0.05,
                "exploration": 0.01,
                "pooled_deposit": False,
                **overrides,
            }
        )

    def _setup(self, problem: Any, **_: Any) -> None:
        mission = problem.mission
        bounds = self.initial_pheromone == "bounds"
        self.colony = Colony(
            mission,
            ColonyRule(
                n_ants=self.n_ants,
                evaporation=self.evaporation,
                heuristic=self.heuristic,
                pheromone=self.pheromone,
                pheromone_per_robot=self.pheromone_per_robot,
                initial_reward_pheromone=mission.total_reward if bounds else self.initial_pheromone,
                initial_survival_pheromone=mission.robots if bounds else self.initial_pheromone,
                reward_epsilon=self.reward_epsilon,
                survival_epsilon=self.survival_epsilon,
                unvisited_bonus=self.unvisited_bonus,
                exploration=self.exploration,
                pooled_deposit=self.pooled_deposit,
            ),
            n_threads=self.n_threads,
            random_state=self.random_state,
        )
        self.archive = PlanArchive(mission.robots)

    def _initialize_advance(self, infills: Any = None, **kwargs: Any) -> None:
        self._advance()

    def _advance(self, infills: Any = None, **_: Any) -> None:
        batch, arcs = self.colony.construct(self.n_ants)
        objectives = self._evaluate(batch)
        members, changed = self.archive.absorb(batch, arcs, objectives)
        archive = self.archive
        self.colony.learn(
            batch, arcs, objectives, members,
            (archive._objectives, archive._arcs, archive._offsets), changed,
        )

    def _evaluate(self, batch):
        self.evaluator.n_eval += len(batch)
        return -self.problem.evaluate_batch(batch)

    @property
    def opt(self):
        return self.archive.population() if self.archive is not None else None

    @opt.setter
    def opt(self, value): pass
    @property
    def pop(self):
        return self.opt
    @pop.setter
    def pop(self, value): pass
    def _set_optimum(self) -> None:
        pass
