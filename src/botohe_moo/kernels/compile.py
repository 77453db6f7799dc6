"""How kernels are compiled: the one place that knows numba's options.

``kernel`` is for what Python calls, ``helper`` and ``inlined`` for what kernels call. Called from
Python, helpers are plain Python.

A named tuple takes some 0.1 µs for each of its arrays when Python hands it to a kernel: kernels
that run for less than a millisecond make their scratch themselves.
"""

import gc
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, TypeVar, cast, overload

from numba import njit
from numba.core import event
from numba.core.cpu import CPUTargetOptions
from numba.extending import register_jitable

from botohe_moo.kernels.linking import leave_helpers_to_kernels

Function = TypeVar("Function", bound=Callable[..., Any])

PLAIN = bool(os.environ.get("BOTOHE_PLAIN_NUMBA"))
"""Whether to do without everything that numba does not document."""

# Options that numba does not document, tried with 0.61 to 0.68. Where a version does not know one,
# kernels do without: they take longer to compile and to run, and give the same results.
# ``_nrt`` off: makes no arrays, and so does not count who uses those it is given.
# ``no_..._wrapper``: no way in from Python or C, which have the function itself.
# ``forceinline``: LLVM copies it into its callers; numba's own ``inline`` compiles for longer.
_PRIVATE = ("_nrt", "no_cpython_wrapper", "no_cfunc_wrapper", "forceinline")
_KNOWN = {name for name in _PRIVATE if hasattr(CPUTargetOptions, name)}
if PLAIN:
    _KNOWN.clear()
# IEEE arithmetic: a division by zero is inf, not an exception that a hot loop has to test for.
_EVERYWHERE = {"error_model": "numpy"}


def _private(*, makes_arrays: bool, forceinline: bool) -> dict[str, bool]:
    options = dict.fromkeys(_PRIVATE, True) | {"_nrt": makes_arrays, "forceinline": forceinline}
    return {name: value for name, value in options.items() if name in _KNOWN}


def kernel(function: Function) -> Function:
    """Compile a function for Python to call, on its first call; later processes load it.

    Kernels hold no lock (``nogil``), so that threads can share the work.
    """
    return cast("Function", _compile(function, nogil=True))


@overload
def helper(function: Function) -> Function: ...


@overload
def helper(*, makes_arrays: bool) -> Callable[[Function], Function]: ...


def helper(function: Any = None, *, makes_arrays: bool = False) -> Any:
    """Let kernels call a function; unless it says so, it makes no arrays.

    Numba compiles it once for each kind of caller (kernels, helpers, inlined functions), and the
    code of what it calls is optimised again in every caller. So what is called in many places is
    best called from helpers only, and chains of calls are best short.
    """
    if function is None:
        return partial(helper, makes_arrays=makes_arrays)
    # Callers hand down to whatever does not set them.
    options = _private(makes_arrays=makes_arrays, forceinline=False)
    return register_jitable(**_EVERYWHERE, **options)(function)


def inlined(function: Function) -> Function:
    """Let kernels contain a function.

    A call hands over every array of every tuple that is not ``shared``, one word after another: for
    what is called in hot loops this costs more than the work.
    """
    options = _private(makes_arrays=False, forceinline=True)
    shared: Function = register_jitable(**_EVERYWHERE, **options)(function)
    return shared


def _has_place_to_keep() -> bool:
    """Return whether there is a place for what is compiled: beside the source, named, or at home.

    Where all three are missing, numba makes a folder named "~" in the one that users stand in, and
    would load code from such a folder that it finds there.
    """
    if {"NUMBA_CACHE_DIR", "XDG_CACHE_HOME"} & os.environ.keys():
        return True
    try:
        return os.access(Path(__file__).parent, os.W_OK) or bool(Path.home())
    except RuntimeError:  # neither is HOME set nor does the system know the user
        return False


_KEEPS = _has_place_to_keep()


def _compile(function: Callable[..., Any], **options: Any) -> Any:
    compiler: Any = njit
    try:
        return compiler(cache=_KEEPS, **_EVERYWHERE, **options)(function)
    except RuntimeError:  # no folder is writable, as in some containers: compile in every process
        return compiler(**_EVERYWHERE, **options)(function)


class _WithoutCollecting(event.Listener):
    """Keeps Python's garbage collector off while numba compiles, which makes millions of objects.

    They are all in use: collecting finds nothing, and takes a tenth of the time.
    """

    def __init__(self) -> None:
        self._depth = 0
        self._was_enabled = False

    def on_start(self, event: Any) -> None:  # noqa: ARG002
        if self._depth == 0:
            self._was_enabled = gc.isenabled()
            gc.disable()
        self._depth += 1

    def on_end(self, event: Any) -> None:  # noqa: ARG002
        self._depth -= 1
        if self._depth == 0 and self._was_enabled:
            gc.enable()


_register: Any = event.register
_register("numba:compile", _WithoutCollecting())
if not PLAIN:
    leave_helpers_to_kernels()
