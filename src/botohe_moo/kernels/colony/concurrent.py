"""Ants that build trail plans with all robots out at once, which take one hop each in turn.

The walk graph, the weights of arcs, and what no walk may enter are those of ``construct``, where
one robot's trail is complete before the next robot's begins.
"""

import math

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.colony.construct import BLOCK, doubled, leads_home, survives_home, tabulate
from botohe_moo.kernels.compile import inline, kernel
from botohe_moo.kernels.rng import uniform


@inline
def _choose(
    head: IntArray,
    low: int,
    high: int,
    power: float,
    gain: FloatArray,
    seen: FloatArray,
    fresh: FloatArray,
    unreached: FloatArray,
    exploration: float,
    states: SeedArray,
    used: OffsetArray,
    visited: OffsetArray,
    robot: int,
    which: int,
    row: int,
    ant: int,
    cumulated: FloatArray,
) -> tuple[int, int]:
    """Draw one of the arcs ``low`` to ``high`` that a robot has not used.

    Gives the arc, and how many it was chosen among. ``used`` and ``visited`` are those of all
    robots; the ant's weights on the robot's map are ``seen[which, row]`` and ``fresh[which, row]``.
    Inlined: a call for every hop would cost a third more time.
    """
    n, last, total = 0, low, 0.0
    for arc in range(low, high):
        weight = 0.0
        if used[robot, arc] != ant:
            n += 1
            last = arc
            weight = seen[which, row, arc]
            if visited[robot, head[arc]] != ant:
                left = unreached[head[arc]]
                if left == 1.0:
                    weight = fresh[which, row, arc]
                else:
                    weight *= math.exp(power * math.log(1.0 + gain[arc] * left))
        total += weight
        cumulated[arc - low] = total
    if n == 1:
        return last, n
    drawn = uniform(states, ant) * (1.0 + exploration / n)
    arc = low
    if drawn < 1.0:
        drawn *= total
        while arc < high - 1 and cumulated[arc - low] <= drawn:
            arc += 1
    else:
        skip = min(n - 1, int((drawn - 1.0) / exploration * n * n))
        while used[robot, arc] == ant or skip > 0:
            skip -= used[robot, arc] != ant
            arc += 1
    return arc, n


@kernel
def _gather(
    hop_nodes: IntArray,
    hop_arcs: IntArray,
    hop_robots: IntArray,
    n_hops: int,
    size: int,
    nodes: IntArray,
    arcs: IntArray,
    lengths: OffsetArray,
) -> tuple[IntArray, IntArray]:
    """Write a plan's hops behind ``size`` others, robot after robot, and count each robot's.

    Gives the arrays with the nodes and arcs, larger ones where the plan would not have fitted.
    """
    while size + n_hops > nodes.shape[0]:
        nodes, arcs = doubled(nodes), doubled(arcs)
    lengths[:] = 0
    for hop in range(n_hops):
        lengths[hop_robots[hop]] += 1
    ends = size + np.cumsum(lengths)
    for hop in range(n_hops - 1, -1, -1):
        robot = hop_robots[hop]
        ends[robot] -= 1
        nodes[ends[robot]], arcs[ends[robot]] = hop_nodes[hop], hop_arcs[hop]
    return nodes, arcs


@kernel
def construct_concurrently(
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
    """Let the ants ``begin`` to ``end`` build one plan each, all robots at once.

    The robots take one hop each in turn, in their order, those that have ended their trails left
    out. η_R of a hop to a node that is not in the robot's own trail takes the probability that no
    other robot reaches the node by the trails as they are so far. Parameters, what is returned
    and all other rules are those of ``construct``: of a single robot both build the same plans.
    """
    n_nodes, n_arcs, n_maps = first.shape[0] - 1, head.shape[0], log_reward.shape[0]
    loop = first[base + 1] - 1
    lambda_step = 1.0 / (n_ants - 1) if n_ants > 1 else 0.0
    careful = not balanced or min_survival > 0.0

    seen_weight = np.empty((n_maps, BLOCK, n_arcs))
    fresh_weight = np.empty((n_maps, BLOCK, n_arcs))
    tabulated = np.full((n_maps, n_nodes), -1, np.int64)
    used = np.full((n_robots, n_arcs), -1, np.int64)
    visited = np.full((n_robots, n_nodes), -1, np.int64)
    here, alive = np.empty(n_robots, np.int32), np.empty(n_robots)
    unreached = np.ones(n_nodes)
    touched = np.empty(n_nodes, np.int32)
    cumulated = np.empty(n_arcs)
    hop_nodes, hop_arcs = np.empty(256, np.int32), np.empty(256, np.int32)
    hop_robots = np.empty(256, np.int32)
    rejected = np.empty(n_arcs, np.int32)
    met, stack = np.full(n_nodes, -1, np.int64), np.empty(n_nodes, np.int32)
    distance = np.empty(n_nodes)
    entry, path = np.empty(n_nodes, np.int32), np.empty(n_nodes, np.int32)
    keys, held = np.empty(n_arcs + 1), np.empty(n_arcs + 1, np.int32)
    n_touched = search = size = 0

    for ant in range(begin, end):
        block = ant // BLOCK
        lambda_first = block * BLOCK * lambda_step if n_ants > 1 else 0.5
        power = 1.0 - (ant * lambda_step if n_ants > 1 else 0.5)
        for i in range(n_touched):
            unreached[touched[i]] = 1.0
        n_touched = n_hops = turn = 0
        here[:], alive[:] = base, 1.0
        visited[:, base] = ant
        n_out = n_robots
        while n_out > 0:
            robot = turn
            turn = turn + 1 if turn + 1 < n_robots else 0
            if here[robot] < 0:  # its trail has ended
                continue
            which = robot if n_maps > 1 else 0
            low, high = first[here[robot]], first[here[robot] + 1]
            if tabulated[which, here[robot]] != block:
                tabulated[which, here[robot]] = block
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
            n_rejected = 0
            while True:
                arc, n = _choose(
                    head,
                    low,
                    high,
                    power,
                    gain,
                    seen_weight,
                    fresh_weight,
                    unreached,
                    exploration,
                    states,
                    used,
                    visited,
                    robot,
                    which,
                    ant - block * BLOCK,
                    ant,
                    cumulated,
                )
                used[robot, arc] = ant
                if not careful or n == 1 or arc == loop:
                    break
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
                        used[robot],
                        ant,
                        alive[robot] * survival[arc],
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
                        used[robot],
                        ant,
                        met,
                        search,
                        stack,
                    )
                if safe:
                    break
                rejected[n_rejected] = arc
                n_rejected += 1
            for i in range(n_rejected):
                used[robot, rejected[i]] = -1
            if n_hops == hop_nodes.shape[0]:
                hop_nodes, hop_arcs = doubled(hop_nodes), doubled(hop_arcs)
                hop_robots = doubled(hop_robots)
            hop_nodes[n_hops], hop_arcs[n_hops], hop_robots[n_hops] = here[robot], arc, robot
            n_hops += 1
            if arc == loop:
                here[robot] = -1
                n_out -= 1
                continue
            alive[robot] *= survival[arc]
            node = head[arc]
            here[robot] = node
            if visited[robot, node] != ant:
                visited[robot, node] = ant
                before = unreached[node]
                unreached[node] = before * (1.0 - alive[robot])
                if before == 1.0 and unreached[node] < 1.0:
                    touched[n_touched] = node
                    n_touched += 1
        plan = lengths[ant * n_robots : (ant + 1) * n_robots]
        nodes, arcs = _gather(hop_nodes, hop_arcs, hop_robots, n_hops, size, nodes, arcs, plan)
        size += n_hops
    return nodes, arcs, size
