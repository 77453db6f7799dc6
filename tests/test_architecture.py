"""What holds for the source as a whole and neither ruff nor the import linter checks."""

import ast
import importlib
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

import botohe_moo
from botohe_moo import algorithms, decide, explorer, mission, operators, plots, study
from botohe_moo.algorithms import greedy

LAZY_PACKAGES = [botohe_moo, algorithms, decide, explorer, mission, operators]
LAZY_PACKAGES += [plots, study, greedy]


def imported_for_checkers(package):
    """The names that type checkers take for exported, ``NAME as NAME``, and their modules."""
    tree = ast.parse(Path(package.__file__).read_text("utf-8"))
    return {
        alias.asname: node.module
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.asname == alias.name
    }


class TestLazyNames:
    """They are the same for Python and for type checkers, and nobody waits for the rest."""

    def test_each_is_what_its_home_says(self):
        for package in LAZY_PACKAGES:
            homes = imported_for_checkers(package)
            assert sorted(homes) == sorted(package.__all__)
            assert set(homes) <= set(dir(package))
            for name, home in homes.items():
                assert getattr(package, name) is getattr(importlib.import_module(home), name)

    def test_none_has_the_name_of_a_module(self):
        # Python would put the module in its place as soon as anybody imports it.
        for package in LAZY_PACKAGES:
            modules = [n for n in package.__all__ if find_spec(f"{package.__name__}.{n}")]
            assert modules == [], package

    def test_other_names_are_refused(self):
        with pytest.raises(AttributeError, match="'botohe_moo' has no attribute 'Misson'"):
            botohe_moo.Misson  # noqa: B018

    @pytest.mark.parametrize(
        ("module", "others"),
        [
            ("botohe_moo", "numpy numba pandas pydantic pymoo networkx matplotlib typer"),
            ("botohe_moo.decide.choosing", "pandas pymoo matplotlib typer"),
            ("botohe_moo.plots.mission", "pandas seaborn pymoo typer"),
        ],
    )
    def test_importing_waits_for_nothing_else(self, module, others):
        code = f"import sys, {module}; print(*sorted({{m.split('.')[0] for m in sys.modules}}))"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
        loaded = set(done.stdout.decode().split())
        assert "botohe_moo" in loaded
        assert not loaded & set(others.split())


def test_initialisers_only_export():
    for path in Path(botohe_moo.__file__).parent.rglob("__init__.py"):
        kinds = {type(node) for node in ast.parse(path.read_text("utf-8")).body}
        assert kinds <= {ast.Expr, ast.Import, ast.ImportFrom, ast.If, ast.Assign}, path
