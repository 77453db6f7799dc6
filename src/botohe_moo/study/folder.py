"""A study's folder: a file for each finished run, which is there whole or not at all."""

import contextlib
import io
import itertools
import json
from collections.abc import Iterable, Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import filelock
import numpy as np

from botohe_moo.base.files import FilePath, replace_file
from botohe_moo.bounds import FrontBound
from botohe_moo.mission.loading import read_mission, save_mission
from botohe_moo.mission.model import mission_digest
from botohe_moo.study.model import MANIFEST, Run, Study, StudyError, StudyMission, digest_of
from botohe_moo.study.perform import Outcome, Record
from botohe_moo.trails import PlanBatch

RUNS, FAILURES, BOUNDS, MISSIONS = PARTS = ("runs", "failures", "bounds", "missions")
OUTCOME_FIELDS = [field.name for field in fields(Outcome) if field.name != "records"]
_OF_RECORDS = ("evaluations", "seconds", "ties", "front_size")
_LOCK = ".lock"
_UNFINISHED = f".{'?' * 16}.tmp"  # as replace_file names them


class StudyFolder:
    """The folder of a study's results; it need not exist, and :meth:`locked` makes it.

    ``runs/DIGEST.npz`` holds a finished run. ``failures/DIGEST.npz`` holds the last failure of a
    run: failures are not results, and the run is performed again until it is finished.
    ``bounds/DIGEST-SECONDS.json`` holds the bound of a mission that was allowed these seconds.
    """

    def __init__(self, path: FilePath) -> None:
        self.path = Path(path)

    @contextlib.contextmanager
    def locked(self, study: Study) -> Iterator[None]:
        """Make the folder for a study, and keep other runners out of it."""
        self.check(study)
        self.path.mkdir(parents=True, exist_ok=True)
        lock = filelock.FileLock(self.path / _LOCK, timeout=0)
        try:
            held = lock.acquire()
        except filelock.Timeout:
            raise StudyError(f"{self.path}: another runner is at work in this folder.") from None
        with held:
            for part in PARTS:
                (self.path / part).mkdir(exist_ok=True)
            for unfinished in self.path.rglob(_UNFINISHED):  # of a runner that was killed
                unfinished.unlink(missing_ok=True)
            yield

    def check(self, study: Study) -> None:
        """Raise a StudyError unless the folder is missing, empty or holds this study."""
        names = sorted(path.name for path in self.path.iterdir()) if self.path.exists() else []
        found = ""
        if MANIFEST in names:
            if (name := read_manifest(self.path)["name"]) != study.name:
                found = f"the study {name!r}"
        elif names and _LOCK not in names:  # a runner that was killed may have made no more
            found = repr(names[0])
        if found:
            raise StudyError(
                f"{self.path}: expected an empty folder or that of the study {study.name!r}, found "
                f"{found}; give another folder by --out."
            )

    def write_study(self, study: Study) -> None:
        """Write the study file, the missions, and ``study.json``: the manifest."""
        for mission in study.missions:
            save_mission(mission.mission, self.path / MISSIONS / f"{mission.digest}.json")
        replace_file(self.path / "study.yaml", study.text.encode())
        content = json.dumps(study.manifest(), indent=1) + "\n"
        replace_file(self.path / MANIFEST, content.encode())

    def _path(self, run: Run, part: str) -> Path:
        return self.path / part / f"{run.digest}.npz"

    def finished(self, runs: Iterable[Run]) -> frozenset[str]:
        """Return the digests of the runs that are finished."""
        there = {path.stem for path in (self.path / RUNS).glob("*.npz")}
        return frozenset(run.digest for run in runs if run.digest in there)

    def save(self, run: Run, outcome: Outcome) -> None:
        """Write the outcome of a run."""
        part = FAILURES if outcome.status == "failed" else RUNS
        replace_file(self._path(run, part), _pack_run(run, outcome))

    def load(self, run: Run) -> Outcome | None:
        """Read the outcome of a run, or its last failure; None if there is neither."""
        paths = [self._path(run, part) for part in (RUNS, FAILURES)]
        path = next(filter(Path.exists, paths), None)
        return _read_run(path, run) if path else None

    def outcomes(self, runs: Iterable[Run]) -> Iterator[tuple[Run, Outcome]]:
        """Read the outcomes of the runs that have one; a StudyError names a damaged file."""
        for run in runs:
            if outcome := self.load(run):
                yield run, outcome

    def bound(self, mission: StudyMission) -> tuple[FrontBound, float] | None:
        """Read the bound of a mission that was allowed the most seconds, and these seconds."""
        found = {}
        for path in (self.path / BOUNDS).glob(f"{mission.bound_digest}-*.json"):
            with _reading(path):
                found[float(path.stem.partition("-")[2])] = path
        if not found:
            return None
        with _reading(path := found[max(found)]):
            return FrontBound.load(path, mission.mission), max(found)

    def save_bound(self, mission: StudyMission, bound: FrontBound, seconds: float) -> None:
        """Write the bound of a mission that was allowed these seconds."""
        bound.save(self.path / BOUNDS / f"{mission.bound_digest}-{seconds:.12g}.json")

    def take_from(self, other: Path) -> None:
        """Copy the files of runs, failures, missions and bounds that are not there yet."""
        for part in PARTS:
            for path in sorted((other / part).glob("[!.]*")):
                copy = self.path / part / path.name
                if not copy.exists():
                    replace_file(copy, path.read_bytes())


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read ``study.json``; raise a StudyError if a folder has none, or a damaged one."""
    path = folder / MANIFEST
    if not path.exists():
        raise StudyError(f"{folder}: there is no study in this folder.")
    with _reading(path):
        content: dict[str, Any] = json.loads(path.read_bytes())
        content["name"]  # raises if this is something else
    return content


def restore_study(folder: Path) -> Study:
    """Read the study that a folder holds, as it was checked when its runs were planned.

    The code that it names is not imported: missions are read from the folder, and the packages of
    its algorithms need not be installed.
    """
    manifest, missions = read_manifest(folder), {}
    with _reading(folder / MANIFEST):
        for label, entry in manifest["missions"].items():
            with _reading(file := folder / entry["file"]):
                missions[label] = read_mission(file)
                if mission_digest(missions[label]) != entry["digest"]:
                    raise ValueError("it was changed")
        return Study.restored(manifest, missions)


def _pack_run(run: Run, outcome: Outcome) -> bytes:
    """Return the content of a run's file: arrays as ``npz``, one of which has the rest as JSON."""
    records = outcome.records
    plans, objectives = (records[-1].plans if records else None) or (None, np.empty((0, 0)))
    header = {"identity": run.identity, **{n: getattr(outcome, n) for n in OUTCOME_FIELDS}}
    of_records: Any = {n: np.array([getattr(r, n) for r in records]) for n in _OF_RECORDS}
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        header=np.frombuffer(json.dumps(header).encode(), np.uint8),
        **of_records,
        points=np.concatenate([r.objectives for r in records] or [objectives]),
        plan_objectives=objectives,
        plan_nodes=np.empty(0, np.int32) if plans is None else plans.nodes,
        plan_offsets=np.zeros(1, np.int64) if plans is None else plans.offsets,
    )
    return buffer.getvalue()


def _read_run(path: Path, run: Run) -> Outcome:
    """Read the outcome of a run; a StudyError names a file that is damaged, or of another run."""
    with _reading(path):
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as file:
            arrays: dict[str, Any] = dict(file)
        header = json.loads(arrays["header"].tobytes())
        if digest_of(header["identity"]) != run.digest:
            raise ValueError("it holds another run")
        evaluations, seconds, ties, sizes = (arrays[name].tolist() for name in _OF_RECORDS)
        fronts = np.split(arrays["points"], list(itertools.accumulate(sizes)))[:-1]
        records = list(map(Record, evaluations, seconds, fronts, ties))
        if records:
            n_robots = run.mission.mission.robots
            plans = PlanBatch(arrays["plan_nodes"], arrays["plan_offsets"], n_robots)
            records[-1] = replace(records[-1], plans=(plans, arrays["plan_objectives"]))
        return Outcome(**{name: header[name] for name in OUTCOME_FIELDS}, records=tuple(records))


@contextlib.contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Turn any exception into a StudyError: the file is damaged, or of another version."""
    try:
        yield
    except StudyError:
        raise
    except Exception as error:  # numpy and zipfile do not say which a damaged file raises
        reason = str(error).partition("\n")[0]
        raise StudyError(
            f"{path}: damaged ({reason}); remove the file, and run the study again."
        ) from error
