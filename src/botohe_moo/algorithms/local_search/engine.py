"""Pareto local search: arrays and kernels, no pymoo."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray, SeedArray
from botohe_moo.algorithms.local_search.kernels.exchange import News, gather_news, take_over
from botohe_moo.algorithms.local_search.kernels.refill import refill
from botohe_moo.algorithms.local_search.kernels.routes import FULL_UP_TO, new_routes, search_all
from botohe_moo.algorithms.local_search.kernels.search import has_room, improve
from botohe_moo.algorithms.local_search.kernels.trail_store import (
    TrailStore,
    copy_trails,
    new_store,
    ragged,
)
from botohe_moo.algorithms.local_search.kernels.workspace import (
    MEMORY,
    N_CHILDREN,
    REFILLED_AT_ONCE,
    REFILLED_IN_LANES,
    Search,
    new_workspace,
)
from botohe_moo.core.apart import apart
from botohe_moo.core.graph import Graph, Limits, with_costs
from botohe_moo.core.ordered import copy_front, new_front, read_front
from botohe_moo.core.rng import draw_state
from botohe_moo.core.trails import read_trails
from botohe_moo.mission.model import Mission
from botohe_moo.trails import PlanBatch

# Names of the moves, in the order in which the kernels number them.
MOVES = ("shortcut", "visit", "visit-two", "splice", "graft", "swap-loops", "reverse", "adopt")

# How likely each move is to be drawn; `make bench` shows what each is good for.
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

# On its n-th turn as a parent a plan is refilled with probability 1 / n², but never less than this.
_P_REFILL = 0.02
# Nodes times robots: with more, refills take more time than they bring (results/refills).
_REFILLED_UP_TO = 1_000

# The most that the length of the longest arc costs, and the least budget to divide by.
_MOST_COST, _LEAST_LENGTH = 1e12, 1e-300

# How many plans the front has room for at first, and how many plans a parent adds at most.
_FIRST_PLANS, _N_ADDED = 256, N_CHILDREN + 1


class LocalSearch:
    """A front, and the search that improves it.

    Every robot keeps the ``limits``. On missions of up to ``FULL_UP_TO`` nodes a parent is refilled
    with at least probability ``p_refill``, whose default depends on the mission. ``moves`` says how
    likely each move is to be drawn, by its name in ``MOVES``; those left out never are. The
    search's own generator takes its seed from ``random_state``. After each call the front keeps at
    most ``max_size`` plans, 2 or more; None keeps all.
    """

    def __init__(
        self,
        mission: Mission,
        limits: Limits,
        *,
        random_state: np.random.Generator,
        moves: Mapping[str, float] = DEFAULT_MOVES,
        p_refill: float | None = None,
        max_size: int | None = None,
    ) -> None:
        self.mission = mission
        self.limits = limits
        self.max_size = max_size
        n_nodes = mission.arrays.n_nodes
        if p_refill is None:
            size = len(mission.nodes) * mission.robots
            p_refill = _P_REFILL if size <= _REFILLED_UP_TO else 0.0
        self._p_refill = p_refill if n_nodes <= FULL_UP_TO else 0.0
        self._weights: FloatArray = np.cumsum([float(moves.get(name, 0.0)) for name in MOVES])
        self._states: SeedArray = draw_state(random_state)
        # An array, since numpy writes to a copy of a record alone, once it is unpickled.
        self._memory = np.array([(-1.0, 0, 0, REFILLED_AT_ONCE)], MEMORY).view(np.recarray)
        self._waiting = np.zeros(REFILLED_AT_ONCE)
        self._front = new_front(_FIRST_PLANS, mission.robots)
        self._store = self._new_store(0, 0, 0)
        self._prepare()

    def _prepare(self) -> None:
        """Compute what is not pickled: what follows from the mission, and scratch."""
        kept = self._memory, self._waiting, self._states, self._front, self._store
        self._memory, self._waiting, self._states, self._front, self._store = apart(kept)
        self._graph, per_length = _priced(self.mission.arrays, self.limits)
        self._routes = new_routes(self._graph, per_length)
        self._work = new_workspace(
            self._graph,
            self.mission.robots,
            memory=self._memory[0],
            waiting=self._waiting,
            states=self._states,
            weights=self._weights,
        )

    @property
    def parts(self) -> Search:
        """What the kernels work with."""
        return Search(
            graph=self._graph,
            routes=self._routes,
            store=self._store,
            front=self._front,
            work=self._work,
            limits=self.limits,
            p_refill=self._p_refill,
        )

    def refill_sooner(self) -> None:
        """Let fewer plans wait until they are refilled, as it is best for searches side by side."""
        self._memory[0].most_waiting = REFILLED_IN_LANES

    def restart(self) -> None:
        """Forget all plans, but not the random numbers."""
        memory = self._memory[0]
        memory.newest, memory.idle, memory.n_waiting = -1.0, 0, 0
        self._front = new_front(*self._front.plan.shape)
        store = self._store
        self._store = new_store(len(store.trails), len(store.arc), len(store.node))

    def share_routes(self, others: Iterable[LocalSearch]) -> None:
        """Search all safest paths, and let others that search the same mission read them.

        Then these stay in the caches of processors, and in memory once.
        """
        search_all(self._graph, self._routes, self._p_refill > 0.0)
        for other in others:
            own = other._routes.paths
            other._routes = self._routes._replace(paths=own)

    def insert(self, batch: PlanBatch) -> None:
        """Insert valid plans for the mission's team into the front, unless it dominates them."""
        self._search(batch, len(batch))

    def run(self, n_evaluations: int) -> int:
        """Search from the plans of the front, of which there must be one.

        Returns how many plans were evaluated: fewer than ``n_evaluations`` where no move makes any
        other plan.
        """
        if self.mission.arrays.n_arcs == 0:  # the kernels rely on arcs to draw from
            return 0
        return self._search(None, n_evaluations)

    def _search(self, batch: PlanBatch | None, n_evaluations: int) -> int:
        """Evaluate the plans of a batch, or search on; return how many plans were evaluated."""
        n, n_robots = 0, self.mission.robots
        given = read_trails(np.empty(0, np.int32), np.zeros(1, np.int64))
        while n < n_evaluations:
            if batch is not None:
                given = read_trails(batch.nodes, batch.offsets[n * n_robots :].copy())
            found = improve(self.parts, given, n_evaluations - n)
            are_waiting = batch is None and self.n_waiting >= self._memory[0].most_waiting
            if are_waiting:
                found += refill(self.parts, n_evaluations - n - found)
            n += found
            if found == 0 and not has_room(self.parts):
                self._keep(read_front(self._front)[0])
            elif found == 0 and not are_waiting:  # no move makes another plan
                break
        self._trim()
        return n

    @property
    def n_waiting(self) -> int:
        """How many plans wait to be refilled."""
        return int(self._memory[0].n_waiting)

    def __len__(self) -> int:
        return int(self._front.n.plans)

    @property
    def version(self) -> int:
        """How many plans ever entered the front: changes whenever the front does."""
        return int(self._front.n.entered)

    def objectives(self) -> FloatArray:
        """Return E[R] and E[S] of the front, by descending E[R] (n_plans, 2), without its plans."""
        return read_front(self._front)[1]

    def plans(self) -> tuple[PlanBatch, FloatArray, OffsetArray]:
        """Return the front by descending E[R].

        Its plans, their E[R] and E[S] (n_plans, 2), and how many plans had entered before each.
        """
        front, store, graph = self._front, self._store, self.mission.arrays
        slots, objectives = read_front(front)
        trails = store.trails[front.plan[slots].ravel()]
        offsets = np.append(0, np.cumsum(trails["n_arcs"] + 1))
        nodes = np.full(offsets[-1], graph.base, np.int32)
        is_head = np.ones(len(nodes), bool)
        is_head[offsets[:-1]] = False
        if graph.kinds is not None:
            nodes[offsets[:-1]] = np.tile(graph.kinds.start, len(slots))
        nodes[is_head] = graph.head[store.arc[ragged(trails["first_arc"], trails["n_arcs"])]]
        batch = PlanBatch._wrap(nodes, offsets, self.mission.robots)
        return batch, objectives, front.serial[slots]

    def news(self, since: int) -> News:
        """Return those plans of the front before which ``since`` plans or more had entered.

        Beside them are turns of other plans as parents, which are taken away here: they count again
        once :meth:`take_over` is called with the same news.
        """
        return gather_news(self.parts, since)

    def take_over(self, news: News) -> None:
        """Insert what searches for the same mission, within the same limits, have found.

        This search's own news have to be among them.
        """
        n = 0
        while (n := take_over(self.parts, news, n)) < len(news.reward):
            self._keep(read_front(self._front)[0])
        self._trim()

    def _trim(self) -> None:
        """Keep only as many plans as the front may have."""
        if self.max_size is not None and len(self) > self.max_size:
            slots, objectives = read_front(self._front)
            self._keep(slots[_most_contributing(objectives, self.max_size)])

    def _keep(self, slots: OffsetArray) -> None:
        """Keep only the plans of some slots of the front; make room for twice as many."""
        front, store = self._front, self._store
        users = np.bincount(front.plan[slots].ravel(), minlength=len(store.trails))
        store.trails["n_users"] = users
        used = np.flatnonzero(users)
        n_arcs, n_visits = (int(store.trails[name][used].sum()) for name in ("n_arcs", "n_visits"))
        n_trails = max(int(used.max(initial=0)) + 1, 2 * len(used))
        self._store = self._new_store(n_trails, 4 * n_arcs, 4 * n_visits)
        copy_trails(store, self._store)
        self._front = copy_front(front, slots, 2 * len(slots) + _N_ADDED + _FIRST_PLANS)

    def _new_store(self, n_trails: int, n_arcs: int, n_visits: int) -> TrailStore:
        """Return a store with this room, and room for the trails of a few parents' children."""
        graph = self.mission.arrays
        n_new = 2 * max(_N_ADDED, self.mission.robots)
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


def _priced(graph: Graph, limits: Limits) -> tuple[Graph, float]:
    """Return the graph with costs of arcs, and what a unit of length adds to these.

    Without a travel budget, costs are dangers: −log of survivals. With one, lengths cost as well,
    so that the cheapest paths compromise between the safest and the shortest ones. The whole budget
    costs as much as all the danger that the survival floor allows, or as a survival of 1 / e
    without a floor. A budget that is far shorter than the longest arc costs less, so that all costs
    are finite.
    """
    if limits.max_length == math.inf:
        return graph, 0.0
    danger = -math.log(limits.min_survival) if 0.0 < limits.min_survival < 1.0 else 1.0
    longest = float(graph.length.max(initial=0.0)) or 1.0
    per_length = min(danger / max(limits.max_length, _LEAST_LENGTH), _MOST_COST / longest)
    return with_costs(graph, graph.cost + per_length * graph.length), per_length


def _most_contributing(objectives: FloatArray, n_most: int) -> OffsetArray:
    """Return which plans stay, by index, when the one of least area is removed again and again.

    Areas are those of the rectangles between a plan's two neighbours; both ends stay.
    """
    kept = np.arange(len(objectives))
    while len(kept) > n_most:
        reward, survivors = objectives[kept].T
        area = (reward[:-2] - reward[2:]) * (survivors[2:] - survivors[:-2])
        kept = np.delete(kept, np.argmin(area) + 1)
    return kept
