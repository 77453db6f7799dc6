"""A study's folder: a file for each finished run, which is there whole or not at all."""

import contextlib
import io
import json
import os
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import filelock
import numpy as np
from pydantic import TypeAdapter, ValidationError

from botohe_moo.base.files import read_bytes, replace_file
from botohe_moo.base.messages import most_alike
from botohe_moo.bounds import FrontBound
from botohe_moo.indicators import INDICATORS
from botohe_moo.mission.loading import read_mission, save_mission
from botohe_moo.mission.model import mission_digest
from botohe_moo.study.content import canonical
from botohe_moo.study.model import MANIFEST, Run, Study, StudyError, StudyMission, digest_of
from botohe_moo.study.task import Outcome, Record
from botohe_moo.trails import PlanBatch

# The folders in a study's; its tables are made from the files in the first three.
RUNS, FAILURES, BOUNDS, MISSIONS = PARTS = ("runs", "failures", "bounds", "missions")
OUTCOME_FIELDS = [field.name for field in fields(Outcome) if field.name != "records"]
_STUDY = TypeAdapter(Study)
_LOCK = ".lock"
_UNFINISHED = f".{'?' * 16}.tmp"  # as replace_file names them
_LONGEST_REASON = 200  # characters


class StudyFolder:
    """The folder of a study's results; it need not exist, and :meth:`locked` makes it.

    ``runs/DIGEST.npz`` holds a finished run. ``failures/DIGEST.npz`` holds the last failure of a
    run that has never finished: failures are not results, and the run is performed again.
    ``bounds/DIGEST-SECONDS.json`` holds the bound of a mission that was allowed these seconds.
    A StudyError names what cannot be used or written to.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)

    @contextlib.contextmanager
    def locked(self, study: Study) -> Iterator[None]:
        """Make the folder for a study, and keep other runners out of it."""
        self.check(study)
        lock = filelock.FileLock(self.path / _LOCK, timeout=0)
        with writing(self.path):
            self.path.mkdir(parents=True, exist_ok=True)
            try:
                lock.acquire()
            except filelock.Timeout:
                raise StudyError(
                    f"{self.path}: another runner is at work in this folder. Wait for it, or give "
                    "another folder by --out."
                ) from None
        try:
            with writing(self.path):
                for part in PARTS:
                    (self.path / part).mkdir(exist_ok=True)
                for unfinished in self.path.rglob(_UNFINISHED):  # of a runner that was killed
                    unfinished.unlink(missing_ok=True)
            yield
        finally:
            lock.release()

    def check(self, study: Study) -> None:
        """Raise a StudyError unless the folder is missing, empty or holds this study."""
        names = sorted(path.name for path in self.path.iterdir()) if self.path.exists() else []
        if MANIFEST in names:
            if (name := read_manifest(self.path)["name"]) != study.name:
                raise StudyError(
                    f"{self.path}: holds the study {name!r}, not {study.name!r}; give another "
                    "folder by --out."
                )
        elif names and _LOCK not in names:  # a runner that was killed may have made no more
            raise StudyError(
                f"{self.path}: expected an empty folder or that of a study, found {names[0]!r} "
                "in it; give another folder by --out."
            )

    def write_study(self, study: Study) -> None:
        """Write the study file, the missions, and ``study.json``: the manifest and the study."""
        kept = _STUDY.dump_python(
            study,
            mode="json",
            exclude={"missions": {"__all__": {"mission"}}},  # missions have files of their own
            exclude_defaults=True,  # some of which cannot be written as JSON
        ) | {"versions": dict(study.versions)}
        content = json.dumps({**study.manifest(), "kept": kept}, indent=1) + "\n"
        with writing(self.path):
            for mission in study.missions:
                save_mission(mission.mission, self.path / MISSIONS / f"{mission.digest}.json")
            replace_file(self.path / "study.yaml", study.text.encode())
            replace_file(self.path / MANIFEST, content.encode())

    def digests(self, part: str = RUNS) -> set[str]:
        """Return the digests of all runs that are finished, or of those that have failed."""
        return {path.stem for path in (self.path / part).glob("*.npz")}

    def save(self, run: Run, outcome: Outcome) -> None:
        """Write the outcome of a run; records of a failed run are not kept."""
        finished, failed = self._paths(run)
        with writing(self.path):
            if outcome.status == "failed":
                replace_file(failed, _pack_run(run, replace(outcome, records=())))
            else:
                replace_file(finished, _pack_run(run, outcome))
                failed.unlink(missing_ok=True)

    def load(self, run: Run) -> Outcome | None:
        """Read the outcome of a run, or its last failure; None if there is neither."""
        path = next(filter(Path.exists, self._paths(run)), None)
        return _read_run(path, run) if path else None

    def _paths(self, run: Run) -> tuple[Path, Path]:
        """Return the files of a run that is finished, and of its last failure."""
        name = f"{run.digest}.npz"
        return self.path / RUNS / name, self.path / FAILURES / name

    def outcomes(self, runs: Iterable[Run]) -> Iterator[tuple[Run, Outcome]]:
        """Read the outcomes of the runs that have one; a StudyError names all damaged files."""
        damaged = []
        for run in runs:
            try:
                if outcome := self.load(run):
                    yield run, outcome
            except StudyError as error:
                damaged.append(str(error))
        if damaged:
            raise StudyError("\n".join(damaged))

    def bound(self, mission: StudyMission) -> tuple[FrontBound, float] | None:
        """Read the bound of a mission that was allowed the most seconds, and these seconds.

        A damaged file counts as missing, and a warning names it.
        """
        found = None
        for path in (self.path / BOUNDS).glob(f"{mission.bound_digest}-*.json"):
            try:
                seconds = float(path.stem.partition("-")[2])
                if found is None or seconds > found[1]:
                    found = FrontBound.load(path, mission.mission), seconds
            except ValueError:
                warnings.warn(f"{path}: damaged, and left out.", stacklevel=2)
        return found

    def save_bound(self, mission: StudyMission, bound: FrontBound, seconds: float) -> None:
        """Write the bound of a mission that was allowed these seconds."""
        name = f"{mission.bound_digest}-{canonical(seconds)}.json"
        with writing(self.path):
            bound.save(self.path / BOUNDS / name)

    def inputs(self, study: Study) -> list[tuple[str, int, int]]:
        """List the files that a study's tables are made from, with sizes and times of change."""
        digests = {run.digest for run in study.runs()}
        digests |= {mission.bound_digest for mission in study.missions}
        return sorted(
            (f"{part}/{path.name}", path.stat().st_size, path.stat().st_mtime_ns)
            for part in (RUNS, FAILURES, BOUNDS)
            for path in (self.path / part).glob("[!.]*")
            if path.stem.partition("-")[0] in digests
        )

    def take_from(self, other: Path) -> None:
        """Copy the files of runs, failures, missions and bounds that are not there yet."""
        with writing(self.path):
            for part in PARTS:
                for path in sorted((other / part).glob("[!.]*")):
                    copy = self.path / part / path.name
                    if not copy.exists():
                        replace_file(copy, read_bytes(path))


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read ``study.json``; raise a StudyError if a folder has none, or a damaged one."""
    path = folder / MANIFEST
    if not path.exists():
        others = (path.parent.name for path in folder.parent.glob(f"*/{MANIFEST}"))
        beside = most_alike(folder.name, others)
        raise StudyError(f"{folder}: there is no study in this folder{beside}.")
    with _reading(path):
        content: dict[str, Any] = json.loads(read_bytes(path))
        content["name"]  # raises if this is something else
    return content


def restore_study(folder: Path) -> Study:
    """Read the study that a folder holds, as it was checked when its runs were planned.

    The code that it names is not imported: missions are read from the folder, and the packages of
    its algorithms need not be installed. A study of an earlier version is refused.
    """
    manifest = read_manifest(folder)
    with _reading(folder / MANIFEST):
        kept = manifest["kept"]
        for mission in kept["missions"]:
            file = folder / MISSIONS / f"{mission['digest']}.json"
            with _reading(file):
                mission["mission"] = read_mission(file)
                if mission_digest(mission["mission"]) != mission["digest"]:
                    raise ValueError("it was changed")
        try:
            study = _STUDY.validate_python(kept, context={"imports": False})
        except ValidationError as error:
            raise ValueError("it was written by another version") from error
        problem_is_stated = study.file.problem is None or all(
            mission.own_objectives is not None for mission in study.missions
        )
        if "versions" not in kept or not problem_is_stated:
            raise ValueError("it was written by another version")
        for name in study.file.indicators:
            if not INDICATORS[name].is_loaded:
                raise StudyError(
                    f"{folder}: the indicator {name!r} is code, which folders do not run: run the "
                    "study file again, or register the indicator as an entry point."
                )
        return study


def _pack_run(run: Run, outcome: Outcome) -> bytes:
    """Return the content of a run's file: arrays as ``npz``, one of which has the rest as JSON."""
    records = outcome.records
    plans, objectives = (records[-1].plans if records else None) or (None, np.empty((0, 0)))
    header = {"identity": run.identity, **{n: getattr(outcome, n) for n in OUTCOME_FIELDS}}
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        header=np.frombuffer(json.dumps(header).encode(), np.uint8),
        evaluations=np.array([record.evaluations for record in records], np.int64),
        seconds=np.array([record.seconds for record in records], np.float64),
        ties=np.array([record.ties for record in records], np.int64),
        n_points=np.array([record.front_size for record in records], np.int64),
        points=np.concatenate([r.objectives for r in records] or [objectives]),
        plan_objectives=objectives,
        plan_nodes=np.empty(0, np.int32) if plans is None else plans.nodes,
        plan_offsets=np.zeros(1, np.int64) if plans is None else plans.offsets,
    )
    return buffer.getvalue()


def _read_run(path: Path, run: Run) -> Outcome:
    """Read the outcome of a run; a StudyError names a file that is damaged, or of another run."""
    with _reading(path):
        with np.load(io.BytesIO(read_bytes(path)), allow_pickle=False) as file:
            arrays: dict[str, Any] = dict(file)
        header = json.loads(arrays["header"].tobytes())
        if digest_of(header["identity"]) != run.digest:
            raise ValueError("it holds another run")
        fronts = np.split(arrays["points"], np.cumsum(arrays["n_points"]))[:-1]
        evaluations, seconds = arrays["evaluations"].tolist(), arrays["seconds"].tolist()
        records = list(map(Record, evaluations, seconds, fronts, arrays["ties"].tolist()))
        if records:
            n_robots = run.mission.mission.robots
            plans = PlanBatch(arrays["plan_nodes"], arrays["plan_offsets"], n_robots)
            records[-1] = replace(records[-1], plans=(plans, arrays["plan_objectives"]))
        return Outcome(**{name: header[name] for name in OUTCOME_FIELDS}, records=tuple(records))


@contextlib.contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Turn any exception into a StudyError that says that the file is damaged."""
    try:
        yield
    except StudyError:
        raise
    except Exception as error:  # numpy and zipfile do not say which a damaged file raises
        reason = " ".join(f"{error}".split())[:_LONGEST_REASON]
        raise StudyError(
            f"{path}: damaged ({reason}); remove the file, and run the study again."
        ) from error


@contextlib.contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Turn an OSError into a StudyError that says what it means for the study."""
    try:
        yield
    except OSError as error:
        raise StudyError(
            f"{error.filename or folder}: cannot be written ({error.strerror}). All runs that are "
            "finished are kept; run the study again to go on."
        ) from error
