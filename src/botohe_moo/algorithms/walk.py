"""A mission as walkers see it: its arcs, and the self-loop that ends a trail."""

from __future__ import annotations

from dataclasses import dataclass

import networkx as nx
import numpy as np

from botohe_moo._types import FloatArray, IntArray, OffsetArray
from botohe_moo.kernels.evaluate import trail_arcs
from botohe_moo.mission.model import Mission
from botohe_moo.trails import PlanBatch

__all__ = ["WalkGraph"]


@dataclass(frozen=True, eq=False)
class WalkGraph:
    """A mission's arcs with the base's self-loop among them, as ants walk them.

    Attributes
    ----------
    first
        The arcs that leave node v are ``first[v]`` to ``first[v + 1]`` (n_nodes + 1); the
        self-loop is the base's last.
    tail, head, survival
        Per arc; the self-loop has survival 1.
    homeward
        Of each node but the base, its arc on some shortest way home.
    base, loop
        Index of the base and of its self-loop.
    balanced
        Whether as many arcs enter every node as leave it.
    """

    first: OffsetArray
    tail: IntArray
    head: IntArray
    survival: FloatArray
    homeward: IntArray
    base: int
    loop: int
    balanced: bool

    @classmethod
    def of(cls, mission: Mission) -> WalkGraph:
        """Prepare a mission."""
        arrays = mission.arrays
        n_nodes, base = arrays.n_nodes, arrays.base
        loop = int(arrays.first[base + 1])
        first = arrays.first.copy()
        first[base + 1 :] += 1
        tail = np.insert(arrays.tail, loop, base).astype(np.int32)
        head = np.insert(arrays.head, loop, base).astype(np.int32)
        homeward = np.full(n_nodes, -1, np.int32)
        arc_of = {arc: i for i, arc in enumerate(zip(tail.tolist(), head.tolist(), strict=True))}
        backwards = mission.graph.reverse(copy=False)
        for nearer, farther in nx.bfs_edges(backwards, mission.base):
            u, v = mission.index(farther), mission.index(nearer)
            homeward[u] = arc_of[u, v]
        return cls(
            first=first,
            tail=tail,
            head=head,
            survival=np.insert(arrays.survival, loop, 1.0),
            homeward=homeward,
            base=base,
            loop=loop,
            balanced=mission.balanced,
        )

    def arcs_of(self, batch: PlanBatch) -> IntArray:
        """Give the arc that leaves each node of valid plans, trails ending with the self-loop.

        Parameters
        ----------
        batch
            Valid plans of the mission.
        """
        arcs = np.empty_like(batch.nodes)
        trail_arcs(self.first, self.head, self.loop, batch.nodes, batch.offsets, arcs)
        return arcs
