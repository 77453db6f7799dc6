"""Choosing a plan by wishes and by a reference point, on fronts judged in one's head."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from botohe_moo import TrailPlan, decide, outcomes
from botohe_moo.decide import choose, toward, worst_case
from botohe_moo.decide import wishes as judged
from botohe_moo.decide.choosing import taken
from botohe_moo.outcomes import plan_outcomes, reach_probabilities, team_reach
from tests import strategies
from tests.decide import made
from tests.decide.made import (
    ATTIC,
    BOTH,
    GROUND,
    HOUSE,
    IN_HOUSE,
    MISSION,
    NAMES,
    PLANS,
    Chance,
    EveryRobot,
    Expected,
    Reach,
    TailMean,
)

# Which plan has the most reward and meets the wishes; see the table in tests/decide/made.py.
ANSWERS = {
    "survivors >= 1.4": "AB",
    "P(reward >= 4) >= 0.7": "AA",  # dominated, but the only one
    "CVaR(reward, 0.1) >= 1.5": "BB",  # (0.01 x 0 + 0.09 x 2) / 0.1 = 1.8
    "CVaR(survivors, 0.5) >= 1": "AC",  # AB: (0.05 x 0 + 0.45 x 1) / 0.5 = 0.9
    "worst case of 1 loss >= 1.9": "AA",  # BB has 1.8
    "reach a >= 0.75": "AA",
    "reach c >= 1 and every robot >= 0.6": "BC",
    # If rewards are all that is wished, the most survivors.
    "reward >= 2.8": "BC",
    "reward >= 2.8 and reward >= 3": "AC",
    "reward >= 2.8 and survivors >= 0": "AB",
}


def test_answers():
    assert {wish: NAMES[choose(MISSION, PLANS, wish).index] for wish in ANSWERS} == ANSWERS


def test_what_there_is_to_be_most_of_can_be_said_and_wishes_come_in_several_forms():
    wishes = ["reach c >= 1", EveryRobot(at_least=0.6), "reward >= 1 and survivors >= 1.9"]
    assert NAMES[choose(MISSION, PLANS, *wishes).index] == "BC"
    for wish, most, name in (
        ("reward >= 2.8", "reward", "AB"),
        ("P(reward >= 3) >= 0.5", "survivors", "BC"),
        # Of equally near ones the best: all miss this probability by 1.
        ("P(survivors >= 3) >= 1", "reward", "AB"),
        ("P(survivors >= 3) >= 1", "survivors", "C"),
    ):
        assert NAMES[choose(MISSION, PLANS, wish, most=most).index] == name
    with pytest.raises(ValueError, match="Expected most among reward, survivors, got 'rewards'"):
        choose(MISSION, PLANS, "reward >= 1", most="rewards")


def test_the_words():
    assert str(choose(MISSION, PLANS, "survivors >= 1.6 and every robot >= 0.9")).splitlines() == [
        "plan 3: expected reward 2.8, expected survivors 1.9",
        "The best among these plans (6): plan 3 has the most reward with survivors >= 1.6 (1.9) "
        "and every robot >= 0.9 (0.9).",
        "Beside it on the front, plan 1 has 0.2 more reward for 0.4 fewer survivors; plan 5 has "
        "0.1 more survivors for 1.8 less reward.",
        # The hull's edges from AB (3.8, 1.4) to BC (2.8, 1.9), and on to C (1, 2): 2 and 18.
        "One more survivor costs 10 reward.",
    ]


def test_a_plan_taken_by_its_number_says_what_a_chosen_one_says():
    chosen, found = choose(MISSION, PLANS, "survivors >= 1.6"), taken(MISSION, PLANS, 3)
    assert (found.index, found.met) == (3, True)
    assert found.why == "Taken by its number from these plans (6)."
    assert str(found) == str(chosen).replace(chosen.why, found.why)
    with pytest.raises(ValueError, match=r"Expected index in \[0, 5\], got 6"):
        taken(MISSION, PLANS, 6)


def test_where_none_has_what_is_wished_the_nearest_is_named():
    # Shortfalls, divided by 2 robots and the total reward 7; AC is nearer than AB in reward.
    #   AB 0.3 and 0, AC 0.25 and 0.07, AA 0.5 and 0.07, BC 0.05 and 0.1, BB 0.1 and 0.217,
    #   C 0 and 0.357
    choice = choose(MISSION, PLANS, "survivors >= 2 and reward >= 3.5")
    assert (NAMES[choice.index], choice.met) == ("BC", False)
    assert [(str(miss.wish), miss.value, miss.by) for miss in choice.missed] == [
        ("survivors >= 2", pytest.approx(1.9), pytest.approx(0.1)),
        ("reward >= 3.5", pytest.approx(2.8), pytest.approx(0.7)),
    ]
    assert choice.why == (
        "None of these plans (6) has survivors >= 2 and reward >= 3.5. Plan 3 comes nearest: "
        "it misses survivors >= 2 by 0.1 (it has 1.9) and reward >= 3.5 by 0.7 (it has 2.8)."
    )
    # Probabilities count as they are: AB lacks 0.45 and 0.3, AC 0.4 and 0.25, BC 0.9 and 0.05.
    choice = choose(MISSION, PLANS, "P(reward >= 5) >= 0.9 and survivors >= 2")
    assert NAMES[choice.index] == "AC"
    choice = choose(MISSION, PLANS, "reward >= 1 and CVaR(survivors, 1) >= 3")
    assert choice.why.endswith(" No plan has CVaR(survivors, 1) >= 3: 2 is the maximum.")


def test_small_fronts():
    choice = choose(MISSION, [PLANS[5]], "reward >= 1")
    assert (choice.index, choice.met, choice.price) == (0, True, 0)
    assert "No plan of the front has more reward or more survivors." in str(choice)
    assert "costs" not in str(choice)
    choice = choose(MISSION, [PLANS[5]], "reward >= 2")
    assert (choice.index, choice.met, choice.missed[0].by) == (0, False, pytest.approx(1))
    for ask in (lambda: choose(MISSION, [], "reward >= 1"), lambda: aim([], 1, 1)):
        with pytest.raises(ValueError, match=r"^Expected at least one plan .*, got none\.$"):
            ask()


@st.composite
def fronts(draw, max_plans=6):
    mission = draw(strategies.missions() | strategies.team_missions())
    plans = draw(st.lists(strategies.plans(mission), min_size=1, max_size=max_plans))
    return mission, [TrailPlan(plan) for plan in plans]


def wishes_for(mission):
    reward = st.floats(0, 1.2 * mission.total_reward + 0.1)
    number = {"reward": reward, "survivors": st.floats(0, mission.robots + 0.5)}
    share = st.floats(0, 1)
    kinds = [
        st.builds(EveryRobot, at_least=share),
        st.builds(made.WorstCase, losses=st.integers(0, mission.robots), at_least=reward),
        st.builds(Reach, node=st.sampled_from(mission.nodes), at_least=share),
    ]
    for quantity, level in number.items():
        said, alpha = st.just(quantity), st.floats(0.01, 1)
        kinds += [
            st.builds(Expected, quantity=said, at_least=level),
            st.builds(Chance, quantity=said, value=level, at_least=share),
            st.builds(TailMean, quantity=said, alpha=alpha, at_least=level),
        ]
    return st.lists(st.one_of(kinds), min_size=1, max_size=3)


def value_of(mission, plan, wish):
    """What a plan has of a wish, in the plainest way."""
    said = getattr(plan_outcomes(mission, plan), wish.quantity or "reward")
    match wish.form:
        case "expected":
            return said.mean
        case "chance":
            return said.at_least(wish.value)
        case "tail mean":
            return said.cvar(wish.alpha)
        case "worst case":
            return worst_case(mission, [plan], wish.losses)[0]
        case "every robot":
            return mission.robot_survival([plan]).min()
        case "reach":
            return team_reach(reach_probabilities(mission, plan))[mission.index(wish.node)]


def lack(mission, plan, wish):
    """How much a plan lacks, as a part of what it can have."""
    quantity = {"worst case": "reward", "chance": None}.get(wish.form, wish.quantity)
    ranges = {"reward": mission.total_reward or 1, "survivors": mission.robots}
    return max(0.0, wish.at_least - value_of(mission, plan, wish)) / ranges.get(quantity, 1)


@given(st.data())
def test_brute_force(data):
    mission, plans = data.draw(fronts())
    wishes = data.draw(wishes_for(mission))
    lacking = np.array([[lack(mission, plan, wish) for wish in wishes] for plan in plans])
    lacking[lacking < 1e-8] = 0
    choice = choose(mission, plans, *wishes)
    only_reward = all(wish.form == "expected" and wish.quantity == "reward" for wish in wishes)
    objectives = mission.evaluate(plans)[:, :: -1 if only_reward else 1]
    meeting = np.flatnonzero(~lacking.any(axis=1))
    assert choice.met == (choice.index in meeting)
    if choice.met:
        assert choice.index == max(meeting, key=lambda i: (*objectives[i], -i))
        return
    assert not len(meeting)
    worst = lacking.max(axis=1)
    assert worst[choice.index] == pytest.approx(worst.min(), abs=1e-7)
    missed = zip(wishes, lacking[choice.index], strict=True)
    assert {str(m.wish) for m in choice.missed} == {str(wish) for wish, much in missed if much}
    for miss in choice.missed:
        value = value_of(mission, plans[choice.index], miss.wish)
        assert miss.value == pytest.approx(value, abs=1e-9)
        assert miss.by == pytest.approx(miss.wish.at_least - miss.value)


def aim(plans, reward, survivors, mission=MISSION):
    return toward(mission, plans, reward=reward, survivors=survivors)


class TestToward:
    # Divided by 7 and 2: AB 0.543 0.7, AC 0.429 0.75, AA 0.429 0.5, BC 0.4 0.95, BB 0.283 0.9,
    # C 0.143 1
    def test_answers(self):
        for reward, survivors, name in (
            (7, 2, "AB"),  # -0.457 beats BC's -0.6
            (3.5, 2, "BC"),  # reference 0.5 1: AB -0.3, AC -0.25, BC -0.1, C -0.357
            (0, 2, "C"),
            (2.8, 1.9, "BC"),
            (2, 1, "AB"),  # reference 0.286 0.5: AB 0.2, AC 0.143, BC 0.114
        ):
            choice = aim(PLANS, reward, survivors)
            assert NAMES[choice.index] == name
            beyond = choice.reward - reward, choice.survivors - survivors
            assert choice.met == (min(beyond) >= -1e-9)

    def test_the_words(self):
        assert aim(PLANS, 3.5, 2).why == (
            "The best among these plans (6) for reward 3.5 and survivors 2: plan 3 misses "
            "reward >= 3.5 by 0.7 (it has 2.8) and survivors >= 2 by 0.1 (it has 1.9)."
        )
        assert aim(PLANS, 2, 1).why.endswith("1: plan 0 has at least as much of both.")
        with pytest.raises(ValueError, match=r"^Expected reward >= 0"):
            aim(PLANS, -1, 1)

    @given(fronts(), st.floats(0, 20), st.floats(0, 3))
    def test_brute_force(self, front, reward, survivors):
        mission, plans = front
        assume(not 0 < mission.total_reward < 1e-100)
        scores = []
        for r, s in mission.evaluate(plans).tolist():
            z = (r - reward) / (mission.total_reward or 1), (s - survivors) / mission.robots
            scores.append((min(z), sum(z)))
        chosen = aim(plans, reward, survivors, mission).index
        least, most = max(scores)[0], scores[chosen][1]
        assert scores[chosen][0] >= least - 2e-9
        assert most >= max(total for low, total in scores if low == least) - 1e-12


def test_distributions_are_computed_from_the_best_plan_on_and_only_those_needed(monkeypatch):
    seen, compute = [], outcomes.reward_distribution

    def noted(mission, plan, **options):
        seen.append(plan)
        return compute(mission, plan, **options)

    monkeypatch.setattr(outcomes, "reward_distribution", noted)
    wishes = "P(reward >= 1) >= 0.5 and CVaR(reward, 1) >= 0 and survivors >= 1.5"
    choose(MISSION, PLANS, wishes)
    assert seen == [PLANS[NAMES.index("AC")]]


def test_what_takes_too_long_is_simulated_and_said(monkeypatch):
    monkeypatch.setattr(judged, "MAX_OUTCOMES", 1)
    choice = choose(MISSION, PLANS, "P(reward >= 4) >= 0.7")
    assert NAMES[choice.index] == "AA"
    assert choice.why.endswith(
        "Some rewards were simulated with 10,000 missions, because their exact distributions "
        "take too long."
    )
    assert choose(MISSION, PLANS, "P(reward >= 4) >= 0.7").why == choice.why


def test_a_solution_chooses_among_its_plans():
    solution = made.solution_of(MISSION, PLANS)
    plans, objectives = solution.plans, solution.objectives
    wishes = "survivors >= 1.6", "reward >= 1"
    assert solution.choose(*wishes).index == choose(MISSION, plans, *wishes).index
    assert solution.choose("reward >= 1", most="reward").plan == PLANS[NAMES.index("AB")]
    assert solution.toward(reward=3.5, survivors=2).plan == PLANS[NAMES.index("BC")]
    assert solution.knees() == decide.knees(MISSION, objectives)
    assert solution.survivor_price(3) == decide.survivor_price(MISSION, plans, 3)
    assert solution.representatives(2) == decide.representatives(MISSION, plans, 2)


def test_survivors_of_a_kind():
    answers = {
        "drone survivors >= 0.75": BOTH,
        "drone survivors >= 1.5": ATTIC,
        "P(drone survivors >= 2) >= 0.5": ATTIC,
        "P( drone survivors >= 1 ) >= 0.6": BOTH,  # 1 - 0.75 x 0.5
        "CVaR(drone survivors, 0.5) >= 1": ATTIC,
        '"drone" survivors >= 2 and rover survivors >= 0.75': GROUND,
    }
    assert {wish: choose(HOUSE, IN_HOUSE, wish).plan for wish in answers} == answers
    choice = choose(HOUSE, IN_HOUSE, "drone survivors >= 2.5")
    assert choice.plan == GROUND
    assert not choice.met
