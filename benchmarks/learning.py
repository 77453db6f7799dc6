"""What learning survivals from missions flown is worth, by docs/survivals.md.

The table has a row for each mission, classes of arcs (arcs of like survival, or each arc alone),
place of loss (known or unknown), policy (plans for the means of the survivals, or for a draw of
them, which is Thompson sampling), and number of missions flown. ``area`` is that of the front that
is planned for the means then, by the true survivals; ``area_true`` that of the front planned for
these. ``shortfall`` is by how much the plans flown so far were worth less than the best one, as
reward a mission, where a survivor has its price. Means over ten seeds, with standard errors.
"""

import re
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import redirect_stdout
from functools import cache
from itertools import pairwise, product
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd

from botohe_moo import Mission, Solution, TrailPlan, area_indicator, load_mission, solve

Counts = dict[Any, tuple[float, float]]  # Beta(a, b) of the survival of each class
# Of each trail: the arcs that its robot survived, and the arcs of which one was its end.
Log = list[tuple[list[Any], list[Any]]]
PAGE = Path(__file__).parents[1] / "docs" / "survivals.md"
# Missions with their parameters, and what a survivor is worth there, as reward.
SITES: dict[str, tuple[dict[str, Any], float]] = {
    "art_museum": ({}, 2.0),
    "terrain": ({"nodes": 60, "seed": 3}, 4.0),
}
CLASSES, PLACES = ("like survival", "single arcs"), ("known", "unknown")
POLICIES = ("mean", "Thompson")
BANDS = 8  # of equal size, if there are more survivals than that
STRENGTH = 10.0  # of the prior; its mean is that of all arcs
FLOWN = (0, 20, 40)
SEEDS = range(1, 11)
CASE = ["mission", "classes", "place", "policy"]
COLUMNS = ["flown", "area", "area_se", "area_true", "shortfall", "shortfall_se"]


def run(out: Path) -> bool:
    """Print and write the table; tell whether learning classes has made all fronts better."""
    cases = list(product(SITES, CLASSES, PLACES, POLICIES))
    with ProcessPoolExecutor(2) as pool:
        jobs = [pool.submit(_learning, *case, seed) for case in cases for seed in SEEDS]
        runs = pd.DataFrame([row for job in jobs for row in job.result()])
    grouped = runs.groupby([*CASE, "flown"], sort=False)
    table = grouped[["area", "area_true", "shortfall"]].mean()
    errors = grouped[["area", "shortfall"]].sem().add_suffix("_se")
    table = table.join(errors).round(4).reset_index()[[*CASE, *COLUMNS]]
    print(table.to_string(index=False))
    table.to_csv(out / "learning.csv", index=False)
    of_classes = table[table["classes"] == CLASSES[0]]
    first, last = (of_classes[of_classes["flown"] == n]["area"] for n in (0, max(FLOWN)))
    return bool((last.to_numpy() > first.to_numpy()).all())


def _learning(
    name: str, classes: str, place: str, policy: str, seed: int
) -> list[dict[str, object]]:
    """Fly missions, and give what the log was worth after some of them."""
    learn = _learn()
    parameters, price = SITES[name]
    mission = load_mission(name, **parameters)
    class_of, prior = _classes(mission, classes)
    rng = np.random.default_rng(seed)
    how = {"pick": rng.beta} if policy == "Thompson" else {}
    log: Log = []
    plans = []
    for _ in range(max(FLOWN)):
        front = _plan_with(mission, class_of, learn(log, class_of, prior), **how)
        plans.append(front.plans[np.argmax(front.objectives @ [1, price])])
        log += _fly(mission, plans[-1], rng, place == "known")
    best, area_true = _best(name)
    shortfalls = best - mission.evaluate(plans) @ [1, price]
    rows = []
    for flown in FLOWN:
        counts = learn(log[: flown * mission.robots], class_of, prior)
        front = _plan_with(mission, class_of, counts)
        area = area_indicator(mission.evaluate(front.plans), mission)
        row = dict(zip(CASE, (name, classes, place, policy), strict=True))
        shortfall = shortfalls[:flown].mean() if flown else np.nan
        measured = {"area": area, "area_true": area_true, "shortfall": shortfall}
        rows.append({**row, "flown": flown, **measured})
    return rows


@cache
def _learn() -> Callable[..., Counts]:
    """Return the function of the page."""
    blocks = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text("utf-8"), re.M | re.S)
    [code] = [block for block in blocks if "def learn(" in block]
    names: dict[str, Any] = {}
    with redirect_stdout(None):  # of its example
        exec(compile(code, PAGE.name, "exec"), names)
    return cast(Callable[..., Counts], names["learn"])


def _fly(
    mission: Mission, plan: TrailPlan, rng: np.random.Generator, known: bool
) -> Iterator[tuple[list[Any], list[Any]]]:
    """Yield the arcs that each robot survived, and the arcs of which one was its end."""
    for trail in mission.labels(plan):
        arcs = list(pairwise(trail))
        survival = [mission.graph.edges[arc]["survival"] for arc in arcs]
        at = int(np.append(rng.random(len(arcs)) >= survival, True).argmax())
        is_clear = known or at == len(arcs)
        yield (arcs[:at], arcs[at : at + 1]) if is_clear else ([], arcs)


def _plan_with(
    mission: Mission,
    classes: dict[Any, Any],
    counts: Counts,
    pick: Callable[[float, float], float] = lambda a, b: a / (a + b),
) -> Solution:
    """Return the front if each class has the survival that is picked for it."""
    survival = {name: pick(a, b) for name, (a, b) in counts.items()}
    graph, kinds = mission.graph.copy(), mission.kinds
    for arc, name in classes.items():
        graph.edges[arc]["survival"] = survival[name]
    other = Mission(graph, base=mission.base, kinds=kinds, pays=mission.pays)
    return solve(other, evaluations=20_000)


def _classes(mission: Mission, classes: str) -> tuple[dict[Any, Any], tuple[float, float]]:
    """Return the class of each arc, and the prior of each class."""
    arcs = list(mission.graph.edges)
    survival = np.array([mission.graph.edges[arc]["survival"] for arc in arcs])
    limits = np.unique(survival)
    if len(limits) > BANDS:
        limits = np.quantile(survival, np.arange(1, BANDS) / BANDS)
    names = arcs if classes == "single arcs" else np.searchsorted(limits, survival).tolist()
    mean = float(survival.mean())
    return dict(zip(arcs, names, strict=True)), (STRENGTH * mean, STRENGTH * (1 - mean))


@cache
def _best(name: str) -> tuple[float, float]:
    """Return what the best plan is worth, and the area of a front that takes as long to find."""
    parameters, price = SITES[name]
    mission = load_mission(name, **parameters)
    values = solve(mission, evaluations=300_000, n_islands=1).objectives @ [1, price]
    front = solve(mission, evaluations=20_000, n_islands=1)
    return float(values.max()), area_indicator(front.objectives, mission)
