"""Reading the folder of a solution; nothing in it is executed or unpickled."""

import json
import os
from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, NonNegativeInt, ValidationError

from botohe_moo._plugins.types import wrong_value
from botohe_moo.mission.digest import numbers_digest
from botohe_moo.mission.formats.files import file_content, read_mission
from botohe_moo.mission.formats.nodelink import decode, read_label
from botohe_moo.mission.model import Mission
from botohe_moo.mission.validation import MissionError
from botohe_moo.solution.model import Solution, as_json
from botohe_moo.trails import TrailPlan

_REMEDY = "Solve the mission again, or put back what was written."


class _Plan(BaseModel):
    model_config = ConfigDict(strict=True)

    plan_id: int
    reward: FiniteFloat
    survivors: FiniteFloat
    trails: list[list[Any]]


class _Record(BaseModel):
    model_config = ConfigDict(strict=True)

    algorithm: str
    parameters: dict[str, Any]
    seed: NonNegativeInt
    min_survival: Annotated[float, Field(ge=0, le=1)]
    max_length: Annotated[FiniteFloat, Field(ge=0)] | None = None  # not in earlier versions' files
    evaluations: NonNegativeInt
    interrupted: bool
    mission_source: dict[str, Any]
    mission_digest: str
    plans: list[_Plan]


def read_solution(folder: str | os.PathLike[str], *, mission: Mission | None = None) -> Solution:
    """Read the solution that :meth:`Solution.write` wrote.

    Parameters
    ----------
    folder
        The folder, with ``plans.json`` and ``mission.json``.
    mission
        The mission, by default that of ``mission.json``. It has to be given if JSON cannot hold its
        labels; they are known by their ``repr`` then.

    Raises
    ------
    ValueError
        If there is no solution in the folder, a file is missing or is not what ``write`` wrote, the
        mission has changed since, a plan is not one of the mission's, or the objectives are not
        those of the plans; names the folder or file, the fault and the remedy. Nothing in the files
        is executed.

    Examples
    --------
    >>> from botohe_moo import read_solution, solve
    >>> files = solve("toy", "greedy", evaluations=100).write("found")
    >>> read_solution("found")
    <Solution of 'toy' by greedy, seed 1: 4 plans, area 0.6087, 4 evaluations>
    """
    folder = Path(folder)
    try:
        return _read(folder, mission)
    except MissionError as error:
        *others, last = error.faults
        faults = [*others, f"{last.removesuffix('.')}. {_REMEDY}"]
        raise MissionError(faults, error.source) from None
    except ValueError as error:
        raise ValueError(f"{str(error).removesuffix('.')}. {_REMEDY}") from None


def _read(folder: Path, mission: Mission | None) -> Solution:
    source = str(folder / "mission.json") if mission is None else f"mission {mission.name!r}"
    if mission is None:
        mission = read_mission(folder / "mission.json")
    path = folder / "plans.json"
    record = _record(path)
    if record.mission_digest != numbers_digest(mission):
        raise ValueError(
            f"{source}: expected the mission that the plans in {path} were made for, found one "
            f"whose nodes, arcs, rewards, survivals, lengths, base or robots are others."
        )
    objectives = np.array([(p.reward, p.survivors) for p in record.plans], float).reshape(-1, 2)
    own = {as_json(node): node for node in mission.nodes}
    plans = tuple(_plan(path, i, plan, mission, own) for i, plan in enumerate(record.plans))
    for i, (said, found) in enumerate(zip(objectives, mission.evaluate(plans), strict=True)):
        if not np.allclose(said, found, rtol=1e-9, atol=1e-9):
            raise ValueError(
                f"{path}: plan {i}: expected the objectives {found.tolist()} of its trails, got "
                f"{said.tolist()}: the plans or the mission were changed since."
            )
    return Solution(
        mission=mission,
        plans=plans,
        objectives=objectives,
        seconds=None,
        source=record.mission_source,
        **record.model_dump(exclude={"plans", "mission_source", "mission_digest"}),
    )


def _record(path: Path) -> _Record:
    text = _text(path)
    try:
        return _Record.model_validate(json.loads(text))
    except ValidationError as error:
        first = error.errors()[0]
        way = first["loc"][:-1] if first["type"] == "missing" else first["loc"]
        name = ".".join(map(str, way)) or "its content"
        raise ValueError(f"{path}: {wrong_value(name, first)}") from None
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        raise ValueError(f"{path}: {where}: expected JSON, found: {error.msg}.") from None
    except (RecursionError, ValueError) as error:  # nested too deeply, or too many digits
        raise ValueError(f"{path}: expected a solution, found: {error}.") from None


def _plan(
    path: Path, number: int, read: _Plan, mission: Mission, own: Mapping[str, Hashable]
) -> TrailPlan:
    """Make a plan of what was read; ``own`` are the mission's labels by what is written of them."""

    def label(written: object) -> Hashable:
        found = read_label(written)
        return found if found in mission.graph else own.get(as_json(written), found)

    try:
        if read.plan_id != number:
            raise ValueError(f"expected the plan_id {number}, got {read.plan_id}.")
        return mission.plan([[label(written) for written in trail] for trail in read.trails])
    except ValueError as error:
        raise ValueError(f"{path}: plan {number}: {error}") from None


def _text(path: Path) -> str:
    try:
        return decode(file_content(path))
    except MissionError as error:
        raise ValueError(f"{path}: {error.faults[0]}.") from None
