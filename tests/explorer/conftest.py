"""One browser for all tests of the page, and solutions to look at."""

import re
from contextlib import contextmanager
from pathlib import Path

import networkx as nx
import pytest

from botohe_moo import load_mission, solve
from botohe_moo.explorer import explore
from tests.decide.made import solution_of
from tests.plots.made import TRAILS, mixed

CHROMIUM = Path("/usr/bin/chromium")
# Nothing but the page: no updates, no sandbox (tests may run as root), no pictures by a GPU.
ARGUMENTS = [
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"),
    *("--disable-background-networking", "--disable-component-update"),
]


# What there is when the page has been filled, which may be after it has been loaded.
FILLED = "#main:not([hidden]), #problem:not([hidden])"
NAMELESS = """() => [...document.querySelectorAll("button, input, select, svg[role=img]")]
    .filter((one) => !(one.textContent.trim() || one.ariaLabel || one.labels?.length)).length"""


@pytest.fixture(scope="session")
def browser():
    api = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
    if not CHROMIUM.exists():
        pytest.skip(f"there is no {CHROMIUM}: apt-get install chromium")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture
def opened(browser):
    """Open a page file; whatever it says on the console or asks the network for is a fault."""

    @contextmanager
    def opened(path, address="", before="", **options):
        faults = []
        options = {"viewport": {"width": 1280, "height": 900}, "accept_downloads": True} | options
        context = browser.new_context(**options)
        page = context.new_page()
        page.set_default_timeout(15_000)
        page.on("console", lambda message: faults.append(f"{message.type}: {message.text}"))
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        asked = []
        if before:
            page.add_init_script(before)
        page.goto(path.as_uri() + address)
        page.wait_for_selector(FILLED)
        try:
            yield page
        finally:
            context.close()
        own = (path.as_uri(), "about:srcdoc", "blob:", "data:")
        assert [url for url in asked if not url.startswith(own)] == []
        assert faults == []

    return opened


@pytest.fixture(scope="session")
def museum():
    return solve("art_museum", evaluations=10_000, seed=1)


@pytest.fixture(scope="session")
def museum_page(museum, tmp_path_factory):
    path = tmp_path_factory.mktemp("explorer") / "museum.html"
    return explore(museum, path, wishes=["survivors >= 2", "reward >= 99"])


@pytest.fixture(scope="session")
def toy_page(tmp_path_factory):
    path = tmp_path_factory.mktemp("explorer") / "toy.html"
    return explore(solution_of(*toy_plans([1], [1, 2, 1], [1, 3, 2, 4, 2, 3, 1])), path)


def toy_plans(*trails):
    mission = load_mission("toy")
    return mission, [mission.plan([trail, [1]]) for trail in trails]


def kinds_solution():
    """Plans of a mission with kinds of robots, depots and rewards on return."""
    mission = mixed()
    return solution_of(mission, [mission.plan(TRAILS), mission.stay_home()])


WIDTHS = pytest.mark.parametrize(
    "viewport", [{"width": 1280, "height": 900}, {"width": 390, "height": 844}], ids=["wide", "390"]
)


def shows(page, plan):
    """Wait until a plan is at hand."""
    page.locator("#at-hand", has_text=re.compile(rf"^Plan {plan}\b")).wait_for()


def at_hand(page):
    return int(re.match(r"Plan (\d+)", page.inner_text("#at-hand"))[1])


def pinned(page):
    return [int(text.split()[-1]) for text in page.locator("#cards h3").all_text_contents()]


def downloaded(page, kind):
    with page.expect_download() as found:
        page.click(f'[data-file="{kind}"]')
    return found.value.path().read_bytes().decode()  # line ends as they are


NASTY = [
    "</script><script>window.hacked = 1</script>",
    '"><img src=x onerror="window.hacked = 1">',
    "' onload='window.hacked = 1",
    "<b>bold</b> & &amp;",
    *("🏺 vase 👩‍👩‍👧", "מוזיאון abc", "{{ 7 * 7 }}", "${window.hacked = 1}"),
]


def nasty_graph(back):
    """A dock, and ways to nodes with labels that a careless page would execute."""
    graph = nx.DiGraph(title=NASTY[0])
    graph.add_node("dock", reward=0)
    for label in NASTY:
        graph.add_node(label, reward=1)
        graph.add_edge("dock", label, survival=0.9)
        graph.add_edge(label, "dock", survival=back)
    return graph


def plain(text):
    """Remove the marks that keep the direction of labels apart."""
    return text.replace("\u2068", "").replace("\u2069", "")
