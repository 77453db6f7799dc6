"""How kernels are compiled: the one place that knows numba's options.

``kernel`` is for what Python calls, ``helper`` and ``inlined`` for what kernels call. Called from
Python, helpers are plain Python. They make no arrays: kernels are handed their scratch, or make it.
"""

import gc
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from numba import njit
from numba.core import event, targetconfig
from numba.core.caching import NullCache
from numba.core.codegen import CPUCodeLibrary
from numba.core.cpu import CPUContext, CPUTargetOptions
from numba.extending import register_jitable

Function = TypeVar("Function", bound=Callable[..., Any])

# Options that numba does not document, tried with 0.61 to 0.68. Where a version does not know one,
# kernels do without: they take longer to compile and to run, and give the same results.
_PRIVATE = {
    "_nrt": False,  # makes no arrays, and so does not count who uses those it is given
    "no_cpython_wrapper": True,  # no way in from Python, which has the function itself
    "no_cfunc_wrapper": True,
    "forceinline": True,  # LLVM copies it into its callers; numba's own inline= compiles for longer
}
_INTERNAL = ("_nrt", "no_cpython_wrapper", "no_cfunc_wrapper")
# IEEE arithmetic: a division by zero is inf, not an exception that a hot loop has to test for.
_EVERYWHERE = {"error_model": "numpy"}


def _private(*names: str) -> dict[str, Any]:
    return {name: _PRIVATE[name] for name in names if hasattr(CPUTargetOptions, name)}


def kernel(function: Function) -> Function:
    """Compile a function for Python to call, on its first call; later processes load it.

    Kernels hold no lock (``nogil``), so that threads can share the work.
    """
    return cast("Function", _compile(function, nogil=True))


def helper(function: Function) -> Function:
    """Let kernels call a function; it makes no arrays."""
    shared: Function = register_jitable(**_EVERYWHERE, **_private(*_INTERNAL))(function)
    return shared


def inlined(function: Function) -> Function:
    """Let kernels contain a function.

    A call hands over every array of every tuple, one word after another: for what is called in hot
    loops this costs more than the work.
    """
    options = _private(*_INTERNAL, "forceinline")
    shared: Function = register_jitable(**_EVERYWHERE, **options)(function)
    return shared


def _compile(function: Callable[..., Any], **options: Any) -> Any:
    compiler: Any = njit
    try:
        return compiler(cache=True, **_EVERYWHERE, **options)(function)
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


class _Unfinished(event.Listener):
    """Leaves helpers to the kernels that contain them, which optimise them again in any case.

    numba optimises every function as a library of its own and makes machine code of it, and does so
    again wherever that library is linked in: for helpers that nobody calls from Python, in vain.
    """

    def __init__(self) -> None:
        self._uncached: list[bool] = []

    def on_start(self, event: Any) -> None:
        self._uncached.append(isinstance(event.data["dispatcher"]._cache, NullCache))

    def on_end(self, event: Any) -> None:  # noqa: ARG002
        self._uncached.pop()

    def applies(self) -> bool:
        """Tell whether a helper is being compiled, within a kernel."""
        flags = targetconfig.ConfigStack.top_or_none()
        nested = len(self._uncached) > 1 and self._uncached[-1]
        return bool(nested and flags is not None and flags.no_cpython_wrapper)

    def install(self) -> None:
        library: Any = CPUCodeLibrary
        optimize, finish = library._optimize_final_module, library._finalize_final_module
        executable = CPUContext.get_executable

        def optimize_kernel(self_: Any) -> None:
            if not self.applies():
                optimize(self_)

        def finish_kernel(self_: Any) -> None:
            if not self.applies():
                finish(self_)
                return
            self_._finalize_dynamic_globals()
            self_._finalized = True

        def executable_kernel(self_: Any, of: Any, *rest: Any) -> Any:
            if not self.applies():
                return executable(self_, of, *rest)
            of._ensure_finalized()
            return [].append  # stands for a way in that nobody takes; each is another one

        library._optimize_final_module = optimize_kernel
        library._finalize_final_module = finish_kernel
        CPUContext.get_executable = executable_kernel
        _register("numba:compile", self)


# Where numba may be made otherwise, kernels compile as it does it: for longer, to the same results.
if (0, 61) <= numba.version_info.short <= (0, 68):
    _Unfinished().install()


# What remains of the former decorators, until all kernels take the one graph.
def inline(function: Function) -> Function:
    """Compile a small helper."""
    return cast("Function", _compile(function, nogil=True, inline="always"))


def frugal(function: Function) -> Function:
    """Compile a kernel that makes no arrays."""
    return cast("Function", _compile(function, nogil=True, _nrt=False))


def part(function: Function) -> Function:
    """Compile a part of a kernel."""
    options = {"forceinline": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return cast("Function", _compile(function, _nrt=False, **options))


def routine(function: Function) -> Function:
    """Compile a larger part of a kernel."""
    options = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return cast("Function", _compile(function, _nrt=False, **options))


def everywhere(function: Function) -> Function:
    """Leave a small function as it is for Python."""
    shared: Function = register_jitable(function)
    return shared
