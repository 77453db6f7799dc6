"""YAML texts as values with lines."""

import contextlib
import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.base.documents import Document

SCALARS = (
    st.none()
    | st.booleans()
    | st.integers(-(10**20), 10**20)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cn", "Zl", "Zp"]), max_size=9)
)
CONTENTS = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.text("abcxyz_ é", min_size=1, max_size=5), inner, max_size=4)
    ),
    max_leaves=15,
)


@given(CONTENTS)
def test_json_is_yaml(content):
    """A study that is given as a mapping is saved as JSON, and read again."""
    text = json.dumps(content, indent=1, ensure_ascii=False)
    assert Document(text).content == content


def test_values_are_those_of_yaml_1_2():
    numbers = Document("[1e-2, 1e5, .5, 2., 1_000_000, 10, -.inf]").content
    assert numbers == [0.01, 100_000.0, 0.5, 2.0, 1_000_000, 10, -math.inf]
    assert [type(number) for number in numbers] == [float] * 4 + [int, int, float]
    assert Document("[False, ~, on, 1:30, 2026-11-21, '1']").content == [
        *(False, None, "on", "1:30", "2026-11-21", "1"),
    ]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        *(("0o17", 15), ("0x1f", 31), ("-7", -7), ("+1_0", 10), ("1e3", 1000.0), (".5e3", 500.0)),
        *(("+.INF", math.inf), ("Null", None), ("TRUE", True), ("", None)),
        *(
            ("!!str 3", "3"),
            ("!!int '3'", 3),
            ("!!float 3", 3.0),
            ("!!float -.inf", -math.inf),
            ("!!bool True", True),
        ),
        ("!!null x", None),
    ],
)
def test_scalars_of_yaml_1_2(text, value):
    found = Document(text).content
    assert (found, type(found)) == (value, type(value))


@pytest.mark.parametrize(
    "text",
    ["yes", "no", "On", "off", "y", "tRUE", "nULL", "0b1", "-0x1F", "0o8", "1:30:45.5", "=", "._"],
)
def test_texts_that_other_versions_of_yaml_take_for_values(text):
    assert Document(text).content == text
    assert Document(f"{{{text}: 1}}").content == {text: 1}


def test_not_a_number():
    assert math.isnan(Document(".NaN").content)


def test_keys_are_texts():
    content = Document("{1: a, true: b, null: c, 2.50: d}").content
    assert content == {"1": "a", "true": "b", "null": "c", "2.50": "d"}


TEXT = """\
name: x
list:
  - a
  - key: 1
    deep: {one: 1,
           two: 2}
base: &base {p: 1, q: 2}
merged:
  <<: *base
  q: 3
"""


def test_merged_mappings_are_overridden():
    assert Document(TEXT).content["merged"] == {"p": 1, "q": 3}
    assert list(Document("q: 3\n<<: {p: 1, q: 2}\n").content) == ["p", "q"]


def test_of_several_mappings_that_are_merged_the_first_one_wins():
    content = Document("<<: [{a: 1}, {a: 2, b: 3}]\nc: 4\n'<<': 5\n").content
    assert content == {"a": 1, "b": 3, "c": 4, "<<": 5}
    assert Document("'<<': 5\n<<: {a: 1}\n").content == {"a": 1, "<<": 5}


def test_anchors():
    """They are of values and of what is a key."""
    assert Document("[&x 1, *x, &y 2, *y]").content == [1, 1, 2, 2]
    assert Document("&k a: 1\nb: *k\n").content == {"a": 1, "b": "a"}
    assert Document("a: &k b\n*k : 2\n").content == {"a": "b", "b": 2}


def test_lines_are_found():
    document = Document(TEXT)
    for place, line in {
        (): 1,
        ("list", 1): 4,
        ("list", 1, "deep", "two"): 6,
        ("list", 7): 2,
        ("list", 1, "missing", "further"): 4,
        ("merged", "q"): 10,
        ("merged", "p"): 7,
    }.items():
        assert document.line(place) == line, place


def test_what_cannot_be_read():
    for text, line, said in (
        ("a: 1\nb: 2\na: 3\n", 3, 'mapping (line 1): found duplicate key "a".'),
        ("x:\n  1: 2\n  '1': 3\n", 3, "duplicate key"),
        ("a: 1\nb:\n  [1, 2]: 3\n", 3, "found unhashable key"),
        ("a: [1,\n", 2, "parsing a flow node (line 2): did not find expected node content."),
        ("a: 'b\n\nc: d\n", 4, "scanning a quoted scalar (line 1): found unexpected end"),
        ("a: 1\nb: \x07\n", 0, "control characters are not allowed"),
        ("a: éééé\nb: \x07\nc: d\n", 0, "control characters are not allowed"),
        ("a: 1\nb: !mine x\n", 2, "'!mine'"),
        ("a: 1\nb: !!python/object/apply:os.system ['true']\n", 2, "os.system'"),
        ("- " * 2_000 + "a", 0, "maximum recursion depth"),
        ("a: !!int x", 0, "invalid literal"),
        (f"a: 1\nb: {'9' * 5_000}", 0, "4300 digits"),
        ("a: 1\nb: !!seq {}", 2, "expected a sequence node, but found mapping."),
        ("a: 1\nb: *c\n", 2, "found undefined alias 'c'."),
        ("a: 1\n---\nb: 2\n", 2, "but found another document"),
        (
            "a:\n  <<: 3\n",
            2,
            "mapping (line 2): expected a mapping or list of mappings for",
        ),
        ("<<: [{}, 3]\n", 1, "expected a mapping for merging"),
        ("<<: {}\n<<: {}\n", 2, 'found duplicate key "<<"'),
        ("a: &a [*a]\n", 1, "found unconstructable recursive node"),
        ("a: b: c\n", 1, "mapping values are not allowed in this context"),
        ("a:\n\t- 1\n", 2, "found character that cannot start any token"),
        ("a: '\ud800'\n", 0, "surrogates not allowed"),
    ):
        with pytest.raises(ValueError, match="not valid YAML") as caught:
            Document(text)
        where = f"line {line}: " if line else ""
        assert str(caught.value).startswith(f"{where}not valid YAML: ")
        assert said in str(caught.value)


@pytest.mark.parametrize("opened", ["[", "{a: ", "- ", "? "])
def test_what_is_nested_a_hundred_thousand_times_is_refused(opened):
    with pytest.raises(ValueError, match="maximum recursion depth"):
        Document(opened * 100_000)


@given(st.text(max_size=60))
def test_any_text_is_read_or_refused(text):
    with contextlib.suppress(ValueError):
        Document(text)
