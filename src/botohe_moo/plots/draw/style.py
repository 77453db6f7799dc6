"""Palettes, the theme, and saving of pictures."""

import io
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import seaborn as sns  # registers its palettes with matplotlib, too
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, to_rgb
from matplotlib.figure import Figure
from seaborn.utils import relative_luminance

from botohe_moo._base.files import replace_file

Colour = tuple[float, float, float]
Palette = str | Sequence[Any] | Mapping[str, Any]

DPI = 160
INK = "#262626"
MUTED = "#8c8c8c"
FORMATS = (".png", ".pdf", ".svg")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")  # so that fronts differ in a grey print too

# Sequential palettes: the darker, the more reward, danger or pheromone, or the more likely reached.
REWARD, SURVIVAL, PHEROMONE = "crest", "flare_r", "flare"
REACH = LinearSegmentedColormap.from_list("slate", ["#ffffff", "#c3ccd8", "#7f90a8", "#26364e"])

# Seaborn's ticks with a pale grid; seaborn's own grid is too dark behind many lines.
_STYLE = {"axes.grid": True, "grid.color": "0.92"}
_STYLE |= {"axes.spines.top": False, "axes.spines.right": False, "axes.titlelocation": "left"}
_STYLE |= {"axes.titleweight": "bold", "legend.frameon": False, "lines.solid_capstyle": "round"}


def colours(n: int) -> list[Colour]:
    """Return the first ``n`` colours of the theme's cycle, which begins again after the last."""
    with theme():
        return list(sns.color_palette(None, n))


def palette_of(labels: Iterable[str], palette: Palette | None = None) -> dict[str, Any]:
    """Return a colour for each label: of ``palette``, as seaborn takes it, or of the theme.

    Raises
    ------
    ValueError
        If ``palette`` is a mapping without one of the labels, or not known to seaborn.
    """
    labels = list(dict.fromkeys(labels))
    if isinstance(palette, Mapping):
        if absent := [label for label in labels if label not in palette]:
            raise ValueError(f"Expected a colour for every label, missing: {', '.join(absent)}.")
        return {label: palette[label] for label in labels}
    with theme():
        found = sns.color_palette(palette, len(labels))
    return dict(zip(labels, found, strict=False))


def tint(colour: Any, strength: float) -> Colour:
    """Mix a colour into white; ``strength`` 0 is white and 1 the colour itself."""
    red, green, blue = (1 - strength * (1 - part) for part in to_rgb(colour))
    return red, green, blue


def readable_on(colour: Any) -> str:
    """Return the text colour, light or dark, that is legible on ``colour``."""
    return "white" if relative_luminance(colour) < 0.2 else INK


@contextmanager
def theme() -> Iterator[None]:
    """Draw in the project's style, unless a theme is set, as by ``seaborn.set_theme``.

    What matplotlib is set to outside stays as it is.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> from botohe_moo.plots import save_plot, theme
    >>> with theme():
    ...     fig, ax = plt.subplots()
    >>> line = ax.plot([0, 1], [2, 0])
    >>> save_plot(ax, "mine.png")
    """
    own = {**sns.axes_style("ticks"), **_STYLE}
    # Fonts are left to the user: those that are not installed on a machine only cause warnings.
    own = {name: value for name, value in own.items() if not name.startswith("font.")}
    own["axes.prop_cycle"] = cycler(color=sns.color_palette("colorblind"))
    is_set = any(mpl.rcParams[name] != mpl.rcParamsDefault[name] for name in own)
    # A dollar sign in a label is a dollar sign.
    with mpl.rc_context({"text.parse_math": False, **({} if is_set else own)}):
        yield


def new_axes(width: float, height: float) -> Axes:
    """Open a figure of ``width`` x ``height`` inches with one plot in it."""
    with theme():
        _, ax = plt.subplots(figsize=(width, height), layout="constrained")
    for axis in (ax.xaxis, ax.yaxis):
        axis.label.set_parse_math(True)  # ours are plain, and yours may be mathematics
    return ax


def save_figure(
    fig: Figure, path: str | os.PathLike[str], *others: str | os.PathLike[str], dpi: int = DPI
) -> None:
    """Write a figure, whole or not at all; the picture is as large as what is drawn.

    Parameters
    ----------
    fig
        Figure to write; it stays open.
    path
        File to write or to replace, PNG, PDF or SVG by its name; its folder exists already.
    *others
        Further files to write.
    dpi
        Pixels an inch.

    Raises
    ------
    ValueError
        If a path does not end in ``.png``, ``.pdf`` or ``.svg``.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> from botohe_moo.plots import save_figure
    >>> fig, ax = plt.subplots()
    >>> save_figure(fig, "mine.png", "mine.svg")
    >>> plt.close(fig)
    """
    targets = [Path(target) for target in (path, *others)]
    for target in targets:
        if target.suffix.lower() not in FORMATS:
            raise ValueError(
                f"Expected a path that ends in '.png', '.pdf' or '.svg', got {str(target)!r}."
            )
    engine = fig.get_layout_engine()
    if engine is not None:  # laid out once, not anew for each file
        engine.execute(fig)
        fig.set_layout_engine("none")
    try:
        for target in targets:
            drawn = io.BytesIO()
            # Journals refuse the Type 3 fonts that matplotlib writes by default.
            with mpl.rc_context({"pdf.fonttype": 42}):
                fig.savefig(drawn, format=target.suffix.lower()[1:], dpi=dpi, bbox_inches="tight")
            replace_file(target, drawn.getvalue())
    finally:
        if engine is not None:
            fig.set_layout_engine(engine)


def save_plot(ax: Axes, path: str | os.PathLike[str], *others: str | os.PathLike[str]) -> None:
    """Write the figure that ``ax`` is in, as :func:`save_figure` does, and close it.

    Parameters
    ----------
    ax
        A plot, the only one in its figure or one of several.
    path
        File to write or to replace, PNG, PDF or SVG by its name; its folder exists already.
    *others
        Further files to write.

    Examples
    --------
    >>> from botohe_moo import load_mission, plot_mission
    >>> from botohe_moo.plots import save_plot
    >>> save_plot(plot_mission(load_mission("toy")), "mission.png", "mission.pdf")
    """
    figure = ax.get_figure(root=True)
    if figure is None:
        raise ValueError("Expected axes in a figure, got axes that were removed from theirs.")
    save_figure(figure, path, *others)
    plt.close(figure)
