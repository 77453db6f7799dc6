"""Controls that switch off keep the focus; the map says which names it does not show."""

import re

import networkx as nx
import numpy as np
import pytest

pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
from playwright.sync_api import expect

from botohe_moo import Mission
from botohe_moo.explorer import explore
from tests.explorer.conftest import FILLED, solution_of
from tests.explorer.test_browser import WIDTHS, at_hand, shows


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
    @pytest.mark.parametrize(("button", "start", "end"), [("more", 1, 0), ("less", -2, -1)])
    def test_at_the_ends_of_the_front(self, opened, museum, museum_page, button, start, end):
        start, end = (range(len(museum.plans))[i] for i in (start, end))
        with opened(museum_page, f"#plan={start}") as page:
            page.focus(f"#{button}")
            for _ in range(2):  # the second does nothing
                page.keyboard.press("Enter")
                shows(page, end)
                assert page.get_attribute(f"#{button}", "aria-disabled") == "true"
                assert focused(page) == button
            page.focus("#less" if button == "more" else "#more")
            page.keyboard.press("Space")
            shows(page, start)
            assert page.get_attribute(f"#{button}", "aria-disabled") == "false"

    def test_on_the_largest_and_the_smallest_map(self, opened, museum_page):
        with opened(museum_page) as page:
            for button, widths in (("larger", (2, 4, 8, 8)), ("smaller", (4, 2, 1, 1))):
                page.focus(f"#{button}")
                for width in widths:
                    page.keyboard.press("Enter")
                    frame = page.locator(".frame").bounding_box()["width"]
                    found = page.locator("#map").bounding_box()["width"]
                    assert found == pytest.approx(width * frame, rel=0.02)
                    assert focused(page) == button

    def test_where_nothing_can_be_animated_or_written(self, opened, tmp_path):
        mission = site({"dock": (0, 0), "near": (1, 0), "far": None})
        trails = (["dock"], ["dock", "near", "dock"], ["dock", "near", "far", "dock"])
        solution = solution_of(mission, [mission.plan([trail]) for trail in trails])
        with opened(explore(solution, tmp_path / "near.html"), "#plan=1") as page:
            page.focus("#animate")
            page.keyboard.press("ArrowLeft")
            shows(page, 2)  # stays at base
            assert page.is_disabled("#animate")
            page.keyboard.press("Enter")
            assert page.inner_text("#animate") == "Animate"
            assert focused(page) == "animate"
            downloads = []
            page.on("download", lambda download: downloads.append(download.url))
            page.focus('[data-file="geojson"]')
            page.keyboard.press("ArrowRight")
            page.keyboard.press("ArrowRight")
            shows(page, 0)
            expect(page.locator("#no-files")).to_contain_text("node far has none")
            page.keyboard.press("Enter")
            assert focused(page) == "geojson"
            page.wait_for_timeout(200)
            assert downloads == []
            page.keyboard.press("ArrowLeft")
            expect(page.locator('[data-file="geojson"]')).to_be_enabled()
            with page.expect_download():
                page.keyboard.press("Enter")

    @pytest.mark.parametrize(
        ("field", "address"), [("walk", "reward=9999"), ("filter-reach", "plan=50")]
    )
    def test_of_fields_that_an_address_switches_off(self, opened, museum_page, field, address):
        with opened(museum_page, "#plan=50&node=3&reach=0.5") as page:
            page.focus(f"#{field}")
            go_to(page, address)
            expect(page.locator(f"#{field}")).to_be_disabled()
            page.keyboard.press("1")
            page.keyboard.press("ArrowLeft")
            assert focused(page) == field
            if field == "filter-reach":
                assert page.input_value("#filter-reach") == ""


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
                n_now = 60 - len(drawn_names(page))
                said = f"Names of {n_now} of 60 nodes have no room on the map: point at "
                told = page.inner_text("#unnamed")
                assert told.startswith(said) if n_now else told == ""
                assert n_now < n_left
                n_left = n_now
                page.click("#larger")
            assert n_left < 10

    def test_nothing_is_said_where_all_nodes_are_named(self, opened, tmp_path):
        mission = site({"dock": (0, 0), "a": (1, 0), "b": (0, 1)})
        solution = solution_of(mission, [mission.plan([["dock", "a", "dock"]])])
        with opened(explore(solution, tmp_path / "few.html")) as page:
            assert sorted(drawn_names(page)) == ["a", "b", "dock"]
            assert page.is_hidden("#unnamed")

    @pytest.mark.parametrize("touch", [False, True])
    def test_pointing_tells_the_name_and_what_the_plan_has(self, opened, crowded, touch):
        names, path = crowded
        viewport = {"width": 390, "height": 844} if touch else {"width": 1280, "height": 900}
        with opened(path, "#plan=0", viewport=viewport, has_touch=touch) as page:
            shown = drawn_names(page)
            name = next(n for n in names[51:] if n not in shown)  # that plan 0 reaches
            at = where(page, name, names)
            (page.touchscreen.tap if touch else page.mouse.move)(*at)
            told = page.locator("#node")
            for plan in (0, 1, 2, 3):
                go_to(page, f"plan={plan}")
                shows(page, plan)
                page.evaluate("document.getElementById('nodes-details').open = true")
                page.wait_for_timeout(100)
                rows = page.locator("#nodes tbody tr").all()
                found = {row.locator("th").inner_text(): row.locator("td").nth(1) for row in rows}
                reached = found[name].inner_text() if name in found else "0.000"
                expect(told).to_have_text(f"{name}: reward 1, reached with {reached}")

    def test_numbers_of_robots_keep_off_names(self, opened, tmp_path):
        # "gallery" stands left of the middle of the longest arc, and its name lies on that middle.
        places = {"dock": (0, 0), "far": (10, 0), "side": (8, 3), "the long gallery": (4, 0)}
        mission = site(places)
        plan = mission.plan([["dock", "far", "side", "dock"]])
        with opened(explore(solution_of(mission, [plan]), tmp_path / "long.html")) as page:
            assert "the long gallery" in drawn_names(page)
            [badge] = page.locator("#map .badges circle").all()
            one = badge.bounding_box()
            for name in page.locator("#map .names text").all():
                other = name.bounding_box()
                apart = [
                    one[x] >= other[x] + other[size] or other[x] >= one[x] + one[size]
                    for x, size in (("x", "width"), ("y", "height"))
                ]
                assert any(apart), name.text_content()


class TestAddress:
    @pytest.mark.parametrize("address", ["plan=3&reach=0.9", "plan=3&reach=0.9&reward=1"])
    def test_a_probability_needs_its_node(self, opened, museum_page, address):
        with opened(museum_page, f"#{address}") as page:
            assert page.inner_text("#problem").endswith("part of its address: reach=0.9.")
            assert at_hand(page) == 3
            assert page.input_value("#filter-reach") == ""

    def test_any_node_is_in_no_address_with_a_probability(self, opened, museum_page):
        with opened(museum_page, "#plan=50&node=3&reach=0.5") as page:
            page.select_option("#filter-node", label="any")
            assert re.search(r"#plan=50$", page.url)
            page.reload()
            page.wait_for_selector(FILLED)
            assert page.is_hidden("#problem")
            page.go_back()
            expect(page.locator("#filter-reach")).to_have_value("0.5")


def test_narrow_pages_start_with_what_is_secondary_closed(opened, museum_page):
    for width, is_open in ((390, False), (1280, True)):
        with opened(museum_page, viewport={"width": width, "height": 844}) as page:
            for one in ("#key", "#nodes-details"):
                details = page.locator(one)
                assert details.evaluate("(one) => one.open") is is_open
                if not is_open:
                    details.locator("summary").click()
            expect(page.locator("#nodes tbody tr").first).to_be_visible()
            assert "The square is the base." in page.inner_text("#key")
