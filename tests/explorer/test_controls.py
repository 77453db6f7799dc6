"""Controls that switch off keep the focus; the map says which names it does not show."""

import networkx as nx
import numpy as np
import pytest

pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
from playwright.sync_api import expect

from botohe_moo import Mission
from botohe_moo.explorer import explore
from tests.explorer.conftest import solution_of
from tests.explorer.test_browser import WIDTHS, shows

pytestmark = pytest.mark.slow


def site(places, base="dock", robots=1):
    """A mission on which one can go from each node to each other one; None is no position."""
    graph = nx.complete_graph(len(places), nx.DiGraph)
    nx.set_edge_attributes(graph, 0.99, "survival")
    nx.set_node_attributes(graph, 1, "reward")
    given = {i: place for i, place in enumerate(places.values()) if place is not None}
    nx.set_node_attributes(graph, given, "pos")
    return Mission(nx.relabel_nodes(graph, dict(enumerate(places))), base=base, robots=robots)


def focused(page):
    return page.evaluate("document.activeElement.id || document.activeElement.dataset.file")


def go_to(page, address):
    page.evaluate("(address) => { location.hash = address; }", address)


class TestFocus:
    def test_at_the_end_of_the_front(self, opened, museum_page):
        with opened(museum_page, "#plan=1") as page:
            page.focus("#more")
            for _ in range(2):  # the second does nothing
                page.keyboard.press("Enter")
                shows(page, 0)
                assert page.get_attribute("#more", "aria-disabled") == "true"
                assert focused(page) == "more"
            page.focus("#less")
            page.keyboard.press("Space")
            shows(page, 1)
            assert page.get_attribute("#more", "aria-disabled") == "false"


@pytest.fixture(scope="module")
def crowded(tmp_path_factory):
    """Sixty nodes of long names, closer than there is room for."""
    places = np.random.default_rng(4).uniform(0, 100, (60, 2)).tolist()
    names = ["dock", *(f"Chamber number {i}" for i in range(1, 60))]
    mission = site(dict(zip(names, places, strict=True)))
    trails = (names[51:], names[20:26], names[40:43])
    plans = [mission.plan([["dock", *trail, "dock"]]) for trail in trails]
    solution = solution_of(mission, [*plans, mission.plan([["dock"]])])
    return names, explore(solution, tmp_path_factory.mktemp("explorer") / "crowded.html")


def drawn_names(page):
    return page.locator("#map .names text").all_text_contents()


def where(page, name, names):
    """The middle of a node on the screen, once it is in view."""
    node = page.locator("#map .nodes circle").nth(names.index(name) - 1)  # the base is a square
    node.scroll_into_view_if_needed()
    box = node.bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


class TestNames:
    @WIDTHS
    def test_names_without_room_are_counted(self, opened, crowded, viewport):
        names, path = crowded
        with opened(path, viewport=viewport) as page:
            n_left = 60
            while page.is_enabled("#larger"):
                assert set(drawn_names(page)) <= set(names)
                n_hidden = 60 - len(drawn_names(page))
                said = f"Names of {n_hidden} of 60 nodes have no room on the map: point at "
                text = page.inner_text("#unnamed")
                assert text.startswith(said) if n_hidden else text == ""
                assert n_hidden < n_left or n_hidden == 0
                n_left = n_hidden
                page.click("#larger")
            assert n_left < 10

    @pytest.mark.parametrize("touch", [False, True])
    def test_pointing_tells_the_name_and_what_the_plan_has(self, opened, crowded, touch):
        names, path = crowded
        viewport = {"width": 390, "height": 844} if touch else {"width": 1280, "height": 900}
        with opened(path, "#plan=0", viewport=viewport, has_touch=touch) as page:
            shown = drawn_names(page)
            name = next(n for n in names[51:] if n not in shown)  # that plan 0 reaches
            at = where(page, name, names)
            (page.touchscreen.tap if touch else page.mouse.move)(*at)
            text = page.locator("#node")
            for plan in (0, 1, 2, 3):
                go_to(page, f"plan={plan}")
                shows(page, plan)
                page.evaluate("document.getElementById('nodes-details').open = true")
                page.wait_for_timeout(100)
                rows = page.locator("#nodes tbody tr").all()
                found = {row.locator("th").inner_text(): row.locator("td").nth(2) for row in rows}
                reached = found[name].inner_text() if name in found else "0.000"
                expect(text).to_have_text(f"{name}: reward 1, reached with {reached}")
