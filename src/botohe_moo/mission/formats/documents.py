"""Reading files, and what is wrong in those of other programs by its line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from pydantic import BaseModel, ValidationError

from botohe_moo._base.files import read_bytes
from botohe_moo._plugins.faults import way_into, wrong_value
from botohe_moo.mission.validation import MissionError

if TYPE_CHECKING:
    from botohe_moo._base.document import Document

M = TypeVar("M", bound=BaseModel)


def validated(document: Document, model: type[M]) -> M:
    """Return the content of a document, a mapping, as a model; a MissionError lists all faults."""
    try:
        return model.model_validate(document.content)
    except ValidationError as invalid:
        errors = invalid.errors(include_url=False)
    faults = []
    for error in errors:
        way = way_into(document.content, error["loc"])
        start = max((i for i, key in enumerate(way) if isinstance(key, str)), default=None)
        name = "the file"
        if start is not None:
            name = f"{way[start]}{''.join(f'[{key}]' for key in way[start + 1 :])}"
        said = wrong_value(name, error).rstrip(".").replace("Expected", "expected", 1)
        faults.append(f"line {document.line(way)}: {said}" if way else said)
    raise MissionError(faults)


def json_record(path: Path, data: bytes, model: type[M]) -> M:
    """Return the content of a JSON file that this package wrote; a ValueError names one fault."""
    try:
        return model.model_validate_json(data)
    except ValidationError as error:
        first = error.errors()[0]
    if first["type"] == "json_invalid":
        raise ValueError(f"{path}: {first['msg']}.")
    way = first["loc"][:-1] if first["type"] == "missing" else first["loc"]
    name = ".".join(map(str, way)) or "its content"
    raise ValueError(f"{path}: {wrong_value(name, first)}")


def file_content(path: Path) -> bytes:
    """Return what is in a file; the MissionError for what cannot be read names the file."""
    try:
        return read_bytes(path)
    except FileNotFoundError:
        raise MissionError("there is no such file", str(path)) from None
    except OSError as error:
        raise MissionError(f"the file cannot be read: {error.strerror}", str(path)) from None
