"""Packages with algorithms and operators."""

import sys

import pytest

from tests.base.packages import entries, write_package


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Install a package with algorithms or operators, as pip would."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def install(code, *, package="reef", group="algorithms", **targets):
        write_package(tmp_path, package, code, entries(group, package, **targets))
        monkeypatch.delitem(sys.modules, package, raising=False)

    return install
