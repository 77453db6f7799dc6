"""Wishes: what planners may write, and what they are told when they write something else."""

import re
from functools import partial

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from botohe_moo import Mission
from botohe_moo.decide import Wish, parse_wishes
from botohe_moo.decide.wishes import FORMS
from tests.decide.made import (
    HOUSE,
    MISSION,
    Chance,
    EveryRobot,
    Expected,
    Reach,
    TailMean,
    WorstCase,
    house,
    star,
)
from tests.decide.test_choosing import wishes_for

LABELS = ["north hall", "a", 7, "7", (1, "x"), (1, (2, 3)), "and >= 0.5 and b", 'say "no"', 2.5]


def labelled(labels):
    graph = nx.DiGraph()
    graph.add_node("dock", reward=0)
    for label in labels:
        graph.add_node(label, reward=1)
        graph.add_edge("dock", label, survival=0.5)
        graph.add_edge(label, "dock", survival=0.5)
    return Mission(graph, base="dock", robots=1, name="pier")


PIER = labelled(LABELS)


FORMS_READ = [
    ("survivors >= 2", Expected(quantity="survivors", at_least=2)),
    ("expected survivors >= 2", Expected(quantity="survivors", at_least=2)),
    ("reward>=.5", Expected(quantity="reward", at_least=0.5)),
    ("  Reward  ≥ 5e0 ", Expected(quantity="reward", at_least=5)),
    ("P(survivors >= 2) >= 0.9", Chance(quantity="survivors", value=2, at_least=0.9)),
    ("p ( reward>=5 )>=1", Chance(quantity="reward", value=5, at_least=1)),
    ("CVaR(reward, 0.1) >= 2", TailMean(quantity="reward", alpha=0.1, at_least=2)),
    ("cvar(survivors,1)>=0", TailMean(quantity="survivors", alpha=1, at_least=0)),
    ("Worst  case of 2 losses>=.5", WorstCase(losses=2, at_least=0.5)),
    ("every robot >= 0.5", EveryRobot(at_least=0.5)),
    ("reach a >= 0.9", Reach(node="a", at_least=0.9)),
    ("reach 'b' >= 0", Reach(node="b", at_least=0)),
]


def test_each_form():
    for text, wish in FORMS_READ:
        assert parse_wishes(MISSION, [text]) == (wish,)


LABELS_READ = [
    ("north hall", "north hall"),
    ('"north hall"', "north hall"),
    ("7", 7),
    ('"7"', "7"),
    ("(1, 'x')", (1, "x")),
    ("[1, [2, 3]]", (1, (2, 3))),
    ('"and >= 0.5 and b"', "and >= 0.5 and b"),
    (r'"say \"no\""', 'say "no"'),
    ("2.5", 2.5),
]


def test_labels():
    for text, label in LABELS_READ:
        [wish] = parse_wishes(PIER, [f"reach {text} >= 0.5"])
        assert (wish.node, type(wish.node)) == (label, type(label))
    [wish] = parse_wishes(labelled(["7"]), ["reach 7 >= 0.5"])  # where labels are texts
    assert wish.node == "7"


def test_a_node_may_be_called_by_its_name():
    graph = labelled([7]).graph.copy()
    graph.nodes[7]["name"] = "north hall"
    mission = Mission(graph, base="dock", robots=1)
    for text in ("north hall", '"north hall"'):
        assert parse_wishes(mission, [f"reach {text} >= 0.5"]) == (Reach(node=7, at_least=0.5),)


def test_the_forms_that_are_listed_can_be_read():
    mission = star({"NODE": (1, 0.5)})
    texts = list(FORMS)
    assert [str(wish) for wish in parse_wishes(mission, texts)] == texts
    assert len(parse_wishes(mission, [" and ".join(texts)])) == len(texts)


@given(wishes_for(PIER))
def test_what_is_written_is_read(made):
    assert parse_wishes(PIER, [" and ".join(map(str, made))]) == tuple(made)
    texts = list(map(str, made))
    assert list(map(str, parse_wishes(PIER, [*texts, *made]))) == texts * 2


simple = st.one_of(
    st.text(max_size=8),
    st.text("\"'\\\nnab >=0.5()[],", max_size=12),
    st.integers(-(10**20), 10**20),
    st.integers(-9, 9).map(np.int64),
    st.floats(allow_nan=False, allow_infinity=False),
    st.booleans(),
    st.sampled_from(["True", "False", "and", " and survivors >= 1", "reach", "a\nb", "\u2028"]),
)
tuples = partial(st.lists, max_size=3)
any_labels = st.recursive(simple, lambda inner: tuples(inner).map(tuple), max_leaves=4)


@given(any_labels)
def test_every_label_that_is_written_is_read(label):
    assume(label != "dock")
    mission = labelled([label])
    text = f"{Reach(node=label, at_least=0.5)} and reward >= 0"
    found, _ = parse_wishes(mission, [text])
    assert mission.index(found.node) == mission.index(label)
    assert found.at_least == 0.5


def test_labels_are_written_with_numbers_of_python():
    labels = np.int64(3), (np.int64(3), np.float64(0.5)), frozenset({1})
    texts = [str(Reach(node=label, at_least=1)) for label in labels]
    assert texts == [f"reach {label} >= 1" for label in ("3", "(3, 0.5)", "frozenset({1})")]


NO_WISHES = [
    *("", "survivors > 2", "survivors >= two", "survivors >= 2 reward >= 1", "robots >= 2"),
    *("survivors >= 2 and", "P(survivors > 2) >= 0.9", "P(survivors >= 2)", "reach a"),
    *("drone reward >= 1", "reach >= 0.5", "survivors >= nan"),
]


def test_what_cannot_be_read_gets_one_message_with_the_forms():
    for text in NO_WISHES:
        with pytest.raises(ValueError, match=r"^Expected a wish, got ") as caught:
            parse_wishes(MISSION, ["reward >= 0", text])
        assert all(form in str(caught.value) for form in FORMS)
    with pytest.raises(ValueError, match=r"got 'robots >= 80 %'\. Wishes.* Write 80 % as 0\.8\.$"):
        parse_wishes(MISSION, ["reward >= 1 and robots >= 80 %"])
    for wishes, found in (([], "''"), ([3], "3")):
        with pytest.raises(ValueError, match=rf"^Expected a wish, got {found}\. Wishes"):
            parse_wishes(MISSION, wishes)


def test_numbers_and_nodes_are_checked_also_in_wishes_that_are_made():
    for text, fault in {
        "worst case of 3 losses >= 1": "Expected losses in [0, 2], got 3.",
        "every robot >= 90": "Expected the wanted value in [0, 1], got 90.0.",
        "P(reward >= -1) >= 0.5": "Expected the value in P( ) >= 0, got -1.0.",
        "CVaR(reward, 0) >= 1": "Expected the share in CVaR( ) in (0, 1], got 0.0.",
        "reach d >= 0.5": "mission 'star' has no node 'd'; most alike are dock, a, b, c.",
    }.items():
        with pytest.raises(ValueError, match=re.escape(f"Wish {text!r}: {fault}")):
            parse_wishes(MISSION, [text])
    for wish, fault in (
        (Reach(node="d", at_least=1), "has no node 'd'"),
        (
            Chance(quantity="reward", at_least=1),
            r"Expected the value in P\( \) to be a number >= 0",
        ),
        (EveryRobot(at_least=True), r"Expected the wanted value to be a number in \[0, 1\]"),
        (WorstCase(at_least=-1, losses=1), "Expected the wanted value >= 0, got -1"),
        (WorstCase(at_least=1), "Expected losses to be an integer in"),
        (Wish("best case", at_least=1), "Expected form among worst case, "),
    ):
        with pytest.raises(ValueError, match=fault):
            parse_wishes(MISSION, [wish])


def test_wishes_of_a_kind_are_written_and_read():
    made = {
        "drone survivors >= 1": Expected(quantity="survivors", at_least=1, kind="drone"),
        'P("lake boat" survivors >= 1) >= 0.5': Chance(
            quantity="survivors", value=1, at_least=0.5, kind="lake boat"
        ),
        'CVaR("lake boat" survivors, 0.5) >= 1': TailMean(
            quantity="survivors", alpha=0.5, at_least=1, kind="lake boat"
        ),
    }
    assert [*map(str, made.values())] == list(made)
    assert parse_wishes(house(rover="lake boat"), [" and ".join(made)]) == tuple(made.values())


def test_a_node_named_survivors():
    mission = Mission(nx.relabel_nodes(HOUSE.graph, {"attic": "survivors"}), kinds=HOUSE.kinds)
    [wish] = parse_wishes(mission, ["reach survivors >= 0.5"])
    assert wish == Reach(node="survivors", at_least=0.5)


def test_kinds_that_there_are_not():
    reward = Expected(quantity="reward", at_least=1, kind="drone")
    for mission, wish, fault in (
        (HOUSE, "dron survivors >= 1", "no survivors of kind 'dron'; most alike are drone, rover."),
        (HOUSE, "P(boat survivors >= 1) >= 0", "no survivors of kind 'boat'; most alike are"),
        (MISSION, "drone survivors >= 1", "no survivors of kind 'drone'; most alike are robot."),
        (HOUSE, "drone reward >= 1", "survivors, or survivors of a kind, in place of reward"),
        (HOUSE, reward, "has no reward of kind 'drone'"),
    ):
        with pytest.raises(ValueError, match=fault):
            parse_wishes(mission, [wish])
