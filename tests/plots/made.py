"""Missions and tables to draw."""

import itertools

import networkx as nx
import numpy as np
import pandas as pd
from PIL import Image

from botohe_moo import Kind, Mission, load_mission

TOY, MUSEUM = load_mission("toy"), load_mission("art_museum")
MUSEUM_TRAILS = [[1, 2, 3, 5, 4, 2, 1], [1, 2, 21, 2, 1], [1]]
MUSEUM_PLAN = MUSEUM.plan(MUSEUM_TRAILS)
STORMY = TOY.with_scenarios(["storm=0.25,factor=3", "calm=0.5,factor=0.5"])
TOY_PLANS = [
    TOY.plan([trail, [1]]) for trail in ([1], [1, 2, 1], [1, 2, 4, 2, 1], [1, 3, 2, 4, 2, 3, 1])
]


def make(nodes, arcs, *, robots=1, base="dock"):
    """Make a mission of rewards by node, or attributes, and arcs with their survivals."""
    graph = nx.DiGraph(name="made")
    for node, of_node in nodes.items():
        graph.add_node(node, **(of_node if isinstance(of_node, dict) else {"reward": of_node}))
    for tail, head, survival in arcs:
        graph.add_edge(tail, head, survival=survival)
    return Mission(graph, base=base, robots=robots)


PLACES = {"dock": (0, 0), "hall": (1, 0), "pond": (2, 0.5), "quay": (2, -0.5), "roof": (1, 1)}
REWARDS = {"dock": 0, "hall": 2, "pond": 5, "quay": 1, "roof": 0}
KINDS = [Kind("drone", 2, start="roof"), Kind("rover", 1)]
TRAILS = [["roof", "pond", "hall", "dock"], ["roof", "hall", "dock"], ["dock"]]


def site(kinds=KINDS, pays="arrival", **more):
    """Rovers take neither the roof nor the pond; quay -> pond is one way, and for drones."""
    graph = nx.DiGraph()
    for node, place in PLACES.items():
        graph.add_node(node, pos=place, reward=REWARDS[node])
    for tail, head, drone, rover in [
        ("dock", "hall", 0.9, 0.8),
        ("hall", "quay", 0.9, 0.95),
        ("hall", "pond", 0.5, 0),
        ("hall", "roof", 0.8, 0),
        ("roof", "pond", 0.5, 0),
    ]:
        survival = {"drone": drone, "rover": rover, "scout": drone}
        survival = {kind.name: survival[kind.name] for kind in kinds}
        graph.add_edge(tail, head, survival=survival)
        graph.add_edge(head, tail, survival=survival)
    one_way = {"drone": 0.7, "rover": 0, "scout": 0.6}
    graph.add_edge("quay", "pond", survival={kind.name: one_way[kind.name] for kind in kinds})
    return Mission(graph, base="dock", kinds=kinds, pays=pays, name="site", **more)


def mixed():
    """The quay is a depot, the pond pays on return, and only rovers collect in the hall."""
    graph = nx.DiGraph(site().graph)
    graph.nodes["quay"]["depot"] = True
    graph.nodes["pond"]["pays"] = "return"
    graph.nodes["hall"]["share"] = {"drone": 0}
    return Mission(graph, base="dock", kinds=KINDS)


def pheromone_of(mission):
    """The n-th arc of each kind has n of reward's pheromone; the base's self-loop has a million."""
    nodes, n = mission.nodes, len(mission.nodes)
    graph = mission.world.graph
    rows = [
        (mission.kinds[tail // n].name, nodes[tail % n], nodes[head % n], float(i), 2.0)
        for i, (tail, head) in enumerate(zip(graph.tail, graph.head, strict=True))
    ]
    rows += [(kind.name, mission.base, mission.base, 1e6, 1e6) for kind in mission.kinds]
    return pd.DataFrame(rows, columns=["kind", "tail", "head", "reward", "survival"])


def write_map(folder, pixels, more="", *, resolution=0.5):
    """Write a map as ROS's map server has it; pixels are from 0, black, to 255."""
    Image.fromarray(np.asarray(pixels, np.uint8)).save(folder / "map.png")
    path = folder / "map.yaml"
    path.write_text(f"image: map.png\nresolution: {resolution}\norigin: [-1, -2, 0]\n{more}")
    return path


# Tables of studies


def trace_of(runs):
    """``{(algorithm, seed): [(evaluations, area), ...]}`` as rows of a trace."""
    rows = [
        (algorithm, seed, evaluations, evaluations / 100, area)
        for (algorithm, seed), records in runs.items()
        for evaluations, area in records
    ]
    columns = ["algorithm", "seed", "evaluations", "seconds", "area"]
    return pd.DataFrame(rows, columns=columns)


def fronts_of(runs):
    """``{(algorithm, seed): [(reward, survivors), ...]}`` as rows of plans, and of runs."""
    plans = [(*run, *point) for run, points in runs.items() for point in points]
    rows = [
        (*run, "done" if points else "failed", sum(map(sum, points)) / 100)
        for run, points in runs.items()
    ]
    return (
        pd.DataFrame(plans, columns=["algorithm", "seed", "reward", "survivors"]),
        pd.DataFrame(rows, columns=["algorithm", "seed", "status", "area"]),
    )


def areas_of(values, lost=()):
    """``{algorithm: areas}`` as runs and their summary."""
    runs = [
        (label, seed, "failed" if (label, seed) in lost else "done", area)
        for label, areas in values.items()
        for seed, area in enumerate(areas, start=1)
    ]
    summary = [(a, float(np.median(found)), min(found), max(found)) for a, found in values.items()]
    return (
        pd.DataFrame(runs, columns=["algorithm", "seed", "status", "area"]),
        pd.DataFrame(summary, columns=["algorithm", "area_median", "area_low", "area_high"]),
    )


RANKS = {"A": 1.2, "B": 2.0, "C": 2.9, "D": 3.9}


def ranks_of(ranks, difference):
    """Ranks and tests of all pairs: a pair differs if its ranks are far enough apart."""
    pairs = [
        (a, b, abs(ranks[a] - ranks[b]) > difference) for a, b in itertools.combinations(ranks, 2)
    ]
    return (
        pd.DataFrame(list(ranks.items()), columns=["algorithm", "average_rank"]),
        pd.DataFrame(pairs, columns=["algorithm", "other", "significant"]),
    )


TWO = {
    ("A", 1): [(10, 0.2), (100, 0.4)],
    ("A", 2): [(20, 0.1), (50, 0.3), (100, 0.5)],
    ("B", 1): [(10, 0.6)],
}
RUNS = {
    ("A", 1): [(1, 1)],
    ("A", 2): [(2, 2), (1, 3), (1, 1)],  # sums to 10: the largest
    ("A", 3): [(3, 1), (1, 2)],  # sums to 7: the median
    ("B", 1): [],
    ("B", 2): [],
    ("B", 3): [(4, 4)],
}
AREAS = {"A": [0.3, 0.1, 0.2], "B": [0.5], "C": [0.0, 0.4]}
SHORTFALLS = (
    pd.DataFrame(
        [("site", "ants", 0.4, 0.8), ("site", "greedy", 0.45, 0.9), ("mine", "ants", 0.2, 1.0)],
        columns=["mission", "algorithm", "area_mean", "area_share"],
    ),
    pd.DataFrame({"mission": ["mine", "other", "site"], "bound_area": [np.nan, 0.9, 0.505]}),
)
MEDIANS = pd.DataFrame(
    [[0.1, 0.25], [0.5, np.nan]],
    index=pd.Index([50, 100], name="n_ants"),
    columns=pd.Index([0.04, 0.1], name="evaporation"),
)
