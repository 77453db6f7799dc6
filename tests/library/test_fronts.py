"""Best known fronts: merging them, and the files that hold them."""

import itertools
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import BOTOHE, Kind, Mission, load_mission
from botohe_moo.library import BestKnown, Finder
from botohe_moo.trails import TrailPlan
from tests.strategies import missions, plans, team_missions

TOY = load_mission("toy")
ADA = Finder("2026-11-27", "Ada", "by hand")
BOB = Finder("2026-11-28", "Bob", "by hand")
# Node 3 pays 1 and node 4 pays 4; the way to 3 has survival 0.9, and on to 4 another 0.9.
FAR = TOY.plan([[1, 3, 2, 4, 2, 3, 1], [1]])  # 0.9 + 0.81 · 4 = 4.14, and 1 + 0.9⁴ = 1.6561
NEAR = TOY.plan([[1, 3, 1], [1]])  # 0.9, and 1 + 0.9² = 1.81
HOME = TOY.stay_home()  # 0 and 2
WORSE = TOY.plan([[1, 3, 2, 1], [1]])  # 0.9, and 1 + 0.9 · 0.9 · 0.81 = 1.6561: behind both


@st.composite
def lists_of_plans(draw):
    """A mission, plain or not, and lists of its plans with who found them."""
    mission = draw(missions(max_nodes=5) | team_missions())
    drawn_plans = plans(mission).map(TrailPlan)
    finders = st.builds(
        Finder,
        on=st.sampled_from(["2026-11-27", "2026-12-01"]),
        by=st.sampled_from(["Ada", "Bob"]),
        method=st.sampled_from(["by hand", "by chance"]),
    )
    lists = st.lists(st.tuples(st.lists(drawn_plans, max_size=4), finders), max_size=4)
    problem = BOTOHE(mission)

    def keep_limits(found):
        worst = np.max(problem.constrain_batch(mission.batch(found)), axis=1, initial=0.0)
        return [plan for plan, most in zip(found, worst, strict=True) if most <= 0]

    return mission, [(keep_limits(found), finder) for found, finder in draw(lists)]


def merged(mission, lists):
    front = BestKnown(mission)
    for found, finder in lists:
        front = front.merged(found, finder)
    return front


def not_dominated(mission, found):
    """The readable twin: objectives with 12 digits, of which none is at least as good twice."""
    if not found:
        return set()
    points = {tuple(float(f"{x:.12g}") for x in row) for row in mission.evaluate(found).tolist()}
    return {p for p in points if not any(q != p and q[0] >= p[0] and q[1] >= p[1] for q in points)}


class TestMerging:
    def test_a_better_point_takes_the_place_of_those_it_dominates(self):
        front = BestKnown(TOY).merged([WORSE, HOME], ADA)
        assert front.objectives.tolist() == [[0.9, 1.6561], [0.0, 2.0]]
        better = front.merged([NEAR, FAR], BOB)
        assert better.objectives.tolist() == [[4.14, 1.6561], [0.9, 1.81], [0.0, 2.0]]
        assert better.finders == (BOB, BOB, ADA)
        assert [*better.plans] == [FAR, NEAR, HOME]
        # (4.14 · 1.6561 + 0.9 · (1.81 − 1.6561)) / (10 · 2)
        assert better.area == pytest.approx(0.34973820, abs=1e-8)

        for found in ([WORSE], []):
            assert better.merged(found, BOB).to_bytes() == better.to_bytes()

    def test_of_equal_ones_the_earliest_stays(self):
        trails = [[1, 3, 1], [1, 3, 2, 4, 2, 3, 1]]
        plans = TOY.plan(trails), TOY.plan(trails[::-1])
        for first, second in itertools.permutations([ADA, BOB]):
            front = BestKnown(TOY).merged(plans[:1], first).merged(plans[1:], second)
            assert front.finders == (ADA,)

    @given(lists_of_plans(), st.randoms(use_true_random=False))
    def test_any_order_gives_the_same_file(self, drawn, shuffled):
        mission, lists = drawn
        front = merged(mission, lists)
        others = list(lists)
        shuffled.shuffle(others)
        assert merged(mission, others).to_bytes() == front.to_bytes()
        apart = merged(mission, [([plan], finder) for found, finder in lists for plan in found])
        assert apart.to_bytes() == front.to_bytes()
        found = [plan for plans, _ in lists for plan in plans]
        assert {tuple(row) for row in front.objectives.tolist()} == not_dominated(mission, found)
        front.check()

    def test_limits_of_the_mission_count(self):
        graph = TOY.graph.copy()
        graph.graph["max_length"] = 2.0  # two arcs, each of length 1
        short = Mission(graph)
        BestKnown(short).merged([NEAR], ADA).check()
        fault = r"Plan 1, robot 0: expected a length of at most 2 in mission 'toy', got 6"
        with pytest.raises(ValueError, match=fault):
            BestKnown(short).merged([NEAR, FAR], ADA)
        floors = Mission(TOY.graph, kinds=[Kind("robot", 2, min_survival=0.9)])
        fault = r"Plan 0, robot 0: expected a survival of at least 0.9 .* got 0.6561"
        with pytest.raises(ValueError, match=fault):
            BestKnown(floors).merged([floors.plan(TOY.labels(FAR))], ADA)

    def test_who_and_when_have_to_be_said(self):
        for finder, fault in (
            (("27.11.2026", "Ada", "by hand"), "Invalid isoformat string: '27.11.2026'"),
            (("2026-06-31", "Ada", "by hand"), "day is out of range"),
            (("2026-11-27", " ", "by hand"), "Expected a line that says who, or by what, got ' '"),
            (("2026-11-27", "Ada", ""), "Expected a line that says who, or by what, got ''"),
            (("2026-11-27", "A\nda", "by hand"), "Expected a line that says who"),
            (("2026-11-27", "A\udcffda", "by hand"), "Expected a line that says who"),
        ):
            with pytest.raises(ValueError, match=fault):
                Finder(*finder)


class TestFiles:
    @given(lists_of_plans())
    def test_what_is_written_is_read_again(self, tmp_path_factory, drawn):
        mission, lists = drawn
        front = merged(mission, lists)
        path = tmp_path_factory.getbasetemp() / "front.json"
        path.write_bytes(front.to_bytes())
        again = BestKnown.read(path, mission)
        assert again.to_bytes() == front.to_bytes()
        assert (again.finders, [*again.plans]) == (front.finders, [*front.plans])
        empty = BestKnown(mission)
        assert (empty.objectives.shape, empty.area) == ((0, 2), 0)
        empty.check()

    def changed(self, tmp_path, change):
        """Read a file after a change of its content."""
        content = json.loads(BestKnown(TOY).merged([FAR, NEAR, HOME], ADA).to_bytes())
        change(content)
        path = tmp_path / "toy.front.json"
        path.write_text(json.dumps(content))
        BestKnown.read(path, TOY).check()

    @pytest.mark.parametrize(
        ("change", "fault"),
        [
            (lambda c: c.update(mission_digest="0" * 16), "that of another mission, '0{16}'"),
            (lambda c: c.update(format="botohe-front-2"), "format"),
            (lambda c: c.pop("finders"), "finders"),
            (lambda c: c["plans"][0].__setitem__(0, 9.5), "Plan 0: expected the objectives"),
            (lambda c: c["plans"][0].__setitem__(0, 4.14 * (1 + 8e-10)), "Plan 0: expected the ob"),
            (lambda c: c["plans"][0][3].reverse(), "with sorted trails"),
            (lambda c: c["plans"].reverse(), "Expected non-dominated plans by descending reward"),
            (lambda c: c["plans"].append(c["plans"][-1]), "each once"),
            (lambda c: c["plans"][0].__setitem__(3, [0, 9]), "no such node, trail or finder"),
            (lambda c: c["plans"][0].__setitem__(2, 1), "no such node, trail or finder"),
            (lambda c: c["trails"][1].pop(), "expected the trail to end at base 1, got 3"),
            (lambda c: c["finders"][0].__setitem__(0, "today"), "Invalid isoformat string"),
            (lambda c: c["finders"][0].append("more"), "finders.0"),
        ],
    )
    def test_what_is_not_true_is_named(self, tmp_path, change, fault):
        self.changed(tmp_path, lambda content: None)
        with pytest.raises(ValueError, match=fault):
            self.changed(tmp_path, change)

    def test_a_dominated_plan_is_named(self, tmp_path):
        def add_worse(content):
            content["trails"].append([1, 3, 2, 1])
            content["plans"].insert(1, [0.9, 1.6561, 0, [0, len(content["trails"]) - 1]])

        with pytest.raises(ValueError, match="Expected non-dominated plans"):
            self.changed(tmp_path, add_worse)

    def test_damaged_files_are_named(self, tmp_path):
        """Those changed at random: see tests/test_damaged_files.py."""
        (tmp_path / "a.front.json.gz").write_bytes(b"{")
        for name in ("a.front.json.gz", "missing.json: no such file"):
            with pytest.raises(ValueError, match=name):
                BestKnown.read(tmp_path / name.partition(":")[0], TOY)
