"""The environment of runs: versions, machine, settings of thread pools."""

import contextlib
import functools
import hashlib
import json
import os
import platform
import subprocess
from importlib.metadata import version
from pathlib import Path
from typing import Any

from botohe_moo.base.runtime import n_cpus

# One thread each: thread pools of other libraries would take cores from other workers, and make
# nothing faster here.
THREAD_SETTINGS = tuple(f"{pool}_NUM_THREADS" for pool in ("OMP", "OPENBLAS", "MKL", "NUMBA"))
_PACKAGES = ("numpy", "numba", "llvmlite", "pymoo", "moocore", "scipy", "networkx")


@functools.cache
def environment() -> dict[str, Any]:
    """Return this process's environment, a row of the table ``environments``."""
    columns: dict[str, Any] = {
        "botohe_moo": version("botohe-moo"),
        "commit": _commit(),
        "python": platform.python_version(),
        "packages": " ".join(f"{name}=={version(name)}" for name in _PACKAGES),
        "system": f"{platform.system()} {platform.release()}",
        "machine": platform.node(),
        "processor": _processor(),
        "n_cpus": n_cpus(),
        "threads": " ".join(
            f"{name}={os.environ[name]}" for name in THREAD_SETTINGS if name in os.environ
        ),
    }
    digest = hashlib.sha256(json.dumps(columns, sort_keys=True).encode()).hexdigest()[:12]
    return {"environment": digest, **columns}


def _processor() -> str:
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text("utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _commit() -> str | None:
    """Return the commit of this package's source; None unless it is a working copy."""
    package = Path(__file__).parents[2]
    root = package.parents[1]
    if not ((root / ".git").exists() and (root / "pyproject.toml").exists()):
        return None
    try:
        commit = _git(root, "rev-parse", "HEAD")
        changed = _git(root, "status", "--porcelain", "--untracked-files=no", "--", "src")
    except (OSError, subprocess.SubprocessError):
        return None
    return f"{commit}+" if changed else commit


def _git(root: Path, *arguments: str) -> str:
    # A process may be killed while it asks, and must leave no lock behind.
    command = ["git", "--no-optional-locks", "-C", str(root), *arguments]
    done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=10)
    return done.stdout.strip()
