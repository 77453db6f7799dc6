"""What a study and the processes of its runs exchange: tasks, records, outcomes, environments."""

import contextlib
import functools
import hashlib
import json
import math
import os
import platform
import re
import subprocess
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

from botohe_moo.base.runtime import n_cpus
from botohe_moo.base.types import FloatArray
from botohe_moo.study.model import (
    PACKAGES,
    Run,
    StudyAlgorithm,
    StudyMission,
    algorithm_origin,
    installed_versions,
)
from botohe_moo.trails import PlanBatch

PATIENCE = 3600.0
MOST_SECONDS_TO_START = 600.0  # kernels are compiled then, perhaps on a slow machine
# One thread each: thread pools of other libraries would take cores from other workers, and make
# nothing faster here.
THREAD_SETTINGS = tuple(f"{pool}_NUM_THREADS" for pool in ("OMP", "OPENBLAS", "MKL", "NUMBA"))
_PACKAGES = ("numpy", "numba", "llvmlite", "pymoo", "moocore", "scipy", "networkx")


@dataclass(frozen=True)
class Task:
    """A run to be performed."""

    run: Run
    # Seconds without an evaluation after which a run of another package's algorithm fails, unless
    # it has a budget of seconds. Not part of a run's identity: no result depends on it.
    patience: float = PATIENCE

    @property
    def seconds_allowed(self) -> float:
        """Seconds for the run; without a budget of seconds, those between its evaluations."""
        budget, origin = self.run.mission.budget, self.run.algorithm.origin
        if budget.seconds is not None:
            return budget.seconds + budget.grace_seconds
        ours = origin["package"] == "botohe-moo" and origin["source"] is None
        return math.inf if ours else self.patience


@dataclass(frozen=True)
class BoundTask:
    """A mission whose front is to be bounded."""

    mission: StudyMission
    front: FloatArray  # E[R] and E[S] of the points that its runs have found (n, 2)
    seconds: float


@dataclass(frozen=True)
class Record:
    """The front of a run after some number of evaluations."""

    evaluations: int
    seconds: float  # the algorithm's own time
    objectives: FloatArray  # E[R] and E[S] of distinct points (n, 2), by descending reward
    ties: int  # further plans whose objectives are those of a point
    # The plans, and their objectives (front_size + ties, 2). The last record has them; the others
    # have them only if the run may be killed.
    plans: tuple[PlanBatch, FloatArray] | None = None

    @property
    def front_size(self) -> int:
        """Number of distinct points on the front."""
        return len(self.objectives)


@dataclass(frozen=True)
class Outcome:
    """How a run ended."""

    status: str  # done, infeasible (found no feasible plan), timeout (was killed) or failed
    stopped_by: str  # evaluations, seconds, itself, limit or error
    evaluations: int
    seconds: float  # without compiling and recording
    recording_seconds: float = 0.0
    records: tuple[Record, ...] = ()  # the last one has its plans
    error: str | None = None
    traceback: str | None = None
    environment: dict[str, Any] = field(default_factory=dict)
    began: str | None = None  # UTC, as 2026-11-22T04:30:12Z; None if it never did


def failure(error: str, traceback: str | None = None, last: Record | None = None) -> Outcome:
    """Return the outcome of a run that failed after its ``last`` record.

    ``error`` becomes a single line. ``traceback`` is that of an exception, or what the process
    printed before it died.
    """
    return Outcome(
        status="failed",
        stopped_by="error",
        evaluations=last.evaluations if last else 0,
        seconds=last.seconds if last else 0.0,
        error=" ".join(error.split()),
        traceback=traceback,
    )


@functools.cache
def environment() -> dict[str, Any]:
    """Return this process's environment, a row of the table ``environments``."""
    threads = (f"{name}={os.environ[name]}" for name in THREAD_SETTINGS if name in os.environ)
    columns: dict[str, Any] = {
        "botohe_moo": version("botohe-moo"),
        "commit": _commit(),
        "python": platform.python_version(),
        "packages": " ".join(f"{name}=={version(name)}" for name in _PACKAGES),
        "system": f"{platform.system()} {platform.release()}",
        "machine": platform.node(),
        "processor": _processor(),
        "n_cpus": n_cpus(),
        "threads": " ".join(threads),
    }
    digest = hashlib.sha256(json.dumps(columns, sort_keys=True).encode()).hexdigest()[:12]
    return {"environment": digest, **columns}


def _processor() -> str:
    with contextlib.suppress(OSError):
        if found := re.search(r"^model name\s*: *(.*)", Path("/proc/cpuinfo").read_text(), re.M):
            return found[1].strip()
    return platform.processor() or platform.machine()


def _commit() -> str | None:
    """Return the commit of this package's source; None unless it is a working copy."""
    root = Path(__file__).parents[3]
    if not ((root / ".git").exists() and (root / "pyproject.toml").exists()):
        return None
    # A process may be killed while it asks, and must leave no lock behind.
    git = ["git", "--no-optional-locks", "-C", str(root)]
    asked = ["rev-parse", "HEAD"], ["status", "--porcelain", "--untracked-files=no", "--", "src"]
    try:
        commit, changed = (
            subprocess.check_output([*git, *words], text=True, timeout=10).strip()
            for words in asked
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return f"{commit}+" if changed else commit


def code_mismatch(versions: Mapping[str, str], algorithms: Iterable[StudyAlgorithm]) -> str | None:
    """Return how this process's code differs from that of a study; None if it is the same.

    ``versions`` and ``algorithms`` are those of the study. The text continues a sentence about the
    worker.
    """
    ours = installed_versions()
    for name, wanted in versions.items():
        if wanted != ours[name]:
            return f"has {PACKAGES[name]} {ours[name]}, the study {wanted}"
    for algorithm in algorithms:
        name, problem = algorithm.algorithm, algorithm.origin.get("problem")
        try:
            found = algorithm_origin(name, algorithm.parameters, problem)
        except Exception as error:
            also = f" or the problem {problem!r}" if problem else ""
            return f"cannot import the algorithm {name!r}{also}: {str(error).rstrip('.')}"
        if found != algorithm.origin:
            return f"has {name!r} from {found}, the study from {algorithm.origin}"
    return None
