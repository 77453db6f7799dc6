"""YAML texts as values with lines."""

import math
import re

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.study.file.document import Document

# A number for YAML 1.2; YAML 1.1 writes such a text without quotes.
EXPONENTIAL = re.compile(r"[-+]?[0-9._]+[eE][-+]?[0-9]+")
SCALARS = (
    st.none()
    | st.booleans()
    | st.integers(-(10**20), 10**20)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(
        st.characters(codec="utf-8", exclude_characters="\x85\u2028\u2029"), max_size=10
    ).filter(lambda text: not EXPONENTIAL.fullmatch(text))
)
CONTENTS = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.text("abcxyz_ é", min_size=1, max_size=5), inner, max_size=4)
    ),
    max_leaves=15,
)


def faults(text):
    return [(fault.line, fault.message) for fault in Document.parse(text).faults]


@given(CONTENTS)
def test_what_yaml_writes_is_read_again(content):
    document = Document.parse(yaml.safe_dump(content, allow_unicode=True))
    assert document.faults == []
    assert document.content == content


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-2", 0.01),
        ("1e5", 100_000.0),
        ("-1.5E+3", -1500.0),
        (".5", 0.5),
        ("2.", 2.0),
        ("1_000_000", 1_000_000),
        ("010", 10),
        ("+7", 7),
        ("-.inf", -math.inf),
        ("true", True),
        ("False", False),
        ("~", None),
        ("null", None),
        ("", None),
        ("yes", "yes"),
        ("on", "on"),
        ("1:30", "1:30"),
        ("2026-11-21", "2026-11-21"),
        ("0x10", "0x10"),
        ("1e", "1e"),
        ("'1'", "1"),
    ],
)
def test_values_are_those_of_yaml_1_2(text, value):
    found = Document.parse(f"key: {text}").content["key"]
    assert found == value
    assert type(found) is type(value)


def test_not_a_number_is_read():
    assert math.isnan(Document.parse("key: .nan").content["key"])


def test_keys_are_texts():
    assert Document.parse("{1: a, true: b, null: c, 2.5: d}").content == {
        "1": "a",
        "true": "b",
        "null": "c",
        "2.5": "d",
    }


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


@pytest.mark.parametrize(
    ("path", "line"),
    [
        ((), 1),
        (("name",), 1),
        (("list", 1), 4),
        (("list", 1, "deep", "two"), 6),
        (("list", 7), 2),
        (("list", 1, "missing", "further"), 4),
        (("nowhere",), 1),
        (("merged", "q"), 10),
        (("merged", "p"), 7),
    ],
)
def test_lines_are_found(path, line):
    assert Document.parse(TEXT).line(path) == line


def test_merged_mappings_are_overridden():
    assert Document.parse(TEXT).content["merged"] == {"p": 1, "q": 3}


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        ("a: 1\nb: 2\na: 3\n", 3, "'a' stands twice, first in line 1"),
        ("x:\n  a: 1\n  1: 2\n  '1': 3\n", 4, "'1' stands twice"),
        ("a: [1,\n", 2, "not valid YAML"),
        ("a: 1\n b: 2\n", 2, "not valid YAML"),
        ("a: 1\nb: \x07\n", 2, "not valid YAML"),
        ("a: 1\n---\nb: 1\n", 2, "not valid YAML: expected a single document"),
        ("a: *nowhere\n", 1, "undefined alias"),
        ("a: &x [*x]\n", 1, "inside of what it stands for"),
        ("a: &x {b: *x}\n", 1, "inside of what it stands for"),
        ("a: 1\n? [1, 2]\n: b\n", 2, "expected a text as a key"),
        ("a: !!python/object/apply:os.system ['true']\n", 1, "expected plain YAML"),
        ("a: !!python/name:os.system\n", 1, "expected plain YAML"),
        ("a: !mine x\n", 1, "expected plain YAML"),
        ("a: !mine {x: 1}\n", 1, "'!mine'"),
        ("a: !!set {x}\n", 1, "expected plain YAML"),
        ("- " * 2_000 + "a", 1, "expected a study file"),
        ("a: " + "9" * 5_000, 1, "less than 4 300 digits"),
    ],
)
def test_faults_have_lines(text, line, said):
    [(found, message)] = faults(text)
    assert said in message
    assert found == line


def test_aliases_cannot_make_a_file_huge():
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 9)]
    [(_, message)] = faults("\n".join(lines))
    assert "too large" in message


@given(st.text(max_size=60))
def test_any_text_is_read_or_refused(text):
    document = Document.parse(text)
    assert all(fault.line >= 1 for fault in document.faults)
