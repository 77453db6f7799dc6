"""Deposit and evaporation against a readable twin."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.kernels.colony.construct import Weights
from botohe_moo.kernels.colony.pheromone import LEAST, Depositors, Pheromone, learn, weigh

N_ARCS, N_ROBOTS = 5, 2


def twin(pheromone, evaporation, pooled, iteration, archived):
    """Dicts of (map, arc) -> [τ_R, τ_S]; the sets are lists of ((E[R], E[S]), trails of arcs)."""
    n_maps = 1 + max(m for m, _ in pheromone)
    after = {key: [(1 - evaporation) * level for level in both] for key, both in pheromone.items()}
    for plans in (iteration, archived):
        size = len(iteration) + len(archived) if pooled else len(plans)
        for objectives, trails in plans:
            for robot, trail in enumerate(trails):
                for arc in trail:
                    for species in range(2):
                        key = (robot if n_maps > 1 else 0, arc)
                        after[key][species] += objectives[species] / size
    return after


plans = st.tuples(
    st.tuples(st.floats(0, 9), st.floats(0, 3)),
    st.lists(
        st.lists(st.integers(0, N_ARCS - 1), min_size=1, max_size=6),
        min_size=N_ROBOTS,
        max_size=N_ROBOTS,
    ),
)


def packed(plans):
    objectives = np.array([objectives for objectives, _ in plans])
    trails = [trail for _, trails in plans for trail in trails]
    offsets = np.zeros(len(trails) + 1, np.int64)
    np.cumsum([len(trail) for trail in trails], out=offsets[1:])
    return objectives, np.array([arc for trail in trails for arc in trail], np.int32), offsets


def new_pheromone(levels, log_eta_reward=0.0, log_eta_survival=None):
    n_maps, n_arcs, _ = levels.shape
    eta = np.zeros(n_arcs) if log_eta_survival is None else np.array(log_eta_survival)
    deposits = np.zeros((2, *levels.shape))
    pheromone = Pheromone(levels, *deposits, np.full(n_arcs, log_eta_reward), eta)
    shape = (n_maps, n_arcs)
    return pheromone, Weights(np.empty(shape), np.empty(shape), np.zeros(n_arcs), np.zeros(n_arcs))


@given(
    st.lists(plans, min_size=1, max_size=4),
    st.sets(st.integers(0, 3), min_size=1),
    st.lists(plans, min_size=1, max_size=4),
    st.sampled_from([1, N_ROBOTS]),
    st.floats(0.01, 0.99),
    st.booleans(),
    st.integers(0, 2**32),
)
def test_learn(batch, chosen, archived, n_maps, evaporation, pooled, seed):
    members = np.array(sorted(i for i in chosen if i < len(batch)) or [0])
    levels = np.random.default_rng(seed).uniform(0.1, 5, (n_maps, N_ARCS, 2))
    before = {(m, a): levels[m, a].tolist() for m in range(n_maps) for a in range(N_ARCS)}
    expected = twin(before, evaporation, pooled, [batch[i] for i in members], archived)

    objectives, arcs, offsets = packed(batch)
    archived_objectives, archived_arcs, archived_offsets = packed(archived)
    everybody = np.arange(len(archived))
    iteration = Depositors(objectives, members, arcs, offsets)
    archive = Depositors(archived_objectives, everybody, archived_arcs, archived_offsets)
    state, weights = new_pheromone(levels)
    again = state._replace(levels=levels.copy())
    for pheromone, changed in ((state, True), (again, False)):
        learn(pheromone, weights, evaporation, pooled, N_ROBOTS, iteration, archive, changed)
        for (m, arc), levels_expected in expected.items():
            assert pheromone.levels[m, arc] == pytest.approx(levels_expected, rel=1e-12)
    before = weights.log_reward.copy()
    weigh(state, weights)
    assert np.array_equal(weights.log_reward, before)


def test_pheromone_never_vanishes():
    """Thousands of iterations without deposit underflow to 0 otherwise, and 0 has no logarithm."""
    objectives, arcs, offsets = packed([((1.0, 1.0), [[0], [0]])])
    plans = Depositors(objectives, np.array([0]), arcs, offsets)
    pheromone, weights = new_pheromone(np.full((1, 2, 2), 1e-249), -3.0, [0.5, -0.5])
    for _ in range(10_000):
        learn(pheromone, weights, 0.5, False, N_ROBOTS, plans, plans, True)
    levels = pheromone.levels
    assert (levels[0, 1] == LEAST).all()
    assert (levels[0, 0] > 1).all()
    assert weights.log_reward[0, 1] == pytest.approx(math.log(LEAST) - 3)
    assert weights.log_survival[0].tolist() == pytest.approx(
        [math.log(levels[0, 0, 1]) + 0.5, math.log(LEAST) - 0.5]
    )
