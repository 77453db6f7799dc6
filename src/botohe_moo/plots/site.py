"""A mission as maps show it, without matplotlib: places, arcs, kinds of robots, a map behind it."""

from __future__ import annotations

import os
from typing import Any, NamedTuple

import networkx as nx
import numpy as np

from botohe_moo.base.types import BoolArray, FloatArray
from botohe_moo.core.world import AT_NEXT_DEPOT, AT_THIS_DEPOT, ON_ARRIVAL
from botohe_moo.mission.formats.maps import MODES, read_raster
from botohe_moo.mission.hazards import places_of
from botohe_moo.mission.model import Mission

ALL_RETURN = "all rewards count on return"

_MAX_KAMADA_KAWAI = 60  # its cost grows with the square of the nodes


def node_positions(mission: Mission) -> FloatArray:
    """Return places (n_nodes, 2): attributes ``pos``, or a reproducible layout if any lacks one."""
    given, graph = places_of(mission.graph.nodes), mission.graph
    if len(given) == len(graph):
        return np.array([given[node] for node in mission.nodes])
    ties: nx.Graph[Any] = nx.Graph(graph.edges)
    ties.add_nodes_from(graph)
    if len(ties) <= _MAX_KAMADA_KAWAI:
        layout = nx.kamada_kawai_layout(ties, weight=None)
    else:
        layout = nx.spring_layout(ties, seed=0, weight=None)
    xy = np.array([layout[node] for node in mission.nodes])
    # Pages are wider than high, and a layout has no up and down of its own.
    return xy[:, ::-1] if np.ptp(xy[:, 1]) > np.ptp(xy[:, 0]) else xy


def layout_notes(mission: Mission) -> list[str]:
    """Write that places on the map are made up, and why; nothing if they are the positions."""
    n_nodes = len(mission.nodes)
    n_without = n_nodes - len(places_of(mission.graph.nodes))
    if n_nodes == 1 or not n_without:
        return []
    why = f"{n_without} of {n_nodes} nodes have no position"
    return [f"the places of the nodes on this map are made up: {why}"]


class Background(NamedTuple):
    """What is drawn behind a graph: shares of black, the first row at the top, and where."""

    shares: FloatArray  # in [0, 1] (n_rows, n_columns)
    extent: tuple[float, float, float, float]  # left, right, bottom and top, in units of ``pos``


def read_background(path: str | os.PathLike[str] | None, mission: Mission) -> Background | None:
    """Read a map of a site; a ValueError says that its nodes lack positions, or what is wrong."""
    if path is None:
        return None
    if notes := layout_notes(mission):
        expected = f"nodes with positions for the background {os.fspath(path)}"
        raise ValueError(f"Expected {expected}, but {notes[0]}.")
    raster = read_raster(path, modes=MODES)
    left, bottom = raster.origin
    height, width = (n_cells * raster.resolution for n_cells in raster.values.shape)
    return Background(raster.values, (left, left + width, bottom, bottom + height))


class Site:
    """Arcs and nodes of a mission, in its own indices, for all its kinds of robots or for one.

    Attributes
    ----------
    kinds, ends
        Indices of the mission's kinds, and the nodes where each of them starts and ends.
    has_ends
        Whether to mark them: there are several kinds, or they differ from the base.
    tail, head, reverse, length, survival
        Of each arc (n_arcs), in ascending order of tails, then heads. ``reverse`` is the arc from
        its head to its tail, −1 where there is none. ``survival`` is that of each kind (n_kinds,
        n_arcs), 0 where it cannot take the arc.
    reward, collects
        Of each node (n_nodes): what a robot expects, if one kind is shown; and which kinds can
        collect it (n_kinds, n_nodes).
    returning, depots
        The nodes that pay on return, and, if there are such nodes, the depots but the base.
    """

    def __init__(self, mission: Mission, kind: str | None = None) -> None:
        graph, n = mission.world.graph, len(mission.nodes)
        self.base = base = mission.index(mission.base)
        self.kinds = [k for k, one in enumerate(mission.kinds) if kind in (None, one.name)]
        places = [one.ends(mission.base) for one in mission.kinds]
        ends = [(mission.index(start), mission.index(end)) for start, end in places]
        self.ends, self.has_ends = [ends[k] for k in self.kinds], ends != [(base, base)]
        # For kernels each kind has nodes of its own.
        layer, tail = np.divmod(graph.tail, n)
        arcs, place = np.unique(tail * n + graph.head % n, return_inverse=True)
        survival, length = np.zeros((len(ends), len(arcs))), np.zeros(len(arcs))
        survival[layer, place], length[place] = graph.mean_survival, graph.length
        taken = (survival[self.kinds] > 0).any(axis=0)
        arcs, self.length = arcs[taken], length[taken]
        self.survival = survival[self.kinds][:, taken]
        self.tail, self.head = np.divmod(arcs, n)
        back = self.head * n + self.tail
        found = np.minimum(np.searchsorted(arcs, back), max(0, len(arcs) - 1))
        self.reverse = np.where(arcs[found] == back, found, -1)
        expected = graph.reward.reshape(-1, n)[self.kinds]
        self.collects = expected > 0
        self.reward = mission.rewards if kind is None else expected[0]
        credit = np.full(n, ON_ARRIVAL)
        if (returns := mission.world.returns) is not None:
            credit = returns.credit[:n]
        self.returning = np.flatnonzero((credit == AT_NEXT_DEPOT) & self.collects.any(axis=0))
        self.depots = np.setdiff1d(np.flatnonzero(credit == AT_THIS_DEPOT), [base])

    @property
    def safest(self) -> FloatArray:
        """The survival of each arc for the kind that it is safest for (n_arcs,)."""
        return np.asarray(self.survival.max(axis=0))

    @property
    def bowed(self) -> BoolArray:
        """Which arcs have no opposite that is as safe, for the same kinds (n_arcs,)."""
        safest, takes = self.safest, self.survival > 0
        same = safest[self.reverse] == safest
        same &= (takes[:, self.reverse] == takes).all(axis=0)
        return np.asarray((self.reverse < 0) | ~same)

    @property
    def once(self) -> BoolArray:
        """Which arcs to draw if two opposite ones that are equal share a line (n_arcs,)."""
        return np.asarray(self.bowed | (self.tail < self.head))

    @property
    def all_return(self) -> bool:
        """Whether some nodes pay on return, and all others are depots, where that is on arrival."""
        paid = np.flatnonzero(self.collects.any(axis=0))
        rest = np.setdiff1d(paid, [*self.returning, *self.depots, self.base])
        return len(self.returning) > 0 and not len(rest)


def only_some(can: BoolArray) -> dict[tuple[int, ...], BoolArray]:
    """Group what some kinds can do and others cannot (n_kinds, n) by the kinds that can."""
    some = can[:, can.any(axis=0) & ~can.all(axis=0)]
    return {
        tuple(np.flatnonzero(column).tolist()): (can == column[:, None]).all(axis=0)
        for column in np.unique(some, axis=1).T
    }


def place_notes(site: Site) -> list[str]:
    """Write what the marks of places mean, for maps without a legend of them."""
    hollow = ", hollow ones: ends" if any(start != end for start, end in site.ends) else ""
    returning = ALL_RETURN if site.all_return else "rings: pay on return"
    notes = {
        f"triangles: starts{hollow}": site.has_ends,
        "thin squares: depots": len(site.depots),
        returning: len(site.returning),
    }
    return [note for note, is_there in notes.items() if is_there]
