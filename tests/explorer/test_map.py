"""The map and trails: danger, names, strips, a map of the site, and robots that move."""

import base64
import io
import re

import networkx as nx
import numpy as np
import pytest
from PIL import Image

pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
from playwright.sync_api import expect

from botohe_moo import Mission, solve
from botohe_moo.explorer import explore
from tests.decide.made import solution_of
from tests.explorer.conftest import at_hand, downloaded, shows, toy_plans
from tests.plots.made import write_map

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def plant():
    """Thirty-four nodes, robots of two kinds, and trails that fill the map."""
    return solve("drones_and_rovers", evaluations=2_000, seed=1)


@pytest.fixture(scope="module")
def plant_page(plant, tmp_path_factory):
    return explore(plant, tmp_path_factory.mktemp("explorer") / "plant.html")


def along(lengths, survivals):
    """A mission of one way for each robot, out and back, with these lengths and survivals."""
    graph, trails = nx.DiGraph(), []
    for robot, (arcs, alive) in enumerate(zip(lengths, survivals, strict=True)):
        way = ["dock", *(f"{robot}-{i}" for i in range(1, len(arcs) + 1))]
        for i, node in enumerate(way[1:], start=1):
            graph.add_node(node, reward=1, pos=(100 * i, 100 * robot))
            for arc in ((way[i - 1], node), (node, way[i - 1])):
                graph.add_edge(*arc, survival=alive[i - 1], length=arcs[i - 1])
        trails.append([*way, *way[-2::-1]])
    graph.add_node("dock", reward=0, pos=(0, 50))
    mission = Mission(graph, base="dock", robots=len(trails))
    return mission, mission.plan(trails)


def test_bands_are_wider_than_trails_and_stronger_for_more_danger(opened, tmp_path):
    mission, plan = along([[1, 1, 1]], [[1.0, 0.9, 0.8]])
    path = explore(solution_of(mission, [plan]), tmp_path / "danger.html")
    with opened(path, "#pins=0") as page:
        for svg in ("#map", "#cards svg"):
            *bands, line = page.locator(f"{svg} .arcs path:not([d=''])").evaluate_all(
                """paths => paths.map((p) => ["stroke-width", "stroke-opacity"]
                .map((name) => Number(p.getAttribute(name)))
                .concat((p.getAttribute("d").match(/M/g) ?? []).length))"""
            )
            assert [n for *_, n in bands] == [1, 1, 1]
            assert line[2] == 3
            opacities = [opacity for _, opacity, _ in bands]
            assert opacities == pytest.approx([0, opacities[2] / 2, opacities[2]], rel=0.25)
            trail = float(page.locator(f"{svg} .trail").get_attribute("stroke-width"))
            assert min(wide for wide, *_ in bands) > 2 * trail
        assert page.inner_text("#safest") == "1.000"
        assert page.inner_text("#riskiest") == "0.800"


CROSSED = """() => {
    const points = [...document.querySelectorAll("#map .trail")].flatMap((path) =>
        Array.from({ length: path.getTotalLength() }, (_, i) => path.getPointAtLength(i)));
    return [...document.querySelectorAll("#map .names text")].filter((text) => {
        const [{ e, f }, box] = [text.transform.baseVal[0].matrix, text.getBBox()];
        return points.some(({ x, y }) => Math.abs(x - e) < box.width / 2 && Math.abs(y - f) < 4);
    }).map((text) => text.textContent);
}"""


class TestPlant:
    def test_names_are_beside_trails_and_drawn_above_them(self, opened, plant, plant_page):
        n_crossed = 0
        with opened(plant_page) as page:
            page.click("#more")
            for _ in range(6):
                names = page.locator("#map .names text").all_text_contents()
                assert len(names) == len(plant.mission.nodes)
                n_crossed += len(page.evaluate(CROSSED))
                page.keyboard.press("ArrowLeft")
            layers = page.locator("#map > g").evaluate_all(
                "all => all.map((g) => g.className.baseVal)"
            )
            printed = page.pdf(format="A4")
        assert n_crossed <= 6  # of 204 names
        assert layers.index("names") > layers.index("trails") > layers.index("arcs")
        assert len(re.findall(rb"/Type /Page\b", printed)) == 2

    def test_narrow_screens_and_strips_of_the_library(self, opened, plant, plant_page):
        with opened(plant_page, viewport={"width": 390, "height": 844}) as page:
            for part in ("#front", "#walk", "#at-hand", "#map"):  # on the first screen
                box = page.locator(part).bounding_box()
                assert box["y"] + box["height"] < 844, part
            plan = plant.plans[at_hand(page)]
            said = page.locator("#strips figcaption").all_text_contents()
            assert page.evaluate("document.documentElement.scrollWidth") <= 390
        survival = plant.mission.robot_survival([plan])[0]
        trails = plant.mission.labels(plan)
        leaving = [robot for robot, trail in enumerate(trails) if len(trail) > 1]
        for text, robot in zip(said, leaving, strict=True):
            assert text.startswith(f"{plant.mission.kind_of[robot].name} {robot}")
            assert f"from {trails[robot][0]}: survives with {survival[robot]:.3f}, " in text


def test_strips_are_survival_against_length_in_the_order_of_visit(opened, tmp_path):
    mission, plan = along([[100, 300], [50]], [[0.9, 0.5], [1.0]])
    home = mission.plan([mission.labels(plan)[0], ["dock"]])
    path = explore(solution_of(mission, [plan, home]), tmp_path / "strips.html")
    with opened(path, "#plan=0") as page:
        strips = page.locator("#strips figure")
        first, second = strips.all()
        said = ["robot 0", "from dock: survives with 0.203, length 800"]
        assert first.locator("figcaption").inner_text().split("\n") == said
        assert "length 100" in second.inner_text()
        names = first.locator(".labels text").all_text_contents()
        assert names == ["dock", "0-1", "0-2", "0-1", "dock"]
        way = first.locator(".alive").get_attribute("d")
        dots = np.array([point.split(",") for point in way[1:].split("L")], float)
        (left, top), (right, _) = dots[0], dots[-1]
        walked = (dots[:, 0] - left) / (right - left) * 800
        assert walked == pytest.approx([0, 100, 400, 700, 800], abs=0.2)
        drop = dots[:, 1] - top
        expected = 1 - np.array([1, 0.9, 0.45, 0.225, 0.2025])
        assert drop / drop[-1] * expected[-1] == pytest.approx(expected, abs=0.002)
        assert first.locator(".again").get_attribute("d").count("M") == 2
        strip = first.locator("svg[role]")
        scale = strip.bounding_box()["width"] / float(strip.get_attribute("viewBox").split()[2])
        high = first.bounding_box()["height"]
        # Browsers tell of a pointer with the next picture.
        strip.hover(position={"x": scale * dots[2, 0] + 1, "y": 20}, force=True)
        expect(first).to_contain_text("0-2: alive with 0.450 after 400")
        assert first.bounding_box()["height"] == high  # else it would leave the pointer
        expect(page.locator("#node")).to_contain_text("0-2: reward 1")
        expect(page.locator("#map .spot circle")).to_have_count(1)
        page.mouse.move(5, 5)
        expect(page.locator("#map .spot circle")).to_have_count(0)
        page.keyboard.press("ArrowLeft")
        expect(strips).to_have_count(1)


@pytest.fixture(scope="module")
def crowded(tmp_path_factory):
    """Sixty nodes of long names, closer than there is room for; each has an arc to each other."""
    names = ["dock", *(f"Chamber number {i}" for i in range(1, 60))]
    places = np.random.default_rng(4).uniform(0, 100, (60, 2)).tolist()
    graph = nx.complete_graph(60, nx.DiGraph)
    nx.set_edge_attributes(graph, 0.99, "survival")
    nx.set_node_attributes(graph, 1, "reward")
    nx.set_node_attributes(graph, dict(enumerate(places)), "pos")
    mission = Mission(nx.relabel_nodes(graph, dict(enumerate(names))), base="dock", robots=1)
    trails = (names[51:], names[20:26], names[40:43])
    plans = [mission.plan([["dock", *trail, "dock"]]) for trail in trails]
    solution = solution_of(mission, [*plans, mission.plan([["dock"]])])
    return names, explore(solution, tmp_path_factory.mktemp("explorer") / "crowded.html")


def drawn_names(page):
    return page.locator("#map .names text").all_text_contents()


@pytest.mark.parametrize("touch", [False, True])
def test_names_without_room_are_counted_and_told_by_pointing(opened, crowded, touch):
    names, path = crowded
    viewport = {"width": 390, "height": 844} if touch else {"width": 1280, "height": 900}
    with opened(path, "#plan=0", viewport=viewport, has_touch=touch) as page:
        name = next(n for n in names[51:] if n not in drawn_names(page))  # that plan 0 reaches
        node = page.locator("#map .nodes circle").nth(names.index(name) - 1)
        node.scroll_into_view_if_needed()  # the base, a square, is not counted
        box = node.bounding_box()
        at = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        (page.touchscreen.tap if touch else page.mouse.move)(*at)
        for plan in (0, 3):
            page.evaluate("(address) => { location.hash = address; }", f"plan={plan}")
            shows(page, plan)
            page.evaluate("document.getElementById('nodes-details').open = true")
            page.wait_for_timeout(100)
            rows = page.locator("#nodes tbody tr").all()
            found = {row.locator("th").inner_text(): row.locator("td").nth(2) for row in rows}
            reached = found[name].inner_text() if name in found else "0.000"
            said = f"{name}: reward 1, reached with {reached}"
            expect(page.locator("#node")).to_have_text(said)
        n_left = 60
        while page.is_enabled("#larger"):
            n_hidden = 60 - len(drawn_names(page))
            said = f"Names of {n_hidden} of 60 nodes have no room on the map: point at "
            text = page.inner_text("#unnamed")
            assert text.startswith(said) if n_hidden else text == ""
            assert n_hidden < n_left or n_hidden == 0
            n_left = n_hidden
            page.click("#larger")
        assert n_left < 10


def test_a_map_of_the_site_lies_at_its_coordinates(opened, tmp_path):
    mission, plans = toy_plans([1], [1, 2, 1])
    pixels = np.full((40, 60), 255)
    pixels[0, :] = 0
    file = write_map(tmp_path, pixels, resolution=0.1)
    path = explore(solution_of(mission, plans), tmp_path / "site.html", background=file)
    with opened(path, "#pins=0") as page:
        for svg in ("#map", "#cards svg"):
            image = page.locator(f"{svg} image")
            names = ("x", "y", "width", "height")
            x, y, wide, high = (float(image.get_attribute(name)) for name in names)
            scale = wide / 6
            assert high == pytest.approx(4 * scale)
            node = page.locator(f"{svg} .nodes circle").first  # node 2
            east, north = mission.graph.nodes[2]["pos"]
            at = [float(node.get_attribute(name)) for name in ("cx", "cy")]
            assert at == pytest.approx([x + (east + 1) * scale, y + (2 - north) * scale])
        href = page.locator("#map image").get_attribute("href")
        assert href in downloaded(page, "svg")
    picture = Image.open(io.BytesIO(base64.b64decode(href.partition(",")[2])))
    assert picture.mode == "LA"
    grey, alpha = np.moveaxis(np.asarray(picture), 2, 0)
    assert set(grey.ravel()) == {128}  # to be seen on light and on dark pages
    assert alpha[0].tolist() == [127] * 60
    assert not alpha[1:].any()


# How far robots have come, and where they are, at the same moment.
MOMENT = """(svg) => ({
    said: document.getElementById("moment").textContent,
    at: [...document.querySelectorAll(`${svg} .robots g`)].map((robot) => {
        const { e, f } = robot.transform.baseVal[0].matrix;
        return [e, f];
    }),
    trails: [...document.querySelectorAll(`${svg} .trail`)].map((path) => path.getAttribute("d")),
})"""


class TestMoving:
    LENGTHS = ([400], [200, 400])  # as long, until the first is at its end

    @pytest.fixture
    def path(self, tmp_path):
        mission, plan = along(self.LENGTHS, [[0.9], [0.9, 0.9]])
        return explore(solution_of(mission, [plan]), tmp_path / "moving.html")

    @staticmethod
    def expected(d, lengths, gone):
        """Where a robot is on a trail that was drawn, each hop as two points."""
        pairs = re.findall(r"[-\d.]+,[-\d.]+", d)
        points = np.array([[float(x) for x in pair.split(",")] for pair in pairs])
        for i, length in enumerate([*lengths, *lengths[::-1]]):
            if gone <= length:
                return points[2 * i] + gone / length * (points[2 * i + 1] - points[2 * i])
            gone -= length
        return points[-1]

    def test_all_robots_are_as_fast_also_on_small_maps(self, opened, path):
        with opened(path, "#pins=0") as page:
            page.click("#animate")
            for svg in ("#map", "#cards svg", "#map"):
                page.wait_for_timeout(150)
                moment = page.evaluate(MOMENT, svg)
                said = re.fullmatch(r"length (\d+) of 1200", moment["said"])
                gone = int(said[1])
                assert 0 < gone < 1200
                for at, d, lengths in zip(
                    moment["at"], moment["trails"], self.LENGTHS, strict=True
                ):
                    assert at == pytest.approx(self.expected(d, lengths, gone), abs=1.5)
            page.keyboard.press("Escape")
            assert page.locator("#map .robots g").count() == 0

    def test_with_reduced_motion_they_are_at_nodes(self, opened, path):
        with opened(path, reduced_motion="reduce") as page:
            page.click("#animate")
            expect(page.locator("#moment")).to_have_text("length 300 of 1200")
            first, second = (page.evaluate(MOMENT, "#map") for _ in range(2))
            assert first == second
        # One is still where it started, the other at its first node.
        for at, d, lengths, gone in zip(
            first["at"], first["trails"], self.LENGTHS, (0, 200), strict=True
        ):
            start = self.expected(d, lengths, gone + 1e-9)
            assert at == pytest.approx(start, abs=0.1)
