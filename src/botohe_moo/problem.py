"""BOTOHE as a pymoo problem, and what pymoo prints while solving it."""

from __future__ import annotations

import copy
import math
from typing import Annotated, Any

import numpy as np
from pydantic import Field
from pymoo.core.problem import Problem
from pymoo.util.display.column import Column
from pymoo.util.display.output import Output

from botohe_moo.base.messages import PluginError, quoted
from botohe_moo.base.parameters import Probability, TravelBudget, checked
from botohe_moo.base.registry import Registry
from botohe_moo.base.types import FloatArray, ObjectArray
from botohe_moo.core.world import CHECKING
from botohe_moo.indicators import area_indicator
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.objectives import Objectives
from botohe_moo.trails import PlanBatch, Plans

__all__ = ["BOTOHE", "FrontOutput", "LeastSurvival"]


class BOTOHE(Problem):
    """Bi-objective team orienteering in hazardous environments.

    A solution is one :class:`TrailPlan`: ``X`` is an object array of shape (n, 1). pymoo
    minimises, so ``F`` holds (−E[R], −E[S]), shape (n, 2).

    Parameters
    ----------
    mission
        What to plan for.
    min_survival
        Survival floor: every robot has to survive with at least this probability, in [0, 1]. It
        becomes an inequality constraint of pymoo's; 0 sets none.
    max_length
        Travel budget: the lengths of the arcs of every robot's trail sum to at most this, at least
        0; an arc without ``length`` counts 1. It becomes an inequality constraint, too. Default:
        the mission's own (``mission.max_length``), if it has one; ``math.inf`` sets none.
    risk
        In (0, 1): the first objective is not E[R], but its mean over the worst scenarios, those
        that have this probability together. It is the conditional value at risk over scenarios
        (Rockafellar and Uryasev, "Conditional value-at-risk for general loss distributions",
        Journal of Banking & Finance 26, 2002). Default: E[R].
    allow_invalid
        Evaluate invalid plans, too, and count their faults as constraint violation, as operators
        without a repair need (:class:`~botohe_moo.operators.PenaltyOnly`).

    Raises
    ------
    TypeError, ValueError
        If ``mission`` is not a Mission, or another parameter is out of its range.

    Notes
    -----
    The problem is that of :meth:`Mission.evaluate`. The survival floor is that of the team
    surviving orienteers problem: Jorgensen, Chen, Milam and Pavone, "The team surviving
    orienteers problem: routing teams of robots in uncertain environments with survival
    constraints", Autonomous Robots 42(4), 2018.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from botohe_moo import BOTOHE, load_mission, make_algorithm
    >>> problem = BOTOHE(load_mission("toy"), min_survival=0.6)
    >>> result = minimize(problem, make_algorithm("nsga2", pop_size=20), ("n_eval", 200), seed=1)
    >>> bool(problem.mission.robot_survival(result.X).min() >= 0.6)
    True
    """

    @checked
    def __init__(
        self,
        mission: Mission,
        *,
        min_survival: Probability = 0.0,
        max_length: TravelBudget | None = None,
        risk: Annotated[float, Field(gt=0, lt=1)] | None = None,
        allow_invalid: bool = False,
    ) -> None:
        check_mission(mission)
        if risk is not None and not mission.scenarios:
            which = f"{quoted(mission.name)}, which has no scenarios"
            raise ValueError(f"Expected no risk for {which}, got {risk:g}.")
        self.risk = risk
        limits = mission.limits(min_survival, max_length)
        n_constraints = int(allow_invalid) + int(limits.has_floors) + int(limits.has_budgets)
        self.mission = mission
        n_obj = len(self.objectives)
        super().__init__(n_var=1, n_obj=n_obj, n_ieq_constr=n_constraints, vtype=object)
        self.min_survival = min_survival
        max_length = mission.max_length if max_length is None else max_length
        self.max_length = None if max_length == math.inf else max_length  # of robots of all kinds
        self.allow_invalid = allow_invalid
        # What plans are checked with, and what searches plan with.
        self.limits = limits.loosened(CHECKING)
        self.world = mission.limited(min_survival, max_length)
        mission.check_ways(self.world)

    def evaluate_batch(self, batch: PlanBatch) -> FloatArray:
        """Compute F (n, 2), −E[R] and −E[S]; all algorithms evaluate plans by this method.

        Parameters
        ----------
        batch
            Plans for the mission's team. A PlanError names what is not valid; with
            ``allow_invalid`` a robot is lost at the first fault of its trail.
        """
        objectives = self._values(self.mission, batch)
        if self.risk is not None:
            objectives[:, 0] = (self.worst_weights(batch) * self._rewards(batch)).sum(axis=0)
        return -objectives

    def worst_weights(self, batch: PlanBatch) -> FloatArray:
        """Return the weights of scenarios whose mean reward ``risk`` makes an objective.

        They sum to 1 for each plan (n_scenarios, n): those of the worst scenarios, which have the
        probability ``risk`` together, are 1 / risk times their probabilities. Without a ``risk``,
        they are the probabilities.

        Parameters
        ----------
        batch
            As for ``evaluate_batch``.
        """
        order = self._rewards(batch).argsort(axis=0, kind="stable")
        chances = np.array([p for p, _ in self.mission.in_scenarios])[order]
        risk = self.risk or 1.0
        counted = np.diff(np.minimum(chances.cumsum(axis=0), risk), axis=0, prepend=0.0)
        weights = np.empty(order.shape)
        np.put_along_axis(weights, order, counted / risk, axis=0)
        return weights

    def _rewards(self, batch: PlanBatch) -> FloatArray:
        """Return E[R] of plans in each scenario (n_scenarios, n)."""
        return np.array([self._values(one, batch)[:, 0] for _, one in self.mission.in_scenarios])

    def _values(self, mission: Mission, batch: PlanBatch) -> FloatArray:
        """Return E[R] and E[S] of plans (n, 2), also of invalid ones where they are allowed."""
        if self.allow_invalid:
            return mission.evaluate_drafts(batch)[0]
        return mission.evaluate(batch)

    def constrain_batch(self, batch: PlanBatch) -> FloatArray:
        """Compute the inequality constraints G (n, n_ieq_constr), at most 0 where they are kept.

        With ``allow_invalid`` there is a column for the number of faults
        (:meth:`Mission.evaluate_drafts`), with a survival floor one for how far the robot in the
        greatest danger falls short of it, and with a travel budget one for the share of it by which
        the longest trail exceeds it (for a budget of 0: the length of that trail).

        Parameters
        ----------
        batch
            As for ``evaluate_batch``.
        """
        columns = []
        if self.allow_invalid:
            columns.append(self.mission.evaluate_drafts(batch)[1])
        if self.limits.has_floors:
            missing = self.limits.floors - self.mission.robot_survival(batch)
            columns.append(missing.max(axis=1))
        if self.limits.has_budgets:
            budgets = self.limits.budgets
            unit = np.where((budgets > 0) & (budgets < math.inf), budgets, 1.0)
            with np.errstate(over="ignore"):  # of budgets near 0 or near the largest number
                beyond = (self.mission.trail_lengths(batch) - budgets) / unit
            columns.append(np.nan_to_num(beyond.max(axis=1)))
        return np.column_stack(columns) if columns else np.empty((len(batch), 0))

    def check_limits(self, plans: Plans) -> None:
        """Refuse, by a ValueError that names one of them, robots that do not keep their limits.

        Parameters
        ----------
        plans
            As for :meth:`Mission.evaluate`.
        """
        self.mission.check_limits(plans, self.limits)

    @property
    def objectives(self) -> Objectives:
        """The names, upper bounds and columns of −F: E[R] and E[S].

        A subclass with other objectives has to override this property: areas, tables and pictures
        follow from it.

        Examples
        --------
        >>> from botohe_moo import BOTOHE, load_mission
        >>> from botohe_moo.objectives import Objectives
        >>> class Safest(BOTOHE):
        ...     '''E[R], and how probably the robot in the greatest danger survives.'''
        ...     @property
        ...     def objectives(self):
        ...         bounds = self.mission.total_reward, 1.0
        ...         return Objectives(("E[R]", "least survival"), bounds, ("reward", "least"))
        ...     def evaluate_batch(self, batch):
        ...         F = super().evaluate_batch(batch)
        ...         F[:, 1] = -self.mission.robot_survival(batch).min(axis=1)
        ...         return F
        >>> toy = load_mission("toy")
        >>> BOTOHE(toy).objectives.bounds, Safest(toy).objectives.bounds
        ((10.0, 2.0), (10.0, 1.0))
        """
        plain = Objectives.of(self.mission)
        if self.risk is None:
            return plain
        name = f"E[R] in the worst {100 * self.risk:g} %"
        return Objectives((name, *plain.names[1:]), plain.bounds, plain.columns)

    def allowing_invalid(self) -> BOTOHE:
        """Return the same problem with ``allow_invalid``."""
        if self.allow_invalid:
            return self
        other = copy.copy(self)
        other.allow_invalid = True
        other.n_ieq_constr += 1
        return other

    def _evaluate(self, x: ObjectArray, out: dict[str, Any], *_: Any, **__: Any) -> None:
        if np.issubdtype(np.asarray(x).dtype, np.number):
            raise TypeError(
                f"Expected trail plans to evaluate {self.name()}, got numbers, as pymoo's own "
                "operators make. make_algorithm('nsga2') has sampling, crossover and mutation for "
                "trail plans; make_algorithm('module:Class') wires any class of pymoo's."
            )
        batch = self.mission.batch(x)
        F, G = self.evaluate_batch(batch), self.constrain_batch(batch)
        if not overrides(self, "_evaluate"):
            F = self.checked("F", F, len(batch))
            G = self.checked("G", G, len(batch))
        out["F"] = F  # an override may add columns to it, or replace it
        if G.shape[1]:
            out["G"] = G

    @property
    def is_plain(self) -> bool:
        """Whether the objectives are E[R] and E[S]: no method that computes them is overridden.

        Examples
        --------
        >>> from botohe_moo import BOTOHE, load_mission
        >>> BOTOHE(load_mission("toy")).is_plain
        True
        """
        methods = ("_evaluate", "evaluate_batch", "objectives")
        return self.risk is None and not any(overrides(self, method) for method in methods)

    def checked(self, what: str, values: Any, n_plans: int) -> FloatArray:
        """Refuse, by a ValueError, values of a wrong shape, and those that are not finite.

        Parameters
        ----------
        what
            ``"F"``, of ``evaluate_batch``, or ``"G"``, of ``constrain_batch``.
        values, n_plans
            What was computed, and for how many plans.
        """
        computed = np.asarray(values, np.float64)
        shape = (n_plans, self.n_obj if what == "F" else self.n_ieq_constr)
        if computed.shape == shape and np.isfinite(computed).all():
            return computed
        method = "evaluate_batch" if what == "F" else "constrain_batch"
        if overrides(self, "_evaluate"):
            method = "_evaluate"
        expected = f"Expected {method} of {type(self).__name__} to give"
        if computed.shape != shape:
            stacked = ""
            if what == "G":
                stacked = " (columns of its own beside those of super().constrain_batch(batch))"
            raise ValueError(f"{expected} {what} of shape {shape}{stacked}, got {computed.shape}.")
        bad = computed[~np.isfinite(computed).all(axis=1)]
        raise ValueError(f"{expected} finite {what}, got {bad[0]}.")

    def name(self) -> str:
        """Return the problem's name, as pymoo shows it."""
        return f"BOTOHE({self.mission.name})"


class LeastSurvival(BOTOHE):
    """A BOTOHE of three objectives: E[R], E[S], and the least survival of a robot.

    The third is the least survival of the trails: between two plans with equal E[S], the one that
    shares the danger more evenly is better. Studies and ``solve`` call this problem
    ``least-survival``.

    Parameters
    ----------
    mission, min_survival, max_length, allow_invalid
        As for :class:`BOTOHE`.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.problem import LeastSurvival
    >>> toy = load_mission("toy")
    >>> problem = LeastSurvival(toy)
    >>> plan = toy.plan([[1, 2, 4, 3, 1], [1]])
    >>> problem.evaluate_batch(toy.batch([plan])).round(2).tolist()
    [[-3.9, -1.59, -0.59]]
    """

    @property
    def objectives(self) -> Objectives:
        """E[R], E[S], and a probability."""
        plain = super().objectives
        return Objectives(
            (*plain.names, "least survival"),
            (*plain.bounds, 1.0),
            (*plain.columns, "least_survival"),
        )

    def evaluate_batch(self, batch: PlanBatch) -> FloatArray:
        """Compute F (n, 3).

        Parameters
        ----------
        batch
            As for :meth:`BOTOHE.evaluate_batch`.
        """
        least = self.mission.robot_survival(batch).min(axis=1)
        return np.column_stack([super().evaluate_batch(batch), -least])


def overrides(problem: BOTOHE, method: str) -> bool:
    """Return whether a problem overrides a method of :class:`BOTOHE`."""
    own = getattr(type(problem), method) is not getattr(BOTOHE, method)
    return own or method in vars(problem)


PROBLEMS = Registry("botohe_moo.problems", "problem", own={"least-survival": LeastSurvival})


def find_problem(problem: str | type[BOTOHE]) -> type[BOTOHE]:
    """Return the class of a problem by its name, or ``module:Class``, whose module is run.

    Raises
    ------
    ValueError
        If there is none, or it does not state the objectives that it computes.
    """
    found: Any = problem
    if isinstance(problem, str):
        try:
            found = PROBLEMS.find(problem, BOTOHE)
        except PluginError as error:
            raise ValueError(f"{PROBLEMS.source(problem)}: {error}.") from error
    if not (isinstance(found, type) and issubclass(found, BOTOHE)):
        raise ValueError(f"Expected a class derived from BOTOHE, got {quoted(found)}.")
    if found._evaluate is not BOTOHE._evaluate:
        remedy = "which not all algorithms call: override evaluate_batch"
        raise ValueError(f"{found.__name__} overrides _evaluate, {remedy}.")
    overrides_values = found.evaluate_batch is not BOTOHE.evaluate_batch
    if overrides_values and found.objectives is BOTOHE.objectives:
        lacks = "does not state its objectives: areas need their upper bounds"
        raise ValueError(f"{found.__name__} overrides evaluate_batch, and {lacks}.")
    return found


def problem_path(problem: type[BOTOHE]) -> str:
    """Return the name of a problem's class, as ``module:Class``."""
    return f"{problem.__module__}:{problem.__qualname__}"


class FrontOutput(Output):
    """What pymoo prints under ``verbose=True``: area, largest expected reward, front size.

    For a problem with other objectives, too, area and reward are those of E[R] and E[S].

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from botohe_moo import BOACO, BOTOHE, load_mission
    >>> from botohe_moo.problem import FrontOutput
    >>> algorithm = BOACO(n_ants=50, output=FrontOutput())  # what it has anyway
    >>> problem = BOTOHE(load_mission("toy"))
    >>> done = minimize(problem, algorithm, ("n_gen", 1), verbose=True)  # doctest: +ELLIPSIS
    ===================================================
    n_gen  |  n_eval  |   area   |  max E[R]  | n_front
    ===================================================
         1 |       50 | ...
    """

    def __init__(self) -> None:
        super().__init__()
        self.area = Column("area", width=8)
        self.reward = Column("max E[R]", width=10)
        self.size = Column("n_front", width=7)
        self.columns += [self.area, self.reward, self.size]

    def update(self, algorithm: Any) -> None:
        """Read the current optimum of an algorithm that solves a :class:`BOTOHE`."""
        super().update(algorithm)
        opt = algorithm.opt
        objectives = np.empty((0, 2))
        if opt is not None and opt.get("feas").any():
            opt = opt[opt.get("feas")]
            plain = algorithm.problem.is_plain
            mission = algorithm.problem.mission
            objectives = -opt.get("F") if plain else mission.evaluate(opt.get("X"))
        self.area.set(area_indicator(objectives, algorithm.problem.mission))
        self.reward.set(float(objectives[:, 0].max()) if len(objectives) else None)
        self.size.set(len(objectives))
