"""Pictures of missions under way: a plan made anew, and what came of missions that were played."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from botohe_moo.base.numbers import price_text
from botohe_moo.decide.fronts import check_objectives
from botohe_moo.plots.draw.canvas import open_axes
from botohe_moo.plots.draw.maps import add_reach_bar, name_map, name_room, open_sheet, title_sheet
from botohe_moo.plots.draw.places import node_positions
from botohe_moo.plots.draw.style import INK, MARKERS, MUTED, colours, new_axes, theme
from botohe_moo.plots.draw.texts import title_above
from botohe_moo.plots.front import staircase
from botohe_moo.plots.plan import DrawnPlan
from botohe_moo.underway import PolicyOutcomes, Replan

_SPREAD = 0.7  # of the distance between two numbers of survivors, for the clouds of all policies


def plot_replan(found: Replan, *, title: str | None = None) -> Axes:
    """Draw what is left of a plan, and beside it the plan that was made anew.

    Robots that are under way have a triangle where they are, and are called by their rows in the
    plan that was made before: R0, R1, ...

    Parameters
    ----------
    found
        What :func:`botohe_moo.replan` returns.
    title
        Name of the picture; default: the mission's title, and what changes.

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
    mission, notes = found.left.mission, []
    with theme():
        old, new = open_sheet(mission, 1, 1, widest=6.4, room=name_room(mission))
        open_axes(node_positions(mission), old)
        add_reach_bar(old, new)
        for ax, plan, words in (
            (old, found.left.plan, "what is left of the plan"),
            (new, found.plan, "the new plan"),
        ):
            shown = DrawnPlan(mission, plan)
            named = zip(shown.styles, found.left.robots, strict=True)
            shown.styles = [replace(style, name=f"R{robot}") for style, robot in named]
            notes += [*shown.draw_team(ax), *shown.marks]
            name_map(ax, "; ".join([f"{words}: {shown.objectives}", *shown.staying]))
        if title is None:
            title = f"{mission.title}\n{found}"
        title_sheet(old, title, "; ".join(dict.fromkeys(notes)))
    return old


def plot_policies(
    outcomes: PolicyOutcomes,
    objectives: ArrayLike | None = None,
    *,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw what came of each mission under each policy, their means, and the front beside them.

    A small point is a mission; the points of a policy lie in a band of their own at each number of
    survivors. A large mark is the mean of a policy, with two standard errors.

    Parameters
    ----------
    outcomes
        What :func:`botohe_moo.simulate_policy` returns.
    objectives
        Shape (n_plans, 2): E[R] and E[S] of the front's plans. Default: no front.
    title
        Name of the picture. Default: the mission's title, and what one more survivor costs.
    ax
        Axes to draw on. One will be created if not given.

    Examples
    --------
    >>> from botohe_moo import simulate_policy, solve
    >>> from botohe_moo.plots import plot_policies, save_plot
    >>> solution = solve("toy", evaluations=100)
    >>> outcomes = simulate_policy(solution.mission, solution.plans[1], missions=50)
    >>> save_plot(plot_policies(outcomes, solution.objectives), "policies.png")
    """
    mission, table = outcomes.mission, outcomes.table.set_index("policy")
    with theme():
        if ax is None:
            ax = new_axes(7.2, 5.2)
        if objectives is not None:
            corners = staircase(check_objectives(np.asarray(objectives, dtype=float)))
            ax.plot(*corners[1:-2].T, color=MUTED, linewidth=1.4, zorder=2, label="front")
        width = _SPREAD / len(table)
        jitter = np.random.default_rng(0).uniform(-0.4, 0.4, outcomes.played["mission"].nunique())
        for i, (colour, policy) in enumerate(zip(colours(len(table)), table.index, strict=True)):
            played = outcomes.played[outcomes.played["policy"] == policy]
            band = (i - (len(table) - 1) / 2 + jitter) * width
            ax.scatter(
                played["reward"],
                played["survivors"] + band,
                s=5,
                color=colour,
                alpha=0.25,
                linewidths=0,
                zorder=1,
            )
            row = table.loc[policy]
            gained = f": {row['gain']:+.2f} ± {row['gain_se']:.2f}" if policy != "static" else ""
            ax.errorbar(
                row["reward"],
                row["survivors"],
                xerr=2 * played["reward"].sem(),
                yerr=2 * played["survivors"].sem(),
                marker=MARKERS[i % len(MARKERS)],
                markersize=9,
                markeredgecolor=INK,
                color=colour,
                ecolor=INK,
                zorder=3,
                label=f"{policy}{gained}",
            )
        ax.set(
            xlabel="team reward R",
            ylabel="number of survivors S, a band for each policy",
            xlim=(-0.02 * mission.total_reward, 1.02 * mission.total_reward or 1.0),
            ylim=(-0.5, mission.robots + 0.5),
            yticks=range(mission.robots + 1),
        )
        ax.legend(loc="upper left", bbox_to_anchor=(0, -0.12), ncols=2, title="gain a mission")
        price = price_text(outcomes.price)
        missions = f"{len(jitter):,} missions"
        title_above(ax, mission.title if title is None else title, f"{price}; {missions}")
    return ax
