"""How kernels are compiled, and when: the one place that knows numba's options.

``at_once`` and ``kernel`` are for what Python calls; ``helper``, ``inlined`` and ``array_maker``
are for what kernels call. Called from Python, functions of these three kinds are plain Python.

A named tuple takes some 0.1 µs for each of its arrays when Python hands it to a kernel: kernels
that run for less than a millisecond make their scratch themselves.

Kernels that are ``at_once`` run as plain Python until their machine code is ready. Both give the
same bits, so that a search may begin at once and go on faster later. One rule decides at each call
of a kernel that has not been compiled for such arguments:

- Python runs it if that takes short, for this call and for the rest of the run at the pace so far.
- If this call would take long, it is compiled here.
- If the rest of the run would, another process compiles it, if there is a processor for that, and
  Python goes on until that is done. It compiles one kernel at a time; others are compiled here.
"""

import gc
import hashlib
import os
import pickle
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, update_wrapper
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, Literal, TypeAlias, TypeVar

import numba
import numpy as np
from numba import extending, njit, types
from numba.core import cgutils, event, imputils, targetconfig
from numba.core.caching import FunctionCache, IndexDataCacheFile, NullCache
from numba.core.codegen import CPUCodeLibrary
from numba.core.cpu import CPUContext, CPUTargetOptions
from numba.core.typing.templates import AttributeTemplate
from numba.extending import register_jitable

from botohe_moo.base.runtime import n_cpus

Function = TypeVar("Function", bound=Callable[..., Any])
Tuple = TypeVar("Tuple", bound=tuple[Any, ...])

# Options that numba does not document, tried with 0.61 to 0.68. Where a version does not know one,
# kernels do without it and give the same results. They compile for a tenth longer, and run up to
# ten times as long (BO-ACO on the museum).
# ``_nrt`` off: the function makes no arrays, and so does not count who uses those it is given.
# ``no_..._wrapper``: Python and C have no entry to the compiled function, and need none.
# ``forceinline``: LLVM copies it into its callers; numba's own ``inline`` compiles for longer.
_PRIVATE = ("_nrt", "no_cpython_wrapper", "no_cfunc_wrapper", "forceinline")
_KNOWN = {name for name in _PRIVATE if hasattr(CPUTargetOptions, name)}
# IEEE arithmetic: a division by zero is inf, not an exception that a hot loop has to test for.
_EVERYWHERE = {"error_model": "numpy"}


def kernel(function: Function) -> Function:
    """Compile a function for Python to call, on its first call; later processes load it.

    Kernels hold no lock (``nogil``), so that threads can share the work.
    """
    compiled: Any = njit(nogil=True, **_EVERYWHERE)(function)
    if hasattr(compiled, "enable_caching"):  # else numba is told to compile nothing
        with suppress(RuntimeError):  # no folder is writable, as in some containers
            compiled._cache = _KernelCache(function)
    return compiled  # type: ignore[no-any-return]


def can_keep(kernel: Any) -> bool:
    """Return whether machine code of a kernel can be on disk, for other processes to load."""
    return isinstance(kernel._cache, _KernelCache) and kernel.py_func.__module__ != "__main__"


def is_kept(kernel: Any, signature: tuple[Any, ...]) -> bool:
    """Return whether machine code of a kernel for arguments of some types is on disk."""
    return can_keep(kernel) and kernel._cache.is_kept(signature, kernel.targetctx.codegen())


class _KernelCache(FunctionCache):
    """numba's cache of a kernel, in files that are named by the sources it was compiled from.

    numba itself compares one file with its date: it would run machine code of helpers that have
    changed since, and fail where a class in the cache has moved. Files that are damaged are written
    again.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        digest = _digest(Path(function.__code__.co_filename).parent)
        self._stem = f"{self._impl.filename_base}-{digest}"
        self._cache_file = IndexDataCacheFile(self._cache_path, self._stem, source_stamp=None)

    def load_overload(self, *described: Any) -> Any:
        """Return what was kept, or None."""
        try:
            return super().load_overload(*described)
        except Exception:  # whatever damaged files may cause
            self.flush()
            return None

    def save_overload(self, *made: Any) -> None:
        """Keep machine code; forget that of other sources."""
        super().save_overload(*made)
        function, _, version = self._impl.filename_base.rpartition(".")
        stale = f"{function.rpartition('-')[0]}-*.{version}-*.nb[ci]"
        for path in Path(self._cache_path).glob(stale):
            if not path.name.startswith(self._stem):
                path.unlink(missing_ok=True)

    def is_kept(self, signature: Any, codegen: Any) -> bool:
        """Return whether there is machine code of the present sources for a signature."""
        try:
            name = self._cache_file._load_index().get(self._index_key(signature, codegen))
        except Exception:  # whatever damaged files may cause
            return False
        return name is not None and Path(self._cache_path, name).exists()  # written after the index


@cache
def _digest(folder: Path) -> str:
    """Return a digest of the modules in a folder and in this one.

    Kernels call nothing else: they import only ``core`` and what lies in their own folder.
    """
    paths = {path for where in (folder, Path(__file__).parent) for path in where.glob("*.py")}
    texts = b"".join(path.read_bytes() for path in sorted(paths))
    return hashlib.sha256(texts).hexdigest()[:12]


def helper(function: Function) -> Function:
    """Let kernels call a function that makes no arrays.

    Numba compiles it once for each kind of caller (kernels, helpers, inlined functions), and the
    code of what it calls is optimised again in every caller. So what is called in many places is
    best called from helpers only, and chains of calls are best short.
    """
    return _let_kernels_call(function, makes_arrays=False, forceinline=False)


def array_maker(function: Function) -> Function:
    """Let kernels call a function that makes arrays, otherwise as ``helper``."""
    return _let_kernels_call(function, makes_arrays=True, forceinline=False)


def inlined(function: Function) -> Function:
    """Let kernels contain a function that makes no arrays.

    A call hands over every array of every tuple that is not ``shared``, one word after another. In
    hot loops this costs more than the function's own work.
    """
    return _let_kernels_call(function, makes_arrays=False, forceinline=True)


def _let_kernels_call(function: Function, *, makes_arrays: bool, forceinline: bool) -> Function:
    # All options are set, also to False: one that a function leaves out comes from its caller.
    private = dict.fromkeys(_PRIVATE, True) | {"_nrt": makes_arrays, "forceinline": forceinline}
    options = {name: value for name, value in private.items() if name in _KNOWN}
    return register_jitable(**_EVERYWHERE, **options)(function)  # type: ignore[no-any-return]


class _Clock(event.Listener):
    """A clock that stands still while any thread compiles kernels, or loads them.

    Meanwhile Python's garbage collector is off: numba makes millions of objects, which are all in
    use, and collecting them takes a tenth of the time.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._depth, self._since, self._spent, self._collects = 0, 0.0, 0.0, False

    def on_start(self, _event: Any) -> None:
        with self._lock:
            if not self._depth:
                self._since, self._collects = time.perf_counter(), gc.isenabled()
                gc.disable()
            self._depth += 1

    def on_end(self, _event: Any) -> None:
        with self._lock:
            self._depth -= 1
            if not self._depth:
                self._spent += time.perf_counter() - self._since
                if self._collects:
                    gc.enable()

    def now(self) -> float:
        with self._lock:
            return (self._since if self._depth else time.perf_counter()) - self._spent


class _Compiling(event.Listener):
    """Follows what numba compiles: one function within another, beginning with a kernel."""

    def __init__(self) -> None:
        self._are_helpers: list[bool] = []  # of the functions that are compiled at the moment

    def on_start(self, event: Any) -> None:
        self._are_helpers.append(isinstance(event.data["dispatcher"]._cache, NullCache))

    def on_end(self, _event: Any) -> None:
        self._are_helpers.pop()

    def is_helper(self) -> bool:
        """Return whether numba compiles a helper at the moment, within a kernel."""
        flags = targetconfig.ConfigStack.top_or_none()
        nested = len(self._are_helpers) > 1 and self._are_helpers[-1]
        return bool(nested and flags is not None and flags.no_cpython_wrapper)


_clock, _compiling = _Clock(), _Compiling()
own_time = _clock.now  # the time in seconds by a clock that stands still while kernels are compiled
event.register("numba:compiler_lock", _clock)
event.register("numba:compile", _compiling)


def _replace_for_helpers(owner: Any, name: str, replacement: Callable[..., Any]) -> None:
    """Replace a method of numba's while a helper is compiled."""
    method = getattr(owner, name)

    def chosen(*arguments: Any) -> Any:
        return (replacement if _compiling.is_helper() else method)(*arguments)

    setattr(owner, name, chosen)


def _finish(library: Any) -> None:
    library._finalize_dynamic_globals()
    library._finalized = True


def _stand_in(_context: Any, library: Any, *_described: Any) -> Any:
    library._ensure_finalized()
    return [].append  # numba wants a different object each time


# numba optimises every function as a library of its own and makes machine code of it, and optimises
# it again in every kernel that it is linked into. A helper is never called from Python: without its
# own machine code, compiling the local search takes two thirds of the time. Other versions compile
# for longer, with the same results.
if numba.version_info.short == (0, 68):
    _replace_for_helpers(CPUCodeLibrary, "_optimize_final_module", lambda _library: None)
    _replace_for_helpers(CPUCodeLibrary, "_finalize_final_module", _finish)
    _replace_for_helpers(CPUContext, "get_executable", _stand_in)


# Numba hands a named tuple to a function array by array, and each array as seven numbers: most of
# the code that it compiled was calls of helpers. ``shared`` hands over one address instead.


class _Shared(types.Type):
    """The address of a named tuple."""

    def __init__(self, named: Any) -> None:
        self.named = named
        super().__init__(name=f"shared({named})")

    def kind_of(self, name: str) -> types.Type:
        """Return the type of a field; a field that is a named tuple is shared, too."""
        field: types.Type = self.named[self.named.fields.index(name)]
        return _Shared(field) if isinstance(field, types.BaseNamedTuple) else field


@extending.register_model(_Shared)
class _SharedModel(extending.models.PrimitiveModel):
    def __init__(self, models: Any, kind: _Shared) -> None:
        super().__init__(models, kind, models[kind.named].get_value_type().as_pointer())


@extending.infer_getattr
class _Fields(AttributeTemplate):
    key = _Shared

    def generic_resolve(self, kind: _Shared, name: str) -> types.Type | None:
        return kind.kind_of(name) if name in kind.named.fields else None


def _read_field(context: Any, builder: Any, kind: _Shared, value: Any, name: str) -> Any:
    address = cgutils.gep_inbounds(builder, value, 0, kind.named.fields.index(name))
    field = kind.kind_of(name)
    read = address if isinstance(field, _Shared) else builder.load(address)
    # Kernels count who uses arrays.
    return imputils.impl_ret_borrowed(context, builder, field, read)


extending.lower_getattr_generic(_Shared)(_read_field)


def shared(named: Tuple) -> Tuple:
    """Return the same named tuple, whose address is what a kernel hands to its helpers.

    Only for arguments of a kernel: its caller keeps their arrays as long as it runs. Arrays that
    the kernel makes would be freed too early, since users by address are not counted.
    """
    return named


def _type_shared(context: Any) -> Any:  # noqa: ARG001
    return lambda named: _Shared(named) if isinstance(named, types.BaseNamedTuple) else None


def _share(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
    return cgutils.alloca_once_value(builder, arguments[0])


extending.type_callable(shared)(_type_shared)
extending.lower_builtin(shared, types.BaseNamedTuple)(_share)


def ticks() -> int:
    """Return how far the processor's counter is: ticks of a constant rate, whatever it is."""
    return time.perf_counter_ns()


def _read_counter(_context: Any, builder: Any, _signature: Any, _arguments: Any) -> Any:
    of_type = cgutils.ir.FunctionType(cgutils.ir.IntType(64), [])
    counter = builder.module.declare_intrinsic("llvm.readcyclecounter", fnty=of_type)
    return builder.call(counter, [])


extending.type_callable(ticks)(lambda _context: lambda: types.int64)
extending.lower_builtin(ticks)(_read_counter)


# Seconds that Python may take for one call, and for all calls of a run that are still to come:
# about as long as compiling takes.
_LONGEST_CALL, _LONGEST_REST = 3.0, 4.0
# If another process compiles anyway, so many seconds in Python are reason enough for later runs.
_NOTED = 0.2

Mode: TypeAlias = Literal["auto", "compiled", "interpreted"]


class _Run:
    """What kernels know of the run that calls them."""

    mode: Mode = "auto"
    number = 0  # how many runs and worlds there have been: each may need other machine code
    rest = 1.0  # what is still to do, as a multiple of what has been done


def begin_run() -> None:
    """Let kernels look again whether they are compiled for their arguments.

    They also forget how long Python took for them.
    """
    _Run.number += 1


@contextmanager
def remaining(rest: float) -> Iterator[None]:
    """Say how much of a run is left, as a multiple of what has been done."""
    before, _Run.rest = _Run.rest, max(1.0, rest)  # a run that goes on may be slower than before
    try:
        yield
    finally:
        _Run.rest = before


@contextmanager
def kernels(mode: Mode) -> Iterator[None]:
    """Let the rule decide (``auto``), or all kernels be ``compiled`` or ``interpreted``."""
    before, _Run.mode = _Run.mode, mode
    begin_run()
    try:
        yield
    finally:
        _Run.mode = before
        begin_run()


def at_once(seconds: Callable[..., float]) -> Callable[[Function], Function]:
    """Let a kernel run as plain Python until its machine code is ready.

    ``seconds`` takes a call's arguments, and returns about how long plain Python takes for it.
    """

    def decorated(function: Function) -> Function:
        compiled: Any = kernel(function)
        # With Intel's SVML machine code rounds otherwise; or numba is told to compile nothing.
        if numba.config.USING_SVML or not hasattr(compiled, "overloads"):
            return compiled  # type: ignore[no-any-return]
        return _Kernel(function, compiled, seconds)  # type: ignore[return-value]

    return decorated


class _Kernel:
    """A function that Python runs until it is compiled, as ``at_once`` describes it."""

    def __init__(
        self, function: Callable[..., Any], compiled: Any, seconds: Callable[..., float]
    ) -> None:
        update_wrapper(self, function)
        self.path = f"{function.__module__}:{function.__qualname__}"
        self.py_func, self.compiled, self.seconds = function, compiled, seconds
        # The last run, seconds that Python took for it there, and whether it is compiled for that.
        self._run, self._spent, self._is_compiled = -1, 0.0, False

    def __call__(self, *arguments: Any) -> Any:
        """Call the function, or its machine code."""
        if self._run != _Run.number:
            self._run, self._spent, self._is_compiled = _Run.number, 0.0, False
        if self._is_compiled or self._settle(arguments):
            return self.compiled(*arguments)
        started = time.perf_counter()
        with np.errstate(all="ignore"):
            result = self.py_func(*arguments)
        self._spent += time.perf_counter() - started
        if self._spent > _NOTED and _Run.mode == "auto":
            _elsewhere.add(self, _signature(arguments))  # for later runs
        return result

    def _settle(self, arguments: tuple[Any, ...]) -> bool:
        """Decide whether to call machine code, which is loaded or compiled here if need be."""
        if _Run.mode == "interpreted":
            return False
        signature = _signature(arguments)
        if _Run.mode == "auto" and not self.is_ready(signature):
            is_long = self.seconds(*arguments) > _LONGEST_CALL
            if not is_long and self._spent * _Run.rest < _LONGEST_REST:
                return False
            if not is_long and _elsewhere.compiles(self, signature):
                return False
        if signature not in self.compiled.overloads:
            while _elsewhere.is_at(self):
                time.sleep(0.05)
            self.compiled.compile(signature)
        self._is_compiled = True
        return True

    def is_ready(self, signature: tuple[Any, ...]) -> bool:
        """Return whether there is machine code, in memory or on disk."""
        return signature in self.compiled.overloads or is_kept(self.compiled, signature)


def prepare(kernel: Any, *arguments: Any) -> None:
    """Let another process compile a kernel for such arguments, if that has not been done."""
    if isinstance(kernel, _Kernel) and _Run.mode == "auto":
        signature = _signature(arguments)
        if not kernel.is_ready(signature):
            _elsewhere.compiles(kernel, signature)


def _signature(arguments: tuple[Any, ...]) -> tuple[Any, ...]:
    return tuple(map(numba.typeof, arguments))


class _Elsewhere:
    """Another process, which compiles one kernel after another into the files of machine code."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._tasks: list[tuple[_Kernel, tuple[Any, ...]]] = []  # those that are not done
        self._lock = threading.RLock()

    def _is_running(self) -> bool:
        return self._process is not None and self._process.poll() is None

    def compiles(self, kernel: _Kernel, signature: tuple[Any, ...]) -> bool:
        """Return whether the process compiles a kernel, after having begun to if it was idle."""
        with self._lock:
            task = kernel, signature
            if self._process is None and n_cpus() > 1 and can_keep(kernel.compiled):
                with suppress(Exception):  # whatever keeps it from starting: all is compiled here
                    self._process = _start()
            self._tasks = [each for each in self._tasks if not each[0].is_ready(each[1])]
            if self._is_running() and not self._tasks:
                self.add(*task)
            return self._is_running() and task in self._tasks

    def add(self, kernel: _Kernel, signature: tuple[Any, ...]) -> None:
        """Let the process, if it runs, compile a kernel after what it has to do already."""
        with self._lock, suppress(Exception):
            process, task = self._process, (kernel, signature)
            if self._is_running() and process and process.stdin and task not in self._tasks:
                pickle.dump((kernel.path, signature), process.stdin)
                process.stdin.flush()
                self._tasks.append(task)

    def is_at(self, kernel: _Kernel) -> bool:
        """Return whether the process still has to compile a kernel: numba locks no files."""
        left = [task for each, task in self._tasks if each is kernel and not each.is_ready(task)]
        return self._is_running() and bool(left)


_elsewhere = _Elsewhere()


def _start() -> subprocess.Popen[bytes] | None:
    """Start a process that compiles kernels; it ends its work also if this one ends before.

    None is started where Python is a part of another program.
    """
    if not Path(sys.executable).name.startswith("python"):
        return None
    path = os.pathsep.join(str(folder or Path.cwd()) for folder in sys.path)
    return subprocess.Popen(
        [sys.executable, "-P", "-c", f"from {__name__} import compile_tasks; compile_tasks()"],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": path},
        start_new_session=True,  # Ctrl-C is for the process that searches
    )


def compile_tasks() -> None:
    """Compile the kernels that standard input names, for the types that it gives."""
    with suppress(EOFError):  # nobody has more to do
        while True:
            path, signature = pickle.load(sys.stdin.buffer)  # what ``add`` has written
            resolve_name(path).compiled.compile(signature)
