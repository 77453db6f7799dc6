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
from botohe_moo.study.model import algorithm_origin
from tests.faults import algorithm_faults

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

        Parameters
        ----------
        depth, width
            How far
            it reaches.
        note
            What one says of it.
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
        bare = classmethod(lambda cls: called.append(1))

    class Boat:
        @classmethod
        def built(cls) -> Self: called.append(1)
        @classmethod
        def named(cls) -> BOACO: return BOACO(n_ants=5)

    def lagoon(): return called.append(1) or 3
    def mission() -> Mission: called.append(1)
    def checkers() -> NSGA2: called.append(1)
    def unlikely() -> BOACO | None: called.append(1)
'''


@pytest.fixture
def reef(install):
    install(
        REEF,
        reef="reef",
        small="small",
        shallow="Atoll.shallow",
        atoll="Atoll",
        journal="journal",
        lagoon="lagoon",
        bo_aco="lagoon",
    )


def stated(name):
    return {parameter.name: parameter for parameter in algorithm_parameters(name)}


def defaults(name):
    return {parameter.name: parameter.default for parameter in algorithm_parameters(name)}


def origin_of(name):
    """Package, version and source."""
    found = algorithm_origin(name, {})
    return found["package"], found["version"], found["source"]


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
    plan = load_mission("toy").stay_home()
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
    for function in (make_algorithm, algorithm_parameters, origin_of):
        with pytest.raises(ValueError, match=said):
            function("boaco")
    [(blamed, found)] = algorithm_faults("no_such_module:X")
    assert blamed is None
    assert found.startswith("it cannot be imported (ModuleNotFoundError: No module named")


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("bo-aco", {"evaporation": 1.3}, r"Expected evap.*, got 1\.3\.$"),
        ("bo-aco", {"n_ant": 3}, "there is no parameter 'n_ant'; known are n_ants, "),
        # pymoo's options are for ``minimize``.
        *(("bo-aco", {name: None}, f"no parameter '{name}'") for name in ("seed", "callback")),
        ("reef", {}, "missing 1 required .*'width'"),
        ("reef", {"widht": 3}, "'widht'; known are width, "),
        ("reef", {"width": 3, "evaporation": 0.5}, "no parameter 'evaporation'"),
        ("reef", {"width": 1, "depth": 0}, r"Expected depth >= 1, got 0\.$"),
        ("reef", {"width": "wide"}, "unsupported operand"),
        ("reef", {"width": 1, "depth": "deep"}, r"to be an integer, got 'deep'\.$"),
        ("lagoon", {}, r"expected an object .*, got 3\.$"),
    ],
)
@pytest.mark.usefixtures("reef")
def test_parameters_are_checked(name, parameters, message):
    with pytest.raises(ValueError, match=f"^Algorithm '{name}': .*{message}"):
        make_algorithm(name, **parameters)


@pytest.mark.usefixtures("reef")
def test_what_other_packages_state():
    assert {"reef", "small", "bo-aco"} <= set(algorithm_names())
    depth, width, note = algorithm_parameters("reef")
    assert (depth.default, depth.annotation, depth.required) == (3, "int", False)
    assert (width.annotation, width.required, width.plain) == ("", True, True)
    assert (note.default, note.annotation, note.plain) == (None, "float | None", True)
    described = [depth.description, width.description, note.description]
    assert described == ["How far it reaches."] * 2 + ["What one says of it."]
    assert describe_algorithm("reef") == "Swim past the reef, and back."
    assert describe_algorithm("small") == describe_algorithm("reef")
    assert defaults("small")["width"] == 2
    assert defaults("shallow") == {}  # it hands nothing to its class
    assert list(stated("atoll")) == ["depth"]  # pymoo's options are for minimize
    assert make_algorithm("reef", width=4, depth=5).n_ants == 9
    # A factory states what it changes, and its class the rest.
    assert defaults("journal") == defaults("bo-aco") | JOURNAL
    assert stated("journal")["evaporation"].range == "in (0, 1)"
    colony = make_algorithm("journal", n_ants=5)
    assert (colony.n_ants, colony.evaporation, colony.exploration) == (5, 0.1, 0.01)
    assert isinstance(make_algorithm("bo-aco"), BOACO)  # names of this package are its own


@pytest.mark.parametrize(
    ("code", "found"),
    [
        ("import no_such_module", "ModuleNotFoundError: No module named 'no_such_module'"),
        ("broken = 3", "bad:broken of package bad to be a function"),
        ("import sys; sys.exit('enough')", "SystemExit: enough"),
    ],
)
def test_broken_ones_are_left_out_with_a_warning(install, code, found):
    install(code, package="bad", broken="broken")
    with pytest.warns(UserWarning, match=rf"^Algorithm 'broken': .*{found}.*left out"):
        assert "broken" not in algorithm_names()
    with pytest.raises(ValueError, match=f"^Algorithm 'broken': .*{found}"):
        make_algorithm("broken")


def test_what_they_print_stays_out_of_the_output(install, capsys):
    install(f"{textwrap.dedent(REEF)}\nprint('Welcome!')", package="loud", loud="reef")
    assert "loud" in algorithm_names()
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == ("", "Welcome!\n")


@pytest.mark.usefixtures("reef")
@pytest.mark.parametrize(
    "path",
    [
        *("reef:small", "reef.small", "reef:Quiet", "reef:Quiet.journal", "reef:Boat.named"),
        "botohe_moo:BOACO.journal",
    ],
)
def test_what_states_that_it_makes_an_algorithm_is_called(path):
    assert isinstance(make_algorithm(path), BOACO)
    assert algorithm_faults(path) == []


KEPT = (
    "lagoon",
    "mission",
    "checkers",
    "unlikely",
    "Boat",
    "Boat.built",
    "Quiet.bare",
    "Quiet.mro",
)


@pytest.mark.usefixtures("reef")
@pytest.mark.parametrize("path", [*(f"reef:{name}" for name in KEPT), "os.system", "builtins:exec"])
def test_all_else_is_refused_by_name_and_never_called(monkeypatch, path):
    monkeypatch.setattr(os, "system", lambda command: pytest.fail(command))
    said = f"^Algorithm {path!r}: expected a class derived from Algorithm, or a function"
    for function in (make_algorithm, algorithm_parameters, origin_of):
        with pytest.raises(ValueError, match=said):
            function(path)
    [(blamed, _)] = algorithm_faults(path, {"command": "true"})
    assert blamed is None
    assert "reef" not in sys.modules or sys.modules["reef"].called == []


@pytest.mark.usefixtures("reef")
def test_studies_know_defaults_and_what_factories_set():
    algorithms = {
        "reef": {"algorithm": "reef", "parameters": {"width": 3}},
        "ants": {"algorithm": "botohe_moo:BOACO.journal", "parameters": {"n_ants": 7}},
        "sa": {"algorithm": "botohe_moo:SimulatedAnnealing.journal", "parameters": {"n_passes": 2}},
    }
    study = {"name": "s", "missions": ["toy"], "seeds": 1, "budget": {"evaluations": 1}}
    found = load_study({**study, "algorithms": algorithms}).algorithms
    reef, ants, annealing = (each.effective for each in found)
    assert reef.items() >= {"depth": 3, "width": 3, "note": None}.items()
    assert ants.items() >= {**JOURNAL, "n_ants": 7, "n_threads": 1}.items()
    assert (annealing["return_probability"], annealing["n_passes"]) == (0.0, 2)


@pytest.mark.usefixtures("reef")
def test_the_origin_of_packages(tmp_path):
    source = hashlib.sha256((tmp_path / "reef.py").read_bytes()).hexdigest()
    for name, expected in {
        "bo-aco": ("botohe-moo", version("botohe-moo"), None),
        "botohe_moo.algorithms.bo_aco:BOACO.journal": ("botohe-moo", version("botohe-moo"), None),
        "pymoo.algorithms.moo.age:AGEMOEA": ("pymoo", version("pymoo"), None),
        "reef": ("reef", "1.0", source),
    }.items():
        assert origin_of(name) == expected


def test_the_origin_of_files_that_nobody_has_installed(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    file = tmp_path / "lone_reef.py"
    file.write_text(textwrap.dedent(REEF))
    (tmp_path / "near_reef.py").write_text("from lone_reef import reef")
    source = hashlib.sha256(file.read_bytes()).hexdigest()
    for path in ("lone_reef:reef", "lone_reef.small", "lone_reef:Atoll.shallow"):
        assert origin_of(path) == (None, None, source)
    # What the file says counts, and what the file says that it is imported from.
    paths = ("lone_reef:journal", "near_reef:reef")
    before = [origin_of(path)[2] for path in paths]
    file.write_text(file.read_text() + "\n")
    after = [origin_of(path)[2] for path in paths]
    assert not set(before) & set(after)
    assert None not in before
