"""Plans robot by robot: each gets the trail that adds most to those before it."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from functools import cached_property, partial
from itertools import permutations
from typing import Annotated, Any, TypeAlias

import numpy as np
from pydantic import Field

from botohe_moo._base.checks import check_number
from botohe_moo._base.types import FloatArray
from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.types import Probability, TravelBudget
from botohe_moo.core.graph import NO_LIMITS, Limits
from botohe_moo.core.kinds import AT_NEXT_DEPOT, kind_ranges
from botohe_moo.core.paths import Budget, new_budget
from botohe_moo.kernels.beam.labels import Beam, new_beam
from botohe_moo.kernels.beam.prospects import BeamRule, Near, dangers, find_near
from botohe_moo.kernels.beam.search import MAX_LABELS, best_trail
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.outcomes.reaching import collected
from botohe_moo.trails import TrailPlan

__all__ = ["plan_sequentially"]

BEAM_WIDTH = 100
MAX_BEAM_WIDTH = 100_000
BeamWidth: TypeAlias = Annotated[int, Field(ge=1, le=MAX_BEAM_WIDTH)]

# Nodes that the search looks ahead to from each node; on 200 nodes as good as all of them.
_N_NEAR = 64

_ROUNDING = 1e-12  # relative: what rounding may change in the product of survivals

_ALL_ORDERS_UP_TO = 3  # kinds, of which all orders are tried


@checked
def plan_sequentially(
    mission: Mission,
    weight: float,
    *,
    beam_width: BeamWidth = BEAM_WIDTH,
    min_survival: Probability = 0.0,
    max_length: TravelBudget | None = None,
) -> TrailPlan:
    """Plan one robot after another, each for the greatest gain given those before it.

    A plan is worth weight · E[R] / (total reward) + (1 − weight) · E[S] / robots. Each robot gets
    the trail that adds most to it. With weight 0 the robots collect only what they can without
    danger. With weight 1 dangers count only by the reward that lost robots do not collect.

    Parameters
    ----------
    mission
        What to plan for.
    weight
        Weight on reward, in [0, 1].
    beam_width
        Partial trails that the search for each robot's trail keeps, from 1 to 100 000. A wider
        beam finds better trails and takes longer, in proportion.
    min_survival
        Survival floor of every robot, in [0, 1]; 0 sets none.
    max_length
        Travel budget: the largest length of a robot's trail, at least 0; None sets none.

    Returns
    -------
    TrailPlan
        The trails in the order in which they were planned.

    Raises
    ------
    TypeError
        If ``mission`` is not a Mission.
    ValueError
        If a parameter is out of its range, or robots of a kind cannot get to their end within the
        limits.

    Notes
    -----
    The sequential scheme for the team surviving orienteers problem: Jorgensen, Chen, Milam and
    Pavone, "The team surviving orienteers problem: routing teams of robots in uncertain
    environments with survival constraints", Autonomous Robots 42(4), 2018. A plan's worth is a
    monotone submodular function of its trails. With the best trail for each of K robots, a plan is
    therefore worth at least 1 − (1 − 1/K)^K of the best plan. A narrow beam may miss the best
    trail. With a travel budget any beam may miss it: robots go home by the safest way or by the
    shortest one, never by a compromise between both.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.search.sequential import plan_sequentially
    >>> mission = load_mission("art_museum")
    >>> plan = plan_sequentially(mission, 1.0)
    >>> reward, survivors = mission.evaluate([plan])[0]
    >>> bool(reward > 10)
    True
    """
    longest = math.inf if max_length is None else max_length
    limits = check_mission(mission).limits(min_survival, longest)
    mission.check_ways(limits)
    return SequentialPlanner(mission, limits, beam_width=beam_width).plan(weight)


class SequentialPlanner:
    """Plans of one mission for many weights; :func:`plan_sequentially` documents parameters."""

    def __init__(
        self,
        mission: Mission,
        limits: Limits = NO_LIMITS,
        *,
        beam_width: int = BEAM_WIDTH,
        max_labels: int = MAX_LABELS,
    ) -> None:
        self.mission = check_mission(mission)
        self.limits = limits
        self.beam_width = beam_width
        self._max_labels = max_labels

    @cached_property
    def _near(self) -> Near:
        return find_near(self.mission.arrays, _N_NEAR)

    @cached_property
    def _home(self) -> TrailPlan:
        return self.mission.stay_home(self.limits)

    @cached_property
    def _budget(self) -> Budget | None:
        return new_budget(self.mission.arrays, self.limits)

    def plan(self, weight: float) -> TrailPlan:
        """Plan the whole team, for a weight on reward."""
        return self._team(self._best_trails(weight))

    def plans(
        self, weight: float, *, n_most: int | None = None, until: float = math.inf
    ) -> list[TrailPlan]:
        """Plan the whole team, and plans in which its last robots stay at base.

        The first plan is the team's, the next that of all robots but the last, and so on to the
        first robot alone; none is returned twice. Of more than ``n_most``, some in between are
        left out. Robots that are not planned at ``until`` (``time.perf_counter()``) stay at base.
        """
        trails = self._best_trails(weight, until)
        n_moving = range(len(trails), 0, -1)
        if n_most is not None and len(n_moving) > n_most:
            chosen = np.linspace(0, len(n_moving) - 1, n_most).astype(int)
            return [self._team(trails[: n_moving[i]]) for i in chosen.tolist()]
        return [self._team(trails[:n]) for n in n_moving] or [self._team([])]

    def _team(self, trails: list[tuple[int, list[int]]]) -> TrailPlan:
        """Return the plan in which these robots take trails, and the others stay at base."""
        team = list(self._home.trails)
        for robot, trail in trails:
            team[robot] = tuple(trail)
        return TrailPlan(team)

    def _best_trails(self, weight: float, until: float = math.inf) -> list[tuple[int, list[int]]]:
        """Plan the trails of those robots that leave, one kind after another.

        Kinds are planned in the order, of a few, that gives the best plan.
        """
        weight = check_number("weight", weight, at_least=0, at_most=1)
        kinds = range(len(self.mission.kinds))
        orders = list(permutations(kinds)) if len(kinds) <= _ALL_ORDERS_UP_TO else [tuple(kinds)]
        found = [self._trails(weight, order, until) for order in orders]
        return found[0] if len(found) == 1 else max(found, key=partial(self._worth, weight))

    def _worth(self, weight: float, trails: list[tuple[int, list[int]]]) -> float:
        """Return what a plan is worth; as a draft, since budgets count ``evaluate``."""
        objectives, _ = self.mission.evaluate_drafts([self._team(trails)])
        reward, survivors = objectives[0] / (self.mission.total_reward or 1.0, self.mission.robots)
        return float(weight * reward + (1.0 - weight) * survivors)

    def _trails(
        self, weight: float, kinds: Sequence[int], until: float
    ) -> list[tuple[int, list[int]]]:
        """Plan robots, kind by kind; return the number and the trail of each that leaves."""
        mission, graph = self.mission, self.mission.arrays
        unreached = np.ones(len(mission.nodes))
        if graph.kinds is None:
            unreached[graph.base] = 0.0  # every trail collects it, and it may be large
        beam = new_beam(graph)
        danger = dangers(graph, self._near, (1.0 - weight) / mission.robots if weight > 0 else 1.0)
        trails: list[tuple[int, list[int]]] = []
        firsts, stops = map(np.unique, kind_ranges(graph.kinds, mission.robots))
        ranges = list(zip(firsts.tolist(), stops.tolist(), strict=True))
        for first, stop in [ranges[kind] for kind in kinds]:
            for robot in range(first, stop):
                if time.perf_counter() > until:
                    return trails
                trail = self._trail(weight, robot, unreached, danger, beam)
                if trail is None:  # nor will later robots of this kind leave
                    home = TrailPlan([self._home.trails[robot]])
                    unreached *= (1.0 - collected(mission, home)[0]) ** (stop - robot)
                    break
                trails.append((robot, trail))
                unreached *= 1.0 - collected(mission, TrailPlan([trail]))[0]
        return trails

    def _trail(
        self, weight: float, robot: int, unreached: FloatArray, danger: FloatArray, beam: Beam
    ) -> list[int] | None:
        """Plan one robot's trail; None if it is best where it is, or on the safest way to its end.

        ``unreached`` is the probability that no robot has collected each node of the mission.
        Rewards that are paid on return count as far as the safest way home is survived.
        """
        mission, graph, budget = self.mission, self.mission.arrays, self._budget
        share = graph.reward / (mission.total_reward or 1.0)
        start, limits, left = graph.base, self.limits, unreached
        if (kinds := graph.kinds) is not None:
            start, n_nodes = int(kinds.start[robot]), len(mission.nodes)
            left = np.zeros(graph.n_nodes)  # also in the layers of other kinds
            layer = start - start % n_nodes
            left[layer : layer + n_nodes] = unreached
            share = np.where(kinds.credit == AT_NEXT_DEPOT, share * graph.home, share)
        least = limits.min_survival if limits.floors is None else float(limits.floors[start])
        survival_weight = (1.0 - weight) / mission.robots
        if weight > 0:
            share = weight * share
        else:  # among the safest trails, the most reward decides
            survival_weight, least = 1.0, float(graph.home[start])
            least *= 1.0 if least == 1.0 else 1.0 - _ROUNDING
            if budget is not None:
                budget = budget._replace(limits=limits.with_floor(least))
        rule = BeamRule(
            start=start,
            worth=share * left,
            danger=danger,
            survival_weight=survival_weight,
            least=least,
            budget=budget,
            width=self.beam_width,
            max_labels=self._max_labels,
        )
        arcs, _, _ = best_trail(graph, self._near, rule, beam)
        return [start, *graph.head[arcs].tolist()] if len(arcs) else None

    def __getstate__(self) -> dict[str, Any]:
        derived = ("_near", "_home", "_budget")  # large, and soon computed
        return {key: value for key, value in vars(self).items() if key not in derived}
