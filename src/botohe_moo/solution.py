"""What a search found: a front of plans, as a table, as JSON and as a folder of files."""

from __future__ import annotations

import csv
import io
import json
import math
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import BaseModel, Field, FiniteFloat, NonNegativeInt

from botohe_moo.base.files import Source, replace_file
from botohe_moo.base.messages import counted
from botohe_moo.base.parameters import validated
from botohe_moo.base.types import FloatArray
from botohe_moo.core.world import CHECKING
from botohe_moo.decide import choosing, fronts, hazards
from botohe_moo.decide.wishes import Quantity, Wish
from botohe_moo.indicators import area_indicator
from botohe_moo.mission.formats.graphs import write_node_link
from botohe_moo.mission.loading import read_mission
from botohe_moo.mission.model import Mission, numbers_digest
from botohe_moo.mission.rules import read_label
from botohe_moo.objectives import Objectives
from botohe_moo.trails import PlanBatch, TrailPlan

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Solution", "read_solution"]

TABLES = ("front.csv", "plans.json", "mission.json")
FRONT_PICTURE = "front.png"
PAGE = "explorer.html"
BOUND = "bound.json"
FILES = (*TABLES, FRONT_PICTURE, "mission.png", PAGE, BOUND)
_SHOWN = 10  # rows of a table of a front of other objectives, at most


@dataclass(frozen=True, eq=False, repr=False)
class Solution:
    """What a search found, and how.

    Attributes
    ----------
    mission
        The mission.
    plans
        The non-dominated plans, by descending expected reward.
    objectives
        Their objectives (n_plans, n_objectives): E[R] and E[S], or those that
        ``problem_objectives`` names.
    algorithm, parameters, seed
        The algorithm's name, its parameters as given, and the seed.
    evaluations
        Number of trail plans that were evaluated.
    seconds
        How long the search took, with what was compiled; None if the solution was read from files.
    interrupted
        Whether the search was stopped before its budget was spent.
    moves
        What each move of a local search brought: children ``tried``, and plans that ``entered`` the
        front. Empty for other algorithms.
    problem, problem_objectives
        The class of the problem, as ``module:Class``, or None for :class:`BOTOHE` itself; names,
        bounds and columns of its objectives.
    source
        Arguments of :func:`load_mission` that make the mission, where they are known.
    min_survival, max_length
        The survival floor, 0 for none, and the travel budget, None for none.

    Examples
    --------
    >>> from botohe_moo import Solution, read_solution, solve
    >>> solution = solve("toy", "greedy", evaluations=100)
    >>> solution
    <Solution of 'toy' by greedy, seed 1: 4 plans, area 0.6087, 4 evaluations>
    >>> solution.table.round(2).head(2)
       plan_id  reward  survivors
    0        0    9.01       0.70
    1        1    7.09       1.35
    >>> files = solution.write("found")
    >>> read_solution("found").area == solution.area
    True
    """

    mission: Mission
    plans: tuple[TrailPlan, ...]
    objectives: FloatArray
    algorithm: str
    parameters: Mapping[str, Any]
    seed: int
    evaluations: int
    seconds: float | None = None
    interrupted: bool = False
    moves: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    source: Mapping[str, Any] = field(default_factory=dict)
    min_survival: float = 0.0
    max_length: float | None = None
    problem: str | None = None
    problem_objectives: Objectives = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.problem_objectives is None:
            object.__setattr__(self, "problem_objectives", Objectives.of(self.mission))

    @property
    def area(self) -> float:
        """The front's area indicator, in [0, 1]."""
        return area_indicator(self.objectives, self.problem_objectives)

    @cached_property
    def expected(self) -> FloatArray:
        """E[R] and E[S] of the plans (n_plans, 2), also where the problem has other objectives."""
        is_plain = self.problem_objectives.is_plain
        return self.objectives if is_plain else self.mission.evaluate(self.plans)

    @property
    def table(self) -> pd.DataFrame:
        """The front: ``plan_id``, ``reward`` (E[R]) and ``survivors`` (E[S]).

        For another problem it has the columns of its objectives.
        """
        import pandas as pd

        table = pd.DataFrame(self.objectives, columns=self.problem_objectives.columns)
        return table.rename_axis("plan_id").reset_index()

    def worst_case(self, losses: int = 1) -> FloatArray:
        """Compute the least E[R] if some robots never leave; see :func:`botohe_moo.worst_case`.

        As a column of the table: ``solution.table.assign(worst_case=solution.worst_case())``.
        """
        return hazards.worst_case(self.mission, self.plans, losses)

    def choose(self, *wishes: str | Wish, most: Quantity | None = None) -> choosing.Choice:
        """Choose the plan of most expected reward that meets all wishes.

        See :func:`botohe_moo.decide.choose`.
        """
        return choosing.choose(self.mission, self.plans, *wishes, most=most)

    def toward(self, *, reward: float, survivors: float) -> choosing.Choice:
        """Choose the plan nearest to a reference point; see :func:`botohe_moo.decide.toward`."""
        return choosing.toward(self.mission, self.plans, reward=reward, survivors=survivors)

    def knees(self) -> tuple[fronts.Mark, ...]:
        """Mark where the front bends; see :func:`botohe_moo.decide.knees`."""
        return fronts.knees(self.mission, self.expected)

    def survivor_price(self, index: int) -> float:
        """Compute the price of a survivor; see :func:`botohe_moo.decide.survivor_price`."""
        return fronts.survivor_price(self.mission, self.expected, index)

    def representatives(self, k: int = 5) -> tuple[int, ...]:
        """Select ``k`` plans, by their rows; see :func:`botohe_moo.decide.representatives`."""
        return fronts.representatives(self.mission, self.plans, k)

    def __repr__(self) -> str:
        how = f"{self.mission.name!r} by {self.algorithm}, seed {self.seed}"
        found = f"{counted(len(self.plans), 'plan')}, area {self.area:.4f}"
        return f"<Solution of {how}: {found}, {self.evaluations} evaluations>"

    def describe(self, *, all_plans: bool = False) -> str:
        """Describe the search and its front in words and a table.

        The table has some ten plans, or all: the ends of the front, its knee (see :meth:`knees`)
        and :meth:`representatives`. Its last column is :meth:`survivor_price`.
        """
        if self.problem is None:
            front = self.mission, self.plans, self.objectives
            table, n_rows = fronts.front_table(*front, all_plans=all_plans)
        else:
            n_rows = len(self.plans) if all_plans else min(_SHOWN, len(self.plans))
            table = self.table.round(3).to_string(index=False, max_rows=n_rows)
        some = f"; the table shows {n_rows}" if n_rows < len(self.plans) else ""
        took = "" if self.seconds is None else f" in {self.seconds:.1f} s"
        stopped = "stopped after" if self.interrupted else "spent"
        spent = f"{stopped} {self.evaluations:,} evaluations{took}"
        found = f"area {self.area:.4f}, {counted(len(self.plans), 'plan')} on the front{some}"
        return f"{table}\n\n{self.algorithm}, seed {self.seed}: {spent}\n{found}"

    def explore(self, path: str | os.PathLike[str], **options: Any) -> Path:
        """Write a page on which to walk along the front, look at its plans and compare them.

        See :func:`botohe_moo.explorer.explore`, which takes the same options.
        """
        from botohe_moo.explorer import explore

        return explore(self, path, **options)

    def _repr_html_(self) -> str | None:
        """Show the page of ``explore``, of 100 plans at most, in a notebook; None without plans."""
        from botohe_moo.explorer.page import notebook_frame

        return notebook_frame(self) if self.plans else None

    def to_json(self) -> str:
        """Write how it was found, and each plan's trails as lists of node labels.

        What JSON cannot hold is written as its ``repr``.
        """
        columns = "plan_id", *self.problem_objectives.columns
        content = {
            "mission": self.mission.name,
            "problem": self.problem,
            "problem_objectives": self.problem_objectives,
            "mission_source": self.source,
            "mission_digest": numbers_digest(self.mission),
            "robots": self.mission.robots,
            "total_reward": self.mission.total_reward,
            "algorithm": self.algorithm,
            "parameters": self.parameters,
            "seed": self.seed,
            "min_survival": self.min_survival,
            "max_length": self.max_length,
            "evaluations": self.evaluations,
            "interrupted": self.interrupted,
            "moves": self.moves,
            "area": self.area,
            "version": version("botohe-moo"),
            "plans": [
                {**dict(zip(columns, row, strict=True)), "trails": self.mission.labels(plan)}
                for row, plan in zip(self._rows(), self.plans, strict=True)
            ],
        }
        return _as_json(content, indent=1) + "\n"

    def _rows(self) -> list[tuple[float, ...]]:
        return [(i, *values) for i, values in enumerate(self.objectives.tolist())]

    def write(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write ``front.csv``, ``plans.json``, ``mission.json``, ``front.png`` and ``mission.png``.

        Each file appears complete, or not at all. Pictures come last: if one fails, the tables are
        there. ``mission.json`` is left out if JSON cannot hold the mission. ``explorer.html`` and
        ``bound.json`` of an earlier solution are removed.

        Parameters
        ----------
        folder
            Folder to write to; made if it does not exist. An OSError is raised if it cannot be
            written to.
        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        front = io.StringIO()  # not by pandas, whose import would take a second
        csv.writer(front, lineterminator="\n").writerows(
            [("plan_id", *self.problem_objectives.columns), *self._rows()]
        )
        tables = {"front.csv": front.getvalue().encode(), "plans.json": self.to_json().encode()}
        with suppress(ValueError):
            tables["mission.json"] = write_node_link(self.mission)
        for name in FILES:
            if name in tables:
                replace_file(folder / name, tables[name])
            else:
                (folder / name).unlink(missing_ok=True)
        from botohe_moo.plots import plot_front, plot_mission, plot_pairs, save_plot

        if self.problem is None:
            save_plot(plot_front(self.objectives, self.mission), folder / FRONT_PICTURE)
        else:
            save_plot(plot_pairs(self.table, self.problem_objectives), folder / FRONT_PICTURE)
        save_plot(plot_mission(self.mission), folder / "mission.png")
        return [folder / name for name in FILES if (folder / name).exists()]


class _Plan(BaseModel, strict=True, extra="allow"):
    __pydantic_extra__: dict[str, FiniteFloat] = Field(init=False)  # its row and objectives
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
    mission_source: dict[str, Any]
    mission_digest: str
    problem: str | None
    problem_objectives: Objectives
    plans: list[_Plan]


def read_solution(folder: str | os.PathLike[str], *, mission: Mission | None = None) -> Solution:
    """Read the solution that :meth:`Solution.write` wrote.

    All plans are evaluated again, and compared with the limits of the search. Of another
    problem's objectives only E[R] and E[S] are checked, since nothing in the files is executed or
    unpickled.

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
        those of the plans. It names the file and the fault.

    Examples
    --------
    >>> from botohe_moo import read_solution, solve
    >>> files = solve("toy", "greedy", evaluations=100).write("found")
    >>> read_solution("found")
    <Solution of 'toy' by greedy, seed 1: 4 plans, area 0.6087, 4 evaluations>
    """
    path, source = Path(folder, "plans.json"), Path(folder, "mission.json")
    where = str(source) if mission is None else f"mission {mission.name!r}"
    mission = read_mission(source) if mission is None else mission
    record = validated(Source(path).data, _Record, source=str(path))
    if record.mission_digest != numbers_digest(mission):
        raise ValueError(f"{where} does not match {path}: the mission was changed.")
    own = record.problem_objectives if record.problem else Objectives.of(mission)
    try:
        batch = _plans_of(record, mission)
        objectives = np.full((len(batch), len(own.columns)), math.nan)
        for i, plan in enumerate(record.plans):
            objectives[i] = [plan.__pydantic_extra__.get(name, math.nan) for name in own.columns]
        # What else another problem computes is trusted: no code is run that a file names.
        longest = math.inf if record.max_length is None else record.max_length
        limits = mission.limits(record.min_survival, longest).loosened(CHECKING)
        evaluated, plain = objectives.copy(), mission.check_limits(batch, limits)
        for i, name in enumerate(("E[R]", "E[S]")):
            if name in own.names:
                evaluated[:, own.names.index(name)] = plain[:, i]
        agree = np.isclose(objectives, evaluated, rtol=1e-9, atol=1e-9).all(axis=1)
        if not agree.all():
            i = int(agree.argmin())
            raise ValueError(
                f"Plan {i}: expected the objectives {evaluated[i].tolist()} of its trails, got "
                f"{objectives[i].tolist()}: the plans or the mission were changed."
            )
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return Solution(
        mission=mission,
        plans=tuple(batch),
        objectives=objectives,
        source=record.mission_source,
        problem_objectives=own,
        **record.model_dump(
            exclude={"plans", "mission_source", "mission_digest", "problem_objectives"}
        ),
    )


def _plans_of(record: _Record, mission: Mission) -> PlanBatch:
    """Return the plans of a file, in one pass: a front may have millions of nodes on its trails."""
    labels = (read_label(json.loads(_as_json(node))) for node in mission.nodes)  # as in the file
    index_of = {label: i for i, label in enumerate(labels)}
    plans = []
    for i, plan in enumerate(record.plans):
        try:
            plans.append([[index_of[read_label(v)] for v in trail] for trail in plan.trails])
        except (KeyError, TypeError, ValueError):  # `plan` says which label is unknown
            mission.plan(plan.trails)
            raise
        if len(plan.trails) != mission.robots:
            expected = f"expected {mission.robots} trails"
            raise ValueError(f"Plan {i}: {expected}, got {len(plan.trails)}.")
    return mission.pack(plans)


def _as_json(content: object, *, indent: int | None = None) -> str:
    """Write a solution, or a label of its mission, as JSON."""
    return json.dumps(content, indent=indent, default=_plain)


def _plain(value: object) -> object:
    """Return what JSON can hold instead of ``value``."""
    if isinstance(value, Objectives):
        return asdict(value)
    return value.item() if isinstance(value, np.generic) else repr(value)
