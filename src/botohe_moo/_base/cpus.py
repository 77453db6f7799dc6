"""How many processors this process may use."""

import math
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path


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
