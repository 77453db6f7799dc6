"""Algorithms by name: those of this package and those that others register."""

import hashlib
import inspect
import re
import sys
import textwrap
from importlib.metadata import version

import pytest
from pymoo.core.algorithm import Algorithm
from pymoo.optimize import minimize

from botohe_moo import BOACO, BOTOHE, RandomTrails, algorithm_names, load_mission, make_algorithm
from botohe_moo._plugins import entry_points as plugins
from botohe_moo.algorithms.origin import algorithm_identity, algorithm_origin
from botohe_moo.algorithms.registry import (
    algorithm_faults,
    algorithm_parameters,
    describe_algorithm,
)

# Other packages may be installed beside this one; these names are its own.
OURS = {"bo-aco": BOACO, "random": RandomTrails}

# Parameters of BO-ACO and their defaults: section 6 of the design.
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
    import functools
    from pymoo.core.algorithm import Algorithm
    from botohe_moo import BOACO

    journal = BOACO.journal

    def reef(*, depth: "int" = 3, width, note: float | None = None, **others) -> BOACO:
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
        def shallow(cls) -> "Atoll":
            return cls(depth=0)

    def bare(n_ants, /):
        return BOACO(n_ants=n_ants)

    def lagoon():
        return 3

    nothing = dict  # whose signature Python cannot tell
'''


@pytest.fixture
def local(tmp_path, monkeypatch):
    """Write a module that nobody has installed."""

    def write(code, name):
        (tmp_path / f"{name}.py").write_text(textwrap.dedent(code))
        monkeypatch.syspath_prepend(str(tmp_path))
        monkeypatch.delitem(sys.modules, name, raising=False)

    return write


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
        lines = [
            f"{name.replace('_', '-')} = {module}:{target}" for name, target in entries.items()
        ]
        (info / "entry_points.txt").write_text("\n".join(["[botohe_moo.algorithms]", *lines]))
        monkeypatch.delitem(sys.modules, module, raising=False)

    return install


def defaults(parameters):
    return {name: parameter.default for name, parameter in parameters.items()}


def stated(name):
    return {parameter.name: parameter for parameter in algorithm_parameters(name)}


class TestOurs:
    def test_names(self):
        names = algorithm_names()
        assert set(names) >= set(OURS)
        assert list(names) == sorted(names)

    @pytest.mark.parametrize(("name", "kind"), OURS.items())
    def test_each_is_made(self, name, kind):
        assert type(make_algorithm(name)) is kind

    @pytest.mark.parametrize("name", algorithm_names())
    def test_each_solves_and_says_what_it_is(self, name):
        algorithm = make_algorithm(name)
        assert isinstance(algorithm, Algorithm)
        mission = load_mission("toy")
        result = minimize(BOTOHE(mission), algorithm, ("n_eval", 200), seed=1)
        assert mission.evaluate(result.X) == pytest.approx(-result.F)
        assert describe_algorithm(name)
        for parameter in algorithm_parameters(name):
            assert parameter.description, parameter.name
            assert parameter.annotation, parameter.name

    def test_parameters_are_handed_over(self):
        algorithm = make_algorithm("bo-aco", n_ants=7, evaporation=0.5, initial_pheromone="bounds")
        assert algorithm.n_ants == 7
        assert algorithm.evaporation == 0.5
        assert algorithm.initial_pheromone == "bounds"
        assert make_algorithm("random", n_ants=7).n_ants == 7

    def test_a_parameter_may_be_called_name(self):
        with pytest.raises(ValueError, match=r"'bo-aco': there is no parameter 'name'; known"):
            make_algorithm("bo-aco", name=3)


class TestParameters:
    def test_bo_aco_states_its_own(self):
        parameters = stated("bo-aco")
        assert defaults(parameters).items() >= BO_ACO.items()
        signature = inspect.signature(BOACO).parameters.values()
        assert list(parameters) == [p.name for p in signature if p.kind is p.KEYWORD_ONLY]
        assert parameters["evaporation"].description == (
            "Share ρ of the pheromone that evaporates in an iteration."
        )
        assert parameters["evaporation"].range == "in (0, 1)"
        assert parameters["initial_pheromone"].annotation == "float | Literal['bounds']"

    def test_only_what_takes_no_python_objects_is_plain(self):
        plain = {name: parameter.plain for name, parameter in stated("bo-aco").items()}
        assert plain == {name: name != "sampling" for name in plain}

    def test_a_factory_states_what_it_changes_and_its_class_the_rest(self, install):
        install("reef-algorithms", REEF, journal="journal")
        parameters = stated("journal")
        assert defaults(parameters) == defaults(stated("bo-aco")) | JOURNAL
        assert all(parameter.description for parameter in parameters.values())
        assert parameters["evaporation"].range == "in (0, 1)"
        colony = make_algorithm("journal", n_ants=5)
        assert (colony.n_ants, colony.evaporation, colony.exploration) == (5, 0.1, 0.01)
        assert make_algorithm("journal", evaporation=0.2).evaporation == 0.2

    def test_of_another_package(self, install):
        install("reef-algorithms", REEF, reef="reef", small="small", bare="bare", nothing="nothing")
        parameters = stated("reef")
        assert list(parameters) == ["depth", "width", "note"]
        depth, width, note = parameters.values()
        assert (depth.default, depth.annotation, depth.required) == (3, "int", False)
        assert (width.default, width.annotation) == (inspect.Parameter.empty, "")
        assert width.required
        assert width.plain  # for all one knows
        assert (note.default, note.annotation, note.plain) == (None, "float | None", True)
        assert [p.description for p in parameters.values()] == [
            "How far it reaches.",
            "How far it reaches.",
            "What one says of it.",
        ]
        assert describe_algorithm("reef") == "Swim past the reef, and back."
        assert stated("small")["width"].default == 2
        assert describe_algorithm("small") == describe_algorithm("reef")
        assert stated("bare") == stated("nothing") == {}
        assert describe_algorithm("bare") == ""

    def test_a_factory_that_takes_nothing_else_hands_nothing_to_its_class(self, install):
        install("reef-algorithms", REEF, shallow="Atoll.shallow")
        assert stated("shallow") == {}

    def test_options_of_pymoo_are_none(self, install):
        install("reef-algorithms", REEF, atoll="Atoll", any="Algorithm")
        assert list(stated("atoll")) == ["depth"]
        assert list(stated("any")) == []
        with pytest.raises(ValueError, match=r"no parameter 'output'; known are depth\.$"):
            make_algorithm("atoll", output=None)

    @pytest.mark.parametrize("function", [algorithm_parameters, describe_algorithm])
    def test_of_an_unknown_one(self, function):
        with pytest.raises(ValueError, match=r"^Algorithm 'bo': there is no such algorithm; known"):
            function("bo")


class TestRefusals:
    def test_unknown_name_lists_the_nearest_first(self):
        for name, nearest in (("boaco", "bo-aco"), ("randon", "random")):
            with pytest.raises(ValueError, match="no such algorithm") as caught:
                make_algorithm(name)
            message = str(caught.value)
            assert message.startswith(
                f"Algorithm {name!r}: there is no such algorithm; known are {nearest}, "
            )
            assert message.endswith("; a package that registers it may not be installed.")
            assert all(known in message for known in OURS)

    def test_unknown_parameter_lists_the_nearest_first(self):
        with pytest.raises(ValueError, match="no parameter") as caught:
            make_algorithm("bo-aco", n_ant=3)
        message = str(caught.value)
        assert message.startswith(
            "Algorithm 'bo-aco': there is no parameter 'n_ant'; known are n_ants, "
        )
        assert all(name in message for name in BO_ACO)
        with pytest.raises(ValueError, match="no parameter 'n_ant' or 'evaporatio'; known"):
            make_algorithm("bo-aco", n_ant=3, evaporatio=0.1)

    @pytest.mark.parametrize("option", ["verbose", "callback", "termination", "seed"])
    def test_options_of_pymoo_are_for_minimize(self, option):
        with pytest.raises(ValueError, match=f"no parameter '{option}'"):
            make_algorithm("bo-aco", **{option: None})

    @pytest.mark.parametrize(
        ("parameters", "message"),
        [
            ({"evaporation": 1.3}, "Expected evaporation in (0, 1), got 1.3."),
            ({"evaporation": 0}, "Expected evaporation in (0, 1), got 0."),
            ({"evaporation": "much"}, "Expected evaporation to be a number in (0, 1), got 'much'."),
            ({"n_ants": 0}, "Expected n_ants in [1, 1000000], got 0."),
            ({"n_ants": 2.5}, "Expected n_ants to be an integer in [1, 1000000], got 2.5."),
            ({"heuristic": 1}, "Expected heuristic to be true or false, got 1."),
            ({"exploration": -1}, "Expected exploration >= 0, got -1."),
            (
                {"initial_pheromone": "x"},
                "Expected initial_pheromone to be a number > 0 or 'bounds', got 'x'.",
            ),
        ],
    )
    def test_values_out_of_their_range(self, parameters, message):
        with pytest.raises(ValueError, match="Expected") as caught:
            make_algorithm("bo-aco", **parameters)
        assert str(caught.value) == f"Algorithm 'bo-aco': {message}"

    def test_nothing_registered(self, monkeypatch):
        monkeypatch.setattr(plugins, "entry_points", lambda group: [])
        assert algorithm_names() == ()
        with pytest.raises(ValueError, match="is the package botohe-moo installed"):
            make_algorithm("bo-aco")


class TestOtherPackages:
    def test_algorithms_of_another_package(self, install):
        install("reef-algorithms", REEF, reef="reef", deep_sea="small")
        assert {"reef", "deep-sea", "bo-aco"} <= set(algorithm_names())
        assert make_algorithm("reef", width=4, depth=5).n_ants == 9
        assert make_algorithm("deep-sea", depth=5).n_ants == 7

    def test_their_parameters_are_checked(self, install):
        install("reef-algorithms", REEF, reef="reef", bare="bare")
        with pytest.raises(ValueError, match=r"^Algorithm 'reef': missing a required .*'width'"):
            make_algorithm("reef")
        with pytest.raises(
            ValueError, match=r"'bare': cannot be made: it requires 'n_ants', which ca"
        ):
            make_algorithm("bare")
        with pytest.raises(ValueError, match=r"'widht'; known are width, "):
            make_algorithm("reef", widht=3)
        with pytest.raises(ValueError, match=r"^Algorithm 'reef': Expected depth >= 1, got 0\.$"):
            make_algorithm("reef", width=1, depth=0)
        expected = r"^Algorithm 'reef': Expected depth to be an integer, got 'deep'\.$"
        with pytest.raises(ValueError, match=expected) as told:
            make_algorithm("reef", width=1, depth="deep")
        assert told.value.parameter == "depth"
        with pytest.raises(ValueError, match=r"^Algorithm 'reef': unsupported operand") as told:
            make_algorithm("reef", width="wide")  # of no stated type
        assert isinstance(told.value.__cause__, TypeError)

    def test_what_is_not_stated_is_not_accepted(self, install):
        install("reef-algorithms", REEF, reef="reef", nothing="nothing")
        with pytest.raises(ValueError, match="no parameter 'evaporation'"):
            make_algorithm("reef", width=3, evaporation=0.5)
        with pytest.raises(ValueError, match="no parameter 'depth'"):
            make_algorithm("nothing", depth=3)

    def test_something_else_than_an_algorithm(self, install):
        install("reef-algorithms", REEF, lagoon="lagoon", nothing="nothing")
        expected = "Algorithm 'lagoon': expected reef_algorithms:lagoon of package reef-algorithms"
        with pytest.raises(ValueError, match=rf"^{expected} to give a pymoo .*, got 3\.$"):
            make_algorithm("lagoon")
        with pytest.raises(ValueError, match=r"to give a pymoo Algorithm, got \{\}\.$"):
            make_algorithm("nothing")

    @pytest.mark.parametrize(
        ("code", "found"),
        [
            ("import no_such_module", "ModuleNotFoundError: No module named 'no_such_module'"),
            ("def (", "SyntaxError"),
            ("1 / 0", "ZeroDivisionError"),
            ("", "AttributeError"),
            ("broken = 3", "bad_algorithms:broken of package bad-algorithms to be a function"),
            ("import sys; sys.exit('enough')", "SystemExit: enough"),
            ("raise RuntimeError('no licence')", "RuntimeError: no licence"),
        ],
    )
    def test_broken_ones_are_left_out_with_a_warning(self, install, code, found):
        install("bad-algorithms", code, broken="broken")
        with pytest.warns(UserWarning, match="left out") as warned:
            names = algorithm_names()
        assert "bo-aco" in names
        assert "broken" not in names
        (message,) = [str(warning.message) for warning in warned]
        assert message.startswith("Algorithm 'broken': ")
        assert "bad_algorithms:broken of package bad-algorithms" in message
        assert found in message
        for function in (make_algorithm, algorithm_parameters, describe_algorithm):
            with pytest.raises(ValueError, match=r"^Algorithm 'broken': ") as caught:
                function("broken")
            assert found in str(caught.value)

    def test_what_they_print_stays_out_of_the_output(self, install, capsys):
        install("loud-algorithms", f"print('Welcome!')\n{textwrap.dedent(REEF)}", reef="reef")
        assert "reef" in algorithm_names()
        printed = capsys.readouterr()
        assert (printed.out, printed.err) == ("", "Welcome!\n")

    @pytest.mark.filterwarnings("error")
    def test_broken_ones_fail_only_what_uses_them(self, install):
        install("bad-algorithms", "1 / 0", broken="broken")
        assert isinstance(make_algorithm("bo-aco"), BOACO)
        with pytest.raises(ValueError, match=r"no such algorithm; known are .*broken"):
            make_algorithm("brokem")

    def test_two_packages_claim_one_name(self, install):
        install("reef-algorithms", REEF, reef="reef")
        install("Rival_Algorithms", REEF, reef="small")
        with pytest.warns(UserWarning, match="'reef': the packages .* both register this name"):
            assert "reef" not in algorithm_names()
        with pytest.raises(ValueError, match="both register this name") as caught:
            make_algorithm("reef", width=2)
        assert "reef-algorithms" in str(caught.value)
        assert "rival-algorithms" in str(caught.value)

    def test_a_package_claims_one_of_ours(self, install):
        install("reef-algorithms", REEF, bo_aco="lagoon")
        warning = "Algorithm 'bo-aco' of package reef-algorithms is left out: botohe-moo has it"
        with pytest.warns(UserWarning, match=warning):
            assert isinstance(make_algorithm("bo-aco"), BOACO)
        with pytest.warns(UserWarning, match=warning):
            assert "bo-aco" in algorithm_names()


TYPED = '''
    from typing import Annotated
    from pydantic import BaseModel, Field
    from pymoo.core.algorithm import Algorithm

    class Cave(Algorithm):
        """Look into caves."""

        class Parameters(BaseModel):
            depth: int = Field(2, ge=1, le=9, description="How deep.")
            light: float = Field(gt=0)

        def __init__(self, depth, light):
            super().__init__()
            self.depth, self.light = depth, light
            if depth == 7:
                raise OSError("it is flooded")

    def shaft(*, steps: Annotated[int, Field(ge=1)] = 1, light: float = 1.0):
        if steps == 7:
            raise SystemExit
        return Cave(steps, light)
'''


class TestCheck:
    @pytest.mark.parametrize(
        ("parameters", "faults"),
        [
            ({}, []),
            (None, []),
            ({"n_ants": 7, "initial_pheromone": "bounds", "evaporation": 0.5}, []),
            (
                {"n_ants": "100"},
                [("n_ants", "Expected n_ants to be an integer in [1, 1000000], got '100'.")],
            ),
            (
                {"heuristic": 1, "evaporation": True, "n_ants": 1.5},
                [
                    ("n_ants", "Expected n_ants to be an integer in [1, 1000000], got 1.5."),
                    ("evaporation", "Expected evaporation to be a number in (0, 1), got True."),
                    ("heuristic", "Expected heuristic to be true or false, got 1."),
                ],
            ),
            ({"evaporation": 1.3}, [("evaporation", "Expected evaporation in (0, 1), got 1.3.")]),
            ({"n_ants": 0}, [("n_ants", "Expected n_ants in [1, 1000000], got 0.")]),
            (
                {"initial_pheromone": "x"},
                [
                    (
                        "initial_pheromone",
                        "Expected initial_pheromone to be a number > 0 or 'bounds', got 'x'.",
                    )
                ],
            ),
        ],
    )
    def test_of_bo_aco(self, parameters, faults):
        assert algorithm_faults("bo-aco", parameters, plain=True) == faults

    def test_unknown_names_and_wrong_types_at_once(self):
        unknown, also_unknown, wrong = algorithm_faults("bo-aco", {"n_ant": 3, "n_ants": "3", 4: 5})
        assert unknown[0] == "n_ant"
        assert unknown[1].startswith("there is no parameter 'n_ant'; known are n_ants, n_threads")
        assert also_unknown[1].startswith("there is no parameter 4; known are ")
        assert wrong == ("n_ants", "Expected n_ants to be an integer in [1, 1000000], got '3'.")

    @pytest.mark.parametrize(
        ("name", "parameters", "message"),
        [
            ("boaco", {}, "there is no such algorithm; known are bo-aco, "),
            (
                "no_such_module:X",
                {},
                "it cannot be imported (ModuleNotFoundError: No module named ",
            ),
            (3, {}, "Expected the name of an algorithm, got 3."),
            ("bo-aco", [1], "Expected parameters to be a mapping from names to values, got [1]."),
            ("builtins:dict", {}, "it is not called, because nothing there says that it makes an "),
        ],
    )
    def test_what_no_parameter_is_to_blame_for(self, name, parameters, message):
        [(blamed, found)] = algorithm_faults(name, parameters)
        assert blamed is None
        assert found.startswith(message)

    def test_python_objects_are_for_python(self):
        plan = load_mission("toy").stay_home()
        assert algorithm_faults("bo-aco", {"sampling": [plan]}) == []
        expected = "sampling can be given from Python only, as Iterable[TrailPlan] | "
        [(name, message)] = algorithm_faults("bo-aco", {"sampling": [plan]}, plain=True)
        assert (name, message[: len(expected)]) == ("sampling", expected)

    def test_plans_to_start_from_are_not_used_up(self):
        plan = load_mission("toy").stay_home()
        assert make_algorithm("bo-aco", sampling=(plan for _ in range(3))).sampling == [plan] * 3

    def test_by_a_model(self, install):
        install("cave-algorithms", TYPED, cave="Cave")
        assert algorithm_faults("cave", {"light": 2}) == []
        assert algorithm_faults("cave", {"depth": "3", "lihgt": 1}) == [
            ("lihgt", "there is no parameter 'lihgt'; known are light, depth."),
            ("light", "missing a required parameter 'light'."),
            ("depth", "Expected depth to be an integer in [1, 9], got '3'."),
        ]
        assert algorithm_faults("cave", {"depth": 10, "light": 0}) == [
            ("depth", "Expected depth in [1, 9], got 10."),
            ("light", "Expected light > 0, got 0."),
        ]
        made = make_algorithm("cave", light=3)
        assert (made.depth, made.light, type(made.light)) == (2, 3.0, float)
        with pytest.raises(ValueError, match=r"^Algorithm 'cave': Expected light > 0, got -1\.$"):
            make_algorithm("cave", light=-1)

    def test_whatever_a_constructor_raises(self, install):
        install("cave-algorithms", TYPED, cave="Cave", shaft="shaft")
        place = "cave_algorithms:{} of package cave-algorithms raised"
        flooded = f"{place.format('Cave')} OSError: it is flooded."
        assert algorithm_faults("cave", {"depth": 7, "light": 1}) == [(None, flooded)]
        ended = f"{place.format('shaft')} SystemExit: ."
        assert algorithm_faults("shaft", {"steps": 7}) == [(None, ended)]
        for name, parameters, said in (
            ("cave", {"depth": 7, "light": 1}, flooded),
            ("shaft", {"steps": 7}, ended),
        ):
            with pytest.raises(ValueError, match=re.escape(f"Algorithm {name!r}: {said}")):
                make_algorithm(name, **parameters)

    def test_ranges_are_stated(self, install):
        install("cave-algorithms", TYPED, cave="Cave", shaft="shaft")
        depth, light = algorithm_parameters("cave")
        assert (depth.default, depth.annotation, depth.range) == (2, "int", "in [1, 9]")
        assert (depth.description, light.required, light.range) == ("How deep.", True, "> 0")
        steps, light = algorithm_parameters("shaft")
        assert (steps.annotation, steps.range, light.range) == ("int", ">= 1", "")

    def test_wired_classes_show_types_by_their_defaults(self):
        assert stated("pymoo.algorithms.moo.rvea:RVEA")["alpha"].annotation == "float"
        normalize = stated("pymoo.algorithms.moo.sms:SMSEMOA")["normalize"]
        assert (normalize.annotation, normalize.default) == ("bool", True)
        assert algorithm_faults("pymoo.algorithms.moo.rvea:RVEA", {"alpha": "x"}) == [
            ("alpha", "Expected alpha to be a number, got 'x'.")
        ]


DANGER = """
    from __future__ import annotations

    import functools
    import os
    from typing import TYPE_CHECKING, Annotated, Self

    import botohe_moo as bm
    from pymoo.core.algorithm import Algorithm
    from pymoo.algorithms.moo.ctaea import CTAEA
    from botohe_moo import BOACO, Mission

    if TYPE_CHECKING:
        from pymoo.algorithms.moo.nsga2 import NSGA2

    called = []

    def make(n=5):
        called.append(n)
        return BOACO(n_ants=n)

    def plain(n: int = 5) -> Algorithm:
        return BOACO(n_ants=n)

    def own(n: int = 5) -> BOACO:
        return BOACO(n_ants=n)

    def dotted() -> bm.algorithms.BOACO:
        return BOACO(n_ants=5)

    def lazy() -> bm.BOACO:
        return BOACO(n_ants=5)

    def quoted() -> "BOACO":
        return BOACO(n_ants=5)

    def either() -> BOACO | "bm.RandomTrails":
        return BOACO(n_ants=5)

    def unlikely() -> BOACO | None:
        return make()

    def kind() -> type[BOACO]:
        return make()

    def mission() -> Mission:
        return make()

    def nothing() -> None:
        return make()

    def checkers() -> NSGA2:
        return make()

    def evaluated() -> called.append(1) or BOACO:
        return make()

    def subscripted() -> [BOACO][called.append(1) or 0]:
        return make()

    def broken():
        return make()

    broken.__annotations__["return"] = "BOACO if ("

    short = lambda: make()
    partial = functools.partial(own, n=7)
    bare_partial = functools.partial(make, n=7)
    class_partial = functools.partial(BOACO, n_ants=7)
    cached = functools.cache(quoted)

    class Caller:
        def __call__(self) -> BOACO:
            return make()

        def __getattr__(self, name):
            called.append(name)
            return lambda: make()

    caller = Caller()

    class Quiet(BOACO):
        @classmethod
        def own(cls) -> Self:
            return cls(n_ants=5)

        @classmethod
        def bare(cls):
            return make()

        @staticmethod
        def static() -> Quiet:
            return Quiet(n_ants=5)

        def method(self) -> BOACO:
            return make()

        @property
        def asked(self) -> BOACO:
            return make()

    class Factory:
        @classmethod
        def named(cls) -> BOACO:
            return BOACO(n_ants=5)

        @classmethod
        def itself(cls) -> Self:
            return make()

    quiet = Quiet()

    class Endless(CTAEA):
        def __init__(self) -> None:
            called.append("endless")

    def endless() -> Algorithm:
        return Endless.__new__(Endless)
"""


class TestOnlyAlgorithmsAreCalled:
    @pytest.mark.parametrize(
        "path",
        [
            "danger:plain",
            "danger.plain",
            "danger:own",
            "danger:dotted",
            "danger:lazy",
            "danger:quoted",
            "danger:either",
            "danger:partial",
            "danger:class_partial",
            "danger:cached",
            "danger:Quiet",
            "danger:Quiet.own",
            "danger:Quiet.static",
            "danger:Quiet.journal",
            "danger:Factory.named",
            "danger:bm.BOACO",
            "botohe_moo:BOACO.journal",
        ],
    )
    def test_what_says_that_it_makes_one_is(self, local, path):
        local(DANGER, "danger")
        assert isinstance(make_algorithm(path), BOACO)
        assert algorithm_faults(path) == []

    @pytest.mark.parametrize(
        ("path", "what"),
        [
            ("danger:make", "the function make does not say"),
            ("danger:unlikely", "the function unlikely does not say"),
            ("danger:kind", "the function kind does not say"),
            ("danger:mission", "the function mission does not say"),
            ("danger:nothing", "the function nothing does not say"),
            ("danger:checkers", "the function checkers does not say"),
            ("danger:evaluated", "the function evaluated does not say"),
            ("danger:subscripted", "the function subscripted does not say"),
            ("danger:broken", "the function broken does not say"),
            ("danger:short", "the function <lambda> does not say"),
            ("danger:bare_partial", "an object of type partial does not say"),
            ("danger:caller", "an object of type Caller does not say"),
            ("danger:called", "an object of type list does not say"),
            ("danger:quiet", "an object of type Quiet does not say"),
            ("danger:Factory", "the class danger.Factory does not say"),
            ("danger:Factory.itself", "the function Factory.itself does not say"),
            ("danger:Quiet.bare", "the function Quiet.bare does not say"),
            ("danger:Quiet.asked", "an object of type property does not say"),
            ("danger:Quiet.mro", "the function Quiet.mro does not say"),
            ("danger:os", "the module os does not say"),
            ("danger:os.system", "the function system does not say"),
            ("danger:os.path.join", "the function join does not say"),
            ("danger", "there is no such algorithm"),
            ("danger:caller.run", "'run' is looked for in an object of type Caller"),
            ("danger:quiet.own", "'own' is looked for in an object of type Quiet"),
            ("danger:Quiet.method", "'method' is a method of the instances of the class"),
            ("danger:BOACO.setup", "'setup' is a method of the instances of the class"),
            ("danger:make.__globals__", "names such as '__globals__' are not for this"),
            ("danger:Algorithm.__subclasses__", "names such as '__subclasses__' are not for this"),
            ("danger.__builtins__.exec", "names such as '__builtins__' are not for this"),
            ("danger:__doc__", "names such as '__doc__' are not for this"),
            ("pymoo.__main__:x", "names such as '__main__' are not for this"),
            ("danger:Endless", "cannot be used; pymoo's CTAEA never ends"),
            ("botohe_moo.cli.app:main", "the function main does not say"),
            ("botohe_moo.study:run_study", "the function run_study does not say"),
            ("pymoo.optimize:minimize", "the function minimize does not say"),
            ("numpy:load", "the function load does not say"),
            ("os:system", "nothing there says"),
            ("os.system", "nothing there says"),
            ("posix:system", "nothing there says"),
            ("subprocess:Popen", "nothing there says"),
            ("pathlib:Path.unlink", "nothing there says"),
            ("builtins:exec", "nothing there says"),
            ("shutil:rmtree", "nothing there says"),
            ("antigravity:x", "nothing there says"),
        ],
    )
    def test_all_else_is_refused_by_name_and_never_called(self, local, path, what):
        local(DANGER, "danger")
        for refuse in (
            lambda: make_algorithm(path),
            lambda: make_algorithm(path, command="true"),
            lambda: algorithm_parameters(path),
            lambda: describe_algorithm(path),
            lambda: algorithm_origin(path),
        ):
            with pytest.raises(ValueError, match=rf"^Algorithm {path!r}: ") as caught:
                refuse()
            assert what in str(caught.value)
            assert "\n" not in str(caught.value)
        [(blamed, said)] = algorithm_faults(path, {"command": "true"}, plain=True)
        assert blamed is None
        assert what in said
        if "danger" in sys.modules:
            assert sys.modules["danger"].called == []
        assert "antigravity" not in sys.modules

    def test_it_is_said_what_to_do(self):
        with pytest.raises(ValueError, match="is not called") as caught:
            make_algorithm("numpy:array")
        assert str(caught.value) == (
            "Algorithm 'numpy:array': it is not called, because the function array does not say "
            "that it makes an Algorithm; name a class derived from Algorithm, state what the "
            "function returns (-> Algorithm), or register it as entry point of "
            "'botohe_moo.algorithms'."
        )

    def test_what_is_registered_may_be_called_by_its_path(self, install):
        install("danger-algorithms", DANGER, make="make")
        assert make_algorithm("danger_algorithms:make").n_ants == 5
        assert make_algorithm("make").n_ants == 5
        with pytest.raises(ValueError, match="does not say that it makes an Algorithm"):
            make_algorithm("danger_algorithms:Quiet.bare")

    def test_what_never_ends_is_refused_whoever_makes_it(self, install):
        install("danger-algorithms", DANGER, endless="endless")
        with pytest.raises(ValueError, match=r"'endless': cannot be used; pymoo's CTAEA never "):
            make_algorithm("endless")

    def test_a_module_that_cannot_be_imported(self, local):
        local("import no_such_module_at_all", "danger")
        with pytest.raises(ValueError, match=r"^Algorithm 'danger.x': it cannot be imported \(Mod"):
            make_algorithm("danger.x")


class TestIdentity:
    @pytest.mark.parametrize(
        ("path", "name"),
        [
            ("bo-aco", "bo-aco"),
            ("botohe_moo.algorithms.bo_aco:BOACO", "bo-aco"),
            ("botohe_moo.algorithms.bo_aco.BOACO", "bo-aco"),
            ("botohe_moo:BOACO", "bo-aco"),
            ("botohe_moo:RandomTrails", "random"),
            ("botohe_moo:BOACO.journal", "botohe_moo.algorithms.bo_aco:BOACO.journal"),
            (
                "botohe_moo:RandomTrails.journal",
                "botohe_moo.algorithms.random_trails:RandomTrails.journal",
            ),
            ("pymoo.algorithms.moo.age.AGEMOEA", "pymoo.algorithms.moo.age:AGEMOEA"),
        ],
    )
    def test_of_ours_and_of_pymoos(self, path, name):
        assert algorithm_identity(path, {}).name == name

    def test_of_another_package(self, install):
        install("reef-algorithms", REEF, reef="reef", small="small", shallow="Atoll.shallow")
        for path in ("reef_algorithms:reef", "reef_algorithms.reef", "reef"):
            assert algorithm_identity(path, {"width": 1}).name == "reef"
            assert algorithm_origin(path) == algorithm_origin("reef")
        assert algorithm_identity("reef_algorithms:small", {}).name == "small"
        assert algorithm_identity("reef_algorithms:Atoll.shallow", {}).name == "shallow"
        assert algorithm_identity("reef_algorithms:Atoll", {}).name == "reef_algorithms:Atoll"
        # What another package's module only passes on is not ours.
        assert algorithm_identity("reef_algorithms:BOACO", {}).name == "reef_algorithms:BOACO"

    def test_a_broken_neighbour_does_not_matter(self, install):
        install("reef-algorithms", REEF, small="small", gone="gone", broken="no.such:thing")
        assert algorithm_identity("reef_algorithms:Atoll", {}).name == "reef_algorithms:Atoll"

    def test_defaults_are_left_out(self, install):
        install("reef-algorithms", REEF, reef="reef")
        found = algorithm_identity("reef", {"depth": 3, "width": 3, "note": None})
        assert found.parameters == {"width": 3}
        assert found.effective.items() >= {"depth": 3, "width": 3, "note": None}.items()

    def test_values_of_a_model_count_as_written(self, install):
        install(
            "cave-algorithms",
            """
            import enum
            from pathlib import Path
            from pydantic import BaseModel
            from pymoo.core.algorithm import Algorithm

            class Rock(enum.Enum):
                LIME = "lime"
                SAND = "sand"

            class Cave(Algorithm):
                class Parameters(BaseModel):
                    rock: Rock = Rock.LIME
                    map: Path = Path("a/b")
                    levels: tuple[int, ...] = (1, 2)
                    lit: bool = True
                    depth: float = 1.0

                def __init__(self, **parameters):
                    super().__init__()
            """,
            cave="Cave",
        )
        same = {"rock": "lime", "map": "a/b", "levels": [1, 2], "lit": True, "depth": 1}
        assert algorithm_identity("cave", same).parameters == {}
        other = {"rock": "sand", "map": "a", "levels": [1], "lit": False, "depth": 2}
        assert algorithm_identity("cave", other).parameters == other
        assert algorithm_identity("cave", {}).effective == {**same, "depth": 1.0}

    def test_effective_ones_of_a_factory_are_those_of_what_it_makes(self):
        effective = algorithm_identity("botohe_moo:BOACO.journal", {"n_ants": 7}).effective
        assert effective.items() >= {**JOURNAL, "n_ants": 7, "n_threads": 1}.items()


class TestOrigin:
    def test_of_ours_and_of_pymoos(self):
        ours = {"package": "botohe-moo", "version": version("botohe-moo"), "source": None}
        assert algorithm_origin("bo-aco") == ours
        assert algorithm_origin("botohe_moo.algorithms.bo_aco:BOACO.journal") == ours
        for path in ("pymoo.algorithms.moo.age:AGEMOEA", "pymoo.algorithms.moo.age.AGEMOEA"):
            assert algorithm_origin(path) == {
                "package": "pymoo",
                "version": version("pymoo"),
                "source": None,
            }

    def test_of_another_package(self, install, tmp_path):
        install("reef-algorithms", REEF, reef="reef")
        source = hashlib.sha256((tmp_path / "reef_algorithms.py").read_bytes()).hexdigest()
        expected = {"package": "reef-algorithms", "version": "1.0", "source": source}
        assert algorithm_origin("reef") == expected

    def test_of_a_file_that_nobody_has_installed(self, tmp_path, monkeypatch):
        monkeypatch.syspath_prepend(str(tmp_path))
        file = tmp_path / "lone_reef.py"
        file.write_text(textwrap.dedent(REEF))
        for path in ("lone_reef:reef", "lone_reef.small", "lone_reef:Atoll.shallow"):
            assert algorithm_origin(path) == {
                "package": None,
                "version": None,
                "source": hashlib.sha256(file.read_bytes()).hexdigest(),
            }
        before = algorithm_origin("lone_reef:journal")["source"]
        file.write_text(file.read_text() + "\n")
        assert before != algorithm_origin("lone_reef:journal")["source"] is not None

    def test_of_what_is_defined_elsewhere(self, tmp_path, monkeypatch):
        monkeypatch.syspath_prepend(str(tmp_path))
        (tmp_path / "far_reef.py").write_text(textwrap.dedent(REEF))
        (tmp_path / "near_reef.py").write_text("from far_reef import reef")
        before = algorithm_origin("near_reef:reef")["source"]
        (tmp_path / "far_reef.py").write_text(textwrap.dedent(REEF) + "\n")
        assert algorithm_origin("near_reef:reef")["source"] != before

    def test_of_an_unknown_one(self):
        with pytest.raises(ValueError, match="there is no such algorithm"):
            algorithm_origin("bo")
