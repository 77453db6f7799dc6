"""A plain mission whose front is nowhere below that of one that is not plain."""

from __future__ import annotations

from typing import Any

import networkx as nx

from botohe_moo.kernels.graph.graph import Limits
from botohe_moo.mission.kinds import by_kind
from botohe_moo.mission.model import Mission

NOTE = "Robots are bounded as if each were the best of all kinds, and rewards counted on arrival."
_START = "botohe: start"  # of all kinds, where these start or end at different nodes


def relaxed_to_plain(mission: Mission, limits: Limits) -> tuple[Mission, Limits]:
    """Return a plain mission, and limits, that allow as much as a mission that is not plain.

    Each plan of the mission is one of the relaxation's, with at least its E[R] and its E[S]. An arc
    is as safe as for the kind that survives it best, and limits are the loosest of any kind. A
    reward counts on arrival, and wholly if any kind has a share in it. Where kinds start or end
    at different nodes, there is one start for all, with a safe arc of length 0 to each start, and
    one back from each end: a robot that stays where it starts goes there and back.

    What robots carry from the start cannot be had on the way, so a mission with a kind that has
    something ``aboard`` is refused with a ValueError.
    """
    if carrying := [kind.name for kind in mission.kinds if kind.aboard]:
        raise ValueError(
            f"bound_front does not support mission {mission.name!r}, in which robots carry "
            f"something from the start: {', '.join(carrying)}."
        )
    graph: nx.DiGraph[Any] = nx.DiGraph(name=mission.name)
    for node, said in mission.graph.nodes(data=True):
        is_collected = max(by_kind(said.get("share", 1.0), mission.kinds)) > 0.0
        graph.add_node(node, reward=said["reward"] if is_collected else 0.0)
    for tail, head, said in mission.graph.edges(data=True):
        survival = max(by_kind(said["survival"], mission.kinds))
        graph.add_edge(tail, head, survival=survival, length=said.get("length", 1.0))
    base = mission.base
    ends = [kind.ends(base) for kind in mission.kinds]
    if any(pair != (base, base) for pair in ends):
        base = _START
        graph.add_node(base, reward=0.0)
        for start, end in ends:
            graph.add_edge(base, start, survival=1.0, length=0.0)
            graph.add_edge(end, base, survival=1.0, length=0.0)
    loosest = limits
    if limits.floors is not None and limits.budgets is not None:
        loosest = Limits(float(limits.floors.min()), float(limits.budgets.max()))
    return Mission(graph, base=base, robots=mission.robots), loosest
