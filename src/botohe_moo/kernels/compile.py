"""How every kernel is compiled."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit
from numba.extending import register_jitable

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


def frugal(function: Function) -> Function:
    """Compile a kernel that makes no arrays, and so does not count who uses those it is given."""
    compiled = _compile(function, nogil=True, error_model="numpy", _nrt=False)
    return cast("Function", compiled)


def part(function: Function) -> Function:
    """Compile a part of a kernel, which the kernel contains after optimisation.

    A call that is left hands over every array of every tuple, one word after another: for parts
    that take whole tuples this costs more than what they do.
    """
    options = {"forceinline": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return cast("Function", _compile(function, error_model="numpy", _nrt=False, **options))


def routine(function: Function) -> Function:
    """Compile a larger part of a kernel, which only kernels call, and not too often."""
    options = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return cast("Function", _compile(function, error_model="numpy", _nrt=False, **options))


def everywhere(function: Function) -> Function:
    """Leave a small function as it is for Python, and compile it into the kernels that call it."""
    shared: Function = register_jitable(function)
    return shared


def _compile(function: Callable[..., Any], **options: Any) -> Any:
    try:
        return njit(cache=True, **options)(function)
    except RuntimeError:  # no folder is writable, as in some containers: compile in every process
        return njit(**options)(function)
