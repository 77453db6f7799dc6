"""Reading a study file, and checking all of it before anything runs."""

import json
import os
from collections.abc import Iterable, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any, get_args

import numpy as np
from pydantic import BaseModel, ValidationError

from botohe_moo.base.documents import Document, DocumentError
from botohe_moo.base.files import read_bytes
from botohe_moo.base.messages import most_alike, quoted
from botohe_moo.base.parameters import content_faults
from botohe_moo.study.file.checking import CheckedContent, Fault, Place
from botohe_moo.study.file.config import StudyFile
from botohe_moo.study.file.model import MANIFEST, Study, StudyError, seeds_of, study_folder


def load_study(
    source: str | os.PathLike[str] | Mapping[str, Any], *, out: str | os.PathLike[str] | None = None
) -> Study:
    """Read a study file, and check all of it before anything runs.

    Parameters
    ----------
    source
        Path of a YAML file, or the content of one as a mapping.
    out
        Folder of the study's results, if not ``results/NAME``. Earlier results in it tell from
        which package an algorithm or mission was that is not known any more.

    Raises
    ------
    StudyError
        If there are faults; lists each with its file and line, what was expected and found.

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
    path, document = Path(), None
    if isinstance(source, Mapping):
        content = _as_json(source)
        text = json.dumps(content, indent=1, ensure_ascii=False) + "\n"  # JSON is YAML, too
    else:
        path = Path(source)
        text = _read_text(path)
        try:
            document = Document(text)
        except DocumentError as error:
            raise StudyError(f"{path}:{error}") from None
        content = _as_json(document.content, f"{path}: ")
    file, faults = None, []
    try:
        file = StudyFile.model_validate(content)
    except ValidationError as invalid:
        faults = [*content_faults(content, invalid, _known_keys)]
    checked = CheckedContent(content, file, path.parent, _missing_packages(content, out))
    faults += checked.faults
    if faults or file is None:
        raise StudyError("\n".join(_lines(faults, path, document)))
    missions, algorithms = tuple(checked.missions), tuple(checked.algorithms)
    return Study(file, text, missions, algorithms, seeds_of(file.seeds))


def _known_keys(place: Place) -> list[str]:
    """Return the keys that the mapping at a place may have."""
    model: type[BaseModel] = StudyFile
    for step in place[:1] + place[2:]:  # the second is the label of a mission or algorithm
        model = _model_in(model.model_fields[str(step)].annotation) or model
    return list(model.model_fields)


def _model_in(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(_model_in, get_args(annotation))), None)


def _lines(faults: Iterable[Fault], path: Path, document: Document | None) -> list[str]:
    """Return a line of text for each fault, each once, in the order of the file if there is one."""
    numbered: dict[tuple[int, str], None] = {}
    for place, sentence in faults:
        line = document.line(place) if document else 0
        text = f"{'.'.join(map(str, place))}: {sentence}" if place else sentence
        numbered[line, " ".join(text.split())] = None
    ordered = sorted(numbered, key=lambda entry: entry[0])
    return [f"{path}:{line}: {text}" if document else text for line, text in ordered]


def _as_json(content: Any, where: str = "") -> Any:
    """Return content with the types of JSON only: mappings, lists, texts, numbers, flags."""
    try:
        return json.loads(json.dumps(content, default=_plain))
    except (TypeError, RecursionError, ValueError) as error:  # such as one that contains itself
        raise StudyError(f"{where}Expected what a study file can hold: {error}.") from None


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"got {quoted(value)}")


def _read_text(path: Path) -> str:
    try:
        return read_bytes(path).decode("utf-8-sig")
    except FileNotFoundError:
        beside = most_alike(path.name, (p.name for p in path.parent.glob("[!.]*.y*ml")))
        raise StudyError(f"{path}: there is no such file{beside}.") from None
    except (OSError, ValueError) as error:  # such as text that is not UTF-8
        raise StudyError(f"{path}: cannot be read ({error}).") from None


def _missing_packages(content: Any, out: str | os.PathLike[str] | None) -> dict[str, str]:
    """Return packages that are not installed any more, by the names that earlier results have.

    Algorithms, missions and problems are named in the manifest of the study, if there is one.
    """
    name = content.get("name") if isinstance(content, dict) else None
    try:
        manifest = json.loads(read_bytes(study_folder(name, out) / MANIFEST))
        entries = [
            *((entry["algorithm"], entry) for entry in manifest["algorithms"].values()),
            *((entry["source"]["name_or_path"], entry) for entry in manifest["missions"].values()),
        ]
        if problem := manifest.get("problem"):
            entries.append((problem["problem"], problem))
        return {
            name: f"{entry['package']} {entry['version']}"
            for name, entry in entries
            if entry["package"] is not None
            and not any(metadata.distributions(name=entry["package"]))
        }
    # There is no manifest, or it is that of something else.
    except (OSError, ValueError, RecursionError, KeyError, TypeError, AttributeError):
        return {}
