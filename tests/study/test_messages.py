"""What is said of wrong study files: in the file's own words, at the line of the culprit."""

import warnings

import pytest

from botohe_moo.study.file.document import Document
from botohe_moo.study.file.loading import load_study
from botohe_moo.study.file.model import StudyError

RIGHT = "name: x\nmissions: [toy]\nalgorithms: [random]\nbudget: {evaluations: 100}\nseeds: 1\n"
GRID = "\n  ants:\n    algorithm: bo-aco\n    grid:\n      n_ants: [10]\n      n_antz: [1]"


def said_of(tmp_path, text):
    path = tmp_path / "s.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(StudyError) as caught:
        load_study(path)
    return str(caught.value).replace(f"{path}:", "s.yaml:").splitlines()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            RIGHT.replace("[random]", GRID),
            "s.yaml:8: algorithms.ants.grid.n_antz: there is no parameter 'n_antz'; known are",
        ),
        (
            RIGHT.replace("[random]", "\n  ants:"),
            's.yaml:4: algorithms.ants: "ants:" has no value: expected a name, or a mapping with '
            "algorithm: NAME.",
        ),
        (
            RIGHT.replace("[toy]", "\n  site:"),
            's.yaml:3: missions.site: "site:" has no value: expected a name, or a mapping with '
            "mission: NAME.",
        ),
        (
            RIGHT + "title: [a, b\n",
            "s.yaml:7: not valid YAML: expected ',' or ']' for the list that line 6 opens",
        ),
        (RIGHT + "title: a: b\n", "s.yaml:6: not valid YAML: no ':' can stand here;"),
        (RIGHT + "\ttitle: x\n", "s.yaml:6: not valid YAML: expected spaces, found a tab"),
        (
            RIGHT.replace("seeds: 1", "seeds: [-1]"),
            "s.yaml:5: seeds.0: Expected seeds[0] >= 0, got -1.",
        ),
        (
            RIGHT.replace("evaluations", "evalutions"),
            "s.yaml:4: budget.evalutions: there is no key 'evalutions'; known are evaluations,",
        ),
        (
            RIGHT.replace("name: x", f"name: {'a' * 300}"),
            "s.yaml:1: name: Expected name of at most 100 characters, got one of 300.",
        ),
        (
            RIGHT.replace("[random]", "\n  \u00e9: random\n  e\u0301: greedy"),
            "s.yaml:5: algorithms.e\u0301: two entries look as if they had the label 'e\u0301'.",
        ),
        (
            RIGHT.replace("[random]", "\n  A:\n    algorithm: bo-aco\n    grid: {n_ants: [5, 5]}"),
            "s.yaml:6: algorithms.A.grid.n_ants: expected different values.",
        ),
        (
            RIGHT.replace("name: x", "name: 2026"),
            's.yaml:1: name: Expected name to be a text, got 2026; put it in quotes: "2026".',
        ),
        (
            RIGHT + "title: 1.5\n",
            's.yaml:6: title: Expected title to be a text, got 1.5; put it in quotes: "1.5".',
        ),
        (
            RIGHT.replace("[random]", "\n  '': random"),
            "s.yaml:4: algorithms.'': expected a label, got an empty one.",
        ),
    ],
)
def test_one_line_at_the_culprit(tmp_path, text, said):
    lines = said_of(tmp_path, text)
    assert len(lines) == 1  # nothing that follows from it is reported beside it
    assert lines[0].startswith(said)


def test_a_file_that_is_too_large_is_not_parsed(tmp_path, monkeypatch):
    monkeypatch.setattr(Document, "parse", lambda *_: pytest.fail("it was parsed"))
    lines = said_of(tmp_path, RIGHT + "#" * 10_000_000)
    assert lines[0].endswith("expected a study file of at most 1 MB, found 10.0 MB.")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            RIGHT + "recording: {at: [50, 1000]}\n",
            "6: recording.at.1: no run makes 1,000 evaluations: the largest budget is 100.",
        ),
        (
            RIGHT.replace("100}", "100, grace_seconds: 5}"),
            "4: budget.grace_seconds: it has no effect without seconds, as no run is killed.",
        ),
    ],
)
def test_what_has_no_effect_is_said(tmp_path, text, said):
    path = tmp_path / "s.yaml"
    path.write_text(text)
    with pytest.warns(UserWarning, match="s.yaml") as caught:
        load_study(path)
    assert [str(warning.message) for warning in caught] == [f"{path}:{said}"]


def test_nothing_is_said_of_a_right_one(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_text(RIGHT + "recording: {at: [100]}\n")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load_study(path)
