"""The tables of a study: their columns, how they are written, and how they are read again."""

import csv
import gzip
import hashlib
import io
import json
import os
from collections import UserDict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from botohe_moo.base.files import read_bytes, replace_file
from botohe_moo.base.registry import is_path
from botohe_moo.indicators import INDICATORS, further_indicators
from botohe_moo.mission.loading import read_mission
from botohe_moo.mission.model import Mission
from botohe_moo.objectives import Objectives
from botohe_moo.study.folder import read_manifest
from botohe_moo.study.model import StudyError
from botohe_moo.trails import TrailPlan

OBJECTIVES = ("reward", "survivors")  # of a study without a problem of its own
INDEX = "tables.json"  # the schema of each table, and the study that they were made of
_FORMAT = 2  # of these files; 1 were Parquet files without an index
# What is kept of indicators of modules, which a folder does not import.
_DESCRIBED = ("label", "higher_is_better", "needs_reference", "long_label", "latex")
_LARGE = ("trace", "fronts", "plans", "references", "bounds")  # these are compressed
_LONGEST_REASON = 200  # characters
_TEXT = pd.Series(["text"]).dtype  # pandas 3 has a type of its own for texts
_DTYPES = {"text": _TEXT, "integer": "Int64", "number": "float64", "flag": "boolean"}
_COMPLETE = {"text": _TEXT, "integer": "int64", "number": "float64", "flag": "bool"}


class Column(NamedTuple):
    """A column of a table."""

    type: str  # text, integer, number or flag
    description: str = ""
    nullable: bool = True

    @property
    def dtype(self) -> Any:
        """Its type in pandas."""
        return (_DTYPES if self.nullable else _COMPLETE)[self.type]


class _Schemas(UserDict[str, Any]):
    """The columns of each table, by their names, as ``columns.csv`` lists them.

    Some tables have a column for each further indicator that is registered.
    """

    def __init__(self) -> None:
        super().__init__()
        file = Path(__file__).with_name("columns.csv")
        for row in csv.DictReader(file.read_text("utf-8").splitlines()):
            self.data.setdefault(row["table"], []).append(row)

    def __getitem__(self, table: str) -> dict[str, Column]:
        columns = {}
        for row in self.data[table]:
            about = "; missing ".join(filter(None, [row["description"], row["missing"]]))
            names = [""] if "{indicator}" not in row["column"] else further_indicators()
            for name in names:
                words = INDICATORS[name].in_words if name else ""
                said = about.format(words=words, indicators=", ".join(INDICATORS))
                column = row["column"].format(indicator=name)
                columns[column] = Column(row["type"], said, bool(row["missing"]))
        return columns

    def needed(self, table: str) -> set[str]:
        """Return the columns that it has whichever indicators are registered."""
        return {row["column"] for row in self.data[table] if "{" not in row["column"]}


SCHEMAS = _Schemas()


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
        A proven upper bound on each mission's front: some point of it weakly dominates every
        plan, found or not. No rows where the study asks for no bounds, or before they are computed.
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

    def objectives(self, label: str) -> Objectives:
        """Return the objectives of a mission, or of the study's own problem on it."""
        return Objectives(**self.manifest["missions"][label]["objectives"])

    def of_mission(self, label: str) -> "StudyTables":
        """Return the rows of one mission, of all tables that have missions."""
        frames = {name: getattr(self, name) for name in SCHEMAS if "mission" in SCHEMAS[name]}
        own = {name: frame[frame["mission"] == label] for name, frame in frames.items()}
        return replace(self, **own)

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


def as_table(
    name: str,
    rows: "Sequence[Mapping[Any, Any]] | pd.DataFrame",
    objectives: Sequence[str] = OBJECTIVES,
) -> pd.DataFrame:
    """Return rows as the table of a schema; a ValueError names a column that does not fit.

    ``objectives`` are the columns of a study's own objectives, in place of E[R] and E[S].
    """
    columns = SCHEMAS[name]
    if {*OBJECTIVES} <= {*columns}:
        own = {column: columns.get(column, Column("number", "", False)) for column in objectives}
        at = [*columns].index(OBJECTIVES[0])
        others = [item for item in columns.items() if item[0] not in OBJECTIVES]
        columns = dict([*others[:at], *own.items(), *others[at:]])
    # Indicators that the study names by their paths.
    given: Iterable[Any] = rows if isinstance(rows, pd.DataFrame) else rows[0] if rows else ()
    columns |= {column: Column("number") for column in given if is_path(str(column))}
    table = pd.DataFrame(rows, columns=[*columns])
    for column, of in columns.items():
        if not of.nullable and table[column].isna().any():
            raise ValueError(f"Table {name}: the column {column} has missing values.")
        try:
            dtype: Any = _DTYPES[of.type]
            table[column] = table[column].astype(dtype).astype(of.dtype)
        except (TypeError, ValueError) as error:
            raise ValueError(
                f"Table {name}, column {column}: expected {of.type}s ({error})."
            ) from None
    return table


def _column_of(values: "pd.Series[Any]") -> Column:
    """Return the type of a column that depends on the study."""
    kinds = {str(dtype): kind for kind, dtype in _DTYPES.items()}
    return Column(kinds.get(str(values.dtype), "text"))


def write_tables(
    folder: Path, tables: Mapping[str, pd.DataFrame], manifest: Mapping[str, Any]
) -> None:
    """Write tables as CSV, the large ones compressed, and an index with their schemas.

    All are made before the first one replaces an earlier one, and the index is written last. It
    has the digest of each file: so a reader notices if a process was killed in the middle.
    """
    files, index = {}, {}
    for name, frame in tables.items():
        known = SCHEMAS[name]
        columns = {c: known.get(str(c)) or _column_of(frame[c]) for c in frame}
        data = frame.to_csv(index=False, lineterminator="\n").encode()
        file = f"{name}.csv"
        if name in _LARGE:
            file, data = f"{file}.gz", gzip.compress(data, mtime=0)
        files[file] = data
        described = {column: of._asdict() for column, of in columns.items()}
        digest = hashlib.sha256(data).hexdigest()
        index[name] = {"file": file, "sha256": digest, "columns": described}
    of_modules = {
        name: {key: getattr(INDICATORS[name], key) for key in _DESCRIBED}
        for name in filter(is_path, manifest.get("indicators", ()))
        if name not in INDICATORS
    }
    content = {"format": _FORMAT, "study": dict(manifest), "tables": index}
    content["indicators"] = of_modules
    files[INDEX] = f"{json.dumps(content, indent=1)}\n".encode()
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
        If the folder holds no study or no tables yet, or those of another version, or if a file
        is missing, damaged or changed.

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
    path = folder / INDEX
    if not path.exists():
        read_manifest(folder)  # raises if there is no study at all
        if (folder / "runs.parquet").exists():
            raise StudyError(f"{folder}: its tables are of an older version. {remedy}")
        raise StudyError(f"{path}: not written yet. {remedy}")
    try:
        index = json.loads(read_bytes(path))
        described = {
            name: {column: Column(**of) for column, of in table["columns"].items()}
            for name, table in index["tables"].items()
        }
        tables = {}
        for name in SCHEMAS:
            lacking = SCHEMAS.needed(name) - {*OBJECTIVES} - described.get(name, {}).keys()
            if lacking or index["format"] != _FORMAT:
                raise ValueError("the tables are of another version")
            path = folder / index["tables"][name]["file"]
            data = read_bytes(path)
            if hashlib.sha256(data).hexdigest() != index["tables"][name]["sha256"]:
                raise ValueError("it was changed, or a process was killed that made tables")
            tables[name] = _parsed(data, described[name])
        for name, known in index.get("indicators", {}).items():
            INDICATORS.describe(name, **known)
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        reason = f"{error}".partition("\n")[0][:_LONGEST_REASON]
        raise StudyError(f"{path}: cannot be read ({reason}). {remedy}") from error
    return StudyTables(folder, index["study"], **tables)


def _parsed(data: bytes, columns: Mapping[str, Column]) -> pd.DataFrame:
    """Return the table in a file; numbers are exactly those that were written."""
    if data[:2] == b"\x1f\x8b":
        data = gzip.decompress(data)
    # Numbers are read as texts: not all versions of pandas read each of them exactly.
    numbers = [column for column, of in columns.items() if of.type == "number"]
    dtypes = {column: of.dtype for column, of in columns.items()} | dict.fromkeys(numbers, "str")
    missing = {column: [""] for column, of in columns.items() if of.nullable}
    frame = pd.read_csv(io.BytesIO(data), dtype=dtypes, keep_default_na=False, na_values=missing)
    return frame.astype(dict.fromkeys(numbers, "float64"))
