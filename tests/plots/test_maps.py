"""Maps of missions, plans and pheromone: what is drawn is read back and compared."""

import itertools
import math
import re
from collections import defaultdict

import matplotlib.pyplot as plt
import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text

from botohe_moo import Kind, Mission, load_mission, plots
from botohe_moo.mission.rules import MissionError
from botohe_moo.plots.canvas import robot_styles
from botohe_moo.plots.site import node_positions, read_background
from botohe_moo.plots.style import REACH, SURVIVAL
from tests.examples import examples
from tests.plots import made, read
from tests.plots.made import MUSEUM, MUSEUM_PLAN, TOY, TOY_PLANS
from tests.strategies import missions_with_plans


def bar_labels(ax):
    return [bar.get_ylabel() for bar in ax.child_axes]


class TestMission:
    def test_every_node_and_arc_of_a_large_one(self):
        ax = plots.plot_mission(load_mission("terrain_200"))
        n_marks = [len(read.only(ax, name).get_offsets()) for name in ("nodes", "base", "heads")]
        assert n_marks == [199, 1, 1348]
        assert (read.n_segments(ax, "lines"), read.n_segments(ax, "arrows")) == (0, 1348)
        assert bar_labels(ax) == ["reward", "survival"]

    def test_the_museum_with_its_floors_and_names(self):
        ax = plots.plot_mission(MUSEUM)
        assert read.title(ax) == "San Diego Museum of Art"
        assert read.legend_texts(ax) == ["3 robots at base 1", "no reward", "floor 1", "floor 2"]
        assert (read.n_segments(ax, "lines"), read.n_segments(ax, "arrows")) == (37, 0)
        floors = read.drawn(ax, "zone")
        # The arc of the stairs, 2 - 21, is on neither floor.
        assert [len(floor.get_segments()) for floor in floors] == [56, 16]
        assert len({tuple(floor.get_color()[0]) for floor in floors}) == 2
        ax.figure.draw_without_rendering()
        labels = {t.get_text(): t.get_window_extent() for t in read.node_texts(ax)}
        assert sorted(labels, key=int) == [str(i) for i in range(1, 28)]
        assert not any(a.overlaps(b) for a, b in itertools.combinations(labels.values(), 2))
        radius = math.sqrt(read.only(ax, "nodes").get_sizes()[0]) / 2 * ax.figure.dpi / 72
        centres = ax.transData.transform(node_positions(MUSEUM))
        for node, (x, y) in zip(MUSEUM.nodes, centres, strict=True):
            box = labels[str(node)]
            assert math.hypot((box.x0 + box.x1) / 2 - x, (box.y0 + box.y1) / 2 - y) < radius / 3
            assert box.width < 2 * radius

    @pytest.mark.parametrize(("n", "said"), [(30, None), (300, "no room for some names of nodes")])
    def test_names_stand_where_there_is_room(self, n, said):
        places = [[math.cos(6 * i / n), math.sin(6 * i / n)] for i in range(n)]
        nodes = {i: {"reward": 1, "pos": place} for i, place in enumerate(places)}
        arcs = [(i, (i + 1) % n, 0.9) for i in range(n)]
        ax = plots.plot_mission(made.make(nodes, arcs, base=0))
        assert len(read.node_texts(ax)) == (0 if said else n)
        assert not said or read.words(ax) == said

    def test_nodes_are_darker_for_more_reward_and_hollow_for_none(self):
        ax = plots.plot_mission(MUSEUM)
        fills = read.only(ax, "nodes").get_facecolors()
        reward = np.delete(MUSEUM.rewards, MUSEUM.index(MUSEUM.base))
        white = (fills[:, :3] == 1).all(axis=1)
        assert np.array_equal(white, reward == 0)
        outline = to_rgb(ax.get_legend().legend_handles[1].get_markeredgecolor())
        outlined = np.isclose(read.only(ax, "nodes").get_edgecolors()[:, :3], outline).all(axis=1)
        assert np.array_equal(outlined, white)
        shades = read.luminance(fills[~white])
        by_reward = [set(shades[np.isclose(reward[~white], r)]) for r in (0.1, 1 / 3, 2 / 3, 1.0)]
        assert [len(group) for group in by_reward] == [1, 1, 1, 1]
        assert sorted(by_reward, key=max, reverse=True) == by_reward

    def test_unequal_and_one_way_arcs_are_arrows_bowed_to_their_right(self):
        ways = [("reef", "cave", 0.7), ("cave", "atoll", 0.6), ("atoll", "cave", 0.85)]
        ways.append(("atoll", "dock", 0.95))
        arcs = [("dock", "reef", 0.9), ("reef", "dock", 0.9), *ways]
        mission = made.make({"dock": 0, "reef": 5, "cave": 0, "atoll": 8}, arcs, robots=2)
        ax = plots.plot_mission(mission)
        assert read.n_segments(ax, "lines") == 1
        arrows = read.only(ax, "arrows").get_segments()
        xy = dict(zip(mission.nodes, node_positions(mission), strict=True))
        assert len(arrows) == len(ways)
        for tail, head, _ in ways:
            ends = [xy[tail], xy[head]]
            (arrow,) = [a for a in arrows if np.allclose(a[[0, -1]], ends, atol=1e-9)]
            along, out = xy[head] - xy[tail], arrow[len(arrow) // 2] - (xy[head] + xy[tail]) / 2
            assert along[0] * out[1] - along[1] * out[0] < 0
            assert 0.03 < np.hypot(*out) / np.hypot(*along) < 0.12

    def test_a_layout_is_reproducible_and_used_when_one_position_is_missing(self):
        graph = nx.DiGraph(TOY.graph)
        del graph.nodes[3]["pos"]
        mission = Mission(graph)
        first, again = (node_positions(mission) for _ in range(2))
        assert np.array_equal(first, again)
        assert not np.allclose(first[4], [1.6, 0.5])
        assert min(math.dist(a, b) for a, b in itertools.combinations(first, 2)) > 0.1
        note = "the places of the nodes on this map are made up: 1 of 5 nodes have no position"
        plan = mission.stay_home()
        with_it = {"plot_mission": (), "plot_plan": (plan,), "plot_choices": ([plan],)}
        for name, own in (with_it | {"plot_pheromone": (made.pheromone_of(mission),)}).items():
            assert note in read.words(getattr(plots, name)(mission, *own))
        big = nx.DiGraph(nx.cycle_graph(61))
        nx.set_node_attributes(big, 1.0, "reward")
        nx.set_edge_attributes(big, 0.9, "survival")
        first, again = (node_positions(Mission(big, base=0, robots=1)) for _ in range(2))
        assert np.array_equal(first, again)
        assert first.shape == (61, 2)


class TestPlan:
    def test_a_map_of_all_robots_and_one_of_each_that_leaves(self):
        ax = plots.plot_plan(MUSEUM, MUSEUM_PLAN)
        team, *own = read.maps_of(ax)
        assert team is ax
        first = f"R0 survives with {0.9**2 * 0.97**2 * 0.9**2:.2f}"
        names = ["all robots", first, "R1 survives with 0.52"]
        assert [read.map_name(one) for one in (team, *own)] == names
        reward, survivors = MUSEUM.evaluate([MUSEUM_PLAN])[0]
        objectives = f"E[R] = {reward:.2f}, E[S] = {survivors:.2f}"
        said = "numbers on each robot's own map: order of visit; staying at 1: R2"
        assert read.words(ax) == f"{objectives}; {said}"
        assert read.visits_drawn(MUSEUM, own[0]) == read.visits_of(MUSEUM_PLAN.trails[0])
        assert read.visits_drawn(MUSEUM, own[1]) == {1: [1, 3], 20: [2], 0: [4]}

    def test_one_map_on_given_axes(self):
        ax = plots.plot_plan(MUSEUM, MUSEUM_PLAN, ax=plt.figure().subplots())
        assert read.legend_texts(ax) == ["R0 survives with 0.62", "R1 survives with 0.52"]
        assert read.words(ax).endswith("staying at 1: R2")
        assert read.arcs_drawn(MUSEUM, ax) == read.arcs_of(*MUSEUM_PLAN.trails)
        handles = ax.get_legend().legend_handles
        styles = robot_styles(MUSEUM)
        assert [handle.get_color() for handle in handles] == [s.colour for s in styles[:2]]

    def test_nodes_are_as_dark_as_they_are_likely_to_be_reached(self):
        team, *own = read.maps_of(plots.plot_plan(MUSEUM, MUSEUM_PLAN))
        missed = defaultdict(lambda: 1.0)
        for ax, trail in zip(own, MUSEUM_PLAN.trails, strict=False):
            chance, reach = 1.0, {trail[0]: 1.0}
            for tail, head in itertools.pairwise(trail):
                arc = MUSEUM.nodes[tail], MUSEUM.nodes[head]
                chance *= MUSEUM.graph.edges[arc]["survival"]
                reach.setdefault(head, chance)
            shades = self.shades_drawn(ax)
            assert {v: shades[v] for v in reach} == {v: REACH(p) for v, p in reach.items()}
            for node, chance in reach.items():
                missed[node] *= 1 - chance
        shades = self.shades_drawn(team)
        assert {v: shades[v] for v in missed} == {v: REACH(1 - p) for v, p in missed.items()}
        assert np.all(np.diff(read.luminance([REACH(p) for p in np.linspace(0, 1, 11)])) < 0)
        assert team.figure.axes[1].child_axes[0].get_ylim() == (0, 1)

    @staticmethod
    def shades_drawn(ax):
        """The colour of each node that a trail touches."""
        marks = [read.only(ax, name) for name in ("nodes", "base")]
        nodes = read.nodes_at(MUSEUM, np.concatenate([mark.get_offsets() for mark in marks]))
        fills = np.concatenate([mark.get_facecolors() for mark in marks])
        return dict(zip(nodes, map(tuple, fills), strict=True))

    def test_no_texts_overlap(self):
        """On a trail around a tree that is searched in depth, of all nodes and home."""
        trail, way = [1], [1]
        for tail, head, kind in nx.dfs_labeled_edges(MUSEUM.graph, 1):
            if tail != head and kind != "nontree":
                way = [*way, head] if kind == "forward" else way[:-1]
                trail.append(way[-1])
        ax = plots.plot_plan(MUSEUM, MUSEUM.plan([[*trail, *way[-2::-1]], [1], [1]]))
        ax.figure.draw_without_rendering()
        for own in read.maps_of(ax):
            texts = [*read.node_texts(own), *read.drawn(own, "robot")]
            boxes = [Text.get_window_extent(text) for text in texts]
            assert len(boxes) >= 20
            assert not any(a.overlaps(b) for a, b in itertools.combinations(boxes, 2))
            limits = own.get_window_extent().padded(3)
            assert all(limits.contains(b.x0, b.y0) and limits.contains(b.x1, b.y1) for b in boxes)

    @pytest.mark.filterwarnings("error")
    def test_labels_are_shown_as_they_are(self):
        names = ['dock "A"', "<reef>", "$cave$", "שלום", "</script>", "b\\c", "x_1^2"]
        arcs = [(a, b, 0.9) for a, b in itertools.pairwise([*names, names[0]])]
        mission = made.make(dict.fromkeys(names, 1), arcs, base=names[0], robots=2)
        ax = plots.plot_plan(mission, mission.plan([[*names, names[0]], names[:1]]))
        assert {text.get_text() for text in read.node_texts(ax)} == set(names)
        ax.figure.canvas.draw()

    def test_passages_of_one_arc_lie_side_by_side(self):
        plan = TOY.plan([[1, 3, 4, 3, 1], [1, 3, 4, 3, 1]])
        ax = plots.plot_plan(TOY, plan, ax=plt.figure().subplots())
        middles = np.array([s[len(s) // 2] for s in read.only(ax, "trails").get_segments()])
        assert len(middles) == 8
        assert min(math.dist(a, b) for a, b in itertools.combinations(middles, 2)) > 0.005
        # 1 -> 3 runs down to the right: its right-hand side is below the line through both nodes.
        for k, sign in [(0, -1), (3, 1), (4, -1), (7, 1)]:
            assert np.sign(middles[k] @ [1, 1] - 0.5) == sign

    @examples(12)
    @given(missions_with_plans())
    def test_any_mission_and_plan_is_drawn_as_it_is(self, case):
        mission, plan = case
        ax = plots.plot_mission(mission, ax=Figure().subplots())
        twins = sum(
            mission.graph.has_edge(v, u) and mission.graph.edges[v, u]["survival"] == s
            for u, v, s in mission.graph.edges(data="survival")
        )
        assert read.n_segments(ax, "lines") == twins / 2
        assert read.n_segments(ax, "arrows") == mission.world.graph.n_arcs - twins
        team, *own = read.maps_of(plots.plot_plan(mission, plan))
        assert read.arcs_drawn(mission, team) == read.arcs_of(*plan.trails)
        out = [trail for trail in plan.trails if len(trail) > 1]
        for one, trail in zip(own, out, strict=True):
            assert read.arcs_drawn(mission, one) == read.arcs_of(trail)
            if not re.search("no room|small", read.map_name(one)):
                assert read.visits_drawn(mission, one) == read.visits_of(trail)
        plt.close("all")


class TestKinds:
    def test_arcs_are_drawn_once_and_what_some_can_do_is_shaded(self):
        ax = plots.plot_mission(made.mixed())
        assert (read.n_segments(ax, "lines"), read.n_segments(ax, "arrows")) == (5, 1)
        assert read.n_segments(ax, "only") == 4  # to pond and roof, and the one way
        assert len(read.only(ax, "nodes").get_offsets()) == 3
        assert read.only(ax, "depots").get_offsets().tolist() == [list(made.PLACES["quay"])]
        assert read.only(ax, "rings").get_offsets().tolist() == [list(made.PLACES["pond"])]
        shades = [mark.get_offsets().tolist() for mark in read.drawn(ax, "behind")]
        assert sorted(shades) == [[list(made.PLACES["hall"])], [list(made.PLACES["pond"])]]
        assert read.legend_texts(ax) == [
            *("base dock", "drone: 2 from roof to dock", "rover: 1 at dock", "depot"),
            *("pays on return", "no reward", "only drone", "only rover"),
        ]

    def test_arcs_have_the_colour_of_the_safest_kind(self):
        ax = plots.plot_mission(made.site())
        assert bar_labels(ax) == ["reward", "survival (safest kind)"]
        assert ax.child_axes[1].get_ylim() == (0.5, 0.95)
        lines = read.only(ax, "lines")
        far = {tuple(line[-1]): i for i, line in enumerate(lines.get_segments())}
        colours = [tuple(lines.get_colors()[far[made.PLACES[end]]]) for end in ("quay", "hall")]
        # hall - quay is safest for rovers, dock - hall for drones.
        assert colours == [SURVIVAL(1.0), SURVIVAL((0.9 - 0.5) / 0.45)]

    def test_rings_are_left_out_if_all_pays_on_return(self):
        ax = plots.plot_mission(made.site(pays="return"))
        assert (read.drawn(ax, "rings"), read.words(ax)) == ([], "all rewards count on return")

    def test_kinds_differ_in_colour_and_their_robots_in_dash(self):
        styles = robot_styles(made.site())
        assert [style.name for style in styles] == ["drone 0", "drone 1", "rover 2"]
        assert styles[0].colour == styles[1].colour != styles[2].colour
        assert styles[0].dash == styles[2].dash != styles[1].dash

    def test_trails_and_names(self):
        mission = made.site()
        plan = mission.plan(made.TRAILS)
        team, *own = read.maps_of(plots.plot_plan(mission, plan))
        assert read.arcs_drawn(mission, team) == read.arcs_of(*mission.trails(plan))
        # 0.5 · 0.5 · 0.9 and 0.8 · 0.9.
        names = ["drone 0 survives with 0.23", "drone 1 survives with 0.72"]
        assert [read.map_name(ax) for ax in own] == names
        assert read.visits_drawn(mission, own[0]) == {2: [1], 1: [2], 0: [3]}
        notes = read.words(team).split("; ")
        assert {"staying at dock: rover 2", "triangles: starts, hollow ones: ends"} <= set(notes)
        assert {text.get_text() for text in read.drawn(team, "robot")} == {"drone 0", "drone 1"}

    def test_robots_that_stay_do_so_where_they_start(self):
        mission = made.site([Kind("drone", 2, start="roof", end="roof"), Kind("rover", 1)])
        said = read.words(plots.plot_plan(mission, mission.stay_home()))
        assert "staying at roof: drone 0, drone 1; staying at dock: rover 2; triangles" in said
        alone = made.site([Kind("drone", 2, start="roof", end="roof")])
        assert "staying at roof: R0, R1" in read.words(plots.plot_plan(alone, alone.stay_home()))
        assert read.legend_texts(plots.plot_mission(alone))[:2] == ["base dock", "drone: 2 at roof"]


class TestPheromone:
    def test_arcs_are_the_wider_and_darker_the_more_of_it(self):
        table = made.pheromone_of(MUSEUM)
        ax = plots.plot_pheromone(MUSEUM, table)
        arrows = read.only(ax, "arrows")
        assert len(arrows.get_segments()) == 74
        assert np.all(np.diff(arrows.get_linewidths()) > 0)
        assert np.all(np.diff(read.luminance(arrows.get_colors())) < 0)
        places = dict(zip(MUSEUM.nodes, node_positions(MUSEUM), strict=True))
        last = [places[node] for node in table.loc[len(table) - 2, ["tail", "head"]]]
        assert np.allclose(arrows.get_segments()[-1][[0, -1]], last)
        # The self-loop's million is not on the scale.
        assert ax.child_axes[0].get_ylim() == (0, 73)
        assert bar_labels(ax) == [r"pheromone $\tau_R$"]

    def test_what_is_refused(self):
        table = made.pheromone_of(TOY)
        for changed, message in (
            (table.drop(columns="head"), r"it lacks \['head'\]"),
            (table.iloc[1:], "a finite pheromone of at least 0 for 1 -> 2, got None"),
            (table.assign(reward=-1.0), r"pheromone of at least 0 for 1 -> 2, got -1\.0"),
        ):
            with pytest.raises(ValueError, match=message):
                plots.plot_pheromone(TOY, changed)

    def test_of_one_kind(self):
        mission = made.site()
        table = made.pheromone_of(mission)
        ax = plots.plot_pheromone(mission, table[table["kind"] == "rover"])
        assert read.n_segments(ax, "arrows") == 4
        assert read.words(ax) == "pheromone of rover for reward"
        with pytest.raises(ValueError, match=r"one kind of robots .* kinds \['drone', 'rover'\]"):
            plots.plot_pheromone(mission, table)


class TestBackground:
    def test_it_lies_at_its_origin_and_black_is_1(self, tmp_path):
        found = read_background(made.write_map(tmp_path, [[0, 255, 255], [255, 255, 0]]), TOY)
        assert found.shares.tolist() == [[1, 0, 0], [0, 0, 1]]
        assert found.extent == (-1, 0.5, -2, -1)

    @pytest.mark.parametrize("more", ["", "mode: Scale\nfree_thresh: 0.0\noccupied_thresh: 1.0\n"])
    def test_nothing_is_drawn_where_the_map_is_transparent(self, tmp_path, recwarn, more):
        white, black, clear, half = [255] * 4, [0, 0, 0, 255], [0, 0, 0, 0], [0, 0, 0, 128]
        found = read_background(made.write_map(tmp_path, [[white, black, clear, half]], more), TOY)
        assert found.shares.tolist() == [[0, 1, 0, 0]]
        assert not recwarn.list

    def test_all_maps_have_it_and_show_no_more_than_without(self, tmp_path):
        path = made.write_map(tmp_path, np.zeros((40, 40)))
        for name, shown in (("plot_mission", [TOY]), ("plot_plan", [TOY, TOY_PLANS[2]])):
            draw = getattr(plots, name)
            bare, ax = draw(*shown), draw(*shown, background=path)
            assert (ax.get_xlim(), ax.get_ylim()) == (bare.get_xlim(), bare.get_ylim())
            maps = [one for one in ax.figure.axes if one.get_legend() or one is ax]
            assert len(maps) == len(shown)
            for one in maps:
                (image,) = one.images
                assert tuple(image.get_extent()) == (-1, 19, -2, 18)
                assert image.zorder < min(drawn.zorder for drawn in one.collections)
            assert not bare.images

    def test_it_needs_positions_and_a_map(self, tmp_path):
        graph = TOY.graph.copy()
        del graph.nodes[2]["pos"]
        bare, path = Mission(graph), made.write_map(tmp_path, [[0]])
        said = r"positions for the background .*map.yaml, but .*: 1 of 5 nodes have no position"
        with pytest.raises(ValueError, match=said):
            plots.plot_mission(bare, background=path)
        with pytest.raises(ValueError, match=said):
            plots.plot_plan(bare, bare.stay_home(), background=path)
        with pytest.raises(MissionError, match=r"none.yaml: no such file"):
            plots.plot_mission(TOY, background=tmp_path / "none.yaml")
