"""What would take too much memory is refused before it takes any."""

import json
import tracemalloc

import pytest

from botohe_moo.mission import MissionError, generators, load_mission, memory, read_mission
from botohe_moo.mission.library import mission_faults

TOO_LARGE = [
    ("terrain", {"nodes": 10**7}, "85.7 GiB; lower nodes."),
    ("complete", {"nodes": 10**4}, "93.2 GiB; lower nodes."),
    ("random", {"nodes": 10**7}, "3.02e+07 GiB; lower nodes or arc_probability."),
    ("random", {"nodes": 10**5, "arc_probability": 1e-4}, "233 GiB; lower nodes or arc_proba"),
    ("terrain", {"nodes": 10**400}, "GiB; lower nodes."),
]


@pytest.fixture
def little():
    """Nothing is allocated that is worth speaking of."""
    tracemalloc.start()
    yield
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 5_000_000


@pytest.mark.usefixtures("little")
class TestGenerators:
    @pytest.mark.parametrize(("name", "parameters", "needed"), TOO_LARGE)
    def test_of_too_many_nodes(self, name, parameters, needed):
        with pytest.raises(
            ValueError, match=r"at most 8 GiB of memory, got 10+\S*, which takes ab"
        ) as e:
            load_mission(name, **parameters)
        assert needed in str(e.value)

    def test_of_too_many_points_whatever_the_neighbours(self, monkeypatch, tmp_path):
        monkeypatch.setattr(memory, "_LIMIT", 8_000)
        path = tmp_path / "site.txt"
        path.write_text("n 5\nm 1\ntmax 9\n" + "".join(f"{i} 0 1\n" for i in range(5)))
        with pytest.raises(ValueError, match=r"Expected points of a mission .* got 5, .*their num"):
            read_mission(path, neighbours=1)

    def test_in_study_files(self):
        ((name, fault),) = mission_faults("terrain", {"nodes": 10**7}, plain=True)
        assert name == "nodes"
        assert fault.endswith("which takes about 85.7 GiB; lower nodes.")


class TestWhatFits:
    @pytest.mark.parametrize(
        ("name", "parameters"),
        [
            ("terrain", {"nodes": 500_000}),
            ("complete", {"nodes": 2_500}),
            ("random", {"nodes": 10_000, "arc_probability": 0.01}),
        ],
    )
    def test_is_not_refused(self, name, parameters, monkeypatch):
        class ReachedError(Exception):
            pass

        def begin(*_):
            raise ReachedError

        for first in ("near_pairs", "_connected_pairs", "_circle"):
            monkeypatch.setattr(generators, first, begin)
        monkeypatch.setattr(generators.np, "full", lambda *_: None)
        monkeypatch.setattr(generators, "_truncated", begin)
        with pytest.raises(ReachedError):
            getattr(generators, name)(**parameters)

    @pytest.mark.parametrize(
        ("name", "parameters"),
        [
            ("terrain", {"nodes": 1_500}),
            ("complete", {"nodes": 120}),
            ("random", {"nodes": 200, "arc_probability": 0.3}),
            ("random", {"nodes": 600, "arc_probability": 0.02}),
        ],
    )
    def test_estimates_are_near_what_is_taken(self, name, parameters, monkeypatch):
        estimates = []

        def note(parameter, value, *, nodes, arcs, pairs=0, remedy=""):
            estimates.append(memory.needed_bytes(nodes, arcs, pairs))

        monkeypatch.setattr(generators, "check_memory", note)
        tracemalloc.start()
        getattr(generators, name)(**parameters)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert 0.7 * peak < estimates[0] < 4 * peak


class TestTeams:
    def refused(self, make, robots):
        with pytest.raises(MissionError) as caught:
            make(robots)
        message = str(caught.value)
        assert "expected robots <= 42949, of which a thousand plans take 8 GiB of memory" in message
        assert message.endswith("GiB; lower robots")
        return message

    @pytest.mark.usefixtures("little")
    @pytest.mark.parametrize("robots", [42_950, 10**6, 10**400])
    def test_too_large(self, robots, tmp_path):
        toy = load_mission("toy")
        content = {"directed": True, "graph": {"base": 0, "robots": robots}, "edges": []}
        path = tmp_path / "large.json"
        path.write_text(json.dumps({**content, "nodes": [{"id": 0, "reward": 1}]}))
        for make in (
            toy.with_robots,
            lambda robots: load_mission("toy", robots=robots),
            lambda robots: load_mission("terrain", nodes=9, robots=robots),
            lambda robots: read_mission(path, robots=robots),
            lambda _: read_mission(path),
        ):
            self.refused(make, robots)

    def test_the_estimate(self):
        assert "got 1000000, of which they take about 186 GiB" in self.refused(
            load_mission("toy").with_robots, 10**6
        )

    def test_large_ones(self):
        assert load_mission("toy").with_robots(42_949).robots == 42_949
        mission = load_mission("art_museum", robots=1000)
        plan = mission.plan([[1, 2, 1]] * 1000)
        there, back = (mission.graph.edges[arc]["survival"] for arc in ((1, 2), (2, 1)))
        assert mission.evaluate([plan])[0, 1] == pytest.approx(1000 * there * back)
