"""Hypothesis strategies for missions and for valid trail plans on them."""

from __future__ import annotations

import warnings
from dataclasses import replace
from math import comb, prod

import networkx as nx
from hypothesis import assume
from hypothesis import strategies as st

from botohe_moo.mission import Kind, Mission, MissionError, PlanError, Scenario
from botohe_moo.trails import TrailPlan
from tests.twins import all_trails

survivals = st.one_of(st.just(1.0), st.floats(0.01, 1.0))
rewards = st.one_of(st.just(0.0), st.floats(0.0, 10.0))
lengths = st.one_of(st.sampled_from([0.0, 0.1, 0.2, 1.0, 2.0, 3.0]), st.floats(0.0, 3.0))
_LENGTHS = lengths


def mission_of(arcs, rewards, *, both_ways=False, **options):
    """Return a mission with base 0 from arcs (tail, head, survival[, length]) and rewards."""
    graph = nx.DiGraph()
    graph.add_nodes_from((node, {"reward": float(reward)}) for node, reward in enumerate(rewards))
    for tail, head, *given in arcs:
        for ends in ((tail, head), (head, tail))[: 1 + both_ways]:
            graph.add_edge(*ends, **dict(zip(("survival", "length"), given, strict=False)))
    return Mission(graph, base=0, **options)


@st.composite
def missions(
    draw, min_nodes=2, max_nodes=7, max_robots=3, one_way=None, survivals=survivals, lengths=None
):
    """Strongly connected missions; one-way ones have nodes with more arcs in than out.

    In half of them some arcs, or all, have a length; with ``lengths`` all arcs have one of these.
    """
    n_nodes = draw(st.integers(min_nodes, max_nodes))
    one_way = draw(st.booleans()) if one_way is None else one_way
    graph = nx.DiGraph()
    graph.add_node(0, reward=draw(rewards))
    for node in range(1, n_nodes):
        graph.add_node(node, reward=draw(rewards))
        before = st.integers(0, node - 1)
        entry = draw(before)
        graph.add_edge(entry, node)
        graph.add_edge(node, draw(before) if one_way else entry)
    if n_nodes > 1:
        pairs = st.tuples(st.integers(0, n_nodes - 1), st.integers(1, n_nodes - 1))
        for tail, offset in draw(st.lists(pairs, max_size=6)):
            head = (tail + offset) % n_nodes
            graph.add_edge(tail, head)
            if not one_way:
                graph.add_edge(head, tail)
    for tail, head in graph.edges:
        graph.edges[tail, head]["survival"] = draw(survivals)
    arcs = list(graph.edges)
    if lengths is None:
        lengths, arcs = _LENGTHS, draw(st.sampled_from([[], [], arcs[::2], arcs]))
    for arc in arcs:
        graph.edges[arc]["length"] = draw(lengths)
    return Mission(graph, base=0, robots=draw(st.integers(1, max_robots)), name="drawn")


@st.composite
def team_missions(draw, max_nodes=5, max_robots=2, pays=None, labels=None, aboard=True, **options):
    """Missions of one to three kinds, up to ``max_robots`` each, with all attributes of files.

    Kinds may be unable to reach some nodes, or to come back from them. Nodes pay on arrival or on
    return, unless ``pays`` says when all of them pay, and are numbered, unless ``labels`` draws
    what they are called. Some robots carry something from the start, unless ``aboard`` is false.
    """
    graph = draw(missions(max_nodes=max_nodes, **options)).graph.copy()
    if labels is not None:
        drawn = draw(st.lists(labels, min_size=len(graph), max_size=len(graph), unique=True))
        graph = nx.relabel_nodes(graph, dict(enumerate(drawn)))
    names = draw(st.lists(st.sampled_from(["robot", "drone", "lac é"]), min_size=1, unique=True))
    times = st.sampled_from(["arrival", "return"])
    shares = st.sampled_from([0.0, 0.25, 1.0, 1.0])
    survivals = st.sampled_from([0.0, 0.25, 0.5, 0.75, 1.0])
    extras = {
        "share": shares | st.fixed_dictionaries({}, optional=dict.fromkeys(names, shares)),
        "depot": st.sampled_from([False, False, True]),
    }
    if pays is None:
        extras["pays"] = times
    for _, node in graph.nodes(data=True):
        node["reward"] = draw(st.integers(0, 9))
        node.update(draw(st.fixed_dictionaries({}, optional=extras)))
    by_kind = st.fixed_dictionaries(dict.fromkeys(names, survivals))
    for *_, arc in graph.edges(data=True):
        arc["survival"] = draw(st.just(0.5) | by_kind)
    kind = {
        "robots": st.integers(1, max_robots),
        "start": st.none() | st.sampled_from(list(graph)),
        "end": st.none() | st.sampled_from(list(graph)),
        "min_survival": st.sampled_from([0.0, 0.0, 0.25]),
        "max_length": st.sampled_from([None, None, 4, 99.5]),
    }
    base, pays = next(iter(graph)), pays or draw(st.none() | times)
    returning = [v for v, node in graph.nodes(data=True) if node.get("pays", pays) == "return"]
    may_carry = [v for v in returning if v != base and not graph.nodes[v].get("depot")]
    if aboard and may_carry:
        some = st.lists(st.sampled_from(may_carry), unique=True, max_size=2)
        kind["aboard"] = st.just(()) | some.map(tuple)
    kinds = [Kind(name, **draw(st.fixed_dictionaries(kind))) for name in names]
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*no kind of robots can collect")
        try:
            return Mission(graph, base=base, kinds=kinds, pays=pays, name="drawn")
        except MissionError:  # a kind has no way from its start to its end, or none within limits
            assume(False)


@st.composite
def trails(draw, mission, max_hops=12, robot=0):
    """A valid trail of a robot as indices of kernels; nodes and base may be visited several times.

    Without kinds they are indices of the mission's nodes.
    """
    graph, team = mission.world.graph, mission.world.team
    unused = {node: [] for node in range(graph.n_nodes)}
    for tail, head in zip(graph.tail.tolist(), graph.head.tolist(), strict=True):
        unused[tail].append(head)
    here = int(team.start[robot])
    end, trail = int(team.end[here]), [here]
    for _ in range(draw(st.integers(0, max_hops))):
        hops = [head for head in unused[here] if way_home(unused, (here, head), end)]
        if not hops:
            break
        head = draw(st.sampled_from(hops))
        unused[here].remove(head)
        trail.append(head)
        here = head
    return trail + way_home(unused, (None, here), end)[1:]


def way_home(unused, arc, base):
    """The shortest walk from an arc's head to the base that does not use the arc; None without."""
    before = {arc[1]: None}
    queue = [arc[1]]
    for node in queue:
        if node == base:
            walk = [node]
            while (node := before[node]) is not None:
                walk.append(node)
            return walk[::-1]
        for head in unused[node]:
            if head not in before and (node, head) != arc:
                before[head] = node
                queue.append(head)
    return None


@st.composite
def plans(draw, mission):
    """A valid plan, as a list of one trail of node indices per robot."""
    return [draw(trails(mission, robot=robot)) for robot in range(mission.robots)]


@st.composite
def missions_with_plans(draw, **options):
    mission = draw(missions(**options))
    return mission, mission.plan(draw(plans(mission)))  # the nodes' labels are their indices


@st.composite
def team_missions_with_plans(draw, **options):
    mission = draw(team_missions(**options))
    return mission, TrailPlan(draw(plans(mission)))


@st.composite
def scenario_missions_with_plans(draw, cases=None):
    """Missions of one kind or several with one to four scenarios, and plans of them.

    Some arcs are closed in some scenarios. Limits of kinds that scenarios break are left out.
    """
    cases = missions_with_plans() | team_missions_with_plans() if cases is None else cases
    mission, plan = draw(cases)
    graph = mission.graph.copy()
    for node in graph:
        graph.nodes[node]["zone"] = draw(st.sampled_from(["east", "west"]))
    zones, some = {of["zone"] for _, of in graph.nodes(data=True)}, st.floats(0.0, 1.0)
    n, found = draw(st.integers(1, 4)), []
    for i in range(n):
        arcs = draw(st.lists(st.sampled_from(list(graph.edges)), max_size=3)) if graph.edges else ()
        nodes = draw(st.lists(st.sampled_from(list(graph)), max_size=2))
        scenario = Scenario(
            f"number {i}",
            draw(st.sampled_from([0.9 / n, 1 / n, 0.1])),
            factor=draw(st.sampled_from([0.0, 0.5, 1.0, 2.0, 8.0])),
            zone=draw(st.sampled_from([None, *sorted(zones)])),
            survival={arc: draw(st.just(0.0) | some) for arc in arcs},
            reward={node: draw(rewards) for node in nodes},
        )
        found.append(scenario)
    given = {"base": mission.base, "pays": mission.pays, "name": "drawn", "scenarios": found}
    kinds = [replace(kind, min_survival=0.0) for kind in mission.kinds]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            drawn = Mission(graph, kinds=kinds, **given)
            drawn.evaluate([plan])
        except (MissionError, PlanError):  # arcs that nobody survives in any scenario
            assume(False)
    return drawn, plan


@st.composite
def small_missions(draw, max_robots=3, max_trails=40, **options):
    """A mission with few trails, and all of them."""
    mission = draw(missions(min_nodes=1, max_nodes=5, max_robots=max_robots, **options))
    assume(not 0 < mission.total_reward < 1e-300)  # of which parts would be rounded to nothing
    trails = all_trails(mission, 1000)
    assume(trails is not None and len(trails) <= max_trails)
    return mission, trails


@st.composite
def small_team_missions(draw, max_teams=2_000, **options):
    """A mission of kinds of robots with few trails, and all of them, kind by kind."""
    mission = draw(team_missions(**options))
    trails = [all_trails(mission, 1000, mission.kind_of.index(kind)) for kind in mission.kinds]
    assume(None not in trails)
    robots = [kind.robots for kind in mission.kinds]
    n_teams = (comb(len(of_kind) + n - 1, n) for of_kind, n in zip(trails, robots, strict=True))
    assume(prod(n_teams) <= max_teams)
    return mission, trails
