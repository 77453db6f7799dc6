"""Best response: trails of one robot that improve the front, the others' being fixed.

A depth-first search over all closed trails of a small mission, cut off where an upper bound of what
can still be collected and survived shows that the front has a plan as good: branch and bound as in
Land and Doig, "An automatic method of solving discrete programming problems", Econometrica 28(3),
1960, with a front in place of the best solution. It finds changes of a whole trail that no sequence
of smaller ones leads to: all of them, or, where that takes too long, all but those that a cut by
what has been visited before may miss.
"""

import numpy as np

from botohe_moo._base.types import FloatArray, SeedArray
from botohe_moo.kernels.compile import part, routine
from botohe_moo.kernels.local_search.front import Front, best_reward, has_room
from botohe_moo.kernels.local_search.members import bring_in, put_in_order
from botohe_moo.kernels.local_search.parent import MARK, N_KNOWN, NEVER, Ground, Workspace
from botohe_moo.kernels.local_search.rule import IDLE, TOLERANCE, SearchRule
from botohe_moo.kernels.local_search.trail_store import TrailStore, add_trail, fits, release

# How the search has ended.
THROUGH = 0
TOO_LONG = 1
STOPPED = 2  # by the budget, or for lack of room


@part
def _hopeless(
    ground: Ground,
    front: Front,
    work: Workspace,
    here: int,
    alive: float,
    reward: float,
    survivors: float,
) -> bool:
    """Tell whether no way on from here can improve the front.

    To visit a node and get home costs at least the safest way there and home. So the robot
    collects, for every survival that may be left to it, at most what lies within that; and the
    front has a plan as good for each.

    Parameters
    ----------
    ground, front, work
        The mission, the front, and what the trail has visited.
    here, alive
        Where the robot is, and with what probability.
    reward, survivors
        E[R] of the plan as far as the trail goes, and E[S] of the other robots.
    """
    home = alive * ground.home[here]
    needed = best_reward(front, (survivors + home) * (1.0 - TOLERANCE))
    if reward * (1.0 - TOLERANCE) > needed:
        return False
    for i in range(ground.by_return.shape[1]):
        # With the nodes up to this one visited the robot survives with at most this probability.
        node = ground.by_return[here, i]
        there = alive * ground.return_reach[here, i]
        reward += work.fresh[node] * there
        if reward * (1.0 - TOLERANCE) <= needed:
            continue
        home = there * ground.home[node]
        needed = best_reward(front, (survivors + home) * (1.0 - TOLERANCE))
        if reward * (1.0 - TOLERANCE) > needed:
            return False
    return True


@part
def _is_known(work: Workspace, call: int, key: np.uint64, alive: float, gained: float) -> bool:
    """Tell whether a robot was here, no worse, having visited the same; if not, note that it is."""
    at = int(key & np.uint64(N_KNOWN - 1))
    same = work.known_to[at] == call and work.known[at] == key
    if same and work.known_alive[at] >= alive and work.known_gained[at] >= gained:
        return True
    work.known_to[at], work.known[at] = call, key
    work.known_alive[at], work.known_gained[at] = alive, gained
    return False


@routine
def respond(
    ground: Ground,
    store: TrailStore,
    front: Front,
    work: Workspace,
    rule: SearchRule,
    remembered: FloatArray,
    robot: int,
    others: float,
    survivors_of_others: float,
    n_evaluations: int,
    rough: bool,
    states: SeedArray,
) -> tuple[int, int, int]:
    """Bring into the front the plans that improve it by another trail of one robot.

    Parameters
    ----------
    ground, store, front, work, rule, remembered, states
        As for ``search``; the other robots have been set aside, and no trail is laid out.
    robot
        Which robot's trail is searched.
    others, survivors_of_others
        E[R] and E[S] of the other robots.
    n_evaluations
        Plans to be evaluated at most: one each time the robot is back at base.
    rough
        Whether to cut off a trail also where a robot was here before, no worse, having visited the
        same. It had perhaps used other arcs, so that it could not go on the same way: trails may be
        missed. If not, the search is given up after an eighth of the hops.

    Returns
    -------
    tuple
        How it ended (``THROUGH`` to ``STOPPED``), how many hops it took, and how many plans were
        evaluated.
    """
    first, head, base = ground.first, ground.head, ground.base
    longest, n_nodes = head.shape[0], ground.reward.shape[0]
    depth = n = 0
    n_hops = most_hops = rule.n_hops if rough else rule.n_hops // 8
    ended = THROUGH
    work.now[MARK] += 1
    call = work.now[MARK]
    work.node[0] = base
    work.visited[0] = np.uint64(0)
    work.alive[0], work.gained[0] = 1.0, 0.0
    work.met[base] = 0
    for node in range(n_nodes):
        work.fresh[node] = work.left[node]
    work.onward[0] = first[base]
    while True:
        here = work.node[depth]
        if ended != THROUGH or work.onward[depth] == first[here + 1]:
            if depth == 0:
                break
            if work.met[here] == depth:
                work.met[here] = NEVER
                work.fresh[here] = work.left[here]
            depth -= 1
            work.position[work.arc[depth]] = -1
            continue
        arc = work.onward[depth]
        work.onward[depth] += 1
        if work.position[arc] >= 0:
            continue
        n_hops -= 1
        if n_hops < 0:
            ended = TOO_LONG
            continue
        node = head[arc]
        alive = work.alive[depth] * ground.survival[arc]
        gained, visited = work.gained[depth], work.visited[depth]
        if work.met[node] == NEVER and work.left[node] > 0.0:
            gained += work.left[node] * alive
            visited ^= ground.key[node]
        if alive * ground.home[node] < rule.min_survival:
            continue
        key = visited ^ ground.key[n_nodes + node]
        if rough and _is_known(work, call, key, alive, gained):
            continue
        work.fresh[node] = 0.0
        if _hopeless(ground, front, work, node, alive, others + gained, survivors_of_others):
            if work.met[node] == NEVER:
                work.fresh[node] = work.left[node]
            continue
        work.arc[depth], work.position[arc] = arc, depth
        depth += 1
        work.node[depth] = node
        work.alive[depth], work.gained[depth], work.visited[depth] = alive, gained, visited
        if work.met[node] == NEVER:
            work.met[node] = depth
        work.onward[depth] = first[node]
        if node != base:
            continue
        if n == n_evaluations or not (
            fits(store, 1, longest, ground.most_visits) and has_room(front, 1)
        ):
            ended = STOPPED
            continue
        n += 1
        remembered[IDLE] += 1.0
        survivors = survivors_of_others + alive
        if (others + gained) * (1.0 - TOLERANCE) > best_reward(
            front, survivors * (1.0 - TOLERANCE)
        ):
            trail = add_trail(head, ground.survival, ground.reward, base, store, work.arc, depth)
            store.n_users[trail] += 1
            put_in_order(store, work, robot, trail)
            bring_in(ground, store, front, work, rule, remembered, states)
            release(store, trail)
    work.met[base] = NEVER
    return ended, most_hops - max(0, n_hops), n
