"""Robot by robot: the guarantee of the method, its corners, and what users rely on."""

import networkx as nx
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Mission, TrailPlan, load_mission
from botohe_moo.algorithms.greedy.planner import (
    MAX_BEAM_WIDTH,
    SequentialPlanner,
    plan_sequentially,
)
from tests.examples import examples
from tests.strategies import lengths, missions, small_missions
from tests.twins import all_objectives, worth

WIDE = MAX_BEAM_WIDTH  # cuts nothing
WEIGHTS = (0.0, 0.1, 0.35, 0.6, 0.9, 0.99, 1.0)


class TestGuarantee:
    @examples(150)
    @given(small_missions())
    def test_at_least_the_share_that_submodularity_promises(self, case):
        mission, trails = case
        every = all_objectives(mission, trails)
        n_robots = mission.robots
        promised = 1 - (1 - 1 / n_robots) ** n_robots
        for weight in WEIGHTS:
            plan = plan_sequentially(mission, weight, beam_width=WIDE)
            found = worth(mission, mission.evaluate([plan]), weight)[0]
            best = worth(mission, every, weight).max()
            assert promised * best - 1e-9 <= found <= best + 1e-9

    @examples(100)
    @given(small_missions(max_robots=1, max_trails=1000), st.floats(0.0, 1.0))
    def test_one_robot_gets_the_best_trail_under_the_floor(self, case, least):
        mission, trails = case
        every = all_objectives(mission, trails)
        feasible = every[every[:, 1] >= least]
        for weight in WEIGHTS:
            plan = plan_sequentially(mission, weight, beam_width=WIDE, min_survival=least)
            objectives = mission.evaluate([plan])
            assert objectives[0, 1] >= least
            best = worth(mission, feasible, weight).max()
            assert worth(mission, objectives, weight)[0] == pytest.approx(best, rel=1e-9)

    @examples(60)
    @given(small_missions(max_trails=1000))
    def test_each_robot_adds_most(self, case):
        """Robot after robot, no other trail in its place would have added more."""
        mission, trails = case
        base = (mission.index(mission.base),)
        planned = plan_sequentially(mission, 0.7, beam_width=WIDE).trails
        for k in range(mission.robots):
            rest = [base] * (mission.robots - k - 1)
            plans = [TrailPlan([*planned[:k], t, *rest]) for t in [planned[k], *trails]]
            values = worth(mission, mission.evaluate(plans), 0.7)
            assert values[0] >= values.max() - 1e-9

    def test_robots_share_the_work(self):
        """Two spurs: 4 behind survival 0.9, 3 behind 0.8, each way; counted by hand."""
        graph = nx.DiGraph(base=0, robots=3)
        graph.add_nodes_from([(0, {"reward": 1.0}), (1, {"reward": 4.0}), (2, {"reward": 3.0})])
        for node, survival in ((1, 0.9), (2, 0.8)):
            graph.add_edge(0, node, survival=survival)
            graph.add_edge(node, 0, survival=survival)
        mission = Mission(graph)
        # With 0.5, survival weighs 1/6 a robot, reward 1/16 a unit. Going to 1, then to 2 and home
        # collects 3.6 + 1.944 and survives with 0.5184: 0.433, against 0.36 for 1 only and
        # 0.257 for 2 only. That leaves 0.4 at 1 and 1.056 at 2, for which nobody goes out.
        assert plan_sequentially(mission, 0.5).trails == ((0, 1, 0, 2, 0), (0,), (0,))
        # With 0.6 (0.1333 and 0.075) the next robot gathers what is left, where more is left
        # first: 0.8448 + 0.2304, surviving with 0.5184: 0.1498, against 0.1474 in the other order,
        # 0.1487 for 2 only and 0.1333 at base. For the third 0.0424 of 4 and 0.0704 of 3 are left.
        planned = ((0, 1, 0, 2, 0), (0, 2, 0, 1, 0), (0,))
        assert plan_sequentially(mission, 0.6).trails == planned
        assert plan_sequentially(mission, 0.1).trails == ((0,),) * 3


class TestCorners:
    @examples(60)
    @given(missions(min_nodes=1))
    def test_weight_0_puts_nobody_in_danger(self, mission):
        plan = plan_sequentially(mission, 0.0, beam_width=20)
        assert mission.evaluate([plan])[0, 1] == mission.robots

    @examples(60)
    @given(small_missions(max_robots=1, max_trails=1000))
    def test_weight_0_takes_what_is_free_and_weight_1_ignores_danger(self, case):
        mission, trails = case
        every = all_objectives(mission, trails)
        for weight, possible in ((0.0, every[every[:, 1] == 1.0]), (1.0, every)):
            reward, _ = mission.evaluate([plan_sequentially(mission, weight, beam_width=WIDE)])[0]
            assert reward == pytest.approx(possible[:, 0].max(), rel=1e-9)

    @examples(80)
    @given(
        missions(max_nodes=9, lengths=lengths),
        st.sampled_from(WEIGHTS),
        st.floats(0.0, 1.0),
        st.one_of(st.none(), st.floats(0.0, 9.0)),
    )
    def test_every_robot_keeps_the_limits(self, mission, weight, least, longest):
        limits = {"min_survival": least, "max_length": longest}
        plan = plan_sequentially(mission, weight, beam_width=3, **limits)
        assert mission.robot_survival([plan]).min() >= least
        assert longest is None or mission.trail_lengths([plan]).max() <= longest

    def test_a_budget_that_binds(self):
        museum = load_mission("art_museum")  # every hop is 1 long
        free, short, home = (
            plan_sequentially(museum, 1.0, max_length=longest, beam_width=30)
            for longest in (None, 12, 1)
        )
        assert museum.trail_lengths([free]).min() > 12
        assert museum.trail_lengths([short]).tolist() == [[12, 12, 12]]
        assert museum.trail_lengths([home]).tolist() == [[0, 0, 0]]

    def test_home_by_the_shortest_way_where_the_safest_is_too_long(self):
        """A goal from which the safest way home is 3 long, and the shortest 1."""
        graph = nx.DiGraph(base=0, robots=1)
        graph.add_nodes_from([(0, {"reward": 0.0}), (1, {"reward": 1.0}), (2, {"reward": 0.0})])
        for tail, head, survival, length in [(0, 1, 1.0, 1.0), (1, 0, 0.5, 1.0)]:
            graph.add_edge(tail, head, survival=survival, length=length)
        for tail, head in [(1, 2), (2, 0)]:
            graph.add_edge(tail, head, survival=1.0, length=1.5)
        mission = Mission(graph)
        for longest, trail in ((4, (0, 1, 2, 0)), (3, (0, 1, 0)), (1.5, (0,))):
            assert plan_sequentially(mission, 0.9, max_length=longest).trails == (trail,)
        plan = plan_sequentially(mission, 0.9, max_length=3, min_survival=0.6)
        assert plan.trails == ((0,),)

    def test_a_base_worth_more_than_all_else(self):
        graph = nx.path_graph(3, nx.DiGraph)
        graph.add_edges_from([(1, 0), (2, 1)])
        nx.set_node_attributes(graph, {0: 1e15, 1: 1.0, 2: 1.0}, "reward")
        nx.set_edge_attributes(graph, 0.9, "survival")
        plan = plan_sequentially(Mission(graph, base=0, robots=2), 1.0)
        assert plan.trails == ((0, 1, 2, 1, 0), (0, 1, 2, 1, 0))


class TestPlanner:
    def test_plans_with_the_last_robots_at_base(self):
        museum = load_mission("art_museum", robots=4)
        base = (museum.index(museum.base),)
        planner = SequentialPlanner(museum, beam_width=30)
        team = planner.plan(0.8)
        away = [trail for trail in team.trails if trail != base]
        assert len(away) >= 2
        plans = planner.plans(0.8)
        assert plans[0] == team
        assert [plan.trails for plan in plans] == [
            (*away[:n], *[base] * (4 - n)) for n in range(len(away), 0, -1)
        ]
        museum.evaluate(plans)
        assert planner.plans(0.0) == [TrailPlan([base] * 4)]

    def test_wider_is_better(self):
        museum = load_mission("art_museum")
        values = []
        for width in (1, 10, 300):
            planner = SequentialPlanner(museum, beam_width=width)
            plans = [planner.plan(weight) for weight in WEIGHTS]
            rows = museum.evaluate(plans)
            values.append(
                sum(worth(museum, [row], w)[0] for row, w in zip(rows, WEIGHTS, strict=True))
            )
        assert values[0] < values[1] < values[2]

    @pytest.mark.parametrize("parameters", [{"weight": 1.5}, {"max_length": "far"}])
    def test_parameters_out_of_range(self, parameters):
        ((name, _),) = parameters.items()
        with pytest.raises(ValueError, match=f"Expected {name} "):
            plan_sequentially(load_mission("toy"), **{"weight": 0.5, **parameters})
