"""A study's folder: one file for each finished run, which is there complete or not at all."""

from __future__ import annotations

import contextlib
import errno
import io
import json
import os
import re
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import filelock
import numpy as np

from botohe_moo._base.files import read_bytes, replace_file
from botohe_moo.mission.formats.files import save_mission
from botohe_moo.study.file.grid import Run, Study
from botohe_moo.study.run.task import Outcome, Record
from botohe_moo.study.store.index import Entry
from botohe_moo.study.store.kept import keep_study
from botohe_moo.study.store.manifest import MANIFEST, StudyError, read_manifest
from botohe_moo.study.store.shelf import put_study, tables_locked
from botohe_moo.trails import PlanBatch

__all__ = ["DamagedError", "Store"]

_FORMAT = 1
_TEMPORARY = re.compile(r"\.[0-9a-f]{16}\.tmp$")  # as replace_file names them
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_DAMAGE = (
    OSError, ValueError, KeyError, TypeError, EOFError, RuntimeError, MemoryError, OverflowError,
    zipfile.BadZipFile, zlib.error,
)  # fmt: skip


class DamagedError(Exception):
    """A run's file that cannot be trusted; names it and says why."""


class Store:
    """The folder of a study.

    Parameters
    ----------
    folder
        Need not exist; nothing is made before :meth:`locked`.

    Notes
    -----
    ``runs/DIGEST.npz`` holds a finished run, ``failures/DIGEST.json`` the last failure of one
    that never finished. Failures are not results: they are performed again.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)
        self._runs = self.folder / "runs"
        self._failures = self.folder / "failures"
        self._lock_file = self.folder / ".lock"

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Make the folder, and keep it from other runners.

        Raises
        ------
        StudyError
            If it cannot be made or written to, or another runner is at work in it.
        """
        _make_folder(self.folder)
        lock = filelock.FileLock(self._lock_file)
        try:
            lock.acquire(blocking=False)
        except filelock.Timeout:
            raise StudyError(
                f"{self.folder}: another runner is at work in this folder"
                f"{self._holder()}. Wait for it, or give another folder by --out."
            ) from None
        except OSError as error:
            raise StudyError(f"{self.folder}: cannot be written to ({error.strerror}).") from None
        try:
            # After the lock, by which a folder is known as a study's even if that is all it holds.
            for folder in (self._runs, self._failures, self.folder / "missions"):
                _make_folder(folder)
            with writing(self.folder):
                replace_file(self.folder / ".runner", f"{os.getpid()}\n".encode())
            self._tidy()
            yield
        finally:
            (self.folder / ".runner").unlink(missing_ok=True)
            lock.release()

    def _holder(self) -> str:
        try:
            return f" (process {int((self.folder / '.runner').read_text())})"
        except (OSError, ValueError):
            return ""

    def _tidy(self) -> None:
        """Remove what a runner that was killed has begun to write."""
        with tables_locked(self.folder):  # they may be made meanwhile
            for folder in (self.folder, self._runs, self._failures, self.folder / "missions"):
                for leftover in folder.glob(".*.tmp"):
                    if _TEMPORARY.match(leftover.name):
                        leftover.unlink(missing_ok=True)

    def check(self, study: Study) -> None:
        """Make sure that the folder is this study's, or nobody's.

        Raises
        ------
        StudyError
            If it holds a study of another name, or something else.
        """
        self._check_ours()
        try:
            name = read_manifest(self.folder)["name"]
        except StudyError:  # there is none, or it is damaged and will be written again
            return
        if name != study.name:
            raise StudyError(
                f"{self.folder}: holds the study {name!r}, not {study.name!r}; give another "
                "folder by --out."
            )

    def _check_ours(self) -> None:
        """Refuse a folder that holds something else than a study."""
        ours = (MANIFEST, self._lock_file.name)
        try:
            names = sorted(path.name for path in self.folder.iterdir())
        except OSError:  # it is not there, or will be complained of when it is written to
            return
        if names and not any(name in names for name in ours):
            raise StudyError(
                f"{self.folder}: expected an empty folder or that of a study, found {names[0]!r} "
                "in it; give another folder by --out."
            )

    def write_study(self, study: Study) -> None:
        """Keep what the study is: its file, its missions, and a manifest.

        Tables that are there stay readable.

        Raises
        ------
        StudyError
            If the folder cannot be written to.
        """
        with writing(self.folder):
            for mission in study.missions:
                path = self.folder / "missions" / f"{mission.digest}.json"
                save_mission(mission.mission, path)
            replace_file(self.folder / "study.yaml", study.text.encode())
            with tables_locked(self.folder):
                put_study(self.folder, {**study.manifest(), "kept": keep_study(study)})

    def finished(self, digest: str) -> bool:
        """Tell whether there is a file of a run; it may be damaged.

        Parameters
        ----------
        digest
            The run's name.
        """
        return self._path(digest).exists()

    def entry(self, run: Run, known: Entry | None = None) -> Entry | None:
        """Make sure that a run's file is whole; None if there is none.

        Parameters
        ----------
        run
            The run.
        known
            What was found when it was read before: it is not read again if it is the same file.

        Raises
        ------
        DamagedError
            As :meth:`load`.
        """
        try:
            state = self._path(run.digest).stat()
        except OSError:  # such as a link to nowhere
            return None
        if known is not None and known.is_of(state):
            return known
        data, outcome = self._read(run)
        return Entry.of(state, data, outcome.seconds)

    def failures(self) -> dict[str, bytes]:
        """Give the files of the last failures, by name of the run."""
        found = {}
        for path in self._failures.glob("*.json"):
            with contextlib.suppress(OSError):
                found[path.stem] = read_bytes(path)
        return found

    def failure(self, digest: str) -> Outcome | None:
        """Give the last failure of a run; None if there was none, or it cannot be read.

        Parameters
        ----------
        digest
            The run's name.
        """
        try:
            content = json.loads(read_bytes(self._failures / f"{digest}.json"))
            return Outcome(**content)
        except (OSError, ValueError, TypeError, RecursionError):
            return None

    def save(self, run: Run, outcome: Outcome) -> Entry | None:
        """Keep how a run ended; say what is known of its file, None for a failed run.

        Parameters
        ----------
        run
            The run.
        outcome
            Its outcome, with records.

        Raises
        ------
        StudyError
            If the folder cannot be written to, for example because the disk is full.
        """
        failed = self._failures / f"{run.digest}.json"
        with writing(self.folder):
            if outcome.status == "failed":
                replace_file(failed, json.dumps(_about(outcome), indent=1).encode())
                return None
            path, data = self._path(run.digest), _packed(run, outcome)
            replace_file(path, data)
            failed.unlink(missing_ok=True)
            return Entry.of(path.stat(), data, outcome.seconds)

    def load(self, run: Run) -> Outcome:
        """Read how a run ended.

        Parameters
        ----------
        run
            The run.

        Raises
        ------
        DamagedError
            If its file is truncated, corrupted, or another run's; names it.
        """
        return self._read(run)[1]

    def _read(self, run: Run) -> tuple[bytes, Outcome]:
        path = self._path(run.digest)
        try:
            data = read_bytes(path)
            return data, _unpacked(data, run)
        except _DAMAGE as error:
            said = f"{type(error).__name__}: {error}".partition("\n")[0]
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
    """Say in a message what it means for a study that its folder cannot be written to."""
    try:
        yield
    except OSError as error:
        reason = "the disk is full" if error.errno in _FULL else error.strerror
        raise StudyError(
            f"{error.filename or folder}: cannot be written, {reason}. All runs that are finished "
            "are kept; run the study again to go on."
        ) from error


def _about(outcome: Outcome) -> dict[str, Any]:
    """Give all of an outcome but its records."""
    names = [field.name for field in fields(outcome) if field.name != "records"]
    return {name: getattr(outcome, name) for name in names}


def _packed(run: Run, outcome: Outcome) -> bytes:
    """Pack a run into the bytes of an npz file, whose checksums tell whether it was damaged."""
    records = outcome.records
    header = {
        "format": _FORMAT,
        "digest": run.digest,
        "identity": run.identity,
        **_about(outcome),
    }
    plans, objectives = (records[-1].plans if records else None) or (None, np.empty((0, 2)))
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        header=np.frombuffer(json.dumps(header).encode(), np.uint8),
        evaluations=np.array([record.evaluations for record in records], np.int64),
        seconds=np.array([record.seconds for record in records], np.float64),
        ties=np.array([record.ties for record in records], np.int64),
        n_points=np.array([record.front_size for record in records], np.int64),
        points=np.concatenate([np.empty((0, 2)), *(r.objectives for r in records)]),
        plan_objectives=objectives,
        plan_nodes=np.empty(0, np.int32) if plans is None else plans.nodes,
        plan_offsets=np.zeros(1, np.int64) if plans is None else plans.offsets,
    )
    return buffer.getvalue()


def _unpacked(data: bytes, run: Run) -> Outcome:
    if not data.startswith(b"PK"):  # numpy would advise to unpickle it
        raise ValueError("not an npz file")
    with np.load(io.BytesIO(data)) as file:
        header: dict[str, Any] = json.loads(file["header"].tobytes())
        arrays = {name: file[name] for name in file.files if name != "header"}
    if header.pop("format") != _FORMAT or header.pop("digest") != run.digest:
        raise ValueError("not the file of this run")
    del header["identity"]
    ends = np.cumsum(arrays["n_points"])
    if len(arrays["points"]) != (ends[-1] if len(ends) else 0):
        raise ValueError("records and points do not fit")
    fronts = np.split(arrays["points"], ends[:-1]) if len(ends) else []
    plans = PlanBatch(arrays["plan_nodes"], arrays["plan_offsets"], run.mission.mission.robots)
    if "ties" not in arrays:  # before ties were told apart, all plans were counted
        arrays["ties"] = arrays["front_size"] - arrays["n_points"]
    columns = (arrays[name].tolist() for name in ("evaluations", "seconds", "ties"))
    records = [
        Record(evaluations, seconds, front, ties)
        for evaluations, seconds, ties, front in zip(*columns, fronts, strict=True)
    ]
    if records:
        records[-1] = replace(records[-1], plans=(plans, arrays["plan_objectives"]))
    return Outcome(**header, records=tuple(records))
