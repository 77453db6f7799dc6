"""Study files: everything wrong is reported at once, and grids expand as written."""

import json
import math
import os
import subprocess
import sys
import textwrap
from importlib import metadata
from pathlib import Path

import jsonschema
import numpy as np
import pytest
import yaml

from botohe_moo import Mission, load_mission, save_mission
from botohe_moo.algorithms import algorithm_names
from botohe_moo.mission.digest import mission_digest
from botohe_moo.study.file.config import StudyFile
from botohe_moo.study.file.loading import load_study
from botohe_moo.study.file.model import StudyError
from botohe_moo.study.file.schema import study_schema
from botohe_moo.study.judge.summary import algorithm_table
from botohe_moo.study.planning import make_task
from botohe_moo.study.store.folder import StudyFolder
from botohe_moo.study.store.tables import read_manifest

EXPERIMENTS = sorted((Path(__file__).parents[2] / "experiments").glob("*.yaml"))

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
        study = load_study(changed(algorithms={"N": entry}))
        assert {a.label: dict(a.parameters) for a in study.algorithms} == {
            f"N (repair={repair}, prob_mutation={prob})": {
                "pop_size": 20,
                "repair": repair,
                "prob_mutation": prob,
            }
            for repair in ("truncate", "penalty")
            for prob in (0.5, 1)
        }

    def test_generators_expand_over_seeds(self):
        entry = {"mission": "terrain", "parameters": {"nodes": 20}, "grid": {"seed": [1, 2]}}
        study = load_study(changed(missions={"hills": entry}))
        assert [m.label for m in study.missions] == ["hills (seed=1)", "hills (seed=2)"]
        assert study.missions[1].mission == load_mission("terrain", nodes=20, seed=2)

    def test_members_say_which_entry_they_are_from(self):
        study = load_study(
            changed(
                missions={
                    "toy": "toy",
                    "hills": {
                        "mission": "terrain",
                        "parameters": {"nodes": 20},
                        "grid": {"seed": [1, 2]},
                    },
                },
                algorithms={
                    "N": {
                        "algorithm": "nsga2",
                        "parameters": {"pop_size": 20},
                        "grid": {"prob_mutation": [0.5, 1]},
                    },
                    "ants": "botohe_moo:BOACO",
                },
            )
        )
        expected = [("toy", {}), ("hills", {"seed": 1}), ("hills", {"seed": 2})]
        assert [(m.family, m.grid) for m in study.missions] == expected
        expected = [("N", {"prob_mutation": 0.5}), ("N", {"prob_mutation": 1}), ("ants", {})]
        assert [(a.family, a.grid) for a in study.algorithms] == expected
        manifest = json.loads(json.dumps(study.manifest()))
        mission = manifest["missions"]["hills (seed=2)"]
        assert (mission["family"], mission["grid"]) == ("hills", {"seed": 2})
        nsga2 = manifest["algorithms"]["N (prob_mutation=1)"]
        assert (nsga2["family"], nsga2["grid"]) == ("N", {"prob_mutation": 1})
        assert (nsga2["name"], nsga2["package"]) == ("nsga2", "botohe-moo")
        assert nsga2["parameters"] == {"pop_size": 20, "prob_mutation": 1}
        assert nsga2["effective"].items() > nsga2["parameters"].items()
        ants = manifest["algorithms"]["ants"]
        assert (ants["algorithm"], ants["name"]) == ("botohe_moo:BOACO", "bo-aco")
        assert ants["effective"].items() >= {"n_ants": 100, "n_threads": 1}.items()

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

    @pytest.mark.parametrize(
        ("keys", "expected"),
        [
            ({}, 10),
            ({"max_length": 4}, 4),
            ({"max_length": 0}, 0),
            ({"max_length": "unlimited"}, None),
        ],
    )
    def test_a_travel_budget(self, tmp_path, keys, expected):
        (tmp_path / "site.txt").write_text("n 2\nm 1\ntmax 10\n0 0 0\n1 0 5\n")
        entry = {"mission": str(tmp_path / "site.txt"), **keys}
        study = load_study(changed(missions={"x": entry}))
        assert study.missions[0].max_length == expected
        assert study.manifest()["missions"]["x"]["max_length"] == expected
        [task, _] = map(make_task, study.runs())
        assert task.max_length == (math.inf if expected is None else expected)
        assert ("max_length" in study.runs()[0].identity) == (expected is not None)

    def test_lengths_from_pos(self):
        entry = {"mission": "terrain", "parameters": {"nodes": 9}, "lengths_from_pos": True}
        study = load_study(changed(missions={"x": entry}))
        terrain = load_mission("terrain", nodes=9)
        assert study.missions[0].mission == terrain.with_lengths_from_pos() != terrain
        assert study.missions[0].source == {
            "name_or_path": "terrain",
            "nodes": 9,
            "lengths_from_pos": True,
        }
        entry["parameters"]["lengths_from_pos"] = True
        [said] = lines(changed(missions={"x": entry}))
        assert "lengths_from_pos stands in the mission's own keys." in said

    @pytest.mark.parametrize("wrong", [-1, "none", True, float("inf"), float("nan"), [1]])
    def test_what_is_no_travel_budget(self, wrong):
        entry = {"mission": "toy", "max_length": wrong}
        assert "max_length" in lines(changed(missions={"x": entry}))[0]

    @pytest.mark.parametrize(
        ("seeds", "expected"),
        [(3, (1, 2, 3)), ([7, 3], (7, 3)), ({"count": 2}, (1, 2)), ({"values": [5]}, (5,))],
    )
    def test_seeds(self, seeds, expected):
        assert load_study(changed(seeds=seeds)).seeds == expected

    def test_seeds_derive_from_study_seed_and_repetition(self):
        few, many, other = (
            load_study(changed(seeds={"count": count, "seed": seed})).seeds
            for count, seed in ((2, 9), (50, 9), (50, 10))
        )
        assert many[:2] == few
        assert len(set(many)) == 50
        assert not set(many) & set(other)
        assert few[0] == np.random.SeedSequence([9, 1]).generate_state(1)[0]


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

    @pytest.mark.parametrize(
        "changes",
        [
            {"missions": {"toy": {"mission": "toy", "robots": 3}}},
            {"missions": {"toy": {"mission": "toy", "min_survival": 0.1}}},
            {"missions": {"toy": {"mission": "toy", "max_length": 9}}},
            {"algorithms": {"ants": {"algorithm": "bo-aco", "parameters": {"n_ants": 99}}}},
            {"budget": {"evaluations": 101}},
            {"budget": {"evaluations": 100, "seconds": 10}},
            {"recording": {"per_decade": 10}},
            {"seeds": [3, 4]},
        ],
    )
    def test_whatever_a_result_depends_on_is(self, changes):
        assert not set(digests(GOOD)) & set(digests(changed(**changes)))

    @pytest.mark.parametrize(
        "changes",
        [
            {"budget": {"evaluations": 100, "grace_seconds": 1}},
            {"recording": {"at": [101]}},
            {"comparison": {"control": "ants"}},
            {"indicators": ["area"]},
            {"title": "x"},
            {"bounds": {"seconds": 9}},
        ],
    )
    def test_nothing_else_is(self, changes):
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

    @pytest.mark.parametrize("package", ["botohe-moo", "pymoo"])
    def test_so_are_the_versions(self, monkeypatch, package):
        before = digests(GOOD)
        monkeypatch.setattr(
            "botohe_moo.study.file.digest._version",
            lambda name: "99.0" if name == package else metadata.version(name),
        )
        assert not set(before) & set(digests(GOOD))

    def test_more_seeds_and_algorithms_leave_the_others(self):
        more = changed(algorithms=["random", "bo-aco"], seeds=5)
        assert set(digests(GOOD)) < set(digests(more))

    def test_it_is_the_same_in_another_process(self):
        code = (
            "from botohe_moo.study.file.loading import load_study\n"
            f"print(*(run.digest for run in load_study({GOOD!r}).runs()))"
        )
        said = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
        assert said.stdout.decode().split() == digests(GOOD)

    @pytest.mark.parametrize(
        "algorithm",
        [
            {"algorithm": "bo-aco", "parameters": {"n_ants": 100, "evaporation": 0.04}},
            {"algorithm": "bo-aco", "parameters": {"exploration": 0, "initial_pheromone": 1}},
            {"algorithm": "bo-aco", "parameters": {"n_threads": 2}},
            {"algorithm": "bo-aco", "grid": {"n_threads": [3]}},
            "botohe_moo.algorithms.bo_aco:BOACO",
            "botohe_moo.algorithms.bo_aco.BOACO",
            "botohe_moo:BOACO",
            {"algorithm": "botohe_moo.algorithms:BOACO", "parameters": {"n_ants": 100}},
        ],
    )
    def test_nor_are_spellings(self, algorithm):
        """Explicit defaults, numbers of threads and paths to the same class."""
        assert digests(changed(algorithms={"ants": algorithm})) == digests(GOOD)

    def test_a_run_without_defaults_keeps_the_name_it_had(self):
        [run] = load_study(changed(seeds=1)).runs()
        assert (run.identity["algorithm"], run.identity["parameters"]) == ("bo-aco", {})
        [run] = load_study(changed(seeds=1, algorithms=[JOURNAL])).runs()
        assert (run.identity["algorithm"], run.identity["parameters"]) == (JOURNAL, {})

    def test_a_factory_of_the_same_class_is_another_algorithm(self):
        # Its own default counts, 0.1; not that of the class, 0.04.
        journal, explicit, same, other = (
            digests(changed(algorithms={"a": {"algorithm": path, "parameters": parameters}}))
            for path, parameters in (
                (JOURNAL, {}),
                (JOURNAL, {"evaporation": 0.1, "n_threads": 2}),
                ("botohe_moo:BOACO.journal", {}),
                (JOURNAL, {"evaporation": 0.04}),
            )
        )
        assert journal == explicit == same
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
        [effective] = [a.identity.effective for a in bare.algorithms]
        assert effective == {"n": 50}

    def test_what_a_class_hands_to_its_base_stands_in_the_table(self, local):
        local(
            """
            from botohe_moo import BOACO
            from botohe_moo.algorithms import PlanNSGA2

            class Fast(BOACO):
                def __init__(self, **options):
                    super().__init__(evaporation=0.2, heuristic=False, **options)

            class Small(PlanNSGA2):
                def __init__(self, **options):
                    super().__init__(pop_size=20, repair="truncate", **options)
            """
        )
        names = ["bo-aco", "mine:Fast", "nsga2", "mine:Small"]
        table = algorithm_table(load_study(changed(algorithms=names)).manifest())
        assert table[table.columns[5:]].astype(object).where(table.notna(), None).to_dict(
            "list"
        ) == {
            "evaporation": [0.04, 0.2, None, None],
            "heuristic": [True, False, None, None],
            "pop_size": [None, None, 100, 20],
            "repair": [None, None, "safest-path", "truncate"],
        }

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
            from pydantic import BaseModel, Field
            from botohe_moo.algorithms import SameResult
            from tests.study.algorithms_made import Sampler

            class Signed(Sampler):
                def __init__(
                    self,
                    *,
                    cores: Annotated[int, Field(ge=1), SameResult()] | None = None,
                    n: int = 9,
                ) -> None:
                    super().__init__(n)

            class Modelled(Signed):
                class Parameters(BaseModel):
                    cores: Annotated[int, Field(ge=1), SameResult] = 1
                    n: int = 9
            """
        )
        for name in ("Signed", "Modelled"):
            bare, cores, n = (
                digests(changed(algorithms={"a": {"algorithm": f"mine:{name}", "parameters": p}}))
                for p in ({}, {"cores": 4, "n": 9}, {"n": 8})
            )
            assert bare == cores
            assert not set(bare) & set(n)

    def test_missions_differ_by_what_robots_meet_not_by_names(self):
        toy = load_mission("toy")
        graph = toy.graph.copy()
        graph.graph["title"] = "Something else"
        tail, head = next(iter(graph.edges))
        assert mission_digest(Mission(graph, name="other")) == mission_digest(toy)
        graph.edges[tail, head]["survival"] *= 0.99
        assert mission_digest(Mission(graph)) != mission_digest(toy)

    def test_an_edited_local_algorithm_is_another(self, tmp_path, monkeypatch):
        module = tmp_path / "local_ants.py"
        module.write_text("from botohe_moo import BOACO\nclass Ants(BOACO): ...\n")
        monkeypatch.syspath_prepend(tmp_path)
        source = changed(algorithms={"ants": "local_ants:Ants"})
        before = digests(source)
        assert digests(source) == before
        module.write_text(module.read_text() + "# edited\n")
        assert not set(digests(source)) & set(before)


ALIKE = ": defaults, spellings and numbers of threads make no other run"


class TestFaults:
    def test_all_are_reported_at_once_with_lines(self, tmp_path):
        path = written(
            tmp_path,
            """\
name: my study
titel: x
missions:
  a: art_museun
  b:
    mission: terrain
    parameters: {nodes: "50", sed: 3}
  c: {mission: missing.json}
  d: {mission: toy, robots: 0}
  e: toy
  f: toy
algorithms:
  X: bo-acco
  Y:
    algorithm: nsga2
    parameters:
      pop_sise: 3
      pop_size: 1.5
  Z: {algorithm: bo-aco, grid: {n_ants: [10, 0, 10]}, parameters: {evaporation: 2.0}}
  W: {algorithm: bo-aco, parameter: {}}
  V: {algorithm: nsga2, parameters: {repair: best, sampling: [1]}}
budget: {evaluations: 1e5, second: 3}
seeds: [1, 1]
comparison: {control: Q, significance: 2}
indicators: [area, igd]
""",
        )
        found = lines(path)
        expected = [
            (1, "name: Expected name of letters"),
            (2, "titel: there is no key 'titel'; known are title,"),
            (4, "'art_museun': there is no such mission; known are art_museum,"),
            (7, "nodes: Expected nodes to be an integer >= 2, got '50'"),
            (7, "sed: there is no parameter 'sed'; known are seed,"),
            (8, "missing.json': there is no such file"),
            (9, "robots: Expected robots >= 1, got 0"),
            (11, "'f' is the same as 'e'"),
            (13, "'bo-acco': there is no such algorithm; known are bo-aco,"),
            (17, "there is no parameter 'pop_sise'; known are pop_size,"),
            (18, "Expected pop_size to be an integer in [2, 1000000], got 1.5"),
            (19, "Expected n_ants in [1, 1000000], got 0"),
            (19, "grid.n_ants: expected different values"),
            (19, "Expected evaporation in (0, 1), got 2.0"),
            (20, "there is no key 'parameter'; known are parameters,"),
            (21, "repair"),
            (22, "Expected evaluations to be an integer, got 100000.0"),
            (22, "there is no key 'second'; known are seconds,"),
            (23, "expected each seed once, got 1 twice"),
            (24, "Expected significance < 1"),
            (25, "indicators[1]"),
        ]
        for line, said in expected:
            assert any(entry.startswith(f"{path}:{line}: ") and said in entry for entry in found), (
                line,
                said,
                found,
            )

    @pytest.mark.parametrize(
        ("changes", "said"),
        [
            ({"name": None}, "name: expected the key 'name', which is missing."),
            ({"missions": {}}, "missions"),
            ({"missions": [1]}, "missions"),
            ({"algorithms": []}, "algorithms"),
            ({"algorithms": {"a": 3}}, "algorithms.a"),
            ({"algorithms": {"a": {"algorithm": ""}}}, "algorithms.a.algorithm"),
            ({"budget": {}}, "expected evaluations or seconds"),
            ({"budget": None}, "missions.toy: expected a budget"),
            ({"budget": {"evaluations": 0}}, "Expected evaluations >= 1, got 0."),
            ({"budget": {"evaluations": True}}, "to be an integer, got True"),
            ({"budget": {"seconds": 0}}, "seconds"),
            ({"budget": {"seconds": float("inf")}}, "seconds"),
            ({"seeds": 0}, "seeds: Expected seeds >= 1, got 0."),
            ({"seeds": "3"}, "seeds: Expected seeds to be an integer, got '3'."),
            ({"seeds": []}, "seeds: Expected seeds not to be empty, got []."),
            ({"seeds": [-1]}, "seeds.0: Expected seeds[0] >= 0, got -1."),
            ({"seeds": {"values": [-1]}}, "seeds.values.0: Expected values[0] >= 0, got -1."),
            ({"seeds": {"count": 1, "values": [1]}}, "either count or values"),
            ({"recording": {"start": 0.5}}, "start"),
            ({"indicators": []}, "indicators"),
            ({"bounds": 300}, "bounds: Expected bounds to be a mapping, got 300."),
            ({"bounds": {}}, "bounds.seconds: expected the key 'seconds', which is missing."),
            ({"bounds": {"seconds": 0}}, "bounds.seconds: Expected seconds > 0, got 0"),
            ({"bounds": {"seconds": "9"}}, "to be a number, got '9'."),
            ({"bounds": {"seconds": float("nan")}}, "bounds.seconds: "),
            ({"bounds": {"second": 9}}, "there is no key 'second'; known are seconds."),
            ({"bound": {"seconds": 9}}, "there is no key 'bound'; known are bounds,"),
            ({"indicators": ["area", "area"]}, "expected each once, got 'area' 2 times"),
            (
                {"algorithms": ["random", "random"]},
                "expected each of algorithms once, got 'random' 2 times",
            ),
            ({"algorithms": {"_a": "random"}}, "does not begin with _"),
            ({"algorithms": {"a\x1bb": "random"}}, "printable"),
            (
                {"missions": {"m": {"mission": "tests.study.algorithms_made:changing_mission"}}},
                "gives another mission each time",
            ),
            ({"comparison": {"control": "ant"}}, "there is no algorithm 'ant'"),
            ({"missions": {"t": {"mission": "toy", "parameters": {"x": 1}}}}, "parameter 'x'"),
            (
                {"missions": {"a": {"mission": "toy", "parameters": {"name_or_path": "x"}}}},
                "name_or_path stands in the mission's own keys",
            ),
            (
                {"missions": {"a": {"mission": "toy", "robots": 1, "grid": {"robots": [2]}}}},
                "robots stands in the mission's own keys",
            ),
            ({"missions": {" a": "toy"}}, "without spaces around it, got ' a'"),
            ({"algorithms": {"a\nb": "random"}}, "in one line"),
            (
                {"algorithms": {"a": {"algorithm": "bo-aco", "grid": {"n_ants": []}}}},
                "n_ants",
            ),
            (
                {
                    "algorithms": {
                        "a": {
                            "algorithm": "bo-aco",
                            "grid": {"n_ants": [1]},
                            "parameters": {"n_ants": 2},
                        }
                    }
                },
                "stands in parameters, too",
            ),
            (
                {"algorithms": {"a": {"algorithm": "bo-aco", "parameters": {"sampling": [1]}}}},
                "sampling",
            ),
            (
                {
                    "seeds": 100_000,
                    "algorithms": {
                        "a": {"algorithm": "bo-aco", "grid": {"n_ants": list(range(1, 21))}}
                    },
                },
                "at most 250,000 runs, found 2,000,000.",
            ),
        ],
    )
    def test_each_is_named(self, changes, said):
        found = lines(changed(**changes))
        assert any(said in line for line in found), found
        assert len(found) <= 2

    def test_bounds_without_seconds(self):
        [said] = lines({**GOOD, "bounds": None})
        assert said == 'bounds: "bounds:" has no value: expected seconds.'

    @pytest.mark.parametrize(
        ("one", "other", "why"),
        [
            ("bo-aco", "bo-aco", ""),
            ("bo-aco", "botohe_moo:BOACO", ALIKE),
            ("bo-aco", {"algorithm": "bo-aco", "parameters": {"n_ants": 100}}, ALIKE),
            ("bo-aco", {"algorithm": "bo-aco", "parameters": {"n_threads": 2}}, ALIKE),
            ({"algorithm": "bo-aco", "grid": {"n_ants": [5, 100]}}, "bo-aco", ALIKE),
        ],
    )
    def test_runs_that_would_be_the_same(self, one, other, why):
        [line] = lines(changed(algorithms={"a": one, "b": other}))
        first = "a" if isinstance(one, str) else "a (n_ants=100)"
        assert line == f"algorithms.b: 'b' is the same as {first!r}{why}."

    @pytest.mark.parametrize("kind", ["algorithm", "mission"])
    @pytest.mark.parametrize("path", ["os:system", "local_harm:run", "local_harm:os.system"])
    def test_nothing_but_algorithms_and_missions_is_called(self, local, tmp_path, kind, path):
        """Point 2 of the issue: ``study plan`` called ``os.system`` while it checked the file."""
        local("import os\ndef run(*, command):\n    os.system(command)\n", "local_harm")
        entry = {kind: path, "parameters": {"command": f"touch {tmp_path / 'harm'}"}}
        [line] = lines(changed(**{f"{kind}s": {"x": entry}}))
        assert line.startswith(f"{kind}s.x.{kind}: {path!r}: it is not called, because ")
        assert f"register it as entry point of 'botohe_moo.{kind}s'" in line
        assert not (tmp_path / "harm").exists()

    def test_missions_that_differ_in_what_no_run_heeds(self):
        budget = {"evaluations": 100}
        other = {"mission": "toy", "budget": {**budget, "seconds": 3}}
        load_study(changed(missions={"a": "toy", "b": other}))
        other["budget"] = {**budget, "grace_seconds": 3}
        [line] = lines(changed(missions={"a": "toy", "b": other}))
        assert line == "missions.b: 'b' is the same as 'a'."

    def test_threads_may_be_compared_at_equal_seconds(self):
        grid = {"algorithm": "bo-aco", "grid": {"n_threads": [1, 2]}}
        study = load_study(changed(budget={"seconds": 1}, algorithms={"a": grid}))
        assert len({run.digest for run in study.runs()}) == len(study.runs()) == 4

    @pytest.mark.parametrize("text", ["", "- a\n", "3\n", "just text\n"])
    def test_what_is_no_mapping(self, tmp_path, text):
        [line] = lines(written(tmp_path, text))
        assert "expected a mapping with the keys of a study" in line

    def test_broken_yaml(self, tmp_path):
        [line] = lines(written(tmp_path, "name: x\nmissions: [\n"))
        assert line.startswith(f"{tmp_path / 'study.yaml'}:3: not valid YAML")

    def test_keys_that_stand_twice_beside_other_faults(self, tmp_path):
        text = "name: x\nname: y\nmissions: [toy]\nalgorithms: [bo-aco]\nseeds: 0\n"
        found = lines(written(tmp_path, text))
        assert [line.partition("study.yaml:")[2][0] for line in found] == ["2", "3", "5"]

    def test_files_that_are_not_there_or_no_text(self, tmp_path):
        (tmp_path / "trials.yaml").write_text("")
        (tmp_path / ".pre-commit.yaml").write_text("")
        [line] = lines(tmp_path / "trial.yaml")
        assert line.endswith("there is no such file; beside it are trials.yaml.")
        [line] = lines(tmp_path)
        assert "cannot be read" in line
        (tmp_path / "latin.yaml").write_bytes(b"name: caf\xe9\n")
        assert "UTF-8" in lines(tmp_path / "latin.yaml")[0]

    def test_pipes_are_not_waited_for(self, tmp_path):
        path = tmp_path / "study.yaml"
        os.mkfifo(path)
        with pytest.raises(StudyError, match=r"study\.yaml: cannot be read .*a device or a pipe"):
            load_study(path)

    def test_mission_files_with_faults(self, tmp_path):
        (tmp_path / "bad.json").write_text("{}")
        found = lines(written(tmp_path, json.dumps(changed(missions=["bad.json"]))))
        assert all("bad.json" in line for line in found)

    @pytest.mark.parametrize("content", [{("a", "b"): 1}, {"x": object()}, {"x": {1, 2}}])
    def test_mappings_that_no_file_can_hold(self, content):
        [line] = lines(content)
        assert "what a study file can hold" in line

    def test_a_mapping_that_holds_itself(self):
        content = changed()
        content["missions"] = content
        [line] = lines(content)
        assert "what a study file can hold" in line

    def test_a_mission_function_that_raises(self, monkeypatch):
        def broken(*_, **__):
            raise RuntimeError("no such place")

        monkeypatch.setattr("botohe_moo.study.file.checking.load_mission", broken)
        [line] = lines(GOOD)
        assert "RuntimeError: no such place" in line

    def test_a_misspelt_keyword_is_blamed_on_the_class_that_was_given_it(self, local, tmp_path):
        local(
            """
            from pymoo.algorithms.moo.nsga2 import NSGA2
            from botohe_moo import BOACO
            from botohe_moo.algorithms import ArchiveAlgorithm, PlanNSGA2, PopulationAlgorithm

            def passing(base, *arguments, **keywords):
                class Passing(base):
                    def __init__(self, **options):
                        super().__init__(*arguments, **keywords, **options)
                return Passing

            class Bare(ArchiveAlgorithm):
                def __init__(self):
                    super().__init__()

            class Pymoo(PopulationAlgorithm, NSGA2):
                pass

            A = passing(BOACO, evaporatoin=0.2)
            B = passing(A)
            C = passing(PlanNSGA2, pop_sise=20)
            D = passing(Pymoo, prob_crosover=0.2)
            E = passing(Pymoo, {"pop_sise": 20})
            F = passing(ArchiveAlgorithm, max_tie=3)
            G = passing(Bare, max_ties=3)
            H = passing(ArchiveAlgorithm, terminatoin=3)

            class I(BOACO):
                def __init__(self, *, ants=3):
                    super().__init__(ants=ants)

            class J(BOACO):
                def __init__(self, *, strength=3):
                    super().__init__(strenght=strength)
            """
        )
        algorithms = "".join(f"  {label}: mine:{label}\n" for label in "ABCDEFGHIJ")
        more = "name: x\nmissions: [toy]\nbudget: {evaluations: 9}\nseeds: 1\n"
        path = written(tmp_path, f"{more}algorithms:\n{algorithms}")
        refused = "{} has no parameter '{}'; known are {}".format
        assert [line.partition(", ")[0] for line in lines(path)] == [
            f"{path}:{number}: algorithms.{label}.algorithm: 'mine:{label}': {said}"
            for number, label, said in [
                (6, "A", refused("BOACO", "evaporatoin", "evaporation")),
                (7, "B", refused("BOACO", "evaporatoin", "evaporation")),
                (8, "C", refused("PlanNSGA2", "pop_sise", "pop_size")),
                (9, "D", refused("PopulationAlgorithm", "prob_crosover", "prob_crossover")),
                (10, "E", refused("NSGA2", "pop_sise", "pop_size")),
                (11, "F", refused("ArchiveAlgorithm", "max_tie", "max_ties")),
                (12, "G", "Bare.__init__() got an unexpected keyword argument 'max_ties'"),
                (13, "H", refused("ArchiveAlgorithm", "terminatoin", "termination")),
                (14, "I", refused("BOACO", "ants", "n_ants")),
                (15, "J", refused("BOACO", "strenght", "termination")),
            ]
        ]


class TestSchema:
    def test_it_is_json_and_knows_all_keys(self):
        schema = json.loads(study_schema())
        assert set(schema["properties"]) == set(StudyFile.model_fields)
        assert schema["additionalProperties"] is False
        assert all("description" in entry for entry in schema["properties"].values())

    @pytest.mark.parametrize("path", EXPERIMENTS, ids=lambda path: path.stem)
    def test_the_studies_keep_to_it(self, path):
        # What the schema has to allow: shorthands of missions, algorithms and seeds.
        jsonschema.validate(yaml.safe_load(path.read_text()), json.loads(study_schema()))

    @pytest.mark.parametrize(
        "changes",
        [
            {"seeds": [3, 4], "missions": ["toy"], "algorithms": {"a": {"algorithm": "nsga2"}}},
            {"seeds": {"count": 3, "seed": 1}},
            {"algorithms": {"a": {"algorithm": "bo-aco", "parameters": {"evaporation": 0.5}}}},
            {"algorithms": {"a": {"algorithm": "bo-aco", "grid": {"exchange_every": [1, None]}}}},
            {"algorithms": {"a": {"algorithm": "my:Own", "parameters": {"evaporation": 2}}}},
            {"missions": {"a": {"mission": "terrain", "grid": {"nodes": [2, 3], "robots": [1]}}}},
            {"missions": {"a": {"mission": "lagoon", "parameters": {"nodes": 1}}}},
        ],
    )
    def test_shorthands_and_parameters_are_allowed(self, changes):
        jsonschema.validate(changed(**changes), json.loads(study_schema()))

    @pytest.mark.parametrize(
        "changes",
        [
            {"seeds": 0},
            {"titel": "x"},
            {"missions": {"a": 3}},
            {"algorithms": {"a": {"algorithm": "x", "parameter": {}}}},
            {"budget": {"evaluations": 0}},
            {"bounds": {"seconds": 0}},
            {"bounds": {}},
            {"indicators": ["igd"]},
            {"algorithms": {"a": {"algorithm": "bo-aco", "parameters": {"evaporation": 1}}}},
            {"algorithms": {"a": {"algorithm": "bo-aco", "parameters": {"evaporatio": 0.5}}}},
            {"algorithms": {"a": {"algorithm": "bo-aco", "parameters": {"sampling": []}}}},
            {"algorithms": {"a": {"algorithm": "bo-aco", "grid": {"n_ants": [10, 0]}}}},
            {"missions": {"a": {"mission": "terrain", "parameters": {"nodes": 1}}}},
            {"missions": {"a": {"mission": "terrain", "grid": {"sed": [1]}}}},
        ],
    )
    def test_and_nothing_else(self, changes):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(changed(**changes), json.loads(study_schema()))


@pytest.mark.parametrize("path", EXPERIMENTS, ids=lambda path: path.stem)
def test_the_studies_of_this_project_are_well_formed(path):
    study = load_study(path)
    assert study.name == path.stem
    assert len(study.runs()) == len(study.missions) * len(study.algorithms) * len(study.seeds)


@pytest.mark.parametrize("path", EXPERIMENTS, ids=lambda path: path.stem)
def test_their_published_results_can_be_made_again(path):
    # In a fresh clone the folder holds small tables only, and still has to be known as the study's.
    study = load_study(path)
    folder = path.parents[1] / "results" / study.name
    tracked = subprocess.run(
        ["git", "ls-files", "study.json"], cwd=folder, capture_output=True, text=True
    )
    if tracked.returncode == 0:  # not a copy without its history
        assert tracked.stdout.strip() == "study.json"
    StudyFolder(folder).check(study)
    assert list(read_manifest(folder)["algorithms"]) == [a.label for a in study.algorithms]


def test_there_are_studies():
    assert {path.stem for path in EXPERIMENTS} >= {
        "smoke",
        "paper",
        "baselines",
        "state-of-the-art",
    }


def test_the_baselines_leave_no_algorithm_out():
    study = load_study(next(path for path in EXPERIMENTS if path.stem == "baselines"))
    compared = {algorithm.algorithm for algorithm in study.algorithms}
    assert compared >= set(algorithm_names()) - {"exact", "pareto-local-search"}
