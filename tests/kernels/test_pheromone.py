"""Deposit and evaporation against a readable twin."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.kernels.colony.pheromone import LEAST, learn, log_weights

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
    pheromone = np.random.default_rng(seed).uniform(0.1, 5, (n_maps, N_ARCS, 2))
    before = {(m, a): pheromone[m, a].tolist() for m in range(n_maps) for a in range(N_ARCS)}
    expected = twin(before, evaporation, pooled, [batch[i] for i in members], archived)

    objectives, arcs, offsets = packed(batch)
    archived_objectives, archived_arcs, archived_offsets = packed(archived)
    amounts, archived_amounts = np.zeros((2, n_maps, N_ARCS, 2))
    again = pheromone.copy()
    for levels, changed in ((pheromone, True), (again, False)):
        learn(
            levels,
            evaporation,
            pooled,
            objectives,
            members,
            arcs,
            offsets,
            archived_objectives,
            archived_arcs,
            archived_offsets,
            changed,
            N_ROBOTS,
            amounts,
            archived_amounts,
        )
        for (m, arc), levels_expected in expected.items():
            assert levels[m, arc] == pytest.approx(levels_expected, rel=1e-12)


def test_pheromone_never_vanishes():
    """Thousands of iterations without deposit underflow to 0 otherwise, and 0 has no logarithm."""
    pheromone = np.full((1, 2, 2), 1e-249)
    objectives, arcs, offsets = packed([((1.0, 1.0), [[0], [0]])])
    amounts, archived_amounts = np.zeros((2, 1, 2, 2))
    for _ in range(10_000):
        learn(
            pheromone,
            0.5,
            False,
            objectives,
            np.array([0]),
            arcs,
            offsets,
            objectives,
            arcs,
            offsets,
            True,
            N_ROBOTS,
            amounts,
            archived_amounts,
        )
    assert (pheromone[0, 1] == LEAST).all()
    assert (pheromone[0, 0] > 1).all()
    log_reward, log_survival = np.empty((2, 1, 2))
    log_weights(pheromone, -3.0, np.array([0.5, -0.5]), log_reward, log_survival)
    assert log_reward[0, 1] == pytest.approx(math.log(LEAST) - 3)
    assert log_survival[0].tolist() == pytest.approx(
        [math.log(pheromone[0, 0, 1]) + 0.5, math.log(LEAST) - 0.5]
    )
