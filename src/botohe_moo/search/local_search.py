"""Pareto local search: arrays and kernels, no pymoo."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.graph.old_paths import nearest
from botohe_moo.kernels.local_search.front import (
    N_ENTERED,
    N_PLANS,
    Front,
    clear_front,
    has_room,
    new_front,
    read_front,
)
from botohe_moo.kernels.local_search.members import admit, thin, write_plans
from botohe_moo.kernels.local_search.moves import N_KINDS
from botohe_moo.kernels.local_search.parent import Ground, new_workspace
from botohe_moo.kernels.local_search.routes import Routes, new_routes
from botohe_moo.kernels.local_search.rule import (
    CREDIT,
    N_REMEMBERED,
    NEWEST,
    NOBODY,
    Reserve,
    SearchRule,
    most_new,
)
from botohe_moo.kernels.local_search.search import search
from botohe_moo.kernels.local_search.trail_store import (
    TrailStore,
    clear_store,
    copy_trails,
    fits,
    new_store,
)
from botohe_moo.kernels.rng import draw_state, hash_keys
from botohe_moo.mission.model import Mission
from botohe_moo.trails import PlanBatch

__all__ = ["DEFAULT_MOVES", "MOVES", "LocalSearch"]

# Names of the moves, in the order in which the kernels number them.
MOVES = (
    "shortcut",
    "visit",
    "visit-two",
    "splice",
    "graft",
    "swap-loops",
    "reverse",
    "adopt",
)

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

_N_NEAR = 12
_SMALL = 64  # nodes of missions on which best responses are searched for
_FIRST_PLANS = 256
_MOST_ALONE = 1_024


class LocalSearch:
    """A front, and the search that improves it.

    Parameters
    ----------
    mission
        What to plan for.
    rule
        How to search.
    moves
        How likely each move is to be drawn, by its name in ``MOVES``; those left out are not.
    reserve_size
        Plans in the reserve, at least 1.
    random_state
        Where the search's own generator takes its seed from.
    """

    def __init__(
        self,
        mission: Mission,
        rule: SearchRule,
        *,
        moves: Mapping[str, float],
        reserve_size: int,
        random_state: np.random.Generator,
    ) -> None:
        self.mission = mission
        self.rule = rule
        self.tally: FloatArray = np.zeros((2, N_KINDS))
        self._weights = np.cumsum([float(moves.get(name, 0.0)) for name in MOVES])
        self._states: SeedArray = draw_state(random_state)
        self._remembered: FloatArray = np.empty(N_REMEMBERED)
        self._reserve = Reserve(
            np.full((reserve_size, mission.robots), NOBODY, np.int32), np.zeros(reserve_size)
        )
        self._front = new_front(_FIRST_PLANS, mission.robots)
        self._remember_nothing()
        self._prepare()
        self._store = self._larger_store(None)

    def _prepare(self) -> None:
        """Make what follows from the mission, or holds nothing between two calls."""
        self._ground = _ground(self.mission)
        self._routes = _routes(self.mission)
        self._work = new_workspace(self._ground, self.mission.robots)
        # The search looks for room there only after all children of a parent.
        self._alone = new_front(max(_MOST_ALONE, most_new(self.rule) + 1), 1)

    def _remember_nothing(self) -> None:
        self._remembered[:] = 0.0
        self._remembered[NEWEST] = -1.0
        self._remembered[CREDIT] = -self.rule.hops_each * self.rule.n_first

    def admit(self, batch: PlanBatch) -> None:
        """Put plans into the front that it does not dominate.

        Parameters
        ----------
        batch
            Valid plans for the mission's team.
        """
        n_robots = self.mission.robots
        for i in range(len(batch)):
            self._make_room(n_robots)  # trails; there is room for a plan, too
            offsets = batch.offsets[i * n_robots : (i + 1) * n_robots + 1]
            admit(self._ground, self._store, self._front, self._work, batch.nodes, offsets)
        thin(self._store, self._front, self.rule.max_size, self._states)

    def restart(self) -> None:
        """Forget all plans, but not the random numbers."""
        self._remember_nothing()
        self._reserve.plan[:] = NOBODY
        clear_front(self._front)
        clear_store(self._store)

    def run(self, n_evaluations: int) -> int:
        """Search; the front must hold a plan.

        Parameters
        ----------
        n_evaluations
            How many plans to evaluate.

        Returns
        -------
        int
            How many were: fewer where no move makes any other plan.
        """
        n = 0
        if len(self._ground.head) == 0:  # kernels draw arcs and nodes, and look for none before
            return n
        while n < n_evaluations:
            self._make_room(most_new(self.rule))
            n += search(
                self._ground,
                self._routes,
                self._store,
                self._front,
                self._reserve,
                self._alone,
                self._work,
                self.rule,
                self._weights,
                self.tally,
                self._remembered,
                n_evaluations - n,
                self._states,
            )
            if n < n_evaluations and self._has_room(most_new(self.rule)):
                break
        return n

    def __len__(self) -> int:
        return int(self._front.counts[N_PLANS])

    @property
    def version(self) -> int:
        """Changes whenever the front does: the number of plans that ever entered."""
        return int(self._front.counts[N_ENTERED])

    def objectives(self) -> FloatArray:
        """Give E[R] and E[S] of the front, by descending E[R] (n_plans, 2), without its plans."""
        objectives = np.empty((len(self), 2))
        read_front(self._front, np.empty(len(self), np.int32), objectives)
        return objectives

    def plans(self) -> tuple[PlanBatch, FloatArray, OffsetArray]:
        """Give the front: its plans by descending E[R], their objectives, and a number for each.

        Returns
        -------
        tuple
            The plans; E[R] and E[S] (n_plans, 2); and how many plans had entered before each.
        """
        front, store, n_robots = self._front, self._store, self.mission.robots
        slots, objectives = np.empty(len(self), np.int32), np.empty((len(self), 2))
        read_front(front, slots, objectives)
        lengths = store.n_arcs[front.plan[slots]]
        nodes = np.empty(int(lengths.sum()) + lengths.size, np.int32)
        offsets = np.zeros(lengths.size + 1, np.int64)
        write_plans(self._ground, store, front, slots, nodes, offsets)
        return PlanBatch._wrap(nodes, offsets, n_robots), objectives, front.serial[slots]

    def _has_room(self, n_trails: int) -> bool:
        ground = self._ground
        return bool(
            fits(self._store, n_trails, len(ground.head), ground.most_visits)
            and has_room(self._front, n_trails)
        )

    def _make_room(self, n_trails: int) -> None:
        if self._has_room(n_trails):
            return
        if not has_room(self._front, n_trails):
            self._front = _larger_front(self._front, n_trails)
        if not self._has_room(n_trails):
            self._store = self._larger_store(self._store)

    def _larger_store(self, store: TrailStore | None) -> TrailStore:
        """Copy the trails in use to where there is room for as many more."""
        ground, rule = self._ground, self.rule
        n_arcs, most_visits = len(ground.head), ground.most_visits
        n_new = max(most_new(rule), self.mission.robots)
        used = np.zeros(0, np.int64) if store is None else np.flatnonzero(store.n_users)
        arcs = visits = 0
        if store is not None:
            arcs, visits = int(store.n_arcs[used].sum()), int(store.n_visits[used].sum())
        highest = int(used[-1]) + 1 if len(used) else 0
        larger = new_store(
            max(highest, 2 * len(used)) + 8 * n_new + 1_000,
            2 * arcs + 2 * n_new * n_arcs,
            2 * visits + 2 * n_new * most_visits,
            len(ground.reward),
        )
        if store is not None:
            copy_trails(store, larger)
        return larger

    def __getstate__(self) -> dict[str, Any]:
        derived = ("_ground", "_routes", "_work", "_alone")
        return {key: value for key, value in self.__dict__.items() if key not in derived}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._prepare()


def _ground(mission: Mission) -> Ground:
    arrays = mission.arrays
    n_nodes = arrays.n_nodes
    cost = -np.log(arrays.survival) + 0.0
    n_near = min(_N_NEAR, n_nodes - 1)
    near: IntArray = np.empty((n_nodes, n_near), np.int32)
    nearest(arrays.first, arrays.head, cost, arrays.survival, near, np.empty((n_nodes, n_near)))
    # Arcs ascend by tail and head, so that the pairs are sorted.
    there = arrays.tail.astype(np.int64) * n_nodes + arrays.head
    back = arrays.head.astype(np.int64) * n_nodes + arrays.tail
    found = np.minimum(np.searchsorted(there, back), max(0, len(there) - 1))
    reverse = np.where(there[found] == back, found, -1).astype(np.int32)
    by_return, return_reach = _by_return(mission)
    return Ground(
        first=arrays.first,
        tail=arrays.tail,
        head=arrays.head,
        survival=arrays.survival,
        cost=cost,
        reverse=reverse,
        reward=arrays.reward,
        near=near,
        home=mission.walk.home,
        by_return=by_return,
        return_reach=return_reach,
        key=hash_keys(2 * n_nodes),
        base=arrays.base,
        most_visits=int((arrays.reward > 0).sum()),
    )


def _by_return(mission: Mission) -> tuple[IntArray, FloatArray]:
    """For each node of a small mission those with a reward, by the safest visit and way home."""
    arrays, n_nodes = mission.arrays, mission.arrays.n_nodes
    if n_nodes > _SMALL:
        return np.empty((0, 0), np.int32), np.empty((0, 0))
    reach = np.eye(n_nodes)
    reach[arrays.tail, arrays.head] = arrays.survival
    for via in range(n_nodes):  # Floyd and Warshall's algorithm, for products
        np.maximum(reach, reach[:, via, np.newaxis] * reach[via], out=reach)
    rewarding = np.flatnonzero(arrays.reward > 0)
    visit_and_return = reach[:, rewarding] * mission.walk.home[rewarding]
    by_return = rewarding[np.argsort(-visit_and_return, axis=1, kind="stable")]
    return by_return.astype(np.int32), np.take_along_axis(reach, by_return, axis=1)


def _routes(mission: Mission) -> Routes:
    walk = mission.walk
    homeward = walk.homeward - (walk.homeward > walk.loop)  # arcs without the self-loop
    return new_routes(mission.arrays.head, homeward.astype(np.int32))


def _larger_front(front: Front, n_more: int) -> Front:
    """Copy a front to where there is room for twice as many plans."""
    n_slots, n_robots = front.plan.shape
    larger = new_front(2 * n_slots + n_more, n_robots)
    for name in ("directory", "size", "slot", "reward", "survivors", "plan", "serial", "tried"):
        getattr(larger, name)[: len(getattr(front, name))] = getattr(front, name)
    counts = larger.counts
    for name, which in (("spare_blocks", 1), ("spare_slots", 2)):
        old, new = getattr(front, name), getattr(larger, name)
        n_spare, n_new = int(front.counts[which]), len(new) - len(old)
        # The highest numbers are at the bottom of the stack: the new ones, then the old.
        new[n_new : n_new + n_spare] = old[:n_spare]
        counts[which] = n_new + n_spare
    for which in (0, 3, 4):
        counts[which] = front.counts[which]
    return larger
