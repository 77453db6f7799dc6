"""Memory of a process; imports nothing that would add to it."""

import resource
from pathlib import Path


def peak_resident() -> float:
    """Give the peak resident memory of this program in MiB.

    What the system says of the process begins with the peak of the one that started it, where it
    can tell the program's own this is better.
    """
    status = Path("/proc/self/status")
    if status.exists():
        for line in status.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return float(line.split()[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
