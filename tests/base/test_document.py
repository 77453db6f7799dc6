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
KEYS = st.text("abcxyz_ é", min_size=1, max_size=5)
CONTENTS = st.recursive(
    SCALARS,
    lambda part: st.lists(part, max_size=4) | st.dictionaries(KEYS, part, max_size=4),
    max_leaves=15,
)


@given(CONTENTS)
def test_json_is_yaml(content):
    """A study that is given as a mapping is saved as JSON, and read again."""
    text = json.dumps(content, indent=1, ensure_ascii=False)
    assert Document(text).content == content


def test_values_are_those_of_yaml_1_2():
    for text, values in (
        ("[1e-2, 1e5, .5, 2., .5e3]", [0.01, 100_000.0, 0.5, 2.0, 500.0]),
        ("[1_000_000, -7, +1_0, 0o17, 0x1f]", [1_000_000, -7, 10, 15, 31]),
        ("[-.inf, +.INF, !!float 3, !!float -.inf]", [-math.inf, math.inf, 3.0, -math.inf]),
        ("[False, TRUE, !!bool True]", [False, True, True]),
        ("[~, Null, !!null x, '1', !!str 3]", [None, None, None, "1", "3"]),
        ("!!int '3'", 3),
        ("", None),
    ):
        found = Document(text).content
        assert repr(found) == repr(values)  # of the same types, too
    assert math.isnan(Document(".NaN").content)


OTHERS = "yes On off y tRUE nULL 0b1 -0x1F 0o8 1:30 2026-11-21 = ._"


def test_texts_that_other_versions_of_yaml_take_for_values_and_keys_which_are_texts():
    for text in OTHERS.split():
        assert Document(f"{{{text}: {text}}}").content == {text: text}
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


def test_mappings_are_merged_and_overridden():
    assert Document(TEXT).content["merged"] == {"p": 1, "q": 3}
    assert list(Document("q: 3\n<<: {p: 1, q: 2}\n").content) == ["p", "q"]
    # Of several, the first one wins; a text that looks like a merge is a key.
    content = Document("<<: [{a: 1}, {a: 2, b: 3}]\nc: 4\n'<<': 5\n").content
    assert content == {"a": 1, "b": 3, "c": 4, "<<": 5}


def test_anchors_are_of_values_and_of_keys():
    assert Document("[&x 1, *x, &y 2, *y]").content == [1, 1, 2, 2]
    assert Document("&k a: 1\nb: *k\n").content == {"a": 1, "b": "a"}
    assert Document("a: &k b\n*k : 2\n").content == {"a": "b", "b": 2}


def test_lines_are_found():
    lines = {
        (): 1,
        ("list", 1): 4,
        ("list", 1, "deep", "two"): 6,
        ("list", 7): 2,
        ("list", 1, "missing", "further"): 4,
        ("merged", "q"): 10,
        ("merged", "p"): 7,
    }
    assert {place: Document(TEXT).line(place) for place in lines} == lines


def test_what_cannot_be_read_is_named_with_its_line():
    for text, line, said in (
        ("a: 1\nb: 2\na: 3\n", 3, 'mapping (line 1): found duplicate key "a".'),
        ("x:\n  1: 2\n  '1': 3\n", 3, "duplicate key"),
        ("<<: {}\n<<: {}\n", 2, 'duplicate key "<<"'),
        ("a: 1\nb:\n  [1, 2]: 3\n", 3, "unhashable key"),
        ("a: [1,\n", 2, "(line 2): did not find expected node content."),
        ("a: éééé\nb: \x07\nc: d\n", 0, "control characters"),
        ("a: 1\nb: !mine x\n", 2, "'!mine'"),
        ("a: 1\nb: !!python/object/apply:os.system ['true']\n", 2, "os.system'"),
        (f"a: 1\nb: {'9' * 5_000}", 0, "4300 digits"),
        ("a: 1\nb: *c\n", 2, "undefined alias 'c'."),
        ("a:\n  <<: 3\n", 2, "mapping (line 2): expected a mapping"),
        ("a: &a [*a]\n", 1, "recursive node"),
        ("a: '\ud800'\n", 0, "surrogates"),
        *((opened * 100_000, 0, "recursion depth") for opened in ("[", "{a: ", "- ", "? ")),
    ):
        with pytest.raises(ValueError, match="not valid YAML") as caught:
            Document(text)
        where = f"line {line}: " if line else ""
        assert str(caught.value).startswith(f"{where}not valid YAML: ")
        assert said in str(caught.value)


@given(st.text(max_size=60))
def test_any_text_is_read_or_refused(text):
    with contextlib.suppress(ValueError):
        Document(text)
