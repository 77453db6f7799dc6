"""Bounding a front from above: what users call.

Of missions that are not plain, a plain one is bounded whose front is nowhere below theirs.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Annotated, Any

import networkx as nx
import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from botohe_moo.algorithms.exact.front import MemoryLimit
from botohe_moo.base.messages import quoted
from botohe_moo.base.parameters import NotNegative, Positive, Probability, TravelBudget, checked
from botohe_moo.bounds.deadline import Deadline
from botohe_moo.bounds.front_bound import FrontBound, Line
from botohe_moo.bounds.proof import Proof
from botohe_moo.core.compile import kernels
from botohe_moo.core.world import Limits
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.mission.rules import ONLY_KIND, Kind, by_kind
from botohe_moo.objectives import check_objectives

TIME_LIMIT = 60.0
MEMORY_LIMIT = 1024.0
MOST_ROBOTS = 5_000
# Prices of survival at which bounds of scenarios are added, beside those of their own lines, in
# shares of all reward per robot.
_SLOPES = np.geomspace(0.125, 32.0, 17)
_SAMPLES = 2_000  # of E[S], where the bounds of scenarios are added up
_OF_SCENARIOS = "Each scenario is bounded as if plans could be made for it alone."


@kernels("compiled")
@checked
def bound_front(
    mission: Mission,
    *,
    front: ArrayLike | None = None,
    time_limit: Positive = TIME_LIMIT,
    memory_limit: MemoryLimit = MEMORY_LIMIT,
    gap: NotNegative = 0.0,
    n_threads: Annotated[int, Field(ge=1, le=1_024)] = 1,
    min_survival: Probability = 0.0,
    max_length: TravelBudget | None = None,
    seed: Annotated[int, Field(ge=0)] = 1,
    callback: Callable[[FrontBound], Any] | None = None,
) -> FrontBound:
    """Bound the front of a mission from above: for each E[S], an E[R] that no plan exceeds.

    Small missions get their true front. On others, visits and survival get prices, and a relaxation
    bounds what a trail is worth under them; see ``docs/bounds.md``. With kinds of robots or rewards
    on return, all this is done for a plain mission that allows more. With scenarios it is done for
    each of them, in its share of the time, and there are no steps.

    Parameters
    ----------
    mission
        What is planned for.
    front
        E[R] and E[S] of known plans (n, 2): ``-result.F``. Work goes first to where the gap between
        them and the bound is the widest. A short search adds others.
    time_limit
        Seconds until it ends, above 0. Compiling does not count, and ending what has begun may take
        longer. More time only lowers the bound.
    memory_limit
        MiB that its tables may take, in (0, 10⁹]. With less, relaxed trails remember less.
    gap
        At least 0: it ends when the bound's area exceeds that of the known plans by at most this
        share.
    n_threads
        Threads that work at different places of the front, from 1 to 1 024.
    min_survival
        Survival floor of every robot, in [0, 1]; a kind may have a higher one.
    max_length
        Travel budget of every robot, at least 0; a kind may have a lower one. None is the mission's
        own, if it has one; inf is no budget.
    seed
        Of the search for trails, at least 0. With one thread, a seed and a time limit lead to the
        same bounds one after another, where libraries round alike; how far they get depends on the
        machine, and so may whether it finds a true front.
    callback
        Called with each bound on the way, which is valid, too.

    Returns
    -------
    FrontBound
        What has been proved, also after Ctrl-C.

    Raises
    ------
    TypeError
        If ``mission`` is not a Mission, or ``callback`` not callable.
    ValueError
        If a parameter is out of its range, the mission has more than 5 000 robots or robots that
        carry something from the start, ``front`` is not of shape (n, 2), or one of its plans lies
        above the bound: then it is of another mission, or does not keep the limits.

    Notes
    -----
    Lagrangian bounds with convex prices on the probability to be alive at a node, column generation
    (Desaulniers, Desrosiers and Solomon, eds., "Column Generation", Springer, 2005) with smoothed
    prices, and ng-routes that learn what to remember (Roberti and Mingozzi, "Dynamic ng-path
    relaxation for the delivery man problem", Transportation Science 48(3), 2014).

    Examples
    --------
    >>> from botohe_moo import bound_front, load_mission
    >>> toy = load_mission("toy", robots=1)
    >>> bound_front(toy).bound([0.3, 0.6, 0.9]).round(2).tolist()
    [7.09, 4.14, 0.0]
    """
    check_mission(mission)
    if mission.robots > MOST_ROBOTS:
        raise ValueError(
            f"Expected a mission of at most {MOST_ROBOTS:,} robots, got {mission.robots:,}: bounds "
            "are computed for each number of them that may move."
        )
    if callback is not None and not callable(callback):
        raise TypeError(f"Expected callback to be callable, got {quoted(callback)}.")
    known = check_objectives("front", () if front is None else front)
    check_boundable(mission, "bound_front")
    if mission.scenarios:
        bound = _over_scenarios(
            mission,
            time_limit=time_limit / len(mission.scenarios),
            min_survival=min_survival,
            memory_limit=memory_limit,
            n_threads=n_threads,
            max_length=max_length,
            seed=seed,
        )
        bound.check("front", known)
        if callback is not None:
            callback(bound)
        return bound
    relaxation, world = mission, mission.limited(min_survival, max_length, by=0.0)
    if not mission.is_plain:
        relaxation = relaxed_to_plain(mission, world.limits)
        world = relaxation.world
    proof = Proof(
        relaxation,
        world,
        bounded=mission,
        seed=seed,
        memory=memory_limit,
        deadline=Deadline(time_limit),
        n_threads=n_threads,
    )
    proof.bound().check("front", known)
    proof.known.add(known)
    try:
        if not proof.find_front():
            proof.run(gap, callback)
    except KeyboardInterrupt:
        pass
    bound = proof.bound()
    bound.check("front", known)
    return bound


def _over_scenarios(mission: Mission, *, min_survival: float, **options: Any) -> FrontBound:
    """Bound the front of a mission with scenarios by the bounds B_s of each.

    For each number j of robots that move, and each price mu of survivors,

        E[R] ≤ Σ_s p_s max_x (B_s(x) + mu · x) − mu · Σ_s p_s x_s.

    B_s never rises: between two samples, it is at most B_s of the first. Floors, which are those of
    the survival over all scenarios, do not bind in one.
    """
    found, robots = [], mission.robots
    for probability, one in mission.in_scenarios:
        kinds = [replace(kind, min_survival=0.0) for kind in one.kinds]
        case = Mission(one.graph, base=one.base, kinds=kinds, pays=one.pays, name=one.name)
        found.append((probability, bound_front(case, **options)))
    lines = []
    slopes = _SLOPES * mission.total_reward / robots
    for moving in range(1, robots + 1):
        x = np.linspace(0.0, moving, _SAMPLES + 1)
        heights = [(p, bound.where(moving, x[:-1] + robots - moving)) for p, bound in found]
        own = [line.mu for _, bound in found for line in bound.lines if line.n_robots == moving]
        for mu in sorted({0.0, *slopes.tolist(), *own}):
            most = math.fsum(p * float((height + mu * x[1:]).max()) for p, height in heights)
            # Where no plan lets so few robots move, any line holds.
            lines.append(Line(moving, max(most * (1.0 + 1e-12), 0.0), mu, "relaxed"))
    bounds = [bound for _, bound in found]
    return FrontBound(
        mission=mission,
        lines=tuple(lines),
        steps=(),
        most_survival=min(1.0, math.fsum(p * bound.most_survival for p, bound in found) + 1e-12),
        min_survival=min(max(min_survival, kind.min_survival) for kind in mission.kinds),
        max_length=bounds[0].max_length,
        seconds=sum(bound.seconds for bound in bounds),
        notes=(*dict.fromkeys(note for bound in bounds for note in bound.notes), _OF_SCENARIOS),
    )


def check_boundable(mission: Mission, who: str) -> None:
    """Refuse, by a ValueError that says who refuses, missions in which robots carry something.

    What is carried from the start may pay although nobody gets to its node, which the relaxation
    would miss.
    """
    paid = {node for node, reward in zip(mission.nodes, mission.rewards, strict=True) if reward}
    carrying = [quoted(kind.name) for kind in mission.kinds if paid & {*kind.aboard}]
    if carrying:
        raise ValueError(
            f"{who} does not support mission {quoted(mission.name)}, in which robots carry "
            f"something from the start: those of kind {', '.join(carrying)}."
        )


def relaxed_to_plain(mission: Mission, limits: Limits) -> Mission:
    """Return a plain mission with limits that allow as much as a mission that is not plain.

    Each plan of the mission is one of the relaxation's, with at least its E[R] and its E[S]. An arc
    is as safe as for the kind that survives it best, and limits are the loosest of any kind. A
    reward counts on arrival, and wholly if any kind has a share in it. Where kinds start or end
    elsewhere than at the base, there is one start for all, with a safe arc of length 0 to each
    start, and one back from each end: a robot that stays where it starts goes there and back.
    """
    kinds, base = mission.kinds, mission.base
    graph: nx.DiGraph[Any] = nx.DiGraph(name=mission.name)
    for node, said in mission.graph.nodes(data=True):
        is_collected = max(by_kind(said.get("share", 1.0), kinds)) > 0.0
        graph.add_node(node, reward=said["reward"] if is_collected else 0.0)
    for tail, head, said in mission.graph.edges(data=True):
        if (survival := max(by_kind(said["survival"], kinds))) > 0.0:
            graph.add_edge(tail, head, survival=survival, length=said.get("length", 1.0))
    ends = [kind.ends(base) for kind in kinds]
    if any(pair != (base, base) for pair in ends):
        base = object()  # which is no label of the mission
        graph.add_node(base, reward=0.0)
        for start, end in ends:
            graph.add_edge(base, start, survival=1.0, length=0.0)
            graph.add_edge(end, base, survival=1.0, length=0.0)
    # Kinds need not get everywhere, a plain team has to.
    used = {base, *(nx.descendants(graph, base) & nx.ancestors(graph, base))}
    graph.remove_nodes_from([node for node in graph if node not in used])
    least, longest = float(limits.floors.min()), float(limits.budgets.max())
    budget = None if longest == math.inf else longest
    kind = Kind(ONLY_KIND, mission.robots, min_survival=least, max_length=budget)
    return Mission(graph, base=base, kinds=[kind])
