"""Moves of the Pareto local search: each cuts a trail somewhere and reconnects it.

A move leaves in the workspace a prefix of the trail, new arcs, and the position from which the
trail is kept to its end. Where that would use an arc twice, the loop in between is cut out, so
that every child is a trail, on any graph.
"""

import numpy as np

from botohe_moo._base.types import SeedArray
from botohe_moo.kernels.compile import part
from botohe_moo.kernels.local_search.parent import (
    LENGTH,
    MARK,
    N_MIDDLE,
    PREFIX,
    SUFFIX,
    WANTED,
    Ground,
    Workspace,
)
from botohe_moo.kernels.local_search.routes import UNKNOWN, Routes, route_entry
from botohe_moo.kernels.local_search.trail_store import TrailStore
from botohe_moo.kernels.rng import uniform

# The kinds of moves, as indices into their weights.
SHORTCUT = 0
VISIT = 1
VISIT_TWO = 2
SPLICE = 3
GRAFT = 4
SWAP_LOOPS = 5
REVERSE = 6
ADOPT = 7
N_KINDS = 8

# How many nodes nearby are compared, at most, when one is chosen to be visited: one, two or three.
_MOST_COMPARED = 3

# How much rather a step leads to a node that is worth something than to another.
_FRESH = 4.0


@part
def begin_child(work: Workspace, prefix: int) -> None:
    """Begin a child that keeps so many arcs from the start of the trail."""
    work.now[PREFIX], work.now[N_MIDDLE] = prefix, 0
    work.now[MARK] += 1


@part
def take_arc(work: Workspace, arc: int) -> None:
    """Let the child take an arc; when it has taken it before, what came in between goes."""
    now = work.now
    if 0 <= work.position[arc] < now[PREFIX]:
        now[PREFIX], now[N_MIDDLE] = work.position[arc] + 1, 0
        now[MARK] += 1
    elif work.middle_mark[arc] == now[MARK]:
        for i in range(work.middle_place[arc] + 1, now[N_MIDDLE]):
            work.middle_mark[work.middle[i]] = -1
        now[N_MIDDLE] = work.middle_place[arc] + 1
    else:
        work.middle_mark[arc], work.middle_place[arc] = now[MARK], now[N_MIDDLE]
        work.middle[now[N_MIDDLE]] = arc
        now[N_MIDDLE] += 1


@part
def _is_taken(work: Workspace, arc: int) -> bool:
    at = work.position[arc]
    now = work.now
    kept = at >= 0 and (at < now[PREFIX] or at >= now[SUFFIX])
    return bool(kept or work.middle_mark[arc] == now[MARK])


@part
def _way_round(ground: Ground, routes: Routes, work: Workspace, goal: int, here: int) -> int:
    """Give the arc from here, not taken yet, from which the goal is reached the safest; or −1."""
    least = np.inf
    best = -1
    for arc in range(ground.first[here], ground.first[here + 1]):
        if _is_taken(work, arc):
            continue
        entry = route_entry(routes, goal, ground.head[arc])
        if entry == UNKNOWN:
            continue
        cost = ground.cost[arc] + routes.cost[goal, entry]
        if cost < least:
            least, best = cost, arc
    return best


@part
def _follow(
    ground: Ground, routes: Routes, work: Workspace, here: int, goal: int, n_detours: int
) -> bool:
    """Let the child take the safest path to a node; False where none is known.

    Up to ``n_detours`` times it leaves that path where an arc is taken already; not on the way to
    the base of a large mission, which is kept apart from the others.
    """
    if here == goal:
        return True
    if goal == ground.base and routes.source.shape[1] < routes.source.shape[0]:
        while here != goal:
            arc = routes.homeward[here]
            take_arc(work, arc)
            here = ground.head[arc]
        return True
    if routes.n_known[goal] == 0:
        work.now[WANTED] = goal
        return False
    entry = route_entry(routes, goal, here)
    if entry == UNKNOWN:
        return False
    while here != goal:
        arc = routes.arc[goal, entry]
        entry = routes.onward[goal, entry]
        if n_detours > 0 and _is_taken(work, arc):
            n_detours -= 1
            other = _way_round(ground, routes, work, goal, here)
            if other >= 0:
                arc = other
                entry = route_entry(routes, goal, ground.head[arc])
        take_arc(work, arc)
        here = ground.head[arc]
    return True


@part
def _below(states: SeedArray, n: int) -> int:
    return int(uniform(states, 0) * n)


@part
def _draw_segment(length: int, p_short: float, n_short: int, states: SeedArray) -> tuple[int, int]:
    """Draw a segment of a trail: short, or any."""
    low = _below(states, length + 1)
    if uniform(states, 0) < p_short:
        return low, min(length, low + _below(states, n_short + 1))
    high = _below(states, length + 1)
    return min(low, high), max(low, high)


@part
def _draw_visit(
    ground: Ground, work: Workspace, here: int, p_near: float, states: SeedArray
) -> int:
    """Draw a node to visit: the richest of a few nearby, by what others leave of it, or any."""
    if uniform(states, 0) >= p_near:
        return _below(states, ground.reward.shape[0])
    n_near = ground.near.shape[1]
    best = ground.near[here, _below(states, n_near)]
    for _ in range(_below(states, _MOST_COMPARED)):
        node = ground.near[here, _below(states, n_near)]
        if work.left[node] > work.left[best]:
            best = node
    return int(best)


@part
def _draw_step(ground: Ground, work: Workspace, here: int, states: SeedArray) -> int:
    """Draw an arc from here that is not taken yet, rather to where there is something to collect.

    Gives −1 where there is none.
    """
    total = 0.0
    drawn = -1
    for arc in range(ground.first[here], ground.first[here + 1]):
        if _is_taken(work, arc):
            continue
        node = ground.head[arc]
        fresh = work.left[node] > 0.0 and work.met[node] > work.now[PREFIX]
        weight = _FRESH if fresh else 1.0
        total += weight
        if uniform(states, 0) * total < weight:
            drawn = arc
    return drawn


@part
def reconnect(
    ground: Ground,
    routes: Routes,
    work: Workspace,
    n_visits: int,
    p_short: float,
    n_short: int,
    p_near: float,
    p_step: float,
    p_more: float,
    n_detours: int,
    states: SeedArray,
) -> bool:
    """Cut out a segment, and reconnect by safest paths through some nodes drawn.

    Parameters
    ----------
    ground, routes, work
        The mission, its safest paths, and the trail.
    n_visits
        How many nodes to visit on the way, 0 to 2.
    p_short, n_short
        With what probability the segment has at most ``n_short`` arcs; otherwise it is any.
    p_near
        With what probability a node to visit is drawn among those near.
    p_step
        With what probability each visit is one step instead, along an arc drawn, be it safe or not.
    p_more
        With what probability two visits are followed by another, and that by another, and so on.
    n_detours
        How often to go round arcs that are taken.
    states
        Random numbers, advanced.

    Returns
    -------
    bool
        Whether there is a child; it may equal the trail.
    """
    low, high = _draw_segment(work.now[LENGTH], p_short, n_short, states)
    begin_child(work, low)
    work.now[SUFFIX] = high
    here = work.node[low]
    steps = n_visits > 0 and uniform(states, 0) < p_step
    while n_visits > 1 and uniform(states, 0) < p_more:
        n_visits += 1
    for _ in range(n_visits):
        if steps:
            arc = _draw_step(ground, work, here, states)
            if arc < 0:
                break
            take_arc(work, arc)
            here = ground.head[arc]
            continue
        goal = _draw_visit(ground, work, here, p_near, states)
        if not _follow(ground, routes, work, here, goal, n_detours):
            return False
        here = goal
    return bool(_follow(ground, routes, work, here, work.node[high], n_detours))


@part
def combine(
    ground: Ground,
    routes: Routes,
    store: TrailStore,
    work: Workspace,
    donor: int,
    to_end: bool,
    p_meet: float,
    n_detours: int,
    states: SeedArray,
) -> bool:
    """Replace a segment, or the end, by a segment or the end of another trail.

    The trails are joined where they meet, or by safest paths.

    Parameters
    ----------
    ground, routes, store, work, n_detours, states
        As for ``reconnect``.
    donor
        The other trail, by number.
    to_end
        Whether to go on along it to its end.
    p_meet
        With what probability to join where the trails meet, if they do at the node drawn.

    Returns
    -------
    bool
        Whether there is a child; it may equal the trail.
    """
    length, donated = work.now[LENGTH], store.n_arcs[donor]
    if donated == 0:
        return False
    start = store.arcs_from[donor]
    begin = _below(states, donated) + 1
    entrance = ground.head[store.arc[start + begin - 1]]
    low = _below(states, length + 1)
    if uniform(states, 0) < p_meet and work.met[entrance] <= length:
        low = work.met[entrance]
    end, high = donated, length
    if not to_end:
        end = begin + _below(states, donated - begin + 1)
        leaving = ground.head[store.arc[start + end - 1]]
        high = low + _below(states, length + 1 - low)
        if uniform(states, 0) < p_meet and low <= work.met[leaving] <= length:
            high = work.met[leaving]
    begin_child(work, low)
    work.now[SUFFIX] = high
    if not _follow(ground, routes, work, work.node[low], entrance, n_detours):
        return False
    here = entrance
    for i in range(begin, end):
        arc = store.arc[start + i]
        take_arc(work, arc)
        here = ground.head[arc]
    return bool(_follow(ground, routes, work, here, work.node[high], n_detours))


@part
def swap_loops(work: Workspace, states: SeedArray) -> bool:
    """Let two loops, one after the other at a node, change places: survival stays as it is.

    Parameters
    ----------
    work
        The trail.
    states
        Random numbers, advanced.
    """
    low = _below(states, work.now[LENGTH] + 1)
    middle = work.again[low]
    if middle < 0 or work.again[middle] < 0:
        return False
    high = work.again[middle]
    begin_child(work, low)
    work.now[SUFFIX] = high
    for i in range(middle, high):
        take_arc(work, work.arc[i])
    for i in range(low, middle):
        take_arc(work, work.arc[i])
    return True


@part
def reverse(
    ground: Ground,
    routes: Routes,
    work: Workspace,
    p_short: float,
    n_short: int,
    n_detours: int,
    states: SeedArray,
) -> bool:
    """Walk a segment the other way round, and join its ends by safest paths.

    Croes, "A method for solving traveling-salesman problems", Operations Research 6(6), 1958. Where
    the segment is a loop it stays one.

    Parameters
    ----------
    ground, routes, work, p_short, n_short, n_detours, states
        As for ``reconnect``.
    """
    low, high = _draw_segment(work.now[LENGTH], p_short, n_short + 2, states)
    if high < low + 2:
        return False
    begin_child(work, low)
    work.now[SUFFIX] = high
    if not _follow(ground, routes, work, work.node[low], work.node[high - 1], n_detours):
        return False
    for i in range(high - 2, low, -1):
        arc = ground.reverse[work.arc[i]]
        if arc < 0:
            return False
        take_arc(work, arc)
    return bool(_follow(ground, routes, work, work.node[low + 1], work.node[high], n_detours))
