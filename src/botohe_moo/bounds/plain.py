"""A plain mission whose front is nowhere below that of one that is not plain."""

from __future__ import annotations

import math
from typing import Any

import networkx as nx

from botohe_moo.base.messages import quoted
from botohe_moo.core.world import Limits
from botohe_moo.mission.model import Mission
from botohe_moo.mission.rules import ONLY_KIND, Kind, by_kind

NOTE = "Robots are bounded as if each were the best of all kinds, and rewards counted on arrival."


def check_boundable(mission: Mission, who: str) -> None:
    """Refuse, by a ValueError that says who refuses, missions in which robots carry something.

    What is carried from the start may pay although nobody gets to its node, which the relaxation
    would miss.
    """
    rewards = mission.graph.nodes(data="reward")
    carrying = [quoted(k.name) for k in mission.kinds if any(rewards[v] for v in k.aboard)]
    if carrying:
        raise ValueError(
            f"{who} does not support mission {quoted(mission.name)}, in which robots carry "
            f"something from the start: those of kind {', '.join(carrying)}."
        )


def fewest_moving(mission: Mission) -> int:
    """Return how many robots move in every plan: those that end elsewhere than they start."""
    return sum(kind.robots for kind in mission.kinds if len({*kind.ends(mission.base)}) > 1)


def relaxed_to_plain(mission: Mission, limits: Limits) -> Mission:
    """Return a plain mission with limits that allow as much as a mission that is not plain.

    Each plan of the mission is one of the relaxation's, with at least its E[R] and its E[S]. An arc
    is as safe as for the kind that survives it best, and limits are the loosest of any kind. A
    reward counts on arrival, and wholly if any kind has a share in it. Where kinds start or end
    elsewhere than at the base, there is one start for all, with a safe arc of length 0 to each
    start, and one back from each end: a robot that stays where it starts goes there and back.
    """
    kinds, base = mission.kinds, mission.base
    graph: nx.DiGraph[Any] = nx.DiGraph(name=mission.name)
    for node, said in mission.graph.nodes(data=True):
        is_collected = max(by_kind(said.get("share", 1.0), kinds)) > 0.0
        graph.add_node(node, reward=said["reward"] if is_collected else 0.0)
    for tail, head, said in mission.graph.edges(data=True):
        if (survival := max(by_kind(said["survival"], kinds))) > 0.0:
            graph.add_edge(tail, head, survival=survival, length=said.get("length", 1.0))
    ends = [kind.ends(base) for kind in kinds]
    if any(pair != (base, base) for pair in ends):
        base = object()  # which is no label of the mission
        graph.add_node(base, reward=0.0)
        for start, end in ends:
            graph.add_edge(base, start, survival=1.0, length=0.0)
            graph.add_edge(end, base, survival=1.0, length=0.0)
    # Kinds need not get everywhere, a plain team has to.
    used = {base, *(nx.descendants(graph, base) & nx.ancestors(graph, base))}
    graph.remove_nodes_from([node for node in graph if node not in used])
    least, longest = float(limits.floors.min()), float(limits.budgets.max())
    budget = None if longest == math.inf else longest
    kind = Kind(ONLY_KIND, mission.robots, min_survival=least, max_length=budget)
    return Mission(graph, base=base, kinds=[kind])
