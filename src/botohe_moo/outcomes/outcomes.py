"""Outcomes of a trail plan: distributions of reward and survivors, and simulation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from botohe_moo.base.messages import ParameterError, check_choice, check_integer, quoted
from botohe_moo.base.types import FloatArray, OffsetArray, Rng
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.outcomes.distribution import Distribution
from botohe_moo.outcomes.joining import (
    Followed,
    TooManyOutcomesError,
    follow,
    join_robots,
    merged,
)
from botohe_moo.trails import TrailPlan

if TYPE_CHECKING:
    import pandas as pd


Seed: TypeAlias = int | Rng | None


@dataclass(frozen=True, eq=False)
class Outcomes:
    """Both outcomes of a plan: the team reward R and the number of surviving robots S.

    Attributes
    ----------
    reward, survivors
        Their distributions; ``simulate`` shows how the two depend on each other.

    Examples
    --------
    >>> from botohe_moo import load_mission, plan_outcomes
    >>> from botohe_moo.outcomes import Outcomes
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1]])
    >>> outcomes = plan_outcomes(toy, plan)
    >>> outcomes.survivors.to_frame()
       value  probability
    0    1.0       0.3439
    1    2.0       0.6561
    """

    reward: Distribution
    survivors: Distribution

    def summary(self, alpha: float = 0.05) -> pd.DataFrame:
        """Return a table with the rows ``reward`` and ``survivors``.

        Its columns are mean, std, q05, median, q95, cvar (mean of the worst share ``alpha``) and
        exact.

        Parameters
        ----------
        alpha
            As for :meth:`Distribution.cvar`.
        """
        import pandas as pd

        rows = [
            (found.mean, found.std, *found.quantile([0.05, 0.5, 0.95]), found.cvar(alpha))
            for found in (self.reward, self.survivors)
        ]
        columns = ["mean", "std", "q05", "median", "q95", "cvar"]
        table = pd.DataFrame(rows, index=["reward", "survivors"], columns=columns)
        return table.assign(exact=[self.reward.exact, self.survivors.exact])


def plan_outcomes(
    mission: Mission,
    plan: TrailPlan,
    *,
    max_outcomes: int = 1_000_000,
    n_samples: int = 100_000,
    random_state: Seed = None,
) -> Outcomes:
    """Compute the distributions of the team reward and of the number of survivors.

    Parameters
    ----------
    mission, plan, max_outcomes, n_samples, random_state
        As for :func:`reward_distribution`, which also says what is raised.

    Examples
    --------
    >>> from botohe_moo import load_mission, plan_outcomes
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1]])
    >>> plan_outcomes(toy, plan).summary().round(2)
               mean   std  q05  median  q95  cvar  exact
    reward     3.24  1.57  0.0     4.0  4.0   0.0   True
    survivors  1.66  0.48  1.0     2.0  2.0   1.0   True
    """
    reward = reward_distribution(
        mission, plan, max_outcomes=max_outcomes, n_samples=n_samples, random_state=random_state
    )
    return Outcomes(reward, survivors_distribution(mission, plan))


def survivors_distribution(
    mission: Mission, plan: TrailPlan, *, kind: str | None = None
) -> Distribution:
    """Compute the distribution of the number of surviving robots, always exactly.

    Robots survive independently, so it is Poisson-binomial; the robots' own distributions are
    convolved one after another: Barlow and Heidmann, "Computing k-out-of-n system reliability",
    IEEE Transactions on Reliability R-33, 1984.

    Parameters
    ----------
    mission, plan
        As for :func:`reward_distribution`.
    kind
        The kind of robots that count, by its name; default: all. A ValueError is raised if there is
        no such kind.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.outcomes import survivors_distribution
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1]])
    >>> round(survivors_distribution(toy, plan).mean, 4)
    1.6561
    """
    check_mission(mission).evaluate([plan])
    if kind is not None:
        check_choice("kind", kind, [known.name for known in mission.kinds])
    counts = [kind in (None, of.name) for of in mission.kind_of]
    followed = follow(mission, plan)
    returns = np.sort(followed.alive[followed.offsets[1:][counts] - 1])
    shares = reduce(np.convolve, [np.array([1 - p, p]) for p in returns])
    values = np.arange(len(shares), dtype=float)
    return Distribution(values[shares > 0], shares[shares > 0])


def reward_distribution(
    mission: Mission,
    plan: TrailPlan,
    *,
    max_outcomes: int = 1_000_000,
    n_samples: int = 100_000,
    random_state: Seed = None,
) -> Distribution:
    """Compute the distribution of the team reward, or simulate it if that takes too long.

    Parameters
    ----------
    mission, plan
        A mission, and a plan that is valid for it.
    max_outcomes
        Joint outcomes that the exact computation may take in all its steps together, at least 1;
        a plan that needs more is simulated, and the distribution's ``exact`` is then False.
    n_samples
        Number of missions to simulate then, at least 1.
    random_state
        Seed or generator of the simulation; None takes fresh entropy, as in numpy.

    Raises
    ------
    PlanError
        If the plan is not valid.
    TypeError
        If ``plan`` is not a TrailPlan.
    ValueError
        If ``max_outcomes`` or ``n_samples`` is not an integer of at least 1.

    Notes
    -----
    A robot's outcome is how many of its rewarding nodes it reaches, or, if they pay on return,
    brings to a depot, where all that it carries is paid together. Whether it collects a reward of
    which it has a share is an independent draw for each robot and node. The robots are joined one
    after another; outcomes of the same reward (up to rounding) that agree on the nodes that later
    robots may reach are merged. Groups of robots without a common node are convolved.

    Examples
    --------
    >>> import networkx as nx
    >>> from botohe_moo import Mission
    >>> from botohe_moo.outcomes import reward_distribution
    >>> graph = nx.DiGraph([("dock", "reef"), ("reef", "dock")], base="dock", robots=2)
    >>> nx.set_node_attributes(graph, {"dock": 1, "reef": 5}, "reward")
    >>> nx.set_edge_attributes(graph, 0.5, "survival")
    >>> mission = Mission(graph)
    >>> plan = mission.plan([["dock", "reef", "dock"], ["dock", "reef", "dock"]])
    >>> reward_distribution(mission, plan).to_frame()
       value  probability
    0    1.0         0.25
    1    6.0         0.75
    """
    max_outcomes = check_integer("max_outcomes", max_outcomes, at_least=1)
    n_samples = check_integer("n_samples", n_samples, at_least=1)
    check_mission(mission).evaluate([plan])
    generator = _generator(random_state)
    # Robots of a kind are identical, so the result must not depend on the order of their trails.
    followed = follow(mission, TrailPlan(sorted(plan.trails)))
    try:
        found = join_robots(mission.rewards, followed, max_outcomes)
    except TooManyOutcomesError:
        rewards = _rewards(mission, followed, _draws(followed, n_samples, generator))
        found = merged(rewards, np.full(n_samples, 1 / n_samples))
        return Distribution(found.values, found.probabilities, n_samples)
    return Distribution(found.values, found.probabilities)


def simulate(
    mission: Mission, plan: TrailPlan, n_missions: int, *, random_state: Seed = None
) -> pd.DataFrame:
    """Simulate the mission many times.

    Parameters
    ----------
    mission, plan
        As for :func:`reward_distribution`.
    n_missions
        How many times, at least 1.
    random_state
        Seed or generator: the same seed gives the same table, and more missions only add rows;
        None takes fresh entropy, as in numpy.

    Returns
    -------
    pandas.DataFrame
        One row per mission: ``reward`` (team reward), ``survivors`` (number of robots), and for
        robot k, from 0 in the order of the plan, ``hops_k``: the number of arcs it survived.

    Examples
    --------
    >>> import networkx as nx
    >>> from botohe_moo.outcomes import simulate
    >>> from botohe_moo import Mission
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
    import pandas as pd

    n_missions = check_integer("n_missions", n_missions, at_least=1)
    check_mission(mission).evaluate([plan])
    followed = follow(mission, plan)
    draws = _draws(followed, n_missions, _generator(random_state))
    alive, hops = followed.alive, np.empty((n_missions, plan.n_robots), np.int64)
    lengths = np.diff(plan.offsets)
    for robot, stop in enumerate(followed.offsets[1:].tolist()):
        start = stop - lengths[robot]
        hops[:, robot] = np.searchsorted(-alive[start:stop], -draws[:, robot]) - 1
    frame = pd.DataFrame(hops, columns=[f"hops_{k}" for k in range(plan.n_robots)])
    frame.insert(0, "reward", _rewards(mission, followed, draws))
    frame.insert(1, "survivors", (hops == lengths - 1).sum(axis=1))
    return frame


def _generator(random_state: Seed) -> Rng:
    try:
        return np.random.default_rng(random_state)
    except (TypeError, ValueError):
        expected = "random_state to be None, an integer >= 0 or a numpy Generator"
        found = quoted(random_state)
        raise ParameterError(f"Expected {expected}, got {found}.", "random_state") from None


def _draws(followed: Followed, n_missions: int, generator: Rng) -> FloatArray:
    """Draw how far each robot gets in each mission, and whether it collects what it may fail to."""
    n_robots = len(followed.offsets) - 1
    return generator.random((n_missions, n_robots + len(_unsure(followed))))


def _unsure(followed: Followed) -> OffsetArray:
    """Return the first visits where a robot may fail to collect the reward."""
    return np.flatnonzero((followed.pays > 0) & (followed.share < 1))


def _rewards(mission: Mission, followed: Followed, draws: FloatArray) -> FloatArray:
    """Compute the team reward of each mission."""
    nodes, offsets, _, pays, credited, share = followed
    drawn, rewards = np.ascontiguousarray(draws.T), np.zeros(len(draws))
    robots = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    unsure = _unsure(followed)
    # In the order of the nodes, so that the same nodes always bring the same floating-point number.
    for node in np.unique(nodes[pays > 0]):
        visits = np.flatnonzero((nodes == node) & (pays > 0))
        collected = drawn[robots[visits]] < credited[visits, np.newaxis]
        may_fail = share[visits] < 1
        draw = len(offsets) - 1 + np.searchsorted(unsure, visits[may_fail])
        collected[may_fail] &= drawn[draw] < share[visits[may_fail], np.newaxis]
        rewards += collected.any(axis=0) * mission.rewards[node]
    return rewards
