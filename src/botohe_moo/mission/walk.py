"""A mission as walkers see it: its arcs, and the self-loop that ends a trail."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray
from botohe_moo.kernels.graph.graph import Graph
from botohe_moo.kernels.plans.evaluate import trail_arcs
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
    cost
        −log(survival) of each arc, at least 0: what safest paths add up.
    homeward
        Of each node but the base, its arc on the safest way home.
    home
        Survival of each node's safest way home, every arc of which may be used; 1 at the base.
    base, loop
        Index of the base and of its self-loop.
    balanced
        Whether as many arcs enter every node as leave it.
    """

    first: OffsetArray
    tail: IntArray
    head: IntArray
    survival: FloatArray
    cost: FloatArray
    homeward: IntArray
    home: FloatArray
    base: int
    loop: int
    balanced: bool

    @classmethod
    def of(cls, arrays: Graph) -> WalkGraph:
        """Prepare a mission's arrays."""
        base = arrays.base
        loop = int(arrays.first[base + 1])
        first = arrays.first.copy()
        first[base + 1 :] += 1
        tail = np.insert(arrays.tail, loop, base).astype(np.int32)
        head = np.insert(arrays.head, loop, base).astype(np.int32)
        survival = np.insert(arrays.survival, loop, 1.0)
        homeward = (arrays.homeward + (arrays.homeward >= loop)).astype(np.int32)
        home = arrays.home
        return cls(
            first=first,
            tail=tail,
            head=head,
            survival=survival,
            cost=-np.log(survival) + 0.0,  # no negative zeros
            homeward=homeward,
            home=home,
            base=base,
            loop=loop,
            balanced=arrays.balanced,
        )

    def __post_init__(self) -> None:
        for array in (self.first, self.tail, self.head, self.survival, self.cost):
            array.setflags(write=False)
        self.homeward.setflags(write=False)
        self.home.setflags(write=False)

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
