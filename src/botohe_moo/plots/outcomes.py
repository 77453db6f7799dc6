"""The picture of what may happen to plans: distributions of reward and survivors."""

from collections.abc import Sequence
from itertools import cycle, islice
from string import ascii_uppercase
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.container import BarContainer
from matplotlib.legend_handler import HandlerTuple
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from botohe_moo._base.words import chance
from botohe_moo.decide.judging import Candidates
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.outcomes import Distribution
from botohe_moo.plots.draw.labels import drawable, wrapped
from botohe_moo.plots.draw.scales import stack_above
from botohe_moo.plots.draw.style import INK, dress, theme
from botohe_moo.plots.draw.trails import RobotStyle, robot_styles
from botohe_moo.trails import TrailPlan

_HATCHES = ("", "////", "....", "xxxx", "----")
_MAX_TOLD = 12  # bars whose heights are written above them


def plot_outcomes(
    mission: Mission,
    *plans: TrailPlan,
    names: Sequence[str] | None = None,
    title: str | None = None,
    axes: Sequence[Axes] | None = None,
) -> tuple[Axes, Axes]:
    """Draw the distributions of the team reward and of the number of survivors.

    On the left the probability of at least so much reward, with the expected reward as a dot on
    the curve; on the right the probability of every number of survivors, with the expected number
    as a triangle under the bars. Plans differ in colour, and in dash or hatching.

    Parameters
    ----------
    mission
        The mission.
    *plans
        One plan or several, valid for it.
    names
        What the plans are called. Default: ``plan 1``, ``plan 2``, ... in their order.
    title
        Name of the picture. Default: the mission's title.
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
        names = [f"plan {letter}" for letter in islice(cycle(ascii_uppercase), len(plans))]
    elif isinstance(names, str) or len(names) != len(plans):
        raise ValueError(f"Expected {len(plans)} names, one a plan, got {names!r}.")
    judged = Candidates(mission, plans)
    rewards = [judged.distribution("reward", i) for i in range(len(plans))]
    survivors = [judged.distribution("survivors", i) for i in range(len(plans))]
    styles = robot_styles(len(plans))
    parts = zip(names, rewards, survivors, strict=True)
    told = [_told(drawable(str(name)), reward, alive) for name, reward, alive in parts]
    with theme():
        left, right = _two_axes() if axes is None else axes
        left.set(xlim=(0.0, mission.total_reward or 1.0), ylim=(0.0, 1.02))
        curves = [_draw_reward(left, *one) for one in zip(rewards, styles, strict=True)]
        bars = _draw_survivors(right, survivors, styles)
        left.set(xlabel="team reward R", ylabel="probability of at least R")
        right.set(xlim=(-0.5, mission.robots + 0.5), ylim=(0.0, 1.12 * right.dataLim.ymax))
        right.set(xlabel="number of survivors S", ylabel="probability of exactly S")
        for ax in (left, right):
            dress(ax)
        right.grid(visible=False, axis="x")  # bands tell the numbers apart
        keys: list[Any] = list(zip(curves, bars, strict=True))
        look: dict[str, Any] = {"frameon": False, "handlelength": 5.0, "borderaxespad": 0.0}
        look |= {"loc": "upper left", "bbox_to_anchor": (0.0, -0.21)}
        left.legend(keys, told, handler_map={tuple: HandlerTuple(None, pad=0.6)}, **look)
        _title(left, mission.title if title is None else title)
    return left, right


def _told(name: str, reward: Distribution, survivors: Distribution) -> str:
    expected = f"E[R] = {reward.mean:.2f}, E[S] = {survivors.mean:.2f}"
    n_samples = reward.n_samples
    source = f"; R from {n_samples:,} simulated missions" if n_samples else ""
    return wrapped(f"{name}: {expected}{source}", 90)


def _title(left: Axes, title: str) -> None:
    head, _, rest = title.partition("\n")
    words = "dot on a curve, triangle under the bars: expected values"
    pale, bold = {"color": "0.4"}, {"color": INK, "fontweight": "bold"}
    parts = [
        (words, "words", 9.5, pale),
        (rest, "subtitle", 10.0, pale),
        (head, "title", 12.0, bold),
    ]
    stack_above(left, parts, 9.0, 7.0)


def _two_axes() -> tuple[Axes, Axes]:
    """Open a figure with two axes beside each other."""
    fig = plt.figure(figsize=(10.0, 4.4))
    places = ((0.07, 0.25, 0.41, 0.57), (0.58, 0.25, 0.41, 0.57))
    left, right = (fig.add_axes(place) for place in places)
    return left, right


def _draw_reward(ax: Axes, reward: Distribution, style: RobotStyle) -> Line2D:
    """Draw the probability of at least so much reward."""
    x = np.concatenate([[0.0], np.repeat(reward.values, 2), [ax.get_xlim()[1]]])
    y = np.repeat(np.append(reward.at_least(reward.values), 0.0), 2)
    look: dict[str, Any] = {"color": style.colour, "linestyle": style.line, "linewidth": 2.0}
    (curve,) = ax.plot(x, y, zorder=3, clip_on=False, gid="reward", **look)
    dot: dict[str, Any] = {"marker": "o", "markersize": 8, "markeredgecolor": "white"}
    mean = reward.mean
    ax.plot([mean], [reward.at_least(mean)], color=style.colour, zorder=4, gid="mean", **dot)
    return curve


def _draw_survivors(
    ax: Axes, found: Sequence[Distribution], styles: Sequence[RobotStyle]
) -> list[BarContainer]:
    """Draw the probability of every number of survivors, the plans beside each other."""
    width = 0.84 / len(found)
    few = sum(len(survivors.values) for survivors in found) <= _MAX_TOLD
    drawn = []
    for i, (survivors, style) in enumerate(zip(found, styles, strict=True)):
        bars = ax.bar(
            survivors.values + (i + 0.5) * width - 0.42,
            survivors.probabilities,
            0.92 * width,
            color=style.colour,
            hatch=_HATCHES[i % len(_HATCHES)],
            edgecolor="white",
            linewidth=0.0,
            zorder=2,
        )
        drawn.append(bars)
        if few:
            heights = [chance(p, 2) for p in survivors.probabilities.tolist()]
            ax.bar_label(bars, heights, padding=2, fontsize=8.5)
        triangle: dict[str, Any] = {"marker": "^", "markersize": 10, "markeredgecolor": "white"}
        mean = [survivors.mean]
        ax.plot(mean, [0.0], color=style.colour, clip_on=False, zorder=5, gid="mean", **triangle)
    for number in range(1, int(max(survivors.values[-1] for survivors in found)) + 1, 2):
        ax.axvspan(number - 0.5, number + 0.5, color="0.96", linewidth=0.0, zorder=0)
    ax.xaxis.set_major_locator(MaxNLocator(nbins=12, integer=True))
    return drawn
