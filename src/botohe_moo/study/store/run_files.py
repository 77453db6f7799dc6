"""The file of a run: the arrays of its records and plans as ``npz``, all else as JSON in it."""

import io
import json
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from botohe_moo._base.files import read_bytes
from botohe_moo.study.file.model import Run, StudyError
from botohe_moo.study.run.task import Outcome, Record
from botohe_moo.trails import PlanBatch

_LONG = 200  # characters of a reason
_FIELDS = [field.name for field in fields(Outcome) if field.name != "records"]


def outcome_fields(outcome: Outcome) -> dict[str, Any]:
    """Return all fields of an outcome except its records."""
    return {name: getattr(outcome, name) for name in _FIELDS}


def pack_run(run: Run, outcome: Outcome) -> bytes:
    """Return the content of a run's file."""
    records = outcome.records
    plans, objectives = (records[-1].plans if records else None) or (None, np.empty((0, 2)))
    header = {"identity": run.identity, **outcome_fields(outcome)}
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


def read_run(path: Path, robots: int) -> Outcome:
    """Read the outcome of a run with a team of ``robots``; a StudyError if the file is damaged."""
    try:
        with np.load(io.BytesIO(read_bytes(path)), allow_pickle=False) as file:
            arrays: dict[str, Any] = dict(file)
        header = json.loads(arrays["header"].tobytes())
        plans = PlanBatch(arrays["plan_nodes"], arrays["plan_offsets"], robots)
        columns = (arrays[name].tolist() for name in ("evaluations", "seconds", "ties"))
        fronts = np.split(arrays["points"], np.cumsum(arrays["n_points"]))[:-1]
        records = [
            Record(evaluations, seconds, front, ties)
            for evaluations, seconds, ties, front in zip(*columns, fronts, strict=True)
        ]
        if records:
            records[-1] = replace(records[-1], plans=(plans, arrays["plan_objectives"]))
        return Outcome(**{name: header[name] for name in _FIELDS}, records=tuple(records))
    except Exception as error:  # numpy, zipfile and what they decode with declare none
        said = f"{error}".partition("\n")[0][:_LONG]
        raise StudyError(
            f"{path}: damaged ({said}); remove the file, and run the study again."
        ) from error
