"""What may happen to a trail plan: distributions of reward and survivors, risk, simulation."""

from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from typing import NamedTuple

import networkx as nx
import numpy as np
import pandas as pd

from botohe_moo._base.checks import check_integer
from botohe_moo._base.types import FloatArray, OffsetArray, SeedArray
from botohe_moo.kernels.plans import simulate as kernels
from botohe_moo.kernels.plans.ragged import Trails, read_trails
from botohe_moo.mission import Mission
from botohe_moo.outcomes.distribution import ROUNDING, Distribution
from botohe_moo.trails import TrailPlan

__all__ = [
    "Outcomes",
    "plan_outcomes",
    "reward_distribution",
    "simulate",
    "survivors_distribution",
]


@dataclass(frozen=True, eq=False)
class Outcomes:
    """Both outcomes of a plan: the team reward R and the number of surviving robots S.

    Attributes
    ----------
    reward, survivors
        Their distributions; what the two have in common is seen in ``simulate``.
    """

    reward: Distribution
    survivors: Distribution

    def summary(self, alpha: float = 0.05) -> pd.DataFrame:
        """Give a table with the rows ``reward`` and ``survivors``.

        Its columns are mean, std, q05, median, q95, cvar (mean of the worst share ``alpha``) and
        exact.

        Parameters
        ----------
        alpha
            Share in (0, 1].

        Raises
        ------
        ValueError
            If ``alpha`` is outside (0, 1].
        """
        rows = {}
        for name, found in (("reward", self.reward), ("survivors", self.survivors)):
            q05, median, q95 = found.quantile([0.05, 0.5, 0.95])
            rows[name] = (found.mean, found.std, q05, median, q95, found.cvar(alpha), found.exact)
        columns = ["mean", "std", "q05", "median", "q95", "cvar", "exact"]
        return pd.DataFrame(list(rows.values()), index=pd.Index(rows), columns=columns)


def plan_outcomes(
    mission: Mission,
    plan: TrailPlan,
    *,
    max_outcomes: int = 1_000_000,
    n_samples: int = 100_000,
    random_state: int | np.random.Generator | None = None,
) -> Outcomes:
    """Give the distributions of the team reward and of the number of survivors.

    Parameters
    ----------
    mission, plan
        A mission and one of its plans.
    max_outcomes, n_samples, random_state
        As for ``reward_distribution``.

    Raises
    ------
    PlanError
        If the mission does not allow the plan.
    TypeError
        If ``plan`` is no TrailPlan.
    ValueError
        If ``max_outcomes`` or ``n_samples`` is no integer of at least 1.
    """
    reward = reward_distribution(
        mission, plan, max_outcomes=max_outcomes, n_samples=n_samples, random_state=random_state
    )
    return Outcomes(reward, survivors_distribution(mission, plan))


def survivors_distribution(mission: Mission, plan: TrailPlan) -> Distribution:
    """Compute the distribution of the number of surviving robots, always exactly.

    Robots survive independently, so it is Poisson-binomial; the robots' own distributions are
    convolved one after another: Barlow and Heidmann, "Computing k-out-of-n system reliability",
    IEEE Transactions on Reliability R-33, 1984.

    Parameters
    ----------
    mission, plan
        A mission and one of its plans.

    Raises
    ------
    PlanError
        If the mission does not allow the plan.
    TypeError
        If ``plan`` is no TrailPlan.
    """
    mission.evaluate([plan])
    returns = np.sort(_follow(mission, plan).alive[plan.offsets[1:] - 1])
    shares = reduce(np.convolve, [np.array([1 - p, p]) for p in returns])
    values = np.arange(len(shares), dtype=float)
    return Distribution(values[shares > 0], shares[shares > 0])


def reward_distribution(
    mission: Mission,
    plan: TrailPlan,
    *,
    max_outcomes: int = 1_000_000,
    n_samples: int = 100_000,
    random_state: int | np.random.Generator | None = None,
) -> Distribution:
    """Compute the distribution of the team reward, or simulate it where that is too much work.

    Parameters
    ----------
    mission, plan
        A mission and one of its plans.
    max_outcomes
        Joint outcomes that the exact computation may look at in all its steps together, at least
        1; a plan that needs more is simulated, and the distribution's ``exact`` is then False.
    n_samples
        Missions to simulate in that case, at least 1.
    random_state
        Seed or generator of the simulation; None takes fresh entropy, as in numpy.

    Raises
    ------
    PlanError
        If the mission does not allow the plan.
    TypeError
        If ``plan`` is no TrailPlan.
    ValueError
        If ``max_outcomes`` or ``n_samples`` is no integer of at least 1.

    Notes
    -----
    A robot's fate is how many of its rewarding nodes it reaches, in the order of its trail. Robots
    join one after another; the outcomes so far that have the same reward (up to rounding) and
    agree on the nodes that robots still to come may reach are one outcome. Robots that share no
    node, also not through others, are joined apart, and their rewards convolved.

    Examples
    --------
    >>> graph = nx.DiGraph(base="dock", robots=2)
    >>> graph.add_nodes_from([("dock", {"reward": 1}), ("reef", {"reward": 5})])
    >>> graph.add_edge("dock", "reef", survival=0.5)
    >>> graph.add_edge("reef", "dock", survival=0.8)
    >>> mission = Mission(graph)
    >>> plan = mission.plan([["dock", "reef", "dock"], ["dock", "reef", "dock"]])
    >>> reward_distribution(mission, plan).to_frame()
       value  probability
    0    1.0         0.25
    1    6.0         0.75
    """
    max_outcomes = check_integer("max_outcomes", max_outcomes, at_least=1)
    n_samples = check_integer("n_samples", n_samples, at_least=1)
    mission.evaluate([plan])
    # Robots are identical, so the order of their trails must not show in the result.
    ordered = TrailPlan(sorted(plan.trails))
    try:
        found = _join_robots(mission.arrays.reward, _follow(mission, ordered), max_outcomes)
    except _TooManyOutcomesError:
        rewards, _ = _play(mission, ordered, n_samples, random_state)
        found = _merged(rewards, np.full(n_samples, 1 / n_samples))
        return Distribution(found.values, found.probabilities, n_samples)
    return Distribution(found.values, found.probabilities)


def simulate(
    mission: Mission,
    plan: TrailPlan,
    n_missions: int,
    *,
    random_state: int | np.random.Generator | None = None,
) -> pd.DataFrame:
    """Play the mission many times.

    Parameters
    ----------
    mission, plan
        A mission and one of its plans.
    n_missions
        How many times, at least 1.
    random_state
        Seed or generator: the same seed gives the same table, and more missions only add rows;
        None takes fresh entropy, as in numpy.

    Returns
    -------
    pandas.DataFrame
        One row per mission: ``reward`` (team reward), ``survivors`` (number of robots), and for
        robot k, from 0 in the order of the plan, ``hops_k``: the arcs it survived, all those of
        its trail where it returned for good.

    Raises
    ------
    PlanError
        If the mission does not allow the plan.
    TypeError
        If ``plan`` is no TrailPlan.
    ValueError
        If ``n_missions`` is no integer of at least 1.

    Examples
    --------
    >>> graph = nx.DiGraph([("dock", "reef"), ("reef", "dock")], base="dock", robots=2)
    >>> nx.set_node_attributes(graph, {"dock": 0, "reef": 5}, "reward")
    >>> nx.set_edge_attributes(graph, 0.5, "survival")
    >>> mission = Mission(graph)
    >>> simulate(mission, mission.plan([["dock", "reef", "dock"], ["dock"]]), 3, random_state=1)
       reward  survivors  hops_0  hops_1
    0     0.0          1       0       0
    1     5.0          2       2       0
    2     5.0          1       1       0
    """
    n_missions = check_integer("n_missions", n_missions, at_least=1)
    mission.evaluate([plan])
    rewards, hops = _play(mission, plan, n_missions, random_state)
    frame = pd.DataFrame(hops, columns=[f"hops_{k}" for k in range(plan.n_robots)])
    frame.insert(0, "reward", rewards)
    frame.insert(1, "survivors", (hops == np.diff(plan.offsets) - 1).sum(axis=1))
    return frame


class _Followed(NamedTuple):
    """A valid plan's trails, ragged, with what ``kernels.follow`` says of each position."""

    trails: Trails
    alive: FloatArray
    pays: FloatArray


def _follow(mission: Mission, plan: TrailPlan) -> _Followed:
    alive, pays = np.empty((2, len(plan.nodes)))
    followed = _Followed(read_trails(plan.nodes, plan.offsets), alive, pays)
    kernels.follow(mission.arrays, *followed)
    return followed


def _play(
    mission: Mission,
    plan: TrailPlan,
    n_missions: int,
    random_state: int | np.random.Generator | None,
) -> tuple[FloatArray, OffsetArray]:
    """Give the reward (n_missions) and the hops of each robot (n_missions, n_robots)."""
    trails, alive, _ = _follow(mission, plan)
    draws = np.random.default_rng(random_state).random((n_missions, plan.n_robots))
    hops, rewards = np.empty(draws.shape, np.int64), np.empty(n_missions)
    kernels.play(mission.arrays.reward, trails, alive, draws, hops, rewards)
    return rewards, hops


class _TooManyOutcomesError(Exception):
    """The exact computation would look at more outcomes than it may."""


class _States(NamedTuple):
    """Outcomes of some robots: reward, probability, and the nodes reached, as bits (n, n_words)."""

    values: FloatArray
    probabilities: FloatArray
    reached: SeedArray


def _merged(
    values: FloatArray, probabilities: FloatArray, reached: SeedArray | None = None
) -> _States:
    """Make outcomes one that agree in reward, up to rounding, and in the nodes reached."""
    if reached is None:
        reached = np.empty((len(values), 0), np.uint64)
    order = np.lexsort((values, *reached.T))
    values, reached = values[order], reached[order]
    differs = np.diff(values) > ROUNDING * values[1:]
    differs |= (reached[1:] != reached[:-1]).any(axis=1)
    starts = np.append(0, 1 + np.flatnonzero(differs))
    probabilities = np.add.reduceat(probabilities[order], starts)
    kept = probabilities > 0  # a product of many small ones may underflow
    starts = starts[kept]
    return _States(values[starts], probabilities[kept], reached[starts])


def _join_robots(reward: FloatArray, followed: _Followed, max_outcomes: int) -> _States:
    """Give the exact outcomes of all robots together."""
    (nodes, offsets), alive, pays = followed
    certain = np.unique(nodes[(alive == 1) & (pays > 0)])
    uncertain = (pays > 0) & (alive > 0) & ~np.isin(nodes, certain)
    sharing: nx.Graph[int] = nx.Graph()
    chains = []
    for robot, (start, stop) in enumerate(pairwise(offsets.tolist())):
        chains.append(start + np.flatnonzero(uncertain[start:stop]))
        # Robots are the vertices from 0, nodes those below 0.
        sharing.add_edges_from((robot, ~node) for node in nodes[chains[robot]].tolist())

    parts = []
    for component in nx.connected_components(sharing):
        group = [chains[robot] for robot in sorted(component) if robot >= 0]
        part, max_outcomes = _join_group(reward, followed, group, max_outcomes)
        parts.append(part)
    total = parts[0] if parts else _merged(np.zeros(1), np.ones(1))
    for part in parts[1:]:
        max_outcomes = _spend(max_outcomes, len(total.values) * len(part.values))
        values = np.add.outer(total.values, part.values).ravel()
        total = _merged(values, np.outer(total.probabilities, part.probabilities).ravel())
    values, probabilities, _ = total
    return _merged(values + reward[certain].sum(), probabilities)


def _join_group(
    reward: FloatArray, followed: _Followed, chains: list[OffsetArray], max_outcomes: int
) -> tuple[_States, int]:
    """Join robots that share nodes, given the positions on their trails that count for each.

    The second result is what is left of ``max_outcomes``.
    """
    table = np.unique(followed.trails.nodes[np.concatenate(chains)])
    masks = np.zeros((len(chains) + 1, (len(table) + 63) // 64), np.uint64)
    bits = [np.searchsorted(table, followed.trails.nodes[chain]) for chain in chains]
    for mask, bit in zip(masks, bits, strict=False):
        np.bitwise_or.at(mask, bit // 64, np.uint64(1) << (bit % 64).astype(np.uint64))
    later = np.bitwise_or.accumulate(masks[::-1])[::-1]

    states = _States(np.zeros(1), np.ones(1), np.zeros((1, masks.shape[1]), np.uint64))
    for robot, chain in enumerate(chains):
        chances = -np.diff(np.concatenate([[1.0], followed.alive[chain], [0.0]]))
        max_outcomes = _spend(max_outcomes, len(states.values) * int((chances > 0).sum()))
        gains = reward[followed.trails.nodes[chain]]
        values, probabilities, reached = kernels.join(*states, bits[robot], gains, chances)
        states = _merged(values, probabilities, reached & later[robot + 1])
    return states, max_outcomes


def _spend(max_outcomes: int, n_joint: int) -> int:
    if n_joint > max_outcomes:
        raise _TooManyOutcomesError
    return max_outcomes - n_joint
