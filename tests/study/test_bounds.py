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
from botohe_moo.cli.study import StudyProgress, study_app
from botohe_moo.study import (
    StudyError,
    StudyInterrupted,
    load_study,
    make_tables,
    merge_studies,
    read_study,
    run_study,
)
from botohe_moo.study.folder import StudyFolder, restore_study
from botohe_moo.study.perform import Outcome
from botohe_moo.study.pool import WorkerPool, perform_bound
from botohe_moo.study.report import number_text, render_page, tables_latex, write_report
from botohe_moo.study.runner import _bound_task
from tests.study.conftest import InProcess
from tests.study.made import MADE, study_of, watched

pytestmark = pytest.mark.usefixtures("in_process", "sketched")

LIMITED = {"mission": "toy", "min_survival": 0.3, "max_length": 6}
HARD = {"mission": "terrain", "parameters": {"nodes": 60, "seed": 1}}  # takes minutes


def bounded(seconds=2, **changes):
    return study_of(**{"algorithms": ["greedy"], "bounds": {"seconds": seconds}, **changes})


def both(seconds=2, **changes):
    missions = {"toy": "toy", "limited": LIMITED}
    return bounded(seconds, missions=missions, algorithms=["random", "greedy"], **changes)


BOTH = [("limited", None), ("toy", None)]


def files(folder):
    return sorted(path for path in (folder / "bounds").glob("*") if path.is_file())


def commanded(*arguments, status=0):
    ended = CliRunner().invoke(study_app, list(map(str, arguments)))
    assert ended.exit_code == status
    return ended


@pytest.fixture(scope="module")
def made(tmp_path_factory, in_process):
    """A study with bounds on a mission, with limits and without."""
    folder = tmp_path_factory.mktemp("made")
    run_study(both(), folder)
    return folder


@pytest.fixture
def copied(made, tmp_path):
    return shutil.copytree(made, tmp_path / "study")


class TestTables:
    def test_areas_gaps_and_limits(self, made):
        tables = read_study(made)
        missions = tables.missions.set_index("mission")
        summary = tables.summary.set_index(["mission", "algorithm"])
        kept = [FrontBound.load(path, load_mission("toy")) for path in files(made)]
        by_floor = {bound.min_survival: bound for bound in kept}
        for label, floor in (("toy", 0.0), ("limited", 0.3)):
            bound, row = by_floor[floor], missions.loc[label]
            assert (row["bound_area"], row["bound_seconds"]) == (bound.area, bound.seconds)
            points = tables.bounds.loc[tables.bounds["mission"] == label, ["reward", "survivors"]]
            assert points.to_numpy().tolist() == bound.points.tolist()
            for algorithm in ("random", "greedy"):
                row = summary.loc[label, algorithm]
                assert 0 <= row["area_gap"] == pytest.approx(bound.area / row["area_mean"] - 1)
        assert by_floor[0.3].max_length == 6
        assert missions.loc["limited", "bound_area"] < missions.loc["toy", "bound_area"]
        assert tables.missing_bounds == []
        for table in (tables.runs, tables.missions):
            limits = table.drop_duplicates("mission")[["mission", "min_survival", "max_length"]]
            assert limits.fillna(0).values.tolist() == [["toy", 0, 0], ["limited", 0.3, 6]]
        assert [mission.max_length for mission in restore_study(made).missions] == [None, 6]

    def test_a_bound_that_a_run_refutes_is_refused(self, copied):
        for path in files(copied):
            content = json.loads(path.read_text())
            content["steps"] = []
            content["lines"] = [[n, 0.1, 0.0, "relaxed"] for n in (1, 2)]
            path.write_text(json.dumps(content))
        with pytest.raises(StudyError, match=r"run on toy has found .* so its bound is wrong"):
            make_tables(copied)


class TestAgain:
    @pytest.mark.slow
    def test_fewer_seconds_are_enough_and_more_are_not(self, copied):
        for seconds in (2, 1):
            _, watcher = watched(both(seconds), copied)
            assert (watcher.performed, watcher.bounded) == ([], [])
        _, watcher = watched(both(2.5), copied)
        assert (watcher.performed, sorted(watcher.bounded)) == ([], BOTH)
        assert {path.name.partition("-")[2] for path in files(copied)} == {"2.json", "2.5.json"}

    def test_runs_stay_when_bounds_are_asked_for_or_not_any_more(self, copied):
        for path in files(copied):
            path.unlink()
        tables, watcher = watched({k: of for k, of in both().items() if k != "bounds"}, copied)
        assert (len(tables.bounds), tables.missing_bounds) == (0, [])
        assert tables.summary["area_gap"].isna().all()
        page = render_page(tables, {}).lower()
        assert "area gap" not in page + tables_latex(tables)["summary.tex"]
        assert "no front" not in page
        tables, again = watched(both(), copied)
        assert watcher.performed == again.performed == []
        assert sorted(again.bounded) == BOTH
        assert tables.summary["area_gap"].notna().all()

    def test_one_mission_under_two_budgets_has_one_bound(self, tmp_path):
        longer = {"mission": "toy", "budget": {"evaluations": 400}}
        tables, watcher = watched(bounded(missions={"a": "toy", "b": longer}), tmp_path)
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
        [missing] = make_tables(copied).missing_bounds
        said = render_page(read_study(copied), {})
        assert f"The bounds of {missing} are not computed yet." in said
        tables, watcher = watched(both(), copied)
        assert (watcher.bounded, tables.missing_bounds) == ([(missing, None)], [])
        path.rename(copy := path.with_stem(f"{path.stem} (copy)"))
        with pytest.raises(StudyError, match=f"{re.escape(str(copy))}: damaged"):
            make_tables(copied)


class TestComputing:
    def test_what_runs_have_found_is_the_guide(self, made):
        study = load_study(both())
        task = _bound_task(study.missions[0], study.runs(), StudyFolder(made), 2)
        tables = read_study(made)
        plans = tables.plans[tables.plans["mission"] == "toy"]
        expected = np.unique(plans[["reward", "survivors"]].to_numpy(), axis=0)
        assert task.front.tolist() == expected.tolist()
        assert (task.mission, task.seconds) == (study.missions[0], 2)

    def test_one_that_fails_is_told_and_tried_again(self, tmp_path, monkeypatch):
        with monkeypatch.context() as patch:
            patch.setattr(InProcess, "bound", lambda *_, **__: "MemoryError: no room")
            assert run_study(bounded(), tmp_path).missing_bounds == ["toy"]
            said = commanded("run", tmp_path / "study.yaml", "--out", tmp_path, status=1).stderr
            assert "bound of toy: failed: MemoryError: no room" in said
            assert "1 bound failed; run the study again to retry." in said
        assert run_study(bounded(), tmp_path).missing_bounds == []

    def test_whatever_is_raised_is_a_line(self):
        task = _bound_task(load_study(bounded()).missions[0], (), StudyFolder("none"), -1.0)
        assert perform_bound(task).endswith("ParameterError: Expected time_limit > 0, got -1.0.")

    @pytest.mark.slow
    def test_a_process_that_is_killed_is_told(self, processes_there, tmp_path):
        mission, asked = load_study(bounded(missions={"hard": HARD})).missions[0], []

        def stopped():
            asked.append(1)
            if len(asked) == 3:
                [process] = processes_there()
                process.kill()
            return False

        task = _bound_task(mission, (), StudyFolder(tmp_path), 1e6)
        [(_, said)] = WorkerPool().perform([task], stopped=stopped)
        assert said == "its process died (signal SIGKILL)"

    def test_none_is_begun_after_a_stop(self, tmp_path):
        def stop(about, news):
            if isinstance(news, Outcome):
                signal.raise_signal(signal.SIGINT)

        with pytest.raises(StudyInterrupted, match=r"stopped by SIG.*run the study again"):
            run_study(bounded(seeds=1), tmp_path, progress=stop)
        assert files(tmp_path) == []
        assert read_study(tmp_path).missing_bounds == ["toy"]

    def test_the_plan_counts_them(self, copied, tmp_path):
        path = tmp_path / "study.yaml"
        path.write_text(json.dumps(both(600)))
        said = commanded("plan", path, "--out", copied).stdout
        assert "2 bounds to compute when the runs are done, at most 10.0 min each" in said
        path.write_text(json.dumps(both()))
        assert "bound" not in commanded("plan", path, "--out", copied).stdout


def test_merged_studies_have_the_bounds_that_were_allowed_the_most_seconds(copied, tmp_path):
    other = shutil.copytree(copied, tmp_path / "other")
    for path in files(other):
        path.rename(path.with_name(path.name.replace("-2.json", "-9.json")))
    merged = merge_studies([copied, other], tmp_path / "all")
    assert merged.missing_bounds == []
    store, mission = StudyFolder(merged.folder), load_study(both()).missions[0]
    assert store.bound(mission)[1] == 9
    assert len(files(merged.folder)) == 4


def test_gaps_stand_beside_areas_in_the_report(copied):
    tables = read_study(copied)
    page, _, latex, *_ = (path.read_text("utf-8", "replace") for path in write_report(tables))
    for row in tables.summary.to_dict("records"):
        assert f">{number_text(row['area_gap'])}<" in page
        assert f"& {number_text(row['area_gap'])} &" in latex
    for area in tables.missions["bound_area"]:
        assert f"No front can have an area above {area:.4f}, proved in" in page
    assert page.count("area gap</th>") == 2
    assert page.count("No plan lies beyond the line of a bound") == 2
    assert "2 seconds each" in page


def test_progress_counts_runs_and_bounds(tmp_path):
    shown = []
    slow = {"algorithm": f"{MADE}:Doing", "parameters": {"what": "pass", "n": 10}}
    algorithms = {"bad": f"{MADE}:Doing", "slow": slow}
    source = bounded(1, algorithms=algorithms, budget={"evaluations": 100, "seconds": 60}, seeds=1)
    run_study(source, tmp_path, progress=StudyProgress(lambda *given: shown.append(given)))
    words = dict.fromkeys(words for words, *_ in shown)
    assert [*words] == [
        "0 of 2 runs, 0 of 1 bounds",
        "1 of 2 runs, 1 failed, 0 of 1 bounds",
        "2 of 2 runs, 1 failed, 0 of 1 bounds",
        "2 of 2 runs, 1 failed, 1 of 1 bounds",
    ]
    shares = [done / total for _, done, total in shown]
    assert shares[0] == 0 < min(shares[1:-2]) < 0.5  # also of runs that are at work
    assert shares[-2:] == [0, 1]  # bounds have a bar of their own
