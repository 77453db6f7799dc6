"""Reading the folder of a solution; nothing in it is executed or unpickled."""

import os
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, Field, FiniteFloat, NonNegativeInt

from botohe_moo.base.files import Source
from botohe_moo.base.parameters import json_record
from botohe_moo.mission.loading import read_mission
from botohe_moo.mission.model import Mission, numbers_digest
from botohe_moo.solution.model import Solution, as_json

_REMEDY = "Solve the mission again, or put back what was written."


class _Plan(BaseModel, strict=True):
    reward: FiniteFloat
    survivors: FiniteFloat
    trails: list[list[Any]]


class _Record(BaseModel, strict=True):
    algorithm: str
    parameters: dict[str, Any]
    seed: NonNegativeInt
    min_survival: Annotated[float, Field(ge=0, le=1)]
    max_length: Annotated[FiniteFloat, Field(ge=0)] | None = None  # not in earlier versions' files
    evaluations: NonNegativeInt
    interrupted: bool
    moves: dict[str, dict[str, NonNegativeInt]] = Field(default_factory=dict)
    area: FiniteFloat
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
    except ValueError as error:
        raise ValueError(f"{str(error).removesuffix('.')}. {_REMEDY}") from None


def _read(folder: Path, mission: Mission | None) -> Solution:
    source = str(folder / "mission.json") if mission is None else f"mission {mission.name!r}"
    if mission is None:
        mission = read_mission(folder / "mission.json")
    path = folder / "plans.json"
    record = json_record(path, Source(path).data, _Record)
    if record.mission_digest != numbers_digest(mission):
        raise ValueError(
            f"{source}: expected the mission that the plans in {path} were made for, found one "
            f"whose nodes, arcs, base or robots, or what they say of these, are others."
        )
    labels = {as_json(node): node for node in mission.nodes}  # by what is written of them
    plans = []
    for i, read in enumerate(record.plans):
        trails = [[labels.get(as_json(node), node) for node in trail] for trail in read.trails]
        try:
            plans.append(mission.plan(trails))
        except ValueError as error:
            raise ValueError(f"{path}: plan {i}: {error}") from None
    objectives = np.array([(p.reward, p.survivors) for p in record.plans], float).reshape(-1, 2)
    for i, (said, found) in enumerate(zip(objectives, mission.evaluate(plans), strict=True)):
        if not np.allclose(said, found, rtol=1e-9, atol=1e-9):
            raise ValueError(
                f"{path}: plan {i}: expected the objectives {found.tolist()} of its trails, got "
                f"{said.tolist()}: the plans or the mission were changed since."
            )
    solution = Solution(
        mission=mission,
        plans=tuple(plans),
        objectives=objectives,
        seconds=None,
        source=record.mission_source,
        **record.model_dump(exclude={"plans", "mission_source", "mission_digest", "area"}),
    )
    if not np.isclose(solution.area, record.area, rtol=1e-9):
        expected = f"expected plans of area {record.area:.6g}, found {solution.area:.6g}"
        raise ValueError(f"{path}: {expected}: plans are missing.")
    return solution
