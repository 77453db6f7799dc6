"""Pareto local search: parents from a front, children of one changed trail, back into it."""

from botohe_moo._base.types import FloatArray, SeedArray
from botohe_moo.kernels.compile import frugal, part, routine
from botohe_moo.kernels.local_search.children import (
    adopt,
    appraise,
    change,
    draw_kind,
    draw_trail,
    write_child,
)
from botohe_moo.kernels.local_search.choose import (
    WHEN_IDLE,
    draw_parent,
    keep_in_reserve,
    take_safest,
)
from botohe_moo.kernels.local_search.front import (
    N_BLOCKS,
    Front,
    best_reward,
    draw_place,
    has_room,
)
from botohe_moo.kernels.local_search.members import bring_in, empty, enter, put_in_order
from botohe_moo.kernels.local_search.moves import ADOPT
from botohe_moo.kernels.local_search.parent import (
    LENGTH,
    WANTED,
    Ground,
    Workspace,
    clear_others,
    clear_trail,
    lay_out,
    set_aside,
)
from botohe_moo.kernels.local_search.response import THROUGH, TOO_LONG, respond
from botohe_moo.kernels.local_search.routes import Routes, search_routes
from botohe_moo.kernels.local_search.rule import (
    CREDIT,
    FAILED,
    FOUND,
    IDLE,
    NEWEST,
    NOBODY,
    ROUGH,
    TOLERANCE,
    Reserve,
    SearchRule,
    most_new,
)
from botohe_moo.kernels.local_search.trail_store import (
    TrailStore,
    add_trail,
    fits,
    release,
)
from botohe_moo.kernels.rng import uniform

# Parents in a row without any child, after which there is nothing left to try.
MAX_FRUITLESS = 10_000

# Trails of a robot's front that go to the reserve, with the other robots', when it is left.
_N_KEPT = 4

# How many more best responses may be given up than found.
_N_FAILURES = 2.0


@part
def _may_respond(remembered: FloatArray) -> bool:
    """Tell whether hops are left for a best response, and enough of them have been found."""
    return bool(remembered[CREDIT] >= 0.0 and remembered[FAILED] <= remembered[FOUND] + _N_FAILURES)


@part
def _is_good(reward: float, needed: float, slack: float) -> tuple[bool, bool]:
    """Tell whether a plan of so much reward enters, and if not, whether it does so nearly."""
    better = reward * (1.0 - TOLERANCE) > needed
    return better, needed * (1.0 - slack) < reward * (1.0 + TOLERANCE) < needed


@part
def _let_go(ground: Ground, store: TrailStore, work: Workspace) -> None:
    """Be done with the parent held."""
    clear_others(ground, work)
    for k in range(work.held.shape[0]):
        release(store, work.held[k])


@routine
def _enter_alone(
    store: TrailStore,
    alone: Front,
    work: Workspace,
    trail: int,
    gained: float,
    alive: float,
) -> None:
    """Put a trail of the robot at hand into the front of its trails."""
    work.alone[0] = trail
    enter(store, alone, work.alone, gained, alive)


@frugal
def search(
    ground: Ground,
    routes: Routes,
    store: TrailStore,
    front: Front,
    reserve: Reserve,
    alone: Front,
    work: Workspace,
    rule: SearchRule,
    weights: FloatArray,
    tally: FloatArray,
    remembered: FloatArray,
    n_evaluations: int,
    states: SeedArray,
) -> int:
    """Search until so many plans have been evaluated, or there is no room for more.

    Parameters
    ----------
    ground, routes
        The mission, and its safest paths.
    store, front, reserve
        Trails, the front, at least one plan in it, and plans that were nearly good enough.
    alone
        Trails of one robot, the others' being fixed: a front of its own; empty.
    work
        Scratch.
    rule
        How to search.
    weights
        How likely each kind of move is, relative, summed up to each (``N_KINDS``).
    tally
        How often each kind of move gave a child, and one that entered; added to (2, N_KINDS).
    remembered
        What goes on from one parent to the next: ``NEWEST`` to ``CREDIT``.
    n_evaluations
        How many.
    states
        Random numbers, one state (1, 2), advanced.

    Returns
    -------
    int
        How many plans have been evaluated; where these are fewer there is no room for more, or no
        move that makes another plan.
    """
    n_robots = work.held.shape[0]
    longest, n_more = ground.head.shape[0], most_new(rule)
    at = robot = n = fruitless = n_alone = 0
    others = survivors_of_others = 0.0
    p_alone = rule.p_alone if n_robots > 1 else 0.0
    while n < n_evaluations and fruitless < MAX_FRUITLESS:
        before = n
        if not (fits(store, n_more, longest, ground.most_visits) and has_room(front, n_more)):
            break
        idle = remembered[IDLE] > rule.patience
        if n_alone > 0:
            single, place = draw_place(alone, states)
            parent = alone.plan[alone.slot[alone.directory[single], place], 0]
        else:
            responding = (
                ground.by_return.shape[0] > 0 and rule.hops_each > 0.0 and _may_respond(remembered)
            )
            if responding and remembered[FOUND] + remembered[FAILED] == 0.0:
                at = take_safest(front, work.held)
            else:
                at = draw_parent(front, reserve, rule, remembered, work.held, states)
                remembered[NEWEST] = -1.0
            for k in range(n_robots):
                store.n_users[work.held[k]] += 1
            robot = int(uniform(states, 0) * n_robots)
            if store.n_arcs[work.held[robot]] == 0:  # those under way have more to change
                robot = int(uniform(states, 0) * n_robots)
            others, survivors_of_others = set_aside(ground, store, work, robot)
            parent = work.held[robot]
            if responding:
                rough = remembered[ROUGH] == 1.0
                ended, n_hops, n_responses = respond(
                    ground,
                    store,
                    front,
                    work,
                    rule,
                    remembered,
                    robot,
                    others,
                    survivors_of_others,
                    n_evaluations - n,
                    rough,
                    states,
                )
                remembered[FOUND] += ended == THROUGH
                if ended == TOO_LONG and not rough:  # once: the next is a rough one, and at once
                    remembered[ROUGH] = 1.0
                else:
                    remembered[FAILED] += ended == TOO_LONG
                    remembered[CREDIT] -= n_hops
                n += n_responses
                fruitless = 0 if n > before else fruitless  # it has cost hops, which have an end
                _let_go(ground, store, work)
                continue
        store.n_users[parent] += 1
        lay_out(ground, store, work, parent)
        if n_alone == 0 and idle and uniform(states, 0) < p_alone:
            n_alone = rule.n_alone
            length = work.now[LENGTH]
            _enter_alone(store, alone, work, parent, work.gained[length], work.alive[length])
        # What a child is measured by: the front, or the trails known for this robot.
        goal, fixed_reward, fixed_survivors = front, others, survivors_of_others
        slack = min(1.0, rule.slack / (1.0 - uniform(states, 0)))
        if rule.p_reserve == 0.0 or (not idle and uniform(states, 0) >= rule.p_keep):
            slack = 0.0
        goal_slack = slack
        if n_alone > 0:
            goal, fixed_reward, fixed_survivors, goal_slack = alone, 0.0, 0.0, 0.0
        busy = remembered[IDLE] <= rule.busy
        for _ in range(rule.n_children_busy if busy else rule.n_children):
            if n == n_evaluations:
                break
            at = min(at, front.counts[N_BLOCKS] - 1)
            kind = draw_kind(weights, states)
            trail = NOBODY
            if kind == ADOPT:
                trail = draw_trail(front, at, rule.p_neighbour, states)
                if trail == parent:
                    continue
                reward, survivors, needed = adopt(
                    store, goal, work, trail, fixed_reward, fixed_survivors
                )
            else:
                low, high = states[0, 0], states[0, 1]
                while True:
                    work.now[WANTED] = -1
                    made = change(ground, routes, store, front, work, rule, kind, at, states)
                    if work.now[WANTED] < 0:
                        break
                    # The same child again, from the same random numbers: what has been searched
                    # before does not matter.
                    search_routes(ground.tail, ground.head, ground.cost, routes, work.now[WANTED])
                    states[0, 0], states[0, 1] = low, high
                if not made:
                    continue
                reward, survivors, needed = appraise(
                    ground,
                    goal,
                    work,
                    rule.min_survival,
                    goal_slack,
                    fixed_reward,
                    fixed_survivors,
                )
            n += 1
            remembered[IDLE] += 1.0
            tally[0, kind] += 1.0
            better, near = _is_good(reward, needed, goal_slack)
            if reward < 0.0 or not (better or near):
                continue
            if trail == NOBODY:
                trail = add_trail(
                    ground.head,
                    ground.survival,
                    ground.reward,
                    ground.base,
                    store,
                    work.child,
                    write_child(work),
                )
            store.n_users[trail] += 1
            if n_alone > 0:
                _enter_alone(store, alone, work, trail, reward, survivors)
                reward += others
                survivors += survivors_of_others
                needed = best_reward(front, survivors * (1.0 - TOLERANCE))
                better, near = _is_good(reward, needed, slack)
            if better or near:
                put_in_order(store, work, robot, trail)
            if better:
                tally[1, kind] += bring_in(ground, store, front, work, rule, remembered, states)
            elif near:
                keep_in_reserve(store, reserve, work.trails, survivors, states)
            release(store, trail)
        earned = rule.hops_each * (WHEN_IDLE if idle else 1.0)
        remembered[CREDIT] = min(remembered[CREDIT] + earned * (n - before), rule.n_hops)
        fruitless = 0 if n > before else fruitless + 1
        clear_trail(ground, work)
        release(store, parent)
        if n_alone > 0:
            n_alone -= max(1, n - before)
            if n_alone > 0 and has_room(alone, n_more):
                continue
            n_alone = 0
            for _ in range(_N_KEPT if rule.p_reserve > 0.0 else 0):
                single, place = draw_place(alone, states)
                block = alone.directory[single]
                put_in_order(store, work, robot, alone.plan[alone.slot[block, place], 0])
                survivors = survivors_of_others + alone.survivors[block, place]
                keep_in_reserve(store, reserve, work.trails, survivors, states)
            empty(store, alone)
        _let_go(ground, store, work)
    if n_alone > 0:
        empty(store, alone)
        _let_go(ground, store, work)
    return n
