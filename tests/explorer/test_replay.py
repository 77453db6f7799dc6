"""The replay of a mission in a browser; its data are tested with those of the other page."""

import pytest

pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
from playwright.sync_api import expect

from botohe_moo import Mission
from botohe_moo.explorer import replay
from botohe_moo.underway import play_mission
from tests.explorer.conftest import NAMELESS, NASTY, WIDTHS, nasty_graph, plain
from tests.plots.made import TRAILS, mixed
from tests.underway.corner import PLAYED

pytestmark = pytest.mark.slow

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


def looks(page):
    """How the trails look that are drawn."""
    drawn = page.locator("#map path.trail").all()
    return [path.get_attribute("class").removeprefix("trail").strip() for path in drawn]


def spots(page):
    return [one.get_attribute("transform") for one in page.locator("#map .robots g").all()]


@WIDTHS
def test_robots_move_one_is_lost_and_the_plan_changes(opened, path, viewport):
    with opened(path, viewport=viewport) as page:
        assert page.inner_text("#step-title") == "Step 0 of 4"
        assert page.get_attribute("#less", "aria-disabled") == "true"
        assert looks(page) == ["", ""]
        start = spots(page)
        assert len(set(start)) == 2
        page.keyboard.press("ArrowRight")
        assert page.inner_text("#said") == PLAYED.sentences[1]
        expect(page.locator("#status")).to_have_text(PLAYED.sentences[1])
        assert page.get_attribute("#walk", "aria-valuetext") == PLAYED.sentences[1]
        label = "Map of step 1: robot 0 lost between base and lab, robot 1 at hall."
        assert page.get_attribute("#map", "aria-label") == label
        assert page.inner_text("#at-hand") == "Reward so far: 1. Robots alive: 1 of 2."
        # Robot 1: where it was, the old way home, and the new way; nothing of robot 0.
        assert looks(page) == ["walked", "old", ""]
        assert not set(spots(page)) & set(start)
        assert page.locator("#map .crosses path").count() == 1
        assert page.locator("#map .robots .lost").all_text_contents() == ["0"]
        rows = page.locator("#robots tbody tr").all_text_contents()
        assert rows == ["0lost between base and lab", "1at hallbase → lab → base"]
        lost, _ = spots(page)
        page.click("#more")
        assert looks(page) == ["walked", ""]
        assert spots(page)[0] == lost
        assert page.locator("#map .nodes :not(.unreached)").count() == 2
        page.keyboard.press("ArrowLeft")
        assert looks(page) == ["walked", "old", ""]
        assert page.evaluate("location.hash") == "#step=1"
        page.click("text=Step 4: robot 1 lost")
        assert page.inner_text("#said") == PLAYED.sentences[4]
        assert page.locator("#map .crosses path").count() == 2
        assert page.get_attribute("#more", "aria-disabled") == "true"
        assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]
        page.focus("#walk")
        page.keyboard.press("Home")
        assert page.inner_text("#step-title") == "Step 0 of 4"
        assert page.evaluate(NAMELESS) == 0


@pytest.mark.parametrize("motion", ["no-preference", "reduce"])
def test_it_plays_by_the_space_bar(opened, path, motion):
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


def test_a_mission_of_kinds_and_one_in_which_nobody_leaves(opened, tmp_path):
    mission = mixed()
    played = play_mission(mission, mission.plan(TRAILS), "arrivals", price=0)
    with opened(replay(played, tmp_path / "kinds.html")) as page:
        head = page.locator("#robots thead th").all_text_contents()
        assert head == ["robot", "kind", "is", "is to go to"]
        rows = page.locator("#robots tbody tr").all_text_contents()
        assert rows[0] == "0droneat roofpond → hall → dock"
        assert page.locator("#map .ends path").count() == 3
    played = play_mission(PLAYED.mission, PLAYED.mission.stay_home(), price=1)
    with opened(replay(played, tmp_path / "home.html")) as page:
        for key in ("Space", "ArrowRight"):
            page.keyboard.press(key)
            assert page.inner_text("#step-title") == "Step 0 of 0"
        assert page.inner_text("#said") == played.sentences[0]


def test_labels_are_shown_and_never_executed_even_without_places(opened, tmp_path):
    mission = Mission(nasty_graph(back=1e-9), base="dock", robots=len(NASTY))
    played = play_mission(mission, mission.plan([["dock", x, "dock"] for x in NASTY]), price=1)
    with opened(replay(played, tmp_path / "nasty.html"), "#step=2") as page:
        assert page.evaluate("typeof window.hacked") == "undefined"
        assert page.locator("img").count() == 0
        assert page.locator("#placing").inner_text().startswith("The places of the nodes")
        where = page.locator("#robots .where").all_text_contents()
        assert all(label in plain(text) for text, label in zip(where, NASTY, strict=True))
