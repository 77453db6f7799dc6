"""The library: its missions, its files, and what is handed in."""

import json

import numpy as np
import pytest

from botohe_moo import (
    MissionError,
    TrailPlan,
    area_indicator,
    bound_front,
    load_mission,
    solve,
)
from botohe_moo.library import (
    FOLDER,
    Finder,
    add_plans,
    best_known,
    certified_bound,
    check_library,
    library_names,
    library_table,
)
from botohe_moo.mission.loading import ENTRIES, library_name_of
from botohe_moo.mission.model import numbers_digest
from botohe_moo.study import StudyError, load_study, make_tables, run_study

SMALL = "town-16"
ADA = Finder("2026-11-27", "Ada", "by hand")
BOB = Finder("2026-11-28", "Bob", "by hand")


@pytest.fixture(scope="module")
def found():
    """A front of a small mission, by descending reward."""
    return solve(f"library:{SMALL}", evaluations=5_000, seed=1)


@pytest.fixture
def library(tmp_path, found):
    """A folder with every other plan of that front, and a bound."""
    folder = tmp_path / "library"
    folder.mkdir()
    add_plans({SMALL: [(found.plans[::2], ADA)]}, folder=folder)
    bound_front(found.mission, time_limit=2).save(folder / f"{SMALL}.bound.json")
    return folder


def contents(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


class TestMissions:
    def test_each_has_its_digest_and_is_of_its_size(self):
        for name, entry in ENTRIES.items():
            mission = load_mission(f"library:{name}")  # refuses another digest
            assert mission.name == name
            assert library_name_of(numbers_digest(mission)) == name
            n_nodes = len(mission.nodes)
            assert name.split("-")[1] == str(n_nodes)
            assert 10 <= n_nodes <= {"small": 40, "medium": 100, "large": 1000}[entry.size]
        assert len({entry.digest for entry in ENTRIES.values()}) == len(ENTRIES)
        assert library_name_of(numbers_digest(load_mission(f"library:{SMALL}", robots=3))) is None

    def test_selections_are_names_of_several(self):
        assert library_names() == tuple(ENTRIES)
        assert library_names(SMALL) == (SMALL,)
        of_size = [library_names(size) for size in ("small", "medium", "large")]
        assert sorted(name for names in of_size for name in names) == sorted(ENTRIES)
        assert library_names("town") == ("town-16", "town-64", "town-196")
        for ask, name, fault in (
            (library_names, "town-17", "a mission of the library among town-16, "),
            (load_mission, "library:town-17", "Expected a mission of the library among town-16, "),
            (load_mission, "library:town", "these are several: town-16, town-64, town-196"),
            (load_mission, "library:", "Expected a mission of the library"),
        ):
            with pytest.raises(ValueError, match=fault):
                ask(name)

    def test_numbers_that_are_drawn_otherwise_are_noticed(self, monkeypatch):
        changed = {**ENTRIES, SMALL: ENTRIES[SMALL]._replace(digest="0" * 16)}
        monkeypatch.setattr("botohe_moo.mission.loading.ENTRIES", changed)
        with pytest.raises(MissionError, match="expected the digest 0000000000000000, got"):
            load_mission(f"library:{SMALL}")


class TestFiles:
    """Those that come with the package."""

    def test_there_is_a_front_and_a_bound_of_each(self):
        names = sorted(path.name.removesuffix(".gz") for path in FOLDER.iterdir())
        kinds = ("front", "bound")
        assert names == sorted(f"{name}.{kind}.json" for name in ENTRIES for kind in kinds)
        assert sum(path.stat().st_size for path in FOLDER.iterdir()) < 12 * 2**20

    def test_the_small_ones_are_right(self):
        assert check_library("small") == {}

    @pytest.mark.slow
    def test_all_are_right(self):
        assert check_library() == {}

    def test_the_table_lists_them(self):
        table = library_table("small")
        assert list(table["mission"]) == list(library_names("small"))
        assert (table["bound_area"] >= table["area"] * (1 - 1e-9)).all()
        row = table.set_index("mission").loc[SMALL]
        assert (row["nodes"], row["arcs"], row["robots"]) == (16, 24, 2)
        assert row["gap"] == certified_bound(SMALL).gap(best_known(SMALL).objectives)


class TestAdding:
    def test_what_improves_the_front_enters(self, library, found):
        before, after, path = add_plans({SMALL: [(found.plans, BOB)]}, folder=library)[SMALL]
        assert path == library / f"{SMALL}.front.json"
        assert after.area > before.area
        assert best_known(SMALL, folder=library).to_bytes() == after.to_bytes()
        kept = dict(zip(map(tuple, before.objectives.tolist()), before.finders, strict=True))
        for point, finder in zip(map(tuple, after.objectives.tolist()), after.finders, strict=True):
            assert finder == (ADA if point in kept else BOB)
        assert check_library([SMALL], folder=library) == {}
        written = contents(library)
        add_plans({SMALL: [(found.plans[::2], BOB), (found.plans, BOB)]}, folder=library)
        assert contents(library) == written

    def test_fronts_of_large_missions_are_compressed(self, tmp_path):
        home = load_mission("library:town-196").stay_home()
        _, after, path = add_plans({"town-196": [([home], ADA)]}, folder=tmp_path)["town-196"]
        assert path == tmp_path / "town-196.front.json.gz"
        assert best_known("town-196", folder=tmp_path).to_bytes() == after.to_bytes()

    def test_nothing_is_written_if_any_plan_is_refused(self, tmp_path, found):
        given = {SMALL: [(found.plans, ADA)], "town-64": [([TrailPlan([[0, 5], [0]])], ADA)]}
        with pytest.raises(ValueError, match="town-64, by hand: Robot 0"):
            add_plans(given, folder=tmp_path / "new")
        assert not (tmp_path / "new").exists()

    def test_names_that_are_unknown_are_refused(self):
        for look in (best_known, certified_bound, library_table):
            with pytest.raises(ValueError, match="vilage"):
                look(["vilage"] if look is library_table else "vilage")

    def test_a_front_that_is_false_is_refused(self, library, found):
        path = library / f"{SMALL}.front.json"
        content = json.loads(path.read_bytes())
        content["plans"] = [[8.5, 2.0, 0, content["plans"][0][3]]]
        content["area"] = area_indicator([[8.5, 2.0]], found.mission)
        path.write_text(json.dumps(content))
        before = contents(library)
        with pytest.raises(ValueError, match=r"front.json: Plan 0: expected the objectives"):
            add_plans({SMALL: [(found.plans, BOB)]}, folder=library)
        assert contents(library) == before


class TestChecking:
    @pytest.mark.parametrize(
        ("kind", "change", "said"),
        [
            ("front", lambda c: c["plans"][0].__setitem__(0, 9.0), "Plan 0: expected the objecti"),
            ("front", lambda c: c["trails"].append([0]), "expected what `botohe library add` writ"),
            ("bound", lambda c: [step.__setitem__(1, 1.0) for step in c["steps"]], "has at most"),
            ("front", None, "o such file"),
            ("bound", None, "o such file"),
        ],
    )
    def test_what_is_wrong_is_named(self, library, kind, change, said):
        path = library / f"{SMALL}.{kind}.json"
        content = json.loads(path.read_bytes())
        path.unlink()
        if change is not None:
            change(content)
            path.write_text(json.dumps(content))
        [(name, fault)] = check_library([SMALL], folder=library).items()
        assert (name, str(path) in fault, said in fault) == (SMALL, True, True)
        if (kind, change) == ("bound", None):
            row = library_table([SMALL], folder=library).iloc[0]
            assert (np.isnan(row["gap"]), row["plans"] > 0) == (True, True)


@pytest.mark.slow
def test_best_known_fronts_are_references_of_studies(tmp_path):
    study = {
        "name": "trial",
        "missions": {"mine": f"library:{SMALL}", "library:lattice-12": "library:lattice-12"},
        "algorithms": ["greedy", "random"],
        "budget": {"evaluations": 200},
        "seeds": 1,
        "reference": "best-known",
    }
    tables = run_study(study, tmp_path / "trial")
    for label, name in (("mine", SMALL), ("lattice-12", "lattice-12")):
        known, bound = best_known(name), certified_bound(name)
        references = tables.references[tables.references["mission"] == label]
        points = references[["reward", "survivors"]].to_numpy()
        evaluated = known.mission.evaluate(known.plans)  # with all digits
        assert {*map(tuple, points.tolist())} == {*map(tuple, evaluated.tolist())}
        summary = tables.summary[tables.summary["mission"] == label]
        for row in summary.to_dict("records"):
            assert row["area_share"] == pytest.approx(row["area_mean"] / known.area)
            assert row["area_gap"] == pytest.approx(bound.area / row["area_mean"] - 1)
    made = (tmp_path / "trial" / "summary.csv").read_bytes()
    make_tables(tmp_path / "trial")
    assert (tmp_path / "trial" / "summary.csv").read_bytes() == made


def loaded(missions, **further):
    budget = {"evaluations": 10}
    study = {"name": "trial", "missions": missions, "algorithms": ["greedy"], "budget": budget}
    return load_study({**study, "seeds": 1, **further})


def labels(missions):
    return {m.label: m.mission.name for m in loaded(missions).missions}


class TestSelections:
    def test_a_list_has_missions_by_their_own_names(self):
        names = (*library_names("town"), "lattice-12", "toy")
        assert labels(["library:town", "library:lattice-12", "toy"]) == {n: n for n in names}
        assert list(labels(["library:small"])) == list(library_names("small"))

    def test_an_entry_has_its_label_before_them(self):
        limited = {"mission": "library:town", "min_survival": 0.3}
        study = loaded({"free": "library:town", "kept": limited, "mine": "library:lattice-12"})
        town = library_names("town")
        names = [*(f"{label} ({name})" for label in ("free", "kept") for name in town), "mine"]
        assert [mission.label for mission in study.missions] == names
        # Options are those of each.
        assert [mission.min_survival for mission in study.missions[3:6]] == [0.3] * 3
        known = [mission.library_name for mission in study.missions]
        assert known == [*town, None, None, None, "lattice-12"]

    def test_what_is_refused(self):
        with pytest.raises(StudyError, match="town-16"):  # twice the same label
            labels({"town-16": "toy", "library:town": "library:town"})
        said = r"^reference: 'mine' is not a mission of the library with its own limits\.$"
        for mission in ("toy", {"mission": f"library:{SMALL}", "robots": 3}):
            with pytest.raises(StudyError, match=said):
                loaded({"mine": mission}, reference="best-known")
