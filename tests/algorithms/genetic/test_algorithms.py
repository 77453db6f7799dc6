"""Operators by name: those of this package, those that others register, and ``module:Class``."""

import pytest
from pymoo.optimize import minimize

from botohe_moo import BOTOHE, load_mission, make_algorithm
from botohe_moo.study.model import algorithm_origin
from tests.faults import algorithm_faults

REEF = """
    import functools
    from pymoo.core.crossover import Crossover
    from pymoo.core.mutation import Mutation

    from botohe_moo.algorithms import PlanSampling
    from botohe_moo.operators import PlanMutation, RuinRecreate, SafestPathRepair

    class Shore(PlanSampling):
        def _sample(self, problem, n_samples, rng):
            return problem.mission.batch([problem.mission.stay_home()] * n_samples)

    class Swap(Crossover):
        def __init__(self, **options): super().__init__(2, 2, **options)
        def _do(self, problem, X, *_, **__): return X[::-1]

    class Single(Swap):
        def __init__(self, **options):
            super().__init__(**options)
            self.n_offsprings = 1

    class Tide(PlanMutation):
        def __init__(self, *, height=1, **options): super().__init__(**options)
        def _draft(self, mission, plans, rng): return plans

    class Wave(Mutation):
        def _do(self, problem, X, *_, **__): return X

    class Raft(SafestPathRepair): pass

    class Wreck(PlanMutation):
        def __init__(self, **options): raise SystemExit("no more")

    deep = functools.partial(RuinRecreate, max_via=3)
    def named(**options) -> Mutation: return RuinRecreate(max_via=7, **options)
    def odd(): return Swap()
"""


@pytest.fixture(autouse=True)
def reef(install):
    targets = {name: name for name in ("Shore", "Swap", "Single", "Tide", "Wave", "Raft", "Wreck")}
    targets |= {"deep": "deep", "named": "named", "odd": "odd", "gone": "Gone"}
    install(REEF, group="operators", **targets)


def made(name="nsga2", **parameters):
    return make_algorithm(name, pop_size=10, **parameters)


def parts_of(mixed):
    return [type(part).__name__ for part in mixed.mixture.parts]


@pytest.mark.parametrize("prefix", ["", "reef:"])
def test_every_kind_has_names(prefix):
    given = {"sampling": "Shore", "crossover": "Swap", "mutation": "Tide", "repair": "Raft"}
    named = {kind: prefix + name for kind, name in given.items()}
    algorithm = made(**named, corners=False, prob_crossover=0.6, prob_mutation=0.8)
    crossover, mutation = algorithm.mating.crossover, algorithm.mating.mutation
    mixtures = [algorithm.initialization.sampling, crossover, mutation]
    assert [parts_of(mixed) for mixed in mixtures] == [["Shore"], ["Swap"], ["Tide"]]
    assert (crossover.prob.value, mutation.prob.value) == (0.6, 0.8)
    [tide] = mutation.mixture.parts
    assert tide.plan_repair is algorithm.repair
    assert type(algorithm.repair).__name__ == "Raft"
    front = minimize(BOTOHE(load_mission("toy")), algorithm, ("n_eval", 100), seed=1).F
    assert front.tolist() == [[0.0, -2.0]]  # nobody ever leaves


def test_they_are_mixed_with_this_packages():
    mating = made(
        sampling={"guided": 1, "Shore": 3},
        crossover={"Swap": 3, "splice": 1, "reef:Single": 0},
        mutation={"Tide": 1, "ruin": 3, "reef:Wave": 0},
        prob_mutation=0.25,
    ).mating
    assert parts_of(mating.crossover) == ["Swap", "TrailSplice"]
    assert parts_of(mating.mutation) == ["Tide", "RuinRecreate"]
    assert mating.crossover.mixture.weights.tolist() == [3, 1]
    assert mating.mutation.mixture.weights.tolist() == [1, 3]
    assert (mating.crossover.prob.value, mating.mutation.prob.value) == (0.9, 0.25)


def test_other_forms_that_make_operators():
    [deep] = made(mutation="deep", repair="truncate").mating.mutation.mixture.parts
    assert (deep.max_via, type(deep.plan_repair).__name__) == (3, "TruncateRepair")
    [named] = made(mutation="reef:named").mating.mutation.mixture.parts
    assert named.max_via == 7
    own = made("moead", crossover="botohe_moo.operators:TrailSplice").mating.crossover
    assert (parts_of(own), own.n_offsprings) == (["TrailSplice"], 1)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"mutation": {"Tid": 1}}, "Expected mutation among Tide, .*ruin.*, got 'Tid'"),
        ({"mutation": "splice"}, "Expected mutation among .*ruin.*, got 'splice'"),
        ({"crossover": "Tide"}, "got 'Tide', which is not derived from pymoo's Crossover"),
        ({"crossover": "reef:Raft"}, "'reef:Raft': expected a class derived from Crossover"),
        ({"mutation": "odd"}, "'odd': expected an object of type Mutation, got Swap"),
        ({"mutation": "gone"}, "'gone': reef:Gone of package reef cannot be imported"),
        ({"mutation": "Wreck"}, r"Mutation 'Wreck': cannot be made \(SystemExit: no more\)"),
        ({"mutation": {"Tide": 0}}, "Expected a mutation of weight above 0"),
        ({"crossover": {"Single": 1, "splice": 1}}, "as many parents and children as each other"),
        ({"mutation": "pymoo.operators.mutation.pm:PM"}, "pymoo's own operators do not work"),
    ],
)
def test_what_cannot_be_had_is_one_error(given, message):
    ((blamed, said),) = algorithm_faults("nsga2", given)
    assert blamed == next(iter(given))
    with pytest.raises(ValueError, match=message) as raised:
        made(**given)
    assert str(raised.value).endswith(said)


def test_results_depend_on_the_code_of_the_operators_that_are_named(tmp_path):
    ours = algorithm_origin("nsga2", {})
    assert algorithm_origin("nsga2", {"mutation": {"ruin": 1}, "sampling": "guided"}) == ours
    named = [
        {"mutation": "Tide"},
        {"mutation": "reef:Tide"},
        {"crossover": {"Swap": 1, "splice": 1}},
    ]
    first, *others = [algorithm_origin("nsga2", parameters) for parameters in named]
    assert others == [first, first]
    assert (first["package"], first["version"]) == (ours["package"], ours["version"])
    assert first["source"] is not None is ours["source"]
    with (tmp_path / "reef.py").open("a") as file:
        file.write("# another version\n")
    assert algorithm_origin("nsga2", named[0]) != first
