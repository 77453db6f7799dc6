"""What a simulated annealing holds: its rule, its state, and the plans it has recorded."""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.graph.graph import Graph
from botohe_moo.kernels.plans.change import MoveRule
from botohe_moo.kernels.plans.marks import MoveScratch, new_move_scratch


class AnnealRule(NamedTuple):
    """How to anneal.

    Attributes
    ----------
    moves
        How trails are changed. Every robot of every plan keeps its floor, that of the first plan
        included.
    record
        Whether to record the plans that are evaluated.
    total_reward
        Sum of all rewards, or 1 where there is none.
    weight
        The weight on reward, in [0, 1].
    cooling
        The factor by which the temperature falls after each step.
    return_probability
        With what probability a rejected step ends at the best plan.
    """

    moves: MoveRule
    record: bool
    total_reward: float
    weight: float
    cooling: float
    return_probability: float


class Best(NamedTuple):
    """The best plan that has been evaluated.

    Attributes
    ----------
    nodes, lengths
        One trail a row (n_robots, n_arcs + 1), and the trails' lengths (n_robots).
    objectives, score
        E[R] and E[S] (2), and the weighted sum of their shares (1). The score may be −inf at
        first, whatever the plan is: then the best plan is among those evaluated from now on.
    """

    nodes: OffsetArray
    lengths: OffsetArray
    objectives: FloatArray
    score: FloatArray


class Walked(NamedTuple):
    """Trails in slots, two for each robot: 2k and 2k + 1 are those of robot k.

    One of them is the robot's trail in the plan the search is at; a step writes the other one. To
    accept it is to change slots. What is known of trails is kept, so that those that have not
    changed are not walked again.

    Attributes
    ----------
    nodes
        The trails, n_arcs + 1 nodes apart.
    lengths
        Of the trails (n_slots).
    met, n_met
        The nodes of each trail by first visit (n_slots, n_nodes), and how many (n_slots).
    reach
        The chance to reach each of these (n_slots, n_nodes).
    alive
        The chance to survive each trail (n_slots).
    """

    nodes: OffsetArray
    lengths: OffsetArray
    met: OffsetArray
    n_met: OffsetArray
    reach: FloatArray
    alive: FloatArray


class TeamScratch(NamedTuple):
    """Scratch of evaluations.

    Attributes
    ----------
    n_walks, n_plans
        How many trails have been walked, and how many plans evaluated (1 each).
    visited, touched_by
        The last walk, and the last plan, that came to each node (n_nodes).
    touched, reached
        The plan's nodes by first visit, and the chance that its robots reach each node (n_nodes).
    order
        The plan's slots in the order of their trails (n_robots).
    """

    n_walks: OffsetArray
    n_plans: OffsetArray
    visited: OffsetArray
    touched_by: OffsetArray
    touched: OffsetArray
    reached: FloatArray
    order: OffsetArray


class AnnealState(NamedTuple):
    """Where a search is.

    Attributes
    ----------
    best
        The best plan so far.
    to_best
        Whether the search has to go to the best plan before its next step (1); so it begins.
    here, tried
        The slots of the plan the search is at, and of the one it tries (n_robots).
    objectives
        E[R] and E[S] of the plan the search is at (2).
    temperature
        Now (1).
    random
        State of the random numbers (1, 2).
    walked, team, moves
        The trails, and scratch.
    """

    best: Best
    to_best: OffsetArray
    here: OffsetArray
    tried: OffsetArray
    objectives: FloatArray
    temperature: FloatArray
    random: SeedArray
    walked: Walked
    team: TeamScratch
    moves: MoveScratch


class Records(NamedTuple):
    """Plans that a search has evaluated, but for those that the plans at hand dominated.

    Attributes
    ----------
    nodes, offsets
        Their trails; there may be room for more.
    objectives
        E[R] and E[S] of each (n_most, 2).
    n_plans
        How many there are (1).
    """

    nodes: IntArray
    offsets: OffsetArray
    objectives: FloatArray
    n_plans: OffsetArray


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
            n_plans=np.zeros(1, np.int64),
            visited=np.zeros(n_nodes, np.int64),
            touched_by=np.zeros(n_nodes, np.int64),
            touched=np.zeros(n_nodes, np.int64),
            reached=np.zeros(n_nodes),
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
