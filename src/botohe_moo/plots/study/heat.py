"""The picture of a grid of two parameters: the median of every combination."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from botohe_moo.plots.draw.labels import columns, drawable, wrapped
from botohe_moo.plots.draw.panels import study_axes
from botohe_moo.plots.draw.scales import title_above
from botohe_moo.plots.draw.style import INK, colour_range, readable_on, reward_palette, theme

_NO_PARAMETERS = {"algorithm", "name", "family", "package", "version"}


def plot_heat(
    medians: pd.DataFrame, *, name: str = "area", title: str | None = None, ax: Axes | None = None
) -> Axes:
    """Draw the median of every combination of two parameters, the darker the larger.

    Parameters
    ----------
    medians
        One row for each value of the first parameter, one column for each of the second; the names
        of index and columns are those of the parameters. What is missing stays empty.
    name
        What the medians are of, for the line under the title.
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
    values = medians.to_numpy(float, na_value=np.nan)
    found = values[np.isfinite(values)]
    if not len(found):
        raise ValueError("Expected the median of at least one combination, got none.")
    rows, cells = (
        [wrapped(drawable(str(value)), 24) for value in labels]
        for labels in (medians.index, medians.columns)
    )
    palette, norm = reward_palette(), colour_range(found)
    best = float(found.max())
    with theme():
        if ax is None:
            wide = float(np.clip(0.15 + 0.085 * max(map(columns, cells)), 0.8, 2.4))
            (ax,) = study_axes(max(wide * len(cells), 1.6), 0.52 * len(rows))
        for (row, column), value in np.ndenumerate(values):
            if not np.isfinite(value):
                continue
            colour = palette(norm(value))
            ax.add_patch(Rectangle((column - 0.5, row - 0.5), 1, 1, facecolor=colour, gid="cell"))
            weight = "bold" if value == best else "normal"
            look: dict[str, Any] = {"color": readable_on(colour), "fontweight": weight}
            look |= {"fontsize": 9.5, "ha": "center", "va": "center"}
            ax.text(column, row, f"{value:.4f}", gid="median", **look)
        ax.set(xlim=(-0.5, len(cells) - 0.5), ylim=(len(rows) - 0.5, -0.5))
        ax.set_xticks(range(len(cells)), cells)
        ax.set_yticks(range(len(rows)), rows)
        ax.tick_params(length=0)
        ax.spines[:].set_visible(False)
        ax.set_xlabel(drawable(str(medians.columns.name)), color=INK)
        ax.set_ylabel(drawable(str(medians.index.name)), color=INK)
        title_above(ax, title, f"median {name}; the largest is bold", width=6.0)
    return ax


def two_parameter_grids(algorithms: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Find families of algorithms in which exactly two parameters vary, and nothing else does.

    Gives for each family the algorithms' labels: a row for each value of the first parameter, a
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
