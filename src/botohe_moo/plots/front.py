"""Pictures of fronts: what plans are expected to bring, the area they dominate, and how often."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import moocore
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from botohe_moo.base.messages import counted
from botohe_moo.base.types import FloatArray
from botohe_moo.decide.fronts import check_objectives, check_row, front_rows
from botohe_moo.indicators import area_indicator
from botohe_moo.mission.model import Mission, numbers_digest
from botohe_moo.objectives import Objectives
from botohe_moo.plots import style as look
from botohe_moo.plots.style import Space, title_above

if TYPE_CHECKING:
    import pandas as pd

    from botohe_moo.bounds import FrontBound

OBJECTIVES = ("expected team reward E[R]", "expected number of survivors E[S]")
_STAIRS = "_stairs"  # label by which the fronts on axes are counted
_CROWD = 150  # points; the rims of more would cover other points
_RING = 5.5  # points: radius of the rings around highlighted plans
_SHADES = 5  # of differences; more are hard to distinguish
_CELLS = 500  # of an image of differences, in each direction


def plot_front(
    objectives: ArrayLike,
    mission: Mission | None = None,
    *,
    highlight: int | Sequence[int] | Mapping[int, str] | None = None,
    label: str | None = None,
    bound: FrontBound | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw plans in objective space and shade the area that they dominate.

    Call it again with the same ``ax`` and another ``label`` to lay fronts over each other.

    Parameters
    ----------
    objectives
        Shape (n_plans, 2): expected team reward E[R] and expected number of survivors E[S], both
        to be maximised, in any order. Dominated plans are drawn paler and bound no area.
    mission
        Mission of the plans. With it the axes reach to the total reward and to the number of
        robots, and the area is the normalised one, in [0, 1]; without it, it is E[R] times E[S].
        By default that of ``bound``, if one is given.
    highlight
        Rows of ``objectives``, counted from 0, to ring and to number: ``plan 7``. A mapping gives
        them names, too: ``{7: "knee"}`` is ``plan 7: knee``.
    label
        Name of the front. Area and number of plans are then in the legend instead of the title.
    bound
        What no plan exceeds, of :func:`bound_front`. The area between the front and it is shaded,
        too, and the legend says how large it is.
    title
        Name of the picture. Default: the mission's title.
    ax
        Axes to draw on. One will be created if not given.

    Raises
    ------
    TypeError
        If ``mission`` is not a Mission.
    ValueError
        If ``objectives`` has another shape or is not finite, ``highlight`` names no row of it, or
        ``bound`` is of another mission, or a plan lies above it.

    Examples
    --------
    >>> from botohe_moo import plot_front, solve
    >>> from botohe_moo.plots import save_plot
    >>> solution = solve("toy", "greedy", evaluations=100)
    >>> ax = plot_front(solution.objectives, solution.mission, highlight={1: "bold"})
    >>> save_plot(ax, "front.png", "front.pdf")
    """
    points = np.asarray(objectives, dtype=float)
    points = check_objectives(points.reshape(-1, 2) if points.shape == (0,) else points)
    chosen = _rows(highlight, len(points))
    if bound is not None:
        mission = bound.mission if mission is None else mission
        if numbers_digest(mission) != numbers_digest(bound.mission):
            expected = f"a bound of the mission {mission.name!r}"
            found = f"one of {bound.mission.name!r} with {bound.mission.team}"
            raise ValueError(f"Expected {expected}, got {found}.")
        bound.check("objectives", points)
    corners, summary = staircase(points), front_summary(points, mission)
    with look.theme():
        ax = ax or look.new_axes(7.2, 5.2)
        drawn = sum(line.get_label() == _STAIRS for line in ax.lines)
        _draw_front(ax, points, corners, drawn, f"{label}: {summary}" if label else None)
        if bound is not None:
            _shade_gap(ax, corners, bound, bound.gap(points), label)
        if label or bound is not None:
            ax.legend(loc="upper right", framealpha=0.9)
        # There may be several fronts, which must all stay in view.
        reach = 1.05 * np.clip([ax.dataLim.x1, ax.dataLim.y1], 0.0, None)
        if mission is not None:
            reach = np.array([mission.total_reward, mission.robots])
            ax.yaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 5, 10]))
        ax.set(xlim=(0, reach[0] or 1.0), ylim=(0, reach[1] or 1.0))
        ax.set(xlabel=OBJECTIVES[0], ylabel=OBJECTIVES[1])
        if title is None:
            title = ax.get_title(loc="left") if mission is None else mission.title
        title_above(ax, title, "" if label else summary)
        _ring_plans(ax, points, chosen)
    return ax


def staircase(objectives: FloatArray) -> FloatArray:
    """Return the corners of the area that plans (n_plans, 2) dominate, both columns maximised.

    Shape (2 n + 2, 2) for n distinct non-dominated plans, from the highest on the vertical axis
    down to the farthest on the horizontal one and back to the origin; (0, 2) for none.

    >>> staircase(np.array([[1.0, 2.0], [3.0, 1.0], [1.0, 1.0]])).tolist()
    [[0.0, 2.0], [1.0, 2.0], [1.0, 1.0], [3.0, 1.0], [3.0, 0.0], [0.0, 0.0]]
    """
    front = objectives[front_rows(objectives)[::-1]]
    if not len(front):
        return np.empty((0, 2))
    reward, survivors = front.T
    right = np.concatenate([[0.0], np.repeat(reward, 2), [0.0]])
    up = np.concatenate([np.repeat(survivors, 2), [0.0, 0.0]])
    return np.column_stack([right, up])


def _rows(
    highlight: int | Sequence[int] | Mapping[int, str] | None, n_plans: int
) -> dict[int, str]:
    """Return the rows to mark, with their texts."""
    if not isinstance(highlight, Mapping):
        rows = [] if highlight is None else np.atleast_1d(highlight).tolist()
        highlight = dict.fromkeys(rows, "")
    for row in highlight:
        check_row("highlight", row, n_plans)
    return {row: f"plan {row}" + (f": {name}" if name else "") for row, name in highlight.items()}


def front_summary(points: FloatArray, mission: Mission | None) -> str:
    """Write the area that plans dominate, and their number."""
    if mission is not None:
        area = f"{area_indicator(points, mission):.4f}"
    else:
        area = f"{moocore.hypervolume(points, ref=[0, 0], maximise=True) if len(points) else 0:.3g}"
    return f"area {area}, {counted(len(points), 'plan')}"


def _draw_front(
    ax: Axes, points: FloatArray, corners: FloatArray, drawn: int, label: str | None
) -> None:
    colour, marker = look.colours(drawn + 1)[-1], look.MARKERS[drawn % len(look.MARKERS)]
    ax.fill(*corners.T, facecolor=colour, alpha=0.16, linewidth=0, zorder=1, label="_area")
    ax.plot(*corners[:-1].T, color=colour, linewidth=1.0, zorder=2, label=_STAIRS)
    best = np.asarray(moocore.is_nondominated(points, maximise=True, keep_weakly=True))
    size, rim = (3.5, 0.0) if len(points) > _CROWD else (5.0, 0.5)
    style: look.Style = {"marker": marker, "linestyle": "none", "markersize": size}
    style |= {"markeredgecolor": "white", "markeredgewidth": rim, "clip_on": False}
    if not best.all():
        pale = look.tint(colour, 0.55)
        ax.plot(*points[~best].T, **style, color=pale, zorder=2.5, label="_dominated")
    ax.plot(*points[best].T, **style, color=colour, zorder=3, label=label or "_front")


def _shade_gap(
    ax: Axes, corners: FloatArray, bound: FrontBound, gap: float, label: str | None
) -> None:
    """Shade what lies between a front, whose corners are given, and a bound."""
    more = f"at most {100 * gap:.2f} % more area"
    highest = staircase(bound.points)
    # Back along the front, so that what it dominates is left out.
    between = np.concatenate([highest, corners[::-1]])
    name = f"{label}, open: {more}" if label else f"open: {more}"
    ax.fill(*between.T, facecolor=look.MUTED, alpha=0.25, linewidth=0, zorder=1, label=name)
    ax.plot(*highest[:-1].T, color=look.MUTED, linewidth=1.0, zorder=1.5, label="_bound")


def _ring_plans(ax: Axes, points: FloatArray, chosen: Mapping[int, str]) -> None:
    """Ring chosen plans and write what they are beside them, where no two texts overlap."""
    figure = ax.figure.figure
    if chosen and (engine := figure.get_layout_engine()) is not None:
        engine.execute(figure)
    drawn = [np.asarray(line.get_xydata(), dtype=float) for line in ax.lines]
    space = Space(ax, points[list(chosen)], _RING, np.concatenate(drawn))
    ring: look.Style = {"marker": "o", "markersize": 2 * _RING, "markerfacecolor": "none"}
    ring |= {"markeredgecolor": look.INK, "markeredgewidth": 1.6, "label": "_highlight"}
    for row, text in chosen.items():
        ax.plot(*points[[row]].T, **ring, clip_on=False, zorder=4)
        space.write_beside(points[row], text, 9.5, reach=60.0, bold=True)


def plot_fronts(
    plans: pd.DataFrame,
    runs: pd.DataFrame,
    *,
    reference: pd.DataFrame | None = None,
    bound: pd.DataFrame | None = None,
    algorithms: Sequence[str] | None = None,
    palette: look.Palette | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the final front of each algorithm's median run over each other.

    The median run is the one with the median area, of the middle two the lower.

    Parameters
    ----------
    plans
        Rows of one mission in a study's plans: columns ``algorithm``, ``seed``, ``reward`` and
        ``survivors``.
    runs
        Rows of the same mission in its runs: columns ``algorithm``, ``seed`` and ``area``.
    reference
        Points of the reference front, columns ``reward`` and ``survivors``; a thin line.
    bound
        Points that plans do not exceed, as in a study's bounds, in the same columns; a dashed line.
    algorithms, palette, title, ax
        As in :func:`plot_curves`.

    Raises
    ------
    ValueError
        If a column is missing, there are rows of several missions, or an algorithm is not known.

    Examples
    --------
    >>> import pandas as pd
    >>> from botohe_moo.plots import plot_fronts, save_plot
    >>> runs = pd.DataFrame(
    ...     [("ants", 1, "done", 0.5), ("ants", 2, "done", 0.4), ("greedy", 1, "done", 0.3)],
    ...     columns=["algorithm", "seed", "status", "area"],
    ... )  # of a study: tables.runs.query("mission == 'museum'")
    >>> plans = pd.DataFrame(
    ...     [("ants", 1, 5, 1), ("ants", 2, 4, 1), ("greedy", 1, 3, 1)],
    ...     columns=["algorithm", "seed", "reward", "survivors"],
    ... )
    >>> save_plot(plot_fronts(plans, runs), "fronts.png")
    """
    fronts = final_fronts(plans, runs, algorithms)
    seeds = {label: median_run(runs[runs["algorithm"] == label]) for label in fronts}
    thin, dashed = {"color": look.INK, "linewidth": 0.6}, {"color": look.MUTED, "linestyle": "--"}
    further: list[tuple[pd.DataFrame | None, dict[str, Any]]] = [
        (reference, {"label": "reference front", **thin}),
        (bound, {"label": "no plan lies beyond", "linewidth": 1.0, **dashed}),
    ]
    # The corners that are plans are every second one, from the upper end of the front.
    looks: look.Style = {"markevery": (1, 2), "markersize": 4, "linewidth": 1.2}
    looks |= {"markeredgecolor": "white", "markeredgewidth": 0.3}
    with look.theme():
        ax = ax or look.new_axes(7.5, max(4.0, 0.42 * len(fronts)))
        for label, style in look.line_styles(fronts, palette).items():
            front = fronts[label][seeds[label]]
            style["label"] += f" (seed {seeds[label]})" + ("" if len(front) else ": no plans")
            ax.plot(*staircase(front)[:-1].T, **style, **looks)
        for points, style in further:
            if points is not None:
                corners = staircase(points[["reward", "survivors"]].to_numpy(float))[:-1]
                ax.plot(*corners.T, **style)
        ax.set(xlim=(0, None), ylim=(0, None))
        return look.finish(ax, title, *OBJECTIVES)


def plot_attainment(
    plans: pd.DataFrame,
    runs: pd.DataFrame,
    *,
    algorithms: Sequence[str] | None = None,
    palette: look.Palette | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw each algorithm's median attainment surface, between those of a quarter of its runs.

    Below and left of the line lies what at least half of the runs reach; the band lies between
    what a quarter and what three quarters of them reach. A run without a front reaches nothing.

    Parameters
    ----------
    plans, runs
        As in :func:`plot_fronts`.
    algorithms, palette, title, ax
        As in :func:`plot_curves`.

    Raises
    ------
    ValueError
        If a column is missing, there are rows of several missions, or an algorithm is not known.

    Examples
    --------
    >>> import pandas as pd
    >>> from botohe_moo.plots import plot_attainment, save_plot
    >>> runs = pd.DataFrame(
    ...     [("ants", 1, "done", 0.5), ("ants", 2, "done", 0.4), ("greedy", 1, "done", 0.3)],
    ...     columns=["algorithm", "seed", "status", "area"],
    ... )  # of a study: tables.runs.query("mission == 'museum'")
    >>> plans = pd.DataFrame(
    ...     [("ants", 1, 5, 1), ("ants", 2, 4, 1), ("greedy", 1, 3, 1)],
    ...     columns=["algorithm", "seed", "reward", "survivors"],
    ... )
    >>> save_plot(plot_attainment(plans, runs), "attainment.png")
    """
    fronts = final_fronts(plans, runs, algorithms)
    with look.theme():
        ax = ax or look.new_axes(7.5, max(4.0, 0.42 * len(fronts)))
        for label, style in look.line_styles(fronts, palette).items():
            runs_of = list(fronts[label].values())
            few, half, most = (staircase(attainment_surface(runs_of, p))[:-1] for p in (25, 50, 75))
            # Markers are not plans: a few are enough to tell the lines apart.
            ax.plot(*half.T, markevery=max(1, len(half) // 8), markersize=5, **style)
            if len(runs_of) > 1:
                band = np.concatenate([few, most[::-1]])
                ax.fill(*band.T, color=style["color"], alpha=0.2, linewidth=0)
        ax.set(xlim=(0, None), ylim=(0, None))
        return look.finish(ax, title, *OBJECTIVES)


def plot_attainment_difference(
    plans: pd.DataFrame,
    runs: pd.DataFrame,
    algorithm: str,
    other: str,
    *,
    palette: look.Palette | None = None,
    title: str | None = None,
    axes: Sequence[Axes] | None = None,
) -> tuple[Axes, Axes]:
    """Draw where more runs of one algorithm than of another reach, and where fewer do.

    On the left what ``algorithm`` reaches more often, on the right what ``other`` does, the darker
    the larger the difference between the shares of their runs. The solid line bounds what any run
    of both reaches, the dashed one what half of the panel's algorithm's runs reach. A run without a
    front reaches nothing.

    Parameters
    ----------
    plans, runs
        As in :func:`plot_fronts`.
    algorithm, other
        Labels of the algorithms on the left and on the right.
    palette, title
        As in :func:`plot_curves`.
    axes
        The two axes to draw on. A figure with two will be created if not given.

    Raises
    ------
    ValueError
        If a column is missing, there are rows of several missions, or an algorithm is not known.

    Examples
    --------
    >>> import pandas as pd
    >>> from botohe_moo.plots import plot_attainment_difference, save_plot
    >>> runs = pd.DataFrame(
    ...     [("ants", 1, "done", 0.5), ("ants", 2, "done", 0.4), ("greedy", 1, "done", 0.3)],
    ...     columns=["algorithm", "seed", "status", "area"],
    ... )  # of a study: tables.runs.query("mission == 'museum'")
    >>> plans = pd.DataFrame(
    ...     [("ants", 1, 5, 1), ("ants", 2, 4, 1), ("greedy", 1, 3, 1)],
    ...     columns=["algorithm", "seed", "reward", "survivors"],
    ... )
    >>> left, right = plot_attainment_difference(plans, runs, "ants", "greedy")
    >>> save_plot(left, "difference.png")
    """
    import seaborn as sns  # late, for the pictures of a solution's front

    fronts = final_fronts(plans, runs, [algorithm, other])
    colours = look.palette_of(fronts, palette)
    mine, theirs = (list(fronts[label].values()) for label in (algorithm, other))
    reach = staircase(attainment_surface([*mine, *theirs], 0))[:-1]
    most = np.where(reach.max(axis=0) > 0, reach.max(axis=0), 1.0)
    # The middles of the cells of an image.
    grid = (np.arange(_CELLS) + 0.5) / _CELLS * most[:, None]
    difference = attainment(mine, *grid) - attainment(theirs, *grid)
    legend: look.Style = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.13), "ncols": 3}
    legend |= {"columnspacing": 1.2, "fontsize": "small", "title": "share of its runs, ahead by"}
    with look.theme():
        if axes is None:
            shape: look.Style = {"figsize": (9.7, 5.0), "layout": "constrained"}
            axes = plt.subplots(1, 2, sharex=True, sharey=True, **shape)[1].tolist()
        left, right = axes
        sides = ((left, algorithm, mine, difference), (right, other, theirs, -difference))
        for ax, label, found, ahead in sides:
            shades = sns.light_palette(colours[label], _SHADES + 1)[1:]
            # Each step includes its upper end: a difference of 1/5 is in the first.
            steps = np.ceil(ahead * _SHADES - 1e-9)
            image: look.Style = {"extent": (0.0, most[0], 0.0, most[1]), "aspect": "auto"}
            image |= {"origin": "lower", "vmin": 1, "vmax": _SHADES, "zorder": 1}
            ax.imshow(np.ma.masked_less(steps, 1), ListedColormap(shades), **image)
            keys: list[Artist] = [
                Patch(color=shade, label=f"{100 * i // _SHADES}–{100 * (i + 1) // _SHADES} %")
                for i, shade in enumerate(shades)
            ]
            half = staircase(attainment_surface(found, 50))[:-1]
            line: look.Style = {"color": look.INK, "linewidth": 1.0}
            keys += ax.plot(*reach.T, **line, label="any run of both")
            keys += ax.plot(*half.T, **line, linestyle="--", label="half of its runs")
            ax.set(xlim=(0, 1.05 * most[0]), ylim=(0, 1.05 * most[1]), xlabel=OBJECTIVES[0])
            name = look.wrapped([label])[0]
            ax.set_title(f"{name} reaches more often", fontweight="normal")
            ax.legend(handles=keys, **legend)
        left.set_ylabel(OBJECTIVES[1])
        if title:
            left.figure.suptitle(title, x=0.01, ha="left", fontweight="bold")
    return left, right


def plot_pairs(
    table: pd.DataFrame,
    objectives: Objectives,
    *,
    hue: str | None = None,
    palette: look.Palette | None = None,
) -> Axes:
    """Plot a front's objectives pair by pair, and how each of them is distributed.

    Parameters
    ----------
    table
        A row a plan, with the columns that ``objectives`` names.
    objectives
        The objectives of the problem.
    hue
        Another column, whose values have a colour each, such as ``"algorithm"``.
    palette
        The colours, as seaborn takes them.

    Returns
    -------
    Axes
        The lowest one on the left.

    Raises
    ------
    ValueError
        If the table lacks a column.

    Examples
    --------
    >>> from botohe_moo import solve
    >>> from botohe_moo.plots import plot_pairs
    >>> found = solve("toy", "nsga2", problem="least-survival", evaluations=500)
    >>> ax = plot_pairs(found.table, found.problem_objectives)
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('E[R]', 'least survival')
    """
    import seaborn as sns

    look.check_table("table", table, (*objectives.columns, *([] if hue is None else [hue])))
    named = table.rename(columns=dict(zip(objectives.columns, objectives.names, strict=True)))
    with look.theme():
        grid = sns.PairGrid(named, vars=[*objectives.names], hue=hue, palette=palette, corner=True)
        grid.map_lower(sns.scatterplot, s=18, alpha=0.8)
        grid.map_diag(sns.histplot, **({} if hue is None else {"element": "step"}))
        if hue is not None:
            grid.add_legend()
    ax: Axes = grid.axes[-1, 0]
    return ax


def final_fronts(
    plans: pd.DataFrame, runs: pd.DataFrame, algorithms: Sequence[str] | None
) -> dict[str, dict[int, FloatArray]]:
    """Return the final front (n_plans, 2) of every run, perhaps empty, by label and seed."""
    labels = look.chosen_algorithms("runs", runs, ("algorithm", "seed", "area"), algorithms)
    point = ["reward", "survivors"]
    look.check_table("plans", plans, ("algorithm", "seed", *point))
    points = plans[point].to_numpy(float)
    of_runs = plans.groupby(["algorithm", "seed"], observed=True).indices
    found = {key: points[rows] for key, rows in of_runs.items()}
    return {
        label: {
            seed: found.get((label, seed), np.empty((0, 2)))
            for seed in sorted(runs.loc[runs["algorithm"] == label, "seed"].tolist())
        }
        for label in labels
    }


def median_run(runs: pd.DataFrame) -> int:
    """Return the seed of the run with the median area, of the middle two the lower."""
    ranked = runs.sort_values(["area", "seed"], kind="stable")["seed"].tolist()
    return int(ranked[(len(ranked) - 1) // 2])


def attainment_surface(fronts: Iterable[FloatArray], percent: float) -> FloatArray:
    """Return the non-dominated corners (n, 2) of what at least ``percent`` of the runs reach.

    Fronts are points (n_plans, 2), to be maximised; an empty one reaches the origin only. A
    ``percent`` of 0 means one run.

    Fonseca, Guerreiro, López-Ibáñez and Paquete, "On the computation of the empirical attainment
    function", EMO 2011.
    """
    # Moocore does not take empty sets.
    points = [front if len(front) else np.zeros((1, 2)) for front in fronts]
    run = np.repeat(np.arange(len(points)), [len(front) for front in points])
    surface = moocore.eaf(-np.concatenate(points), run, percentiles=[percent])
    return np.asarray(-surface[:, :2] + 0.0)  # no negative zeros


def attainment(
    fronts: Sequence[FloatArray], rewards: FloatArray, survivors: FloatArray
) -> FloatArray:
    """Return the share of runs that reach each point of a grid (n_survivors, n_rewards)."""
    reached = np.zeros((len(survivors), len(rewards)))
    for front in fronts:
        by_reward = front[np.argsort(front[:, 0])]
        # The most survivors with at least the reward of each plan; none with more than the largest.
        best = np.append(np.maximum.accumulate(by_reward[::-1, 1])[::-1], 0.0)
        reached += survivors[:, None] <= best[np.searchsorted(by_reward[:, 0], rewards)]
    return reached / len(fronts)
