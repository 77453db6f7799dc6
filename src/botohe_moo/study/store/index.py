"""What is known of the files of runs, so that those that have not changed need not be read."""

from __future__ import annotations

import contextlib
import hashlib
import json
from typing import TYPE_CHECKING, NamedTuple

from pydantic import TypeAdapter

from botohe_moo._base.files import read_bytes, replace_file

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from pathlib import Path

__all__ = ["Entry", "read_index", "write_index"]

INDEX = ".index.json"


class Entry(NamedTuple):
    """A run's file, which was read and found to be whole.

    Attributes
    ----------
    size, changed, touched
        Its size in bytes, when its content has changed, and when anything of it has, in ns; a
        file of which these are the same is taken to be the same.
    content
        Digest of its content.
    seconds
        How long the run took.
    """

    size: int
    changed: int
    touched: int
    content: str
    seconds: float

    @classmethod
    def of(cls, state: os.stat_result, data: bytes, seconds: float) -> Entry:
        """Describe a file.

        Parameters
        ----------
        state
            What the system says of it.
        data
            Its content.
        seconds
            How long its run took.
        """
        content = hashlib.sha256(data).hexdigest()[:16]
        return cls(*_stamp(state), content, seconds)

    def is_of(self, state: os.stat_result) -> bool:
        """Tell whether a file is the one that was read.

        Parameters
        ----------
        state
            What the system says of it.
        """
        return _stamp(state) == self[:3]


def _stamp(state: os.stat_result) -> tuple[int, int, int]:
    return state.st_size, state.st_mtime_ns, state.st_ctime_ns


_ENTRIES = TypeAdapter(dict[str, Entry])


def read_index(folder: Path) -> dict[str, Entry]:
    """Read what is known of a study's runs; nothing where that is not there, or damaged.

    Parameters
    ----------
    folder
        The study's folder.
    """
    with contextlib.suppress(OSError, ValueError, RecursionError):
        return _ENTRIES.validate_json(read_bytes(folder / INDEX))
    return {}


def write_index(folder: Path, entries: Mapping[str, Entry]) -> None:
    """Keep what is known of a study's runs.

    Parameters
    ----------
    folder
        The study's folder.
    entries
        The files of its finished runs, by name of the run.

    Raises
    ------
    OSError
        If the folder cannot be written to.
    """
    if entries != read_index(folder):
        replace_file(folder / INDEX, json.dumps(entries).encode())
