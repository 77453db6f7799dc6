"""Operators by name: those of this package, those that others register, and ``module:Class``."""

import sys

import pytest
from pymoo.optimize import minimize

from botohe_moo import BOTOHE, load_mission, make_algorithm
from botohe_moo.study.model import algorithm_origin
from tests.base.packages import entries, write_package
from tests.faults import algorithm_faults

REEF = """
    import functools
    import numpy as np
    from pymoo.core.crossover import Crossover
    from pymoo.core.mutation import Mutation
    from pymoo.core.sampling import Sampling

    from botohe_moo import TrailPlan
    from botohe_moo.algorithms import PlanSampling
    from botohe_moo.operators import PlanMutation, RuinRecreate, SafestPathRepair, TrailSplice
    from botohe_moo.trails import PlanBatch

    class Shore(PlanSampling):
        def _sample(self, problem, n_samples, rng):
            home = problem.mission.stay_home()
            return PlanBatch.from_plans([home] * n_samples, problem.mission.robots)

    class Swap(Crossover):
        def __init__(self, **options):
            super().__init__(2, 2, **options)

        def _do(self, problem, X, *_, **__):
            return X[::-1]

    class Single(Swap):
        def __init__(self, **options):
            super().__init__(**options)
            self.n_offsprings = 1

    class Tide(PlanMutation):
        def __init__(self, *, height=1, **options):
            super().__init__(**options)
            self.height = height

        def _draft(self, mission, plans, rng):
            return plans

    class Wave(Mutation):
        def _do(self, problem, X, *_, **__):
            return X

    class Raft(SafestPathRepair):
        pass

    class Wreck(PlanMutation):
        def __init__(self, **options):
            raise SystemExit("no more")

    deep = functools.partial(RuinRecreate, max_via=3)

    def named(**options) -> Mutation:
        return RuinRecreate(max_via=7, **options)

    def odd():
        return Swap()
"""


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Install a package with operators, as pip would."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def install(package="reef", code=REEF, **targets):
        write_package(tmp_path, package, code, entries("operators", package, **targets))
        monkeypatch.delitem(sys.modules, package, raising=False)
        return tmp_path

    return install


def made(**parameters):
    return make_algorithm("nsga2", pop_size=10, **parameters)


def front(algorithm):
    return minimize(BOTOHE(load_mission("toy")), algorithm, ("n_eval", 100), seed=1).F


def kind_of(operator):
    return type(operator).__name__


@pytest.mark.parametrize("prefix", ["", "reef:"])
def test_every_kind_has_names(install, prefix):
    install(Shore="Shore", Swap="Swap", Tide="Tide", Raft="Raft")
    given = {"sampling": "Shore", "crossover": "Swap", "mutation": "Tide", "repair": "Raft"}
    algorithm = made(
        **{kind: prefix + name for kind, name in given.items()},
        corners=False,
        prob_crossover=0.6,
        prob_mutation=0.8,
    )
    crossover, mutation = algorithm.mating.crossover, algorithm.mating.mutation
    (sampling,) = algorithm.initialization.sampling.mixture.parts
    (swap,), (tide,) = crossover.mixture.parts, mutation.mixture.parts
    found = [kind_of(o) for o in (sampling, swap, tide, algorithm.repair)]
    assert found == [*given.values()]
    assert (crossover.prob.value, mutation.prob.value) == (0.6, 0.8)
    assert tide.plan_repair is algorithm.repair
    assert front(algorithm).tolist() == [[0.0, -2.0]]  # nobody ever leaves


def test_they_are_mixed_with_this_packages(install):
    install(Shore="Shore", swap="Swap", Tide="Tide")
    algorithm = made(
        sampling={"guided": 1, "Shore": 3},
        crossover={"swap": 3, "splice": 1, "reef:Single": 0},
        mutation={"Tide": 1, "ruin": 3, "reef:Wave": 0},
    )
    crossover, mutation = algorithm.mating.crossover, algorithm.mating.mutation
    assert [kind_of(part) for part in crossover.mixture.parts] == ["Swap", "TrailSplice"]
    assert [kind_of(part) for part in mutation.mixture.parts] == ["Tide", "RuinRecreate"]
    assert crossover.mixture.weights.tolist() == [3, 1]
    assert mutation.mixture.weights.tolist() == [1, 3]
    assert crossover.prob.value == 0.9


def test_other_forms_that_make_operators(install):
    install(deep="deep", named="named", wave="Wave")
    (deep,) = made(mutation="deep", repair="truncate").mating.mutation.mixture.parts
    assert (deep.max_via, kind_of(deep.plan_repair)) == (3, "TruncateRepair")
    assert made(mutation="reef:named").mating.mutation.mixture.parts[0].max_via == 7
    mutation = made(mutation={"wave": 3, "ruin": 1}, prob_mutation=0.25).mating.mutation
    assert [kind_of(part) for part in mutation.mixture.parts] == ["Wave", "RuinRecreate"]
    assert mutation.prob.value == 0.25
    own = make_algorithm("moead", crossover="botohe_moo.operators:TrailSplice").mating.crossover
    assert [kind_of(part) for part in own.mixture.parts] == ["TrailSplice"]
    assert own.n_offsprings == 1


def test_what_cannot_be_had_is_one_error(install):
    others = {"gone": "Gone", "wreck": "Wreck", "odd": "odd", "single": "Single"}
    install(tide="Tide", wave="Wave", **others)
    for given, message in [
        ({"mutation": {"tid": 1}}, "Expected mutation among tide, .*ruin.*, got 'tid'"),
        ({"mutation": "splice"}, "Expected mutation among .*ruin.*, got 'splice'"),
        ({"crossover": "tide"}, "got 'tide', which is not derived from pymoo's Crossover"),
        ({"crossover": "reef:Raft"}, "'reef:Raft': expected a class derived from Crossover"),
        ({"mutation": "odd"}, "'odd': expected an object of type Mutation, got Swap"),
        ({"mutation": "gone"}, "'gone': reef:Gone of package reef cannot be imported"),
        ({"mutation": "wreck"}, r"Mutation 'wreck': cannot be made \(SystemExit: no more\)"),
        ({"mutation": {"tide": 0}}, "Expected a mutation of weight above 0"),
        ({"crossover": {"single": 1, "splice": 1}}, "as many parents and children as each other"),
        ({"mutation": "pymoo.operators.mutation.pm:PM"}, "pymoo's own operators do not work"),
    ]:
        ((blamed, said),) = algorithm_faults("nsga2", given)
        assert blamed == next(iter(given))
        with pytest.raises(ValueError, match=message) as raised:
            made(**given)
        assert str(raised.value).endswith(said)


def test_results_depend_on_the_code_of_the_operators_that_are_named(install):
    site = install(tide="Tide", swap="Swap")
    ours = algorithm_origin("nsga2", {})
    assert algorithm_origin("nsga2", {"mutation": {"ruin": 1}, "sampling": "guided"}) == ours
    named = [
        {"mutation": "tide"},
        {"mutation": "reef:Tide"},
        {"crossover": {"swap": 1, "splice": 1}},
    ]
    first, *others = [algorithm_origin("nsga2", parameters) for parameters in named]
    assert others == [first, first]
    assert (first["package"], first["version"]) == (ours["package"], ours["version"])
    assert first["source"] is not None is ours["source"]
    with (site / "reef.py").open("a") as file:
        file.write("# another version\n")
    assert algorithm_origin("nsga2", named[0]) != first
