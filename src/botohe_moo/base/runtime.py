"""What the package asks of Python: late imports, processors, signals."""

import math
import os
import re
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
    source: str = sys.modules[package].__loader__.get_source(package)  # type: ignore[union-attr]
    imports = re.findall(r"^ +from (\S+) import (\w+) as \2$", source, re.MULTILINE)
    homes = {name: home for home, name in imports}
    listed = sorted(homes)

    def get(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(homes[name]), name)

    return get, listed.copy, listed


def n_cpus(groups: Path = Path("/sys/fs/cgroup")) -> int:
    """Return how many processors this process may use, at least 1.

    Those are the ones of its affinity (``taskset``), but no more than a container's share of time
    allows, as version 2 of the control ``groups`` has it.
    """
    n = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    with suppress(OSError, ValueError):  # no quota ("max"), or no groups
        quota, period = map(int, (groups / "cpu.max").read_text().split())
        n = min(n, math.ceil(quota / period))
    return n


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

    def note(number: int, _: object) -> None:
        # Not the usual handler, which may end the process at once, without any cleaning up.
        signal.signal(number, signal.default_int_handler)
        if not stop.signal:  # another signal may come while the event is being set
            stop.signal = number
            stop.set()

    for number in numbers if threading.current_thread() is threading.main_thread() else ():
        handler = signal.getsignal(number)
        is_usual = handler in (signal.SIG_DFL, signal.default_int_handler)
        if is_usual or (handled and callable(handler)):
            usual[number] = signal.signal(number, note)
    try:
        yield stop
    finally:
        for number, handler in usual.items():
            signal.signal(number, handler)
