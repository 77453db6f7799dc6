"""Helpers are optimised where kernels contain them, not also as libraries of their own."""

from typing import Any

import numba
from numba.core import event, targetconfig
from numba.core.caching import NullCache
from numba.core.codegen import CPUCodeLibrary
from numba.core.cpu import CPUContext

# Other versions may be made otherwise: with them numba compiles as it is, which takes longer and
# gives the same results.
_TRIED = ((0, 68), (0, 68))


class _CompilingHelpers(event.Listener):
    """Knows whether what numba compiles at the moment is a helper, within a kernel."""

    def __init__(self) -> None:
        self._uncached: list[bool] = []

    def on_start(self, event: Any) -> None:
        self._uncached.append(isinstance(event.data["dispatcher"]._cache, NullCache))

    def on_end(self, event: Any) -> None:  # noqa: ARG002
        self._uncached.pop()

    def __bool__(self) -> bool:
        stack: Any = targetconfig.ConfigStack
        flags = stack.top_or_none()
        nested = len(self._uncached) > 1 and self._uncached[-1]
        return bool(nested and flags is not None and flags.no_cpython_wrapper)


def leave_helpers_to_kernels() -> None:
    """Let numba make no machine code of functions that only kernels call.

    numba optimises every function as a library of its own and makes machine code of it, and
    optimises it again in every kernel that it is linked into. Of a helper, which nobody calls from
    Python, the first is in vain; without it, compiling takes half the time. Functions that are not
    compiled within a kernel, and all that have a way in from Python, are left to numba.
    """
    if not _TRIED[0] <= numba.version_info.short <= _TRIED[1]:
        return
    compiling_helper = _CompilingHelpers()
    library: Any = CPUCodeLibrary
    context: Any = CPUContext
    optimize, finish = library._optimize_final_module, library._finalize_final_module
    make_executable = context.get_executable

    def optimize_unless_helper(self: Any) -> None:
        if not compiling_helper:
            optimize(self)

    def finish_unless_helper(self: Any) -> None:
        if not compiling_helper:
            finish(self)
            return
        self._finalize_dynamic_globals()
        self._finalized = True

    def executable_unless_helper(self: Any, made: Any, *described: Any) -> Any:
        if not compiling_helper:
            return make_executable(self, made, *described)
        made._ensure_finalized()
        return [].append  # a way in that nobody takes; numba wants each to be another object

    library._optimize_final_module = optimize_unless_helper
    library._finalize_final_module = finish_unless_helper
    context.get_executable = executable_unless_helper
    register: Any = event.register
    register("numba:compile", compiling_helper)
