"""Maps as the map server of Nav2 reads them, and the ways through their free space."""

from __future__ import annotations

import math
import os
import warnings
from collections import Counter, defaultdict
from collections.abc import Sequence
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import networkx as nx
import numpy as np
from PIL import Image, UnidentifiedImageError
from pydantic import BaseModel, Field

from botohe_moo.base.files import FilePath, Source
from botohe_moo.base.messages import ParameterError, quoted
from botohe_moo.base.parameters import NotNegative, Positive, Probability, checked, validated
from botohe_moo.base.types import FloatArray
from botohe_moo.mission.hazards import Raster, plain_numbers, survived
from botohe_moo.mission.rules import MissionError, blamed_on

MODES = ("trinary", "scale")
FREE, OCCUPIED, UNKNOWN = np.array([0, 100, -1], np.int8)  # as in ROS's OccupancyGrid


class _MapFile(BaseModel, strict=True, allow_inf_nan=False):
    image: Annotated[str, Field(min_length=1)]
    resolution: Positive
    origin: Annotated[list[float], Field(min_length=2, max_length=3)]
    negate: Annotated[bool, Field(strict=False)] = False
    mode: str = "trinary"
    free_thresh: Probability = 0.25  # both as the map saver of Nav2 writes them
    occupied_thresh: Probability = 0.65


def read_raster(path: FilePath, *, modes: Sequence[str] = ("scale",)) -> Raster:
    """Read a map as shares of full scale, which is black, or with ``negate`` white.

    The file is read as the map server of Nav2 reads it. In mode ``scale`` shares up to
    ``free_thresh`` become 0, those from ``occupied_thresh`` on become 1, and the scale between
    them is linear. Without thresholds it goes from 0 to 1, so that shares stay. They also stay in
    mode ``trinary``. Cells are free below ``free_thresh``, by default 0.25, and occupied above
    ``occupied_thresh``, by default 0.65. Others are unknown, and so is the grey 205 of map savers.
    A pixel that is transparent, if only partly, is an unknown cell of share 0. The map server
    requires thresholds, ``negate`` and an angle in ``origin``: here they may be left out. A ``~``
    with which ``image`` begins is the home folder.

    Parameters
    ----------
    path
        YAML that names an image. Keys that are not known are ignored.
    modes
        The ``mode`` of the file has to be one of these, in any case; without one it is
        ``trinary``. In mode ``raw``, which is never one of these, pixels are not shares. If
        ``trinary`` is not one of these either, a warning counts the transparent pixels.

    Raises
    ------
    MissionError
        If the map cannot be read: names the file, and the line of what is wrong.
    """
    source = Source(path)
    try:
        given = source.yaml.content
        found = validated(given, _MapFile, source.yaml.line)
        low, high = given.get("free_thresh", 0.0), given.get("occupied_thresh", 1.0)
        mode, (x, y, *angle) = found.mode.lower(), found.origin
        for key, is_wrong, expected in (
            ("mode", mode not in modes, f"mode to be {' or '.join(modes)}"),
            ("origin", any(angle), "origin [x, y, 0], without rotation"),
            ("free_thresh", low > high, f"free_thresh <= occupied_thresh, {high:g}"),
        ):
            if is_wrong:
                fault = f"expected {expected}, got {quoted(given.get(key))}"
                raise MissionError(f"line {source.yaml.line([key])}: {fault}")
        white = _read_image(source.path.parent, found.image)
    except ValueError as error:  # not valid YAML, not UTF-8, or a MissionError
        raise blamed_on(str(path), error) from None
    if (n_clear := np.isnan(white).sum()) and "trinary" not in modes:
        said = f"{n_clear} of {white.size} pixels are transparent: unknown, which counts as 0."
        warnings.warn(f"{path}: {said}", stacklevel=2)
    black = white if found.negate else 1.0 - white
    # Map savers write the grey 205 for unknown cells; by their own free_thresh, 0.25, it is free.
    is_free = (black < found.free_thresh) & ~np.isclose(black, 1.0 - 205.0 / 255.0)
    cells = np.where(is_free, FREE, np.where(black > found.occupied_thresh, OCCUPIED, UNKNOWN))
    if mode == "scale":
        black = np.interp(black, [low, max(high, np.nextafter(low, 2.0))], [0.0, 1.0])
    return Raster(np.nan_to_num(black), found.resolution, (x, y), cells, str(path))


def _read_image(folder: Path, name: str) -> FloatArray:
    """Read an image as shares of white (n_rows, n_columns); NaN where it is transparent."""
    try:
        with Image.open(BytesIO(Source(folder / Path(name).expanduser()).data)) as image:
            if image.mode == "F":
                raise MissionError("expected integers as pixels, found floats")
            if image.mode.startswith("I"):  # of 16 bits or more
                grey = np.asarray(image, float)
                grey[grey == image.info.get("transparency")] = np.nan
                return np.clip(grey / 65_535.0, 0.0, 1.0)
            pixels = np.asarray(image.convert("RGBA"))
            return np.where(pixels[..., 3] < 255, np.nan, pixels[..., :3].mean(axis=2) / 255.0)
    except (OSError, RuntimeError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        fault = getattr(error, "faults", [f"cannot be read: {error}"])[0]
        if isinstance(error, UnidentifiedImageError):
            fault = "expected an image, such as PNG or PGM"
    raise MissionError(f"image {quoted(name)}: {fault}")


@checked
def roadmap_from_map(
    path: FilePath,
    *,
    radius: Positive = 0.3,
    spacing: Positive | None = None,
    base: int | tuple[float, float] = (0.0, 0.0),
    danger: NotNegative | None = None,
    hazard: FilePath | None = None,
) -> Any:
    """Make a graph of the ways on which a robot gets through a map of obstacles.

    Ways are the skeleton of all places where a robot is clear of obstacles, in the largest
    connected part: they keep to the middle of rooms and corridors. Nodes are where ways meet
    or end. Of nodes nearer to each other than ``radius``, or than two cells, one stays, so that
    shorter dead ends disappear. Loops and parallel branches get
    nodes in between. Needs ``pip install "botohe-moo[maps]"``.

    Parameters
    ----------
    path
        YAML that names an image, as the map server of Nav2 reads it. Cells below its
        ``free_thresh``, by default 0.25, are free. Unknown cells are not, nor is what lies outside.
        Pixels that are transparent, if only partly, are unknown cells.
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
        :func:`survival_from_raster` along the points of a way. With ``free_thresh`` and
        ``occupied_thresh`` the scale goes from one to the other, as for the map server. Pixels that
        are transparent, if only partly, are unknown: they count as 0, with a warning.

    Returns
    -------
    networkx.DiGraph
        Nodes 0, 1, ... from the top of the map to the bottom, with ``pos`` [x, y] in the frame of
        the map, and ``reward`` 1, at the base 0. Arcs lead both ways, with the ``length`` of the
        way. The graph has the attribute ``base``.

    Raises
    ------
    MissionError
        If a map cannot be read, has no free cells, or no ways for such a robot, if packages are
        missing, or the map of dangers does not cover all ways.
    ValueError
        If a parameter is out of its range, the base is not a node, or ``danger`` is so large that
        the survival of an arc would be 0 as a float.

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
    rates = None if hazard is None else read_raster(hazard)
    raster, source = read_raster(path, modes=MODES), os.fspath(path)
    if spacing is not None and spacing < raster.resolution:
        fault = f"Expected spacing >= {raster.resolution:g}, the width of a cell, got {spacing:g}."
        raise ParameterError(fault, "spacing")
    ways = _joined(_merged(_skeleton(raster, radius, source), max(radius, 2.0 * raster.resolution)))
    if not ways:
        why = "where it fits is a round or square hall, which has a middle, but no ways"
        raise MissionError(f"{_NO_WAY.format(radius)}: the largest part {why}", source)
    graph = _roadmap(ways, spacing or math.inf, danger, rates)
    if (place := plain_numbers(base)).shape == (2,):
        base = min(graph, key=lambda node: math.dist(place, graph.nodes[node]["pos"]))
    if base not in graph:
        expected = f"a node, 0 to {len(graph) - 1}, or a place (x, y)"
        raise ParameterError(f"Expected base to be {expected}, got {quoted(base)}.", "base")
    graph.graph["base"] = base
    graph.nodes[base]["reward"] = 0.0
    return graph


_NO_WAY = "expected ways through free space for a robot of radius {:g}, found none"
_Way: TypeAlias = np.ndarray[Any, np.dtype[np.complex128]]  # points x + iy; nodes at both ends


def _skeleton(raster: Raster, radius: float, source: str) -> list[_Way]:
    """Return the ways of the skeleton of the largest part where a robot is clear of obstacles."""
    from scipy.ndimage import distance_transform_edt, label

    try:
        from skan import Skeleton
        from skimage.morphology import skeletonize
    except ImportError:
        needed = "the packages scikit-image and skan: pip install 'botohe-moo[maps]'"
        raise MissionError(f"a roadmap needs {needed}", source) from None
    is_free = np.pad(raster.cells == FREE, 1)  # with a margin that is not
    # From the centre of a cell to the edge of the nearest one that is not free.
    clearance = (distance_transform_edt(is_free) - 0.5) * raster.resolution
    parts, n_parts = label(clearance >= radius * (1.0 - 1e-9), np.ones((3, 3)))
    if n_parts == 0:
        fault = f"{_NO_WAY.format(radius)}: the largest clearance is {clearance.max():g}"
        if not is_free.any():
            unknown = np.mean(raster.cells == UNKNOWN)
            fault = f"no cell is free; {unknown:.0%} are unknown, {1.0 - unknown:.0%} are occupied"
        raise MissionError(fault, source)
    sizes = np.bincount(parts.ravel())[1:]
    if n_parts > 1:
        share = f"{1.0 - sizes.max() / sizes.sum():.1%} of where a robot of radius {radius:g} fits"
        said = f"Left out parts of the map that do not join the largest one: {n_parts - 1}, with"
        warnings.warn(f"{said} {share}.", stacklevel=4)
    skeleton = skeletonize(parts == sizes.argmax() + 1)  # type: ignore[no-untyped-call]
    if skeleton.sum() < 2:
        return []
    branches = Skeleton(skeleton, keep_images=False)
    # Where the cell in the corner is: the first row is at the top, and there is the margin.
    corner = complex(*(raster.origin + np.array([-0.5, len(parts) - 1.5]) * raster.resolution))
    cells = [branches.path_coordinates(i) @ [-1j, 1] for i in range(branches.n_paths)]
    return [corner + way * raster.resolution for way in cells]


def _merged(ways: list[_Way], near: float) -> list[_Way]:
    """Leave one of nodes that are nearer to each other than ``near``, and draw their ways to it.

    What would be a way around nothing is left out: one around an obstacle is longer.
    """
    from scipy.spatial import KDTree

    degree = Counter(end for way in ways for end in way[[0, -1]].tolist())
    nodes = sorted(degree, key=lambda node: (-degree[node], *_from_top(node)))
    at = _xy(nodes)
    stays: dict[complex, complex] = {}
    for node, around in zip(nodes, KDTree(at).query_ball_point(at, near * (1 - 1e-9)), strict=True):
        if node not in stays:
            stays |= {nodes[i]: stays.get(nodes[i], node) for i in around}
    drawn = [np.array([stays[way[0]], *way, stays[way[-1]]]) for way in ways]
    shortest: dict[frozenset[complex], float] = {}
    merged = []
    for way in sorted(drawn, key=lambda way: _distances(way)[-1]):
        ends, length = frozenset(way[[0, -1]].tolist()), _distances(way)[-1]
        other = 0.0 if len(ends) == 1 else shortest.get(ends, math.inf)
        if length + other >= 4.0 * near:
            merged.append(way)
            shortest.setdefault(ends, length)
    return merged


def _joined(ways: list[_Way]) -> list[_Way]:
    """Make one way of any two that meet where no other does."""
    kept = dict(enumerate(ways))
    at = defaultdict(list)
    for i, way in kept.items():
        at[way[0]].append(i)
        at[way[-1]].append(i)
    for node in sorted(at, key=_from_top):
        if len({*at[node]}) == len(at[node]) == 2:
            first, second = pair = at.pop(node)
            to, on = (way if way[0] == node else way[::-1] for way in map(kept.pop, pair))
            kept[first] = np.append(to[::-1], on[1:])
            at[on[-1]][at[on[-1]].index(second)] = first
    return list(kept.values())


def _xy(places: Any) -> FloatArray:
    """Return points x + iy as pairs (..., 2)."""
    return np.stack([np.real(places), np.imag(places)], axis=-1)


def _from_top(place: complex) -> tuple[float, float]:
    """Return the key by which places are sorted from the top of the map to the bottom."""
    return -place.imag, place.real


def _distances(way: _Way) -> FloatArray:
    """Return how far each point of a way is from the first one along it."""
    return _summed(np.hypot(*_xy(np.diff(way)).T))


def _summed(steps: FloatArray) -> FloatArray:
    """Return the sums of all steps before each point, from 0 for the first one."""
    return np.append(0.0, np.cumsum(steps))


def _roadmap(
    ways: list[_Way], spacing: float, danger: float | None, rates: Raster | None
) -> nx.DiGraph[Any]:
    """Cut ways into arcs, none longer than ``spacing``; no two arcs have the same ends."""
    cut: nx.Graph[Any] = nx.Graph()
    for way in ways:
        along = _distances(way)
        first, last = np.round(way[[0, -1]], 6).tolist()
        least = 3 if first == last else 1 + cut.has_edge(first, last)
        n_arcs = max(least, math.ceil(along[-1] / spacing - 1e-9))
        cuts, length = np.linspace(0.0, along[-1], n_arcs + 1, retstep=True)
        stops: Any = np.round(np.interp(cuts, along, way), 6).tolist()
        loss = along if rates is None else _summed(rates.means(_xy(way)) * np.diff(along))
        lost = np.diff(np.interp(cuts, along, (danger or 0.0) * loss)).tolist()
        for i, ends in enumerate(pairwise(stops)):
            cut.add_edge(*ends, length=round(float(length), 6))
            if danger is not None:
                where = "Arc from {} to {}".format(*_xy(ends).tolist())
                cut.edges[ends]["survival"] = survived(lost[i], where, length=length)
    order = {place: i for i, place in enumerate(sorted(cut, key=_from_top))}
    graph: nx.DiGraph[Any] = nx.DiGraph()
    graph.add_nodes_from((order[at], {"pos": _xy(at).tolist(), "reward": 1.0}) for at in order)
    graph.add_edges_from(sorted(nx.relabel_nodes(cut, order).to_directed().edges(data=True)))
    return graph
