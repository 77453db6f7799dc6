"""Maps as the map server of Nav2 reads them, and the ways through their free space."""

from __future__ import annotations

import math
import os
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import networkx as nx
import numpy as np
from PIL import Image, UnidentifiedImageError
from pydantic import AfterValidator, BaseModel, Field

from botohe_moo._base.checks import ParameterError, as_float, quoted
from botohe_moo._base.document import Document
from botohe_moo._base.files import read_bytes
from botohe_moo._base.types import BoolArray, FloatArray
from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.types import NotNegative, Positive
from botohe_moo.mission.formats.reading import file_content, validated
from botohe_moo.mission.hazards import in_cells, mean_along
from botohe_moo.mission.rules import MissionError

MODES = ("trinary", "scale")

_Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]


def _without_rotation(origin: list[float]) -> list[float]:
    if any(origin[2:]):
        raise ValueError("expected [x, y, 0], without rotation")
    return origin


class _MapFile(BaseModel):
    image: Annotated[str, Field(min_length=1)]
    resolution: Annotated[_Finite, Field(gt=0)]
    origin: Annotated[
        list[_Finite], Field(min_length=2, max_length=3), AfterValidator(_without_rotation)
    ]
    negate: Literal[0, 1] = 0
    mode: Literal["trinary", "scale"] = "trinary"
    free_thresh: Annotated[float, Field(strict=True, gt=0, lt=1)] = 0.25  # as Nav2 saves maps


class Raster(NamedTuple):
    """A map of shares, as `survival_from_raster` takes it."""

    values: FloatArray  # in [0, 1], the first row at the top (n_rows, n_columns)
    resolution: float  # width of a cell
    origin: tuple[float, float]  # the lower left corner
    free_thresh: float  # in a map of obstacles, cells with less are free


def read_raster(path: str | os.PathLike[str], *, modes: Sequence[str] = ("scale",)) -> Raster:
    """Read a map as shares of full scale, which is black, or with ``negate`` white.

    Its ``mode`` has to be one of ``modes``; without one it is ``trinary``, as for the map server. A
    MissionError names the file, and the line of what is wrong. In mode ``raw``, which is never one
    of them, pixels are not shares.
    """
    path = Path(path)
    try:
        document = Document(file_content(path).decode("utf-8-sig"))
        if not isinstance(document.content, dict):
            raise MissionError(f"expected a map, with an image, got {quoted(document.content)}")
        found = validated(document, _MapFile)
        if found.mode not in modes:
            got = quoted(document.content["mode"]) if "mode" in document.content else "none"
            expected = f"expected mode to be {' or '.join(modes)}, found {got}"
            raise MissionError(f"line {document.line(['mode'])}: {expected}")
        try:
            shares = _read_image(path.parent / found.image)
        except ValueError as error:
            raise MissionError(f"image {quoted(found.image)}: {error}") from None
    except MissionError as error:
        raise MissionError(list(error.faults), str(path)) from None
    except ValueError as error:  # DocumentError, and text that is not UTF-8
        raise MissionError(str(error).rstrip("."), str(path)) from None
    x, y, *_ = found.origin
    values = shares if found.negate else 1.0 - shares
    return Raster(values, found.resolution, (x, y), found.free_thresh)


def _read_image(path: Path) -> FloatArray:
    """Read an image as shares of white (n_rows, n_columns); a ValueError says why it cannot be."""
    try:
        with Image.open(BytesIO(read_bytes(path))) as image:
            if image.mode == "F":
                raise ValueError("expected integers as pixels, found floats")
            # Of 16 bits or more; others have at most 8 for each colour, of which the mean counts.
            most = 65_535.0 if image.mode.startswith("I") else 255.0
            pixels = np.asarray(image if most > 255.0 else image.convert("RGB"), float)
    except FileNotFoundError:
        raise ValueError("there is no such file") from None
    except UnidentifiedImageError:
        raise ValueError("expected an image, such as PNG or PGM") from None
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror or error}") from None
    except (SyntaxError, Image.DecompressionBombError) as error:
        raise ValueError(f"cannot be read: {error}") from None
    grey = pixels if pixels.ndim == 2 else pixels.mean(axis=2)
    shares: FloatArray = np.clip(grey / most, 0.0, 1.0)
    return shares


# The grey that map savers write for unknown cells, which is free by their own free_thresh of 0.25.
_UNKNOWN = 1.0 - 205.0 / 255.0


@checked
def roadmap_from_map(
    path: str | os.PathLike[str],
    *,
    radius: Positive = 0.3,
    spacing: Positive | None = None,
    base: int | tuple[float, float] = (0.0, 0.0),
    danger: NotNegative | None = None,
    hazard: str | os.PathLike[str] | None = None,
) -> Any:
    """Make a graph of the ways on which a robot gets through a map of obstacles.

    Ways are the skeleton of all places where a robot is clear of obstacles, in the largest
    connected part: they keep to the middle of rooms and corridors. Nodes are where ways meet
    or end. Of nodes nearer to each other than ``radius``, or than two cells, one stays, so that
    shorter dead ends disappear. A way back to where it began, or beside another one, gets nodes in
    between. Needs ``pip install "botohe-moo[maps]"``.

    Parameters
    ----------
    path
        YAML that names an image, as the map server of Nav2 reads it. Cells below its
        ``free_thresh`` are free. Unknown cells are not, nor is what lies outside.
    radius
        Of a robot, above 0, in metres, as are all lengths. With half a cell or less, ways pass
        between obstacles that touch at a corner.
    spacing
        Along a way nodes are at most so far apart, above 0. Default: only where ways meet and end.
    base
        The base: a node, or a place (x, y), to which it is the nearest node.
    danger
        Rate of loss for a metre, at least 0: arcs get the ``survival`` exp(−danger · length).
        Default: none, arcs get no survival.
    hazard
        Map of where it is dangerous, in the same frame, YAML with ``mode: scale``: where it is
        black the rate of loss is ``danger``, where it is white 0, as for
        :func:`survival_from_raster` along the points of a way.

    Returns
    -------
    networkx.DiGraph
        Nodes 0, 1, ... from the top of the map to the bottom, with ``pos`` [x, y] in the frame of
        the map, and ``reward`` 1, at the base 0. Arcs lead both ways, with the ``length`` of the
        way. The graph has the attribute ``base``.

    Raises
    ------
    MissionError
        If a map cannot be read, no way is left on it, packages are missing, or the map of dangers
        does not cover all ways.
    ValueError
        If a parameter is out of its range, or the base is not a node.

    References
    ----------
    Zhang and Suen, "A fast parallel algorithm for thinning digital patterns", Communications of the
    ACM 27 (1984) 236-239; Nunez-Iglesias et al., "A new Python library to analyse skeleton images
    confirms malaria parasite remodelling of the red blood cell membrane skeleton", PeerJ 6 (2018)
    e4312.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from PIL import Image
    >>> from botohe_moo import Mission, roadmap_from_map
    >>> cells = np.zeros((9, 60), np.uint8)
    >>> cells[2:7, 2:58] = 255  # a corridor, 5.6 m long and half a metre wide
    >>> Image.fromarray(cells).save("corridor.png")
    >>> text = "{image: corridor.png, resolution: 0.1, origin: [0, 0, 0]}"
    >>> _ = Path("corridor.yaml").write_text(text)
    >>> graph = roadmap_from_map("corridor.yaml", radius=0.2, spacing=2, danger=0.01)
    >>> Mission(graph, robots=2)
    <Mission 'mission': 4 nodes, 6 arcs, 2 robots at base 0, total reward 3>
    """
    if hazard is not None and danger is None:
        fault = "Expected danger, the rate of loss where the map is black, found none."
        raise ParameterError(fault, "danger")
    loss_along = None if danger is None else _loss_along(danger, hazard)
    raster = read_raster(path, modes=MODES)
    if spacing is not None and spacing < raster.resolution:
        fault = f"Expected spacing >= {raster.resolution:g}, the width of a cell, got {spacing:g}."
        raise ParameterError(fault, "spacing")
    ways = _skeleton(raster, radius, os.fspath(path))
    ways = _joined(_merged(ways, max(radius, 2.0 * raster.resolution)))
    if not ways:
        fault = (
            f"expected ways through free space for a robot of radius {radius:g}, found none: it "
            "does not fit, or all is one round or square hall, which has a middle, but no ways"
        )
        raise MissionError(fault, os.fspath(path))
    graph = _roadmap(ways, spacing, loss_along)
    if isinstance(base, tuple) and len(base) == 2 and np.isfinite([*map(as_float, base)]).all():
        away = np.array([place for _, place in graph.nodes(data="pos")]) - base
        base = int(np.hypot(*away.T).argmin())
    if base not in graph:
        expected = f"a node, 0 to {len(graph) - 1}, or a place (x, y)"
        raise ParameterError(f"Expected base to be {expected}, got {quoted(base)}.", "base")
    graph.graph["base"] = base
    graph.nodes[base]["reward"] = 0.0
    return graph


# From a node to a node, and the points (n, 2) in between, with those of both.
_Way = tuple[int, int, FloatArray]


def _skeleton(raster: Raster, radius: float, source: str) -> list[_Way]:
    """Return the ways of the skeleton of where a robot is clear of obstacles."""
    try:
        from skan import Skeleton
        from skimage.morphology import skeletonize
    except ImportError:
        needed = "the packages scikit-image and skan: pip install 'botohe-moo[maps]'"
        raise MissionError(f"a roadmap needs {needed}", source) from None
    thin: Any = skeletonize  # untyped
    clear = _clear(raster, radius)
    skeleton = thin(clear)
    if skeleton.sum() < 2:
        return []
    branches = Skeleton(skeleton, keep_images=False)
    # Where the cell in the corner is: the first row is at the top, and there is a margin of a cell.
    corner = np.array([-0.5, len(clear) - 1.5]) * raster.resolution + raster.origin
    ways: list[_Way] = []
    for i in range(branches.n_paths):
        rows, columns = branches.path_coordinates(i).T
        tail, *_, head = branches.path(i).tolist()
        points = corner + np.column_stack([columns, -rows]) * raster.resolution
        ways.append((tail, head, points))
    return ways


def _clear(raster: Raster, radius: float) -> BoolArray:
    """Return the largest part where a robot is clear of obstacles, with a margin of one cell."""
    from scipy.ndimage import distance_transform_edt, label

    is_free = (raster.values < raster.free_thresh) & ~np.isclose(raster.values, _UNKNOWN)
    # From the centre of a cell to the edge of the nearest one that is not free.
    clearance = (distance_transform_edt(np.pad(is_free, 1)) - 0.5) * raster.resolution
    parts, n_parts = label(clearance >= radius * (1.0 - 1e-9), np.ones((3, 3)))
    sizes = np.bincount(parts.ravel())[1:]
    if n_parts > 1:
        share = 1.0 - sizes.max() / sizes.sum()
        warnings.warn(
            f"Left out parts of the map that do not join the largest one: {n_parts - 1}, with "
            f"{share:.1%} of where a robot of radius {radius:g} fits.",
            stacklevel=5,
        )
    largest: BoolArray = parts == (sizes.argmax() + 1 if n_parts else -1)
    return largest


def _length(points: FloatArray) -> float:
    return float(_distances(points)[-1])


def _merged(ways: list[_Way], near: float) -> list[_Way]:
    """Leave one of nodes that are nearer to each other than ``near``, and draw their ways to it.

    What would be a way around nothing is left out: one around an obstacle is longer.
    """
    from scipy.spatial import KDTree

    if not ways:
        return []
    degree = Counter(end for way in ways for end in way[:2])
    places = {end: way[2][i] for way in ways for end, i in zip(way[:2], (0, -1), strict=True)}
    nodes = sorted(degree, key=lambda node: (-degree[node], node))
    at = np.array([places[node] for node in nodes])
    stays: dict[int, int] = {}
    for node, around in zip(nodes, KDTree(at).query_ball_point(at, near * (1 - 1e-9)), strict=True):
        if node not in stays:
            stays |= {nodes[i]: stays.get(nodes[i], node) for i in around}
    drawn = [
        (stays[tail], stays[head], np.vstack([places[stays[tail]], points, places[stays[head]]]))
        for tail, head, points in ways
    ]
    shortest: dict[frozenset[int], float] = {}
    merged = []
    for way in sorted(drawn, key=lambda way: _length(way[2])):
        ends, length = frozenset(way[:2]), _length(way[2])
        other = 0.0 if len(ends) == 1 else shortest.setdefault(ends, math.inf)
        if length + other >= 4.0 * near:
            merged.append(way)
            shortest[ends] = min(length, other)
    return merged


def _joined(ways: list[_Way]) -> list[_Way]:
    """Make one way of any two that meet where no other does."""
    kept = dict(enumerate(ways))
    at: dict[int, list[int]] = {}
    for i, (tail, head, _) in kept.items():
        at.setdefault(tail, []).append(i)
        at.setdefault(head, []).append(i)
    for node in sorted(at):
        if len(at[node]) == 2 and at[node][0] != at[node][1]:
            first, second = at.pop(node)
            start, to = _from(node, kept.pop(first))
            end, on = _from(node, kept.pop(second))
            kept[first] = start, end, np.vstack([to[::-1], on[1:]])
            at[end][at[end].index(second)] = first
    return list(kept.values())


def _from(node: int, way: _Way) -> tuple[int, FloatArray]:
    """Return the other end of a way, and its points from a node on."""
    tail, head, points = way
    return (head, points) if tail == node else (tail, points[::-1])


def _loss_along(
    danger: float, hazard: str | os.PathLike[str] | None
) -> Callable[[FloatArray], FloatArray]:
    """Return what integrates the rate of loss along a way, up to each of its points."""
    if hazard is None:
        return lambda points: danger * _distances(points)
    values, resolution, origin, _ = read_raster(hazard)
    cells = values[::-1]

    def losses(points: FloatArray) -> FloatArray:
        at = in_cells(points, cells, resolution, origin)
        if (is_off := np.isnan(at).any(axis=1)).any():
            x, y = points[is_off][0].tolist()
            fault = f"expected a map that covers all ways, found none of it at [{x:g}, {y:g}]"
            raise MissionError(fault, os.fspath(hazard))
        shares = [mean_along(cells, *ends) for ends in pairwise(at)]
        return danger * np.append(0.0, np.cumsum(shares * np.diff(_distances(points))))

    return losses


def _distances(points: FloatArray) -> FloatArray:
    """Return how far each point of a way is from the first one along it."""
    return np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))


def _roadmap(
    ways: list[_Way], spacing: float | None, loss_along: Callable[[FloatArray], FloatArray] | None
) -> nx.DiGraph[Any]:
    """Cut ways into arcs, at most as long as ``spacing``, of which no two have the same ends."""
    places: list[tuple[float, float]] = []
    numbers: dict[int, int] = {}
    arcs: dict[tuple[int, int], dict[str, float]] = {}

    def placed(place: FloatArray) -> int:
        places.append((round(float(place[0]), 6), round(float(place[1]), 6)))
        return len(places) - 1

    for tail, head, points in ways:
        for end, place in ((tail, points[0]), (head, points[-1])):
            if end not in numbers:
                numbers[end] = placed(place)
        first, last = numbers[tail], numbers[head]
        along = _distances(points)
        length = float(along[-1])
        n_arcs = 3 if first == last else 2 if (first, last) in arcs else 1
        if spacing is not None:
            n_arcs = max(n_arcs, math.ceil(length / spacing - 1e-9))
        cuts = np.linspace(0.0, length, n_arcs + 1)
        between = np.column_stack([np.interp(cuts[1:-1], along, axis) for axis in points.T])
        parts = [{"length": round(length / n_arcs, 6)} for _ in range(n_arcs)]
        if loss_along is not None:
            lost = np.diff(np.interp(cuts, along, loss_along(points)))
            parts = [
                part | {"survival": math.exp(-one)} for part, one in zip(parts, lost, strict=True)
            ]
        stops = pairwise([first, *map(placed, between), last])
        for (one, other), part in zip(stops, parts, strict=True):
            arcs[one, other] = arcs[other, one] = part
    order = sorted(range(len(places)), key=lambda i: (-places[i][1], places[i][0]))
    label = {i: number for number, i in enumerate(order)}
    graph: nx.DiGraph[Any] = nx.DiGraph()
    for i in order:
        graph.add_node(label[i], pos=list(places[i]), reward=1.0)
    for one, other in sorted(arcs, key=lambda ends: (label[ends[0]], label[ends[1]])):
        graph.add_edge(label[one], label[other], **arcs[one, other])
    return graph
