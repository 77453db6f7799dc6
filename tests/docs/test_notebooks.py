"""The notebooks run, and show what they are committed with."""

import tempfile

import pytest

pytest.importorskip("nbclient", reason="nbclient is not installed")
import nbformat
from nbclient import NotebookClient

from tests.docs.guides import NOTEBOOKS, words

LARGEST = 300_000  # bytes, so that code hosts show them
CASES = [pytest.param(path, id=path.stem) for path in NOTEBOOKS]


def executed(path, folder):
    """A notebook after a run in an empty folder."""
    notebook = nbformat.read(path, as_version=4)
    NotebookClient(
        notebook,
        timeout=240,  # seconds a cell, the first of which compile
        record_timing=False,
        coalesce_streams=True,
        resources={"metadata": {"path": str(folder)}},
    ).execute()
    notebook.metadata["language_info"] = {"name": "python", "pygments_lexer": "ipython3"}
    return notebook


def code(path):
    return [cell for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "code"]


def shown(cells):
    """What each cell shows: the words of texts, and which pictures there are."""
    return [[said(output) for output in cell.get("outputs", [])] for cell in cells]


def said(output):
    parts = output.get("data") or {output["name"]: output["text"]}
    return {kind: kind if "image" in kind else words(part) for kind, part in parts.items()}


@pytest.mark.slow
@pytest.mark.parametrize("path", CASES)
def test_notebooks_show_what_happens(path, tmp_path):
    fresh = [cell for cell in executed(path, tmp_path).cells if cell.cell_type == "code"]
    assert shown(code(path)) == shown(fresh), "run `python -m tests.docs.test_notebooks`"


@pytest.mark.parametrize("path", CASES)
def test_notebooks_are_shown_without_scrolling(path):
    assert path.stat().st_size < LARGEST
    lines = [line for cell in code(path) for line in cell.source.splitlines()]
    assert [line for line in lines if len(line) > 78] == []


if __name__ == "__main__":
    for path in NOTEBOOKS:
        with tempfile.TemporaryDirectory() as folder:
            nbformat.write(executed(path, folder), path)
