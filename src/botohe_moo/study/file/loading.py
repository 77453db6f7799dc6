"""Reading a study file: all of it is checked before anything runs."""

import json
import os
import warnings
from collections.abc import Iterable, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from botohe_moo._base.checks import nearest_first
from botohe_moo._base.files import read_bytes
from botohe_moo.study.file.checking import CheckedContent
from botohe_moo.study.file.document import Document, Fault
from botohe_moo.study.file.model import MANIFEST, Study, StudyError, study_folder
from botohe_moo.study.file.shape import MAX_FAULTS, Place, printable

_MAX_BYTES = 1_000_000


def load_study(
    source: str | os.PathLike[str] | Mapping[str, Any], *, out: str | os.PathLike[str] | None = None
) -> Study:
    """Read a study file and check all it says, before anything runs.

    Parameters
    ----------
    source
        Path of a YAML file, or the content of one as a mapping.
    out
        Folder of the study's results, if not ``results/NAME``: it remembers which packages
        algorithms and missions are from, to name those that are missing.

    Raises
    ------
    StudyError
        Lists every fault: the file and line, what was expected and what was found.

    Warns
    -----
    UserWarning
        Names what is allowed but without effect, such as a record beyond every budget.

    Examples
    --------
    >>> from botohe_moo.study import load_study
    >>> study = load_study({
    ...     "name": "trial",
    ...     "missions": ["toy"],
    ...     "algorithms": {"ants": "bo-aco", "NSGA-II": {"algorithm": "nsga2"}},
    ...     "budget": {"evaluations": 1000},
    ...     "seeds": 5,
    ... })
    >>> len(study.runs())
    10
    """
    if isinstance(source, Mapping):
        content = _as_json(source)
        checked = CheckedContent(content, Path(), _missing_packages(content, out))
        faults = [f"{_dotted(at)}{said}" for at, said in checked.faults]
        notices = [f"{_dotted(at)}{said}" for at, said in checked.notices]
        text = json.dumps(content, indent=1) + "\n"  # JSON is YAML, too
    else:
        path = Path(source)
        text = _text(path)
        document = Document.parse(text)
        found, content = list(document.faults), document.content
        checked = CheckedContent(content, path.parent, _missing_packages(content, out))
        if content is not None or not found:  # else there is nothing to check
            found += _with_lines(document, checked.faults)
        faults = [f"{path}:{fault.line}: {fault.message}" for fault in sorted(set(found))]
        notices = [f"{path}:{f.line}: {f.message}" for f in _with_lines(document, checked.notices)]
    if faults:
        more = [f"These are the first {MAX_FAULTS} faults."] if len(faults) >= MAX_FAULTS else []
        raise StudyError("\n".join([*faults[:MAX_FAULTS], *more]))
    for notice in notices:
        warnings.warn(notice, stacklevel=2)
    return checked.study(text)


def _with_lines(document: Document, said: Iterable[tuple[Place, str]]) -> list[Fault]:
    return [Fault(document.line(at), f"{_dotted(at)}{what}") for at, what in said]


def _as_json(source: Mapping[str, Any]) -> Any:
    """Convert a mapping to the values that a file would have."""
    try:
        return json.loads(json.dumps(source, default=_no_json))
    except StudyError:
        raise
    except (TypeError, RecursionError, ValueError) as error:  # such as one that contains itself
        raise StudyError(f"Expected what a study file can hold: {error}.") from None


def _no_json(value: Any) -> Any:
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, np.generic):
        return value.item()
    raise StudyError(f"Expected what a study file can hold, got {value!r}.")


def _text(path: Path) -> str:
    try:
        size = path.stat().st_size
        read = b"" if size > _MAX_BYTES else read_bytes(path)
    except FileNotFoundError:
        among = sorted(p.name for p in path.parent.glob("[!.]*.y*ml"))
        near = f"; beside it are {', '.join(nearest_first(path.name, among))}" if among else ""
        raise StudyError(f"{path}: there is no such file{near}.") from None
    except OSError as error:
        raise StudyError(f"{path}: cannot be read ({error.strerror}).") from None
    except ValueError as error:  # a name with a NUL
        raise StudyError(f"{str(path)!r}: cannot be read ({error}).") from None
    if size > _MAX_BYTES:
        limit, found = f"{_MAX_BYTES / 1e6:g} MB", f"{size / 1e6:.1f} MB"
        raise StudyError(f"{path}: expected a study file of at most {limit}, found {found}.")
    try:
        return read.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise StudyError(
            f"{path}: expected UTF-8 text, found other bytes from {error.start} on."
        ) from None


def _missing_packages(content: Any, out: str | os.PathLike[str] | None) -> dict[str, str]:
    """Name the packages, not installed any more, of what earlier results name as theirs."""
    name = content.get("name") if isinstance(content, dict) else None
    try:
        manifest = json.loads(read_bytes(study_folder(name, out) / MANIFEST))
        entries = [
            *((entry["algorithm"], entry) for entry in manifest["algorithms"].values()),
            *((entry["source"]["name_or_path"], entry) for entry in manifest["missions"].values()),
        ]
        if own := manifest.get("problem"):
            entries.append((own["problem"], own))
        return {
            name: f"{entry['package']} {entry['version']}"
            for name, entry in entries
            if entry["package"] is not None
            and not any(metadata.distributions(name=entry["package"]))
        }
    # There is none, or it is not a study's.
    except (OSError, ValueError, RecursionError, KeyError, TypeError, AttributeError):
        return {}


def _dotted(path: tuple[int | str, ...]) -> str:
    return f"{'.'.join(map(printable, path))}: " if path else ""
