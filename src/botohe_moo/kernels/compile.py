"""How every kernel is compiled."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Compile ``function`` on its first call and keep the machine code for later processes.

    Kernels hold no lock (``nogil``), so that threads can share the work, and follow IEEE
    arithmetic (a division by zero is inf, not an exception that a hot loop has to test for).
    """
    return cast("Function", _compile(function, nogil=True, error_model="numpy"))


def inline(function: Function) -> Function:
    """Compile a small helper that kernels call in their hottest loops, into those loops."""
    compiled = _compile(function, nogil=True, error_model="numpy", inline="always")
    return cast("Function", compiled)


def _compile(function: Callable[..., Any], **options: Any) -> Any:
    try:
        return njit(cache=True, **options)(function)
    except RuntimeError:  # no folder is writable, as in some containers: compile in every process
        return njit(**options)(function)
