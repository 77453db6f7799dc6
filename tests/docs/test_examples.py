"""The packages that the guides build, installed as they stand, do what the guides say."""

import os
import shlex
import shutil
import sys
import tomllib

import pytest

from botohe_moo import read_solution
from botohe_moo.study import read_study
from tests.base.test_installed import botohe, pip_install, search_path, write_wheel
from tests.docs.guides import DOCS, blocks
from tests.forked import run_forked

pytestmark = pytest.mark.slow
EXAMPLES = DOCS / "examples"
# Packages with entry points: these are installed by pip, and found by their names.
PACKAGES = ("botohe-drift", "botohe-edges", "botohe-tower", "botohe-rich-visit", "botohe-spacing")
# The study file that a guide's commands use: one of the package, or shown, with its runs.
STUDIES = {
    "adding-a-mission": ("towers.yaml", "18 runs"),
    "adding-an-operator": ("mutations.yaml", "9 runs"),
    "adding-an-algorithm": "botohe-drift/drift.yaml",
    "adding-an-indicator": "botohe-spacing/spacing.yaml",
    "adding-an-objective": "botohe-safest/safest.yaml",
}


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
        assert (project["name"], project["dependencies"]) == (package, ["botohe-moo"])
        module = package.replace("-", "_")
        modules = {module: (source / f"{module}.py").read_text("utf-8")}
        wheels.append(write_wheel(folder, package, modules, as_lines(project["entry-points"])))
    pip_install(folder / "site", *wheels)
    return folder / "site"


def shown(guide, language):
    return [text for of, text in blocks(DOCS / f"{guide}.md") if of == language]


@pytest.fixture
def follow(site, tmp_path):
    """Return a function that runs a guide's commands and returns their outputs."""

    def follow(guide, site=site):
        study = STUDIES.get(guide)
        if isinstance(study, str):
            shutil.copy(EXAMPLES / study, tmp_path)
        typed = [line for text in shown(guide, "console") for line in text.splitlines()]
        commands = [shlex.split(line.removeprefix("$ botohe ")) for line in typed]
        if isinstance(study, tuple):
            [text] = shown(guide, "yaml")
            (tmp_path / study[0]).write_text(text)
            commands.append(["study", "plan", study[0]])
        ended = [botohe(*command, site=site, cwd=tmp_path) for command in commands]
        assert [one.err for one in ended if one.status] == []
        assert not isinstance(study, tuple) or study[1] in ended[-1].out
        return [" ".join(one.out.split()) for one in ended]

    return follow


def test_the_algorithm_is_described_and_in_the_study_and_in_its_report(follow, tmp_path):
    described, *_ = follow("adding-an-algorithm")
    assert "n_children" in described
    assert "max_via" in described
    assert len(read_solution(tmp_path / "results" / "museum").plans) > 20
    tables = read_study(tmp_path / "results" / "drift")
    assert set(tables.runs["status"]) == {"done"}
    assert set(tables.runs["evaluations"]) == {2_000}
    museum = tables.summary[tables.summary["mission"] == "art_museum"]
    areas = museum.set_index("algorithm")["area_median"]
    assert areas.drop("random").min() > areas["random"]
    page = tmp_path / "results" / "drift" / "report" / "report.html"
    assert "Drift (max_via=2)" in page.read_text("utf-8")


@pytest.mark.parametrize(
    ("guide", "made"),
    [
        ("adding-a-mission", ["tower.png", "results/tower/front.csv"]),
        ("adding-a-format", ["results/reefs/front.csv"]),
        ("adding-an-operator", []),
    ],
)
def test_what_the_guide_makes_is_there(follow, tmp_path, guide, made):
    if guide == "adding-a-format":
        [text] = shown(guide, "text")
        (tmp_path / "reefs.csv").write_text(text)
    follow(guide)
    assert [name for name in made if not (tmp_path / name).exists()] == []


def test_the_indicator_is_in_the_study_and_in_its_report(follow, tmp_path):
    follow("adding-an-indicator")
    tables = read_study(tmp_path / "results" / "spacing")
    for table in (tables.indicators, tables.comparisons):
        assert set(table["indicator"]) == {"area", "spacing"}
    page = tmp_path / "results" / "spacing" / "report" / "report.html"
    assert "spacing" in page.read_text("utf-8")


def test_the_problem_is_in_the_study_and_in_its_report(follow, tmp_path):
    follow("adding-an-objective", site=EXAMPLES / "botohe-safest")
    tables = read_study(tmp_path / "results" / "safest")
    assert set(tables.runs["status"]) == {"done"}
    assert tables.plans["least_survival"].max() == 1.0
    page = tmp_path / "results" / "safest" / "report" / "report.html"
    assert "botohe_safest:Safest" in page.read_text("utf-8")


def run_with(*arguments, path, cwd):
    env = {**os.environ, "PYTHONPATH": search_path(path)}
    done = run_forked([sys.executable, *arguments], env=env, cwd=cwd)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize("package", PACKAGES)
def test_their_own_tests_pass(package, site, tmp_path):
    test = f"test_{package.replace('-', '_')}.py"
    shutil.copy(EXAMPLES / package / test, tmp_path)
    run_with("-m", "pytest", "-q", "-p", "no:cacheprovider", test, path=site, cwd=tmp_path)


def test_the_mutation_is_used_as_shown(tmp_path):
    package = EXAMPLES / "botohe-rich-visit"
    code = (package / "use.py").read_text("utf-8")
    assert run_with("-c", code, path=package, cwd=tmp_path).startswith("<Solution of 'art_museum'")
