"""Pictures of plans: the trails of one on maps, and a front with maps of some of its plans."""

import os

import numpy as np
from matplotlib.axes import Axes
from matplotlib.transforms import Bbox

from botohe_moo.base.numbers import probability_text
from botohe_moo.decide import Mark, knees, representatives
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.outcomes import reach_probabilities, team_reach
from botohe_moo.plots.draw.background import read_background
from botohe_moo.plots.draw.canvas import open_axes
from botohe_moo.plots.draw.kinds import place_notes
from botohe_moo.plots.draw.maps import (
    PlanMap,
    add_reach_bar,
    key_of,
    name_map,
    name_room,
    open_sheet,
    title_sheet,
)
from botohe_moo.plots.draw.places import node_positions
from botohe_moo.plots.draw.site import place_name, site_of
from botohe_moo.plots.draw.style import INK, theme
from botohe_moo.plots.draw.texts import objectives_text, title_above
from botohe_moo.plots.draw.trails import robot_styles
from botohe_moo.plots.front import front_summary, plot_front
from botohe_moo.trails import Plans, TrailPlan

_MAX_MAPS = 24
# The marker of each mark, and a letter that looks like it.
_SIGNS = {"farthest from the chord": ("D", "◆"), "largest product": ("*", "☆")}


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
    would be too small to see is not drawn, and the line under the title says so: arcs off the
    trails of large missions, and names and numbers without room.

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
        Name of the picture; what follows a line break is paler. Default: the mission's title, and
        the plan's objectives.
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
    behind = read_background(background, mission)
    if title is None:
        title = f"{mission.title}\n{shown.objectives}"
    with theme():
        if ax is not None:
            open_axes(node_positions(mission), ax, behind)
            add_reach_bar(ax)
            shown.add_legend(ax)
            title_above(ax, title, "; ".join([*shown.staying, *shown.draw_team(ax), *shown.marks]))
            return ax
        robots = shown.leaving[:_MAX_MAPS]
        # Between more than three, the map of all robots is larger: trails share its arcs.
        span = 2 if len(robots) == 2 or len(robots) > 3 else 1
        widest, room = 6.4 if len(robots) < 4 else 5.2, name_room(mission) / span
        first, *others = open_sheet(mission, len(robots), span, behind, widest=widest, room=room)
        open_axes(node_positions(mission), first, behind)
        add_reach_bar(first, *others)
        notes = [*shown.staying, *shown.draw_team(first), *shown.marks]
        name_map(first, "all robots" if mission.robots > 1 else "with the names of nodes")
        for small, robot in zip(others, robots, strict=True):
            shown.draw_robot(small, robot)
        if robots:
            notes.insert(0, "numbers: order of visit")
        if len(robots) < len(shown.leaving):
            notes.append(f"maps of {len(robots)} of the {len(shown.leaving)} robots that leave")
        title_sheet(first, title, "; ".join(notes))
    return first


def plot_choices(
    mission: Mission, plans: Plans, *, k: int = 5, title: str | None = None, ax: Axes | None = None
) -> Axes:
    """Draw a front with its knee and ``k`` representatives, and a map of each of them.

    Plans have the numbers of their rows in ``plans``, from 0. A diamond marks the plan that is
    farthest from the chord of the front, a star that of the largest E[R] times E[S]: marks, not
    verdicts. On the maps nodes are the darker the more likely any robot reaches them.

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
    with theme():
        others: list[Axes] = []
        if ax is None:
            ax, *others = open_sheet(mission, len(rows), 2)
            add_reach_bar(*others)
            # Inches for the names and numbers of its axes.
            inner = np.array([0.75, 0.6]) * ax.figure.figure.dpi / ax.figure.bbox.size
            place = ax.get_position()
            ax.set_position(Bbox(np.array([place.min + inner, place.max])))
        plot_front(objectives, mission, highlight=rows, ax=ax)
        for mark in marks:
            _draw_mark(ax, mark)
        ax.legend(loc="best", framealpha=0.9, handletextpad=0.2)
        for row, small in zip(rows, others, strict=False):  # no maps beside given axes
            shown = DrawnPlan(mission, batch[row])
            notes += [*shown.draw_team(small), *shown.marks]
            signs = "".join(_SIGNS[mark.name][1] for mark in marks if mark.index == row)
            parts = [f"plan {row} {signs}".strip() + f": {shown.objectives}", *shown.staying]
            name_map(small, "; ".join(parts))
        title_above(ax, mission.title if title is None else title, "; ".join(dict.fromkeys(notes)))
    return ax


def _draw_mark(ax: Axes, mark: Mark) -> None:
    """Draw the sign of a mark at its plan, and explain it in the legend."""
    marker = _SIGNS[mark.name][0]
    is_diamond = marker == "D"  # the white star can be seen on it, too
    ax.plot(
        [mark.reward],
        [mark.survivors],
        linestyle="none",
        marker=marker,
        markersize=7.0 if is_diamond else 7.5,
        markerfacecolor=INK if is_diamond else "white",
        markeredgecolor=INK,
        markeredgewidth=0.8,
        clip_on=False,
        zorder=5,
        label=f"{mark.name}: plan {mark.index}",
    )


class DrawnPlan:
    """A plan with everything that maps show about it; errors are those of ``plot_plan``."""

    def __init__(self, mission: Mission, plan: TrailPlan) -> None:
        check_mission(mission)
        self.mission = mission
        self.objectives = objectives_text(*mission.evaluate([plan])[0])
        self.survival = mission.robot_survival([plan])[0]  # (n_robots,)
        self.reach = reach_probabilities(mission, plan)  # (n_robots, n_nodes)
        self.trails, self.styles = mission.trails(plan), robot_styles(mission)

    @property
    def leaving(self) -> list[int]:
        """Return the robots that leave where they start."""
        return [robot for robot, trail in enumerate(self.trails) if len(trail) > 1]

    @property
    def staying(self) -> list[str]:
        """Write which robots stay where they start, if any."""
        home: dict[str, list[str]] = {}
        for style, trail in zip(self.styles, self.trails, strict=True):
            if len(trail) == 1:
                home.setdefault(place_name(self.mission, trail[0]), []).append(style.name)
        return [
            f"all {len(names)} robots stay at {place}"
            if len(names) == self.mission.robots > 1
            else f"{', '.join(names)} stay{'s' if len(names) == 1 else ''} at {place}"
            for place, names in home.items()
        ]

    @property
    def marks(self) -> list[str]:
        """Write what the marks of places on the maps mean."""
        return place_notes(site_of(self.mission))

    def draw_team(self, ax: Axes) -> list[str]:
        """Draw all trails, and return notes on the map."""
        drawn = PlanMap(ax, self.mission, self.trails, self.styles, team_reach(self.reach))
        # Robots first: a trail without a name is worse than a node without one.
        drawn.name_robots()
        drawn.name_nodes()
        return drawn.notes

    def draw_robot(self, ax: Axes, robot: int) -> None:
        """Draw the trail of one robot, with the numbers of its visits, and name the map."""
        alone, style = [self.trails[robot]], self.styles[robot]
        drawn = PlanMap(ax, self.mission, alone, [style], self.reach[robot])
        name_map(ax, "; ".join([self._survives(robot), *drawn.number_visits()]), style)

    def add_legend(self, ax: Axes) -> None:
        """Add a legend of the robots' lines below a map."""
        handles = [key_of(self._survives(robot), self.styles[robot]) for robot in self.leaving]
        if handles:
            ax.legend(
                handles=handles,
                ncols=min(3, len(handles)),
                loc="upper left",
                bbox_to_anchor=(0.0, -0.01),
                borderaxespad=0.0,
                columnspacing=1.2,
                handlelength=2.4 if len(self.mission.kinds) > 1 else None,  # for dashes
                fontsize=9.0,
            )

    def _survives(self, robot: int) -> str:
        chance = probability_text(self.survival[robot], 2)
        return f"{self.styles[robot].name} survives with {chance}"
