"""Wishes: what planners may write, and what they are told when they write something else."""

import ast
import re
from functools import partial

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, event, given
from hypothesis import strategies as st

from botohe_moo import Mission
from botohe_moo.decide import Chance, EveryRobot, Expected, Reach, TailMean, Wish, parse_wishes
from botohe_moo.decide.grammar import FORMS
from tests.decide.made import MISSION, star

LABELS = [
    "north hall",
    "a",
    7,
    "7",
    (1, "x"),
    (1, (2, 3)),
    "and >= 0.5 and b",
    'say "no"',
    "漢字",
    2.5,
]


def labelled(labels):
    graph = nx.DiGraph()
    graph.add_node("dock", reward=0)
    for label in labels:
        graph.add_node(label, reward=1)
        graph.add_edge("dock", label, survival=0.5)
        graph.add_edge(label, "dock", survival=0.5)
    return Mission(graph, base="dock", robots=1, name="pier")


PIER = labelled(LABELS)


@pytest.mark.parametrize(
    ("text", "wish"),
    [
        ("survivors >= 2", Expected(quantity="survivors", at_least=2)),
        ("reward>=.5", Expected(quantity="reward", at_least=0.5)),
        ("  Reward  ≥ 5e0 ", Expected(quantity="reward", at_least=5)),
        ("P(survivors >= 2) >= 0.9", Chance(quantity="survivors", value=2, at_least=0.9)),
        ("p ( reward>=5 )>=1", Chance(quantity="reward", value=5, at_least=1)),
        ("CVaR(reward, 0.1) >= 2", TailMean(quantity="reward", alpha=0.1, at_least=2)),
        ("cvar(survivors,1)>=0", TailMean(quantity="survivors", alpha=1, at_least=0)),
        ("every robot >= 0.5", EveryRobot(at_least=0.5)),
        ("reach a >= 0.9", Reach(node="a", at_least=0.9)),
        ("reach a>=0.9", Reach(node="a", at_least=0.9)),
        ('reach "a" >= 0.9', Reach(node="a", at_least=0.9)),
        ("reach 'b' >= 0", Reach(node="b", at_least=0)),
    ],
)
def test_each_form(text, wish):
    assert parse_wishes(MISSION, [text]) == (wish,)


@pytest.mark.parametrize(
    ("text", "label"),
    [
        ("north hall", "north hall"),
        ('"north hall"', "north hall"),
        ("7", 7),
        ('"7"', "7"),
        ("(1, 'x')", (1, "x")),
        ('[1, "x"]', (1, "x")),
        ("[1, [2, 3]]", (1, (2, 3))),
        ('"and >= 0.5 and b"', "and >= 0.5 and b"),
        (r'"say \"no\""', 'say "no"'),
        ("漢字", "漢字"),
        ("2.5", 2.5),
    ],
)
def test_labels(text, label):
    [wish] = parse_wishes(PIER, [f"reach {text} >= 0.5"])
    assert wish == Reach(node=label, at_least=0.5)
    assert type(wish.node) is type(label)


def test_a_number_may_be_a_text_where_labels_are_texts():
    [wish] = parse_wishes(labelled(["7"]), ["reach 7 >= 0.5"])
    assert wish.node == "7"


def test_several():
    texts = ["reward >= 1 and reach a >= 0.5 and every robot >= 0.1", "survivors >= 1"]
    made = EveryRobot(at_least=0.3)
    found = parse_wishes(MISSION, [*texts, made])
    assert [str(wish) for wish in found] == [
        "reward >= 1",
        "reach a >= 0.5",
        "every robot >= 0.1",
        "survivors >= 1",
        "every robot >= 0.3",
    ]
    assert found[-1] is made


def test_the_forms_that_are_listed_can_be_read():
    mission = star({"NODE": (1, 0.5)})
    texts = list(FORMS)
    assert [str(wish) for wish in parse_wishes(mission, texts)] == texts
    assert len(parse_wishes(mission, [" and ".join(texts)])) == len(texts)


levels = st.floats(0, 1e9)
shares = st.floats(0, 1)
quantities = st.sampled_from(["reward", "survivors"])
wishes = st.one_of(
    st.builds(Expected, quantity=quantities, at_least=levels),
    st.builds(Chance, quantity=quantities, value=levels, at_least=shares),
    st.builds(
        TailMean, quantity=quantities, alpha=st.floats(0, 1, exclude_min=True), at_least=levels
    ),
    st.builds(EveryRobot, at_least=shares),
    st.builds(Reach, node=st.sampled_from(LABELS), at_least=shares),
)


@given(st.lists(wishes, min_size=1, max_size=4))
def test_what_is_written_is_read(made):
    assert parse_wishes(PIER, [" and ".join(map(str, made))]) == tuple(made)


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
    assert str(Reach(node=np.int64(3), at_least=1)) == "reach 3 >= 1"
    assert str(Reach(node=(np.int64(3), np.float64(0.5)), at_least=1)) == "reach (3, 0.5) >= 1"
    assert str(Reach(node=frozenset({1}), at_least=1)) == "reach frozenset({1}) >= 1"


def test_a_backslash_that_json_does_not_know_may_be_in_quotes():
    [wish] = parse_wishes(labelled(["a.b"]), [r'reach "a\.b" >= 0.5'])
    assert wish.node == "a.b"


@pytest.mark.parametrize(
    "text",
    [
        "",
        " ",
        "survivors > 2",
        "survivors >= two",
        "survivors >= 2 reward >= 1",
        "survivors >= 2 and",
        "survivors >= 2 or reward >= 1",
        "S >= 2",
        "P(survivors > 2) >= 0.9",
        "P(survivors >= 2)",
        "CVaR(reward) >= 2",
        "every robot",
        "reach >= 0.5",
        "survivors >= nan",
    ],
)
def test_what_cannot_be_read_gets_one_message_with_the_forms(text):
    with pytest.raises(ValueError, match=r"^Expected a wish, got ") as caught:
        parse_wishes(MISSION, ["reward >= 0", text])
    assert repr(text) in str(caught.value)
    assert all(form in str(caught.value) for form in FORMS)


@pytest.mark.parametrize("text", ["reach a", "reach a >=", "every robot >= ", "P(reward >= 1)"])
def test_a_missing_number_is_named(text):
    with pytest.raises(ValueError, match=r"got 'reward >= 1 and .*, which lacks .>=. and a number"):
        parse_wishes(MISSION, [f"reward >= 1 and {text}"])
    with pytest.raises(ValueError, match=r"got 'reach >= 0\.5'\. Wishes"):  # its node is missing
        parse_wishes(MISSION, ["reach >= 0.5"])


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("reward > 5", "reward >= 5"),
        ("reward=5", "reward >= 5"),
        ("reward => 5", "reward >= 5"),
        ("P(survivors > 2) > 0.9", "P(survivors >= 2) >= 0.9"),
        ("reward >= 2,5", "reward >= 2.5"),
        ("reward >= 0,125", "reward >= 0.125"),
        ("P(survivors >= 2) >= 80%", "P(survivors >= 2) >= 0.8"),
        ("every robot >= 99.99999 %", "every robot >= 0.9999999"),
        ("CVaR(reward, 12,5 %) >= 2", "CVaR(reward, 0.125) >= 2"),
        ("rewrad >= 5", "reward >= 5"),
        ("suvivors >= 2", "survivors >= 2"),
        ("every robots >= 0.5", "every robot >= 0.5"),
        ("reech a >= 0.9", "reach a >= 0.9"),
        ("CVAR(reward; 0.1) >= 2e0", "CVAR(reward, 0.1) >= 2e0"),
        ("E[S] >= 2 and E(R) >= 1", "survivors >= 2 and reward >= 1"),
        ("reward >= 5; suvivors > 2, reach 'b' > 90%", None),
    ],
)
def test_what_is_nearly_a_wish_gets_the_wish_that_is_meant(text, meant):
    meant = meant or "reward >= 5 and survivors >= 2 and reach 'b' >= 0.9"
    asked = f"Expected a wish, got {text!r}; did you mean {meant!r}? Wishes are {FORMS[0]}; "
    with pytest.raises(ValueError, match="^" + re.escape(asked)):
        parse_wishes(MISSION, [text])
    parse_wishes(MISSION, [meant])


def test_labels_are_left_as_they_are_where_a_wish_is_repaired():
    mission = labelled(["rewards", "a > b", "n1, 50%"])
    for node in ("rewards", "'a > b'", '"n1, 50%"'):
        with pytest.raises(ValueError, match=re.escape(repr(f"reach {node} >= 0.5"))):
            parse_wishes(mission, [f"reech {node} > 50%"])


def test_no_other_node_is_offered_than_the_one_written():
    mission = labelled(["n1,5", "n1.5", "50%", "0.5"])
    for node in ("n1,5", "50%"):
        with pytest.raises(ValueError, match=re.escape(repr(f"reach {node} >= 0.9"))):
            parse_wishes(mission, [f"reach {node} > 90%"])


def test_labels_do_not_stand_in_the_way_of_symbols():
    with pytest.raises(ValueError, match="did you mean 'survivors >= 2'"):
        parse_wishes(labelled(["S", "R"]), ["E[S] >= 2"])


def test_an_offer_is_written_in_full():
    with pytest.raises(ValueError, match=r"did you mean '(survivors >= 1 and ){9}survivors >= 1'"):
        parse_wishes(MISSION, [" and ".join(["survivors > 1"] * 10)])


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("survivors <= 2", "; wishes are lower limits, written with '>='."),
        ("P(survivors ≤ 1) >= 0.1", "; wishes are lower limits, written with '>='."),
        ("reward >= 1,000", "; write numbers as 2.5 and 1500, without commas."),
        ("rewrad >= 80%", "; write probabilities as 0.8, and other numbers without '%'."),
        ("every robot >= 120%", "; write probabilities as 0.8, and other numbers without '%'."),
        ("reach zz >= 90%", "; write probabilities as 0.8, and other numbers without '%'."),
        (
            "CVaR(reward, 0.1) >= 20%",
            "; write probabilities as 0.8, and other numbers without '%'.",
        ),
        ("reach 'a < 1' or 'a'", ". Wishes"),  # what is in quotes is no limit
        ("robots >= 2", ". Wishes"),  # "robot >= 2" could not be read either
        ("rewrad >= 5" + " " * 500, ". Wishes"),
    ],
)
def test_where_it_is_not_plain_what_is_meant_nothing_is_offered(text, fault):
    with pytest.raises(ValueError, match=r"^Expected a wish, got ") as caught:
        parse_wishes(MISSION, [text])
    assert fault in str(caught.value)
    assert "did you mean" not in str(caught.value)


subjects = ["S", "rewrad", "E[R]", "P(reward > 1)", "CVAR(S; 5%)", "evry robot", "reech 'b'", "no"]
near_wishes = st.tuples(
    st.sampled_from(subjects),
    st.sampled_from([" > ", "=>", " = ", "<"]),
    st.sampled_from(["0,5", "50 %", "1,000", "1e0"]),
).map("".join)


@given(st.lists(near_wishes, min_size=1, max_size=8), st.sampled_from([" and ", "; ", ",", " or "]))
def test_whatever_is_offered_can_be_read(texts, joint):
    with pytest.raises(ValueError, match=r"^Expected a wish, got ") as caught:
        parse_wishes(MISSION, [joint.join(texts)])
    _, *offered = str(caught.value).partition("; did you mean ")
    event(f"something is offered: {bool(offered[0])}")
    if offered[0]:
        text = ast.literal_eval(offered[1].partition("? Wishes are")[0])
        assert len(parse_wishes(MISSION, [text])) == len(texts)


CAFE, DECOMPOSED = "caf\u00e9", "cafe\u0301"


@pytest.mark.parametrize(
    ("label", "written"), [(CAFE, DECOMPOSED), (DECOMPOSED, CAFE), (CAFE, f" {DECOMPOSED}\t")]
)
def test_blanks_and_the_encoding_of_accents_do_not_matter(label, written):
    mission = labelled([label, "a"])
    made = Reach(node=written, at_least=0.5)
    for wish in (f"reach {written} >= 0.5", f"reach '{written}' >= 0.5", made):
        assert parse_wishes(mission, [wish]) == (Reach(node=label, at_least=0.5),)


def test_a_label_that_looks_like_several_has_to_be_exact():
    mission = labelled([CAFE, DECOMPOSED])
    for label in (CAFE, DECOMPOSED):
        assert parse_wishes(mission, [f"reach {label} >= 0"])[0].node == label
    with pytest.raises(ValueError, match="has no node"):
        parse_wishes(mission, [f"reach '{CAFE} ' >= 0"])


def test_where_it_stops_making_sense_is_said():
    with pytest.raises(ValueError, match=re.escape("got 'reward >= 1 and robots' at 'robots'. ")):
        parse_wishes(MISSION, ["reward >= 1 and robots"])


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("P(survivors >= 2) >= 1.2", "Expected the last number in [0, 1], got 1.2."),
        ("every robot >= 90", "Expected the last number in [0, 1], got 90.0."),
        ("reward >= -1", "Expected the last number >= 0, got -1.0."),
        ("P(reward >= -1) >= 0.5", "Expected the number in P(...) >= 0, got -1.0."),
        ("CVaR(reward, 0) >= 1", "Expected the share in CVaR(...) in (0, 1], got 0.0."),
        ("survivors >= 1e999", "Expected the last number >= 0 and finite, got inf."),
        ("reach 'dok >= 0.5", "the quote before 'dok' is not closed."),
        ('reach "a >= 0.5 and reward >= 1', "the quote before 'a' is not closed."),
        ("reach d >= 0.5", "mission 'star' has no node 'd'; most alike are dock, a, b, c."),
        ('reach "dok" >= 0.5', "mission 'star' has no node"),
    ],
)
def test_numbers_and_nodes_are_checked(text, fault):
    with pytest.raises(ValueError, match=re.escape(f"Wish {text!r}: {fault}")):
        parse_wishes(MISSION, [text])


def test_what_is_not_a_wish():
    with pytest.raises(ValueError, match=r"^Expected at least one wish, got none\. Wishes"):
        parse_wishes(MISSION, [])
    with pytest.raises(ValueError, match=r"^Expected a wish, a text such as '.*', got 3\."):
        parse_wishes(MISSION, [3])
    with pytest.raises(ValueError, match="has no node 'd'"):
        parse_wishes(MISSION, [Reach(node="d", at_least=1)])
    with pytest.raises(ValueError, match="has no node"):
        parse_wishes(MISSION, [Reach(node=["a"], at_least=1)])


@pytest.mark.parametrize(
    ("kind", "parts", "fault"),
    [
        (Expected, {"quantity": "price", "at_least": 1}, "Expected quantity among .*, got 'price'"),
        (Expected, {"quantity": "reward", "at_least": "1"}, "Expected at_least >= 0, got '1'"),
        (Chance, {"quantity": "reward", "value": None, "at_least": 1}, "Expected value >= 0"),
        (
            TailMean,
            {"quantity": "reward", "alpha": 2, "at_least": 1},
            r"Expected alpha in \(0, 1\]",
        ),
        (EveryRobot, {"at_least": True}, r"Expected at_least in \[0, 1\], got True"),
        (Reach, {"node": "a", "at_least": -0.1}, r"Expected at_least in \[0, 1\], got -0\.1"),
        (Wish, {"at_least": -1}, "Expected at_least >= 0, got -1"),
    ],
)
def test_typed_wishes_check_their_parts(kind, parts, fault):
    with pytest.raises(ValueError, match=fault):
        kind(**parts)
