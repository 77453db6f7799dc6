"""The team-orienteering benchmark format, and arcs between points in the plane."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import chain, repeat
from typing import Any, Literal

import networkx as nx
import numpy as np

from botohe_moo._base.checks import quoted
from botohe_moo._base.types import FloatArray
from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.types import Count, Positive
from botohe_moo.mission.arrays import plain_numbers
from botohe_moo.mission.formats.reading import Draft, Format, Row, Source
from botohe_moo.mission.hazards import survived
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
    graph = benchmark_graph(robots, tmax, table, neighbours=neighbours, scale=scale or tmax)
    if (table[:1, :2] != table[-1:, :2]).any():
        graph.graph["kinds"] = [{"name": ONLY_KIND, "robots": robots, "end": len(table) - 1}]
    nodes = [Row(f"node {node}", (node,), of) for node, of in graph.nodes(data=True)]
    arcs = [Row(f"arc {u} -> {v}", (u, v), of) for u, v, of in graph.edges(data=True)]
    return Draft(nodes, arcs, graph.graph)


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


def benchmark_graph(
    robots: Any, tmax: float, table: FloatArray, *, neighbours: int | Literal["all"], scale: float
) -> nx.DiGraph[Any]:
    """Make a graph of points with their scores (n, 3), the first the base; see `read_benchmark`."""
    points = table[:, :2]
    title = f"Team orienteering benchmark: {len(points)} points, tmax {tmax:g}"
    graph: nx.DiGraph[Any] = nx.DiGraph(base=0, robots=robots, title=title, max_length=tmax)
    for node, (x, y, score) in enumerate(table.tolist()):
        graph.add_node(node, reward=score, pos=[x, y])
    degree = len(points) - 1 if neighbours == "all" else min(neighbours, len(points) - 1)
    for u, v in sorted({*nearest_pairs(points, degree), *spanning_pairs(points)}):
        length = math.dist(points[u], points[v])
        survival = survived(length / scale, f"Points {u} and {v}", length=length)
        graph.add_edges_from([(u, v), (v, u)], survival=survival, length=length)
    return graph


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


def near_pairs(points: FloatArray, radius: float) -> list[tuple[int, int]]:
    """Return all pairs of points (n, 2) at most ``radius`` apart, the lower index first, sorted."""
    from scipy.spatial import KDTree

    return sorted(KDTree(points).query_pairs(radius))


def nearest_pairs(points: FloatArray, degree: int) -> Iterator[tuple[int, int]]:
    """Give the pairs of each point (n, 2) with its ``degree`` nearest, the lower index first."""
    for i in range(len(points) if degree else 0):
        squares = np.add(*np.square(points - points[i]).T)
        squares[i] = np.inf
        near = np.flatnonzero(squares <= np.partition(squares, degree - 1)[degree - 1])
        for j in near[squares[near].argsort(kind="stable")][:degree].tolist():
            yield min(i, j), max(i, j)


ORIENTEERING = Format((".txt",), lambda source: "tmax" in source.text.lower(), read_benchmark)
