"""What holds for every operator: valid children, untouched inputs, rates, repeatability."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pymoo.core.crossover import Crossover
from pymoo.core.mutation import Mutation
from pymoo.core.population import Population

from botohe_moo import BOTOHE, TrailPlan, load_mission, operators
from botohe_moo.operators import (
    MixedCrossover,
    MixedMutation,
    PlanCrossover,
    PlanDuplicates,
    PlanMutation,
    RuinRecreate,
    SafestPathRepair,
    ShareTrails,
    TrailSplice,
    TruncateRepair,
)
from botohe_moo.trails import PlanBatch
from tests.examples import examples
from tests.strategies import missions, plans, team_missions

OPERATORS = {
    "splice": TrailSplice,
    "one child": lambda **options: TrailSplice(n_offsprings=1, repair=TruncateRepair(), **options),
    "either splice": lambda **options: MixedCrossover(
        {TrailSplice(): 2, TrailSplice(repair=TruncateRepair()): 1}, **options
    ),
    "share": ShareTrails,
    "ruin": RuinRecreate,
    "ruin without via": lambda **options: RuinRecreate(
        max_via=0, repair=TruncateRepair(), **options
    ),
    "either mutation": lambda **options: MixedMutation(
        {RuinRecreate(): 2, ShareTrails(): 1}, **options
    ),
}


def test_every_operator_is_under_contract():
    exported = {getattr(operators, name) for name in operators.__all__}
    concrete = {c for c in exported if issubclass(c, Crossover | Mutation)}
    assert concrete - {PlanCrossover, PlanMutation} == {type(make()) for make in OPERATORS.values()}


def generator(seed):
    return np.random.default_rng(seed)


def as_x(drawn):
    return PlanBatch.from_plans(drawn, drawn[0].n_robots).to_array()


def trails_of(pop):
    return [individual.X[0].trails for individual in pop]


def applied(operator, problem, pop, seed):
    """What pymoo gets from an operator: children of pairs of neighbours, or changed plans."""
    if isinstance(operator, Crossover):
        pairs = np.arange(len(pop)).reshape(-1, 2)
        return operator(problem, pop, pairs, random_state=generator(seed))
    return operator(problem, pop, inplace=False, random_state=generator(seed))


@pytest.mark.slow
@pytest.mark.parametrize("name", OPERATORS)
@examples(100)
@given(st.data(), st.integers(0, 2**32))
def test_children_are_valid_parents_stay_and_the_seed_decides(name, data, seed):
    mission = data.draw(missions(max_nodes=8) | team_missions())
    parents = [TrailPlan(data.draw(plans(mission))) for _ in range(4)]
    try:
        problem = BOTOHE(mission)
    except ValueError:  # some kind has no way to its end within its limits
        assume(False)
    pop, before = Population.new(X=as_x(parents)), [plan.trails for plan in parents]
    children = applied(OPERATORS[name](), problem, pop, seed)
    assert len(children) == (2 if name == "one child" else 4)
    mission.evaluate(mission.batch(children.get("X")))
    assert trails_of(applied(OPERATORS[name](), problem, pop, seed)) == trails_of(children)
    assert trails_of(pop) == before  # at full rate, too:
    applied(OPERATORS[name](prob=1.0), problem, pop, seed)
    assert trails_of(pop) == before == [plan.trails for plan in parents]


N = 3_000


@pytest.fixture(scope="module")
def crowd():
    """Many copies of a pair of plans."""
    problem = BOTOHE(load_mission("art_museum"))
    mission, rng = problem.mission, generator(3)
    drafts = rng.integers(len(mission.nodes), size=(2, 3, 12)).tolist()
    pair = SafestPathRepair().repair_batch(mission, mission.batch(map(TrailPlan, drafts)))
    return problem, as_x(list(pair) * (N // 2))


@pytest.mark.slow
@pytest.mark.parametrize("name", OPERATORS)
def test_rates(name, crowd):
    """pymoo's base classes apply ``prob``: an operator that does it again changes prob²."""
    problem, X = crowd

    def changed_share(prob):
        """The share of children that are none of the parents."""
        operator = OPERATORS[name](prob=prob)
        children = applied(operator, problem, Population.new(X=X.copy()), 1).get("X").ravel()
        if isinstance(operator, Crossover):
            children = children.reshape(operator.n_offsprings, -1)[0]
        return np.mean([plan not in set(X[:2, 0]) for plan in children]), len(children)

    always, n = changed_share(1.0)  # some drafts are repaired to the plan they were made of
    assert always > 0.25
    for prob in (0.0, 0.3, 0.8):
        share, _ = changed_share(prob)
        spread = np.sqrt(always * (1 - always) / n) * prob * 4.5
        expected = prob * always
        assert abs(share - expected) <= 4.5 * np.sqrt(expected * (1 - expected) / n) + spread, prob


def test_mixtures_draw_by_weight():
    parts = {ShareTrails(): 1.0, RuinRecreate(): 3.0, RuinRecreate(max_via=0): 0.5}
    shares = MixedMutation(parts).mixture.draw(generator(1), N)
    assert sorted(np.concatenate([share for _, share in shares]).tolist()) == list(range(N))
    for (part, share), weight in zip(shares, parts.values(), strict=True):
        assert parts[part] == weight
        rate = weight / 4.5
        assert abs(len(share) - rate * N) <= 4.5 * np.sqrt(N * rate * (1 - rate))


class Short(PlanMutation):
    """An operator that loses a plan."""

    def _draft(self, mission, plans, rng):
        return plans.take(np.arange(len(plans) - 1))


class Childless(PlanCrossover):
    """Likewise."""

    _draft = Short._draft


TOY = load_mission("toy")


def mutate(operator, drafts):
    return operator.mutate_batch(TOY, drafts, generator(1))


def cross(operator, n_pairs):
    home = np.full((2, n_pairs, 1), TOY.stay_home())
    return operator._do(BOTOHE(TOY), home, random_state=generator(1))


EMPTY = PlanBatch(np.array([0], np.int32), np.array([0, 1, 1]), 2)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: TrailSplice(repair="safest"), "repair to be a PlanRepair, got 'safest'"),
        (lambda: MixedMutation(["ruin"]), "a mutation to be a Mutation, got 'ruin'"),
        (lambda: MixedMutation("ruin"), "a sequence of Mutations"),
        (lambda: MixedMutation([]), "at least one mutation, got none"),
        (lambda: MixedMutation({RuinRecreate(): 0}), "weight of a mutation > 0, got 0"),
        (lambda: MixedMutation([ShareTrails()], prob=7), r"prob in \[0, 1\]"),
        (lambda: MixedCrossover([TrailSplice()], prob=-1), r"prob in \[0, 1\]"),
        (
            lambda: MixedCrossover([TrailSplice(), TrailSplice(n_offsprings=1)]),
            "as many parents and children as each other, got 2 and 1 and 2 and 2",
        ),
        (lambda: mutate(RuinRecreate(), [TrailPlan([[0]] * 3)]), "expected 2 trails, got 3"),
        (lambda: mutate(RuinRecreate(), EMPTY), "Plan 0, robot 1: expected at least one node"),
        (lambda: mutate(Short(), [TOY.stay_home()] * 4), "_draft of Short to give 4 drafts, got 3"),
        (lambda: cross(Childless(), 2), "_draft of Childless to give 4 drafts, got 3"),
    ],
)
def test_what_is_refused(make, message):
    with pytest.raises((TypeError, ValueError), match=message):
        make()


def test_no_plans_stay_none():
    assert len(mutate(RuinRecreate(), [])) == 0


def test_of_duplicates_the_first_ones_stay():
    """The order of the robots does not matter, but how often a trail is there."""
    A, B, C = [0, 1, 0], [0, 2, 0], [0]

    def population(*plans):
        return Population.new(X=as_x([TrailPlan(trails) for trails in plans]))

    pop = population([A, A, B], [A, B, B], [B, A, A], [C, A, B], [B, C, A], [B, B, A])
    left = PlanDuplicates().do(pop)
    assert trails_of(left) == trails_of(pop[[0, 1, 3]])
    left = PlanDuplicates().do(pop, population([B, A, A]), population([C, B, A]))
    assert trails_of(left) == trails_of(pop[[1]])
    assert len(PlanDuplicates().do(pop[[]], pop)) == 0
