"""A study's folder: a file for each finished run, which is there whole or not at all."""

import contextlib
import errno
import json
import os
import re
from collections.abc import Iterator
from pathlib import Path

import filelock

from botohe_moo._base.files import read_bytes, replace_file
from botohe_moo.mission.formats.files import save_mission
from botohe_moo.search.bounds import FrontBound
from botohe_moo.study.file.model import MANIFEST, Run, Study, StudyError, StudyMission
from botohe_moo.study.run.task import Outcome
from botohe_moo.study.store.bound_files import KeptBound, bound_file, bound_files, read_bound
from botohe_moo.study.store.manifest import dump_study, read_manifest
from botohe_moo.study.store.run_files import IndexedFile, outcome_fields, pack_run, unpack_run
from botohe_moo.study.store.run_parts import read_ending
from botohe_moo.study.store.table_files import put_study, tables_locked

_TEMPORARY = re.compile(r"\.[0-9a-f]{16}\.tmp$")  # as replace_file names them
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class DamagedError(Exception):
    """The file of a run or of a bound cannot be trusted; names the file and says why."""


class StudyFolder:
    """The folder of a study's results; it need not exist, and :meth:`locked` makes it.

    ``runs/DIGEST.npz`` holds a finished run, ``failures/DIGEST.json`` the last failure of a run
    that has never finished. Failures are not results: the run is performed again.
    ``bounds/DIGEST-SECONDS.json`` holds the bound of a mission. What cannot be used or written to
    is named by a StudyError.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self._runs = self.path / "runs"
        self._failures = self.path / "failures"
        self._missions = self.path / "missions"
        self._bounds = self.path / "bounds"
        self._lock_file = self.path / ".lock"
        self._runner_file = self.path / ".runner"

    @contextlib.contextmanager
    def locked(self, study: Study) -> Iterator[None]:
        """Make the folder for a study, and keep other runners out of it."""
        self.check(study)  # while the lock file does not mark the folder as a study's yet
        _make_folder(self.path)
        lock = filelock.FileLock(self._lock_file)
        try:
            lock.acquire(blocking=False)
        except filelock.Timeout:
            raise StudyError(
                f"{self.path}: another runner is at work in this folder"
                f"{self._holder()}. Wait for it, or give another folder by --out."
            ) from None
        except OSError as error:
            raise StudyError(f"{self.path}: cannot be written to ({error.strerror}).") from None
        try:
            self.check(study)  # another runner may have ended in between
            # After the lock, which marks the folder as a study's even if it holds nothing else.
            for folder in (self._runs, self._failures, self._missions):
                _make_folder(folder)
            if study.file.bounds:
                _make_folder(self._bounds)
            with writing(self.path):
                replace_file(self._runner_file, f"{os.getpid()}\n".encode())
            self._tidy()
            yield
        finally:
            self._runner_file.unlink(missing_ok=True)
            lock.release()

    def _holder(self) -> str:
        try:
            return f" (process {int(self._runner_file.read_text())})"
        except (OSError, ValueError):
            return ""

    def _tidy(self) -> None:
        """Remove unfinished files of a runner that was killed."""
        with tables_locked(self.path):  # tables may be made meanwhile
            folders = (self.path, self._runs, self._failures, self._missions, self._bounds)
            for folder in folders:
                for leftover in folder.glob(".*.tmp"):
                    if _TEMPORARY.match(leftover.name):
                        leftover.unlink(missing_ok=True)

    def check(self, study: Study) -> None:
        """Make sure that the folder is empty, missing, or holds this study."""
        marks = (MANIFEST, self._lock_file.name)
        names: list[str] = []
        with contextlib.suppress(OSError):  # not there, or reported when it is written to
            names = sorted(path.name for path in self.path.iterdir())
        if names and not any(mark in names for mark in marks):
            raise StudyError(
                f"{self.path}: expected an empty folder or that of a study, found {names[0]!r} "
                "in it; give another folder by --out."
            )
        try:
            name = read_manifest(self.path)["name"]
        except StudyError:  # there is none, or it is damaged and will be written again
            return
        if name != study.name:
            raise StudyError(
                f"{self.path}: holds the study {name!r}, not {study.name!r}; give another "
                "folder by --out."
            )

    def write_study(self, study: Study) -> None:
        """Write the study file, the missions and the manifest; existing tables stay readable."""
        with writing(self.path):
            for mission in study.missions:
                save_mission(mission.mission, self._missions / f"{mission.digest}.json")
            replace_file(self.path / "study.yaml", study.text.encode())
            with tables_locked(self.path):
                put_study(self.path, {**study.manifest(), "kept": dump_study(study)})

    def has_run(self, digest: str) -> bool:
        """Tell whether there is a file of a run; it may be damaged."""
        return self._path(digest).exists()

    def check_run(self, run: Run, known: IndexedFile | None = None) -> IndexedFile | None:
        """Make sure that a run's file is whole; None if there is no file.

        The file is not read again if it is the ``known`` one.
        """
        try:
            state = self._path(run.digest).stat()
        except OSError:  # such as a link to nowhere
            return None
        if known is not None and known.matches(state):
            return known
        data, outcome = self._read(run)
        return IndexedFile.of(state, data, outcome.seconds)

    def failures(self) -> dict[str, bytes]:
        """Read the files of the last failures, by digest of the run."""
        found = {}
        for path in self._failures.glob("*.json"):
            with contextlib.suppress(OSError):
                found[path.stem] = read_bytes(path)
        return found

    def failure(self, digest: str) -> Outcome | None:
        """Read the last failure of a run; None if there was none, or it cannot be read."""
        try:
            content = json.loads(read_bytes(self._failures / f"{digest}.json"))
            return Outcome(**read_ending(content).model_dump())
        except (OSError, ValueError, RecursionError):
            return None

    def save(self, run: Run, outcome: Outcome) -> IndexedFile | None:
        """Write the outcome of a run; describe its file, None for a failed run."""
        failed = self._failures / f"{run.digest}.json"
        with writing(self.path):
            if outcome.status == "failed":
                replace_file(failed, json.dumps(outcome_fields(outcome), indent=1).encode())
                return None
            path, data = self._path(run.digest), pack_run(run, outcome)
            replace_file(path, data)
            failed.unlink(missing_ok=True)
            return IndexedFile.of(path.stat(), data, outcome.seconds)

    def load(self, run: Run) -> Outcome:
        """Read the outcome of a run; a DamagedError names a file that cannot be trusted."""
        return self._read(run)[1]

    def bound(self, mission: StudyMission) -> KeptBound | None:
        """Read the bound of a mission; of several that with the most seconds, None without any.

        A DamagedError names a file that cannot be trusted, if there is no other.
        """
        fault = None
        for path in bound_files(self._bounds, mission):
            try:
                return read_bound(path, mission)
            except (OSError, ValueError) as error:
                said = getattr(error, "strerror", None) or str(error).removeprefix(f"{path} ")
                fault = fault or DamagedError(f"{path}: damaged ({said.rstrip('.')})")
        if fault:
            raise fault
        return None

    def bounds(self, study: Study) -> dict[str, KeptBound]:
        """Read all bounds that a study asks for, by label of the mission, but damaged ones."""
        found = {}
        for mission in study.missions if study.file.bounds else ():
            with contextlib.suppress(DamagedError):
                if kept := self.bound(mission):
                    found[mission.label] = kept
        return found

    def save_bound(self, mission: StudyMission, bound: FrontBound, seconds: float) -> None:
        """Write the bound of a mission that was allowed so many seconds, in place of any other."""
        path = bound_file(self._bounds, mission, seconds)
        with writing(self.path):
            bound.save(path)
            for other in bound_files(self._bounds, mission):
                if other != path:
                    other.unlink(missing_ok=True)

    def _read(self, run: Run) -> tuple[bytes, Outcome]:
        path = self._path(run.digest)
        try:
            data = read_bytes(path)
            return data, unpack_run(data, run)
        except (OSError, ValueError) as error:
            said = (getattr(error, "strerror", None) or str(error)).partition("\n")[0]
            raise DamagedError(f"{path}: damaged ({said})") from error

    def _path(self, digest: str) -> Path:
        return self._runs / f"{digest}.npz"


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StudyError(f"{folder}: expected a folder to write to; {error.strerror}.") from None


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
