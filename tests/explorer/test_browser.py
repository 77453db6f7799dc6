"""The page in a browser: what readers do with it, and that each number is the library's."""

import csv
import io
import json
import math
import re
import xml.etree.ElementTree as ET
from decimal import Decimal
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest

pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
from playwright.sync_api import expect

from botohe_moo import Mission, load_mission
from botohe_moo.decide import compare, plan_csv, plan_geojson, plan_json
from botohe_moo.decide.wishes import MAX_OUTCOMES, N_SAMPLES, SEED
from botohe_moo.explorer import explore
from botohe_moo.explorer.data import sentence
from botohe_moo.outcomes import plan_outcomes, reach_probabilities
from tests.decide.made import MISSION, PLANS
from tests.explorer.conftest import FILLED, solution_of, toy_plans

pytestmark = pytest.mark.slow
WIDTHS = pytest.mark.parametrize(
    "viewport", [{"width": 1280, "height": 900}, {"width": 390, "height": 844}], ids=["wide", "390"]
)


def shows(page, plan):
    """Wait until a plan is at hand."""
    expect(page.locator("#at-hand")).to_have_text(re.compile(rf"Plan {plan}\b.*"))


def at_hand(page):
    return int(re.match(r"Plan (\d+)", page.inner_text("#at-hand"))[1])


def pinned(page):
    return [int(text.split()[-1]) for text in page.locator("#cards h3").all_text_contents()]


def view(page):
    return page.evaluate(
        """() => ["at-hand", "team", "cards", "compare", "matching", "robots"]
        .map((id) => document.getElementById(id).textContent)"""
    )


def downloaded(page, kind):
    with page.expect_download() as found:
        page.click(f'[data-file="{kind}"]')
    return found.value.path().read_bytes().decode()  # line ends as they are


class TestMuseum:
    @WIDTHS
    def test_walk_pin_filter_undo_reload_export(self, opened, museum, museum_page, viewport):
        mission, chosen = museum.mission, museum.choose("survivors >= 2").index
        with opened(museum_page, viewport=viewport) as page:
            assert page.inner_text("h1") == mission.title
            assert at_hand(page) == chosen
            for _ in range(3):
                page.keyboard.press("ArrowRight")  # to more reward: a lower number
            assert at_hand(page) == chosen - 3
            page.keyboard.press("Enter")
            page.wait_for_timeout(750)  # what follows is another walk
            page.keyboard.press("ArrowLeft")
            page.keyboard.press("ArrowLeft")
            page.keyboard.press("Enter")
            assert pinned(page) == [chosen - 3, chosen - 1]
            heads = page.locator("#compare thead th").all_text_contents()
            assert heads == [f"Plan {chosen - 1} (B)", f"Plan {chosen - 3} (A)"]

            pins = view(page)
            page.fill("#filter-reward", "8")
            n_met = int((museum.objectives[:, 0] >= 8).sum())
            assert page.inner_text("#matching") == f"{n_met} of {len(museum.plans)} plans"
            assert at_hand(page) == n_met - 1  # the nearest of those that meet it
            page.wait_for_timeout(200)
            shown = view(page)
            address = page.url.partition("#")[2]
            page.reload()
            page.wait_for_selector(FILLED)
            assert view(page) == shown
            page.go_back()
            expect(page.locator("#filter-reward")).to_have_value("")
            assert view(page) == pins
            page.go_back()
            expect(page.locator("#cards article")).to_have_count(1)
            assert pinned(page) == [chosen - 3]
            assert at_hand(page) == chosen - 1
            assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]

            plan = museum.plans[at_hand(page)]
            content = json.loads(downloaded(page, "json"))
            again = mission.plan(content["trails"])
            assert again == plan
            assert mission.evaluate([again]).tolist() == mission.evaluate([plan]).tolist()
        with opened(museum_page, f"#{address}") as page:
            assert view(page) == shown

    def test_files_are_those_of_the_library(self, opened, museum, museum_page):
        plan = museum.plans[30]
        with opened(museum_page, "#plan=30") as page:
            text = {kind: downloaded(page, kind) for kind in ("json", "csv", "geojson", "svg")}
        writers = {"json": plan_json, "csv": plan_csv, "geojson": plan_geojson}
        for kind, write in writers.items():
            assert text[kind] == write(museum.mission, plan)
        drawing = ET.fromstring(text["svg"])
        assert not re.search(r"var\(|color\(|class=\"point\" style", text["svg"])
        circles = drawing.findall(".//{http://www.w3.org/2000/svg}circle")
        assert len(circles) > len(museum.plans) + len(museum.mission.nodes) - 1

    def test_pointer(self, opened, museum, museum_page):
        place = """(plan) => { const box = document.querySelectorAll('#front .point')[plan]
            .getBoundingClientRect(); return [box.x + box.width / 2, box.y + box.height / 2]; }"""
        last = len(museum.plans) - 1
        with opened(museum_page, "#plan=50") as page:
            x, y = page.evaluate(place, 0)  # the plan of most survivors stands alone
            page.mouse.move(x, y)
            shows(page, last)
            assert page.evaluate("location.hash") == "#plan=50"
            page.mouse.move(5, 5)
            shows(page, 50)
            page.mouse.click(x, y)
            assert (at_hand(page), pinned(page)) == (last, [last])
            page.mouse.click(x, y)
            assert pinned(page) == []

    def test_four_plans_at_most_are_pinned(self, opened, museum_page):
        with opened(museum_page, "#plan=60&pins=10,20,30,40,50") as page:
            assert pinned(page) == [10, 20, 30, 40]
            page.keyboard.press("Enter")
            assert pinned(page) == [10, 20, 30, 40]
            assert "unpin one first" in page.inner_text("#at-hand")
            page.click('[aria-label="Unpin plan 20"]')
            assert pinned(page) == [10, 30, 40]
            assert page.evaluate("document.activeElement.id") == "pin"

    def test_filters_by_node(self, opened, museum, museum_page):
        mission = museum.mission
        node = mission.index(26)
        reached = [
            1 - np.prod(1 - reach_probabilities(mission, plan)[:, node]) for plan in museum.plans
        ]
        with opened(museum_page) as page:
            page.select_option("#filter-node", label="26")
            n = sum(value > 0 for value in reached)
            assert page.inner_text("#matching") == f"{n} of {len(reached)} plans"
            page.fill("#filter-reach", "0.3")
            n = sum(value >= 0.3 - 1e-9 for value in reached)
            assert 0 < n < len(reached)
            assert page.inner_text("#matching") == f"{n} of {len(reached)} plans"
            page.fill("#filter-survivors", "3")
            assert page.inner_text("#matching") == f"0 of {len(reached)} plans"
            assert page.inner_text("#filter-faults") == "No plan meets these filters."
            assert page.is_disabled("#walk")
            page.click("#clear")
            expect(page.locator("#matching")).to_have_text(f"{len(reached)} plans")

    def test_a_filter_that_cannot_be_is_off_and_says_so(self, opened, museum, museum_page):
        field, value, expected = "reach", "1.5", "a probability from 0 to 1"
        with opened(museum_page) as page:
            page.select_option("#filter-node", label="26")
            said = page.inner_text("#matching")
            assert said != f"0 of {len(museum.plans)} plans"
            page.fill(f"#filter-{field}", value)
            assert page.inner_text("#filter-faults") == f"Expected {expected}: this filter is off."
            assert page.get_attribute(f"#filter-{field}", "aria-invalid") == "true"
            assert page.inner_text("#matching") == said
            expect(page.locator("#status")).to_contain_text(expected)
            page.fill(f"#filter-{field}", "0.01")
            assert page.is_hidden("#filter-faults")
            assert page.get_attribute(f"#filter-{field}", "aria-invalid") == "false"

    def test_marks_and_why(self, opened, museum, museum_page):
        choice = museum.choose("survivors >= 2")
        with opened(museum_page) as page:
            assert page.locator("#why li").first.text_content() == sentence(choice.why)
            marks = " ".join(page.locator("#marks td:last-child").all_text_contents())
            for name in (
                "knee",
                "representative",
                "meets survivors >= 2",
                "nearest to reward >= 99",
            ):
                assert name in marks
            assert len(page.locator("#front .symbols path").all()) >= 5

    def test_words_are_those_of_compare(self, opened, museum, museum_page):
        with opened(museum_page, "#plan=31&pins=30") as page:
            sentences = page.locator("#words li").all_text_contents()
        said = compare(museum.mission, museum.plans[31], museum.plans[30]).sentences
        assert sentences == list(map(sentence, said))

    def test_what_the_address_cannot_mean_is_said(self, opened, museum_page):
        with opened(museum_page, "#foo&plan=abc&pins=1,2,3,4,5&reach=0.9") as page:
            said = page.inner_text("#problem")
            assert said.endswith(": foo, plan=abc, pins=1,2,3,4,5, reach=0.9.")

    def test_it_is_said_aloud_and_by_keyboard(self, opened, museum_page):
        with opened(museum_page) as page:
            page.keyboard.press("ArrowRight")
            shown = page.locator("#at-hand strong").inner_text()
            expect(page.locator("#status")).to_contain_text(shown)
            assert page.get_attribute("#status", "aria-live") == "polite"
            assert page.get_attribute("#walk", "aria-valuetext").startswith(shown)
            page.focus("#pin")
            page.keyboard.press("Space")
            assert len(pinned(page)) == 1
            outline = "getComputedStyle(document.getElementById('pin')).outlineStyle"
            assert page.evaluate(outline) == "solid"
            nameless = page.evaluate(
                """() => [...document.querySelectorAll("button, input, select, svg[role=img]")]
                .filter((one) => !(one.textContent.trim() || one.ariaLabel || one.labels?.length))
                .length"""
            )
            assert nameless == 0

    @pytest.mark.parametrize("motion", ["no-preference", "reduce"])
    def test_animation(self, opened, museum_page, motion):
        with opened(museum_page, reduced_motion=motion) as page:
            page.click("#animate")
            expect(page.locator("#map .robots g").first).to_be_attached()
            assert re.match(r"length \d+ of \d+", page.inner_text("#moment"))
            before = page.get_attribute("#map .robots g", "transform")
            if motion == "no-preference":
                there = "() => document.querySelector('#map .robots g').getAttribute('transform')"
                page.wait_for_function(f"(before) => ({there})() !== before", arg=before)
            else:
                page.wait_for_timeout(150)
                assert page.get_attribute("#map .robots g", "transform") == before
            page.keyboard.press("Escape")
            assert page.locator("#map .robots g").count() == 0


def text_of(value):
    text = f"{value:.3f}"
    if value > 0 and text == "0.000":
        return "<0.001"
    return ">0.999" if value < 1 - 1e-12 and text == "1.000" else text


COLLECT = """async () => {
    const walk = document.getElementById("walk");
    const cells = (id) => [...document.querySelectorAll(`#${id} tbody tr:not(.group)`)]
        .map((row) => [...row.cells].map((cell) => cell.textContent));
    const found = [];
    for (let place = 0; place <= Number(walk.max); place += 1) {
        walk.value = place;
        walk.dispatchEvent(new Event("input", { bubbles: true }));
        await new Promise((done) => requestAnimationFrame(() => setTimeout(done, 1)));
        const said = document.querySelector("#at-hand strong").textContent;
        const [robots, compare, nodes] = ["robots", "compare", "nodes"].map(cells);
        found.push({ said, robots, compare, nodes });
    }
    return found;
}"""


@pytest.fixture(params=["museum", "star"])
def walked(request, opened, museum, tmp_path):
    """A solution, and all that its page shows of each of its plans."""
    if request.param == "museum":
        solution = museum
        path = request.getfixturevalue("museum_page")
    else:
        solution = solution_of(MISSION, PLANS)
        path = explore(solution, tmp_path / "star.html")
    with opened(path) as page:
        return solution, page.evaluate(COLLECT)


def decimals_of(values, digits=3):
    """How many decimals a column of numbers needs, so that its largest has three digits."""
    most = max(digits - 1 - math.floor(math.log10(max(values))), 0)
    rounded = [round(Decimal(float(value)), most) for value in values]
    return next(n for n in range(most + 1) if all(round(value, n) == value for value in rounded))


def columns_of(solution):
    """Decimals of objectives, of rewards of nodes and of lengths, and what may happen to plans."""
    mission, plans = solution.mission, list(solution.plans)
    for digits in (3, 4):
        objectives = [decimals_of(column, digits) for column in solution.objectives.T]
        texts = [
            tuple(f"{value:.{n}f}" for value, n in zip(row, objectives, strict=True))
            for row in solution.objectives
        ]
        if all(one != other for one, other in pairwise(texts)):
            break
    outcomes = [
        plan_outcomes(
            mission, plan, max_outcomes=MAX_OUTCOMES, n_samples=N_SAMPLES, random_state=SEED
        )
        for plan in plans
    ]
    # The largest reward of which one can be so sure.
    safe = [
        max(v for v in one.reward.values if one.reward.at_least(v) > 0.9 - 1e-9) for one in outcomes
    ]
    facts = [safe, *([f(one.reward) for one in outcomes] for f in (median, lowest_tenth))]
    return {
        "objectives": objectives,
        "outcomes": outcomes,
        "facts": facts,
        "rewards": decimals_of(mission.rewards),
        "lengths": decimals_of(mission.trail_lengths(plans).ravel()),
    }


def median(reward):
    return reward.quantile(0.5)


def lowest_tenth(reward):
    return reward.cvar(0.1)


def first_visits(mission, plan):
    """How far the robot has come that is the first at each node, if all are as fast."""
    first = {}
    for trail in mission.labels(plan):
        length = 0.0
        for i, node in enumerate(trail):
            if i:
                length += mission.graph.edges[trail[i - 1], node].get("length", 1.0)
            index = mission.index(node)
            first[index] = min(first.get(index, length), length)
    return first


class TestNumbers:
    """Each number shown of each plan is the library's, to the digits shown."""

    def test_all_of_them(self, walked):
        solution, found = walked
        assert len(found) == len(solution.plans)
        columns = columns_of(solution)
        for shown in found:
            self.check(solution, shown, columns)

    def check(self, solution, shown, columns):
        mission = solution.mission
        plan_id = int(re.match(r"Plan (\d+)", shown["said"])[1])
        plan = solution.plans[plan_id]
        reward, survivors = mission.evaluate([plan])[0]
        in_reward, in_survivors = columns["objectives"]
        texts = f"{reward:.{in_reward}f}", f"{survivors:.{in_survivors}f}"
        assert shown["said"] == f"Plan {plan_id}: reward {texts[0]}, survivors {texts[1]}"

        survival = mission.robot_survival([plan])[0]
        lengths = mission.trail_lengths([plan])[0]
        for row, robot, trail, alive in zip(
            shown["robots"], range(mission.robots), mission.labels(plan), survival, strict=True
        ):
            way = " → ".join(map(str, trail)) if len(trail) > 1 else "stays at base"
            length = f"{lengths[robot]:.{columns['lengths']}f}"
            assert row == [str(robot), text_of(alive), length, str(len(set(trail)) - 1), way]

        reach = reach_probabilities(mission, plan)
        reached = 1 - (1 - reach).prod(axis=0)
        visited = set(np.unique(plan.nodes)) - {mission.index(mission.base)}
        rows = {row[0]: row[1:] for row in shown["nodes"]}
        assert len(rows) == len(visited)
        first = first_visits(mission, plan)
        order = sorted(visited, key=lambda node: (first[node], node))
        assert list(rows) == [str(mission.nodes[node]) for node in order]
        for node in visited:
            robots = ", ".join(str(robot) for robot in np.flatnonzero(reach[:, node]))
            after = f"{first[node]:.{columns['lengths']}f}"
            worth = f"{mission.rewards[node]:.{columns['rewards']}f}"
            expected = [after, worth, text_of(reached[node]), robots]
            assert rows[str(mission.nodes[node])] == expected

        outcomes = columns["outcomes"][plan_id]
        rows = iter(shown["compare"])
        assert [next(rows)[1] for _ in range(2)] == list(texts)
        for column in columns["facts"]:
            assert next(rows)[1] == f"{column[plan_id]:.{in_reward}f}"
        assert next(rows)[1] == ", ".join(
            text_of(alive) for alive in sorted(survival, reverse=True)
        )
        for n in range(mission.robots + 1):
            alive = outcomes.survivors.at_least(n) - outcomes.survivors.at_least(n + 1)
            assert next(rows) == [str(n), text_of(alive)]
        bins = list(rows)
        edges = [tuple(map(float, name.split(" to "))) for name, _ in bins]
        assert edges[0][0] == 0
        assert all(one[1] == other[0] for one, other in pairwise(edges))
        assert edges[-1][1] > outcomes.reward.values[-1]
        for name, text in bins:
            low, high = map(float, name.split(" to "))
            within = (outcomes.reward.values >= low * (1 - 1e-12)) & (
                outcomes.reward.values < high * (1 - 1e-12)
            )
            assert abs(self.number(text) - outcomes.reward.probabilities[within].sum()) < 0.000501

    @staticmethod
    def number(text):
        return {"<0.001": 0.0005, ">0.999": 0.9995}.get(text) or float(text)


NASTY = [
    "</script><script>window.hacked = 1</script>",
    '"><img src=x onerror="window.hacked = 1">',
    "' onload='window.hacked = 1",
    "<b>bold</b> & &amp;",
    "🏺 vase 👩‍👩‍👧",
    "מוזיאון abc",
    "{{ 7 * 7 }}",
    "${window.hacked = 1}",
]


class TestTexts:
    @pytest.fixture
    def page_of_nasty(self, tmp_path):
        graph = nx.DiGraph()
        graph.add_node("dock", reward=0)
        for label in NASTY:
            graph.add_node(label, reward=1)
            graph.add_edge("dock", label, survival=0.9)
            graph.add_edge(label, "dock", survival=0.8)
        graph.graph["title"] = NASTY[0] + NASTY[5]
        mission = Mission(graph, base="dock", robots=2, name=NASTY[1])
        trail = ["dock", *(node for label in NASTY for node in (label, "dock"))]
        plans = [mission.plan([trail, ["dock"]]), mission.plan([["dock"], ["dock"]])]
        solution = solution_of(mission, plans)
        return mission, plans, explore(solution, tmp_path / "nasty.html", wishes=["survivors >= 1"])

    def test_labels_are_shown_and_never_executed(self, opened, page_of_nasty):
        mission, plans, path = page_of_nasty
        with opened(path, "#plan=0&pins=0,1&node=1") as page:
            assert page.evaluate("typeof window.hacked") == "undefined"
            assert page.evaluate("document.querySelector('h1').textContent") == mission.title
            names = page.locator("#nodes bdi").all_text_contents()
            assert sorted(names) == sorted(NASTY)
            shown = page.evaluate("document.querySelector('#robots td:last-child').textContent")
            assert shown.replace("\u2068", "").replace("\u2069", "").split(" → ")[1::2] == NASTY
            options = page.locator("#filter-node option").all_text_contents()
            assert options == ["any", "dock", *NASTY]
            sentences = page.evaluate("document.getElementById('words').textContent")
            assert json.dumps(NASTY[5], ensure_ascii=False) in sentences
            assert page.locator("img").count() == 0
            content = json.loads(downloaded(page, "json"))
            rows = list(csv.reader(io.StringIO(downloaded(page, "csv"))))
        assert mission.plan(content["trails"]) == plans[0]  # labels in files are as they were
        assert [row[3] for row in rows[2::2]][: len(NASTY)] == NASTY


class TestSmallFronts:
    @WIDTHS
    def test_one_plan(self, opened, tmp_path, viewport):
        path = explore(solution_of(*toy_plans([1, 2, 1])), tmp_path / "one.html")
        with opened(path, viewport=viewport) as page:
            assert at_hand(page) == 0
            page.keyboard.press("ArrowRight")
            page.keyboard.press("Enter")
            assert pinned(page) == [0]
            assert page.is_disabled("#less")
            assert page.is_disabled("#more")
            assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]

    def test_a_mission_without_positions(self, opened, tmp_path):
        graph = load_mission("toy").graph.copy()
        for node in graph:
            graph.nodes[node].pop("pos", None)
        mission = Mission(graph)
        plan = mission.plan([[1, 2, 1], [1]])
        path = explore(solution_of(mission, [plan]), tmp_path / "bare.html")
        with opened(path) as page:
            nodes = page.locator("#map .nodes").locator("circle, rect")
            assert nodes.count() == len(mission.nodes)
            assert page.is_disabled('[data-file="geojson"]')
            said = "Node 1: expected pos [x, y] for GeoJSON, found none"
            assert page.locator("#no-files").inner_text().startswith(said)
            said = "The places of the nodes on this map are made up: 5 of 5 nodes have no position."
            assert page.locator("#placing").inner_text() == said
            assert downloaded(page, "csv") == plan_csv(mission, plan)


class TestBrowsers:
    def test_one_that_cannot_unpack_is_told(self, opened, toy_page):
        with opened(toy_page, before="delete window.DecompressionStream") as page:
            assert "cannot unpack" in page.inner_text("#problem")

    def test_a_notebook_frame_works(self, opened, tmp_path):
        solution = solution_of(*toy_plans([1], [1, 2, 1], [1, 3, 2, 4, 2, 3, 1]))
        path = tmp_path / "notebook.html"
        frame = solution._repr_html_()
        path.write_text(f"<!DOCTYPE html><p id=main>{frame}", "utf-8")
        with opened(path) as page:
            inner = page.frame_locator("iframe")
            inner.locator("#at-hand strong").wait_for()
            inner.locator("#pin").click()
            assert inner.locator("#cards article").count() == 1
            assert "pins a plan." in inner.locator(".hint").inner_text()
            assert "Back" not in inner.locator(".hint").inner_text()
