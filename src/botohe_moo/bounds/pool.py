"""The trails that the linear programme for prices may know."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.bounds.kernels.states import ROUNDING, Net
from botohe_moo.bounds.kernels.trails import follow_trails
from botohe_moo.bounds.memory import RelaxedTrail
from botohe_moo.bounds.prices import Prices


class Visits(NamedTuple):
    """A trail as a row of a linear programme: it is worth ``weights`` · prices + mu · survival."""

    columns: OffsetArray  # of prices (n_nodes × n_levels), level 0 left out
    weights: FloatArray
    survival: float


class Pool:
    """Known trails and relaxed trails, each once; relaxed ones may be dropped."""

    def __init__(self, net: Net, n_levels: int) -> None:
        self._net, self.n_levels = net, n_levels
        self.nodes: OffsetArray = np.flatnonzero(net.graph.reward > 0.0)
        self._row = np.full(net.graph.n_nodes, -1)
        self._row[self.nodes] = np.arange(len(self.nodes))
        self._n_columns = len(self.nodes) * n_levels
        self._known: dict[bytes, int] = {}
        self._matrix: Any = None
        self.visits: list[Visits] = []
        self.relaxed: list[RelaxedTrail | None] = []  # None for trails
        self.dropped: list[bool] = []

    def __len__(self) -> int:
        return len(self.visits)

    def add(self, arcs: list[int], paid: list[bool] | None = None) -> tuple[int, bool]:
        """Add a trail, or a relaxed one with the visits that pay.

        Returns its number, and whether it is new or was dropped before.
        """
        paying, alive = self._follow(arcs, paid)
        relaxed = None
        if paid is not None and not self._is_trail(arcs, paying, alive):
            relaxed = RelaxedTrail(arcs, paid)
        visits = self._visits(paying, alive)
        key = visits.columns.tobytes() + visits.weights.round(10).tobytes()
        key += np.round(alive, 12).tobytes()
        if key in self._known:
            number = self._known[key]
            was_dropped, self.dropped[number] = self.dropped[number], False
            if relaxed is None:
                self.relaxed[number] = None
            return number, was_dropped
        self._known[key] = len(self)
        self.visits.append(visits)
        self.relaxed.append(relaxed)
        self.dropped.append(False)
        self._matrix = None
        return len(self) - 1, True

    def _follow(
        self, arcs: list[int], paid: list[bool] | None
    ) -> tuple[list[tuple[int, float]], float]:
        """Return the nodes that pay, each with the probability to be alive there, and survival.

        Without ``paid``, each node pays at its first visit.
        """
        graph = self._net.graph
        if paid is None:
            taken = np.array([arcs], np.int32)
            survival, [reached] = follow_trails(self._net.world, taken, np.array([len(arcs)]))
            nodes = np.flatnonzero(reached)
            return list(zip(nodes.tolist(), reached[nodes].tolist(), strict=True)), survival[0]
        alive, heads = graph.survival[arcs].cumprod(), graph.head[arcs].tolist()
        paying = zip(heads, alive.tolist(), paid, strict=True)
        return [(node, chance) for node, chance, pays in paying if pays], alive[-1]

    def _is_trail(self, arcs: list[int], paying: list[tuple[int, float]], alive: float) -> bool:
        """Return whether a relaxed trail is a trail.

        It comes home within the limits, no node pays twice, and no arc is taken twice.
        """
        net, graph = self._net, self._net.graph
        nodes = {node for node, _ in paying}
        return bool(
            len(nodes) == len(paying)
            and len({*arcs}) == len(arcs)
            and graph.head[arcs[-1]] == net.base
            and alive >= net.min_survival * (1.0 - ROUNDING)
            and graph.length[arcs].sum() * (1.0 - ROUNDING) <= net.max_length
        )

    def _visits(self, paying: list[tuple[int, float]], survival: float) -> Visits:
        """Share out the probability to be alive at each node to the two levels next to it."""
        weights: dict[int, float] = {}
        for node, alive in paying:
            row = self._row[node]
            if row < 0:
                continue
            level = min(alive / self._net.reach[node], 1.0) * self.n_levels
            low = min(int(level), self.n_levels - 1)
            for one, weight in ((low, low + 1 - level), (low + 1, level - low)):
                if one > 0 and weight > 0.0:
                    column = int(row * self.n_levels + one - 1)
                    weights[column] = weights.get(column, 0.0) + weight
        columns = np.array(sorted(weights), np.int64)
        return Visits(columns, np.array([weights[c] for c in columns.tolist()]), survival)

    def value(self, number: int, prices: Prices) -> float:
        """Return what one trail is worth."""
        visits = self.visits[number]
        worth = visits.weights @ prices.visits[:, 1:].ravel()[visits.columns]
        return float(worth + prices.mu * visits.survival)

    def values(self, prices: Prices, *, relaxed: bool) -> FloatArray:
        """Return what trails are worth (n), −inf for those that are dropped.

        Without ``relaxed`` it is −inf for relaxed trails, too.
        """
        from scipy.sparse import csr_array

        if not self.visits:
            return np.empty(0)
        if self._matrix is None:
            first = np.cumsum([0, *(len(visits.columns) for visits in self.visits)])
            columns = np.concatenate([visits.columns for visits in self.visits])
            weights = np.concatenate([visits.weights for visits in self.visits])
            shape = (len(self), self._n_columns)
            self._matrix = csr_array((weights, columns, first), shape=shape)
            self._survival = self.survival
        paid = prices.visits[:, 1:].ravel()
        worth: FloatArray = self._matrix @ paid + prices.mu * self._survival
        worth[np.array(self.dropped)] = -np.inf
        if not relaxed:
            worth[[trail is not None for trail in self.relaxed]] = -np.inf
        return worth

    @property
    def survival(self) -> FloatArray:
        """The probabilities to come home (n)."""
        return np.array([visits.survival for visits in self.visits])

    def drop_forbidden(self, allows: Callable[[RelaxedTrail], bool]) -> None:
        """Drop relaxed trails that are not allowed any more."""
        for number, trail in enumerate(self.relaxed):
            if trail is not None and not self.dropped[number]:
                self.dropped[number] = not allows(trail)
