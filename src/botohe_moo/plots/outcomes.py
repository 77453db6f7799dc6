"""Pictures of what may happen: distributions of a plan's outcomes, and missions as played."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import seaborn as sns
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from botohe_moo.base.messages import price_text
from botohe_moo.decide.fronts import check_objectives
from botohe_moo.decide.wishes import Candidates
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.plots import style as look
from botohe_moo.plots.front import staircase
from botohe_moo.plots.style import Palette, line_styles, objectives_text, title_above
from botohe_moo.trails import TrailPlan

if TYPE_CHECKING:
    from botohe_moo.underway import PolicyOutcomes

_DASHES = ("-", "--", ":", "-.")
_SPREAD = 0.7  # of the distance between two numbers of survivors, for the clouds of all policies


def plot_outcomes(
    mission: Mission,
    *plans: TrailPlan,
    names: Sequence[str] | None = None,
    palette: Palette | None = None,
    title: str | None = None,
    axes: Sequence[Axes] | None = None,
) -> tuple[Axes, Axes]:
    """Draw the distributions of the team reward and of the number of survivors.

    The left plot shows the probability to get at least a reward, with the expected reward as a dot
    on the curve. The right one shows the probability of every number of survivors, with the
    expected number as a triangle under the bars. Plans differ in colour and dash.

    Parameters
    ----------
    mission
        The mission.
    *plans
        One plan or several, valid for it.
    names
        What the plans are called, all different. Default: ``plan 0``, ``plan 1``, ...
    palette
        Colours as seaborn takes them, or a colour for each name. Default: as in
        :func:`plot_curves`.
    title
        Title of the picture. Default: the mission's title.
    axes
        The two axes to draw on. A figure with two will be created if not given.

    Returns
    -------
    tuple of matplotlib.axes.Axes
        The axes of the reward, and of the survivors.

    Raises
    ------
    PlanError
        If the mission does not allow one of the plans.
    TypeError
        If ``mission`` is not a Mission, or one of ``plans`` not a TrailPlan.
    ValueError
        If there is no plan, or not one of ``names`` for each.

    Notes
    -----
    The distributions are those by which :func:`botohe_moo.decide.choose` judges plans and which
    the explorer shows: exact, or where that takes too long, the rewards of 10 000 simulated
    missions, always with the same seed; the legend says so.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.plots import plot_outcomes, save_plot
    >>> toy = load_mission("toy")
    >>> bold, shy = toy.plan([[1, 2, 4, 2, 1]] * 2), toy.plan([[1, 2, 1], [1]])
    >>> save_plot(plot_outcomes(toy, bold, shy, names=["bold", "shy"])[0], "outcomes.png")
    """
    check_mission(mission)
    if not plans:
        raise ValueError("Expected at least one plan, got none.")
    if names is None:
        names = [f"plan {i}" for i in range(len(plans))]
    if len({*names}) != len(plans):
        raise ValueError(f"Expected {len(plans)} different names, one a plan, got {names!r}.")
    judged = Candidates(mission, plans)
    colours = look.palette_of(map(str, names), palette)
    bars: list[dict[str, Any]] = []
    with look.theme():
        if axes is None:
            _, axes = plt.subplots(1, 2, figsize=(10.0, 4.6), layout="constrained")
        left, right = axes
        for i, (name, colour) in enumerate(colours.items()):
            reward, alive = (judged.distribution(what, i) for what in ("reward", "survivors"))
            source = f"; R from {reward.n_samples:,} simulated missions" if reward.n_samples else ""
            line: look.Style = {"color": colour, "linestyle": _DASHES[i % len(_DASHES)]}
            line["label"] = f"{name}: {objectives_text(reward.mean, alive.mean)}{source}"
            beyond = {"x": reward.values, "weights": reward.probabilities, "complementary": True}
            sns.ecdfplot(**beyond, **line, linewidth=2, ax=left)
            dot: look.Style = {"color": colour, "markeredgecolor": "white"}
            left.plot(reward.mean, reward.at_least(reward.mean), "o", markersize=8, **dot)
            right.plot(alive.mean, 0, "^", markersize=10, zorder=5, clip_on=False, **dot)
            numbers = zip(alive.values, alive.probabilities, strict=True)
            bars += [{"plan": name, "number": int(s), "probability": p} for s, p in numbers]
        columns: look.Style = {"hue": "plan", "palette": colours, "saturation": 1.0}
        columns |= {"native_scale": True, "legend": False}
        sns.barplot(pd.DataFrame(bars), x="number", y="probability", **columns, ax=right)
        left.set(xlim=(0.0, mission.total_reward or 1.0), ylim=(0.0, 1.02))
        left.set(xlabel="team reward R", ylabel="probability of at least R")
        right.set(xlabel="number of survivors S", ylabel="probability of exactly S")
        right.set_xlim(-0.5, mission.robots + 0.5)
        right.xaxis.set_major_locator(MaxNLocator(nbins=12, integer=True))
        right.margins(y=0.1)
        right.set_ylim(bottom=0)
        right.grid(visible=False, axis="x")
        left.legend(loc="upper left", bbox_to_anchor=(0.0, -0.16))
        left.set_title(mission.title if title is None else title)
    return left, right


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
    with look.theme():
        ax = ax or look.new_axes(7.2, 5.2)
        if objectives is not None:
            corners = staircase(check_objectives(np.asarray(objectives, dtype=float)))
            ax.plot(*corners[1:-2].T, color=look.MUTED, linewidth=1.4, zorder=2, label="front")
        width = _SPREAD / len(table)
        jitter = np.random.default_rng(0).uniform(-0.4, 0.4, outcomes.played["mission"].nunique())
        cloud: look.Style = {"s": 5, "alpha": 0.25, "linewidths": 0, "zorder": 1}
        mean: look.Style = {"markersize": 9, "markeredgecolor": look.INK, "ecolor": look.INK}
        for i, (policy, style) in enumerate(line_styles(table.index, None).items()):
            row, played = table.loc[policy], outcomes.played[outcomes.played["policy"] == policy]
            band = (i - (len(table) - 1) / 2 + jitter) * width
            ax.scatter(played["reward"], played["survivors"] + band, color=style["color"], **cloud)
            gained = f": {row['gain']:+.2f} ± {row['gain_se']:.2f}" if policy != "static" else ""
            reward, survivors = played[["reward", "survivors"]].sem()
            style |= {"xerr": 2 * reward, "yerr": 2 * survivors, "label": f"{policy}{gained}"}
            ax.errorbar(row["reward"], row["survivors"], **style, **mean, zorder=3)
        ax.set(xlabel="team reward R", ylabel="number of survivors S, a band for each policy")
        ax.set_xlim(-0.02 * mission.total_reward, 1.02 * mission.total_reward or 1.0)
        ax.set(ylim=(-0.5, mission.robots + 0.5), yticks=range(mission.robots + 1))
        ax.legend(loc="upper left", bbox_to_anchor=(0, -0.12), ncols=2, title="gain a mission")
        price = price_text(outcomes.price)
        missions = f"{len(jitter):,} missions"
        title_above(ax, mission.title if title is None else title, f"{price}; {missions}")
    return ax
