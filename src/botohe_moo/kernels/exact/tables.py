"""What the search for all trails of a mission works on: tables of labels and trails that grow."""

from typing import Any, NamedTuple, TypeVar

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray

SHELF = 32  # trails that are looked at together

# Places in the array of counts, and how many there are.
LABELS, TRAILS, NEXT = 0, 1, 2
N_COUNTS = 3

Table = TypeVar("Table", bound=tuple[Any, ...])


class Site(NamedTuple):
    """A mission's arcs, and what decides about trails.

    Attributes
    ----------
    first, tail, head, survival
        The arcs, grouped by tail node, the base's self-loop not among them.
    goal
        Of each node, which goal it is, −1 for those without reward and for the base.
    reward
        Of each goal (n_goals).
    home
        Survival of each node's safest way home over all arcs.
    base
        Index of the base.
    balanced
        Whether as many arcs enter every node as leave it.
    single
        Whether the team is one robot.
    least
        Survival floor.
    """

    first: OffsetArray
    tail: IntArray
    head: IntArray
    survival: FloatArray
    goal: IntArray
    reward: FloatArray
    home: FloatArray
    base: int
    balanced: bool
    single: bool
    least: float


class Labels(NamedTuple):
    """Labels, one a row; those at the same node with the same goals reached are chained.

    Attributes
    ----------
    parent, arc, node
        The label that each goes on from, by which arc, and to which node; −1 for the first one.
    alive
        Probability to get there.
    reached
        Probability to have reached each goal, 0 where it has not been visited (n, n_goals).
    used
        Bits of the arcs that it cannot use any more (n, n_words).
    key, before
        A hash of the node and the goals reached, and the label before it in its chain or −1.
    last
        The last label of each chain, −1 for none, by the low bits of its key; as many as there are
        rows at most, a power of two. Chains that share a place are one.
    """

    parent: OffsetArray
    arc: IntArray
    node: IntArray
    alive: FloatArray
    reached: FloatArray
    used: SeedArray
    key: SeedArray
    before: OffsetArray
    last: OffsetArray


class Trails(NamedTuple):
    """Trails that no trail before them is as good as; SHELF of them lie on a shelf.

    Attributes
    ----------
    parent, arc
        The label and the arc after which each goes home by the safest way; parents below 0 number
        trails known from elsewhere.
    survives
        Probability to survive.
    reached
        Probability to reach each goal; for a single robot the share of the reward (n, n_columns).
    shelf_survives, shelf_reached
        The largest of them on each shelf.
    """

    parent: OffsetArray
    arc: IntArray
    survives: FloatArray
    reached: FloatArray
    shelf_survives: FloatArray
    shelf_reached: FloatArray


class Here(NamedTuple):
    """Room for what a label at hand may still reach.

    Attributes
    ----------
    reach, entry, settled
        Survival of the safest way to each node over arcs that it can use, 0 for none, the last arc
        of that way, and whether it is known for good.
    homeward
        Whether arcs that it can use lead from each node home.
    used
        Its arcs (n_words).
    reached, prospect
        Probability to have reached each goal, and at most to reach it at all (n_goals).
    column
        One row of ``Trails.reached``.
    """

    reach: FloatArray
    entry: IntArray
    settled: OffsetArray
    homeward: OffsetArray
    used: SeedArray
    reached: FloatArray
    prospect: FloatArray
    column: FloatArray


def new_here(n_nodes: int, n_goals: int, n_words: int, n_columns: int) -> Here:
    """Make room for a label at hand, whose robot has not left the base.

    Parameters
    ----------
    n_nodes, n_goals, n_words
        How many nodes, goals, and words of bits for the arcs.
    n_columns
        Columns of ``Trails.reached``.
    """
    return Here(
        reach=np.zeros(n_nodes),
        entry=np.zeros(n_nodes, np.int32),
        settled=np.zeros(n_nodes, np.int64),
        homeward=np.zeros(n_nodes, np.int64),
        used=np.zeros(n_words, np.uint64),
        reached=np.zeros(n_goals),
        prospect=np.zeros(n_goals),
        column=np.zeros(n_columns),
    )


def new_labels(n: int, n_goals: int, n_words: int) -> Labels:
    """Make room for labels.

    Parameters
    ----------
    n
        For how many, a power of two.
    n_goals, n_words
        How many goals, and words of bits for the arcs.
    """
    return Labels(
        parent=np.zeros(n, np.int64),
        arc=np.zeros(n, np.int32),
        node=np.zeros(n, np.int32),
        alive=np.zeros(n),
        reached=np.zeros((n, n_goals)),
        used=np.zeros((n, n_words), np.uint64),
        key=np.zeros(n, np.uint64),
        before=np.zeros(n, np.int64),
        last=np.full(n, -1, np.int64),
    )


def new_trails(n: int, n_columns: int) -> Trails:
    """Make room for trails.

    Parameters
    ----------
    n
        For how many, a multiple of SHELF.
    n_columns
        Columns of ``reached``.
    """
    return Trails(
        parent=np.zeros(n, np.int64),
        arc=np.zeros(n, np.int32),
        survives=np.zeros(n),
        reached=np.zeros((n, n_columns)),
        shelf_survives=np.zeros(n // SHELF),
        shelf_reached=np.zeros((n // SHELF, n_columns)),
    )


def doubled(table: Table) -> Table:
    """Copy a named tuple of arrays to where there is room for twice as many rows.

    Parameters
    ----------
    table
        Stays as it is.
    """
    larger = [np.concatenate([column, np.zeros_like(column)]) for column in table]
    return type(table)(*larger)


def n_bytes(table: tuple[Any, ...]) -> int:
    """Count the bytes of a named tuple of arrays.

    Parameters
    ----------
    table
        The arrays.
    """
    return sum(column.nbytes for column in table)
