"""A front of any number of objectives, pair by pair."""

from typing import TYPE_CHECKING, Any

import seaborn as sns

from botohe_moo.objectives import Objectives

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


def plot_pairs(
    table: "pd.DataFrame",
    objectives: Objectives,
    *,
    hue: str | None = None,
    palette: Any = None,
) -> "Axes":
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

    Examples
    --------
    >>> from botohe_moo import solve
    >>> from botohe_moo.plots import plot_pairs
    >>> found = solve("toy", "nsga2", problem="least-survival", evaluations=500)
    >>> ax = plot_pairs(found.table, found.stated)
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('E[R]', 'least survival')
    """
    named = table.rename(columns=dict(zip(objectives.columns, objectives.names, strict=True)))
    grid = sns.PairGrid(named, vars=[*objectives.names], hue=hue, palette=palette, corner=True)
    grid.map_lower(sns.scatterplot, s=18, alpha=0.8)
    grid.map_diag(sns.histplot, **({} if hue is None else {"element": "step"}))
    if hue is not None:
        grid.add_legend()
    ax: Axes = grid.axes[-1, 0]
    return ax
