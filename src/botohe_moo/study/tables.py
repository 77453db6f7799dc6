"""The tables of a study: their columns, how they are written, and how they are read again."""

import csv
import gzip
import hashlib
import io
import json
import os
from collections import UserDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from botohe_moo.base.files import replace_file
from botohe_moo.base.registry import is_path
from botohe_moo.indicators import INDICATORS, further_indicators
from botohe_moo.mission.loading import read_mission
from botohe_moo.mission.model import Mission
from botohe_moo.objectives import Objectives
from botohe_moo.study.folder import read_manifest
from botohe_moo.study.model import StudyError
from botohe_moo.trails import TrailPlan

OBJECTIVES = ("reward", "survivors")  # of a study without a problem of its own
INDEX = "tables.json"  # the type of each column, and the study that the tables were made of
_LARGE = ("trace", "fronts", "plans", "references", "bounds")  # these are compressed
_TEXT = pd.Series(["text"]).dtype  # pandas 3 has a type of its own for texts
_DTYPES: dict[str, tuple[Any, Any]] = {  # without and with missing values
    "text": (_TEXT, _TEXT),
    "integer": ("int64", "Int64"),
    "number": ("float64", "float64"),
    "flag": ("bool", "boolean"),
}
_COLUMNS = Path(__file__).with_name("columns.csv").read_text("utf-8")
_VERSION = hashlib.sha256(_COLUMNS.encode()).hexdigest()  # of the tables


class Column(NamedTuple):
    """A column of a table."""

    type: str  # text, integer, number or flag
    description: str
    nullable: bool


class _Schemas(UserDict[str, Any]):
    """The columns of each table, by their names, as ``columns.csv`` lists them.

    Some tables have a column for each further indicator that is registered.
    """

    def __init__(self) -> None:
        super().__init__()
        for row in csv.DictReader(_COLUMNS.splitlines()):
            self.data.setdefault(row["table"], []).append(row)

    def __getitem__(self, table: str) -> dict[str, Column]:
        columns: dict[str, Column] = {}
        for row in self.data[table]:
            said = "; missing ".join(filter(None, [row["description"], row["missing"]]))
            column = Column(row["type"], said, bool(row["missing"]))
            names = further_indicators() if "{indicator}" in row["column"] else [""]
            columns |= {row["column"].format(indicator=name): column for name in names}
        return columns


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
        is_meant = self.plans["run"].str.startswith(run) & (self.plans["plan_id"] == plan_id)
        rows = self.plans[is_meant]
        if len(rows) != 1:
            raise KeyError(f"Expected one plan {plan_id} of a run {run!r}, found {len(rows)}.")
        row = rows.iloc[0]
        return self.mission(row["mission"]).plan(json.loads(row["trails"]))


def as_table(
    name: str,
    rows: "Sequence[Mapping[Any, Any]] | pd.DataFrame",
    objectives: Sequence[str] = OBJECTIVES,
) -> pd.DataFrame:
    """Return rows as the table of a schema: its columns in their order, with their types.

    ``objectives`` are the columns of a study's own objectives, in place of E[R] and E[S].
    Indicators that the study names by their paths have columns, too. An error is raised if a value
    does not fit.
    """
    columns: dict[str, Column] = {}
    for column, of in SCHEMAS[name].items():
        own = {"reward": objectives, "survivors": ()}.get(column, (column,))
        columns |= dict.fromkeys(own, of)
    table = pd.DataFrame(rows)
    dtypes = {column: _DTYPES[of.type][of.nullable] for column, of in columns.items()}
    dtypes |= dict.fromkeys(filter(is_path, map(str, table)), "float64")
    return table.reindex(columns=[*dtypes]).astype(dtypes)


def write_tables(
    folder: Path, tables: Mapping[str, pd.DataFrame], manifest: Mapping[str, Any]
) -> None:
    """Write tables as CSV, the large ones compressed, and an index with the types of columns.

    All are made before the first one replaces an earlier one, and the index is written last. It
    has the digest of each file: so a reader notices if a process was killed in the middle.
    """
    files, index = {}, {}
    for name, table in tables.items():
        file, data = f"{name}.csv", table.to_csv(index=False, lineterminator="\n").encode()
        if name in _LARGE:
            file, data = f"{file}.gz", gzip.compress(data, 6, mtime=0)
        files[file] = data
        dtypes = {column: str(dtype) for column, dtype in table.dtypes.items()}
        index[name] = {"file": file, "sha256": hashlib.sha256(data).hexdigest(), "columns": dtypes}
    content = {"version": _VERSION, "study": dict(manifest), "tables": index}
    # Who reads them does not import the modules of indicators.
    content["indicators"] = {
        name: vars(INDICATORS[name]) | {"function": None}
        for name in filter(is_path, manifest.get("indicators", ()))
    }
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
        raise StudyError(f"{path}: not written yet, or by an older version. {remedy}")
    try:
        index = json.loads(path.read_bytes())
        if index["version"] != _VERSION:
            raise ValueError("the tables are of another version")
        tables = {}
        for name in SCHEMAS:
            of = index["tables"][name]
            path = folder / of["file"]
            data = path.read_bytes()
            if hashlib.sha256(data).hexdigest() != of["sha256"]:
                raise ValueError("it was changed, or a process was killed that made tables")
            tables[name] = _parsed(name, data, of["columns"])
        for name, known in index["indicators"].items():
            INDICATORS.describe(name, **known)
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise StudyError(f"{path}: cannot be read ({error}). {remedy}") from error
    return StudyTables(folder, index["study"], **tables)


def _parsed(name: str, data: bytes, dtypes: Mapping[str, str]) -> pd.DataFrame:
    """Return the table in a file; numbers are exactly those that were written."""
    schema = SCHEMAS[name].items()
    texts = [column for column, of in schema if of.type == "text" and not of.nullable]
    # Numbers are read as texts: not all versions of pandas read each of them exactly.
    numbers = [column for column, dtype in dtypes.items() if dtype == "float64"]
    frame = pd.read_csv(
        io.BytesIO(data),
        compression="gzip" if name in _LARGE else None,
        dtype={**dtypes, **dict.fromkeys(numbers, "str")},
        keep_default_na=False,
        na_values={column: [""] for column in dtypes if column not in texts},
    )
    return frame.astype(dict.fromkeys(numbers, "float64"))
