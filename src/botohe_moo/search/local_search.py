"""Pareto local search: arrays and kernels, no pymoo."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray, SeedArray
from botohe_moo.kernels.fronts.ordered import copy_front, has_room, new_front, read_front
from botohe_moo.kernels.graph.graph import Graph, with_costs
from botohe_moo.kernels.local_search.admission import Given
from botohe_moo.kernels.local_search.moves import N_KINDS
from botohe_moo.kernels.local_search.routes import FULL_UP_TO, new_routes
from botohe_moo.kernels.local_search.search import search
from botohe_moo.kernels.local_search.trail_store import copy_trails, fits, new_store, pieces
from botohe_moo.kernels.local_search.workspace import SearchRule, new_memory, new_workspace
from botohe_moo.kernels.rng import draw_state
from botohe_moo.mission.model import Mission
from botohe_moo.trails import PlanBatch

# Names of the moves, in the order in which the kernels number them.
MOVES = ("shortcut", "visit", "visit-two", "splice", "graft", "swap-loops", "reverse", "adopt")

# How likely each is to be drawn: `make bench` shows what each is good for.
DEFAULT_MOVES: Mapping[str, float] = {
    "shortcut": 0.07,
    "visit": 0.18,
    "visit-two": 0.11,
    "splice": 0.25,
    "graft": 0.25,
    "swap-loops": 0.02,
    "reverse": 0.06,
    "adopt": 0.1,
}

# What the length of the longest arc costs, at most.
_MOST_COST = 1e12

_FIRST_PLANS = 256


class LocalSearch:
    """A front, and the search that improves it.

    ``moves`` says how likely each move is to be drawn, by its name in ``MOVES``; those left out are
    not. The search's own generator takes its seed from ``random_state``. After each call the front
    keeps ``max_size`` plans at most, at least 2; None keeps all.
    """

    def __init__(
        self,
        mission: Mission,
        rule: SearchRule,
        *,
        moves: Mapping[str, float],
        random_state: np.random.Generator,
        max_size: int | None = None,
    ) -> None:
        self.mission = mission
        small = len(mission.nodes) <= FULL_UP_TO
        self.rule = rule if small else rule._replace(p_refill=0.0)
        self.max_size = max_size
        self.tally: OffsetArray = np.zeros((2, N_KINDS), np.int64)
        self._weights: FloatArray = np.cumsum([float(moves.get(name, 0.0)) for name in MOVES])
        self._states: SeedArray = draw_state(random_state)
        self._memory = new_memory()
        self._front = new_front(_FIRST_PLANS, mission.robots)
        self._store = self._new_store(0, 0, 0)
        self._prepare()

    def _prepare(self) -> None:
        """Make what follows from the mission, or holds nothing between two calls."""
        self._graph, per_length = _priced(self.mission.arrays, self.rule)
        graph = self._graph
        self._routes = new_routes(graph, per_length)
        self._work = new_workspace(
            graph,
            self.mission.robots,
            memory=self._memory[0],
            tally=self.tally,
            states=self._states,
            weights=self._weights,
        )

    def restart(self) -> None:
        """Forget all plans, but not the random numbers."""
        memory = self._memory[0]
        memory.newest, memory.idle = -1.0, 0
        self._front = new_front(*self._front.plan.shape)
        store = self._store
        self._store = new_store(len(store.trails), len(store.arc), len(store.node))

    def admit(self, batch: PlanBatch) -> None:
        """Put valid plans for the mission's team into the front that it does not dominate."""
        self._search(batch, len(batch))

    def run(self, n_evaluations: int) -> int:
        """Search from the plans of the front, of which there must be one.

        Gives how many plans were evaluated: fewer than ``n_evaluations`` where no move makes any
        other plan.
        """
        if self.mission.arrays.n_arcs == 0:  # kernels draw arcs and nodes, and look for none before
            return 0
        return self._search(None, n_evaluations)

    def _search(self, batch: PlanBatch | None, n_evaluations: int) -> int:
        n, n_robots = 0, self.mission.robots
        while n < n_evaluations:
            self._make_room()
            given = Given(np.empty(0, np.int32), np.zeros(1, np.int64))
            if batch is not None:
                given = Given(batch.nodes.copy(), batch.offsets[n * n_robots :].copy())
            n += search(
                self._graph,
                self._routes,
                self._store,
                self._front,
                self._work,
                self.rule,
                given,
                n_evaluations - n,
            )
            if n < n_evaluations and self._has_room():
                break
        if self.max_size is not None and len(self) > self.max_size:
            slots, objectives = read_front(self._front)
            self._keep(slots[_most_contributing(objectives, self.max_size)])
        return n

    def __len__(self) -> int:
        return int(self._front.n.plans)

    @property
    def version(self) -> int:
        """Changes whenever the front does: the number of plans that ever entered."""
        return int(self._front.n.entered)

    def objectives(self) -> FloatArray:
        """Give E[R] and E[S] of the front, by descending E[R] (n_plans, 2), without its plans."""
        return read_front(self._front)[1]

    def plans(self) -> tuple[PlanBatch, FloatArray, OffsetArray]:
        """Give the front by descending E[R].

        Its plans, their E[R] and E[S] (n_plans, 2), and how many plans had entered before each.
        """
        front, store, graph = self._front, self._store, self.mission.arrays
        slots, objectives = read_front(front)
        used, which = np.unique(front.plan[slots], return_inverse=True)  # many plans share trails
        trails = store.trails[used]
        _, *ways = pieces(store.arc, trails["first_arc"], trails["n_arcs"])
        walked = [np.append(graph.base, graph.head[way]).astype(np.int32) for way in ways]
        which = which.ravel()
        nodes = np.concatenate([np.empty(0, np.int32), *(walked[i] for i in which.tolist())])
        offsets = np.append(0, np.cumsum(trails["n_arcs"][which] + 1))
        batch = PlanBatch._wrap(nodes, offsets, self.mission.robots)
        return batch, objectives, front.serial[slots]

    @property
    def _most_new(self) -> int:
        return max(self.rule.most_new, self.mission.robots)

    def _has_room(self) -> bool:
        stored = fits(self.mission.arrays, self._store, self._most_new)
        return stored and has_room(self._front, self.rule.most_new)

    def _make_room(self) -> None:
        """Copy what is in use to where there is room for as much more, if room is wanting."""
        if not self._has_room():
            self._keep(read_front(self._front)[0])

    def _keep(self, slots: OffsetArray) -> None:
        """Copy plans of some slots of the front, and their trails, to where there is more room."""
        front, store = self._front, self._store
        users = np.bincount(front.plan[slots].ravel(), minlength=len(store.trails))
        store.trails["n_users"] = users
        used = np.flatnonzero(users)
        lengths, visits = (int(store.trails[name][used].sum()) for name in ("n_arcs", "n_visits"))
        n_trails = max(int(used.max(initial=0)) + 1, 2 * len(used))
        self._store = self._new_store(n_trails, 4 * lengths, 4 * visits)
        copy_trails(store, self._store)
        self._front = copy_front(front, slots, 2 * len(slots) + self.rule.most_new + _FIRST_PLANS)

    def _new_store(self, n_trails: int, n_arcs: int, n_visits: int) -> Any:
        graph, n_new = self.mission.arrays, 2 * self._most_new
        return new_store(
            n_trails + 4 * n_new + 1_000,
            n_arcs + n_new * graph.n_arcs,
            n_visits + n_new * graph.n_nodes,
        )

    def __getstate__(self) -> dict[str, Any]:
        derived = ("_graph", "_routes", "_work")
        return {key: value for key, value in vars(self).items() if key not in derived}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._prepare()


def _priced(graph: Graph, rule: SearchRule) -> tuple[Graph, float]:
    """Let lengths add to the costs of arcs where there is a travel budget, and say how much.

    Paths that are cheapest then are neither the safest nor the shortest: a whole budget costs as
    much as all the danger that the survival floor allows, or as a survival of 1 / e without one. A
    budget that is far shorter than the longest arc costs less, so that all costs are finite.
    """
    if rule.max_length == math.inf:
        return graph, 0.0
    danger = -math.log(rule.min_survival) if 0.0 < rule.min_survival < 1.0 else 1.0
    longest = float(graph.length.max(initial=0.0)) or 1.0
    per_length = min(danger / max(rule.max_length, 1e-300), _MOST_COST / longest)
    return with_costs(graph, graph.cost + per_length * graph.length), per_length


def _most_contributing(objectives: FloatArray, n_most: int) -> OffsetArray:
    """Leave out plans, each time that which contributes the least area; the ends stay."""
    kept = np.arange(len(objectives))
    while len(kept) > n_most:
        reward, survivors = objectives[kept].T
        area = (reward[:-2] - reward[2:]) * (survivors[2:] - survivors[:-2])
        kept = np.delete(kept, np.argmin(area) + 1)
    return kept
