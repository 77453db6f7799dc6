"""Functions that read a picture back."""

import itertools
from collections import defaultdict

import numpy as np
from PIL import Image

from botohe_moo.plots import save_figure
from botohe_moo.plots.site import node_positions


def drawn(ax, name):
    """Return the artists of this name."""
    return [artist for artist in ax.get_children() if artist.get_label() == f"_{name}"]


def only(ax, name):
    (artist,) = drawn(ax, name)
    return artist


def n_segments(ax, name):
    return sum(len(artist.get_segments()) for artist in drawn(ax, name))


def node_texts(ax):
    """Return the texts in and beside nodes."""
    return [text for text in ax.texts if text.get_label() not in ("_words", "_robot")]


def title(ax):
    return ax.get_title(loc="left")


def words(ax):
    return " ".join(only(ax, "words").get_text().split())


def legend_texts(ax):
    return [t.get_text() for t in ax.get_legend().get_texts() if t.get_text().strip()]


def map_name(ax):
    (name,) = legend_texts(ax)
    return name


def maps_of(ax):
    return ax.figure.axes


def lines_of(ax):
    """Return the lines that are named, by name."""
    return {line.get_label(): line for line in ax.lines if not line.get_label().startswith("_")}


def of_kind(ax, kind):
    return [artist for artist in ax.get_children() if type(artist) is kind]


def plan_names(ax):
    return [text.get_text() for text in ax.texts if text.get_fontweight() == "bold"]


def luminance(colours):
    return np.asarray(colours)[:, :3] @ [0.2126, 0.7152, 0.0722]


def darkness(ax, path):
    """The share of pixels of the saved picture that are not almost white, and its width."""
    save_figure(ax.figure.figure, path, dpi=80)
    pixels = np.asarray(Image.open(path).convert("RGB")) / 255
    return (pixels.min(axis=2) < 0.9).mean(), pixels.shape[1]


def nodes_at(mission, points):
    """The indices of the nodes nearest to points."""
    away = node_positions(mission)[:, None] - np.reshape(points, (-1, 2))
    return np.hypot(*away.T).argmin(axis=1).tolist()


def arcs_drawn(mission, ax):
    """The arcs, as node indices, that the trails of a map follow, in their order."""
    segments = [s for lines in drawn(ax, "trails") for s in lines.get_segments()]
    nodes = nodes_at(mission, np.array([s[[0, -1]] for s in segments]).reshape(-1, 2))
    return list(zip(nodes[::2], nodes[1::2], strict=True))


def arcs_of(*trails):
    return [arc for trail in trails for arc in itertools.pairwise(trail)]


def visits_drawn(mission, ax):
    """The numbers at each node of a robot's map."""
    texts = node_texts(ax)
    nodes = nodes_at(mission, [text.xy for text in texts])
    numbers = [[int(part) for part in text.get_text().split(",")] for text in texts]
    return dict(zip(nodes, numbers, strict=True))


def visits_of(trail):
    numbers = defaultdict(list)
    for i, node in enumerate(trail[1:], start=1):
        numbers[node].append(i)
    return dict(numbers)
