"""Results of several machines become one study."""

import dataclasses
import shutil

import pandas as pd
import pytest
from typer.testing import CliRunner

from botohe_moo.cli.app import app
from botohe_moo.study import StudyError, load_study, merge_studies, read_study, run_study
from botohe_moo.study.folder import StudyFolder

pytestmark = pytest.mark.usefixtures("in_process")

TIMES = ["seconds", "recording_seconds", "began", "environment"]


def part(seeds, **keys):
    return {
        "name": "shared",
        "missions": ["toy"],
        "algorithms": ["random", "greedy"],
        "budget": {"evaluations": 60},
        "seeds": list(seeds),
        **keys,
    }


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """Two machines' folders, whose seeds overlap, and the folder of one that did all."""
    folder = tmp_path_factory.mktemp("parts")
    run_study(part([2, 1]), folder / "one")
    run_study(part([2, 3]), folder / "two")
    run_study(part([1, 2, 3]), folder / "whole")
    return folder


@pytest.fixture
def copies(parts, tmp_path):
    for name in ("one", "two"):
        shutil.copytree(parts / name, tmp_path / name)
    return tmp_path


def test_two_parts_are_the_study_that_one_machine_did(parts, tmp_path):
    merged = merge_studies([parts / "one", parts / "two"], tmp_path / "all")
    whole = read_study(parts / "whole")
    for name in ("runs", "indicators", "references", "comparisons", "plans", "fronts"):
        ours, theirs = getattr(merged, name), getattr(whole, name)
        kept = [column for column in theirs.columns if column not in TIMES]
        pd.testing.assert_frame_equal(ours[kept], theirs[kept])
    assert merged.missing["missing"].sum() == 0
    study = load_study(tmp_path / "all" / "study.yaml")
    assert {run.digest for run in study.runs()} == set(whole.runs["run"])


def test_one_of_the_folders_can_take_the_others(copies):
    before = read_study(copies / "one").runs.set_index("run")["seconds"]
    merged = merge_studies([copies / "two", copies / "one"], copies / "one")
    assert len(merged.runs) == 6
    after = merged.runs.set_index("run")["seconds"]
    assert after[before.index].equals(before)  # its own runs stay


def test_parts_of_the_same_seeds_that_were_stopped_are_one(copies):
    shutil.rmtree(copies / "two")
    shutil.copytree(copies / "one", copies / "two")
    first, second, *_ = sorted((copies / "one" / "runs").iterdir())
    first.unlink()
    (copies / "two" / "runs" / second.name).unlink()
    merged = merge_studies([copies / "one", copies / "two"], copies / "all")
    assert (len(merged.runs), merged.missing["missing"].sum()) == (4, 0)


@pytest.mark.parametrize(
    "other",
    [
        {"name": "another", "title": "Other"},
        {"missions": {"toy": {"mission": "toy", "robots": 1}}},
    ],
)
def test_another_study_is_refused(parts, tmp_path, other):
    run_study({**part([4]), **other}, tmp_path / "other")
    for folders, out in (
        ([parts / "one", tmp_path / "other"], tmp_path / "all"),
        ([parts / "one", parts / "two"], tmp_path / "other"),
    ):
        with pytest.raises(StudyError) as caught:
            merge_studies(folders, out)
        assert str(caught.value) == (
            f"{tmp_path / 'other'}: expected the study of {parts / 'one'} but for its seeds."
        )
    assert not (tmp_path / "all").exists()
    assert len(read_study(tmp_path / "other").runs) == 2


def test_files_of_one_name_that_differ_are_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, reward in (("one", 5), ("two", 6)):
        site = f"n 3\nm 2\ntmax 10\n0 0 0\n1 0 {reward}\n0 1 5\n"
        (tmp_path / "site.txt").write_text(site)
        run_study(part([1], missions={"site": "site.txt"}), tmp_path / name)
    with pytest.raises(StudyError, match=r"expected the study of .*one but for its seeds"):
        merge_studies([tmp_path / "one", tmp_path / "two"], tmp_path / "all")


def test_failures_come_along_where_nobody_succeeded(copies):
    store, study = StudyFolder(copies / "one"), load_study(part([1, 2]))
    failed = {}
    for run in study.runs()[:2]:
        outcome = dataclasses.replace(store.load(run), status="failed", error="it broke")
        store.save(run, outcome)
        (copies / "one" / "runs" / f"{run.digest}.npz").unlink()
        failed[run.seed] = run.digest
    merged = merge_studies([copies / "one", copies / "two"], copies / "all")
    status = merged.runs.set_index("run")["status"]
    assert status[failed[1]] == "failed"
    assert status[failed[2]] == "done"  # on the other machine


def test_a_damaged_file_is_named(copies):
    path = next((copies / "two" / "runs").glob("*.npz"))
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(StudyError, match=rf"{path.name}: damaged .*; remove the file"):
        merge_studies([copies / "two", copies / "one"], copies / "all")


def test_folders_without_a_study(parts, tmp_path):
    with pytest.raises(StudyError, match="there is no study in this folder"):
        merge_studies([parts / "one", tmp_path / "nothing"], tmp_path / "all")


def test_from_the_command_line(parts, tmp_path):
    given = [str(parts / "one"), str(parts / "two"), "--out", str(tmp_path / "all")]
    done = CliRunner().invoke(app, ["study", "merge", *given])
    assert done.exit_code == 0, done.output
    assert "6 runs merged" in done.output


def test_nothing_to_merge_is_refused():
    with pytest.raises(StudyError, match="Expected folders of a study, got none"):
        merge_studies([])
