"""Studies in this process: what is run, what is kept, what becomes of it."""

import errno
import hashlib
import io
import json
import os
import re
import shutil
import sys
import threading
import time
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from botohe_moo import BOTOHE, area_indicator, load_mission
from botohe_moo.mission.formats.files import save_mission
from botohe_moo.study import make_tables, planning, read_study, run_study
from botohe_moo.study.file.loading import load_study
from botohe_moo.study.file.model import StudyError
from botohe_moo.study.judge import collect
from botohe_moo.study.planning import make_task, plan_study
from botohe_moo.study.run.perform import warm_up
from botohe_moo.study.store import folder as run_folder
from botohe_moo.study.store import table_files
from botohe_moo.study.store.folder import StudyFolder
from botohe_moo.study.store.manifest import restore_study
from botohe_moo.study.store.table_files import tables_locked
from botohe_moo.study.store.tables import SCHEMAS, to_arrow

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


def with_column(name, values):
    """Give a change that fills a column of a table; bytes become a text that is none."""

    def change(table):
        column = pa.array(values * table.num_rows)
        if isinstance(values[0], bytes):
            column = pa.StringArray.from_buffers(len(column), *column.buffers()[1:])
        return table.set_column(table.column_names.index(name), name, column)

    return change


def forge(folder, name, change):
    """Change a table, and let the manifest name what it is then."""
    path = folder / f"{name}.parquet"
    pq.write_table(change(pq.read_table(path)), path)
    manifest = json.loads((folder / "study.json").read_text())
    manifest["tables"][name] = hashlib.sha256(path.read_bytes()).hexdigest()
    (folder / "study.json").write_text(json.dumps(manifest))


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


def forbidden(*_, **__):
    raise AssertionError("nobody needs this")


class Watcher:
    """Notes what is performed."""

    def __init__(self):
        self.performed, self.plan, self.records, self.bounded = [], None, 0, []

    def begin(self, plan):
        self.plan = plan

    def record(self, run, record):
        self.records += 1

    def end(self, run, outcome):
        self.performed.append((run.algorithm.label, run.seed, outcome.status))

    def end_bound(self, mission, error):
        self.bounded.append((mission.label, error))


def watched(source, folder, **options):
    watcher = Watcher()
    tables = run_study(source, folder, watcher=watcher, **options)
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
    warm_up(make_task(load_study(source).runs()[0]))  # none of the seconds is for compiling
    return run_study(source, tmp_path_factory.mktemp("study"), workers=2)


def runs_of(tables, algorithm, mission="plant"):
    runs = tables.runs
    return runs[(runs["algorithm"] == algorithm) & (runs["mission"] == mission)]


class TestWhatComesOfRuns:
    def test_each_is_reported_as_such(self, done):
        by = {label: set(runs_of(done, label)["status"]) for label in done.algorithm_labels}
        assert by == {
            "random": {"done"},
            "sampler": {"done"},
            "raising": {"failed"},
            "infeasible": {"infeasible"},
            "never": {"timeout"},
            "dying": {"failed"},
        }
        stopped = {
            label: set(runs_of(done, label)["stopped_by"]) for label in done.algorithm_labels
        }
        assert stopped["never"] == {"limit"}
        assert stopped["raising"] == stopped["dying"] == {"error"}
        assert stopped["sampler"] == {"evaluations"}

    def test_what_went_wrong_is_told(self, done):
        assert set(runs_of(done, "raising")["error"]) == {"RuntimeError: out of luck"}
        assert runs_of(done, "raising")["traceback"].str.contains("_advance").all()
        assert runs_of(done, "dying")["error"].str.contains("SIGABRT").all()
        assert runs_of(done, "never")["error"].str.contains("killed").all()
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

    def test_verdicts_mention_them(self, done):
        rows = done.comparisons[done.comparisons["algorithm"] == "raising"]
        assert rows["verdict"].str.contains("2 of 2 runs of raising").all()
        summary = done.summary.set_index(["mission", "algorithm"])["n_not_done"]
        assert summary["plant", "raising"] == summary["plant", "never"] == 2
        assert summary["plant", "random"] == 0

    def test_the_floor_is_kept(self, done):
        mission = done.mission("plant")
        for row in done.plans[done.plans["mission"] == "plant"].itertuples():
            survival = mission.robot_survival([done.plan(row.run, row.plan_id)])
            assert survival.min() >= FLOOR * (1 - 1e-12)


def read_study_again(folder):
    return run_study(study_of(), folder)


class TestTables:
    def test_they_are_of_their_schemas(self, done):
        for name in TABLES:
            to_arrow(name, getattr(done, name))

    def test_every_row_can_be_evaluated_again(self, done):
        for (label, run), rows in done.plans.groupby(["mission", "run"]):
            mission = done.mission(label)
            plans = [done.plan(run, plan_id) for plan_id in rows["plan_id"]]
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

    def test_csv_and_parquet_agree(self, done):
        for name in ("runs", "summary", "comparisons", "indicators", "ranks", "environments"):
            read = pd.read_csv(done.folder / f"{name}.csv")
            frame = getattr(done, name)
            assert len(read) == len(frame)
            for column in frame.select_dtypes("number"):
                assert np.allclose(
                    read[column].astype(float),
                    frame[column].astype(float),
                    equal_nan=True,
                    rtol=1e-15,
                )

    def test_missing_columns_and_wrong_types_are_found(self, done):
        with pytest.raises(StudyError, match="Table runs: expected columns"):
            to_arrow("runs", done.runs.drop(columns="area"))
        with pytest.raises(StudyError, match="Table runs"):
            to_arrow("runs", done.runs.assign(area="high"))
        with pytest.raises(StudyError, match=r"Table trace.*evaluations"):
            to_arrow("trace", done.trace.assign(evaluations=0.5))
        with pytest.raises(StudyError, match=r"Table trace.*mission"):
            to_arrow("trace", done.trace.assign(mission=None))

    def test_plans_that_are_not_there(self, done):
        with pytest.raises(KeyError, match="found 0"):
            done.plan(done.runs["run"].iloc[0], 10**6)

    @pytest.mark.parametrize("damage", [b"", b"not parquet", None])
    def test_damaged_tables_are_named(self, small, damage):
        path = small / "trace.parquet"
        if damage is None:
            path.unlink()
        else:
            path.write_bytes(damage)
        with pytest.raises(StudyError, match=r"trace\.parquet"):
            read_study(small)

    @pytest.mark.parametrize(
        ("name", "change", "said"),
        [
            ("runs", lambda table: table.drop_columns("area"), "expected the columns run, "),
            ("runs", lambda table: table.append_column("x", table["area"]), "no further columns"),
            ("plans", with_column("trails", [0.5]), "type string in each row of column trails"),
            ("trace", with_column("area", [None]), "type double in each row of column area"),
            ("trace", with_column("area", [[0.5]]), "type double in each row of column area|read"),
            ("runs", with_column("mission", ["x"]), "only missions of the study .* found 'x'"),
            ("summary", with_column("algorithm", ["x"]), "only algorithms of the study"),
            ("ranks", with_column("indicator", ["x"]), "only indicators of the study"),
            ("missions", lambda table: table.slice(1), "each of the study's missions once"),
            ("runs", lambda table: table.replace_schema_metadata({"pandas": "{"}), "be read"),
            ("runs", with_column("status", [b"\xff"]), "be read"),
        ],
    )
    def test_forged_tables_are_named(self, small, name, change, said):
        """Each would have ended in a traceback where the report is made."""
        forge(small, name, change)
        with pytest.raises(StudyError, match=rf"{name}\.parquet: .*{said}") as caught:
            read_study(small)
        assert len(str(caught.value).splitlines()) == 1

    def test_tables_of_another_moment_are_noticed(self, small, tmp_path):
        older = (small / "summary.parquet").read_bytes()
        run_study(study_of(seeds=3), small)
        (small / "summary.parquet").write_bytes(older)
        with pytest.raises(StudyError, match=r"summary\.parquet: damaged, or of another moment"):
            read_study(small)

    def test_so_is_a_study_without_any(self, tmp_path):
        study = load_study(study_of())
        with StudyFolder(tmp_path).locked(study):
            StudyFolder(tmp_path).write_study(study)
        with pytest.raises(StudyError, match=r"its tables are not made yet.*botohe study tables"):
            read_study(tmp_path)

    def test_earlier_ones_stay_readable_while_a_changed_study_runs(self, small):
        before, seen = read_study(small), []

        class Reading(Watcher):
            def end(self, run, outcome):
                seen.append(read_study(small))

        after = run_study(study_of(seeds=3), small, watcher=Reading())
        assert len(seen) == 2
        for tables in seen:
            assert_same(tables, before)
            assert tables.manifest["seeds"] == [1, 2]
            assert tables.mission("toy") == load_mission("toy")
        assert len(after.runs) == 6

    @pytest.mark.parametrize("tidied", [False, True])
    def test_new_ones_replace_them_all_at_once_wherever_it_is_killed(
        self, small, monkeypatch, tidied
    ):
        """Kills before each file that is written or moved, and reads what is there then."""
        before = read_study(small)
        StudyFolder(small).write_study(load_study(study_of(seeds=1)))
        after = make_tables(shutil.copytree(small, small.with_name("other")))
        usual_replace, usual_move = table_files.replace_file, Path.replace
        left, judged, usual_judged = [0], {}, collect._judged

        def judged_once(study, *rest):  # the same tables of the same runs, fifty times
            if len(study.seeds) not in judged:
                judged[len(study.seeds)] = usual_judged(study, *rest)
            return dict(judged[len(study.seeds)])

        monkeypatch.setattr(collect, "_judged", judged_once)
        monkeypatch.setattr(os, "fsync", lambda _: None)

        def counted(act):
            def do(path, *rest):
                # Of a file that is written, its last step only counts where readers look for it.
                if "study.json" in str(path) or ("tables-" in str(path) and path.suffix != ".tmp"):
                    left[0] -= 1
                    if left[0] < 0:
                        raise KeyboardInterrupt
                return act(path, *rest)

            return do

        monkeypatch.setattr(table_files, "replace_file", counted(usual_replace))
        monkeypatch.setattr(Path, "replace", counted(usual_move))
        if not tidied:  # a process that is killed puts nothing in order
            monkeypatch.setattr(table_files.shutil, "rmtree", lambda *_, **__: None)
        n_steps, found = 0, []
        while True:
            folder = shutil.copytree(small, small.with_name(f"killed-{n_steps}"))
            left[0] = n_steps
            try:
                make_tables(folder)
            except KeyboardInterrupt:
                found.append(read_study(folder))
            else:
                break
            n_steps += 1
        assert n_steps > 20
        lengths = [len(tables.runs) for tables in found]
        assert set(lengths) == {4, 2}
        assert lengths == sorted(lengths, reverse=True)
        for tables in found:  # by the digests of their files, which reading has checked
            expected = before if len(tables.runs) == 4 else after
            assert tables.manifest["tables"] == expected.manifest["tables"]
        monkeypatch.undo()
        monkeypatch.setattr(collect, "_judged", judged_once)
        monkeypatch.setattr(os, "fsync", lambda _: None)
        for n, tables in enumerate(found):
            path = small.with_name(f"killed-{n}")
            with tables_locked(path):  # puts in order what it finds
                assert not list(path.glob(".tables-*"))
            if not tidied:  # where it was tidied, nothing has changed, and nothing is in the way
                assert read_study(path).manifest["tables"] == tables.manifest["tables"]
                assert make_tables(path).manifest["tables"] == after.manifest["tables"]

    def test_they_say_how_many_runs_are_missing(self, small):
        assert read_study(small).n_missing == 0
        path, _ = a_run_of(small)
        path.unlink()
        assert make_tables(small).n_missing == 1
        assert read_study(small).n_missing == 1

    def test_they_are_made_without_the_file_and_the_packages(self, tmp_path, monkeypatch):
        """Of the folder alone: no code is called, and no file outside of it is read."""
        (tmp_path / "elsewhere").mkdir()
        (tmp_path / "elsewhere" / "mine_for_a_while.py").write_text(
            "from botohe_moo import load_mission\n"
            "from botohe_moo.algorithms.random_trails import RandomTrails as Ants\n"
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
            (moved / f"{name}.parquet").unlink()
        after = make_tables(moved)
        assert_same(after, before)
        assert {**after.manifest, "tables": 0} == {**before.manifest, "tables": 0}

    @pytest.mark.parametrize(
        ("key", "value"),
        [
            ("missions", [{}]),
            ("missions", {"grid": None}),
            ("missions", {"label": ["q"]}),
            ("missions", {"min_survival": "x"}),
            ("missions", {"budget": 7}),
            ("missions", {"origin": {"package": None}}),
            ("missions", {"source": {}}),
            ("algorithms", {"origin": {"version": "1"}}),
            ("algorithms", [{"label": 1}]),
            ("text", "[1, 2]"),
            ("seeds", "x"),
        ],
    )
    def test_what_they_are_made_of_may_be_damaged(self, small, key, value):
        content = json.loads((small / "study.json").read_text())
        if isinstance(value, dict):
            content["kept"][key][0].update(value)
        else:
            content["kept"][key] = value
        (small / "study.json").write_text(json.dumps(content))
        with pytest.raises(StudyError, match=r"study\.json: cannot be read"):
            make_tables(small)

    def test_damaged_runs_are_named_when_they_are_made(self, small):
        path, _ = a_run_of(small)
        state = path.stat()
        data = bytearray(path.read_bytes())
        data[300] ^= 1
        path.write_bytes(data)
        os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))
        said = []
        assert len(make_tables(small, say=said.append).runs) == 3
        [line] = said
        assert line.startswith(f"{path}: damaged (")
        _, watcher = watched(study_of(), small)
        assert len(watcher.performed) == 1

    def test_so_are_changed_missions(self, small):
        [path] = (small / "missions").glob("*.json")
        content = json.loads(path.read_text())
        content["nodes"][1]["reward"] += 1
        path.write_text(json.dumps(content))
        tables = read_study(small)
        with pytest.raises(StudyError, match="not the mission that was planned for"):
            tables.plan(tables.runs["run"][0], 0)

    def test_missions_with_many_faults_are_named_in_a_line(self, small):
        [path] = (small / "missions").glob("*.json")
        content = json.loads(path.read_text())
        for arc in content["edges"]:
            arc["survival"] = 2
        path.write_text(json.dumps(content))
        with pytest.raises(StudyError, match=f"{path}: arc .*, and 11 more faults; run") as caught:
            make_tables(small)
        assert len(str(caught.value)) < 500

    @pytest.mark.parametrize(
        "content",
        [
            '{"name": "s", "missions": {}, "algorithms": {}}',
            '{"name": "s", "missions": {"toy": null}}',
            "[" * 100_000,
            "",
        ],
    )
    def test_damaged_manifests_are_named(self, small, content):
        (small / "study.json").write_text(content)
        with pytest.raises(StudyError, match=r"study\.json: cannot be read"):
            read_study(small)
        first = read_study_again(small)
        assert len(first.runs) == 4

    @pytest.mark.parametrize(
        ("key", "value"),
        [
            ("comparison", {}),
            ("comparison", {"control": None}),
            ("indicators", ["area", "beauty"]),
        ],
    )
    def test_what_readers_rely_on_is_checked(self, small, key, value):
        path = small / "study.json"
        path.write_text(json.dumps({**json.loads(path.read_text()), key: value}))
        with pytest.raises(StudyError, match=rf"study\.json: cannot be read \({key}"):
            read_study(small)

    def test_what_they_do_not_know_does_not_disturb_them(self, small):
        path = small / "study.json"
        content = json.loads(path.read_text())
        content["comparison"]["power"] = 0.8
        path.write_text(json.dumps(content))
        assert len(read_study(small).runs) == 4

    def test_folders_without_a_study(self, tmp_path):
        with pytest.raises(StudyError, match="there is no study in this folder"):
            read_study(tmp_path / "nowhere")
        (tmp_path / "study.json").write_text("[1, 2]")
        with pytest.raises(StudyError, match=r"study.json: cannot be read"):
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


def without_version(manifest):
    del manifest["kept"]["versions"]["version"]


def elsewhere(manifest):
    manifest["kept"]["missions"][0]["digest"] = "../../outside"


def seconds_as_text(manifest):
    manifest["bounds"] = {"seconds": "10"}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (without_version, "versions: .*expected versions of version, pymoo"),
        (elsewhere, r"kept.missions: expected a digest, got '../../outside'"),
        (seconds_as_text, "bounds.seconds: Input should be a valid number"),
    ],
)
def test_what_a_changed_manifest_lacks_is_named(small, change, said):
    path = small / "study.json"
    manifest = json.loads(path.read_text())
    change(manifest)
    path.write_text(json.dumps(manifest))
    with pytest.raises(StudyError, match=rf"study\.json: cannot be read \({said}"):
        restore_study(small)


def a_run_of(folder):
    digest = read_study(folder).runs["run"][1]
    return folder / "runs" / f"{digest}.npz", digest


def as_npy(array):
    if isinstance(array, bytes):
        return array
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def as_header(content):
    text = content if isinstance(content, str) else json.dumps(content)
    return np.frombuffer(text.encode(), np.uint8)


def changed_header(**changes):
    return lambda header: as_header({**json.loads(header.tobytes()), **changes})


def npy_header(shape, descr, end=""):
    text = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}}}{end}".encode()
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


class TestAgain:
    def test_nothing_is_performed_twice(self, small):
        first = read_study(small)
        second, watcher = watched(study_of(), small)
        assert watcher.performed == []
        assert_same(first, second)
        # Times, too, for nothing ran.
        pd.testing.assert_frame_equal(first.runs, second.runs)

    def test_and_nothing_is_made_anew(self, finished, monkeypatch):
        """No file of a run is opened, no table is written, where nothing has changed."""
        run_study(study_of(), finished)
        before = {path: path.stat().st_mtime_ns for path in finished.glob("*.*")}
        monkeypatch.setattr(StudyFolder, "load", forbidden)
        monkeypatch.setattr(StudyFolder, "_read", forbidden)
        monkeypatch.setattr(collect, "collect_tables", forbidden)
        tables, watcher = watched(study_of(), finished)
        assert watcher.performed == []
        assert len(tables.runs) == 4
        made = {path: path.stat().st_mtime_ns for path in finished.glob("*.*")}
        assert made.keys() == before.keys()
        assert {path.name for path in made if made[path] != before[path]} <= {"study.yaml"}

    def test_another_comment_makes_nothing_anew(self, small, tmp_path, monkeypatch):
        run_study(study_of(), small)
        path = tmp_path / "study.yaml"
        path.write_text(f"# A comment\n{json.dumps(study_of())}")
        monkeypatch.setattr(collect, "collect_tables", forbidden)
        run_study(path, small)
        assert "# A comment" in (small / "study.yaml").read_text()
        assert restore_study(small).text.startswith("# A comment")
        run_study(study_of(), small)

    def test_nor_do_failures_of_other_runs(self, small, monkeypatch):
        run_study(study_of(), small)
        (small / "failures" / f"{'0' * 16}.json").write_text("{}")
        monkeypatch.setattr(collect, "collect_tables", forbidden)
        run_study(study_of(), small)

    def test_a_runner_leaves_tables_alone_that_are_being_made(self, small):
        """What is half-written there belongs to somebody who is at work."""
        begun, removed = small / f".{'0' * 16}.tmp", []
        begun.write_text("x")

        def start():
            with StudyFolder(small).locked(load_study(study_of())):
                removed.append(not begun.exists())

        with tables_locked(small):
            runner = threading.Thread(target=start)
            runner.start()
            time.sleep(0.3)
            assert begun.exists()
        runner.join()
        assert removed == [True]

    def test_files_that_were_touched_are_read_and_tables_stay(self, small, monkeypatch):
        run_study(study_of(), small)
        for path in (small / "runs").glob("*.npz"):
            path.touch()
        read, usual = [], StudyFolder._read
        monkeypatch.setattr(
            StudyFolder, "_read", lambda store, run: read.append(run) or usual(store, run)
        )
        monkeypatch.setattr(collect, "collect_tables", forbidden)
        run_study(study_of(), small)
        assert len(read) == 4
        run_study(study_of(), small)
        assert len(read) == 4

    @pytest.mark.parametrize(
        "change",
        [
            lambda folder, _: a_run_of(folder)[0].unlink(),
            lambda folder, _: (folder / "runs.csv").unlink(),
            lambda folder, _: (folder / "trace.parquet").write_bytes(b"x"),
            lambda folder, _: (folder / ".index.json").write_bytes(b"x"),
            lambda folder, _: (folder / "study.json").write_bytes(b"x"),
            lambda _, patch: patch.setattr(planning, "_code_digest", lambda: "another"),
        ],
        ids=["run", "csv", "table", "index", "manifest", "code"],
    )
    def test_what_has_changed_is_made_anew(self, small, monkeypatch, change):
        before = run_study(study_of(), small)
        change(small, monkeypatch)
        assert_same(run_study(study_of(), small), before)
        assert (small / "runs.csv").exists()
        assert_same(read_study(small), before)

    def test_changed_comparisons_make_new_tables_of_old_runs(self, small):
        run_study(study_of(), small)
        tables, watcher = watched(study_of(comparison={"control": "greedy"}), small)
        assert watcher.performed == []
        assert set(tables.comparisons["other"]) == {"greedy"}

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
        _, watcher = watched(study_of(), small)
        assert watcher.performed == []

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
        tables, watcher = watched(source, folder)
        assert set(tables.runs["status"]) == {"failed"}
        _, watcher = watched(source, folder)
        assert [status for *_, status in watcher.performed] == ["failed"]
        assert len(watcher.plan.failed) == 1
        stone.unlink()
        tables, watcher = watched(source, folder)
        assert [status for *_, status in watcher.performed] == ["done"]
        assert tables.runs["error"].isna().all()
        _, watcher = watched(source, folder)
        assert watcher.performed == []
        assert not watcher.plan.failed

    @pytest.mark.parametrize(
        "damage",
        [
            lambda data: data[: len(data) // 2],
            lambda data: b"",
            lambda data: b"PK" + data[2:-30],
            lambda data: data[:200] + bytes([data[200] ^ 1]) + data[201:],
            lambda data: data[:-200] + bytes(200),
            lambda data: b"\x80\x04K\x01.",  # a pickle
        ],
        ids=["half", "empty", "cut", "a bit", "zeros", "pickle"],
    )
    def test_damaged_files_are_named(self, small, damage):
        path, first = a_run_of(small)
        path.write_bytes(damage(path.read_bytes()))
        plan = plan_study(load_study(study_of()), StudyFolder(small))
        assert [run.digest for run in plan.missing] == [first]
        [said] = plan.damaged.values()
        assert said.startswith(f"{path}: damaged (")

    @pytest.mark.parametrize(
        ("name", "change", "said"),
        [
            ("header", lambda _: as_header([1]), "expected a header"),
            ("header", lambda _: as_header("[" * 100_000), "nested too deeply"),
            ("header", lambda _: None, "Expecting value"),
            ("header", changed_header(status="well"), "status: Input should be 'done'"),
            ("header", changed_header(seconds=float("inf")), "seconds: Input should be"),
            ("header", changed_header(environment={"n_cpus": 2}), "environment: .*environment to"),
            ("header", changed_header(environment=[1]), "environment: Input should be"),
            ("points", lambda _: b"\x80\x04K\x01.", "not an npz file of arrays"),
            ("points", lambda _: npy_header("(2, 2)", "'|O'"), "Object arrays cannot be loaded"),
            ("points", lambda _: npy_header("(2, 2)", "'<f8'", '\\\n"""'), "TokenError"),
            ("points", lambda points: points[0, 0], "expected an array points of type float64"),
            ("points", lambda points: points + np.nan, "possible on its mission"),
            ("points", lambda points: points + 1e9, "possible on its mission"),
            ("points", lambda points: points[:, :1], "possible on its mission"),
            ("points", lambda points: points[1:], "records and points do not fit"),
            ("seconds", lambda seconds: seconds.astype("M8[s]"), "an array seconds of type float"),
            ("seconds", lambda seconds: seconds * np.inf, "finite numbers >= 0"),
            ("evaluations", lambda evaluations: -evaluations, "finite numbers >= 0"),
            ("evaluations", lambda evaluations: evaluations[1:], "as many of each"),
            ("evaluations", lambda _: None, "expected an array evaluations"),
            ("plan_nodes", lambda nodes: nodes + np.int32(99), "expected nodes of its mission"),
            ("plan_offsets", lambda offsets: offsets * 0, "offsets that ascend"),
            ("plan_objectives", lambda objectives: objectives[1:], "expected objectives of"),
        ],
    )
    @pytest.mark.filterwarnings("error")
    def test_forged_files_are_named(self, small, name, change, said):
        """Each would have ended in a traceback where the run is read, or where tables are made."""
        path, first = a_run_of(small)
        with np.load(path) as file:
            arrays = dict(file)
        changed = change(arrays.pop(name))
        with zipfile.ZipFile(path, "w") as file:
            for member, array in arrays.items():
                file.writestr(f"{member}.npy", as_npy(array))
            if changed is not None:
                file.writestr(f"{name}.npy", as_npy(changed))
        plan = plan_study(load_study(study_of()), StudyFolder(small))
        assert plan.damaged.keys() == {first}
        assert re.match(rf"{path}: damaged \(.*{said}", plan.damaged[first])
        assert len(plan.damaged[first].splitlines()) == 1

    def test_gigabytes_of_zeros_in_a_small_file_are_not_read(self, small):
        path, first = a_run_of(small)
        with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as file:
            file.writestr("zeros.npy", bytes(2**20))
        data = bytearray(path.read_bytes())
        size = data.rindex(b"PK\x01\x02") + 24  # where it is, of the member when it is unpacked
        data[size : size + 4] = (2**31).to_bytes(4, "little")
        path.write_bytes(data)
        plan = plan_study(load_study(study_of()), StudyFolder(small))
        assert "expected arrays of at most 536,870,912 bytes" in plan.damaged[first]

    def test_failures_that_are_none_are_not_there(self, small):
        [run, *_] = load_study(study_of()).runs()
        path = small / "failures" / f"{run.digest}.json"
        ended = {"status": "failed", "stopped_by": "error", "evaluations": 0, "seconds": 0.5}
        ended["recording_seconds"] = 0
        path.write_text(json.dumps(ended))
        assert StudyFolder(small).failure(run.digest).status == "failed"
        for wrong in ({"status": 5}, {"environment": {"x": 1}}, {"evaluations": -1}):
            path.write_text(json.dumps({**ended, **wrong}))
            assert StudyFolder(small).failure(run.digest) is None

    def test_another_runs_file_is_damage(self, small):
        path, first = a_run_of(small)
        other = next(file for file in path.parent.glob("*.npz") if file != path)
        path.write_bytes(other.read_bytes())
        assert list(plan_study(load_study(study_of()), StudyFolder(small)).damaged) == [first]

    def test_files_from_before_it_was_noted_do_not_say_when_they_began(self, small):
        path, first = a_run_of(small)
        [run] = [run for run in load_study(study_of()).runs() if run.digest == first]
        now = StudyFolder(small).load(run)
        assert now.began is not None
        with np.load(path) as file:
            arrays = dict(file)
        header = json.loads(arrays["header"].tobytes())
        assert header.pop("began") == now.began
        arrays["header"] = np.frombuffer(json.dumps(header).encode(), np.uint8)
        np.savez(path, **arrays)
        before = StudyFolder(small).load(run)
        assert before.began is None
        assert before.evaluations == now.evaluations

    def test_damaged_runs_are_performed_again(self, small):
        before = read_study(small)
        path, first = a_run_of(small)
        path.write_bytes(path.read_bytes()[:-100])
        after, watcher = watched(study_of(), small)
        assert [(digest, len(watcher.performed)) for digest in watcher.plan.damaged] == [(first, 1)]
        assert_same(before, after)

    def test_flags_that_zip_files_have_are_damage_too(self, small):
        path, first = a_run_of(small)
        data = bytearray(path.read_bytes())
        data[data.rindex(b"PK\x01\x02") + 8] |= 1  # "encrypted", in the directory
        path.write_bytes(bytes(data))
        assert list(plan_study(load_study(study_of()), StudyFolder(small)).damaged) == [first]

    def test_a_damaged_run_that_fails_when_performed_again_is_a_failed_run(self, tmp_path):
        stone = tmp_path / "stone"
        entry = {"algorithm": f"{MADE}:RaisingOnce", "parameters": {"path": str(stone)}}
        source = study_of(algorithms={"x": entry, "random": "random"}, seeds=1)
        before = run_study(source, tmp_path / "study")
        [path] = (tmp_path / "study" / "runs").glob(f"{before.runs['run'][0]}.npz")
        path.write_bytes(b"x")
        stone.touch()
        after = run_study(source, tmp_path / "study")
        assert after.runs["status"].tolist() == ["failed", "done"]
        assert after.summary["n"].tolist() == [1, 1]

    def test_every_bit_of_a_file_counts_or_changes_nothing(self, tmp_path):
        source = study_of(seeds=1, algorithms=["random"])
        first = run_study(source, tmp_path)
        study = load_study(source)
        [run] = study.runs()
        store = StudyFolder(tmp_path)
        path = tmp_path / "runs" / f"{run.digest}.npz"
        whole = path.read_bytes()
        good = store.load(run)
        rng = np.random.default_rng(0)
        n_noticed = 0
        for position in rng.integers(len(whole), size=150):
            data = bytearray(whole)
            data[position] ^= 1 << int(rng.integers(8))
            path.write_bytes(bytes(data))
            if plan_study(study, StudyFolder(tmp_path)).damaged:
                n_noticed += 1
                continue
            found = store.load(run)
            assert found.evaluations == good.evaluations
            assert [r.objectives.tolist() for r in found.records] == [
                r.objectives.tolist() for r in good.records
            ]
        assert n_noticed > 100
        assert len(first.runs) == 1


class TestPlan:
    def test_it_tells_what_is_there(self, small, tmp_path):
        study = load_study(study_of())
        assert len(plan_study(study, StudyFolder(tmp_path / "none")).missing) == 4
        assert not (tmp_path / "none").exists()
        plan = plan_study(load_study(study_of(seeds=[2, 3])), StudyFolder(small))
        assert [run.seed for run in plan.missing] == [3, 3]
        runs = read_study(small).runs.set_index("run")["seconds"]
        assert len(plan.finished) == 2
        for digest, entry in plan.finished.items():
            assert entry.seconds == runs[digest]


class TestFolder:
    def test_another_study_is_not_overwritten(self, small):
        with pytest.raises(StudyError, match="holds the study 'trial', not 'other'"):
            run_study(study_of(name="other"), small)

    def test_other_peoples_folders_are_left_alone(self, tmp_path):
        (tmp_path / "runs.csv").write_text("mine")
        (tmp_path / ".important.tmp").write_text("mine")
        with pytest.raises(StudyError, match="expected an empty folder or that of a study"):
            run_study(study_of(), tmp_path)
        assert sorted(path.name for path in tmp_path.iterdir()) == [".important.tmp", "runs.csv"]

    def test_a_folder_is_known_as_soon_as_anything_is_made_in_it(self, tmp_path, monkeypatch):
        made = []
        usual = Path.mkdir

        def mkdir(path, *args, **kwargs):
            if path.name == "runs":  # as if killed here
                made.append(path)
                raise KeyboardInterrupt
            usual(path, *args, **kwargs)

        monkeypatch.setattr(Path, "mkdir", mkdir)
        with pytest.raises(KeyboardInterrupt):
            run_study(study_of(), tmp_path / "out")
        monkeypatch.undo()
        assert made
        assert len(run_study(study_of(), tmp_path / "out").runs) == 4

    def test_a_file_is_no_folder(self, tmp_path):
        (tmp_path / "file").touch()
        with pytest.raises(StudyError, match="expected a folder to write to"):
            run_study(study_of(), tmp_path / "file")

    def test_a_second_runner_stops(self, small):
        with (
            StudyFolder(small).locked(load_study(study_of())),
            pytest.raises(StudyError, match=r"another runner is at work in this folder \(process"),
        ):
            run_study(study_of(), small)
        run_study(study_of(), small)

    def test_a_full_disk_loses_nothing(self, tmp_path, monkeypatch):
        usual, n = run_folder.replace_file, [0]

        def replace_file(path, data):
            n[0] += path.suffix == ".npz"
            if n[0] == 3:
                raise OSError(errno.ENOSPC, "No space left on device", str(path))
            usual(path, data)

        monkeypatch.setattr(run_folder, "replace_file", replace_file)
        with pytest.raises(StudyError, match=r"the disk is full.*are kept; run the study again"):
            run_study(study_of(), tmp_path)
        monkeypatch.undo()
        _, watcher = watched(study_of(), tmp_path)
        assert len(watcher.performed) == 2

    def test_leftovers_of_a_killed_runner_are_removed(self, small):
        leftover = small / "runs" / ".0123456789abcdef.tmp"
        leftover.write_bytes(b"half")
        other = small / "runs" / ".mine.tmp"
        other.write_bytes(b"whole")
        run_study(study_of(), small)
        assert not leftover.exists()
        assert other.exists()

    def test_the_study_is_kept_with_its_results(self, tmp_path):
        path = tmp_path / "mine.yaml"
        path.write_text("# mine\n" + json.dumps(study_of()))
        tables = run_study(path, tmp_path / "out")
        assert (tmp_path / "out" / "study.yaml").read_text() == path.read_text()
        assert tables.mission("toy") == load_mission("toy")
        assert len(load_study(tmp_path / "out" / "study.yaml").runs()) == 4


def test_workers_are_checked(tmp_path):
    with pytest.raises(ValueError, match="Expected workers >= 1, got 0"):
        run_study(study_of(), tmp_path, workers=0)
