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

pytestmark = pytest.mark.slow

CROSSOVERS = {  # names that no mutation has
    "splice": TrailSplice,
    "one child": lambda **options: TrailSplice(n_offsprings=1, **options),
    "splice, truncated": lambda **options: TrailSplice(repair=TruncateRepair(), **options),
    "either": lambda **options: MixedCrossover(
        {TrailSplice(): 2, TrailSplice(repair=TruncateRepair()): 1}, **options
    ),
}
MUTATIONS = {
    "share": ShareTrails,
    "ruin": RuinRecreate,
    "ruin without via": lambda **options: RuinRecreate(max_via=0, **options),
    "truncated": lambda **options: RuinRecreate(repair=TruncateRepair(), **options),
    "mixed": lambda **options: MixedMutation({RuinRecreate(): 2, ShareTrails(): 1}, **options),
}


def test_every_operator_is_under_contract():
    made = [make() for table in (CROSSOVERS, MUTATIONS) for make in table.values()]
    exported = {getattr(operators, name) for name in operators.__all__}
    concrete = {c for c in exported if issubclass(c, Crossover | Mutation)}
    assert concrete - {PlanCrossover, PlanMutation} == {type(operator) for operator in made}


def generator(seed):
    return np.random.default_rng(seed)


def as_x(drawn):
    return PlanBatch.from_plans(drawn, drawn[0].n_robots).to_array()


def trails_of(pop):
    return [individual.X[0].trails for individual in pop]


@st.composite
def situations(draw, n_plans):
    """A problem, one-way missions among them, and some valid plans for it."""
    mission = draw(missions(max_nodes=8) | team_missions())
    made = [TrailPlan(draw(plans(mission))) for _ in range(n_plans)]
    return problem_of(mission), made


def problem_of(mission, **limits):
    """A problem, if every kind has a way to its end within the limits."""
    try:
        return BOTOHE(mission, **limits)
    except ValueError:
        assume(False)


@pytest.mark.parametrize("name", CROSSOVERS)
@examples(100)
@given(situation=situations(n_plans=6), seed=st.integers(0, 2**32))
def test_crossovers(name, situation, seed):
    problem, parents = situation
    X = as_x(parents)
    pop = Population.new(X=X)
    pairs = np.array([[0, 1], [2, 3], [4, 5]])
    before = trails_of(pop)
    crossover = CROSSOVERS[name]()
    children = crossover(problem, pop, pairs, random_state=generator(seed))
    assert len(children) == 3 * crossover.n_offsprings
    problem.mission.evaluate(problem.mission.batch(children.get("X")))
    assert trails_of(pop) == before == [plan.trails for plan in parents]
    again = CROSSOVERS[name]()(problem, pop, pairs, random_state=generator(seed))
    assert trails_of(again) == trails_of(children)


@pytest.mark.parametrize("name", MUTATIONS)
@examples(100)
@given(situation=situations(n_plans=4), seed=st.integers(0, 2**32))
def test_mutations(name, situation, seed):
    problem, parents = situation
    mutation = MUTATIONS[name]()
    children = mutation(problem, Population.new(X=as_x(parents)), random_state=generator(seed))
    assert len(children) == len(parents)
    problem.mission.evaluate(problem.mission.batch(children.get("X")))
    again = MUTATIONS[name]()(
        problem, Population.new(X=as_x(parents)), random_state=generator(seed)
    )
    assert trails_of(again) == trails_of(children)
    X = as_x(parents)
    changed = mutation._do(problem, X, random_state=generator(seed))
    assert [x.trails for x in X.ravel()] == [plan.trails for plan in parents]
    assert changed.shape == X.shape


N = 6_000


def within(found, rate, n):
    """Whether a count is within four and a half standard deviations of a rate."""
    return abs(found - rate * n) <= 4.5 * np.sqrt(n * rate * (1 - rate)) + 1e-9


@pytest.fixture(scope="module")
def crowd():
    """Many copies of a pair of plans, and what an operator at full rate changes of them."""
    problem = BOTOHE(load_mission("art_museum"))
    mission, rng = problem.mission, generator(3)
    drafts = rng.integers(len(mission.nodes), size=(2, 3, 12)).tolist()
    pair = SafestPathRepair().repair_batch(mission, mission.batch(map(TrailPlan, drafts)))
    return problem, PlanBatch.from_plans(list(pair) * (N // 2), 3).to_array()


def changed_share(operator, problem, X):
    """The share of children that are none of the parents."""
    pop, parents = Population.new(X=X.copy()), set(X.ravel())
    if isinstance(operator, Crossover):
        pairs = np.arange(len(X)).reshape(-1, 2)
        children = operator(problem, pop, pairs, random_state=generator(1))
        plans = children.get("X").reshape(operator.n_offsprings, -1)[0]
    else:
        plans = operator(problem, pop, random_state=generator(1)).get("X").ravel()
    return np.mean([plan not in parents for plan in plans]), len(plans)


@pytest.mark.parametrize("name", [*CROSSOVERS, *MUTATIONS])
def test_rates(name, crowd):
    # Some drafts are repaired to the plan they were made of, at any rate.
    make = CROSSOVERS.get(name) or MUTATIONS[name]
    always, n = changed_share(make(prob=1.0), *crowd)
    assert always > 0.25
    for prob in (0.0, 0.3, 0.8):
        share, _ = changed_share(make(prob=prob), *crowd)
        spread = np.sqrt(always * (1 - always) / n) * prob * 4.5
        expected = prob * always
        assert abs(share - expected) <= 4.5 * np.sqrt(expected * (1 - expected) / n) + spread, prob


def test_rates_of_mixtures():
    parts = {ShareTrails(): 1.0, RuinRecreate(): 3.0, RuinRecreate(max_via=0): 0.5}
    shares = MixedMutation(parts).mixture.draw(generator(1), N)
    assert sorted(np.concatenate([share for _, share in shares]).tolist()) == list(range(N))
    for (part, share), weight in zip(shares, parts.values(), strict=True):
        assert parts[part] == weight
        assert within(len(share), weight / 4.5, N)


def test_rate_of_copies():
    mission = load_mission("toy")
    one, other = [1, 2, 1], [1, 3, 1]  # they share no node inside
    plan = mission.plan([one, other])
    batch = PlanBatch.from_plans([plan] * N, 2)
    mutation = ShareTrails(prob_copy=0.3)
    drafts = mutation._draft(mission, batch, generator(1))
    copied = sum(len(set(draft.trails)) == 1 for draft in drafts)
    assert within(copied, 0.3, N)


def test_batches_are_checked():
    toy, none = load_mission("toy"), PlanBatch.from_plans([], 2)
    assert len(RuinRecreate().mutate_batch(toy, none, generator(1))) == 0
    threes = PlanBatch.from_plans([TrailPlan([[0]] * 3)], 3)
    with pytest.raises(ValueError, match="Plan 0: expected 2 trails, got 3"):
        RuinRecreate().mutate_batch(toy, threes, generator(1))
    empty = PlanBatch(np.array([0], np.int32), np.array([0, 1, 1]), 2)
    with pytest.raises(ValueError, match="Plan 0, robot 1: expected at least one node, got none"):
        RuinRecreate().mutate_batch(toy, empty, generator(1))


class TestDuplicates:
    A, B, C = [0, 1, 0], [0, 2, 0], [0]

    def population(self, *plans):
        return Population.new(X=PlanBatch.from_plans(map(TrailPlan, plans), 3).to_array())

    def test_the_order_of_the_robots_does_not_matter_but_how_often_a_trail_is_there(self):
        A, B, C = self.A, self.B, self.C
        pop = self.population([A, A, B], [A, B, B], [B, A, A], [C, A, B], [B, C, A], [B, B, A])
        left = PlanDuplicates().do(pop)
        assert trails_of(left) == trails_of(pop[[0, 1, 3]])  # the first ones stay

    def test_of_other_populations(self):
        A, B, C = self.A, self.B, self.C
        pop = self.population([A, A, B], [C, C, C], [A, B, C])
        left = PlanDuplicates().do(pop, self.population([B, A, A]), self.population([C, B, A]))
        assert trails_of(left) == [((0,), (0,), (0,))]
        assert len(PlanDuplicates().do(pop[[]], pop)) == 0


def test_repairs_are_checked():
    with pytest.raises(TypeError, match="Expected repair to be a PlanRepair, got 'safest'"):
        TrailSplice(repair="safest")
    with pytest.raises(TypeError, match="Expected a mutation to be a Mutation, got 'ruin'"):
        MixedMutation(["ruin"])
    with pytest.raises(ValueError, match="Expected at least one mutation, got none"):
        MixedMutation([])
    with pytest.raises(ValueError, match="Expected weight of a mutation > 0, got 0"):
        MixedMutation({RuinRecreate(): 0})


def test_children_share_one_repair():
    repair = SafestPathRepair()
    problem = BOTOHE(load_mission("art_museum"))
    home = [problem.mission.stay_home()] * 10
    pop = Population.new(X=PlanBatch.from_plans(home, 3).to_array())
    RuinRecreate(repair=repair)(problem, pop, random_state=generator(0))
    ShareTrails(repair=repair)(problem, pop, random_state=generator(0))
    assert repair.counts.plans == 20
