"""Results of several machines become one study."""

import dataclasses
import os
import shutil

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from botohe_moo.cli.app import app
from botohe_moo.mission import save_mission
from botohe_moo.study import StudyError, load_study, merge_studies, read_study, run_study
from botohe_moo.study.file import union
from botohe_moo.study.store.folder import StudyFolder

pytestmark = pytest.mark.usefixtures("in_process")

TIMES = ["seconds", "recording_seconds", "began", "environment"]
BUDGET = {"evaluations": 60}


def part(seeds, *, missions=("toy",), algorithms=("random", "greedy"), **keys):
    return {
        "name": "shared",
        "missions": missions if isinstance(missions, dict) else list(missions),
        "algorithms": algorithms if isinstance(algorithms, dict) else list(algorithms),
        "budget": BUDGET,
        "seeds": list(seeds),
        **keys,
    }


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """Two machines' folders, whose seeds overlap, and the folder of one that did all."""
    folder = tmp_path_factory.mktemp("parts")
    run_study(part([1, 2]), folder / "one")
    run_study(part([2, 3]), folder / "two")
    run_study(part([1, 2, 3]), folder / "whole")
    return folder


@pytest.fixture
def copies(parts, tmp_path):
    for name in ("one", "two"):
        shutil.copytree(parts / name, tmp_path / name)
    return tmp_path


def change(folder, changed, *, seed=2):
    """Write a run again, as ``changed`` makes its outcome."""
    store, study = StudyFolder(folder), load_study(part([1, 2]))
    run = next(r for r in study.runs() if r.seed == seed and r.algorithm.label == "random")
    store.save(run, changed(store.load(run)))
    return run


def test_two_parts_are_the_study_that_one_machine_did(parts, tmp_path):
    merged = merge_studies([parts / "one", parts / "two"], tmp_path / "all")
    whole = read_study(parts / "whole")
    for name in ("runs", "indicators", "references", "comparisons", "plans", "fronts"):
        ours, theirs = getattr(merged, name), getattr(whole, name)
        kept = [column for column in theirs.columns if column not in TIMES]
        pd.testing.assert_frame_equal(ours[kept], theirs[kept])
    assert merged.n_missing == 0


def test_it_goes_on_as_a_study(parts, tmp_path):
    merge_studies([parts / "one", parts / "two"], tmp_path / "all")
    study = load_study(tmp_path / "all" / "study.yaml", out=tmp_path / "all")
    assert study.seeds == (1, 2, 3)
    runs = {run.digest for run in study.runs()}
    assert runs == set(read_study(parts / "whole").runs["run"])


def test_one_of_the_folders_can_take_the_others(copies):
    before = read_study(copies / "one").runs.set_index("run")["seconds"]
    merged = merge_studies([copies / "one", copies / "two"], copies / "one")
    assert len(merged.runs) == 6
    after = merged.runs.set_index("run")["seconds"]
    assert after[before.index].equals(before)  # its own runs stay


def test_its_own_runs_stay_whatever_comes_first(tmp_path):
    """Runs that end by the clock differ between machines."""
    clock = {"missions": ["toy"], "budget": {"seconds": 0.05}, "algorithms": ["random"]}
    for name in ("one", "two"):
        run_study({**part([1]), **clock}, tmp_path / name)
    before = read_study(tmp_path / "two").runs
    for order in (["one", "two"], ["two", "one"]):
        merged = merge_studies([tmp_path / name for name in order], tmp_path / "two")
        pd.testing.assert_frame_equal(merged.runs, before)


def test_missions_algorithms_and_grids_add_up(parts, tmp_path):
    hills = {"hills": {"mission": "random", "parameters": {"nodes": 6}, "grid": {"seed": [1, 2]}}}
    other = part([1], missions=hills, algorithms=["random"])
    run_study(other, tmp_path / "hills")
    merged = merge_studies([parts / "one", tmp_path / "hills"], tmp_path / "all")
    assert merged.mission_labels == ["toy", "hills (seed=1)", "hills (seed=2)"]
    assert merged.n_missing == 3 * 2 * 2 - 6
    assert merged.manifest["missions"]["hills (seed=1)"]["family"] == "hills"
    study = load_study(tmp_path / "all" / "study.yaml", out=tmp_path / "all")
    assert [mission.label for mission in study.missions] == merged.mission_labels


def test_values_of_a_grid_can_be_shared_out(tmp_path):
    for seed in (1, 2):
        hills = {
            "hills": {"mission": "random", "parameters": {"nodes": 6}, "grid": {"seed": [seed]}}
        }
        run_study(part([1], missions=hills, algorithms=["random"]), tmp_path / str(seed))
    merged = merge_studies([tmp_path / "1", tmp_path / "2"], tmp_path / "all")
    assert len(merged.runs) == 2
    study = load_study(tmp_path / "all" / "study.yaml", out=tmp_path / "all")
    assert {run.digest for run in study.runs()} == set(merged.runs["run"])


def test_missions_of_files_come_along(tmp_path):
    """What a file was read with is in the mission that is kept; its study file has to say so."""
    site = "n 4\nm 2\ntmax 10\n0 0 0\n1 0 5\n0 1 5\n3 3 0\n"
    for name in ("one", "two"):
        (tmp_path / f"{name}.txt").write_text(site)
        hills = {"mission": str(tmp_path / f"{name}.txt"), "grid": {"scale": [5, 9]}}
        run_study(part([1, 2] if name == "one" else [2, 3], missions={"s": hills}), tmp_path / name)
        (tmp_path / f"{name}.txt").unlink()
    merged = merge_studies([tmp_path / "one", tmp_path / "two"], tmp_path / "all")
    study = load_study(tmp_path / "all" / "study.yaml", out=tmp_path / "all")
    assert {run.digest for run in study.runs()} == set(merged.runs["run"])
    assert (
        [m.label for m in study.missions] == merged.mission_labels == ["s (scale=5)", "s (scale=9)"]
    )


@pytest.mark.parametrize("limit", [0, 4.5, "unlimited", None])
def test_travel_budgets_come_along(tmp_path, limit):
    site = tmp_path / "site.txt"
    site.write_text("n 2\nm 1\ntmax 10\n0 0 0\n1 0 5\n")
    hills = {"mission": str(site), "max_length": limit}
    floors = [{**hills, "min_survival": floor} for floor in (0.0, 0.1)]
    studies = [load_study(part([1], missions={f"m{i}": m})) for i, m in enumerate(floors)]
    (tmp_path / "missions").mkdir()
    united = union.unite_studies([tmp_path, tmp_path], studies)
    for mission in united.missions:
        save_mission(mission.mission, tmp_path / "missions" / f"{mission.digest}.json")
    (tmp_path / "study.yaml").write_text(united.text)
    again = load_study(tmp_path / "study.yaml")
    digests = [
        {run.digest for study in group for run in study.runs()} for group in (studies, [again])
    ]
    assert digests[0] == digests[1]


def test_another_study_of_the_name_keeps_its_folder(parts, tmp_path):
    run_study(part([5]), tmp_path / "other")
    before = {path: path.read_bytes() for path in (tmp_path / "other").glob("*.*")}
    with pytest.raises(StudyError, match="holds a study with 2 runs that are not in those to be"):
        merge_studies([parts / "one", parts / "two"], tmp_path / "other")
    assert {path: path.read_bytes() for path in (tmp_path / "other").glob("*.*")} == before


def test_devices_and_pipes_are_not_read(copies):
    """They may have no end."""
    manifest = copies / "two" / "study.json"
    manifest.unlink()
    manifest.symlink_to("/dev/zero")
    with pytest.raises(StudyError, match=r"two/study\.json: cannot be read .*a device or a pipe"):
        merge_studies([copies / "one", copies / "two"], copies / "all")
    run = next((copies / "one" / "runs").glob("*.npz"))
    run.unlink()
    os.mkfifo(run)
    with pytest.raises(StudyError, match=f"{run.name}: damaged .*a device or a pipe"):
        merge_studies([copies / "one", copies / "one"], copies / "all")


def test_a_link_to_itself_is_no_folder_to_write_to(copies):
    loop = copies / "loop"
    loop.symlink_to(loop)
    with pytest.raises(StudyError, match="loop: "):
        merge_studies([copies / "one", copies / "two"], loop)


def test_what_no_study_file_can_hold_is_refused(monkeypatch, parts, tmp_path):
    monkeypatch.setattr(union, "MAX_RUNS", 5)
    with pytest.raises(StudyError, match="too large for one: expected at most 5 runs, found 6"):
        merge_studies([parts / "one", parts / "two"], tmp_path / "all")
    assert not (tmp_path / "all").exists()


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"name": "another"}, "expected its name to be 'shared', found 'another'"),
        (
            {"missions": {"toy": {"mission": "toy", "robots": 1}}},
            "mission is '5 nodes, 12 arcs, team of 1",
        ),
        ({"budget": {"evaluations": 70}}, "budget is {'evaluations': 70"),
        (
            {"algorithms": {"random": "greedy"}},
            "algorithm 'random' is not the one",
        ),
        ({"recording": {"per_decade": 3}}, "expected its recording to be"),
        ({"missions": {"toy": {"mission": "toy", "max_length": 99}}}, "max_length is 99.0 instead"),
    ],
)
def test_what_differs_is_no_one_study(parts, tmp_path, other, said):
    run_study({**part([4]), **other}, tmp_path / "other")
    with pytest.raises(StudyError) as caught:
        merge_studies([parts / "one", tmp_path / "other"], tmp_path / "all")
    message = str(caught.value)
    assert said in message
    assert str(tmp_path / "other") in message
    assert "\n" not in message
    assert not (tmp_path / "all").exists()


def test_another_result_of_the_same_run(copies):
    run = change(copies / "two", lambda outcome: dataclasses.replace(outcome, evaluations=59))
    with pytest.raises(StudyError, match="has another result than in") as caught:
        merge_studies([copies / "one", copies / "two"], copies / "all")
    assert run.digest in str(caught.value)
    assert not (copies / "all").exists()


def test_plans_that_do_not_bring_what_they_claim(copies):
    def other(outcome):
        *others, last = outcome.records
        plans, objectives = last.plans
        claimed = dataclasses.replace(
            last, objectives=last.objectives * 0.9, plans=(plans, objectives * 0.9)
        )
        return dataclasses.replace(outcome, records=(*others, claimed))

    change(copies / "one", other)
    with pytest.raises(StudyError, match="is claimed to bring"):
        merge_studies([copies / "one", copies / "two"], copies / "all")


def test_points_that_no_plan_brings(copies):
    """Indicators are computed from the points that are recorded."""

    def best(outcome):
        *others, last = outcome.records
        forged = dataclasses.replace(last, objectives=np.array([[9.0, 2.0]]))
        return dataclasses.replace(outcome, records=(*others, forged))

    run = change(copies / "one", best)
    with pytest.raises(StudyError, match="points of its final front are not those") as caught:
        merge_studies([copies / "one", copies / "two"], copies / "all")
    assert run.digest in str(caught.value)


def test_more_evaluations_than_the_budget(copies):
    change(copies / "one", lambda outcome: dataclasses.replace(outcome, evaluations=61))
    with pytest.raises(StudyError, match="expected at most 60 evaluations, found 61"):
        merge_studies([copies / "one", copies / "two"], copies / "all")


def test_a_damaged_file_is_named(copies):
    path = next((copies / "two" / "runs").glob("*.npz"))
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(StudyError, match="damaged") as caught:
        merge_studies([copies / "one", copies / "two"], copies / "all")
    assert str(path) in str(caught.value)


def test_failures_come_along_where_nobody_succeeded(copies):
    def failed(outcome):
        return dataclasses.replace(outcome, status="failed", error="it broke", records=())

    run = change(copies / "one", failed, seed=1)
    (copies / "one" / "runs" / f"{run.digest}.npz").unlink()
    merged = merge_studies([copies / "one", copies / "two"], copies / "all")
    row = merged.runs.set_index("run").loc[run.digest]
    assert (row["status"], row["error"]) == ("failed", "it broke")


def test_a_folder_without_a_study(parts, tmp_path):
    with pytest.raises(StudyError, match="there is no study in this folder"):
        merge_studies([parts / "one", tmp_path / "nothing"], tmp_path / "all")
    with pytest.raises(StudyError, match="Expected at least two folders to merge, got 1"):
        merge_studies([parts / "one"], tmp_path / "all")


def test_from_the_command_line(parts, tmp_path):
    given = [str(parts / "one"), str(parts / "two"), "--out", str(tmp_path / "all")]
    done = CliRunner().invoke(app, ["study", "merge", *given])
    assert done.exit_code == 0, done.output
    assert "6 runs and the tables are in" in done.output
