"""Change trails by moves, drawn until one can be made.

Most moves need arcs that lead both ways. Where arcs are one-way, detours can still be made: a part
of a trail goes another way, along safest paths over arcs that the trail has not taken.
"""

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.core.compile import helper, kernel
from botohe_moo.core.graph import Graph, Limits, find_arc, limit_at
from botohe_moo.core.kinds import end_of, layer_of, n_origins
from botohe_moo.core.paths import safest_path
from botohe_moo.core.rng import below, uniform
from botohe_moo.core.sharing import shared
from botohe_moo.core.trails import Trails, write_trails
from botohe_moo.operators.kernels.moves import (
    CANNOT,
    DETOUR,
    MoveScratch,
    mark_trail,
    move_trail,
    new_move_scratch,
    shift,
)

_LAST_TRIES = 10  # detours, where none of the moves drawn could be made


class MoveRule(NamedTuple):
    """How trails are changed."""

    # How likely each kind of move is to be drawn, relative; at most ``N_KINDS``, and kinds left out
    # are never drawn.
    weights: FloatArray
    max_tries: int  # how many moves to draw before a few detours are tried
    every_robot: bool  # whether every trail of a plan is changed, rather than one drawn uniformly
    limits: Limits  # of every trail


@helper
def _add_path(graph: Graph, scratch: MoveScratch, n: int, source: int, target: int) -> int:
    """Append the safest path over arcs that are not marked to a way of ``n`` arcs.

    Returns the new number of arcs, −1 where there is no path.
    """
    n_added = safest_path(graph, scratch.paths, scratch.used, scratch.mark[0], source, target)
    for i in range(n_added):
        scratch.way[n + i] = scratch.paths.path[i]
    return n + n_added if n_added >= 0 else -1


@helper
def _replace(
    graph: Graph, way: OffsetArray, n: int, nodes: OffsetArray, length: int, start: int, stop: int
) -> int:
    """Replace a segment by a way of ``n`` arcs; ``CANNOT`` if it is the same."""
    longer = n - (stop - start)
    if longer == 0:
        i = 0
        while i < n and graph.head[way[i]] == nodes[start + 1 + i]:
            i += 1
        if i == n:
            return CANNOT
    length = shift(nodes, length, stop + 1, longer)
    for i in range(n):
        nodes[start + 1 + i] = graph.head[way[i]]
    return length


@helper
def _take_detour(
    graph: Graph, scratch: MoveScratch, nodes: OffsetArray, length: int, states: SeedArray
) -> int:
    """Go another way from a position of a trail to the same or a later one, in place.

    The way leads over a node drawn among all. It takes the arc to that node if it is free, else the
    safest path, and then the safest path to the second position. With the base, or a node at one of
    the positions, it is the safest path between these. All arcs are ones that the rest of the trail
    does not take. The first position is drawn uniformly, the second so that the logarithms of spans
    are uniform.

    Returns ``CANNOT`` where there is no path, or only the one that the trail takes.
    """
    used, mark, way, kinds = scratch.used, scratch.mark[0], scratch.way, graph.kinds
    start = below(states, length)
    room = length - start
    stop = start + min(room, int((room + 1) ** uniform(states, 0))) - 1
    source, target = nodes[start], nodes[stop]
    via = layer_of(kinds, source) + below(states, n_origins(kinds, graph.reward.shape[0]))
    for i in range(start, stop):
        used[find_arc(graph, nodes[i], nodes[i + 1])] = -1
    n_out = 0
    if via not in (end_of(kinds, graph.base, source), source, target):
        way[0] = find_arc(graph, source, via)
        n_out = 1
        if way[0] < 0 or used[way[0]] == mark:
            n_out = _add_path(graph, scratch, 0, source, via)
        for i in range(n_out):
            used[way[i]] = mark
        source = via
    n = n_out
    if source != target and n_out >= 0:
        n = _add_path(graph, scratch, n_out, source, target)
    for i in range(n_out):
        used[way[i]] = -1
    for i in range(start, stop):
        used[find_arc(graph, nodes[i], nodes[i + 1])] = mark
    return CANNOT if n < 0 else _replace(graph, way, n, nodes, length, start, stop)


@helper
def _draw_kind(weights: FloatArray, states: SeedArray) -> int:
    """Draw a kind of move; −1 where rounding leads to a kind that must not be drawn."""
    n_kinds = weights.shape[0]
    total = 0.0
    for kind in range(n_kinds):
        total += weights[kind]
    left = uniform(states, 0) * total - weights[0]
    kind = 0
    while left >= 0.0 and kind < n_kinds - 1:
        kind += 1
        left -= weights[kind]
    return kind if weights[kind] > 0.0 else -1


@helper
def keeps_limits(graph: Graph, limits: Limits, nodes: OffsetArray, n: int) -> bool:
    """Return whether a trail of ``n`` nodes keeps limits.

    Survivals are multiplied, and lengths added, in the order and with the bits of ``evaluate``.
    """
    alive, length = 1.0, 0.0
    for i in range(n - 1):
        arc = find_arc(graph, nodes[i], nodes[i + 1])
        alive *= graph.survival[arc]
        length += graph.length[arc]
    is_safe = alive >= limit_at(limits.min_survival, limits.floors, nodes[0])
    return is_safe and length <= limit_at(limits.max_length, limits.budgets, nodes[0])


@helper
def change_trail(
    graph: Graph,
    rule: MoveRule,
    scratch: MoveScratch,
    nodes: OffsetArray,
    length: int,
    states: SeedArray,
) -> int:
    """Make one move, in place, of a kind drawn by the rule's weights.

    Another move is drawn where that one cannot be made or the trail would not keep the limits. In
    the end a few detours are tried. Parameters and result are those of ``move_trail``, but no arc
    needs to be marked.
    """
    limits = rule.limits
    binding = limits.min_survival > 0.0 or limits.max_length < math.inf
    mark_trail(graph, scratch, nodes, length)
    for attempt in range(rule.max_tries + _LAST_TRIES):
        kind = _draw_kind(rule.weights, states) if attempt < rule.max_tries else DETOUR
        if kind < 0:
            continue
        if binding:
            for i in range(length):
                scratch.spare[i] = nodes[i]
        if kind == DETOUR:
            changed = _take_detour(graph, scratch, nodes, length, states)
        else:
            changed = move_trail(graph, scratch, nodes, length, kind, states)
        if changed == CANNOT:
            continue
        if not binding or keeps_limits(graph, limits, nodes, changed):
            return changed
        for i in range(length):
            nodes[i] = scratch.spare[i]
    return CANNOT


@kernel
def _change_plans(
    graph: Graph,
    rule: MoveRule,
    scratch: MoveScratch,
    plans: Trails,
    n_robots: int,
    states: SeedArray,
    n_done: int,
    out: Trails,
) -> int:
    """Change one trail, or every trail, of plans by one move, while there is room to write them.

    A trail for which no move can be made stays as it is. ``n_done`` trails, those of whole plans,
    have been written to ``out`` before. Returns the number of trails that are written in the end.
    """
    graph, rule, scratch = shared(graph), shared(rule), shared(scratch)
    plans, out = shared(plans), shared(out)
    n_trails, room = plans.offsets.shape[0] - 1, graph.head.shape[0] + 1
    trail_nodes = np.empty(room, np.int64)
    for first in range(n_done, n_trails, n_robots):
        size = out.offsets[first]
        needed = plans.offsets[first + n_robots] - plans.offsets[first]
        needed += room * n_robots if rule.every_robot else room
        if size + needed > out.nodes.shape[0]:
            return first
        chosen = -1 if rule.every_robot else first + below(states, n_robots)
        for trail in range(first, first + n_robots):
            start = plans.offsets[trail]
            length = plans.offsets[trail + 1] - start
            for i in range(length):
                trail_nodes[i] = plans.nodes[start + i]
            if rule.every_robot or trail == chosen:
                changed = change_trail(graph, rule, scratch, trail_nodes, length, states)
                length = length if changed == CANNOT else changed
            for i in range(length):
                out.nodes[size + i] = trail_nodes[i]
            size += length
            out.offsets[trail + 1] = size
    return int(n_trails)


def change_plans(
    graph: Graph, rule: MoveRule, plans: Trails, n_robots: int, states: SeedArray
) -> tuple[IntArray, OffsetArray]:
    """Change one trail, or every trail, of valid plans by one move."""
    scratch = new_move_scratch(graph)
    write = partial(_change_plans, graph, rule, scratch, plans, n_robots, states)
    room = 2 * len(plans.nodes) + graph.n_arcs + 1
    return write_trails(len(plans.offsets) - 1, room, write)
