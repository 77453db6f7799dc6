"""The page of a mission with kinds of robots."""

import pytest

from botohe_moo import load_mission
from botohe_moo.decide import plan_csv, plan_geojson, plan_json
from botohe_moo.explorer import explore
from botohe_moo.explorer.data import page_data
from tests.explorer.conftest import solution_of
from tests.plots.made import TRAILS, mixed

NAMES = ["drone 0", "drone 1", "rover 2"]


def two_plans():
    mission = mixed()
    return solution_of(mission, [mission.plan(TRAILS), mission.stay_home()])


class TestData:
    """By hand: see the site in tests/plots/test_kinds.py."""

    DATA = page_data(two_plans())

    def test_arcs_are_there_once_with_what_each_kind_survives(self):
        tails, heads, codes = self.DATA["arcs"]
        arcs = list(zip(tails, heads, strict=True))
        assert len(arcs) == len(set(arcs)) == 11
        of = {
            arc: [codes[i], *(kind[i] for kind in self.DATA["arc_codes"])]
            for arc, i in zip(arcs, range(11), strict=True)
        }
        assert of[0, 1] == [900, 900, 800]
        assert of[1, 3] == [950, 900, 950]
        assert of[3, 2] == [700, 700, 0]

    def test_kinds_starts_and_what_only_some_can_do(self):
        data = self.DATA
        assert (data["kinds"], data["kind_of"]) == (["drone", "rover"], [0, 0, 1])
        assert data["ends"] == [(4, 0), (0, 0)]
        assert (data["depots"], data["rings"]) == ([3], [2])
        (drone, ways, spots), (rover, no_ways, hall) = data["only"]
        assert (drone, len(ways), spots) == ((0,), 7, [2])
        assert (rover, no_ways, hall) == ((1,), [], [1])
        assert data["node_notes"] == [
            "",
            "drone cannot collect it",
            "pays on return, rover cannot collect it",
            "depot",
            "",
        ]

    def test_trails_and_what_they_bring_alone(self):
        data = self.DATA
        (plan,) = [one for one in data["plans"] if len({*one}) == 3]
        assert [data["trails"][i] for i in plan] == [(4, 2, 1, 0), (4, 1, 0), (0,)]
        # The pond's 5 are paid at the dock: 0.5 · 0.5 · 0.9; drones get nothing in the hall.
        assert [data["trail_reward_texts"][i] for i in plan] == ["1.12", "0.00", "0.00"]
        both = dict(zip([0, 1, 2, 4], data["collected"][data["plans"].index(plan)], strict=True))
        assert both[2] == 225

    def test_plain_missions_have_none_of_it(self):
        mission = load_mission("toy")
        data = page_data(solution_of(mission, [mission.stay_home()]))
        for name in ("kinds", "ends", "only", "rings", "arc_codes", "node_notes", "collected"):
            assert data[name] == []


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return explore(two_plans(), tmp_path_factory.mktemp("explorer") / "kinds.html")


@pytest.mark.slow
class TestPage:
    def test_robots_have_names_colours_and_dashes(self, opened, path):
        with opened(path, "#plan=0") as page:
            assert page.locator("#team button").all_inner_texts() == NAMES
            assert page.locator("#map .badges text").all_text_contents() == NAMES[:2]
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
            rows = page.locator("#nodes tbody tr").all_text_contents()
            assert "pond150.5000.225drone 0" in rows

    def test_pointing_at_nodes_and_arcs(self, opened, path):
        with opened(path, "#plan=0") as page:
            boxes = [
                page.locator(f"#map .nodes {mark}").bounding_box()
                for mark in (".base", "circle >> nth=0", "circle >> nth=1")
            ]
            base, hall, pond = ((b["x"] + b["width"] / 2, b["y"] + b["height"] / 2) for b in boxes)
            page.mouse.move(*pond)
            assert page.inner_text("#node") == (
                "pond: reward 5, reached with 0.500; pays on return, rover cannot collect it"
            )
            page.mouse.move(*((a + b) / 2 for a, b in zip(base, hall, strict=True)))
            assert page.inner_text("#node") == (
                "dock – hall: drone survives with 0.900, rover survives with 0.800"
            )
            page.mouse.move(*((a + b) / 2 for a, b in zip(pond, hall, strict=True)))
            assert page.inner_text("#node") == (
                "hall – pond: drone survives with 0.500, not for rover"
            )

    def test_files_are_those_of_the_library(self, opened, path):
        solution = two_plans()
        mission, plan = solution.mission, solution.plans[0]
        text = {}
        with opened(path, "#plan=0") as page:
            for kind in ("json", "csv", "geojson"):
                with page.expect_download() as found:
                    page.click(f'[data-file="{kind}"]')
                text[kind] = found.value.path().read_bytes().decode()
        writers = {"json": plan_json, "csv": plan_csv, "geojson": plan_geojson}
        assert text == {kind: write(mission, plan) for kind, write in writers.items()}
