"""What is known of a front, from below and from above."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from botohe_moo.algorithms.exact.front import FrontSearch, TooLargeError
from botohe_moo.algorithms.local_search.engine import Costs, LocalSearch
from botohe_moo.bounds.front_bound import FrontBound, Step
from botohe_moo.bounds.kernels.states import ROUNDING, Net
from botohe_moo.bounds.lines import LEVELS, Lines
from botohe_moo.bounds.master import Pool, most_levels
from botohe_moo.bounds.net import Remembered, arcs_by_ends, new_net
from botohe_moo.bounds.relaxation import Relaxation
from botohe_moo.bounds.stairs import MOST_MOVING, TeamStairs
from botohe_moo.bounds.steps import Steps
from botohe_moo.bounds.targets import Known
from botohe_moo.bounds.turns import Clock, Turns
from botohe_moo.core.world import CHECKING, World
from botohe_moo.mission.model import Mission

# These constants share out time and memory; every bound is valid whatever they are. Where no other
# source is given, they were chosen by experiment, for small gaps on the missions of 20 to 200 nodes
# in `python -m benchmarks bounds`.

# Shares of the time limit.
_EXACT_SHARE = 0.05  # for the true front
_EXACT_SECONDS = 10.0  # at most: missions of the library that are solved at all take 5 or less
_SEARCH_SHARE = 0.05  # to find trails
_PREPARING_SHARE = 0.25  # to prepare relaxed trails that remember
# What work is counted as.
_PORTIONS_A_SECOND, _MOST_PORTIONS = 50, 1_000_000  # of the search for the true front
_SECONDS_A_STOP = 5e-9  # to evaluate a plan, for each node and robot
_SECONDS_A_PAIR = 4e-7  # of nodes, to prepare what they remember
_EVALUATIONS = 100_000  # plans that the search for trails evaluates at most
_LEAST_LEVELS, _MOST_LEVELS = 4, 12  # of prices
_MOST_PRICES = 400  # of the linear programme
_MOST_CONFIGURATIONS = 6_000  # of a team's levels, all of which are looked at for each node
_NEAREST = 8  # rewards near by that a node remembers
_FIRST_BITS = 10  # that a node remembers at first: rewards and bridges
_MOST_COMPARED = 3_000  # nodes of which all pairs are compared: a second, and 0.1 GiB
_BYTES_A_LINK = 40.0  # two integers of 8 bytes, a flag and a figure, and some while they are found
_MIB = 2**20
NOTE = "Robots are bounded as if each were the best of all kinds, and rewards counted on arrival."


class Proof:
    """What is known of a front: plans, and lines, stairs and steps that no plan lies above."""

    def __init__(
        self,
        mission: Mission,
        world: World,
        *,
        bounded: Mission | None = None,
        seed: int,
        memory: float,
        clock: Clock,
        turns: Turns,
    ) -> None:
        self.clock, self.turns = clock, turns
        self.robots = mission.robots
        self._mission, self._world, self._memory = mission, world, memory
        self._bounded = mission if bounded is None else bounded  # whose plans are the mission's
        self._random_state = np.random.default_rng(seed)
        # In units in which all reward is about 100: a power of 2, so that nothing is rounded.
        self.unit = 2.0 ** round(math.log2(mission.total_reward / 100 or 1.0))
        self._net = new_net(world, self.unit)
        self.min_survival, self.max_length = self._net.min_survival, self._net.max_length
        self.most_survival = _most_survival(self._net)
        base_reward = float(world.graph.reward[world.team.start[0]])
        self._base_reward = base_reward / self.unit
        self.known = Known(base_reward, mission.robots)
        self._front: list[Step] = []
        self._notes = [] if self._bounded.is_plain else [NOTE]
        # Without a memory and with one level; they are made again where there is time.
        self.lines: list[Lines] = []
        self.steps: list[Steps] = []
        self._prepare(0, 1)

    def _prepare(self, n_bits: int, n_levels: int) -> None:
        """Make relaxed trails, and begin all lines and steps anew.

        Nodes remember ``n_bits``; prices have ``n_levels``.
        """
        net, mission = self._net, self._mission
        n_bytes = self._memory * _MIB
        # For each thread five tables of what lies ahead, under two prices, with their copies for
        # searches; and the links.
        per_state = 16.0 * (2 * LEVELS + n_levels + 1)
        per_state += _BYTES_A_LINK * max(1.0, net.graph.n_arcs / net.graph.n_nodes)
        fits = int(n_bytes / per_state / self.turns.n_threads)
        self._relaxation = Relaxation(
            net,
            # Four tables of all pairs of nodes, in a quarter of the memory.
            Remembered(net, _NEAREST, n_bits, min(_MOST_COMPARED, math.isqrt(int(n_bytes / 128)))),
            self._random_state,
            self.turns,
            self.clock,
            fits,
        )
        self._pool = Pool(net, n_levels)
        self.lines = [
            Lines(self._relaxation, self._pool, moving, self._base_reward)
            for moving in range(1, mission.robots + 1)
        ]
        for lines in self.lines:
            lines.family = self.lines
        self.steps = [Steps(lines, self.most_survival) for lines in self.lines]
        self.stairs = TeamStairs(self.lines[:MOST_MOVING], self.most_survival)

    def _levels(self) -> int:
        """Return how many levels prices have; 0 where the memory has no room for one."""
        n_nodes, robots = max(1, len(self._pool.nodes)), self._mission.robots
        n_levels = min(max(_MOST_PRICES // n_nodes, _LEAST_LEVELS), _MOST_LEVELS)
        # Half of the memory for two tables of each number of robots.
        fits = int(self._memory * _MIB / 2 / (16 * n_nodes * robots))
        return most_levels(robots, n_levels, min(_MOST_CONFIGURATIONS, fits))

    def find_front(self) -> bool:
        """Take the true front as the bound; return whether a share of the time sufficed for it."""
        mission = self._mission
        seconds = min(_EXACT_SHARE * self.clock.seconds, _EXACT_SECONDS)
        # Portions decide, unless they take twice as long as they usually do.
        world = self._world.with_limits(self._world.limits.loosened(ROUNDING))
        search = FrontSearch(mission, world, time_limit=2 * seconds, memory_limit=self._memory)
        n_portions = int(min(_MOST_PORTIONS, 1 + _PORTIONS_A_SECOND * seconds))
        try:
            while search.plans is None and n_portions > 0:
                search.advance()
                n_portions -= 1
        except TooLargeError:
            return False
        if search.plans is None:
            return False
        objectives = mission.evaluate(search.plans)  # by ascending E[S]
        # Twice what exact_front regards as equal.
        reward, robots = 2 * CHECKING * mission.total_reward, 2 * CHECKING * mission.robots
        most = [float(objectives[0, 0]) + reward, *(objectives[1:, 0] + reward).tolist()]
        least = [-math.inf, *(objectives[:-1, 1] + robots).tolist()]
        for moving in range(1, mission.robots + 1):
            stay = mission.robots - moving
            for height, start in zip(most, least, strict=True):
                self._front.append(Step(moving, height, max(start - stay, 0.0), "front"))
        return True

    def prepare(self) -> bool:
        """Find plans, and prepare all lines and steps; return False where there is no room."""
        n_levels = self._levels()
        if n_levels == 0:
            self._notes.append(
                "Prices for this number of robots and nodes do not fit into the memory."
            )
            return False
        pairs = min(self._net.graph.n_nodes, _MOST_COMPARED) ** 2
        if _SECONDS_A_PAIR * pairs < _PREPARING_SHARE * self.clock.seconds:
            self._prepare(_FIRST_BITS, n_levels)
        else:
            self._notes.append("Relaxed trails remember nothing: there is too little time.")
        if self._relaxation.remembers_less:
            self._notes.append("Relaxed trails remember less than they would with more memory.")
        if self.max_length < math.inf:
            self._notes.append("Relaxed trails keep the travel budget one arc at a time only.")
        if self.min_survival > 0.0:
            self._notes.append("Relaxed trails keep the survival floor one arc at a time only.")
        self._find_trails()
        return True

    def bound(self) -> FrontBound:
        """Return what has been proved, without lines that are nowhere the lowest."""
        for each in self.lines:
            each.prune()
        unit = self.unit
        lines = (
            line._replace(most=line.most * unit, mu=line.mu * unit)
            for each in self.lines
            for line in each.found
        )
        found = [*(step for each in self.steps for step in each.found), *self.stairs.found]
        steps = (step._replace(most=step.most * unit) for step in found)
        return FrontBound(
            mission=self._bounded,
            lines=tuple(lines),
            steps=(*self._front, *steps),
            most_survival=self.most_survival,
            min_survival=self.min_survival,
            max_length=self.max_length,
            seconds=self.clock.elapsed,
            notes=tuple(self._notes),
        )

    def _find_trails(self) -> None:
        """Search for plans, and put their trails into the pool."""
        mission, graph = self._mission, self._net.graph
        search = LocalSearch(mission, Costs(self._world), random_state=self._random_state)
        search.insert(mission.batch([mission.stay_home()]))
        seconds = _SECONDS_A_STOP * graph.n_nodes * mission.robots
        search.run(int(min(_EVALUATIONS, 1 + _SEARCH_SHARE * self.clock.seconds / seconds)))
        batch, objectives, _ = search.plans()
        self.known.add(objectives)
        arcs = arcs_by_ends(graph)
        for trail in {tuple(trail) for plan in batch for trail in plan.trails}:
            way = [arcs.get(pair, -1) for pair in pairwise(trail)]
            if way and min(way) >= 0:
                self._pool.add(way)


def _most_survival(net: Net) -> float:
    """Return the largest probability to survive of a robot that moves."""
    graph = net.graph
    leaving = slice(graph.first[net.base], graph.first[net.base + 1])
    survival = graph.survival[leaving] * net.world.ways.home[graph.head[leaving]]
    return min(1.0, float(survival.max(initial=0.0)) * (1.0 + CHECKING))  # products are rounded
