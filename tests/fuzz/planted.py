"""Readers with faults, each of which fuzzing has to find."""

import os
import pickle
import subprocess
import sys
import time
import warnings
from pathlib import Path
from typing import Any

from tests.fuzz.oracle import Target


def _sound(folder: Path) -> str:
    data = (folder / "a").read_bytes()
    if data != b"sound":
        raise ValueError(f"{folder / 'a'}: expected something sound.")
    return "sound"


def _bug(folder: Path) -> str:
    return {"a": "b"}["c"]


def _no_name(folder: Path) -> None:
    raise ValueError("It is wrong.")


def _long(folder: Path) -> None:
    raise ValueError(f"{folder}: {'x' * 5_000}")


def _many_lines(folder: Path) -> None:
    raise ValueError(f"{folder}:\n" * 1_000)


def _others_error(folder: Path) -> None:
    raise subprocess.SubprocessError(f"{folder}: what nobody expects")


def _exit(folder: Path) -> None:
    sys.exit(1)


def _warning(folder: Path) -> None:
    warnings.warn("overflow", RuntimeWarning, stacklevel=1)


def _write(folder: Path) -> None:
    (folder.parent / "outside" / "x").write_text("changed")


def _write_here(folder: Path) -> None:
    Path("x").write_text("new")


def _write_and_remove(folder: Path) -> None:
    path = folder.parent / "y"
    path.touch()
    path.unlink()


def _start(folder: Path) -> None:
    subprocess.run(["true"], check=True)


def _unpickle(folder: Path) -> Any:
    return pickle.loads(b"cos\nsystem\n.")


def _memory(folder: Path) -> int:
    return len(b"x" * (600 * 2**20))


def _addresses(folder: Path) -> int:
    return len(bytearray(3 * 2**30))


def _hang(folder: Path) -> None:
    time.sleep(60)


def _crash(folder: Path) -> None:
    os.abort()


def _unusable(value: str, folder: Path) -> None:
    raise ZeroDivisionError


def _target(name: str, read: Any, use: Any = None) -> Target:
    """Give a target that is sound for its seed, and after that has its fault."""
    n_read: list[None] = []

    def reads(folder: Path) -> Any:
        n_read.append(None)
        return _sound(folder) if len(n_read) == 1 else read(folder)

    def uses(value: Any, folder: Path) -> None:
        if use is not None and len(n_read) > 1:
            use(value, folder)

    return Target(name, 5, lambda: [{"a": b"sound"}], lambda rng, files: files, reads, uses)


SOUND = Target(
    *("sound", 5, lambda: [{"a": b"sound"}]),
    lambda rng, files: {"a": rng.choice((b"sound", b"broken"))},
    _sound,
)
# What the faults are called when they are found.
FAULTS = {
    "bug": (_bug, "KeyError"),
    "no name": (_no_name, "does not name the file"),
    "long": (_long, "the longest of 5,0"),
    "many lines": (_many_lines, "1000 lines"),
    "other's error": (_others_error, "SubprocessError"),
    "exit": (_exit, "SystemExit"),
    "warning": (_warning, "RuntimeWarning: overflow"),
    "write": (_write, "outside/x"),
    "write here": (_write_here, "current/x"),
    "write and remove": (_write_and_remove, "place/y"),
    "start": (_start, "subprocess.Popen"),
    "unpickle": (_unpickle, "pickle.find_class"),
    "memory": (_memory, "it took 6.. MiB"),
}
PLANTED = {name: _target(name, read) for name, (read, _) in FAULTS.items()}
PLANTED["unusable"] = _target("unusable", _sound, _unusable)
# Those with which the process ends, or that only its limits find.
TARGETS = {
    "sound": SOUND,
    "hang": _target("hang", _hang),
    "crash": _target("crash", _crash),
    "addresses": _target("addresses", _addresses),
}
