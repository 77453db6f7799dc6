"""The bounds that a study asks for: computed once, kept, in the tables and the report."""

import json
import re
import shutil
import signal

import numpy as np
import pytest
from typer.testing import CliRunner

from botohe_moo import load_mission
from botohe_moo.bounds import FrontBound
from botohe_moo.cli.study import study_app
from botohe_moo.study import (
    StudyError,
    StudyInterrupted,
    load_study,
    make_tables,
    merge_studies,
    read_study,
    run_study,
)
from botohe_moo.study import report as pictures
from botohe_moo.study.folder import StudyFolder
from botohe_moo.study.pool import WorkerPool, perform_bound
from botohe_moo.study.report import number_text, render_page, tables_latex, write_report
from botohe_moo.study.runner import _bound_task
from tests.study.conftest import InProcess
from tests.study.test_perform import marked_processes
from tests.study.test_runner import Watcher

pytestmark = pytest.mark.usefixtures("in_process")

LIMITED = {"mission": "toy", "min_survival": 0.3, "max_length": 6}
FOREVER = 1e6  # seconds
HARD = {"mission": "terrain", "parameters": {"nodes": 60, "seed": 1}}  # takes minutes


def study_of(seconds=2, **changes):
    bounds = {} if seconds is None else {"bounds": {"seconds": seconds}}
    return {
        "name": "trial",
        "missions": ["toy"],
        "algorithms": ["random", "greedy"],
        "budget": {"evaluations": 300},
        "seeds": 2,
        **bounds,
        **changes,
    }


def watched(source, folder):
    watcher = Watcher()
    return run_study(source, folder, progress=watcher), watcher


def files(folder):
    return sorted(path for path in (folder / "bounds").glob("*") if path.is_file())


@pytest.fixture(scope="module")
def made(tmp_path_factory, in_process):
    """A study with bounds on a mission, with limits and without."""
    folder = tmp_path_factory.mktemp("made")
    run_study(study_of(missions={"toy": "toy", "limited": LIMITED}), folder)
    return folder


@pytest.fixture
def copied(made, tmp_path):
    return shutil.copytree(made, tmp_path / "study")


def both(seconds=2):
    return study_of(seconds, missions={"toy": "toy", "limited": LIMITED})


class TestTables:
    def test_areas_and_gaps(self, made):
        tables = read_study(made)
        missions = tables.missions.set_index("mission")
        summary = tables.summary.set_index(["mission", "algorithm"])
        kept = [FrontBound.load(path, load_mission("toy")) for path in files(made)]
        by_floor = {bound.min_survival: bound for bound in kept}
        for label, floor in (("toy", 0.0), ("limited", 0.3)):
            bound = by_floor[floor]
            assert missions.loc[label, "bound_area"] == bound.area
            assert missions.loc[label, "bound_seconds"] == bound.seconds
            points = tables.bounds.loc[tables.bounds["mission"] == label, ["reward", "survivors"]]
            assert points.to_numpy().tolist() == bound.points.tolist()
            for algorithm in ("random", "greedy"):
                row = summary.loc[label, algorithm]
                assert row["area_gap"] == pytest.approx(bound.area / row["area_mean"] - 1)
                assert row["area_gap"] >= 0
        assert by_floor[0.3].max_length == 6
        assert missions.loc["limited", "bound_area"] < missions.loc["toy", "bound_area"]
        assert tables.missing_bounds == []

    @pytest.mark.slow
    def test_rewards_on_return_are_bounded(self, tmp_path):
        site = {"mission": "terrain", "parameters": {"nodes": 8, "robots": 1, "depots": 1}}
        source = study_of(missions={"site": site}, algorithms=["greedy"], seeds=1)
        tables = run_study(source, tmp_path)
        assert tables.missing_bounds == []
        assert 0 < tables.summary["area_gap"].item() < 2

    def test_without_bounds_they_are_empty(self, tmp_path):
        tables = run_study(study_of(None), tmp_path)
        assert files(tmp_path) == []
        assert len(tables.bounds) == 0
        assert tables.missions["bound_area"].isna().all()
        assert tables.summary["area_gap"].isna().all()
        assert tables.missing_bounds == []

    def test_a_bound_that_a_run_refutes_is_refused(self, copied):
        for path in files(copied):
            content = json.loads(path.read_text())
            content["steps"] = []
            content["lines"] = [[n, 0.1, 0.0, "relaxed"] for n in (1, 2)]
            path.write_text(json.dumps(content))
        with pytest.raises(
            StudyError, match=r"A run on toy has found an area of .* so its bound is wrong"
        ):
            make_tables(copied)


class TestAgain:
    @pytest.mark.slow
    def test_fewer_seconds_are_enough_and_more_are_not(self, copied):
        before = files(copied)
        for seconds in (2, 1):
            tables, watcher = watched(both(seconds), copied)
            assert (watcher.performed, watcher.bounded) == ([], [])
            assert files(copied) == before
            assert tables.summary["area_gap"].notna().all()
        tables, watcher = watched(both(2.5), copied)
        assert sorted(watcher.bounded) == [("limited", None), ("toy", None)]
        assert watcher.performed == []
        assert {path.name.partition("-")[2] for path in files(copied)} == {"2.json", "2.5.json"}
        assert tables.missing_bounds == []

    @pytest.mark.slow
    def test_runs_stay_when_bounds_are_asked_for_or_not_any_more(self, tmp_path):
        run_study(study_of(None), tmp_path)
        tables, watcher = watched(study_of(), tmp_path)
        assert (watcher.performed, watcher.bounded) == ([], [("toy", None)])
        assert tables.summary["area_gap"].notna().all()
        tables, watcher = watched(study_of(None), tmp_path)
        assert (watcher.performed, watcher.bounded) == ([], [])
        assert tables.summary["area_gap"].isna().all()
        assert len(files(tmp_path)) == 1

    def test_one_mission_under_two_budgets_has_one_bound(self, tmp_path):
        longer = {"mission": "toy", "budget": {"evaluations": 400}}
        tables, watcher = watched(study_of(missions={"a": "toy", "b": longer}), tmp_path)
        assert len(watcher.bounded) == 1
        one, other = tables.missions["bound_area"]
        assert one == other > 0

    def test_damaged_files_are_named_and_computed_again(self, copied):
        path = files(copied)[0]
        path.write_bytes(path.read_bytes()[:-20])
        for work in (make_tables, lambda folder: run_study(both(), folder)):
            with pytest.raises(StudyError, match=f"{path}: damaged .*; remove the file"):
                work(copied)
        path.unlink()
        assert make_tables(copied).missing_bounds == ["toy"]
        tables, watcher = watched(both(), copied)
        assert len(watcher.bounded) == 1
        assert tables.missing_bounds == []
        copy = path.with_stem(f"{path.stem} (copy)")
        copy.write_bytes(path.read_bytes())
        with pytest.raises(StudyError, match=f"{re.escape(str(copy))}: damaged"):
            make_tables(copied)


class TestComputing:
    def test_what_runs_have_found_is_the_guide(self, made):
        folder, study = StudyFolder(made), load_study(both())
        task = _bound_task(study.missions[0], study.runs(), folder, 2)
        tables = read_study(made)
        plans = tables.plans[tables.plans["mission"] == "toy"]
        expected = np.unique(plans[["reward", "survivors"]].to_numpy(), axis=0)
        assert task.front.tolist() == expected.tolist()
        assert (task.mission, task.seconds) == (study.missions[0], 2)

    def test_one_that_fails_is_told_and_tried_again(self, tmp_path, monkeypatch):
        with monkeypatch.context() as patch:
            patch.setattr(InProcess, "bound", lambda *_, **__: "MemoryError: no room")
            tables, watcher = watched(study_of(), tmp_path)
            assert watcher.bounded == [("toy", "MemoryError: no room")]
            assert tables.missing_bounds == ["toy"]
            path = tmp_path / "study.yaml"
            ended = CliRunner().invoke(study_app, ["run", str(path), "--out", str(tmp_path)])
            assert ended.exit_code == 1
            assert "bound of toy: failed: MemoryError: no room" in ended.stderr
            assert "1 bound failed; run the study again to retry." in ended.stderr
        assert run_study(study_of(), tmp_path).missing_bounds == []

    def test_whatever_is_raised_is_a_line(self):
        task = _bound_task(load_study(study_of()).missions[0], (), StudyFolder("none"), -1.0)
        assert perform_bound(task).endswith("ParameterError: Expected time_limit > 0, got -1.0.")

    @pytest.mark.slow
    def test_a_process_that_is_killed_is_told(self, new_interpreters, monkeypatch, tmp_path):
        monkeypatch.setenv("BOTOHE_TEST_FOLDER", str(tmp_path))
        mission = load_study(study_of(missions={"hard": HARD})).missions[0]
        asked = []

        def stopped():
            asked.append(1)
            if len(asked) == 3:
                [process] = marked_processes(tmp_path)
                process.kill()
            return False

        task = _bound_task(mission, (), StudyFolder(tmp_path), FOREVER)
        [(_, said)] = WorkerPool().perform([task], stopped=stopped)
        assert said == "its process died (signal SIGKILL)"

    def test_none_is_begun_after_a_stop(self, tmp_path):
        class Stopping(Watcher):
            def end(self, run, outcome):
                signal.raise_signal(signal.SIGINT)

        with pytest.raises(StudyInterrupted, match=r"stopped by SIG.*run the study again"):
            run_study(study_of(seeds=1, algorithms=["greedy"]), tmp_path, progress=Stopping())
        assert files(tmp_path) == []
        assert read_study(tmp_path).missing_bounds == ["toy"]


class TestPlan:
    def test_it_counts_them(self, copied, tmp_path):
        path = tmp_path / "study.yaml"
        path.write_text(json.dumps(both(600)))
        asked = ["plan", str(path), "--out", str(copied)]
        ended = CliRunner().invoke(study_app, asked)
        assert "2 bounds to compute when the runs are done, at most 10.0 min each" in ended.stdout
        path.write_text(json.dumps(both()))
        assert "bound" not in CliRunner().invoke(study_app, asked).stdout


@pytest.mark.slow
def test_merged_studies_have_the_bounds_that_were_allowed_the_most_seconds(copied, tmp_path):
    other = tmp_path / "other"
    run_study({**both(1), "seeds": [3]}, other)
    run_study({**both(2), "seeds": [3]}, other)
    merged = merge_studies([copied, other], tmp_path / "all")
    assert merged.missing_bounds == []
    store, mission = StudyFolder(merged.folder), load_study(both()).missions[0]
    assert store.bound(mission)[1] == 2
    _, watcher = watched(tmp_path / "all" / "study.yaml", tmp_path / "all")
    assert watcher.bounded == []


@pytest.fixture
def one_format(monkeypatch):
    monkeypatch.setattr(pictures, "FORMATS", pictures.FORMATS[:1])


@pytest.mark.usefixtures("one_format")
class TestReport:
    @pytest.mark.slow
    def test_gaps_stand_beside_areas(self, copied):
        tables = read_study(copied)
        write_report(tables)
        page = (copied / "report" / "report.html").read_text("utf-8")
        latex = (copied / "report" / "summary.tex").read_text("utf-8")
        for row in tables.summary.to_dict("records"):
            assert f">{number_text(row['area_gap'])}<" in page
            assert f"& {number_text(row['area_gap'])} &" in latex
        for area in tables.missions["bound_area"]:
            assert f"No front whatsoever has an area above {area:.4f}, proved in" in page
        assert page.count("area gap</th>") == 2
        assert page.count("No plan lies beyond the line of a bound") == 2
        assert "2 seconds each" in page

    def test_missing_ones_are_named(self, copied):
        for path in files(copied):
            path.unlink()
        page = render_page(make_tables(copied), {})
        assert "The bounds of toy, limited are not computed yet." in page
        assert "area gap" not in page

    def test_without_bounds_nothing_is_said_of_them(self, tmp_path):
        tables = run_study(study_of(None, seeds=1, algorithms=["greedy"]), tmp_path)
        page = render_page(tables, {}).lower()
        assert "area gap" not in page + tables_latex(tables)["summary.tex"]
        assert "no front" not in page
