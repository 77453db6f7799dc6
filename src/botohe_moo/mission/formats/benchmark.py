"""The team-orienteering benchmark format, and arcs between points in the plane."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any, Literal

import networkx as nx
import numpy as np
from pydantic import Field

from botohe_moo._base.checks import quoted
from botohe_moo._base.types import FloatArray
from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.types import Positive
from botohe_moo.mission.formats.reading import Draft, Format, Row, Source
from botohe_moo.mission.rules import MissionError

_HEADER = {"n": int, "m": int, "tmax": float}


@checked
def read_benchmark(
    source: Source,
    *,
    neighbours: Annotated[int, Field(ge=1)] | Literal["all"] = 8,
    scale: Positive | None = None,
) -> Draft:
    """Read a team-orienteering instance as a nearest-neighbours mission.

    The file has the lines ``n N``, ``m M`` and ``tmax T``, and then N lines ``x y score``;
    separators are spaces, tabs and semicolons. Its points become the nodes 0 to N − 1, point 0 the
    base, M the number of robots, and scores rewards. Arcs lead both ways between each point and the
    ``neighbours`` nearest ones, of equally distant ones the first, and along the edges of a
    Euclidean minimum spanning tree, so that the base reaches all points. With ``"all"`` there is an
    arc from every point to every other, as the benchmark means it: within a travel budget the best
    tours may need any of them. An arc's length is the distance, its survival
    exp(−distance / ``scale``), with tmax as the default scale; tmax is the mission's travel budget.

    A MissionError names the lines that are missing, superfluous or wrong.

    References
    ----------
    Chao, Golden and Wasil, "The team orienteering problem", European Journal of Operational
    Research 88 (1996) 464-474.
    """
    robots, tmax, table = _parse(source.text)
    if scale is None and tmax <= 0:
        raise MissionError(f"expected tmax > 0 to be the scale, got {tmax:g}; give a scale")
    graph = benchmark_graph(
        robots, tmax, table, neighbours=neighbours, scale=tmax if scale is None else scale
    )
    nodes = [Row(f"node {node}", (node,), {**of}) for node, of in graph.nodes(data=True)]
    arcs = [Row(f"arc {u} -> {v}", (u, v), {**of}) for u, v, of in graph.edges(data=True)]
    return Draft(nodes, arcs, graph.graph)


def benchmark_graph(
    robots: int,
    tmax: float,
    table: FloatArray,
    *,
    neighbours: int | Literal["all"],
    scale: float,
) -> nx.DiGraph[Any]:
    """Make a graph of points with their scores (n, 3); see :func:`read_benchmark`."""
    points = table[:, :2]
    title = f"Team orienteering benchmark: {len(points)} points, tmax {tmax:g}"
    graph: nx.DiGraph[Any] = nx.DiGraph(base=0, robots=robots, title=title, max_length=tmax)
    for node, (x, y, score) in enumerate(table.tolist()):
        graph.add_node(node, reward=score, pos=[x, y])
    degree = len(points) - 1 if neighbours == "all" else min(neighbours, len(points) - 1)
    for tail, head in sorted({*nearest_pairs(points, degree), *spanning_pairs(points)}):
        distance = math.dist(points[tail], points[head])
        survival = math.exp(-distance / scale)
        graph.add_edge(tail, head, survival=survival, length=distance)
        graph.add_edge(head, tail, survival=survival, length=distance)
    return graph


def _parse(text: str) -> tuple[int, float, FloatArray]:
    """Return the number of robots, tmax, and the points with their scores (n, 3)."""
    lines = enumerate(text.replace(";", " ").splitlines(), 1)
    rows = [(number, line.split()) for number, line in lines if line.strip()]
    header: dict[str, Any] = {}
    points, faults = [], []
    for (name, kind), (number, fields) in zip(_HEADER.items(), rows, strict=False):
        try:
            key, value = fields
            header[name] = kind(value)
        except ValueError:
            key = ""
        if key.lower() != name:
            found = quoted(" ".join(fields))
            faults.append(f"line {number}: expected {name!r} and a number, got {found}")
    for number, fields in rows[len(_HEADER) :]:
        try:
            x, y, score = map(float, fields)
            points.append((x, y, score))
        except ValueError:
            found = quoted(" ".join(fields))
            faults.append(f"line {number}: expected three numbers, x, y and a score, got {found}")
    if len(rows) < len(_HEADER):
        faults.append(f"expected lines of {', '.join(_HEADER)}, got {len(rows)} lines")
    elif not faults and header["n"] != len(points):
        expected = f"expected n {len(points)}, the number of lines after tmax"
        faults.append(f"line {rows[0][0]}: {expected}, got n {header['n']}")
    if faults:
        raise MissionError(faults)
    return header["m"], header["tmax"], np.array(points).reshape(-1, 3)


def spanning_pairs(points: FloatArray) -> list[tuple[int, int]]:
    """Return the edges of a Euclidean minimum spanning tree of points (n, 2), by Prim's method.

    Points may coincide, and the tree is the same on every platform. Edges are pairs of indices, the
    lower one first. Takes time in the square of the number of points, and memory in proportion.
    """
    outside = np.arange(1, len(points))
    squares = np.full(len(points) - 1, np.inf)
    link = np.zeros(len(points) - 1, np.int64)
    newest, pairs = 0, []
    while len(outside):
        new_squares = _squares(points[outside], points[newest])
        closer = new_squares < squares
        squares[closer] = new_squares[closer]
        link[closer] = newest
        nearest = int(squares.argmin())
        newest, known = int(outside[nearest]), int(link[nearest])
        pairs.append((min(newest, known), max(newest, known)))
        outside, squares, link = (np.delete(a, nearest) for a in (outside, squares, link))
    return pairs


def near_pairs(points: FloatArray, radius: float) -> list[tuple[int, int]]:
    """Return all pairs of points (n, 2) at most ``radius`` apart, the lower index first, sorted."""
    from scipy.spatial import KDTree

    return sorted(KDTree(points).query_pairs(radius))


def nearest_pairs(points: FloatArray, degree: int) -> Iterator[tuple[int, int]]:
    """Give the pairs of each point (n, 2) with its ``degree`` nearest, the lower index first."""
    for i in range(len(points) if degree else 0):
        squares = _squares(points, points[i])
        squares[i] = np.inf
        near = np.flatnonzero(squares <= np.partition(squares, degree - 1)[degree - 1])
        for j in near[squares[near].argsort(kind="stable")][:degree].tolist():
            yield min(i, j), max(i, j)


def _squares(points: FloatArray, origin: FloatArray) -> FloatArray:
    """Squared distances: unlike their roots, the same bits on every platform."""
    x, y = (points - origin).T
    squares: FloatArray = x * x + y * y
    return squares


ORIENTEERING = Format((".txt",), lambda source: bool(source.text), read_benchmark)
