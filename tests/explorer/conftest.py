"""One browser for all tests of the page, and solutions to look at."""

from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from botohe_moo import Solution, load_mission, solve
from botohe_moo.explorer import explore

CHROMIUM = Path("/usr/bin/chromium")
# Nothing but the page: no updates, no sandbox (tests may run as root), no pictures by a GPU.
ARGUMENTS = [
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"),
    *("--disable-background-networking", "--disable-component-update"),
]


FILLED = "#main:not([hidden]), #problem:not([hidden])"
"""What there is when the page has been filled, which may be after it has been loaded."""


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
    return solve("art_museum", evaluations=20_000, seed=1)


@pytest.fixture(scope="session")
def museum_page(museum, tmp_path_factory):
    path = tmp_path_factory.mktemp("explorer") / "museum.html"
    return explore(museum, path, wishes=["survivors >= 2", "reward >= 99"])


@pytest.fixture(scope="session")
def toy_page(tmp_path_factory):
    path = tmp_path_factory.mktemp("explorer") / "toy.html"
    return explore(solve("toy", evaluations=2_000, seed=1), path)


def solution_of(mission, plans):
    """A solution that has these plans."""
    objectives = mission.evaluate(plans)
    order = np.lexsort((-objectives[:, 1], -objectives[:, 0]))
    return Solution(
        mission=mission,
        plans=tuple(plans[i] for i in order),
        objectives=objectives[order],
        algorithm="by hand",
        parameters={},
        seed=0,
        evaluations=len(plans),
        seconds=None,
        interrupted=False,
    )


def toy_plans(*trails):
    mission = load_mission("toy")
    return mission, [mission.plan([trail, [1]]) for trail in trails]
