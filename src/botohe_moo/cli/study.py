"""The ``botohe study`` commands."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from botohe_moo.base.messages import counted
from botohe_moo.cli.options import out_option
from botohe_moo.cli.shell import FAILED, fail, failing, say, tell

if TYPE_CHECKING:
    from collections.abc import Callable

    from pandas import DataFrame

    from botohe_moo.study.runner import Estimate
    from botohe_moo.study.tables import StudyTables

study_app = typer.Typer(
    no_args_is_help=True,
    help="Compare algorithms: from a study file to tables and figures.",
)

_SECONDS_BETWEEN_LINES = 60.0  # of a study's progress, where there is no terminal
_BY_SIGNAL = 128  # exit status of a command that a signal has ended, and the signal's number

FileArgument = Annotated[Path, typer.Argument(metavar="FILE", help="A study file (YAML).")]
FolderArgument = Annotated[
    Path, typer.Argument(metavar="DIR", help="Folder that `botohe study run` has written to.")
]
OutOption = Annotated[Path | None, out_option("DIR", "Its folder; by default results/NAME.")]
WorkersOption = Annotated[
    int | None,
    typer.Option(
        "--workers",
        "-w",
        metavar="N",
        help="Runs at a time; by default as many as there are processors.",
    ),
]

PatienceOption = Annotated[
    int,
    typer.Option(
        "--patience",
        metavar="SECONDS",
        help="A run of another package's algorithm fails that evaluates nothing for that long, "
        "where its budget has no seconds.",
    ),
]


def _workers(given: int | None) -> int:
    from botohe_moo.base.messages import check_integer
    from botohe_moo.base.runtime import n_cpus

    return n_cpus() if given is None else check_integer("--workers", given, at_least=1)


@study_app.command("run")
def run(
    file: FileArgument,
    out: OutOption = None,
    workers: WorkersOption = None,
    dask: Annotated[
        str | None,
        typer.Option("--dask", metavar="ADDRESS", help="Work on the Dask cluster there."),
    ] = None,
    patience: PatienceOption = 3600,
) -> None:
    """Perform the runs that are missing, and make the tables.

    Ctrl-C, SIGTERM and SIGHUP stop; what is done stays done, and the same command goes on from
    there.
    """
    from botohe_moo.base.messages import check_integer
    from botohe_moo.cli.progress import StudyWatcher, showing
    from botohe_moo.study.loading import load_study
    from botohe_moo.study.model import study_folder
    from botohe_moo.study.runner import StudyInterrupted, run_study

    with failing():
        n_workers = _workers(workers)
        check_integer("--patience", patience, at_least=1)
        study = load_study(file)
    folder = study_folder(study.name, out)
    try:
        with failing(FAILED), showing("reading", every=_SECONDS_BETWEEN_LINES) as show:
            tables = run_study(
                study,
                folder,
                workers=n_workers,
                dask=dask,
                patience=patience,
                watcher=StudyWatcher(show),
            )
    except StudyInterrupted as stopped:
        status = _BY_SIGNAL + stopped.signal
        fail(f"stopped; what is done is in {folder}. Run it again to go on.", status)
    tell(_outcome(tables))
    tell(f"\nThe tables are in {folder}; `botohe study report {folder}` makes the report.")
    if n_failed := int((tables.runs["status"] == "failed").sum()):
        fail(
            f"{counted(n_failed, 'run')} failed: runs.csv says why; run the study again to retry.",
            FAILED,
        )
    if n_unbounded := len(tables.missing_bounds):
        fail(f"{counted(n_unbounded, 'bound')} failed; run the study again to retry.", FAILED)


def _outcome(tables: StudyTables) -> str:
    """Return the medians as a table for each mission."""
    summary = tables.summary
    lines = []
    for mission in tables.mission_labels:
        rows = summary[summary["mission"] == mission]
        if rows.empty:
            lines.append(f"{mission}\nno runs yet")
            continue
        shown = rows[["algorithm", "n", "area_median", "area_low", "area_high", "seconds_median"]]
        shown = shown.set_axis(
            ["algorithm", "runs", "median area", "low", "high", "seconds"], axis=1
        )
        if rows["area_gap"].notna().any():
            shown.insert(5, "gap at most", rows["area_gap"])
        formats = {"seconds": "{:.2f}".format, "gap at most": "{:.2%}".format}
        lines.append(f"{mission}\n{_table(shown, **formats)}")
    return "\n\n".join(lines)


@study_app.command("plan")
def plan(file: FileArgument, out: OutOption = None, workers: WorkersOption = None) -> None:
    """List the runs, those that are there, and the time for the rest."""
    from botohe_moo.study.folder import StudyFolder
    from botohe_moo.study.loading import load_study
    from botohe_moo.study.model import study_folder
    from botohe_moo.study.runner import estimate_times, plan_study, time_left

    with failing():
        n_workers = _workers(workers)
        study = load_study(file)
        folder = StudyFolder(study_folder(study.name, out))
        folder.check(study)
        planned = plan_study(study, folder)
        estimates = estimate_times(planned, folder)
    tell(_plan_table(estimates))
    n_there, n_runs = len(planned.finished), len(planned.runs)
    tell(f"\n{n_runs} runs: {n_there} are there, {n_runs - n_there} to go, in {folder.path}")
    n_bounds = len(planned.unbounded)
    if n_bounds:
        each = _duration(study.bound_seconds)
        tell(f"{counted(n_bounds, 'bound')} to compute when the runs are done, at most {each} each")
    waiting = [estimate for estimate in estimates if estimate.n_left]
    left = time_left(waiting, n_workers, n_bounds=n_bounds, bound_seconds=study.bound_seconds)
    if left:
        at_most = n_bounds or any(estimate.at_most for estimate in waiting)
        unknown = any(estimate.seconds is None for estimate in waiting)
        tell(
            f"{'at most about' if at_most else 'about'} {_duration(left)} with {n_workers} at a "
            f"time{', besides what is unknown' if unknown else ''}"
        )


def _plan_table(estimates: list[Estimate]) -> str:
    import pandas as pd

    rows = [
        (e.mission, e.algorithm, e.n_runs, e.n_finished, e.n_failed, _each(e)) for e in estimates
    ]
    header = ["mission", "algorithm", "runs", "there", "failed", "each takes"]
    return _table(pd.DataFrame(rows, columns=header))


def _table(frame: DataFrame, **formats: Callable[[float], str]) -> str:
    """Lay out a table for a terminal, where Chinese letters take two columns."""
    from pandas import option_context

    with option_context("display.unicode.east_asian_width", True):
        return frame.to_string(index=False, float_format="{:.4f}".format, formatters=formats)


def _each(estimate: Estimate) -> str:
    if estimate.seconds is None:
        return "unknown"
    return f"{'at most ' if estimate.at_most else ''}{_duration(estimate.seconds)}"


def _duration(seconds: float) -> str:
    """Return a duration in the unit that suits it."""
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.1f} s"


@study_app.command("tables")
def tables(folder: FolderArgument) -> None:
    """Make the tables of the runs that are there.

    Also while a runner is at work, or after a kill. The study file is not needed.
    """
    from botohe_moo.study.runner import make_tables

    with failing():
        made = make_tables(folder)
    tell(_outcome(made))
    _say_missing(made)
    tell(f"\nThe tables are in {folder}; `botohe study report {folder}` makes the report.")


@study_app.command("merge")
def merge(
    folders: Annotated[
        list[Path], typer.Argument(metavar="DIR", help="Folders of the same study.")
    ],
    out: OutOption = None,
) -> None:
    """Make one study of the results that several machines have of it.

    Their study files are the same but for the seeds, which add up.
    """
    from botohe_moo.study.runner import merge_studies

    with failing():
        merged = merge_studies(folders, out)
    tell(_outcome(merged))
    _say_missing(merged)
    tell(f"\n{len(merged.runs)} runs and the tables are in {merged.folder}.")


def _say_missing(tables: StudyTables) -> None:
    n_runs = len(tables.runs) + tables.n_missing
    if tables.n_missing:
        say(f"{tables.n_missing} of the study's {n_runs} runs are missing from the tables.")
    if n_unbounded := len(tables.missing_bounds):
        n_missions = len(tables.mission_labels)
        say(f"{n_unbounded} of the study's {n_missions} bounds are missing from the tables.")


@study_app.command("report")
def report(folder: FolderArgument) -> None:
    """Make the report: a page, figures and LaTeX tables."""
    from botohe_moo.cli.progress import showing
    from botohe_moo.study.report import write_report
    from botohe_moo.study.tables import read_study

    with failing():
        tables = read_study(folder)
    _say_missing(tables)
    with failing(FAILED), showing("drawing figures"):
        paths = write_report(tables, workers=_workers(None))
    for path in paths:
        tell(f"wrote {path}")


@study_app.command("schema")
def schema() -> None:
    """Print the JSON Schema of study files, for editors."""
    from botohe_moo.study.loading import study_schema

    tell(study_schema().rstrip())
