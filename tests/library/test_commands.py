"""The commands ``botohe library ...``."""

import json
from datetime import date
from types import SimpleNamespace

import pandas as pd
import pytest
from typer.testing import CliRunner

from botohe_moo import solve
from botohe_moo.cli import app
from botohe_moo.library import Finder, best_known
from botohe_moo.study import run_study, runner

SMALL = "town-16"


@pytest.fixture
def botohe(tmp_path):
    """Run a command in this process, on a library of its own."""

    def botohe(*args, status=0):
        ended = CliRunner().invoke(app, ["library", *map(str, args)])
        assert ended.exit_code == status, ended.output
        return ended.output

    (tmp_path / "library").mkdir()
    return botohe


@pytest.fixture
def library(tmp_path):
    return ("--library", tmp_path / "library")


@pytest.fixture
def solved(tmp_path):
    """The folder of a solution."""
    folder = tmp_path / "solved"
    folder.mkdir()
    solve(f"library:{SMALL}", evaluations=2_000, seed=1).write(folder)
    return folder


@pytest.fixture
def dated(monkeypatch):
    """Say which day it is."""

    def dated(day):
        today = SimpleNamespace(today=lambda: date.fromisoformat(day))
        monkeypatch.setattr(runner.dt, "date", today)

    return dated


def test_solutions_are_added(botohe, library, solved, dated):
    dated("2026-11-27")
    said = botohe("add", solved, "--by", "Ada", *library)
    front = best_known(SMALL, folder=library[1])
    told = f"{SMALL}: {len(front.finders)} new plans, area {front.area:.6f}; wrote {library[1]}"
    assert said.startswith(told)
    method = "pareto-local-search (n_islands=8), 2,000 evaluations, seed 1"
    assert set(front.finders) == {Finder("2026-11-27", "Ada", method)}
    assert "0 new plans, area" in botohe("add", solved, "--by", "Bob", *library)
    assert best_known(SMALL, folder=library[1]).to_bytes() == front.to_bytes()
    dated("2026-11-26")
    earlier = botohe("add", solved, "--by", "Bob", *library)
    assert "0 new plans, area" in earlier
    assert "; wrote " in earlier  # since the earliest stays
    assert {finder.by for finder in best_known(SMALL, folder=library[1]).finders} == {"Bob"}


@pytest.mark.slow
def test_studies_are_added(botohe, library, tmp_path):
    study = {
        "name": "trial",
        "missions": {"mine": f"library:{SMALL}", "toy": "toy"},
        "algorithms": {"search": {"algorithm": "nsga2", "parameters": {"pop_size": 20}}},
        "budget": {"evaluations": 100},
        "seeds": 2,
    }
    run_study(study, tmp_path / "trial")
    botohe("add", tmp_path / "trial", "--by", "Ada", *library)
    methods = {finder.method for finder in best_known(SMALL, folder=library[1]).finders}
    assert methods == {f"nsga2 (pop_size=20), 100 evaluations, seed {seed}" for seed in (1, 2)}


@pytest.mark.slow
def test_changed_plans_of_a_study_are_refused(botohe, library, tmp_path):
    study = {
        "name": "trial",
        "missions": {"mine": f"library:{SMALL}"},
        "algorithms": ["greedy"],
        "budget": {"evaluations": 20},
        "seeds": 1,
    }
    run_study(study, tmp_path / "trial")
    path = tmp_path / "trial" / "plans.csv.gz"
    table = pd.read_csv(path, dtype=str)
    table.loc[0, "trails"] = "[[0, 5, 0], [0]]"
    table.to_csv(path, index=False)
    said = botohe("add", tmp_path / "trial", "--by", "Ada", *library, status=2)
    assert f"{path}: cannot be read (it was changed" in said
    assert list(library[1].iterdir()) == []


def test_plans_of_another_mission_are_refused(botohe, library, tmp_path):
    folder = tmp_path / "toy"
    folder.mkdir()
    solve("toy", "greedy", evaluations=100).write(folder)
    said = botohe("add", folder, "--by", "Ada", *library, status=2)
    assert "expected plans of a mission of the library, found none." in said
    assert list(library[1].iterdir()) == []


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda plan: plan["trails"].__setitem__(0, [0, 5, 0]), "Plan 3"),
        (lambda plan: plan.update(reward=99.0), "Plan 3: expected the objectives"),
    ],
)
def test_an_invalid_plan_is_named(botohe, library, solved, change, fault):
    content = json.loads((solved / "plans.json").read_bytes())
    change(content["plans"][3])
    (solved / "plans.json").write_text(json.dumps(content))
    assert fault in botohe("add", solved, "--by", "Ada", *library, status=2)
    assert list(library[1].iterdir()) == []


@pytest.mark.parametrize(
    ("options", "fault"),
    [
        (("--by", ""), "Expected a line that says who"),
    ],
)
def test_bad_options_are_named(botohe, library, solved, options, fault):
    assert fault in botohe("add", solved, *options, *library, status=2)


def test_a_folder_without_plans_is_named(botohe, library, tmp_path):
    assert str(tmp_path) in botohe("add", tmp_path, "--by", "Ada", *library, status=2)


def test_missions_are_listed_and_checked():
    runner = CliRunner()
    listed = runner.invoke(app, ["library", "list", "town"]).output
    assert [line.split()[0] for line in listed.splitlines()[1:4]] == [
        "town-16",
        "town-64",
        "town-196",
    ]
    checked = runner.invoke(app, ["library", "check", f"library:{SMALL}"])
    assert checked.exit_code == 0
    assert f"{SMALL}: right" in checked.output
    refused = runner.invoke(app, ["library", "check", "vilage"])
    assert refused.exit_code == 2
    assert "Expected a mission of the library among" in refused.output


def test_what_is_wrong_is_named_with_status_1(botohe, library, solved):
    botohe("add", solved, "--by", "Ada", *library)
    path = library[1] / f"{SMALL}.front.json"
    path.write_text(path.read_text().replace("1.66067138744", "1.76067138744"))
    assert "expected the objectives" in botohe("check", SMALL, *library, status=1)
