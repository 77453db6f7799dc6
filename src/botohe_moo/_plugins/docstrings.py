"""What numpydoc docstrings say of functions and classes, and of their parameters."""

import functools
import inspect
import re
from collections.abc import Callable
from typing import Any


def _docstring_of(function: Callable[..., Any]) -> str:
    """Return the docstring of a function or class, also of one with some arguments fixed."""
    # A partial would answer with what partials are.
    documented = function.func if isinstance(function, functools.partial) else function
    return inspect.getdoc(documented) or ""


def summary_of(function: Callable[..., Any]) -> str:
    """Return the paragraph that a docstring begins with, in one line; may be empty."""
    return " ".join(_docstring_of(function).partition("\n\n")[0].split())


def described_parameters(function: Callable[..., Any]) -> dict[str, str]:
    """Read the Parameters sections of the numpydoc docstrings of a function, or class and bases."""
    sources = function.__mro__[-2::-1] if isinstance(function, type) else (function,)
    described: dict[str, str] = {}
    for source in sources:
        described |= _described_by(source)
    return described


def own_parameters(function: Callable[..., Any]) -> list[str]:
    """List what the docstring of a function or class describes, without those of its bases."""
    is_own = not isinstance(function, type) or vars(function).get("__doc__")
    return [*_described_by(function)] if is_own else []


def _described_by(function: Callable[..., Any]) -> dict[str, str]:
    section = re.search(
        r"^Parameters\n-+\n(.*?)(?=^\S[^\n]*\n-+\n|\Z)", _docstring_of(function), re.M | re.S
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
