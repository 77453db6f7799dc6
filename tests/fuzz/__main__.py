"""``python -m tests.fuzz [TARGET ...]``: read files that were changed at random.

The exit status is 1 if a reader has failed an input: did anything but give a value that is of use,
or raise one of the package's errors, in lines that name the file. Such inputs are kept under
results/fuzz/, with what was wrong; ``--again FOLDER`` repeats one. The same seed gives the same
inputs.
"""

import argparse
import json
import shutil
import sys
import tempfile
import time
from pathlib import Path

from tests.fuzz.child import get_ready, make_input
from tests.fuzz.driver import Count, Job, fuzz
from tests.fuzz.oracle import FaultError, Files, Odd, Place, Target, Watch, examine
from tests.fuzz.targets import TARGETS

RESULTS = Path(__file__).parents[2] / "results" / "fuzz"
_ABOUT = "fault.json"  # beside the files of an input that failed
_MOST_KEPT = 20  # of a target


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=", ".join(TARGETS))
    parser.add_argument("--inputs", type=int, help="of each target; by default 120 000 in all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--again", type=Path, metavar="FOLDER", help="repeat an input that failed")
    given = parser.parse_args()
    if given.again is not None:
        return _repeat(given.again)
    if unknown := set(given.targets) - TARGETS.keys():
        parser.error(f"unknown target {', '.join(sorted(unknown))}")
    names = given.targets or list(TARGETS)
    inputs = {name: given.inputs or TARGETS[name].inputs for name in names}
    print(f"{sum(inputs.values()):,} inputs, seed {given.seed}", flush=True)
    began = time.monotonic()
    counts = fuzz(inputs, given.seed, workers=given.workers, show=_show)
    _print_table(counts)
    print(f"{time.monotonic() - began:.0f} s")
    for name, count in counts.items():
        _keep(TARGETS[name], given.seed, count)
    return int(not all(is_sound(count) for count in counts.values()))


def _show(job: Job) -> None:
    """Say how far a target is, where there is a terminal: the line is overwritten."""
    if sys.stderr.isatty():
        print(f"\r{job.target} {job.last:,}   ", end="", file=sys.stderr, flush=True)


def is_sound(count: Count) -> bool:
    """Tell whether a target has failed no input, and has met both sound files and wrong ones."""
    return not count.faults and count.accepted > 0 and count.refused > 0


def _print_table(counts: dict[str, Count]) -> None:
    header = ("target", "inputs", "accepted", "refused", "failures", "seconds")
    rows = [
        (name, c.inputs, c.accepted, c.refused, len(c.faults), round(c.seconds))
        for name, c in counts.items()
    ]
    total = ("all", *(sum(column) for column in list(zip(*rows, strict=True))[1:]))
    for row in (header, *rows, total):
        name, *cells = row
        print(f"{name:<14}" + "".join(f"{cell:>10}" for cell in cells))


def _keep(target: Target, seed: int, count: Count) -> None:
    """Keep the inputs that failed, and say how to repeat them."""
    for number, fault in sorted(count.faults.items())[:_MOST_KEPT]:
        folder = RESULTS / f"{target.name}-{seed}-{number}"
        shutil.rmtree(folder, ignore_errors=True)
        files, odd = make_input(target, seed, number), {}
        for name, data in files.items():
            path = folder / "in" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            if isinstance(data, Odd):
                odd[name] = data.value
            else:
                path.write_bytes(data)
        about = {"target": target.name, "seed": seed, "number": number, "odd": odd, "fault": fault}
        (folder / _ABOUT).write_text(json.dumps(about, indent=1))
        print(f"\n{fault.strip()}\npython -m tests.fuzz --again {folder.relative_to(Path.cwd())}")


def _repeat(folder: Path) -> int:
    """Let a kept input be read again, in this process and without limits."""
    about = json.loads((folder / _ABOUT).read_text())
    files: dict[str, bytes | Odd] = {name: Odd(value) for name, value in about["odd"].items()}
    for path in (folder / "in").rglob("*"):
        if path.is_file():
            files[path.relative_to(folder / "in").as_posix()] = path.read_bytes()
    return _said_of(TARGETS[about["target"]], files)


def _said_of(target: Target, files: Files) -> int:
    with tempfile.TemporaryDirectory() as name:
        place, watch = Place(Path(name)), Watch()
        get_ready(target, place)
        try:
            print(examine(target, files, place, watch))
        except FaultError as fault:
            print(fault)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
