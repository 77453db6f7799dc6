"""Greedy sequential planning, as an algorithm of pymoo's."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any

from pydantic import Field

from botohe_moo.algorithms.base import ArchiveAlgorithm, MaxTies
from botohe_moo.algorithms.greedy.planner import BEAM_WIDTH, BeamWidth, SequentialPlanner
from botohe_moo.base.parameters import checked
from botohe_moo.base.types import ObjectArray
from botohe_moo.problem import BOTOHE
from botohe_moo.trails import TrailPlan


class Greedy(ArchiveAlgorithm):
    """Greedy sequential planning: one robot after another, for a sweep of weights on reward.

    Every iteration (a pymoo generation) takes one weight w in [0, 1] and plans the robots one
    after another. Each gets the trail that adds most to w · E[R] / (total reward) +
    (1 − w) · E[S] / robots, given the trails of those before it. The weights are spread evenly, in
    an order that is coarse first: 0, 1, 1/2, 1/4, 3/4, ... Besides the team's plan, plans are
    evaluated in which only the first robots leave the base.

    After all weights the run ends by itself, even if budget is left. Nothing is random: every seed
    gives the same front.

    Parameters
    ----------
    n_weights
        How many weights.
    beam_width
        Partial trails that the search for each robot's trail keeps. A wider beam finds better
        trails and takes longer, in proportion.
    max_ties
        Plans with equal objectives but different trails that the archive keeps.
    sampling
        Trail plans to start from, evaluated first and put into the archive; they do not change
        what is planned. An iterable of plans, or ``X`` of another result.
    **options
        pymoo's own: ``termination``, ``callback``, ``output``, ``save_history``, ``seed``, ...

    Attributes
    ----------
    archive : PlanArchive
        All non-dominated plans found so far (``plans``, ``objectives``).

    Notes
    -----
    The sequential scheme for the team surviving orienteers problem: Jorgensen, Chen, Milam and
    Pavone, "The team surviving orienteers problem: routing teams of robots in uncertain
    environments with survival constraints", Autonomous Robots 42(4), 2018. See
    :func:`~botohe_moo.algorithms.greedy.plan_sequentially` for its guarantee. Plans that are best
    for some weight lie on the convex hull of the front; plans for fewer robots lie between them.

    With a travel budget, robots go home by the safest way or by the shortest one; trails that need
    a compromise between both are not found.

    No plan is evaluated twice, and partial trails do not count as evaluations: to compare efforts,
    compare times. Robots are planned for the mission's own objectives, even if a problem overrides
    ``evaluate_batch``.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from botohe_moo import BOTOHE, Greedy, area_indicator, load_mission
    >>> toy = load_mission("toy")
    >>> algorithm = Greedy(n_weights=11)
    >>> result = minimize(BOTOHE(toy), algorithm, ("n_eval", 200), seed=1)
    >>> area_indicator(-result.F, toy) > 0.5
    True
    """

    deterministic = True

    @checked
    def __init__(
        self,
        *,
        n_weights: Annotated[int, Field(ge=2, le=1_000_000)] = 100,
        beam_width: BeamWidth = BEAM_WIDTH,
        max_ties: MaxTies = 1_000,
        sampling: Iterable[TrailPlan] | ObjectArray | None = None,
        **options: Any,
    ) -> None:
        super().__init__(max_ties=max_ties, sampling=sampling, **options)
        self.n_weights = n_weights
        self.beam_width = beam_width

    def _setup(self, problem: BOTOHE, **_: Any) -> None:
        super()._setup(problem)
        self.planner = SequentialPlanner(problem.mission, problem.world, beam_width=self.beam_width)
        self._waiting = _coarse_first(self.n_weights)[::-1]
        self._evaluated = set(self.sampling)

    def _advance(self, **_: Any) -> None:
        weight = self._waiting.pop() / (self.n_weights - 1)
        plans = [plan for plan in self.planner.plans(weight) if plan not in self._evaluated]
        if plans:
            self._evaluated.update(plans)
            self.evaluate_plans(self.problem.mission.batch(plans[: self.n_left]))
        if not self._waiting:
            self.termination.force_termination = True


def _coarse_first(n: int) -> list[int]:
    """Return 0 to n − 1 in the order: both ends, then the middles of ever smaller gaps."""
    order, gaps = [0, n - 1], [(0, n - 1)]
    for low, high in gaps:  # grows as it is read
        if high - low > 1:
            middle = (low + high) // 2
            order.append(middle)
            gaps += [(low, middle), (middle, high)]
    return order
