"""Towers keep what can be relied on of every mission."""

from botohe_tower import tower

from botohe_moo.testing import parametrize_with_checks


@parametrize_with_checks([tower])
def test_conforms(check):
    check()


def test_rooms_pay_more_the_higher_they_are():
    graph = tower(floors=3, rooms=2).graph
    for floor in range(3):
        for room in ("room 1", "room 2"):
            reward = graph.nodes[f"{floor}: {room}"]["reward"]
            assert reward % (floor + 1) == 0
