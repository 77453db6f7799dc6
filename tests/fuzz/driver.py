"""Fuzzing with several processes at a time, each of which is replaced when an input ends it."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Self

ROOT = Path(__file__).parents[2]
HANG = 20.0  # seconds that no input may take
_STEP = 500  # inputs of a job
# What is written is synchronised, for which a disk would take most of the time.
_IN_MEMORY = next((path for path in ("/dev/shm",) if os.access(path, os.W_OK)), None)


@dataclass
class Count:
    """What has become of a target's inputs."""

    inputs: int = 0
    accepted: int = 0
    refused: int = 0
    seconds: float = 0.0
    faults: dict[int, str] = field(default_factory=dict)  # by number of the input

    def add(self, answer: Mapping[str, Any]) -> None:
        """Add what a process has said: a fault, or the counts of a job."""
        if "fault" in answer:
            self.faults[answer["number"]] = answer["fault"]
        else:
            self.accepted += answer["accepted"]
            self.refused += answer["refused"]
            self.seconds += answer["seconds"]


@dataclass(frozen=True)
class Job:
    """Inputs of a target, by number."""

    target: str
    seed: int
    first: int
    last: int  # not one of them


def fuzz(
    inputs: Mapping[str, int],
    seed: int,
    *,
    workers: int = 2,
    module: str = "tests.fuzz.targets",
    hang: float = HANG,
    show: Callable[[Job], None] | None = None,
) -> dict[str, Count]:
    """Try so many inputs of each target; say what has become of them.

    ``show`` is told of each job that is done.
    """
    jobs: SimpleQueue[Job] = SimpleQueue()
    for job in _jobs(inputs, seed):
        jobs.put(job)
    found: SimpleQueue[tuple[Job, dict[str, Any]]] = SimpleQueue()

    def work() -> None:
        with Worker(module, hang) as worker:
            while True:
                try:
                    job = jobs.get_nowait()
                except Empty:
                    return
                for answer in worker.do(job):
                    found.put((job, answer))
                if show is not None:
                    show(job)

    with ThreadPoolExecutor(workers) as pool:
        for done in [pool.submit(work) for _ in range(workers)]:
            done.result()
    counts = {name: Count(inputs=n) for name, n in inputs.items()}
    while not found.empty():
        job, answer = found.get()
        counts[job.target].add(answer)
    return counts


def _jobs(inputs: Mapping[str, int], seed: int) -> Iterator[Job]:
    """Cut the inputs into jobs; those of slow targets, of which there are few, come first."""
    for name, n in sorted(inputs.items(), key=lambda pair: pair[1]):
        step = min(_STEP, max(10, n // 20))
        yield from (Job(name, seed, i, min(n, i + step)) for i in range(0, n, step))


class Worker:
    """A process of ``tests.fuzz.child``, and the next one if it ends."""

    def __init__(self, module: str, hang: float) -> None:
        self._module, self._hang = module, hang
        self._folder = tempfile.TemporaryDirectory(prefix="fuzz-", dir=_IN_MEMORY)
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
        self._folder.cleanup()

    def do(self, job: Job) -> Iterator[dict[str, Any]]:
        """Do a job; an input with which the process ends is one of its faults."""
        first = job.first
        while first < job.last:
            process = self._started()
            assert process.stdin is not None
            assert process.stdout is not None
            process.stdin.write(f"{job.target} {job.seed} {first} {job.last}\n")
            process.stdin.flush()
            for line in process.stdout:
                answer = json.loads(line)
                yield answer
                if "seconds" in answer:
                    return
            status, number = process.wait(), self._number()
            self._process = None
            said = self._last_words(status)
            yield {"fault": said, "number": max(first, number)}
            if number < first:  # it has died before its first input, and so would the next one
                return
            first = number + 1

    def _started(self) -> subprocess.Popen[str]:
        if self._process is None:
            folder = Path(self._folder.name)
            folder.joinpath("number").write_text("-1")
            arguments = [self._module, folder, self._hang]
            self._errors = (folder / "errors").open("w+")
            self._process = subprocess.Popen(
                [sys.executable, "-m", "tests.fuzz.child", *map(str, arguments)],
                cwd=ROOT,
                env={**os.environ, **_SETTINGS},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                text=True,
            )
        return self._process

    def _number(self) -> int:
        return int(Path(self._folder.name, "number").read_text())

    def _last_words(self, status: int) -> str:
        stack = Path(self._folder.name, "stack").read_text()
        if "Timeout" in stack:
            return f"it took more than {self._hang:g} s:\n{stack}"
        printed = Path(self._folder.name, "errors").read_text(errors="replace")[-2_000:]
        return f"the process ended with status {status}:\n{printed}"


# One thread, since address space is limited; and nothing written that is no input's doing.
_SETTINGS = {
    "PYTHONDONTWRITEBYTECODE": "1",
    "PYTHONHASHSEED": "0",
    "MPLBACKEND": "Agg",
    "ARROW_DEFAULT_MEMORY_POOL": "system",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
}
