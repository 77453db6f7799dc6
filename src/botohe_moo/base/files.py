"""Files that are read, and files that are written whole."""

from __future__ import annotations

import contextlib
import csv
import errno
import functools
import io
import itertools
import json
import os
import re
import secrets
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from botohe_moo.base.messages import FaultsError, quoted

if TYPE_CHECKING:
    import pandas as pd

    from botohe_moo.base.documents import Document

FilePath: TypeAlias = str | os.PathLike[str]

FILE, FAULTS = "botohe_moo file", "botohe_moo faults"  # attributes of tables read from files


class Source:
    """A file that is read: its path, its bytes, and its content as text, JSON or YAML.

    Examples
    --------
    >>> from botohe_moo import load_mission, save_mission
    >>> from botohe_moo.mission import Source
    >>> save_mission(load_mission("toy"), "site.json")
    >>> Source("site.json").json["graph"]["name"]
    'toy'
    """

    def __init__(self, path: FilePath) -> None:
        self.path = Path(path)

    @functools.cached_property
    def data(self) -> bytes:
        """The bytes of the file; a FaultsError names one that cannot be read."""
        try:
            return read_bytes(self.path)
        except FileNotFoundError:
            fault = "no such file"
        except OSError as error:
            fault = f"cannot be read: {error.strerror}"
        raise FaultsError(fault, str(self.path))

    @functools.cached_property
    def text(self) -> str:
        """The file as a text in UTF-8; a UnicodeDecodeError if it is not UTF-8."""
        return self.data.decode("utf-8-sig")

    @functools.cached_property
    def json(self) -> Any:
        """The content of a JSON file; a ValueError if it is not JSON, or repeats a key."""
        return read_json(self.text)

    @functools.cached_property
    def yaml(self) -> Document:
        """The content of a YAML file, with lines of values; a ValueError if it is not YAML."""
        # Imported late: it takes time, and most missions are not in YAML.
        from botohe_moo.base.documents import Document

        try:
            return Document(self.text)
        except ValueError as error:
            raise ValueError(f"line {error}") from None


def read_bytes(path: Path) -> bytes:
    """Read a file; an OSError refuses folders, and devices and pipes, which may have no end."""
    _check_regular(path)
    return path.read_bytes()


def read_json(text: str | bytes) -> Any:
    """Return the content of a JSON text; a ValueError if it is not JSON, or repeats a key."""
    try:
        return json.loads(text, object_pairs_hook=_object)
    except json.JSONDecodeError as error:
        raise ValueError(f"expected JSON: {error}") from None


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"expected each key of an object once, found {quoted(twice)} twice")
    return content


def _check_regular(path: Path) -> None:
    """Refuse, with an OSError, a folder, a device or a pipe; the file need not exist."""
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, "expected a file, found a folder", str(path))
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "expected a file, found a device or a pipe", str(path))


def check_file(path: Path) -> None:
    """Refuse, with an OSError, a file in a folder that does not exist, or in place of a folder."""
    if not path.parent.exists():
        raise FileNotFoundError(errno.ENOENT, "there is no such folder", str(path.parent))
    if not path.parent.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "expected a folder, found a file", str(path.parent))
    _check_regular(path)


def check_folder(folder: Path) -> None:
    """Refuse, with an OSError, a folder that cannot be written to; it need not exist."""
    there = next(path for path in (folder, *folder.parents) if path.exists())
    if not there.is_dir() or not os.access(there, os.W_OK):
        place = "it" if there == folder else str(there)
        fault = "cannot be written to" if there.is_dir() else "is a file"
        raise OSError(f"{folder}: expected a folder to write to; {place} {fault}.")


def suffix_fault(path: Path, known: Collection[str]) -> str:
    """Say what is wrong with the suffix of a file's name; nothing if it is a ``known`` one."""
    if path.suffix.lower() in known:
        return ""
    found = f"the suffix {path.suffix!r}" if path.suffix else "no suffix"
    return f"expected a file name that ends in one of {', '.join(known)}; found {found}"


def check_suffix(path: Path, known: Collection[str]) -> None:
    """Refuse, with a ValueError, a file name that has none of the ``known`` suffixes."""
    if fault := suffix_fault(path, known):
        raise ValueError(f"{path}: {fault}.")


@contextlib.contextmanager
def new_folder(wanted: Path) -> Iterator[Path]:
    """Make a folder that was not there; it is removed, with its parents, if it is left empty.

    Where there is a folder of the ``wanted`` name, ``-2``, ``-3`` and so on is added.
    """
    missing = [path for path in wanted.parents if not path.exists()]
    wanted.parent.mkdir(parents=True, exist_ok=True)
    names = (wanted.with_name(f"{wanted.name}-{number}") for number in itertools.count(2))
    for made in itertools.chain([wanted], names):
        with contextlib.suppress(FileExistsError):
            made.mkdir()  # at once, so that no other process takes it
            break
    try:
        yield made
    finally:
        for path in (made, *missing):
            with contextlib.suppress(OSError):
                path.rmdir()


def replace_file(path: Path, data: bytes) -> None:
    """Write ``data`` to a file in one step: it appears complete, or stays as it was.

    A symlink stays: the file that it leads to is written, and keeps its permissions. An OSError
    refuses devices and pipes, which would be replaced by a file.
    """
    target = Path(os.path.realpath(path))
    check_file(target)
    temporary = target.with_name(f".{secrets.token_hex(8)}.tmp")
    try:
        with temporary.open("xb") as file:
            if target.exists():
                temporary.chmod(target.stat().st_mode & 0o7777)
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(target)
    except OSError as error:  # which would name the temporary file
        raise OSError(error.errno, error.strerror, str(path)) from None
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


def read_table(path: FilePath) -> pd.DataFrame:
    """Read a CSV file of texts, whose index is the number of each row in a spreadsheet.

    Cells are separated by commas, semicolons or tabs: by what a first line such as ``sep=;`` says,
    or by what the header has most of. Empty rows are left out, and so are rows with too few or too
    many cells: they are in the attribute `FAULTS`. A ValueError names the file and what is wrong
    with it.
    """
    import pandas as pd

    try:
        text = Source(path).text
    except UnicodeDecodeError as error:
        remedy = "save it as 'CSV UTF-8', as spreadsheets call it"
        raise ValueError(f"{path}: {error}; {remedy}") from None
    first, _, rest = text.lstrip().partition("\n")
    separator = max(",;\t", key=first.count)
    if re.fullmatch(r'"?sep=[,;\t]"?\r?', first, re.IGNORECASE):  # of Excel
        text = f"\n{rest}"
    lines = csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True)
    try:
        rows = {i: cells for i, cells in enumerate(lines, 1) if any(map(str.strip, cells))}
    except csv.Error as error:  # such as a quote that does not end
        raise ValueError(f"{path}: line {lines.line_num}: {error}") from None
    if not rows:
        raise ValueError(f"{path}: expected a first row of column names, found an empty file")
    header = rows.pop(next(iter(rows)))
    whole = {i: cells for i, cells in rows.items() if len(cells) == len(header)}
    table = pd.DataFrame([*whole.values()], pd.Index([*whole], dtype=int), header, dtype=object)
    table.attrs[FILE] = str(path)
    table.attrs[FAULTS] = [
        f"{path}, row {i}: expected {len(header)} cells, as the first row has, found {len(cells)}"
        for i, cells in rows.items()
        if i not in whole
    ]
    return table


def filled_cells(
    frame: pd.DataFrame, names: Sequence[str], table: str
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the place and the non-empty cells of each row; places begin with ``table``.

    Columns have ``names``; one with an empty name is left out. Texts lose the blanks around them.
    """
    cells = frame.astype(object).where(frame.notna(), None)
    for index, *values in cells.itertuples(name=None):
        stripped = (value.strip() or None if isinstance(value, str) else value for value in values)
        filled = zip(names, stripped, strict=True)
        yield f"{table}, row {index}", {key: v for key, v in filled if key and v is not None}
