"""The commands ``botohe library ...``."""

import json
from datetime import date
from types import SimpleNamespace

import pandas as pd
import pytest

from botohe_moo import solve
from botohe_moo.library import Finder, best_known
from botohe_moo.study import run_study, runner
from tests.commands import run_botohe

SMALL = "town-16"


def said(*args, status=0):
    """Run a command, and return all that it says."""
    ended = run_botohe("library", *args)
    assert ended.status == status, ended
    return ended.out + ended.err


@pytest.fixture
def library(tmp_path):
    """Return the option for another library folder."""
    (tmp_path / "library").mkdir()
    return ("--library", tmp_path / "library")


@pytest.fixture
def solved(tmp_path):
    """The folder of a solution."""
    (tmp_path / "solved").mkdir()
    solve(f"library:{SMALL}", evaluations=2_000, seed=1).write(tmp_path / "solved")
    return tmp_path / "solved"


def test_solutions_are_added_and_checked(library, solved, monkeypatch):
    def add(by, day):
        today = SimpleNamespace(today=lambda: date.fromisoformat(day))
        monkeypatch.setattr(runner.dt, "date", today)
        return said("add", solved, "--by", by, *library)

    told = add("Ada", "2026-11-27")
    front = best_known(SMALL, folder=library[1])
    wrote = f"{SMALL}: {len(front.finders)} new plans, area {front.area:.6f}; wrote {library[1]}"
    assert told.startswith(wrote)
    method = "pareto-local-search (n_islands=8), 2,000 evaluations, seed 1"
    assert set(front.finders) == {Finder("2026-11-27", "Ada", method)}
    told = add("Bob", "2026-11-27")
    assert ("0 new plans, area" in told, "wrote" in told) == (True, False)
    assert best_known(SMALL, folder=library[1]).to_bytes() == front.to_bytes()
    assert "; wrote " in add("Bob", "2026-11-26")  # since the earliest stays
    assert {finder.by for finder in best_known(SMALL, folder=library[1]).finders} == {"Bob"}
    path = library[1] / f"{SMALL}.front.json"
    path.write_text(path.read_text().replace("1.66067138744", "1.76067138744"))
    assert "expected the objectives" in said("check", SMALL, *library, status=1)


@pytest.mark.slow
def test_studies_are_added_unless_they_were_changed(library, tmp_path):
    study = {
        "name": "trial",
        "missions": {"mine": f"library:{SMALL}", "toy": "toy"},
        "algorithms": {"search": {"algorithm": "nsga2", "parameters": {"pop_size": 20}}},
        "budget": {"evaluations": 100},
        "seeds": 2,
    }
    run_study(study, tmp_path / "trial")
    path = tmp_path / "trial" / "plans.csv.gz"
    written = path.read_bytes()
    table = pd.read_csv(path, dtype=str)
    table.loc[0, "trails"] = "[[0, 5, 0], [0]]"
    table.to_csv(path, index=False)
    told = said("add", tmp_path / "trial", "--by", "Ada", *library, status=2)
    assert f"{path}: cannot be read (it was changed" in told
    assert list(library[1].iterdir()) == []
    path.write_bytes(written)
    said("add", tmp_path / "trial", "--by", "Ada", *library)
    methods = {finder.method for finder in best_known(SMALL, folder=library[1]).finders}
    assert methods == {f"nsga2 (pop_size=20), 100 evaluations, seed {seed}" for seed in (1, 2)}


def test_what_is_refused(library, solved, tmp_path):
    (tmp_path / "toy").mkdir()
    solve("toy", "greedy", evaluations=100).write(tmp_path / "toy")
    for folder, by, fault in (
        (solved, "", "Expected a line that says who"),
        (library[1], "Ada", str(library[1])),
        (tmp_path / "toy", "Ada", "expected plans of a mission of the library, found none."),
    ):
        assert fault in said("add", folder, "--by", by, *library, status=2)
    content = json.loads((solved / "plans.json").read_bytes())
    content["plans"][3]["reward"] = 99.0
    (solved / "plans.json").write_text(json.dumps(content))
    fault = "Plan 3: expected the objectives"
    assert fault in said("add", solved, "--by", "Ada", *library, status=2)
    assert list(library[1].iterdir()) == []
    assert "a mission of the library among" in said("check", "vilage", status=2)


def test_missions_are_listed_and_checked():
    rows = said("list", "town").splitlines()[1:4]
    assert [row.split()[0] for row in rows] == ["town-16", "town-64", "town-196"]
    checked = said("check", f"library:{SMALL}")
    assert f"{SMALL}: right" in checked
    assert "1 mission: each plan was evaluated again" in checked
