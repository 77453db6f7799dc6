"""Making a plan anew for a mission under way."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from botohe_moo.algorithms.local_search.engine import Costs, LocalSearch
from botohe_moo.base.messages import check_integer, check_number
from botohe_moo.base.types import FloatArray
from botohe_moo.core.world import World
from botohe_moo.decide.fronts import (
    PlansOrObjectives,
    check_row,
    difference_text,
    front_rows,
    objectives_of,
    short_text,
)
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.mission.underway import Event, UnderWay, under_way
from botohe_moo.trails import TrailPlan

_EVALUATIONS_OF_A_PRICE = 2_000


@dataclass(frozen=True)
class Replan:
    """The best rest of a plan at a price, and the front of all rests.

    Attributes
    ----------
    left
        What is left of the mission and of its plan.
    price
        What a survivor is worth, as reward.
    plan
        The plan of ``left.mission`` that has most reward and worth of survivors.
    objectives, before
        Its E[R] and E[S], and those of the rest of the running plan. Rewards that count already
        are ``left.banked``.
    plans, front
        All plans found that are not dominated, by descending reward, and their objectives.

    Examples
    --------
    >>> from botohe_moo import Event, load_mission, replan
    >>> from botohe_moo.underway import Replan
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1, 3, 1]])
    >>> found = replan(toy, plan, [Event("home", 1)], price=50)
    >>> isinstance(found, Replan), found.left.banked
    (True, 1.0)
    """

    left: UnderWay
    price: float
    plan: TrailPlan
    objectives: FloatArray
    before: FloatArray
    plans: tuple[TrailPlan, ...]
    front: FloatArray

    @property
    def gain(self) -> float:
        """What the new plan is worth more than the rest of the old one, as reward; at least 0."""
        return _worth(self.objectives, self.price) - _worth(self.before, self.price)

    def __str__(self) -> str:
        price = f"A robot more costs {short_text(self.price)} reward."
        if self.gain <= 0.0:
            return f"{price} What is left of the plan stays as it is."
        more = self.objectives - self.before
        reward, survivors = map(difference_text, more.tolist(), ("reward", "survivors"))
        return f"{price} The new plan has {reward} and {survivors}."


def robot_price(mission: Mission, plans: PlansOrObjectives, index: int) -> float:
    """Compute what a survivor is worth, as reward, to whoever chooses a plan of a front.

    It is the slope of the convex hull of the front at the plan's survivors; where two edges of the
    hull meet, their mean.

    Parameters
    ----------
    mission, plans, index
        As for :func:`botohe_moo.decide.neighbours`, which also says what is raised.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.underway import robot_price
    >>> front = [[8, 0], [7, 1], [4, 1.4], [0, 2]]  # E[R] and E[S] of four plans
    >>> robot_price(load_mission("toy"), front, 1)
    4.0
    """
    objectives = objectives_of(mission, plans)
    return _slope(objectives, objectives[check_row("index", index, len(objectives)), 1])


def check_price(mission: Mission, plan: TrailPlan, price: float | None, world: World) -> float:
    """Check the price of a survivor; if there is none, compute what a plan implies.

    That is the slope of the front near the plan, which a short local search finds, always with the
    same seed, since a plan implies one price.
    """
    if price is not None:
        return check_number("price", price, at_least=0)
    search = LocalSearch(mission, Costs(world), random_state=np.random.default_rng(1))
    search.insert(mission.batch([plan, mission.stay_home()]))
    search.run(_EVALUATIONS_OF_A_PRICE)
    return _slope(search.plans()[1], mission.evaluate([plan])[0, 1])


def _slope(objectives: FloatArray, survivors: float) -> float:
    """Compute what a survivor costs at some number of survivors, on the hull of a front."""
    hull: list[FloatArray] = []
    for point in objectives[front_rows(objectives)]:  # by ascending survivors
        while len(hull) > 1 and _turns_left(hull[-2], hull[-1], point):
            hull.pop()
        hull.append(point)
    if len(hull) == 1:
        return 0.0
    corners = np.array(hull)
    slopes = -np.diff(corners[:, 0]) / np.diff(corners[:, 1])
    first = int(np.searchsorted(corners[1:-1, 1], survivors, "left"))
    last = int(np.searchsorted(corners[1:-1, 1], survivors, "right"))
    return float((slopes[first] + slopes[last]) / 2)


def _turns_left(one: FloatArray, middle: FloatArray, other: FloatArray) -> bool:
    """Return whether a point lies on or below the line from one point to another."""
    (reward, survivors), (more, fewer) = middle - one, other - one
    return bool(reward * fewer <= more * survivors)


def replan(
    mission: Mission,
    plan: TrailPlan,
    events: Iterable[Event],
    *,
    price: float | None = None,
    evaluations: int = 400,
    seed: int = 1,
    min_survival: float = 0.0,
    max_length: float | None = None,
) -> Replan:
    """Make a plan anew for what is left of a mission after some events.

    A Pareto local search starts from the rest of the running plan, so that no plan found is worse.

    Parameters
    ----------
    mission, plan, events
        As for :func:`botohe_moo.underway.under_way`.
    price
        What a survivor is worth, as reward, at least 0; :func:`botohe_moo.underway.robot_price`
        gives that of a plan of a front. Default: what the plan implies, by the slope of a front
        that a local search of 2 000 evaluations finds from it.
    evaluations
        Plans to evaluate, at least 0.
    seed
        Seed of the search, at least 0.
    min_survival, max_length
        As for :func:`botohe_moo.underway.under_way`.

    Raises
    ------
    ValueError
        If a parameter is out of its range.
    PlanError, EventError, MissionError
        As for :func:`botohe_moo.underway.under_way`.

    Examples
    --------
    >>> from botohe_moo import Event, load_mission, replan
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1]])
    >>> new = replan(toy, plan, [Event("lost", 0)], price=1)
    >>> new.left.mission.robots, new.gain >= 0
    (1, True)
    """
    evaluations = check_integer("evaluations", evaluations, at_least=0)
    generator = np.random.default_rng(check_integer("seed", seed, at_least=0))
    left = under_way(
        check_mission(mission), plan, events, min_survival=min_survival, max_length=max_length
    )
    price = check_price(mission, plan, price, mission.limited(min_survival, max_length))
    return replan_left(left, price, evaluations, generator)


def replan_left(
    left: UnderWay, price: float, evaluations: int, random_state: np.random.Generator
) -> Replan:
    """Make a plan anew for what is left of a mission, as `replan` does."""
    rest = left.mission
    search = LocalSearch(rest, Costs(rest.limited()), random_state=random_state)
    search.insert(rest.batch([left.plan, rest.stay_home()]))
    search.run(evaluations)
    batch, objectives, _ = search.plans()
    plans = list(batch)
    [before] = rest.evaluate([left.plan])
    worth = objectives @ np.array([1.0, price])
    best = int(np.argmax(worth))
    same = np.isclose(objectives, before, rtol=1e-12, atol=0.0).all(axis=1)
    if same.any() and np.isclose(worth[same][0], worth[best], rtol=1e-12, atol=0.0):
        best = int(np.argmax(same))
        plans[best], objectives[best] = left.plan, before
    return Replan(left, price, plans[best], objectives[best], before, tuple(plans), objectives)


def _worth(objectives: FloatArray, price: float) -> float:
    return float(objectives[0] + price * objectives[1])
