"""The packages that the guides build, installed as they stand, do what the guides say."""

import csv
import os
import shlex
import shutil
import subprocess
import sys
import tomllib

import pytest

from botohe_moo.study import read_study
from tests.base.test_installed import botohe, pip_install, search_path, write_wheel
from tests.docs.guides import DOCS, blocks
from tests.forked import run_forked

pytestmark = pytest.mark.slow
EXAMPLES = DOCS / "examples"
# Packages with entry points: these are installed by pip, and found by their names.
PACKAGES = ("botohe-drift", "botohe-edges", "botohe-tower", "botohe-rich-visit", "botohe-spacing")


def as_lines(groups):
    """Entry points as an installed package has them."""
    return "".join(
        f"[{group}]\n" + "".join(f"{name} = {target}\n" for name, target in entries.items())
        for group, entries in groups.items()
    )


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder into which pip has installed the packages."""
    folder = tmp_path_factory.mktemp("examples")
    wheels = []
    for package in PACKAGES:
        source = EXAMPLES / package
        project = tomllib.loads((source / "pyproject.toml").read_text("utf-8"))["project"]
        assert project["name"] == package
        assert project["dependencies"] == ["botohe-moo"]
        module = package.replace("-", "_")
        modules = {module: (source / f"{module}.py").read_text("utf-8")}
        wheels.append(write_wheel(folder, package, modules, as_lines(project["entry-points"])))
    pip_install(folder / "site", *wheels)
    return folder / "site"


def commands(guide):
    """What a guide has its reader type."""
    typed = [text for language, text in blocks(DOCS / f"{guide}.md") if language == "console"]
    lines = "".join(typed).splitlines()
    assert lines
    return [shlex.split(line.removeprefix("$ botohe ")) for line in lines]


@pytest.fixture(scope="module")
def drifted(site, tmp_path_factory):
    """A folder in which the commands of the guide to algorithms were given, and their outputs."""
    folder = tmp_path_factory.mktemp("drift")
    shutil.copy(EXAMPLES / "botohe-drift" / "drift.yaml", folder)
    printed = []
    for command in commands("adding-an-algorithm"):
        ended = botohe(*command, site=site, cwd=folder)
        assert ended.status == 0, ended.err
        printed.append(ended.out)
    return folder, printed


def test_the_algorithm_is_described(drifted):
    described = " ".join(drifted[1][0].split())
    assert "n_children" in described
    assert "max_via" in described


def test_the_algorithm_finds_a_front(drifted):
    with (drifted[0] / "results" / "museum" / "front.csv").open(newline="") as file:
        assert len(list(csv.DictReader(file))) > 20


def test_the_algorithm_is_in_the_study_and_in_its_report(drifted):
    tables = read_study(drifted[0] / "results" / "drift")
    assert set(tables.runs["status"]) == {"done"}
    assert set(tables.runs["evaluations"]) == {2_000}
    museum = tables.summary[tables.summary["mission"] == "art_museum"]
    areas = museum.set_index("algorithm")["area_median"]
    assert areas.drop("random").min() > areas["random"]
    page = drifted[0] / "results" / "drift" / "report" / "report.html"
    assert "Drift (max_via=2)" in page.read_text("utf-8")


def test_the_mission_is_shown_and_solved(site, tmp_path):
    for command in commands("adding-a-mission"):
        ended = botohe(*command, site=site, cwd=tmp_path)
        assert ended.status == 0, ended.err
    assert (tmp_path / "tower.png").exists()
    assert (tmp_path / "results" / "tower" / "front.csv").exists()


def test_the_study_of_missions_is_one(site, tmp_path):
    (text,) = (t for language, t in blocks(DOCS / "adding-a-mission.md") if language == "yaml")
    (tmp_path / "towers.yaml").write_text(text)
    ended = botohe("study", "plan", "towers.yaml", site=site, cwd=tmp_path)
    assert (ended.status, "18 runs" in ended.out) == (0, True), ended


def test_the_format_is_read_as_shown(site, tmp_path):
    (text,) = (t for language, t in blocks(DOCS / "adding-a-format.md") if language == "text")
    (tmp_path / "reefs.csv").write_text(text)
    for command in commands("adding-a-format"):
        ended = botohe(*command, site=site, cwd=tmp_path)
        assert ended.status == 0, ended.err
    assert (tmp_path / "results" / "reefs" / "front.csv").exists()


def test_the_mutation_is_known_by_its_name(site, tmp_path):
    for command in commands("adding-an-operator"):
        ended = botohe(*command, site=site, cwd=tmp_path)
        assert ended.status == 0, ended.err
    (text,) = (t for language, t in blocks(DOCS / "adding-an-operator.md") if language == "yaml")
    (tmp_path / "mutations.yaml").write_text(text)
    ended = botohe("study", "plan", "mutations.yaml", site=site, cwd=tmp_path)
    assert (ended.status, "9 runs" in ended.out) == (0, True), ended


def test_the_indicator_is_in_the_study_and_in_its_report(site, tmp_path):
    shutil.copy(EXAMPLES / "botohe-spacing" / "spacing.yaml", tmp_path)
    for command in commands("adding-an-indicator"):
        ended = botohe(*command, site=site, cwd=tmp_path)
        assert ended.status == 0, ended.err
    tables = read_study(tmp_path / "results" / "spacing")
    assert set(tables.indicators["indicator"]) == {"area", "spacing"}
    assert set(tables.comparisons["indicator"]) == {"area", "spacing"}
    page = tmp_path / "results" / "spacing" / "report" / "report.html"
    assert "spacing" in page.read_text("utf-8")


def test_the_problem_is_in_the_study_and_in_its_report(tmp_path):
    package = EXAMPLES / "botohe-safest"
    shutil.copy(package / "safest.yaml", tmp_path)
    for command in commands("adding-an-objective"):
        ended = botohe(*command, site=package, cwd=tmp_path)
        assert ended.status == 0, ended.err
    tables = read_study(tmp_path / "results" / "safest")
    assert set(tables.runs["status"]) == {"done"}
    assert tables.plans["least_survival"].max() == 1.0
    page = tmp_path / "results" / "safest" / "report" / "report.html"
    assert "botohe_safest:Safest" in page.read_text("utf-8")


@pytest.mark.parametrize("package", PACKAGES)
def test_their_own_tests_pass(package, site, tmp_path):
    test = f"test_{package.replace('-', '_')}.py"
    shutil.copy(EXAMPLES / package / test, tmp_path)
    done = run_forked(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", test],
        env={**os.environ, "PYTHONPATH": search_path(site)},
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stdout


def test_the_mutation_is_used_as_shown(tmp_path):
    package = EXAMPLES / "botohe-rich-visit"
    done = subprocess.run(
        [sys.executable, package / "use.py"],
        env={**os.environ, "PYTHONPATH": search_path(package)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.startswith("<Solution of 'art_museum' by ")
