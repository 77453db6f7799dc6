"""How algorithms look: the same colour, marker and line in every figure of a report."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from botohe_moo._base.checks import check_frame, nearest_first
from botohe_moo.plots.draw.labels import UNBROKEN, WIDTH, display_names, drawable, wrapped
from botohe_moo.plots.draw.style import MARKERS, Colour, colours

if TYPE_CHECKING:
    import pandas as pd

Line = tuple[int, tuple[float, ...] | None]

# Colours repeat after ten, then the line changes; the marker has a period of its own.
_LINES: tuple[Line, ...] = ((0, None), (0, (5, 1.6)), (0, (1.2, 1.2)), (0, (6, 1.5, 1.2, 1.5)))


@dataclass(frozen=True)
class AlgorithmStyle:
    """Colour, marker and line of one algorithm.

    Attributes
    ----------
    colour, marker, line
        Red, green and blue in [0, 1]; marker and line style as matplotlib takes them.
    name
        What it is called in pictures; its label, if empty.

    Examples
    --------
    >>> from botohe_moo.plots import AlgorithmStyle, algorithm_styles
    >>> ants = AlgorithmStyle(colour=(0.8, 0.2, 0.1), marker="o", line="solid", name="the ants")
    >>> styles = algorithm_styles(["greedy"]) | {"ants": ants}  # plots take them as styles
    >>> list(styles)
    ['greedy', 'ants']
    """

    colour: Colour
    marker: str
    line: Line
    name: str = ""


def stroke(style: AlgorithmStyle, width: float) -> dict[str, Any]:
    """Give matplotlib's options of an algorithm's line."""
    return {"color": style.colour, "linestyle": style.line, "linewidth": width}


def marks(style: AlgorithmStyle, size: float, *, rim: float) -> dict[str, Any]:
    """Give matplotlib's options of an algorithm's markers, with a white rim."""
    edge = {"markeredgecolor": "white", "markeredgewidth": rim}
    return {"marker": style.marker, "markersize": size, **edge}


def algorithm_styles(labels: Iterable[str]) -> dict[str, AlgorithmStyle]:
    """Give every algorithm a look of its own, by its place among all of them, and a name.

    Names are labels without what the members of a grid have in common. The styles, by label, are
    for the plots' option ``styles``.

    Parameters
    ----------
    labels
        Labels of all algorithms of the study, in the order of its file. Ten have colours of their
        own, forty a colour and a line of their own.

    Examples
    --------
    >>> from botohe_moo.plots import algorithm_styles
    >>> styles = algorithm_styles(["ants", "greedy"])
    >>> styles["ants"].colour != styles["greedy"].colour
    True
    """
    names = display_names(labels)
    return {
        label: AlgorithmStyle(
            colour, MARKERS[i % len(MARKERS)], _LINES[i // 10 % len(_LINES)], name
        )
        for i, ((label, name), colour) in enumerate(
            zip(names.items(), colours(len(names)), strict=True)
        )
    }


def styles_of(
    algorithms: Sequence[str], styles: Mapping[str, AlgorithmStyle] | None
) -> Mapping[str, AlgorithmStyle]:
    """Give the styles to draw ``algorithms`` in: those given, or new ones."""
    if styles is None:
        return algorithm_styles(algorithms)
    if absent := [label for label in algorithms if label not in styles]:
        raise ValueError(f"Expected a style for every algorithm, missing: {', '.join(absent)}.")
    return styles


def chosen_algorithms(
    name: str, frame: pd.DataFrame, columns: Sequence[str], algorithms: Sequence[str] | None
) -> list[str]:
    """Check a table of one mission, and give the algorithms to draw: all by default."""
    check_frame(name, frame)
    if missing := [column for column in columns if column not in frame.columns]:
        raise ValueError(f"Expected {name} with columns {tuple(columns)}, it lacks {missing}.")
    missions = list(frame["mission"].unique()) if "mission" in frame.columns else []
    if len(missions) > 1:
        found = ", ".join(map(repr, missions))
        raise ValueError(f"Expected {name} of one mission, got {found}.")
    known = list(frame["algorithm"].unique())
    if algorithms is None:
        return known
    for label in algorithms:
        if label not in known:
            among = ", ".join(nearest_first(str(label), known))
            raise ValueError(f"Expected an algorithm of {name}, got {label!r}; known are {among}.")
    return list(dict.fromkeys(algorithms))


def names_of(
    algorithms: Iterable[str],
    styles: Mapping[str, AlgorithmStyle],
    width: int = WIDTH,
    *,
    longest: int = UNBROKEN,
) -> dict[str, str]:
    """Give the names of ``algorithms`` in pictures, on lines as ``wrapped`` makes them."""
    return {
        label: wrapped(styles[label].name or drawable(label), width, longest=longest)
        for label in algorithms
    }
