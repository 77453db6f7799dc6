"""A mission whose plans are judged in one's head.

Two robots leave the dock. Three dead-end nodes, the ways back are safe:

    node    reward   survival out
    a       4        0.5
    b       2        0.9
    c       1        1

    plan    trips    E[R]                   E[S]   robots     reward: probability
    AB      a, b     2 + 1.8      = 3.8     1.4    0.5 0.9    6: .45  4: .05  2: .45  0: .05
    AC      a, c     2 + 1        = 3.0     1.5    0.5 1      5: .5   1: .5
    AA      a, a     4 (1 - 0.25) = 3.0     1.0    0.5 0.5    4: .75  0: .25
    BC      b, c     1.8 + 1      = 2.8     1.9    0.9 1      3: .9   1: .1
    BB      b, b     2 (1 - 0.01) = 1.98    1.8    0.9 0.9    2: .99  0: .01
    C       c        1                      2.0    1   1      1: 1

AB, AC, BC and C are not dominated; the total reward is 7.
"""

from functools import partial

import networkx as nx
import numpy as np

from botohe_moo import Kind, Mission, Solution
from botohe_moo.decide import Wish

Expected, Chance, TailMean = (partial(Wish, form) for form in ("expected", "chance", "tail mean"))
WorstCase, EveryRobot, Reach = (partial(Wish, f) for f in ("worst case", "every robot", "reach"))

LEAVES = {"a": (4, 0.5), "b": (2, 0.9), "c": (1, 1.0)}
NAMES = ["AB", "AC", "AA", "BC", "BB", "C"]


def star(leaves=None, robots=2):
    graph = nx.DiGraph()
    graph.add_node("dock", reward=0)
    for leaf, (reward, survival) in (leaves or LEAVES).items():
        graph.add_node(leaf, reward=reward)
        graph.add_edge("dock", leaf, survival=survival)
        graph.add_edge(leaf, "dock", survival=1.0)
    return Mission(graph, base="dock", robots=robots, name="star")


MISSION = star()


def trips(mission, *leaves):
    """Each robot goes to one leaf and back; the others stay."""
    trails = [["dock", leaf, "dock"] for leaf in leaves]
    return mission.plan(trails + [["dock"]] * (mission.robots - len(trails)))


PLANS = [trips(MISSION, *name.lower()) for name in NAMES]


def solution_of(mission, plans):
    """A solution that has these plans."""
    objectives = mission.evaluate(plans)
    order = np.lexsort((-objectives[:, 1], -objectives[:, 0]))
    return Solution(
        mission=mission,
        plans=tuple(plans[i] for i in order),
        objectives=objectives[order],
        algorithm="by hand",
        parameters={},
        seed=0,
        evaluations=len(plans),
        seconds=None,
        interrupted=False,
    )


def house(rover="rover"):
    """Two drones start and end on the roof, where they deposit, too; a rover leaves the dock.

    The drones collect what is in the cellar with a share of 1/2. All ways back are safe:

        node     reward   survival out: drone   rover
        attic    4        0.5                   -
        cellar   6        0.25, by the dock     0.75
    """
    graph = nx.DiGraph(pays="return", base="dock")
    for i, (node, reward) in enumerate({"dock": 0, "roof": 0, "attic": 4, "cellar": 6}.items()):
        graph.add_node(node, reward=reward, depot=node == "roof", pos=[i, 0])
    graph.nodes["cellar"]["share"] = {"drone": 0.5}
    for tail, head, drone, by_rover in (
        ("roof", "attic", 0.5, 0),
        ("roof", "dock", 1, 0),
        ("dock", "cellar", 0.25, 0.75),
    ):
        graph.add_edge(tail, head, survival={"drone": drone, rover: by_rover})
        graph.add_edge(head, tail, survival={"drone": 1, rover: float(by_rover > 0)})
    kinds = [Kind("drone", 2, start="roof", end="roof"), Kind(rover, 1)]
    return Mission(graph, kinds=kinds, name="house")


HOUSE = house()
ROVER = ["dock", "cellar", "dock"]
DEEP = ["roof", "dock", "cellar", "dock", "roof"]
# E[R] and E[S]: 4 x 0.5 + 6 x 0.75 = 6.5 and 2.25; 4.5 and 2.75; 2 + 6 (1 - 0.25 x 0.875) and 1.5.
ATTIC = HOUSE.plan([["roof", "attic", "roof"], ["roof"], ROVER])
GROUND = HOUSE.plan([["roof"], ["roof"], ROVER])
BOTH = HOUSE.plan([DEEP, ["roof", "attic", "roof"], ROVER])
IN_HOUSE = [ATTIC, GROUND, BOTH]
