"""Known trails and relaxed ones, as points: how much of each level of each node they visit."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from botohe_moo._base.types import BoolArray, FloatArray, OffsetArray
from botohe_moo.kernels.bounds.states import ROUNDING, Net


class Visits(NamedTuple):
    """What a trail is to a linear programme: its value is ``weights`` · prices + mu · survival."""

    columns: OffsetArray  # of prices (n_nodes × n_levels), level 0 left out
    weights: FloatArray
    survival: float


class Pool:
    """Trails, each known once; those that are relaxed ones only may be dropped."""

    def __init__(self, net: Net, nodes: OffsetArray, n_levels: int) -> None:
        self._net, self.nodes, self.n_levels = net, nodes, n_levels
        self._row = np.full(net.graph.n_nodes, -1)
        self._row[nodes] = np.arange(len(nodes))
        self._n_columns = len(nodes) * n_levels
        self._known: dict[bytes, int] = {}
        self._matrix: Any = None
        self.visits: list[Visits] = []
        # Of relaxed ones, their arcs and which of these pay; None of trails.
        self.relaxed: list[tuple[list[int], list[bool]] | None] = []
        self.dropped: list[bool] = []

    def __len__(self) -> int:
        return len(self.visits)

    def add(self, arcs: list[int], paid: list[bool] | None = None) -> tuple[int, bool]:
        """Add a trail, or a relaxed one with the visits that pay.

        Returns its number, and whether it is new. A relaxed one is a trail where it comes home
        within the limits, pays no node twice and takes no arc twice.
        """
        net, graph = self._net, self._net.graph
        alive, seen, at = 1.0, {graph.base}, []
        for i, arc in enumerate(arcs):
            alive *= graph.survival[arc]
            node = int(graph.head[arc])
            if node not in seen if paid is None else paid[i]:
                at.append((node, alive))
            seen.add(node)
        visited = [node for node, _ in at]
        is_trail = len({*visited}) == len(visited) and len({*arcs}) == len(arcs)
        is_trail = is_trail and graph.head[arcs[-1]] == graph.base
        is_trail = is_trail and alive >= net.min_survival * (1.0 - ROUNDING)
        is_trail = is_trail and graph.length[arcs].sum() * (1.0 - ROUNDING) <= net.max_length
        visits = self._visits(at, alive)
        key = visits.columns.tobytes() + visits.weights.round(10).tobytes()
        key += np.round(alive, 12).tobytes()
        number = self._known.get(key, -1)
        how = None if is_trail or paid is None else (arcs, paid)
        if number >= 0:
            is_new = self.dropped[number]
            self.dropped[number] = False
            if how is None:
                self.relaxed[number] = None
            return number, is_new
        self._known[key] = len(self)
        self.visits.append(visits)
        self.relaxed.append(how)
        self.dropped.append(False)
        self._matrix = None
        return len(self) - 1, True

    def _visits(self, at: list[tuple[int, float]], survival: float) -> Visits:
        weights: dict[int, float] = {}
        for node, alive in at:
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

    def values(self, prices: FloatArray, mu: float) -> FloatArray:
        """Return what trails are worth, −inf for those dropped; ``prices`` leave level 0 out."""
        from scipy.sparse import csr_array

        if not self.visits:
            return np.empty(0)
        if self._matrix is None:
            first = np.cumsum([0, *(len(visits.columns) for visits in self.visits)])
            columns = np.concatenate([visits.columns for visits in self.visits])
            weights = np.concatenate([visits.weights for visits in self.visits])
            shape = (len(self), self._n_columns)
            self._matrix = csr_array((weights, columns, first), shape=shape)
            self._survival = np.array([visits.survival for visits in self.visits])
        worth: FloatArray = self._matrix @ prices.ravel() + mu * self._survival
        worth[np.array(self.dropped)] = -np.inf
        return worth

    @property
    def is_relaxed(self) -> BoolArray:
        """Which are relaxed ones, and not trails (n)."""
        return np.array([how is not None for how in self.relaxed], bool)
