"""The parts of a run's file, read with a check of all that later steps rely on."""

import io
import json
import warnings
import zipfile
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    NonNegativeFloat,
    ValidationError,
)

from botohe_moo._base.checks import quoted
from botohe_moo._base.types import FloatArray
from botohe_moo.indicators import Scale, largest_objectives
from botohe_moo.mission.model import Mission
from botohe_moo.study.file.config import MAX_EVALUATIONS
from botohe_moo.study.store.schemas import SCHEMAS
from botohe_moo.trails import PlanBatch

_MOST_BYTES = 2**29  # of all arrays: some kilobytes of a file may hold gigabytes of zeros
_LONG = 200  # characters of a reason
_ROUNDING = 1e-9
_KINDS = {"string": str, "int64": int}
_HEADER = "header"
_ENDS, _NODES = np.dtype(np.int64), np.dtype(np.int32)
_NUMBERS = np.dtype(np.float64)
# Of each array that a file holds, its type and how many dimensions it has.
_ARRAYS = {
    "evaluations": (_ENDS, 1),
    "seconds": (_NUMBERS, 1),
    "ties": (_ENDS, 1),
    "n_points": (_ENDS, 1),
    "points": (_NUMBERS, 2),
    "plan_objectives": (_NUMBERS, 2),
    "plan_nodes": (_NODES, 1),
    "plan_offsets": (_ENDS, 1),
}


def _check_environment(where: dict[str, Any]) -> dict[str, Any]:
    """Refuse what is not a row of the table ``environments``."""
    for column in SCHEMAS["environments"] if where else ():
        value = where.get(column.name)
        expected = _KINDS[str(column.type)]
        if type(value) is not expected and not (value is None and column.nullable):
            name, found = f"{column.name} of its environment", quoted(value)
            raise ValueError(f"expected {name} to be of type {expected.__name__}, got {found}")
    return where


class Ending(BaseModel):
    """How a run ended: what its file says besides the records, and the file of a failure."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    status: Literal["done", "infeasible", "timeout", "failed"]
    stopped_by: Literal["evaluations", "seconds", "itself", "limit", "error"]
    evaluations: Annotated[int, Field(ge=0, le=2 * MAX_EVALUATIONS)]
    seconds: NonNegativeFloat
    recording_seconds: NonNegativeFloat
    error: str | None = None
    traceback: str | None = None
    environment: Annotated[dict[str, Any], AfterValidator(_check_environment)] = {}
    began: str | None = None


def read_ending(content: Any) -> Ending:
    """Read how a run ended; a ValueError says in a line what is wrong."""
    try:
        return Ending.model_validate(content)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"])) or "its header"
        raise ValueError(f"{where}: {first['msg']}") from None


def read_parts(data: bytes) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read the header and the arrays of a file; a ValueError if they are not those of a run."""
    arrays = _read_arrays(data)
    try:
        header = json.loads(arrays.pop(_HEADER, np.empty(0)).tobytes())
    except RecursionError:
        raise ValueError("its header is nested too deeply") from None
    if not isinstance(header, dict):
        raise ValueError(f"expected a header, got {quoted(header)}")
    if "front_size" in arrays:  # before ties were told apart, all plans were counted
        arrays["ties"] = arrays.pop("front_size") - arrays["n_points"]
    for name, (dtype, n_dimensions) in _ARRAYS.items():
        found = arrays.get(name)
        if found is None or (found.dtype, found.ndim) != (dtype, n_dimensions):
            raise ValueError(f"expected an array {name} of type {dtype}")
    return header, arrays


def _read_arrays(data: bytes) -> dict[str, Any]:
    """Read all arrays of an npz file by name; a ValueError if it is none. Nothing is unpickled."""
    try:
        with warnings.catch_warnings(action="ignore"), zipfile.ZipFile(io.BytesIO(data)) as file:
            members = file.infolist()
            if sum(member.file_size for member in members) > _MOST_BYTES:
                raise ValueError(f"expected arrays of at most {_MOST_BYTES:,} bytes")
            arrays = {}
            for member in members:
                with file.open(member) as array:
                    name = member.filename.removesuffix(".npy")
                    arrays[name] = np.lib.format.read_array(array, allow_pickle=False)
            return arrays
    except Exception as error:  # numpy, zipfile and what they decode with declare none
        said = f"{type(error).__name__}: {error}".partition("\n")[0]
        raise ValueError(f"not an npz file of arrays, {said[:_LONG]}") from error


def check_records(arrays: Mapping[str, Any], scale: Scale) -> None:
    """Raise a ValueError if records do not fit together, or are not of a mission's plans."""
    columns = [arrays[name] for name in ("evaluations", "seconds", "ties", "n_points")]
    if len({len(column) for column in columns}) > 1:
        raise ValueError("expected as many of each of the numbers of its records")
    for column in columns:
        if not (np.isfinite(column) & (column >= 0)).all():
            raise ValueError("expected finite numbers >= 0 in its records")
    if sum(arrays["n_points"].tolist()) != len(arrays["points"]):
        raise ValueError("records and points do not fit")
    for points in (arrays["points"], arrays["plan_objectives"]):
        _check_points(points, scale)


def _check_points(points: FloatArray, scale: Scale) -> None:
    most = np.array(largest_objectives(scale)) * (1 + _ROUNDING)
    if points.shape[1:] != (2,) or not ((points >= 0) & (points <= most)).all():
        raise ValueError("expected points that are possible on its mission")


def check_plans(plans: PlanBatch, objectives: FloatArray, mission: Mission) -> None:
    """Raise a ValueError if these cannot be plans of a mission, and their objectives."""
    if len(plans) != len(objectives):
        raise ValueError(f"expected objectives of {len(plans)} plans, got {len(objectives)}")
    if (np.diff(plans.offsets) == 0).any():
        raise ValueError("expected trails of at least one node")
    nodes = plans.nodes
    if len(nodes) and not 0 <= nodes.min() <= nodes.max() < len(mission.nodes):
        raise ValueError("expected nodes of its mission in its plans")
