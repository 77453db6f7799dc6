"""An indicator that is registered is in all that studies write: one line makes it one."""

import csv
import json
import sys

import matplotlib as mpl
import numpy as np
import pytest

from botohe_moo import indicators, load_mission
from botohe_moo.indicators import INDICATORS, Indicator
from botohe_moo.plots import plot_curves
from botohe_moo.study import SCHEMAS, StudyError, load_study, make_tables, read_study, run_study
from botohe_moo.study.report import write_report
from tests.base.packages import entries, write_package

STUDY = {
    "name": "gains",
    "missions": ["toy"],
    "algorithms": {
        "few": {"algorithm": "random", "parameters": {"n_ants": 2}},
        "many": {"algorithm": "random", "parameters": {"n_ants": 9}},
    },
    "budget": {"evaluations": 30},
    "seeds": 2,
}
NEW_COLUMNS = {"trace": ["gain", "missed"], "summary": ["gain_median", "missed_median"]}


@pytest.fixture(autouse=True)
def one_format(monkeypatch):
    monkeypatch.setattr("botohe_moo.study.report.FORMATS", ("png",))


def most_reward(points, mission):
    return float(points[:, 0].max(initial=0) / mission.total_reward)


def reward_missed(points, reference, mission):
    missed = reference[:, 0].max() - points[:, 0].max(initial=0)
    return float(missed / mission.total_reward) + 0.25


@pytest.fixture
def columns(monkeypatch):
    """Register one that needs no reference, and one that does; gives the columns before that."""
    columns = {name: [*schema] for name, schema in SCHEMAS.items()}
    gain = Indicator("gain %", most_reward, higher_is_better=True)
    missed = Indicator("missed", reward_missed, higher_is_better=False, needs_reference=True)
    monkeypatch.setitem(INDICATORS.own, "gain", gain)
    monkeypatch.setitem(INDICATORS.own, "missed", missed)
    return columns


def loaded(folder, **options):
    path = folder / "gains.json"
    path.write_text(json.dumps({**STUDY, **options}))
    return load_study(path)


@pytest.mark.slow
@pytest.mark.usefixtures("in_process")
def test_it_is_in_tables_reports_and_figures(columns, tmp_path):
    mpl.use("Agg")
    run_study(loaded(tmp_path), tmp_path / "done")
    tables = read_study(tmp_path / "done")
    assert tables.manifest["indicators"] == [*INDICATORS]
    found = tables.indicators.pivot_table("value", "run", "indicator")
    final = tables.plans.groupby("run")["reward"].max() / load_mission("toy").total_reward
    top = tables.references["reward"].max() / load_mission("toy").total_reward
    assert found["gain"].to_dict() == pytest.approx(final.to_dict())
    assert found["missed"].to_dict() == pytest.approx((top - final + 0.25).to_dict())
    assert {"gain", "missed"} <= set(tables.comparisons["indicator"])
    assert {"gain", "missed"} <= set(tables.ranks["indicator"])
    for name, before in columns.items():
        assert sorted(SCHEMAS[name]) == sorted([*before, *NEW_COLUMNS.get(name, [])])
    last = tables.trace.groupby("run").last()
    assert last["gain"].to_dict() == pytest.approx(found["gain"].to_dict())
    medians = found["gain"].groupby(tables.runs.set_index("run")["algorithm"]).median()
    assert tables.summary.set_index("algorithm")["gain_median"].to_dict() == medians.to_dict()
    (path,) = (tmp_path / "done").rglob("summary.csv")
    with path.open(newline="") as file:
        assert "missed_median" in next(csv.reader(file))
    written = {path.name: path for path in write_report(tables)}
    assert "gain %</th>" in written["report.html"].read_text("utf-8")
    assert r"gain \% " in written["summary.tex"].read_text("utf-8")
    assert {"igd_plus-toy.png", "epsilon-toy.png", "missed-toy.png"} <= written.keys()
    assert plot_curves(tables.trace, value="missed").get_ylabel() == "missed"


SPACING = """
from botohe_moo.indicators import Indicator

def width(points, mission):
    return float(points[:, 0].max(initial=0) - points[:, 0].min(initial=0))

def far(points, reference, mission):
    return float(len(reference))

WIDTH = Indicator("width", width, higher_is_better=True)
"""


@pytest.fixture
def spacing(tmp_path, monkeypatch):
    """A package that registers an indicator, in a module that has others, too."""
    entry_points = entries("indicators", "spacing_of_fronts", width="WIDTH")
    write_package(tmp_path, "spacing-of-fronts", SPACING, entry_points)
    monkeypatch.syspath_prepend(tmp_path)


@pytest.mark.slow
@pytest.mark.usefixtures("in_process", "spacing")
def test_it_may_be_of_another_package(tmp_path):
    """By an entry point, or by its path: then a function describes fronts."""
    assert [*INDICATORS][-1] == "width"
    named = "spacing_of_fronts:far"
    run_study(loaded(tmp_path, indicators=["area", "width", named]), tmp_path / "done")
    assert named not in INDICATORS  # it is this study's alone
    tables = read_study(tmp_path / "done")
    found = tables.indicators.pivot_table("value", "run", "indicator")
    assert tables.summary[f"{named}_median"].tolist() == [len(tables.references)] * 2
    rewards = tables.plans.groupby("run")["reward"]
    assert found["width"].to_dict() == pytest.approx(rewards.max().to_dict())
    assert set(found[named]) == {len(tables.references)}
    assert set(tables.comparisons["indicator"]) == {"area", "width"}
    assert "width</th>" in report_page(tables)


def report_page(tables):
    page = next(path for path in write_report(tables) if path.name == "report.html")
    return page.read_text("utf-8")


@pytest.mark.usefixtures("in_process")
def test_no_folder_runs_it(tmp_path, monkeypatch):
    """A study file may name code; its folder of results only tells of it."""
    (tmp_path / "code_of_a_study.py").write_text(SPACING)
    monkeypatch.syspath_prepend(tmp_path)
    named = "code_of_a_study:far"
    run_study(loaded(tmp_path, indicators=["area", named]), tmp_path / "done")
    monkeypatch.setattr(indicators, "_KNOWN", {})
    monkeypatch.delitem(sys.modules, "code_of_a_study")
    tables = read_study(tmp_path / "done")
    assert (INDICATORS[named].label, INDICATORS[named].needs_reference) == ("far", True)
    assert "far</th>" in report_page(tables)
    with pytest.raises(ValueError, match=r"'far': .*: code that a folder of results names is"):
        make_tables(tmp_path / "done")
    assert "code_of_a_study" not in sys.modules


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (lambda points, mission: "12", "expected a finite number, got '12'"),
        (lambda points, mission: None, "expected a finite number, got None"),
        (lambda points, mission: 10**400, "expected a finite number, got 1000"),
        (lambda points, mission: sys.exit(0), "SystemExit: 0"),
        (lambda points, mission: points[0], "IndexError: "),
        (lambda: 1.0, "TypeError: "),
    ],
)
def test_what_gives_no_number_is_refused_before_anything_runs(
    function, said, tmp_path, monkeypatch
):
    monkeypatch.setitem(INDICATORS.own, "odd", Indicator("odd %", function, None))
    with pytest.raises(StudyError, match=rf"indicators\.\d: 'odd': .*{said}"):
        loaded(tmp_path)


@pytest.mark.usefixtures("spacing")
def test_what_a_path_leads_to_is_checked(tmp_path):
    loaded(tmp_path, indicators=["spacing_of_fronts:WIDTH"])
    assert INDICATORS["spacing_of_fronts:WIDTH"].higher_is_better
    for wrong, said in (("json:no", "cannot be imported"), ("json:__name__", "to be a function")):
        with pytest.raises(StudyError, match=rf"indicators\.0: .*{said}"):
            loaded(tmp_path, indicators=[wrong])


@pytest.mark.usefixtures("columns")
def test_study_files_may_name_it(tmp_path):
    assert loaded(tmp_path, indicators=["gain", "area"]).manifest()["indicators"] == [
        "gain",
        "area",
    ]
    with pytest.raises(StudyError, match=r"'loss': there is no such indicator; known.* missed"):
        loaded(tmp_path, indicators=["loss"])


def test_a_name_that_is_not_registered_is_refused(tmp_path):
    for wrong, said in (
        ("gain", "'gain': there is no such"),
        (3, "Expected .* to be a text, got"),
    ):
        with pytest.raises(StudyError, match=rf"indicators\.1: {said}"):
            loaded(tmp_path, indicators=["area", wrong])


def test_a_value_that_is_not_a_number_names_the_indicator():
    odd = Indicator("odd", lambda *_: np.nan, higher_is_better=True)
    with pytest.raises(ValueError, match="Indicator 'odd': expected a finite number, got nan"):
        odd(np.ones((1, 2)), None, load_mission("toy"))
