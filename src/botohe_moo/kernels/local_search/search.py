"""Pareto local search: parents from a front, children of one changed trail, back into it."""

from botohe_moo._types import FloatArray, IntArray, SeedArray
from botohe_moo.kernels.compile import frugal, part, routine
from botohe_moo.kernels.local_search.children import (
    adopt,
    appraise,
    change,
    draw_kind,
    draw_trail,
    write_child,
)
from botohe_moo.kernels.local_search.front import (
    N_BLOCKS,
    Front,
    best_reward,
    contribution,
    draw_place,
    find_place,
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
    FAILED,
    NOBODY,
    THROUGH_WITH,
    TOLERANCE,
    Reserve,
    SearchRule,
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

# How much rather parents come from the reserve when nothing has entered the front for long.
_IDLE = 3.0


@part
def _draw_parent(
    front: Front,
    reserve: Reserve,
    rule: SearchRule,
    newest: FloatArray,
    held: IntArray,
    states: SeedArray,
) -> int:
    """Write the trails of a parent into ``held``; give its block's number in the directory."""
    if newest[0] >= 0.0 and uniform(states, 0) < rule.p_newest:
        at, place = find_place(front, newest[0])
        if at == front.counts[N_BLOCKS]:
            at -= 1
            place = front.size[front.directory[at]] - 1
    else:
        p_reserve = rule.p_reserve * (_IDLE if newest[1] > rule.patience else 1.0)
        if p_reserve > 0.0 and uniform(states, 0) < p_reserve:
            drawn = int(uniform(states, 0) * reserve.survivors.shape[0])
            if reserve.plan[drawn, 0] != NOBODY:
                for k in range(held.shape[0]):
                    held[k] = reserve.plan[drawn, k]
                at, place = find_place(front, reserve.survivors[drawn])
                return int(min(at, front.counts[N_BLOCKS] - 1))
        at, place = draw_place(front, states)
        if uniform(states, 0) < rule.p_end:
            at, place = 0, 0
        elif rule.n_drawn > 1:
            most = contribution(front, at, place)
            for _ in range(rule.n_drawn - 1):
                other, other_place = draw_place(front, states)
                area = contribution(front, other, other_place)
                if area > most:
                    most, at, place = area, other, other_place
    slot = front.slot[front.directory[at], place]
    for k in range(held.shape[0]):
        held[k] = front.plan[slot, k]
    return at


@routine
def _keep_in_reserve(
    store: TrailStore, reserve: Reserve, trails: IntArray, survivors: float, states: SeedArray
) -> None:
    """Put a plan in the place of another, drawn."""
    drawn = int(uniform(states, 0) * reserve.survivors.shape[0])
    for k in range(trails.shape[0]):
        store.n_users[trails[k]] += 1
        if reserve.plan[drawn, k] != NOBODY:
            release(store, reserve.plan[drawn, k])
        reserve.plan[drawn, k] = trails[k]
    reserve.survivors[drawn] = survivors


@routine
def _enter_alone(
    store: TrailStore,
    response: Front,
    work: Workspace,
    trail: int,
    gained: float,
    alive: float,
) -> None:
    """Put a trail of the robot at hand into the front of its trails."""
    work.alone[0] = trail
    enter(store, response, work.alone, gained, alive)


@frugal
def search(
    ground: Ground,
    routes: Routes,
    store: TrailStore,
    front: Front,
    reserve: Reserve,
    response: Front,
    work: Workspace,
    rule: SearchRule,
    weights: FloatArray,
    tally: FloatArray,
    newest: FloatArray,
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
    response
        Trails of one robot, the others' being fixed: a front of its own; empty.
    work
        Scratch.
    rule
        How to search.
    weights
        How likely each kind of move is, relative, summed up to each (``N_KINDS``).
    tally
        How often each kind of move gave a child, and one that entered; added to (2, N_KINDS).
    newest
        E[S] of the plan that has just entered, −1 where none has; how many have been evaluated
        since one entered; how many best responses were found, and how many given up (4).
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
    longest = ground.head.shape[0]
    at = robot = n = fruitless = n_response = 0
    others = survivors_of_others = 0.0
    p_response = rule.p_response if n_robots > 1 else 0.0
    while n < n_evaluations and fruitless < MAX_FRUITLESS:
        before = n
        if not (
            fits(store, rule.n_children + 1, longest, ground.most_visits)
            and has_room(front, rule.n_children + 1)
        ):
            break
        responding = n_response > 0
        if responding:
            single, place = draw_place(response, states)
            parent = response.plan[response.slot[response.directory[single], place], 0]
        else:
            at = _draw_parent(front, reserve, rule, newest, work.held, states)
            newest[0] = -1.0
            for k in range(n_robots):
                store.n_users[work.held[k]] += 1
            robot = int(uniform(states, 0) * n_robots)
            others, survivors_of_others = set_aside(ground, store, work, robot)
            parent = work.held[robot]
            small = ground.reach.shape[0] > 0 and newest[FAILED] <= newest[THROUGH_WITH] + 2.0
            if small and newest[1] > rule.patience and uniform(states, 0) < rule.p_response:
                ended, n_more, _ = respond(
                    ground,
                    store,
                    front,
                    work,
                    rule,
                    newest,
                    robot,
                    others,
                    survivors_of_others,
                    n_evaluations - n,
                    states,
                )
                newest[THROUGH_WITH] += ended == THROUGH
                newest[FAILED] += ended == TOO_LONG
                n += n_more
                fruitless = 0 if n_more > 0 else fruitless + 1
                clear_others(ground, work)
                for k in range(n_robots):
                    release(store, work.held[k])
                continue
            if newest[1] > rule.patience and uniform(states, 0) < p_response:
                n_response = rule.n_response
        store.n_users[parent] += 1
        lay_out(ground, store, work, parent)
        if n_response > 0 and not responding:
            responding = True
            length = work.now[LENGTH]
            _enter_alone(store, response, work, parent, work.gained[length], work.alive[length])
        # What a child is measured by: the front, or the trails known for this robot.
        goal = response if responding else front
        fixed_reward = 0.0 if responding else others
        fixed_survivors = 0.0 if responding else survivors_of_others
        slack = min(1.0, rule.slack / (1.0 - uniform(states, 0)))
        if newest[1] <= rule.patience and uniform(states, 0) >= rule.p_keep:
            slack = 0.0
        goal_slack = 0.0 if responding else slack
        for _ in range(rule.n_children):
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
            newest[1] += 1.0
            tally[0, kind] += 1.0
            if reward < 0.0 or needed * (1.0 - goal_slack) >= reward * (1.0 + TOLERANCE):
                continue
            better = reward * (1.0 - TOLERANCE) > needed
            if not better and (
                responding or rule.p_reserve == 0.0 or needed <= reward * (1.0 + TOLERANCE)
            ):
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
            if responding:
                _enter_alone(store, response, work, trail, reward, survivors)
                reward += others
                survivors += survivors_of_others
                needed = best_reward(front, survivors * (1.0 - TOLERANCE))
                better = reward * (1.0 - TOLERANCE) > needed
            if better or (
                rule.p_reserve > 0.0
                and needed * (1.0 - slack) < reward * (1.0 + TOLERANCE) < needed
            ):
                put_in_order(store, work, robot, trail)
            if better:
                tally[1, kind] += bring_in(ground, store, front, work, rule, newest, states)
            elif rule.p_reserve > 0.0 and (
                needed * (1.0 - slack) < reward * (1.0 + TOLERANCE) < needed
            ):
                _keep_in_reserve(store, reserve, work.trails, survivors, states)
            release(store, trail)
        fruitless = 0 if n > before else fruitless + 1
        clear_trail(ground, work)
        release(store, parent)
        if responding:
            n_response -= max(1, n - before)
            if not has_room(response, rule.n_children + 1):
                n_response = 0
        if n_response <= 0:
            n_response = 0
            if responding:
                for _ in range(_N_KEPT if rule.p_reserve > 0.0 else 0):
                    single, place = draw_place(response, states)
                    block = response.directory[single]
                    put_in_order(store, work, robot, response.plan[response.slot[block, place], 0])
                    survivors = survivors_of_others + response.survivors[block, place]
                    _keep_in_reserve(store, reserve, work.trails, survivors, states)
                empty(store, response)
            clear_others(ground, work)
            for k in range(n_robots):
                release(store, work.held[k])
    if n_response > 0:
        empty(store, response)
        clear_others(ground, work)
        for k in range(n_robots):
            release(store, work.held[k])
    return n
