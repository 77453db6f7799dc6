"""Plans robot by robot: each gets the trail that adds most to those before it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property, partial
from itertools import pairwise, permutations
from typing import Annotated, TypeAlias

import numpy as np
from pydantic import Field

from botohe_moo.algorithms.greedy import kernels
from botohe_moo.base.parameters import Probability, TravelBudget, check, checked
from botohe_moo.base.types import FloatArray
from botohe_moo.core.paths import new_near
from botohe_moo.core.walk import new_visits, walk
from botohe_moo.core.world import AT_NEXT_DEPOT, PLANNING, World, brought_home, find_arc
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.trails import TrailPlan

BEAM_WIDTH = 100
MAX_BEAM_WIDTH = 100_000
BeamWidth: TypeAlias = Annotated[int, Field(ge=1, le=MAX_BEAM_WIDTH)]

# Nodes that the search looks ahead to from each node; on 200 nodes as good as all of them.
_N_NEAR = 64

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
    >>> from botohe_moo.algorithms.greedy import plan_sequentially
    >>> mission = load_mission("art_museum")
    >>> plan = plan_sequentially(mission, 1.0)
    >>> reward, survivors = mission.evaluate([plan])[0]
    >>> bool(reward > 10)
    True
    """
    longest = math.inf if max_length is None else max_length
    world = check_mission(mission).limited(min_survival, longest)
    mission.check_ways(world)
    return SequentialPlanner(mission, world, beam_width=beam_width).plan(weight)


Trails: TypeAlias = list[tuple[int, tuple[int, ...]]]  # robots that leave, and their trails


class SequentialPlanner:
    """Plans of one mission for many weights; :func:`plan_sequentially` documents parameters.

    Robots keep the limits of ``world``, by default those of the mission.
    """

    def __init__(
        self, mission: Mission, world: World | None = None, *, beam_width: int = BEAM_WIDTH
    ) -> None:
        self.mission = check_mission(mission)
        self.world = mission.world if world is None else world
        self.beam_width = beam_width
        self._home = mission.stay_home(self.world).trails
        self._near = new_near(self.world.graph.n_nodes, _N_NEAR)
        # What each node is worth as a share of the total reward, if nobody else reaches it.
        share = self.world.graph.reward / (mission.total_reward or 1.0)
        self._worth = brought_home(self.world, share)

    @cached_property
    def _safest(self) -> World:
        """The mission in which only the safest trails keep the survival floor."""
        limits = self.world.limits
        floors = self.world.ways.home[self.world.team.start]
        floors = np.where(floors < 1.0, floors * (1.0 - PLANNING), floors)
        return self.world.with_limits(limits._replace(floors=np.maximum(floors, limits.floors)))

    def plan(self, weight: float) -> TrailPlan:
        """Plan the whole team, for a weight on reward."""
        return self._team(self._best_trails(weight))

    def plans(self, weight: float) -> list[TrailPlan]:
        """Plan the whole team, and plans in which its last robots stay at base.

        The first plan is the team's, the next that of all robots but the last, and so on to the
        first robot alone; none is returned twice.
        """
        trails = self._best_trails(weight)
        return [self._team(trails[:n]) for n in range(len(trails), 0, -1) or [0]]

    def _team(self, trails: Trails) -> TrailPlan:
        """Return the plan in which these robots take trails, and the others stay at base."""
        moving = dict(trails)
        return TrailPlan([moving.get(robot, home) for robot, home in enumerate(self._home)])

    def _best_trails(self, weight: float) -> Trails:
        """Plan the trails of those robots that leave, one kind after another.

        Kinds are planned in the order, of a few, that gives the best plan.
        """
        weight = check("weight", weight, Probability)
        kinds = np.unique(self.world.team.first).tolist()  # the first robot of each
        orders = list(permutations(kinds)) if len(kinds) <= _ALL_ORDERS_UP_TO else [tuple(kinds)]
        found = [self._trails(weight, order) for order in orders]
        return found[0] if len(found) == 1 else max(found, key=partial(self._value, weight))

    def _value(self, weight: float, trails: Trails) -> float:
        """Return what a plan is worth; as a draft, since budgets count ``evaluate``."""
        objectives, _ = self.mission.evaluate_drafts([self._team(trails)])
        reward, survivors = objectives[0] / (self.mission.total_reward or 1.0, self.mission.robots)
        return float(weight * reward + (1.0 - weight) * survivors)

    def _trails(self, weight: float, order: Sequence[int]) -> Trails:
        """Plan the robots, kind by kind, each given by its first robot."""
        world, team = self.world, self.world.team
        beam = kernels.new_beam(world, self.beam_width)
        graph, unreached = world.graph, _unreached(world)
        visits = new_visits(graph.n_nodes, graph.n_scenarios)
        trails: Trails = []
        for first in order:
            stays = False
            for robot in range(first, int(team.stop[first])):
                trail = self._home[robot]
                if not stays:
                    found = self._trail(weight, robot, unreached, beam)
                    stays = len(found) == 1  # nor will later robots of this kind leave
                if not stays:
                    trail = found
                    trails.append((robot, trail))
                found_arcs = [find_arc(graph, tail, head) for tail, head in pairwise(trail)]
                arcs = np.array(found_arcs, np.int64)
                n, *_ = walk(graph, team, world.returns, arcs, len(arcs), robot, visits)
                unreached[visits.node[:n]] *= 1.0 - visits.chance[:n]
        return trails

    def _trail(
        self, weight: float, robot: int, unreached: FloatArray, beam: kernels.Beam
    ) -> tuple[int, ...]:
        """Plan one robot's trail; only its start if it is best there, or on the safest way home.

        ``unreached`` is the probability that no robot has collected each entry of ``Team.worth``.
        """
        world, team = self.world, self.world.team
        worth, survival_weight = weight * self._worth, (1.0 - weight) / self.mission.robots
        if weight == 0.0:  # among the safest trails, the most reward decides
            world, worth, survival_weight = self._safest, self._worth, 1.0
        worth = worth * _mean(world, unreached)[team.origin]
        rule = kernels.BeamRule(
            robot, world.n_robots + robot, worth, survival_weight, self.beam_width
        )
        n_arcs, _, _ = kernels.best_trail(world, self._near, rule, beam)
        return int(team.start[robot]), *world.graph.head[beam.trail[:n_arcs]].tolist()


def _unreached(world: World) -> FloatArray:
    """Return the probability that no robot collects each entry of ``Team.worth``, at first.

    What robots collect where they start is the same on all trails, and may be large: it is left
    out.
    """
    team, unreached = world.team, np.ones(len(world.team.worth))
    starts = team.start[team.share[team.start] == 1.0]
    if world.returns is not None:
        starts = starts[world.returns.credit[starts] != AT_NEXT_DEPOT]
    unreached.reshape(-1, world.graph.n_nodes)[:, team.origin[starts]] = 0.0
    return unreached


def _mean(world: World, unreached: FloatArray) -> FloatArray:
    """Return the share of each node's expected reward that is left, over all scenarios."""
    team, shape = world.team, (world.graph.n_scenarios, world.graph.n_nodes)
    n_nodes = len(team.reward)
    if shape[0] == 1:
        return unreached[:n_nodes]
    left: FloatArray = (team.worth * unreached).reshape(shape).sum(axis=0)[:n_nodes]
    return left / np.where(team.reward > 0.0, team.reward, 1.0)
