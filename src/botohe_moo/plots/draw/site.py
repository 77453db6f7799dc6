"""A mission as maps show it, without matplotlib: each arc once, and what nodes are to its kinds."""

from dataclasses import dataclass

import numpy as np

from botohe_moo.base.types import BoolArray, FloatArray, OffsetArray
from botohe_moo.core.world import AT_NEXT_DEPOT, AT_THIS_DEPOT
from botohe_moo.mission import Mission


@dataclass(frozen=True)
class Site:
    """Arcs and nodes of a mission, in its own indices, for all its kinds of robots or for one."""

    kinds: tuple[int, ...]  # indices of the mission's kinds
    ends: tuple[tuple[int, int], ...]  # the nodes where each of them starts and ends
    has_ends: bool  # whether these are worth a mark: there are several kinds, or other ends
    base: int
    # Of each arc (n_arcs), in ascending order of tails, then heads; ``reverse`` is the arc from its
    # head to its tail, −1 where there is none.
    tail: OffsetArray
    head: OffsetArray
    reverse: OffsetArray
    length: FloatArray
    survival: FloatArray  # of each kind and arc (n_kinds, n_arcs), 0 where it cannot take the arc
    reward: FloatArray  # of each node (n_nodes); what a robot expects, if one kind is shown
    collects: BoolArray  # which kinds can collect the reward of which nodes (n_kinds, n_nodes)
    # The nodes that pay on return, and the depots but the base, if there are such nodes.
    returning: OffsetArray
    depots: OffsetArray

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
    def all_return(self) -> bool:
        """Whether some nodes pay on return, and all others are depots, where that is on arrival."""
        paid = np.flatnonzero(self.collects.any(axis=0))
        rest = np.setdiff1d(paid, [*self.returning, *self.depots, self.base])
        return len(self.returning) > 0 and not len(rest)


def site_of(mission: Mission, kind: str | None = None) -> Site:
    """Return a mission's site for all its kinds, or for the one of a name."""
    graph, n, base = mission.world.graph, len(mission.nodes), mission.index(mission.base)
    kinds = tuple(k for k, one in enumerate(mission.kinds) if kind in (None, one.name))
    ends = [tuple(map(mission.index, one.ends(mission.base))) for one in mission.kinds]
    # For kernels each kind has nodes of its own.
    layer, tail = np.divmod(graph.tail, n)
    arcs, place = np.unique(tail * n + graph.head % n, return_inverse=True)
    survival = np.zeros((len(mission.kinds), len(arcs)))
    survival[layer, place] = graph.survival
    length = np.zeros(len(arcs))
    length[place] = graph.length
    survival = survival[list(kinds)]
    taken = (survival > 0).any(axis=0)
    arcs, length, survival = arcs[taken], length[taken], survival[:, taken]
    tail, head = np.divmod(arcs, n)
    back = head * n + tail
    found = np.minimum(np.searchsorted(arcs, back), max(0, len(arcs) - 1))
    expected = graph.reward.reshape(-1, n)[list(kinds)]
    returning = depots = np.empty(0, np.int64)
    if (returns := mission.world.returns) is not None:
        credit = returns.credit[:n]
        returning = np.flatnonzero((credit == AT_NEXT_DEPOT) & (expected > 0).any(axis=0))
        depots = np.setdiff1d(np.flatnonzero(credit == AT_THIS_DEPOT), [base])
    return Site(
        kinds=kinds,
        ends=tuple((ends[k][0], ends[k][1]) for k in kinds),
        has_ends=ends != [(base, base)],
        base=base,
        tail=tail,
        head=head,
        reverse=np.where(arcs[found] == back, found, -1),
        length=length,
        survival=survival,
        reward=mission.rewards if kind is None else expected[0],
        collects=expected > 0,
        returning=returning,
        depots=depots,
    )


def only_some(can: BoolArray) -> dict[tuple[int, ...], BoolArray]:
    """Return sets of kinds that can do, as no other kind, some of what is asked (n_kinds, n)."""
    some = can[:, can.any(axis=0) & ~can.all(axis=0)]
    return {
        tuple(np.flatnonzero(column).tolist()): (can == column[:, None]).all(axis=0)
        for column in np.unique(some, axis=1).T
    }


def robot_names(mission: Mission) -> list[str]:
    """Return what each robot is called: "robot 0", or if there are several kinds, "drone 0"."""
    several = len(mission.kinds) > 1
    return [f"{kind.name if several else 'robot'} {i}" for i, kind in enumerate(mission.kind_of)]


def place_name(mission: Mission, node: int) -> str:
    """Return how to call the node where a robot stays."""
    return "base" if mission.nodes[node] == mission.base else str(mission.nodes[node])
