"""Outcomes of a plan: distributions of reward and survivors, and simulation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple, TypeAlias, overload

import networkx as nx
import numpy as np

from botohe_moo.base.messages import ParameterError, check_choice, quoted
from botohe_moo.base.parameters import check
from botohe_moo.base.types import FloatArray, OffsetArray, Rng, SeedArray
from botohe_moo.core.world import AT_NEXT_DEPOT, AT_THIS_DEPOT, Returns, Team
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.trails import TrailPlan

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "Distribution",
    "Outcomes",
    "collect_probabilities",
    "plan_outcomes",
    "reach_probabilities",
    "reward_distribution",
    "simulate",
    "survivors_distribution",
    "team_reach",
]

ROUNDING = 1e-12  # relative; values and probabilities that differ by less are equal


@dataclass(frozen=True, eq=False, repr=False)
class Distribution:
    """A discrete distribution of the team reward or of the number of survivors.

    Attributes
    ----------
    values
        Possible outcomes (n_values, read-only): rewards or numbers of robots, which ascend.
    probabilities
        Probability of each value (n_values, read-only), above 0; they sum to 1.
    n_samples
        Number of simulated missions whose shares the probabilities are; None if they are exact.

    Examples
    --------
    >>> import numpy as np
    >>> from botohe_moo.outcomes import Distribution
    >>> reward = Distribution(np.array([0.0, 4.0, 9.0]), np.array([0.125, 0.375, 0.5]))
    >>> reward
    <Distribution: 3 values from 0 to 9, mean 6, exact>
    >>> reward.at_least(4), reward.quantile(0.5), reward.cvar(0.25)
    (0.875, 4.0, 2.0)
    """

    values: FloatArray
    probabilities: FloatArray
    n_samples: int | None = None

    def __post_init__(self) -> None:
        values, probabilities = np.array(self.values, float), np.array(self.probabilities, float)
        if values.ndim != 1 or values.size == 0 or values.shape != probabilities.shape:
            expected = "as many probabilities as values, at least one"
            shapes = f"{probabilities.shape} and {values.shape}"
            raise ValueError(f"Expected {expected}, got the shapes {shapes}.")
        if not (np.isfinite(values).all() and (np.diff(values) > 0).all()):
            raise ValueError(f"Expected finite values that ascend, got {values}.")
        if not ((probabilities > 0).all() and abs(probabilities.sum() - 1) < 1e-9):
            raise ValueError(f"Expected probabilities above 0 that sum to 1, got {probabilities}.")
        for name, array in (("values", values), ("probabilities", probabilities)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @property
    def exact(self) -> bool:
        """Whether the probabilities are computed rather than simulated."""
        return self.n_samples is None

    @property
    def mean(self) -> float:
        """Expected value."""
        return float(self.probabilities @ self.values)

    @property
    def variance(self) -> float:
        """Variance of these values with these probabilities (simulated: the divisor is n)."""
        return float(self.probabilities @ (self.values - self.mean) ** 2)

    @property
    def std(self) -> float:
        """Standard deviation."""
        return float(np.sqrt(self.variance))

    @property
    def standard_error(self) -> float:
        """Standard error of the mean: 0 when exact, nan for a single simulated mission."""
        if self.n_samples is None:
            return 0.0
        return self.std / float(np.sqrt(self.n_samples - 1)) if self.n_samples > 1 else float("nan")

    @overload
    def quantile(self, q: float) -> float: ...
    @overload
    def quantile(self, q: Sequence[float] | FloatArray) -> FloatArray: ...
    def quantile(self, q: float | Sequence[float] | FloatArray) -> float | FloatArray:
        """Return the smallest value that is not exceeded with a probability of at least ``q``.

        Parameters
        ----------
        q
            Probability in [0, 1], or any number of them; 0 gives the smallest value. A ValueError
            is raised for others.
        """
        wanted = np.asarray(q, float)
        if not np.all((wanted >= 0) & (wanted <= 1)):
            raise ValueError(f"Expected q in [0, 1], got {q}.")
        cumulative = np.cumsum(self.probabilities)
        cumulative[-1] = 1.0
        # No slack at 1: the largest value is possible, however small its probability.
        slack = np.where(wanted < 1, 1 - ROUNDING, 1)
        found = self.values[np.searchsorted(cumulative, wanted * slack)]
        return float(found) if wanted.ndim == 0 else found

    @overload
    def at_least(self, x: float) -> float: ...
    @overload
    def at_least(self, x: Sequence[float] | FloatArray) -> FloatArray: ...
    def at_least(self, x: float | Sequence[float] | FloatArray) -> float | FloatArray:
        """Return the probability that the outcome is ``x`` or more.

        Parameters
        ----------
        x
            Reward or number of robots, or any number of them; a ValueError is raised for nan. A
            value reaches ``x`` if it falls short by less than 1e-12 of it, because sums of rewards
            are rounded.
        """
        wanted = np.asarray(x, float)
        if np.isnan(wanted).any():
            raise ValueError(f"Expected x to be a number, got {x}.")
        tail = np.append(np.cumsum(self.probabilities[::-1])[::-1], 0.0)
        tail[0] = 1.0
        lowered = np.minimum(wanted * (1 - ROUNDING), wanted * (1 + ROUNDING))
        found = np.minimum(tail[np.searchsorted(self.values, lowered)], 1.0)
        return float(found) if wanted.ndim == 0 else found

    def cvar(self, alpha: float) -> float:
        """Return the conditional value at risk: the mean of the lowest share ``alpha`` of outcomes.

        If the share ends within the probability of a value, only the part within counts:
        Rockafellar and Uryasev, "Conditional value-at-risk for general loss distributions",
        Journal of Banking & Finance 26, 2002; Acerbi and Tasche, "On the coherence of expected
        shortfall", same volume.

        Parameters
        ----------
        alpha
            Share in (0, 1]; 1 gives the mean. A ValueError is raised for others.
        """
        if not 0 < alpha <= 1:
            raise ValueError(f"Expected alpha in (0, 1], got {alpha}.")
        before = np.append(0.0, np.cumsum(self.probabilities)[:-1])
        inside = np.clip(alpha - before, 0.0, self.probabilities)
        return float(inside @ self.values / inside.sum())

    def to_frame(self) -> pd.DataFrame:
        """Return the distribution as a table with the columns ``value`` and ``probability``."""
        import pandas as pd

        return pd.DataFrame({"value": self.values, "probability": self.probabilities})

    def __repr__(self) -> str:
        source = "exact" if self.n_samples is None else f"from {self.n_samples} samples"
        low, high = self.values[0], self.values[-1]
        span = f"{len(self.values)} values from {low:g} to {high:g}"
        return f"<Distribution: {span}, mean {self.mean:g}, {source}>"


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

    def in_one(case: Mission) -> Distribution:
        followed = follow(case, plan)
        returns = np.sort(followed.alive[followed.offsets[1:][counts] - 1])
        shares = reduce(np.convolve, [np.array([1 - p, p]) for p in returns])
        values = np.arange(len(shares), dtype=float)
        return Distribution(values[shares > 0], shares[shares > 0])

    return _mixture(mission, in_one)


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
    A robot's outcome is the number of its rewarding nodes that it reaches. If they pay on return,
    it is the number that it brings to a depot, where all that it carries is paid together. Where a
    share is below 1, each robot collects the node's reward by an independent draw. Robots are
    joined one after another. Outcomes are merged if they have the same reward (up to rounding) and
    agree on the nodes that later robots may reach. Groups of robots that share no node are
    convolved.

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
    max_outcomes = check("max_outcomes", max_outcomes, int, ge=1)
    n_samples = check("n_samples", n_samples, int, ge=1)
    check_mission(mission).evaluate([plan])
    generator = _generator(random_state)
    # Robots of a kind are identical, so the result must not depend on the order of their trails.
    ordered = TrailPlan(sorted(plan.trails))

    def in_one(case: Mission) -> Distribution:
        followed = follow(case, ordered)
        try:
            return Distribution(*join_robots(case.rewards, followed, max_outcomes)[:2])
        except TooManyOutcomesError:
            rewards = _rewards(case, followed, _draws(followed, n_samples, generator))
            found = merged(rewards, np.full(n_samples, 1 / n_samples))
            return Distribution(found.values, found.probabilities, n_samples)

    return _mixture(mission, in_one)


def _mixture(mission: Mission, in_one: Callable[[Mission], Distribution]) -> Distribution:
    """Return the distribution over all scenarios, given that of the mission in each."""
    if not mission.scenarios:
        return in_one(mission)
    found = [(p, in_one(case)) for p, case in mission.in_scenarios]
    values = np.concatenate([one.values for _, one in found])
    chances = np.concatenate([p * one.probabilities for p, one in found])
    both = merged(values, chances / chances.sum())
    samples = [one.n_samples for _, one in found if one.n_samples is not None]
    return Distribution(both.values, both.probabilities, min(samples, default=None))


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
        robot k, from 0 in the order of the plan, ``hops_k``: the number of arcs it survived. With
        scenarios, also ``scenario``, the name of the one that was drawn.

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
    n_missions = check("n_missions", n_missions, int, ge=1)
    check_mission(mission).evaluate([plan])
    import pandas as pd

    followed = [follow(one, plan) for _, one in mission.in_scenarios]
    if not mission.scenarios:
        draws = _draws(followed[0], n_missions, _generator(random_state))
        return _as_frame(mission, plan, followed[0], draws)
    n_draws = max(len(of.offsets) - 1 + len(_unsure(of)) for of in followed)
    draws = _generator(random_state).random((n_missions, 1 + n_draws))  # the first: which scenario
    ends = np.cumsum([p for p, _ in mission.in_scenarios])
    drawn = np.minimum(np.searchsorted(ends, draws[:, 0], side="right"), len(ends) - 1)
    parts = []
    for s, (of, (_, one)) in enumerate(zip(followed, mission.in_scenarios, strict=True)):
        rows = np.flatnonzero(drawn == s)
        part = _as_frame(one, plan, of, draws[rows, 1:]).set_index(rows)
        part.insert(2, "scenario", mission.scenarios[s].name)
        parts.append(part)
    return pd.concat(parts).sort_index()


def _as_frame(
    mission: Mission, plan: TrailPlan, followed: Followed, draws: FloatArray
) -> pd.DataFrame:
    """Return the table of simulated missions, a row of draws for each."""
    import pandas as pd

    n_missions = len(draws)
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
    """Draw how far each robot gets in each mission, and whether it collects unsure rewards."""
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


def reach_probabilities(mission: Mission, plan: TrailPlan) -> FloatArray:
    """Compute with what probability each robot reaches each node.

    Parameters
    ----------
    mission, plan
        A mission, and a plan that is valid for it; otherwise a PlanError is raised.

    Returns
    -------
    numpy.ndarray
        Shape (robots, n_nodes), robots in the order of the plan, nodes in that of
        ``mission.nodes``; 1 where its trail begins, 0 at nodes that are not on it.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.outcomes import reach_probabilities
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1]])
    >>> toy.nodes
    (1, 2, 3, 4, 5)
    >>> reach_probabilities(toy, plan).round(3).tolist()
    [[1.0, 0.81, 0.0, 0.81, 0.0], [1.0, 0.0, 0.0, 0.0, 0.0]]
    """
    check_mission(mission).evaluate([plan])
    return expected_over(mission, lambda one: _by_node(one, plan, lambda of: of.alive))


def expected_over(mission: Mission, of: Callable[[Mission], FloatArray]) -> FloatArray:
    """Return the mean over all scenarios of a function of the mission in each."""
    if not mission.scenarios:
        return of(mission)
    found: FloatArray = np.sum([p * of(one) for p, one in mission.in_scenarios], axis=0)
    return found


def team_chances(
    chances: Callable[[Mission, TrailPlan], FloatArray], mission: Mission, plan: TrailPlan
) -> FloatArray:
    """Compute with what probability some robot reaches each node, or collects its reward.

    ``chances`` is :func:`reach_probabilities` or :func:`collect_probabilities`. Robots are lost
    independently in each scenario only.
    """
    return expected_over(mission, lambda one: team_reach(chances(one, plan)))


def rewards_alone(mission: Mission, plan: TrailPlan) -> FloatArray:
    """Compute the E[R] of each robot if there were no others (robots,)."""
    return expected_over(mission, lambda one: collect_probabilities(one, plan) @ one.rewards)


def collect_probabilities(mission: Mission, plan: TrailPlan) -> FloatArray:
    """Compute with what probability each robot collects the reward of each node.

    It is P(arrive) · share, or, if the node pays on return, P(reach a depot after the visit) ·
    share. Without scenarios, the team's E[R] follows by :func:`team_reach`. In a plain mission
    these are the probabilities to reach the nodes.

    Parameters
    ----------
    mission, plan
        As for :func:`reach_probabilities`.

    Returns
    -------
    numpy.ndarray
        Shape (robots, n_nodes), as for :func:`reach_probabilities`.

    Examples
    --------
    >>> from botohe_moo import Mission, load_mission
    >>> from botohe_moo.outcomes import collect_probabilities
    >>> toy = load_mission("toy")
    >>> mission = Mission(toy.graph, pays="return")
    >>> plan = mission.plan([[1, 2, 4, 2, 1], [1]])
    >>> collect_probabilities(mission, plan).round(3).tolist()
    [[1.0, 0.656, 0.0, 0.656, 0.0], [1.0, 0.0, 0.0, 0.0, 0.0]]
    """
    check_mission(mission).evaluate([plan])
    return expected_over(mission, lambda one: collected(one, plan))


def collected(mission: Mission, plan: TrailPlan) -> FloatArray:
    """Compute :func:`collect_probabilities` of valid trails, of any number of robots."""
    return _by_node(mission, plan, lambda of: of.share * of.credited)


def _by_node(mission: Mission, plan: TrailPlan, of: Callable[..., FloatArray]) -> FloatArray:
    """Return the largest of the chances ``of`` all visits, robot by robot and node by node."""
    followed = follow(mission, plan)
    found = np.zeros((len(followed.offsets) - 1, len(mission.nodes)))
    robots = np.repeat(np.arange(len(found)), np.diff(followed.offsets))
    # The first visit of a node is its most probable one.
    np.maximum.at(found, (robots, followed.nodes), of(followed))
    return found


def team_reach(reached: FloatArray) -> FloatArray:
    """Compute with what probability some robot reaches each node, from :func:`reach_probabilities`.

    Robots are lost independently, so it is 1 − Π_k (1 − p[k, v]) for node v.

    Parameters
    ----------
    reached
        Probabilities p, of shape (robots, n_nodes).

    Returns
    -------
    numpy.ndarray
        Shape (n_nodes,).

    Examples
    --------
    >>> import numpy as np
    >>> from botohe_moo.outcomes import team_reach
    >>> team_reach(np.array([[1.0, 0.5], [1.0, 0.5]])).tolist()
    [1.0, 0.75]
    """
    some: FloatArray = 1 - np.prod(1 - reached, axis=0)
    return some


class Followed(NamedTuple):
    """The trails of a valid plan, and what is known of each position on them."""

    nodes: OffsetArray  # indices of the mission's nodes
    offsets: OffsetArray
    alive: FloatArray  # the probability to reach the position
    pays: FloatArray  # the reward of the node where its trail first visits it, else 0
    # For first visits: the probability to get to where the reward is credited, 0 if it never is;
    # and the probability that a robot which gets there has collected it.
    credited: FloatArray
    share: FloatArray


def follow(mission: Mission, plan: TrailPlan) -> Followed:
    """Follow the trails of a valid plan of a mission without scenarios."""
    graph, team, returns = mission.world.graph, mission.world.team, mission.world.returns
    nodes = plan.nodes.astype(np.int64)
    arcs, alive = graph.tail * graph.n_nodes + graph.head, np.ones(len(nodes))
    for start, stop in pairwise(plan.offsets.tolist()):
        hops = nodes[start : stop - 1] * graph.n_nodes + nodes[start + 1 : stop]
        [survival] = graph.survival  # of a mission without scenarios
        alive[start + 1 : stop] = np.cumprod(survival[np.searchsorted(arcs, hops)])
    offsets, credited = plan.offsets, alive
    if returns is not None:  # what robots carry comes first
        nodes, alive, offsets = _with_aboard(team, returns, nodes, alive, offsets)
        credited = _credited(alive, returns.credit[nodes], offsets)
    robots = np.repeat(np.arange(plan.n_robots), np.diff(offsets))
    first = np.unique(robots * graph.n_nodes + nodes, return_index=True)[1]
    pays, share, nodes = np.zeros(len(nodes)), team.share[nodes], team.origin[nodes]
    pays[first] = mission.rewards[nodes[first]]
    return Followed(nodes, offsets, alive, pays, credited, share)


def _with_aboard(
    team: Team, returns: Returns, nodes: OffsetArray, alive: FloatArray, offsets: OffsetArray
) -> tuple[OffsetArray, FloatArray, OffsetArray]:
    """Put the nodes whose rewards a robot carries before the trail of each.

    Trails may be of any number of robots; all robots of a kind carry the same.
    """
    n, sources = len(team.reward), nodes[offsets[:-1]]
    robots = np.searchsorted(team.start // n, sources // n)  # the first of the kind
    first, stop = returns.first[robots], returns.stop[robots]
    n_aboard = stop - first
    if not n_aboard.any():
        return nodes, alive, offsets
    starts = np.repeat(offsets[:-1], n_aboard)
    places = [returns.aboard[i:j] for i, j in zip(first, stop, strict=True)]
    layers = nodes[starts] - team.origin[nodes[starts]]
    added = np.concatenate(places) + layers
    offsets = offsets + np.cumsum([0, *n_aboard])
    return np.insert(nodes, starts, added), np.insert(alive, starts, 1.0), offsets


def _credited(alive: FloatArray, credit: OffsetArray, offsets: OffsetArray) -> FloatArray:
    """Compute the probability to get to where what is paid at each position is credited."""
    credited = alive.copy()
    for start, stop in pairwise(offsets.tolist()):
        at_depot = 0.0  # behind the last depot of the trail
        for i in reversed(range(start, stop)):
            if credit[i] == AT_THIS_DEPOT:
                at_depot = alive[i]
            elif credit[i] == AT_NEXT_DEPOT:
                credited[i] = at_depot
    return credited


class TooManyOutcomesError(Exception):
    """The exact computation needs more outcomes than allowed."""


class States(NamedTuple):
    """Outcomes of some robots: reward, probability, and the nodes reached, as bits (n, n_words)."""

    values: FloatArray
    probabilities: FloatArray
    reached: SeedArray


def merged(
    values: FloatArray, probabilities: FloatArray, reached: SeedArray | None = None
) -> States:
    """Merge outcomes that agree in reward, up to rounding, and in the nodes reached.

    Their mean stays, to the last digits.
    """
    if reached is None:
        reached = np.empty((len(values), 0), np.uint64)
    if len(values) == 0:  # all have underflown
        return States(values, probabilities, reached)
    order = np.lexsort((values, *reached.T))
    values, reached = values[order], reached[order]
    differs = np.diff(values) > ROUNDING * values[1:]
    differs |= (reached[1:] != reached[:-1]).any(axis=1)
    starts = np.append(0, 1 + np.flatnonzero(differs))
    probabilities = probabilities[order]
    beyond = values - np.repeat(values[starts], np.diff(starts, append=len(values)))
    beyond = np.add.reduceat(probabilities * beyond, starts)
    probabilities = np.add.reduceat(probabilities, starts)
    kept = probabilities > 0  # a product of many small ones may underflow
    starts, probabilities = starts[kept], probabilities[kept]
    return States(values[starts] + beyond[kept] / probabilities, probabilities, reached[starts])


def join_robots(reward: FloatArray, followed: Followed, max_outcomes: int) -> States:
    """Compute the outcomes of all robots exactly; see ``reward_distribution``."""
    nodes, offsets, _, pays, credited, share = followed
    certain = np.unique(nodes[(credited == 1) & (share == 1) & (pays > 0)])
    uncertain = (pays > 0) & (credited > 0) & (share > 0) & ~np.isin(nodes, certain)
    chains = [i + np.flatnonzero(uncertain[i:j]) for i, j in pairwise(offsets.tolist())]
    # In the order in which they are credited: what is credited at a depot has one probability.
    chains = [chain[np.argsort(-credited[chain], kind="stable")] for chain in chains]
    reaching = np.zeros((len(chains), len(reward)), bool)
    for row, chain in zip(reaching, chains, strict=True):
        row[nodes[chain]] = True
    sharing: nx.Graph[int] = nx.Graph()
    sharing.add_edges_from(zip(*np.nonzero(reaching @ reaching.T), strict=True))

    parts = []
    for component in nx.connected_components(sharing):
        group = [chains[robot] for robot in sorted(component)]
        part, max_outcomes = _join_group(reward, followed, group, max_outcomes)
        parts.append(part)
    total = parts[0] if parts else merged(np.zeros(1), np.ones(1))
    for part in parts[1:]:
        max_outcomes = _spend(max_outcomes, len(total.values) * len(part.values))
        values = np.add.outer(total.values, part.values).ravel()
        total = merged(values, np.outer(total.probabilities, part.probabilities).ravel())
    values, probabilities, _ = total
    return merged(values + reward[certain].sum(), probabilities)


def _join_group(
    reward: FloatArray, followed: Followed, chains: list[OffsetArray], max_outcomes: int
) -> tuple[States, int]:
    """Join robots that share nodes; ``chains`` are the positions on each trail that count.

    Positions are in the order in which they are credited. Also returns what is left of
    ``max_outcomes``.

    A bit for each node of the group says which nodes were reached. If robot 0 may reach nodes 4 and
    9, and robot 1 nodes 9 and 7, the nodes 4, 7, 9 have the bits 1, 2, 4 (``table`` is [4, 7, 9]),
    ``masks`` are [5, 6, 0], and ``later`` is [7, 6, 0]: once robot 0 is joined, only the bits of 7
    and 9 matter, so that states which differ in node 4 alone are merged.
    """
    table = np.unique(followed.nodes[np.concatenate(chains)])
    masks = np.zeros((len(chains) + 1, (len(table) + 63) // 64), np.uint64)
    bits = [np.searchsorted(table, followed.nodes[chain]) for chain in chains]
    for mask, bit in zip(masks, bits, strict=False):
        np.bitwise_or.at(mask, bit // 64, np.uint64(1) << (bit % 64).astype(np.uint64))
    later = np.bitwise_or.accumulate(masks[::-1])[::-1]

    states = States(np.zeros(1), np.ones(1), np.zeros((1, masks.shape[1]), np.uint64))
    for robot, chain in enumerate(chains):
        gains, credited = reward[followed.nodes[chain]], followed.credited[chain]
        share = followed.share[chain]
        if (share == 1).all():
            chances = -np.diff(np.concatenate([[1.0], credited, [0.0]]))
            max_outcomes = _spend(max_outcomes, len(states.values) * int((chances > 0).sum()))
            joint = _join(states, bits[robot], gains, chances)
        else:
            steps = zip(bits[robot], gains, credited, share, strict=True)
            joint, max_outcomes = _join_unsure(states, list(steps), later[robot + 1], max_outcomes)
        states = merged(*joint._replace(reached=joint.reached & later[robot + 1]))
    return states, max_outcomes


def _join_unsure(
    states: States,
    steps: list[tuple[int, float, float, float]],
    later: SeedArray,
    max_outcomes: int,
) -> tuple[States, int]:
    """Join every state with every fate of a robot that may fail to collect a reward it gets to.

    ``steps`` are bit, reward, probability to get there, and share, of each node that it may
    collect; ``later`` are the nodes that other robots may collect. Node by node, so that fates that
    make no difference ahead are merged. Also returns what is left of ``max_outcomes``.
    """
    bits = np.array([step[0] for step in steps])
    ahead = np.zeros((len(steps) + 1, len(later)), np.uint64)
    ahead[np.arange(len(steps)), bits // 64] = np.uint64(1) << (bits % 64).astype(np.uint64)
    ahead = later | np.bitwise_or.accumulate(ahead[::-1])[::-1]
    lost, alive = [], 1.0
    for (bit, gain, credited, share), kept in zip(steps, ahead[1:], strict=True):
        max_outcomes = _spend(max_outcomes, 3 * len(states.values))
        on = credited / alive
        lost.append(states._replace(probabilities=states.probabilities * (1 - on)))
        chances = np.array([on * (1 - share), on * share])
        joint = _join(states, np.array([bit]), np.array([gain]), chances)
        states = merged(*joint._replace(reached=joint.reached & kept))
        alive = credited
    return States(*map(np.concatenate, zip(*lost, states, strict=True))), max_outcomes


def _join(states: States, bits: OffsetArray, gains: FloatArray, chances: FloatArray) -> States:
    """Join every state of the robots so far with every fate of one more robot.

    ``bits`` and ``gains`` are the bit and the reward of each node that the robot may reach, in the
    order of its trail (n_reachable). ``chances`` are the probabilities that it reaches the first
    0, 1, ..., n_reachable of them and no more; a fate with the probability 0 is left out.
    """
    word, bit = bits // 64, np.uint64(1) << (bits % 64).astype(np.uint64)
    adds = np.where(states.reached[:, word] & bit, 0.0, gains)
    values = np.cumsum(np.column_stack([states.values, adds]), axis=1)
    masks = np.zeros((len(chances), states.reached.shape[1]), np.uint64)
    masks[np.arange(1, len(chances)), word] = bit
    fates = chances > 0
    masks = np.bitwise_or.accumulate(masks)[fates]
    probabilities = np.outer(states.probabilities, chances[fates]).ravel()
    reached = (states.reached[:, np.newaxis] | masks).reshape(-1, masks.shape[1])
    return States(values[:, fates].ravel(), probabilities, reached)


def _spend(max_outcomes: int, n_joint: int) -> int:
    """Return what is left of the outcomes that are allowed, or raise a TooManyOutcomesError."""
    if n_joint > max_outcomes:
        raise TooManyOutcomesError
    return max_outcomes - n_joint
