"""Ants that build trail plans hop by hop.

The kernels here see the walk graph: the mission's arcs grouped by tail node, and the base's
self-loop, which ends a trail, as the last arc that leaves the base.
"""

import math

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.compile import kernel
from botohe_moo.kernels.graph.old_paths import way_home
from botohe_moo.kernels.rng import uniform

# Ants whose weights are tabulated together: enough to share the exponentials, few enough that
# the tables of a small mission stay in the fastest caches.
BLOCK = 50

# Up to this many arcs a scan that stops early beats one without branches (measured).
_SHORT_SCAN = 5


@kernel
def leads_home(
    first: OffsetArray,
    head: IntArray,
    homeward: IntArray,
    base: int,
    node: int,
    used: OffsetArray,
    trail: int,
    met: OffsetArray,
    search: int,
    stack: IntArray,
) -> bool:
    """Tell whether arcs that a trail has not used lead from ``node`` to the base.

    First along ``homeward``: cheap, and nearly always enough. Then by depth-first search.

    Parameters
    ----------
    first, head, homeward, base
        The walk graph; ``homeward`` is each node's arc on some shortest way home.
    node
        Where the way home begins.
    used, trail
        Arc a is used where ``used[a] == trail``.
    met, search
        Scratch (n_nodes): the last search that met a node; the number of this search.
    stack
        Scratch (n_nodes).
    """
    here = node
    while here != base and used[homeward[here]] != trail:
        here = head[homeward[here]]
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
            if used[arc] == trail or met[there] == search:
                continue
            if there == base:
                return True
            met[there] = search
            stack[height] = there
            height += 1
    return False


@kernel
def survives_home(
    first: OffsetArray,
    tail: IntArray,
    head: IntArray,
    cost: FloatArray,
    survival: FloatArray,
    homeward: IntArray,
    home: FloatArray,
    base: int,
    node: int,
    used: OffsetArray,
    trail: int,
    alive: float,
    least: float,
    search: int,
    met: OffsetArray,
    distance: FloatArray,
    entry: IntArray,
    keys: FloatArray,
    held: IntArray,
    path: IntArray,
) -> bool:
    """Tell whether a robot that reaches ``node`` with probability ``alive`` can keep a floor.

    It can if it gets home over arcs that its trail has not used with probability ``least`` or
    more. Parameters are those of ``way_home``, and ``home``, the survival of the safest way home.
    """
    if alive * home[node] < least:
        return False
    n = way_home(
        first,
        tail,
        head,
        cost,
        homeward,
        base,
        used,
        trail,
        node,
        search,
        met,
        distance,
        entry,
        keys,
        held,
        path,
    )
    if n < 0:
        return False
    for i in range(n):
        alive *= survival[path[i]]
    return alive >= least


@kernel
def tabulate(
    log_reward: FloatArray,
    log_survival: FloatArray,
    log_fresh: FloatArray,
    low: int,
    high: int,
    lambda_first: float,
    lambda_step: float,
    seen: FloatArray,
    fresh: FloatArray,
) -> None:
    """Fill in the weights of the arcs ``low`` to ``high`` for every ant of a block.

    The ants' λ are evenly spaced, so that an arc's weight is a geometric progression over the
    ants: a few exponentials serve the whole block.

    Parameters
    ----------
    log_reward, log_survival, log_fresh
        As for ``construct``, of one map (n_arcs).
    low, high
        Which arcs.
    lambda_first, lambda_step
        λ of the block's first ant, and how much more each further one has.
    seen, fresh
        Output: the weights (``BLOCK``, n_arcs) for a head already in the trail, and for one that
        no robot reaches yet.
    """
    for arc in range(low, high):
        slope = log_survival[arc] - log_reward[arc]
        weight = math.exp(log_reward[arc] + lambda_first * slope)
        ratio = math.exp(lambda_step * slope)
        factor = math.exp((1.0 - lambda_first) * log_fresh[arc])
        factor_ratio = math.exp(-lambda_step * log_fresh[arc])
        for i in range(seen.shape[0]):
            seen[i, arc] = weight
            fresh[i, arc] = weight * factor
            weight *= ratio
            factor *= factor_ratio


@kernel
def construct(
    first: OffsetArray,
    head: IntArray,
    survival: FloatArray,
    tail: IntArray,
    cost: FloatArray,
    homeward: IntArray,
    home: FloatArray,
    base: int,
    balanced: bool,
    log_reward: FloatArray,
    log_survival: FloatArray,
    gain: FloatArray,
    log_fresh: FloatArray,
    exploration: float,
    min_survival: float,
    n_robots: int,
    n_ants: int,
    begin: int,
    end: int,
    states: SeedArray,
    nodes: IntArray,
    arcs: IntArray,
    lengths: OffsetArray,
) -> tuple[IntArray, IntArray, int]:
    """Let the ants ``begin`` to ``end`` build one plan each, robot after robot.

    An ant at a node weighs each arc a that this trail has not used yet with
    (τ_R η_R)^(1 − λ) (τ_S η_S)^λ, where η_R is ``1 + gain[a] · (probability that no earlier robot
    reaches its head)`` times that of a head already in this trail.

    Where some node has more arcs in than out (not ``balanced``), an arc from which no unused arcs
    lead home is drawn again: the walk never enters a dead end. Likewise for an arc from which the
    robot could not get home with probability ``min_survival`` over all.

    Parameters
    ----------
    first, head, survival, tail, cost, homeward, home, base, balanced
        The walk graph (see ``WalkGraph``).
    log_reward, log_survival
        log(τ_R η_R), with η_R that of a head already in this trail, and log(τ_S η_S)
        (n_maps, n_arcs); one map a robot, or one that all robots share.
    gain, log_fresh
        What a head that no robot reaches yet adds to η_R, relative, and log(1 + gain) (n_arcs).
    exploration
        Every weight is raised by exploration · (mean weight) / (number of candidates).
    min_survival
        Survival floor: the least probability with which every robot gets home; 0 sets none.
    n_robots
        Trails per plan.
    n_ants
        Size of the colony: ant i has λ = i / (n_ants − 1), a single ant λ = 1/2.
    begin, end
        Which ants build now. What an ant builds depends on its own random numbers only.
    states
        State of each ant's random numbers (n_ants, 2), advanced.
    nodes, arcs
        Where to write; larger arrays take their place when they are full.
    lengths
        Output: nodes of each trail (n_ants · n_robots).

    Returns
    -------
    tuple
        The nodes of the trails one after another, the arc that leaves each (at the end of a trail
        the self-loop), and how many there are; the arrays may be longer.
    """
    n_nodes, n_arcs, n_maps = first.shape[0] - 1, head.shape[0], log_reward.shape[0]
    loop = first[base + 1] - 1
    lambda_step = 1.0 / (n_ants - 1) if n_ants > 1 else 0.0

    seen_weight = np.empty((n_maps, BLOCK, n_arcs))
    fresh_weight = np.empty((n_maps, BLOCK, n_arcs))
    tabulated = np.full((n_maps, n_nodes), -1, np.int64)
    used = np.full(n_arcs, -1, np.int64)
    visited = np.full(n_nodes, -1, np.int64)
    unreached = np.ones(n_nodes)
    touched = np.empty(n_nodes, np.int32)
    cumulated = np.empty(n_arcs)
    met = np.full(n_nodes, -1, np.int64)
    stack = np.empty(n_nodes, np.int32)
    rejected = np.empty(n_arcs, np.int32)
    careful = not balanced or min_survival > 0.0
    distance = np.empty(n_nodes)
    entry, path = np.empty(n_nodes, np.int32), np.empty(n_nodes, np.int32)
    keys, held = np.empty(n_arcs + 1), np.empty(n_arcs + 1, np.int32)
    n_touched = n_rejected = search = size = 0

    for ant in range(begin, end):
        block = ant // BLOCK
        lambda_first = block * BLOCK * lambda_step if n_ants > 1 else 0.5
        power = 1.0 - (ant * lambda_step if n_ants > 1 else 0.5)
        for i in range(n_touched):
            unreached[touched[i]] = 1.0
        n_touched = 0
        for robot in range(n_robots):
            trail = ant * n_robots + robot
            which = robot if n_maps > 1 else 0
            seen = seen_weight[which, ant - block * BLOCK]
            fresh = fresh_weight[which, ant - block * BLOCK]
            here, alive, start = base, 1.0, size
            visited[base] = trail
            while True:
                low, high = first[here], first[here + 1]
                if tabulated[which, here] != block:
                    tabulated[which, here] = block
                    tabulate(
                        log_reward[which],
                        log_survival[which],
                        log_fresh,
                        low,
                        high,
                        lambda_first,
                        lambda_step,
                        seen_weight[which],
                        fresh_weight[which],
                    )
                n = 0
                total = 0.0
                arc = low
                for a in range(low, high):
                    weight = 0.0
                    if used[a] != trail:
                        n += 1
                        arc = a
                        weight = seen[a]
                        if visited[head[a]] != trail:
                            left = unreached[head[a]]
                            if left == 1.0:
                                weight = fresh[a]
                            else:
                                weight *= math.exp(power * math.log(1.0 + gain[a] * left))
                    total += weight
                    cumulated[a - low] = total
                # Drawing in a function of its own would cost a sixth more time.
                if n > 1:
                    drawn = uniform(states, ant) * (1.0 + exploration / n)
                    if drawn < 1.0:
                        drawn *= total
                        arc = low
                        if high - low > _SHORT_SCAN:
                            for c in range(high - low - 1):
                                arc += cumulated[c] <= drawn
                        else:
                            while arc < high - 1 and cumulated[arc - low] <= drawn:
                                arc += 1
                    else:
                        skip = min(n - 1, int((drawn - 1.0) / exploration * n * n))
                        arc = low
                        while used[arc] == trail or skip > 0:
                            skip -= used[arc] != trail
                            arc += 1
                used[arc] = trail
                if careful:
                    if n > 1 and arc != loop:
                        search += 1
                        if min_survival > 0.0:
                            safe = survives_home(
                                first,
                                tail,
                                head,
                                cost,
                                survival,
                                homeward,
                                home,
                                base,
                                head[arc],
                                used,
                                trail,
                                alive * survival[arc],
                                min_survival,
                                search,
                                met,
                                distance,
                                entry,
                                keys,
                                held,
                                path,
                            )
                        else:
                            safe = leads_home(
                                first,
                                head,
                                homeward,
                                base,
                                head[arc],
                                used,
                                trail,
                                met,
                                search,
                                stack,
                            )
                        if not safe:
                            rejected[n_rejected] = arc
                            n_rejected += 1
                            continue
                    for i in range(n_rejected):
                        used[rejected[i]] = -1
                    n_rejected = 0
                if size == nodes.shape[0]:
                    nodes, arcs = doubled(nodes), doubled(arcs)
                nodes[size] = here
                arcs[size] = arc
                size += 1
                if arc == loop:
                    break
                alive *= survival[arc]
                here = head[arc]
                if visited[here] != trail:
                    visited[here] = trail
                    before = unreached[here]
                    unreached[here] = before * (1.0 - alive)
                    if before == 1.0 and unreached[here] < 1.0:
                        touched[n_touched] = here
                        n_touched += 1
            lengths[trail] = size - start
    return nodes, arcs, size


@kernel
def doubled(array: IntArray) -> IntArray:
    """Copy ``array`` into one of twice its size."""
    larger = np.empty(2 * array.shape[0], np.int32)
    larger[: array.shape[0]] = array
    return larger
