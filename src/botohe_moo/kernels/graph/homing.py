"""Whether, and by which way, a robot can get home within a survival floor and a travel budget."""

import math
from typing import NamedTuple

from botohe_moo._base.types import OffsetArray
from botohe_moo.kernels.compile import helper
from botohe_moo.kernels.graph.graph import Graph, Limits, measured_by_length
from botohe_moo.kernels.graph.paths import Paths, way_home


class Budget(NamedTuple):
    """A travel budget, for planners that look for ways home."""

    short: Graph  # the graph as ``measured_by_length`` gives it
    limits: Limits  # the budget and the survival floor


def new_budget(graph: Graph, limits: Limits) -> Budget | None:
    """Prepare a travel budget; None where the limits set none."""
    if limits.max_length == math.inf:
        return None
    return Budget(measured_by_length(graph), limits)


@helper
def way_within(
    graph: Graph,
    budget: Budget | None,
    paths: Paths,
    used: OffsetArray,
    trail: int,
    node: int,
    alive: float,
    length: float,
) -> int:
    """Write a way home that keeps both limits to ``paths.path``, as ``way_home`` does.

    ``alive`` and ``length`` are those of the robot's trail up to the node. The way is the safest
    one if that is short enough, otherwise the shortest one if that is safe enough. Where neither
    is, the result is −1: a way that compromises between both is not looked for. Without a budget
    it is ``way_home``, which keeps no limits.
    """
    if budget is None:
        return way_home(graph, paths, used, trail, node)
    short, limits = budget.short, budget.limits
    # What a way home takes at least, with every arc free.
    if length + short.home[node] > limits.max_length:
        return -1
    if alive * graph.home[node] < limits.min_survival:
        return -1
    n = way_home(graph, paths, used, trail, node)
    if n < 0 or _keeps(graph, paths, n, alive, length, limits):
        return n
    n = way_home(short, paths, used, trail, node)
    return n if _keeps(graph, paths, n, alive, length, limits) else -1


@helper
def _keeps(graph: Graph, paths: Paths, n: int, alive: float, length: float, limits: Limits) -> bool:
    """Return whether a trail that goes on by ``n`` arcs of ``paths.path`` keeps limits."""
    for i in range(n):
        alive *= graph.survival[paths.path[i]]
        length += graph.length[paths.path[i]]
    return alive >= limits.min_survival and length <= limits.max_length
