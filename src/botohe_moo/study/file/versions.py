"""Versions of the code that results depend on."""

import functools
from collections.abc import Mapping
from importlib.metadata import version

from botohe_moo.algorithms.origin import algorithm_origin

# This package's algorithms derive from pymoo's.
_PACKAGES = {"version": "botohe-moo", "pymoo": "pymoo"}


@functools.cache
def _version(package: str) -> str:
    return version(package)


def installed_versions() -> dict[str, str]:
    """Give the versions of the packages that every result depends on."""
    return {name: _version(package) for name, package in _PACKAGES.items()}


def code_mismatch(
    versions: Mapping[str, str], origins: Mapping[str, Mapping[str, str | None]]
) -> str | None:
    """Say, after "the worker", how the code here differs from that a study was checked with.

    ``versions`` and ``origins`` are those of the study; None if the code is the same.
    """
    ours = installed_versions()
    differing = [name for name in versions if versions[name] != ours[name]]
    if differing:
        here = " and ".join(f"{_PACKAGES[name]} {ours[name]}" for name in differing)
        return f"has {here}, the study {' and '.join(versions[name] for name in differing)}"
    for algorithm, origin in origins.items():
        try:
            found = algorithm_origin(algorithm)
        except Exception as error:
            return f"cannot import the algorithm {algorithm!r}: {str(error).rstrip('.')}"
        if found != origin:
            return f"has {algorithm!r} from {found}, the study from {origin}"
    return None
