"""A mission as kernels see it."""

from __future__ import annotations

from dataclasses import astuple, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterable

    import networkx as nx

    from botohe_moo._base.types import FloatArray, IntArray, OffsetArray

__all__ = ["MissionArrays"]


@dataclass(frozen=True, eq=False)
class MissionArrays:
    """Nodes and arcs as indices; all arrays are read-only.

    Attributes
    ----------
    first
        The arcs that leave node v are ``first[v]`` to ``first[v + 1]`` (n_nodes + 1).
    tail, head
        The nodes that each arc leaves and enters (n_arcs); heads ascend within a node's arcs.
    survival
        Probability to survive each arc, in (0, 1] (n_arcs).
    reward
        Reward of each node, at least 0 (n_nodes).
    base
        Index of the base.
    """

    first: OffsetArray
    tail: IntArray
    head: IntArray
    survival: FloatArray
    reward: FloatArray
    base: int

    def __post_init__(self) -> None:
        for array in (self.first, self.tail, self.head, self.survival, self.reward):
            array.setflags(write=False)

    def __reduce__(self) -> tuple[object, ...]:
        return MissionArrays, astuple(self)  # numpy unpickles arrays as writable ones

    @classmethod
    def of(cls, graph: nx.DiGraph[Any], index: dict[Any, int], base: Hashable) -> MissionArrays:
        """Compile a valid graph.

        Parameters
        ----------
        graph
            A mission's graph.
        index
            The number of each node, in the graph's order.
        base
            Label of the base.
        """
        labelled: Iterable[tuple[Any, Any, float]] = graph.edges(data="survival")
        arcs = sorted((index[u], index[v], s) for u, v, s in labelled)
        tail = np.array([u for u, _, _ in arcs], np.int32)
        reward = np.array([r for _, r in graph.nodes(data="reward")], np.float64)
        first = np.zeros(len(reward) + 1, np.int64)
        np.cumsum(np.bincount(tail, minlength=len(reward)), out=first[1:])
        return cls(
            first=first,
            tail=tail,
            head=np.array([v for _, v, _ in arcs], np.int32),
            survival=np.array([s for _, _, s in arcs], np.float64),
            reward=reward,
            base=index[base],
        )

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.reward)

    @property
    def n_arcs(self) -> int:
        """Number of arcs, the base's self-loop not among them."""
        return len(self.head)

    @property
    def balanced(self) -> bool:
        """Whether as many arcs enter every node as leave it, so that no trail meets a dead end."""
        entering = np.bincount(self.head, minlength=self.n_nodes)
        return bool(np.array_equal(entering, np.diff(self.first)))
