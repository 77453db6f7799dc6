"""Algorithms by name: those of this package and those that others register."""

import hashlib
import inspect
import os
import sys
import textwrap
from importlib.metadata import version

import pytest
from pymoo.core.algorithm import Algorithm

from botohe_moo import BOACO, algorithm_names, load_mission, make_algorithm
from botohe_moo.algorithms.registry import algorithm_parameters, describe_algorithm
from botohe_moo.study import load_study
from botohe_moo.study.model import algorithm_origin as origin_with
from tests.base.packages import entries, write_package
from tests.faults import algorithm_faults


def algorithm_origin(name):
    versions = {"botohe-moo", "pymoo"}
    return {key: value for key, value in origin_with(name, {}).items() if key not in versions}


JOURNAL = {
    "evaporation": 0.1,
    "initial_pheromone": "bounds",
    "unvisited_bonus": 0.05,
    "exploration": 0.01,
    "pooled_deposit": False,
}

REEF = '''
    from __future__ import annotations

    import functools
    from typing import TYPE_CHECKING, Self

    from pymoo.core.algorithm import Algorithm
    from botohe_moo import BOACO, Mission

    if TYPE_CHECKING:
        from pymoo.algorithms.moo.nsga2 import NSGA2

    called = []
    journal = BOACO.journal

    def reef(*, depth: int = 3, width, note: float | None = None, **others) -> BOACO:
        """Swim past the reef,
        and back.

        More of it.

        Parameters
        ----------
        depth, width
            How far
            it reaches.
        note
            What one says of it.

        Notes
        -----
        note
            Not this.
        """
        if depth < 1:
            raise ValueError(f"Expected depth >= 1, got {depth}.")
        return BOACO(n_ants=depth + width, **others)

    small = functools.partial(reef, width=2)

    class Atoll(Algorithm):
        def __init__(self, *, depth=1, output=None, **options):
            super().__init__(output=output, **options)

        @classmethod
        def shallow(cls) -> Self:
            return cls(depth=0)

    class Quiet(BOACO):
        @classmethod
        def bare(cls):
            called.append(1)

    class Boat:
        @classmethod
        def built(cls) -> Self:
            called.append(1)

        @classmethod
        def named(cls) -> BOACO:
            return BOACO(n_ants=5)

    def lagoon():
        called.append(1)
        return 3

    def mission() -> Mission:
        called.append(1)

    def checkers() -> NSGA2:
        called.append(1)

    def unlikely() -> BOACO | None:
        called.append(1)
'''


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Install a package with algorithms, as pip would."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def install(package="reef", code=REEF, **targets):
        write_package(tmp_path, package, code, entries("algorithms", package, **targets))
        monkeypatch.delitem(sys.modules, package, raising=False)

    return install


def stated(name):
    return {parameter.name: parameter for parameter in algorithm_parameters(name)}


def defaults(name):
    return {parameter.name: parameter.default for parameter in algorithm_parameters(name)}


def test_each_of_ours_says_what_it_is():
    names = algorithm_names()
    assert list(names) == sorted(names)
    for name in names:
        assert isinstance(make_algorithm(name), Algorithm)
        assert describe_algorithm(name)
        for parameter in algorithm_parameters(name):
            assert parameter.description, (name, parameter.name)
            assert parameter.annotation, (name, parameter.name)


def test_parameters_are_those_of_the_signature_and_are_handed_over():
    parameters = stated("bo-aco")
    signature = inspect.signature(BOACO).parameters.values()
    assert list(parameters) == [p.name for p in signature if p.kind is p.KEYWORD_ONLY]
    assert parameters["evaporation"].range == "in (0, 1)"
    assert parameters["initial_pheromone"].annotation == "float | Literal['bounds']"
    assert [name for name, p in parameters.items() if not p.plain] == ["sampling"]
    algorithm = make_algorithm("bo-aco", n_ants=7, initial_pheromone="bounds")
    assert (algorithm.n_ants, algorithm.initial_pheromone) == (7, "bounds")
    plan = load_mission("toy").plan([[1], [1]])
    assert make_algorithm("bo-aco", sampling=(plan for _ in range(3))).sampling == [plan] * 3
    assert algorithm_faults("bo-aco", {"sampling": [plan]}) == []


def test_wired_classes_show_types_by_their_defaults():
    assert stated("pymoo.algorithms.moo.rvea:RVEA")["alpha"].annotation == "float"
    normalize = stated("pymoo.algorithms.moo.sms:SMSEMOA")["normalize"]
    assert (normalize.annotation, normalize.default) == ("bool", True)
    assert algorithm_faults("pymoo.algorithms.moo.rvea:RVEA", {"alpha": "x"}) == [
        ("alpha", "Expected alpha to be a number, got 'x'.")
    ]


def test_unknown_names_list_the_nearest_first():
    said = "^Algorithm 'boaco': no such algorithm; known are bo-aco, "
    for function in (make_algorithm, algorithm_parameters, algorithm_origin):
        with pytest.raises(ValueError, match=said):
            function("boaco")
    [(blamed, found)] = algorithm_faults("no_such_module:X")
    assert blamed is None
    assert found.startswith("it cannot be imported (ModuleNotFoundError: No module named")


def test_all_faults_of_parameters_at_once():
    given = {"n_ant": 3, "heuristic": 1, "evaporation": 1.3, "n_ants": "100"}
    unknown, *others = algorithm_faults("bo-aco", given)
    assert unknown[0] == "n_ant"
    assert [name for name, _ in others] == ["n_ants", "evaporation", "heuristic"]
    for given, said in [
        ({"evaporation": 1.3}, r"^Algorithm 'bo-aco': Expected evap.*, got 1\.3\.$"),
        ({"n_ant": 3}, "there is no parameter 'n_ant'; known are n_ants, "),
        # pymoo's options are for ``minimize``.
        *(({name: None}, f"no parameter '{name}'") for name in ("verbose", "seed", "callback")),
    ]:
        with pytest.raises(ValueError, match=said):
            make_algorithm("bo-aco", **given)


class TestOtherPackages:
    def test_what_they_state(self, install):
        install(reef="reef", small="small", shallow="Atoll.shallow", atoll="Atoll")
        assert {"reef", "small", "bo-aco"} <= set(algorithm_names())
        depth, width, note = algorithm_parameters("reef")
        assert (depth.default, depth.annotation, depth.required) == (3, "int", False)
        assert (width.annotation, width.required, width.plain) == ("", True, True)
        assert (note.default, note.annotation, note.plain) == (None, "float | None", True)
        assert [p.description for p in (depth, width, note)] == [
            "How far it reaches.",
            "How far it reaches.",
            "What one says of it.",
        ]
        assert describe_algorithm("reef") == "Swim past the reef, and back."
        assert describe_algorithm("small") == describe_algorithm("reef")
        assert defaults("small")["width"] == 2
        assert defaults("shallow") == {}  # it hands nothing to its class
        assert list(stated("atoll")) == ["depth"]  # pymoo's options are for minimize
        assert make_algorithm("reef", width=4, depth=5).n_ants == 9

    def test_a_factory_states_what_it_changes_and_its_class_the_rest(self, install):
        install(journal="journal")
        assert defaults("journal") == defaults("bo-aco") | JOURNAL
        assert stated("journal")["evaporation"].range == "in (0, 1)"
        colony = make_algorithm("journal", n_ants=5)
        assert (colony.n_ants, colony.evaporation, colony.exploration) == (5, 0.1, 0.01)

    @pytest.mark.parametrize(
        ("name", "parameters", "message"),
        [
            ("reef", {}, r"^Algorithm 'reef': .*missing 1 required .*'width'"),
            ("reef", {"widht": 3}, r"'widht'; known are width, "),
            ("reef", {"width": 3, "evaporation": 0.5}, "no parameter 'evaporation'"),
            ("reef", {"width": 1, "depth": 0}, r"^Algorithm 'reef': Expected depth >= 1, got 0\.$"),
            ("reef", {"width": "wide"}, r"^Algorithm 'reef': unsupported operand"),
            ("reef", {"width": 1, "depth": "deep"}, r"to be an integer, got 'deep'\.$"),
            ("lagoon", {}, r"^Algorithm 'lagoon': expected an object .*, got 3\.$"),
        ],
    )
    def test_their_parameters_are_checked(self, install, name, parameters, message):
        install(reef="reef", lagoon="lagoon")
        with pytest.raises(ValueError, match=message):
            make_algorithm(name, **parameters)

    @pytest.mark.parametrize(
        ("code", "found"),
        [
            ("import no_such_module", "ModuleNotFoundError: No module named 'no_such_module'"),
            ("broken = 3", "bad:broken of package bad to be a function"),
            ("import sys; sys.exit('enough')", "SystemExit: enough"),
        ],
    )
    def test_broken_ones_are_left_out_with_a_warning(self, install, code, found):
        install("bad", code, broken="broken")
        with pytest.warns(UserWarning, match="left out") as warned:
            names = algorithm_names()
        assert "bo-aco" in names
        assert "broken" not in names
        (message,) = [str(warning.message) for warning in warned]
        assert message.startswith("Algorithm 'broken': ")
        assert found in message
        with pytest.raises(ValueError, match=r"^Algorithm 'broken': ") as caught:
            make_algorithm("broken")
        assert found in str(caught.value)

    def test_what_they_print_stays_out_of_the_output(self, install, capsys):
        install("loud", f"{textwrap.dedent(REEF)}\nprint('Welcome!')", reef="reef")
        assert "reef" in algorithm_names()
        printed = capsys.readouterr()
        assert (printed.out, printed.err) == ("", "Welcome!\n")

    def test_names_of_this_package_are_its_own(self, install):
        install(reef="reef", bo_aco="lagoon")
        assert isinstance(make_algorithm("bo-aco"), BOACO)

    def test_what_states_that_it_makes_an_algorithm_is_called(self, install):
        install()
        for path in (
            "reef:small",
            "reef.small",
            "reef:Quiet",
            "reef:Quiet.journal",
            "reef:Boat.named",
            "botohe_moo:BOACO.journal",
        ):
            assert isinstance(make_algorithm(path), BOACO)
            assert algorithm_faults(path) == []

    def test_all_else_is_refused_by_name_and_never_called(self, install, monkeypatch):
        install()
        monkeypatch.setattr(os, "system", lambda command: pytest.fail(command))
        made = [
            "lagoon",
            "mission",
            "checkers",
            "unlikely",
            "Boat",
            "Boat.built",
            "Quiet.bare",
            "Quiet.mro",
        ]
        for path in (*(f"reef:{name}" for name in made), "os.system", "builtins:exec"):
            said = f"^Algorithm {path!r}: expected a class derived from Algorithm, or a function"
            for function in (make_algorithm, algorithm_parameters, algorithm_origin):
                with pytest.raises(ValueError, match=said):
                    function(path)
            [(blamed, _)] = algorithm_faults(path, {"command": "true"})
            assert blamed is None
        assert sys.modules["reef"].called == []


def test_studies_know_defaults_and_what_factories_set(install):
    install(reef="reef")
    algorithms = [
        {"algorithm": "reef", "parameters": {"width": 3}},
        {"algorithm": "botohe_moo:BOACO.journal", "parameters": {"n_ants": 7}},
        {"algorithm": "botohe_moo:SimulatedAnnealing.journal", "parameters": {"n_passes": 2}},
    ]
    content = {
        "name": "s",
        "missions": ["toy"],
        "algorithms": dict(zip("abc", algorithms, strict=True)),
        "seeds": 1,
    }
    found = load_study({**content, "budget": {"evaluations": 1}}).algorithms
    reef, ants, annealing = (each.effective for each in found)
    assert reef.items() >= {"depth": 3, "width": 3, "note": None}.items()
    assert ants.items() >= {**JOURNAL, "n_ants": 7, "n_threads": 1}.items()
    assert (annealing["return_probability"], annealing["n_passes"]) == (0.0, 2)


class TestOrigin:
    def test_of_packages(self, install, tmp_path):
        install(reef="reef")
        source = hashlib.sha256((tmp_path / "reef.py").read_bytes()).hexdigest()
        ours = {"package": "botohe-moo", "version": version("botohe-moo"), "source": None}
        for name, expected in {
            "bo-aco": ours,
            "botohe_moo.algorithms.bo_aco:BOACO.journal": ours,
            "pymoo.algorithms.moo.age:AGEMOEA": ours
            | {"package": "pymoo", "version": version("pymoo")},
            "reef": {"package": "reef", "version": "1.0", "source": source},
        }.items():
            assert algorithm_origin(name) == expected

    def test_of_files_that_nobody_has_installed(self, tmp_path, monkeypatch):
        monkeypatch.syspath_prepend(str(tmp_path))
        file = tmp_path / "lone_reef.py"
        file.write_text(textwrap.dedent(REEF))
        (tmp_path / "near_reef.py").write_text("from lone_reef import reef")
        for path in ("lone_reef:reef", "lone_reef.small", "lone_reef:Atoll.shallow"):
            assert algorithm_origin(path) == {
                "package": None,
                "version": None,
                "source": hashlib.sha256(file.read_bytes()).hexdigest(),
            }
        # What the file says counts, and what the file says that it is imported from.
        paths = ("lone_reef:journal", "near_reef:reef")
        before = [algorithm_origin(path)["source"] for path in paths]
        file.write_text(file.read_text() + "\n")
        after = [algorithm_origin(path)["source"] for path in paths]
        assert not set(before) & set(after)
        assert None not in before
