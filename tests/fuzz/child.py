"""A process that reads inputs, within limits: ``python -m tests.fuzz.child MODULE FOLDER SECONDS``.

It takes jobs from standard input, one a line: target, seed, first number and the one after the
last. It answers with a line for each fault and one at the end, as JSON. The file ``number`` in its
folder holds the number of the input that is being read, and ``stack`` where it was if one takes too
long: the process then ends.
"""

import faulthandler
import importlib
import json
import logging
import os
import resource
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

from tests.fuzz.oracle import MIB, MOST_ADDRESSES, FaultError, Files, Place, Target, Watch, examine


def make_input(target: Target, seed: int, number: int) -> Files:
    """Make the input of a number; the same one each time."""
    rng = Random(f"{seed}/{target.name}/{number}")
    return target.change(rng, rng.choice(target.seeds()))


def limit_addresses() -> None:
    """Let allocations fail beyond a bound, instead of taking the machine's memory."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + MOST_ADDRESSES * MIB
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


def get_ready(target: Target, place: Place) -> None:
    """Load and compile what a target needs; its seeds have to be accepted."""
    for files in [] if target.ready else target.seeds():
        place.fill(files)
        value = target.read(place.folder)
        if target.use is not None:
            target.use(value, place.folder)
    target.ready[:] = [True]


class Reader:
    """Reads inputs, and notes which one and where it is, in case it does not come to its end."""

    def __init__(self, folder: Path, seconds: float) -> None:
        self._seconds = seconds
        self._watch = Watch()
        self._place = Place(Path(tempfile.mkdtemp(dir=folder)))
        self._number = os.open(folder / "number", os.O_RDWR | os.O_CREAT)
        self._stack = (folder / "stack").open("w")

    def answers(self, target: Target, seed: int, first: int, last: int) -> Iterator[dict[str, Any]]:
        """Read the inputs from a first number to before a last one."""
        get_ready(target, self._place)
        counts = {"accepted": 0, "refused": 0}
        began = time.monotonic()
        for i in range(first, last):
            os.pwrite(self._number, f"{i:<20}".encode(), 0)
            files = make_input(target, seed, i)
            faulthandler.dump_traceback_later(self._seconds, exit=True, file=self._stack)
            try:
                counts[examine(target, files, self._place, self._watch)] += 1
            except FaultError as fault:
                yield {"fault": str(fault), "number": i}
            except MemoryError:
                yield {"fault": "it took more memory than it may", "number": i}
            finally:
                faulthandler.cancel_dump_traceback_later()
        yield {**counts, "seconds": time.monotonic() - began}


def main() -> None:
    targets = importlib.import_module(sys.argv[1]).TARGETS
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what is printed is no answer
    logging.disable()
    reader = Reader(Path(sys.argv[2]).resolve(), float(sys.argv[3]))
    if sys.platform == "linux":
        limit_addresses()
    for line in sys.stdin:
        name, *numbers = line.split()
        for answer in reader.answers(targets[name], *map(int, numbers)):
            answers.write(json.dumps(answer) + "\n")
            answers.flush()


if __name__ == "__main__":
    main()
