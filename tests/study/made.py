"""Studies made of given or random fronts, with valid tables, for tests of what reads them."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass, field
from itertools import combinations

import numpy as np

from botohe_moo.indicators import INDICATORS, area_indicator
from botohe_moo.mission.loading import save_mission
from botohe_moo.mission.model import mission_digest
from botohe_moo.objectives import Objectives
from botohe_moo.study.scores import (
    algorithm_table,
    bound_table,
    mission_table,
    points_by_mission,
    reach_targets,
    reference_fronts,
    score_runs,
    summarise,
)
from botohe_moo.study.statistics import compare_ranks, rank_algorithms
from botohe_moo.study.tables import as_table, read_study, write_tables

ENVIRONMENT = {
    "environment": "e1",
    "botohe_moo": "0.1.0",
    "commit": None,
    "python": "3.12.1",
    "packages": "numpy==2.4.0 pymoo==0.6.2",
    "system": "Linux",
    "machine": "made",
    "processor": "none",
    "n_cpus": 2,
    "threads": "OMP_NUM_THREADS=1",
}


@dataclass
class Record:
    """One run: its fronts as (evaluations, seconds, points), the last one final."""

    mission: str
    algorithm: str
    seed: int
    fronts: list = field(default_factory=list)
    status: str = "done"
    error: str | None = None

    @property
    def run(self):
        return hashlib.sha256(repr((self.mission, self.algorithm, self.seed)).encode()).hexdigest()

    @property
    def key(self):
        return {
            "run": self.run,
            "mission": self.mission,
            "algorithm": self.algorithm,
            "seed": self.seed,
        }

    @property
    def front(self):
        return self.fronts[-1][2] if self.fronts else np.empty((0, 2))


def random_record(
    rng, label, mission, algorithm, seed, *, strength=0.5, n_records=25, until=10_000
):
    """A run whose fronts grow towards ``strength`` of what the mission offers."""
    ends = np.unique(np.geomspace(max(1, until // 1000), until, n_records).astype(int))
    own = strength * rng.uniform(0.93, 1.05)
    fronts = []
    angles = np.sort(rng.uniform(0.03, 1.54, 14))
    wobble = rng.uniform(0.95, 1.0, 14)
    for i, evaluations in enumerate(ends.tolist()):
        reached = own * (0.4 + 0.6 * ((i + 1) / len(ends)) ** (0.5 + seed % 3 / 5)) * wobble
        points = np.column_stack(
            [
                mission.total_reward * np.minimum(1.0, reached * np.cos(angles) ** 0.7),
                mission.robots * np.minimum(1.0, reached * np.sin(angles) ** 0.7),
            ]
        )
        fronts.append((evaluations, evaluations * 2e-4 * rng.uniform(0.9, 1.1), points))
    fronts.sort(key=lambda front: front[0])
    return Record(label, algorithm, seed, fronts)


def study_tables(missions, algorithms, records, *, control=None, bounds=()):
    """The tables of a study; comparisons are placeholders with plausible numbers."""
    labels, fronts = list(algorithms), [record.front for record in records]
    runs = as_table(
        "runs", [_run_row(r, area_indicator(r.front, missions[r.mission])) for r in records]
    )
    references = reference_fronts(runs, fronts, {})
    scores = score_runs(runs, fronts, references, missions=missions, indicators=list(INDICATORS))
    ranks = rank_algorithms(
        scores[scores["indicator"] == "area"],
        algorithms=labels,
        significance=0.05,
        digests={label: label for label in missions},
    )
    trace = [
        {
            **r.key,
            "evaluations": evaluations,
            "seconds": seconds,
            "area": area_indicator(front, missions[r.mission]),
            "front_size": len(front),
            "ties": 0,
            "igd_plus": 0.3 / (i + 1),
            "epsilon": 0.5 / (i + 1),
        }
        for r in records
        for i, (evaluations, seconds, front) in enumerate(r.fronts)
    ]
    points = [
        {**r.key, "evaluations": evaluations, "reward": reward, "survivors": survivors}
        for r in records
        for evaluations, _, front in r.fronts
        for reward, survivors in front.tolist()
    ]
    plans = [
        {**r.key, "plan_id": i, "reward": reward, "survivors": survivors, "trails": "[]"}
        for r in records
        for i, (reward, survivors) in enumerate(sorted(r.front.tolist(), reverse=True))
    ]
    comparisons = [
        row
        for label in missions
        for row in _comparisons(label, runs[runs["mission"] == label], labels, control)
    ]
    trace = as_table("trace", trace)
    found = points_by_mission(references)
    areas = {label: area_indicator(found[label], missions[label]) for label in found}
    return {
        "runs": runs,
        "trace": trace,
        "fronts": as_table("fronts", points),
        "plans": as_table("plans", plans),
        "indicators": scores,
        "references": references,
        "comparisons": as_table("comparisons", comparisons),
        "ranks": ranks,
        "posthoc": compare_ranks(ranks, significance=0.05),
        "summary": summarise(runs, scores, areas, significance=0.05, bounds=dict(bounds)),
        "bounds": bound_table(dict(bounds)),
        "targets": reach_targets(runs, trace, areas),
        "environments": as_table("environments", [ENVIRONMENT]),
    }


def make_study(folder, missions, algorithms, records, *, control=None, bounds=(), **manifest):
    """Write a study's folder, and read it again as ``StudyTables``."""
    (folder / "missions").mkdir(exist_ok=True)
    entries = {}
    for i, (label, mission) in enumerate(missions.items()):
        save_mission(mission, folder / "missions" / f"m{i}.json")
        entries[label] = {
            "file": f"missions/m{i}.json",
            "digest": mission_digest(mission),
            "package": "botohe-moo",
            "version": "0.1.0",
            "source": {"name_or_path": mission.name, "robots": mission.robots},
            "min_survival": 0.0,
            "max_length": None,
            "budget": {"evaluations": 10_000, "seconds": None},
            "family": label,
            "grid": {},
            "objectives": asdict(Objectives.of(mission)),
        }
    content = {
        "name": "made",
        "title": "A made study",
        "description": "Fronts at random.",
        "version": "0.1.0",
        "missions": entries,
        "algorithms": {
            label: {
                "parameters": {},
                "package": "botohe-moo",
                "version": "0.1.0",
                "name": entry["algorithm"],
                "effective": {},
                "family": label,
                **entry,
            }
            for label, entry in algorithms.items()
        },
        "seeds": sorted({r.seed for r in records}),
        "indicators": ["area", "igd_plus", "epsilon", "front_size"],
        "comparison": {"control": control, "significance": 0.05},
        "made_from": "",
        **manifest,
    }
    tables = study_tables(missions, algorithms, records, control=control, bounds=bounds)
    tables["missions"] = mission_table(content, missions, dict(bounds))
    tables["algorithms"] = algorithm_table(content)
    write_tables(folder, tables, content)
    return read_study(folder)


def _run_row(record, area):
    last = record.fronts[-1] if record.fronts else (0, 0.0, None)
    failed = record.status != "done"
    return {
        **record.key,
        "status": record.status,
        "stopped_by": "error" if failed else "evaluations",
        "began": "2026-11-22T04:30:12Z",
        "evaluations": last[0],
        "seconds": last[1],
        "recording_seconds": 0.0,
        "budget_evaluations": 10_000,
        "budget_seconds": None,
        "min_survival": 0.0,
        "area": area,
        "front_size": len(record.front),
        "ties": 0,
        "environment": "e1",
        "error": record.error,
        "traceback": "Traceback: made up" if failed else None,
    }


def _comparisons(mission, runs, labels, control):
    areas = {label: own["area"] for label, own in runs.groupby("algorithm", sort=False)}
    labels = [label for label in labels if label in areas]
    pairs = combinations(labels, 2)
    if control is not None:
        pairs = [(label, control) for label in labels if label != control]
    for label, other in pairs:
        mine, theirs = areas[label].to_numpy(), areas[other].to_numpy()
        a12 = float(((mine[:, None] > theirs) + 0.5 * (mine[:, None] == theirs)).mean())
        verdict = "better, large" if a12 > 0.5 else "worse, large"
        yield {
            "mission": mission,
            "indicator": "area",
            "algorithm": label,
            "other": other,
            "n": len(mine),
            "n_other": len(theirs),
            "median": float(np.median(mine)),
            "median_other": float(np.median(theirs)),
            "p_value": 0.0002,
            "p_holm": 0.0004,
            "a12": a12,
            "a12_low": 0.0,
            "a12_high": 1.0,
            "significant": abs(a12 - 0.5) > 0.2,
            "verdict": verdict if abs(a12 - 0.5) > 0.2 else "no difference found",
        }
