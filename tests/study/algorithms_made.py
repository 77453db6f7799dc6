"""Algorithms for studies that go wrong, and some that do not: named as ``module:Class``."""

import copy
import os
import random
import time
from pathlib import Path

import numpy as np
from numba.core import event
from pymoo.core.algorithm import Algorithm
from pymoo.core.population import Population

from botohe_moo import BOTOHE, Mission
from botohe_moo import load_mission as generated
from botohe_moo.algorithms import RandomTrailSampling
from botohe_moo.algorithms.base import ArchiveAlgorithm


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


class Raising(ArchiveAlgorithm):
    """Evaluates twenty plans and raises."""

    def __init__(self, message: str = "out of luck"):
        super().__init__()
        self.message = message

    def _advance(self, **_):
        if self.evaluator.n_eval:
            raise RuntimeError(self.message)
        sample(self, 20)


def sample(algorithm, n):
    batch = RandomTrailSampling().sample_batch(algorithm.problem, n, algorithm.random_state)
    algorithm.evaluate_plans(batch)


class Compiling(ArchiveAlgorithm):
    """Compiles for a while before it evaluates plans."""

    def __init__(self, seconds: float = 0.3):
        super().__init__()
        self.seconds = seconds

    def _advance(self, **_):
        with event.trigger_event("numba:compiler_lock"):
            time.sleep(self.seconds)
        sample(self, 20)


class RaisingOnce(Raising):
    """Raises as long as a file is there."""

    def __init__(self, path: str = ""):
        super().__init__()
        self.path = path

    def _advance(self, **_):
        if Path(self.path).exists():
            raise RuntimeError("the file is there")
        sample(self, 20)


class Infeasible(Sampler):
    """Evaluates only plans in which a robot survives less probably than it has to."""

    def _infill(self):
        mission = self.problem.mission
        rng = self.random_state
        drawn = RandomTrailSampling().do(BOTOHE(mission), 10 * self.n, random_state=rng)
        least = mission.robot_survival(drawn.get("X").ravel()).min(axis=1)
        return drawn[least < self.problem.min_survival][: self.n]


class NeverEnding(ArchiveAlgorithm):
    """Evaluates some plans, and then sleeps for ever, or computes for ever."""

    def __init__(self, busy: bool = False):
        super().__init__()
        self.busy = busy

    def _advance(self, **_):
        if not self.evaluator.n_eval:
            sample(self, 20)
            return
        while True:
            if not self.busy:
                time.sleep(3600)


class SlowWithin(Sampler):
    """Takes its time within one iteration."""

    def __init__(self, seconds: float = 0.01):
        super().__init__()
        self.seconds = seconds

    def _infill(self):
        while True:
            time.sleep(self.seconds)
            self.evaluator.eval(
                self.problem,
                RandomTrailSampling().do(self.problem, 10, random_state=self.random_state),
            )


class Dying(ArchiveAlgorithm):
    """Takes its process along."""

    def _advance(self, **_):
        print("last words", flush=True)
        os.abort()


class Overdrawing(ArchiveAlgorithm):
    """Evaluates more than it may."""

    def _advance(self, **_):
        sample(self, 30)


class Slow(ArchiveAlgorithm):
    """Takes its time, the same for every plan, without computing."""

    def __init__(self, seconds: float = 0.01):
        super().__init__()
        self.seconds = seconds

    def _advance(self, **_):
        time.sleep(self.seconds)
        sample(self, min(10, self.n_left))


class Printing(Slow):
    """Prints, to whomever."""

    def _advance(self, **_):
        print("on standard output", flush=True)
        os.write(1, b"more of it\n")
        super()._advance()


class Forking(ArchiveAlgorithm):
    """Leaves a process of its own behind, and dies; or stays, and never ends."""

    def __init__(self, stay: bool = False):
        super().__init__()
        self.stay = stay

    def _advance(self, **_):
        if os.fork() == 0:
            time.sleep(3600)
            os._exit(0)
        if not self.stay:
            os._exit(3)
        time.sleep(3600)


class Asking(ArchiveAlgorithm):
    """Asks somebody at the keyboard."""

    def _advance(self, **_):
        input("How many? ")


class Exiting(ArchiveAlgorithm):
    """Ends the process as if all were well."""

    def _advance(self, **_):
        raise SystemExit(0)


class Overstating(ArchiveAlgorithm):
    """Claims more than its plans bring, and never ends."""

    def _advance(self, **_):
        if not self.evaluator.n_eval:
            sample(self, 20)
            front = self.archive.front
            self.archive._front = front._replace(objectives=front.objectives * 1.5)
            return
        time.sleep(3600)


class Understating(ArchiveAlgorithm):
    """Evaluates fifty plans an iteration, and counts one."""

    def _advance(self, **_):
        problem = self.problem
        batch = RandomTrailSampling().sample_batch(problem, 50, self.random_state)
        problem.evaluate_batch(batch)
        self.evaluate_plans(batch[:1])


class Copying(Sampler):
    """Evaluates on copies of its problem, some of which allow plans that are none."""

    def _advance(self, infills=None, **_):
        super()._advance(infills)
        drawn = RandomTrailSampling().do(self.problem, 30, random_state=self.random_state)
        batch = self.problem.mission.batch(drawn.get("X"))
        copy.copy(self.problem).evaluate_batch(batch)
        self.problem.allowing_invalid().evaluate_batch(batch)


class Changing(ArchiveAlgorithm):
    """Makes its mission pay ten times as much."""

    def _advance(self, **_):
        reward = self.problem.mission.rewards
        reward.setflags(write=True)
        reward *= 10
        reward.setflags(write=False)  # or kernels would be compiled for another type
        sample(self, min(20, self.n_left))


class Remembering(ArchiveAlgorithm):
    """Remembers, for all runs of its process, that it has run."""

    runs = ()

    def _advance(self, **_):
        if len(set(Remembering.runs) | {id(self)}) > 1:
            raise RuntimeError("somebody was here before")
        Remembering.runs = (id(self),)
        sample(self, min(20, self.n_left))


class Drawing(ArchiveAlgorithm):
    """Draws from the generators that everybody shares, and says what."""

    def _advance(self, **_):
        raise RuntimeError(f"{random.random()} {np.random.random()}")  # noqa: NPY002


def changing_mission() -> Mission:
    """Give another mission each time."""
    return generated("terrain", nodes=8, seed=int(time.monotonic_ns() % 10**9))


def broken_mission() -> Mission:
    """Give no mission at all."""
    raise RuntimeError("no such place")


class InKernel(ArchiveAlgorithm):
    """Says that it evaluates where no problem sees it; studies give it one that does not count."""

    evaluates_in_kernels = True

    def _advance(self, **_):
        sample(self, 20)
