"""Pictures of missions with kinds of robots, and with rewards on return."""

import matplotlib as mpl
import matplotlib.pyplot as plt
import networkx as nx
import numpy as np
import pandas as pd
import pytest
from matplotlib.patches import Patch

from botohe_moo import Kind, Mission
from botohe_moo.plots import plot_mission, plot_pheromone, plot_plan
from botohe_moo.plots.canvas import robot_styles
from botohe_moo.plots.style import SURVIVAL
from tests.plots.test_plan_plots import arcs_drawn, arcs_of, map_name, maps_of, visits_drawn
from tests.plots.test_plots import (
    bar_labels,
    drawn,
    legend_texts,
    n_segments,
    only,
    unbroken,
    words,
)

PLACES = {"dock": (0, 0), "hall": (1, 0), "pond": (2, 0.5), "quay": (2, -0.5), "roof": (1, 1)}
REWARDS = {"dock": 0, "hall": 2, "pond": 5, "quay": 1, "roof": 0}
KINDS = [Kind("drone", 2, start="roof"), Kind("rover", 1)]
TRAILS = [["roof", "pond", "hall", "dock"], ["roof", "hall", "dock"], ["dock"]]


@pytest.fixture(autouse=True)
def _close_figures():
    mpl.use("Agg")
    yield
    plt.close("all")


def site(kinds=KINDS, pays="arrival", **more):
    """Rovers take neither the roof nor the pond; quay -> pond is one way, and for drones."""
    graph = nx.DiGraph()
    for node, place in PLACES.items():
        graph.add_node(node, pos=place, reward=REWARDS[node])
    for tail, head, drone, rover in [
        ("dock", "hall", 0.9, 0.8),
        ("hall", "quay", 0.9, 0.95),
        ("hall", "pond", 0.5, 0),
        ("hall", "roof", 0.8, 0),
        ("roof", "pond", 0.5, 0),
    ]:
        survival = {"drone": drone, "rover": rover, "scout": drone}
        survival = {kind.name: survival[kind.name] for kind in kinds}
        graph.add_edge(tail, head, survival=survival)
        graph.add_edge(head, tail, survival=survival)
    one_way = {"drone": 0.7, "rover": 0, "scout": 0.6}
    graph.add_edge("quay", "pond", survival={kind.name: one_way[kind.name] for kind in kinds})
    return Mission(graph, base="dock", kinds=kinds, pays=pays, name="site", **more)


def mixed():
    """The quay is a depot, the pond pays on return, and only rovers collect in the hall."""
    graph = nx.DiGraph(site().graph)
    graph.nodes["quay"]["depot"] = True
    graph.nodes["pond"]["pays"] = "return"
    graph.nodes["hall"]["share"] = {"drone": 0}
    return Mission(graph, base="dock", kinds=KINDS)


class TestMission:
    def test_arcs_are_drawn_once_and_what_some_can_do_is_shaded(self):
        ax = plot_mission(mixed())
        assert n_segments(ax, "lines") == 5
        assert n_segments(ax, "arrows") == 1
        assert n_segments(ax, "only") == 4  # to pond and roof, and the one way
        assert len(only(ax, "nodes").get_offsets()) == 3
        assert only(ax, "depots").get_offsets().tolist() == [list(PLACES["quay"])]
        assert only(ax, "rings").get_offsets().tolist() == [list(PLACES["pond"])]
        shades = [mark.get_offsets().tolist() for mark in drawn(ax, "behind")]
        assert sorted(shades) == [[list(PLACES["hall"])], [list(PLACES["pond"])]]
        assert legend_texts(ax) == [
            "base dock",
            "drone: 2 from roof to dock",
            "rover: 1 at dock",
            "depot",
            "pays on return",
            "no reward",
            "only drone",
            "only rover",
        ]

    def test_arcs_have_the_colour_of_the_safest_kind(self):
        ax = plot_mission(site())
        assert bar_labels(ax) == ["reward", "survival (safest kind)"]
        assert ax.child_axes[1].get_ylim() == (0.5, 0.95)
        lines = only(ax, "lines")
        far = {tuple(line[-1]): i for i, line in enumerate(lines.get_segments())}
        colours = [tuple(lines.get_colors()[far[PLACES[end]]]) for end in ("quay", "hall")]
        # hall - quay is safest for rovers, dock - hall for drones.
        assert colours == [SURVIVAL(1.0), SURVIVAL((0.9 - 0.5) / 0.45)]

    def test_sets_of_kinds_that_can_do_the_same_have_a_key_each(self):
        ax = plot_mission(site([*KINDS, Kind("scout", 1)]))
        assert legend_texts(ax)[-1] == "only drone and scout"
        bands = drawn(ax, "only")
        assert [len(band.get_segments()) for band in bands] == [4, 4]
        assert len({tuple(band.get_color()[0]) for band in bands}) == 2

    def test_zones_have_none_of_the_colours_of_kinds(self):
        graph = nx.DiGraph(site().graph)
        nx.set_node_attributes(graph, {"hall": "in", "pond": "out"}, "zone")
        handles = plot_mission(Mission(graph, base="dock", kinds=KINDS)).get_legend().legend_handles
        looks = [handle.get_facecolor()[:3] for handle in handles if isinstance(handle, Patch)]
        hues = [tuple(np.round((1 - np.array(c)) / (1 - min(c)), 2)) for c in looks]
        assert len({*hues}) == len(hues) == 3

    def test_rings_are_left_out_if_all_pays_on_return(self):
        ax = plot_mission(site(pays="return"))
        assert not drawn(ax, "rings")
        assert words(ax) == "all rewards count on return"

    def test_one_kind_that_starts_elsewhere_is_robots(self):
        mission = site([Kind("drone", 2, start="roof", end="roof")])
        assert legend_texts(plot_mission(mission))[:2] == ["base dock", "drone: 2 at roof"]
        ax = plot_plan(mission, mission.stay_home())
        assert "staying at roof: R0, R1" in words(ax)


class TestPlans:
    def test_kinds_differ_in_colour_and_their_robots_in_dash(self):
        styles = robot_styles(site())
        assert [style.name for style in styles] == ["drone 0", "drone 1", "rover 2"]
        assert styles[0].colour == styles[1].colour != styles[2].colour
        assert styles[0].dash == styles[2].dash != styles[1].dash

    def test_trails_and_names(self):
        mission = site()
        plan = mission.plan(TRAILS)
        team, *own = maps_of(plot_plan(mission, plan))
        trails = mission.trails(plan)
        assert arcs_drawn(mission, team) == arcs_of(*trails)
        # 0.5 · 0.5 · 0.9 and 0.8 · 0.9.
        names = ["drone 0 survives with 0.23", "drone 1 survives with 0.72"]
        assert [map_name(ax) for ax in own] == names
        assert visits_drawn(mission, own[0]) == {2: [1], 1: [2], 0: [3]}
        notes = words(team).split("; ")
        assert {"staying at dock: rover 2", "triangles: starts, hollow ones: ends"} <= set(notes)
        assert {text.get_text() for text in drawn(team, "robot")} == {"drone 0", "drone 1"}

    def test_robots_that_stay_do_so_where_they_start(self):
        mission = site([Kind("drone", 2, start="roof", end="roof"), Kind("rover", 1)])
        said = words(plot_plan(mission, mission.stay_home()))
        assert "staying at roof: drone 0, drone 1; staying at dock: rover 2; " in unbroken(said)
        assert said.endswith("; triangles: starts")


def pheromone(mission):
    """A row for each arc of each kind."""
    nodes, n = mission.nodes, len(mission.nodes)
    rows = [
        {"kind": mission.kinds[tail // n].name, "tail": nodes[tail % n], "head": nodes[head % n]}
        for tail, head in zip(mission.world.graph.tail, mission.world.graph.head, strict=True)
    ]
    return pd.DataFrame(rows).assign(reward=1.0, survival=2.0)


def test_pheromone_is_drawn_of_one_kind():
    mission = site()
    table = pheromone(mission)
    ax = plot_pheromone(mission, table[table["kind"] == "rover"])
    assert n_segments(ax, "arrows") == 4
    assert words(ax) == "pheromone of rover for reward"
    with pytest.raises(ValueError, match=r"one kind of robots .*, got kinds \['drone', 'rover'\]"):
        plot_pheromone(mission, table)
