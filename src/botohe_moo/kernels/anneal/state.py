"""What a simulated annealing holds: its rule, its state, and the plans it has recorded."""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.graph.graph import Graph
from botohe_moo.kernels.plans.change import MoveRule
from botohe_moo.kernels.plans.evaluate import Team, new_team
from botohe_moo.kernels.plans.marks import MoveScratch, new_move_scratch


class AnnealRule(NamedTuple):
    """How to anneal."""

    # How trails are changed. Every robot of every plan keeps its limits, that of the first plan
    # included.
    moves: MoveRule
    record: bool  # whether to record the plans that are evaluated
    total_reward: float  # sum of all rewards, or 1 where there is none
    weight: float  # on reward, in [0, 1]
    cooling: float  # the factor by which the temperature falls after each step
    return_probability: float  # with what probability a rejected step ends at the best plan


class Best(NamedTuple):
    """The best plan that has been evaluated."""

    # One trail a row (n_robots, n_arcs + 1), and the trails' lengths (n_robots).
    nodes: OffsetArray
    lengths: OffsetArray
    # E[R] and E[S] (2), and the weighted sum of their shares (1). The score may be −inf at first,
    # whatever the plan is: then the best plan is among those evaluated from now on.
    objectives: FloatArray
    score: FloatArray


class Walked(NamedTuple):
    """Trails in slots, two for each robot: 2k and 2k + 1 are those of robot k.

    One of them is the robot's trail in the plan the search is at; a step writes the other one, and
    where it is accepted the two change roles. What is known of trails is kept, so that those that
    have not changed are not walked again.
    """

    nodes: OffsetArray  # the trails, n_arcs + 1 nodes apart
    lengths: OffsetArray  # of the trails (n_slots)
    # The nodes of each trail by first visit (n_slots, n_nodes), and how many (n_slots).
    met: OffsetArray
    n_met: OffsetArray
    reach: FloatArray  # the chance to reach each of these (n_slots, n_nodes)
    alive: FloatArray  # the chance to survive each trail (n_slots)


class TeamScratch(NamedTuple):
    """Scratch of evaluations."""

    n_walks: OffsetArray  # how many trails have been walked (1)
    visited: OffsetArray  # the last walk that came to each node (n_nodes)
    team: Team  # what the plan reaches
    order: OffsetArray  # the plan's slots in the order of their trails (n_robots)


class AnnealState(NamedTuple):
    """Where a search is."""

    best: Best  # the best plan so far
    # Whether the search has to go to the best plan before its next step (1); so it begins.
    to_best: OffsetArray
    # The slots of the plan the search is at, and of the one it tries (n_robots).
    here: OffsetArray
    tried: OffsetArray
    objectives: FloatArray  # E[R] and E[S] of the plan the search is at (2)
    temperature: FloatArray  # (1)
    random: SeedArray  # state of the random numbers (1, 2)
    walked: Walked
    team: TeamScratch
    moves: MoveScratch


class Records(NamedTuple):
    """Plans that a search has evaluated, but for those that the plans at hand dominated."""

    # Their trails; there may be room for more.
    nodes: IntArray
    offsets: OffsetArray
    objectives: FloatArray  # E[R] and E[S] of each (n_most, 2)
    n_plans: OffsetArray  # how many there are (1)


def new_state(graph: Graph, n_robots: int, random: SeedArray, *, detours: bool) -> AnnealState:
    """Begin a search with all robots at base."""
    n_nodes, width, n_slots = graph.n_nodes, graph.n_arcs + 1, 2 * n_robots
    return AnnealState(
        best=Best(
            np.full((n_robots, width), graph.base),
            np.ones(n_robots, np.int64),
            np.array([graph.reward[graph.base], n_robots]),
            np.full(1, -np.inf),
        ),
        to_best=np.ones(1, np.int64),
        here=2 * np.arange(n_robots),
        tried=2 * np.arange(n_robots),
        objectives=np.zeros(2),
        temperature=np.ones(1),
        random=random,
        walked=Walked(
            nodes=np.zeros(n_slots * width, np.int64),
            lengths=np.zeros(n_slots, np.int64),
            met=np.zeros((n_slots, n_nodes), np.int64),
            n_met=np.zeros(n_slots, np.int64),
            reach=np.zeros((n_slots, n_nodes)),
            alive=np.zeros(n_slots),
        ),
        team=TeamScratch(
            n_walks=np.zeros(1, np.int64),
            visited=np.zeros(n_nodes, np.int64),
            team=new_team(n_nodes),
            order=np.zeros(n_robots, np.int64),
        ),
        moves=new_move_scratch(graph, detours=detours),
    )


def new_records(n_robots: int, n_plans: int, n_nodes: int) -> Records:
    """Make room for so many plans, of so many nodes."""
    return Records(
        np.empty(n_nodes, np.int32),
        np.zeros(n_plans * n_robots + 1, np.int64),
        np.empty((n_plans, 2)),
        np.zeros(1, np.int64),
    )
