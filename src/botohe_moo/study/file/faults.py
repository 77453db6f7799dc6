"""What pydantic finds wrong in a study file: places in the file, and a sentence for each."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias, get_args

from pydantic import BaseModel, ValidationError

from botohe_moo._base.checks import nearest_first, quoted
from botohe_moo._plugins.types import own_message, way_into, wrong_value
from botohe_moo.study.file.config import StudyFile

Place: TypeAlias = tuple[int | str, ...]  # keys and positions on the way to a value
Fault: TypeAlias = tuple[Place, str]


def shape_faults(content: Any, invalid: ValidationError) -> list[Fault]:
    """Return the places and sentences of what pydantic found wrong with a file's content."""
    found: dict[Place, list[Mapping[str, Any]]] = {}
    for error in invalid.errors(include_url=False):
        place = way_into(content, error["loc"])
        if error["loc"] and (not place or error["type"] == "missing"):
            place = (*place, error["loc"][-1])  # a key that is not there
        found.setdefault(place, []).append(error)
    return [(place, _sentence(place, errors)) for place, errors in found.items()]


def _sentence(place: Place, errors: Sequence[Mapping[str, Any]]) -> str:
    kind = errors[0]["type"]
    if kind == "missing":
        return f"expected the key {place[-1]!r}, which is missing."
    if kind == "extra_forbidden":
        known = ", ".join(nearest_first(str(place[-1]), _known_keys(place[:-1])))
        return f"there is no key {quoted(place[-1])}; known are {known}."
    if kind == "value_error":
        return f"{own_message(errors[0]).rstrip('.')}."
    name = str(place[-1]) if place else "the study"
    if place and isinstance(place[-1], int):
        name = f"{place[-2]}[{place[-1]}]"
    return wrong_value(name, *errors).removeprefix(f"{name}: ")  # the place says it


def _known_keys(place: Place) -> list[str]:
    """Return the keys that the mapping at a place may have."""
    model: type[BaseModel] = StudyFile
    for step in place[:1] + place[2:]:  # without labels, which come second
        model = _model_in(model.model_fields[str(step)].annotation) or model
    return list(model.model_fields)


def _model_in(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(_model_in, get_args(annotation))), None)
