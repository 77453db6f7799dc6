"""Digests of what results depend on, and the versions of its code."""

import functools
import json
from collections.abc import Iterable, Mapping
from importlib.metadata import version
from typing import Any

from botohe_moo.algorithms.origin import algorithm_origin


def value_text(value: Any) -> str:
    """Write a parameter's value as a study file would: a text as it is, all others as JSON."""
    if isinstance(value, str) and value.isprintable():
        return value
    text = json.dumps(value, ensure_ascii=False)
    return text if text.isprintable() else json.dumps(value)


def canonical(value: Any) -> str:
    """Write what a study file can hold so that equal values give equal texts."""
    return json.dumps(_one_number(value), sort_keys=True, separators=(",", ":"))


def _one_number(value: Any) -> Any:
    """Write 1.0 as 1: whether a number may be one is checked before, and it is the same number."""
    if isinstance(value, float) and value.is_integer():
        return int(value)
    if isinstance(value, dict):
        return {key: _one_number(item) for key, item in value.items()}
    return [_one_number(item) for item in value] if isinstance(value, list | tuple) else value


# This package's algorithms derive from pymoo's.
_PACKAGES = {"version": "botohe-moo", "pymoo": "pymoo"}


@functools.cache
def _version(package: str) -> str:
    return version(package)


def installed_versions() -> dict[str, str]:
    """Return the versions of the packages that every result depends on."""
    return {name: _version(package) for name, package in _PACKAGES.items()}


def code_mismatch(
    versions: Mapping[str, str],
    origins: Iterable[tuple[str, Mapping[str, Any], Mapping[str, str | None]]],
) -> str | None:
    """Return how this process's code differs from that of a study; None if it is the same.

    ``versions`` and ``origins`` are those of the study. Each of ``origins`` is an algorithm's
    name, its parameters and its origin. The text continues a sentence about the worker.
    """
    ours = installed_versions()
    differing = [name for name in versions if versions[name] != ours[name]]
    if differing:
        installed = " and ".join(f"{_PACKAGES[name]} {ours[name]}" for name in differing)
        return f"has {installed}, the study {' and '.join(versions[name] for name in differing)}"
    for algorithm, parameters, origin in origins:
        problem = origin.get("problem")
        try:
            found = algorithm_origin(algorithm, parameters, problem)
        except Exception as error:
            also = f" or the problem {problem!r}" if problem else ""
            return f"cannot import the algorithm {algorithm!r}{also}: {str(error).rstrip('.')}"
        if found != origin:
            return f"has {algorithm!r} from {found}, the study from {origin}"
    return None
