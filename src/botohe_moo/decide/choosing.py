"""Choosing one plan of a front, by wishes or by a reference point, and comparing plans."""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from botohe_moo.base.messages import check_choice, difference_text, price_text, short_text
from botohe_moo.base.parameters import NotNegative, check
from botohe_moo.decide import fronts
from botohe_moo.decide import wishes as w
from botohe_moo.decide.fronts import TradeOff, arc_counts, distances
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.trails import Plans, TrailPlan

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Miss:
    """A wish that the chosen plan does not meet.

    Attributes
    ----------
    wish
        The wish.
    value, by
        The value that the plan has, and how much is missing.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import Miss, choose
    >>> toy = load_mission("toy")
    >>> plans = [toy.plan([trail, [1]]) for trail in ([1], [1, 2, 1], [1, 2, 4, 2, 1])]
    >>> for miss in choose(toy, plans, "survivors >= 1.5 and reward >= 5").missed:
    ...     print(miss)
    reward >= 5 by 1.76 (it has 3.24)
    """

    wish: w.Wish
    value: float
    by: float

    def __str__(self) -> str:
        return f"{self.wish} by {short_text(self.by)} (it has {short_text(self.value)})"


@dataclass(frozen=True, eq=False)
class Choice:
    """A plan chosen from a front, the best among these plans; ``str`` says why, and what it costs.

    Attributes
    ----------
    plan, index
        The plan, and its row in the front that was given.
    reward, survivors
        Its E[R] and E[S].
    why
        Why this one, in a sentence.
    cost
        The differences to its :func:`neighbours` on the front.
    price
        The price of a survivor at this plan, as :func:`survivor_price` computes it.
    met
        Whether it meets all wishes. If no plan does, it is the one that comes nearest.
    wishes, missed
        The wishes, and those that the plan does not meet.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import Choice, choose
    >>> toy = load_mission("toy")
    >>> plans = [toy.plan([trail, [1]]) for trail in ([1], [1, 2, 1], [1, 2, 4, 2, 1])]
    >>> choice = choose(toy, plans, "survivors >= 1.6")
    >>> print(choice.why)
    The best among these plans (3): plan 2 has the most reward with survivors >= 1.6 (1.656).
    >>> choice.met, choice.missed
    (True, ())
    """

    plan: TrailPlan
    index: int
    reward: float
    survivors: float
    why: str
    cost: tuple[TradeOff, ...]
    price: float
    met: bool
    wishes: tuple[w.Wish, ...]
    missed: tuple[Miss, ...]

    def __str__(self) -> str:
        reward, survivors = short_text(self.reward), short_text(self.survivors)
        title = f"plan {self.index}: expected reward {reward}, expected survivors {survivors}"
        return "\n".join([title, self.why, *self.costs])

    @property
    def costs(self) -> tuple[str, ...]:
        """What it costs beside its neighbours, and what a survivor costs, in sentences."""
        price = [f"{price_text(self.price).capitalize()}."] if self.price else []
        beside = f"Beside it on the front, {'; '.join(map(str, self.cost))}."
        if not self.cost:
            beside = "No plan of the front has more reward or more survivors."
        return (beside, *price)


def choose(
    mission: Mission, plans: Plans, *wishes: str | w.Wish, most: w.Quantity | None = None
) -> Choice:
    """Choose the plan of most expected reward among those that meet all wishes.

    Of plans with equal rewards, the one with more survivors is chosen, then the first. The best
    among these plans need not be the best of all. A front is optimal in the two expectations only:
    a plan that is not on it may be better in a probability or a conditional value at risk.

    Parameters
    ----------
    mission
        The mission.
    plans
        Its plans, for example ``solution.plans`` or ``result.X``.
    *wishes
        Texts such as ``"survivors >= 2"``, ``"drone survivors >= 1"`` or
        ``"P(reward >= 5) >= 0.8"``, or what :func:`parse_wishes` makes of them.
    most
        The quantity to maximise; default: the survivors if all wishes are of the form
        ``reward >= x``, else the reward.

    Returns
    -------
    Choice
        If no plan meets all wishes, the plan whose largest shortfall is the smallest. Shortfalls
        are divided by what a plan can have: 1 for probabilities, the number of robots, of the kind,
        for survivors, the total reward for rewards.

    Raises
    ------
    ValueError
        If there is no plan or no wish, or a wish cannot be read.
    PlanError
        If a plan is not valid for the mission.

    Notes
    -----
    Wishes are judged by the exact distributions of reward and survivors. Plans are judged in order
    of preference, until one meets all wishes. Where the exact distribution of a plan's reward takes
    too long, it is simulated, always with the same seed, and the answer says so.

    A weighted sum of both objectives is not offered, because it finds only plans on the convex hull
    of the front: some 20 of the art museum's 470.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import choose
    >>> toy = load_mission("toy")
    >>> plans = [toy.plan([trail, [1]]) for trail in ([1], [1, 2, 4, 2, 1], [1, 3, 2, 4, 2, 3, 1])]
    >>> choice = choose(toy, plans, "survivors >= 1.6")
    >>> print(choice.why)
    The best among these plans (3): plan 2 has the most reward with survivors >= 1.6 (1.656).
    >>> print(choice.costs[0])
    Beside it on the front, plan 0 has 0.3439 more survivors for 4.14 less reward.
    """
    return best(w.Candidates(mission, plans), wishes, most)


def best(
    front: w.Candidates, wishes: Iterable[str | w.Wish], most: w.Quantity | None = None
) -> Choice:
    """Choose one of the candidates; see :func:`choose`."""
    wanted = w.parse_wishes(front.mission, wishes)
    if most is None:
        of_reward = all((of.form, of.quantity) == ("expected", "reward") for of in wanted)
        most = "survivors" if of_reward else "reward"
    check_choice("most", most, w.QUANTITIES)
    first = w.QUANTITIES.index(most)
    order = np.lexsort((-front.objectives[:, 1 - first], -front.objectives[:, first])).tolist()
    quickest_first = sorted(wanted, key=lambda wish: wish.form in ("chance", "tail mean"))
    n_plans = f"these plans ({len(front)})"
    meeting = (i for i in order if not any(front.missing(wish, i) for wish in quickest_first))
    if (chosen := next(meeting, None)) is not None:
        values = (f"{wish} ({short_text(front.value(wish, chosen))})" for wish in wanted)
        has = f"plan {chosen} has the most {most} with {' and '.join(values)}"
        why = f"The best among {n_plans}: {has}."
    else:
        shortfalls = np.array([[front.missing(wish, i) for wish in wanted] for i in order])
        shortfalls /= [front.span(wish) for wish in wanted]
        chosen = order[int(shortfalls.max(axis=1).argmin())]
        missed = " and ".join(map(str, _missed(front, chosen, wanted)))
        nearest = f"Plan {chosen} comes nearest: it misses {missed}."
        why = f"None of {n_plans} has {' and '.join(map(str, wanted))}. {nearest}"
        beyond = [of for of in wanted if of.at_least > front.span(of) * (1 + fronts.SLACK)]
        why += "".join(f" No plan has {of}: {front.span(of):g} is the maximum." for of in beyond)
    return _choice(front, chosen, why + front.simulation_note(), wanted)


def toward(mission: Mission, plans: Plans, *, reward: float, survivors: float) -> Choice:
    """Choose the plan that comes nearest to a reference point, or exceeds it most evenly.

    Parameters
    ----------
    mission, plans
        As for :func:`choose`.
    reward, survivors
        The reference point: the values to aim at, at least 0. They need not be possible.

    Returns
    -------
    Choice
        ``met`` says whether the plan has at least as much of both.

    Raises
    ------
    ValueError
        As for :func:`choose`, or if the reference point is not finite numbers of at least 0.

    Notes
    -----
    The largest value of the achievement scalarising function min_i z_i, of equal ones that of the
    largest Σ_i z_i, where z_i is by how much the plan exceeds the reference point in objective i,
    divided by the total reward or by the number of robots, never by the range of the front:
    Wierzbicki, "The use of reference objectives in multiobjective optimization", 1980. Every
    non-dominated plan is chosen for some reference point: its own objectives.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import toward
    >>> toy = load_mission("toy")
    >>> plans = [toy.plan([trail, [1]]) for trail in ([1], [1, 2, 4, 2, 1], [1, 3, 2, 4, 2, 3, 1])]
    >>> choice = toward(toy, plans, reward=5, survivors=1.6)
    >>> choice.index, choice.met
    (2, False)
    """
    reward = check("reward", reward, NotNegative)
    survivors = check("survivors", survivors, NotNegative)
    wanted = w.Wish("expected", reward, "reward"), w.Wish("expected", survivors, "survivors")
    front = w.Candidates(mission, plans)
    reference = np.array([wish.at_least for wish in wanted])
    beyond = (front.objectives - reference) / fronts.scales(mission)
    least = beyond.min(axis=1)
    equal = least >= least.max() - fronts.SLACK
    i = int(np.where(equal, beyond.sum(axis=1), -np.inf).argmax())
    missed = _missed(front, i, wanted)
    point = f"reward {short_text(reference[0])} and survivors {short_text(reference[1])}"
    how = f"misses {' and '.join(map(str, missed))}" if missed else "has at least as much of both"
    why = f"The best among these plans ({len(front)}) for {point}: plan {i} {how}."
    return _choice(front, i, why, wanted)


def taken(mission: Mission, plans: Plans, index: int) -> Choice:
    """Take the plan of a row, from 0, and say what it costs beside its neighbours."""
    front = w.Candidates(mission, plans)
    index = fronts.check_row("index", index, len(front))
    return _choice(front, index, f"Taken by its number from these plans ({len(front)}).", ())


def _missed(front: w.Candidates, i: int, wishes: tuple[w.Wish, ...]) -> tuple[Miss, ...]:
    lacking = [(wish, front.missing(wish, i)) for wish in wishes]
    return tuple(Miss(wish, front.value(wish, i), by) for wish, by in lacking if by)


def _choice(front: w.Candidates, i: int, why: str, wishes: tuple[w.Wish, ...]) -> Choice:
    missed, objectives = _missed(front, i, wishes), front.objectives
    cost = fronts.neighbours(front.mission, objectives, i)
    price = fronts.survivor_price(front.mission, objectives, i)
    reward, survivors = objectives[i].tolist()
    about = front.plans[i], i, reward, survivors, why, cost, price
    return Choice(*about, met=not missed, wishes=wishes, missed=missed)


@dataclass(frozen=True, eq=False)
class Difference:
    """The difference of two plans; ``str`` describes it, a line for each robot that changes.

    Attributes
    ----------
    reward, survivors
        How much more E[R] and E[S] the second plan has; below 0 if it has less.
    table
        A row for each robot of the first plan: ``robot`` and ``other_robot``, the one that it is
        matched with in the second, from 0; the name of their ``kind``; ``survival`` and
        ``other_survival``, the probabilities that they survive; ``gained`` and ``lost``, the nodes
        that only the second, or only the first of them visits; and ``same``, whether their trails
        are the same.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import Difference, compare
    >>> toy = load_mission("toy")
    >>> found = compare(toy, toy.plan([[1, 2, 1], [1]]), toy.plan([[1, 2, 4, 2, 1], [1]]))
    >>> round(found.reward, 2)
    3.24
    >>> found.table[["robot", "survival", "other_survival", "gained"]].round(3)
       robot  survival  other_survival gained
    0      0     0.656           0.656   (4,)
    1      1     1.000           1.000     ()
    """

    reward: float
    survivors: float
    table: pd.DataFrame

    @property
    def sentences(self) -> tuple[str, ...]:
        """The lines of ``str``."""
        if self.table["same"].all():
            return ("The plans are the same.",)
        reward = difference_text(self.reward, "reward")
        survivors = difference_text(self.survivors, "survivors")
        lines = [f"The second plan has {reward} and {survivors}."]
        changed: Iterable[Any] = self.table[~self.table["same"]].itertuples()
        for change in changed:
            before, after = map(short_text, (change.survival, change.other_survival))
            parts = [f"survival {before} -> {after}" if before != after else f"survival {before}"]
            visits = {"also visits": change.gained, "no longer visits": change.lost}
            for words, nodes in visits.items():
                parts += [f"{words} {', '.join(map(w.label_text, nodes))}"] if nodes else []
            parts += [] if change.gained or change.lost else ["another trail to the same nodes"]
            then = f"robot {change.other_robot} in the second plan"
            lines.append(f"Robot {change.robot} ({then}): {'; '.join(parts)}.")
        return tuple(lines)

    def __str__(self) -> str:
        return "\n".join(self.sentences)


def compare(mission: Mission, first: TrailPlan, second: TrailPlan) -> Difference:
    """Compare two plans: rewards, survivors, nodes, and the trails of matched robots.

    Robots of a kind are identical, so each robot of the first plan is matched with one of the
    second, of its kind. The sum of the distances of their trails, ``1 − |A ∩ B| / |A ∪ B|`` of
    their arcs, is the smallest.

    Parameters
    ----------
    mission
        The mission.
    first, second
        Two plans of it.

    Raises
    ------
    PlanError
        If a plan is not valid for the mission.
    TypeError
        If one is not a TrailPlan.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import compare
    >>> toy = load_mission("toy")
    >>> first, second = toy.plan([[1, 2, 1], [1]]), toy.plan([[1], [1, 2, 4, 2, 1]])
    >>> print(compare(toy, first, second))
    The second plan has 3.24 more reward and the same survivors.
    Robot 0 (robot 1 in the second plan): survival 0.6561; also visits 4.
    """
    import pandas as pd

    batch = check_mission(mission).batch([first, second])
    reward, survivors = np.diff(mission.evaluate(batch), axis=0)[0].tolist()
    before, after = mission.robot_survival(batch).tolist()
    ours, others = ([*map(set, mission.labels(plan))] for plan in (first, second))

    def in_order(nodes: set[Hashable]) -> tuple[Hashable, ...]:
        return tuple(sorted(nodes, key=mission.index))

    matched = _matched(mission, first, second)
    columns = {
        "robot": range(mission.robots),
        "other_robot": matched,
        "kind": [kind.name for kind in mission.kind_of],
        "survival": before,
        "other_survival": [after[k] for k in matched],
        "gained": [in_order(others[k] - own) for own, k in zip(ours, matched, strict=True)],
        "lost": [in_order(own - others[k]) for own, k in zip(ours, matched, strict=True)],
        "same": [first.trails[i] == second.trails[k] for i, k in enumerate(matched)],
    }
    return Difference(reward, survivors, pd.DataFrame(columns))


def _matched(mission: Mission, first: TrailPlan, second: TrailPlan) -> list[int]:
    """Match the robots of two plans, kind by kind; equal trails come first, then the nearest."""
    from scipy.optimize import linear_sum_assignment

    batch = mission.batch([first, second])
    counts, other_counts = np.split(arc_counts(batch, per_robot=True), 2)
    # Trails of the same arcs in another order have no distance, but are not equal.
    differ = [[trail != other for other in second.trails] for trail in first.trails]
    apart = distances(counts, other_counts) + 1e-9 * np.array(differ)
    kinds = np.array([mission.kinds.index(kind) for kind in mission.kind_of])
    apart[kinds[:, None] != kinds] = np.inf
    return list(map(int, linear_sum_assignment(apart)[1]))
