"""What tells runs with different parameters apart: marks of types, values as texts hold them."""

from __future__ import annotations

import enum
import os
from numbers import Number
from typing import Annotated, Any, get_args, get_origin

import numpy as np

from botohe_moo._plugins.types import UNIONS, plain_number

__all__ = ["SameResult", "changes_nothing", "plain_value"]


class SameResult:
    """Marks a parameter that no result depends on, only the time: a number of threads.

    Runs of a study that differ in such parameters only are one run, where no seconds limit them.

    Examples
    --------
    >>> def search(*, workers: Annotated[int, SameResult()] = 1): ...
    """


def changes_nothing(hint: Any) -> bool:
    """Whether a type is marked by :class:`SameResult`.

    Parameters
    ----------
    hint
        A type, maybe ``Annotated``.
    """
    marks = getattr(hint, "__metadata__", ())
    return any(mark is SameResult or isinstance(mark, SameResult) for mark in marks) or (
        get_origin(hint) in (Annotated, *UNIONS) and any(map(changes_nothing, get_args(hint)))
    )


def plain_value(value: Any) -> Any:
    """Write a value as a text file would hold it; ``NotImplemented`` for what none can hold.

    Parameters
    ----------
    value
        Anything, such as a default.
    """
    if isinstance(value, enum.Enum):
        value = value.value
    elif isinstance(value, os.PathLike):
        value = os.fspath(value)
    elif isinstance(value, Number | np.generic):
        value = plain_number(value)
    if value is None or type(value) in (bool, int, float, str):
        return value
    if isinstance(value, list | tuple):
        items = [plain_value(item) for item in value]
        return NotImplemented if any(item is NotImplemented for item in items) else items
    if isinstance(value, dict) and all(isinstance(key, str) for key in value):
        pairs = {key: plain_value(item) for key, item in value.items()}
        return NotImplemented if any(v is NotImplemented for v in pairs.values()) else pairs
    return NotImplemented
