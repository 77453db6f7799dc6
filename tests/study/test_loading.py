"""Study files: everything wrong is reported at once, and grids expand as written."""

import json
import math
import subprocess
import sys
import textwrap
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from PIL import Image

from botohe_moo import Kind, Mission, load_mission, save_mission
from botohe_moo.algorithms import algorithm_names
from botohe_moo.base.documents import Document
from botohe_moo.study.content import StudyFile
from botohe_moo.study.folder import StudyFolder, read_manifest
from botohe_moo.study.loading import load_study, study_schema
from botohe_moo.study.model import StudyError

EXPERIMENTS = sorted((Path(__file__).parents[2] / "experiments").glob("*.yaml"))

NSGA2 = {"algorithm": "nsga2"}
GOOD = {
    "name": "trial",
    "missions": {"toy": "toy"},
    "algorithms": {"ants": "bo-aco"},
    "budget": {"evaluations": 100},
    "seeds": 2,
}


def changed(**changes):
    return {key: value for key, value in {**GOOD, **changes}.items() if value is not None}


def lines(source):
    with pytest.raises(StudyError) as caught:
        load_study(source)
    return str(caught.value).splitlines()


def written(tmp_path, text):
    path = tmp_path / "study.yaml"
    path.write_text(text)
    return path


def test_paths_are_relative_to_the_file_that_names_them(tmp_path, monkeypatch):
    folder = tmp_path / "studies"
    (folder / "maps").mkdir(parents=True)
    Image.fromarray(np.zeros((4, 4), np.uint8)).save(folder / "maps" / "black.png")
    (folder / "maps" / "black.yaml").write_text(
        "{image: black.png, mode: scale, resolution: 1, origin: [0, 0]}"
    )
    points = [
        {"properties": {"id": i}, "geometry": {"type": "Point", "coordinates": [1 + i, 1]}}
        for i in range(2)
    ]
    line = {"type": "LineString", "coordinates": [[1, 1], [2, 1]]}
    ends = {"startid": 0, "endid": 1}
    features = [*points, {"properties": ends, "geometry": line}]
    (folder / "site.geojson").write_text(json.dumps({"features": features}))
    parameters = {"base": 0, "danger": 0.5, "hazard": "maps/black.yaml", "both_ways": True}
    mission = {"mission": "site.geojson", "robots": 1, "parameters": parameters}
    (folder / "study.yaml").write_text(json.dumps(changed(missions={"site": mission})))
    monkeypatch.chdir(tmp_path)
    study = load_study("studies/study.yaml")
    survivals = study.missions[0].mission.graph.edges
    assert survivals[0, 1]["survival"] == pytest.approx(math.exp(-0.5))
    monkeypatch.chdir(folder)
    assert load_study("study.yaml").missions[0].digest == study.missions[0].digest


class TestGrid:
    def test_runs_go_mission_by_mission(self):
        study = load_study(changed(missions=["toy", "art_museum"], algorithms=["random", "greedy"]))
        assert [(r.mission.label, r.algorithm.label, r.seed) for r in study.runs()] == [
            (mission, algorithm, seed)
            for mission in ("toy", "art_museum")
            for algorithm in ("random", "greedy")
            for seed in (1, 2)
        ]

    def test_every_combination_of_a_grid_is_an_entry(self):
        entry = {
            "algorithm": "nsga2",
            "parameters": {"pop_size": 20},
            "grid": {"repair": ["truncate", "penalty"], "prob_mutation": [0.5, 1]},
        }
        study = load_study(changed(algorithms={"N": entry, "ants": "botohe_moo:BOACO"}))
        *variants, ants = study.algorithms
        assert {a.label: dict(a.parameters) for a in variants} == {
            f"N (repair={repair}, prob_mutation={prob})": {
                "pop_size": 20,
                "repair": repair,
                "prob_mutation": prob,
            }
            for repair in ("truncate", "penalty")
            for prob in (0.5, 1)
        }
        assert {a.family for a in variants} == {"N"}
        assert (ants.family, ants.grid) == ("ants", {})
        manifest = json.loads(json.dumps(study.manifest()))["algorithms"]
        last = manifest["N (repair=penalty, prob_mutation=1)"]
        assert last["family"] == "N"
        assert last["grid"] == {"repair": "penalty", "prob_mutation": 1}
        assert (last["name"], last["package"]) == ("nsga2", "botohe-moo")
        assert last["effective"].items() > last["parameters"].items() > last["grid"].items()
        ants = manifest["ants"]
        assert ants["name"] == "botohe_moo:BOACO"
        assert ants["effective"].items() >= {"n_ants": 100, "n_threads": 1}.items()

    def test_generators_expand_over_seeds(self):
        entry = {"mission": "terrain", "parameters": {"nodes": 20}, "grid": {"seed": [1, 2]}}
        study = load_study(changed(missions={"hills": entry}))
        assert [m.label for m in study.missions] == ["hills (seed=1)", "hills (seed=2)"]
        assert study.missions[1].mission == load_mission("terrain", nodes=20, seed=2)
        second = study.manifest()["missions"]["hills (seed=2)"]
        assert (second["family"], second["grid"]) == ("hills", {"seed": 2})

    def test_files_are_beside_the_study(self, tmp_path):
        (tmp_path / "sites").mkdir()
        save_mission(load_mission("toy", robots=1), tmp_path / "sites" / "mine.json")
        path = written(tmp_path, json.dumps(changed(missions=["sites/mine.json"])))
        assert load_study(path).missions[0].mission == load_mission("toy", robots=1)

    def test_a_mission_has_its_own_team_floor_and_budget(self):
        entry = {
            "mission": "toy",
            "robots": 3,
            "min_survival": 0.5,
            "budget": {"seconds": 2, "grace_seconds": 0},
        }
        [mission] = load_study(changed(missions={"x": entry}, budget=None)).missions
        assert mission.mission.robots == 3
        assert mission.min_survival == 0.5
        assert (mission.budget.evaluations, mission.budget.seconds) == (None, 2)

    def test_a_travel_budget(self, tmp_path):
        (tmp_path / "site.txt").write_text("n 3\nm 1\ntmax 10\n0 0 0\n1 0 5\n0 0 0\n")
        entry = {"mission": str(tmp_path / "site.txt")}
        for keys, expected in (
            ({}, 10),
            ({"max_length": 4}, 4),
            ({"max_length": 0}, 0),
            ({"max_length": "unlimited"}, None),
        ):
            study = load_study(changed(missions={"x": {**entry, **keys}}))
            assert study.missions[0].max_length == expected
            assert study.manifest()["missions"]["x"]["max_length"] == expected
            assert ("max_length" in study.runs()[0].identity) == (expected is not None)

    def test_lengths_from_pos(self):
        entry = {"mission": "terrain", "parameters": {"nodes": 9, "lengths_from_pos": True}}
        study = load_study(changed(missions={"x": entry}))
        terrain = load_mission("terrain", nodes=9)
        assert study.missions[0].mission == terrain.with_lengths_from_pos() != terrain
        assert study.missions[0].source == {
            "name_or_path": "terrain",
            "nodes": 9,
            "lengths_from_pos": True,
        }

    def test_seeds(self):
        for seeds, expected in ((3, (1, 2, 3)), ([7, 3], (7, 3))):
            assert load_study(changed(seeds=seeds)).seeds == expected


JOURNAL = "botohe_moo.algorithms.bo_aco:BOACO.journal"


@pytest.fixture
def local(tmp_path, monkeypatch):
    """Write a module that nobody has installed."""

    def write(code, name="mine"):
        (tmp_path / f"{name}.py").write_text(textwrap.dedent(code))
        monkeypatch.syspath_prepend(str(tmp_path))
        monkeypatch.delitem(sys.modules, name, raising=False)

    return write


def digests(source):
    return [run.digest for run in load_study(source).runs()]


class TestIdentity:
    def test_labels_and_order_are_not_part_of_it(self):
        named = changed(missions={"x": "toy"}, algorithms={"y": "random", "z": "bo-aco"})
        assert set(digests(GOOD)) < set(digests(named))

    def test_whatever_a_result_depends_on_is(self):
        ants = {"algorithm": "bo-aco", "parameters": {"n_ants": 99}}
        for changes in (
            {"missions": {"toy": {"mission": "toy", "robots": 3}}},
            {"missions": {"toy": {"mission": "toy", "min_survival": 0.1}}},
            {"missions": {"toy": {"mission": "toy", "max_length": 9}}},
            {"algorithms": {"ants": ants}},
            {"budget": {"evaluations": 101}},
            {"budget": {"evaluations": 100, "seconds": 10}},
            {"recording": {"per_decade": 10}},
            {"seeds": [3, 4]},
        ):
            assert not set(digests(GOOD)) & set(digests(changed(**changes))), changes

    def test_nothing_else_is(self):
        changes = {
            "budget": {"evaluations": 100, "grace_seconds": 1},
            "comparison": {"control": "ants"},
            "indicators": ["area"],
            "title": "x",
            "bounds": {"seconds": 9},
        }
        assert digests(changed(**changes)) == digests(GOOD)

    def test_equal_numbers_are_the_same(self):
        whole, broken, order = (
            digests(changed(algorithms={"N": {"algorithm": "nsga2", "parameters": p}}))
            for p in (
                {"prob_mutation": 1, "pop_size": 20},
                {"prob_mutation": 1.0, "pop_size": 20},
                {"pop_size": 20, "prob_mutation": 1.0},
            )
        )
        assert whole == broken == order

    def test_so_are_the_versions(self):
        study = load_study(GOOD)
        for package in ("botohe-moo", "pymoo"):
            origin = {**study.algorithms[0].origin, package: "99.0"}
            other = replace(study, algorithms=(replace(study.algorithms[0], origin=origin),))
            assert not set(digests(GOOD)) & {run.digest for run in other.runs()}

    @pytest.mark.slow
    def test_it_is_the_same_in_another_process(self):
        code = (
            "from botohe_moo.study.loading import load_study\n"
            f"print(*(run.digest for run in load_study({GOOD!r}).runs()))"
        )
        said = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
        assert said.stdout.decode().split() == digests(GOOD)

    def test_nor_are_defaults_and_threads(self):
        other = {"algorithm": "bo-aco", "parameters": {"n_ants": 100}}
        assert digests(changed(algorithms={"ants": other})) == digests(GOOD)
        other = {"algorithm": "bo-aco", "grid": {"n_threads": [3]}}
        assert digests(changed(algorithms={"ants": other})) == digests(GOOD)

    def test_a_factory_of_the_same_class_is_another_algorithm(self):
        # Its own default counts, 0.1; not that of the class, 0.04.
        journal, explicit, other = (
            digests(changed(algorithms={"a": {"algorithm": path, "parameters": parameters}}))
            for path, parameters in (
                (JOURNAL, {}),
                (JOURNAL, {"evaporation": 0.1, "n_threads": 2}),
                (JOURNAL, {"evaporation": 0.04}),
            )
        )
        assert journal == explicit
        assert not set(journal) & {*digests(GOOD), *other}

    def test_what_a_factory_hands_to_its_class_is_not_known_beforehand(self, local):
        # ``tuned`` gives its class 50, where the class itself has 70.
        local(
            """
            from tests.study.algorithms_made import Sampler

            class Tuned(Sampler):
                @classmethod
                def tuned(cls, **options) -> "Tuned":
                    return cls(**{"n": 50, **options})
            """
        )
        bare, seventy = (
            load_study(changed(algorithms={"a": {"algorithm": "mine:Tuned.tuned", **more}}))
            for more in ({}, {"parameters": {"n": 70}})
        )
        assert not {r.digest for r in bare.runs()} & {r.digest for r in seventy.runs()}
        [effective] = [a.effective for a in bare.algorithms]
        assert effective == {"n": 50}

    def test_threads_count_where_seconds_limit_a_run(self):
        few, many = (
            digests(
                changed(
                    budget={"evaluations": 100, "seconds": 5},
                    algorithms={"a": {"algorithm": "bo-aco", "parameters": {"n_threads": n}}},
                )
            )
            for n in (1, 2)
        )
        assert not set(few) & set(many)

    def test_others_say_which_of_their_parameters_change_nothing(self, local):
        local(
            """
            from typing import Annotated
            from botohe_moo.algorithms import SameResult
            from tests.study.algorithms_made import Sampler

            class Signed(Sampler):
                def __init__(self, *, cores: Annotated[int, SameResult()] = 1, n: int = 9) -> None:
                    super().__init__(n)
            """
        )
        bare, cores, n = (
            digests(changed(algorithms={"a": {"algorithm": "mine:Signed", "parameters": given}}))
            for given in ({}, {"cores": 4, "n": 9}, {"n": 8})
        )
        assert bare == cores
        assert not set(bare) & set(n)

    def test_an_edited_local_algorithm_is_another(self, tmp_path, monkeypatch):
        module = tmp_path / "local_ants.py"
        module.write_text("from botohe_moo import BOACO\nclass Ants(BOACO): ...\n")
        monkeypatch.syspath_prepend(tmp_path)
        source = changed(algorithms={"ants": "local_ants:Ants"})
        before = digests(source)
        assert digests(source) == before
        module.write_text(module.read_text() + "# edited\n")
        assert not set(digests(source)) & set(before)


class TestFaults:
    @pytest.mark.parametrize(
        ("text", "expected"),
        [
            pytest.param(
                """\
name: my study
titel: x
missions:
  d: {mission: toy, robots: 0}
  e: toy
algorithms:
  W: {algorithm: bo-aco, parameter: {}}
budget: {evaluations: 1e5, second: 3}
seeds: [1, 1]
comparison: {control: Q, significance: 2}
indicators: area
""",
                [
                    (1, "name: Expected name to match pattern '^[A-Za-z0-9][A-Za-z0-9._-]*$', got"),
                    (2, "titel: there is no key 'titel'; known are title,"),
                    (4, "robots: Expected robots >= 1, got 0"),
                    (7, "there is no key 'parameter'; known are parameters,"),
                    (8, "Expected evaluations to be an integer, got 100000.0"),
                    (8, "there is no key 'second'; known are seconds,"),
                    (9, "expected each seed once; 1 is there 2 times"),
                    (10, "Expected significance < 1"),
                ],
                id="keys",
            ),
            pytest.param(
                """\
name: study
missions:
  a: art_museun
  b:
    mission: terrain
    parameters: {nodes: "50", sed: 3}
  c: {mission: missing.json}
algorithms:
  X: bo-acco
  Y:
    algorithm: nsga2
    parameters:
      pop_sise: 3
      pop_size: 1.5
  Z: {algorithm: bo-aco, grid: {n_ants: [10, 0]}, parameters: {evaporation: 2.0}}
  V: {algorithm: nsga2, parameters: {repair: best, sampling: [1]}}
budget: {evaluations: 100}
seeds: 1
""",
                [
                    (3, "'art_museun': there is no such mission; known are art_museum,"),
                    (6, "nodes: Expected nodes to be an integer >= 2, got '50'"),
                    (6, "sed: there is no parameter 'sed'; known are seed,"),
                    (7, "missing.json': no such file"),
                    (9, "'bo-acco': there is no such algorithm; known are bo-aco,"),
                    (13, "there is no parameter 'pop_sise'; known are pop_size,"),
                    (14, "Expected pop_size to be an integer in [2, 1000000], got 1.5"),
                    (15, "Expected n_ants in [1, 1000000], got 0"),
                    (15, "Expected evaporation in (0, 1), got 2.0"),
                    (16, "repair"),
                ],
                id="names and parameters",
            ),
            pytest.param(
                """\
name: study
missions: {e: toy, f: toy}
algorithms: {X: bo-aco, Y: bo-aco}
comparison: {control: Q}
indicators: [area, igd]
budget: {evaluations: 100}
seeds: 1
""",
                [
                    (2, "'f' is the same as 'e'"),
                    (3, "'Y' is the same as 'X': defaults and numbers of threads"),
                    (4, "there is no algorithm 'Q'; known are X, Y."),
                    (5, "indicators.1: 'igd': there is no such indicator; known are igd_plus,"),
                ],
                id="together",
            ),
        ],
    )
    def test_all_of_a_kind_are_reported_at_once_with_lines(self, tmp_path, text, expected):
        path = written(tmp_path, text)
        found = lines(path)
        for line, said in expected:
            assert any(entry.startswith(f"{path}:{line}: ") and said in entry for entry in found), (
                line,
                said,
                found,
            )

    @pytest.mark.parametrize(
        ("changes", "place"),
        [
            ({"algorithms": {"a": "__main__:Mine"}}, "algorithms.a: runs "),
            ({"missions": {"m": {"mission": "__main__:Mine"}}}, "missions.m.mission: runs "),
            ({"problem": "__main__:Mine"}, "problem: runs are performed in other processes, "),
            (
                {
                    "algorithms": {
                        "a": {"algorithm": "nsga2", "grid": {"repair": ["__main__:Mine"]}}
                    }
                },
                "algorithms.a.grid.repair.0: runs ",
            ),
        ],
    )
    def test_what_a_notebook_or_script_defines(self, changes, place):
        """Processes of runs cannot import it: every run would fail."""
        [line] = lines(changed(**changes))
        assert line.startswith(place)
        assert "cannot import what a notebook or script defines" in line
        assert "save Mine in a file, such as mine.py, and write mine:Mine" in line

    def test_each_is_named(self):
        twice = {"grid": {"n_ants": [1]}, "parameters": {"n_ants": 2}}
        many = {"algorithm": "bo-aco", "grid": {"n_ants": list(range(1, 21))}}
        seeds = {"mission": "terrain", "grid": {"seed": [3, 3.0]}}
        for changes, said in (
            ({"name": None}, "name: expected the key 'name', which is missing."),
            ({"name": 2026}, "name: Expected name to be a text, got 2026."),
            ({"name": "a/b"}, "name: Expected name to match pattern '^[A-Za-z0-9][A-Za-z0-9._-]*"),
            ({"missions": [1]}, "missions: Expected missions to be a mapping, got [1]."),
            ({"algorithms": []}, "algorithms: Expected algorithms to have at least 1 item, got"),
            (
                {"algorithms": {"a": None}},
                "algorithms.a: Expected a to be a mapping, got None.",
            ),
            ({"budget": {}}, "budget: expected evaluations or seconds, or both, found neither."),
            ({"budget": None}, "missions.toy.mission: 'toy': expected a budget of its own or of"),
            (
                {"budget": {"seconds": math.nan}},
                "budget.seconds: Expected seconds to be a finite number, got nan.",
            ),
            ({"seeds": "3"}, "seeds: expected a count or a list of seeds, got '3'."),
            ({"seeds": [-1]}, "seeds.0: Expected seeds[0] >= 0, got -1."),
            ({"algorithms": ["random", "random"]}, "expected each name once; 'random' is there 2"),
            ({"missions": {"m": seeds}}, "missions.m.grid.seed: expected each value once; 3 is"),
            (
                {"algorithms": {"_a": "random"}},
                "(.*\\S)?$', got '_a'",
            ),
            ({"missions": {" a": "toy"}}, "(.*\\S)?$', got ' a'"),
            (
                {"missions": {"m": {"mission": "tests.study.algorithms_made:changing_mission"}}},
                "gives another mission each time",
            ),
            ({"missions": {"m": {"mission": "toy", "max_length": -1}}}, ">= 0 or 'unlimited', got"),
            (
                {"algorithms": {"a": {"algorithm": "bo-aco", **twice}}},
                "algorithms.a: expected each parameter once; 'n_ants' is there 2 times.",
            ),
            (
                {"comparison": {"control": "ant"}},
                "there is no algorithm 'ant'; known are ants.",
            ),
            (
                {"seeds": 100_000, "algorithms": {"a": many}},
                "seeds: expected at most 250,000 runs, found 2,000,000.",
            ),
        ):
            [line] = lines(changed(**changes))  # and nothing that follows from it
            assert said in line

    def test_limits_that_a_kind_cannot_keep(self, tmp_path):
        graph = load_mission("toy").graph
        kinds = [Kind("drone", 1, end=next(node for node in graph if node != 1))]
        save_mission(Mission(graph, base=1, kinds=kinds), tmp_path / "site.json")
        path = written(
            tmp_path,
            """\
            name: trial
            missions: {site: {mission: site.json, min_survival: 0.99}}
            algorithms: [random]
            budget: {evaluations: 9}
            seeds: 1
            """,
        )
        *_, line = lines(path)
        place = f"{path}:2: missions.site.mission: 'site.json': "
        assert f"{place}Mission 'toy': robots of kind 'drone' cannot keep" in line
        assert "cannot keep min_survival 0.99. The safest way" in line

    def test_runs_that_would_be_the_same(self):
        grid = {"algorithm": "bo-aco", "grid": {"n_ants": [5, 100]}}
        for one, label in (("bo-aco", "a"), (grid, "a (n_ants=100)")):
            [line] = lines(changed(algorithms={"a": one, "b": "bo-aco"}))
            assert line.startswith(f"algorithms.b: 'b' is the same as {label!r}: defaults and ")

    @pytest.mark.parametrize("kind", ["algorithm", "mission"])
    def test_nothing_but_algorithms_and_missions_is_called(self, local, tmp_path, kind):
        """``study plan`` called ``os.system`` while it checked the file."""
        local("import os\ndef run(*, command):\n    os.system(command)\n", "local_harm")
        for path in ("local_harm:run", "local_harm:os.system"):
            entry = {kind: path, "parameters": {"command": f"touch {tmp_path / 'harm'}"}}
            [line] = lines(changed(**{f"{kind}s": {"x": entry}}))
            assert line.startswith(f"{kind}s.x.{kind}: {path!r}: expected a class derived from ")
            assert f"register it as entry point of 'botohe_moo.{kind}s'" in line
            assert not (tmp_path / "harm").exists()

    def test_what_is_no_study(self, tmp_path):
        for text, said in (
            ("", "1: Expected the file to be a mapping, got None."),
            (
                "name: x\nmissions: [\n",
                " line 3: not valid YAML: while parsing a flow node",
            ),
            (
                "name: x\nmissions: &m [*m]\n",
                " line 2: not valid YAML: found unconstructable recursive node",
            ),
        ):
            [line] = lines(written(tmp_path, text))
            assert line.startswith(f"{tmp_path / 'study.yaml'}:{said}")

    def test_files_that_are_not_there_or_no_text(self, tmp_path):
        (tmp_path / "trials.yaml").write_text("")
        (tmp_path / ".pre-commit.yaml").write_text("")
        [line] = lines(tmp_path / "trial.yaml")
        assert line.endswith("no such file or directory.")
        [line] = lines(tmp_path)
        assert "is a directory" in line
        (tmp_path / "latin.yaml").write_bytes(b"name: caf\xe9\n")
        assert "utf-8" in lines(tmp_path / "latin.yaml")[0]

    def test_mappings_that_no_file_can_hold(self):
        for content in ({("a", "b"): 1}, {"x": object()}):
            [line] = lines(content)
            assert "what a study file can hold" in line

    def test_a_mission_function_that_raises(self, monkeypatch):
        def broken(*_, **__):
            raise RuntimeError("no such place")

        monkeypatch.setattr("botohe_moo.study.loading.load_mission", broken)
        [line] = lines(GOOD)
        assert "RuntimeError: no such place" in line

    def test_a_misspelt_keyword_is_blamed_on_the_class_that_was_given_it(self, local, tmp_path):
        local(
            """
            from botohe_moo import BOACO
            from botohe_moo.algorithms import ArchiveAlgorithm

            class Fast(BOACO):
                def __init__(self):
                    super().__init__(evaporatoin=0.2)

            class Bare(ArchiveAlgorithm):
                def __init__(self):
                    super().__init__()

            class Tied(Bare):
                def __init__(self):
                    super().__init__(max_ties=3)
            """
        )
        text = json.dumps(changed(algorithms={"a": "mine:Fast", "b": "mine:Tied"}))
        fast, tied = lines(written(tmp_path, text))
        assert (
            "'mine:Fast': BOACO: there is no parameter 'evaporatoin'; known are evaporation,"
            in fast
        )
        assert "Bare.__init__() got an unexpected keyword argument 'max_ties'" in tied


SCHEMA = jsonschema.Draft202012Validator(json.loads(study_schema()))


class TestSchema:
    def test_it_is_json_and_knows_all_keys(self):
        schema = SCHEMA.schema
        assert set(schema["properties"]) == set(StudyFile.model_fields)
        assert schema["additionalProperties"] is False
        assert all("description" in entry for entry in schema["properties"].values())

    def test_the_studies_keep_to_it(self):
        # What the schema has to allow: shorthands of missions, algorithms and seeds.
        for path in EXPERIMENTS:
            content = Document(path.read_text("utf-8")).content
            SCHEMA.validate(content)

    def test_shorthands_and_parameters_are_allowed_and_nothing_else(self):
        for changes in (
            {"seeds": [3, 4], "missions": ["toy"], "algorithms": {"a": {"algorithm": "nsga2"}}},
            {
                "algorithms": {
                    "a": {"algorithm": "pareto-local-search", "grid": {"max_size": [100, None]}}
                }
            },
            {"algorithms": {"a": {"algorithm": "my:Own", "parameters": {"evaporation": 2}}}},
            {"missions": {"a": {"mission": "terrain", "grid": {"nodes": [2, 3], "robots": [1]}}}},
        ):
            SCHEMA.validate(changed(**changes))
        for changes in (
            {"seeds": 0},
            {"name": "a/b"},
            {"missions": {"a": 3}},
            {"algorithms": {"a": {"algorithm": "x", "parameter": {}}}},
        ):
            assert not SCHEMA.is_valid(changed(**changes)), changes


@pytest.mark.slow
def test_published_results_can_be_made_again():
    # In a fresh clone the folder holds small tables only, and still has to be known as the study's.
    compared = {}
    for path in EXPERIMENTS:
        study = load_study(path)
        assert study.name == path.stem
        folder = path.parents[1] / "results" / study.name
        tracked = subprocess.run(
            ["git", "ls-files", "study.json"], cwd=folder, capture_output=True, text=True
        )
        if tracked.returncode == 0:  # not a copy without its history
            assert tracked.stdout.strip() == "study.json"
        StudyFolder(folder).check(study)
        assert list(read_manifest(folder)["algorithms"]) == [a.label for a in study.algorithms]
        compared[study.name] = {algorithm.algorithm for algorithm in study.algorithms}
    assert compared["baselines"] >= set(algorithm_names()) - {"exact", "pareto-local-search"}


def test_robots_are_stated_once():
    entry = {"mission": "toy", "robots": 3, "parameters": {"robots": 2}}
    [line] = lines(changed(missions={"a": entry}))
    assert "expected robots once, found it among the parameters, too" in line
