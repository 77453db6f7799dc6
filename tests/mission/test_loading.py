"""Missions by name: those of this package, of others, of modules, and what is refused."""

import sys
from pathlib import Path

import networkx as nx
import pytest

from botohe_moo.mission import (
    Mission,
    MissionError,
    load_mission,
    loading,
    mission_names,
    save_mission,
)
from botohe_moo.mission.formats.reading import suffixes
from botohe_moo.mission.loading import mission_parameters
from tests.base.packages import entries, write_package
from tests.faults import mission_faults

DATA = Path(__file__).parents[1] / "data"

# name, nodes, arcs, robots, total reward: case-studies/README.md
SIZES = [
    ("art_museum", 27, 74, 3, 13.0667),
    ("art_museum_return", 27, 74, 3, 13.0667),
    ("power_plant", 73, 144, 2, 8.70),
    ("terrain_200", 200, 1348, 5, 103.949),
    ("toy", 5, 12, 2, 10),
]
CODE = """
    import networkx as nx
    from typing import Annotated
    from pydantic import Field
    from botohe_moo import BOACO, Mission, load_mission

    called = []

    def reef(*, danger=0.1, width: Annotated[int, Field(ge=1)]) -> Mission:
        called.append("reef")
        graph = nx.DiGraph(name="reef", base=0, robots=1)
        graph.add_nodes_from(range(width), reward=1)
        for node in range(1, width):
            graph.add_edge(0, node, survival=1 - danger)
            graph.add_edge(node, 0, survival=1)
        return Mission(graph)

    def tide():
        return reef(width=2, danger=-1)

    def ebb():
        return load_mission("lost.json")

    def flood():
        raise RuntimeError("no tide")

    def bare(**given):
        called.append("bare")

    def other() -> BOACO:
        called.append("other")

    class Island(Mission):
        def __init__(self) -> None:
            super().__init__(load_mission("toy").graph)

        @classmethod
        def far(cls) -> "Island":
            return cls()

    broken = 3
"""


@pytest.fixture
def shore(tmp_path, monkeypatch):
    """A package that registers missions, as pip would install it; returns its module."""
    monkeypatch.syspath_prepend(str(tmp_path))
    named = {name: name for name in ("reef", "tide", "ebb", "flood")} | {"toy": "reef"}
    write_package(tmp_path, "dark-shore", CODE, entries("missions", "dark_shore", **named))
    yield lambda: sys.modules["dark_shore"]
    sys.modules.pop("dark_shore", None)


@pytest.mark.parametrize(("name", "nodes", "arcs", "robots", "total"), SIZES)
def test_case_studies(tmp_path, name, nodes, arcs, robots, total):
    mission = load_mission(name)
    assert (len(mission.nodes), mission.world.graph.n_arcs, mission.robots) == (nodes, arcs, robots)
    assert mission.total_reward == pytest.approx(total, abs=5e-5)
    assert (mission.name, mission.balanced, name in mission_names()) == (name, True, True)
    assert mission.title != name
    assert mission == getattr(loading, name)()
    assert load_mission(name, robots=6) == mission.with_robots(6)
    data = Path(loading.__file__).parent / "data" / f"{name}.json"
    if name not in ("toy", "art_museum_return"):
        save_mission(mission, tmp_path / "x.json")
        assert (tmp_path / "x.json").read_text() == data.read_text()


def test_files_are_paths_and_names_come_before_files_of_that_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pier = load_mission(DATA / "pier.json")
    save_mission(pier, "Pier.JSON")
    for path in ("Pier.JSON", str(tmp_path / "Pier.JSON"), tmp_path / "Pier.JSON"):
        assert load_mission(path, robots=5) == pier.with_robots(5)
    for path in ("lost.json", "lost/toy", "./toy", Path("toy")):
        with pytest.raises(MissionError, match=r"toy: expected a file name|no such f"):
            load_mission(path)
    for name in ("toy", "boy"):
        Path(name).write_text("{}")
    assert len(load_mission("toy").nodes) == 5
    with pytest.raises(MissionError, match="boy: expected a file name that ends in one of"):
        load_mission("boy")


def test_an_unknown_name_lists_what_is_known():
    with pytest.raises(MissionError) as caught:
        load_mission("power-plants")
    message, ends = str(caught.value), ", ".join(suffixes())
    assert message.startswith("Mission 'power-plants': no such mission; known are powe")
    assert all(name in message for name in mission_names())
    assert f"mission files end in one of {ends}; botohe missions import" in message
    assert [*mission_names()] == sorted(mission_names())


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("nodes.csv", {}, "botohe missions import reads tables"),
        (
            nx.DiGraph(),
            {},
            r"Expected the name of a mission or a path \(Mission\(graph, bas.*, got",
        ),
        ("terrain", {"node": 3}, r"there is no parameter 'node'; known are nodes, .*robots"),
        ("terrain", {"nodes": 1}, r"Expected nodes >= 2, got 1\."),
        ("reef", {}, "width"),
        ("reef", {"width": 0}, r"Expected width >= 1, got 0\."),
        ("tide", {}, r"^Mission 'tide': Mission 'reef': arc 0 -> 1: expected survival in"),
        ("ebb", {}, r"^Mission 'ebb': lost\.json: no such file"),
        ("no_such_module:reef", {}, "^Mission 'no_such_module:reef': it cannot be imported"),
        ("dark_shore:reef", {"widht": 4}, "^Mission 'dark_shore:reef': there is no parameter 'wi"),
        ("dark_shore:bare", {}, r"\(-> Mission\)"),
        ("dark_shore:other", {}, r"\(-> Mission\)"),
        ("dark_shore:called.append", {}, r"\(-> Mission\)|is looked for in"),
        ("dark_shore:broken", {}, "dark_shore:broken"),
    ],
)
def test_refusals(shore, name, parameters, message):
    """Nothing is called of a module but what says that it makes a mission."""
    with pytest.raises(ValueError, match=message) as caught:
        load_mission(name, **parameters)
    [(_, said)] = mission_faults(name, parameters)
    assert said.rstrip(".") in str(caught.value)
    assert {*getattr(sys.modules.get("dark_shore"), "called", [])} <= {"reef"}


def test_missions_of_other_packages_and_modules(shore):
    assert {"reef", "toy"} <= {*mission_names()}
    for name in ("reef", "dark_shore:reef"):
        mission = load_mission(name, width=4, danger=0.5, robots=3)
        assert (isinstance(mission, Mission), mission.robots) == (True, 3)
        assert mission.world.graph.mean_survival.tolist() == [0.5, 0.5, 0.5, 1, 1, 1]
    assert load_mission("dark_shore:Island") == load_mission("dark_shore:Island.far")
    assert len(load_mission("toy").nodes) == 5  # which another package claims
    with pytest.raises(RuntimeError, match="no tide"):
        load_mission("flood")
    assert mission_faults("flood") == [(None, "RuntimeError: no tide")]


def test_broken_ones_are_left_out_with_a_warning(shore, tmp_path):
    entry = entries("missions", "bad_missions", b="broken")
    write_package(tmp_path, "bad-missions", "broken = 3", entry)
    found = "bad_missions:broken of package bad-missions to be a function or class"
    with pytest.warns(UserWarning, match=f"left out.*Mission 'b'.*{found}|Mission 'b'.*{found}"):
        assert "b" not in mission_names()
    with pytest.raises(MissionError, match=found):
        load_mission("b")


def test_a_check_names_all_parameters_at_once_and_makes_nothing(shore):
    (misspelt, said), given = mission_faults("reef", {"widht": 1, "width": 2.5, "robots": 2})
    known = "width, danger, robots, scenarios, lengths_from_pos"
    assert (misspelt, said) == ("widht", f"there is no parameter 'widht'; known are {known}.")
    assert given == ("width", "Expected width to be an integer >= 1, got 2.5.")
    assert shore().called == []
    for name, given in (("reef", {"width": 2}), (DATA / "pier.json", {})):
        assert mission_faults(name, given) == []


def test_parameters_of_missions_and_formats(shore):
    danger, width = mission_parameters("reef")
    assert (danger.default, width.required, width.range) == (0.1, True, ">= 1")
    assert mission_parameters("toy") == ()
    names = {parameter.name for parameter in mission_parameters(DATA / "points.txt")}
    assert {"base", "danger", "hazard", "neighbours"} < names
