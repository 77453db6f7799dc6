"""What each operator and each repair brings to NSGA-II, and what each costs."""

import functools
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pymoo.core.population import Population
from pymoo.optimize import minimize

from benchmarks.measure import best
from botohe_moo import BOACO, BOTOHE, area_indicator, load_mission, make_algorithm
from botohe_moo.algorithms import (
    CornerSampling,
    GuidedTrailSampling,
    PlanSampling,
    RandomTrailSampling,
)
from botohe_moo.algorithms.archive import PlanArchive
from botohe_moo.algorithms.base import PopulationArchive
from botohe_moo.operators import (
    PlanCrossover,
    PlanDuplicates,
    PlanMutation,
    RuinRecreate,
    SafestPathRepair,
    ShareTrails,
    TrailSplice,
    TruncateRepair,
)

MISSIONS = ("art_museum", "power_plant")
SEEDS = range(1, 11)
BUDGETS = (10_000, 100_000)
REPETITIONS = 7

# Published for 100 000 evaluations of the museum (the paper's journal version, four runs).
PUBLISHED = {"without heuristic": 0.4859, "without pheromone": 0.4977}
PUBLISHED_BOACO = 0.5245


VARIANTS: dict[str, dict[str, Any]] = {
    "default": {},
    "sampling: random": {"sampling": "random"},
    "sampling: guided and random": {"sampling": {"guided": 1, "random": 1}},
    "sampling: no corners": {"corners": False},
    "sampling: random, no corners": {"sampling": "random", "corners": False},
    "crossover: none": {"crossover": {}},
    "mutation: no ruin": {"mutation": "share"},
    "mutation: no share": {"mutation": "ruin"},
    "mutation: none": {"prob_mutation": 0.0},
    "mutation: always": {"prob_mutation": 1.0},
    "repair: truncate": {"repair": "truncate"},
    "repair: penalty": {"repair": "penalty"},
}


BOACO_JOURNAL = "BO-ACO, journal settings"


def area(job: tuple[str, str, int, int]) -> dict[str, object]:
    """Run one variant for a budget; give its area."""
    variant, name, budget, seed = job
    mission = load_mission(name)
    journal = variant == BOACO_JOURNAL
    algorithm = BOACO.journal() if journal else make_algorithm("nsga2", **VARIANTS[variant])
    result = minimize(BOTOHE(mission), algorithm, ("n_eval", budget), seed=seed)
    return {
        "variant": variant,
        "mission": name,
        "evaluations": result.algorithm.evaluator.n_eval,
        "seed": seed,
        "area": area_indicator(-result.F, mission),
    }


def run(out: Path) -> bool:
    """Print and keep the ablation and the costs; tell whether NSGA-II does what is asked of it."""
    costs = _costs()
    print(costs.to_string(index=False))
    costs.to_csv(out / "costs.csv", index=False)
    cheap = _generation(out)

    jobs = [
        (variant, name, budget, seed)
        for variant in (*VARIANTS, BOACO_JOURNAL)
        for name in MISSIONS
        for budget in BUDGETS
        for seed in SEEDS
    ]
    with ProcessPoolExecutor(2) as pool:
        table = ablation(pd.DataFrame(pool.map(area, jobs)))
    print(f"\narea over {len(SEEDS)} seeds\n{table.to_string()}")
    table.to_csv(out / "ablation.csv")

    ours = table.loc["default", f"art_museum, {max(BUDGETS):,}"]
    print(f"\nNSGA-II on the museum at {max(BUDGETS):,}: {ours:.4f}; published: {PUBLISHED}")
    print(f"BO-ACO's own {PUBLISHED_BOACO} passed: {ours > PUBLISHED_BOACO}")
    return bool(cheap and ours > max(PUBLISHED.values()))


def ablation(runs: pd.DataFrame) -> pd.DataFrame:
    """Give mean and standard deviation of the area of each variant, mission and budget."""
    columns = {}
    for (name, budget), group in runs.groupby(["mission", "evaluations"]):
        areas = group.groupby("variant", sort=False)["area"]
        columns[f"{name}, {budget:,}"] = areas.mean().round(4)
        columns[f"sd {name}, {budget:,}"] = areas.std().round(4)
    table = pd.DataFrame(columns)
    assert not table.isna().any(axis=None), "a run has not spent its budget"
    return table


def _costs() -> pd.DataFrame:
    """Give µs a plan of every operator, on 100 plans that NSGA-II has evolved."""
    columns = {name: _mission_costs(name) for name in (*MISSIONS, "terrain_200")}
    return pd.DataFrame(columns).round(2).rename_axis("µs a plan").reset_index()


def _mission_costs(name: str) -> dict[str, float]:
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
    return best(times) * 1e6


@contextmanager
def _timed(owner: type, method: str, seconds: dict[str, float], key: str) -> Iterator[None]:
    usual = getattr(owner, method)

    def call(*args: Any, **kwargs: Any) -> Any:
        started = time.perf_counter()
        try:
            return usual(*args, **kwargs)
        finally:
            seconds[key] += time.perf_counter() - started

    setattr(owner, method, call)
    try:
        yield
    finally:
        setattr(owner, method, usual)


def _generation(out: Path) -> bool:
    """Time what repair and variation take of a generation of 100, and what pymoo takes."""
    rows = []
    for name in (*MISSIONS, "terrain_200"):
        problem = BOTOHE(load_mission(name))
        minimize(problem, make_algorithm("nsga2"), ("n_gen", 3), seed=1)
        ours = {
            "variation": [(PlanCrossover, "_do"), (PlanMutation, "_do")],
            "sampling": [(PlanSampling, "_do")],
            "evaluation": [(BOTOHE, "_evaluate")],
            "duplicates": [(PlanDuplicates, "do")],
            "archive": [(PlanArchive, "_insert"), (PopulationArchive, "population")],
        }
        seconds = dict.fromkeys(ours, 0.0)
        n_generations = 300
        with ExitStack() as stack:
            for key, methods in ours.items():
                for owner, method in methods:
                    stack.enter_context(_timed(owner, method, seconds, key))
            started = time.perf_counter()
            result = minimize(problem, make_algorithm("nsga2"), ("n_gen", n_generations), seed=1)
            total = time.perf_counter() - started
        counts = result.algorithm.repair.counts
        rest = total - sum(seconds.values())
        row = {"mission": name, "generation, ms": total}
        row |= {f"{key}, ms": value for key, value in seconds.items()}
        row |= {"pymoo, ms": rest, "repair alone, ms": counts.seconds}
        rows.append({k: v if k == "mission" else v / n_generations * 1e3 for k, v in row.items()})
        rows[-1]["variation / pymoo"] = seconds["variation"] / rest
    table = pd.DataFrame(rows).round(3)
    print(f"\na generation of 100, in one run\n{table.to_string(index=False)}")
    table.to_csv(out / "generation.csv", index=False)
    # On 200 nodes trails are long, and Dijkstra's algorithm looks at hundreds of arcs for a gap.
    ratios = table.set_index("mission")["variation / pymoo"]
    cheap = bool((ratios[list(MISSIONS)] < 1).all())
    print(f"repair and variation cost less than pymoo's own on {' and '.join(MISSIONS)}: {cheap}")
    return cheap
