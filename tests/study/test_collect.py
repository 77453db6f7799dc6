"""From the files of runs to tables: what is kept, and what is counted."""

import json
from dataclasses import replace

import networkx as nx
import numpy as np
import pandas as pd
import pytest

from botohe_moo.algorithms.archive import PlanArchive
from botohe_moo.mission import Mission
from botohe_moo.study import read_study
from botohe_moo.study.folder import StudyFolder
from botohe_moo.study.loading import load_study
from botohe_moo.study.perform import Outcome, Record, Recorder
from botohe_moo.study.pool import environment
from botohe_moo.study.scores import collect_tables
from botohe_moo.trails import PlanBatch

STUDY = {
    "name": "counted",
    "missions": {"toy": "toy", "towns": {"mission": "two_communities", "grid": {"seed": [1, 2]}}},
    "algorithms": {
        "random": "random",
        "ants": {"algorithm": "bo-aco", "grid": {"n_ants": [5, 10], "evaporation": [0.1, 0.2]}},
    },
    "budget": {"evaluations": 100},
    "seeds": 2,
}


def outcome_of(run, *fronts, ties=0):
    """A run with these fronts, in shares of what its mission offers; the last with tied plans."""
    mission = run.mission.mission
    whole = np.array([mission.total_reward, mission.robots])
    records = [
        Record(10 * (i + 1), 0.5 * (i + 1), np.array(front) * whole, 0)
        for i, front in enumerate(fronts)
    ]
    if records:
        points = records[-1].objectives
        objectives = np.concatenate([points, np.repeat(points[-1:], ties, axis=0)])
        plans = [mission.plan([[mission.base]] * mission.robots)] * len(objectives)
        batch = PlanBatch.from_plans(plans, mission.robots)
        records[-1] = replace(records[-1], ties=ties, plans=(batch, objectives))
    return Outcome(
        status="done" if records else "infeasible",
        stopped_by="evaluations",
        evaluations=10 * len(fronts),
        seconds=0.5 * len(fronts),
        recording_seconds=0.0,
        records=tuple(records),
        environment=environment(),
        began="2026-11-22T04:30:12Z" if records else None,
    )


@pytest.fixture(scope="module")
def study():
    return load_study(STUDY)


@pytest.fixture(scope="module")
def kept(study, tmp_path_factory):
    """Runs of seed 1 improve twice, those of seed 2 not at all; random nothing on toy."""
    store = StudyFolder(tmp_path_factory.mktemp("counted") / "study")
    with store.locked(study):
        store.write_study(study)
        for run in study.runs():
            first, second = [(0.4, 0.4)], [(0.6, 0.5), (0.5, 0.6)]
            if run.seed == 2:
                second = first
            fronts = [first, second, second]
            if run.mission.label == "toy" and run.algorithm.label == "random":
                fronts = []
            store.save(run, outcome_of(run, *fronts, ties=3 if fronts else 0))
        collect_tables(study, store)
    return read_study(store.path)


class TestFrontSize:
    def test_points_are_counted_and_ties_apart(self, kept):
        last = kept.trace.groupby("run").last()
        runs = kept.runs.set_index("run")
        for column in ("front_size", "ties"):
            assert (last[column] == runs.loc[last.index, column]).all()
        found = runs[runs["status"] == "done"]
        assert set(found["ties"]) == {3}
        assert dict(found.groupby("seed")["front_size"].unique().map(list)) == {1: [2], 2: [1]}
        n_plans = kept.plans.groupby("run").size()
        assert (n_plans == (found["front_size"] + found["ties"])[n_plans.index]).all()
        sizes = kept.indicators[kept.indicators["indicator"] == "front_size"].set_index("run")
        assert (sizes["value"] == runs["front_size"][sizes.index]).all()

    def test_a_recorder_counts_points_and_ties(self, study):
        """Two rocks that are alike: each of them alone is worth the same, both are worth more."""
        graph = nx.DiGraph()
        graph.add_node("dock", reward=0)
        for rock in ("a", "b"):
            graph.add_node(rock, reward=1)
            graph.add_edge("dock", rock, survival=0.9)
            graph.add_edge(rock, "dock", survival=0.9)
        mission = Mission(graph, base="dock", robots=1)
        trails = [["dock"], ["dock", "a", "dock"], ["dock", "b", "dock"]]
        plans = [mission.plan([trail]) for trail in trails]
        archive = PlanArchive(1)
        archive.insert(PlanBatch.from_plans(plans, 1), mission.evaluate(plans))
        records = []
        Recorder(study.runs()[0], lambda: archive, records.append).record(3, 0.1, with_plans=True)
        [record] = records
        assert (len(record.plans[0]), record.front_size, record.ties) == (3, 2, 1)


class TestTrace:
    def test_its_last_record_is_worth_what_the_run_is(self, kept):
        values = kept.indicators.set_index(["run", "indicator"])["value"]
        last = kept.trace.groupby("run").last()
        for name in ("area", "igd_plus", "epsilon"):
            found = last[name].to_numpy(float)
            assert np.allclose(found, values[[(run, name) for run in last.index]], atol=1e-11)

    def test_fronts_get_better_by_what_is_measured(self, kept):
        rows = kept.trace[(kept.trace["mission"] == "toy") & (kept.trace["seed"] == 1)].head(3)
        area = 0.6 * 0.5 + 0.5 * 0.1
        assert np.allclose(rows["area"], [0.16, area, area])
        # Of two points: how far (0.6, 0.5) and (0.5, 0.6) are ahead of (0.4, 0.4).
        assert np.allclose(rows["igd_plus"], [np.hypot(0.2, 0.1), 0, 0])
        assert np.allclose(rows["epsilon"], [0.2, 0, 0])

    def test_what_the_study_does_not_compute_is_missing(self, tmp_path):
        study = load_study({**STUDY, "indicators": ["area", "epsilon"]})
        store = StudyFolder(tmp_path / "study")
        with store.locked(study):
            store.write_study(study)
            run = study.runs()[0]
            store.save(run, outcome_of(run, [(0.4, 0.4)]))
            collect_tables(study, store)
        trace = read_study(store.path).trace
        assert trace["igd_plus"].isna().all()
        assert list(trace["epsilon"]) == [0.0]

    def test_runs_without_a_front_have_no_rows(self, kept):
        nothing = kept.runs[kept.runs["status"] == "infeasible"]
        assert len(nothing) == 2
        assert (nothing["area"] == 0).all()
        assert not set(nothing["run"]) & (set(kept.trace["run"]) | set(kept.plans["run"]))
        assert nothing["began"].isna().all()


class TestEntries:
    def test_parameters_are_columns(self, kept):
        table = kept.algorithms.set_index("algorithm")
        assert list(table) == ["name", "family", "package", "version", "n_ants", "evaporation"]
        ants = table[table["family"] == "ants"]
        assert list(ants["n_ants"]) == [5, 5, 10, 10]
        assert list(ants["evaporation"]) == [0.1, 0.2, 0.1, 0.2]
        # Random search states its default of the one and does not know the other.
        assert table.loc["random", "n_ants"] == 100
        assert pd.isna(table.loc["random", "evaporation"])
        assert set(table["name"]) == {"random", "bo-aco"}
        assert table["family"].value_counts().to_dict() == {"ants": 4, "random": 1}

    def test_missions_are_described(self, kept):
        table = kept.missions.set_index("mission")
        for label in kept.mission_labels:
            mission, row = kept.mission(label), table.loc[label]
            assert (row["nodes"], row["arcs"]) == (len(mission.nodes), mission.world.graph.n_arcs)
            assert (row["robots"], row["total_reward"]) == (mission.robots, mission.total_reward)
        assert list(table["name"]) == ["toy", "two_communities", "two_communities"]
        assert list(table["family"]) == ["toy", "towns", "towns"]
        assert list(table["seed"].dropna()) == [1, 2]


def test_the_file_of_a_run_has_all_of_it(study, tmp_path):
    run, store = study.runs()[0], StudyFolder(tmp_path / "study")
    outcome = outcome_of(run, [(0.4, 0.4)], [(0.6, 0.5), (0.5, 0.6)], ties=2)
    with store.locked(study):
        store.save(run, outcome)
    with np.load(store.path / "runs" / f"{run.digest}.npz", allow_pickle=False) as file:
        assert json.loads(file["header"].tobytes())["identity"] == run.identity
    found = store.load(run)
    assert replace(found, records=()) == replace(outcome, records=())
    for one, other in zip(found.records, outcome.records, strict=True):
        assert (one.evaluations, one.seconds, one.ties) == (
            other.evaluations,
            other.seconds,
            other.ties,
        )
        assert one.objectives.tolist() == other.objectives.tolist()
    (plans, objectives), (expected, claimed) = found.records[-1].plans, outcome.records[-1].plans
    assert list(plans) == list(expected)
    assert objectives.tolist() == claimed.tolist()


def test_failures_are_kept_until_the_run_is_finished(study, tmp_path):
    run, store = study.runs()[0], StudyFolder(tmp_path / "study")
    done = outcome_of(run, [(0.4, 0.4)])
    with store.locked(study):
        store.save(run, replace(done, status="failed", error="it broke", records=()))
        found = store.load(run)
        assert (found.status, found.error, found.records) == ("failed", "it broke", ())
        assert store.finished([run]) == set()
        store.save(run, done)
        assert store.load(run).status == "done"
        assert store.finished([run]) == {run.digest}
