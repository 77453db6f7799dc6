"""What the guides show is what happens, and what they link to is there."""

import importlib
import re
import shlex
from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd
import pytest
from benchmarks import made
from typer.testing import CliRunner

from botohe_moo.algorithms.local_search.engine import DEFAULT_MOVES
from botohe_moo.cli.app import app
from botohe_moo.library import library_table
from botohe_moo.mission.loading import ENTRIES
from botohe_moo.study import pool, report
from botohe_moo.testing import algorithms, missions
from botohe_moo.testing.rules import rules_of, said_by
from docs import architecture
from tests.docs.guides import DOCS, GUIDES, NOTEBOOKS, ROOT, blocks, links, printed_by, words
from tests.forked import ForkedSubprocess

# Read from top to bottom in one session; every block of the others stands alone.
SESSIONS = {"model", "scenarios", "studies", "tour", "under-way"}
# Blocks that are tables, by what they begin with: commands below them read these files.
TABLES = {"label,": "nodes.csv", "tail,": "arcs.csv", "robot,": "events.csv"}
# What takes long, and is as well shown with less. Bounds take the time that they are given.
SHORTER = {
    "time_limit=30": "time_limit=1",
    "evaluations=100_000": "evaluations=20_000",
    '"n_gen", 200': '"n_gen", 50',
    '"seeds": 5': '"seeds": 2',
    '"nsga2", problem': '"nsga2", evaluations=2_000, problem',
}
# Their commands need the packages that these pages make: see test_examples.py.
OF_PACKAGES = {
    "adding-a-format",
    "adding-a-mission",
    "adding-an-algorithm",
    "adding-an-indicator",
    "adding-an-objective",
    "adding-an-operator",
}
PAGES = [*GUIDES, *sorted((DOCS / "reference").glob("*.md"))]
TEXTS = [*PAGES, *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md"))]


def runs(page):
    return any(language in ("python", "console") for language, _ in blocks(page))


@pytest.mark.slow
@pytest.mark.parametrize("page", [*filter(runs, PAGES)], ids=lambda page: page.stem)
def test_guides_run(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(report, "FORMATS", report.FORMATS[:1])
    monkeypatch.setattr(pool, "subprocess", ForkedSubprocess)
    with plt.rc_context():  # some set a theme
        run_page(page)
    plt.close("all")


def run_page(page):
    namespace, printed = {}, ""
    for language, text in blocks(page):
        if language == "python":
            namespace = namespace if page.stem in SESSIONS else {}
            for long, short in SHORTER.items():
                text = text.replace(long, short)
            printed = printed_by(text, namespace)
        elif language == "text" and page.stem in SESSIONS:
            assert words(printed) == words(text)
        elif language == "console" and page.stem not in OF_PACKAGES:
            for line in text.replace("\\\n", "").splitlines():
                done = CliRunner().invoke(app, shlex.split(line.removeprefix("$ botohe ")))
                assert done.exit_code == 0, (line, done.output)
        elif name := next((TABLES[start] for start in TABLES if text.startswith(start)), None):
            Path(name).write_text(text, "utf-8")


def test_code_is_shown_without_scrolling():
    shown = [text for page in (*GUIDES, ROOT / "README.md") for _, text in blocks(page)]
    shown += [path.read_text("utf-8") for path in (DOCS / "examples").glob("*/*.*")]
    assert [line for text in shown for line in text.splitlines() if len(line) > 78] == []


def test_links_lead_somewhere():
    assert [(page, link) for page in TEXTS for link in links(page) if not link.exists()] == []


# Words of an earlier edition that a reader cannot know: the glossary has others.
UNKNOWN = ("what others leave", "made anew", "look-ahead", "refill")


def sentences(page):
    """The sentences of a page, outside headings, lists, tables, code and formulas."""
    text = re.sub(r"^ *(```|\$\$).*?^ *\1$", "", page.read_text("utf-8"), flags=re.M | re.S)
    for block in re.split(r"\n\s*\n", text):
        if not re.match(r"\s*([-*|#] |#|\d+\. |<!--)", block):
            yield from re.split(r"(?<=[.!?])[*\"”)]*\s+", block.strip())


@pytest.mark.parametrize("page", [*GUIDES, ROOT / "README.md"], ids=lambda page: page.stem)
def test_sentences_are_short_and_of_known_words(page):
    assert [said for said in sentences(page) if len(said.split()) > 30] == []
    text = " ".join(page.read_text("utf-8").lower().split())
    assert [word for word in UNKNOWN if word in text] == []


def test_the_index_has_every_page():
    pages = [link for link in links(DOCS / "index.md") if link.suffix in (".md", ".ipynb")]
    known = {*GUIDES, *NOTEBOOKS, DOCS / "reference" / "index.md"} - {DOCS / "index.md"}
    assert {page.resolve() for page in pages} == known


def test_the_gallery_shows_what_its_code_draws():
    code = "".join(text for language, text in blocks(DOCS / "gallery.md") if language == "python")
    drawn = set(re.findall(r'"([\w-]+\.png)"', code))
    kept = ROOT / "results" / "gallery"
    shown = {
        target.name for target in links(DOCS / "gallery.md") if target.parent.name == "gallery"
    }
    assert drawn == shown == {path.name for path in kept.glob("*.png")}


def test_every_result_has_its_command():
    results = ROOT / "results"
    assert {*made.folders(results)} - made.commands(results).keys() == set()


@pytest.mark.parametrize("name", [p.stem for p in (ROOT / "benchmarks").glob("[!_]*.py")])
def test_benchmarks_find_what_they_measure(name):
    importlib.import_module(f"benchmarks.{name}")


def test_the_drawing_shows_the_imports():
    assert architecture.drawn() == architecture.arrows(architecture.rooms())


def table(frame):
    """A table in Markdown."""
    rows = [frame.columns, ["---"] * len(frame.columns), *frame.astype(object).to_numpy()]
    return "".join(f"| {' | '.join(map(cell, row))} |\n" for row in rows)


def cell(value):
    """A number in groups of three digits, or a text."""
    return f"{value:,}".replace(",", " ") if isinstance(value, int) else str(value)


def published():
    columns = ["algorithm", "iteration", "published", "area", "tolerance"]
    frame = pd.read_csv(ROOT / "results" / "paper" / "published.csv")[columns]
    return frame.rename(columns={"iteration": "iterations", "area": "ours"})


def speed():
    found = pd.read_csv(ROOT / "results" / "bo-aco" / "speed.csv", index_col=0)
    wanted = {"whole run, s": "seconds", "both, µs a plan": "µs to build and evaluate a plan"}
    return found.loc[list(wanted)].T.rename(columns=wanted).rename_axis("mission").reset_index()


def islands():
    """Areas by evaluations of the longest island, at two marks of each mission."""
    rows = {}
    found = pd.read_csv(ROOT / "results" / "islands" / "areas.csv")
    for one in found[found["counted"] == "an island"].itertuples():
        first = {"mission": one.mission, "evaluations of an island": one.mark}
        row = rows.setdefault(tuple(first.values()), first)
        row["1 island" if one.islands == 1 else f"{one.islands} islands"] = f"{one.area:.4f}"
    shown = pd.DataFrame(list(rows.values()))
    return shown[shown["evaluations of an island"].isin((30_000, 125_000))]


def gaps():
    """Gaps of fronts after some seconds, by mission: means over seeds."""
    table = pd.read_csv(ROOT / "results" / "bounds" / "bounds.csv")
    table["mission"] = table["mission"].str.replace(r", seed \d+$", "", regex=True)
    means = table.groupby(["mission", "robots", "seconds_given"], sort=False)["gap"].mean()
    rows = means.map("{:.2f} %".format).reset_index()
    rows["gap after seconds"] = rows["gap"] + " (" + rows["seconds_given"].astype(str) + " s)"
    by_mission = rows.groupby(["mission", "robots"], sort=False)["gap after seconds"]
    return by_mission.agg(", ".join).reset_index()


def collection():
    """The missions of the library, with the areas of their best known fronts."""
    found = library_table()
    shown = found[["mission", "family", "nodes", "arcs", "robots", "plans"]]
    return shown.assign(
        area=found["area"].map("{:.6f}".format), gap=(100 * found["gap"]).map("{:.2f} %".format)
    )


def by_size():
    """Mean areas of the algorithms as shares of the best known ones, by the size of missions."""
    summary = pd.read_csv(ROOT / "results" / "algorithms" / "summary.csv")
    sizes = summary["mission"].map({name: entry.size for name, entry in ENTRIES.items()})
    rows = summary.groupby("algorithm")["rank"].mean().sort_values().to_frame("average rank")
    for size in ("small", "medium", "large"):
        shares = summary[sizes == size].groupby("algorithm")["area_share"].mean()
        rows[size] = (100 * shares).map("{:.2f} %".format)
    return rows.reset_index().round({"average rank": 2})


KEPT = {"library": (collection, by_size), "measured": (speed, islands, gaps), "paper": (published,)}


def test_the_guide_lists_all_moves():
    text = (ROOT / "docs" / "local-search.md").read_text("utf-8")
    table = text.partition("<!-- moves")[2].partition("<!-- end of moves")[0]
    rows = re.findall(r"^\| `([a-z-]+)` \| ([0-9.]+) \|", table, re.MULTILINE)
    assert {name: float(weight) for name, weight in rows} == DEFAULT_MOVES


def renewed(guide):
    """A guide with its tables made anew."""
    text = (DOCS / f"{guide}.md").read_text("utf-8")
    for make in KEPT[guide]:
        name = make.__name__
        begin = f"<!-- {name}: kept by tests/docs/test_guides.py -->\n"
        end = f"<!-- end of {name} -->"
        before, after = text.partition(begin)[0], text.partition(end)[2]
        text = f"{before}{begin}\n{table(make())}\n{end}{after}"
    return text


@pytest.mark.parametrize("guide", KEPT)
def test_tables_are_those_of_the_results(guide):
    said = "run `python -m tests.docs.test_guides`"
    assert (DOCS / f"{guide}.md").read_text("utf-8") == renewed(guide), said


if __name__ == "__main__":
    for guide in KEPT:
        (DOCS / f"{guide}.md").write_text(renewed(guide), "utf-8")


@pytest.mark.parametrize(("title", "home"), [("Algorithms", algorithms), ("Missions", missions)])
def test_conformance_lists_all_rules(title, home):
    text = (DOCS / "conformance.md").read_text("utf-8")
    section = text.partition(f"## {title}\n")[2].partition("## ")[0]
    rows = re.findall(r"^\| `(\w+)` \| (.*) \|$", section, re.M)
    assert rows == [(rule.__name__, said_by(rule)[0]) for rule in rules_of(home)]
