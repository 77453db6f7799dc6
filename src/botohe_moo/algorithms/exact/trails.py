"""All trails that the exact front may need, found a portion at a time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from botohe_moo.algorithms.exact import labels
from botohe_moo.algorithms.exact.labels import TrailTable
from botohe_moo.base.types import FloatArray, Record
from botohe_moo.core.world import World, read_only

_ROWS = 1024  # that tables have room for at first


def without_base_reward(world: World) -> World:
    """Return a plain mission's world without the reward of its base, which all plans collect."""
    reward = world.graph.reward.copy()
    reward[world.team.start[0]] = 0.0
    graph, team = world.graph._replace(reward=reward), world.team._replace(reward=reward)
    return read_only(world._replace(graph=graph, team=team))


class TrailSearch:
    """The search for all trails of a plain mission that a best team may need.

    Every trail keeps the limits of ``world``, whose base has no reward.
    """

    def __init__(self, world: World) -> None:
        self._search = labels.new_search(world, _ROWS)

    @property
    def progress(self) -> Record:
        """How many partial trails (``n_labels``) and trails that teams may need it has found.

        It goes on from label ``next``.
        """
        return self._search.progress[0]

    @property
    def reward(self) -> FloatArray:
        """The reward of each goal, or for one robot, whose trails have shares of it, all reward."""
        reward = self._search.reward
        return reward if self._search.world.n_robots > 1 else np.array([reward.sum()])

    @property
    def n_bytes(self) -> int:
        """The size of the tables in bytes."""
        return labels.n_bytes(self._search.labels, self._search.trails)

    def found(self) -> tuple[FloatArray, FloatArray]:
        """Return the survivals of trails, and the probabilities that they reach each goal.

        Survivals descend once the search has ended. For one robot, shares of reward take the place
        of the probabilities.
        """
        trails, n = self._search.trails, self.progress.n_trails
        return trails.rows["survives"][:n].copy(), trails.reached[:n].copy()

    def advance(self, n_looks: int, require: Callable[[int], None]) -> bool:
        """Go on from ``n_looks`` labels at most; return whether all trails are known.

        Before memory is taken, ``require`` is called with the number of bytes. In the end trails
        are sorted by descending survival, without those that another is as good as.
        """
        search, progress = self._search, self.progress
        if labels.grow(search, n_looks):
            require(self.n_bytes)
            larger = labels.doubled(search.labels)
            self._search = search._replace(labels=larger, trails=labels.doubled(search.trails))
        if progress.next < progress.n_labels:
            return False
        n, others = progress.n_trails, TrailTable(*[column.copy() for column in search.trails])
        total = sum(others.reached[:n].T, np.zeros(n))
        progress.n_trails = 0
        # Of trails that survive alike, one that another is as good as comes after it.
        labels.add_trails(search, others, np.lexsort((-total, -others.rows["survives"][:n])))
        return True

    def trail(self, row: int) -> list[int]:
        """Return a trail of the table as nodes."""
        search, table = self._search, self._search.labels
        graph, paths = search.world.graph, search.paths
        label, arc, _ = search.trails.rows[row].tolist()
        home = [int(search.world.team.start[0])]
        if label < 0:
            return home
        search.used[:] = [labels.has(table.used[label], i) for i in range(graph.n_arcs)]
        search.used[arc] = 1
        last = table.rows[self.progress.n_labels]
        last.length, last.node = table.rows.length[label] + graph.length[arc], graph.head[arc]
        labels.look_around(search)
        while (entry := paths.entry[home[-1]]) >= 0:
            home.append(int(graph.tail[entry]))
        out: list[int] = []
        while label >= 0:
            label, node, *_ = table.rows[label].tolist()
            out.append(node)
        return out[::-1] + home[::-1]
