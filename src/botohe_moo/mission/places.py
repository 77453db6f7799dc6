"""Where nodes lie: their attribute ``pos``."""

from __future__ import annotations

import math
from collections.abc import Hashable
from typing import Any

import networkx as nx

from botohe_moo._base.checks import quoted

_FARTHEST = 1e100  # the square of a distance is to be a number


def given_places(graph: nx.DiGraph[Any]) -> dict[Hashable, tuple[float, float] | None]:
    """Return the position of each node, or None; a ValueError names one that is not two numbers."""
    places: dict[Hashable, tuple[float, float] | None] = {}
    for node, place in graph.nodes(data="pos"):
        places[node] = None
        if place is None:
            continue
        try:
            x, y = (float(part) for part in place)
        except (TypeError, ValueError, OverflowError):
            x = y = math.nan
        if not (abs(x) <= _FARTHEST and abs(y) <= _FARTHEST):
            hint = "" if not math.isfinite(x + y) else f", beyond {_FARTHEST:g}"
            raise ValueError(
                f"Node {quoted(node)}: expected pos [x, y], two finite numbers, got "
                f"{quoted(place)}{hint}."
            )
        places[node] = x, y
    return places
