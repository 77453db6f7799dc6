"""Ants that build trail plans hop by hop.

All kernels here see the walk graph: the mission's arcs grouped by tail node, and the base's
self-loop as the last arc that leaves the base.
"""

import math

import numpy as np

from botohe_moo._types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.compile import kernel
from botohe_moo.kernels.rng import uniform

# Ants whose weights are tabulated together: enough to share the exponentials, few enough that
# the tables of a small mission stay in the fastest cache. Threads share out whole blocks.
BLOCK = 25


@kernel
def _leads_home(
    first: OffsetArray,
    head: IntArray,
    homeward: IntArray,
    base: int,
    node: int,
    opened: OffsetArray,
    opening: int,
    current: FloatArray,
    met: OffsetArray,
    search: int,
    stack: IntArray,
) -> bool:
    """Tell whether arcs that this trail has not used lead from ``node`` to the base.

    First along ``homeward``, from each node its arc on a shortest way home: cheap, and nearly
    always enough. Then by depth-first search; ``met`` holds the last search that met a node.
    """
    here = node
    while here != base:
        arc = homeward[here]
        if opened[here] == opening and current[arc] == 0.0:
            break
        here = head[arc]
    if here == base:
        return True
    stack[0] = node
    met[node] = search
    height = 1
    while height > 0:
        height -= 1
        here = stack[height]
        for arc in range(first[here], first[here + 1]):
            there = head[arc]
            if met[there] == search or (opened[here] == opening and current[arc] == 0.0):
                continue
            if there == base:
                return True
            met[there] = search
            stack[height] = there
            height += 1
    return False


@kernel
def _tabulate(
    log_reward: FloatArray,
    log_survival: FloatArray,
    log_fresh: FloatArray,
    low: int,
    high: int,
    weight: float,
    step: float,
    seen: FloatArray,
    fresh: FloatArray,
) -> None:
    """Fill in the weights of the arcs ``low`` to ``high`` for every ant of a block.

    Ants' weights on survival are evenly spaced, so that an arc's weight is a geometric
    progression over the ants: a few exponentials serve the whole block.
    """
    for arc in range(low, high):
        slope = log_survival[arc] - log_reward[arc]
        value = math.exp(log_reward[arc] + weight * slope)
        ratio = math.exp(step * slope)
        factor = math.exp((1.0 - weight) * log_fresh[arc])
        factor_ratio = math.exp(-step * log_fresh[arc])
        for i in range(seen.shape[0]):
            seen[i, arc] = value
            fresh[i, arc] = value * factor
            value *= ratio
            factor *= factor_ratio


@kernel
def _choose(
    current: FloatArray,
    low: int,
    high: int,
    exploration: float,
    states: SeedArray,
    ant: int,
    cumulated: FloatArray,
) -> int:
    """Draw one of the arcs ``low`` to ``high`` by weight, those of weight 0 never.

    With probability (exploration / n) / (1 + exploration / n), n the number of candidates, all
    candidates are equally likely: the floor of exploration · (mean weight) / n on every weight.
    """
    total = 0.0
    for arc in range(low, high):
        total += current[arc]
        cumulated[arc - low] = total
    drawn = uniform(states, ant)
    if exploration > 0.0:
        n = 0
        for arc in range(low, high):
            n += current[arc] > 0.0
        drawn *= 1.0 + exploration / n
        if drawn >= 1.0:
            skip = min(n - 1, int((drawn - 1.0) / exploration * n * n))
            arc = low
            while current[arc] == 0.0 or skip > 0:
                skip -= current[arc] > 0.0
                arc += 1
            return arc
    drawn *= total
    arc = low
    for i in range(high - low - 1):
        arc += cumulated[i] <= drawn
    return arc


@kernel
def construct(
    first: OffsetArray,
    head: IntArray,
    survival: FloatArray,
    entering_first: OffsetArray,
    entering: IntArray,
    entering_tail: IntArray,
    homeward: IntArray,
    base: int,
    balanced: bool,
    log_reward: FloatArray,
    log_survival: FloatArray,
    gain: FloatArray,
    log_fresh: FloatArray,
    exploration: float,
    n_robots: int,
    n_ants: int,
    begin: int,
    end: int,
    states: SeedArray,
    nodes: IntArray,
    arcs: IntArray,
    lengths: OffsetArray,
):
    """x."""
    n_nodes = first.shape[0] - 1
    n_arcs = head.shape[0]
    n_maps = log_reward.shape[0]
    loop = first[base + 1] - 1
    step = 1.0 / (n_ants - 1) if n_ants > 1 else 0.0

    seen_weight = np.empty((n_maps, BLOCK, n_arcs))
    fresh_weight = np.empty((n_maps, BLOCK, n_arcs))
    tabulated = np.full((n_maps, n_nodes), -1, np.int64)
    opened = np.full(n_nodes, -1, np.int64)
    current = np.empty(n_arcs)
    visited = np.full(n_nodes, -1, np.int64)
    visits = np.empty(n_nodes, np.int32)
    unreached = np.ones(n_nodes)
    touched = np.empty(n_nodes, np.int32)
    n_touched = 0
    cumulated = np.empty(n_arcs)
    met = np.full(n_nodes, -1, np.int64)
    search = 0
    stack = np.empty(n_nodes, np.int32)
    rejected = np.empty(n_arcs, np.int32)
    rejected_weight = np.empty(n_arcs)

    size = 0
    trail = 0
    for block in range(begin, end, BLOCK):
        for i in range(min(BLOCK, end - block)):
            ant = block + i
            power = 1.0 - ant * step if n_ants > 1 else 0.5
            for t in range(n_touched):
                unreached[touched[t]] = 1.0
            n_touched = 0
            for robot in range(n_robots):
                which = robot if n_maps > 1 else 0
                opening = ant * n_maps + which
                seen = seen_weight[which, i]
                fresh = fresh_weight[which, i]
                trail += 1
                start = size
                here = base
                alive = 1.0
                visited[base] = trail
                n_visits = 0
                while True:
                    if size >= nodes.shape[0]:
                        larger = np.empty(2 * size, np.int32)
                        larger[:size] = nodes
                        nodes = larger
                        larger = np.empty(2 * size, np.int32)
                        larger[:size] = arcs
                        arcs = larger
                    low, high = first[here], first[here + 1]
                    if opened[here] != opening:
                        opened[here] = opening
                        if tabulated[which, here] != block:
                            tabulated[which, here] = block
                            _tabulate(
                                log_reward[which],
                                log_survival[which],
                                log_fresh,
                                low,
                                high,
                                block * step if n_ants > 1 else 0.5,
                                step,
                                seen_weight[which],
                                fresh_weight[which],
                            )
                        for arc in range(low, high):
                            there = head[arc]
                            if visited[there] == trail:
                                current[arc] = seen[arc]
                            elif unreached[there] == 1.0:
                                current[arc] = fresh[arc]
                            else:
                                current[arc] = seen[arc] * math.exp(
                                    power * math.log(1.0 + gain[arc] * unreached[there])
                                )
                    arc = _choose(current, low, high, exploration, states, ant, cumulated)
                    if not balanced and arc != loop:
                        n_rejected = 0
                        while arc != loop:
                            kept = current[arc]
                            current[arc] = 0.0
                            search += 1
                            if _leads_home(
                                first,
                                head,
                                homeward,
                                base,
                                head[arc],
                                opened,
                                opening,
                                current,
                                met,
                                search,
                                stack,
                            ):
                                break
                            rejected[n_rejected] = arc
                            rejected_weight[n_rejected] = kept
                            n_rejected += 1
                            arc = _choose(current, low, high, exploration, states, ant, cumulated)
                        for r in range(n_rejected):
                            current[rejected[r]] = rejected_weight[r]
                    nodes[size] = here
                    arcs[size] = arc
                    size += 1
                    if arc == loop:
                        break
                    alive *= survival[arc]
                    here = head[arc]
                    if visited[here] != trail:
                        visited[here] = trail
                        for e in range(entering_first[here], entering_first[here + 1]):
                            current[entering[e]] = seen[entering[e]]
                        visits[n_visits] = here
                        n_visits += 1
                        before = unreached[here]
                        unreached[here] = before * (1.0 - alive)
                        if before == 1.0 and unreached[here] < 1.0:
                            touched[n_touched] = here
                            n_touched += 1
                    current[arc] = 0.0
                lengths[ant * n_robots + robot] = size - start
                if n_maps == 1 and robot < n_robots - 1:
                    for e in range(entering_first[base], entering_first[base + 1]):
                        current[entering[e]] = seen[entering[e]]
                    for v in range(n_visits):
                        node = visits[v]
                        left = unreached[node]
                        for e in range(entering_first[node], entering_first[node + 1]):
                            if opened[entering_tail[e]] == opening:
                                arc = entering[e]
                                current[arc] = seen[arc] * math.exp(
                                    power * math.log(1.0 + gain[arc] * left)
                                )
    return nodes, arcs, size
