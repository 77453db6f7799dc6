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
from botohe_moo.mission.formats.nodelink import decode
from botohe_moo.mission.memory import check_memory
from botohe_moo.mission.validation import MissionError

_HEADER = ("n", "m", "tmax")


@checked
def read_benchmark(
    data: bytes,
    /,
    *,
    neighbours: Annotated[int, Field(ge=1)] | Literal["all"] = 8,
    scale: Positive | None = None,
) -> tuple[nx.DiGraph[Any], list[str]]:
    """Read a team-orienteering instance as a nearest-neighbours mission.

    The file has the lines ``n N``, ``m M`` and ``tmax T``, and then N lines ``x y score``;
    separators are spaces, tabs and semicolons. Its points become the nodes 0 to N − 1, point 0 the
    base, M the number of robots, and scores rewards. Arcs lead both ways between each point and the
    ``neighbours`` nearest ones, of equally distant ones the first, and along the edges of a
    Euclidean minimum spanning tree, so that the base reaches all points. With ``"all"`` there is an
    arc from every point to every other, as the benchmark means it: within a travel budget the best
    tours may need any of them. An arc's length is the distance, its survival
    exp(−distance / ``scale``), with tmax as the default scale; tmax is the mission's travel budget.

    Gives the graph and an empty list of faults. A MissionError is raised if a line is missing,
    superfluous or wrong, or an arc's survival is 0 in floating-point numbers.

    References
    ----------
    Chao, Golden and Wasil, "The team orienteering problem", European Journal of Operational
    Research 88 (1996) 464-474.
    """
    robots, tmax, points, scores = _parse(decode(data))
    if scale is None and tmax <= 0:
        raise MissionError(f"expected tmax > 0 to be the scale, got {tmax:g}; give a scale")
    if tmax < 0:
        raise MissionError(f"expected tmax >= 0, the travel budget, got {tmax:g}")
    check_memory("points", len(points), nodes=len(points), arcs=0, remedy="their number")
    degree = len(points) - 1 if neighbours == "all" else min(neighbours, len(points) - 1)
    arcs = 2 * len(points) * (degree + 1)
    given = degree if neighbours == "all" else neighbours
    check_memory("neighbours", given, nodes=len(points), arcs=arcs)
    title = f"Team orienteering benchmark: {len(points)} points, tmax {tmax:g}"
    graph: nx.DiGraph[Any] = nx.DiGraph(base=0, robots=robots, title=title, max_length=tmax)
    for node, (point, score) in enumerate(zip(points.tolist(), scores, strict=True)):
        graph.add_node(node, reward=score, pos=point)
    _add_arcs(graph, points, degree, tmax if scale is None else scale)
    return graph, []


def _add_arcs(graph: nx.DiGraph[Any], points: FloatArray, degree: int, scale: float) -> None:
    faults = []
    for tail, head in sorted({*_nearest_pairs(points, degree), *spanning_pairs(points)}):
        distance = math.dist(points[tail], points[head])
        survival = math.exp(-distance / scale)
        if survival == 0:
            faults.append(
                f"arc {tail} -> {head}: expected survival in (0, 1], got exp(-{distance:g} / "
                f"{scale:g}), which is 0 in floating-point numbers; give a larger scale"
            )
        graph.add_edge(tail, head, survival=survival, length=distance)
        graph.add_edge(head, tail, survival=survival, length=distance)
    if faults:
        raise MissionError(faults)


def _parse(text: str) -> tuple[int, float, FloatArray, list[float]]:
    """Return the number of robots, tmax, the points (n, 2) and their scores."""
    lines = enumerate(text.replace(";", " ").splitlines(), 1)
    rows = [(i, line.split()) for i, line in lines if line.strip()]
    if len(rows) < len(_HEADER):
        raise MissionError(f"expected the lines n, m and tmax first, found {len(rows)} lines")
    faults: list[str] = []
    header = [_header(*row, key, faults) for key, row in zip(_HEADER, rows, strict=False)]
    points = [_numbers(*row, faults) for row in rows[len(_HEADER) :]]
    n_points, robots, tmax = header
    if n_points is not None and n_points < 1:
        faults.append(f"line {rows[0][0]}: expected n >= 1, got {n_points:g}")
    elif n_points is not None and len(points) != n_points:
        faults.append(f"expected {n_points:g} lines 'x y score' after tmax, got {len(points)}")
    if faults or robots is None or tmax is None:
        raise MissionError(faults)
    table = np.array(points)
    return int(robots), tmax, table[:, :2], table[:, 2].tolist()


def _header(number: int, fields: list[str], key: str, faults: list[str]) -> float | None:
    kind = float if key == "tmax" else int
    try:
        name, value = fields
        if name.lower() == key and math.isfinite(kind(value)):
            return kind(value)
    except (ValueError, OverflowError):
        pass
    word = "a finite number" if key == "tmax" else "an integer"
    faults.append(f"line {number}: expected '{key}' and {word}, got {quoted(' '.join(fields))}")
    return None


def _numbers(number: int, fields: list[str], faults: list[str]) -> tuple[float, float, float]:
    try:
        x, y, score = map(float, fields)
        if all(map(math.isfinite, (x, y, score))) and score >= 0:
            return x, y, score
    except ValueError:
        pass
    faults.append(
        f"line {number}: expected three finite numbers, x, y and a score >= 0, "
        f"got {quoted(' '.join(fields))}"
    )
    return 0, 0, 0


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
    pairs = []
    for i in range(len(points) - 1):
        near = np.flatnonzero(_squares(points[i + 1 :], points[i]) <= radius**2) + i + 1
        pairs += [(i, j) for j in near.tolist()]
    return pairs


def _nearest_pairs(points: FloatArray, degree: int) -> Iterator[tuple[int, int]]:
    for i in range(len(points) if degree else 0):
        squares = _squares(points, points[i])
        squares[i] = np.inf
        near = np.flatnonzero(squares <= np.partition(squares, degree - 1)[degree - 1])
        near = near[near != i]  # for coordinates so large that all squares are infinite
        for j in near[squares[near].argsort(kind="stable")][:degree].tolist():
            yield min(i, j), max(i, j)


def _squares(points: FloatArray, origin: FloatArray) -> FloatArray:
    """Squared distances: unlike their roots, the same bits on every platform."""
    with np.errstate(over="ignore"):
        x, y = (points - origin).T
        squares: FloatArray = x * x + y * y
    return squares
