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


# Parameters of BO-ACO and their defaults.
BO_ACO = {
    "n_ants": 100,
    "evaporation": 0.04,
    "heuristic": True,
    "pheromone": True,
    "pheromone_per_robot": False,
    "initial_pheromone": 1.0,
    "reward_epsilon": 0.05,
    "survival_epsilon": 0.01,
    "unvisited_bonus": 0.0,
    "exploration": 0.0,
    "pooled_deposit": True,
    "n_threads": 1,
    "sampling": None,
}
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

    import botohe_moo as bm
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


class TestOurs:
    def test_names(self):
        names = algorithm_names()
        assert {"bo-aco", "random", "pareto-local-search"} <= set(names)
        assert list(names) == sorted(names)

    def test_each_says_what_it_is(self):
        for name in algorithm_names():
            assert isinstance(make_algorithm(name), Algorithm)
            assert describe_algorithm(name)
            for parameter in algorithm_parameters(name):
                assert parameter.description, (name, parameter.name)
                assert parameter.annotation, (name, parameter.name)

    def test_bo_aco_states_its_parameters(self):
        parameters = stated("bo-aco")
        assert defaults("bo-aco").items() >= BO_ACO.items()
        signature = inspect.signature(BOACO).parameters.values()
        assert list(parameters) == [p.name for p in signature if p.kind is p.KEYWORD_ONLY]
        evaporation = parameters["evaporation"]
        assert evaporation.description.startswith("Share ρ of the pheromone that evaporates")
        assert evaporation.range == "in (0, 1)"
        assert parameters["initial_pheromone"].annotation == "float | Literal['bounds']"
        assert [name for name, p in parameters.items() if not p.plain] == ["sampling"]

    def test_parameters_are_handed_over(self):
        algorithm = make_algorithm("bo-aco", n_ants=7, initial_pheromone="bounds")
        assert (algorithm.n_ants, algorithm.initial_pheromone) == (7, "bounds")
        plan = load_mission("toy").plan([[1], [1]])
        assert make_algorithm("bo-aco", sampling=(plan for _ in range(3))).sampling == [plan] * 3

    def test_wired_classes_show_types_by_their_defaults(self):
        assert stated("pymoo.algorithms.moo.rvea:RVEA")["alpha"].annotation == "float"
        normalize = stated("pymoo.algorithms.moo.sms:SMSEMOA")["normalize"]
        assert (normalize.annotation, normalize.default) == ("bool", True)
        assert algorithm_faults("pymoo.algorithms.moo.rvea:RVEA", {"alpha": "x"}) == [
            ("alpha", "Expected alpha to be a number, got 'x'.")
        ]


class TestRefusals:
    def test_unknown_names_list_the_nearest_first(self):
        said = "^Algorithm 'boaco': there is no such algorithm; known are bo-aco, "
        for function in (make_algorithm, algorithm_parameters, algorithm_origin):
            with pytest.raises(ValueError, match=said) as caught:
                function("boaco")
            assert str(caught.value).endswith("; a package that registers it may not be installed.")

    def test_unknown_parameters_list_the_nearest_first(self):
        said = "Algorithm 'bo-aco': there is no parameter 'n_ant'; known are n_ants, "
        with pytest.raises(ValueError, match=said):
            make_algorithm("bo-aco", n_ant=3)

    def test_options_of_pymoo_are_for_minimize(self):
        for option in ("verbose", "callback", "termination", "seed"):
            with pytest.raises(ValueError, match=f"no parameter '{option}'"):
                make_algorithm("bo-aco", **{option: None})

    def test_all_faults_at_once(self):
        given = {"n_ant": 3, "heuristic": 1, "evaporation": 1.3, "n_ants": "100"}
        unknown, *others = algorithm_faults("bo-aco", given)
        assert unknown[0] == "n_ant"
        assert others == [
            ("n_ants", "Expected n_ants to be an integer in [1, 1000000], got '100'."),
            ("evaporation", "Expected evaporation in (0, 1), got 1.3."),
            ("heuristic", "Expected heuristic to be true or false, got 1."),
        ]
        with pytest.raises(ValueError, match=r"^Algorithm 'bo-aco': Expected evap.*, got 1\.3\.$"):
            make_algorithm("bo-aco", evaporation=1.3)
        assert algorithm_faults("bo-aco", None) == []

    def test_what_no_parameter_is_to_blame_for(self):
        [(blamed, found)] = algorithm_faults("no_such_module:X")
        assert blamed is None
        assert found.startswith("it cannot be imported (ModuleNotFoundError: No module named")

    def test_python_objects(self):
        plan = load_mission("toy").plan([[1], [1]])
        assert algorithm_faults("bo-aco", {"sampling": [plan]}) == []


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
        assert all(parameter.description for parameter in algorithm_parameters("journal"))
        colony = make_algorithm("journal", n_ants=5)
        assert (colony.n_ants, colony.evaporation, colony.exploration) == (5, 0.1, 0.01)

    def test_their_parameters_are_checked(self, install):
        install(reef="reef", lagoon="lagoon")
        for parameters, message in (
            ({}, r"^Algorithm 'reef': .*missing 1 required .*'width'"),
            ({"widht": 3}, r"'widht'; known are width, "),
            ({"width": 3, "evaporation": 0.5}, "no parameter 'evaporation'"),
            ({"width": 1, "depth": 0}, r"^Algorithm 'reef': Expected depth >= 1, got 0\.$"),
            ({"width": "wide"}, r"^Algorithm 'reef': unsupported operand"),
        ):
            with pytest.raises(ValueError, match=message):
                make_algorithm("reef", **parameters)
        with pytest.raises(ValueError, match=r"to be an integer, got 'deep'\.$"):
            make_algorithm("reef", width=1, depth="deep")
        with pytest.raises(
            ValueError, match=r"^Algorithm 'lagoon': expected an object .*, got 3\.$"
        ):
            make_algorithm("lagoon")

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
        assert "bad:broken of package bad" in message
        assert found in message
        with pytest.raises(ValueError, match=r"^Algorithm 'broken': ") as caught:
            make_algorithm("broken")
        assert found in str(caught.value)
        assert isinstance(make_algorithm("bo-aco"), BOACO)

    def test_what_they_print_stays_out_of_the_output(self, install, capsys):
        install("loud", f"{textwrap.dedent(REEF)}\nprint('Welcome!')", reef="reef")
        assert "reef" in algorithm_names()
        printed = capsys.readouterr()
        assert (printed.out, printed.err) == ("", "Welcome!\n")

    def test_names_of_this_package_are_its_own(self, install):
        install(reef="reef", bo_aco="lagoon")
        assert isinstance(make_algorithm("bo-aco"), BOACO)


class TestOnlyAlgorithmsAreCalled:
    def test_what_states_that_it_makes_one_is(self, install):
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
        for path in (
            "reef:lagoon",
            "reef:mission",
            "reef:checkers",
            "reef:unlikely",
            "reef:Boat",
            "reef:Boat.built",
            "reef:Quiet.bare",
            "reef:Quiet.mro",
            "os.system",
            "builtins:exec",
        ):
            said = f"^Algorithm {path!r}: expected a class derived from Algorithm, or a function"
            for function in (make_algorithm, algorithm_parameters, algorithm_origin):
                with pytest.raises(ValueError, match=said):
                    function(path)
            [(blamed, _)] = algorithm_faults(path, {"command": "true"})
            assert blamed is None
        assert sys.modules["reef"].called == []


def described(name, parameters):
    algorithms = {"a": {"algorithm": name, "parameters": parameters}}
    content = {"name": "s", "missions": ["toy"], "algorithms": algorithms, "seeds": 1}
    return load_study({**content, "budget": {"evaluations": 1}}).algorithms[0]


class TestDescribed:
    def test_defaults_are_added(self, install):
        install(reef="reef")
        found = described("reef", {"depth": 3, "width": 3, "note": None})
        assert found.effective.items() >= {"depth": 3, "width": 3, "note": None}.items()

    def test_effective_ones_of_a_factory_are_those_of_what_it_makes(self):
        effective = described("botohe_moo:BOACO.journal", {"n_ants": 7}).effective
        assert effective.items() >= {**JOURNAL, "n_ants": 7, "n_threads": 1}.items()


class TestOrigin:
    def test_of_ours_and_of_pymoos(self):
        ours = {"package": "botohe-moo", "version": version("botohe-moo"), "source": None}
        assert algorithm_origin("bo-aco") == ours
        assert algorithm_origin("botohe_moo.algorithms.bo_aco:BOACO.journal") == ours
        pymoos = {"package": "pymoo", "version": version("pymoo"), "source": None}
        assert algorithm_origin("pymoo.algorithms.moo.age:AGEMOEA") == pymoos

    def test_of_another_package(self, install, tmp_path):
        install(reef="reef")
        source = hashlib.sha256((tmp_path / "reef.py").read_bytes()).hexdigest()
        expected = {"package": "reef", "version": "1.0", "source": source}
        assert algorithm_origin("reef") == expected

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
