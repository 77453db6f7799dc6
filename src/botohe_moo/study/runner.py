"""Running a study: missing runs are performed, missions bounded, and tables made."""

from __future__ import annotations

import contextlib
import datetime as dt
import json
import os
import signal
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from botohe_moo.base.parameters import Positive, check
from botohe_moo.base.runtime import hold_signals
from botohe_moo.library import Finder
from botohe_moo.mission.loading import library_name_of
from botohe_moo.mission.model import Mission, numbers_digest
from botohe_moo.solution import read_solution
from botohe_moo.study import model as m
from botohe_moo.study.content import parameter_words
from botohe_moo.study.folder import StudyFolder, restore_study
from botohe_moo.study.loading import load_study
from botohe_moo.study.pool import BoundTask, WorkerPool, dask_outcomes
from botohe_moo.study.tables import StudyTables, read_study
from botohe_moo.trails import Plans

# Ctrl-C; what batch systems and ``docker stop`` send; what a terminal sends that is closed.
_STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@dataclass(frozen=True)
class Plan:
    """The runs of a study, which of them are finished, and which bounds are missing."""

    runs: tuple[m.Run, ...]
    finished: frozenset[str]  # digests of runs
    unbounded: Mapping[str, m.StudyMission]  # by digests of the bounds that are to be computed

    @property
    def missing(self) -> tuple[m.Run, ...]:
        """The runs that are to be performed."""
        return tuple(run for run in self.runs if run.digest not in self.finished)


def plan_study(study: m.Study, folder: StudyFolder) -> Plan:
    """Find out which runs of a study are finished, and which bounds are there."""
    runs = study.runs()
    unbounded = {
        mission.bound_digest: mission
        for mission in study.bounded
        if (bound := folder.bound(mission)) is None or bound[1] < study.bound_seconds
    }
    return Plan(runs, folder.finished(runs), unbounded)


def _bound_task(
    mission: m.StudyMission, runs: Iterable[m.Run], folder: StudyFolder, seconds: float
) -> BoundTask:
    """Return the task to bound a mission, guided by the points that its runs have found."""
    of_mission = [run for run in runs if run.mission.bound_digest == mission.bound_digest]
    last = (outcome.records[-1:] for _, outcome in folder.outcomes(of_mission))
    fronts = [np.empty((0, 2)), *(record.objectives for records in last for record in records)]
    return BoundTask(mission, np.unique(np.concatenate(fronts), axis=0), seconds)


def _make_tables(study: m.Study, folder: StudyFolder) -> StudyTables:
    # Imported late: scipy.stats takes half a second, which `study plan` can save.
    from botohe_moo.study.scores import collect_tables

    collect_tables(study, folder)
    return read_study(folder.path)


class StudyInterrupted(KeyboardInterrupt):
    """A study was stopped by a signal; the runs that are finished are in its folder and tables.

    Parameters
    ----------
    number
        Number of the signal, which is SIGINT for Ctrl-C.

    Examples
    --------
    >>> import signal
    >>> from botohe_moo.study import StudyInterrupted
    >>> stopped = StudyInterrupted(signal.SIGTERM)  # what run_study raises then
    >>> stopped.signal == signal.SIGTERM, isinstance(stopped, KeyboardInterrupt)
    (True, True)
    """

    def __init__(self, number: int = signal.SIGINT) -> None:
        super().__init__(f"stopped by {signal.Signals(number).name}; run the study again to go on")
        self.signal = number


def run_study(
    source: str | os.PathLike[str] | Mapping[str, Any] | m.Study,
    out: str | os.PathLike[str] | None = None,
    *,
    workers: int = 1,
    dask: str | None = None,
    patience: float = m.PATIENCE,
    progress: Callable[[Any, Any], Any] = lambda _about, _news: None,
) -> StudyTables:
    """Perform the missing runs of a study, bound its missions if it asks so, and make its tables.

    A run that is already in the folder is not performed again, unless something has changed that
    its result depends on: mission, algorithm, parameters, budget, recording, seed or package
    version. Failed runs are performed again. Bounds are computed when all runs are done. A bound
    that is in the folder is computed again only if it is now allowed more seconds.

    Parameters
    ----------
    source
        A study file, the content of one as a mapping, or a study that was read before.
    out
        Folder to write to; default: ``results/NAME``.
    workers
        Runs or bounds at a time on this machine, at least 1. Results of runs do not depend on it.
    dask
        Address of the scheduler of a Dask cluster, to perform runs there instead.
    patience
        Seconds, above 0, without an evaluation after which a run of another package's algorithm
        fails. Where the budget limits the seconds of a run, these end it instead.
    progress
        Is called with the study and its plan, with a run and each front that it records, with a run
        and its outcome, and with a mission and its bound, or the error because of which it has
        none.

    Raises
    ------
    StudyError
        If the study file is wrong, the folder is that of something else, another runner is at work
        in it, or the cluster does not answer.
    OSError
        If the folder cannot be written to; what was finished until then is kept.
    StudyInterrupted
        After Ctrl-C, SIGTERM or SIGHUP; what was finished until then is kept.

    Warns
    -----
    UserWarning
        If all runs failed.

    Examples
    --------
    >>> import tempfile
    >>> from botohe_moo.study import run_study
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     tables = run_study({
    ...         "name": "trial",
    ...         "missions": ["toy"],
    ...         "algorithms": ["random", "greedy"],
    ...         "budget": {"evaluations": 50},
    ...         "seeds": 2,
    ...     }, folder)
    >>> tables.runs[["algorithm", "seed", "status"]].values.tolist()
    [['random', 1, 'done'], ['random', 2, 'done'], ['greedy', 1, 'done'], ['greedy', 2, 'done']]
    """
    workers = check("workers", workers, int, ge=1, le=1_024)
    patience = check("patience", patience, Positive)
    study = source if isinstance(source, m.Study) else load_study(source)
    folder = StudyFolder(m.study_folder(study.name, out))
    with folder.locked(study):
        plan = plan_study(study, folder)
        if plan.missing:  # name a damaged file before, not after, hours of work
            deque(folder.outcomes(run for run in plan.runs if run.digest in plan.finished), 0)
        folder.write_study(study)
        progress(study, plan)
        with hold_signals(*_STOPS) as stop, contextlib.closing(WorkerPool()) as pool:
            here: dict[str, Any] = {"workers": workers, "stopped": stop.is_set}
            runs = [replace(run, patience=patience) for run in plan.missing]
            if dask is not None and runs:
                outcomes = dask_outcomes(runs, address=dask, stopped=stop.is_set)
            else:
                outcomes = pool.perform(runs, note=progress, **here)
            with contextlib.closing(outcomes):
                for run, outcome in outcomes:
                    folder.save(run, outcome)
                    progress(run, outcome)
            bound_tasks = (
                _bound_task(mission, plan.runs, folder, study.bound_seconds)
                for mission in plan.unbounded.values()
            )
            with contextlib.closing(pool.perform(bound_tasks, **here)) as bounds:
                for bounded, bound in bounds:
                    if not isinstance(bound, str):
                        folder.save_bound(bounded.mission, bound, bounded.seconds)
                    progress(bounded.mission, bound)
            tables = _make_tables(study, folder)
    if stop.is_set():
        raise StudyInterrupted(stop.signal)
    if len(tables.runs) and (tables.runs["status"] == "failed").all():
        said = f"all {len(tables.runs)} runs failed, the first with: {tables.runs['error'].iloc[0]}"
        warnings.warn(f"{folder.path}: {said}", stacklevel=2)
    return tables


def make_tables(folder: str | os.PathLike[str]) -> StudyTables:
    """Make the tables of a study anew from the runs in its folder.

    Neither the study file nor the packages of its algorithms are needed. Another process may be
    running the study meanwhile.

    Parameters
    ----------
    folder
        Folder that ``botohe study run`` has written to.

    Raises
    ------
    StudyError
        If the folder holds no study or cannot be written to, or a file is damaged.

    Examples
    --------
    >>> from botohe_moo.study import make_tables, run_study
    >>> trial = {
    ...     "name": "trial",
    ...     "missions": ["toy"],
    ...     "algorithms": ["greedy"],
    ...     "budget": {"evaluations": 50},
    ...     "seeds": 1,
    ... }
    >>> tables = run_study(trial, "results/trial")
    >>> len(make_tables("results/trial").runs)
    1
    """
    return _make_tables(restore_study(Path(folder)), StudyFolder(folder))


def merge_studies(
    folders: Sequence[str | os.PathLike[str]], out: str | os.PathLike[str] | None = None
) -> StudyTables:
    """Make one study from the results of it on several machines.

    Their study files are the same but for the seeds, and the merged study has all of these. Where
    several folders have the same run, ``out`` keeps its own, or else gets that of the first folder.

    Parameters
    ----------
    folders
        Folders of the study.
    out
        Folder to write to: a new or empty one, or one with this study, such as one of ``folders``.
        Default: ``results/NAME``.

    Raises
    ------
    StudyError
        If a folder holds no study, or another one than the first folder does. Also if the file of a
        run is damaged, or ``out`` cannot be used or written to.

    Examples
    --------
    >>> from botohe_moo.study import merge_studies, run_study
    >>> trial = {
    ...     "name": "trial",
    ...     "missions": ["toy"],
    ...     "algorithms": ["greedy"],
    ...     "budget": {"evaluations": 50},
    ...     "seeds": [1],
    ... }
    >>> first = run_study(trial, "one")
    >>> second = run_study({**trial, "seeds": [2]}, "two")
    >>> merge_studies(["one", "two"], "both").runs["seed"].tolist()
    [1, 2]
    """
    paths = [Path(folder) for folder in folders]
    if not paths:
        raise m.StudyError("Expected folders of a study, got none.")
    first = restore_study(paths[0])
    target = StudyFolder(m.study_folder(first.name, out))
    if (target.path / m.MANIFEST).exists():
        paths.append(target.path)
    studies = {path: restore_study(path) for path in paths}
    for path, study in studies.items():
        if _without_seeds(study) != _without_seeds(first):
            raise m.StudyError(f"{path}: expected the study of {paths[0]} but for its seeds.")
    values = sorted({seed for study in studies.values() for seed in study.seeds})
    file = first.file.model_copy(update={"seeds": values})
    # JSON is YAML, too, and never takes a text for a number.
    text = json.dumps(file.model_dump(mode="json", exclude_defaults=True), indent=1) + "\n"
    study = replace(first, file=file, text=text, seeds=tuple(values))
    with target.locked(study):
        target.write_study(study)
        for path in paths:
            target.take_from(path)
        return _make_tables(study, target)


def _without_seeds(study: m.Study) -> Any:
    """Return all that studies on several machines must have in common."""
    # Equal files may name different missions by the same name, or code of different versions.
    digests = [run.digest for run in replace(study, seeds=(0,)).runs()]
    return study.file.model_dump(exclude={"seeds"}), digests


def found_plans(folder: Path, *, by: str) -> dict[str, list[tuple[Plans, Finder]]]:
    """Read the plans of a solution or a study, as :func:`botohe_moo.library.add_plans` takes them.

    Parameters
    ----------
    folder
        Folder of a solution, or of a study.
    by
        Who found the plans; the date is today's.

    Raises
    ------
    ValueError
        If no mission in it is one of the library, or a plan cannot be read.
    """
    found: dict[str, list[tuple[Plans, Finder]]] = {}
    for mission, plans, method in _plans_in(folder):
        if name := library_name_of(numbers_digest(mission)):
            finder = Finder(dt.date.today().isoformat(), by, method)
            found.setdefault(name, []).append((plans, finder))
    if not found:
        raise ValueError(f"{folder}: expected plans of a mission of the library, found none.")
    return found


def _plans_in(folder: Path) -> Iterator[tuple[Mission, Plans, str]]:
    """Yield each mission and the plans of a solution or of a study's runs, and their method."""
    if (folder / "plans.json").exists():
        solution = read_solution(folder)
        how = solution.algorithm, solution.parameters, solution.evaluations, solution.seed
        yield solution.mission, solution.plans, _method(*how)
        return
    tables = read_study(folder)
    plans, algorithms = tables.plans.groupby("run")["trails"], tables.manifest["algorithms"]
    rows: Any = tables.runs[tables.runs["front_size"] > 0].to_dict("records")
    for row in rows:
        mission, how = tables.mission(row["mission"]), algorithms[row["algorithm"]]
        index_of = {node: i for i, node in enumerate(mission.nodes)}
        trails = map(json.loads, plans.get_group(row["run"]))
        packed = [[[index_of[node] for node in trail] for trail in plan] for plan in trails]
        spent = row["evaluations"], row["seed"]
        yield mission, mission.pack(packed), _method(how["algorithm"], how["parameters"], *spent)


def _method(algorithm: str, parameters: Mapping[str, Any], evaluations: int, seed: int) -> str:
    given = f" ({parameter_words(parameters)})" if parameters else ""
    return f"{algorithm}{given}, {evaluations:,} evaluations, seed {seed}"
