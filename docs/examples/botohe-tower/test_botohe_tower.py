"""Towers keep what can be relied on of every mission."""

from botohe_tower import tower

from botohe_moo.testing import parametrize_with_checks


@parametrize_with_checks([tower])
def test_conforms(check):
    check()


def test_rooms_pay_more_the_higher_they_are():
    graph = tower(floors=3, rooms=2).graph
    rewards = [{graph.nodes[f"{floor}: room {i}"]["reward"] for i in (1, 2)} for floor in range(3)]
    assert all(reward % (floor + 1) == 0 for floor in range(3) for reward in rewards[floor])
