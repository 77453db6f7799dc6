"""The true front, as an algorithm."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from botohe_moo.algorithms.base import ArchiveAlgorithm, MaxTies
from botohe_moo.algorithms.exact.front import MEMORY_LIMIT, TIME_LIMIT, FrontSearch, MemoryLimit
from botohe_moo.base.parameters import Positive, checked
from botohe_moo.base.types import ObjectArray
from botohe_moo.mission.model import Mission
from botohe_moo.problem import BOTOHE
from botohe_moo.trails import TrailPlan


class Exact(ArchiveAlgorithm):
    """The true Pareto front, for small missions.

    The plan in which everybody stays at base is evaluated first. Then every iteration (a pymoo
    generation) does a portion of the search. At its end the plans of the front, one for each point,
    are evaluated by descending E[R], and the run ends by itself, even if budget is left. Nothing is
    random: every seed gives the same front.

    Parameters
    ----------
    time_limit
        Seconds that the search may take; compiling it for the first time does not count.
    memory_limit
        MiB that the search may take.
    max_ties
        Plans with equal objectives but different trails that the archive keeps. The search
        itself gives one of them.
    sampling
        Trail plans to start from, evaluated first and put into the archive; they do not change
        what is searched. An iterable of plans, or ``X`` of another result.
    **options
        pymoo's own: ``termination``, ``callback``, ``output``, ``save_history``, ``seed``, ...

    Raises
    ------
    TooLargeError
        While it runs: if the mission is too large for the limits.
    TypeError
        If an option is unknown, or the problem is not a :class:`BOTOHE` or overrides
        ``evaluate_batch`` or ``constrain_batch``, which the search does not call.

    Attributes
    ----------
    archive : PlanArchive
        The front (``plans``, ``objectives``); until the search is done only what was evaluated
        first.

    Notes
    -----
    See :func:`~botohe_moo.algorithms.exact_front` for the method, and for what is exact where
    numbers are rounded.

    Partial trails and teams do not count as evaluations: to compare efforts, compare times. With a
    budget of fewer evaluations than the front has points, the result has those with most reward. A
    run that ends before the search has what was evaluated first.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from botohe_moo import BOTOHE, Exact, load_mission
    >>> problem = BOTOHE(load_mission("toy", robots=1))
    >>> result = minimize(problem, Exact(), ("n_eval", 200))
    >>> (-result.F).round(2).tolist()
    [[7.09, 0.35], [4.14, 0.66], [0.9, 0.81], [0.0, 1.0]]
    """

    evaluates_in_kernels = True
    deterministic = True

    @classmethod
    def supports(cls, mission: Mission) -> bool:
        """Return whether robots are alike, start and end at the base, and are paid on arrival."""
        return mission.is_plain

    @checked
    def __init__(
        self,
        *,
        time_limit: Positive = TIME_LIMIT,
        memory_limit: MemoryLimit = MEMORY_LIMIT,
        max_ties: MaxTies = 1_000,
        sampling: Iterable[TrailPlan] | ObjectArray | None = None,
        **options: Any,
    ) -> None:
        super().__init__(max_ties=max_ties, sampling=sampling, **options)
        self.time_limit = time_limit
        self.memory_limit = memory_limit

    def _setup(self, problem: BOTOHE, **_: Any) -> None:
        super()._setup(problem)
        limits = {"time_limit": self.time_limit, "memory_limit": self.memory_limit}
        self._search = FrontSearch(problem.mission, problem.world, **limits)
        self._evaluated = set(self.sampling)

    def _advance(self, **_: Any) -> None:
        if len(self.archive) == 0:  # some terminations need an optimum from the first generation on
            mission = self.problem.mission
            home = mission.stay_home()
            self._evaluated.add(home)
            self.evaluate_plans(mission.batch([home]))
        n_left = self.n_left
        if n_left == 0:
            return
        self._search.advance()
        if self._search.plans is not None:
            plans = [plan for plan in self._search.plans if plan not in self._evaluated]
            self.evaluate_plans(self.problem.mission.batch(plans[:n_left]))
            self.termination.force_termination = True
