"""Drafts of new plans out of pieces of known ones, and valid trails out of drafts.

A draft is any sequence of integers for each robot. Kernels that make drafts write which pieces of
an array of nodes each trail is made of: ``pieces[trail, i]`` are the beginning and the end of the
i-th one, (0, 0) where there is none. They draw from one state of random numbers, in the order of
the plans.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from botohe_moo.base.types import IntArray, OffsetArray, SeedArray
from botohe_moo.core.compile import at_once, helper, shared
from botohe_moo.core.paths import Paths, leads_home, new_paths, safest_path, way_home
from botohe_moo.core.rng import below, log_uniform, uniform
from botohe_moo.core.world import Graph, Team, World, find_arc, layer_of

_N_PIECES = 3

# The repairs.
SAFEST_PATH, TRUNCATE = 0, 1


class Trails(NamedTuple):
    """Trail t is ``nodes[offsets[t]:offsets[t + 1]]``; a plan's trails follow one another."""

    # Indices of nodes, 64-bit as everywhere in kernels. Behind the trails that a kernel has written
    # there may be room for more.
    nodes: OffsetArray
    offsets: OffsetArray  # where each trail begins, and the end of the last one (n_trails + 1)


def read_trails(nodes: IntArray, offsets: OffsetArray) -> Trails:
    """Return trails as kernels take them."""
    return Trails(nodes.astype(np.int64), offsets)


def write_trails(
    n_trails: int, n_nodes: int, write: Callable[[int, Trails], int]
) -> tuple[IntArray, OffsetArray]:
    """Let a kernel write trails whose lengths are not known before.

    ``write`` takes the number of trails that are written already, and where to write. It writes on
    while there is room, and returns the new number. At first there is room for ``n_nodes`` nodes,
    at least 1; it is doubled until all trails are written.
    """
    nodes, offsets = np.empty(n_nodes, np.int64), np.zeros(n_trails + 1, np.int64)
    n_done = write(0, Trails(nodes, offsets))
    while n_done < n_trails:
        nodes = np.concatenate([nodes, np.empty_like(nodes)])
        n_done = write(n_done, Trails(nodes, offsets))
    return nodes[: offsets[-1]].astype(np.int32), offsets


def new_pieces(n_trails: int) -> OffsetArray:
    """Return the pieces of drafts that have none."""
    return np.zeros((n_trails, _N_PIECES, 2), np.int64)


def whole_trails(offsets: OffsetArray) -> OffsetArray:
    """Return the pieces of drafts that are the plans as they are."""
    pieces = new_pieces(len(offsets) - 1)
    pieces[:, 0, 0], pieces[:, 0, 1] = offsets[:-1], offsets[1:]
    return pieces


def join_pieces(nodes: IntArray, pieces: OffsetArray) -> tuple[IntArray, OffsetArray]:
    """Write the drafts' nodes one after another; return them, and where each draft begins."""
    starts, stops = pieces.reshape(-1, 2).T
    lengths = stops - starts
    ends = np.cumsum(lengths)
    shift = np.repeat(starts - ends + lengths, lengths)
    offsets = np.zeros(len(pieces) + 1, np.int64)
    offsets[1:] = ends[_N_PIECES - 1 :: _N_PIECES]
    return nodes[np.arange(len(shift)) + shift], offsets


@helper
def _draw_shared_place(
    trails: Trails, one: int, other: int, counts: OffsetArray, states: SeedArray
) -> tuple[int, int]:
    """Draw a place inside each of two trails where both are at the same node.

    All pairs of such places are equally likely; (−1, −1) where there is none. Unknown nodes do not
    count. ``counts`` is scratch (n_nodes), zero before and after.
    """
    nodes, offsets, n_nodes = trails.nodes, trails.offsets, counts.shape[0]
    start, stop = offsets[one] + 1, offsets[one + 1] - 1
    other_start, other_stop = offsets[other] + 1, offsets[other + 1] - 1
    for j in range(other_start, other_stop):
        if 0 <= nodes[j] < n_nodes:
            counts[nodes[j]] += 1
    n = 0
    for i in range(start, stop):
        if 0 <= nodes[i] < n_nodes:
            n += counts[nodes[i]]
    place = other_place = -1
    left = below(states, n) if n > 0 else -1
    for i in range(start, stop if n > 0 else start):
        n_shared = counts[nodes[i]] if 0 <= nodes[i] < n_nodes else 0
        if left < n_shared:
            place = i
            break
        left -= n_shared
    for j in range(other_start, other_stop):
        if 0 <= nodes[j] < n_nodes:
            counts[nodes[j]] = 0
        if place >= 0 and nodes[j] == nodes[place]:
            if left == 0:
                other_place = j
            left -= 1
    return place, other_place


@helper
def _draw_robot_out(offsets: OffsetArray, first: int, stop: int, states: SeedArray) -> int:
    """Draw a trail that leaves the base, of those from ``first`` to ``stop``; any if none does."""
    n = 0
    for trail in range(first, stop):
        n += offsets[trail + 1] - offsets[trail] > 1
    if n == 0:
        return first + below(states, stop - first)
    left = below(states, n)
    for trail in range(first, stop):
        if offsets[trail + 1] - offsets[trail] > 1:
            if left == 0:
                return trail
            left -= 1
    return -1


@helper
def _continue_as(
    pieces: OffsetArray, draft: int, start: int, cut: int, onward: int, stop: int
) -> None:
    """Make a draft of the nodes from ``start`` to ``cut`` and from ``onward`` to ``stop``."""
    pieces[draft, 0, 0], pieces[draft, 0, 1] = start, cut
    pieces[draft, 1, 0], pieces[draft, 1, 1] = onward, stop


@at_once(lambda trails, *_: 5e-6 * len(trails.nodes))
def splice(
    trails: Trails, team: Team, counts: OffsetArray, states: SeedArray, pieces: OffsetArray
) -> None:
    """Draw two children of each pair of plans: those of pair m are the plans 2m and 2m + 1.

    ``trails`` are all first parents, then all second ones. One trail of each parent, of robots of a
    kind, goes on as the other's from a node that both visit. Where there is none the two trails
    change places.

    ``counts``, zeros (n_nodes), are scratch. ``states`` (1, 2) are advanced; ``pieces`` are 0
    before.
    """
    offsets, n_robots = trails.offsets, team.start.shape[0]
    n_pairs = pieces.shape[0] // (2 * n_robots)
    for pair in range(n_pairs):
        mine, others = pair * n_robots, (n_pairs + pair) * n_robots
        child, other_child = 2 * mine, 2 * mine + n_robots
        s = _draw_robot_out(offsets, mine, mine + n_robots, states)
        first, stop = others + team.first[s - mine], others + team.stop[s - mine]
        t = _draw_robot_out(offsets, first, stop, states)
        p, q = _draw_shared_place(trails, s, t, counts, states)
        if p < 0:
            p, q = offsets[s], offsets[t]
        for k in range(n_robots):
            for parent, draft in ((mine + k, child + k), (others + k, other_child + k)):
                pieces[draft, 0, 0], pieces[draft, 0, 1] = offsets[parent], offsets[parent + 1]
        _continue_as(pieces, child + s - mine, offsets[s], p, q, offsets[t + 1])
        _continue_as(pieces, other_child + t - others, offsets[t], q, p, offsets[s + 1])


@helper
def _draw_next(graph: Graph, node: int, states: SeedArray) -> int:
    """Draw a node to which an arc leads from a node; −1 where there is none."""
    if node < 0 or node >= graph.reward.shape[0]:
        return -1
    first, stop = graph.first[node], graph.first[node + 1]
    return graph.head[first + below(states, stop - first)] if first < stop else -1


@at_once(lambda trails, *_: 5e-6 * len(trails.nodes))
def ruin(
    trails: Trails,
    team: Team,
    graph: Graph,
    prob_small: float,
    states: SeedArray,
    via: IntArray,
    pieces: OffsetArray,
) -> None:
    """Cut a random segment out of one trail of each plan, and visit drawn nodes instead.

    With probability ``prob_small`` the change is a small one: the logarithm of the segment's length
    is uniform, and an arc leads to each new node from the one before, if any arc does.

    The nodes are written to ``via`` (n_plans, max_via), and every number of them is equally likely.
    To ``pieces``, which are whole trails before, they lie behind the trails' nodes.
    """
    offsets, n_robots, max_via = trails.offsets, team.start.shape[0], via.shape[1]
    for plan in range(via.shape[0]):
        robot = below(states, n_robots)
        trail, layer = plan * n_robots + robot, layer_of(team, team.start[robot])
        start, stop = offsets[trail], offsets[trail + 1]
        is_small = uniform(states, 0) < prob_small
        one, other = start + below(states, stop - start), start + below(states, stop - start)
        if is_small:
            low, high = one, one + log_uniform(states, stop - one) - 1
        else:
            low, high = min(one, other), max(one, other)
        n_via = below(states, max_via + 1)
        if n_via == 0 and high - low < 2 and max_via > 0:
            n_via = 1  # or nothing would change
        node = trails.nodes[low]
        for i in range(n_via):
            node = _draw_next(graph, node, states) if is_small else -1
            if node < 0:
                node = layer + below(states, team.reward.shape[0])
            via[plan, i] = node
        if n_via == 0:  # a node does not follow itself
            high = max(high, low + 1)
        behind = trails.nodes.shape[0] + plan * max_via
        _continue_as(pieces, trail, start, low + 1, behind, behind + n_via)
        pieces[trail, 2, 0], pieces[trail, 2, 1] = high, stop


@at_once(lambda trails, *_: 5e-6 * len(trails.nodes))
def share(
    trails: Trails,
    team: Team,
    prob_copy: float,
    counts: OffsetArray,
    states: SeedArray,
    pieces: OffsetArray,
) -> None:
    """Let one robot of each plan copy another's trail, or two robots swap the ends of their trails.

    Both are of one kind; a plan stays as it is where the first one drawn is alone of its kind. They
    swap from a node that both visit; where there is none, from any place of each trail. ``pieces``
    are whole trails before.
    """
    offsets, n_robots = trails.offsets, team.start.shape[0]
    for plan in range(pieces.shape[0] // n_robots):
        own = plan * n_robots
        one = _draw_robot_out(offsets, own, own + n_robots, states)
        first, stop = own + team.first[one - own], own + team.stop[one - own]
        if stop - first == 1:
            continue
        other = first + below(states, stop - first - 1)
        other += other >= one
        if uniform(states, 0) < prob_copy:
            pieces[other, 0, 0], pieces[other, 0, 1] = offsets[one], offsets[one + 1]
            continue
        p, q = _draw_shared_place(trails, one, other, counts, states)
        if p < 0:
            p = offsets[one] + below(states, offsets[one + 1] - offsets[one])
            q = offsets[other] + below(states, offsets[other + 1] - offsets[other])
        _continue_as(pieces, one, offsets[one], p, q, offsets[other + 1])
        _continue_as(pieces, other, offsets[other], q, p, offsets[one + 1])


class _Scratch(NamedTuple):
    """Scratch of repairs."""

    # The last trail, and the last draft, that used each arc (n_arcs).
    used: OffsetArray
    drafted: OffsetArray
    paths: Paths  # scratch of searches for paths


@helper
def _take_path(graph: Graph, scratch: _Scratch, n: int, out: Trails, size: int) -> int:
    """Append the first ``n`` arcs of ``paths.path`` to a trail; return the new size."""
    for i in range(n):
        out.nodes[size + i] = graph.head[scratch.paths.path[i]]
    return size + n


@helper
def _take_back(graph: Graph, scratch: _Scratch, out: Trails, size: int) -> int:
    """Take the last hop off a trail; return the new size."""
    tail, head = out.nodes[size - 2], out.nodes[size - 1]
    scratch.used[find_arc(graph, tail, head)] = -1
    return size - 1


@helper
def _bridge_gaps(
    world: World, scratch: _Scratch, drafts: Trails, trail: int, out: Trails, size: int
) -> int:
    """Visit the nodes of a draft in order, by safest paths over gaps; return the new size."""
    graph, team, used, paths, nodes = (
        world.graph,
        world.team,
        scratch.used,
        scratch.paths,
        out.nodes,
    )
    node = nodes[size - 1]
    layer = layer_of(team, node)
    for i in range(drafts.offsets[trail], drafts.offsets[trail + 1]):
        head = drafts.nodes[i]
        if head < 0 or head >= graph.reward.shape[0]:
            continue
        head = layer + world.team.origin[head]  # whichever kind it was meant for
        if head == node:
            continue
        arc = find_arc(graph, node, head)
        if arc >= 0 and used[arc] == trail:
            while nodes[size - 1] != head or nodes[size - 2] != node:
                size = _take_back(graph, scratch, out, size)
            node = head
            continue
        n = 1
        paths.path[0] = arc
        if arc < 0:
            n = safest_path(graph, paths, used, trail, node, head)
        for j in range(n):
            used[paths.path[j]] = trail
        if n < 0:
            continue
        start, size = size, _take_path(graph, scratch, n, out, size)
        if not graph.balanced and not leads_home(world, paths, used, trail, head):
            while size > start:
                size = _take_back(graph, scratch, out, size)
            continue
        node = head
    return size


@helper
def _keep_prefix(
    world: World, scratch: _Scratch, drafts: Trails, trail: int, out: Trails, size: int
) -> int:
    """Take the longest valid prefix of a draft from which a way leads home; return the new size."""
    graph, used, nodes = world.graph, scratch.used, out.nodes
    start, stop = drafts.offsets[trail], drafts.offsets[trail + 1]
    node, size_home = nodes[size - 1], size
    layer, origin = layer_of(world.team, node), world.team.origin
    for i in range(start, stop):
        head = drafts.nodes[i]
        if head < 0 or head >= graph.reward.shape[0]:
            break
        head = layer + origin[head]
        if i == start and head == node:
            continue
        arc = find_arc(graph, node, head) if i > start else -1
        if arc < 0 or used[arc] == trail:
            break
        used[arc] = trail
        nodes[size] = node = head
        size += 1
        if graph.balanced or leads_home(world, scratch.paths, used, trail, node):
            size_home = size
    while size > size_home:
        size = _take_back(graph, scratch, out, size)
    return size


@helper
def _count_changes(
    world: World, drafted: OffsetArray, drafts: Trails, trail: int, out: Trails
) -> int:
    """Count the arcs that a repair added and the hops that it dropped."""
    graph, origin, draft, nodes = world.graph, world.team.origin, drafts.nodes, out.nodes
    start, stop = drafts.offsets[trail], drafts.offsets[trail + 1]
    begin, end = out.offsets[trail], out.offsets[trail + 1]
    layer, n_nodes = layer_of(world.team, nodes[begin]), graph.reward.shape[0]
    for i in range(start, stop - 1):
        tail, head = draft[i], draft[i + 1]
        if 0 <= tail < n_nodes and 0 <= head < n_nodes:
            arc = find_arc(graph, layer + origin[tail], layer + origin[head])
            if arc >= 0:
                drafted[arc] = trail
    kept = 0
    for i in range(begin, end - 1):
        arc = find_arc(graph, nodes[i], nodes[i + 1])
        kept += drafted[arc] == trail
    changes = int(max(0, stop - start - 1) - kept + (end - begin - 1) - kept)
    if changes == 0 and (stop == start or draft[start] != nodes[begin]):
        return 1  # the draft is empty, or a single node that is not the base
    return changes


@at_once(lambda _world, _how, _scratch, drafts, *_: 1e-4 * len(drafts.nodes))
def _repair(
    world: World,
    how: int,
    scratch: _Scratch,
    drafts: Trails,
    n_done: int,
    out: Trails,
    changes: OffsetArray,
) -> int:
    """Make valid trails out of drafts, as long as there is room to write them.

    ``n_done`` drafts have been repaired before, into ``out``. Returns how many are repaired in the
    end: fewer than all where there may be no room for the next trail of up to n_arcs + 1 nodes.
    """
    world, scratch, drafts, out = shared(world), shared(scratch), shared(drafts), shared(out)
    graph, start = world.graph, world.team.start
    for trail in range(n_done, changes.shape[0]):
        size = out.offsets[trail]
        if size + graph.head.shape[0] + 1 > out.nodes.shape[0]:
            return trail
        out.nodes[size] = start[trail % start.shape[0]]
        if how == SAFEST_PATH:
            size = _bridge_gaps(world, scratch, drafts, trail, out, size + 1)
        else:
            size = _keep_prefix(world, scratch, drafts, trail, out, size + 1)
        n = way_home(world, scratch.paths, scratch.used, trail, out.nodes[size - 1])
        out.offsets[trail + 1] = _take_path(graph, scratch, n, out, size)
        changes[trail] = _count_changes(world, scratch.drafted, drafts, trail, out)
    return int(changes.shape[0])


def repair(world: World, how: int, drafts: Trails) -> tuple[IntArray, OffsetArray, OffsetArray]:
    """Make valid trails out of drafts; return nodes, offsets, and the changes of each.

    With ``SAFEST_PATH`` every gap is bridged by the safest path over arcs that the trail has not
    used yet. Nodes are taken in the order of the draft. Where a hop takes an arc that the trail has
    used already, the loop in between is cut off. Nodes are left out that cannot be reached over
    unused arcs, or from which no unused arcs would lead home after the safest path to them.

    With ``TRUNCATE`` the longest valid prefix of each draft is kept. It begins at base, takes no
    missing arc and no arc twice, and leaves a way home over unused arcs.

    Nodes of a draft count as those of the kind of the robot whose trail it is. Both end with the
    safest way home. Changes are arcs added and hops dropped.
    """
    n_arcs, n_trails = world.graph.n_arcs, len(drafts.offsets) - 1
    used = np.full(n_arcs, -1, np.int64)
    scratch = _Scratch(used, used.copy(), new_paths(world))
    changes = np.empty(n_trails, np.int64)
    nodes, offsets = write_trails(
        n_trails,
        2 * len(drafts.nodes) + n_arcs + 1,
        lambda n_done, out: _repair(world, how, scratch, drafts, n_done, out, changes),
    )
    return nodes, offsets, changes
