"""How the examples in docstrings run: each in an empty folder, as a reader would run it."""

from pathlib import Path

import matplotlib as mpl
import pytest

mpl.use("Agg")


@pytest.fixture(autouse=True)
def as_a_reader(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Leave an example nothing of its module if it imports what it shows, as public ones do."""
    monkeypatch.chdir(tmp_path)
    example = request.node.dtest
    shown = example.name.rpartition(".")[2]
    imported = [line.source for line in example.examples if " import " in line.source]
    if any(shown in line.replace(",", " ").split() for line in imported):
        example.globs.clear()
        example.globs["__name__"] = "__main__"
