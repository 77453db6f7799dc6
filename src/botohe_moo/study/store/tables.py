"""The tables of a study: their columns, how they are written, and how they are read again."""

import io
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from botohe_moo.base.files import read_bytes, replace_file
from botohe_moo.mission.loading import read_mission
from botohe_moo.mission.model import Mission
from botohe_moo.study.file.model import StudyError
from botohe_moo.study.store.folder import read_manifest
from botohe_moo.study.store.schemas import SCHEMAS
from botohe_moo.trails import TrailPlan

_LARGE = ("trace", "fronts", "plans", "references", "bounds")  # all others are CSV files, too
_LONGEST_REASON = 200  # characters
# Keys of the metadata of Parquet files: a digest of what the tables were made from, the same in all
# that were made together, and in the table runs the manifest of the study.
_MADE_FROM, _MANIFEST = b"made_from", b"study"


@dataclass(frozen=True, eq=False)
class StudyTables:
    """The outcome of a study as pandas tables; ``SCHEMAS`` describes their columns.

    Attributes
    ----------
    folder, manifest
        The folder of the study, and its description: labels, budgets, comparison and so on.
    runs, indicators, summary
        One row a run; one for each run and indicator; one for each mission and algorithm.
    trace, fronts, plans
        Recorded fronts with their areas, the points of these, and the plans of the final fronts.
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
        Evaluations and seconds that it took to reach shares of the reference fronts' areas.
    missions, algorithms, environments
        Missions and algorithms, with columns for parameters, and where runs ran.

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
    _missions: dict[str, Mission] = field(default_factory=dict, init=False, repr=False)

    @property
    def name(self) -> str:
        """The study's name."""
        return str(self.manifest["name"])

    @property
    def title(self) -> str:
        """The study's title, or its name if it has no title."""
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
        labels = [self.mission_labels, self.algorithm_labels]
        cells = pd.MultiIndex.from_product(labels, names=["mission", "algorithm"])
        n_runs: Any = self.runs.groupby(cells.names).size().reindex(cells, fill_value=0)
        n_missing: pd.Series[int] = len(self.manifest["seeds"]) - n_runs
        return n_missing[n_missing > 0].reset_index(name="missing")

    @property
    def missing_bounds(self) -> list[str]:
        """Labels of missions without the bound that the study asks for."""
        missing = self.missions["bound_area"].isna() & (self.manifest.get("bounds") is not None)
        return self.missions.loc[missing, "mission"].tolist()

    def mission(self, label: str) -> Mission:
        """Return a mission by its label.

        Parameters
        ----------
        label
            One of ``mission_labels``.

        Raises
        ------
        KeyError
            If there is no such mission.
        OSError, MissionError
            If its file cannot be read, or is not that of a mission.
        """
        if label not in self._missions:
            entry = self.manifest["missions"][label]
            self._missions[label] = read_mission(self.folder / entry["file"])
        return self._missions[label]

    def plan(self, run: str, plan_id: int) -> TrailPlan:
        """Return a plan of a final front, to be evaluated again or drawn.

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
        rows = self.plans[
            self.plans["run"].str.startswith(run) & (self.plans["plan_id"] == plan_id)
        ]
        if len(rows) != 1:
            raise KeyError(f"Expected one plan {plan_id} of a run {run!r}, found {len(rows)}.")
        row = rows.iloc[0]
        return self.mission(row["mission"]).plan(json.loads(row["trails"]))


def to_arrow(name: str, frame: pd.DataFrame) -> pa.Table:
    """Convert a table; raise an error if a column is missing or not of its schema's type."""
    schema = SCHEMAS[name]
    if schema.metadata:  # the table may have further columns
        further = frame.drop(columns=schema.names)
        schema = pa.schema([*schema, *pa.Schema.from_pandas(further, preserve_index=False)])
    return pa.Table.from_pandas(frame, schema, preserve_index=False)


def from_arrow(table: pa.Table, **options: Any) -> pd.DataFrame:
    """Convert a table back, without Arrow's threads.

    They may still hold Python's data when Python ends, and then abort it (apache/arrow issues
    34314 and 50482).
    """
    frame: pd.DataFrame = table.to_pandas(use_threads=False, **options)
    return frame


def write_tables(
    folder: Path, tables: Mapping[str, pd.DataFrame], manifest: Mapping[str, Any]
) -> None:
    """Write tables as Parquet, and the small ones as CSV, too.

    All are made before the first one replaces an earlier one. A process that is killed meanwhile
    leaves some new tables beside old ones; a reader notices by ``made_from`` in their metadata.
    """
    files = {}
    for name, frame in tables.items():
        table = to_arrow(name, frame)
        metadata = {**table.schema.metadata, _MADE_FROM: manifest["made_from"]}
        if name == "runs":
            metadata[_MANIFEST] = json.dumps(manifest)
        table = table.replace_schema_metadata(metadata)
        buffer = io.BytesIO()
        pq.write_table(table, buffer, compression="zstd")
        files[f"{name}.parquet"] = buffer.getvalue()
        if name not in _LARGE:
            files[f"{name}.csv"] = frame.to_csv(index=False, lineterminator="\n").encode()
    for file, data in files.items():
        replace_file(folder / file, data)


def read_study(folder: str | os.PathLike[str]) -> StudyTables:
    """Read the tables of a study that were made last.

    Parameters
    ----------
    folder
        Folder that ``botohe study run`` has written to.

    Raises
    ------
    StudyError
        If the folder holds no study or no tables yet, or if one is missing or damaged.

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
    remedy = f"`botohe study tables {folder}` makes the tables of the runs that are there."
    tables, made_from, manifest = {}, set(), b""
    for name in SCHEMAS:
        path = folder / f"{name}.parquet"
        try:
            data = pa.BufferReader(read_bytes(path))
            # Not ``read_table``: it starts threads whatever it is told.
            table = pq.ParquetFile(data, pre_buffer=False).read(use_threads=False)
            metadata = table.schema.metadata
            made_from.add(metadata[_MADE_FROM])
            manifest = metadata.get(_MANIFEST, manifest)
            tables[name] = from_arrow(table)
        except FileNotFoundError:
            read_manifest(folder)  # raises if there is no study at all
            raise StudyError(f"{path}: there is no such table yet. {remedy}") from None
        except (OSError, ValueError, LookupError, pa.ArrowException) as error:
            reason = f"{error}".partition("\n")[0][:_LONGEST_REASON]
            raise StudyError(f"{path}: cannot be read ({reason}). {remedy}") from error
    if len(made_from) > 1:
        raise StudyError(f"{folder}: its tables are of several moments. {remedy}")
    return StudyTables(folder, json.loads(manifest), **tables)
