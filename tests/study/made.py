"""Studies for tests: some are run, and the runs of others have found what a test says."""

import numpy as np
import pandas as pd

from botohe_moo.study import read_study, run_study
from botohe_moo.study.folder import StudyFolder
from botohe_moo.study.loading import load_study
from botohe_moo.study.perform import Outcome, Record
from botohe_moo.study.runner import Plan
from botohe_moo.study.scores import collect_tables
from botohe_moo.study.tables import SCHEMAS
from botohe_moo.trails import PlanBatch

MADE = "tests.study.algorithms_made"
TIMES = {"began", "seconds", "recording_seconds", "seconds_median", "bound_seconds", "traceback"}


def study_of(**changes):
    """The content of a study file; a key that is changed to None is left out."""
    content = {
        "name": "trial",
        "missions": ["toy"],
        "algorithms": ["random", "greedy"],
        "budget": {"evaluations": 300},
        "seeds": 2,
        **changes,
    }
    return {key: value for key, value in content.items() if value is not None}


def outcome_of(run, *fronts, ties=0):
    """A run with these fronts, in shares of what its mission offers; the last with tied plans."""
    mission = run.mission.mission
    most = np.array([mission.total_reward, mission.robots])
    records = [
        Record(10 * i, 0.5 * i, np.array(front) * most, 0) for i, front in enumerate(fronts, 1)
    ]
    last = records[-1]
    objectives = np.concatenate([last.objectives, np.repeat(last.objectives[-1:], ties, axis=0)])
    batch = PlanBatch.from_plans([mission.stay_home()] * len(objectives), mission.robots)
    records[-1] = Record(last.evaluations, last.seconds, last.objectives, ties, (batch, objectives))
    return Outcome("done", "evaluations", last.evaluations, last.seconds, records=tuple(records))


def made_study(folder, content, outcome_of_run):
    """The tables of a study with an outcome for each run; a run without one is missing."""
    study, store = load_study(content), StudyFolder(folder)
    with store.locked(study):
        store.write_study(study)
        for run in study.runs():
            if outcome := outcome_of_run(run):
                store.save(run, outcome)
        collect_tables(study, store)
    return read_study(folder)


def without_times(tables):
    frames = {name: getattr(tables, name) for name in SCHEMAS}
    return {name: of.drop(columns=[c for c in of if c in TIMES]) for name, of in frames.items()}


def assert_same(one, other):
    """The tables of two studies are the same but for times."""
    one, other = without_times(one), without_times(other)
    for name in SCHEMAS:
        pd.testing.assert_frame_equal(one[name], other[name], obj=name)


class Watcher:
    """Notes what is performed."""

    def __init__(self):
        self.performed, self.plan, self.bounded = [], None, []

    def __call__(self, about, news):
        note = {Plan: self.begin, Record: self.record, Outcome: self.end}
        note.get(type(news), self.end_bound)(about, news)

    def begin(self, study, plan):
        self.plan = plan

    def record(self, run, record):
        pass

    def end(self, run, outcome):
        self.performed.append((run.algorithm.label, run.seed, outcome.status))

    def end_bound(self, mission, bound):
        self.bounded.append((mission.label, bound if isinstance(bound, str) else None))


def watched(source, folder, **options):
    watcher = Watcher()
    return run_study(source, folder, progress=watcher, **options), watcher
