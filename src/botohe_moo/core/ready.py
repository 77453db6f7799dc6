"""Kernels that run as plain Python until their machine code is ready.

Both give the same bits, so that a search may begin at once and go on faster later. One rule decides
at each call of a kernel that has not been compiled for such arguments:

- Python runs it if that takes short, for this call and for the rest of the run at the pace so far.
- If this call would take long, it is compiled here.
- If the rest of the run would, another process compiles it, if there is a processor for that, and
  Python goes on until that is done. It compiles one kernel at a time; others are compiled here.
"""

import os
import pickle
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import update_wrapper
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, Literal, TypeAlias, TypeVar

import numba
import numpy as np

from botohe_moo._base.cpus import n_cpus
from botohe_moo.core.compile import can_keep, is_kept, kernel

# Seconds that Python may take for one call, and for all calls of a run that are still to come:
# about as long as compiling takes.
_LONGEST_CALL, _LONGEST_REST = 3.0, 4.0

Mode: TypeAlias = Literal["auto", "compiled", "interpreted"]
Function = TypeVar("Function", bound=Callable[..., Any])


class _Run:
    """What kernels know of the run that calls them."""

    mode: Mode = "auto"
    number = 0  # how many runs have begun
    world = 0  # how many worlds there have been: the next one may need other machine code
    rest = 1.0  # what is still to do, as a multiple of what has been done


def expect_other_types() -> None:
    """Let kernels look again whether they are compiled for their arguments."""
    _Run.world += 1


def begin_run() -> None:
    """Let kernels forget how long Python took for them in earlier runs."""
    _Run.number += 1
    expect_other_types()


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
    expect_other_types()
    try:
        yield
    finally:
        _Run.mode = before
        expect_other_types()


def at_once(seconds: Callable[..., float]) -> Callable[[Function], Function]:
    """Let a kernel run as plain Python until its machine code is ready.

    ``seconds`` takes a call's arguments, and returns about how long plain Python takes for it.
    """

    def decorated(function: Function) -> Function:
        compiled: Any = kernel(function)
        # With Intel's SVML machine code rounds otherwise; or numba is told to compile nothing.
        if numba.config.USING_SVML or not hasattr(compiled, "overloads"):
            return compiled  # type: ignore[no-any-return]
        made: Any = _Kernel(function, compiled, seconds)
        return made  # type: ignore[no-any-return]

    return decorated


class _Kernel:
    """A function that Python runs until it is compiled, as ``at_once`` describes it."""

    def __init__(
        self, function: Callable[..., Any], compiled: Any, seconds: Callable[..., float]
    ) -> None:
        update_wrapper(self, function)
        self.path = f"{function.__module__}:{function.__qualname__}"
        self.py_func, self.compiled, self.seconds = function, compiled, seconds
        self._compiled_for = -1  # the last world for whose arguments it is compiled
        self._run, self._spent = -1, 0.0  # the last run, and seconds that Python took for it there

    def __call__(self, *arguments: Any) -> Any:
        """Call the function, or its machine code."""
        if self._compiled_for == _Run.world or self.settle(arguments):
            return self.compiled(*arguments)
        started = time.perf_counter()
        with np.errstate(all="ignore"):
            result = self.py_func(*arguments)
        self._spent += time.perf_counter() - started
        return result

    def settle(self, arguments: tuple[Any, ...]) -> bool:
        """Decide whether to call machine code, which is loaded or compiled here if need be."""
        if _Run.mode == "interpreted":
            return False
        world, signature = _Run.world, _signature(arguments)
        if self._run != _Run.number:
            self._run, self._spent = _Run.number, 0.0
        if _Run.mode == "auto" and not self.is_ready(signature):
            is_long = self.seconds(*arguments) > _LONGEST_CALL
            if not is_long and self._spent * _Run.rest < _LONGEST_REST:
                return False
            if not is_long and _elsewhere.compiles(self, signature):
                return False
        if signature not in self.compiled.overloads:
            _elsewhere.wait_for(self)
            self.compiled.compile(signature)
        self._compiled_for = world
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


def settle(kernel: Any, *arguments: Any) -> None:
    """Load or compile machine code for a call, if it is to be called, before the call is timed."""
    if isinstance(kernel, _Kernel):
        kernel.settle(arguments)


def _signature(arguments: tuple[Any, ...]) -> tuple[Any, ...]:
    return tuple(map(numba.typeof, arguments))


class _Elsewhere:
    """Another process, which compiles one kernel after another into the files of machine code."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._task: tuple[str, tuple[Any, ...]] | None = None
        self._lock = threading.Lock()

    def compiles(self, kernel: _Kernel, signature: tuple[Any, ...]) -> bool:
        """Return whether the process compiles a kernel, after having begun to if it was idle."""
        with self._lock:
            task = kernel.path, signature
            if self._process is not None and self._process.poll() is None:
                return task == self._task
            has_failed = task == self._task
            if has_failed or n_cpus() == 1 or not can_keep(kernel.compiled):
                return False
            self._task = task
            with suppress(Exception):  # whatever keeps it from starting: kernels are compiled here
                self._process = _start(task)
                return self._process is not None
            return False

    def wait_for(self, kernel: _Kernel) -> None:
        """Wait until the process has compiled a kernel, if it does so: numba locks no files."""
        with self._lock:
            if self._process is not None and self._task and self._task[0] == kernel.path:
                self._process.wait()


_elsewhere = _Elsewhere()


def _start(task: tuple[str, tuple[Any, ...]]) -> subprocess.Popen[bytes] | None:
    """Start a process that compiles a kernel; it goes on to its end, also if this one ends before.

    None is started where Python is a part of another program.
    """
    if getattr(sys, "frozen", False) or not Path(sys.executable).name.startswith("python"):
        return None
    path = os.pathsep.join(str(folder or Path.cwd()) for folder in sys.path)
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", f"from {__name__} import compile_task; compile_task()"],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": path},
        start_new_session=True,  # Ctrl-C is for the process that searches
    )
    assert process.stdin is not None
    with process.stdin as pipe:
        pickle.dump(task, pipe)
    return process


def compile_task() -> None:
    """Compile the kernel that standard input names, for the types that it gives."""
    path, signature = pickle.load(sys.stdin.buffer)  # what ``_start`` has written
    resolve_name(path).compiled.compile(signature)
