"""What the README shows is what happens; tests/docs has the guides."""

import re
from pathlib import Path

import pytest

from tests.docs.guides import blocks, printed_by, words

ROOT = Path(__file__).parents[1]


def test_the_library_use_prints_what_is_shown(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = blocks(ROOT / "README.md")
    (code,) = (text for language, text in found if language == "python")
    assert len([line for line in code.splitlines() if line]) == 10
    shown = [text for language, text in found if not language][1]
    printed = printed_by(code, {})
    # Another machine's libm may lead the search elsewhere: the numbers' form and size must agree.
    areas = [float(re.search(r"area (0\.\d{3})\n", text)[1]) for text in (printed, shown)]
    assert areas[0] == pytest.approx(areas[1], abs=0.005)
    assert words(printed) == words(shown)
    assert (tmp_path / "results" / "museum" / "plans.json").exists()


def test_the_two_commands_are_there():
    text = (ROOT / "README.md").read_text("utf-8")
    makefile = (ROOT / "Makefile").read_text("utf-8")
    for command in re.findall(r"^make (\w+)", text, re.M):
        assert re.search(rf"^{command}:", makefile, re.M)
    assert {"demo", "test"} <= set(re.findall(r"^make (\w+)", text, re.M))
