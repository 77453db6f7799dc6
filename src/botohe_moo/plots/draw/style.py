"""The theme and the palettes of pictures, and saving them."""

import io
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, to_rgb
from matplotlib.figure import Figure

from botohe_moo.base.files import check_suffix, replace_file

Colour = tuple[float, float, float]
Palette = str | Sequence[Any] | Mapping[str, Any]

DPI = 160
FORMATS = (".png", ".pdf", ".svg")

INK = "#262626"
MUTED = "#8c8c8c"
MARKERS = ("o", "s", "^", "D", "v", "P", "X")  # so that fronts differ in a grey print, too

# Seaborn's palettes "colorblind", "crest" and "flare" and its style "ticks" are written out:
# importing seaborn, which loads pandas and scipy.stats, takes longer than drawing a mission and its
# front. Only pictures of studies and outcomes import it.
# fmt: off
_COLOURBLIND = [
    "#0173b2", "#de8f05", "#029e73", "#d55e00", "#cc78bc",
    "#ca9161", "#fbafe4", "#949494", "#ece133", "#56b4e9",
]
# In sequential palettes the darker colour is more reward, danger or pheromone, or the node that is
# reached with the greater probability.
REWARD = LinearSegmentedColormap.from_list("crest", [
    "#a5cd90", "#92c491", "#7fbb91", "#6db290", "#5da890", "#509e90", "#44948f", "#398a8e",
    "#2e808d", "#24768b", "#1d6c8a", "#1d6187", "#215584", "#26497e", "#2a3d78", "#2c3172",
])
PHEROMONE = LinearSegmentedColormap.from_list("flare", [
    "#edb081", "#ec9f76", "#ea8f6c", "#e77e63", "#e46d5d", "#de5d5c", "#d64f5f", "#c94465",
    "#ba3e6a", "#aa3a6e", "#9a3670", "#8a3171", "#7a2e70", "#6a2b6c", "#5a2767", "#4b2362",
])
# fmt: on
SURVIVAL = PHEROMONE.reversed()
REACH = LinearSegmentedColormap.from_list("slate", ["#ffffff", "#c3ccd8", "#7f90a8", "#26364e"])

_THEME: dict[Any, Any] = {
    "axes.axisbelow": True,
    "axes.edgecolor": INK,
    "axes.facecolor": "white",
    "axes.grid": True,
    "axes.labelcolor": INK,
    "axes.prop_cycle": cycler(color=_COLOURBLIND),
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "figure.facecolor": "white",
    "grid.color": "0.92",  # seaborn's is too dark behind many lines
    "legend.frameon": False,
    "lines.solid_capstyle": "round",
    "patch.edgecolor": "white",
    "patch.force_edgecolor": True,
    "text.color": INK,
    "xtick.color": INK,
    "xtick.direction": "out",
    "ytick.color": INK,
    "ytick.direction": "out",
}


def colours(n: int) -> list[Colour]:
    """Return the first ``n`` colours of the theme's cycle, which begins again after the last."""
    with theme():
        return [to_rgb(f"C{i}") for i in range(n)]


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
    if palette is None:
        return dict(zip(labels, colours(len(labels)), strict=True))
    import seaborn as sns

    found = sns.color_palette(palette, len(labels))
    return dict(zip(labels, found, strict=False))


def tint(colour: Any, strength: float) -> Colour:
    """Mix a colour into white; ``strength`` 0 is white and 1 the colour itself."""
    red, green, blue = (1 - strength * (1 - part) for part in to_rgb(colour))
    return red, green, blue


def luminance(colour: Any) -> float:
    """Return the relative luminance of a colour, from 0 to 1 (WCAG)."""
    red, green, blue = (part**2.2 for part in to_rgb(colour))
    return float(0.2126 * red + 0.7152 * green + 0.0722 * blue)


def readable_on(colour: Any) -> str:
    """Return the text colour, light or dark, that is legible on ``colour``."""
    return "white" if luminance(colour) < 0.2 else INK  # at 0.2 both have the same contrast


@contextmanager
def theme() -> Iterator[None]:
    """Draw in the style of this package, unless a theme is set, as by ``seaborn.set_theme``.

    Outside of the ``with`` block, matplotlib's settings stay as they are.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> from botohe_moo.plots import save_plot, theme
    >>> with theme():
    ...     fig, ax = plt.subplots()
    >>> line = ax.plot([0, 1], [2, 0])
    >>> save_plot(ax, "mine.png")
    """
    # A notebook's backend makes matplotlib interactive when it is loaded: that has to last.
    plt.draw_if_interactive()  # type: ignore[no-untyped-call]
    # The font is not part of it: a font that is not installed causes warnings.
    is_set = any(mpl.rcParams[name] != mpl.rcParamsDefault[name] for name in _THEME)
    # Labels of users may contain dollar signs, which are not to start mathematics. An offset of
    # the ticks would be written over the name of the axis.
    own = {} if is_set else _THEME
    with mpl.rc_context({"text.parse_math": False, "axes.formatter.useoffset": False, **own}):
        yield


def new_axes(width: float, height: float) -> Axes:
    """Open a figure of ``width`` x ``height`` inches with one plot in it."""
    with theme():
        _, ax = plt.subplots(figsize=(width, height), layout="constrained")
    for axis in (ax.xaxis, ax.yaxis):
        axis.label.set_parse_math(True)  # for users who name an axis by a formula
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
        check_suffix(target, FORMATS)
    engine = fig.get_layout_engine()
    if engine is not None:  # laid out once, and not again for each file
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
    figure = ax.figure.figure  # the whole one, also of axes in a subfigure
    save_figure(figure, path, *others)
    plt.close(figure)
