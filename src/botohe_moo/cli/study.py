"""The ``botohe study`` commands."""

from __future__ import annotations

from collections import Counter, defaultdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from botohe_moo import study as studies
from botohe_moo.base.messages import counted
from botohe_moo.base.runtime import n_cpus
from botohe_moo.cli import common
from botohe_moo.cli.common import FAILED, Count, command, fail, failing, say, showing, tell

if TYPE_CHECKING:
    from botohe_moo.study.runner import Plan

study_app = typer.Typer(
    no_args_is_help=True, help="Compare algorithms: from a study file to tables and figures."
)

_SECONDS_BETWEEN_LINES = 60.0  # of a study's progress, where there is no terminal
_BY_SIGNAL = 128  # exit status of a command that a signal has ended, and the signal's number
_SUMMARY = {  # columns of a study's summary: title and format
    "algorithm": ("algorithm", ""),
    "n": ("runs", ""),
    "area_median": ("median area", ".4f"),
    "area_low": ("low", ".4f"),
    "area_high": ("high", ".4f"),
    "area_gap": ("gap at most", ".2%"),
    "seconds_median": ("seconds", ".2f"),
}


@command(study_app)
def run(
    file: Path,
    *,
    out: Path | None = None,
    workers: common.CountOrNone = None,
    dask: str | None = None,
    patience: Count = 3600,
) -> None:
    """Perform the runs that are missing, and make the tables.

    Ctrl-C, SIGTERM and SIGHUP stop it. Finished runs are kept, and the same command goes on from
    there.

    The exit status is 1 if a run or a bound failed. It is 2 for bad input.

    Parameters
    ----------
    dask : ADDRESS
        Work on the Dask cluster at this address.
    patience : SECONDS
        For algorithms of other packages, if the budget has no seconds: a run fails when it
        evaluates nothing for so long.
    """
    from botohe_moo.study.model import study_folder

    with failing():
        study = studies.load_study(file)
    folder = study_folder(study.name, out)
    try:
        with failing(FAILED), showing("reading", every=_SECONDS_BETWEEN_LINES) as show:
            how: Any = {"workers": workers or n_cpus(), "dask": dask, "patience": patience}
            tables = studies.run_study(study, folder, progress=StudyProgress(show), **how)
    except studies.StudyInterrupted as stopped:
        status = _BY_SIGNAL + stopped.signal
        fail(f"stopped; what is done is in {folder}. Run it again to go on.", status)
    _tell_tables(tables)
    failures = []
    if n_failed := int((tables.runs["status"] == "failed").sum()):
        failures.append(f"{counted(n_failed, 'run')} failed: runs.csv says why")
    if n_unbounded := len(tables.missing_bounds):
        failures.append(f"{counted(n_unbounded, 'bound')} failed")
    if failures:
        fail(f"{'; '.join(failures)}; run the study again to retry.", FAILED)


class StudyProgress:
    """Counts the runs and bounds of a study that end, and shows their number."""

    def __init__(self, show: common.Show) -> None:
        self._show_words = show
        self._shares: dict[str, float] = {}  # of their budgets, that runs at work have spent
        self._n: Counter[str] = Counter()

    def __call__(self, about: Any, news: Any) -> None:
        """Note a study's plan, a front or the outcome of a run, or the bound of a mission."""
        from botohe_moo.study.perform import Outcome, Record
        from botohe_moo.study.runner import Plan

        if isinstance(news, Plan):
            self._begin(news)
        elif isinstance(news, Record):
            budget = about.mission.budget
            both = ((news.evaluations, budget.evaluations), (news.seconds, budget.seconds))
            share = max(spent / allowed for spent, allowed in both if allowed)
            self._shares[about.digest] = min(share, 1.0)
        elif isinstance(news, Outcome):
            self._shares.pop(about.digest, None)
            self._n.update(ended=1, failed=news.status == "failed")
            if news.status != "done":
                which = f"{about.algorithm.label} on {about.mission.label}, seed {about.seed}"
                say(f"{which}: {news.status}: {news.error}")
        else:
            self._n.update(bounded=1)
            if isinstance(news, str):
                say(f"bound of {about.label}: failed: {news}")
        self._show()

    def _begin(self, plan: Plan) -> None:
        """Print how many runs are finished, and how many are left."""
        self._n.update(runs=len(plan.missing), bounds=len(plan.unbounded))
        there = len(plan.runs) - self._n["runs"]
        say(f"{len(plan.runs)} runs: {there} are there, {self._n['runs']} to go.")
        if n_bounds := self._n["bounds"]:
            say(f"{counted(n_bounds, 'bound')} to compute when the runs are done.")

    def _show(self) -> None:
        n = self._n
        failed = f", {n['failed']} failed" if n["failed"] else ""
        bounds = f", {n['bounded']} of {n['bounds']} bounds" if n["bounds"] else ""
        done, total = n["ended"] + sum(self._shares.values()), n["runs"]
        # Bounds get a bar of their own, from which the time they take is estimated.
        if n["bounds"] and n["ended"] == n["runs"]:
            done, total = n["bounded"], n["bounds"]
        self._show_words(f"{n['ended']} of {n['runs']} runs{failed}{bounds}", done, total)


def _tell_tables(tables: studies.StudyTables) -> None:
    """Print the medians as a table for each mission, and what is missing from it."""
    for mission in tables.mission_labels:
        rows = tables.summary[tables.summary["mission"] == mission]
        tell(f"{mission}\n{'no runs yet' if rows.empty else common.frame_table(rows, _SUMMARY)}\n")
    _say_missing(tables)
    folder = tables.folder
    tell(f"The tables are in {folder}; `botohe study report {folder}` makes the report.")


def _say_missing(tables: studies.StudyTables) -> None:
    if n_missing := int(tables.missing["missing"].sum()):
        n_runs = len(tables.runs) + n_missing
        say(f"{n_missing} of the study's {n_runs} runs are missing from the tables.")
    if n_unbounded := len(tables.missing_bounds):
        n_missions = len(tables.mission_labels)
        say(f"{n_unbounded} of the study's {n_missions} bounds are missing from the tables.")


@command(study_app)
def plan(file: Path, *, out: Path | None = None) -> None:
    """Count finished and missing runs, and say if more seeds are needed."""
    from botohe_moo.study import runner
    from botohe_moo.study.folder import StudyFolder
    from botohe_moo.study.model import study_folder
    from botohe_moo.study.statistics import seeds_needed

    with failing():
        study = studies.load_study(file)
        folder = StudyFolder(study_folder(study.name, out))
        folder.check(study)
        planned = runner.plan_study(study, folder)
    tell(_plan_table(planned))
    n_there, n_runs, n_bounds = map(len, (planned.finished, planned.runs, planned.unbounded))
    tell(f"\n{n_runs} runs: {n_there} are there, {n_runs - n_there} to go, in {folder.path}")
    control, level = study.file.comparison.control, study.file.comparison.significance
    needed = seeds_needed(len(study.algorithms), has_control=bool(control), significance=level)
    if len(study.seeds) < needed:
        why = f"no difference can be significant at {level:g} after Holm's correction"
        tell(f"With {counted(len(study.seeds), 'seed')}, {why}: {needed} seeds are needed")
    if n_bounds:
        each = f"at most {_duration(study.bound_seconds)} each"
        tell(f"{counted(n_bounds, 'bound')} to compute when the runs are done, {each}")


def _plan_table(planned: Plan) -> str:
    counts: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    for run in planned.runs:
        labels = run.mission.label, run.algorithm.label
        counts[labels].update(runs=1, there=int(run.digest in planned.finished))
    titles = ("runs", "there")
    rows = [(*labels, *(str(n[title]) for title in titles)) for labels, n in counts.items()]
    return common.table([("mission", "algorithm", *titles), *rows])


def _duration(seconds: float) -> str:
    """Return a duration in the unit that suits it."""
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.1f} s"


@command(study_app)
def tables(study: Path) -> None:
    """Make the tables of the finished runs.

    Works while the study is running, and after it was killed.
    """
    with failing():
        made = studies.make_tables(study)
    _tell_tables(made)


@command(study_app)
def merge(folders: list[Path], *, out: Path | None = None) -> None:
    """Merge the results that several machines have of one study.

    Their study files are the same but for the seeds.

    Parameters
    ----------
    folders : DIR
        Folders of the same study.
    """
    with failing():
        merged = studies.merge_studies(folders, out)
    _tell_tables(merged)
    tell(f"{counted(len(merged.runs), 'run')} merged.")


@command(study_app)
def report(study: Path) -> None:
    """Make the report: a page, figures and LaTeX tables."""
    from botohe_moo.study.report import write_report

    with failing():
        read = studies.read_study(study)
    _say_missing(read)
    with failing(FAILED), showing("drawing figures"):
        paths = write_report(read, workers=n_cpus())
    for path in paths:
        tell(f"wrote {path}")


@command(study_app)
def schema() -> None:
    """Print the JSON Schema of study files, for editors."""
    from botohe_moo.study.loading import study_schema

    tell(study_schema().rstrip())
