"""Threads change no result: of each algorithm that has them, wherever it runs."""

import multiprocessing
import pickle
from concurrent.futures import ProcessPoolExecutor

import pytest

from botohe_moo import BOTOHE, load_mission, make_algorithm, solve
from botohe_moo.algorithms.bo_aco import algorithm as bo_aco
from botohe_moo.algorithms.local_search import engine
from botohe_moo.algorithms.registry import algorithm_names, algorithm_parameters
from botohe_moo.base import runtime
from botohe_moo.core import threads
from botohe_moo.operators import variation

NAMES = [
    name
    for name in algorithm_names()
    if "n_threads" in {parameter.name for parameter in algorithm_parameters(name)}
]
ENGINES = ["bo-aco", "nsga2", "pareto-local-search"]  # one for each way to share work
EVALUATIONS = 700


@pytest.fixture(autouse=True)
def shared(monkeypatch):
    """Work is shared from the first evaluations on; forked processes inherit this."""
    monkeypatch.setattr(engine, "FIRST_ALONE", 200)
    monkeypatch.setattr(engine, "N_MIGRANTS", 10)
    monkeypatch.setattr(variation, "_MUCH", 0)
    monkeypatch.setattr(bo_aco, "_MUCH", 0)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bo-aco", "nsga2"])
def test_large_missions_have_much_to_share(name, monkeypatch):
    """As it is for users, and for the workers of studies."""
    monkeypatch.undo()
    used, mapping = set(), threads.mapping
    monkeypatch.setattr(threads, "mapping", lambda n: (used.add(n), mapping(n))[1])
    solve("terrain_200", algorithm=name, n_threads=2, evaluations=300, seed=3)
    assert 2 in used


def begun(name, n_threads, mission="art_museum"):
    islands = {"n_islands": 4} if name == "pareto-local-search" else {}
    algorithm = make_algorithm(name, **islands, n_threads=n_threads)
    problem = BOTOHE(load_mission(mission))
    return algorithm.setup(problem, termination=("n_eval", EVALUATIONS), seed=3)


def finished(algorithm):
    """The front of a run that goes on to its end: trails, and the bits of the objectives."""
    while algorithm.has_next():
        algorithm.next()
    assert algorithm.evaluator.n_eval == EVALUATIONS
    opt = algorithm.opt
    return [plan.trails for plan in opt.get("X")[:, 0]], opt.get("F").tobytes()


def finished_with(name, n_threads):
    return finished(begun(name, n_threads))


@pytest.mark.parametrize(
    "mission", ["art_museum", pytest.param("drones_and_rovers", marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("name", [*ENGINES, *sorted({*NAMES} - {*ENGINES})])
def test_any_number_gives_the_same_front(name, mission):
    one = finished(begun(name, 1, mission))
    for n_threads in (2, 7):
        assert finished(begun(name, n_threads, mission)) == one


@pytest.mark.parametrize("name", ENGINES)
def test_after_pickling_half_way(name):
    algorithm = begun(name, 2)
    while algorithm.evaluator.n_eval < EVALUATIONS // 2:
        algorithm.next()
    again = pickle.loads(pickle.dumps(algorithm))
    assert finished(again) == finished(algorithm) == finished_with(name, 1)


@pytest.mark.slow
@pytest.mark.parametrize("name", ENGINES)
def test_in_a_forked_process(name):
    """Also where the process that forks has run threads before."""
    here = finished_with(name, 2)
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("fork")) as pool:
        assert pool.submit(finished_with, name, 2).result() == here


@pytest.mark.parametrize(
    ("quota", "expected"),
    [(None, 6), ("max 100000", 6), ("250000 100000", 3), ("10000 100000", 1), ("900000 100000", 6)],
)
def test_processors_are_those_of_the_affinity_within_the_quota(
    tmp_path, monkeypatch, quota, expected
):
    monkeypatch.setattr(runtime.os, "sched_getaffinity", lambda _: set(range(6)), raising=False)
    if quota:
        (tmp_path / "cpu.max").write_text(f"{quota}\n")
    assert runtime.n_cpus(tmp_path) == expected
