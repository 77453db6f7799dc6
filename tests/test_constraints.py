"""What is pinned, and what is supported at least, are what pyproject.toml says."""

import tomllib
from pathlib import Path

from packaging.requirements import Requirement
from packaging.version import Version

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
OLDEST_PYTHON = {"python_version": "3.11"}


def requirements(lines):
    return [Requirement(line) for line in lines if not line.startswith("#")]


def named(wish):
    return wish.name.lower().replace("_", "-")


def pinned(name):
    lines = requirements((ROOT / name).read_text("utf-8").splitlines())
    chosen = [one for one in lines if one.marker is None or one.marker.evaluate(OLDEST_PYTHON)]
    return {named(one): Version(str(one.specifier).removeprefix("==")) for one in chosen}


def lower_bounds(wishes):
    for wish in requirements(wishes):
        bounds = [Version(one.version) for one in wish.specifier if one.operator == ">="]
        yield named(wish), *bounds


def test_the_oldest_libraries_are_the_lower_bounds():
    bounds = dict(lower_bounds([*PROJECT["dependencies"], *EXTRAS["dask"], *EXTRAS["maps"]]))
    assert pinned("constraints-oldest.txt") == bounds


def test_what_is_developed_with_is_pinned_within_the_bounds():
    versions = pinned("constraints.txt")
    extras = [wish for extra in ("dask", "maps", "dev", "dist", "docs") for wish in EXTRAS[extra]]
    for name, *bounds in lower_bounds([*PROJECT["dependencies"], *extras]):
        if name != "botohe-moo":
            assert all(versions[name] >= bound for bound in bounds), name
