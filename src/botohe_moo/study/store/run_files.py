"""The file of a finished run as ``npz``, and the index of all of them."""

import contextlib
import hashlib
import io
import json
import os
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from pydantic import TypeAdapter

from botohe_moo._base.files import read_bytes, replace_file
from botohe_moo.study.file.model import Run
from botohe_moo.study.run.task import Outcome, Record
from botohe_moo.study.store.run_parts import (
    check_plans,
    check_records,
    read_ending,
    read_parts,
)
from botohe_moo.trails import PlanBatch

_FORMAT = 1


def outcome_fields(outcome: Outcome) -> dict[str, Any]:
    """Give all fields of an outcome except its records."""
    names = [field.name for field in fields(outcome) if field.name != "records"]
    return {name: getattr(outcome, name) for name in names}


def pack_run(run: Run, outcome: Outcome) -> bytes:
    """Pack a run into the bytes of an npz file, whose checksums tell whether it was damaged."""
    records = outcome.records
    header = {
        "format": _FORMAT,
        "digest": run.digest,
        "identity": run.identity,
        **outcome_fields(outcome),
    }
    plans, objectives = (records[-1].plans if records else None) or (None, np.empty((0, 2)))
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        header=np.frombuffer(json.dumps(header).encode(), np.uint8),
        evaluations=np.array([record.evaluations for record in records], np.int64),
        seconds=np.array([record.seconds for record in records], np.float64),
        ties=np.array([record.ties for record in records], np.int64),
        n_points=np.array([record.front_size for record in records], np.int64),
        points=np.concatenate([np.empty((0, 2)), *(r.objectives for r in records)]),
        plan_objectives=objectives,
        plan_nodes=np.empty(0, np.int32) if plans is None else plans.nodes,
        plan_offsets=np.zeros(1, np.int64) if plans is None else plans.offsets,
    )
    return buffer.getvalue()


def unpack_run(data: bytes, run: Run) -> Outcome:
    """Read an outcome from the bytes of its file; a ValueError if it is not that run's."""
    header, arrays = read_parts(data)
    if (header.get("format"), header.get("digest")) != (_FORMAT, run.digest):
        raise ValueError("not the file of this run")
    mission, objectives = run.mission.mission, arrays["plan_objectives"]
    check_records(arrays, run.mission.scale)
    plans = PlanBatch(arrays["plan_nodes"], arrays["plan_offsets"], mission.robots)
    check_plans(plans, objectives, mission)
    ends = np.cumsum(arrays["n_points"])
    fronts = np.split(arrays["points"], ends[:-1]) if len(ends) else []
    columns = (arrays[name].tolist() for name in ("evaluations", "seconds", "ties"))
    records = [
        Record(evaluations, seconds, front, ties)
        for evaluations, seconds, ties, front in zip(*columns, fronts, strict=True)
    ]
    if records:
        records[-1] = replace(records[-1], plans=(plans, objectives))
    return Outcome(**read_ending(header).model_dump(), records=tuple(records))


INDEX = ".index.json"


class IndexedFile(NamedTuple):
    """A run's file that was read and found to be whole."""

    # A file of the same size and times is taken to be the same.
    size: int  # bytes
    modified: int  # when its content has changed, in ns
    changed: int  # when its metadata has changed, in ns
    content: str  # digest
    seconds: float  # that the run took

    @classmethod
    def of(cls, state: os.stat_result, data: bytes, seconds: float) -> Self:
        """Describe a file by its ``stat``, its content and the seconds that its run took."""
        content = hashlib.sha256(data).hexdigest()[:16]
        return cls(*_stamp(state), content, seconds)

    def matches(self, state: os.stat_result) -> bool:
        """Tell whether a file is the one that was read."""
        return _stamp(state) == self[:3]


def _stamp(state: os.stat_result) -> tuple[int, int, int]:
    return state.st_size, state.st_mtime_ns, state.st_ctime_ns


_FILES = TypeAdapter(dict[str, IndexedFile])


def read_index(folder: Path) -> dict[str, IndexedFile]:
    """Read the index by digest of the run; empty where there is none, or it is damaged."""
    with contextlib.suppress(OSError, ValueError, RecursionError):
        return _FILES.validate_json(read_bytes(folder / INDEX))
    return {}


def write_index(folder: Path, files: Mapping[str, IndexedFile]) -> None:
    """Write the index, if it has changed; an OSError says why it cannot be written."""
    if files != read_index(folder):
        replace_file(folder / INDEX, json.dumps(files).encode())
