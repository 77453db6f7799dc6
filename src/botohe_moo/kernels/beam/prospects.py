"""What partial trails are worth: when they go home at once, by what lies ahead, and at most."""

from typing import Any, NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.core.compile import helper, inlined, kernel
from botohe_moo.core.graph import Graph, limit_at
from botohe_moo.core.paths import (
    ANYWHERE,
    Budget,
    Paths,
    leads_home,
    new_paths,
    search_paths,
    usual_way_home,
    way_within,
)
from botohe_moo.core.sharing import shared
from botohe_moo.kernels.beam.labels import Beam

# The share of what lies ahead and looks worth its danger that counts when labels are ranked.
# Measured on the case studies: without it, beams run home too early; above a half, too late.
FORESIGHT = 0.5

# Smaller gains, relative, are not searched for: they would be rounding, not reward.
TOLERANCE = 1e-12


class Near(NamedTuple):
    """For each node the other nodes that are safest to reach, the safest first.

    Where fewer can be reached, the rest of the row is the node itself with survival 0.
    """

    nodes: OffsetArray  # (n_nodes, n_near), n_near < n_nodes
    reach: FloatArray  # survival of the safest path to each of them (n_nodes, n_near)


class BeamRule(NamedTuple):
    """What to search for, and how widely; see ``best_trail``."""

    start: int  # where the trail begins
    worth: FloatArray  # what each node is worth to a robot that surely reaches it (n_nodes)
    # What a robot that is surely alive at a node loses of the worth of surviving when it goes home
    # by a near node, instead of by the safest way (n_nodes, n_near).
    danger: FloatArray
    survival_weight: float  # what surviving for sure is worth, at least 0
    least: float  # survival floor: the least probability to survive the trail; 0 sets none
    # Travel budget, with the survival floor; without a budget its code is not compiled.
    budget: Budget | None
    width: int  # labels that go on from each level, at least 1
    max_labels: int  # how many labels are kept at most


def find_near(graph: Graph, n_near: int) -> Near:
    """Find the ``n_near`` nodes that are safest to reach from each node."""
    shape = graph.n_nodes, min(n_near, graph.n_nodes - 1)
    near = Near(np.empty(shape, np.int64), np.empty(shape))
    _write_near(graph, new_paths(graph), np.zeros(graph.n_arcs, np.int64), near)
    return near


@kernel
def _write_near(graph: Graph, paths: Paths, used: OffsetArray, near: Near) -> None:
    graph, paths, near = shared(graph), shared(paths), shared(near)
    for source in range(near.nodes.shape[0]):
        _search_from(graph, paths, used, near, source)


# A helper of its own, since ``search_paths`` is compiled once for all helpers that call it, but
# again for a kernel that does.
@helper
def _search_from(graph: Graph, paths: Paths, used: OffsetArray, near: Near, source: int) -> None:
    n_near = near.nodes.shape[1]
    n = search_paths(graph, paths, used, 1, source, ANYWHERE, n_near + 1, False)
    alive = paths.distance  # which is not needed any more
    alive[source] = 1.0
    for i in range(n - 1, n_near):
        near.nodes[source, i], near.reach[source, i] = source, 0.0
    for i in range(n - 1):
        node = paths.order[i + 1]
        arc = paths.entry[node]
        alive[node] = alive[graph.tail[arc]] * graph.survival[arc]
        near.nodes[source, i], near.reach[source, i] = node, alive[node]


def dangers(graph: Graph, near: Near, survival_weight: float) -> FloatArray:
    """Return ``BeamRule.danger``."""
    home_after = near.reach * graph.home[near.nodes]
    return survival_weight * (graph.home[:, None] - home_after)


@helper
def write_gathered(graph: Graph, worth: FloatArray, gathered: FloatArray) -> None:
    """Write ``Beam.gathered``."""
    for node in range(gathered.shape[0]):
        at, alive, total = node, 1.0, 0.0
        while graph.homeward[at] >= 0:
            arc = graph.homeward[at]
            at = graph.head[arc]
            alive *= graph.survival[arc]
            total += alive * worth[at]
        gathered[node] = total + TOLERANCE * total


@inlined
def judge(near: Near, rule: BeamRule, ahead: FloatArray, child: Any, stay: float) -> None:
    """Write ``bound`` and ``rank`` of a child of the current label.

    The bound counts the most that all nodes not visited could bring together; the rank, what near
    nodes bring beyond the danger of going home by them. Near nodes that are too far from home for
    the travel budget do not count.
    """
    node = child.node
    n_nodes, n_near = near.nodes.shape
    most = promise = nearby = 0.0
    for i in range(n_near):
        there = near.nodes[node, i]
        worth = ahead[there]
        nearby += worth
        if is_too_far(rule.budget, there, child.length):
            continue
        brings = near.reach[node, i] * worth
        most += brings
        promise += max(0.0, brings - rule.danger[node, i])
    if n_near < n_nodes - 1:
        most += max(0.0, child.left - nearby) * near.reach[node, n_near - 1]
    child.bound = child.value + child.alive * most + stay
    child.rank = child.value + stay + FORESIGHT * child.alive * promise


@inlined
def has_no_limits(rule: BeamRule) -> bool:
    """Return whether a robot may take any way home."""
    return rule.least == 0.0 and rule.budget is None


@inlined
def is_hopeless(graph: Graph, rule: BeamRule, child: Any, stay: float, enough: float) -> bool:
    """Return whether a cheap test shows that a label breaks limits or is not worth ``enough``."""
    if is_too_far(rule.budget, child.node, child.length):
        return True
    most = child.value + child.alive * child.left + stay
    return bool(child.alive * graph.home[child.node] < rule.least or most <= enough)


@inlined
def is_too_far(budget: Budget | None, node: int, length: float) -> bool:
    """Return whether a trail of some length cannot visit a node within the travel budget."""
    if budget is None:
        return False
    longest = limit_at(budget.limits.max_length, budget.limits.budgets, node)
    return bool(length + budget.short.home[node] > longest)


@helper
def close(graph: Graph, rule: BeamRule, beam: Beam, child: Any, stay: float) -> tuple[float, float]:
    """Send a child of the current label home; return value and survival of the closed trail.

    The value is −1 where the trail cannot be better than the best one known. The survival is −1
    where no way leads home, or none is known that keeps the travel budget.
    """
    used, paths, node = beam.used, beam.paths, child.node
    value, survives = child.value, child.alive
    may_be_best = value + stay > beam.state[0].value or not has_no_limits(rule)
    if not may_be_best and usual_way_home(graph, paths, used, 1, node) < 0:
        back = graph.balanced or leads_home(graph, paths, used, 1, node)
        return -1.0, survives if back else -1.0
    n_hops = way_within(graph, rule.budget, paths, used, 1, node, survives, child.length)
    if n_hops < 0:
        return -1.0, -1.0
    for i in range(n_hops):
        arc = paths.path[i]
        survives *= graph.survival[arc]
        value += survives * beam.ahead[graph.head[arc]]
    return value + rule.survival_weight * survives, survives
