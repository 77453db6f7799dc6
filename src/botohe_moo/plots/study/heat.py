"""The picture of a grid of two parameters: the median of every combination."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd
import seaborn as sns
from matplotlib.axes import Axes

from botohe_moo.plots.draw.style import new_axes, theme

_NO_PARAMETERS = {"algorithm", "name", "family", "package", "version"}


def plot_heat(
    medians: pd.DataFrame,
    *,
    palette: str = "crest",
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the median of every combination of two parameters, the darker the larger.

    The largest is bold.

    Parameters
    ----------
    medians
        One row for each value of the first parameter, one column for each of the second; the names
        of index and columns are those of the parameters. What is missing stays empty.
    palette
        Name of a sequential palette.
    title, ax
        As in :func:`plot_curves`.

    Raises
    ------
    ValueError
        If no combination has a median.

    Examples
    --------
    >>> import pandas as pd
    >>> from botohe_moo.plots import plot_heat, save_plot
    >>> medians = pd.DataFrame(
    ...     [[0.48, 0.51], [0.50, 0.52]],
    ...     index=pd.Index([50, 100], name="n_ants"),
    ...     columns=pd.Index([0.04, 0.1], name="evaporation"),
    ... )
    >>> save_plot(plot_heat(medians), "grid.png")
    """
    values = medians.astype(float)
    if not values.notna().any(axis=None):
        raise ValueError("Expected the median of at least one combination, got none.")
    n_rows, n_columns = values.shape
    with theme():
        ax = ax or new_axes(1.8 + 1.0 * n_columns, 1.2 + 0.55 * n_rows)
        sns.heatmap(values, annot=True, fmt=".4f", cmap=palette, cbar=False, ax=ax)
        ax.grid(visible=False)
        ax.tick_params(length=0, rotation=0)
        ax.set_title(title or "")
        for text in ax.texts:
            if text.get_text() == f"{np.nanmax(values):.4f}":
                text.set_fontweight("bold")
    return ax


def two_parameter_grids(algorithms: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Find families of algorithms in which exactly two parameters vary, and nothing else does.

    Returns for each family the algorithms' labels: a row for each value of the first parameter, a
    column for each of the second, in ascending order, or in that of ``algorithms``, the study's
    table, if they are not numbers; missing where there is no such algorithm.
    """
    parameters = [column for column in algorithms.columns if column not in _NO_PARAMETERS]
    if algorithms.empty or len(parameters) < 2:
        return {}
    grids = {}
    for family, rows in algorithms.groupby("family", sort=False):
        shown = rows[parameters].astype(object).where(rows[parameters].notna(), "default")
        varying = [name for name in parameters if len(set(shown[name])) > 1]
        if len(varying) != 2 or len(set(rows["name"])) > 1 or shown.duplicated(varying).any():
            continue
        labels = rows["algorithm"].set_axis(pd.MultiIndex.from_frame(shown[varying])).unstack()  # noqa: PD010
        index, columns = (_ordered(shown[name]) for name in varying)
        grids[str(family)] = labels.reindex(index=index, columns=columns)
    return grids


def _ordered(values: Iterable[Any]) -> list[Any]:
    found = list(dict.fromkeys(values))
    numbers = all(isinstance(value, int | float | np.number) for value in found)
    return sorted(found) if numbers else found
