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
from typing import Any, Literal, TypeAlias

import numba
import numpy as np

from botohe_moo.base.runtime import n_cpus
from botohe_moo.core.compile import Function, can_keep, is_kept, kernel

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
