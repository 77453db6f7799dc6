"""The JSON Schema of study files, with the parameters of built-in algorithms and missions.

Those of other packages are not in it, so that it is the same everywhere.
"""

import json
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from botohe_moo.algorithms.registry import algorithm_names, algorithm_parameters
from botohe_moo.base.parameters import Parameter, plain_value
from botohe_moo.mission.loading import COMMON, mission_names, mission_origin, mission_parameters
from botohe_moo.study.file.config import StudyFile
from botohe_moo.study.file.origin import algorithm_origin


def study_schema() -> str:
    """Return the JSON Schema of study files, with which editors check them."""
    schema = StudyFile.model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["$defs"]["AlgorithmEntry"]["allOf"] = _rules(
        "algorithm", algorithm_names(), algorithm_origin, algorithm_parameters
    )
    schema["$defs"]["MissionEntry"]["allOf"] = _rules(
        "mission", mission_names(), mission_origin, mission_parameters, COMMON
    )
    return json.dumps(schema, indent=1) + "\n"


def _rules(
    key: str,
    names: Iterable[str],
    origin_of: Callable[[str], Mapping[str, str | None]],
    parameters_of: Callable[[str], Iterable[Parameter]],
    also: Iterable[str] = (),
) -> list[dict[str, Any]]:
    """Return a rule for each built-in algorithm or mission: parameters, types and ranges."""
    rules = []
    for name in names:
        if origin_of(name)["package"] != "botohe-moo":
            continue
        single: dict[str, Any] = {key: {} for key in also}
        single |= {p.name: _described(p) for p in parameters_of(name) if p.plain}
        several = {name: {"items": schema} for name, schema in single.items()}
        given = {
            "parameters": {"properties": single, "additionalProperties": False},
            "grid": {"properties": several, "additionalProperties": False},
        }
        condition = {"properties": {key: {"const": name}}, "required": [key]}
        rules.append({"if": condition, "then": {"properties": given}})
    return rules


def _described(parameter: Parameter) -> dict[str, Any]:
    schema = parameter.adapter.json_schema() if parameter.adapter and parameter.plain else {}
    default = plain_value(parameter.default)
    if not (parameter.required or default is NotImplemented):
        schema["default"] = default
    return {**schema, "description": parameter.description}
