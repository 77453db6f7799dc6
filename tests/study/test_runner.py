"""Studies in this process: what is run, what is kept and merged, what becomes of it."""

import errno
import json
import re
import shutil
import sys
from dataclasses import replace
from unittest import mock

import numpy as np
import pandas as pd
import pytest
from rich.cells import cell_len
from typer.testing import CliRunner

from botohe_moo import area_indicator, load_mission
from botohe_moo.cli.study import _plan_table, study_app
from botohe_moo.mission.loading import save_mission
from botohe_moo.study import StudyError, make_tables, merge_studies, read_study, run_study, runner
from botohe_moo.study import folder as run_folder
from botohe_moo.study import tables as table_files
from botohe_moo.study.folder import StudyFolder, restore_study
from botohe_moo.study.loading import load_study
from botohe_moo.study.perform import Outcome
from botohe_moo.study.pool import WorkerPool
from botohe_moo.study.tables import INDEX, SCHEMAS, as_table, write_tables
from tests.study.made import MADE, assert_same, outcome_of, study_of, watched

pytestmark = pytest.mark.usefixtures("in_process")

FLOOR = 0.5


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A study of everything that can come of a run."""
    told = {"never": "time.sleep(3600)", "dying": "os.abort()"}
    doing = {x: {"algorithm": f"{MADE}:Doing", "parameters": {"what": told[x]}} for x in told}
    source = study_of(
        missions={"plant": {"mission": "power_plant", "min_survival": FLOOR, "robots": 3}},
        algorithms={
            "random": "random",
            "sampler": f"{MADE}:Sampler",
            "raising": f"{MADE}:Doing",
            "infeasible": f"{MADE}:Infeasible",
            **doing,
        },
        budget={"evaluations": 200, "seconds": 1, "grace_seconds": 0.2},
        seeds=1,
        comparison={"control": "random"},
    )
    with mock.patch.object(runner, "WorkerPool", WorkerPool):
        return run_study(source, tmp_path_factory.mktemp("study"), workers=2)


@pytest.fixture(scope="module")
def finished(tmp_path_factory, in_process):
    folder = tmp_path_factory.mktemp("finished")
    run_study(study_of(), folder)
    return folder


@pytest.fixture
def small(finished, tmp_path):
    """A copy of a finished study's folder."""
    return shutil.copytree(finished, tmp_path / "copy")


class TestWhatComesOfRuns:
    def test_each_is_reported_as_such(self, done):
        runs = done.runs.set_index("algorithm")
        ends = runs[["status", "stopped_by", "evaluations"]].T.to_dict("list")
        assert 0 < ends["infeasible"].pop() <= 200
        assert ends == {
            "random": ["done", "evaluations", 200],
            "sampler": ["done", "evaluations", 200],
            "raising": ["failed", "error", 20],
            "infeasible": ["infeasible", "evaluations"],
            "never": ["timeout", "limit", 20],
            "dying": ["failed", "error", 20],
        }
        assert runs["error"]["raising"] == "RuntimeError: out of luck"
        assert "_advance" in runs["traceback"]["raising"]
        assert "SIGABRT" in runs["error"]["dying"]
        assert "killed" in runs["error"]["never"]
        assert pd.isna(runs["error"]["random"])
        assert done.summary["n_not_done"].tolist() == [0, 0, 1, 1, 1, 1]
        # Runs without a front are scored as bringing nothing; what killed runs had found counts.
        values = done.indicators.set_index(["indicator", "algorithm"])["value"]
        for label in ("raising", "infeasible", "dying"):
            assert values["area"][label] == values["front_size"][label] == 0
            assert 0 < values["igd_plus"][label] < np.inf
        assert runs["area"]["never"] > 0
        assert (done.plans["algorithm"] == "never").sum() == runs["front_size"]["never"]

    def test_every_row_can_be_evaluated_again(self, done):
        for (label, run), rows in done.plans.groupby(["mission", "run"]):
            mission = done.mission(label)
            plans = [done.plan(run, plan_id) for plan_id in rows["plan_id"]]
            assert mission.robot_survival(plans).min() >= FLOOR * (1 - 1e-12)
            found = mission.evaluate(plans)
            assert np.allclose(found, rows[["reward", "survivors"]], rtol=1e-9)
            area = done.runs.set_index("run")["area"][run]
            assert area_indicator(found, mission) == pytest.approx(area, rel=1e-9)
        with pytest.raises(KeyError, match="found 0"):
            done.plan(done.runs["run"].iloc[0], 10**6)


class TestTables:
    def test_types_and_numbers_come_back(self, tmp_path):
        whole = {name: as_table(name, []) for name in SCHEMAS}
        fill_of = {"text": "t", "integer": 1, "number": 0.5, "flag": True}
        for name, columns in {
            "comparisons": {
                "mission": ['a, "b"\nc', "ε", "NA"],
                "indicator": ["x", "y", "z"],
                "n": [1, 2**62, 0],
                "p_value": [0.1 + 0.2, 5e-324, float("inf")],
                "significant": [True, False, True],
            },
            "missions": {
                "further flags": pd.array([True, None, False], "boolean"),
                "mine": pd.array([1, None, 2**53 + 1], "Int64"),
            },
        }.items():
            fill = {column: fill_of[of.type] for column, of in SCHEMAS[name].items()}
            whole[name] = as_table(name, pd.DataFrame([fill] * 3).assign(**columns))
        (tmp_path / "study.json").write_text("{}")
        write_tables(tmp_path, whole, {})
        read = read_study(tmp_path)
        pd.testing.assert_frame_equal(read.comparisons, whole["comparisons"], check_exact=True)
        pd.testing.assert_frame_equal(read.missions, whole["missions"], check_exact=True)
        assert read.missions["bound_area"].dtype == "float64"

    def test_what_is_not_of_its_schema_is_not_written(self, done):
        as_table("runs", done.runs)
        changes = done.runs.assign(area="high"), done.runs.assign(evaluations="many")
        for changed in (done.runs.drop(columns="evaluations"), *changes):
            with pytest.raises((TypeError, ValueError)):
                as_table("runs", changed)

    @pytest.mark.parametrize(
        ("name", "damage"),
        [
            ("trace.csv.gz", b"\x1f\x8b"),
            ("runs.csv", b"run,mission\n"),
            ("plans.csv.gz", None),
            (INDEX, b"{"),
            (INDEX, b"[]"),
            (INDEX, b'{"tables": {"runs": 7}}'),
        ],
    )
    def test_damaged_tables_are_named(self, small, name, damage):
        (small / name).unlink()
        if damage is not None:
            (small / name).write_bytes(damage)
        with pytest.raises(StudyError, match=rf"{name}: cannot be read.*study tables"):
            read_study(small)

    def test_tables_of_another_version_are_named(self, small):
        index = json.loads((small / INDEX).read_bytes())
        (small / INDEX).write_text(json.dumps({**index, "version": "0"}))  # it has other columns
        with pytest.raises(StudyError, match=r"tables are of another version.*study tables"):
            read_study(small)
        (small / INDEX).unlink()
        with pytest.raises(StudyError, match=r"or by an older version.*study tables"):
            read_study(small)
        assert len(make_tables(small).runs) == len(read_study(small).runs) == 4

    def test_earlier_ones_stay_readable_while_a_changed_study_runs(self, small):
        before, seen = read_study(small), []

        def progress(about, news):
            if isinstance(news, Outcome):
                seen.append(read_study(small))

        after = run_study(study_of(seeds=3, algorithms=["greedy"]), small, progress=progress)
        [tables] = seen
        assert_same(tables, before)
        assert tables.manifest["seeds"] == [1, 2]
        assert tables.mission("toy") == load_mission("toy")
        assert len(after.runs) == 3

    @pytest.mark.parametrize("n_written", [0, 12])
    def test_a_kill_while_they_are_written_is_noticed(self, small, monkeypatch, n_written):
        """Wherever it is killed, a reader gets all tables of one moment, or an error."""
        before = read_study(small)
        StudyFolder(small).write_study(load_study(study_of(seeds=1)))
        usual, left = table_files.replace_file, iter(range(n_written))

        def replace_file(path, data):
            if next(left, None) is None:
                raise KeyboardInterrupt
            usual(path, data)

        with monkeypatch.context() as patch:
            patch.setattr(table_files, "replace_file", replace_file)
            with pytest.raises(KeyboardInterrupt):
                make_tables(small)
        if n_written == 0:
            assert_same(read_study(small), before)
        else:
            with pytest.raises(StudyError, match=r"cannot be read \(it was changed.*study tables"):
                read_study(small)
        assert len(make_tables(small).runs) == len(read_study(small).runs) == 2

    def test_they_are_made_without_the_file_and_the_packages(self, tmp_path, monkeypatch):
        """Of the folder alone: no code is called, and no file outside of it is read."""
        (tmp_path / "elsewhere").mkdir()
        code = "from botohe_moo.algorithms.bo_aco.algorithm import RandomTrails as Ants\n"
        (tmp_path / "elsewhere" / "mine_for_a_while.py").write_text(code)
        save_mission(load_mission("toy"), tmp_path / "elsewhere" / "site.json")
        monkeypatch.syspath_prepend(tmp_path / "elsewhere")
        mine = {"algorithm": "mine_for_a_while:Ants", "grid": {"n_ants": [10, 20]}}
        source = study_of(
            missions={"site": {"mission": "site.json", "robots": 3}, "toy": "toy"},
            algorithms={"mine": mine, "random": "random"},
            seeds=1,
            recording={"at": [7]},
            title="As it was",
            comparison={"control": "random", "significance": 0.1},
        )
        path = tmp_path / "elsewhere" / "study.yaml"
        path.write_text(json.dumps(source))
        before = run_study(path, tmp_path / "out")
        digests = [run.digest for run in load_study(path).runs()]
        shutil.rmtree(tmp_path / "elsewhere")
        del sys.modules["mine_for_a_while"]
        with pytest.raises(StudyError):
            load_study(tmp_path / "out" / "study.yaml")
        moved = (tmp_path / "out").rename(tmp_path / "moved")
        assert [run.digest for run in restore_study(moved).runs()] == digests
        for path in moved.glob("*.csv*"):
            path.unlink()
        after = make_tables(moved)
        assert_same(after, before)
        assert after.manifest == before.manifest

    @pytest.mark.parametrize(
        ("name", "damage", "said"),
        [
            ("missions/*.json", lambda data: data.replace(b"0.9", b"0.8"), "it was changed"),
            ("missions/*.json", lambda _: b"{", ".*"),
            ("study.json", lambda _: b'{"name": "s", "missions": [7]}', ".*"),
            ("study.json", lambda _: b"", ".*"),
            ("runs/*.npz", lambda data: data[: len(data) // 2], ".*"),
            ("runs/*.npz", lambda d: d[:200] + bytes([d[200] ^ 1]) + d[201:], ".*"),
            ("runs/*.npz", lambda _: b"\x80\x04K\x01.", ".*"),  # a pickle
            ("runs/*.npz", None, "it holds another run"),
        ],
    )
    def test_damaged_files_of_the_study_are_named(self, small, name, damage, said):
        path, *others = sorted(small.glob(name))
        before = path.read_bytes()
        path.write_bytes(damage(before) if damage else others[0].read_bytes())
        assert path.read_bytes() != before
        for work in (make_tables, lambda folder: merge_studies([folder], small.parent / "all")):
            with pytest.raises(StudyError, match=rf"{path.name}: damaged \({said}.*; remove"):
                work(small)

    def test_tables_that_are_not_written_yet(self, tmp_path):
        study = load_study(study_of())
        with StudyFolder(tmp_path).locked(study):
            StudyFolder(tmp_path).write_study(study)
        with pytest.raises(StudyError, match=r"not written yet.*botohe study tables"):
            read_study(tmp_path)


class TestAgain:
    def test_nothing_is_performed_anew(self, small, tmp_path):
        """No run is performed, and tables stay as they are, where only a comment has changed."""
        before = {path: path.read_bytes() for path in small.glob("*.csv*")}
        path = tmp_path / "study.yaml"
        path.write_text(f"# A comment\n{json.dumps(study_of())}")
        _, watcher = watched(path, small)
        assert watcher.performed == []
        assert before == {path: path.read_bytes() for path in small.glob("*.csv*")}
        assert (small / "study.yaml").read_text() == path.read_text()

    @pytest.mark.parametrize("name", ["runs/*.npz", "trace.csv.gz", "study.json"])
    def test_what_is_missing_is_made_anew(self, small, name):
        before = read_study(small)
        min(small.glob(name)).unlink()
        if name.startswith("runs"):
            assert make_tables(small).missing["missing"].sum() == 1
        assert_same(run_study(study_of(), small), before)
        assert_same(read_study(small), before)

    def test_only_what_is_new_is_performed_and_what_is_left_out_is_kept(self, small, tmp_path):
        few = {"algorithm": "random", "parameters": {"n_ants": 20}}
        source = study_of(algorithms={"new": few, "g": "greedy"}, seeds=3)
        tables, watcher = watched(source, small)
        expected = [("g", 3), *(("new", seed) for seed in (1, 2, 3))]
        assert sorted(watcher.performed) == [(*run, "done") for run in expected]
        assert_same(tables, run_study(source, tmp_path / "fresh"))
        tables, again = watched(study_of(comparison={"control": "greedy"}), small)
        assert again.performed == []
        assert set(tables.comparisons["other"]) == {"greedy"}

    def test_a_damaged_run_is_named_before_others_begin(self, small):
        path, *others = (small / "runs").iterdir()
        path.write_bytes(b"damaged")
        with pytest.raises(StudyError, match=f"{path.name}: damaged"):
            run_study(study_of(seeds=3), small)
        assert len([*(small / "runs").iterdir()]) == 1 + len(others)

    @pytest.mark.filterwarnings("error:.* runs failed")
    def test_failed_runs_are_tried_again(self, tmp_path):
        stone, folder = tmp_path / "stone", tmp_path / "study"
        stone.touch()
        what = f"if Path({str(stone)!r}).exists(): raise RuntimeError('a stone')"
        entry = {"algorithm": f"{MADE}:Doing", "parameters": {"what": what}}
        source = study_of(algorithms={"x": entry}, seeds=1)
        for _ in range(2):
            with pytest.warns(UserWarning, match=r"all 1 runs failed, the first with: Runtime"):
                _, watcher = watched(source, folder)
            assert watcher.performed == [("x", 1, "failed")]
        stone.unlink()
        tables, watcher = watched(source, folder)
        assert watcher.performed == [("x", 1, "done")]
        assert tables.runs["error"].isna().all()


class TestFolder:
    def test_other_peoples_folders_are_left_alone(self, small, tmp_path):
        with pytest.raises(StudyError, match="that of the study 'other', found the study 'trial'"):
            run_study(study_of(name="other"), small)
        (folder := tmp_path / "others").mkdir()
        names = [".important.tmp", "runs.csv"]
        for name in names:
            (folder / name).write_text("mine")
        with pytest.raises(StudyError, match="expected an empty folder or that of the study"):
            run_study(study_of(), folder)
        assert sorted(path.name for path in folder.iterdir()) == names
        study = load_study(study_of())
        busy = pytest.raises(StudyError, match="another runner is at work in this folder")
        with StudyFolder(small).locked(study), busy:
            run_study(study, small)

    def test_a_folder_is_known_when_it_holds_nothing_but_a_lock(self, tmp_path):
        study = study_of(algorithms=["greedy"])
        with StudyFolder(tmp_path / "out").locked(load_study(study)):
            leftover = tmp_path / "out" / "runs" / ".0123456789abcdef.tmp"
            leftover.write_bytes(b"half")  # as if killed here
        assert len(run_study(study, tmp_path / "out").runs) == 2
        assert not leftover.exists()

    def test_a_full_disk_loses_nothing(self, tmp_path, monkeypatch):
        usual, left = run_folder.replace_file, [1, 2]

        def replace_file(path, data):
            if path.suffix == ".npz" and not (left and left.pop()):
                raise OSError(errno.ENOSPC, "No space left on device", str(path))
            usual(path, data)

        with monkeypatch.context() as patch:
            patch.setattr(run_folder, "replace_file", replace_file)
            with pytest.raises(OSError, match=r"No space left on device: .*\.npz"):
                run_study(study_of(), tmp_path)
        _, watcher = watched(study_of(), tmp_path)
        assert len(watcher.performed) == 2

    def test_the_file_of_a_run_has_all_of_it(self, tmp_path):
        study, store = load_study(study_of()), StudyFolder(tmp_path / "study")
        run = study.runs()[0]
        failed = Outcome("failed", "error", error="it broke")
        done = outcome_of(run, [(0.4, 0.4)], [(0.6, 0.5), (0.5, 0.6)], ties=2)
        with store.locked(study):
            store.save(run, failed)
            assert (store.load(run), store.finished([run])) == (failed, frozenset())
            store.save(run, done)
        assert store.finished([run]) == {run.digest}
        found = store.load(run)
        assert replace(found, records=()) == replace(done, records=())
        for one, other in zip(found.records, done.records, strict=True):
            assert one.objectives.tolist() == other.objectives.tolist()
            bare = replace(one, objectives=other.objectives, plans=other.plans)
            assert vars(bare) == vars(other)
        (plans, objectives), (expected, claimed) = found.records[-1].plans, done.records[-1].plans
        assert (list(plans), objectives.tolist()) == (list(expected), claimed.tolist())


class TestMerged:
    """Results of several machines become one study."""

    @pytest.fixture
    def parts(self, finished, tmp_path):
        """Two machines' folders, whose seeds overlap: 1 and 2, 2 and 3."""
        shutil.copytree(finished, tmp_path / "one")
        run_study(study_of(seeds=[2, 3]), tmp_path / "two")
        return [tmp_path / "one", tmp_path / "two"]

    def test_parts_are_the_study_that_one_machine_did(self, parts, tmp_path):
        merged = merge_studies(parts, tmp_path / "all")
        assert_same(merged, run_study(study_of(seeds=[1, 2, 3]), tmp_path / "whole"))
        study = load_study(tmp_path / "all" / "study.yaml")
        assert {run.digest for run in study.runs()} == set(merged.runs["run"])
        # One of the folders can take the others, and its own runs stay.
        before = read_study(parts[0]).runs.set_index("run")["began"]
        began = merge_studies(parts[::-1], parts[0]).runs.set_index("run")["began"]
        assert len(began) == 6
        assert began[before.index].equals(before)

    def test_what_was_stopped_or_failed_on_one_machine_comes_from_another(self, parts, tmp_path):
        store, study = StudyFolder(parts[0]), load_study(study_of())
        ends = {}
        for run in study.runs()[:2]:
            store.save(run, replace(store.load(run), status="failed", error="it broke"))
            (parts[0] / "runs" / f"{run.digest}.npz").unlink()
            ends[run.digest] = "done" if run.seed == 2 else "failed"
        runs = merge_studies(parts, tmp_path / "all").runs
        assert len(runs) == 6
        assert runs.set_index("run")["status"][[*ends]].to_dict() == ends

    @pytest.mark.parametrize(
        "other",
        [{"name": "another"}, {"missions": {"toy": {"mission": "toy", "robots": 1}}}],
    )
    def test_another_study_is_refused(self, finished, tmp_path, other):
        """Files of one name may differ."""
        run_study(study_of(**{"seeds": [4], **other}), tmp_path / "other")
        folders = [finished, tmp_path / "other"]
        for given, out in ((folders, tmp_path / "all"), (folders[:1], tmp_path / "other")):
            with pytest.raises(StudyError) as caught:
                merge_studies(given, out)
            said = f"{folders[1]}: expected the study of {folders[0]} but for its seeds."
            assert str(caught.value) == said
        assert not (tmp_path / "all").exists()


def test_what_is_refused(tmp_path):
    with pytest.raises(StudyError, match="there is no study in this folder"):
        merge_studies([tmp_path / "nothing"], tmp_path / "all")
    with pytest.raises(StudyError, match="Expected folders of a study, got none"):
        merge_studies([])
    with pytest.raises(ValueError, match=r"Expected workers in \[1, 1024\], got 0"):
        run_study(study_of(), tmp_path, workers=0)


def invoke(*arguments, status=0):
    ended = CliRunner().invoke(study_app, list(map(str, arguments)))
    assert ended.exit_code == status, ended.output
    return " ".join(re.sub("[│\\n]", " ", ended.output).split())


class TestCommands:
    def test_plan_run_and_merge(self, tmp_path):
        algorithms = {"bad": f"{MADE}:Doing", "good": "random"}
        path, folder = tmp_path / "s.json", tmp_path / "out"
        path.write_text(json.dumps(study_of(algorithms=algorithms, seeds=1)))
        said = invoke("plan", path, "--out", folder)
        assert "toy bad 1 0 toy good 1 0 2 runs: 0 are there, 2 to go" in said
        assert "With 1 seed, no difference can be significant at 0.05 after" in said
        assert said.endswith(": 4 seeds are needed")  # 2 / binomial(8, 4) = 0.029
        assert not folder.exists()
        said = invoke("run", path, "--out", folder, status=1)
        for part in ("bad on toy, seed 1: failed: RuntimeError: out of luck", "1 run failed"):
            assert part in said
        assert "good 1 0." in said
        assert "2 runs: 1 are there, 1 to go" in invoke("plan", path, "--out", folder)
        assert "2 runs merged" in invoke("merge", folder, "--out", tmp_path / "all")

    @pytest.mark.parametrize(
        ("arguments", "said"),
        [
            (["tables", "nowhere"], "nowhere: there is no study in this folder"),
            (["run", "x.yaml", "--workers", "0"], "'-w': Input should be greater than or equal"),
            (["run", "missing.yaml"], "botohe: missing.yaml: no such file or directory."),
        ],
    )
    def test_bad_input(self, arguments, said):
        assert said in invoke(*arguments, status=2)

    def test_columns_of_the_plan_allow_for_wide_letters(self):
        runs = load_study(study_of(missions={"美术馆": "toy", "m": "art_museum"})).runs()
        lines = _plan_table(runner.Plan(runs, frozenset(), {})).splitlines()
        assert len({cell_len(line) for line in lines}) == 1
        assert len({len(line) for line in lines}) == 2
