"""Labels: partial trails that leave the base, each known by its last arc and the label before it.

Walking up its parents gives the arcs that a label has used and the nodes it has visited. Parents
have smaller numbers than their children.
"""

from typing import Any, NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray, RecordArray, SeedArray
from botohe_moo.core.compile import helper, inlined
from botohe_moo.core.graph import Graph
from botohe_moo.core.paths import Paths, new_paths
from botohe_moo.core.rng import hash_keys

LABEL = np.dtype(
    [
        ("parent", np.int64),  # the label that this one goes on from, −1 for the first one
        ("arc", np.int64),  # the arc by which, −1 for the first one
        ("node", np.int64),  # where it ends
        ("alive", np.float64),  # probability to get there
        ("length", np.float64),  # sum of the lengths of its arcs
        ("value", np.float64),  # worth collected
        ("left", np.float64),  # worth of all nodes not visited
        ("used", np.uint64),  # hash of the set of arcs used
        ("seen", np.uint64),  # hash of the set of nodes visited that are worth something
        ("key", np.uint64),  # by which children are found in the hash table
        ("bound", np.float64),  # what decides which children go on; see ``best_trail``
        ("rank", np.float64),
    ]
)
STATE = np.dtype(
    [
        # The last level is labels ``low`` to ``high``; ``high`` is 0 before the search.
        ("low", np.int64),
        ("high", np.int64),
        ("at", np.int64),  # the current label
        ("cut", np.int64),  # whether the beam was too narrow for a label
        ("value", np.float64),  # value of the best trail known
        # The label and the arc after which it goes home, −1 where it stays at base.
        ("label", np.int64),
        ("arc", np.int64),
        ("n_hops", np.int64),  # hops of the best trail, once the search has ended
    ]
)

_N_LABELS = 4096  # for which there is room at first


class Beam(NamedTuple):
    """State and scratch of a search for a trail."""

    state: RecordArray  # a ``STATE`` (1)
    labels: RecordArray  # all labels that went on, as ``LABEL``, level by level
    children: RecordArray  # of the last level, as ``LABEL``; some go on as labels
    table: OffsetArray  # a hash table of children, −1 where a slot is empty
    # Children in order, and scratch to sort them.
    order: OffsetArray
    spare: OffsetArray
    # Of the current label: 1 for the arcs it has used, 0 for the others (n_arcs); how often it has
    # visited each node, and the worth of each node that it has not visited, 0 for the others
    # (n_nodes).
    used: OffsetArray
    visits: OffsetArray
    ahead: FloatArray
    paths: Paths
    # Of each node, what a robot that is there for sure collects on the safest way home, or more
    # (n_nodes).
    gathered: FloatArray
    # Keys for hashes: of each arc used, of each node visited, and of the node where a label ends.
    arc_keys: SeedArray
    node_keys: SeedArray
    place_keys: SeedArray
    trail: OffsetArray  # the arcs of the best trail (n_arcs)


def new_beam(graph: Graph) -> Beam:
    """Return room for a search, which gets more as it needs it."""
    n_arcs, n_nodes = graph.n_arcs, graph.n_nodes
    keys = hash_keys(n_arcs + 2 * n_nodes)
    return Beam(
        state=np.zeros(1, STATE).view(np.recarray),
        labels=_new_labels(_N_LABELS),
        **_room_for_children(_N_LABELS),
        used=np.empty(n_arcs, np.int64),
        visits=np.empty(n_nodes, np.int64),
        ahead=np.empty(n_nodes),
        paths=new_paths(graph),
        gathered=np.empty(n_nodes),
        arc_keys=keys[:n_arcs].copy(),
        node_keys=keys[n_arcs : n_arcs + n_nodes].copy(),
        place_keys=keys[n_arcs + n_nodes :].copy(),
        trail=np.empty(n_arcs, np.int64),
    )


def _new_labels(n: int) -> RecordArray:
    return np.empty(n, LABEL).view(np.recarray)


def _room_for_children(n: int) -> dict[str, Any]:
    table, order = np.empty(table_size(n), np.int64), np.empty(n, np.int64)
    return {"children": _new_labels(n), "table": table, "order": order, "spare": order.copy()}


def larger_beam(beam: Beam, n_labels: int, n_children: int) -> Beam:
    """Return a beam with room for these numbers of labels, which are kept, and of children."""
    if n_children > len(beam.children):
        beam = beam._replace(**_room_for_children(n_children))
    if n_labels > len(beam.labels):
        labels = _new_labels(max(n_labels, 2 * len(beam.labels)))
        labels[: len(beam.labels)] = beam.labels
        beam = beam._replace(labels=labels)
    return beam


@helper
def stand_at(beam: Beam, worth: FloatArray, label: int) -> None:
    """Make another label the current one.

    Only the arcs that they do not share are taken back and added: mostly few, however long the
    trails are.
    """
    labels, used, visits, ahead = beam.labels, beam.used, beam.visits, beam.ahead
    before, beam.state[0].at = beam.state[0].at, label
    while before != label:
        leave = before > label
        at = labels[before if leave else label]
        if leave:
            used[at.arc] -= 1
            visits[at.node] -= 1
            if visits[at.node] == 0:
                ahead[at.node] = worth[at.node]
            before = at.parent
        else:
            used[at.arc] += 1
            visits[at.node] += 1
            ahead[at.node] = 0.0
            label = at.parent


@inlined
def table_size(n: int) -> int:
    """Return the size of a hash table of ``n`` children: a power of two, at least 2n."""
    size = 16
    while size < 2 * n:
        size *= 2
    return size


@inlined
def find(beam: Beam, size: int, key: np.uint64) -> int:
    """Find the slot of the child with a key, or the empty one where it belongs."""
    table, children, last = beam.table, beam.children, size - 1
    slot = np.int64(key & np.uint64(last))
    while table[slot] >= 0 and children[table[slot]].key != key:
        slot = (slot + 1) & last
    return int(slot)
