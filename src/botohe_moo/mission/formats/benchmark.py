"""The team-orienteering benchmark format, and arcs between points in the plane."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import chain, repeat
from typing import Literal

import numpy as np

from botohe_moo.base.messages import quoted
from botohe_moo.base.parameters import Count, Positive, checked
from botohe_moo.base.types import FloatArray
from botohe_moo.mission.formats.reading import Draft, Format, Row, Source
from botohe_moo.mission.hazards import plain_numbers, survived
from botohe_moo.mission.rules import ONLY_KIND, MissionError


@checked
def read_benchmark(
    source: Source, *, neighbours: Count | Literal["all"] = 8, scale: Positive | None = None
) -> Draft:
    """Read a team-orienteering instance as a nearest-neighbours mission.

    The file has the lines ``n N``, ``m M`` and ``tmax T``, and then N lines ``x y score``.
    Separators are spaces, tabs and semicolons; ``#`` begins a comment. Points become the nodes 0 to
    N − 1, scores rewards, and tmax the travel budget of each of M robots. Their trails lead from
    the first point, the base, to the last one, or back to the base if both are at the same place.

    Arcs lead both ways between each point and the ``neighbours`` nearest ones, of equally distant
    ones the first, and along the edges of a Euclidean minimum spanning tree, so that the base
    reaches all points. With ``"all"`` there is an arc from every point to every other, as the
    benchmark means it: within a travel budget the best tours may need any of them. An arc's length
    is the distance, its survival exp(−distance / ``scale``), with tmax as the default scale.

    A MissionError names the lines that are missing, superfluous or wrong.

    References
    ----------
    Chao, Golden and Wasil, "The team orienteering problem", European Journal of Operational
    Research 88 (1996) 464-474.
    """
    robots, tmax, table = _parse(source.text)
    if scale is None and tmax <= 0:
        raise MissionError(f"expected tmax > 0 to be the scale, got {tmax:g}; give a scale")
    points, n = table[:, :2], len(table)
    title = f"Team orienteering benchmark: {n} points, tmax {tmax:g}"
    graph = {"base": 0, "robots": robots, "title": title, "max_length": tmax}
    if (points[:1] != points[-1:]).any():
        graph["kinds"] = [{"name": ONLY_KIND, "robots": robots, "end": n - 1}]
    nodes = [
        Row(f"node {node}", (node,), {"reward": score, "pos": [x, y]})
        for node, (x, y, score) in enumerate(table.tolist())
    ]
    arcs, degree = [], n - 1 if neighbours == "all" else min(neighbours, n - 1)
    pairs = sorted({*nearest_pairs(points, degree), *spanning_pairs(points)})
    for u, v in [ends for pair in pairs for ends in (pair, pair[::-1])]:
        length = math.dist(points[u], points[v])
        survival = survived(length / (scale or tmax), f"Points {u} and {v}", length=length)
        arcs.append(Row(f"arc {u} -> {v}", (u, v), {"survival": survival, "length": length}))
    return Draft(nodes, arcs, graph)


def _parse(text: str) -> tuple[str, float, FloatArray]:
    """Return the number of robots, tmax, and the points with their scores (n, 3)."""
    lines = (line.partition("#")[0].replace(";", " ").split() for line in text.splitlines())
    rows = [(f"line {i}", fields) for i, fields in enumerate(lines, 1) if fields]
    rows += [("the end", [""])] * (3 - len(rows))
    faults = []
    for (where, fields), name in zip(rows, chain(("n", "m", "tmax"), repeat("")), strict=False):
        numbers = plain_numbers(fields[1:] if name else fields)
        if len(numbers) != (1 if name else 3) or name not in ("", fields[0].lower()):
            expected = f"{name!r} and a number" if name else "three numbers, x, y and a score"
            faults.append(f"{where}: expected {expected}, got {quoted(' '.join(fields))}")
    (where, n), (_, robots), (_, tmax), *points = rows
    if not faults and float(n[1]) != len(points):
        faults = [f"{where}: expected n {len(points)}, the number of lines after tmax, got {n[1]}"]
    if faults:
        raise MissionError(faults)
    return robots[1], float(tmax[1]), np.array([of for _, of in points], float).reshape(-1, 3)


def spanning_pairs(points: FloatArray) -> list[tuple[int, int]]:
    """Return the edges of a Euclidean minimum spanning tree of points (n, 2), by Prim's method.

    Points may coincide, and the tree is the same on every platform: squares of distances have the
    same bits everywhere, unlike their roots. Edges are pairs of indices, the lower one first. Takes
    time in the square of the number of points, and memory in proportion.
    """
    squares, link = np.full(len(points), np.inf), np.zeros(len(points), np.int64)
    newest, pairs = 0, []
    for _ in points[1:]:
        squares[newest] = np.nan  # it is in the tree: nothing is closer
        new_squares = np.add(*np.square(points - points[newest]).T)
        closer = new_squares < squares
        squares[closer], link[closer] = new_squares[closer], newest
        newest = int(np.nanargmin(squares))
        pairs.append((min(newest, int(link[newest])), max(newest, int(link[newest]))))
    return pairs


def nearest_pairs(points: FloatArray, degree: int) -> Iterator[tuple[int, int]]:
    """Give the pairs of each point (n, 2) with its ``degree`` nearest, the lower index first."""
    for i, point in enumerate(points):
        squares = np.add(*np.square(points - point).T)
        squares[i] = np.inf
        near = np.flatnonzero(squares <= np.partition(squares, degree - 1)[degree - 1])
        for j in near[squares[near].argsort(kind="stable")][:degree].tolist():
            yield min(i, j), max(i, j)


ORIENTEERING = Format((".txt",), lambda source: "tmax" in source.text.lower(), read_benchmark)
