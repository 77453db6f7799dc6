"""The page as a file: self-contained, safe, readable, and with the library that it should have."""

import base64
import hashlib
import html
import re
from importlib.resources import files
from itertools import product
from pathlib import Path

from botohe_moo import explorer
from botohe_moo.explorer.page import _REPLAY_SCRIPTS, SCRIPTS, notebook_frame, own_script
from tests.decide.made import solution_of
from tests.explorer.conftest import toy_plans

FOLDER = Path(explorer.__file__).parent
ASSETS, VENDOR = FOLDER / "assets", FOLDER / "vendor"
STYLE = (ASSETS / "style.css").read_text("utf-8")


class TestVendored:
    def test_d3_is_the_official_file(self):
        said = (VENDOR / "VERSION").read_text("utf-8")
        assert "Mike Bostock" in (VENDOR / "LICENSE").read_text("utf-8")
        data = (VENDOR / "d3.min.js").read_bytes()
        assert f"sha256 {hashlib.sha256(data).hexdigest()}" in said
        version = re.search(r"d3 (\d+\.\d+\.\d+) ", said)[1]
        assert data.startswith(f"// https://d3js.org v{version} Copyright".encode())


class TestScript:
    def test_all_modules_are_in_it(self):
        assert {path.stem for path in ASSETS.glob("*.js")} == {*SCRIPTS, *_REPLAY_SCRIPTS}
        assert files("botohe_moo.explorer").joinpath("assets", "main.js").is_file()

    def test_it_neither_makes_markup_of_texts_nor_asks_the_network(self):
        for pattern in (
            r"innerHTML|outerHTML|insertAdjacentHTML|\.html\(|document\.write",
            r"\beval\b|new Function|setTimeout\(\"|import\(",
            r"fetch\(|XMLHttpRequest|WebSocket|EventSource|sendBeacon",
            r"https?://(?!www\.w3\.org/2000/svg)",
            r"</script",
        ):
            for scripts in (SCRIPTS, _REPLAY_SCRIPTS):
                assert not re.search(pattern, own_script(scripts))


class TestPage:
    def test_only_its_own_scripts_and_styles_are_allowed(self, toy_page):
        page = toy_page.read_text("utf-8")
        policy = html.unescape(re.search(r'Content-Security-Policy" content="(.*?)">', page)[1])
        assert policy.startswith("default-src 'none'; ")
        assert "unsafe" not in policy
        blocks = re.findall(r"<(?:script|style)>(.*?)</(?:script|style)>", page, re.DOTALL)
        assert len(blocks) == 3
        for block in blocks:
            digest = base64.b64encode(hashlib.sha256(block.encode()).digest()).decode()
            assert f"'sha256-{digest}'" in policy

        assert "img-src data:;" in policy

    def test_nothing_is_loaded(self, toy_page):
        markup = re.sub(
            r"<(script|style).*?</\1>", "", toy_page.read_text("utf-8"), flags=re.DOTALL
        )
        assert not re.search(r"\b(src|href|srcset|action)=|url\(|@import", markup + STYLE)

    def test_notebooks_show_the_same_page_in_a_closed_frame(self):
        solution = solution_of(*toy_plans([1], [1, 2, 1]))
        frame = solution._repr_html_()
        assert frame == notebook_frame(solution)
        assert 'sandbox="allow-scripts allow-downloads"' in frame
        [page] = re.findall('srcdoc="([^"]*)"', frame)
        assert html.unescape(page) == explorer.explorer_page(solution)


def luminance(colour):
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one, other):
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


LIGHT, DARK = (
    dict(re.findall(r"--([\w-]+): (#\w{6});", block))
    for block in re.findall(r":root \{(.*?)\}", STYLE, re.DOTALL)
)
TEXTS = [
    *product(("ink", "muted", "tone"), ("page", "soft")),
    ("on-tone", "tone"),
    *product(["warn"], ("page", "soft")),
]


def test_texts_have_contrast():
    """WCAG 2.2, level AA: 4.5."""
    for scheme, (ink, paper) in product((LIGHT, DARK), TEXTS):
        assert contrast(scheme[ink], scheme[paper]) >= 4.5, (ink, paper)
