"""A study's folder: a file for each finished run, which is there whole or not at all."""

import contextlib
import errno
import os
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import filelock

from botohe_moo._base.files import replace_file
from botohe_moo.mission.formats.files import save_mission
from botohe_moo.search.bounds import FrontBound
from botohe_moo.study.file.digest import canonical
from botohe_moo.study.file.model import MANIFEST, Run, Study, StudyError, StudyMission
from botohe_moo.study.run.task import Outcome
from botohe_moo.study.store.manifest import pack_study, read_manifest
from botohe_moo.study.store.run_files import pack_run, read_run

# The folders in it; tables are made of the files in the first three.
RUNS, FAILURES, BOUNDS, MISSIONS = PARTS = ("runs", "failures", "bounds", "missions")
_LOCK = ".lock"
_UNFINISHED = f".{'?' * 16}.tmp"  # as replace_file names them
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class StudyFolder:
    """The folder of a study's results; it need not exist, and :meth:`locked` makes it.

    ``runs/DIGEST.npz`` holds a finished run, ``failures/DIGEST.npz`` the last failure of a run
    that has never finished: failures are not results, and the run is performed again.
    ``bounds/DIGEST-SECONDS.json`` holds the bound of a mission, and the seconds that it was
    allowed. What cannot be used or written to is named by a StudyError.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)

    @contextlib.contextmanager
    def locked(self, study: Study) -> Iterator[None]:
        """Make the folder for a study, and keep other runners out of it."""
        self.check(study)
        lock = filelock.FileLock(self.path / _LOCK, blocking=False)
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
        """Make sure that the folder is empty, missing, or holds this study."""
        names = sorted(path.name for path in self.path.iterdir()) if self.path.exists() else []
        if MANIFEST in names:
            if (name := read_manifest(self.path)["name"]) != study.name:
                raise StudyError(
                    f"{self.path}: holds the study {name!r}, not {study.name!r}; give another "
                    "folder by --out."
                )
        elif names and _LOCK not in names:  # which is made first
            raise StudyError(
                f"{self.path}: expected an empty folder or that of a study, found {names[0]!r} "
                "in it; give another folder by --out."
            )

    def write_study(self, study: Study) -> None:
        """Write the study file, the missions and the manifest."""
        with writing(self.path):
            for mission in study.missions:
                save_mission(mission.mission, self.path / MISSIONS / f"{mission.digest}.json")
            replace_file(self.path / "study.yaml", study.text.encode())
            replace_file(self.path / MANIFEST, pack_study(study))

    def digests(self, part: str = RUNS) -> set[str]:
        """List the digests of all runs that are finished, or have failed."""
        return {path.stem for path in (self.path / part).glob("*.npz")}

    def save(self, run: Run, outcome: Outcome) -> None:
        """Write the outcome of a run; records of a failed run are not kept."""
        failed = self._path(run, FAILURES)
        with writing(self.path):
            if outcome.status == "failed":
                replace_file(failed, pack_run(run, replace(outcome, records=())))
            else:
                replace_file(self._path(run, RUNS), pack_run(run, outcome))
                failed.unlink(missing_ok=True)

    def load(self, run: Run) -> Outcome | None:
        """Read the outcome of a run, or its last failure; None if there is neither."""
        for path in (self._path(run, RUNS), self._path(run, FAILURES)):
            if path.exists():
                return read_run(path, run.mission.mission.robots)
        return None

    def _path(self, run: Run, part: str) -> Path:
        return self.path / part / f"{run.digest}.npz"

    def bound(self, mission: StudyMission) -> tuple[FrontBound, float] | None:
        """Read the bound of a mission that was allowed the most seconds, and how many they were.

        A file that is damaged counts as not there, and a warning names it.
        """
        found = (self.path / BOUNDS).glob(f"{mission.bound_digest}-*.json")
        allowed = {float(path.stem.partition("-")[2]): path for path in found}
        if not allowed:
            return None
        seconds = max(allowed)
        try:
            return FrontBound.load(allowed[seconds], mission.mission), seconds
        except ValueError:
            warnings.warn(f"{allowed[seconds]}: damaged, and left out.", stacklevel=2)
            return None

    def save_bound(self, mission: StudyMission, bound: FrontBound, seconds: float) -> None:
        """Write the bound of a mission that was allowed that many seconds."""
        name = f"{mission.bound_digest}-{canonical(seconds)}.json"
        with writing(self.path):
            bound.save(self.path / BOUNDS / name)

    def inputs(self, study: Study) -> list[tuple[str, int, int]]:
        """List the files that a study's tables are made of, each with its size and its time."""
        digests = {run.digest for run in study.runs()}
        digests |= {mission.bound_digest for mission in study.missions}
        found = []
        for part in (RUNS, FAILURES, BOUNDS):
            for path in (self.path / part).glob("[!.]*"):
                if path.stem.partition("-")[0] in digests:
                    state = path.stat()
                    found.append((f"{part}/{path.name}", state.st_size, state.st_mtime_ns))
        return sorted(found)


@contextlib.contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Turn an OSError into the StudyError that says what it means for the study."""
    try:
        yield
    except OSError as error:
        reason = "the disk is full" if error.errno in _FULL else error.strerror
        raise StudyError(
            f"{error.filename or folder}: cannot be written, {reason}. All runs that are finished "
            "are kept; run the study again to go on."
        ) from error
