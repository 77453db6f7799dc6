"""Whether the code here is that with which a study was checked."""

from __future__ import annotations

import functools
from importlib.metadata import version
from typing import TYPE_CHECKING

from botohe_moo.algorithms.origin import algorithm_origin

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["installed_versions", "other_code"]

# pymoo's algorithms are what this package's derive from.
_PACKAGES = {"version": "botohe-moo", "pymoo": "pymoo"}


@functools.cache
def _version(package: str) -> str:
    return version(package)


def installed_versions() -> dict[str, str]:
    """Give the versions of the packages that every result depends on."""
    return {name: _version(package) for name, package in _PACKAGES.items()}


def other_code(
    versions: Mapping[str, str], origins: Mapping[str, Mapping[str, str | None]]
) -> str | None:
    """Say what is not here, or differs from that with which a study was checked.

    Parameters
    ----------
    versions
        What :func:`installed_versions` gave there.
    origins
        What :func:`algorithm_origin` gave there, for each algorithm.

    Returns
    -------
    str or None
        Words that follow "the worker"; None if the code is the same.
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
