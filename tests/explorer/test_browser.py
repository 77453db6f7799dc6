"""The page of a front in a browser: what readers do with it, and that it shows its data."""

import csv
import io
import json
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
from playwright.sync_api import expect

from botohe_moo import Mission, Scenario, load_mission
from botohe_moo.decide import compare, plan_csv, plan_geojson, plan_json
from botohe_moo.explorer import explore
from botohe_moo.explorer.data import page_data, probability_codes, sentence
from botohe_moo.outcomes import reach_probabilities, team_chances
from tests.decide.made import solution_of, star, trips
from tests.explorer import conftest
from tests.explorer.conftest import FILLED, NASTY, at_hand, downloaded, pinned, shows

pytestmark = pytest.mark.slow
WRITERS = {"json": plan_json, "csv": plan_csv, "geojson": plan_geojson}


def view(page):
    return page.evaluate(
        """() => ["at-hand", "team", "cards", "compare", "matching", "robots"]
        .map((id) => document.getElementById(id).textContent)"""
    )


class TestMuseum:
    @conftest.WIDTHS
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
            content = json.loads(downloaded(page, "json"))
            assert mission.plan(content["trails"]) == museum.plans[at_hand(page)]
        with opened(museum_page, f"#{address}") as page:
            assert view(page) == shown

    def test_one_plan_its_files_pins_and_what_is_said_of_it(self, opened, museum, museum_page):
        with opened(museum_page, "#plan=31&pins=30") as page:
            sentences = page.locator("#words li").all_text_contents()
            said = compare(museum.mission, museum.plans[31], museum.plans[30]).sentences
            assert sentences == list(map(sentence, said))
            for kind, write in WRITERS.items():
                assert downloaded(page, kind) == write(museum.mission, museum.plans[31])
            svg = downloaded(page, "svg")
            assert not re.search(r"var\(|color\(|class=\"point\" style", svg)
            circles = ET.fromstring(svg).findall(".//{http://www.w3.org/2000/svg}circle")
            assert len(circles) > len(museum.plans) + len(museum.mission.nodes) - 1
        with opened(museum_page, "#plan=60&pins=10,20,30,40,50") as page:
            assert pinned(page) == [10, 20, 30, 40]  # four at most
            page.keyboard.press("Enter")
            assert pinned(page) == [10, 20, 30, 40]
            assert "unpin one first" in page.inner_text("#at-hand")
            page.click('[aria-label="Unpin plan 20"]')
            assert pinned(page) == [10, 30, 40]
            assert page.evaluate("document.activeElement.id") == "pin"

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

    def test_filters_and_those_that_cannot_be(self, opened, museum, museum_page):
        node, n_plans = museum.mission.index(26), len(museum.plans)
        reach = [reach_probabilities(museum.mission, plan)[:, node] for plan in museum.plans]
        reached = 1 - np.prod(1 - np.array(reach), axis=1)
        with opened(museum_page) as page:
            page.select_option("#filter-node", label="26")
            said = f"{(reached > 0).sum()} of {n_plans} plans"
            assert page.inner_text("#matching") == said
            page.fill("#filter-reach", "1.5")
            expected = "a probability from 0 to 1"
            assert page.inner_text("#filter-faults") == f"Expected {expected}: this filter is off."
            assert page.get_attribute("#filter-reach", "aria-invalid") == "true"
            assert page.inner_text("#matching") == said
            expect(page.locator("#status")).to_contain_text(expected)
            page.fill("#filter-reach", "0.3")
            assert page.is_hidden("#filter-faults")
            assert page.get_attribute("#filter-reach", "aria-invalid") == "false"
            n = (reached >= 0.3 - 1e-9).sum()
            assert 0 < n < n_plans
            assert page.inner_text("#matching") == f"{n} of {n_plans} plans"
            page.fill("#filter-survivors", "3")
            assert page.inner_text("#matching") == f"0 of {n_plans} plans"
            assert page.inner_text("#filter-faults") == "No plan meets these filters."
            assert page.is_disabled("#walk")
            page.click("#clear")
            expect(page.locator("#matching")).to_have_text(f"{n_plans} plans")
        with opened(museum_page, "#foo&plan=abc&pins=1,2,3,4,5&reach=0.9") as page:
            said = page.inner_text("#problem")
            assert said.endswith(": foo, plan=abc, pins=1,2,3,4,5, reach=0.9.")

    def test_marked_plans_are_reached_by_click_and_by_key(self, opened, museum, museum_page):
        with opened(museum_page) as page:
            choice = museum.choose("survivors >= 2")
            assert page.locator("#why li").first.text_content() == sentence(choice.why)
            marks = " ".join(page.locator("#marks td:last-child").all_text_contents())
            wishes = ("meets survivors >= 2", "nearest to reward >= 99")
            assert all(name in marks for name in ("knee", "representative", *wishes))
            assert len(page.locator("#front .symbols path").all()) >= 5
            rows = page.locator("#marks tbody tr")
            for i in (0, 2):
                row = rows.nth(i)
                button = row.locator("button")
                if i:
                    button.focus()
                    page.keyboard.press("Enter")
                else:
                    row.locator("td").last.click()
                plan = int(re.search(r"\d+", row.locator("th").inner_text())[0])
                shows(page, plan)
                assert button.get_attribute("aria-current") == "true"
                assert page.locator('#marks [aria-current="true"]').count() == 1
                reward, survivors, why = row.locator("td").all_inner_texts()
                said = page.inner_text("#at-hand strong")
                assert said == f"Plan {plan}: reward {reward}, survivors {survivors}"
                assert page.locator("#at-hand .tag").all_inner_texts() == why.split("; ")

    def test_it_is_said_aloud_and_by_keyboard(self, opened, museum_page):
        with opened(museum_page, "#plan=1") as page:
            page.focus("#more")
            for _ in range(2):  # the second does nothing
                page.keyboard.press("Enter")
                shows(page, 0)
                assert page.get_attribute("#more", "aria-disabled") == "true"
                assert page.evaluate("document.activeElement.id") == "more"
            page.focus("#less")
            page.keyboard.press("Space")
            shows(page, 1)
            assert page.get_attribute("#more", "aria-disabled") == "false"
            shown = page.locator("#at-hand strong").inner_text()
            expect(page.locator("#status")).to_contain_text(shown)
            assert page.get_attribute("#status", "aria-live") == "polite"
            assert page.get_attribute("#walk", "aria-valuetext").startswith(shown)
            page.focus("#pin")
            page.keyboard.press("Space")
            assert len(pinned(page)) == 1
            outline = "getComputedStyle(document.getElementById('pin')).outlineStyle"
            assert page.evaluate(outline) == "solid"
            assert page.evaluate(conftest.NAMELESS) == 0


ROWS = """(id) => [...document.querySelectorAll(`#${id} tbody tr:not(.group)`)]
    .map((row) => [...row.cells].map((cell) => cell.textContent))"""


def text_of(code):
    """What a code of a probability means."""
    return {1001: "<0.001", 1002: ">0.999"}.get(code, f"{code / 1000:.3f}")


def test_each_number_of_a_plan_is_that_of_the_data(opened, museum, museum_page):
    """Which are the library's: see test_data.py."""
    mission, data = museum.mission, page_data(museum, ["survivors >= 2", "reward >= 99"])
    with opened(museum_page) as page:
        for row in (3, len(museum.plans) // 2, len(museum.plans) - 4):
            page.evaluate("(address) => { location.hash = address; }", f"plan={row}")
            shows(page, row)
            robots, compared, nodes = (
                page.evaluate(ROWS, x) for x in ("robots", "compare", "nodes")
            )
            place, plan = data["ids"].index(row), museum.plans[row]
            trails, reach = data["plans"][place], reach_probabilities(mission, plan)
            reward, survivors = (column[place] for column in data["objective_texts"])
            said = f"Plan {row}: reward {reward}, survivors {survivors}"
            assert page.inner_text("#at-hand strong") == said
            alive = [text_of(data["trail_codes"][trail]) for trail in trails]
            for robot, trail in enumerate(mission.labels(plan)):
                way = " → ".join(map(str, trail)) if len(trail) > 1 else "stays at base"
                length, n = data["trail_length_texts"][trails[robot]], str(len(set(trail)) - 1)
                assert robots[robot] == [str(robot), alive[robot], length, n, way]
            visited = np.unique(plan.nodes).tolist()
            assert {cells[0] for cells in nodes} == {str(mission.nodes[v]) for v in visited[1:]}
            for cells in nodes:
                index = mission.index(int(cells[0]))
                those = ", ".join(str(robot) for robot in np.flatnonzero(reach[:, index]))
                reached = text_of(data["reached"][place][visited.index(index)])
                first = min(trail.index(index) for trail in plan.trails if index in trail)
                assert cells[1:] == [str(first), data["reward_texts"][index], reached, those]
            facts = [column[place] for column in data["facts"].values()]
            chances = map(text_of, (*data["survivors"][place], *data["rewards_in"][place]))
            best_first = ", ".join(sorted(alive, reverse=True))
            expected = [reward, survivors, *facts, best_first, *chances]
            assert [cells[1] for cells in compared] == expected
            assert [cells[0] for cells in compared][-len(data["bins"]) :] == data["bins"]


def test_labels_are_shown_and_never_executed(opened, tmp_path):
    mission = Mission(conftest.nasty_graph(back=0.8), base="dock", robots=2, name=NASTY[1])
    trail = ["dock", *(node for label in NASTY for node in (label, "dock"))]
    plans = [mission.plan([trail, ["dock"]]), mission.plan([["dock"], ["dock"]])]
    solution = solution_of(mission, plans)
    path = explore(solution, tmp_path / "nasty.html", wishes=["survivors >= 1"])
    with opened(path, "#plan=0&pins=0,1&node=1") as page:
        assert page.evaluate("typeof window.hacked") == "undefined"
        assert page.evaluate("document.querySelector('h1').textContent") == mission.title
        assert sorted(page.locator("#nodes bdi").all_text_contents()) == sorted(NASTY)
        shown = page.evaluate("document.querySelector('#robots td:last-child').textContent")
        assert conftest.plain(shown).split(" → ")[1::2] == NASTY
        options = page.locator("#filter-node option").all_text_contents()
        assert options == ["any", "dock", *NASTY]
        sentences = page.evaluate("document.getElementById('words').textContent")
        assert json.dumps(NASTY[5], ensure_ascii=False) in sentences
        assert page.locator("img").count() == 0
        content = json.loads(downloaded(page, "json"))
        rows = list(csv.reader(io.StringIO(downloaded(page, "csv"))))
    assert mission.plan(content["trails"]) == plans[0]  # labels in files are as they were
    assert [row[3] for row in rows[2::2]][: len(NASTY)] == NASTY


def test_one_plan_of_a_mission_without_positions(opened, tmp_path):
    mission, plan = star(), trips(star(), "a")
    path = explore(solution_of(mission, [plan]), tmp_path / "bare.html")
    with opened(path, viewport={"width": 390, "height": 844}) as page:
        assert at_hand(page) == 0
        page.keyboard.press("ArrowRight")
        page.keyboard.press("Enter")
        assert pinned(page) == [0]
        assert page.is_disabled("#less")
        assert page.is_disabled("#more")
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        nodes = page.locator("#map .nodes").locator("circle, rect")
        assert nodes.count() == len(mission.nodes)
        assert page.is_disabled('[data-file="geojson"]')
        said = "Node 'dock': expected pos [x, y] for GeoJSON, found none"
        assert page.locator("#no-files").inner_text().startswith(said)
        said = "The places of the nodes on this map are made up: 4 of 4 nodes have no position."
        assert page.locator("#placing").inner_text() == said
        assert downloaded(page, "csv") == plan_csv(mission, plan)


def test_a_browser_that_cannot_unpack_is_told(opened, toy_page):
    with opened(toy_page, before="delete window.DecompressionStream") as page:
        assert "cannot unpack" in page.inner_text("#problem")


def test_a_notebook_frame_works(opened, tmp_path):
    solution = solution_of(*conftest.toy_plans([1], [1, 2, 1], [1, 3, 2, 4, 2, 3, 1]))
    path = tmp_path / "notebook.html"
    path.write_text(f"<!DOCTYPE html><p id=main>{solution._repr_html_()}", "utf-8")
    with opened(path) as page:
        inner = page.frame_locator("iframe")
        inner.locator("#at-hand strong").wait_for()
        inner.locator("#pin").click()
        assert inner.locator("#cards article").count() == 1
        assert "pins a plan." in inner.locator(".hint").inner_text()
        assert "Back" not in inner.locator(".hint").inner_text()


def test_kinds_of_robots(opened, tmp_path):
    solution, names = conftest.kinds_solution(), ["drone 0", "drone 1", "rover 2"]
    path = explore(solution, tmp_path / "kinds.html")
    with opened(path, "#plan=0") as page:
        assert page.locator("#team button").all_inner_texts() == names
        assert page.locator("#map .badges text").all_text_contents() == names[:2]
        looks = page.locator("#map .trail").evaluate_all(
            "paths => paths.map((p) => [p.style.stroke, p.getAttribute('stroke-dasharray')])"
        )
        assert looks == [["var(--robot-0)", None], ["var(--robot-0)", "12 4"]]
        head = page.locator("#robots thead th").all_text_contents()
        assert head == ["robot", "kind", "survives", "brings alone", "length", "nodes", "trail"]
        first, _, last = page.locator("#robots tbody tr").all()
        cells = first.locator("td").all_text_contents()
        assert cells == ["drone", "0.225", "1.12", "3", "3", "roof → pond → hall → dock"]
        assert last.locator("td").all_text_contents()[-1] == "stays at base"
        label = page.get_attribute("#map", "aria-label")
        assert label.startswith("Map of Plan 0: drone 0 visits 3 nodes, ")
        assert page.locator("#map .ends path").count() == 3  # two starts, and one other end
        assert "pond150.5000.225drone 0" in page.locator("#nodes tbody tr").all_text_contents()
        marks = (".base", "circle >> nth=0", "circle >> nth=1")
        boxes = [page.locator(f"#map .nodes {mark}").bounding_box() for mark in marks]
        base, hall, pond = ((b["x"] + b["width"] / 2, b["y"] + b["height"] / 2) for b in boxes)
        for (x, y), (to_x, to_y), said in (
            (pond, pond, "reward 5, reached with 0.500; pays on return, rover cannot collect it"),
            (base, hall, "drone survives with 0.900, rover survives with 0.800"),
            (pond, hall, "drone survives with 0.500, not for rover"),
        ):
            page.mouse.move((x + to_x) / 2, (y + to_y) / 2)
            assert page.inner_text("#node").partition(": ")[2] == said
        for kind, write in WRITERS.items():
            assert downloaded(page, kind) == write(solution.mission, solution.plans[0])


def test_a_scenario_is_shown(opened, tmp_path):
    """With a storm, arcs, trails and nodes are as they are in it; all else stays the mean."""
    mission = Mission(load_mission("toy").graph, scenarios=[Scenario("storm", 0.25, factor=3)])
    plan = mission.plan([[1, 2, 4, 2, 1], [1, 3, 1]])

    def shown(page):
        rows = "rows => rows.map((row) => [row.cells[0].textContent, row.cells[3].textContent])"
        return (
            page.locator("#robots tbody td:nth-child(2)").all_text_contents(),
            dict(page.locator("#nodes tbody tr").evaluate_all(rows)),
            page.locator("#riskiest").text_content(),
        )

    def expected(one):
        alive = probability_codes(one.robot_survival([plan])[0])
        reach = probability_codes(team_chances(reach_probabilities, one, plan))
        [riskiest] = probability_codes([one.world.graph.mean_survival.min()])
        visited = set(plan.nodes.tolist()) - {0}
        return (
            [*map(text_of, alive)],
            {str(mission.nodes[node]): text_of(reach[node]) for node in visited},
            text_of(riskiest),
        )

    with opened(explore(solution_of(mission, [plan]), tmp_path / "scenarios.html")) as page:
        chances = page.locator("#scenario option").all_text_contents()[1:]
        assert chances == ["storm (0.250)", "otherwise (0.750)"]
        assert shown(page) == expected(mission)
        for name, chance in zip(("storm", "otherwise"), chances, strict=True):
            page.select_option("#scenario", label=chance)
            assert shown(page) == expected(mission.in_scenario(name))
            assert page.url.endswith(f"scenario={name}")
        page.reload()
        page.wait_for_selector(FILLED)
        assert shown(page) == expected(mission.in_scenario("otherwise"))
        page.go_back()
        assert shown(page) == expected(mission.in_scenario("storm"))
        compared = page.locator("#compare tr").all()
        facts = [row.locator("th, td").all_text_contents() for row in compared]
        [reward] = [
            float(cells[1]) for cells in facts if cells[0] == "Expected reward in scenario storm"
        ]
        assert reward == pytest.approx(
            mission.in_scenario("storm").evaluate([plan])[0, 0], abs=0.01
        )
