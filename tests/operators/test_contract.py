"""What holds for every operator: valid children, untouched inputs, rates, repeatability."""

import copy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymoo.core.population import Population

from botohe_moo import BOTOHE, PlanBatch, TrailPlan, load_mission, operators
from botohe_moo.operators import (
    CornerSampling,
    GivenSampling,
    GuidedTrailSampling,
    MixedCrossover,
    MixedMutation,
    MixedSampling,
    PlanCrossover,
    PlanMutation,
    PlanRepair,
    PlanSampling,
    RandomTrailSampling,
    RuinRecreate,
    SafestPathRepair,
    SendHome,
    ShareTrails,
    TrailExchange,
    TrailMoves,
    TrailSplice,
    TruncateRepair,
)
from tests.strategies import missions, plans

SAMPLINGS = {
    "random": RandomTrailSampling,
    "guided": GuidedTrailSampling,
    "corners": CornerSampling,
    "given": lambda: GivenSampling([]),
    "mixed": lambda: MixedSampling({RandomTrailSampling(): 1, GuidedTrailSampling(): 2}),
}
CROSSOVERS = {
    "exchange": TrailExchange,
    "splice": TrailSplice,
    "mixed": MixedCrossover,
    "one child": lambda **options: MixedCrossover(n_offsprings=1, **options),
    "truncated": lambda **options: TrailSplice(repair=TruncateRepair(), **options),
}
MUTATIONS = {
    "moves": TrailMoves,
    "moves of all": lambda **options: TrailMoves(every_robot=True, **options),
    "ruin": RuinRecreate,
    "ruin without via": lambda **options: RuinRecreate(max_via=0, **options),
    "home": SendHome,
    "share": ShareTrails,
    "truncated": lambda **options: RuinRecreate(repair=TruncateRepair(), **options),
    "mixed": lambda **options: MixedMutation(
        {TrailMoves(): 1, RuinRecreate(): 2, ShareTrails(): 1}, **options
    ),
}


def test_every_operator_is_under_contract():
    made = [make() for table in (SAMPLINGS, CROSSOVERS, MUTATIONS) for make in table.values()]
    kinds = (PlanSampling, PlanCrossover, PlanMutation)
    exported = {getattr(operators, name) for name in operators.__all__}
    concrete = {c for c in exported if issubclass(c, kinds)} - set(kinds)
    assert concrete == {type(operator) for operator in made}


def generator(seed):
    return np.random.default_rng(seed)


def as_x(drawn):
    return PlanBatch.from_plans(drawn, drawn[0].n_robots).to_array()


def trails_of(pop):
    return [individual.X[0].trails for individual in pop]


@st.composite
def situations(draw, n_plans):
    """A problem, one-way missions among them, and some valid plans for it."""
    mission = draw(missions(max_nodes=8))
    made = [mission.plan(draw(plans(mission))) for _ in range(n_plans)]
    return BOTOHE(mission), made


@pytest.mark.parametrize("name", SAMPLINGS)
@settings(max_examples=60, deadline=None)
@given(mission=missions(max_nodes=8), floor=st.sampled_from([0.0, 0.5, 0.9]), n=st.integers(1, 7))
def test_samplings(name, mission, floor, n):
    problem = BOTOHE(mission, min_survival=floor)
    pop = SAMPLINGS[name]()(problem, n, random_state=generator(n))
    assert len(pop) == n
    batch = mission.batch(pop.get("X"))
    mission.evaluate(batch)
    assert (mission.robot_survival(batch) >= floor * (1 - 1e-12)).all()
    again = SAMPLINGS[name]()(problem, n, random_state=generator(n))
    assert trails_of(again) == trails_of(pop)


@pytest.mark.parametrize("name", CROSSOVERS)
@settings(max_examples=100, deadline=None)
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
@settings(max_examples=100, deadline=None)
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


@pytest.mark.parametrize("name", [*CROSSOVERS, *MUTATIONS])
def test_other_random_numbers_give_other_children(name):
    problem = BOTOHE(load_mission("art_museum"))
    pop = RandomTrailSampling()(problem, 40, random_state=generator(0))
    found = []
    for seed in (1, 2):
        given = copy.deepcopy(pop)
        if name in CROSSOVERS:
            pairs = np.arange(40).reshape(20, 2)
            found.append(CROSSOVERS[name]()(problem, given, pairs, random_state=generator(seed)))
        if name in MUTATIONS:
            found.append(MUTATIONS[name]()(problem, given, random_state=generator(seed)))
    assert trails_of(found[0]) != trails_of(found[1])


class Mark(PlanRepair):
    """Gives plans that no operator would: whoever was changed shows it."""

    def repair_batch(self, mission, drafts):
        home = TrailPlan([[mission.arrays.base]] * mission.robots)
        return PlanBatch.from_plans([home] * len(drafts), mission.robots)


N = 4_000


def within(found, rate, n):
    """Whether a count is within four standard deviations of a rate."""
    return abs(found - rate * n) <= 4 * np.sqrt(n * rate * (1 - rate))


@pytest.fixture(scope="module")
def crowd():
    problem = BOTOHE(load_mission("art_museum"))
    plan = RandomTrailSampling()(problem, 1, random_state=generator(3))[0].X[0]
    assert any(len(trail) > 1 for trail in plan.trails)
    return problem, as_x([plan] * N)


@pytest.mark.parametrize("prob", [0.0, 0.3, 0.8, 1.0])
@pytest.mark.parametrize("name", sorted(set(CROSSOVERS) - {"truncated"}))
def test_rate_of_crossovers(name, prob, crowd):
    problem, X = crowd
    crossover = CROSSOVERS[name](prob=prob, repair=Mark())
    pairs = np.arange(N).reshape(-1, 2)
    children = crossover(problem, Population.new(X=X), pairs, random_state=generator(1))
    children = np.array([len(i.X[0].nodes) == 3 for i in children])
    crossed = children.reshape(crossover.n_offsprings, -1)
    assert (crossed == crossed[0]).all()
    assert within(crossed[0].sum(), prob, N // 2)


@pytest.mark.parametrize("prob", [0.0, 0.3, 0.8, 1.0])
@pytest.mark.parametrize("name", sorted(set(MUTATIONS) - {"truncated"}))
def test_rate_of_mutations(name, prob, crowd, monkeypatch):
    problem, X = crowd
    mutation = MUTATIONS[name](prob=prob)
    monkeypatch.setattr(
        mutation, "mutate_batch", lambda mission, drafts, _: Mark().repair_batch(mission, drafts)
    )
    children = mutation(problem, Population.new(X=X.copy()), random_state=generator(1))
    assert within(sum(len(i.X[0].nodes) == 3 for i in children), prob, N)


@pytest.mark.parametrize("prob_splice", [0.0, 0.3, 1.0])
def test_rate_of_splices(prob_splice):
    kinds = MixedCrossover(prob_splice=prob_splice)._kinds(N, generator(1))
    assert within((kinds == 1).sum(), prob_splice, N)


def test_rates_of_mixtures():
    parts = {SendHome(): 1.0, RuinRecreate(): 3.0, ShareTrails(): 0.5}
    shares = MixedMutation(parts).mixture.draw(generator(1), N)
    assert sorted(np.concatenate(shares).tolist()) == list(range(N))
    for share, weight in zip(shares, parts.values(), strict=True):
        assert within(len(share), weight / 4.5, N)


@pytest.mark.parametrize("prob_copy", [0.0, 0.3, 1.0])
def test_rate_of_copies(prob_copy):
    mission = load_mission("toy")
    one, other = [1, 2, 1], [1, 3, 1]  # they share no node inside
    plan = mission.plan([one, other])
    batch = PlanBatch.from_plans([plan] * N, 2)
    mutation = ShareTrails(prob_copy=prob_copy)
    drafts = mutation._draft(mission, batch, generator(1))
    copied = sum(len(set(draft.trails)) == 1 for draft in drafts)
    assert within(copied, prob_copy, N)


@pytest.mark.parametrize("make", [TrailExchange, RuinRecreate])
@pytest.mark.parametrize("prob", [-0.1, 1.1, "often", None])
def test_probabilities_are_checked(make, prob):
    with pytest.raises(ValueError, match=r"Expected prob in \[0, 1\], got"):
        make(prob=prob)


def test_repairs_are_checked():
    with pytest.raises(TypeError, match="Expected repair to be a PlanRepair, got 'safest'"):
        TrailSplice(repair="safest")
    with pytest.raises(TypeError, match="Expected a mutation to be a PlanMutation, got 'ruin'"):
        MixedMutation(["ruin"])
    with pytest.raises(ValueError, match="Expected at least one mutation, got none"):
        MixedMutation([])
    with pytest.raises(ValueError, match="Expected weight of a mutation > 0, got 0"):
        MixedMutation({SendHome(): 0})
    with pytest.raises(ValueError, match=r"Expected max_via >= 0, got -1"):
        RuinRecreate(max_via=-1)


def test_children_share_one_repair():
    repair = SafestPathRepair()
    problem = BOTOHE(load_mission("art_museum"))
    pop = RandomTrailSampling()(problem, 10, random_state=generator(0))
    RuinRecreate(repair=repair)(problem, pop, random_state=generator(0))
    ShareTrails(repair=repair)(problem, pop, random_state=generator(0))
    assert repair.counts.plans == 20
