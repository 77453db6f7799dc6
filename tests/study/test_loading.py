"""Study files: everything wrong is reported at once, and grids expand as written."""

import json
import math
import os
import re
import subprocess
import sys
import textwrap
import tracemalloc
from dataclasses import replace
from itertools import product
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from botohe_moo import Kind, Mission, load_mission, save_mission
from botohe_moo.algorithms import algorithm_names
from botohe_moo.base.documents import Document
from botohe_moo.study.content import StudyFile
from botohe_moo.study.folder import StudyFolder, read_manifest
from botohe_moo.study.loading import load_study, study_schema
from botohe_moo.study.model import StudyError
from tests.plots.made import write_map
from tests.study.made import study_of
from tests.test_damaged_files import changed_bytes

ROOT = Path(__file__).parents[2]
EXPERIMENTS = sorted((ROOT / "experiments").glob("*.yaml"))
JOURNAL = "botohe_moo.algorithms.bo_aco:BOACO.journal"
HERE = "tests.study.algorithms_made"
OWN = "__main__:Mine"
MANY = {"algorithm": "bo-aco", "grid": {"n_ants": [*range(91, 111)]}}


def changed(**changes):
    defaults = {"algorithms": {"ants": "bo-aco"}, "budget": {"evaluations": 100}}
    return study_of(**{**defaults, **changes})


def with_ants(parameters, algorithm="bo-aco", *, grid=None, **changes):
    entry = {"algorithm": algorithm, "parameters": parameters, "grid": grid or {}}
    return changed(algorithms={"ants": entry}, **changes)


def mission_m(mission, **entry):
    return {"missions": {"m": {"mission": mission, **entry}}}


def lines(source):
    with pytest.raises(StudyError) as caught:
        load_study(source)
    return str(caught.value).splitlines()


def written(tmp_path, text):
    path = tmp_path / "study.yaml"
    path.write_text(text)
    return path


def digests(source):
    return {run.digest for run in load_study(source).runs()}


@pytest.fixture
def local(tmp_path, monkeypatch):
    """Write a module that nobody has installed."""

    def write(code, name="mine"):
        (tmp_path / f"{name}.py").write_text(textwrap.dedent(code))
        monkeypatch.syspath_prepend(str(tmp_path))
        monkeypatch.delitem(sys.modules, name, raising=False)

    return write


def test_paths_are_relative_to_the_file_that_names_them(tmp_path, monkeypatch):
    (maps := tmp_path / "studies" / "maps").mkdir(parents=True)
    write_map(maps, np.zeros((4, 4)), "mode: scale\n", resolution=1)  # from (-1, -2) to (3, 2)
    points = [
        {"properties": {"id": i}, "geometry": {"type": "Point", "coordinates": [i, 1]}}
        for i in range(2)
    ]
    line = {"type": "LineString", "coordinates": [[0, 1], [1, 1]]}
    features = [*points, {"properties": {"startid": 0, "endid": 1}, "geometry": line}]
    (maps.parent / "site.geojson").write_text(json.dumps({"features": features}))
    parameters = {"base": 0, "danger": 0.5, "hazard": "maps/map.yaml", "both_ways": True}
    mission = {"mission": "site.geojson", "robots": 1, "parameters": parameters}
    written(maps.parent, json.dumps(changed(missions={"site": mission})))
    monkeypatch.chdir(tmp_path)
    [mission] = load_study("studies/study.yaml").missions
    assert mission.mission.graph.edges[0, 1]["survival"] == pytest.approx(math.exp(-0.5))


class TestGrid:
    def test_runs_go_mission_by_mission_in_the_order_of_the_file(self):
        study = load_study(
            changed(missions=["toy", "art_museum"], algorithms=["random", "greedy"], seeds=[7, 3])
        )
        expected = product(["toy", "art_museum"], ["random", "greedy"], [7, 3])
        assert [(r.mission.label, r.algorithm.label, r.seed) for r in study.runs()] == [*expected]

    def test_every_combination_of_a_grid_is_an_entry(self):
        grid = {"repair": ["truncate", "penalty"], "prob_mutation": [0.5, 1]}
        entry = {"algorithm": "nsga2", "parameters": {"pop_size": 20}, "grid": grid}
        study = load_study(changed(algorithms={"N": entry, "ants": "botohe_moo:BOACO"}))
        *variants, ants = study.algorithms
        assert {a.label: dict(a.parameters) for a in variants} == {
            f"N (repair={r}, prob_mutation={p})": {"pop_size": 20, "repair": r, "prob_mutation": p}
            for r, p in product(*grid.values())
        }
        assert {a.family for a in variants} == {"N"}
        assert (ants.family, ants.grid) == ("ants", {})
        manifest = json.loads(json.dumps(study.manifest()))["algorithms"]
        last, ants = manifest["N (repair=penalty, prob_mutation=1)"], manifest["ants"]
        own = {"family": "N", "grid": {"repair": "penalty", "prob_mutation": 1}, "name": "nsga2"}
        assert last.items() >= (own | {"package": "botohe-moo"}).items()
        assert last["effective"].items() > last["parameters"].items() > last["grid"].items()
        assert ants["name"] == "botohe_moo:BOACO"
        assert ants["effective"].items() >= {"n_ants": 100, "n_threads": 1}.items()

    def test_generators_expand_over_seeds(self):
        entry = {"mission": "terrain", "parameters": {"nodes": 20}, "grid": {"seed": [1, 2]}}
        study = load_study(changed(missions={"hills": entry}))
        assert [m.label for m in study.missions] == ["hills (seed=1)", "hills (seed=2)"]
        assert study.missions[1].mission == load_mission("terrain", nodes=20, seed=2)
        second = study.manifest()["missions"]["hills (seed=2)"]
        assert (second["family"], second["grid"]) == ("hills", {"seed": 2})

    def test_a_mission_has_its_own_team_floor_and_budget(self):
        entry = {"mission": "toy", "robots": 3, "min_survival": 0.5, "budget": {"seconds": 2}}
        [mission] = load_study(changed(missions={"x": entry}, budget=None)).missions
        assert (mission.mission.robots, mission.min_survival) == (3, 0.5)
        assert (mission.budget.evaluations, mission.budget.seconds) == (None, 2)

    @pytest.mark.parametrize(
        ("keys", "longest"),
        [
            ({}, 10),
            ({"max_length": 4}, 4),
            ({"max_length": 0}, 0),
            ({"max_length": "unlimited"}, None),
        ],
    )
    def test_a_travel_budget(self, tmp_path, keys, longest):
        (tmp_path / "site.txt").write_text("n 3\nm 1\ntmax 10\n0 0 0\n1 0 5\n0 0 0\n")
        study = load_study(changed(**mission_m(str(tmp_path / "site.txt"), **keys)))
        manifest = study.manifest()["missions"]["m"]
        assert study.missions[0].max_length == manifest["max_length"] == longest
        assert ("max_length" in study.runs()[0].identity) == (longest is not None)


class TestIdentity:
    """What a run's result depends on is part of its digest, and nothing else is."""

    def test_labels_and_order_are_not_part_of_it(self):
        named = changed(missions={"x": "toy"}, algorithms={"y": "random", "z": "bo-aco"})
        assert digests(changed()) < digests(named)

    @pytest.mark.parametrize(
        "changes",
        [
            {"missions": {"toy": {"mission": "toy", "robots": 3}}},
            {"missions": {"toy": {"mission": "toy", "min_survival": 0.1}}},
            {"missions": {"toy": {"mission": "toy", "max_length": 9}}},
            {"algorithms": {"ants": {"algorithm": "bo-aco", "parameters": {"n_ants": 99}}}},
            {"algorithms": {"ants": JOURNAL}},
            {"budget": {"evaluations": 101}},
            {"budget": {"evaluations": 100, "seconds": 10}},
            {"recording": {"per_decade": 10}},
            {"seeds": [3, 4]},
        ],
    )
    def test_whatever_a_result_depends_on_is(self, changes):
        assert not digests(changed()) & digests(changed(**changes))

    @pytest.mark.parametrize(
        ("one", "other"),
        [
            (changed(), changed(title="x", indicators=["area"], bounds={"seconds": 9})),
            (changed(), changed(comparison={"control": "ants"})),
            (changed(), changed(budget={"evaluations": 100, "grace_seconds": 1})),
            (changed(), with_ants({"n_ants": 100, "n_threads": 3})),  # a default, and threads
            # A factory has a default of its own: that of the class is 0.04.
            (with_ants({}, JOURNAL), with_ants({"evaporation": 0.1, "n_threads": 2}, JOURNAL)),
            (
                with_ants({"prob_mutation": 1, "pop_size": 20}, "nsga2"),
                with_ants({"pop_size": 20, "prob_mutation": 1.0}, "nsga2"),
            ),
        ],
    )
    def test_nothing_else_is(self, one, other):
        assert digests(one) == digests(other)

    def test_so_are_the_versions(self):
        study = load_study(changed())
        for package in ("botohe-moo", "pymoo"):
            origin = {**study.algorithms[0].origin, package: "99.0"}
            other = replace(study, algorithms=(replace(study.algorithms[0], origin=origin),))
            assert not digests(changed()) & {run.digest for run in other.runs()}

    def test_threads_count_where_seconds_limit_a_run(self):
        budget = {"evaluations": 100, "seconds": 5}
        few, many = (digests(with_ants({"n_threads": n}, budget=budget)) for n in (1, 2))
        assert not few & many

    def test_code_of_ones_own_says_what_changes_no_result_and_an_edit_does(self, local):
        code = """
            from typing import Annotated
            from botohe_moo.algorithms import SameResult
            from tests.study.algorithms_made import Sampler

            class Mine(Sampler):
                def __init__(self, *, cores: Annotated[int, SameResult()] = 1, n: int = 9) -> None:
                    super().__init__(n)

                @classmethod
                def tuned(cls, **options) -> "Mine":
                    return cls(**{"n": 50, **options})
            """
        local(code)
        bare, cores, n = (
            digests(with_ants(given, "mine:Mine")) for given in ({}, {"cores": 4, "n": 9}, {"n": 8})
        )
        tuned, nine = (digests(with_ants(given, "mine:Mine.tuned")) for given in ({}, {"n": 9}))
        assert bare == cores
        assert not bare & n
        assert not tuned & nine  # the class gets 50, which nobody has stated
        local(code + "# edited")
        assert not bare & digests(with_ants({}, "mine:Mine"))


class TestFaults:
    @pytest.mark.parametrize(
        ("text", "expected"),
        [
            (
                """\
name: my study
titel: x
missions:
  d: {mission: toy, robots: 0}
algorithms:
  W: {algorithm: bo-aco, parameter: {}}
budget: {evaluations: 1e5, second: 3}
seeds: [1, 1]
comparison: {control: Q, significance: 2}
""",
                [
                    (1, "name: Expected name to match pattern '^[A-Za-z0-9][A-Za-z0-9._-]*$', got"),
                    (2, "titel: there is no key 'titel'; known are title,"),
                    (4, "robots: Expected robots >= 1, got 0"),
                    (6, "there is no key 'parameter'; known are parameters,"),
                    (7, "Expected evaluations to be an integer, got 100000.0"),
                    (7, "there is no key 'second'; known are seconds,"),
                    (8, "expected each seed once; 1 is there 2 times"),
                    (9, "Expected significance < 1"),
                ],
            ),
            (
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
budget: {evaluations: 100}
seeds: 1
""",
                [
                    (3, "'art_museun': no such mission; known are art_museum,"),
                    (6, "nodes: Expected nodes to be an integer >= 2, got '50'"),
                    (6, "sed: there is no parameter 'sed'; known are seed,"),
                    (7, "missing.json': no such file"),
                    (9, "'bo-acco': no such algorithm; known are bo-aco,"),
                    (13, "there is no parameter 'pop_sise'; known are pop_size,"),
                    (14, "Expected pop_size to be an integer in [2, 1000000], got 1.5"),
                    (15, "Expected n_ants in [1, 1000000], got 0"),
                    (15, "Expected evaporation in (0, 1), got 2.0"),
                ],
            ),
        ],
        ids=["keys", "names and parameters"],
    )
    def test_all_of_a_kind_are_reported_at_once_with_lines(self, tmp_path, text, expected):
        path = written(tmp_path, text)
        found = lines(path)
        for line, said in expected:
            of_line = [entry for entry in found if entry.startswith(f"{path}:{line}: ")]
            assert any(said in entry for entry in of_line), (said, found)

    @pytest.mark.parametrize(
        ("changes", "said"),
        [
            ({"name": None}, "name: expected the key 'name', which is missing."),
            ({"name": 2026}, "name: Expected name to be a text, got 2026."),
            ({"missions": [1]}, "missions: Expected missions to be a mapping, got [1]."),
            ({"algorithms": []}, "algorithms: Expected algorithms to have at least 1 item, got"),
            ({"algorithms": {"a": None}}, "algorithms.a: Expected a to be a mapping, got None."),
            ({"missions": {"e": "toy", "f": "toy"}}, "missions.f: 'f' is the same as 'e'."),
            ({"comparison": {"control": "Q"}}, "there is no algorithm 'Q'; known are ants."),
            ({"budget": {}}, "budget: expected evaluations or seconds, or both, found neither."),
            ({"budget": None}, "missions.toy.mission: 'toy': expected a budget of its own or of"),
            ({"budget": {"seconds": math.nan}}, "Expected seconds to be a finite number, got nan."),
            ({"seeds": "3"}, "seeds: expected a count or a list of seeds, got '3'."),
            ({"seeds": [-1]}, "seeds.0: Expected seeds[0] >= 0, got -1."),
            ({"algorithms": ["random", "random"]}, "expected each name once; 'random' is there 2"),
            (
                mission_m("terrain", grid={"seed": [3, 3.0]}),
                "m.grid.seed: expected each value once",
            ),
            ({"algorithms": {"_a": "random"}}, "(.*\\S)?$', got '_a'"),
            ({"missions": {" a": "toy"}}, "(.*\\S)?$', got ' a'"),
            (mission_m("toy", max_length=-1), ">= 0 or 'unlimited', got"),
            (mission_m("toy", robots=3, parameters={"robots": 2}), "found it among the parameters"),
            (mission_m(f"{HERE}:changing_mission"), "another mission each time; it needs a seed"),
            (mission_m(f"{HERE}:broken_mission"), "RuntimeError: no such place"),
            (
                with_ants({"n_ants": 2}, grid={"n_ants": [1]}),
                "algorithms.ants: expected each parameter once; 'n_ants' is there 2 times.",
            ),
            (
                {"seeds": 100_000, "algorithms": {"a": MANY}},
                "seeds: expected at most 250,000 runs, found 2,000,000.",
            ),
            (
                {"algorithms": {"a": "bo-aco", "b": MANY}},
                "algorithms.b: 'b (n_ants=100)' is the same as 'a': defaults and",
            ),
            # Nothing but algorithms and missions is called: this harms nobody, and is refused.
            (
                with_ants({"command": "true"}, "os:system"),
                "a class derived from Algorithm",
            ),
            (
                mission_m("os:system", parameters={"command": "true"}),
                "a class derived from Mission",
            ),
            # Processes of runs cannot import what a notebook or script defines.
            (with_ants({}, OWN), "save Mine in a file, such as mine.py, and write mine:Mine"),
            (mission_m(OWN), "m.mission: runs are performed in other processes, which cannot"),
            ({"problem": OWN}, "problem: runs "),
            (
                with_ants({}, "nsga2", grid={"repair": [OWN]}),
                "algorithms.ants.grid.repair.0: runs ",
            ),
        ],
    )
    def test_each_is_named_and_nothing_that_follows_from_it(self, changes, said):
        [line] = lines(changed(**changes))
        assert said in line

    def test_limits_that_a_kind_cannot_keep(self, tmp_path):
        site = Mission(load_mission("toy").graph, base=1, kinds=[Kind("drone", 1, end=2)])
        save_mission(site, tmp_path / "site.json")
        path = written(tmp_path, json.dumps(changed(**mission_m("site.json", min_survival=0.99))))
        *_, line = lines(path)
        place = f"{path}:1: missions.m.mission: 'site.json': "
        assert f"{place}Mission 'toy': robots of kind 'drone' cannot keep min_survival" in line

    @pytest.mark.parametrize(
        ("data", "said"),
        [
            (b"", "study.yaml:1: Expected the file to be a mapping, got None."),
            (b"name: x\nmissions: [\n", "study.yaml: line 3: not valid YAML: while parsing a flow"),
            (b"name: &m [*m]\n", "line 1: not valid YAML: found unconstructable recursive node"),
            (b"name: caf\xe9\n", "utf-8"),
            (None, "no such file or directory."),
            ({("a", "b"): 1}, "what a study file can hold"),
            ({"x": object()}, "what a study file can hold"),
        ],
    )
    def test_what_is_no_study(self, tmp_path, data, said):
        path = tmp_path / "study.yaml"
        if isinstance(data, bytes):
            path.write_bytes(data)
        [line] = lines(data if isinstance(data, dict) else path)
        assert said in line

    def test_a_misspelt_keyword_is_blamed_on_the_class_that_was_given_it(self, local):
        local(
            """
            from botohe_moo import BOACO

            class Fast(BOACO):
                def __init__(self):
                    super().__init__(evaporatoin=0.2)
            """
        )
        [fast] = lines(with_ants({}, "mine:Fast"))
        assert "'mine:Fast': BOACO: there is no parameter 'evaporatoin'; known are evap" in fast


def test_the_schema():
    schema = jsonschema.Draft202012Validator(json.loads(study_schema()))
    assert set(schema.schema["properties"]) == set(StudyFile.model_fields)
    assert schema.schema["additionalProperties"] is False
    assert all("description" in entry for entry in schema.schema["properties"].values())
    for path in EXPERIMENTS:  # with shorthands of missions, algorithms and seeds
        schema.validate(Document(path.read_text("utf-8")).content)
    sizes = {"algorithm": "pareto-local-search", "grid": {"max_size": [100, None]}}
    schema.validate(changed(seeds=[3, 4], algorithms={"a": sizes}))
    schema.validate(with_ants({"evaporation": 2}, "my:Own"))
    wrong = {"algorithms": {"a": {"algorithm": "x", "parameter": {}}}}
    for changes in ({"seeds": 0}, {"name": "a/b"}, {"missions": {"a": 3}}, wrong):
        assert not schema.is_valid(changed(**changes)), changes


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


# Study files that were changed at random, or ask for too much: read or refused.
# ``BOTOHE_MUTATIONS=8000 pytest tests/study/test_loading.py`` looks longer.

N_MUTATED = int(os.environ.get("BOTOHE_MUTATIONS", "25"))
GUIDE = (ROOT / "docs" / "studies.md").read_text("utf-8").split("```yaml\n")[1].split("```")[0]
TEXTS = [path.read_text("utf-8") for path in EXPERIMENTS]
TEXTS.append(GUIDE.replace("sites/mine.json", "art_museum"))
TEXTS.append(
    "name: merged\nseeds: [3, 1]\nbudget: &b {evaluations: 100}\n"
    "missions: {a: &m {mission: toy, budget: *b}, b: {<<: *m, min_survival: 0.5}}\n"
    "algorithms: {A: &n {algorithm: nsga2, grid: {pop_size: [5, 10]}}, "
    "B: {<<: [*n, {}], grid: {}}}\n"
)
WORD = re.compile(rb"[^\s\[\]{},:#]+")
PIECES = [
    *("", "0", "-1", "2", "1e3", "1e999", ".inf", ".nan", "1000", "20000", "100_000", "1000000"),
    *("4294967296", "9" * 30, "9" * 5_000, "9_" * 20_000, "true", "null", "~", "''", '""', "[]"),
    *("{}", "*a", "*b", "*m", "&a", "<<", "<<: *m", "!x", "!!str 5", "!!int x", "!!binary eA=="),
    *("'", '"', ":", "- ", "? ", "|", ">", "#", "%", "@", "`", "\t", "\n", "\n  ", "\n    "),
    *("\0", "\x7f", "é", "\u2028", "😀", '"\\ud800"', '"\\UFFFFFFFF"', "x" * 3_000, "[1, 2, 3]"),
    *("{a: 1}", "[" * 60 + "]" * 60, "{grid: {seed: [1, 2, 3]}}", "os:system", "botohe_moo:BOACO"),
    *("pymoo.algorithms.moo.nsga3:NSGA3", "terrain", "complete", "random", "../x.json", "a:b"),
]


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("mutated") / "study.yaml"


def read(path, data):
    """Read a file: a study, or the lines that say what is wrong, which one can read."""
    path.write_bytes(data)
    try:
        return load_study(path)
    except StudyError as error:
        found = str(error).splitlines()
        assert max(map(len, found)) < 2_000
        return found


@settings(max_examples=N_MUTATED)
@given(
    st.sampled_from(TEXTS).flatmap(
        lambda text: changed_bytes(text.encode(), WORD, [piece.encode() for piece in PIECES])
    )
)
def test_changed_files_are_read_or_refused(path, data):
    found = read(path, data)
    if isinstance(found, list):
        for line in found:
            assert line.startswith(f"{path}:")
    else:
        assert len({run.digest for run in found.runs()}) <= 250_000


SEEDS = "name: x\nmissions: [toy]\nalgorithms: [random]\nbudget: {evaluations: 100}\nseeds: "
ALGORITHM = "name: x\nmissions: [toy]\nbudget: {evaluations: 9}\nseeds: 1\nalgorithms: "
TEN = ", ".join(f"p{i}: [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]" for i in range(3))
TWO = ", ".join(f"p{i}: [1, 2]" for i in range(4_000))


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    {
        "a long file": f"{SEEDS}1\ntitle: '{'x' * 1_000_000}'\n",
        "repeated keys": f"{SEEDS}1\n" + "key: 1\n" * 9_000,
        "a grid": f"{ALGORITHM}{{a: {{algorithm: nsga2, grid: {{{TEN}, q: [1, 2]}}}}}}\n",
        "a grid of many": f"{ALGORITHM}{{a: {{algorithm: nsga2, grid: {{{TWO}}}}}}}\n",
        "runs": f"{SEEDS}100000\n".replace("[random]", "[random, greedy, bo-aco]"),
    }.items(),
    ids=lambda case: case[0],
)
def test_what_would_grow_is_refused(path, text):
    """Each took minutes, gigabytes, or a message of megabytes."""
    assert isinstance(read(path, text[1].encode()), list)


@pytest.mark.slow
def test_a_run_takes_little_memory(path):
    study = read(path, f"{SEEDS}5000\n".encode())
    tracemalloc.start()
    runs = study.runs()
    taken = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert len(runs) == 5_000
    assert taken / len(runs) < 300
