"""The index of a study's run files: those that have not changed need not be read again."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from pydantic import TypeAdapter

from botohe_moo._base.files import read_bytes, replace_file

INDEX = ".index.json"


class IndexedFile(NamedTuple):
    """A run's file that was read and found to be whole."""

    # A file of the same size and times is taken to be the same.
    size: int  # bytes
    modified: int  # when its content has changed, in ns
    changed: int  # when its metadata has changed, in ns
    content: str  # digest
    seconds: float  # that the run took

    @classmethod
    def of(cls, state: os.stat_result, data: bytes, seconds: float) -> IndexedFile:
        """Describe a file by its ``stat``, its content and the seconds that its run took."""
        content = hashlib.sha256(data).hexdigest()[:16]
        return cls(*_stamp(state), content, seconds)

    def matches(self, state: os.stat_result) -> bool:
        """Tell whether a file is the one that was read."""
        return _stamp(state) == self[:3]


def _stamp(state: os.stat_result) -> tuple[int, int, int]:
    return state.st_size, state.st_mtime_ns, state.st_ctime_ns


_FILES = TypeAdapter(dict[str, IndexedFile])


def read_index(folder: Path) -> dict[str, IndexedFile]:
    """Read the index by digest of the run; empty where there is none, or it is damaged."""
    with contextlib.suppress(OSError, ValueError, RecursionError):
        return _FILES.validate_json(read_bytes(folder / INDEX))
    return {}


def write_index(folder: Path, files: Mapping[str, IndexedFile]) -> None:
    """Write the index, if it has changed; an OSError says why it cannot be written."""
    if files != read_index(folder):
        replace_file(folder / INDEX, json.dumps(files).encode())
