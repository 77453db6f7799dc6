"""What pictures share: theme, palettes, room for labels, axes and legends, and saving."""

from __future__ import annotations

import io
import os
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, to_rgb
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.patheffects import withStroke
from matplotlib.textpath import text_to_path
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from botohe_moo.base.files import check_suffix, replace_file
from botohe_moo.base.messages import check_choice, check_frame
from botohe_moo.base.parameters import Probability, check
from botohe_moo.base.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

_WORDS = "_words"
_SIDES = np.array([(1, 0), (1, 1), (1, -1), (0, 1), (0, -1), (-1, 1), (-1, -1), (-1, 0)])

# In points:
_AWAY = (1.5, 6.0, 12.0, 20.0, 30.0, 45.0, 60.0)  # distances of a text from its mark
_LEADER = 4.0  # distance from which on a line ties them
_FARTHER = 4.0  # how much farther other marks are from a text that no line ties to its own
_LEAST = 5.8  # least height of letters in a mark
_PAD = 1.5  # left and right of texts

_NAME = 30  # most letters in a line of an algorithm's name


def title_above(ax: Axes, title: str | None, words: str) -> None:
    """Write a title above a picture and pale ``words`` below it, or write them anew."""
    for text in [text for text in ax.texts if text.get_label() == _WORDS]:
        text.remove()
    width = ax.get_window_extent().width / ax.figure.figure.dpi * 72
    head, pale = (
        textwrap.wrap(text, max(8, int(width / (0.56 * size))))
        for text, size in ((title or "", 12.0), (words, 9.5))
    )
    if pale:
        look: Style = {"fontsize": 9.5, "color": "0.4", "label": _WORDS}
        look |= {"xycoords": "axes fraction", "textcoords": "offset points"}
        ax.annotate("\n".join(pale), (0, 1), (0, 7), **look)
    bold: Style = {"loc": "left", "fontsize": 12, "fontweight": "bold"}
    ax.set_title("\n".join(head), pad=8.5 + 12.5 * len(pale), **bold)


def objectives_text(reward: float, survivors: float) -> str:
    """Write the objectives of a plan."""
    return f"E[R] = {reward:.2f}, E[S] = {survivors:.2f}"


@cache
def text_size(text: str, size: float, *, bold: bool = False) -> tuple[float, float]:
    """Return width and height of a text in letters of ``size`` points, with some air around it."""
    font = FontProperties(size=size, weight="bold" if bold else "normal")
    measure, lines = text_to_path.get_text_width_height_descent, text.split("\n")
    widths = [measure(line, font, ismath=False)[0] for line in lines]
    return max(widths) + 0.2 * size, 1.15 * size * len(lines)


class Space:
    """Room on axes whose scale is known. ``boxes`` are the texts, in points, as they are placed.

    Texts cover no mark at ``marks`` (n, 2), a disc of ``radius`` points, and as few of the points
    ``lines`` (n, 2) as possible.
    """

    def __init__(self, ax: Axes, marks: FloatArray, radius: float, lines: FloatArray) -> None:
        self.ax, self.radius = ax, radius
        self.marks, self.lines = self.in_points(marks), self.in_points(lines.reshape(-1, 2))
        box = ax.get_window_extent()
        self._frame = np.array([box.min, box.max]) * 72 / ax.figure.figure.dpi
        self.boxes: list[tuple[float, ...]] = []

    def in_points(self, xy: FloatArray) -> FloatArray:
        """Return where data (n, 2) lie on paper."""
        return np.asarray(self.ax.transData.transform(xy)) * 72 / self.ax.figure.figure.dpi

    def place(
        self, centres: FloatArray, width: float, height: float, costs: FloatArray | float = 0.0
    ) -> int | None:
        """Take room for a box at one of ``centres`` (n, 2), and return which; None without room.

        The box covers the fewest points of lines, plus ``costs`` (n); of equal places the first.
        """
        if not len(centres):
            return None
        half = np.array([width / 2 + _PAD, height / 2])
        low, high = centres - half, centres + half
        free = ((low >= self._frame[0]) & (high <= self._frame[1])).all(axis=1)
        if self.boxes:
            boxes = np.array(self.boxes)[:, None]
            free &= ((low >= boxes[..., 2:]) | (high <= boxes[..., :2])).any(axis=2).all(axis=0)
        lowest, highest = low.min(axis=0) - self.radius, high.max(axis=0) + self.radius
        marks, lines = (
            points[((points > lowest) & (points < highest)).all(axis=1)]
            for points in (self.marks, self.lines)
        )
        free &= _gaps(centres, half, marks).min(axis=1, initial=np.inf) >= self.radius
        if not free.any():
            return None
        covered = (_gaps(centres, half, lines) == 0).sum(axis=1) + costs
        best = int(np.argmin(np.where(free, covered, np.inf)))
        self.boxes.append((*low[best], *high[best]))
        return best

    def write_inside(self, at: FloatArray, text: str, fill: Any) -> bool:
        """Write a text into a mark at data ``at``, if it fits there."""
        room = 1.75 * self.radius
        size = min(9.0, 0.6 * room, room / max(text_size(text, 1.0)[0], 1e-9))
        if size < _LEAST:
            return False
        look: Style = {"fontsize": size, "color": readable_on(fill), "zorder": 6}
        self.ax.annotate(text, tuple(at), ha="center", va="center_baseline", **look)
        return True

    def write_beside(
        self, at: FloatArray, text: str, size: float, *, reach: float, bold: bool = False
    ) -> bool:
        """Write a text up to ``reach`` points from a mark at data ``at``, if there is room.

        The text belongs to its mark: a line ties them, or all other marks are farther, if possible.
        """
        width, height = text_size(text, size, bold=bold)
        half, (mark,) = np.array([width, height]) / 2, self.in_points(at[None])
        # On a diagonal, a box comes closer to a disc.
        sides = np.where(_SIDES.all(axis=1), 0.7, 1.0)[:, None] * _SIDES
        away = [sides * (self.radius + gap) + _SIDES * half for gap in _AWAY if gap <= reach]
        offsets = np.concatenate(away)
        distance = _gaps(offsets, half, np.zeros((1, 2)))[:, 0]
        tied = distance > self.radius + _LEADER
        others = _gaps(mark + offsets, half, self.marks[(self.marks != mark).any(axis=1)])
        nearer = others.min(axis=1, initial=np.inf) < distance + _FARTHER
        best = self.place(mark + offsets, width, height, 1e6 * (nearer & ~tied))
        if best is None:
            return False
        look: Style = {
            "fontweight": "bold" if bold else "normal",
            "va": "center" if "\n" in text else "center_baseline",
            "path_effects": [withStroke(linewidth=1.8, foreground="white")],
        }
        if tied[best]:
            # From the text's edge that faces the mark.
            edge = tuple(0.5 - np.clip(offsets[best] / half, -1, 1).round() / 2)
            look["arrowprops"] = {"arrowstyle": "-", "color": MUTED, "lw": 0.6, "relpos": edge}
            look["arrowprops"] |= {"shrinkA": 1.0, "shrinkB": self.radius}
        look |= {"fontsize": size, "color": INK, "ha": "center", "linespacing": 1.0, "zorder": 6}
        look |= {"textcoords": "offset points", "annotation_clip": False}
        self.ax.annotate(text, tuple(at), tuple(offsets[best]), **look)
        return True


def _gaps(centres: FloatArray, half: FloatArray, points: FloatArray) -> FloatArray:
    """Compute how far points (m, 2) are from boxes around centres (n, 2), as (n, m)."""
    beyond = (np.abs(points - centres[:, None]) - half).clip(min=0.0)
    return np.asarray(np.hypot(beyond[..., 0], beyond[..., 1]))


Colour = tuple[float, float, float]
Palette = str | Sequence[Any] | Mapping[str, Any]
Style = dict[str, Any]  # keyword arguments of what matplotlib draws

DPI = 160
FORMATS = (".png", ".pdf", ".svg")

INK = "#262626"
MUTED = "#8c8c8c"
MARKERS = ("o", "s", "^", "D", "v", "P", "X")  # so that fronts differ in a grey print, too

# Seaborn's palettes "crest" and "flare" are written out, and its "colorblind" and "ticks" are in
# own.mplstyle: importing seaborn, which loads pandas and scipy.stats, takes longer than drawing a
# mission and its front. Only pictures of studies and outcomes import it.
# fmt: off
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

_OWN = Path(__file__).with_name("own.mplstyle")
_THEME = mpl.rc_params_from_file(_OWN, use_default_template=False)


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

    return dict(zip(labels, sns.color_palette(palette, len(labels)), strict=False))


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


def check_table(name: str, frame: pd.DataFrame, columns: Sequence[str]) -> None:
    """Refuse what is not a table, lacks a column, or is of several missions."""
    check_frame(name, frame)
    if missing := [column for column in columns if column not in frame.columns]:
        raise ValueError(f"Expected {name} with columns {tuple(columns)}, it lacks {missing}.")
    missions = frame["mission"].unique() if "mission" in frame.columns else ()
    if len(missions) > 1:
        found = ", ".join(map(repr, missions))
        raise ValueError(f"Expected {name} of one mission, got {found}.")


def chosen_algorithms(
    name: str, frame: pd.DataFrame, columns: Sequence[str], algorithms: Sequence[str] | None
) -> list[str]:
    """Check a table of one mission, and return the algorithms to draw: all by default."""
    check_table(name, frame, columns)
    known = list(frame["algorithm"].unique())
    for label in algorithms or ():
        check_choice(f"an algorithm of {name}", label, known)
    labels = known if algorithms is None else list(dict.fromkeys(algorithms))
    if not labels:
        raise ValueError("Expected at least one algorithm, got none.")
    return labels


def wrapped(labels: Iterable[str]) -> list[str]:
    """Return names as pictures show them, on lines of at most 30 letters."""
    return [textwrap.fill(str(label), _NAME) for label in labels]


def line_styles(labels: Iterable[str], palette: Palette | None) -> dict[str, dict[str, Any]]:
    """Return colour, marker and name of each line."""
    pairs = zip(palette_of(labels, palette).items(), cycle(MARKERS), strict=False)
    return {
        label: {"color": colour, "marker": marker, "label": label}
        for (label, colour), marker in pairs
    }


def finish(ax: Axes, title: str | None, x: str, y: str) -> Axes:
    """Write the title, the names of both axes, and right of them the legend, if there is one."""
    ax.set(xlabel=x, ylabel=y, title=title or "")
    handles, names = ax.get_legend_handles_labels()
    if handles:
        ax.legend(handles, wrapped(names), loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return ax


def log_axis(ax: Axes, which: Literal["x", "y"] = "x") -> None:
    """Make an axis logarithmic, with numbers that people read: 0.01, 200, 10,000."""
    ax.set(**{f"{which}scale": "log"})
    axis = ax.xaxis if which == "x" else ax.yaxis
    low, high = axis.get_view_interval()
    if high < 5 * low:
        axis.set_major_locator(MaxNLocator(4))
    elif high < 50 * low:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    # The formatter of matplotlib writes mathematics, which the theme switches off.
    axis.set_major_formatter(lambda value, _: f"{value:,.10f}".rstrip("0").rstrip("."))
    axis.set_minor_formatter(NullFormatter())


def draw_bound(ax: Axes, bound: float | None, which: Literal["x", "y"]) -> None:
    """Draw a dashed line at the area ``bound``, which the axis then reaches.

    A line that would more than double the areas that are shown is left out.
    """
    low, high = (ax.xaxis if which == "x" else ax.yaxis).get_view_interval()
    if bound is not None and check("bound", bound, Probability) <= 2 * high - low:
        draw = ax.axvline if which == "x" else ax.axhline
        label = f"no front exceeds {bound:.4f}"
        draw(bound, color=MUTED, ls="--", lw=1.0, zorder=1, label=label)
        ax.set(**{f"{which}lim": (low, max(high, bound))})


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
    # As large as what is drawn; found once, and not again for each file.
    box = fig.get_tightbbox().padded(mpl.rcParams["savefig.pad_inches"])
    try:
        for target in targets:
            drawn = io.BytesIO()
            # Journals refuse the Type 3 fonts that matplotlib writes by default.
            with mpl.rc_context({"pdf.fonttype": 42}):
                fig.savefig(drawn, format=target.suffix.lower()[1:], dpi=dpi, bbox_inches=box)
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
