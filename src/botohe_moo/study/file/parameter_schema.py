"""What the JSON Schema of study files says of the parameters of built-in algorithms and missions.

Those of other packages are not in it, so that it is the same everywhere.
"""

from collections.abc import Callable, Iterable
from typing import Any

from botohe_moo._plugins.stated import Parameter
from botohe_moo._plugins.types import plain_value
from botohe_moo.algorithms.origin import algorithm_origin
from botohe_moo.algorithms.registry import algorithm_names, algorithm_parameters
from botohe_moo.mission.library import mission_names, mission_origin, mission_parameters

_OURS = "botohe-moo"


def algorithm_rules() -> list[dict[str, Any]]:
    """Give a rule for each built-in algorithm: its parameters, their types and ranges."""
    names = [name for name in algorithm_names() if algorithm_origin(name)["package"] == _OURS]
    return _rules("algorithm", names, algorithm_parameters)


def mission_rules() -> list[dict[str, Any]]:
    """Give a rule for each built-in mission; all take ``robots``."""
    names = [name for name in mission_names() if mission_origin(name)["package"] == _OURS]
    return _rules("mission", names, mission_parameters, also={"robots": {}})


def _rules(
    key: str,
    names: Iterable[str],
    parameters_of: Callable[[str], Iterable[Parameter]],
    also: dict[str, Any] | None = None,
) -> list[dict[str, Any]]:
    rules = []
    for name in names:
        single = {p.name: _described(p) for p in parameters_of(name) if p.plain} | (also or {})
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
    known = {} if parameter.required or default is NotImplemented else {"default": default}
    return {**schema, **known, "description": parameter.description}
