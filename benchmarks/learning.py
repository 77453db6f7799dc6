"""What learning survivals from missions flown is worth, by the recipe of docs/under-way.md.

The table has a row for each mission, classes of arcs (arcs of like survival, or each arc alone),
place of loss (known or unknown), policy (plans for the means of the survivals, or for a draw of
them, which is Thompson sampling), and number of missions flown. ``area`` is that of the front that
is planned for the means then, by the true survivals; ``area_true`` that of the front planned for
these. ``shortfall`` is by how much the plans flown so far were worth less than the best one, as
reward a mission, where a survivor has its price. Means over ten seeds, with standard errors.
"""

import re
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from botohe_moo import Mission, area_indicator, load_mission, solve

PAGE = Path(__file__).parents[1] / "docs" / "under-way.md"
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
    recipe = _recipe()
    parameters, price = SITES[name]
    mission = load_mission(name, **parameters)
    class_of, prior = _classes(mission, classes)
    rng = np.random.default_rng(seed)
    how = {"pick": rng.beta} if policy == "Thompson" else {}
    log, plans = recipe["fly_missions"](
        mission, class_of, prior, max(FLOWN), price, place == "known", rng, **how
    )
    best, area_true = _best(name)
    shortfalls = best - mission.evaluate(plans) @ [1, price]
    rows = []
    for flown in FLOWN:
        counts = recipe["learn"](log[: flown * mission.robots], class_of, prior)
        front = recipe["plan_with"](mission, class_of, counts)
        area = area_indicator(mission.evaluate(front.plans), mission)
        row = dict(zip(CASE, (name, classes, place, policy), strict=True))
        shortfall = shortfalls[:flown].mean() if flown else np.nan
        measured = {"area": area, "area_true": area_true, "shortfall": shortfall}
        rows.append({**row, "flown": flown, **measured})
    return rows


@cache
def _recipe() -> dict[str, Any]:
    """Return the functions of the page."""
    blocks = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text("utf-8"), re.M | re.S)
    [code] = [block for block in blocks if "def learn(" in block]
    names: dict[str, Any] = {}
    exec(compile(code, PAGE.name, "exec"), names)
    return names


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
