"""Pictures of plans: the trails of one on maps, a front with maps of some plans, and a new plan."""

from __future__ import annotations

import os
from collections.abc import Hashable, Sequence
from textwrap import fill
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D

from botohe_moo.base.messages import probability_text
from botohe_moo.base.types import FloatArray
from botohe_moo.decide import knees, representatives
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.outcomes import reach_probabilities, team_chances
from botohe_moo.plots import canvas as maps
from botohe_moo.plots import site as where
from botohe_moo.plots import style as look
from botohe_moo.plots.canvas import Canvas, RobotStyle, open_axes, robot_styles
from botohe_moo.plots.front import front_summary, plot_front
from botohe_moo.plots.style import Space, objectives_text, text_size, title_above
from botohe_moo.trails import Plans, TrailPlan

if TYPE_CHECKING:
    from botohe_moo.underway import Replan

_MOST_MAPS = 24
_GROUND = "#c9c9c9"

# In points:
_SMALLEST = 1.6  # least radius of a node on a trail
_LEGIBLE = 2.2  # least radius of a node for what is off the trails to be drawn
_NUMBERS = 6.5  # height of numbers beside nodes
_ROBOTS = 7.0  # height of names of robots
_NEAR = 1.5  # how far the names of many nodes may be from them

# In inches:
_NAME = 0.5  # height of the name below each map
_ABOVE = 0.8  # height of the title over all maps
_BESIDE = 0.9  # width of the numbers left of a front, and of the key right of all maps

_LINE = 14  # most letters in a line of numbers beside a node
_SHAPE = 1.2  # the preferred width of a figure, divided by its height


def plot_plan(
    mission: Mission,
    plan: TrailPlan,
    *,
    background: str | os.PathLike[str] | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the trails of a plan: all of them on one map, and those of each robot on its own.

    On the maps of single robots visits are numbered in their order, and nodes are the darker the
    more likely that robot reaches them; on the map of all robots nodes have their names, and are
    the darker the more likely any robot reaches them. Trails keep to the right of their arcs, so
    that both directions are seen. Robots, R0, R1, ... in the order of the plan, differ in colour,
    dash and label; kinds of robots differ in colour, and the robots of a kind in dash and label. A
    triangle marks where a kind starts, a hollow one where it ends, and depots are squares. What
    would be too small to see is not drawn, and the line under the title says so: nodes and arcs
    off the trails of large missions, and names and numbers without room.

    Parameters
    ----------
    mission
        The mission.
    plan
        A plan that is valid for it.
    background
        File of a map of the site, YAML as for ROS's map server, to draw faintly behind each map.
        Its origin and resolution are in the units of ``pos``.
    title
        Name of the picture. Default: the mission's title.
    ax
        Axes for the map of all robots, which is then the only one, with a legend below. By default
        a figure with all maps will be created, of at most 24 robots that leave their place.

    Returns
    -------
    matplotlib.axes.Axes
        The axes of the map of all robots.

    Raises
    ------
    PlanError
        If the mission does not allow ``plan``.
    TypeError
        If ``mission`` is not a Mission or ``plan`` not a TrailPlan.
    ValueError
        If the ``pos`` of a node is not two finite numbers, the background cannot be read, or there
        is one and not all nodes have positions.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.plots import plot_plan, save_plot
    >>> toy = load_mission("toy")
    >>> save_plot(plot_plan(toy, toy.plan([[1, 2, 4, 2, 1], [1, 2, 1]])), "plan.png")
    """
    shown = DrawnPlan(mission, plan)
    behind = where.read_background(background, mission)
    with look.theme():
        if ax is None:
            robots = shown.leaving[:_MOST_MAPS]
            # Between more than three, the map of all robots is larger: trails share its arcs.
            span = 2 if len(robots) == 2 or len(robots) > 3 else 1
            axes = _open_sheet(mission, len(robots), span)
        else:
            robots, axes = [], [ax]
        for one in axes:
            open_axes(mission, one, behind)
        _add_reach_bar(axes)
        first, *others = axes
        if robots:
            _name_map(first, "all robots")
        else:
            shown.add_legend(first)
        notes = [shown.objectives, *shown.staying, *shown.draw_team(first), *shown.marks]
        for small, robot in zip(others, robots, strict=True):
            shown.draw_robot(small, robot)
        if robots:
            notes.insert(1, "numbers on each robot's own map: order of visit")
        if 0 < len(robots) < len(shown.leaving):
            notes.append(f"maps of {len(robots)} of the {len(shown.leaving)} robots that leave")
        title_above(first, mission.title if title is None else title, "; ".join(notes))
    return first


def plot_choices(
    mission: Mission, plans: Plans, *, k: int = 5, title: str | None = None, ax: Axes | None = None
) -> Axes:
    """Draw a front with its knee and ``k`` representatives, and a map of each of them.

    Plans have the numbers of their rows in ``plans``, from 0. Named are the plan that is farthest
    from the chord of the front, and that of the largest E[R] times E[S]. On the maps nodes are the
    darker the more likely any robot reaches them.

    Parameters
    ----------
    mission, plans
        As for :func:`botohe_moo.decide.choose`.
    k
        How many representatives, as for :func:`botohe_moo.decide.representatives`.
    title
        Name of the picture. Default: the mission's title.
    ax
        Axes for the front, which is then drawn without maps. By default a figure with both will
        be created.

    Returns
    -------
    matplotlib.axes.Axes
        The axes of the front.

    Raises
    ------
    PlanError
        If the mission does not allow one of the plans.
    TypeError
        If ``mission`` is not a Mission, or something in ``plans`` not a TrailPlan.
    ValueError
        If there is no plan, or ``k`` is not an integer of at least 1.

    Examples
    --------
    >>> from botohe_moo import solve
    >>> from botohe_moo.plots import plot_choices, save_plot
    >>> solution = solve("toy", "greedy", evaluations=100)
    >>> save_plot(plot_choices(solution.mission, solution.plans, k=2), "choices.png")
    """
    check_mission(mission)
    batch = mission.batch(plans)
    objectives = mission.evaluate(batch)
    marks = knees(mission, objectives)
    chosen = representatives(mission, batch, k)
    rows = sorted({*chosen, *(mark.index for mark in marks)}, key=lambda row: -objectives[row, 0])
    notes = [front_summary(objectives, mission)]
    if len(batch) > 1:
        notes.append(f"numbered: the knee, and {len(chosen)} representatives")
    names = {row: ", ".join(mark.name for mark in marks if mark.index == row) for row in rows}
    with look.theme():
        others: list[Axes] = []
        if ax is None:
            ax, *others = _open_sheet(mission, len(rows), 2)
            _add_reach_bar(others)
        plot_front(objectives, mission, highlight=names, ax=ax)
        for row, small in zip(rows, others, strict=False):  # no maps beside given axes
            shown = DrawnPlan(mission, batch[row])
            open_axes(mission, small)
            notes += [*shown.draw_team(small), *shown.marks]
            _name_map(small, "; ".join([f"plan {row}: {shown.objectives}", *shown.staying]))
        title_above(ax, mission.title if title is None else title, "; ".join(dict.fromkeys(notes)))
    return ax


def plot_replan(found: Replan, *, title: str | None = None) -> Axes:
    """Draw what is left of a plan, and beside it the plan that was made anew.

    Robots that are under way have a triangle where they are, and are called by their rows in the
    plan that was made before: R0, R1, ...

    Parameters
    ----------
    found
        What :func:`botohe_moo.replan` returns.
    title
        Name of the picture; default: the mission's title.

    Returns
    -------
    matplotlib.axes.Axes
        The axes of the map of the old plan.

    Examples
    --------
    >>> from botohe_moo import Event, load_mission, replan
    >>> from botohe_moo.plots import plot_replan, save_plot
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1]])
    >>> found = replan(toy, plan, [Event("lost", 0, 4)], price=1)
    >>> save_plot(plot_replan(found), "replan.png")
    """
    mission, notes = found.left.mission, [str(found)]
    with look.theme():
        axes = _open_sheet(mission, 1, 1)
        _add_reach_bar(axes)
        sides = {"what is left of the plan": found.left.plan, "the new plan": found.plan}
        for ax, (words, plan) in zip(axes, sides.items(), strict=True):
            shown = DrawnPlan(mission, plan)
            named = zip(shown.styles, found.left.robots, strict=True)
            shown.styles = [style._replace(name=f"R{robot}") for style, robot in named]
            open_axes(mission, ax)
            notes += [*shown.draw_team(ax), *shown.marks]
            _name_map(ax, "; ".join([f"{words}: {shown.objectives}", *shown.staying]))
        words = "; ".join(dict.fromkeys(notes))
        title_above(axes[0], mission.title if title is None else title, words)
    return axes[0]


def plot_scenarios(mission: Mission, plan: TrailPlan, *, title: str | None = None) -> Axes:
    """Draw a plan in each scenario: how dangerous arcs are in it, and what robots reach.

    The darker a node, the more likely any robot reaches it in the scenario.

    Parameters
    ----------
    mission
        A mission with scenarios. Of more than 24 the most probable ones are drawn.
    plan
        A plan that is valid for it.
    title
        Name of the picture. Default: the mission's title.

    Returns
    -------
    matplotlib.axes.Axes
        The axes of the map of the first scenario.

    Raises
    ------
    PlanError
        If the mission does not allow ``plan``.
    ValueError
        If the mission has no scenarios.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.plots import plot_scenarios, save_plot
    >>> mission = load_mission("toy", scenarios=["storm=0.25,factor=3"])
    >>> save_plot(plot_scenarios(mission, mission.plan([[1, 2, 4, 2, 1], [1]])), "scenarios.png")
    """
    if not check_mission(mission).scenarios:
        raise ValueError(f"Expected a mission with scenarios, got {mission!r}.")
    by_chance = sorted(mission.scenarios, key=lambda scenario: -scenario.probability)
    scenarios = [one for one in mission.scenarios if one in by_chance[:_MOST_MAPS]]
    drawn = [DrawnPlan(mission.in_scenario(scenario.name), plan) for scenario in scenarios]
    safest = [one.site.safest for one in drawn]
    notes = [objectives_text(*mission.evaluate([plan])[0])]
    if len(scenarios) < len(by_chance):
        notes.append(f"the {len(scenarios)} most probable of {len(by_chance)} scenarios")
    with look.theme():
        axes = _open_sheet(mission, len(drawn) - 1, 1)
        span = Normalize(float(np.min(safest)), float(np.max(safest)))
        for ax, one, scenario, survival in zip(axes, drawn, scenarios, safest, strict=True):
            open_axes(mission, ax)
            one.ground = np.asarray(look.SURVIVAL(span(survival)))
            notes += [*one.draw_team(ax), *one.marks]
            _name_map(ax, f"{scenario.name}, {scenario.probability:.3g}: {one.objectives}")
        right = _add_reach_bar(axes)
        maps.add_colour_bar(right, ScalarMappable(span, look.SURVIVAL), "survival", 1)
        words = "; ".join(dict.fromkeys([*notes, *drawn[0].staying]))
        title_above(axes[0], mission.title if title is None else title, words)
    return axes[0]


class DrawnPlan:
    """A plan with everything that maps show about it; errors are those of ``plot_plan``."""

    def __init__(self, mission: Mission, plan: TrailPlan) -> None:
        check_mission(mission)
        self.mission, self.site = mission, where.Site(mission)
        self.ground: str | FloatArray = _GROUND  # colours of arcs
        self.objectives = objectives_text(*mission.evaluate([plan])[0])
        self.survival = mission.robot_survival([plan])[0]  # (n_robots,)
        self.reach = reach_probabilities(mission, plan)  # (n_robots, n_nodes)
        self.team_reach = team_chances(reach_probabilities, mission, plan)  # (n_nodes,)
        self.trails, self.styles = mission.trails(plan), robot_styles(mission)
        self.marks = where.place_notes(self.site)  # what the marks of places mean
        self.leaving = [robot for robot, trail in enumerate(self.trails) if len(trail) > 1]

    @property
    def staying(self) -> list[str]:
        """Write which robots stay where they start."""
        home: dict[Hashable, list[str]] = {}
        for style, trail in zip(self.styles, self.trails, strict=True):
            if len(trail) == 1:
                home.setdefault(self.mission.nodes[trail[0]], []).append(style.name)
        return [f"staying at {place}: {', '.join(names)}" for place, names in home.items()]

    def draw_team(self, ax: Axes) -> list[str]:
        """Draw all trails, and return notes on the map."""
        drawn = _PlanMap(ax, self, list(range(self.mission.robots)), self.team_reach)
        # Robots first: a trail without a name is worse than a node without one.
        drawn.name_robots()
        drawn.name_nodes()
        return drawn.notes

    def draw_robot(self, ax: Axes, robot: int) -> None:
        """Draw the trail of one robot, with the numbers of its visits, and name the map."""
        drawn = _PlanMap(ax, self, [robot], self.reach[robot])
        text = "; ".join([self._survives(robot), *drawn.number_visits()])
        _name_map(ax, text, self.styles[robot])

    def add_legend(self, ax: Axes) -> None:
        """Add a legend of the robots' lines below a map."""
        handles = [self.styles[robot].key(self._survives(robot)) for robot in self.leaving]
        place: look.Style = {"loc": "upper left", "bbox_to_anchor": (0.0, -0.01)}
        place |= {"borderaxespad": 0.0, "columnspacing": 1.2, "fontsize": 9.0, "handlelength": 2.4}
        if handles:
            ax.legend(handles=handles, ncols=min(3, len(handles)), **place)

    def _survives(self, robot: int) -> str:
        chance = probability_text(self.survival[robot], 2)
        return f"{self.styles[robot].name} survives with {chance}"


class _PlanMap:
    """A map of the trails of some robots, and of nodes shaded by ``reach`` (n_nodes).

    ``notes`` are what has to be said about the map.
    """

    def __init__(self, ax: Axes, plan: DrawnPlan, robots: list[int], reach: FloatArray) -> None:
        self.mission, self.trails = plan.mission, [plan.trails[robot] for robot in robots]
        self.styles = [plan.styles[robot] for robot in robots]
        self.canvas = canvas = Canvas(ax, self.mission, plan.site, smallest=_SMALLEST)
        self.fills, self.notes = np.asarray(look.REACH(reach)), where.layout_notes(self.mission)
        self.is_legible = canvas.radius >= _LEGIBLE
        if self.is_legible:
            ground = canvas.curves(plan.site.tail, plan.site.head, bowed=False)
            canvas.draw_lines(ground, colors=plan.ground, linewidths=0.9, zorder=1, label="_ground")
        else:
            self.notes.append("nodes and arcs off the trails are too small to draw")
        self.points = canvas.draw_trails(self.trails, self.styles)  # (n_passages, n_points, 2)
        edges = [look.INK if there else look.MUTED for there in reach > 0]
        away = 0.8 * canvas.radius if self.is_legible else 0.0
        canvas.draw_nodes(self.fills, np.where(reach > 0, canvas.radius, away), edges)
        shown = canvas.xy[(reach > 0) | self.is_legible]
        self.space = Space(ax, shown, canvas.radius, self.points[:, ::2])

    def name_nodes(self) -> None:
        """Write the names of nodes into or beside them, first of those visited.

        Names of many nodes stand close to them, so that it is clear which node each belongs to.
        """
        visited = sorted({node for trail in self.trails for node in trail})
        order = list(dict.fromkeys([*visited, *range(len(self.fills))]))
        reach = maps.FAR if len(order) <= maps.MANY else _NEAR if self.is_legible else 0.0
        names = {node: str(self.mission.nodes[node]) for node in order}
        self.notes += self.canvas.label_nodes(self.space, names, self.fills, reach=reach)

    def number_visits(self) -> list[str]:
        """Write the numbers of the only robot's visits, from 1 after the base; return notes."""
        if not self.is_legible:
            return ["too small to number"]
        visits: dict[int, list[str]] = {}
        for i, node in enumerate(self.trails[0][1:], start=1):
            visits.setdefault(node, []).append(str(i))
        texts = {node: fill(", ".join(numbers), _LINE) for node, numbers in visits.items()}
        longest_first = dict(sorted(texts.items(), key=lambda item: -len(item[1])))
        options: look.Style = {"size": _NUMBERS, "what": "numbers"}
        return self.canvas.label_nodes(self.space, longest_first, self.fills, **options)

    def name_robots(self) -> None:
        """Write the name of each robot on its trail, where there is room."""
        stops = np.cumsum([len(trail) - 1 for trail in self.trails])
        for style, passages in zip(self.styles, np.split(self.points, stops[:-1]), strict=True):
            on = passages[:, 4:13:2].reshape(-1, 2)
            spots = on[:: len(on) // 60 + 1]  # of many, some 60 are tried
            width, height = text_size(style.name, _ROBOTS)
            at = self.space.place(self.space.in_points(spots), width + 4, height + 2)
            if at is not None:
                box = {"boxstyle": "round,pad=0.18", "fc": "white", "ec": style.colour}
                text: look.Style = {"fontsize": _ROBOTS, "fontweight": "bold", "label": "_robot"}
                text |= {"ha": "center", "va": "center_baseline", "bbox": box, "zorder": 7}
                x, y = spots[at]
                self.canvas.ax.text(x, y, style.name, **text)


def _open_sheet(mission: Mission, n_small: int, span: int) -> list[Axes]:
    """Open a figure with large axes, ``span`` times as wide and high as the maps beside them."""
    xy = where.node_positions(mission)
    _, half = maps.frame_of(xy)
    # Maps are the wider the closer most nodes are to each other, in inches.
    wide = float(np.clip(0.56 * half[0] / max(maps.crowding(xy), 1e-9), 4.4, 6.4))
    high = wide * half[1] / half[0] + _NAME
    cells = n_small + span**2
    n_columns = int(np.clip(np.ceil((cells * _SHAPE * high / wide) ** 0.5), span, n_small + span))
    n_rows = max(span, -(-cells // n_columns))
    width, height = n_columns * wide + 2 * _BESIDE, n_rows * high + _ABOVE
    fig = plt.figure(figsize=(width, height))
    space = {"left": _BESIDE / width, "right": 1 - _BESIDE / width, "wspace": 0.04}
    space |= {"bottom": _NAME / height, "top": 1 - _ABOVE / height}
    space |= {"hspace": _NAME / (high - _NAME)}
    grid = fig.add_gridspec(n_rows, n_columns, **space)
    places = [place for place in np.ndindex(n_rows, n_columns) if max(place) >= span]
    cells_of_maps = [grid[:span, :span], *(grid[place] for place in places[:n_small])]
    return [fig.add_subplot(cell) for cell in cells_of_maps]


def _add_reach_bar(axes: Sequence[Axes]) -> Axes:
    """Put the key of the nodes' shades right of the highest of the rightmost maps; return that."""
    ax = max(axes, key=lambda ax: (round(ax.get_position().x1, 6), ax.get_position().y1))
    shades = ScalarMappable(Normalize(0, 1), look.REACH)
    maps.add_colour_bar(ax, shades, "probability of being reached", 0)
    return ax


def _name_map(ax: Axes, text: str, style: RobotStyle | None = None) -> None:
    """Name a map below its lower left corner, with the line of its robot."""
    key = Line2D([], [], linestyle="none", label=text) if style is None else style.key(text)
    line, gap = (0.0, 0.0) if style is None else (2.4, 0.8)
    place: look.Style = {"loc": "upper left", "bbox_to_anchor": (0.0, 0.0), "fontsize": 9.5}
    ax.legend(handles=[key], handlelength=line, handletextpad=gap, borderaxespad=0.1, **place)
