"""Towers, as missions."""

from typing import Annotated

import networkx as nx
import numpy as np
from pydantic import Field

from botohe_moo import Mission


def tower(
    *,
    floors: Annotated[int, Field(ge=1, le=100)] = 4,
    rooms: Annotated[int, Field(ge=1, le=100)] = 5,
    robots: Annotated[int, Field(ge=1, le=1_000)] = 3,
    seed: Annotated[int, Field(ge=0)] = 0,
) -> Mission:
    """A tower whose rooms pay the more, the higher they are.

    Parameters
    ----------
    floors
        Floors, joined by dangerous stairs.
    rooms
        Rooms of a floor, in a row from the stairs.
    robots
        Team size.
    seed
        Of the rewards.
    """
    rng = np.random.default_rng(seed)
    graph = nx.DiGraph(name="tower", title=f"A tower of {floors} floors")
    graph.add_node("entrance", reward=0.0, pos=[-1, 0])
    below = "entrance"
    for floor in range(floors):
        stairs = f"{floor}: stairs"
        graph.add_node(stairs, reward=0.0, pos=[0, floor])
        join(graph, below, stairs, 0.8 if floor else 1.0)
        last = stairs
        for number in range(1, rooms + 1):
            room = f"{floor}: room {number}"
            reward = float(rng.integers(1, 4)) * (floor + 1)
            graph.add_node(room, reward=reward, pos=[number, floor])
            join(graph, last, room, 0.95)
            last = room
        below = stairs
    return Mission(graph, base="entrance", robots=robots)


def join(graph: nx.DiGraph, here: str, there: str, survival: float) -> None:
    """Let robots go both ways."""
    graph.add_edge(here, there, survival=survival)
    graph.add_edge(there, here, survival=survival)
