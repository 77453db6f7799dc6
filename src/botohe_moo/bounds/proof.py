"""The proof of a bound: what is prepared, and what is known in the end."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from typing import Any

import numpy as np

from botohe_moo.algorithms.exact.front import FrontSearch, TooLargeError
from botohe_moo.algorithms.local_search.engine import Costs, LocalSearch
from botohe_moo.bounds.deadline import Deadline
from botohe_moo.bounds.front_bound import FrontBound, Step
from botohe_moo.bounds.ground import Ground
from botohe_moo.bounds.kernels.states import ROUNDING
from botohe_moo.bounds.net import MOST_SLOPES, arcs_by_ends, new_net
from botohe_moo.bounds.prices import Pool, most_levels
from botohe_moo.bounds.relaxation import BYTES_A_LABEL, FIRST_BITS, LEVELS, MOST_LABELS, Relaxation
from botohe_moo.bounds.schedule import Known, Schedule
from botohe_moo.core.world import CHECKING, World
from botohe_moo.mission.model import Mission

# As in ``ground``, these constants were chosen by experiment.

# Shares of the time limit.
_EXACT_SHARE = 0.05  # for the true front
_EXACT_SECONDS = 10.0  # at most: missions of the library that are solved at all take 5 or less
_SEARCH_SHARE = 0.05  # to find trails
# What work is counted as, on a usual processor.
_PORTIONS_A_SECOND = 50  # of the search for the true front
_SECONDS_A_STOP = 5e-9  # to evaluate a plan, for each node and robot
_EVALUATIONS = 100_000  # plans that the search for trails evaluates at most
_LEAST_LEVELS, _MOST_LEVELS = 4, 12  # of prices
_MOST_PRICES = 400  # of the linear programme
_MOST_CONFIGURATIONS = 6_000  # of a team's levels, all of which are looked at for each node
_LABELS_SHARE, _MASKS_SHARE = 0.2, 0.2  # of the memory
_BYTES_A_MASK = 4.0
_BYTES_A_LINK = 40.0  # two integers of 8 bytes, a flag and a figure, and some while they are found
_MIB = 2**20
NOTE = "Robots are bounded as if each were the best of all kinds, and rewards counted on arrival."


class Proof:
    """Proves a bound on the front of ``bounded``; a plain ``mission`` has all of its plans."""

    def __init__(
        self,
        mission: Mission,
        world: World,
        *,
        bounded: Mission | None = None,
        seed: int,
        memory: float,
        deadline: Deadline,
        n_threads: int,
    ) -> None:
        self.deadline, self._n_threads = deadline, n_threads
        self._mission, self._world, self._memory = mission, world, memory * _MIB
        self._bounded = mission if bounded is None else bounded
        self._random_state = np.random.default_rng(seed)
        # In units in which all reward is about 100: a power of 2, so that nothing is rounded.
        self.unit = 2.0 ** round(math.log2(mission.total_reward / 100 or 1.0))
        self._net = new_net(world, self.unit)
        base_reward = float(world.graph.reward[world.team.start[0]])
        self.known = Known(base_reward, mission.robots)
        self._base_reward = base_reward / self.unit
        self._front: list[Step] = []
        self._notes = [] if self._bounded.is_plain else [NOTE]
        self.ground = self._new_ground(0, 1)
        self.certificate = self.ground.certificate()

    def _new_ground(self, n_bits: int, n_levels: int) -> Ground:
        """Return relaxed trails that remember ``n_bits`` at each node, and no known trails.

        Prices have ``n_levels``.
        """
        net = self._net
        # Bytes for a state in each thread: two tables of what lies ahead with 8 bytes a level, for
        # each slope if there are bridges; and the links.
        per_state = 16.0 * (LEVELS + n_levels + 1)
        if len(net.pieces.of_option) > 0:
            per_state *= MOST_SLOPES
        per_state += _BYTES_A_LINK * max(1.0, net.graph.n_arcs / net.graph.n_nodes)
        a_thread = self._memory / self._n_threads
        fits = int((1.0 - _LABELS_SHARE - _MASKS_SHARE) * a_thread / per_state)
        n_masks = int(_MASKS_SHARE * self._memory / _BYTES_A_MASK)
        n_labels = int(min(MOST_LABELS, _LABELS_SHARE * a_thread / BYTES_A_LABEL))
        given = net, n_bits, self._random_state, self.deadline
        relaxation = Relaxation(*given, fits, n_masks, n_labels)
        pool, robots = Pool(net, n_levels), self._mission.robots
        return Ground(relaxation, pool, robots, self._base_reward, self.unit)

    def find_front(self) -> bool:
        """Take the true front as the bound; return whether a share of the time sufficed for it."""
        mission = self._mission
        seconds = min(_EXACT_SHARE * self.deadline.seconds, _EXACT_SECONDS)
        # The number of calls of ``advance`` decides, unless they take twice as long as usual.
        memory = self._memory / _MIB
        world = self._world.with_limits(self._world.limits.loosened(ROUNDING))
        search = FrontSearch(mission, world, time_limit=2 * seconds, memory_limit=memory)
        n_portions = int(1 + _PORTIONS_A_SECOND * seconds)
        with suppress(TooLargeError):
            while search.plans is None and n_portions > 0:
                search.advance()
                n_portions -= 1
        if search.plans is None:
            return False
        objectives = mission.evaluate(search.plans)  # by ascending E[S]
        # Twice what exact_front regards as equal.
        reward, robots = 2 * CHECKING * mission.total_reward, 2 * CHECKING * mission.robots
        most = (objectives[:, 0] + reward).tolist()
        least = [-math.inf, *(objectives[:-1, 1] + robots).tolist()]
        for moving in range(1, mission.robots + 1):
            stay = mission.robots - moving
            for height, start in zip(most, least, strict=True):
                self._front.append(Step(moving, height, max(start - stay, 0.0), "front"))
        return True

    def run(self, gap: float, callback: Callable[[FrontBound], Any] | None) -> None:
        """Prove until the gap is as small as wanted, or the time is over."""
        if self._prepare():
            given = self.ground, self.certificate, self.known, self.bound, self._n_threads
            Schedule(*given).run(gap, callback)

    def _prepare(self) -> bool:
        """Find trails, and relaxed ones that remember; return False where there is no room."""
        net, mission = self._net, self._mission
        n_nodes = max(1, int((net.graph.reward > 0.0).sum()))
        n_levels = min(max(_MOST_PRICES // n_nodes, _LEAST_LEVELS), _MOST_LEVELS)
        # Half of the memory for two tables of each number of robots.
        fits = int(self._memory / 2 / (16 * n_nodes * mission.robots))
        n_levels = most_levels(mission.robots, n_levels, min(_MOST_CONFIGURATIONS, fits))
        if n_levels == 0:
            self._notes.append(
                "Prices for this number of robots and nodes do not fit into the memory."
            )
            return False
        self.ground = self._new_ground(FIRST_BITS, n_levels)
        if net.max_length < math.inf:
            self._notes.append("Relaxed trails keep the travel budget one arc at a time only.")
        if net.min_survival > 0.0:
            self._notes.append("Relaxed trails keep the survival floor one arc at a time only.")
        self._find_trails()
        return True

    def bound(self) -> FrontBound:
        """Return what has been proved."""
        unit, certificate, notes = self.unit, self.certificate, [*self._notes]
        if self.ground.relaxation.is_full:
            notes.append("Relaxed trails remember less than they would with more memory.")
        own = (line for each in certificate.lines for line, _ in each)
        lines = (line._replace(most=line.most * unit, mu=line.mu * unit) for line in own)
        steps = (step._replace(most=step.most * unit) for step in certificate.steps())
        return FrontBound(
            mission=self._bounded,
            lines=tuple(lines),
            steps=(*self._front, *steps),
            most_survival=self.ground.most_survival,
            min_survival=self._net.min_survival,
            max_length=self._net.max_length,
            seconds=self.deadline.elapsed,
            notes=tuple(notes),
        )

    def _find_trails(self) -> None:
        """Search for plans, and put their trails into the pool."""
        mission, graph = self._mission, self._net.graph
        search = LocalSearch(mission, Costs(self._world), random_state=self._random_state)
        search.insert(mission.batch([mission.stay_home()]))
        seconds = _SECONDS_A_STOP * graph.n_nodes * mission.robots
        search.run(int(min(_EVALUATIONS, 1 + _SEARCH_SHARE * self.deadline.seconds / seconds)))
        batch, objectives, _ = search.plans()
        self.known.add(objectives)
        arcs = arcs_by_ends(graph)
        for trail in {tuple(trail) for plan in batch for trail in plan.trails}:
            way = [arcs.get(pair, -1) for pair in pairwise(trail)]
            if way and min(way) >= 0:
                self.ground.pool.add(way)
