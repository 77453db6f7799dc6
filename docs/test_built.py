"""What has to be true of the built pages; `make docs` looks after it has built them."""

import re
import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parent / "_extensions"))
from exported import documented_names

BUILT = Path(__file__).parent / "_build" / "html"
ON_THE_PAGE_OF_THEIR_MODULE = {"botohe_moo.indicators.INDICATORS", "botohe_moo.study.SCHEMAS"}
PAGES = sorted(BUILT.rglob("*.html"))
# All that a browser fetches by itself; a link is only followed when somebody clicks.
FETCHED = re.compile(
    r"<(?:script|link|img|iframe|source|video|audio|embed|object|use)\b[^>]*?"
    r"(?:src|href|srcset|data)\s*=\s*[\"']?((?:https?:)?//[^\"'\s>]+)",
    re.IGNORECASE,
)


def test_there_are_pages():
    assert len(PAGES) > 150


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(BUILT)))
def test_nothing_is_fetched_from_a_network(page):
    assert FETCHED.findall(page.read_text("utf-8")) == []


def test_styles_fetch_nothing_from_a_network():
    styles = [*BUILT.rglob("*.css")]
    assert styles
    for style in styles:
        text = style.read_text("utf-8")
        assert not re.search(r"(?:url\(|@import)\s*[\"']?(?:https?:)?//", text), style


def test_what_would_be_fetched_is_found():
    fetched = '<script async src="https://a.b/c.js"></script><link rel=x href=//a.b/c.css>'
    assert FETCHED.findall(fetched) == ["https://a.b/c.js", "//a.b/c.css"]
    assert FETCHED.findall('<a href="https://a.b">x</a><script src="c.js">') == []


def test_each_export_has_a_page_with_an_example_and_nothing_else_has():
    pages = {path.stem: path.read_text("utf-8") for path in BUILT.glob("reference/names/*.html")}
    assert pages.keys() == {*documented_names().values()} - ON_THE_PAGE_OF_THEIR_MODULE
    for name, text in pages.items():
        assert f'id="{name}"' in text, name
        assert '<span class="gp">&gt;&gt;&gt; </span>' in text, name


def test_what_has_no_page_is_described_all_the_same():
    for name in ON_THE_PAGE_OF_THEIR_MODULE:
        page = BUILT / "reference" / f"{name.rpartition('.')[0]}.html"
        assert f'id="{name}"' in page.read_text("utf-8")


def test_formulas_are_drawn():
    assert (BUILT / "model.html").read_text("utf-8").count("<math") > 20


def test_the_command_line_shows_signs_and_not_their_names():
    text = (BUILT / "command-line.html").read_text("utf-8")
    assert "&quot;survivors &gt;= 2&quot;" in text
    assert "&amp;" not in text
