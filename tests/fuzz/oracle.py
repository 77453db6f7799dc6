"""What must hold whatever a file holds: a value that is of use, or one error that says why not."""

import contextlib
import enum
import os
import shutil
import sys
import traceback
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.fuzz.bits import OUTSIDE

MIB = 2**20
MOST_RESIDENT = 512  # MiB that an input of some kilobytes may take
MOST_ADDRESSES = 2_048  # MiB on top of what a process has when it begins
MOST_LINES = 102  # a fault a line, of which a hundred are shown
MOST_CHARACTERS = 2_000  # of a line

_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_CHANGES = {"os.mkdir", "os.rmdir", "os.remove", "os.rename", "os.symlink", "os.link", "os.chmod"}
_CHANGES |= {"os.truncate", "os.mknod", "os.mkfifo", "os.utime", "os.chown"}
_CALLS = {"subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.fork", "os.forkpty"}
_CALLS |= {"socket.connect", "socket.bind", "webbrowser.open", "pickle.find_class", "os.kill"}


class Odd(enum.Enum):
    """What may be where a file should be."""

    NOTHING = "nothing"  # no file
    FOLDER = "folder"
    PIPE = "pipe"
    LOOP = "link to itself"


Files = Mapping[str, bytes | Odd]


class FaultError(Exception):
    """What must not happen has happened."""


@dataclass
class Target:
    """A reader, what it may read, and what has to be possible with what it has read."""

    name: str
    inputs: int  # of a whole round
    seeds: Any  # () -> list of files that are read
    change: Any  # (Random, files) -> files
    read: Any  # (folder) -> value
    use: Any = None  # (value, folder) -> None
    declared: tuple[type[Exception], ...] = (ValueError, OSError)
    warns: tuple[type[Warning], ...] = ()
    names_file: bool = True
    ready: list[bool] = field(default_factory=list)


class Place:
    """A folder for inputs, beside which nothing may change."""

    def __init__(self, root: Path) -> None:
        self.root = root.resolve()
        self.folder, self.outside = self.root / "in", self.root / "outside"
        self.current = self.root / "current"
        for folder in (self.outside, self.current):
            folder.mkdir(parents=True)
        self.outside.joinpath("x").write_text("not to be changed")
        os.chdir(self.current)

    def fill(self, files: Files) -> None:
        """Hold these files and nothing else."""
        if self.folder.exists():
            shutil.rmtree(self.folder)
        self.folder.mkdir()
        outside = (OUTSIDE.encode(), os.fsencode(self.outside))
        for name, data in files.items():
            path = self.folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            if isinstance(data, bytes):
                path.write_bytes(data.replace(*outside))
            elif data is Odd.FOLDER:
                path.mkdir()
            elif data is Odd.PIPE:
                os.mkfifo(path)
            elif data is Odd.LOOP:
                path.symlink_to(path)

    def beside(self) -> list[tuple[str, int, int]]:
        """List what is beside the folder of inputs."""
        found = []
        for folder in (self.root, self.outside, self.current):
            for entry in os.scandir(folder):
                state = entry.stat(follow_symlinks=False)
                stamp = (state.st_size, state.st_mtime_ns) if entry.is_file() else (0, 0)
                found.append((entry.path, *stamp))
        return sorted(found)


class Watch:
    """Notes what this process writes outside of a folder, starts, connects to or unpickles."""

    def __init__(self) -> None:
        self.allowed: str | None = None
        self.seen: list[str] = []
        sys.addaudithook(self._note)

    @contextlib.contextmanager
    def over(self, folder: Path) -> Iterator[None]:
        self.seen.clear()
        self.allowed = str(folder)
        try:
            yield
        finally:
            self.allowed = None

    def _note(self, event: str, args: tuple[Any, ...]) -> None:
        if self.allowed is None:
            return
        if event == "open":
            path, _, flags = args
            if isinstance(path, str | bytes | os.PathLike) and (flags or 0) & _WRITING:
                self._note_path(event, path)
        elif event in _CHANGES:
            for path in args[: 2 if event == "os.rename" else 1]:
                if isinstance(path, str | bytes | os.PathLike):
                    self._note_path(event, path)
        elif event in _CALLS and not _of_numba(event):
            self.seen.append(f"{event} {args}")

    def _note_path(self, event: str, path: Any) -> None:
        given = Path(os.fsdecode(path))
        real = given.parent.resolve() / given.name  # a link is changed itself, if at all
        if not f"{real}/".startswith(f"{self.allowed}/") and real != Path(os.devnull):
            self.seen.append(f"{event} {real}")


def _of_numba(event: str) -> bool:
    """Tell whether numba's cache of kernels is being read, which is pickled."""
    frame = sys._getframe() if event == "pickle.find_class" else None
    while frame is not None:
        if frame.f_globals.get("__name__", "").startswith("numba."):
            return True
        frame = frame.f_back
    return False


def examine(target: Target, files: Files, place: Place, watch: Watch) -> str:
    """Let a target read files: "accepted" or "refused"; a FaultError says what is wrong."""
    place.fill(files)
    before, memory = place.beside(), _reset_peak()
    with warnings.catch_warnings(record=True) as warned, watch.over(place.folder):
        warnings.simplefilter("always")
        verdict = _verdict(target, place.folder)
    peak = _peak() - memory
    if watch.seen:
        raise FaultError(f"outside of its folder: {watch.seen[0]}")
    if place.beside() != before:
        raise FaultError(
            f"files beside its folder have changed: {set(place.beside()) ^ set(before)}"
        )
    for one in warned:
        if one.category not in target.warns:
            where = f"{one.filename}:{one.lineno}"
            raise FaultError(f"a warning: {one.category.__name__}: {one.message} ({where})")
    if peak > MOST_RESIDENT:
        raise FaultError(f"it took {peak:.0f} MiB")
    return verdict


def _verdict(target: Target, folder: Path) -> str:
    try:
        value = target.read(folder)
    except target.declared as error:
        check_message(error, folder if target.names_file else None)
        return "refused"
    except (Exception, SystemExit):
        raise FaultError(f"reading raised what it should not:\n{traceback.format_exc()}") from None
    if target.use is not None:
        try:
            target.use(value, folder)
        except Exception:
            raise FaultError(f"what was read cannot be used:\n{traceback.format_exc()}") from None
    return "accepted"


def check_message(error: Exception, folder: Path | None) -> None:
    """Raise a FaultError unless an error says in lines one can read which file is wrong."""
    if type(error).__module__.partition(".")[0] not in ("botohe_moo", "builtins"):
        raise FaultError(f"an error of another package: {type(error)}: {str(error)[:500]}")
    if isinstance(error, UnicodeError):
        raise FaultError(f"an error without a file: {error!r}"[:500])
    name = getattr(error, "filename", None)
    said = str(error)
    if folder is not None and str(folder) not in f"{said} {name}":
        raise FaultError(
            f"a message that does not name the file: {type(error).__name__}: {said[:500]}"
        )
    check_lines(said)


def check_lines(said: str) -> None:
    """Raise a FaultError for a text that is too long to be read."""
    lines = said.splitlines()
    longest = max(lines, key=len, default="")
    if len(lines) > MOST_LINES or len(longest) > MOST_CHARACTERS or not said.strip():
        size = f"{len(lines)} lines, the longest of {len(longest):,} characters"
        raise FaultError(f"a message of {size}: {longest[:500]}")


def _reset_peak() -> float:
    """Let the peak of this process's memory count from here on; give the memory, in MiB."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")
    return _peak()


def _peak() -> float:
    """Give the peak of this process's memory in MiB; 0 where the system does not tell it."""
    try:
        with Path("/proc/self/status").open() as file:
            return next(int(line.split()[1]) for line in file if line.startswith("VmHWM")) / 1024
    except OSError:
        return 0.0
