"""What the package asks of Python: late imports, processors, signals."""

import ast
import math
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import Any


def lazy_names(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Make the ``__getattr__`` and ``__dir__`` (PEP 562) and the ``__all__`` of a package.

    Its public names are those that its ``__init__`` imports for type checkers, in the form that
    these require of exports: ``from HOME import NAME as NAME``, HOME from the top. They are read
    from its source, so that each is named once.

    Examples
    --------
    >>> get, names, listed = lazy_names("botohe_moo")
    >>> get("TrailPlan").__module__, "TrailPlan" in names(), "TrailPlan" in listed
    ('botohe_moo.trails', True, True)
    """
    loader: Any = sys.modules[package].__loader__
    tree = ast.parse(loader.get_source(package))
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    homes = {
        alias.asname: str(node.module) for node in imports for alias in node.names if alias.asname
    }
    listed = sorted(homes)

    def get(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(homes[name]), name)

    return get, listed.copy, listed


def n_cpus(groups: Path = Path("/sys/fs/cgroup")) -> int:
    """Return how many processors this process may use, at least 1.

    Those are the ones of its affinity (``taskset``), or as many as Python was told (from 3.13 on,
    ``PYTHON_CPU_COUNT``), but no more than a container's share of time allows, as the files of the
    control ``groups`` have it.
    """
    usable: Callable[[], int | None] | None = getattr(os, "process_cpu_count", None)
    affinity: Callable[[int], set[int]] | None = getattr(os, "sched_getaffinity", None)
    if usable is not None:
        n = usable() or 1
    else:
        n = os.cpu_count() or 1 if affinity is None else len(affinity(0))
    for names in (("cpu.max",), ("cpu/cpu.cfs_quota_us", "cpu/cpu.cfs_period_us")):
        with suppress(OSError, ValueError):  # of the other version, no quota ("max"), or no groups
            words = [word for name in names for word in (groups / name).read_text().split()]
            quota, period = map(int, words)
            if quota > 0:
                n = min(n, math.ceil(quota / period))
    return max(n, 1)


_DEFAULTS = (signal.SIG_DFL, signal.default_int_handler)


class Stop(threading.Event):
    """Set when a stop is asked for; ``signal`` is the number of the signal that did."""

    signal = 0


@contextmanager
def hold_signals(*numbers: int, handled: bool = False) -> Iterator[Stop]:
    """Let signals set an event; one that comes a second time raises KeyboardInterrupt.

    A signal that is ignored, as under ``nohup`` or for jobs in the background, is left alone; so is
    one that has a handler of its own, unless ``handled``. Outside the main thread, which alone may
    handle signals, all are left alone.
    """
    stop = Stop()
    usual: dict[int, Any] = {}
    for number in numbers if threading.current_thread() is threading.main_thread() else ():
        handler = signal.getsignal(number)
        if handler in _DEFAULTS or (handled and callable(handler)):
            usual[number] = handler

    def note(number: int, _: object) -> None:
        # Not the usual handler, which may end the process at once, without any cleaning up.
        signal.signal(number, signal.default_int_handler)
        if not stop.signal:  # another signal may come while the event is being set
            stop.signal = number
            stop.set()

    for number in usual:
        signal.signal(number, note)
    try:
        yield stop
    finally:
        for number, handler in usual.items():
            signal.signal(number, handler)
