"""Bi-objective ant colony optimisation."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Any, Literal, Self

import numpy as np
import pandas as pd
from pymoo.core.algorithm import Algorithm
from pymoo.core.population import Population
from pymoo.core.result import Result
from pymoo.termination.max_eval import MaximumFunctionCallTermination

from botohe_moo._checks import check_flag, check_integer, check_number
from botohe_moo._types import FloatArray, ObjectArray
from botohe_moo.algorithms.archive import PlanArchive
from botohe_moo.algorithms.colony import Colony, ColonyRule
from botohe_moo.problem import BOTOHE, FrontOutput
from botohe_moo.trails import PlanBatch, TrailPlan

__all__ = ["BOACO"]

_PYMOO_OPTIONS = (
    "callback",
    "display",
    "evaluator",
    "output",
    "return_least_infeasible",
    "save_history",
    "seed",
    "termination",
    "verbose",
)


class BOACO(Algorithm):
    """Bi-objective ant colony optimisation (BO-ACO).

    Every iteration (a pymoo generation) each ant builds one trail plan, robot by robot and hop by
    hop. From node v it takes an arc to v' that the trail has not used yet with probability
    proportional to (τ_R η_R)^(1 − λ) (τ_S η_S)^λ, and ends the trail by the base's self-loop.
    The ants' λ are spread evenly over [0, 1], from all for reward to all for survival. The plans
    of the iteration's Pareto set and of the archive, the Pareto set over all iterations, deposit
    pheromone on their arcs in proportion to their E[R] and E[S].

    Defaults are the first settings of the paper; :meth:`journal` gives those of its curves.

    Parameters
    ----------
    n_ants
        Ants in the colony, at least 1: evaluations per iteration. A single ant has λ = 1/2.
    evaporation
        Share ρ of the pheromone that evaporates in an iteration, in (0, 1).
    heuristic
        Whether heuristics guide the ants; without, η_R = η_S = 1.
    pheromone
        Whether pheromone guides the ants; without, τ_R = τ_S = 1.
    pheromone_per_robot
        Whether each robot has its own pair of pheromone maps; otherwise the robots share one.
    initial_pheromone
        Pheromone on every arc at the start, above 0; ``"bounds"`` starts τ_R at the mission's
        total reward and τ_S at its number of robots.
    reward_epsilon
        Added to η_R, above 0.
    survival_epsilon
        Added to η_S = ω, above 0.
    unvisited_bonus
        Added to ω·r in η_R for a node not in the trail yet, at least 0:
        η_R = reward_epsilon + (unvisited_bonus + ω·r) · (probability that no earlier robot
        reaches the node). It is reward_epsilon for a node already in the trail, and the base.
    exploration
        Every candidate's weight is raised by exploration · (mean weight) / (number of
        candidates), at least 0.
    pooled_deposit
        Whether both Pareto sets deposit as one multiset, divided by its size P, or one after the
        other, each divided by its own size.
    max_ties
        Plans with equal objectives but different trails that the archive keeps, at least 1. The
        journal version keeps all; where nothing is dangerous those have no end.
    n_threads
        Threads that build plans, at least 1; the result does not depend on it.
    sampling
        Trail plans to start from, evaluated first and put into the archive, so that they deposit
        pheromone from the first iteration on: an iterable of plans, or ``X`` of another result.
    **options
        pymoo's own: ``termination``, ``callback``, ``output``, ``save_history``, ``seed``, ...

    Raises
    ------
    ValueError
        If a parameter is out of its range.
    TypeError
        If an option is unknown, or the problem is not a :class:`BOTOHE`.

    Attributes
    ----------
    archive : PlanArchive
        All non-dominated plans found so far (``plans``, ``objectives``). Their pymoo population
        (``pop`` and ``opt``) is made when it is asked for.

    Notes
    -----
    Simon, Richley, Overbey and Perez-Lavin, "Bi-objective trail-planning for a robot team
    orienteering in a hazardous environment", 2025; after Iredi, Merkle and Middendorf,
    "Bi-criterion optimization with multi colony ant algorithms", EMO 2001.

    With ``("n_eval", n)`` as termination the last iteration has just as many ants as evaluations
    are left: no budget is overdrawn.

    Where some node has more arcs in than out a walk could run into a dead end; ants draw again
    when no unused arcs lead home from the node they chose.
    """

    is_initialized: bool

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
        max_ties: int = 1_000,
        n_threads: int = 1,
        sampling: Iterable[TrailPlan] | ObjectArray | None = None,
        **options: Any,
    ) -> None:
        for name in options:
            if name not in _PYMOO_OPTIONS:
                raise TypeError(
                    f"{type(self).__name__} has no parameter {name!r}; pymoo's options here are "
                    f"{', '.join(_PYMOO_OPTIONS)}."
                )
        self.n_ants = check_integer("n_ants", n_ants, at_least=1)
        self.evaporation = check_number("evaporation", evaporation, above=0, below=1)
        self.heuristic = check_flag("heuristic", heuristic)
        self.pheromone = check_flag("pheromone", pheromone)
        self.pheromone_per_robot = check_flag("pheromone_per_robot", pheromone_per_robot)
        self.initial_pheromone = (
            initial_pheromone
            if isinstance(initial_pheromone, str) and initial_pheromone == "bounds"
            else check_number("initial_pheromone", initial_pheromone, above=0, other="'bounds'")
        )
        self.reward_epsilon = check_number("reward_epsilon", reward_epsilon, above=0)
        self.survival_epsilon = check_number("survival_epsilon", survival_epsilon, above=0)
        self.unvisited_bonus = check_number("unvisited_bonus", unvisited_bonus, at_least=0)
        self.exploration = check_number("exploration", exploration, at_least=0)
        self.pooled_deposit = check_flag("pooled_deposit", pooled_deposit)
        self.max_ties = check_integer("max_ties", max_ties, at_least=1)
        self.n_threads = check_integer("n_threads", n_threads, at_least=1)
        self.sampling = sampling
        self.archive = PlanArchive(1)
        super().__init__(**{"output": FrontOutput(), **options})
        self.archive = PlanArchive(1)  # pymoo has set its own, which only sees its individuals

    @classmethod
    def journal(
        cls,
        *,
        evaporation: float = 0.1,
        initial_pheromone: float | Literal["bounds"] = "bounds",
        unvisited_bonus: float = 0.05,
        exploration: float = 0.01,
        pooled_deposit: bool = False,
        **parameters: Any,
    ) -> Self:
        """Give the colony with which the paper's journal version made its published curves.

        Parameters
        ----------
        evaporation, initial_pheromone, unvisited_bonus, exploration, pooled_deposit
            As for the class, with that version's values.
        **parameters
            Any other parameter of the class.

        Notes
        -----
        Simon, Richley, Overbey and Perez-Lavin, PeerJ Computer Science, 2025.
        """
        return cls(
            evaporation=evaporation,
            initial_pheromone=initial_pheromone,
            unvisited_bonus=unvisited_bonus,
            exploration=exploration,
            pooled_deposit=pooled_deposit,
            **parameters,
        )

    @property
    def pheromone_maps(self) -> pd.DataFrame:
        """The pheromone on each arc now.

        One row an arc (and robot, where each has maps of its own): columns ``robot`` (only then),
        ``tail`` and ``head`` (node labels; the base's self-loop has the base as both), ``reward``
        and ``survival`` (the two pheromones).

        Raises
        ------
        RuntimeError
            If the algorithm has not been set up with a problem yet.
        """
        if self.problem is None:
            raise RuntimeError("There is no pheromone before the algorithm has a problem.")
        walk, nodes = self.colony.walk, self.problem.mission.nodes
        arcs = {
            "tail": pd.Series([nodes[i] for i in walk.tail], dtype=object),
            "head": pd.Series([nodes[i] for i in walk.head], dtype=object),
        }
        frames = [
            pd.DataFrame({**arcs, "reward": levels[:, 0], "survival": levels[:, 1]})
            for levels in self.colony.pheromone
        ]
        if not self.pheromone_per_robot:
            return frames[0]
        return pd.concat(frames, keys=range(len(frames)), names=["robot"]).reset_index("robot")

    def setup(self, problem: Any, **kwargs: Any) -> Algorithm:
        """Prepare to solve ``problem``; pymoo's ``minimize`` calls this.

        Without any termination the run ends after 100 000 evaluations: pymoo's default would
        look for convergence in the design space, which trail plans do not have.

        Parameters
        ----------
        problem
            What to solve.
        **kwargs
            pymoo's options, such as ``termination`` and ``seed``.

        Raises
        ------
        TypeError
            If ``problem`` is no :class:`BOTOHE`.
        """
        if not isinstance(problem, BOTOHE):
            raise TypeError(f"Expected a BOTOHE problem, got {type(problem).__name__}.")
        if self.termination is None and kwargs.get("termination") is None:
            kwargs["termination"] = ("n_eval", 100_000)
        return super().setup(problem, **kwargs)

    def _setup(self, problem: BOTOHE, **_: Any) -> None:
        mission = problem.mission
        reward, survival = (
            (mission.total_reward or 1.0, float(mission.robots))
            if self.initial_pheromone == "bounds"
            else (float(self.initial_pheromone),) * 2
        )
        rule = ColonyRule(
            evaporation=self.evaporation,
            heuristic=self.heuristic,
            pheromone=self.pheromone,
            pheromone_per_robot=self.pheromone_per_robot,
            initial_reward_pheromone=reward,
            initial_survival_pheromone=survival,
            reward_epsilon=self.reward_epsilon,
            survival_epsilon=self.survival_epsilon,
            unvisited_bonus=self.unvisited_bonus,
            exploration=self.exploration,
            pooled_deposit=self.pooled_deposit,
        )
        self.colony = Colony(
            mission,
            rule,
            n_ants=self.n_ants,
            n_threads=self.n_threads,
            random_state=self.random_state,
        )
        self.archive = PlanArchive(mission.robots, max_ties=self.max_ties)

    def advance(self, infills: Population | None = None, **_: Any) -> Result | None:  # noqa: ARG002
        """Run one iteration; pymoo's ``next`` calls this.

        As pymoo's own, but for what it returns before the end: not the current optimum, which
        would then be made into a population in every iteration, whether somebody looks or not.

        Parameters
        ----------
        infills
            None: ants do not ask pymoo to evaluate.
        **_
            Nothing else is used.
        """
        if self.is_initialized:
            self._advance()
        else:
            self.n_iter = 1
            self._initialize_advance()
            self.is_initialized = True
        self._post_advance()
        if not self.termination.has_terminated():
            return None
        self.finalize()
        return self.result()

    def _initialize_advance(self, **_: Any) -> None:
        if self.sampling is not None:
            mission = self.problem.mission
            given = self.sampling
            given = given.get("X") if isinstance(given, Population) else given
            batch = mission.batch(list(mission.batch(given))[: self._n_left()])
            self.archive.absorb(batch, self.colony.arcs_of(batch), self._evaluate(batch))
        self._advance()

    def _advance(self, **_: Any) -> None:
        n_ants = min(self.n_ants, self._n_left())
        if n_ants == 0:
            return
        batch, arcs = self.colony.construct(n_ants)
        objectives = self._evaluate(batch)
        members = self.archive.absorb(batch, arcs, objectives)
        self.colony.learn(batch, arcs, objectives, members, self.archive)

    def _n_left(self) -> int:
        """Count the evaluations that the budget still allows."""
        limit = getattr(self.termination, "n_max_evals", None)
        if not isinstance(self.termination, MaximumFunctionCallTermination) or limit is None:
            return sys.maxsize
        return int(min(max(0, limit - self.evaluator.n_eval), sys.maxsize))

    def _evaluate(self, batch: PlanBatch) -> FloatArray:
        self.evaluator.n_eval += len(batch)
        values = np.asarray(self.problem.evaluate_batch(batch), np.float64)
        if values.shape != (len(batch), 2):
            raise ValueError(
                f"Expected evaluate_batch of {type(self.problem).__name__} to give F of shape "
                f"{(len(batch), 2)}, got {values.shape}."
            )
        return -values

    def _finalize(self) -> None:
        self.colony.close()

    def _set_optimum(self) -> None:
        pass  # the archive is the optimum, at all times

    # pymoo assigns pop and opt in its loop. Here both are the archive, as a population that is
    # made when somebody looks: termination, display and callbacks see it in every iteration, and
    # an iteration in which nobody looks does not pay for it.

    @property
    def opt(self) -> Population | None:
        """The archive as a pymoo population; None as long as it is empty."""
        return self.archive.population() if len(self.archive) else None

    @opt.setter
    def opt(self, value: Population | None) -> None: ...

    @property
    def pop(self) -> Population | None:
        """The same as ``opt``."""
        return self.opt

    @pop.setter
    def pop(self, value: Population | None) -> None: ...
