"""Interpreted, compiled or first one and then the other: algorithms find the same to the bit."""

import pytest

from botohe_moo import BOTOHE, Kind, Mission, load_mission, make_algorithm
from botohe_moo.core.compile import kernels
from tests.algorithms.test_contract import DOTTED, NAMES, SEARCHING

pytestmark = pytest.mark.compiled_only

SMALL = {
    "bo-aco": {"n_ants": 10},
    "random": {"n_ants": 10},
    "greedy": {"n_weights": 6, "beam_width": 5},
    "exact": {},
    "pareto-local-search": {"evaluations_per_generation": 30},
    "simulated-annealing": {"steps_per_generation": 20},
    SEARCHING: {"n_ants": 10, "local_search": 0.5, "local_search_evaluations": 4},
}
ALL = (*NAMES, *DOTTED, SEARCHING)
TOY = load_mission("toy")
PROBLEMS = {
    "plain": BOTOHE(TOY),
    "limits": BOTOHE(TOY, min_survival=0.3, max_length=6.0),
    "kinds": BOTOHE(Mission(TOY.graph, kinds=[Kind("drone", 1, start=2), Kind("rover", 1)])),
    "return": BOTOHE(Mission(TOY.graph, pays="return")),
}
CASES = [
    pytest.param(name, mission, marks=pytest.mark.slow if mission in ("plain", "return") else ())
    for name in ALL
    for mission in PROBLEMS
    if name != "exact" or mission in ("plain", "limits")
]


def front_of(name, mission, n_interpreted):
    """The plans that are found, with their objectives, if the first generations are interpreted."""
    algorithm = make_algorithm(
        "bo-aco" if name == SEARCHING else name, **SMALL.get(name, {"pop_size": 10})
    )
    algorithm.setup(PROBLEMS[mission], termination=("n_eval", 60), seed=1)
    generation = 0
    while algorithm.has_next():
        with kernels("interpreted" if generation < n_interpreted else "compiled"):
            algorithm.next()
        generation += 1
    return [(each.X[0].trails, each.F.tobytes()) for each in algorithm.opt]


@pytest.mark.parametrize(("name", "mission"), CASES)
def test_it_is_the_same_whenever_kernels_are_compiled(name, mission):
    compiled = front_of(name, mission, 0)
    for n_interpreted in (1 + ALL.index(name) % 5, 99):
        assert front_of(name, mission, n_interpreted) == compiled
