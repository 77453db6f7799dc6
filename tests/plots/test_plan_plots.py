"""What the pictures of plans show: what is drawn is read back and compared with the plan."""

import itertools
import math
import re
import warnings
from collections import defaultdict

import matplotlib as mpl
import matplotlib.pyplot as plt
import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from matplotlib.text import Text

from botohe_moo import Mission
from botohe_moo.plots import (
    plot_choices,
    plot_mission,
    plot_plan,
    save_plot,
)
from botohe_moo.plots.canvas import robot_styles
from botohe_moo.plots.site import node_positions
from botohe_moo.plots.style import REACH
from tests.examples import examples
from tests.plots.test_plots import (
    MUSEUM_TRAILS,
    drawn,
    legend_texts,
    load,
    make,
    node_texts,
    only,
    title,
    words,
)
from tests.strategies import missions_with_plans


@pytest.fixture(autouse=True)
def _close_figures():
    mpl.use("Agg")
    yield
    plt.close("all")


def nodes_at(mission, points):
    """The indices of the nodes nearest to points."""
    away = node_positions(mission)[:, None] - np.reshape(points, (-1, 2))
    return np.hypot(*away.T).argmin(axis=1).tolist()


def ends_drawn(ax):
    """Where the trails of a map begin and end on each arc (n, 2, 2), in their order."""
    segments = [s for lines in drawn(ax, "trails") for s in lines.get_segments()]
    return np.array([s[[0, -1]] for s in segments]).reshape(-1, 2, 2)


def arcs_drawn(mission, ax):
    """The arcs, as node indices, that the trails of a map follow, in their order."""
    nodes = nodes_at(mission, ends_drawn(ax))
    return list(zip(nodes[::2], nodes[1::2], strict=True))


def arcs_of(*trails):
    return [arc for trail in trails for arc in itertools.pairwise(trail)]


def visits_drawn(mission, ax):
    """The numbers at each node of a robot's map."""
    texts = node_texts(ax)
    nodes = nodes_at(mission, [text.xy for text in texts])
    numbers = [[int(part) for part in text.get_text().split(",")] for text in texts]
    return dict(zip(nodes, numbers, strict=True))


def visits_of(trail):
    numbers = defaultdict(list)
    for i, node in enumerate(trail[1:], start=1):
        numbers[node].append(i)
    return dict(numbers)


def shades_drawn(mission, ax):
    """The colour of each node that a trail touches."""
    marks = [only(ax, name) for name in ("nodes", "base")]
    nodes = nodes_at(mission, np.concatenate([mark.get_offsets() for mark in marks]))
    fills = np.concatenate([mark.get_facecolors() for mark in marks])
    return dict(zip(nodes, map(tuple, fills), strict=True))


def reach_of(mission, trail):
    """The probability with which a robot reaches each node of its trail, step by step."""
    chance, found = 1.0, {trail[0]: 1.0}
    for tail, head in itertools.pairwise(trail):
        chance *= mission.graph.edges[mission.nodes[tail], mission.nodes[head]]["survival"]
        found.setdefault(head, chance)
    return found


def texts_of(ax):
    """The boxes in pixels of all texts on a map, without the lines that tie them to nodes."""
    return [Text.get_window_extent(text) for text in [*node_texts(ax), *drawn(ax, "robot")]]


def maps_of(ax):
    return ax.figure.axes


def map_name(ax):
    (name,) = legend_texts(ax)
    return name


class TestPlan:
    def test_every_robot_that_leaves_has_a_map_and_the_others_are_told(self):
        mission = load("art_museum")
        ax = plot_plan(mission, mission.plan(MUSEUM_TRAILS))
        maps = maps_of(ax)
        assert maps[0] is ax
        assert [map_name(own) for own in maps] == [
            "all robots",
            f"R0 survives with {0.9**2 * 0.97**2 * 0.9**2:.2f}",
            "R1 survives with 0.52",
        ]
        reward, survivors = mission.evaluate([mission.plan(MUSEUM_TRAILS)])[0]
        assert title(ax) == "San Diego Museum of Art"
        objectives = f"E[R] = {reward:.2f}, E[S] = {survivors:.2f}"
        assert words(ax) == f"{objectives}; numbers: order of visit; staying at 1: R2"

    def test_trails_are_those_of_the_plan(self):
        mission = load("art_museum")
        plan = mission.plan(MUSEUM_TRAILS)
        team, first, second = maps_of(plot_plan(mission, plan))
        assert arcs_drawn(mission, team) == arcs_of(*plan.trails)
        assert arcs_drawn(mission, first) == arcs_of(plan.trails[0])
        assert arcs_drawn(mission, second) == arcs_of(plan.trails[1])

    def test_visits_are_numbered_in_their_order(self):
        mission = load("art_museum")
        plan = mission.plan(MUSEUM_TRAILS)
        _, first, second = maps_of(plot_plan(mission, plan))
        assert visits_drawn(mission, first) == visits_of(plan.trails[0])
        assert visits_drawn(mission, second) == {1: [1, 3], 20: [2], 0: [4]}

    def test_nodes_are_as_dark_as_they_are_likely_to_be_reached(self):
        mission = load("art_museum")
        plan = mission.plan(MUSEUM_TRAILS)
        team, *own = maps_of(plot_plan(mission, plan))
        palette = REACH
        missed = defaultdict(lambda: 1.0)
        for ax, trail in zip(own, plan.trails, strict=False):
            reach = reach_of(mission, trail)
            shades = shades_drawn(mission, ax)
            assert {v: shades[v] for v in reach} == {v: palette(p) for v, p in reach.items()}
            for node, chance in reach.items():
                missed[node] *= 1 - chance
        shades = shades_drawn(mission, team)
        assert {v: shades[v] for v in missed} == {v: palette(1 - p) for v, p in missed.items()}
        light = [np.mean(palette(p)[:3]) for p in np.linspace(0, 1, 11)]
        assert np.all(np.diff(light) < 0)
        assert team.figure.axes[1].child_axes[0].get_ylim() == (0, 1)

    @pytest.mark.slow
    def test_no_texts_overlap(self):
        mission = load("art_museum")
        ax = plot_plan(mission, plan_of(mission, tour(mission)))
        ax.figure.draw_without_rendering()
        for own in maps_of(ax):
            boxes = texts_of(own)
            assert len(boxes) >= 20
            assert not any(a.overlaps(b) for a, b in itertools.combinations(boxes, 2))
            limits = own.get_window_extent().padded(3)
            assert all(limits.contains(b.x0, b.y0) and limits.contains(b.x1, b.y1) for b in boxes)

    def test_robots_that_all_stay_have_no_maps(self):
        mission = load("toy")
        ax = plot_plan(mission, mission.stay_home())
        assert maps_of(ax) == [ax]
        assert words(ax) == "E[R] = 0.00, E[S] = 2.00; staying at 1: R0, R1"
        assert not drawn(ax, "trails")

    def test_places_that_are_made_up_are_told(self):
        mission = load("art_museum")
        graph = nx.DiGraph(mission.graph)
        del graph.nodes[3]["pos"]
        mission = Mission(graph, base=1, robots=3)
        note = "the places of the nodes on this map are made up: 1 of 27 nodes have no position"
        plan = mission.plan(MUSEUM_TRAILS)
        pictures = [plot_plan(mission, plan), plot_mission(mission), plot_choices(mission, [plan])]
        for ax in pictures:
            assert note in " ".join(words(ax).split())

    def test_texts_are_shown_as_they_are(self, tmp_path):
        names = ['dock "A"', "<reef>", "$cave$", "שלום", "</script>", "b\\c", "x_1^2"]
        arcs = [(a, b, 0.9) for a, b in itertools.pairwise([*names, names[0]])]
        mission = make({name: {"reward": 1} for name in names}, arcs, base=names[0], robots=2)
        plan = mission.plan([[*names, names[0]], names[:1]])
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            ax = plot_plan(mission, plan, title="<b> $x$")
            shown = {text.get_text() for text in node_texts(ax)}
            assert shown == set(names)
            assert title(ax) == "<b> $x$"
            save_plot(ax, *(tmp_path / f"plan.{end}" for end in ("png", "svg", "pdf")))

    def test_one_map_on_given_axes(self):
        mission = load("art_museum")
        plan = mission.plan(MUSEUM_TRAILS)
        _, ax = plt.subplots()
        assert plot_plan(mission, plan, ax=ax) is ax
        assert legend_texts(ax) == ["R0 survives with 0.62", "R1 survives with 0.52"]
        assert words(ax).endswith("staying at 1: R2")
        assert arcs_drawn(mission, ax) == arcs_of(*plan.trails)
        styles = robot_styles(mission)
        handles = ax.get_legend().legend_handles
        assert [handle.get_color() for handle in handles] == [s.colour for s in styles[:2]]

    @examples(10)
    @given(missions_with_plans())
    def test_any_plan_is_drawn_as_it_is(self, case):
        mission, plan = case
        team, *own = maps_of(plot_plan(mission, plan))
        assert arcs_drawn(mission, team) == arcs_of(*plan.trails)
        out = [trail for trail in plan.trails if len(trail) > 1]
        assert len(own) == len(out)
        for ax, trail in zip(own, out, strict=True):
            assert arcs_drawn(mission, ax) == arcs_of(trail)
            if not re.search("no room|small", map_name(ax)):
                assert visits_drawn(mission, ax) == visits_of(trail)
        plt.close("all")


def tour(mission, most=math.inf):
    """A trail around a tree that is searched in depth, of all nodes or so many steps, and home."""
    trail, way = [mission.base], [mission.base]
    for tail, head, kind in nx.dfs_labeled_edges(mission.graph, mission.base):
        if tail == head or kind == "nontree" or len(trail) > most:
            continue
        way = [*way, head] if kind == "forward" else way[:-1]
        trail.append(way[-1])
    # In these missions every arc has its opposite.
    return [*trail, *way[-2::-1]]


def plan_of(mission, trail):
    return mission.plan([trail, *[[mission.base]] * (mission.robots - 1)])
