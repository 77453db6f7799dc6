"""The guides, as their tests read them."""

import contextlib
import io
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
GUIDES = sorted(DOCS.glob("*.md"))
NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.ipynb"))


def blocks(path):
    """The fenced blocks of a page, in their order: pairs of language and text."""
    return re.findall(r"^```([^`\n]*)\n(.*?)^```$", path.read_text("utf-8"), re.M | re.S)


def links(path):
    """What a page links to and shows, within the repository, without anchors."""
    text = re.sub(r"^```.*?^```$", "", path.read_text("utf-8"), flags=re.M | re.S)
    found = re.findall(r"\]\(((?!http)[^)#]+)(?:#[^)]*)?\)", text)
    return [path.parent / target for target in found]


def printed_by(code, namespace):
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(code, "example", "exec"), namespace)
    return printed.getvalue()


def words(text):
    """The words of what is printed, without numbers and trails: another machine's libm, and the
    page's width, may change those and the ends of lines."""
    return re.sub(r"\([\d, ]*\)|[\d.]+", "0", text).split()
