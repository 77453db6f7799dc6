"""An indicator that is registered is in all that studies write: one line makes it one."""

import sys

import pytest

from botohe_moo import indicators, load_mission
from botohe_moo.indicators import INDICATORS, Indicator
from botohe_moo.study import SCHEMAS, StudyError, load_study, make_tables, read_study, run_study
from botohe_moo.study.report import write_report
from tests.base.packages import entries, write_package
from tests.study.made import study_of

MANY = {"algorithm": "random", "parameters": {"n_ants": 9}}
STUDY = study_of(algorithms={"few": "random", "many": MANY}, budget={"evaluations": 30})
NEW_COLUMNS = {"trace": ["gain", "missed"], "summary": ["gain_median", "missed_median"]}


def most_reward(points, mission):
    return float(points[:, 0].max(initial=0) / mission.total_reward)


def reward_missed(points, reference, mission):
    missed = reference[:, 0].max() - points[:, 0].max(initial=0)
    return float(missed / mission.total_reward) + 0.25


@pytest.fixture
def columns(monkeypatch):
    """Register one that needs no reference, and one that does; gives the columns before that."""
    columns = {name: [*schema] for name, schema in SCHEMAS.items()}
    for name, own in {
        "gain": Indicator("gain %", most_reward, higher_is_better=True),
        "missed": Indicator("missed", reward_missed, higher_is_better=False, needs_reference=True),
    }.items():
        monkeypatch.setitem(INDICATORS.own, name, own)
    return columns


def reported(tables):
    """The files of the report, by name."""
    return {path.name: path.read_text("utf-8", "replace") for path in write_report(tables)}


@pytest.mark.usefixtures("in_process", "sketched")
def test_it_is_in_tables_reports_and_figures(columns, tmp_path):
    run_study(STUDY, tmp_path)
    tables = read_study(tmp_path)
    assert tables.manifest["indicators"] == [*INDICATORS]
    found = tables.indicators.pivot_table("value", "run", "indicator")
    final = tables.plans.groupby("run")["reward"].max() / load_mission("toy").total_reward
    top = tables.references["reward"].max() / load_mission("toy").total_reward
    assert found["gain"].to_dict() == pytest.approx(final.to_dict())
    assert found["missed"].to_dict() == pytest.approx((top - final + 0.25).to_dict())
    assert {"gain", "missed"} <= {*tables.comparisons["indicator"]} & {*tables.ranks["indicator"]}
    for name, before in columns.items():
        assert sorted(SCHEMAS[name]) == sorted([*before, *NEW_COLUMNS.get(name, [])])
    last = tables.trace.groupby("run").last()
    assert last["gain"].to_dict() == pytest.approx(found["gain"].to_dict())
    medians = found["gain"].groupby(tables.runs.set_index("run")["algorithm"]).median()
    assert tables.summary.set_index("algorithm")["gain_median"].to_dict() == medians.to_dict()
    written = reported(tables)
    assert "gain %</th>" in written["report.html"]
    assert r"gain \% " in written["summary.tex"]
    assert {"igd_plus-toy.png", "epsilon-toy.png", "missed-toy.png"} <= written.keys()


PACKAGE = """
from botohe_moo.indicators import Indicator

def width(points, mission):
    return float(points[:, 0].max(initial=0) - points[:, 0].min(initial=0))

def far(points, reference, mission):
    return float(len(reference))

WIDTH = Indicator("width", width, higher_is_better=True)
"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package that registers an indicator, in a module that has others, too."""
    entry_points = entries("indicators", "spacing_of_fronts", width="WIDTH")
    write_package(tmp_path, "spacing-of-fronts", PACKAGE, entry_points)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "spacing_of_fronts", raising=False)


@pytest.mark.usefixtures("in_process", "sketched", "package")
def test_it_may_be_of_another_package(tmp_path, monkeypatch):
    """By an entry point, or by its path: then a function describes fronts."""
    assert [*INDICATORS][-1] == "width"
    named = "spacing_of_fronts:far"
    run_study({**STUDY, "indicators": ["area", "width", named]}, tmp_path / "done")
    assert named not in INDICATORS  # it is this study's alone
    # A study file may name code; its folder of results only tells of it.
    monkeypatch.setattr(indicators, "_KNOWN", {})
    tables = read_study(tmp_path / "done")
    assert (INDICATORS[named].label, INDICATORS[named].needs_reference) == ("far", True)
    found = tables.indicators.pivot_table("value", "run", "indicator")
    assert tables.summary[f"{named}_median"].tolist() == [len(tables.references)] * 2
    rewards = tables.plans.groupby("run")["reward"]
    assert found["width"].to_dict() == pytest.approx(rewards.max().to_dict())
    assert set(found[named]) == {len(tables.references)}
    assert set(tables.comparisons["indicator"]) == {"area", "width"}
    page = reported(tables)["report.html"]
    assert "width</th>" in page
    assert "far</th>" in page
    with pytest.raises(ValueError, match=r"'far': .*: code that a folder of results names is"):
        make_tables(tmp_path / "done")


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (lambda points, mission: "12", "expected a finite number, got '12'"),
        (lambda points, mission: float("nan"), "expected a finite number, got nan"),
        (lambda points, mission: 10**400, "expected a finite number, got 1000"),
        (lambda points, mission: sys.exit(0), "SystemExit: 0"),
        (lambda points, mission: points[0], "IndexError: "),
        (lambda: 1.0, "TypeError: "),
    ],
)
def test_what_gives_no_number_is_refused_before_anything_runs(function, said, monkeypatch):
    monkeypatch.setitem(INDICATORS.own, "odd", Indicator("odd %", function, None))
    with pytest.raises(StudyError, match=rf"indicators\.\d: 'odd': .*{said}"):
        load_study(STUDY)


@pytest.mark.usefixtures("columns", "package")
@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ("loss", "'loss': no such indicator; known.* missed"),
        (3, "Expected .* to be a text, got"),
        ("json:no", ".*cannot be imported"),
        ("json:__name__", ".*to be a function"),
    ],
)
def test_study_files_may_name_it_and_nothing_else(wrong, said):
    loaded = load_study({**STUDY, "indicators": ["gain", "spacing_of_fronts:WIDTH"]})
    assert loaded.manifest()["indicators"] == ["gain", "spacing_of_fronts:WIDTH"]
    with pytest.raises(StudyError, match=rf"indicators\.1: {said}"):
        load_study({**STUDY, "indicators": ["area", wrong]})
