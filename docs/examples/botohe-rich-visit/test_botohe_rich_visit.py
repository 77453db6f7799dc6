"""RichVisit makes valid plans of valid ones."""

import numpy as np
from botohe_rich_visit import RichVisit

from botohe_moo import load_mission, make_algorithm, solve


def parents_on(mission):
    found = solve(mission, "random", evaluations=100, seed=1)
    return mission.batch(found.plans)


def test_children_are_valid_and_parents_unchanged():
    mission = load_mission("art_museum")
    parents = parents_on(mission)
    before = list(parents)
    rng = np.random.default_rng(1)
    children = RichVisit().mutate_batch(mission, parents, rng)
    assert mission.evaluate(children).shape == (len(parents), 2)
    assert list(parents) == before
    assert list(children) != before


def test_the_same_generator_gives_the_same_children():
    mission = load_mission("art_museum")
    parents = parents_on(mission)
    first, second = (
        RichVisit().mutate_batch(mission, parents, np.random.default_rng(7))
        for _ in range(2)
    )
    assert list(first) == list(second)


def test_it_is_known_by_its_name():
    algorithm = make_algorithm("nsga2", pop_size=20, mutation="rich-visit")
    assert solve("toy", algorithm, evaluations=100).evaluations == 100
