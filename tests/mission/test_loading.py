import re
import shutil
import sys
import textwrap
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
GENERATORS = [
    "building",
    "complete",
    "drones_and_rovers",
    "lattice",
    "orienteering",
    "random",
    "terrain",
    "town",
    "tunnel",
    "two_communities",
]


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Install a package with entry points, as pip would."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def install(package, code, **entries):
        module = package.replace("-", "_")
        (tmp_path / f"{module}.py").write_text(textwrap.dedent(code))
        info = tmp_path / f"{module}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        lines = [f"{name} = {module}:{target}" for name, target in entries.items()]
        (info / "entry_points.txt").write_text("\n".join(["[botohe_moo.missions]", *lines]))
        monkeypatch.delitem(sys.modules, module, raising=False)

    return install


REEF = """
    import networkx as nx
    from botohe_moo.mission import Mission

    def reef(*, danger=0.1, width) -> Mission:
        graph = nx.DiGraph(name="reef", base=0, robots=1)
        graph.add_nodes_from(range(width), reward=1)
        for node in range(1, width):
            graph.add_edge(0, node, survival=1 - danger)
            graph.add_edge(node, 0, survival=1)
        return Mission(graph)

    def shoal(depth=2, **anything):
        return reef(width=depth)

    def lagoon():
        return 3

    nothing = dict  # whose signature Python cannot tell
"""


@pytest.mark.parametrize(("name", "nodes", "arcs", "robots", "total"), SIZES)
def test_case_studies(name, nodes, arcs, robots, total):
    mission = load_mission(name)
    assert (len(mission.nodes), mission.world.graph.n_arcs, mission.robots) == (nodes, arcs, robots)
    assert mission.total_reward == pytest.approx(total, abs=5e-5)
    assert mission.name == name
    assert mission.balanced
    assert mission.title != name
    assert all("pos" in values for _, values in mission.graph.nodes(data=True))
    assert mission == getattr(loading, name)()
    assert load_mission(name, robots=6) == mission.with_robots(6)


def test_names():
    names = mission_names()
    assert set(names) >= {name for name, *_ in SIZES} | set(GENERATORS)
    assert list(names) == sorted(names)


def test_saved_case_studies_are_what_the_package_holds(tmp_path):
    for name in ("art_museum", "power_plant", "terrain_200"):
        save_mission(load_mission(name), tmp_path / "x.json")
        data = Path(loading.__file__).parent / "data" / f"{name}.json"
        assert (tmp_path / "x.json").read_text() == data.read_text()


class TestPaths:
    def test_files(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        shutil.copy(DATA / "pier.json", "Pier.JSON")
        pier = load_mission(DATA / "pier.json")
        assert pier.name == "pier"
        for path in ("Pier.JSON", str(tmp_path / "Pier.JSON"), tmp_path / "Pier.JSON"):
            assert load_mission(path) == pier
        assert load_mission("Pier.JSON", robots=5) == pier.with_robots(5)
        assert load_mission(DATA / "points.txt", neighbours=1).world.graph.n_arcs == 8

    def test_what_looks_like_a_path_is_one(self):
        for path in ("lost.json", "lost/toy", "./toy", Path("toy")):
            with pytest.raises(MissionError, match=r"toy: expected a file name|no such f"):
                load_mission(path)

    def test_names_come_before_files_of_that_name(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        for name in ("toy", "boy"):
            Path(name).write_text("{}")
        assert len(load_mission("toy").nodes) == 5
        with pytest.raises(MissionError, match="boy: expected a file name that ends in one of"):
            load_mission("boy")


class TestRefusals:
    def test_unknown_name_lists_the_nearest_first(self):
        with pytest.raises(MissionError) as caught:
            load_mission("power-plants")
        message = str(caught.value)
        assert message.startswith(
            "Mission 'power-plants': there is no such mission; known are powe"
        )
        assert all(name in message for name in mission_names())
        assert (
            f"mission files end in one of {', '.join(suffixes())}; botohe missions import"
            in message
        )

    def test_graphs_and_tables_are_shown_the_way(self):
        with pytest.raises(ValueError, match=r"\(Mission\(graph, base=.*\) takes graphs\), got"):
            load_mission(nx.DiGraph())
        with pytest.raises(MissionError, match="botohe missions import reads tables"):
            load_mission("nodes.csv")

    @pytest.mark.parametrize(
        ("name", "parameters", "message"),
        [
            ("terrain", {"node": 3}, r"there is no parameter 'node'; known are nodes, .*robots"),
            ("toy", {"seed": 3}, "no parameter 'seed'; known are robots, l"),
            ("random", {"arc_probabilty": 1}, r"known are arc_probability, "),
            ("terrain", {"nodes": 1}, r"Expected nodes >= 2, got 1\."),
            ("toy", {"robots": 0}, r"Expected robots >= 1, got 0\."),
            ("toy", {"lengths_from_pos": 1}, r"Expected lengths_from_pos to be true or f.*, got 1"),
        ],
    )
    def test_parameters(self, name, parameters, message):
        with pytest.raises(ValueError, match=message):
            load_mission(name, **parameters)


class TestOtherPackages:
    def test_missions_of_another_package(self, install):
        install("reef-missions", REEF, reef="reef", shoal="shoal")
        assert {"reef", "shoal", "toy"} <= set(mission_names())
        mission = load_mission("reef", width=4, danger=0.5)
        assert isinstance(mission, Mission)
        assert mission.world.graph.survival.tolist() == [0.5, 0.5, 0.5, 1, 1, 1]
        assert load_mission("reef", width=4, robots=3).robots == 3
        assert len(load_mission("shoal", depth=5, robots=2).nodes) == 5

    def test_whatever_their_functions_raise(self, install):
        install("tide-missions", "def tide():\n    raise RuntimeError('no tide')\n", tide="tide")
        with pytest.raises(RuntimeError, match="no tide"):
            load_mission("tide")
        assert mission_faults("tide") == [(None, "RuntimeError: no tide")]

    def test_faults_of_their_missions(self, install, tmp_path):
        """The error names the plug-in, and the file if it reads one."""
        code = f"""
            import networkx as nx
            from botohe_moo.mission import Mission, read_mission

            def tide():
                graph = nx.DiGraph([(0, 1), (1, 0)], base=0, robots=1)
                nx.set_node_attributes(graph, 1, "reward")
                nx.set_edge_attributes(graph, 3, "survival")
                return Mission(graph)

            def ebb():
                return read_mission({str(tmp_path / "no.json")!r})
        """
        install("tide-missions", code, tide="tide", ebb="ebb")
        with pytest.raises(MissionError, match=r"^Mission 'tide' has 2 faults:\n  - arc 0 -> 1: "):
            load_mission("tide")
        with pytest.raises(MissionError, match=r"^Mission 'ebb': .*no\.json: no such file"):
            load_mission("ebb")

    @pytest.mark.parametrize(
        ("code", "found"),
        [
            ("import no_such_module", "ModuleNotFoundError: No module named 'no_such_module'"),
            (
                "broken = 3",
                "expected bad_missions:broken of package bad-missions to be a function or class",
            ),
        ],
    )
    def test_broken_ones_are_left_out_with_a_warning(self, install, code, found):
        install("bad-missions", code, broken="broken")
        with pytest.warns(UserWarning, match="left out") as warned:
            names = mission_names()
        assert "toy" in names
        assert "broken" not in names
        (message,) = [str(warning.message) for warning in warned]
        assert "Mission 'broken'" in message
        assert "bad_missions:broken of package bad-missions" in message
        assert found in message
        with pytest.raises(MissionError) as caught:
            load_mission("broken")
        assert found in str(caught.value)

    def test_a_package_claims_one_of_ours(self, install):
        install("reef-missions", REEF, toy="reef")
        assert len(load_mission("toy").nodes) == 5


class TestCheck:
    def test_nothing_to_say(self):
        assert mission_faults("terrain", {"nodes": 5, "seed": 1, "robots": 2}) == []
        assert mission_faults("toy") == mission_faults("toy", {"robots": 3}) == []
        assert mission_faults(DATA / "pier.json", {"robots": 3}) == []

    def test_names_and_types_at_once_and_nothing_is_made(self, install):
        install("reef-missions", TYPED, wreck="wreck")
        assert mission_faults("wreck", {"depht": 1, "depth": 2.5, "robots": 2}) == [
            (
                "depht",
                "there is no parameter 'depht'; known are depth, danger, lengths_from_pos, robots, "
                "known.",
            ),
            ("depth", "Expected depth to be an integer >= 1, got 2.5."),
        ]
        assert "made" not in sys.modules["reef_missions"].__dict__
        assert mission_faults("wreck", {"danger": 0.5}) == []
        assert "made" in sys.modules["reef_missions"].__dict__

    def test_python_objects(self, install):
        install("reef-missions", TYPED, wreck="wreck")
        assert mission_faults("wreck", {"danger": 0.5, "known": [load_mission("toy")]}) == []

    @pytest.mark.parametrize(
        ("name", "parameters", "faults"),
        [
            ("terrain", {"nodes": 1}, [("nodes", "Expected nodes >= 2, got 1.")]),
            ("lost.json", {}, [(None, "no such file or directory")]),
        ],
    )
    def test_what_only_making_it_finds(self, name, parameters, faults):
        assert mission_faults(name, parameters) == faults

    def test_what_is_no_name(self):
        [(blamed, fault)] = mission_faults(3)
        assert blamed is None
        assert re.match(r"Expected the name of a mission or a path .*, got 3\.$", fault)

    def test_parameters(self, install):
        install("reef-missions", TYPED, wreck="wreck")
        depth, danger, known = mission_parameters("wreck")
        assert (depth.default, depth.range, danger.required, known.plain) == (
            2,
            ">= 1",
            True,
            False,
        )
        assert [p.name for p in mission_parameters("random")] == [
            "nodes",
            "arc_probability",
            "robots",
            "seed",
        ]
        assert mission_parameters("toy") == ()
        names = {parameter.name for parameter in mission_parameters(DATA / "points.txt")}
        assert {"base", "danger", "hazard", "neighbours"} < names


TYPED = """
    from typing import Annotated
    from pydantic import Field
    from botohe_moo.mission import Mission, load_mission

    def wreck(*, depth: Annotated[int, Field(ge=1)] = 2, danger: float,
              known: "list[Mission] | None" = None):
        global made
        made = True
        return load_mission("complete", nodes=depth + 1)
"""


class TestModules:
    def test_what_nobody_has_registered(self, tmp_path, monkeypatch):
        monkeypatch.syspath_prepend(str(tmp_path))
        (tmp_path / "lone_shore.py").write_text(textwrap.dedent(REEF))
        mission = load_mission("lone_shore:reef", width=4, robots=2)
        assert (len(mission.nodes), mission.robots) == (4, 2)
        with pytest.raises(ValueError, match=r"^Mission 'lone_shore:reef': there is no parameter"):
            load_mission("lone_shore:reef", widht=4)

    def test_what_cannot_be_imported(self):
        expected = "^Mission 'no_such_module:reef': it cannot be imported .ModuleNotFoundError"
        with pytest.raises(ValueError, match=expected):
            load_mission("no_such_module:reef")

    def test_only_what_says_that_it_makes_a_mission_is_called(self, tmp_path, monkeypatch):
        monkeypatch.syspath_prepend(str(tmp_path))
        (tmp_path / "dark_shore.py").write_text(
            textwrap.dedent(
                """
                from botohe_moo import BOACO, Mission, load_mission

                called = []

                def bare(**given):
                    called.append(given)
                    return load_mission("toy")

                def other() -> BOACO:
                    called.append("other")

                class Island(Mission):
                    def __init__(self) -> None:
                        super().__init__(load_mission("toy").graph)

                    @classmethod
                    def far(cls) -> "Island":
                        return cls()
                """
            )
        )
        for path in ("dark_shore:bare", "dark_shore:other", "dark_shore:called.append"):
            with pytest.raises(MissionError, match=r"\(-> Mission\)|is looked for in"):
                load_mission(path)
            [(blamed, said)] = mission_faults(path, {})
            assert blamed is None
            assert "(-> Mission)" in said or "is looked for in" in said
        assert sys.modules["dark_shore"].called == []
        assert load_mission("dark_shore:Island") == load_mission("dark_shore:Island.far")
