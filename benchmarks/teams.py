"""What it costs to plan as if robots were alike, or as if rewards counted on arrival.

Plans made for the simpler mission are evaluated in the true one: where there are kinds, with every
assignment of their trails to the robots, of which those are left out that a robot cannot take.
"""

import math
from collections.abc import Iterator
from functools import cache
from itertools import groupby, permutations
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import moocore
import networkx as nx
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from botohe_moo import (
    Kind,
    Mission,
    ParetoLocalSearch,
    Solution,
    TrailPlan,
    area_indicator,
    load_mission,
    plot_front,
    solve,
)
from botohe_moo.plots import save_figure, theme

EVALUATIONS = 300_000
# With fewer, chance decides by a point or two: of plans with the same objectives a search keeps one
# that it finds, and what they are worth truly differs.
SEEDS = 20
MISSIONS: dict[str, dict[str, Any]] = {"art_museum": {}, "terrain": {"nodes": 60, "seed": 3}}
RETURN, SENSORS, SCOUT = "collect on return", "sensors A, B and both", "scout, no stairs, frail"
# Gains in per cent that are wanted, case by case; nan where none is.
WANTED = {"art_museum": (13.5, 8.0, 3.8, math.nan), "terrain": (12.8, 13.6, 5.6, math.nan)}
DPI = 100

Values = NDArray[np.float64]
_Kinds = dict[str, tuple[Values, Values]]  # name: survival of each arc, share of each node


class _Case(NamedTuple):
    scenario: str
    mission: Mission
    planned_as: str
    ignoring: Mission  # for which plans are made
    plain: Mission


def run(out: Path) -> bool:
    """Print and keep gains, and fronts of the first seed; tell whether gains are as wanted."""
    table = measured(EVALUATIONS, SEEDS)
    table.to_csv(out / "teams.csv", index=False)
    _plot(out / "teams.png")
    # A gain that may be below what is wanted by chance is enough.
    most = table["gain_percent"] + 2 * table["standard_error"]
    return not (most < table["gain_wanted"]).any()


def measured(evaluations: int, n_seeds: int) -> pd.DataFrame:
    """Measure every case, and print the table."""
    rows = []
    for name in MISSIONS:
        for case, wanted in zip(_cases(name), WANTED[name], strict=True):
            for mission in (case.plain, case.ignoring, case.mission):
                _search(mission, 300, 1)  # compiles
            rows.append({"mission": name, **_measure(case, wanted, evaluations, n_seeds)})
    rounded = {"area": 5, "area_ignoring": 5, "gain_percent": 2, "standard_error": 2, "slower": 2}
    table = pd.DataFrame(rows).round({**rounded, "seconds": 2, "seconds_plain": 2})
    print(f"ParetoLocalSearch(), {evaluations} evaluations, seeds 1 to {n_seeds}; one thread")
    print(table.to_string(index=False))
    return table


def _cases(name: str) -> Iterator[_Case]:
    """Give what is planned truly, and as if it were simpler."""
    mission = load_mission(name, **MISSIONS[name])
    on_return = Mission(mission.graph, base=mission.base, robots=mission.robots, pays="return")
    yield _Case(RETURN, on_return, "on arrival", mission, mission)

    nodes, plain = mission.graph.nodes, mission.with_robots(3)
    survival = np.array([mission.graph.edges[arc]["survival"] for arc in _arcs(mission)])
    if name == "art_museum":
        arcs = [(nodes[tail]["zone"], nodes[head]["zone"]) for tail, head in _arcs(mission)]
        stairs = np.array([tail != head for tail, head in arcs])
    else:
        stairs = np.random.default_rng(5).random(len(survival)) < 0.1
    is_a = np.random.default_rng(7).random(len(nodes)) < 0.5
    everything = np.ones(len(nodes))
    sensors = {"A": (survival, 1.0 * is_a), "B": (survival, 1.0 * ~is_a)}
    sensors["both"] = survival**2, everything
    yield _Case(SENSORS, _team(mission, sensors), "alike", _alike(mission, sensors), plain)

    abilities = {
        "scout": (survival**0.5, 0.5 * everything),
        "wheeled": (np.where(stairs, 0.0, survival), everything),
        "frail": (survival**1.5, everything),
    }
    team, closed = _team(mission, abilities), _alike(mission, abilities)
    yield _Case(SCOUT, team, "alike, stairs closed", closed, plain)
    yield _Case(SCOUT, team, "alike, stairs open", _alike(mission, abilities, are_open=True), plain)


def _arcs(mission: Mission) -> list[tuple[Any, Any]]:
    return sorted(mission.graph.edges, key=lambda arc: tuple(map(mission.index, arc)))


def _team(mission: Mission, kinds: _Kinds, robots: int = 1) -> Mission:
    """Make the mission for that number of robots of each kind, without what none can reach."""
    graph = mission.graph.copy()
    for i, arc in enumerate(_arcs(mission)):
        graph.edges[arc]["survival"] = {name: float(of[i]) for name, (of, _) in kinds.items()}
        if not any(graph.edges[arc]["survival"].values()):
            graph.remove_edge(*arc)
    for i, node in enumerate(mission.nodes):
        graph.nodes[node]["share"] = {name: float(of[i]) for name, (_, of) in kinds.items()}
    there, back = nx.descendants(graph, mission.base), nx.ancestors(graph, mission.base)
    graph = graph.subgraph((there & back) | {mission.base})
    return Mission(graph, base=mission.base, kinds=[Kind(name, robots) for name in kinds])


def _alike(mission: Mission, kinds: _Kinds, *, are_open: bool = False) -> Mission:
    """Make the mission for robots of the mean kind: geometric mean of survivals, mean share.

    An arc that a kind cannot take is left out; if ``are_open``, its survival is the mean of the
    other kinds.
    """
    survivals = np.array([survival for survival, _ in kinds.values()])
    n_averaged = (survivals > 0).sum(axis=0) if are_open else len(kinds)
    if are_open:
        survivals = np.where(survivals > 0, survivals, 1.0)
    mean = survivals.prod(axis=0) ** (1 / n_averaged)
    share = np.mean([share for _, share in kinds.values()], axis=0)
    return _team(mission, {"robot": (mean, share)}, len(kinds))


@cache
def _search(mission: Mission, evaluations: int, seed: int) -> Solution:
    return solve(mission, ParetoLocalSearch(), evaluations=evaluations, seed=seed)


def _measure(case: _Case, wanted: float, evaluations: int, n_seeds: int) -> dict[str, Any]:
    seeds = range(1, n_seeds + 1)
    true, ignoring, plain = (
        [_search(mission, evaluations, seed) for seed in seeds]
        for mission in (case.mission, case.ignoring, case.plain)
    )
    areas = np.array([area_indicator(one.objectives, case.mission) for one in true])
    assigned = [_assigned(one, case.mission) for one in ignoring]
    others = np.array([area_indicator(objectives, case.mission) for objectives in assigned])
    seconds, seconds_plain = (np.median([one.seconds for one in of]) for of in (true, plain))
    return {
        "scenario": case.scenario,
        "planned_as": case.planned_as,
        "area": areas.mean(),
        "area_ignoring": others.mean(),
        "gain_percent": 100 * (areas.mean() / others.mean() - 1),
        "standard_error": 100 * np.std(areas / others, ddof=1) / math.sqrt(n_seeds),
        "gain_wanted": wanted,
        "plans": int(np.mean([len(one.plans) for one in true])),
        "plans_ignoring": int(np.mean([len(one.plans) for one in ignoring])),
        "seconds": seconds,
        "seconds_plain": seconds_plain,
        "slower": seconds / seconds_plain,
    }


def _assigned(solution: Solution, mission: Mission) -> Values:
    """Evaluate plans in another mission, with all valid assignments of trails to its robots."""
    robots, n_nodes = mission.robots, len(mission.nodes)
    listed = list(map(solution.mission.labels, solution.plans))
    plans = [[[mission.index(node) for node in trail] for trail in plan] for plan in listed]
    several = len(mission.kinds) > 1  # of one robot each
    drafts = [
        TrailPlan([[v + several * k * n_nodes for v in plan[r]] for k, r in enumerate(order)])
        for order in (permutations(range(robots)) if several else [range(robots)])
        for plan in plans
    ]
    objectives, faults = mission.evaluate_drafts(drafts)
    return objectives[faults == 0]


def _plot(path: Path) -> None:
    with theme():
        fig, panels = plt.subplots(len(MISSIONS), 3, figsize=(15, 8.4), layout="constrained")
    for row, name in zip(panels, MISSIONS, strict=True):
        grouped = groupby(_cases(name), attrgetter("scenario"))
        for ax, (scenario, cases) in zip(row, grouped, strict=True):
            drawn = list(cases)
            mission, title = drawn[0].mission, f"{name}: {scenario}"
            found = _search(mission, EVALUATIONS, 1).objectives
            plot_front(found, mission, label="as it is", title=title, ax=ax)
            for case in drawn:
                values = _assigned(_search(case.ignoring, EVALUATIONS, 1), mission)
                best = values[moocore.is_nondominated(values, maximise=True)]
                plot_front(best, mission, label=case.planned_as, title=title, ax=ax)
            ax.legend(loc="upper right", fontsize="small")
    save_figure(fig, path, dpi=DPI)
    plt.close(fig)
    print(path)
