"""The best trail of one robot, by beam search over partial trails.

Labels are partial trails that leave the base; a level holds those of one number of hops.
"""

import numpy as np

from botohe_moo._base.types import OffsetArray
from botohe_moo.core.archive import sort_descending
from botohe_moo.core.compile import helper, kernel
from botohe_moo.core.graph import Graph
from botohe_moo.core.paths import way_within
from botohe_moo.core.sharing import shared
from botohe_moo.kernels.beam.labels import Beam, find, larger_beam, stand_at, table_size
from botohe_moo.kernels.beam.prospects import (
    TOLERANCE,
    BeamRule,
    Near,
    close,
    has_no_limits,
    is_hopeless,
    is_too_far,
    judge,
    write_gathered,
)

# A search keeps at most as many labels, whatever its width: a few hundred megabytes.
MAX_LABELS = 5_000_000

# A trail worth less than this share of the best one known is worse by more than rounding.
_NEARLY = 1 - 1e-9

_ENDED = 0  # instead of a number of children


def best_trail(
    graph: Graph, near: Near, rule: BeamRule, beam: Beam
) -> tuple[OffsetArray, float, bool]:
    """Find a closed trail of the greatest value for one robot.

    A trail's value is Σ over the nodes it visits of worth · (probability to reach the node), and
    ``survival_weight`` · (probability to survive the trail).

    Labels go on hop by hop, also those that are back at base. Each is closed at once by the safest
    way home over arcs it has not used, so that no good trail is lost when labels are dropped;
    where there is no such way the label is dropped. With a travel budget it is closed by the way
    that ``way_within`` finds, so that trails are lost whose way home compromises. (Where the usual
    way home is blocked, another one is looked for only if there are limits, or it may lead to the
    best trail known.) Of labels that end at the same node and have used the same arcs the most
    valuable stays. A label is left out if it could not beat the best trail known even by reaching
    every node not visited by its safest path. Of the rest the ``width`` labels go on that rank
    highest by

    value + survival_weight · (survival of going home) + FORESIGHT · (probability to be here) ·
    Σ over near nodes v not visited of max(0, worth of v · reach of v − what the detour over v
    costs in survival_weight · (survival of going home)),

    one of each kind first, where labels of a kind are at the same node and have visited the same
    nodes of any worth. Ties go by the order of arcs. Time and memory grow with the width, with the
    number of hops, and with the arcs that leave a node; the search ends when it has kept
    ``max_labels``.

    Returns the arcs of the trail (none if none is better than the safest way from start to end, or
    than staying where both are the same), its value, and whether any label was dropped because the
    beam was too narrow. If none was, and there is no travel budget, no trail is better by more than
    10⁻¹² of the value, unless 64-bit hashes collide. The value is −1 where even the safest way is
    too long, and no shorter way is found.
    """
    state = beam.state[0]
    state["high"] = 0
    while (n_children := _search(graph, near, rule, beam)) != _ENDED:
        beam = larger_beam(beam, int(state["high"]) + min(n_children, rule.width), n_children)
    return beam.trail[: state["n_hops"]].copy(), float(state["value"]), bool(state["cut"])


@kernel
def _search(graph: Graph, near: Near, rule: BeamRule, beam: Beam) -> int:
    """Search until a level has more children than there is room for, and return how many it has.

    Returns ``_ENDED`` at the end of the search.
    """
    graph, near, rule, beam = shared(graph), shared(near), shared(rule), shared(beam)
    state, labels, children = beam.state[0], beam.labels, beam.children
    if state.high == 0:
        _begin(graph, rule, beam)
    while state.low < state.high:
        n_most = 0
        for label in range(state.low, state.high):
            node = labels[label].node
            n_most += graph.first[node + 1] - graph.first[node]
        n_go_on = min(rule.width, rule.max_labels - state.high)
        if n_most > len(children) or state.high + min(n_most, n_go_on) > len(labels):
            return n_most
        n = _expand(graph, near, rule, beam, n_most)
        n = _rank(beam, n, state.value + TOLERANCE * state.value)
        if n > n_go_on:
            state.cut = 1
            _choose(beam, n, n_go_on)
        state.low = state.high
        for i in range(min(n, n_go_on)):
            labels[state.high] = children[beam.order[i]]
            state.high += 1
    _write_trail(graph, rule, beam)
    return _ENDED


@helper
def _begin(graph: Graph, rule: BeamRule, beam: Beam) -> None:
    """Put the label of a robot that has not left its start into row 0, and stand there."""
    state, label, start = beam.state[0], beam.labels[0], rule.start
    worth, n_nodes, left = rule.worth, rule.worth.shape[0], 0.0
    for arc in range(beam.used.shape[0]):
        beam.used[arc] = 0
    for node in range(n_nodes):
        left += worth[node]
        beam.visits[node], beam.ahead[node] = 0, worth[node]
    beam.visits[start], beam.ahead[start] = 1, 0.0
    label.parent = label.arc = -1
    label.node, label.alive, label.length = start, 1.0, 0.0
    label.value, label.left = worth[start], left - worth[start]
    label.used = label.seen = np.uint64(0)
    state.low, state.high, state.at, state.cut = 0, 1, 0, 0
    value, alive, length, node = worth[start], 1.0, 0.0, start
    while graph.homeward[node] >= 0:
        arc = graph.homeward[node]
        alive *= graph.survival[arc]
        length += graph.length[arc]
        node = graph.head[arc]
        value += alive * worth[node]
    value += alive * rule.survival_weight
    state.value = -1.0 if is_too_far(rule.budget, node, length) else value
    state.label = state.arc = -1
    write_gathered(graph, worth, beam.gathered)


@helper
def _expand(graph: Graph, near: Near, rule: BeamRule, beam: Beam, n_most: int) -> int:
    """Go on by one hop from the labels of the last level; return how many children there are.

    Children are left out that cannot get home within the limits or beat the best trail known, or
    where another child has the same node and arcs used, and as much value.
    """
    state, labels, children, table = beam.state[0], beam.labels, beam.children, beam.table
    used, ahead = beam.used, beam.ahead
    size = table_size(n_most)
    for slot in range(size):
        table[slot] = -1
    # Where every child surely has a way home, only those that may become the best trail are closed.
    closes_few = graph.balanced and has_no_limits(rule)
    n = 0
    for parent in range(state.low, state.high):
        stand_at(beam, rule.worth, parent)
        label = labels[parent]
        for arc in range(graph.first[label.node], graph.first[label.node + 1]):
            if used[arc] == 1:
                continue
            node, child = graph.head[arc], children[n]
            fresh, enough = ahead[node], state.value + TOLERANCE * state.value
            child.parent, child.arc, child.node = parent, arc, node
            child.alive = label.alive * graph.survival[arc]
            child.length = label.length + graph.length[arc]
            child.value = label.value + child.alive * fresh
            child.left = label.left - fresh
            stay = rule.survival_weight * child.alive * graph.home[node]
            if is_hopeless(graph, rule, child, stay, enough):
                continue
            child.used = label.used ^ beam.arc_keys[arc]
            child.seen = label.seen ^ beam.node_keys[node] if fresh > 0.0 else label.seen
            child.key = child.used ^ beam.place_keys[node]
            slot = find(beam, size, child.key)
            known = table[slot]
            if known >= 0 and children[known].value >= child.value:
                continue
            used[arc], ahead[node] = 1, 0.0
            judge(near, rule, ahead, child, stay)
            value, survives = -1.0, -1.0
            if child.bound > enough:
                gathered = child.value + child.alive * beam.gathered[node] + stay
                if closes_few and gathered < _NEARLY * state.value:
                    survives = child.alive
                else:
                    value, survives = close(graph, rule, beam, child, stay)
            used[arc], ahead[node] = 0, fresh
            if survives < rule.least:
                continue
            if value > state.value:
                state.value, state.label, state.arc = value, parent, arc
            if known >= 0:
                children[known] = child
            else:
                table[slot] = n
                n += 1
    return n


@helper
def _rank(beam: Beam, n_children: int, enough: float) -> int:
    """List the children that may become worth more than ``enough``, the highest rank first.

    Returns how many there are. Equal ranks stay in order.
    """
    children, order = beam.children, beam.order
    n = 0
    for child in range(n_children):
        if children[child].bound > enough:
            order[n] = child
            n += 1
    sort_descending(children["rank"], order, beam.spare, n)
    return n


@helper
def _choose(beam: Beam, n: int, n_go_on: int) -> None:
    """Put the children that go on first in the order: the best of each kind, then others.

    Children of a kind are at the same node and have visited the same nodes of any worth: mostly
    they become the same trails.
    """
    children, table, order, others = beam.children, beam.table, beam.order, beam.spare
    size = table_size(n)
    for slot in range(size):
        table[slot] = -1
    n_chosen = n_others = 0
    for i in range(n):
        row = order[i]
        child = children[row]
        child.key = child.seen ^ beam.place_keys[child.node]
        slot = find(beam, size, child.key)
        if table[slot] >= 0:
            others[n_others] = row
            n_others += 1
        elif n_chosen < n_go_on:
            table[slot] = order[n_chosen] = row
            n_chosen += 1
    for i in range(n_go_on - n_chosen):
        order[n_chosen + i] = others[i]


@helper
def _write_trail(graph: Graph, rule: BeamRule, beam: Beam) -> None:
    """Write the arcs of the best trail."""
    state, labels, trail, used = beam.state[0], beam.labels, beam.trail, beam.used
    state.n_hops = 0
    if state.arc < 0:
        return
    stand_at(beam, rule.worth, state.label)
    used[state.arc] = 1
    n, label = 0, state.label
    while label > 0:
        trail[n] = labels[label].arc
        n, label = n + 1, labels[label].parent
    for i in range(n // 2):
        trail[i], trail[n - 1 - i] = trail[n - 1 - i], trail[i]
    trail[n] = state.arc
    last = labels[state.label]
    alive, length = last.alive * graph.survival[state.arc], last.length + graph.length[state.arc]
    node, paths = graph.head[state.arc], beam.paths
    n_home = way_within(graph, rule.budget, paths, used, 1, node, alive, length)
    for i in range(n_home):
        trail[n + 1 + i] = paths.path[i]
    state.n_hops = n + 1 + n_home
