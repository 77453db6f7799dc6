"""Labels: partial trails that leave the base, each known by its last arc and the label before it.

Walking up its parents gives the arcs that a label has used and the nodes it has visited. Parents
have smaller numbers than their children.
"""

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.compile import inline, kernel


class Label(NamedTuple):
    """A partial trail.

    Attributes
    ----------
    parent, arc, node
        The label that this one goes on from, by which arc, and to which node; the first has
        neither parent nor arc (−1).
    alive
        Probability to get here.
    value
        Worth collected.
    left
        Worth of all nodes not visited.
    used, seen
        Hashes: of the set of arcs used, and of the set of nodes visited that are worth something.
    """

    parent: int
    arc: int
    node: int
    alive: float
    value: float
    left: float
    used: np.uint64
    seen: np.uint64


# Many labels are one array: what kernels pay for a tuple grows with the arrays in it.
LABEL = np.dtype(
    [
        ("parent", np.int64),
        ("arc", np.int32),
        ("node", np.int32),
        ("alive", np.float64),
        ("value", np.float64),
        ("left", np.float64),
        ("used", np.uint64),
        ("seen", np.uint64),
    ]
)
Labels: TypeAlias = NDArray[Any]  # of LABEL


class Standing(NamedTuple):
    """What the label at hand has used and visited.

    Attributes
    ----------
    label
        Which label that is (1).
    used
        1 for the arcs it has used, 0 for the others (n_arcs).
    visits
        How often it has visited each node (n_nodes).
    worth
        Of each node (n_nodes).
    ahead
        Worth of each node that it has not visited, 0 for the others (n_nodes).
    """

    label: OffsetArray
    used: OffsetArray
    visits: OffsetArray
    worth: FloatArray
    ahead: FloatArray


@kernel
def new_labels(n: int) -> Labels:
    """Make room for ``n`` labels.

    Parameters
    ----------
    n
        How many.
    """
    return np.empty(n, LABEL)


@inline
def write_label(labels: Labels, row: int, label: Label) -> None:
    """Put a label into a row.

    Parameters
    ----------
    labels, row
        Where to; changed in place.
    label
        The label.
    """
    into = labels[row]
    into.parent, into.arc, into.node = label.parent, label.arc, label.node
    into.alive, into.value, into.left = label.alive, label.value, label.left
    into.used, into.seen = label.used, label.seen


@kernel
def doubled(labels: Labels) -> Labels:
    """Copy the labels to where there is room for twice as many.

    Parameters
    ----------
    labels
        Stay as they are.
    """
    larger = new_labels(2 * len(labels))
    larger[: len(labels)] = labels
    return larger


@kernel
def first_label(base: int, worth: FloatArray) -> Label:
    """Give the label of a robot that has not left the base.

    Parameters
    ----------
    base
        Where it is.
    worth
        Of each node (n_nodes).
    """
    left = worth.sum() - worth[base]
    return Label(-1, -1, base, 1.0, worth[base], left, np.uint64(0), np.uint64(0))


@kernel
def standing_at_base(base: int, worth: FloatArray, n_arcs: int) -> Standing:
    """Stand at the first label, whose row is 0.

    Parameters
    ----------
    base
        Where that is.
    worth
        Of each node (n_nodes).
    n_arcs
        How many arcs there are.
    """
    visits, ahead = np.zeros(worth.shape[0], np.int64), worth.copy()
    visits[base], ahead[base] = 1, 0.0
    return Standing(np.zeros(1, np.int64), np.zeros(n_arcs, np.int64), visits, worth, ahead)


@kernel
def stand_at(labels: Labels, label: int, standing: Standing) -> None:
    """Move from the label at hand to another one.

    Only as far up from both as to where they part: mostly not far, however long the trails are.

    Parameters
    ----------
    labels, label
        Where the other one is.
    standing
        Changed in place.
    """
    before, standing.label[0] = standing.label[0], label
    while before != label:
        leave = before > label
        at = before if leave else label
        arc, node, parent = labels[at].arc, labels[at].node, labels[at].parent
        if leave:
            standing.used[arc] -= 1
            standing.visits[node] -= 1
            if standing.visits[node] == 0:
                standing.ahead[node] = standing.worth[node]
            before = parent
        else:
            standing.used[arc] += 1
            standing.visits[node] += 1
            standing.ahead[node] = 0.0
            label = parent


@kernel
def hash_keys(n: int) -> SeedArray:
    """Give each index a key of 64 bits, as SplitMix64 finishes its numbers.

    A set of indices hashes to the exclusive or of their keys.

    Parameters
    ----------
    n
        How many indices.
    """
    keys = np.empty(n, np.uint64)
    for i in range(n):
        mixed = np.uint64(i + 1) * np.uint64(0x9E3779B97F4A7C15)
        mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        keys[i] = mixed ^ (mixed >> np.uint64(31))
    return keys


@kernel
def new_table(n: int) -> OffsetArray:
    """Make an empty hash table with room for ``n`` labels; see ``find``.

    Parameters
    ----------
    n
        How many.
    """
    size = 16
    while size < 2 * n:
        size *= 2
    return np.full(size, -1, np.int64)


@inline
def find(
    table: OffsetArray,
    nodes: IntArray,
    hashes: SeedArray,
    node: int,
    hashed: np.uint64,
    node_key: np.uint64,
) -> int:
    """Find a label by its node and a hash.

    Parameters
    ----------
    table
        Rows of labels, −1 where a slot is empty.
    nodes, hashes
        Of all labels.
    node, hashed
        What to look for.
    node_key
        The key of the node.

    Returns
    -------
    int
        The slot that holds the label, or the empty one where it belongs.
    """
    last = table.shape[0] - 1
    slot = np.int64((hashed ^ node_key) & np.uint64(last))
    while table[slot] >= 0:
        known = table[slot]
        if hashes[known] == hashed and nodes[known] == node:
            break
        slot = (slot + 1) & last
    return int(slot)
