"""Moves: how they are declared, that each makes children, and all children of some by hand."""

import networkx as nx
import pytest

from botohe_moo import Mission, TrailPlan, load_mission
from botohe_moo.algorithms.local_search.engine import DEFAULT_MOVES
from botohe_moo.algorithms.local_search.kernels import moves, plans, search
from botohe_moo.algorithms.local_search.kernels.moves import MOVES, N_MOVES, Move
from tests.algorithms.local_search.made import check, started, watched


class TestDeclarations:
    def test_names_and_weights(self):
        names = [move.name for move in MOVES]
        assert len(set(names)) == len(names) == N_MOVES
        assert all(name == name.lower().strip() != "ruin-and-recreate" for name in names)
        assert min(move.weight for move in MOVES) > 0
        assert sum(move.weight for move in MOVES) == pytest.approx(1.0, abs=0.1)
        assert len({move[2:] for move in MOVES}) == N_MOVES

    @pytest.mark.parametrize("n", [1, 2, N_MOVES + 1])
    def test_one_is_called_by_its_number(self, monkeypatch, n):
        called = [Move(f"move {i}", 1.0, lambda of, i: of.append(i), i) for i in range(n)]
        monkeypatch.setattr(moves, "MOVES", called)
        monkeypatch.setattr(moves, "N_MOVES", n)
        make_move, made = moves._chained(0), []
        for number in range(n):
            make_move(made, number)
        assert made == list(range(n))


@pytest.fixture(scope="module")
def found():
    museum = load_mission("art_museum")
    search = started(museum)
    search.run(5_000)
    return museum, search.plans()[0]


@pytest.mark.compiled_only
@pytest.mark.parametrize("name", DEFAULT_MOVES)
def test_each_alone_makes_children(found, name):
    museum, batch = found
    search = started(museum, batch, moves={name: 1.0}, prob_recreate=0.0)
    assert search.run(500) == 500
    tried = search.statistics["tried"]
    assert tried[name] == tried.sum() == 500
    check(search)


@pytest.mark.compiled_only
def test_moves_that_lead_nowhere_end_the_search():
    for name in ("splice", "graft", "swap-loops"):
        search = started(load_mission("art_museum"), moves={name: 1.0}, prob_recreate=0.0)
        assert search.run(100_000) == 0  # there is only the trail that stays at base
        assert len(search) == 1


class TestByHand:
    """One robot, and all children that it can have."""

    def made(self, mission, trail, move):
        """The children of one trail, whatever else is found."""
        constants, seen = [(plans, "P_NEWEST", 0.0), (search, "P_END", 1.0)], set()
        options = {"moves": {move: 1.0}, "prob_recreate": 0.0, "constants": constants}
        for seed in range(9):
            _, made = watched(mission, [TrailPlan([trail])], 100, seed=seed, **options)
            seen |= {child.trail for child in made if child.parent == tuple(trail)}
        return seen

    @pytest.fixture
    def mission(self):
        """Nodes 1 to 3 round the base; 1 and 2 are neighbours; the richest trail is in front."""
        graph = nx.DiGraph()
        graph.add_nodes_from((node, {"reward": float(node)}) for node in range(4))
        for one, other in ((0, 1), (0, 2), (0, 3), (1, 2)):
            graph.add_edge(one, other, survival=0.9)
            graph.add_edge(other, one, survival=0.9)
        return Mission(graph, base=0, robots=1)

    def test_shortcut(self, mission):
        found = self.made(mission, (0, 3, 0, 2, 1, 0), "shortcut")
        assert found == {(0,), (0, 2, 1, 0), (0, 3, 0), (0, 3, 0, 1, 0), (0, 3, 0, 2, 0), (0, 1, 0)}

    def test_swap_loops(self, mission):
        # Loops: 1, 2 and 3; the order by which 3 comes first is the best, and is the parent.
        found = self.made(mission, (0, 3, 0, 2, 0, 1, 0), "swap-loops")
        assert found == {(0, 2, 0, 3, 0, 1, 0), (0, 3, 0, 1, 0, 2, 0)}

    def test_adopt(self, mission):
        start = [TrailPlan([[0, 3, 0], [0, 2, 0]])]
        options = {"moves": {"adopt": 1.0}, "prob_recreate": 0.0}
        search, _ = watched(mission.with_robots(2), start, 50, **options)
        found = {tuple(sorted(plan.trails)) for plan in search.plans()[0]}
        assert found == {((0,), (0,)), ((0,), (0, 3, 0)), ((0, 2, 0), (0, 3, 0))}

    def test_visit(self, mission):
        found = self.made(mission, (0, 3, 0), "visit")
        # Before it and behind it; in its place; and on the way back from it.
        assert {(0, 1, 0), (0, 2, 0), (0, 1, 0, 3, 0), (0, 3, 0, 2, 0)} <= found
        assert all(len(trail) <= 5 for trail in found)
