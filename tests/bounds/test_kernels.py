"""Relaxed trails and exact ones, beside readable twins: dictionaries of states, and all trails."""

from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from botohe_moo import Mission
from botohe_moo.bounds.kernels.relaxed import follow, relax
from botohe_moo.bounds.kernels.states import Worth, find_states
from botohe_moo.bounds.kernels.trails import Completions, Stairs, TrailRule, find_trails, new_depths
from botohe_moo.bounds.net import Remembered, new_net, pieces_of
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
        alive *= graph.survival[arcs[pair]]
        if pair[1] not in seen:
            worth += price_at(prices, pair[1], alive / net.reach[pair[1]] * N_LEVELS)
        seen.add(pair[1])
    return worth + mu * alive


def states_by_dictionary(net, remembered):
    """What ``find_states`` finds: states as (node, set of bits), and their links."""
    graph, n = net.graph, net.graph.n_nodes
    backs = (
        {piece.back: piece.arc for piece in pieces_of(net.world)[1:]}
        if any(remembered.bits)
        else {}
    )
    found, todo = {}, [(net.base, frozenset())]
    while todo:
        state = todo.pop()
        if state in found:
            continue
        found[state] = links = {}
        node, bits = state
        for arc in range(graph.first[node], graph.first[node + 1]):
            if n + arc in bits:
                continue
            head = int(graph.head[arc])
            taken = {n + arc, n + backs.get(arc, arc)} | (
                {head} if graph.reward[head] > 0 else set()
            )
            after = frozenset((bits | taken) & set(remembered.bits[head]))
            pays = graph.reward[head] > 0 and arc not in backs and head not in bits
            links[arc] = ((head, after), pays)
            todo.append((head, after))
    return found


def values_by_dictionary(net, states, prices, mu):
    """Value iteration from below, all states at once."""
    levels = np.arange(N_LEVELS + 1)
    values = {state: np.zeros(N_LEVELS + 1) for state in states}
    for _ in range(3_000):
        change = 0.0
        for (node, bits), links in states.items():
            best = mu * levels / N_LEVELS if node == net.base else np.zeros(N_LEVELS + 1)
            for arc, (to, pays) in links.items():
                there = net.ratio[arc] * levels
                value = np.interp(there, levels, values[to])
                best = np.maximum(best, value + pays * price_at(prices, to[0], there))
            change = max(change, (best - values[node, bits]).max())
            values[node, bits] = best
        if change < 1e-13:
            return values
    return None


def shortfall(net, states, prices, mu, cap, values):
    """The most by which a value falls short of the best that one step leads to."""
    levels, most = np.arange(N_LEVELS + 1), 0.0
    for state, node in enumerate(states.node):
        best = mu * levels / N_LEVELS if node == net.base else np.zeros(N_LEVELS + 1)
        for link in range(states.first[state], states.first[state + 1]):
            arc = states.arc[link]
            there = net.ratio[arc] * levels
            value = np.interp(there, levels, values[states.to[link]])
            value += states.pays[link] * price_at(prices, net.graph.head[arc], there)
            best = np.maximum(best, value)
        most = max(most, (np.minimum(best, cap[node]) - values[state]).max())
    return most


def prepared(mission, nearest, n_bits, least=0.0):
    net = new_net(mission.limited(least))
    remembered = Remembered(net, nearest, n_bits, 100)
    return net, remembered, find_states(net, remembered.pack(), 100_000)


dangerous = missions(survivals=st.sampled_from([0.5, 0.8, 0.9, 0.97]))
memories = st.sampled_from([(0, 0), (1, 1), (2, 4), (7, 9)])


@examples(60)
@given(dangerous, memories, st.integers(0, 99))
def test_what_lies_ahead_is_that_of_value_iteration(mission, memory, seed):
    net, remembered, states = prepared(mission, *memory)
    prices, mu = drawn_prices(net, seed)
    twin = states_by_dictionary(net, remembered)
    assert len(states.node) == len(twin)
    assert len(states.arc) == sum(map(len, twin.values()))
    assert states.pays.sum() == sum(pays for links in twin.values() for _, pays in links.values())
    values = np.zeros((len(states.node), N_LEVELS + 1))
    cap = np.full((net.graph.n_nodes, N_LEVELS + 1), np.inf)
    short, n_looks = relax(net, states, Worth(prices, mu), cap, 1e-13, values)
    expected = values_by_dictionary(net, twin, prices, mu)
    start = expected[net.base, frozenset()]
    assert values[0] == pytest.approx(start, rel=1e-9, abs=1e-9)
    assert np.sort(values.sum(axis=1)) == pytest.approx(
        np.sort([value.sum() for value in expected.values()]), rel=1e-9, abs=1e-9
    )
    assert 0 <= short < 1e-9
    # All links, and each state at least once for its choice.
    assert n_looks >= len(states.arc) + len(states.node)
    assert shortfall(net, states, prices, mu, cap, values) <= short + 1e-12


@examples(60)
@given(dangerous, memories, st.integers(0, 99), st.sampled_from([1e-3, 0.1]))
def test_how_far_values_fall_short_is_known(mission, memory, seed, tolerance):
    """With a wide tolerance and a cap, which both cut values."""
    net, _, states = prepared(mission, *memory)
    prices, mu = drawn_prices(net, seed)
    values = np.zeros((len(states.node), N_LEVELS + 1))
    most = np.random.default_rng(seed).uniform(0.2, 2.0) * (prices[:, -1].max() + mu)
    cap = np.tile(most * np.arange(N_LEVELS + 1) / N_LEVELS, (net.graph.n_nodes, 1))
    short, _ = relax(net, states, Worth(prices, mu), cap, tolerance, values)
    assert 0 <= short <= tolerance + 1e-9
    assert (values <= cap[states.node] + 1e-12).all()
    assert shortfall(net, states, prices, mu, cap, values) <= short + 1e-12


@examples(80)
@given(missions(max_nodes=6), memories, st.sampled_from([0.0, 0.4]), st.integers(0, 99))
def test_no_trail_is_worth_more_than_relaxed_ones_and_the_best_is_found(
    mission, memory, floor, seed
):
    """And the best is found; also where arcs are sure: relaxed trails collect up to the cap then.

    Arcs that lead to no reward are not on any of them.
    """
    net, _, states = prepared(mission, *memory, floor)
    prices, mu = drawn_prices(net, seed)
    values = np.zeros((len(states.node), N_LEVELS + 1))
    cap = np.full((net.graph.n_nodes, N_LEVELS + 1), 2 * prices[:, -1].sum() + mu)
    short, _ = relax(net, states, Worth(prices, mu), cap, 1e-13, values)
    assert short < np.inf
    spare = net.graph.n_arcs * (short + 1e-12)
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
    _, most = follow(net, states, Worth(prices, mu), values, -1, np.empty(1, np.int64))
    assert most + spare >= max(worths, default=0.0)
    line = Completions(values[None], np.zeros(1), np.zeros((1, net.graph.n_nodes)))
    depths = new_depths(net, np.random.default_rng(seed), 1 << 8, 2, 1)
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
    values, beside = [], []
    for mu in mus:
        for own in (prices, lower):
            value = np.zeros((len(states.node), N_LEVELS + 1))
            cap = np.full((net.graph.n_nodes, N_LEVELS + 1), np.inf)
            assert relax(net, states, Worth(own, mu), cap, 1e-13, value)[0] < 1e-9
            values.append(value)
            beside.append((prices - own).max(axis=1))
    return Completions(np.array(values), np.repeat(mus, 2), np.array(beside))


@examples(80)
@given(
    missions(max_nodes=6, survivals=st.sampled_from([0.5, 0.8, 0.97])),
    memories,
    st.sampled_from([0.0, 0.3, 0.6]),
    st.integers(0, 99),
)
def test_stairs_are_above_all_trails(mission, memory, least, seed):
    net, _, states = prepared(mission, *memory)
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
    depths = new_depths(net, np.random.default_rng(seed), 1 << 8, 5_000, 6)
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
        small = new_depths(net, np.random.default_rng(seed), 1 << 8, above - 1, 6)
        assert find_trails(*given, Stairs(needed, width, least), every, small) < 0


@examples(40)
@given(dangerous, memories, st.integers(0, 99), st.integers(-1, 3))
def test_the_best_relaxed_trail_is_followed(mission, memory, seed, turn):
    net, _, states = prepared(mission, *memory)
    prices, mu = drawn_prices(net, seed)
    values = np.zeros((len(states.node), N_LEVELS + 1))
    cap = np.full((net.graph.n_nodes, N_LEVELS + 1), np.inf)
    relax(net, states, Worth(prices, mu), cap, 1e-13, values)
    links = np.empty(300, np.int64)
    n, most = follow(net, states, Worth(prices, mu), values, turn, links)
    taken = links[:n]
    source = np.repeat(np.arange(len(states.node)), np.diff(states.first))
    assert (source[taken[1:]] == states.to[taken[:-1]]).all()
    assert len(taken) == 0 or source[taken[0]] == 0
    arcs = states.arc[taken]
    levels = np.cumprod(net.ratio[arcs]) * N_LEVELS
    worth = mu * levels[-1] / N_LEVELS if len(taken) else 0.0
    for head, level, pays in zip(net.graph.head[arcs], levels, states.pays[taken], strict=True):
        worth += pays * price_at(prices, head, level)
    # What lies ahead is on chords, which are above what a single way is worth.
    assert worth <= most + 1e-9
    if turn == -1 and len(taken):
        there = net.ratio[arcs[0]] * N_LEVELS
        first = np.interp(there, np.arange(N_LEVELS + 1), values[states.to[taken[0]]])
        first += states.pays[taken[0]] * price_at(prices, net.graph.head[arcs[0]], there)
        assert first == pytest.approx(most, rel=1e-9, abs=1e-9)


def test_too_many_states_are_none():
    net = new_net(_complete(5).world)
    memory = Remembered(net, 4, 4, 100).pack()
    n = len(find_states(net, memory, 10_000).node)
    # At each node itself is remembered, and any of the other three; at the base any of the four.
    assert n == 4 * 2**3 + 2**4
    assert len(find_states(net, memory, n).node) == n
    assert len(find_states(net, memory, n - 1).node) == 0


def _complete(n_nodes):
    graph = nx.complete_graph(n_nodes, nx.DiGraph())
    nx.set_node_attributes(graph, {node: float(node > 0) for node in graph}, "reward")
    nx.set_edge_attributes(graph, 0.9, "survival")
    return Mission(graph, base=0, robots=1)


def test_parts_that_hang_on_bridges():
    """0 - 1 - 2 and 1 - 3, and a triangle at 3."""
    both = [(0, 1), (1, 2), (1, 3), (3, 4), (4, 5), (5, 3)]
    graph = nx.DiGraph([*both, *((b, a) for a, b in both)])
    nx.set_node_attributes(graph, {n: float(n in (2, 5)) for n in graph}, "reward")
    nx.set_edge_attributes(graph, 0.9, "survival")
    world = Mission(graph, base=0, robots=1).world
    base, *pieces = pieces_of(world)
    assert (base.nodes, base.above, base.arc, base.back) == ((0,), -1, -1, -1)
    assert [(piece.gate, sorted(piece.nodes)) for piece in pieces] == [
        (0, [1]),
        (1, [2]),
        (1, [3, 4, 5]),
    ]
    assert [piece.above for piece in pieces] == [0, 1, 1]
    for piece in pieces:
        assert world.graph.tail[piece.arc] == world.graph.head[piece.back] == piece.gate
        assert world.graph.head[piece.arc] == world.graph.tail[piece.back] == min(piece.nodes)


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
    there = net.reach[net.graph.tail] * net.graph.survival
    assert (there <= net.reach[net.graph.head]).all()
