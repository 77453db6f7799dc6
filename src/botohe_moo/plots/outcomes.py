"""The picture of what may happen to plans: distributions of reward and survivors."""

from collections.abc import Sequence
from string import ascii_uppercase
from typing import Any

import matplotlib.pyplot as plt
import pandas as pd
import seaborn as sns
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from botohe_moo.decide.wishes import Candidates
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.plots.draw.algorithms import DASHES
from botohe_moo.plots.draw.style import Palette, palette_of, theme
from botohe_moo.plots.draw.texts import objectives_text
from botohe_moo.trails import TrailPlan

_FEW = 12  # most bars whose heights are written above them


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
        What the plans are called, all different. Default: ``plan A``, ``plan B``, ...
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
        letters = [ascii_uppercase[i % 26] + f"{i // 26 or ''}" for i in range(len(plans))]
        names = [f"plan {letter}" for letter in letters]
    elif isinstance(names, str) or len({*names}) != len(plans):
        raise ValueError(f"Expected {len(plans)} different names, one a plan, got {names!r}.")
    judged = Candidates(mission, plans)
    colours = palette_of(map(str, names), palette)
    bars: list[dict[str, Any]] = []
    with theme():
        if axes is None:
            _, axes = plt.subplots(1, 2, figsize=(10.0, 4.6), layout="constrained")
        left, right = axes
        for i, (name, colour) in enumerate(colours.items()):
            reward, alive = (judged.distribution(what, i) for what in ("reward", "survivors"))
            expected = objectives_text(reward.mean, alive.mean)
            n_samples = reward.n_samples
            source = f"; R from {n_samples:,} simulated missions" if n_samples else ""
            sns.ecdfplot(
                x=reward.values,
                weights=reward.probabilities,
                complementary=True,
                color=colour,
                linestyle=DASHES[i % len(DASHES)],
                linewidth=2,
                label=f"{name}: {expected}{source}",
                ax=left,
            )
            dot: dict[str, Any] = {"color": colour, "markeredgecolor": "white"}
            left.plot(reward.mean, reward.at_least(reward.mean), "o", markersize=8, **dot)
            right.plot(alive.mean, 0, "^", markersize=10, zorder=5, clip_on=False, **dot)
            numbers = zip(alive.values, alive.probabilities, strict=True)
            bars += [{"plan": name, "number": int(s), "probability": p} for s, p in numbers]
        sns.barplot(
            pd.DataFrame(bars),
            x="number",
            y="probability",
            hue="plan",
            native_scale=True,
            palette=colours,
            saturation=1.0,
            legend=False,
            ax=right,
        )
        if len(bars) <= _FEW:
            for drawn in right.containers:
                right.bar_label(
                    drawn,  # type: ignore[arg-type]
                    fmt=lambda p: f"{p:.2f}" if p >= 0.005 else "",
                    padding=2,
                    fontsize="small",
                )
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
