"""RichVisit makes valid plans of valid ones."""

import numpy as np
from botohe_rich_visit import RichVisit

from botohe_moo import load_mission, make_algorithm, solve


def test_children_are_valid_and_parents_unchanged():
    mission = load_mission("art_museum")
    parents = mission.batch(solve(mission, "random", evaluations=100, seed=1).plans)
    before = list(parents)
    children = RichVisit().mutate_batch(mission, parents, np.random.default_rng(1))
    assert mission.evaluate(children).shape == (len(parents), 2)
    assert list(parents) == before
    assert list(children) != before


def test_the_same_generator_gives_the_same_children():
    mission = load_mission("art_museum")
    parents = mission.batch(solve(mission, "random", evaluations=100, seed=1).plans)
    first, second = (
        RichVisit().mutate_batch(mission, parents, np.random.default_rng(7)) for _ in range(2)
    )
    assert list(first) == list(second)


def test_it_is_known_by_its_name():
    algorithm = make_algorithm("nsga2", pop_size=20, mutation="rich-visit")
    assert solve("toy", algorithm, evaluations=100).evaluations == 100
