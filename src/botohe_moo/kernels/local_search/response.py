"""Best response: all trails of one robot that improve the front, the others' being fixed.

A depth-first search over all closed trails of a small mission, cut off where an upper bound of what
can still be collected and survived shows that the front has a plan as good: branch and bound as in
Land and Doig, "An automatic method of solving discrete programming problems", Econometrica 28(3),
1960, with a front in place of the best solution. It finds changes of a whole trail that no sequence
of smaller ones leads to.
"""

from botohe_moo._types import FloatArray, SeedArray
from botohe_moo.kernels.compile import routine
from botohe_moo.kernels.local_search.front import Front, best_reward, has_room
from botohe_moo.kernels.local_search.members import bring_in, put_in_order
from botohe_moo.kernels.local_search.parent import NEVER, Ground, Workspace
from botohe_moo.kernels.local_search.rule import TOLERANCE, SearchRule
from botohe_moo.kernels.local_search.trail_store import TrailStore, add_trail, fits, release

# How the search has ended.
THROUGH = 0
TOO_LONG = 1
STOPPED = 2  # by the budget, or for lack of room


@routine
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
    n = 0
    most = reward
    for node in range(ground.reach.shape[0]):
        if work.met[node] != NEVER or node == here or work.left[node] == 0.0:
            continue
        there = alive * ground.reach[here, node]
        home = there * ground.reach[node, ground.base]
        most += work.left[node] * there
        place = n
        while place > 0 and work.product[place - 1] < home:
            work.product[place] = work.product[place - 1]
            work.later_gain[place] = work.later_gain[place - 1]
            place -= 1
        work.product[place], work.later_gain[place] = home, work.left[node] * there
        n += 1
    home = alive * ground.reach[here, ground.base]
    if best_reward(front, (survivors + home) * (1.0 - TOLERANCE)) >= most * (1.0 - TOLERANCE):
        return True
    for i in range(n + 1):
        # With the first i nodes visited the robot survives with at most this probability.
        if i > 0:
            home = work.product[i - 1]
            reward += work.later_gain[i - 1]
        if i < n and work.product[i] == home:
            continue
        if best_reward(front, (survivors + home) * (1.0 - TOLERANCE)) < reward * (1.0 - TOLERANCE):
            return False
    return True


@routine
def respond(
    ground: Ground,
    store: TrailStore,
    front: Front,
    work: Workspace,
    rule: SearchRule,
    newest: FloatArray,
    robot: int,
    others: float,
    survivors_of_others: float,
    n_evaluations: int,
    states: SeedArray,
) -> tuple[int, int, int]:
    """Bring into the front all plans that improve it by another trail of one robot.

    Parameters
    ----------
    ground, store, front, work, rule, newest, states
        As for ``search``; the other robots have been set aside, and no trail is laid out.
    robot
        Which robot's trail is searched.
    others, survivors_of_others
        E[R] and E[S] of the other robots.
    n_evaluations
        Plans to be evaluated at most: one each time the robot is back at base.

    Returns
    -------
    tuple
        How it ended (``THROUGH`` to ``STOPPED``), how many plans were evaluated, and how many
        entered.
    """
    first, head, base = ground.first, ground.head, ground.base
    longest = head.shape[0]
    depth = n = n_entered = 0
    n_hops = rule.n_response_hops
    ended = THROUGH
    work.node[0] = base
    work.alive[0], work.gained[0] = 1.0, 0.0
    work.met[base] = 0
    work.onward[0] = first[base]
    while True:
        here = work.node[depth]
        if ended != THROUGH or work.onward[depth] == first[here + 1]:
            if depth == 0:
                break
            if work.met[here] == depth:
                work.met[here] = NEVER
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
        gained = work.gained[depth]
        if work.met[node] == NEVER:
            gained += work.left[node] * alive
        if alive * ground.reach[node, base] < rule.min_survival:
            continue
        if _hopeless(ground, front, work, node, alive, others + gained, survivors_of_others):
            continue
        work.arc[depth], work.position[arc] = arc, depth
        depth += 1
        work.node[depth] = node
        work.alive[depth], work.gained[depth] = alive, gained
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
        newest[1] += 1.0
        survivors = survivors_of_others + alive
        if (others + gained) * (1.0 - TOLERANCE) > best_reward(
            front, survivors * (1.0 - TOLERANCE)
        ):
            trail = add_trail(head, ground.survival, ground.reward, base, store, work.arc, depth)
            store.n_users[trail] += 1
            put_in_order(store, work, robot, trail)
            n_entered += bring_in(ground, store, front, work, rule, newest, states)
            release(store, trail)
    work.met[base] = NEVER
    return ended, n, n_entered
