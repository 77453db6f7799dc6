"""The picture of a plan: a map with all trails, and one of every robot's own."""

from typing import Any

from matplotlib.axes import Axes

from botohe_moo._base.words import chance
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.outcomes import reach_probabilities, team_reach
from botohe_moo.plots.draw.canvas import open_axes
from botohe_moo.plots.draw.maps import PlanMap, name_room
from botohe_moo.plots.draw.places import node_positions
from botohe_moo.plots.draw.sheets import (
    add_reach_bar,
    add_reach_bar_right,
    key_of,
    name_map,
    open_sheet,
    title_sheet,
)
from botohe_moo.plots.draw.style import theme
from botohe_moo.plots.draw.titles import title_above
from botohe_moo.plots.draw.trails import robot_styles
from botohe_moo.trails import TrailPlan

_MAX_MAPS = 24


def plot_plan(
    mission: Mission, plan: TrailPlan, *, title: str | None = None, ax: Axes | None = None
) -> Axes:
    """Draw the trails of a plan: all of them on one map, and those of each robot on its own.

    On the maps of single robots visits are numbered in their order, and nodes are the darker the
    more likely that robot reaches them; on the map of all robots nodes have their names, and are
    the darker the more likely any robot reaches them. Trails keep to the right of their arcs, so
    that both directions are seen. Robots, R0, R1, ... in the order of the plan, differ in colour,
    dash and label. What would be too small to see is not drawn, and the line under the title says
    so: arcs off the trails of large missions, and names and numbers without room.

    Parameters
    ----------
    mission
        The mission.
    plan
        A plan that is valid for it.
    title
        Name of the picture; what follows a line break is paler. Default: the mission's title, and
        the plan's objectives.
    ax
        Axes for the map of all robots, which is then the only one, with a legend below. By default
        a figure with all maps will be created, of at most 24 robots that leave the base.

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
        If the ``pos`` of a node is not two finite numbers.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.plots import plot_plan, save_plot
    >>> toy = load_mission("toy")
    >>> save_plot(plot_plan(toy, toy.plan([[1, 2, 4, 2, 1], [1, 2, 1]])), "plan.png")
    """
    shown = PlanOnMap(mission, plan)
    if title is None:
        title = f"{mission.title}\n{shown.objectives}"
    with theme():
        if ax is not None:
            open_axes(node_positions(mission), ax)
            add_reach_bar(ax)
            shown.add_legend(ax)
            title_above(ax, title, "; ".join([*shown.at_base, *shown.draw_team(ax)]))
            return ax
        robots = shown.out[:_MAX_MAPS]
        # Between more than three, the map of all robots is larger: trails share its arcs.
        span = 2 if len(robots) == 2 or len(robots) > 3 else 1
        widest, room = 6.4 if len(robots) < 4 else 5.2, name_room(mission) / span
        first, *others = open_sheet(mission, len(robots), span, widest=widest, room=room)
        open_axes(node_positions(mission), first)
        add_reach_bar_right([first, *others])
        notes = [*shown.at_base, *shown.draw_team(first)]
        name_map(first, "all robots" if mission.robots > 1 else "with the names of nodes")
        for own, robot in zip(others, robots, strict=True):
            shown.draw_robot(own, robot)
        if robots:
            notes.insert(0, "numbers: order of visit")
        if len(robots) < len(shown.out):
            notes.append(f"maps of {len(robots)} of the {len(shown.out)} robots that leave")
        title_sheet(first, title, "; ".join(notes))
    return first


class PlanOnMap:
    """A plan, and what maps show of it; errors are those of ``plot_plan``."""

    def __init__(self, mission: Mission, plan: TrailPlan) -> None:
        check_mission(mission)
        reward, survivors = mission.evaluate([plan])[0]
        self.mission, self.plan = mission, plan
        self.objectives = f"E[R] = {reward:.2f}, E[S] = {survivors:.2f}"
        self.survival = mission.robot_survival([plan])[0]  # (n_robots,)
        self.reach = reach_probabilities(mission, plan)  # (n_robots, n_nodes)
        self.styles = robot_styles(plan.n_robots)

    @property
    def out(self) -> list[int]:
        """The robots that leave the base."""
        return [robot for robot, trail in enumerate(self.plan.trails) if len(trail) > 1]

    @property
    def at_base(self) -> list[str]:
        """Which robots stay at base, if any."""
        home = [style.name for i, style in enumerate(self.styles) if i not in self.out]
        if len(home) == len(self.styles):
            return [f"all {len(home)} robots stay at base" if len(home) > 1 else "R0 stays at base"]
        return [f"{', '.join(home)} stay{'s' if len(home) == 1 else ''} at base"] if home else []

    def draw_team(self, ax: Axes) -> list[str]:
        """Draw all trails, and return what has to be said about the map."""
        drawn = PlanMap(ax, self.mission, self.plan, self.styles, team_reach(self.reach))
        # Robots first: a trail without a name is worse than a node without one.
        drawn.name_robots()
        drawn.name_nodes()
        return drawn.notes

    def draw_robot(self, ax: Axes, robot: int) -> None:
        """Draw the trail of one robot, with the numbers of its visits, and name the map."""
        own, style = TrailPlan([self.plan.trails[robot]]), self.styles[robot]
        drawn = PlanMap(ax, self.mission, own, [style], self.reach[robot])
        name_map(ax, "; ".join([self._survives(robot), *drawn.number_visits()]), style)

    def add_legend(self, ax: Axes) -> None:
        """Add a legend below a map that tells which line belongs to which robot."""
        handles = [key_of(self._survives(robot), self.styles[robot]) for robot in self.out]
        if handles:
            look: dict[str, Any] = {"frameon": False, "fontsize": 9.0, "columnspacing": 1.2}
            look |= {"loc": "upper left", "bbox_to_anchor": (0.0, -0.01), "borderaxespad": 0.0}
            ax.legend(handles=handles, ncols=min(3, len(handles)), **look)

    def _survives(self, robot: int) -> str:
        return f"{self.styles[robot].name} survives with {chance(self.survival[robot], 2)}"
