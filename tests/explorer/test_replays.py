"""The replay of a mission: what is on its page, and what readers do with it."""

import networkx as nx
import pytest

pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
from playwright.sync_api import expect

from botohe_moo import Mission
from botohe_moo.explorer import replay, replay_page
from botohe_moo.explorer.data import LITTLE
from botohe_moo.explorer.page import replay_data
from botohe_moo.underway import POLICIES, play_mission
from tests.explorer.test_browser import NASTY, WIDTHS
from tests.plots.made import TRAILS, mixed
from tests.underway.corner import MISSION, NUMBER, PLAN, PLAYED


class TestData:
    """By hand: see tests.underway.corner.py."""

    DATA = replay_data(PLAYED)

    def test_trails_by_step(self):
        names = self.DATA["names"]
        trails = [
            [" ".join(names[node] for node in self.DATA["trails"][i]) for i in plan]
            for plan in self.DATA["plans"]
        ]
        assert trails == [
            ["base lab base", "base hall base"],
            *[["base lab", "base hall base lab base"]] * 4,
        ]
        assert self.DATA["at"] == [(0, 0), (0, 1), (0, 2), (0, 3), (0, 3)]
        assert self.DATA["lost"] == [(), (0,), (0,), (0,), (0, 1)]
        assert self.DATA["told"] == [1, 4]

    def test_nodes_are_filled_when_their_rewards_count(self):
        names = self.DATA["names"]
        codes = [
            dict(zip(sorted(names, key=names.index), of, strict=True))
            for of in self.DATA["reached"]
        ]
        assert codes[0] == {"base": LITTLE, "lab": 0, "hall": 0}
        assert codes[1] == codes[2] == {"base": LITTLE, "lab": 0, "hall": 1000}
        assert codes[3] == codes[4] == {"base": LITTLE, "lab": 1000, "hall": 1000}
        assert self.DATA["banked"] == ["0", "1", "1", "11", "11"]

    def test_the_same_mission_gives_the_same_page(self):
        again = play_mission(MISSION, PLAN, price=2, number=NUMBER)
        assert replay_page(again) == replay_page(PLAYED)

    def test_policies_are_said_and_losses_told(self):
        for policy, words in POLICIES.items():
            data = replay_data(play_mission(MISSION, PLAN, policy, price=2, number=NUMBER))
            assert words in data["about"]
            assert data["told"][0] == data["lost"].index((0,))


# Where robots are drawn from now on.
WATCH = """() => {
    window.seen = new Set();
    new MutationObserver((changes) => {
        for (const { target } of changes) window.seen.add(target.getAttribute("transform"));
    }).observe(document.querySelector("#map .robots"), { attributes: true, subtree: true,
        attributeFilter: ["transform"] });
}"""


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return replay(PLAYED, tmp_path_factory.mktemp("replay") / "corner.html")


@pytest.mark.slow
class TestPage:
    @staticmethod
    def looks(page):
        """How the trails look that are drawn."""
        return [
            path.get_attribute("class").removeprefix("trail").strip()
            for path in page.locator("#map path.trail").all()
        ]

    @staticmethod
    def spots(page):
        return [one.get_attribute("transform") for one in page.locator("#map .robots g").all()]

    @WIDTHS
    def test_robots_move_one_is_lost_and_the_plan_changes(self, opened, path, viewport):
        with opened(path, viewport=viewport) as page:
            assert page.inner_text("#step-title") == "Step 0 of 4"
            assert page.get_attribute("#less", "aria-disabled") == "true"
            assert self.looks(page) == ["", ""]
            start = self.spots(page)
            assert len(set(start)) == 2
            page.keyboard.press("ArrowRight")
            assert page.inner_text("#said") == PLAYED.sentences[1]
            assert page.inner_text("#at-hand") == "Reward so far: 1. Robots alive: 1 of 2."
            # Robot 1: where it was, the old way home, and the new way; nothing of robot 0.
            assert self.looks(page) == ["walked", "old", ""]
            assert not set(self.spots(page)) & set(start)
            assert page.locator("#map .crosses path").count() == 1
            assert page.locator("#map .robots .lost").all_text_contents() == ["0"]
            rows = page.locator("#robots tbody tr").all_text_contents()
            assert rows == ["0lost between base and lab", "1at hallbase → lab → base"]
            lost, _ = self.spots(page)
            page.click("#more")
            assert self.looks(page) == ["walked", ""]
            assert self.spots(page)[0] == lost
            filled = page.locator("#map .nodes :not(.unreached)")
            assert filled.count() == 2
            page.keyboard.press("ArrowLeft")
            assert self.looks(page) == ["walked", "old", ""]
            assert page.evaluate("location.hash") == "#step=1"
            page.click("text=Step 4: robot 1 lost")
            assert page.inner_text("#said") == PLAYED.sentences[4]
            assert page.locator("#map .crosses path").count() == 2
            assert page.get_attribute("#more", "aria-disabled") == "true"
            assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]

    @pytest.mark.parametrize("motion", ["no-preference", "reduce"])
    def test_it_plays_by_the_space_bar(self, opened, path, motion):
        with opened(path, "#step=2", reduced_motion=motion) as page:
            page.evaluate(WATCH)
            page.keyboard.press("Space")
            assert page.inner_text("#play") == "Stop"
            expect(page.locator("#play")).to_have_text("Play")
            assert page.inner_text("#step-title") == "Step 4 of 4"
            places = page.evaluate("[...window.seen]")
            assert (len(places) <= 4) == (motion == "reduce")  # two robots, two steps
            page.keyboard.press("Space")  # from the start
            page.keyboard.press("Escape")
            assert page.inner_text("#step-title") == "Step 0 of 4"
            assert page.inner_text("#play") == "Play"

    def test_a_mission_in_which_nobody_leaves(self, opened, tmp_path):
        played = play_mission(PLAYED.mission, PLAYED.mission.stay_home(), price=1)
        with opened(replay(played, tmp_path / "home.html")) as page:
            for key in ("Space", "ArrowRight"):
                page.keyboard.press(key)
                assert page.inner_text("#step-title") == "Step 0 of 0"
            assert page.inner_text("#said") == played.sentences[0]

    def test_it_is_said_aloud_and_controls_have_names(self, opened, path):
        with opened(path, "#step=1") as page:
            expect(page.locator("#status")).to_have_text(PLAYED.sentences[1])
            assert page.get_attribute("#walk", "aria-valuetext") == PLAYED.sentences[1]
            label = "Map of step 1: robot 0 lost between base and lab, robot 1 at hall."
            assert page.get_attribute("#map", "aria-label") == label
            page.focus("#walk")
            page.keyboard.press("End")
            assert page.inner_text("#step-title") == "Step 4 of 4"
            nameless = page.evaluate(
                """() => [...document.querySelectorAll("button, input, svg[role=img]")]
                .filter((one) => !(one.textContent.trim() || one.ariaLabel)).length"""
            )
            assert nameless == 0

    def test_kinds_of_robots(self, opened, tmp_path):
        mission = mixed()
        played = play_mission(mission, mission.plan(TRAILS), "arrivals", price=0)
        with opened(replay(played, tmp_path / "kinds.html")) as page:
            head = page.locator("#robots thead th").all_text_contents()
            assert head == ["robot", "kind", "is", "is to go to"]
            rows = page.locator("#robots tbody tr").all_text_contents()
            assert rows[0] == "0droneat roofpond → hall → dock"
            assert page.locator("#map .ends path").count() == 3

    def test_labels_are_shown_and_never_executed_even_without_places(self, opened, tmp_path):
        graph = nx.DiGraph()
        graph.add_node("dock", reward=0)
        for label in NASTY:
            graph.add_node(label, reward=1)
            graph.add_edge("dock", label, survival=0.9)
            graph.add_edge(label, "dock", survival=1e-9)
        graph.graph["title"] = NASTY[0]
        mission = Mission(graph, base="dock", robots=len(NASTY))
        plan = mission.plan([["dock", label, "dock"] for label in NASTY])
        played = play_mission(mission, plan, price=1)
        with opened(replay(played, tmp_path / "nasty.html"), "#step=2") as page:
            assert page.evaluate("typeof window.hacked") == "undefined"
            assert page.locator("img").count() == 0
            assert page.locator("#placing").inner_text().startswith("The places of the nodes")
            where = page.locator("#robots .where").all_text_contents()
            for text, label in zip(where, NASTY, strict=True):
                assert label in text.replace("\u2068", "").replace("\u2069", "")
