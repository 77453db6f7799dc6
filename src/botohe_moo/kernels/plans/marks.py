"""Scratch of moves, which change a trail in a buffer whose arcs are marked."""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import OffsetArray
from botohe_moo.kernels.compile import helper
from botohe_moo.kernels.graph.graph import Graph, find_arc
from botohe_moo.kernels.graph.paths import Paths, new_paths

# Instead of a length: the move cannot be made, or is a detour without scratch for paths. The trail
# is as it was.
CANNOT = -1
NO_PATHS = -2


class MoveScratch(NamedTuple):
    """Scratch of moves."""

    mark: OffsetArray  # the number of the trail that is changed (1)
    # The last trail that used each arc (n_arcs): this one takes arc a where used[a] == mark[0].
    used: OffsetArray
    spare: OffsetArray  # a trail as it was before a move (n_arcs + 1)
    way: OffsetArray  # arcs of a detour (2 · n_nodes)
    # Scratch of searches for paths; None leaves out detours, which then are not compiled.
    paths: Paths | None


def new_move_scratch(graph: Graph, *, detours: bool) -> MoveScratch:
    """Make room for moves of trails of a graph."""
    return MoveScratch(
        mark=np.zeros(1, np.int64),
        used=np.zeros(graph.n_arcs, np.int64),
        spare=np.zeros(graph.n_arcs + 1, np.int64),
        way=np.zeros(2 * graph.n_nodes, np.int64),
        paths=new_paths(graph) if detours else None,
    )


@helper
def mark_trail(graph: Graph, scratch: MoveScratch, nodes: OffsetArray, length: int) -> None:
    """Take the next mark, and mark every arc of a trail."""
    scratch.mark[0] += 1
    for i in range(length - 1):
        scratch.used[find_arc(graph, nodes[i], nodes[i + 1])] = scratch.mark[0]
