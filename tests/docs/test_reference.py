"""The reference lists exactly what the package exports, with an example each that runs alone."""

import inspect
import re
import sys
from importlib import import_module

from tests.docs.guides import DOCS, links

sys.path.append(str(DOCS / "_extensions"))
from exported import documented_names, public_modules

REFERENCE = DOCS / "reference"
MODULES = public_modules()
DOCUMENTED = documented_names()
# Described and shown on their pages.
WITHOUT_DOCSTRING = {"botohe_moo.indicators.INDICATORS", "botohe_moo.study.SCHEMAS"}


def listed(module):
    """The dotted names on a module's page."""
    text = (REFERENCE / f"{module}.md").read_text("utf-8")
    names = re.findall(r"^   ~(botohe_moo\S+)$|^\.\. py:data:: (\S+)$", text, re.M)
    return [one or other for one, other in names]


def test_there_are_many():
    assert len(MODULES) > 15
    assert len(DOCUMENTED) > 120


def test_there_is_a_page_for_each_module_and_no_other():
    pages = {path.stem for path in REFERENCE.glob("*.md")} - {"index"}
    assert pages == set(MODULES)
    assert {path.stem for path in links(REFERENCE / "index.md")} == {*pages, "command-line"}


def test_pages_list_what_modules_export():
    for module in MODULES:
        names, exported = listed(module), import_module(module).__all__
        assert sorted(name.rpartition(".")[2] for name in names) == sorted(exported)
        assert set(names) <= set(DOCUMENTED.values())
        for name in names:
            home, _, own = name.rpartition(".")
            assert getattr(import_module(home), own) is getattr(import_module(module), own)


def imports_in_its_example(name):
    home, _, own = name.rpartition(".")
    text = inspect.getdoc(getattr(import_module(home), own)) or ""
    examples = text.partition("\nExamples\n--------\n")[2]
    return re.search(rf"^>>> from {re.escape(home)} import .*\b{own}\b", examples, re.M)


def test_each_name_has_an_example_that_imports_it():
    names = {*DOCUMENTED.values()} - WITHOUT_DOCSTRING
    assert [name for name in sorted(names) if not imports_in_its_example(name)] == []
