"""The tables of a study: their columns, how they are written, and how they are read again."""

from __future__ import annotations

import dataclasses
import io
import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from botohe_moo._checks import nearest_first
from botohe_moo._files import replace_file
from botohe_moo.mission.files import read_mission

if TYPE_CHECKING:
    import os

    from botohe_moo.mission.model import Mission
    from botohe_moo.trails import TrailPlan

__all__ = ["SCHEMAS", "StudyError", "StudyTables", "read_study", "write_tables"]

TEXT, INTEGER, NUMBER, FLAG = pa.string(), pa.int64(), pa.float64(), pa.bool_()
SMALL = ("runs", "indicators", "comparisons", "ranks", "environments", "summary")
MANIFEST = "study.json"


class StudyError(ValueError):
    """What is wrong with a study or its folder, and where; one line for each fault."""


def _schema(*columns: tuple[str, pa.DataType, str], optional: tuple[str, ...] = ()) -> pa.Schema:
    return pa.schema(
        pa.field(name, dtype, name in optional, {"description": description})
        for name, dtype, description in columns
    )


_RUN = (
    ("run", TEXT, "identity of the run: digest of everything its result depends on"),
    ("mission", TEXT, "label of the mission in the study file"),
    ("algorithm", TEXT, "label of the algorithm in the study file"),
    ("seed", INTEGER, "seed of the run's random numbers"),
)
_PLAN = (
    ("reward", NUMBER, "E[R], expected team reward"),
    ("survivors", NUMBER, "E[S], expected number of surviving robots"),
)
_EVALUATIONS = ("evaluations", INTEGER, "trail plans evaluated so far")
_SECONDS = ("seconds", NUMBER, "the algorithm's own time so far, without recording")

SCHEMAS: dict[str, pa.Schema] = {
    "runs": _schema(
        *_RUN,
        ("status", TEXT, "done, infeasible, timeout or failed"),
        ("stopped_by", TEXT, "evaluations, seconds, itself, limit (killed) or error"),
        ("evaluations", INTEGER, "trail plans evaluated"),
        ("seconds", NUMBER, "the algorithm's own time, without recording and indicators"),
        ("recording_seconds", NUMBER, "time spent on recording fronts"),
        ("budget_evaluations", INTEGER, "evaluations allowed; missing where there is no limit"),
        ("budget_seconds", NUMBER, "seconds allowed; missing where there is no limit"),
        ("min_survival", NUMBER, "survival floor of every robot"),
        ("area", NUMBER, "area of the final front, in [0, 1]"),
        ("front_size", INTEGER, "plans on the final front"),
        ("environment", TEXT, "where it ran: a row of environments"),
        ("error", TEXT, "what went wrong, in a line; missing where nothing did"),
        ("traceback", TEXT, "where it went wrong; missing where nothing did"),
        optional=("budget_evaluations", "budget_seconds", "error", "traceback"),
    ),
    "trace": _schema(
        *_RUN,
        _EVALUATIONS,
        _SECONDS,
        ("area", NUMBER, "area of the front, in [0, 1]"),
        ("front_size", INTEGER, "plans on the front"),
    ),
    "fronts": _schema(*_RUN, _EVALUATIONS, *_PLAN),
    "plans": _schema(
        *_RUN,
        ("plan_id", INTEGER, "number of the plan on the final front, by descending reward"),
        *_PLAN,
        ("trails", TEXT, "the robots' trails, lists of node labels as JSON"),
    ),
    "indicators": _schema(
        *_RUN,
        ("indicator", TEXT, "area, igd_plus, epsilon or front_size"),
        ("value", NUMBER, "its value for the final front"),
        ("reference", TEXT, "the reference front, a key of references; missing if it needs none"),
        optional=("reference",),
    ),
    "references": _schema(
        ("reference", TEXT, "digest of the front's points"),
        ("mission", TEXT, "label of the mission in the study file"),
        *_PLAN,
    ),
    "comparisons": _schema(
        ("mission", TEXT, "label of the mission in the study file"),
        ("indicator", TEXT, "what is compared"),
        ("algorithm", TEXT, "label of the first algorithm"),
        ("other", TEXT, "label of the second, the control where there is one"),
        ("n", INTEGER, "runs of the first"),
        ("n_other", INTEGER, "runs of the second"),
        ("median", NUMBER, "median of the first"),
        ("median_other", NUMBER, "median of the second"),
        ("p_value", NUMBER, "of the two-sided Mann-Whitney test"),
        ("p_holm", NUMBER, "corrected by Holm over the mission's comparisons by this indicator"),
        ("a12", NUMBER, "probability that a run of the first is better, ties counted half"),
        ("a12_low", NUMBER, "lower end of its confidence interval"),
        ("a12_high", NUMBER, "upper end of its confidence interval"),
        ("significant", FLAG, "whether p_holm is below the significance level"),
        ("verdict", TEXT, "the same in words"),
    ),
    "ranks": _schema(
        ("indicator", TEXT, "what is ranked by"),
        ("algorithm", TEXT, "label of the algorithm"),
        ("average_rank", NUMBER, "mean over missions of the rank of its median; 1 is best"),
        ("n_missions", INTEGER, "missions, the blocks of the test"),
        ("statistic", NUMBER, "Friedman's statistic; missing where there is no test"),
        ("p_value", NUMBER, "of the Friedman test; missing where there is no test"),
        ("note", TEXT, "the outcome in words, or why there is no test"),
        optional=("statistic", "p_value"),
    ),
    "summary": _schema(
        ("mission", TEXT, "label of the mission in the study file"),
        ("algorithm", TEXT, "label of the algorithm"),
        ("n", INTEGER, "runs"),
        ("n_not_done", INTEGER, "runs among them that failed, timed out or found nothing feasible"),
        ("area_median", NUMBER, "median area"),
        ("area_low", NUMBER, "lower end of the median's bootstrap confidence interval"),
        ("area_high", NUMBER, "upper end of it"),
        ("area_mean", NUMBER, "mean area"),
        ("area_sd", NUMBER, "standard deviation of the areas; missing for a single run"),
        ("area_best", NUMBER, "largest area"),
        ("igd_plus_median", NUMBER, "median IGD+; missing where it is not computed"),
        ("epsilon_median", NUMBER, "median additive epsilon; missing where it is not computed"),
        ("front_size_median", NUMBER, "median number of plans on the front"),
        ("rank", NUMBER, "rank of the median area on this mission; 1 is best"),
        ("evaluations_median", NUMBER, "median number of evaluations"),
        ("seconds_median", NUMBER, "median of the algorithm's own time"),
        optional=("area_sd", "igd_plus_median", "epsilon_median"),
    ),
    "environments": _schema(
        ("environment", TEXT, "digest of the other columns"),
        ("botohe_moo", TEXT, "version of this package"),
        ("commit", TEXT, "commit of its source, with + where it was changed; missing if installed"),
        ("python", TEXT, "version"),
        ("packages", TEXT, "versions of the packages that compute, as name==version"),
        ("system", TEXT, "operating system"),
        ("machine", TEXT, "name of the machine"),
        ("processor", TEXT, "model of the processor"),
        ("n_cpus", INTEGER, "processors that may be used"),
        ("threads", TEXT, "settings of thread pools, as NAME=VALUE"),
        optional=("commit",),
    ),
}


@dataclass(frozen=True, eq=False)
class StudyTables:
    """The outcome of a study as pandas tables; ``SCHEMAS`` describes their columns.

    Attributes
    ----------
    folder
        Where the study is.
    manifest
        What the study is: its file, with labels, budgets and the comparison that is wanted.
    runs
        One row a run.
    trace
        One row a recorded front: how the area grows.
    fronts
        The points of all recorded fronts.
    plans
        The plans of the final fronts.
    indicators
        One row for each run and indicator.
    references
        The reference fronts: what all runs on a mission found together.
    comparisons
        Pairwise tests, by mission.
    ranks
        Average ranks over missions.
    summary
        One row for each mission and algorithm.
    environments
        Where runs ran.
    """

    folder: Path
    manifest: dict[str, Any]
    runs: pd.DataFrame
    trace: pd.DataFrame
    fronts: pd.DataFrame
    plans: pd.DataFrame
    indicators: pd.DataFrame
    references: pd.DataFrame
    comparisons: pd.DataFrame
    ranks: pd.DataFrame
    summary: pd.DataFrame
    environments: pd.DataFrame

    @property
    def name(self) -> str:
        """The study's name."""
        return str(self.manifest["name"])

    @property
    def title(self) -> str:
        """What the study is, in words; its name where its file says nothing."""
        return str(self.manifest.get("title") or self.name)

    @property
    def mission_labels(self) -> list[str]:
        """Labels of the missions, in the order of the study file."""
        return list(self.manifest["missions"])

    @property
    def algorithm_labels(self) -> list[str]:
        """Labels of the algorithms, in the order of the study file."""
        return list(self.manifest["algorithms"])

    @property
    def control(self) -> str | None:
        """Label of the algorithm that the others are compared with; None: all pairs."""
        return self.manifest["comparison"]["control"]  # type: ignore[no-any-return]

    @property
    def significance(self) -> float:
        """Significance level of the comparisons; intervals cover 1 minus this."""
        return float(self.manifest["comparison"]["significance"])

    @cached_property
    def missions(self) -> dict[str, Mission]:
        """The missions by label."""
        return {
            label: read_mission(self.folder / entry["file"])
            for label, entry in self.manifest["missions"].items()
        }

    def plan(self, run: str, plan_id: int) -> TrailPlan:
        """Give a plan of a final front, to be evaluated again or drawn.

        Parameters
        ----------
        run
            Identity of the run, or the beginning of it, as in column ``run``.
        plan_id
            Number of the plan on its front, as in column ``plan_id``.

        Raises
        ------
        KeyError
            If there is no such run or plan, or several runs begin like that.
        """
        found = self.plans[
            self.plans["run"].str.startswith(run) & (self.plans["plan_id"] == plan_id)
        ]
        if len(found) != 1:
            raise KeyError(f"Expected one plan {plan_id} of a run {run!r}, found {len(found)}.")
        row = found.iloc[0]
        trails = json.loads(row["trails"])
        return self.missions[row["mission"]].plan([[_label(v) for v in trail] for trail in trails])


def _label(value: Any) -> Any:
    """Give a node label as missions have it: JSON knows no tuples."""
    return tuple(map(_label, value)) if isinstance(value, list) else value


def to_arrow(name: str, frame: pd.DataFrame) -> pa.Table:
    """Check a table's columns and types.

    Raises
    ------
    StudyError
        If a column is missing or too many, of another type, or lacks values it has to have.
    """
    schema = SCHEMAS[name]
    if list(frame.columns) != schema.names:
        raise StudyError(f"Table {name}: expected columns {schema.names}, got {list(frame)}.")
    try:
        table = pa.Table.from_pandas(frame, schema=schema, preserve_index=False, safe=True)
    except (pa.ArrowInvalid, pa.ArrowTypeError, TypeError, ValueError) as error:
        raise StudyError(f"Table {name}: {error}") from error
    for field in schema:
        if not field.nullable and table.column(field.name).null_count:
            raise StudyError(f"Table {name}: expected values in all rows of column {field.name}.")
    return table


def write_tables(folder: Path, tables: dict[str, pd.DataFrame]) -> None:
    """Write tables as Parquet, the small ones as CSV, too; each appears whole or not at all.

    Raises
    ------
    StudyError
        If a table is not of its schema; nothing is written then.
    OSError
        If the folder cannot be written to.
    """
    checked = {name: to_arrow(name, frame) for name, frame in tables.items()}
    for name, table in checked.items():
        buffer = io.BytesIO()
        pq.write_table(table, buffer, compression="zstd")
        replace_file(folder / f"{name}.parquet", buffer.getvalue())
        if name in SMALL:
            text = tables[name].to_csv(index=False, lineterminator="\n")
            replace_file(folder / f"{name}.csv", text.encode())


def read_table(path: Path) -> pd.DataFrame:
    """Read one Parquet file.

    Raises
    ------
    StudyError
        If it is missing or damaged.
    """
    try:
        table: pd.DataFrame = pq.read_table(io.BytesIO(path.read_bytes())).to_pandas()
    except FileNotFoundError:
        raise StudyError(f"{path}: there is no such table; `botohe study run` makes it.") from None
    except (OSError, pa.ArrowException) as error:
        raise StudyError(f"{path}: cannot be read ({error}); run the study again.") from error
    return table


def read_study(folder: str | os.PathLike[str]) -> StudyTables:
    """Read the tables of a study.

    Parameters
    ----------
    folder
        Folder that ``botohe study run`` has written to.

    Raises
    ------
    StudyError
        If it holds no study, or a table is missing or damaged; names the file.
    """
    folder = Path(folder)
    manifest = read_manifest(folder)
    names = [field.name for field in dataclasses.fields(StudyTables)][2:]
    tables = {name: read_table(folder / f"{name}.parquet") for name in names}
    return StudyTables(folder, manifest, **tables)


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read what a folder's study is.

    Raises
    ------
    StudyError
        If the folder holds no study, or the file is damaged.
    """
    path = folder / MANIFEST
    try:
        content = json.loads(path.read_bytes())
        if not (isinstance(content, dict) and content.keys() >= {"name", "missions", "algorithms"}):
            raise ValueError("not a study's")
    except FileNotFoundError:
        among = sorted(p.parent.name for p in folder.parent.glob(f"*/{MANIFEST}"))
        near = nearest_first(folder.name, among)
        known = f"; studies beside it are {', '.join(near)}" if near else ""
        raise StudyError(f"{folder}: there is no study in this folder{known}.") from None
    except (OSError, ValueError) as error:
        raise StudyError(f"{path}: cannot be read ({error}); run the study again.") from error
    return content
