"""The tables of a study: their columns, how they are written, and how they are read again."""

import dataclasses
import io
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from botohe_moo.mission.model import Mission
from botohe_moo.study.file.model import StudyError
from botohe_moo.study.store.manifest import read_manifest, saved_mission, tabled_manifest
from botohe_moo.study.store.schemas import SCHEMAS
from botohe_moo.study.store.table_checks import FURTHER_TYPES, label_fault, schema_fault
from botohe_moo.study.store.table_files import AGAIN, put_tables, read_file
from botohe_moo.trails import TrailPlan

# These are written as CSV, too.
_LARGE = ("trace", "fronts", "plans", "references", "bounds")
_LONG = 200  # characters of a reason
SMALL = tuple(name for name in SCHEMAS if name not in _LARGE)


@dataclass(frozen=True, eq=False)
class StudyTables:
    """The outcome of a study as pandas tables; ``SCHEMAS`` describes their columns.

    Attributes
    ----------
    folder, manifest
        Where the study is, and what: its file's labels, budgets and the comparison that is wanted.
    runs, indicators, summary
        One row a run; one for each run and indicator; one for each mission and algorithm.
    trace, fronts, plans
        How the area of recorded fronts grows, their points, and the plans of the final ones.
    references
        The reference fronts: what all runs on a mission found together.
    bounds
        Points of which one weakly dominates each plan of a mission, found or not; none where the
        study asks for no bounds, or they are not computed yet.
    comparisons
        Pairwise tests, by mission.
    ranks, posthoc
        Average ranks over missions, and pairs of them, where Friedman's test applies.
    targets
        What it took to reach parts of the reference fronts' areas.
    missions, algorithms, environments
        What is compared, on what, with a column for each parameter, and where runs ran.

    Examples
    --------
    >>> from botohe_moo.study import StudyTables, run_study
    >>> trial = {
    ...     "name": "trial",
    ...     "missions": ["toy"],
    ...     "algorithms": ["greedy"],
    ...     "budget": {"evaluations": 50},
    ...     "seeds": 1,
    ... }
    >>> tables = run_study(trial, "results/trial")
    >>> tables.summary[["mission", "algorithm", "n"]].values.tolist()
    [['toy', 'greedy', 1]]
    >>> run = tables.runs["run"][0]
    >>> tables.mission("toy").labels(tables.plan(run, plan_id=0))
    ((1, 3, 2, 4, 5, 4, 2, 1), (1, 3, 2, 4, 5, 4, 2, 1))
    """

    folder: Path
    manifest: dict[str, Any]
    runs: pd.DataFrame
    trace: pd.DataFrame
    fronts: pd.DataFrame
    plans: pd.DataFrame
    indicators: pd.DataFrame
    references: pd.DataFrame
    bounds: pd.DataFrame
    comparisons: pd.DataFrame
    ranks: pd.DataFrame
    summary: pd.DataFrame
    posthoc: pd.DataFrame
    targets: pd.DataFrame
    missions: pd.DataFrame
    algorithms: pd.DataFrame
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
    def n_missing(self) -> int:
        """How many runs of the study were not there yet when its tables were made."""
        return int(self.missing["missing"].sum())

    @property
    def control(self) -> str | None:
        """Label of the algorithm that the others are compared with; None: all pairs."""
        return self.manifest["comparison"]["control"]  # type: ignore[no-any-return]

    @property
    def significance(self) -> float:
        """Significance level of the comparisons; intervals cover 1 minus this."""
        return float(self.manifest["comparison"]["significance"])

    @property
    def missing(self) -> pd.DataFrame:
        """Runs of the study that are not in the tables: ``mission``, ``algorithm``, ``missing``.

        A row for each mission and algorithm that lacks some. They were not performed yet, or the
        study was stopped.
        """
        wanted = len(self.manifest["seeds"])
        found: Any = self.runs.groupby(["mission", "algorithm"]).size()
        rows = [
            (mission, algorithm, wanted - int(found.get((mission, algorithm), 0)))
            for mission in self.mission_labels
            for algorithm in self.algorithm_labels
        ]
        table = pd.DataFrame(rows, columns=["mission", "algorithm", "missing"])
        return table[table["missing"] > 0].reset_index(drop=True)

    @property
    def missing_bounds(self) -> list[str]:
        """Labels of missions without the bound that the study asks for."""
        missing = self.missions["bound_area"].isna() & (self.manifest.get("bounds") is not None)
        return self.missions.loc[missing, "mission"].tolist()

    def mission(self, label: str) -> Mission:
        """Give a mission by its label.

        Parameters
        ----------
        label
            One of ``mission_labels``.

        Raises
        ------
        KeyError
            If there is no such mission.
        StudyError
            If its file is not the mission that was planned for any more.
        """
        if label not in self._missions:
            entry = self.manifest["missions"][label]
            self._missions[label] = saved_mission(self.folder / entry["file"], entry["digest"])
        return self._missions[label]

    @cached_property
    def _missions(self) -> dict[str, Mission]:
        """The missions that have been read so far, by label."""
        return {}

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
        return self.mission(row["mission"]).plan([[_label(v) for v in trail] for trail in trails])


def _label(value: Any) -> Any:
    """Give a node label as missions have it: JSON knows no tuples."""
    return tuple(map(_label, value)) if isinstance(value, list) else value


def to_arrow(name: str, frame: pd.DataFrame) -> pa.Table:
    """Check a table's columns and types; those that depend on the study may have several types."""
    schema = SCHEMAS[name]
    columns = list(frame.columns)
    n_further = len(columns) - len(schema) if schema.metadata else 0
    if columns[: len(columns) - n_further] != schema.names or len(set(columns)) < len(columns):
        raise StudyError(f"Table {name}: expected columns {schema.names}, got {columns}.")
    try:
        for field in pa.Schema.from_pandas(frame.iloc[:, len(schema) :], preserve_index=False):
            schema = schema.append(pa.field(field.name, FURTHER_TYPES[field.type]))
        table = pa.Table.from_pandas(frame, schema=schema, preserve_index=False, safe=True)
    except KeyError as error:
        raise StudyError(f"Table {name}: a column of type {error.args[0]}.") from error
    except (pa.ArrowInvalid, pa.ArrowTypeError, TypeError, ValueError) as error:
        raise StudyError(f"Table {name}: {error}") from error
    for field in schema:
        if not field.nullable and table.column(field.name).null_count:
            raise StudyError(f"Table {name}: expected values in all rows of column {field.name}.")
    return table


def write_tables(
    folder: Path, tables: Mapping[str, pd.DataFrame], manifest: Mapping[str, Any]
) -> None:
    """Check tables; write them as Parquet, the small ones as CSV, too, and their manifest."""
    checked = {name: to_arrow(name, frame) for name, frame in tables.items()}
    files = {}
    for name, table in checked.items():
        buffer = io.BytesIO()
        pq.write_table(table, buffer, compression="zstd")
        files[f"{name}.parquet"] = buffer.getvalue()
        if name in SMALL:
            files[f"{name}.csv"] = tables[name].to_csv(index=False, lineterminator="\n").encode()
    put_tables(folder, files, manifest)


def read_study(folder: str | os.PathLike[str]) -> StudyTables:
    """Read the tables of a study: while a runner is at work, those that were made last.

    Parameters
    ----------
    folder
        Folder that ``botohe study run`` has written to.

    Raises
    ------
    StudyError
        If it holds no study, no tables are made yet, or one is missing or damaged; names the file.

    Examples
    --------
    >>> from botohe_moo.study import read_study, run_study
    >>> trial = {
    ...     "name": "trial",
    ...     "missions": ["toy"],
    ...     "algorithms": ["greedy"],
    ...     "budget": {"evaluations": 50},
    ...     "seeds": 1,
    ... }
    >>> done = run_study(trial, "results/trial")
    >>> read_study("results/trial").runs[["algorithm", "status"]].values.tolist()
    [['greedy', 'done']]
    """
    folder = Path(folder)
    manifest = read_manifest(folder)
    names = [field.name for field in dataclasses.fields(StudyTables)][2:]
    while True:
        tabled = tabled_manifest(manifest)
        if tabled is None or not tabled["tables"].keys() >= set(names):
            raise StudyError(
                f"{folder}: its tables are not made yet: a runner is at work, or was killed. "
                f"`botohe study tables {folder}` makes them of the runs that are there."
            )
        try:
            tables = {name: _read_table(folder, name, tabled) for name in names}
        except StudyError:
            latest = read_manifest(folder)
            if latest == manifest:
                raise
            manifest = latest  # they have been replaced meanwhile
        else:
            return StudyTables(folder, tabled, **tables)


def _read_table(folder: Path, name: str, manifest: Mapping[str, Any]) -> pd.DataFrame:
    data = read_file(folder, f"{name}.parquet", manifest["tables"])
    path = folder / f"{name}.parquet"
    try:
        # Threads of Arrow's may still hold the file when Python ends, and abort it (apache/arrow
        # issues 34314 and 50482); a reader of memory needs none.
        read = pq.read_table(pa.BufferReader(data), use_threads=False, pre_buffer=False)
        read.validate(full=True)
        fault = schema_fault(name, read)
        table: pd.DataFrame = read.to_pandas(use_threads=False)
    except Exception as error:  # pandas and pyarrow declare none
        said = str(error).partition("\n")[0][:_LONG]
        raise StudyError(f"{path}: cannot be read ({said}); {AGAIN}.") from error
    if fault := fault or label_fault(name, table, manifest):
        raise StudyError(f"{path}: expected {fault}; {AGAIN}.")
    return table
