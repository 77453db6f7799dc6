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
    return cast("Function", njit(cache=True, nogil=True, error_model="numpy")(function))


def inline(function: Function) -> Function:
    """Compile a small helper that kernels call in their hottest loops, into those loops."""
    compiled = njit(cache=True, nogil=True, error_model="numpy", inline="always")(function)
    return cast("Function", compiled)
