"""A mission that is played by hand: two robots, a lab that pays much, and a hall that is safe.

Robot 0 is lost on its way to the lab, robot 1 is sent on there from the hall, and lost on its way
back: the survivals of the lab's arcs are 0.5, those of the hall's are 1.
"""

import networkx as nx
import numpy as np

from botohe_moo import Mission
from botohe_moo.underway import play_mission


def corner():
    graph = nx.DiGraph()
    for node, reward, place in (("base", 0, (0, 0)), ("lab", 10, (3, 2)), ("hall", 1, (3, 0))):
        graph.add_node(node, reward=reward, pos=place)
    for node, survival in (("lab", 0.5), ("hall", 1)):
        graph.add_edge("base", node, survival=survival)
        graph.add_edge(node, "base", survival=survival)
    return Mission(graph, base="base", robots=2)


def dangers(number):
    """The random numbers of each robot's hops in a mission of seed 1."""
    return np.random.default_rng([1, number]).random((2, 4))


MISSION = corner()
PLAN = MISSION.plan([["base", "lab", "base"], ["base", "hall", "base"]])
NUMBER = next(
    number
    for number in range(100)
    if (dangers(number)[[0, 1, 1], [0, 2, 3]] < 0.5).tolist() == [False, True, False]
)
PLAYED = play_mission(MISSION, PLAN, price=2, number=NUMBER)
