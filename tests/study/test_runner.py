"""Studies in this process: what is run, what is kept, what becomes of it."""

import errno
import json
import shutil
import sys
from unittest import mock

import numpy as np
import pandas as pd
import pytest

from botohe_moo import BOTOHE, area_indicator, load_mission
from botohe_moo.mission.loading import save_mission
from botohe_moo.study import folder as run_folder
from botohe_moo.study import make_tables, read_study, run_study, runner
from botohe_moo.study import tables as table_files
from botohe_moo.study.folder import StudyFolder, restore_study
from botohe_moo.study.loading import load_study
from botohe_moo.study.model import StudyError
from botohe_moo.study.perform import Outcome, Record
from botohe_moo.study.pool import WorkerPool
from botohe_moo.study.runner import Plan
from botohe_moo.study.tables import INDEX, SCHEMAS, as_table, write_tables

pytestmark = pytest.mark.usefixtures("in_process")

MADE = "tests.study.algorithms_made"
TIMES = {"began", "seconds", "recording_seconds", "seconds_median", "bound_seconds", "traceback"}
TABLES = tuple(SCHEMAS)


def study_of(**changes):
    return {
        "name": "trial",
        "missions": ["toy"],
        "algorithms": ["random", "greedy"],
        "budget": {"evaluations": 300},
        "seeds": 2,
        **changes,
    }


def without_times(tables, leave_out=()):
    return {
        name: getattr(tables, name).drop(
            columns=[c for c in getattr(tables, name) if c in TIMES or c in leave_out]
        )
        for name in TABLES
    }


def assert_same(one, other):
    one, other = without_times(one), without_times(other)
    for name in TABLES:
        pd.testing.assert_frame_equal(one[name], other[name], obj=name)


class Watcher:
    """Notes what is performed."""

    def __init__(self):
        self.performed, self.plan, self.records, self.bounded = [], None, 0, []

    def __call__(self, about, news):
        note = {Plan: self.begin, Record: self.record, Outcome: self.end}
        note.get(type(news), self.end_bound)(about, news)

    def begin(self, study, plan):
        self.plan = plan

    def record(self, run, record):
        self.records += 1

    def end(self, run, outcome):
        self.performed.append((run.algorithm.label, run.seed, outcome.status))

    def end_bound(self, mission, bound):
        self.bounded.append((mission.label, bound if isinstance(bound, str) else None))


def watched(source, folder, **options):
    watcher = Watcher()
    tables = run_study(source, folder, progress=watcher, **options)
    return tables, watcher


FLOOR = 0.5


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A study of everything that can come of a run."""
    source = study_of(
        missions={"plant": {"mission": "power_plant", "min_survival": FLOOR, "robots": 3}},
        algorithms={
            "random": "random",
            "sampler": f"{MADE}:Sampler",
            "raising": f"{MADE}:Raising",
            "infeasible": f"{MADE}:Infeasible",
            "never": f"{MADE}:NeverEnding",
            "dying": f"{MADE}:Dying",
        },
        budget={"evaluations": 200, "seconds": 1, "grace_seconds": 0.2},
        seeds=2,
        comparison={"control": "random"},
    )
    with mock.patch.object(runner, "WorkerPool", WorkerPool):
        return run_study(source, tmp_path_factory.mktemp("study"), workers=2)


def runs_of(tables, algorithm, mission="plant"):
    runs = tables.runs
    return runs[(runs["algorithm"] == algorithm) & (runs["mission"] == mission)]


class TestWhatComesOfRuns:
    def test_each_is_reported_as_such(self, done):
        columns = ["status", "stopped_by", "error"]
        by = {label: runs_of(done, label)[columns].iloc[0] for label in done.algorithm_labels}
        assert {label: (row["status"], row["stopped_by"]) for label, row in by.items()} == {
            "random": ("done", "evaluations"),
            "sampler": ("done", "evaluations"),
            "raising": ("failed", "error"),
            "infeasible": ("infeasible", "evaluations"),
            "never": ("timeout", "limit"),
            "dying": ("failed", "error"),
        }
        assert by["raising"]["error"] == "RuntimeError: out of luck"
        assert runs_of(done, "raising")["traceback"].str.contains("_advance").all()
        assert "SIGABRT" in by["dying"]["error"]
        assert "killed" in by["never"]["error"]
        assert runs_of(done, "random")["error"].isna().all()

    def test_nobody_spends_more_than_the_budget(self, done):
        assert (done.runs["evaluations"] <= 200).all()
        assert (runs_of(done, "sampler")["evaluations"] == 200).all()

    def test_runs_without_a_front_are_scored_as_bringing_nothing(self, done):
        values = done.indicators.set_index(["indicator", "algorithm"])["value"]
        for label in ("raising", "infeasible", "dying"):
            assert (runs_of(done, label)["area"] == 0).all()
            # NaN-free, and as bad as the base alone.
            assert (values["igd_plus"][label] > 0).any()
            assert np.isfinite(values["igd_plus"][label]).all()
        assert (values["front_size"]["raising"] == 0).all()

    def test_what_a_killed_run_had_found_counts(self, done):
        never = runs_of(done, "never")
        assert (never["area"] > 0).all()
        assert (never["evaluations"] == 20).all()
        found = done.plans[done.plans["run"] == never["run"].iloc[0]]
        assert len(found) == never["front_size"].iloc[0]

    def test_the_summary_counts_them(self, done):
        summary = done.summary.set_index(["mission", "algorithm"])["n_not_done"]
        assert summary["plant", "raising"] == summary["plant", "never"] == 2
        assert summary["plant", "random"] == 0


class TestTables:
    def test_they_are_of_their_schemas(self, done):
        for name in TABLES:
            as_table(name, getattr(done, name))

    def test_every_row_can_be_evaluated_again(self, done):
        for (label, run), rows in done.plans.groupby(["mission", "run"]):
            mission = done.mission(label)
            plans = [done.plan(run, plan_id) for plan_id in rows["plan_id"]]
            assert mission.robot_survival(plans).min() >= FLOOR * (1 - 1e-12)
            found = mission.evaluate(plans)
            assert np.allclose(found, rows[["reward", "survivors"]], rtol=1e-9)
            area = done.runs.set_index("run")["area"][run]
            assert area_indicator(found, mission) == pytest.approx(area, rel=1e-9)

    def test_runs_trace_and_fronts_agree(self, done):
        last = done.trace.groupby("run").last()
        runs = done.runs.set_index("run")
        for column in ("evaluations", "area", "front_size"):
            assert (last[column] == runs.loc[last.index, column]).all()
        for (run, evaluations), points in done.fronts.groupby(["run", "evaluations"]):
            mission = done.mission(points["mission"].iloc[0])
            row = done.trace[
                (done.trace["run"] == run) & (done.trace["evaluations"] == evaluations)
            ]
            [area] = row["area"]
            assert area_indicator(points[["reward", "survivors"]], mission) == area

    def test_a_run_can_be_repeated_from_its_row(self, done):
        row = runs_of(done, "random").iloc[0]
        from pymoo.optimize import minimize

        from botohe_moo import make_algorithm

        result = minimize(
            BOTOHE(load_mission("power_plant", robots=3), min_survival=FLOOR),
            make_algorithm("random"),
            ("n_eval", int(row["evaluations"])),
            seed=int(row["seed"]),
        )
        assert area_indicator(-result.F, result.problem.mission) == row["area"]

    def test_travel_budgets_are_in_the_tables(self, tmp_path):
        missions = {"near": {"mission": "toy", "max_length": 4}, "far": "toy"}
        source = study_of(missions=missions, algorithms=["nsga2"], seeds=1)
        tables = run_study(source, tmp_path)
        assert set(tables.runs["status"]) == {"done"}
        for table in (tables.runs, tables.missions, pd.read_csv(tmp_path / "missions.csv")):
            limits = table.set_index("mission")["max_length"]
            assert limits["near"] == 4
            assert pd.isna(limits["far"])
        longest = {}
        for label, own in tables.plans.groupby("mission"):
            plans = [tables.plan(run, i) for run, i in zip(own["run"], own["plan_id"], strict=True)]
            longest[label] = load_mission("toy").trail_lengths(plans).max()
        assert longest["near"] == 4 < longest["far"]
        assert [mission.max_length for mission in restore_study(tmp_path).missions] == [4, None]

    def test_types_and_numbers_come_back(self, tmp_path):
        columns = {
            "mission": ['a, "b"\nc', "ε", "NA"],
            "indicator": ["x", "y", "z"],
            "n": [1, 2**62, 0],
            "p_value": [0.1 + 0.2, 5e-324, float("inf")],
            "significant": [True, False, True],
        }
        odd = {"further flags": [True, None, False], "mine": [1, None, 2**53 + 1]}
        types = {"further flags": "boolean", "mine": "Int64"}
        whole = {name: as_table(name, []) for name in SCHEMAS}
        fill_of = {"text": "t", "integer": 1, "number": 0.5, "flag": True}
        fill = {name: fill_of[of.type] for name, of in SCHEMAS["comparisons"].items()}
        rows = pd.DataFrame({**{k: [v] * 3 for k, v in fill.items()}, **columns})
        whole["comparisons"] = as_table("comparisons", rows)
        rest = {name: fill_of[of.type] for name, of in SCHEMAS["missions"].items()}
        frame = as_table("missions", [rest] * 3)
        whole["missions"] = frame.assign(**pd.DataFrame(odd).astype(types))
        (tmp_path / "study.json").write_text("{}")
        write_tables(tmp_path, whole, {})
        read = read_study(tmp_path)
        pd.testing.assert_frame_equal(read.comparisons, whole["comparisons"], check_exact=True)
        assert read.missions[[*odd]].equals(whole["missions"][[*odd]])
        assert dict(read.missions.dtypes.astype(str))["bound_area"] == "float64"

    def test_what_is_not_of_its_schema_is_not_written(self, done):
        for changed in (
            done.runs.drop(columns="evaluations"),
            done.runs.assign(area="high"),
            done.runs.assign(evaluations="many"),
        ):
            with pytest.raises((TypeError, ValueError)):
                as_table("runs", changed)

    def test_plans_that_are_not_there(self, done):
        with pytest.raises(KeyError, match="found 0"):
            done.plan(done.runs["run"].iloc[0], 10**6)

    def test_damaged_tables_are_named(self, small):
        for name, damage in (
            ("trace.csv.gz", b"\x1f\x8b"),
            ("runs.csv", b"run,mission\n"),
            (INDEX, b"{"),
            (INDEX, b"[]"),
            (INDEX, b'{"tables": {"runs": 7}}'),
        ):
            whole = (small / name).read_bytes()
            (small / name).write_bytes(damage)
            with pytest.raises(StudyError, match=rf"{name}: cannot be read.*study tables"):
                read_study(small)
            (small / name).write_bytes(whole)
        (small / "plans.csv.gz").unlink()
        with pytest.raises(StudyError, match=r"plans\.csv\.gz: cannot be read.*study tables"):
            read_study(small)

    def test_tables_of_another_version_are_named(self, small):
        index = json.loads((small / INDEX).read_bytes())
        index["version"] = "0"  # as if the package had other columns
        (small / INDEX).write_text(json.dumps(index))
        with pytest.raises(StudyError, match=r"tables are of another version.*study tables"):
            read_study(small)
        (small / INDEX).unlink()
        (small / "runs.parquet").write_bytes(b"PAR1")
        with pytest.raises(
            StudyError, match=r"not written yet, or by an older version.*study tables"
        ):
            read_study(small)
        assert len(make_tables(small).runs) == 4
        assert len(read_study(small).runs) == 4

    def test_earlier_ones_stay_readable_while_a_changed_study_runs(self, small):
        before, seen = read_study(small), []

        class Reading(Watcher):
            def end(self, run, outcome):
                seen.append(read_study(small))

        after = run_study(study_of(seeds=3), small, progress=Reading())
        assert len(seen) == 2
        for tables in seen:
            assert_same(tables, before)
            assert tables.manifest["seeds"] == [1, 2]
            assert tables.mission("toy") == load_mission("toy")
        assert len(after.runs) == 6

    @pytest.mark.parametrize("n_written", [0, 12])
    def test_a_kill_while_they_are_written_is_noticed(self, small, monkeypatch, n_written):
        """Wherever it is killed, a reader gets all tables of one moment, or an error."""
        before = read_study(small)
        StudyFolder(small).write_study(load_study(study_of(seeds=1)))
        usual, written = table_files.replace_file, []

        def replace_file(path, data):
            if len(written) == n_written:
                raise KeyboardInterrupt
            written.append(path)
            usual(path, data)

        monkeypatch.setattr(table_files, "replace_file", replace_file)
        with pytest.raises(KeyboardInterrupt):
            make_tables(small)
        monkeypatch.setattr(table_files, "replace_file", usual)
        if n_written == 0:
            assert_same(read_study(small), before)
        else:
            with pytest.raises(StudyError, match=r"cannot be read \(it was changed.*study tables"):
                read_study(small)
        assert len(make_tables(small).runs) == len(read_study(small).runs) == 2

    def test_they_are_made_without_the_file_and_the_packages(self, tmp_path, monkeypatch):
        """Of the folder alone: no code is called, and no file outside of it is read."""
        (tmp_path / "elsewhere").mkdir()
        (tmp_path / "elsewhere" / "mine_for_a_while.py").write_text(
            "from botohe_moo import load_mission\n"
            "from botohe_moo.algorithms.bo_aco.algorithm import RandomTrails as Ants\n"
        )
        save_mission(load_mission("toy"), tmp_path / "elsewhere" / "site.json")
        monkeypatch.syspath_prepend(tmp_path / "elsewhere")
        source = study_of(
            missions={"site": {"mission": "site.json", "robots": 3}, "toy": "toy"},
            algorithms={
                "mine": {"algorithm": "mine_for_a_while:Ants", "grid": {"n_ants": [10, 20]}},
                "random": "random",
            },
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
        for name in TABLES:
            [path.unlink() for path in moved.glob(f"{name}.csv*")]
        after = make_tables(moved)
        assert_same(after, before)
        assert after.manifest == before.manifest

    def test_a_mission_that_was_changed_is_named(self, small):
        path = next((small / "missions").iterdir())
        content = json.loads(path.read_text())
        content["edges"][0]["survival"] *= 0.5
        path.write_text(json.dumps(content))
        with pytest.raises(StudyError, match=rf"{path}: damaged \(it was changed"):
            make_tables(small)

    def test_damaged_files_of_the_study_are_named(self, small):
        for name, damage in (
            ("missions/*.json", "{"),
            ("study.json", '{"name": "s", "missions": [7]}'),
            ("study.json", ""),
        ):
            [path] = small.glob(name)
            path.write_text(damage)
            with pytest.raises(StudyError, match=rf"{path}: damaged \(.*; remove the file"):
                make_tables(small)

    def test_a_run_under_the_name_of_another_is_named(self, small):
        one, other, *_ = sorted((small / "runs").glob("*.npz"))
        other.write_bytes(one.read_bytes())
        with pytest.raises(StudyError, match=rf"{other}: damaged \(it holds another run\)"):
            make_tables(small)

    def test_folders_without_a_study(self, tmp_path):
        with pytest.raises(StudyError, match="there is no study in this folder"):
            read_study(tmp_path / "nowhere")
        study = load_study(study_of())
        with StudyFolder(tmp_path).locked(study):
            StudyFolder(tmp_path).write_study(study)
        with pytest.raises(StudyError, match=r"not written yet.*botohe study tables"):
            read_study(tmp_path)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("finished")
    run_study(study_of(), folder)
    return folder


@pytest.fixture
def small(finished, tmp_path):
    """A copy of a finished study's folder."""
    return shutil.copytree(finished, tmp_path / "copy")


def a_run_of(folder):
    return folder / "runs" / f"{read_study(folder).runs['run'][1]}.npz"


class TestAgain:
    def test_nothing_is_performed_anew(self, small, tmp_path):
        """No run is performed, and tables stay as they are, where only a comment has changed."""
        before = {path: path.read_bytes() for path in small.glob("*.csv*")}
        path = tmp_path / "study.yaml"
        path.write_text(f"# A comment\n{json.dumps(study_of())}")
        tables, watcher = watched(path, small)
        assert watcher.performed == []
        assert len(tables.runs) == 4
        assert before == {path: path.read_bytes() for path in small.glob("*.csv*")}
        assert restore_study(small).text.startswith("# A comment")

    def test_what_has_changed_is_made_anew(self, small):
        before = run_study(study_of(), small)
        for path in (a_run_of(small), small / "trace.csv.gz", small / "study.json"):
            path.unlink()
            if path.suffix == ".npz":
                assert (
                    make_tables(small).missing["missing"].sum()
                    == read_study(small).missing["missing"].sum()
                    == 1
                )
            assert_same(run_study(study_of(), small), before)
            assert_same(read_study(small), before)

    def test_only_what_is_new_is_performed(self, small, tmp_path):
        few = {"algorithm": "random", "parameters": {"n_ants": 20}}
        source = study_of(algorithms={"new": few, "random": "random", "g": "greedy"}, seeds=3)
        tables, watcher = watched(source, small)
        assert sorted(watcher.performed) == [
            ("g", 3, "done"),
            ("new", 1, "done"),
            ("new", 2, "done"),
            ("new", 3, "done"),
            ("random", 3, "done"),
        ]
        fresh = run_study(source, tmp_path / "fresh")
        assert_same(tables, fresh)

    def test_what_is_left_out_is_not_in_the_tables_but_kept(self, small):
        tables, watcher = watched(study_of(algorithms=["greedy"]), small)
        assert watcher.performed == []
        assert set(tables.runs["algorithm"]) == {"greedy"}
        tables, watcher = watched(study_of(comparison={"control": "greedy"}), small)
        assert watcher.performed == []
        assert set(tables.comparisons["other"]) == {"greedy"}

    def test_a_damaged_run_is_named_before_others_begin(self, tmp_path):
        folder = tmp_path / "study"
        watched(study_of(seeds=1), folder)
        path, *others = (folder / "runs").iterdir()
        path.write_bytes(b"damaged")
        with pytest.raises(StudyError, match=f"{path.name}: damaged"):
            watched(study_of(seeds=2), folder)
        assert len([*(folder / "runs").iterdir()]) == 1 + len(others)

    def test_failed_runs_are_tried_again(self, tmp_path):
        stone = tmp_path / "stone"
        stone.touch()
        source = study_of(
            algorithms={
                "x": {"algorithm": f"{MADE}:RaisingOnce", "parameters": {"path": str(stone)}}
            },
            seeds=1,
        )
        folder = tmp_path / "study"
        with pytest.warns(UserWarning, match=r"study: all 1 runs failed, the first with: Runtime"):
            tables, watcher = watched(source, folder)
        assert set(tables.runs["status"]) == {"failed"}
        with pytest.warns(UserWarning, match="all 1 runs failed"):
            _, watcher = watched(source, folder)
        assert [status for *_, status in watcher.performed] == ["failed"]
        stone.unlink()
        tables, watcher = watched(source, folder)
        assert [status for *_, status in watcher.performed] == ["done"]
        assert tables.runs["error"].isna().all()
        _, watcher = watched(source, folder)
        assert watcher.performed == []

    @pytest.mark.parametrize("seeds", [2, 3])
    def test_damaged_files_are_named(self, small, seeds):
        before = read_study(small)
        damages = (
            lambda data: data[: len(data) // 2],
            lambda data: data[:200] + bytes([data[200] ^ 1]) + data[201:],
            lambda data: b"\x80\x04K\x01.",  # a pickle
        )
        paths = sorted((small / "runs").iterdir())[:3]
        for path, damage in zip(paths, damages, strict=True):
            path.write_bytes(damage(path.read_bytes()))
        with pytest.raises(StudyError, match=r"damaged \(.*\); remove the file, and"):
            run_study(study_of(seeds=seeds), small)
        for _ in paths:
            with pytest.raises(StudyError) as caught:
                make_tables(small)
            [named] = [path for path in paths if str(caught.value).startswith(f"{path}: damaged (")]
            named.unlink()
        after, watcher = watched(study_of(), small)
        assert len(watcher.performed) == 3
        assert_same(before, after)


class TestFolder:
    def test_another_study_is_not_overwritten(self, small):
        with pytest.raises(StudyError, match="that of the study 'other', found the study 'trial'"):
            run_study(study_of(name="other"), small)

    def test_other_peoples_folders_are_left_alone(self, tmp_path):
        (tmp_path / "runs.csv").write_text("mine")
        (tmp_path / ".important.tmp").write_text("mine")
        with pytest.raises(StudyError, match="expected an empty folder or that of the study"):
            run_study(study_of(), tmp_path)
        assert sorted(path.name for path in tmp_path.iterdir()) == [".important.tmp", "runs.csv"]

    def test_a_second_runner_stops(self, small):
        with (
            StudyFolder(small).locked(load_study(study_of())),
            pytest.raises(StudyError, match="another runner is at work in this folder"),
        ):
            run_study(study_of(), small)
        run_study(study_of(), small)

    def test_a_folder_is_known_when_it_holds_nothing_but_a_lock(self, tmp_path):
        with StudyFolder(tmp_path / "out").locked(load_study(study_of())):
            leftover = tmp_path / "out" / "runs" / ".0123456789abcdef.tmp"
            leftover.write_bytes(b"half")  # as if killed here
        assert len(run_study(study_of(), tmp_path / "out").runs) == 4
        assert not leftover.exists()

    def test_a_full_disk_loses_nothing(self, tmp_path, monkeypatch):
        usual, n = run_folder.replace_file, [0]

        def replace_file(path, data):
            n[0] += path.suffix == ".npz"
            if n[0] == 3:
                raise OSError(errno.ENOSPC, "No space left on device", str(path))
            usual(path, data)

        monkeypatch.setattr(run_folder, "replace_file", replace_file)
        with pytest.raises(OSError, match=r"No space left on device: .*\.npz"):
            run_study(study_of(), tmp_path)
        monkeypatch.undo()
        _, watcher = watched(study_of(), tmp_path)
        assert len(watcher.performed) == 2

    def test_the_study_is_kept_with_its_results(self, tmp_path):
        path = tmp_path / "mine.yaml"
        path.write_text("# mine\n" + json.dumps(study_of()))
        tables = run_study(path, tmp_path / "out")
        assert (tmp_path / "out" / "study.yaml").read_text() == path.read_text()
        assert tables.mission("toy") == load_mission("toy")
        assert len(load_study(tmp_path / "out" / "study.yaml").runs()) == 4


def test_workers_are_checked(tmp_path):
    with pytest.raises(ValueError, match=r"Expected workers in \[1, 1024\], got 0"):
        run_study(study_of(), tmp_path, workers=0)
