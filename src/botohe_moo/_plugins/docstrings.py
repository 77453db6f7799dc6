"""What numpydoc docstrings say of functions and classes, and of their parameters."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable
from typing import Any

__all__ = ["described_parameters", "docstring_of"]


def docstring_of(function: Callable[..., Any]) -> str:
    """Give the docstring of a function or class.

    Parameters
    ----------
    function
        May be one of which some arguments are fixed.
    """
    # A partial would answer with what partials are.
    documented = function.func if isinstance(function, functools.partial) else function
    return inspect.getdoc(documented) or ""


def described_parameters(function: Callable[..., Any]) -> dict[str, str]:
    """Read the Parameters section of a numpydoc docstring, and those of a class's bases."""
    if isinstance(function, type):
        described: dict[str, str] = {}
        for base in reversed(function.__mro__[:-1]):
            described |= _described_by(base)
        return described
    return _described_by(function)


def _described_by(function: Callable[..., Any]) -> dict[str, str]:
    section = re.search(
        r"^Parameters\n-+\n(.*?)(?=^\S[^\n]*\n-+\n|\Z)", docstring_of(function), re.M | re.S
    )
    described: dict[str, str] = {}
    names: list[str] = []
    for line in section[1].splitlines() if section else []:
        if line[:1].strip():
            names = [name.strip(" *") for name in line.partition(":")[0].split(",")]
        elif line.strip():
            for parameter in names:
                described[parameter] = f"{described.get(parameter, '')} {line.strip()}".strip()
    return described
