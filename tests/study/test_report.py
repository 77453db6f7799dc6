"""The report of a study: what is written, what the page says, and that nothing breaks it."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from html.parser import HTMLParser

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import load_mission
from botohe_moo.study import report as pictures
from botohe_moo.study.report import (
    mission_table,
    number_text,
    parameter_words,
    render_page,
    rivals,
    slug,
    write_report,
)
from tests.study.made import Record, make_study, random_record

TOY = load_mission("toy")
ODD = "a/b_c$ <b>&\"' 50%"
ENDS = pictures.FORMATS[:1]  # test_report_figures.py has all
FIXED_NAMES = ["report.html", "outcome.tex", "summary.tex", "comparisons.tex", "ranks.tex"]


def figure_names(label, *, without=()):
    """Files of the figures of a mission with fewer than twelve algorithms and all runs done."""
    kinds = ["curves", "seconds", "reached", "igd_plus", "epsilon", "areas"]
    kinds += ["fronts", "attainment", "difference"]
    kinds = [kind for kind in kinds if kind not in without]
    return [f"{kind}-{slug(label)}.{end}" for kind in kinds for end in ENDS]


AREAS_ONLY = [f"areas-toy.{end}" for end in ENDS]


@pytest.fixture(autouse=True, scope="module")
def _backend():
    mpl.use("Agg")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pictures, "FORMATS", ENDS)
        yield
    plt.close("all")


def algorithms(*labels):
    return {label: {"algorithm": "nsga2", "parameters": {}} for label in labels}


def study(folder, missions, records, *, control=None, labels=None, **manifest):
    folder.mkdir(parents=True, exist_ok=True)
    labels = labels or dict.fromkeys(record.algorithm for record in records)
    made = dict.fromkeys(missions, TOY)
    return make_study(folder, made, algorithms(*labels), records, control=control, **manifest)


def random_records(missions, labels, seeds, **options):
    rng = np.random.default_rng(0)
    return [
        random_record(rng, mission, TOY, label, seed, strength=0.4 + 0.05 * i, **options)
        for mission in missions
        for i, label in enumerate(labels)
        for seed in seeds
    ]


def lost(mission, label, seeds, status="failed", error="ValueError: <boom> & bust"):
    return [Record(mission, label, seed, [], status, error) for seed in seeds]


VOID = {"meta", "img", "br", "hr", "link", "input"}


class Page(HTMLParser):
    """Checks that tags balance, and keeps what tests ask for."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.open, self.tags, self.attributes, self.texts = [], [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += [(tag, name, value) for name, value in attrs]
        assert len({name for name, _ in attrs}) == len(attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] != "style":
            self.texts.append(data)

    @property
    def text(self):
        return re.sub(r"\s+", " ", " ".join(self.texts))

    def values(self, *names):
        return [value for _, name, value in self.attributes if name in names]


def page_of(tables):
    return checked((tables.folder / "report" / "report.html").read_text("utf-8"))


def checked(text):
    """A page that needs nothing but itself."""
    assert text.startswith("<!DOCTYPE html>\n")
    page = Page(text)
    ids = page.values("id")
    assert len(set(ids)) == len(ids)
    for address in page.values("href", "src"):
        assert address.startswith("data:image/png;base64,") or address[1:] in ids
    style = text[text.index("<style>") : text.index("</style>")]
    assert "url(" not in style
    assert "@import" not in style
    assert not {"script", "link", "iframe", "object"} & set(page.tags)
    assert not [name for _, name, _ in page.attributes if name.startswith("on")]
    assert page.tags.count("img") == len([value for value in page.values("alt") if value])
    return page


@pytest.fixture(scope="module")
def odd(tmp_path_factory):
    """Two missions, one with an odd label; odd and lost algorithms; and its report."""
    records = [
        *random_records(["toy", ODD], ["BO-ACO", ODD], (1, 2, 3)),
        *random_records(["toy", ODD], ["single"], (1,), n_records=1),
        *lost("toy", "lost", (1, 2, 3)),
        *random_records([ODD], ["lost"], (1, 2)),
        *lost(ODD, "lost", (3,), "timeout", "stopped after 60 seconds"),
    ]
    tables = study(
        tmp_path_factory.mktemp("odd"),
        ["toy", ODD],
        records,
        control="BO-ACO",
        title="Title <i>& more",
        description="About <script>alert(1)</script> it.",
    )
    return tables, write_report(tables)


class TestFiles:
    def test_all_are_written_and_named(self, odd):
        tables, paths = odd
        folder = tables.folder / "report"
        names = [name for label in ("toy", ODD) for name in figure_names(label)]
        expected = [folder / name for name in FIXED_NAMES]
        expected += [folder / "figures" / name for name in ("shortfalls.png", *names)]
        assert sorted(paths) == sorted(expected)
        assert sorted(folder.rglob("*.*")) == sorted(expected)
        assert all(path.stat().st_size for path in paths)

    def test_a_plain_label_is_its_own_slug(self):
        assert slug("art_museum") == "art_museum"
        assert re.fullmatch(r"art-museum-[0-9a-f]{8}", slug("Art museum"))
        assert re.fullmatch(r"[0-9a-f]{8}", slug("../.."))

    @given(st.text(min_size=1), st.text(min_size=1))
    def test_slugs_are_safe_and_tell_labels_apart(self, one, other):
        assert re.fullmatch(r"[a-z0-9][a-z0-9._-]*", slug(one))
        assert len(slug(one)) < 80
        assert (slug(one) == slug(other)) == (one == other)


class TestPage:
    def test_labels_are_text_whatever_they_are(self, odd):
        page = page_of(odd[0])
        assert "b" not in page.tags
        assert "i" not in page.tags
        assert "Title <i>& more" in page.text
        assert "About <script>alert(1)</script> it." in page.text
        assert ODD in page.texts
        assert "ValueError: <boom> & bust" in page.texts
        assert any(ODD in alternative for alternative in page.values("alt"))

    def test_a_title_may_be_a_number_or_a_list(self, odd):
        for title in (2026, ["a", "<b>"]):
            tables = replace(odd[0], manifest={**odd[0].manifest, "title": title})
            assert Page(render_page(tables, {})).texts.count(str(title)) == 2

    def test_the_outcome_comes_first(self, odd):
        tables, _ = odd
        text = page_of(tables).text
        outcome = text[text.index("Outcome") : text.index("What was run Missions")]
        assert outcome.startswith(f"Outcome algorithm toy {ODD} average rank BO-ACO 0.")
        assert "4 runs are not done , and scored all the same" in outcome

    @pytest.mark.slow
    def test_travel_budgets_where_there_are_any(self, odd, tmp_path):
        assert "max length" not in page_of(odd[0]).text
        records = random_records(["toy", "far"], ["A"], (1, 2))
        tables = study(tmp_path, ["toy", "far"], records)
        tables.missions["max_length"] = [4.5, math.nan]
        write_report(tables)
        text = page_of(tables).text
        assert "min survival max length nodes" in text
        assert "0 4.500 5 12 2 10" in text
        assert "0 – 5 12 2 10" in text

    def test_what_was_run(self, odd):
        text = page_of(odd[0]).text
        assert "2 missions, 4 algorithms, 3 seeds; 20 runs, 16 done; 4 missing." in text
        assert "Seeds 1, 2, 3" in text
        assert "others with BO-ACO, at a significance level of 0.05" in text
        assert "toy toy robots=2 10,000 0 5 12 2 10" in text

    def test_nodes_and_arcs_of_kinds_count_once(self, tmp_path):
        mission = load_mission("building", robots=2, wheeled=1)
        study = make_study(tmp_path, {"two kinds": mission}, algorithms("A"), [])
        row = mission_table(study).cells.iloc[0]
        assert (row["nodes"], row["arcs"]) == (54, 126)

    @pytest.mark.parametrize("kind", ["union", "best-known"])
    def test_what_the_reference_is(self, odd, kind):
        tables = replace(odd[0], manifest={**odd[0].manifest, "reference": kind})
        known = Page(render_page(tables, {})).text
        said = "from the reference front, what all runs on a mission found together{}; 0 is best."
        with_known = ", with the best known front of the library"
        assert said.format(with_known if kind == "best-known" else "") in known

    def test_what_is_lost_is_said(self, odd):
        text = page_of(odd[0]).text
        assert "scored as the plan that brings nothing back: area 0" in text
        assert "toy lost 1 failed error ValueError: <boom> & bust 0" in text
        assert f"{ODD} lost 3 timeout error stopped after 60 seconds 0" in text
        assert "Runs without any recorded front are not in it." in text
        assert "Runs without a front reach nothing." in text
        assert "runs n not done area area low area high" in text
        assert "lost 3 3 0 0 0 0" in text

    def test_figures_are_in_it(self, odd):
        tables, _ = odd
        page = page_of(tables)
        n_figures = 2 * len(figure_names("toy")) + 1  # and one of both missions
        assert page.tags.count("img") == n_figures
        assert page.tags.count("figcaption") == n_figures
        first = next(value for value in page.values("src"))
        assert first.startswith("data:image/png;base64,iVBORw0KGgo")

    def test_each_verdict_is_said_once(self, odd):
        """In a word, beside its numbers."""
        tables, _ = odd
        page = page_of(tables)
        pattern = r"(better|worse), \w+|no difference found"
        said = [text for text in page.texts if re.fullmatch(pattern, text)]
        assert len(said) == len(tables.comparisons)
        found = tables.comparisons[tables.comparisons["significant"]]
        assert len(found)


@pytest.mark.slow
class TestHardStudies:
    def test_one_mission_one_algorithm_one_seed(self, tmp_path):
        tables = study(tmp_path, ["toy"], random_records(["toy"], "A", (1,)))
        names = {path.name for path in write_report(tables)}
        assert names == {
            *FIXED_NAMES,
            *figure_names("toy", without=["difference"]),
        }
        text = page_of(tables).text
        assert "1 mission, 1 algorithm, 1 seed; 1 run, all done." in text
        assert "All runs are done." in text

    def test_no_run_has_a_front(self, tmp_path):
        tables = study(tmp_path, ["toy"], [r for x in "AB" for r in lost("toy", x, (1, 2))])
        names = {path.name for path in write_report(tables)}
        assert names == {*FIXED_NAMES, *AREAS_ONLY}
        assert "A 0 (1.5) B 0 = (1.5)" in page_of(tables).text

    def test_a_mission_without_runs(self, tmp_path):
        labels = ["A", "B"]
        tables = study(
            tmp_path, ["toy", "later"], random_records(["toy"], "A", (1,)), labels=labels
        )
        names = {path.name for path in write_report(tables)}
        assert not any("later" in name for name in names)
        assert f"later {TOY.title} No runs yet." in page_of(tables).text

    def test_a_study_without_any_run(self, tmp_path):
        tables = study(tmp_path, ["toy"], [], labels=["A"])
        assert {path.name for path in write_report(tables)} == set(FIXED_NAMES)
        assert "0 runs" in page_of(tables).text


class TestRivals:
    def test_the_control_and_the_best_other(self, tmp_path):
        records = random_records(["toy"], "ABC", (1, 2), n_records=1)
        for control, expected in (("A", ("A", "C")), ("C", ("C", "B")), (None, ("C", "B"))):
            tables = study(tmp_path / str(control), ["toy"], records, control=control)
            assert rivals(tables) == expected


class TestWords:
    def test_numbers_and_settings(self):
        for written, text in (
            (number_text(0.12345), "0.1235"),
            (number_text(0.00123456), "0.001235"),
            (number_text(123456.7), "123,457"),
            (number_text(1.234e-9), "1.234e-09"),
            (number_text(12.345), "12.35"),
            (number_text(0), "0"),
            (number_text(math.inf), "inf"),  # the gap of runs without a front
            (number_text(10_000.0), "10,000"),
            (number_text(3.5), "3.500"),
            (
                parameter_words({"a": 1, "b": None, "c": "x", "d": [0.5]}),
                "a=1, b=null, c=x, d=[0.5]",
            ),
        ):
            assert written == text
