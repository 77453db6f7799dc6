"""Missions that were played, step by step."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from botohe_moo import Event, load_mission, simulate_policy
from botohe_moo.underway import POLICIES, play_mission
from tests.examples import examples
from tests.mission.test_underway import keeps_limits
from tests.strategies import missions_with_plans, team_missions_with_plans
from tests.underway.corner import MISSION, NUMBER, PLAN, PLAYED

TOY = load_mission("toy")
TOY_PLAN = TOY.plan([[1, 2, 4, 2, 1], [1, 3, 1]])


@examples(40)
@given(
    missions_with_plans(max_robots=3) | team_missions_with_plans(),
    st.sampled_from(tuple(POLICIES)),
    st.integers(0, 3),
)
def test_steps_are_consistent(case, policy, number):
    mission, plan = case
    assume(keeps_limits(mission, plan))
    played = play_mission(mission, plan, policy, price=1, number=number, evaluations=20)
    start, last = played.steps[0], played.steps[-1]
    assert (start.events, start.trails, set(start.at)) == ((), mission.labels(plan), {0})
    for before, after in pairwise(played.steps):
        moves = {event.robot: event for event in after.events}
        assert len(moves) == len(after.events) > 0
        for robot, (trail, old) in enumerate(zip(after.trails, before.trails, strict=True)):
            at, event = before.at[robot], moves.get(robot)
            moved = event is not None and event.what == "reached"
            assert after.at[robot] == at + moved
            assert trail[: at + 1 + moved] == old[: at + 1 + moved]
            assert event is None or event.node == old[at + 1]
            if robot in after.lost:
                assert trail == old[: at + 2]
            elif after.replan is None:
                assert trail == old
        if after.replan is not None:
            assert after.replan.left.banked == pytest.approx(after.reward)
    assert last.reward == pytest.approx(played.reward)
    assert len(last.lost) == mission.robots - played.survivors
    assert len(played.table) == len(played.sentences) == len(played.steps)


class TestByHand:
    """The robot in the hall is sent on to the lab where another was lost."""

    def test_steps(self):
        start, lost, back, lab, end = PLAYED.steps
        assert (start.lost, start.collected) == ((), {})
        assert lost.events == (Event("lost", 0, "lab"), Event("reached", 1, "hall"))
        assert lost.trails == (("base", "lab"), ("base", "hall", "base", "lab", "base"))
        assert (lost.at, lost.lost, lost.collected) == ((0, 1), (0,), {"hall": 1})
        assert lost.replan.before.tolist() == [0, 1]
        assert lost.replan.objectives.tolist() == [5, 0.25]
        assert (back.events, back.at, back.reward) == ((Event("reached", 1, "base"),), (0, 2), 1)
        assert lab.collected == {"hall": 1, "lab": 10}
        assert end.events == (Event("lost", 1, "base"),)
        assert (end.lost, end.replan) == ((0, 1), None)  # nobody is left to plan for
        assert (PLAYED.reward, PLAYED.survivors) == (11, 0)

    def test_words(self):
        assert PLAYED.sentences == (
            "Start: 6 reward and 1.25 survivors expected.",
            "Step 1: robot 0 is lost between base and lab. The plan is made anew: 5 reward and "
            "0.25 survivors expected from now on, instead of 0 and 1.",
            "Step 2: 1 robot moves on.",
            "Step 3: 1 robot moves on.",
            "Step 4: robot 1 is lost between lab and base. "
            "The mission ends with 11 reward and 0 of 2 robots.",
        )
        assert str(PLAYED) == (
            "Lost: robot 0 between base and lab, robot 1 between lab and base. "
            "The plan is made anew 1 time. The mission ends with 11 reward and 0 of 2 robots."
        )
        kept = play_mission(MISSION, PLAN, price=100, number=NUMBER)
        assert kept.sentences[1].endswith(
            "and stays as it is: 0 reward and 1 survivors expected from now on."
        )

    def test_table(self):
        columns = PLAYED.table[["reward", "robots", "lost"]].to_numpy().T.tolist()
        assert columns == [[0, 1, 1, 11, 11], [2, 1, 1, 1, 0], [0, 1, 0, 0, 1]]
        [replanned] = PLAYED.table[PLAYED.table["replanned"]].to_numpy().tolist()
        assert replanned[-4:] == [0, 1, 5, 0.25]


def test_it_is_a_mission_of_the_simulation():
    table = simulate_policy(TOY, TOY_PLAN, "losses", price=2, missions=5, seed=3).table
    played = [play_mission(TOY, TOY_PLAN, price=2, seed=3, number=number) for number in range(5)]
    means = np.mean([[one.reward, one.survivors] for one in played], axis=0)
    assert table.loc[1, ["reward", "survivors"]].tolist() == means.tolist()
    gained = table.loc[1, ["reward", "survivors"]] - table.loc[0, ["reward", "survivors"]]
    assert table["gain"][1] == pytest.approx(gained["reward"] + 2 * gained["survivors"])


@pytest.mark.parametrize(
    "wrong", [{"policy": "always"}, {"number": -1}, {"price": -1}, {"seed": 0.5}]
)
def test_what_is_wrong_is_said(wrong):
    with pytest.raises((ValueError, TypeError), match=f"Expected {next(iter(wrong))}"):
        play_mission(TOY, TOY_PLAN, **{"price": 1} | wrong)
