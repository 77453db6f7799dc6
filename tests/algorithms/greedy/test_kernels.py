"""The search for one robot's trail: exact where nothing is cut, valid and deterministic always."""

from itertools import pairwise
from math import inf

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numba import njit

from botohe_moo.algorithms.greedy import kernels
from botohe_moo.algorithms.greedy.kernels import BeamRule, new_beam
from botohe_moo.core.paths import find_near, new_near
from botohe_moo.mission import Kind, Mission, load_mission
from tests.core.test_paths import whole_graph
from tests.examples import examples
from tests.strategies import lengths, mission_of, missions, team_missions
from tests.twins import alike, all_trails, arc_survivals, ends_of, length_of, survival_of, within

WIDE = 100_000


def best_trail(
    mission, worth, survival_weight, limits=(0.0, inf), width=WIDE, *, n_near=64, robot=0, **options
):
    """The trail as nodes, its value, and whether the beam was cut."""
    world, (start, end) = alike(mission, *limits), ends_of(mission, robot)
    graph, worth = world.graph, np.array(worth, np.float64)
    rule = BeamRule(robot, world.n_robots + robot, worth, survival_weight, width)
    beam = new_beam(world, width, options.get("max_labels", kernels.MAX_LABELS))
    n, value, cut = kernels.best_trail(world, new_near(graph.n_nodes, n_near), rule, beam)
    if n > 0:
        arcs = beam.trail[:n]
        assert graph.tail[arcs[0]] == start
        assert np.array_equal(graph.head[arcs[:-1]], graph.tail[arcs[1:]])
        return [start, *graph.head[arcs].tolist()], value, cut
    trail = [start]
    while trail[-1] != end:  # the safest way
        trail.append(int(graph.head[world.ways.homeward[trail[-1]]]))
    return trail, value, cut


def value_of(mission, trail, worth, survival_weight):
    """Straight from the definition."""
    reached = {node: survival_of(mission, trail[: trail.index(node) + 1]) for node in set(trail)}
    collected = sum(worth[node] * alive for node, alive in reached.items())
    return collected + survival_weight * survival_of(mission, trail)


def is_sure(mission, trail, every, limits):
    """Whether a trail survives a beam for sure: any way home from its nodes keeps the limits."""
    return all(
        within(mission, [other], *limits) == [other]
        for stop in range(1, len(trail))
        for other in every
        if other[:stop] == trail[:stop] and len(set(other[stop - 1 :])) == len(other) - stop + 1
    )


@examples(400)
@given(
    missions(min_nodes=1, max_nodes=6, lengths=lengths) | team_missions(max_nodes=6, max_robots=1),
    st.data(),
    st.integers(1, 6),
    st.sampled_from([0.0, 0.05, 0.3, 1.0]),
    st.just(0.0) | st.floats(0.0, 1.0),
    st.sampled_from([inf, inf, 3.0, 5.0]),
)
def test_a_wide_beam_finds_the_best_trail_within_limits(
    mission, data, n_near, survival_weight, least, longest
):
    robot, limits = data.draw(st.integers(0, mission.robots - 1)), (least, longest)
    found = all_trails(mission, 2_000, robot)
    assume(found is not None)
    values, n = st.just(0.0) | st.floats(0.01, 1.0), mission.world.graph.n_nodes
    worth = data.draw(st.lists(values, min_size=n, max_size=n))
    given = (mission, worth, survival_weight, limits)
    trail, value, cut = best_trail(*given, n_near=n_near, robot=robot)
    assert not cut
    kept = within(mission, found, *limits)
    sure = [t for t in kept if longest == inf or is_sure(mission, t, found, limits)]
    best = max([value_of(mission, t, worth, survival_weight) for t in sure], default=-1.0)
    assert value >= best - 1e-9 * abs(best)
    if tuple(trail) in kept:
        expected = value_of(mission, trail, worth, survival_weight)
        assert value == pytest.approx(expected, rel=1e-9)
    else:  # the safest way, which keeps no limits
        assert value == -1.0 or survival_of(mission, trail) < least
        assert not sure


def test_where_the_safest_way_is_too_long():
    """It is worth most, by node 2; by 3 there is a shorter one."""
    arcs = [(2, 1, 0.5), (0, 3, 0.5), (3, 1, 0.5), (0, 2, 1.0, 3.0), (0, 1, 0.375)]
    mission = mission_of(arcs, [1] * 4, kinds=[Kind("drone", 1, end=1)])
    found = [
        best_trail(mission, [0.0, 0.0, 9.0, 2.0], 1.0, (0.0, longest))[:2]
        for longest in (9.0, 2.0, 1.0, 0.5)
    ]
    assert found == [([0, 2, 1], 9.5), ([0, 3, 1], 1.25), ([0, 1], 0.375), ([0, 2, 1], -1.0)]


@pytest.mark.parametrize(
    ("seed", "limits"),
    [(0, (0.0, inf)), (1, (0.3, inf)), (2, (0.0, 9.0)), (3, (0.4, 14.0)), (4, (0.0, inf))],
)
def test_beams_that_are_too_narrow_find_what_the_twin_finds(seed, limits):
    mission, cuts = random_mission(14, 45, seed), 0
    worth = mission.rewards / mission.total_reward
    for width in (1, 3, 10):
        for survival_weight in (0.0, 0.2):
            twin = Beam(mission, 5, worth, survival_weight, alike(mission, *limits), width)
            trail, value, cut = best_trail(mission, worth, survival_weight, limits, width, n_near=5)
            assert trail == twin.best_trail()
            assert value == pytest.approx(twin.best_value, rel=1e-12)
            assert cut == twin.cut
            cuts += cut
    assert cuts > 0


def test_labels_come_to_an_end():
    museum = load_mission("art_museum")
    worth = museum.rewards / museum.total_reward
    _, value, _ = best_trail(museum, worth, 0.0, width=100)
    trail, less, cut = best_trail(museum, worth, 0.0, width=100, max_labels=300)
    assert cut
    assert 0 < less < value
    museum.with_robots(1).plan([[museum.nodes[node] for node in trail]])


def random_mission(n_nodes, n_arcs, seed):
    """One-way, with no two paths alike."""
    rng = np.random.default_rng(seed)
    cycle = rng.permutation(n_nodes).tolist()
    ends = set(zip(cycle, cycle[1:] + cycle[:1], strict=True))
    while len(ends) < n_arcs:
        ends.add(tuple(rng.choice(n_nodes, 2, replace=False).tolist()))
    arcs = [(*arc, rng.uniform(0.8, 1.0), rng.uniform(0.5, 2.0)) for arc in sorted(ends)]
    rewards = [rng.uniform(0, 1) if node % 3 else 0.0 for node in range(n_nodes)]
    return mission_of(arcs, rewards, robots=1)


class Beam:
    """The beam search, one rule a line; labels are trails as tuples of nodes."""

    def __init__(self, mission, n_near, worth, survival_weight, world, width):
        self.mission, self.graph, self.worth = mission, world.graph, worth
        self.near, self.ways = find_near(world, n_near), world.ways
        self.survival_weight, self.width = survival_weight, width
        self.least, self.longest = world.limits.floors[0], world.limits.budgets[0]
        self.survival, self.base = arc_survivals(mission), mission.index(mission.base)
        self.cut = False
        self.best, self.best_value = (self.base,), self.value((self.base,)) + survival_weight

    def alive(self, trail):
        return survival_of(self.mission, trail)

    def value(self, trail):
        return value_of(self.mission, trail, self.worth, 0.0)

    def stay(self, trail):
        """What surviving is worth if the robot turns home and every arc may be used."""
        return self.survival_weight * self.alive(trail) * self.ways.home[trail[-1]]

    def way_home(self, trail):
        """The trail gone home by the safest way over unused arcs, or else by the shortest one.

        None where neither keeps the limits.
        """
        free = whole_graph(self.mission)
        free.remove_edges_from(list(pairwise(trail)))
        if not nx.has_path(free, trail[-1], self.base):
            return None
        for weight in ("cost", "length"):
            way = nx.dijkstra_path(free, trail[-1], self.base, weight=weight)
            if within(self.mission, [closed := trail + tuple(way[1:])], self.least, self.longest):
                return closed
        return None

    def is_too_far(self, node, trail):
        """Whether no trail that begins like this keeps the budget if it goes to a node."""
        if self.ways.shortest is None:
            return False
        shortest = self.ways.shortest.length[node]
        return length_of(self.mission, trail) + shortest > self.longest

    def is_blocked(self, trail):
        """Whether an arc of the safest way home with every arc free is used."""
        here, used = trail[-1], set(pairwise(trail))
        while here != self.base:
            there = int(self.graph.head[self.ways.homeward[here]])
            if (here, there) in used:
                return True
            here = there
        return False

    def ahead(self, trail):
        """Reach, worth and number of each near node that is not visited and not too far."""
        here = trail[-1]
        near = zip(self.near.nodes[here].tolist(), self.near.reach[here], strict=True)
        return [
            (reach, self.worth[node], node)
            for node, reach in near
            if node not in trail and not self.is_too_far(node, trail)
        ]

    def bound(self, trail):
        nearby = sum(reach * worth for reach, worth, _ in self.ahead(trail))
        near = self.near.nodes[trail[-1]].tolist()
        far = sum(w for v, w in enumerate(self.worth) if v not in (*trail, *near))
        most = nearby + far * self.near.reach[trail[-1], -1]
        return self.value(trail) + self.alive(trail) * most + self.stay(trail)

    def rank(self, trail):
        promise = 0.0
        for reach, worth, node in self.ahead(trail):
            detour = self.ways.home[trail[-1]] - reach * self.ways.home[node]
            promise += max(0.0, reach * worth - self.survival_weight * detour)
        return self.value(trail) + self.stay(trail) + 0.5 * self.alive(trail) * promise

    def is_good_enough(self, trail):
        return self.bound(trail) > self.best_value * (1 + 1e-12)

    def close(self, trail):
        """Whether the robot can get home; notes the trail that does if it is the best known."""
        closed = self.way_home(trail)
        if closed is None:
            return False
        promising = self.value(trail) + self.stay(trail) > self.best_value
        if self.least > 0 or self.longest < inf or promising or not self.is_blocked(trail):
            value = self.value(closed) + self.survival_weight * self.alive(closed)
            if value > self.best_value:
                self.best, self.best_value = closed, value
        return True

    def expand(self, level):
        states = {}
        for trail in level:
            used = set(pairwise(trail))
            for tail, head in self.survival:
                child = (*trail, head)
                if tail != trail[-1] or (tail, head) in used or not self.is_good_enough(child):
                    continue
                state = head, frozenset(pairwise(child))
                if state in states and self.value(states[state]) >= self.value(child):
                    continue
                if self.close(child):
                    states[state] = child
        return list(states.values())

    def select(self, children):
        children = sorted(filter(self.is_good_enough, children), key=self.rank, reverse=True)
        if len(children) <= self.width:
            return children
        self.cut = True
        kinds, first, others = set(), [], []
        for child in children:
            kind = child[-1], frozenset(node for node in child if self.worth[node] > 0)
            (others if kind in kinds else first).append(child)
            kinds.add(kind)
        return (first + others)[: self.width]

    def best_trail(self):
        level = [(self.base,)]
        while level:
            level = self.select(self.expand(level))
        return list(self.best)


def test_a_beam_can_be_used_again():
    museum = load_mission("art_museum")
    world, worth = museum.world, museum.rewards / museum.total_reward
    near, beam = new_near(world.graph.n_nodes, 64), new_beam(world, 30)
    rule = BeamRule(0, world.n_robots, worth, 0.1, 30)
    n, *found = kernels.best_trail(world, near, rule, beam)
    arcs = beam.trail[:n].tolist()
    assert n > 20
    kernels.best_trail(world, near, rule._replace(worth=worth[::-1].copy()), beam)
    assert [n, *found] == [*kernels.best_trail(world, near, rule, beam)]
    assert beam.trail[:n].tolist() == arcs


@pytest.mark.parametrize(("survival", "worth"), [(5e-324, 1.0), (1.0, 5e-324)])
def test_extreme_survivals_and_worths(survival, worth):
    graph = nx.complete_graph(5, nx.DiGraph)
    nx.set_node_attributes(graph, 1.0, "reward")
    nx.set_edge_attributes(graph, survival, "survival")
    mission = Mission(graph, base=0, robots=1)
    trail, value, _ = best_trail(mission, [worth] * 5, 0.5, width=20)
    assert value >= 0.5 + worth
    assert value < inf
    assert (len(trail) > 5) == (survival == 1.0 and 0.5 + worth > 0.5)


sort_descending = njit(kernels._sort_descending)


@given(st.lists(st.integers(0, 5).map(float), min_size=1, max_size=70), st.data())
def test_the_first_numbers_are_sorted_and_equal_ones_stay_in_order(keys, data):
    chosen = data.draw(st.lists(st.integers(0, len(keys) - 1), unique=True))
    behind = [-1, -2]  # stays as it is
    found, spare = np.array([*chosen, *behind]), np.empty(len(chosen), np.int64)
    sort_descending(np.array(keys), found, spare, len(chosen))
    assert found.tolist() == sorted(chosen, key=lambda i: -keys[i]) + behind
