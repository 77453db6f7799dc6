"""What operators and repairs of NSGA-II cost; experiments/operators.yaml says what they bring."""

import functools
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pymoo.core.population import Population
from pymoo.optimize import minimize

from botohe_moo import BOTOHE, load_mission, make_algorithm
from botohe_moo.algorithms import CornerSampling, GuidedTrailSampling, RandomTrailSampling
from botohe_moo.operators import (
    PlanDuplicates,
    RuinRecreate,
    SafestPathRepair,
    ShareTrails,
    TrailSplice,
    TruncateRepair,
)

MISSIONS = ("art_museum", "power_plant", "terrain_200")
REPETITIONS = 7


def run(out: Path) -> bool:
    """Write µs a plan of every operator, on 100 plans that NSGA-II has evolved."""
    columns = {name: _costs(name) for name in MISSIONS}
    table = pd.DataFrame(columns).round(2).rename_axis("µs a plan").reset_index()
    print(table.to_string(index=False))
    table.to_csv(out / "costs.csv", index=False)
    return True


def _costs(name: str) -> dict[str, float]:
    mission = load_mission(name)
    problem, rng = BOTOHE(mission), np.random.default_rng(1)
    X = minimize(problem, make_algorithm("nsga2"), ("n_eval", 5_000), seed=1).pop.get("X")
    pairs = X.reshape(2, 50, 1)
    drafts = RuinRecreate()._draft(mission, mission.batch(X), rng)
    corners = CornerSampling()
    costs = {"corners (two plans)": _micros(lambda: corners.sample_batch(problem, 2, rng)) / 2}
    for sampling in (RandomTrailSampling(), GuidedTrailSampling()):
        call = functools.partial(sampling.sample_batch, problem, 100, rng)
        costs[type(sampling).__name__] = _micros(call) / 100
    for operator, given in ((TrailSplice(), pairs), (RuinRecreate(), X), (ShareTrails(), X)):
        call = functools.partial(operator._do, problem, given, random_state=rng)
        costs[f"{type(operator).__name__}, repaired"] = _micros(call) / 100
    for repair in (SafestPathRepair(), TruncateRepair()):
        call = functools.partial(repair.repair_batch, mission, drafts)
        costs[f"{type(repair).__name__} alone, of ruined plans"] = _micros(call) / 100
    population = Population.new(X=X)
    costs["PlanDuplicates"] = _micros(lambda: PlanDuplicates().do(population)) / 100
    return costs


def _micros(call: Callable[[], Any]) -> float:
    call()
    times = []
    for _ in range(REPETITIONS):
        started = time.perf_counter()
        call()
        times.append(time.perf_counter() - started)
    return min(times) * 1e6
