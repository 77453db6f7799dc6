"""What the README shows is what happens; tests/docs has the guides."""

import contextlib
import io
import re
from pathlib import Path

import pytest

from tests.docs.guides import blocks

ROOT = Path(__file__).parents[1]


def printed_by(code):
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(code, "example", "exec"), {})
    return printed.getvalue()


def test_the_library_use_prints_what_is_shown(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = blocks(ROOT / "README.md")
    (code,) = (text for language, text in found if language == "python")
    assert len(code.strip().splitlines()) == 10
    shown = [text for language, text in found if not language][1]
    printed = printed_by(code)
    # Another machine's libm may lead the search elsewhere: the numbers' form and size must agree.
    area = re.search(r"\d+ plans, area (0\.\d{3})\n", printed)
    assert float(area[1]) == pytest.approx(float(re.search(r"area (0\.\d+)", shown)[1]), abs=0.005)
    assert [line.split()[0] for line in printed.splitlines()[-3:]] == [
        "mean",
        "reward",
        "survivors",
    ]
    assert len(printed.splitlines()) == len(shown.splitlines())
    assert (tmp_path / "results" / "museum" / "plans.json").exists()


def test_the_two_commands_are_there():
    text = (ROOT / "README.md").read_text("utf-8")
    makefile = (ROOT / "Makefile").read_text("utf-8")
    for command in re.findall(r"^make (\w+)", text, re.M):
        assert re.search(rf"^{command}:", makefile, re.M)
    assert {"demo", "test"} <= set(re.findall(r"^make (\w+)", text, re.M))
