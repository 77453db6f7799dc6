"""What the pictures show; all of them are really rendered."""

import json
import math
import os
import subprocess
import sys
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree as ET

import matplotlib as mpl
import matplotlib.pyplot as plt
import networkx as nx
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text

import botohe_moo
from botohe_moo.bounds import bound_front
from botohe_moo.mission import Mission
from botohe_moo.plots import (
    plot_choices,
    plot_front,
    plot_mission,
    plot_pheromone,
    plot_plan,
    save_figure,
    save_plot,
)
from botohe_moo.plots.front import staircase
from botohe_moo.plots.site import node_positions
from tests.examples import examples
from tests.strategies import missions_with_plans

DATA = Path(botohe_moo.__file__).parent / "mission" / "data"
MUSEUM_TRAILS = [[1, 2, 3, 5, 4, 2, 1], [1, 2, 21, 2, 1], [1]]


@pytest.fixture(autouse=True)
def _close_figures():
    mpl.use("Agg")
    yield
    plt.close("all")


def load(name):
    text = (DATA / f"{name}.json").read_text()
    return Mission(nx.node_link_graph(json.loads(text), edges="edges"))


def make(nodes, arcs, *, robots=1, base="dock"):
    graph = nx.DiGraph(name="made")
    for node, attributes in nodes.items():
        graph.add_node(node, **attributes)
    for tail, head, survival in arcs:
        graph.add_edge(tail, head, survival=survival)
    return Mission(graph, base=base, robots=robots)


def lagoon():
    """One-way arcs, one pair of unequal arcs (cave, atoll), one pair of equal ones (dock, reef)."""
    return make(
        {n: {"reward": r} for n, r in {"dock": 0, "reef": 5, "cave": 0, "atoll": 8}.items()},
        [
            ("dock", "reef", 0.9),
            ("reef", "dock", 0.9),
            ("reef", "cave", 0.7),
            ("cave", "atoll", 0.6),
            ("atoll", "cave", 0.85),
            ("atoll", "dock", 0.95),
        ],
        robots=2,
    )


def alone(reward=2.0):
    return make({"dock": {"reward": reward}}, [])


def drawn(ax, name):
    """Return the artists that a picture calls so, by their labels."""
    return [artist for artist in ax.get_children() if artist.get_label() == f"_{name}"]


def fronts_drawn(ax):
    return [line for line in ax.lines if line.get_zorder() == 3]


def node_texts(ax):
    """Return the texts in and beside nodes."""
    others = ("_words", "_robot")
    return [text for text in ax.texts if text.get_label() not in others]


def only(ax, name):
    (artist,) = drawn(ax, name)
    return artist


def n_segments(ax, name):
    return sum(len(artist.get_segments()) for artist in drawn(ax, name))


def title(ax):
    return ax.get_title(loc="left")


def unbroken(text):
    return " ".join(text.split())


def words(ax):
    return only(ax, "words").get_text()


def plan_names(ax):
    return [text.get_text() for text in ax.texts if text.get_fontweight() == "bold"]


def legend_texts(ax):
    return [t.get_text() for t in ax.get_legend().get_texts() if t.get_text().strip()]


def bar_labels(ax):
    return [bar.get_ylabel() for bar in ax.child_axes]


def luminance(colours):
    return np.asarray(colours)[:, :3] @ [0.2126, 0.7152, 0.0722]


def rendered(ax, path):
    """The pixels of the saved picture."""
    save_figure(ax.figure, path)
    return plt.imread(path)[:, :, :3]


# Missions


@pytest.mark.parametrize(
    ("name", "n_nodes", "n_lines", "n_arrows"),
    [
        ("art_museum", 27, 37, 0),
        ("terrain_200", 200, 0, 1348),
    ],
)
def test_mission_shows_every_node_and_arc(tmp_path, name, n_nodes, n_lines, n_arrows):
    ax = plot_mission(load(name))
    assert len(only(ax, "nodes").get_offsets()) == n_nodes - 1
    assert len(only(ax, "base").get_offsets()) == 1
    assert n_segments(ax, "lines") == n_lines
    assert n_segments(ax, "arrows") == n_arrows
    assert len(only(ax, "heads").get_offsets()) == n_arrows
    assert bar_labels(ax) == ["reward", "survival"]
    pixels = rendered(ax, tmp_path / "mission.png")
    assert 900 < pixels.shape[1] < 1500
    assert 0.03 < (pixels.min(axis=2) < 0.9).mean() < 0.6


def test_museum_names_title_team_and_floors():
    mission = load("art_museum")
    ax = plot_mission(mission)
    assert title(ax) == "San Diego Museum of Art"
    assert legend_texts(ax) == ["3 robots at base 1", "no reward", "floor 1", "floor 2"]
    floors = drawn(ax, "zone")
    # The arc of the stairs, 2 - 21, is on neither floor.
    assert [len(floor.get_segments()) for floor in floors] == [56, 16]
    assert len({tuple(floor.get_color()[0]) for floor in floors}) == 2


def test_museum_labels_lie_in_their_nodes_and_apart(tmp_path):
    mission = load("art_museum")
    ax = plot_mission(mission)
    rendered(ax, tmp_path / "museum.png")
    labels = {t.get_text(): t.get_window_extent() for t in node_texts(ax)}
    assert sorted(labels, key=int) == [str(i) for i in range(1, 28)]
    assert not any(a.overlaps(b) for a, b in combinations(labels.values(), 2))
    radius = math.sqrt(only(ax, "nodes").get_sizes()[0]) / 2 * ax.figure.dpi / 72
    centres = ax.transData.transform(node_positions(mission))
    for node, (x, y) in zip(mission.nodes, centres, strict=True):
        box = labels[str(node)]
        assert math.hypot((box.x0 + box.x1) / 2 - x, (box.y0 + box.y1) / 2 - y) < radius / 3
        assert box.width < 2 * radius


def test_names_of_nodes_stand_where_there_is_room():
    def named(n):
        places = [[math.cos(6 * i / n), math.sin(6 * i / n)] for i in range(n)]
        nodes = {i: {"reward": 1, "pos": place} for i, place in enumerate(places)}
        return plot_mission(make(nodes, [(i, (i + 1) % n, 0.9) for i in range(n)], base=0))

    assert len(node_texts(named(30))) == 30
    crowded = named(300)
    assert not node_texts(crowded)
    assert words(crowded) == "no room for some names of nodes"


def test_nodes_are_darker_for_more_reward_and_hollow_for_none():
    mission = load("art_museum")
    ax = plot_mission(mission)
    fills = only(ax, "nodes").get_facecolors()
    reward = np.delete(mission.rewards, mission.index(mission.base))
    white = (fills[:, :3] == 1).all(axis=1)
    assert white.sum() == 3
    assert np.array_equal(white, reward == 0)
    outline = to_rgb(ax.get_legend().legend_handles[1].get_markeredgecolor())
    outlined = np.isclose(only(ax, "nodes").get_edgecolors()[:, :3], outline).all(axis=1)
    assert np.array_equal(outlined, white)
    shades = luminance(fills[~white])
    by_reward = [set(shades[np.isclose(reward[~white], r)]) for r in (0.1, 1 / 3, 2 / 3, 1.0)]
    assert [len(group) for group in by_reward] == [1, 1, 1, 1]
    assert sorted(by_reward, key=max, reverse=True) == by_reward


def test_unequal_and_one_way_arcs_are_arrows_bowed_to_their_right():
    mission = lagoon()
    ax = plot_mission(mission)
    assert n_segments(ax, "lines") == 1
    arrows = only(ax, "arrows").get_segments()
    xy = dict(zip(mission.nodes, node_positions(mission), strict=True))
    ends = [("reef", "cave"), ("cave", "atoll"), ("atoll", "cave"), ("atoll", "dock")]
    assert len(arrows) == len(ends)
    for tail, head in ends:
        (arrow,) = [a for a in arrows if np.allclose(a[[0, -1]], [xy[tail], xy[head]], atol=1e-9)]
        along, out = xy[head] - xy[tail], arrow[len(arrow) // 2] - (xy[head] + xy[tail]) / 2
        assert along[0] * out[1] - along[1] * out[0] < 0
        assert 0.03 < np.hypot(*out) / np.hypot(*along) < 0.12


def test_layout_is_reproducible_and_used_when_one_pos_is_missing():
    graph = nx.DiGraph(load("toy").graph)
    del graph.nodes[3]["pos"]
    first, again = (node_positions(Mission(graph)) for _ in range(2))
    assert np.array_equal(first, again)
    assert not np.allclose(first[4], [1.6, 0.5])
    assert min(math.dist(a, b) for a, b in combinations(first, 2)) > 0.1
    big = nx.DiGraph(nx.cycle_graph(61))
    nx.set_node_attributes(big, 1.0, "reward")
    nx.set_edge_attributes(big, 0.9, "survival")
    first, again = (node_positions(Mission(big, base=0, robots=1)) for _ in range(2))
    assert np.array_equal(first, again)
    assert first.shape == (61, 2)


@examples(12)
@given(missions_with_plans())
def test_any_mission_is_drawn_whole(case):
    mission, plan = case
    ax = plot_mission(mission, ax=Figure().subplots())
    twins = sum(
        mission.graph.has_edge(v, u) and mission.graph.edges[v, u]["survival"] == s
        for u, v, s in mission.graph.edges(data="survival")
    )
    assert n_segments(ax, "lines") == twins / 2
    assert n_segments(ax, "arrows") == mission.world.graph.n_arcs - twins
    trails = plot_plan(mission, plan, ax=Figure().subplots())
    assert n_segments(trails, "trails") == sum(len(trail) - 1 for trail in plan.trails)


def test_passages_of_one_arc_lie_side_by_side():
    mission = load("toy")
    _, ax = plt.subplots()
    plot_plan(mission, mission.plan([[1, 3, 4, 3, 1], [1, 3, 4, 3, 1]]), ax=ax)
    middles = np.array([s[len(s) // 2] for s in only(ax, "trails").get_segments()])
    assert len(middles) == 8
    assert min(math.dist(a, b) for a, b in combinations(middles, 2)) > 0.005
    # 1 -> 3 runs down to the right, so its right-hand side is below the line through both nodes.
    for k, sign in [(0, -1), (3, 1), (4, -1), (7, 1)]:
        assert np.sign(middles[k] @ [1, 1] - 0.5) == sign


# Fronts


@given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), max_size=8))
def test_staircase_bounds_the_cells_that_some_plan_reaches(points):
    corners = staircase(np.array(points, dtype=float).reshape(-1, 2))
    x, y = corners.T
    area = abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
    cells = {(i, j) for a, b in points for i in range(a) for j in range(b)}
    assert area == len(cells)


def test_front_with_mission_gives_normalised_area_and_fixed_limits(tmp_path):
    # 4 · 1.5 + 4 · 1 = 10 of 10 rewards x 2 robots.
    ax = plot_front([[8, 1], [4, 1.5], [4, 1]], load("toy"))
    assert words(ax) == "area 0.5000, 3 plans"
    assert ax.get_xlim() == (0, 10)
    assert ax.get_ylim() == (0, 2)
    assert ax.get_xlabel() == "expected team reward E[R]"
    assert ax.get_ylabel() == "expected number of survivors E[S]"
    assert fronts_drawn(ax)[0].get_xydata().tolist() == [[8, 1], [4, 1.5]]
    assert only(ax, "dominated").get_xydata().tolist() == [[4, 1]]
    assert ax.get_legend() is None
    assert (rendered(ax, tmp_path / "front.png") < 0.9).any()


def test_front_without_mission_gives_plain_area():
    ax = plot_front([[8, 1], [4, 1.5]])
    assert words(ax) == "area 10, 2 plans"
    assert ax.get_xlim() == (0, 8.4)
    assert ax.get_ylim() == pytest.approx((0, 1.575))


def test_fronts_overlay():
    mission = load("toy")
    ax = plot_front([[8, 1], [4, 1.5]], mission, label="bo-aco")
    assert plot_front([[5, 1]], mission, label="random", ax=ax) is ax
    assert legend_texts(ax) == [
        "bo-aco: area 0.5000, 2 plans",
        "random: area 0.2500, 1 plan",
    ]
    assert unbroken(title(ax)) == mission.title
    assert not drawn(ax, "words")
    fronts = fronts_drawn(ax)
    assert len(fronts) == len(drawn(ax, "area")) == 2
    assert fronts[0].get_color() != fronts[1].get_color()
    assert fronts[0].get_marker() != fronts[1].get_marker()


def test_empty_front(tmp_path):
    empty = np.empty((0, 2))
    ax = plot_front(empty, load("toy"))
    assert words(ax) == "area 0.0000, 0 plans"
    assert ax.get_xlim() == (0, 10)
    rendered(ax, tmp_path / "empty.png")
    bare = plot_front(empty, label="none")
    assert legend_texts(bare) == ["none: area 0, 0 plans"]
    assert bare.get_xlim() == (0, 1)


def test_highlighted_plans_are_ringed_and_named():
    ax = plot_front([[8, 1], [4, 1.5], [2, 1.7]], highlight=[2, 0])
    assert [ring.get_xydata().tolist() for ring in drawn(ax, "highlight")] == [[[2, 1.7]], [[8, 1]]]
    assert plan_names(ax) == ["plan 2", "plan 0"]
    assert plan_names(plot_front([[8, 1]], highlight=0)) == ["plan 0"]
    named = plot_front([[8, 1], [4, 2]], highlight={1: "knee $<>$"})
    assert plan_names(named) == ["plan 1: knee $<>$"]
    assert not plan_names(plot_front([[8, 1]], highlight={}))


@pytest.mark.slow
def test_names_of_highlighted_plans_do_not_overlap():
    reward = np.linspace(0, 10, 200)
    points = np.column_stack([reward, 2 - reward**2 / 50])
    rows = [0, 100, 101, 102, 103, 150, 198, 199]
    ax = plot_front(points, load("toy"), highlight=dict.fromkeys(rows, "one of those"))
    ax.figure.draw_without_rendering()
    boxes = [Text.get_window_extent(text) for text in ax.texts if text.get_fontweight() == "bold"]
    assert len(boxes) == len(rows)
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
    whole = ax.figure.bbox
    assert all(whole.x0 <= b.x0 and b.x1 <= whole.x1 and b.y1 <= whole.y1 for b in boxes)
    rings = ax.transData.transform(points[rows])
    assert not any(box.contains(*ring) for box in boxes for ring in rings)


def test_front_of_bad_values_is_refused():
    with pytest.raises(ValueError, match=r"without NaN and infinity, got \[nan, 1.0\] in row 1"):
        plot_front([[1, 1], [math.nan, 1]])
    with pytest.raises(ValueError, match=r"Expected highlight in \[0, 0\], got 1"):
        plot_front([[1, 1]], highlight=1)


def opened(ax):
    (patch,) = [patch for patch in ax.patches if "open" in patch.get_label()]
    return patch


def enclosed(artist):
    x, y = artist.get_xy().T
    return abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def test_what_a_bound_leaves_open_is_shaded_and_told(tmp_path):
    toy = load("toy")
    bound = bound_front(toy)
    front = [[7, 1], [4, 1.5], [3, 1]]  # an area of 9 of 10 rewards x 2 robots
    ax = plot_front(front, toy, bound=bound)
    assert legend_texts(ax) == [f"open: at most {100 * (bound.area / 0.45 - 1):.2f} % more area"]
    assert words(ax) == "area 0.4500, 3 plans"
    assert ax.get_xlim() == (0, 10)
    assert enclosed(only(ax, "area")) == pytest.approx(9)
    assert enclosed(opened(ax)) == pytest.approx(20 * bound.area - 9)
    assert only(ax, "bound").get_xydata().tolist() == staircase(bound.points)[:-1].tolist()
    plain = plot_front(front, toy)
    assert (rendered(ax, tmp_path / "open.png") != rendered(plain, tmp_path / "plain.png")).any()


# Pheromone


def pheromone_of(mission):
    rows = [(u, v, float(i), 1.0) for i, (u, v) in enumerate(mission.graph.edges)]
    rows.append((mission.base, mission.base, 1e6, 1e6))
    return pd.DataFrame(rows, columns=["tail", "head", "reward", "survival"])


def test_pheromone_widens_and_darkens_arcs(tmp_path):
    mission = load("art_museum")
    pheromone = pheromone_of(mission)
    ax = plot_pheromone(mission, pheromone)
    arrows = only(ax, "arrows")
    assert len(arrows.get_segments()) == 74
    assert np.all(np.diff(arrows.get_linewidths()) > 0)
    assert np.all(np.diff(luminance(arrows.get_colors())) < 0)
    last = pheromone.iloc[-2]
    places = dict(zip(mission.nodes, node_positions(mission), strict=True))
    ends = arrows.get_segments()[-1][[0, -1]]
    assert np.allclose(ends, [places[last["tail"]], places[last["head"]]])
    # The self-loop's million is not on the scale.
    assert ax.child_axes[0].get_ylim() == (0, 73)
    assert bar_labels(ax) == [r"pheromone $\tau_R$"]
    assert (rendered(ax, tmp_path / "pheromone.png") < 0.9).any()


def test_malformed_pheromone_is_refused():
    mission = load("toy")
    table = pheromone_of(mission)
    for changed, message in (
        (table.drop(columns="head"), r"it lacks \['head'\]"),
        (table.iloc[1:], "a finite pheromone of at least 0 for 1 -> 2, got None"),
        (table.assign(reward=-1.0), r"pheromone of at least 0 for 1 -> 2, got -1\.0"),
    ):
        with pytest.raises(ValueError, match=message):
            plot_pheromone(mission, changed)


# Manners

PICTURES = {
    "mission": lambda ax: plot_mission(load("toy"), ax=ax),
    "front": lambda ax: plot_front([[8, 1]], load("toy"), label="one", ax=ax),
    "bound": lambda ax: plot_front([[7, 1]], load("toy"), bound=bound_front(load("toy")), ax=ax),
    "pheromone": lambda ax: plot_pheromone(load("toy"), pheromone_of(load("toy")), ax=ax),
    "plan": lambda ax: plot_plan(load("toy"), load("toy").plan([[1, 3, 1], [1]]), ax=ax),
    "choices": lambda ax: plot_choices(load("toy"), [load("toy").plan([[1, 3, 1], [1]])], ax=ax),
}


def test_save_figure_replaces_whole_files_or_nothing(tmp_path, monkeypatch):
    path = tmp_path / "front.png"
    ax = plot_front([[1, 1]])
    path.write_text("old")
    with monkeypatch.context() as patch:

        def fail_half_way(target, **_):
            target.write(b"half")
            raise OSError("disk full")

        patch.setattr(ax.figure, "savefig", fail_half_way)
        with pytest.raises(OSError, match="disk full"):
            save_figure(ax.figure, path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
    save_figure(ax.figure, str(path), dpi=50)
    assert plt.imread(path).shape[1] < 400
    assert list(tmp_path.iterdir()) == [path]


def test_own_axes_are_the_only_ones_drawn_on():
    for picture in PICTURES.values():
        fig, (mine, other) = plt.subplots(1, 2)
        before = len(other.get_children())
        assert picture(mine) is mine
        assert plt.get_fignums() == [fig.number]
        assert fig.axes == [mine, other]
        assert len(other.get_children()) == before
        assert other.get_xlim() == (0, 1)
        assert title(mine)
        plt.close(fig)


def test_all_formats_are_written_and_leave_the_settings_of_matplotlib(tmp_path):
    paths = [tmp_path / f"picture.{end}" for end in ("png", "pdf", "svg")]
    before = dict(mpl.rcParams)
    save_plot(PICTURES["mission"](None), *paths)
    assert dict(mpl.rcParams) == before
    png, pdf, svg = (path.read_bytes() for path in paths)
    assert png.startswith(b"\x89PNG")
    assert pdf.startswith(b"%PDF")
    assert ET.fromstring(svg).tag.endswith("svg")
    with pytest.raises(ValueError, match=r"ends in one of \.png, \.pdf, \.svg; found .*jpg"):
        save_plot(PICTURES["front"](None), tmp_path / "a.jpg")


@pytest.mark.slow
def test_a_backend_that_draws_at_once_still_does_so_after_the_first_picture(tmp_path):
    """As that of notebooks, which shows no figure where matplotlib is not interactive."""
    backend = "import matplotlib\nfrom matplotlib.backends.backend_agg import *\n"
    (tmp_path / "at_once.py").write_text(f"{backend}matplotlib.interactive(True)\n")
    code = """
import matplotlib
from botohe_moo import plot_front
plot_front([[1.0, 2.0]])
print(matplotlib.is_interactive())
"""
    path = os.pathsep.join([str(tmp_path), *sys.path])
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "MPLBACKEND": "module://at_once", "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "True\n"
