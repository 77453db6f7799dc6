"""Palettes, the theme, and saving of pictures."""

import io
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from importlib.resources import as_file, files
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize, to_rgb
from matplotlib.figure import Figure

from botohe_moo._base.files import replace_file
from botohe_moo._base.types import FloatArray
from botohe_moo.plots.draw.labels import families

Colour = tuple[float, float, float]

DPI = 160
INK = "#262626"
MUTED = "#8c8c8c"
# Without dates and versions, so that the same figure gives the same bytes.
_METADATA: Mapping[str, Mapping[str, str | None]] = {
    ".png": {"Software": "botohe_moo"},
    ".pdf": {"Creator": "botohe_moo", "Producer": None, "CreationDate": None},
    ".svg": {"Creator": "botohe_moo", "Date": None},
}
# Seaborn's palettes, without seaborn: importing it takes as long as everything else together.
_CREST = (
    "#a5cd90 #93c491 #81bc91 #70b390 #61aa90 #53a190 #48988f #3e8e8e #33858d #2a7c8c #21728b "
    "#1c6889 #1e5e87 #225383 #26487e #2a3d77 #2c3172"
)
_FLARE = (
    "#edb081 #eca077 #ea916e #e88165 #e5715e #e0615c #d9535d #cf4862 #c14168 #b33c6c #a4386f "
    "#953470 #873171 #772d6f #682a6c #592767 #4b2362"
)
# Its palette "colorblind" in another order: the first few should differ the most.
_COLOURBLIND = (
    *("#0173b2", "#de8f05", "#029e73", "#cc78bc", "#d55e00"),
    *("#56b4e9", "#ca9161", "#fbafe4", "#ece133", "#949494"),
)
N_COLOURS = len(_COLOURBLIND)
with as_file(files(__package__) / "theme.mplstyle") as _path:
    _THEME = mpl.rc_params_from_file(_path, use_default_template=False)
MARKERS = ("o", "s", "^", "D", "v", "P", "X")  # so that fronts differ in a grey print too


def reward_palette() -> Colormap:
    """Sequential green to blue: the darker, the more reward."""
    return LinearSegmentedColormap.from_list("crest", _CREST.split())


def survival_palette() -> Colormap:
    """Sequential purple to orange: the darker, the more dangerous."""
    return pheromone_palette().reversed()


def pheromone_palette() -> Colormap:
    """Sequential cream to purple: the darker, the more pheromone."""
    return LinearSegmentedColormap.from_list("flare", _FLARE.split())


def reach_palette() -> Colormap:
    """Sequential white to slate: the darker, the more likely a node is reached."""
    return LinearSegmentedColormap.from_list("slate", ["#ffffff", "#c3ccd8", "#7f90a8", "#26364e"])


def colours(n: int) -> list[Colour]:
    """Give ``n`` colours that colour-blind readers can tell apart; after ten they repeat."""
    return [to_rgb(_COLOURBLIND[i % N_COLOURS]) for i in range(n)]


def tint(colour: Colour, strength: float) -> Colour:
    """Mix a colour into white; ``strength`` 0 is white and 1 the colour itself."""
    red, green, blue = (1 - strength * (1 - part) for part in colour)
    return red, green, blue


def readable_on(colour: object) -> str:
    """Give the text colour, light or dark, that is legible on ``colour``."""
    red, green, blue = (part**2.2 for part in to_rgb(colour))  # type: ignore[arg-type]
    # At this luminance either text has the same contrast (WCAG).
    return "white" if 0.2126 * red + 0.7152 * green + 0.0722 * blue < 0.2 else INK


def colour_range(values: FloatArray, *, low: float | None = None) -> Normalize:
    """Span the colours over ``values``, from ``low`` if given; one value alone gets a range too."""
    bottom = float(values.min()) if low is None else low
    top = float(values.max())
    if top <= bottom:
        bottom, top = bottom - 0.05 * (abs(bottom) or 1.0), bottom + 0.05 * (abs(bottom) or 1.0)
    return Normalize(bottom, top)


@contextmanager
def theme() -> Iterator[None]:
    """Draw in the project's style; what matplotlib is set to outside stays as it is.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> from botohe_moo.plots import save_plot, theme
    >>> with theme():
    ...     fig, ax = plt.subplots()
    >>> line = ax.plot([0, 1], [2, 0])
    >>> save_plot(ax, "mine.png")
    """
    with mpl.rc_context({**_THEME, "font.family": list(families())}):
        yield


def new_axes(width: float, height: float) -> Axes:
    """Open a figure of ``width`` x ``height`` inches with one plot in it."""
    with theme():
        _, ax = plt.subplots(figsize=(width, height), layout="constrained")
    return ax


def dress(ax: Axes) -> None:
    """Give axes the grid and the frame of all plots."""
    ax.grid(color="0.92", linewidth=0.8)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def save_figure(
    fig: Figure, path: str | os.PathLike[str], *others: str | os.PathLike[str], dpi: int = DPI
) -> None:
    """Write a figure, whole or not at all, and the same bytes every time.

    The picture is as large as what is drawn. It is laid out once for all files.

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
        if target.suffix.lower() not in _METADATA:
            raise ValueError(
                f"Expected a path that ends in '.png', '.pdf' or '.svg', got {str(target)!r}."
            )
    engine = fig.get_layout_engine()
    with theme():
        if engine is not None:
            engine.execute(fig)
            fig.set_layout_engine("none")  # once is enough
        try:
            _write_all(fig, targets, dpi)
        finally:
            if engine is not None:
                fig.set_layout_engine(engine)


def _write_all(fig: Figure, targets: Sequence[Path], dpi: int) -> None:
    box = fig.get_tightbbox().padded(0.1)
    drawn: dict[Path, bytes] = {}
    for target in targets:
        kind, buffer = target.suffix.lower(), io.BytesIO()
        metadata = dict(_METADATA[kind])
        # Artists have names for tests; in SVG names have to be unique.
        with _without_names(fig) if kind == ".svg" else nullcontext():
            fig.savefig(buffer, format=kind[1:], dpi=dpi, bbox_inches=box, metadata=metadata)
        drawn[target] = buffer.getvalue()
    for target, data in drawn.items():
        replace_file(target, data)


@contextmanager
def _without_names(fig: Figure) -> Iterator[None]:
    # Not findobj, which would create all ticks, even of invisible axes.
    artists = [*fig.get_children(), *(child for ax in fig.axes for child in ax.get_children())]
    named = [(artist, artist.get_gid()) for artist in artists if artist.get_gid()]
    for artist, _ in named:
        artist.set_gid(None)
    try:
        yield
    finally:
        for artist, gid in named:
            artist.set_gid(gid)


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
