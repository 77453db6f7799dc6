"""Algorithms for studies, and missions, most of which go wrong: named as ``module:Name``."""

# ruff: noqa: F401 - what Doing is told may use all of this

import copy
import os
import random
import time
from pathlib import Path

import numpy as np
from numba.core import event
from pymoo.core.algorithm import Algorithm
from pymoo.core.population import Population

from botohe_moo import BOTOHE, Mission, load_mission
from botohe_moo.algorithms import RandomTrailSampling
from botohe_moo.algorithms.base import ArchiveAlgorithm

SEEN = {}  # by all runs of a process


class Sampler(Algorithm):
    """Not of this package's kind: evaluates random plans 70 at a time, whatever the budget."""

    def __init__(self, n: int = 70, **options):
        super().__init__(**options)
        self.n = n

    def _initialize_infill(self):
        return self._infill()

    def _initialize_advance(self, infills=None, **_):
        self._advance(infills)

    def _infill(self):
        return RandomTrailSampling().do(self.problem, self.n, random_state=self.random_state)

    def _advance(self, infills=None, **_):
        self.pop = infills if self.pop is None else Population.merge(self.pop, infills)


class Infeasible(Sampler):
    """Evaluates only plans in which a robot survives less probably than it has to."""

    def _infill(self):
        mission = self.problem.mission
        rng = self.random_state
        drawn = RandomTrailSampling().do(BOTOHE(mission), 10 * self.n, random_state=rng)
        least = mission.robot_survival(drawn.get("X").ravel()).min(axis=1)
        return drawn[least < self.problem.min_survival][: self.n]


class Copying(Sampler):
    """Evaluates on copies of its problem, some of which allow plans that are none."""

    def _advance(self, infills=None, **_):
        super()._advance(infills)
        batch = RandomTrailSampling().sample_batch(self.problem, 30, self.random_state)
        copy.copy(self.problem).evaluate_batch(batch)
        self.problem.allowing_invalid().evaluate_batch(batch)


class Doing(ArchiveAlgorithm):
    """Evaluates n plans, does what it is told (by default it fails), evaluates n more, ..."""

    def __init__(self, what: str = "raise RuntimeError('out of luck')", n: int = 20):
        super().__init__()
        self.what, self.n = what, n

    def _advance(self, **_):
        if self.evaluator.n_eval:
            exec(self.what, {**globals(), "self": self})
        self.sample(min(self.n, self.n_left))

    def draw(self, n):
        return RandomTrailSampling().sample_batch(self.problem, n, self.random_state)

    def sample(self, n):
        if n:
            self.evaluate_plans(self.draw(n))


class InKernel(Doing):
    """Declares that it evaluates in kernels: studies give it a problem that does not count."""

    evaluates_in_kernels = True

    def __init__(self):
        super().__init__("pass")


def changing_mission() -> Mission:
    return load_mission("terrain", nodes=8, seed=int(time.monotonic_ns() % 10**9))


def broken_mission() -> Mission:
    raise RuntimeError("no such place")
