"""How algorithms look: the same colour, marker and line in every figure of a report."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import zip_longest
from typing import TYPE_CHECKING

from botohe_moo._checks import nearest_first
from botohe_moo.plots.style import MARKERS, Colour, colours

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    import pandas as pd

__all__ = ["AlgorithmStyle", "algorithm_styles", "chosen_algorithms", "shortened", "styles_of"]

Line = tuple[int, tuple[float, ...] | None]

# Colours repeat after ten, then the line changes; the marker has a period of its own.
_LINES: tuple[Line, ...] = ((0, None), (0, (5, 1.6)), (0, (1.2, 1.2)), (0, (6, 1.5, 1.2, 1.5)))
_LONGEST = 30
_HEAD = 8  # letters that stay of a label whose beginning others share


@dataclass(frozen=True)
class AlgorithmStyle:
    """Colour, marker and line of one algorithm.

    Attributes
    ----------
    colour
        Red, green and blue in [0, 1].
    marker
        Marker, as matplotlib calls it.
    line
        Line style, as matplotlib takes it: offset and lengths of dashes and gaps.
    """

    colour: Colour
    marker: str
    line: Line


def algorithm_styles(labels: Iterable[str]) -> dict[str, AlgorithmStyle]:
    """Give every algorithm a look of its own, by its place among all of them.

    Parameters
    ----------
    labels
        Labels of all algorithms of the study, in the order of its file. Ten have colours of their
        own, forty a colour and a line of their own.

    Returns
    -------
    dict
        The style of each label, for the plots' option ``styles``.
    """
    labels = list(dict.fromkeys(labels))
    return {
        label: AlgorithmStyle(colour, MARKERS[i % len(MARKERS)], _LINES[i // 10 % len(_LINES)])
        for i, (label, colour) in enumerate(zip(labels, colours(len(labels)), strict=True))
    }


def styles_of(
    algorithms: Sequence[str], styles: Mapping[str, AlgorithmStyle] | None
) -> Mapping[str, AlgorithmStyle]:
    """Give the styles to draw ``algorithms`` in: those given, or new ones.

    Raises
    ------
    ValueError
        If an algorithm has no style among those given.
    """
    if styles is None:
        return algorithm_styles(algorithms)
    if absent := [label for label in algorithms if label not in styles]:
        raise ValueError(f"Expected a style for every algorithm, missing: {', '.join(absent)}.")
    return styles


def chosen_algorithms(
    name: str, frame: pd.DataFrame, columns: Sequence[str], algorithms: Sequence[str] | None
) -> list[str]:
    """Check a table of one mission, and give the algorithms to draw: all by default.

    Raises
    ------
    ValueError
        If the table lacks a column or holds several missions, or an algorithm is not in it.
    """
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


def shortened(labels: Iterable[str]) -> dict[str, str]:
    """Give labels that leave room for the plot, and differ where the whole ones do.

    The middle of a long one is left out; where that would make two alike, what is left out is
    what they have in common.
    """
    short = {label: _cut(label, (_LONGEST - 1) // 2) for label in labels}
    texts = list(short.values())
    for text in dict.fromkeys(text for text in texts if texts.count(text) > 1):
        alike = [label for label in short if short[label] == text]
        n_common = next(i for i, letters in enumerate(zip_longest(*alike)) if len(set(letters)) > 1)
        for number, label in enumerate(alike, 1):
            told = f"{label[:_HEAD]}…{label[max(n_common - 4, _HEAD) :][: _LONGEST - _HEAD - 1]}"
            short[label] = told if told not in short.values() else f"{text} #{number}"
    return short


def _cut(label: str, half: int) -> str:
    return label if len(label) <= _LONGEST else f"{label[:half]}…{label[-half:]}"
