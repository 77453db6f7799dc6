"""All trails that the exact front may need, and an estimate of how many labels it takes."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable
from itertools import pairwise

import numpy as np

from botohe_moo._base.types import FloatArray, Record
from botohe_moo.algorithms.exact.kernels import tables
from botohe_moo.algorithms.exact.kernels.labels import has, look_around
from botohe_moo.algorithms.exact.kernels.trails import add_trails, as_column, grow
from botohe_moo.core.graph import Graph, Limits, find_arc
from botohe_moo.core.paths import new_budget
from botohe_moo.core.rng import hash_keys
from botohe_moo.mission.model import Mission

_ROWS = 1024  # that tables have room for at first
# An estimate ends after as many descents, or when they have met as many labels.
_MAX_DIVES, _MAX_MET = 1_000, 30_000


class TrailSearch:
    """The search for all trails of a mission that a best team may need, a portion at a time.

    Every trail keeps the limits. Trails that a ``known`` one is as good as need not be found.
    """

    def __init__(
        self, mission: Mission, limits: Limits, known: Iterable[tuple[int, ...]] = ()
    ) -> None:
        self.graph = graph = mission.arrays
        self.rule = _rule_of(graph, mission.robots == 1, limits)
        self._search = tables.new_search(graph, self.rule, _ROWS)
        self._known = [(graph.base,), *(trail for trail in known if trail != (graph.base,))]
        self._add_known()
        self._n_tidy = self.progress.n_trails

    def _add_known(self) -> None:
        """Put known trails into the table; their labels are −1, −2, ... in the order given."""
        search, n = self._search, 0
        others = tables.new_trails(_ROWS, search.trails.reached.shape[1])
        for n, trail in enumerate(self._known[:_ROWS], 1):
            survives, reached = self.follow(trail)
            others.rows[n - 1] = -n, -1, survives
            as_column(self.rule, reached, others.reached[n - 1])
        add_trails(search.trails, search.progress, others, np.arange(n))

    @property
    def progress(self) -> Record:
        """How many partial trails (``n_labels``) and trails that teams may need it has found.

        It goes on from label ``next``.
        """
        return self._search.progress[0]

    @property
    def n_bytes(self) -> int:
        """The size of the tables in bytes."""
        return tables.n_bytes(self._search.labels) + tables.n_bytes(self._search.trails)

    @property
    def n_label_bytes(self) -> int:
        """The size of a partial trail in bytes."""
        return tables.n_bytes(self._search.labels) // len(self._search.labels.rows)

    def found(self) -> tuple[FloatArray, FloatArray]:
        """Return the survivals of known trails, and the probabilities that they reach each goal.

        Survivals descend once the search has ended. For one robot, shares of reward take the place
        of the probabilities.
        """
        trails, n = self._search.trails, self.progress.n_trails
        return trails.rows["survives"][:n].copy(), trails.reached[:n].copy()

    def advance(self, n_looks: int, require: Callable[[int], None]) -> bool:
        """Go on from ``n_looks`` labels at most; return whether all trails are known.

        Before memory is taken, ``require`` is called with the number of bytes.
        """
        search, progress = self._search, self.progress
        full = grow(search, n_looks, True)
        if progress.n_trails > 1.5 * self._n_tidy + 64:
            self._tidy()
        if full:
            require(tables.n_bytes(search.labels))
            labels = tables.chained_again(tables.doubled(search.labels), progress.n_labels)
            require(tables.n_bytes(search.trails))
            self._search = search._replace(labels=labels, trails=tables.doubled(search.trails))
        ended = bool(progress.next == progress.n_labels)
        if ended:
            self._tidy()
        return ended

    def _tidy(self) -> None:
        """Sort the trails by descending survival, without those that another is as good as."""
        trails, progress = self._search.trails, self.progress
        n, others = progress.n_trails, tables.TrailTable(*[column.copy() for column in trails])
        total = sum(others.reached[:n].T, np.zeros(n))
        progress.n_trails = 0
        # Of trails that survive alike, one that another is as good as comes after it.
        order = np.lexsort((-total, -others.rows["survives"][:n]))
        add_trails(trails, self._search.progress, others, order)
        self._n_tidy = progress.n_trails

    def estimate(self, n_bytes: int) -> float:
        """Return an estimate from above of the number of labels, which takes ``n_bytes`` at most.

        It is the same every time.
        """
        most = 1 + self.graph.n_arcs * int(np.diff(self.graph.first).max())
        n_rows = min(most, _MAX_MET, n_bytes // self.n_label_bytes)
        n_rows = 1 << max(4, n_rows.bit_length())
        probe, rng = self._probe(n_rows), np.random.default_rng(0)
        found: list[float] = []
        n_met = 0
        while len(found) < _MAX_DIVES and n_met < _MAX_MET:
            estimate = probe._dive(rng)
            if estimate is None:
                break
            found.append(estimate)
            n_met += probe.progress.n_labels
        return float(np.mean(found)) if found else 0.0

    def _probe(self, n_rows: int) -> TrailSearch:
        """Return a search with the same trails and no labels."""
        probe, search = copy.copy(self), self._search
        n_goals, n_words = search.labels.reached.shape[1], search.labels.used.shape[1]
        probe._search = search._replace(
            labels=tables.new_labels(n_rows, n_goals, n_words),
            trails=tables.doubled(search.trails),
            progress=search.progress.copy(),
        )
        return probe

    def _dive(self, rng: np.random.Generator) -> float | None:
        """Estimate the number of labels from those that one random descent meets.

        Of the n children of a label one is drawn. Each child counts for the product of all n before
        it: Knuth, "Estimating the efficiency of backtrack programs", Mathematics of Computation
        29(129), 1975. The search has fewer labels, since it compares each with all others, not only
        with those of the same descent.

        A descent ends where there is no more room for labels. None is returned where there is no
        room for trails.
        """
        search, progress = self._search, self.progress
        progress.n_labels = label = 0
        weight = total = 1.0
        low = 1
        while True:
            progress.next = label
            if grow(search, 1, False):
                self._tidy()
                if grow(search, 1, False):
                    node = search.labels.rows["node"][label]
                    degree = self.graph.first[node + 1] - self.graph.first[node]
                    return None if len(search.trails.rows) - progress.n_trails < degree else total
            n = progress.n_labels - low
            if n <= 0:
                return total
            weight *= int(n)  # of Python: numpy would warn where it becomes infinite
            total += weight
            label, low = low + int(rng.random() * n), progress.n_labels

    def trail(self, row: int) -> list[int]:
        """Return a trail of the table as nodes."""
        graph, labels, current = self.graph, self._search.labels, self._search.current
        label, arc, _ = self._search.trails.rows[row].tolist()
        if label < 0:
            return list(self._known[-1 - label])
        current.used[:] = [has(labels.used[label], i) for i in range(graph.n_arcs)]
        current.used[arc] = 1
        current.row["length"] = labels.rows["length"][label] + graph.length[arc]
        current.row["node"] = graph.head[arc]
        look_around(self._search)
        home = [graph.base]
        while (last := current.paths.entry[home[-1]]) >= 0:
            home.append(int(graph.tail[last]))
        out: list[int] = []
        while label >= 0:
            label, _, node, *_ = labels.rows[label].tolist()
            out.append(node)
        return out[::-1] + home[::-1]

    def follow(self, trail: tuple[int, ...]) -> tuple[float, FloatArray]:
        """Return the probabilities to survive a trail, and to reach each goal on it."""
        graph, reached, alive = self.graph, np.zeros(len(self.rule.reward)), 1.0
        for tail, head in pairwise(trail):
            alive *= float(graph.survival[find_arc(graph, tail, head)])
            goal = self.rule.goal[head]
            if goal >= 0 and reached[goal] == 0.0:
                reached[goal] = alive
        return alive, reached


def _rule_of(graph: Graph, single: bool, limits: Limits) -> tables.LabelRule:
    """Return what decides about trails: nodes with a reward are goals, but not the base."""
    is_goal = (graph.reward > 0) & (np.arange(graph.n_nodes) != graph.base)
    keys, budget = hash_keys(2 * graph.n_nodes), new_budget(graph, limits)
    return tables.LabelRule(
        goal=np.where(is_goal, np.cumsum(is_goal) - 1, -1),
        reward=graph.reward[is_goal],
        node_keys=keys[: graph.n_nodes].copy(),
        goal_keys=keys[graph.n_nodes :].copy(),
        single=single,
        limits=limits,
        short=None if budget is None else budget.short,
    )
