"""Relaxed trails and exact ones, beside readable twins: dictionaries of states, and all trails."""

from itertools import combinations, pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from botohe_moo import Mission
from botohe_moo.bounds import net as net_module
from botohe_moo.bounds.kernels import labels as labels_module
from botohe_moo.bounds.kernels.labels import (
    LabelSearch,
    new_frontiers,
    new_labels,
    raise_by_labels,
)
from botohe_moo.bounds.kernels.relaxed import Rule, Worth, follow, look_ahead
from botohe_moo.bounds.kernels.states import find_states
from botohe_moo.bounds.kernels.trails import (
    Stairs,
    TrailRule,
    find_trails,
    new_corners,
    new_depths,
)
from botohe_moo.bounds.net import RelaxedTrail, Remembered, arcs_by_ends, new_net, pieces_of
from botohe_moo.bounds.relaxation import Ahead, completions, new_tables
from tests import twins
from tests.examples import examples
from tests.strategies import missions

N_LEVELS = 6


def drawn_prices(net, seed):
    """Convex prices, 0 at 0, no steeper than rewards."""
    rng = np.random.default_rng(seed)
    prices = np.zeros((net.graph.n_nodes, N_LEVELS + 1))
    for node in np.flatnonzero(net.graph.reward > 0):
        rises = np.sort(rng.uniform(0, 1, N_LEVELS)) * (rng.uniform(size=N_LEVELS) < 0.8)
        heights = np.append(0.0, np.cumsum(np.sort(rises)))
        prices[node] = heights * net.graph.reward[node] * net.reach[node] / N_LEVELS
    return prices, float(rng.choice([0.0, 1.0, 5.0]) * rng.uniform())


def price_at(prices, node, level):
    return np.interp(level, np.arange(N_LEVELS + 1), prices[node])


def value_of(net, trail, prices, mu):
    """What a trail of nodes is worth."""
    graph = net.graph
    arcs = {pair: arc for arc, pair in enumerate(zip(graph.tail, graph.head, strict=True))}
    alive, worth, seen = 1.0, 0.0, {net.base}
    for pair in pairwise(trail):
        alive *= graph.mean_survival[arcs[pair]]
        if pair[1] not in seen:
            worth += price_at(prices, pair[1], alive / net.reach[pair[1]] * N_LEVELS)
        seen.add(pair[1])
    return worth + mu * alive


def states_by_dictionary(net, remembered):
    """What ``find_states`` finds: states as (node, set of bits), and their links."""
    graph, pieces, n = net.graph, net.pieces, net.graph.n_nodes
    found, todo = {}, [(entry, frozenset()) for entry in pieces.entry.tolist()]
    while todo:
        state = todo.pop()
        if state in found:
            continue
        found[state] = links = {}
        node, bits = state
        for arc in range(graph.first[node], graph.first[node + 1]):
            if n + arc in bits or pieces.is_back[arc]:
                continue
            head = int(graph.head[arc])
            end = node if pieces.into[arc] >= 0 else head
            pays = graph.reward[head] > 0 and end == head and head not in pieces.entry
            taken = {n + arc, head} if pays else {n + arc}
            after = frozenset((bits | taken) & set(remembered.bits[end]))
            links[arc] = ((end, after), pays and head not in bits)
            todo.append((end, after))
    return found


def corners_of(net, piece, tables, heights, level):
    """The excursions into a piece that may be the best for what follows: (survival, worth).

    Each pair of slopes gives one, if all the others allow it.
    """
    slopes = tables.slope[piece, : len(heights)]
    alive = net.reach[net.pieces.gate[piece]] * level / N_LEVELS
    alive *= net.graph.mean_survival[net.pieces.arc[piece]]
    found = [0.0, alive]
    for (a, h), (b, k) in combinations(zip(slopes, heights, strict=True), 2):
        found.append(min(max((k - h) / (b - a), 0.0), alive))
    return [(q, min(h - a * q for a, h in zip(slopes, heights, strict=True))) for q in found]


def values_by_dictionary(net, states, prices, mu, tables):
    """Value iteration from below, all states of a piece at once, for the slopes of the tables.

    Returns what lies ahead at the base, and at the entry of each other piece by slope.
    """
    levels, pieces, graph = np.arange(N_LEVELS + 1), net.pieces, net.graph
    heights = {}  # by piece and level, for each slope

    def excursion(piece, after):
        """What is worth the most at each level: an excursion, and what lies ahead behind it."""
        out, home = graph.mean_survival[[pieces.arc[piece], pieces.back[piece]]]
        if piece not in heights:
            there = levels * out * home
            return np.interp(there, levels, after) + prices[pieces.entry[piece]]
        best = np.zeros(N_LEVELS + 1)
        for level in range(1, N_LEVELS + 1):
            for q, worth in corners_of(net, piece, tables, heights[piece][:, level], level):
                there = q * home / net.reach[pieces.gate[piece]] * N_LEVELS
                best[level] = max(best[level], worth + np.interp(there, levels, after))
        return best

    def iterate(piece, slope):
        own = [state for state in states if pieces.of[state[0]] == piece]
        values = {state: np.zeros(N_LEVELS + 1) for state in own}
        for _ in range(3_000):
            change = 0.0
            for node, bits in own:
                best = np.zeros(N_LEVELS + 1)
                if node == pieces.entry[piece]:
                    best = slope * net.reach[node] * levels / N_LEVELS
                for arc, (to, pays) in states[node, bits].items():
                    if pieces.into[arc] >= 0:
                        value = excursion(pieces.into[arc], values[to])
                    else:
                        there = net.ratio[arc] * levels
                        value = np.interp(there, levels, values[to])
                        value = value + pays * price_at(prices, to[0], there)
                    best = np.maximum(best, value)
                change = max(change, (best - values[node, bits]).max())
                values[node, bits] = best
            if change < 1e-13:
                return values[pieces.entry[piece], frozenset()]
        return None

    for piece in range(len(pieces.entry) - 1, 0, -1):
        if np.diff(pieces.first_option)[piece] > 1:
            slopes = tables.slope[piece, : tables.n_slopes[piece]]
            entry = prices[pieces.entry[piece]]
            heights[piece] = np.array([entry + iterate(piece, slope) for slope in slopes])
    return iterate(0, mu), heights


def shortfall(net, states, mu, cap, tables, values):
    """The most by which a value of the base's piece falls short of the best of one step."""
    levels, most = np.arange(N_LEVELS + 1), 0.0
    for state in range(len(values)):
        node = states.node[state]
        alive = mu * net.reach[node] * levels / N_LEVELS
        best = alive if node == net.base else np.zeros(N_LEVELS + 1)
        for link in range(states.first[state], states.first[state + 1]):
            move = states.move[link]
            value = np.interp(tables.there[:, move], levels, values[states.to[link]])
            best = np.maximum(best, value + states.pays[link] * tables.paid[:, move])
        most = max(most, (np.minimum(best, cap + alive) - values[state]).max())
    return most


def prepared(mission, memory, least=0.0):
    """The net, with the way to its largest piece joined or not, its memory and states."""
    n_bits, nearest, joined = memory
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(net_module, "_MOST_JOINED", joined)
        patch.setattr(net_module, "_NEAREST", nearest)
        net = new_net(mission.limited(least))
        remembered = Remembered(net, n_bits)
    return net, remembered, find_states(net, remembered.pack(), 100_000, 1_000_000)


def ahead_under(net, states, prices, mus, tolerance=1e-13, cap=np.inf):
    """The tables, the values for each mu, and by how much they fall short."""
    tables, values = (
        new_tables(net, states, N_LEVELS),
        np.zeros((len(mus), states.begin[1], N_LEVELS + 1)),
    )
    rule = Rule(tolerance, cap, 20 * net.graph.reward.sum() + max(mus), 0.05)
    short = look_ahead(net, states, prices, np.array(mus), rule, tables, values)
    return tables, values, short


dangerous = missions(survivals=st.sampled_from([0.5, 0.8, 0.9, 0.97]))
memories = st.sampled_from([(0, 0, 0), (0, 0, 9), (1, 0, 0), (4, 3, 0), (4, 4, 9), (9, 9, 0)])


@examples(60)
@given(dangerous, memories, st.integers(0, 99))
def test_what_lies_ahead_is_that_of_value_iteration(mission, memory, seed):
    net, remembered, states = prepared(mission, memory)
    prices, mu = drawn_prices(net, seed)
    twin = states_by_dictionary(net, remembered)
    assert len(states.node) == len(twin)
    links = [(arc, pays) for links in twin.values() for arc, (_, pays) in links.items()]
    n_options = np.append(np.diff(net.pieces.first_option), 1)[net.pieces.into]
    assert len(states.move) == sum(n_options[arc] for arc, _ in links)
    inside = states.move < net.graph.n_arcs
    assert states.pays[inside].sum() == sum(pays for _, pays in links)
    tables, [values], short = ahead_under(net, states, prices, [mu])
    start, heights = values_by_dictionary(net, twin, prices, mu, tables)
    assert values[0] == pytest.approx(start, rel=1e-9, abs=1e-9)
    for piece, expected in heights.items():
        rows = tables.row[piece, : len(expected)]
        found = prices[net.pieces.entry[piece]] + tables.values[rows]
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert 0 <= short < 1e-9
    assert shortfall(net, states, mu, np.inf, tables, values) <= short + 1e-12


@examples(60)
@given(dangerous, memories, st.integers(0, 99), st.sampled_from([1e-3, 0.1]))
def test_how_far_values_fall_short_is_known(mission, memory, seed, tolerance):
    """With a wide tolerance and a cap, which both cut values."""
    net, _, states = prepared(mission, memory)
    prices, mu = drawn_prices(net, seed)
    cap = np.random.default_rng(seed).uniform(0.2, 2.0) * (prices[:, -1].max() + mu)
    tables, [values], short = ahead_under(net, states, prices, [mu], tolerance, cap)
    assert 0 <= short <= tolerance + 1e-9
    levels = np.arange(N_LEVELS + 1)
    assert (values <= cap + mu + 1e-12).all()
    # Up to where all prices are straight lines, so are values, which are convex and 0 at 0.
    bends = np.abs(np.diff(prices, 2)).max(axis=0) > 1e-12
    straight = int(np.append(np.flatnonzero(bends), N_LEVELS - 1)[0]) + 1
    falling = cap * np.minimum(1.0, levels / straight)
    assert shortfall(net, states, mu, falling, tables, values) <= short + 1e-12


def ahead_of(states, prices, mus, tables, found, beside):
    """Completions under the same prices and several prices of survival."""
    return [
        Ahead(states, Worth(prices, mu), tables, values, 0.0, 0.0, beside)
        for mu, values in zip(mus, found, strict=True)
    ]


@examples(80)
@given(missions(max_nodes=6), memories, st.sampled_from([0.0, 0.4]), st.integers(0, 99))
def test_no_trail_is_worth_more_than_relaxed_ones_and_the_best_is_found(
    mission, memory, floor, seed
):
    """And the best is found; also where arcs are sure: relaxed trails collect up to the cap then.

    Arcs that lead to no reward are not on any of them.
    """
    net, _, states = prepared(mission, memory, floor)
    prices, mu = drawn_prices(net, seed)
    cap = prices[:, -1].sum()
    tables, found, short = ahead_under(net, states, prices, [mu, 0.0], cap=cap)
    values = found[0]
    spare = 2 * net.graph.n_arcs * (short + 1e-12)
    arcs = set(zip(net.graph.tail.tolist(), net.graph.head.tolist(), strict=True))
    every = twins.all_trails(mission)
    assume(every is not None)
    within = [
        trail
        for trail in every
        if len(trail) > 1
        and arcs.issuperset(pairwise(trail))
        and twins.survival_of(mission, trail) >= floor
    ]
    worths = [value_of(net, trail, prices, mu) for trail in within]
    room = np.empty(2, np.int64), np.empty(2, np.int64)
    _, most = follow(net, states, Worth(prices, mu), tables, values, -1, *room)
    assert most + spare >= max(worths, default=0.0)
    none = np.zeros(net.graph.n_nodes)
    line = completions(ahead_of(states, prices, [mu], tables, found[:1], none))
    # A bound on worth with survival, without a price of its own.
    line = line._replace(mu=np.zeros(1))
    depths = new_depths(net, np.random.default_rng(seed), 1 << 8, 2, 1, N_LEVELS)
    stairs = np.zeros(1)
    given = net, states, Worth(prices, mu), line, Stairs(stairs, np.inf, 0.0)
    n = find_trails(*given, TrailRule(False, 0.0, 1_000_000), depths)
    assert n >= 0
    best = max([*worths, 0.0])
    assert best - spare - 1e-12 <= stairs[0] <= best * (1 + 1e-12)
    assert spare < 1e-9
    if depths.found.n_trails:
        last = min(depths.found.n_trails, 2) - 1
        arcs = depths.arcs[last, : depths.n_arcs[last]]
        trail = [net.base, *net.graph.head[arcs].tolist()]
        assert value_of(net, trail, prices, mu) == pytest.approx(stairs[0], rel=1e-12)
    if n > 1:
        stairs[:] = 0.0
        assert find_trails(*given, TrailRule(False, 0.0, n - 1), depths) == -n


N_STEPS = 7


def lines_ahead(net, states, prices, mus, seed):
    """Completions under the prices themselves, and under others that are lower."""
    lower = prices * np.random.default_rng(seed).uniform(0.5, 1.0)
    lines = []
    for own in (prices, lower):
        tables, found, short = ahead_under(net, states, own, mus)
        assert short < 1e-9
        lines += ahead_of(states, own, mus, tables, found, (prices - own).max(axis=1))
    return completions(lines)


@examples(80)
@given(
    missions(max_nodes=6, survivals=st.sampled_from([0.5, 0.8, 0.97])),
    memories,
    st.sampled_from([0.0, 0.3, 0.6]),
    st.integers(0, 99),
)
def test_stairs_are_above_all_trails(mission, memory, least, seed):
    net, _, states = prepared(mission, memory)
    prices, mu = drawn_prices(net, seed)
    trails = twins.all_trails(mission)
    assume(trails is not None)
    arcs = set(zip(net.graph.tail.tolist(), net.graph.head.tolist(), strict=True))
    known = [
        (twins.survival_of(mission, trail), value_of(net, trail, prices, 0.0))
        for trail in trails
        if len(trail) > 1 and arcs.issuperset(pairwise(trail))
    ]
    known = [(survival, worth) for survival, worth in known if survival >= least * (1 - 1e-12)]
    ahead = lines_ahead(net, states, prices, [0.0, mu, 3 * mu + 1], seed)
    width = 1.0 / N_STEPS
    steps = np.minimum((np.array([survival for survival, _ in known]) / width + 1e-9), N_STEPS - 1)
    expected = np.zeros(N_STEPS)
    for step, (_, worth) in zip(steps.astype(int), known, strict=True):
        expected[: step + 1] = np.maximum(expected[: step + 1], worth)
    first = int(least / width + 1e-9)
    depths = new_depths(net, np.random.default_rng(seed), 1 << 8, 5_000, 6, N_LEVELS)
    stairs = np.zeros(N_STEPS)
    given, every = (net, states, Worth(prices, 0.0), ahead), TrailRule(True, 0.0, 1_000_000)
    raised = Stairs(stairs, width, least)
    assert find_trails(*given, raised, TrailRule(False, 0.0, 1_000_000), depths) >= 0
    assert stairs[first:] == pytest.approx(expected[first:], abs=1e-9)
    # All trails above some stairs, each once.
    needed = expected * np.random.default_rng(seed).uniform(0.3, 1.1) + 1e-6
    assert find_trails(*given, Stairs(needed, width, least), every, depths) >= 0
    above = sum(worth > needed[int(step)] for step, (_, worth) in zip(steps, known, strict=True))
    assert depths.found.n_trails == above
    found = {tuple(depths.arcs[i, : depths.n_arcs[i]]) for i in range(above)}
    assert len(found) == above
    if above > 1:
        small = new_depths(net, np.random.default_rng(seed), 1 << 8, above - 1, 6, N_LEVELS)
        assert find_trails(*given, Stairs(needed, width, least), every, small) < 0


def raised_by_labels(net, states, prices, mus, stairs, **options):
    """Whether stairs were raised above all relaxed trails, and their lines: what no one exceeds."""
    cap = prices[:, -1].sum()
    tables, found, short = ahead_under(net, states, prices, mus, cap=cap)
    none = np.zeros(net.graph.n_nodes)
    n_steps, n_lines = len(stairs.heights), len(mus)
    given = {"tolerance": 1e-13, "slack": 0.0, "cap": cap, "fine": 0.0, "n_most": 1_000_000}
    search = LabelSearch(
        net,
        states,
        prices,
        completions(ahead_of(states, prices, mus, tables, found, none)),
        stairs,
        new_corners(n_steps, n_lines),
        np.empty(n_lines),
        new_frontiers(net, N_LEVELS),
        new_labels(options.pop("n_room", 100_000), len(states.node)),
        **given | options,
    )
    n = raise_by_labels(search)
    lines = [(values[0, -1], mu) for mu, values in zip(mus, found, strict=True)]
    spare = 2 * net.graph.n_arcs * (short + 2e-12)
    return n, lines, spare + net.graph.n_arcs * search.tolerance


@examples(80)
@given(
    missions(max_nodes=6),
    memories,
    st.sampled_from([0.0, 0.3, 0.6]),
    st.sampled_from([(0.0, 1e-13), (0.02, 1e-13), (1.0, 1e-13), (0.0, 0.01), (0.1, 0.1)]),
    st.sampled_from([1, 2, 256]),
    st.integers(0, 99),
)
def test_labels_raise_stairs_above_all_trails_and_no_higher_than_lines(
    mission, memory, least, losses, n_corners, seed
):
    """Also where arcs are sure, labels are left out, and excursions stand for others.

    With the last, stairs may exceed lines.
    """
    fine, tolerance = losses
    net, _, states = prepared(mission, memory)
    prices, mu = drawn_prices(net, seed)
    trails = twins.all_trails(mission)
    assume(trails is not None)
    arcs = set(zip(net.graph.tail.tolist(), net.graph.head.tolist(), strict=True))
    width = (1.0 + 1e-9) / N_STEPS
    floor = np.random.default_rng(seed).choice([0.0, 0.1]) * prices[:, -1].sum()
    stairs = Stairs(np.full(N_STEPS, floor), width, least)
    mus = [0.0, mu, 3 * mu + 1]
    given = {"fine": fine, "tolerance": tolerance}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(labels_module, "_MOST_CORNERS", n_corners)
        n, lines, spare = raised_by_labels(net, states, prices, mus, stairs, **given)
    assert n >= 0
    for trail in trails:
        survival = twins.survival_of(mission, trail)
        if len(trail) > 1 and arcs.issuperset(pairwise(trail)) and survival >= least:
            step = min(int(survival / width), N_STEPS - 1)
            assert stairs.heights[step] + spare >= value_of(net, trail, prices, 0.0)
    assert (np.diff(stairs.heights) <= 0).all()
    if fine == 0.0 and n_corners == 256:
        at = np.arange(N_STEPS) * width
        most = np.min([height - mu * at for height, mu in lines], axis=0)
        assert (stairs.heights <= np.maximum(most, floor) + spare + 1e-9).all()


def test_labels_by_hand():
    """A base, a hall behind a bridge, and two rooms: nothing is between the three excursions.

    The hall is worth 1, the near room 2 and the far one 4, whenever a robot comes. It is alive with
    0.9 at the hall; 0.8 of that comes back from the near room, and half from the far one. The way
    home takes 0.9 again, so trails survive with 0.81, 0.648, 0.405 or 0.324.
    """
    graph = nx.Graph([(0, 1, {"survival": 0.9}), (1, 2, {"survival": 0.8**0.5})])
    graph.add_edge(1, 3, survival=0.5**0.5)
    nx.set_node_attributes(graph, {0: 0.0, 1: 1.0, 2: 2.0, 3: 4.0}, "reward")
    net, _, states = prepared(Mission(graph.to_directed(), base=0, robots=1), (4, 4, 0))
    prices = np.outer(net.graph.reward, np.arange(N_LEVELS + 1) > 0).astype(float)
    stairs = Stairs(np.zeros(10), 0.1, 0.0)
    n, _, _ = raised_by_labels(net, states, prices, [0.0, 2.0], stairs)
    assert n > 0
    assert stairs.heights == pytest.approx([7, 7, 7, 7, 5, 3, 3, 1, 1, 0])
    for limits, is_enough in (({"n_room": 2}, False), ({"n_most": 3}, False), ({}, True)):
        again = stairs._replace(heights=np.zeros(10))
        n, _, _ = raised_by_labels(net, states, prices, [0.0, 2.0], again, **limits)
        assert (n > 0) == is_enough
    # What is below stairs does not raise them, and trails that survive with less do not count.
    least = Stairs(np.full(10, 4.0), 0.1, 0.5)
    raised_by_labels(net, states, prices, [0.0, 2.0], least)
    assert least.heights == pytest.approx(np.full(10, 4.0))


@examples(60)
@given(dangerous, memories, st.integers(0, 99), st.integers(-1, 3))
def test_the_best_relaxed_trail_is_followed(mission, memory, seed, turn):
    net, remembered, states = prepared(mission, memory)
    prices, mu = drawn_prices(net, seed)
    tables, [values], _ = ahead_under(net, states, prices, [mu])
    arcs, paid = np.empty(300, np.int64), np.empty(300, np.int64)
    n, most = follow(net, states, Worth(prices, mu), tables, values, turn, arcs, paid)
    arcs, paid = arcs[:n], paid[:n] == 1
    twin, pieces = states_by_dictionary(net, remembered), net.pieces
    state, behind, alive, worth = (net.base, frozenset()), [], 1.0, 0.0
    for arc, pays in zip(arcs.tolist(), paid.tolist(), strict=True):
        alive *= net.graph.mean_survival[arc]
        head = int(net.graph.head[arc])
        worth += pays * price_at(prices, head, alive / net.reach[head] * N_LEVELS)
        if pieces.is_back[arc]:
            state = behind.pop()
            continue
        state, may_pay = twin[state][arc]
        if pieces.into[arc] >= 0:
            behind.append(state)
            state = head, frozenset()
        else:
            assert pays == may_pay
    if n < 299 and n > 0:
        assert net.graph.head[arcs[-1]] == net.base or mu == 0.0
        worth += mu * alive * (net.graph.head[arcs[-1]] == net.base)
    # What lies ahead is on chords, which are above what a single way is worth.
    assert worth <= most + 1e-9


@pytest.mark.parametrize(
    ("arcs", "paid", "expected"),
    [
        # Node 1 pays twice, and its reward is forgotten at 2 and 3; arcs pay nothing.
        (
            [(0, 1), (1, 2), (2, 3), (3, 1), (1, 2), (2, 1)],
            [True, True, True, True, False, True],
            [(("reward", 1), [1, 2, 3]), (("reward", 1), [1, 2])],
        ),
        # The excursion to 4 is made twice from 3; what happens beyond the bridge is not needed.
        (
            [(0, 1), (1, 3), (3, 4), (4, 5), (5, 4), (4, 3), (3, 4), (4, 3)],
            [True] * 4 + [False] * 2 + [True, False],
            [(("excursion", (3, 4)), [3])],
        ),
    ],
)
def test_what_relaxed_trails_forget_in_a_piece(arcs, paid, expected):
    """A triangle of 1, 2 and 3 behind the base, and 3 - 4 - 5 behind it."""
    both = [(0, 1), (1, 2), (2, 3), (3, 1), (3, 4), (4, 5)]
    graph = nx.DiGraph([*both, *((b, a) for a, b in both)])
    nx.set_node_attributes(graph, {node: float(node > 0) for node in graph}, "reward")
    nx.set_edge_attributes(graph, 0.9, "survival")
    net = new_net(Mission(graph, base=0, robots=1).world)
    numbers = arcs_by_ends(net.graph)
    trail = RelaxedTrail([numbers[pair] for pair in arcs], paid)
    memory = Remembered(net, 0)
    found = memory.forgets(trail)
    assert found == [
        (node if what == "reward" else net.graph.n_nodes + numbers[node], nodes)
        for (what, node), nodes in expected
    ]
    assert memory.add(found, 14)
    assert memory.forgets(trail) == []


def test_too_many_states_are_none():
    net = new_net(_complete(5).world)
    memory = Remembered(net, 4).pack()  # all four rewards, which are few enough
    n = len(find_states(net, memory, 10_000, 100_000).node)
    # At each node itself is remembered, and any of the other three; at the base any of the four.
    assert n == 4 * 2**3 + 2**4
    assert len(find_states(net, memory, n, 100_000).node) == n
    assert len(find_states(net, memory, n - 1, 100_000).node) == 0
    n_masks = int((1 << memory.n_bits).sum())
    assert len(find_states(net, memory, n, n_masks).node) == n
    assert len(find_states(net, memory, n, n_masks - 1).node) == 0


def _complete(n_nodes):
    graph = nx.complete_graph(n_nodes, nx.DiGraph())
    nx.set_node_attributes(graph, {node: float(node > 0) for node in graph}, "reward")
    nx.set_edge_attributes(graph, 0.9, "survival")
    return Mission(graph, base=0, robots=1)


def test_parts_that_hang_on_bridges(monkeypatch):
    """0 - 1 - 2 and 1 - 3, and a triangle at 3."""
    both = [(0, 1), (1, 2), (1, 3), (3, 4), (4, 5), (5, 3)]
    graph = nx.DiGraph([*both, *((b, a) for a, b in both)])
    nx.set_node_attributes(graph, {n: float(n in (2, 5)) for n in graph}, "reward")
    nx.set_edge_attributes(graph, 0.9, "survival")
    world = Mission(graph, base=0, robots=1).world
    monkeypatch.setattr(net_module, "_MOST_JOINED", 1)
    base, *pieces = pieces_of(world)
    assert (base.nodes, base.above, base.arc, base.back) == ((0,), -1, -1, -1)
    assert [(piece.gate, piece.nodes) for piece in pieces] == [(0, (1,)), (1, (2,)), (1, (3, 4, 5))]
    assert [piece.above for piece in pieces] == [0, 1, 1]
    for piece in pieces:
        assert world.graph.tail[piece.arc] == world.graph.head[piece.back] == piece.gate
        assert world.graph.head[piece.arc] == world.graph.tail[piece.back] == min(piece.nodes)
    monkeypatch.setattr(net_module, "_MOST_JOINED", 2)
    assert [piece.nodes for piece in pieces_of(world)] == [(0, 1, 3, 4, 5), (2,)]


def test_arcs_without_any_use_are_left_out():
    """Node 2 hangs on 1 and pays nothing; node 3 is too dangerous for the floor."""
    graph = nx.DiGraph([(0, 1), (1, 0), (1, 2), (2, 1), (0, 3), (3, 0)])
    nx.set_node_attributes(graph, {n: float(n in (1, 3)) for n in graph}, "reward")
    nx.set_edge_attributes(graph, 0.9, "survival")
    graph.edges[0, 3]["survival"] = 0.3
    mission = Mission(graph, base=0, robots=1)
    kept = new_net(mission.limited(0.5)).graph
    assert list(zip(kept.tail.tolist(), kept.head.tolist(), strict=True)) == [(0, 1), (1, 0)]
    assert new_net(mission.world).graph.n_arcs == 4
    assert new_net(mission.limited(0.0, 1.5)).graph.n_arcs == 0  # two hops are a length of 2


def test_no_arc_leads_to_more_than_the_best():
    """As floats multiply: ways that are equally safe differ in their last bits."""
    rng = np.random.default_rng(0)
    graph = nx.grid_2d_graph(12, 12).to_directed()
    nx.set_node_attributes(graph, 1.0, "reward")
    for arc in graph.edges:
        graph.edges[arc]["survival"] = float(rng.choice([0.9, 0.95, 0.97]))
    net = new_net(Mission(graph, base=(0, 0), robots=1).world)
    there = net.reach[net.graph.tail] * net.graph.mean_survival
    assert (there <= net.reach[net.graph.head]).all()
