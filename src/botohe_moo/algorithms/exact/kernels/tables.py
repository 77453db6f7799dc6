"""What the search for all trails of a mission works on: tables of labels and trails that grow."""

from typing import Any, NamedTuple, TypeVar

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray, RecordArray, SeedArray
from botohe_moo.core.graph import Graph, Limits
from botohe_moo.core.paths import Paths, new_paths

SHELF = 32  # trails that are skipped together where none can be as good

LABEL = np.dtype(
    [
        ("parent", np.int64),  # the label that this one goes on from, −1 for the first one
        ("arc", np.int64),  # the arc by which, −1 for the first one
        ("node", np.int64),  # where it ends
        ("alive", np.float64),  # probability to get there
        ("length", np.float64),  # how long it is
        ("key", np.uint64),  # a hash of the node and the goals reached
        ("before", np.int64),  # the label before it in its chain, or −1
    ]
)
TRAIL = np.dtype(
    [
        # The label and the arc after which the trail goes home by the safest way; parents below 0
        # number trails known from elsewhere.
        ("parent", np.int64),
        ("arc", np.int64),
        ("survives", np.float64),  # probability to survive
    ]
)
PROGRESS = np.dtype(
    [
        ("n_labels", np.int64),
        ("next", np.int64),  # the next label to go on from
        ("n_trails", np.int64),
    ]
)
Table = TypeVar("Table", bound=tuple[Any, ...])


class LabelRule(NamedTuple):
    """What decides about trails."""

    # Of each node, which goal it is, −1 for those without reward and for the base (n_nodes).
    goal: OffsetArray
    reward: FloatArray  # of each goal (n_goals)
    # Keys for hashes.
    node_keys: SeedArray
    goal_keys: SeedArray
    single: bool  # whether the team is one robot
    limits: Limits  # survival floor and travel budget
    short: Graph | None  # the graph with lengths as costs; None without a budget


class LabelTable(NamedTuple):
    """Labels, one a row; those at the same node that have reached the same goals are chained."""

    rows: RecordArray  # as ``LABEL``
    # Probability to have reached each goal, 0 where it has not been visited (n, n_goals).
    reached: FloatArray
    used: SeedArray  # bits of the arcs that it cannot use any more (n, n_words)
    # The last label of each chain, −1 for none, at the place that the low bits of its key give; the
    # number of places is a power of two, and at most that of rows. Each place has one chain.
    last: OffsetArray


class TrailTable(NamedTuple):
    """Trails, one a row, each better in something than every one before it.

    ``SHELF`` of them lie on a shelf.
    """

    rows: RecordArray  # as ``TRAIL``
    # Probability to reach each goal; for a single robot the share of the reward (n, n_columns).
    reached: FloatArray
    # The largest survival, and the largest of each column, of the trails on each shelf.
    shelf_survives: FloatArray
    shelf_reached: FloatArray


class CurrentLabel(NamedTuple):
    """Scratch: a label, and what it may still reach."""

    row: RecordArray  # as ``LABEL`` (1)
    # Which arcs it cannot use any more (n_arcs), and the same as bits (n_words).
    used: OffsetArray
    bits: SeedArray
    # Probability to have reached each goal, and the most that this may become (n_goals).
    reached: FloatArray
    prospect: FloatArray
    column: FloatArray  # one row of ``TrailTable.reached``
    paths: Paths  # the safest ways from its node over arcs that it can use
    reach: FloatArray  # survival of these, 0 where there is none (n_nodes)
    homeward: OffsetArray  # whether arcs that it can use lead home from each node (n_nodes)


class LabelSearch(NamedTuple):
    """A search for all trails that teams may need."""

    graph: Graph
    rule: LabelRule
    labels: LabelTable
    trails: TrailTable
    progress: RecordArray  # as ``PROGRESS`` (1)
    current: CurrentLabel


def new_search(graph: Graph, rule: LabelRule, n: int) -> LabelSearch:
    """Return a search that has not begun, with room for ``n`` labels and as many trails."""
    n_goals, n_words = len(rule.reward), graph.n_arcs // 64 + 1
    n_columns = 1 if rule.single else n_goals
    current = CurrentLabel(
        row=np.zeros(1, LABEL).view(np.recarray),
        used=np.zeros(graph.n_arcs, np.int64),
        bits=np.zeros(n_words, np.uint64),
        reached=np.zeros(n_goals),
        prospect=np.zeros(n_goals),
        column=np.zeros(n_columns),
        paths=new_paths(graph),
        reach=np.zeros(graph.n_nodes),
        homeward=np.zeros(graph.n_nodes, np.int64),
    )
    labels, trails = new_labels(n, n_goals, n_words), new_trails(n, n_columns)
    progress = np.zeros(1, PROGRESS).view(np.recarray)
    return LabelSearch(graph, rule, labels, trails, progress, current)


def new_labels(n: int, n_goals: int, n_words: int) -> LabelTable:
    """Return room for ``n`` labels, a power of two."""
    return LabelTable(
        rows=np.zeros(n, LABEL).view(np.recarray),
        reached=np.zeros((n, n_goals)),
        used=np.zeros((n, n_words), np.uint64),
        last=np.full(n, -1, np.int64),
    )


def new_trails(n: int, n_columns: int) -> TrailTable:
    """Return room for ``n`` trails, a multiple of SHELF."""
    return TrailTable(
        rows=np.zeros(n, TRAIL).view(np.recarray),
        reached=np.zeros((n, n_columns)),
        shelf_survives=np.zeros(n // SHELF),
        shelf_reached=np.zeros((n // SHELF, n_columns)),
    )


def doubled(table: Table) -> Table:
    """Return a copy of a named tuple of arrays with room for twice as many rows."""
    larger = [
        np.concatenate([column, np.zeros_like(column)]).view(type(column)) for column in table
    ]
    return type(table)(*larger)


def chained_again(labels: LabelTable, n_labels: int) -> LabelTable:
    """Chain all labels again, after the table has got room for more chains."""
    labels.last[:] = -1
    rows = labels.rows[:n_labels]
    place = (rows["key"] & np.uint64(len(labels.last) - 1)).astype(np.int64)
    order = np.argsort(place, kind="stable")  # chain by chain, the oldest label first
    follows = place[order[1:]] == place[order[:-1]]
    rows["before"] = -1
    rows["before"][order[1:][follows]] = order[:-1][follows]
    labels.last[place[order]] = order  # the last one of each place stays
    return labels


def n_bytes(table: tuple[Any, ...]) -> int:
    """Count the bytes of a named tuple of arrays."""
    return sum(column.nbytes for column in table)
