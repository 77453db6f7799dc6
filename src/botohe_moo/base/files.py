"""Files that are read, numbers and flags as texts hold them, and files that are written whole."""

from __future__ import annotations

import contextlib
import errno
import functools
import io
import itertools
import json
import os
import secrets
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from botohe_moo.base.messages import FaultsError, quoted

if TYPE_CHECKING:
    import pandas as pd

    from botohe_moo.base.documents import Document

FilePath: TypeAlias = str | os.PathLike[str]

FLAGS = dict.fromkeys(("true", "yes", "1", "1.0"), True)
FLAGS |= dict.fromkeys(("false", "no", "0", "0.0"), False)
FILE = "botohe_moo file"  # the attribute of tables that says what file they were read from


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
            return self.path.read_bytes()
        except OSError as error:
            raise FaultsError(str(error.strerror).lower(), str(self.path)) from None

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

        return Document(self.text)


def read_json(text: str | bytes) -> Any:
    """Return the content of a JSON text; a ValueError if it is not JSON, or repeats a key."""
    try:
        return json.loads(text, object_pairs_hook=_object)
    except json.JSONDecodeError as error:
        ends = error.msg.startswith("Unterminated") or not error.doc[error.pos :].strip()
        why = "the file is empty or ends too early" if ends else error.msg
        raise ValueError(f"line {error.lineno}: not valid JSON: {why}") from None


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        [(twice, _)] = Counter(key for key, _ in pairs).most_common(1)
        raise ValueError(f"expected each key of an object once, found {quoted(twice)} twice")
    return content


def check_file(path: Path) -> None:
    """Refuse, with an OSError, a file that cannot be written; it need not exist, its folder must.

    Devices and pipes are refused, since a file would replace them.
    """
    if not path.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, "no such folder", str(path.parent))
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "expected a file, found a folder, device or pipe", str(path))
    check_folder(path.parent)


def check_folder(folder: Path) -> None:
    """Refuse, with an OSError, a folder that cannot be written to; it need not exist."""
    there = next(path for path in (folder, *folder.parents) if path.exists())
    if not (there.is_dir() and os.access(there, os.W_OK)):
        why = os.strerror(errno.EACCES) if there.is_dir() else "expected a folder to write to"
        raise OSError(errno.EACCES, why, str(there))


def check_suffix(path: Path, known: Collection[str]) -> None:
    """Refuse, with a FaultsError, a file name that has none of the ``known`` suffixes."""
    if path.suffix.lower() not in known:
        found = f"the suffix {path.suffix!r}" if path.suffix else "no suffix"
        expected = f"a file name that ends in one of {', '.join(known)}"
        raise FaultsError(f"expected {expected}; found {found}", str(path))


def new_folder(wanted: Path) -> Path:
    """Make a folder that was not there: ``-2``, ``-3`` and so on is added to a name that is taken.

    It is made at once, so that no other process takes it.
    """
    made = wanted
    for number in itertools.count(2):
        with contextlib.suppress(FileExistsError):
            made.mkdir(parents=True)
            break
        made = wanted.with_name(f"{wanted.name}-{number}")
    return made


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
        temporary.unlink(missing_ok=True)


def read_table(path: FilePath) -> pd.DataFrame:
    """Read a CSV file of texts, whose index is the number of each row in a spreadsheet.

    Cells are separated by commas, semicolons or tabs: by what the header has most of. Empty rows
    are left out, and cells that a row lacks are empty. A ValueError names the file and what is
    wrong with it.
    """
    import pandas as pd

    data = Source(path).data
    try:
        text = data.decode("utf-8-sig")
        separator = max(",;\t", key=text.partition("\n")[0].count)
        options: Any = {"dtype": object, "na_filter": False, "skip_blank_lines": False}
        # Without a header, which would be without names for the first of too many cells.
        rows = pd.read_csv(io.StringIO(text), sep=separator, header=None, **options)
    except ValueError as error:  # such as a row with too many cells
        remedy = "; save it as 'CSV UTF-8', as spreadsheets call it"
        found = f"{str(error).strip()}{remedy if isinstance(error, UnicodeError) else ''}"
        raise ValueError(f"{path}: {found}") from None
    rows.index += 1
    table: pd.DataFrame = rows[1:].set_axis([*rows.iloc[0]], axis=1)
    table = table[table.astype(bool).any(axis=1)]
    table.attrs[FILE] = str(path)
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


def read_number(value: Any) -> Any:
    """Convert text to a number, also in lists and mappings; return anything else unchanged."""
    if isinstance(value, Mapping):
        return {kind: read_number(number) for kind, number in value.items()}
    if isinstance(value, list | tuple):
        return [read_number(number) for number in value]
    for number in (int, float) if isinstance(value, str) else ():
        with contextlib.suppress(ValueError):  # text that stays text breaks a rule
            return number(value)
    return value


def read_flag(value: Any) -> Any:
    """Convert text, or 0 or 1, to a flag; return anything else unchanged."""
    return FLAGS.get(str(value).lower(), value)
