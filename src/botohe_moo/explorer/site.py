"""The site on the page: its nodes and arcs, and what kinds of robots do there."""

from __future__ import annotations

import base64
import io
from contextlib import suppress
from typing import Any

import numpy as np
from PIL import Image

from botohe_moo.base.types import FloatArray
from botohe_moo.explorer.texts import number_texts, probability_codes, shown_names
from botohe_moo.mission.formats.nodelink import plain_label
from botohe_moo.mission.hazards import places_of
from botohe_moo.mission.model import Mission
from botohe_moo.plots.draw.background import Background
from botohe_moo.plots.draw.places import layout_notes, node_positions
from botohe_moo.plots.draw.site import Site, only_some, site_of


def site_data(mission: Mission) -> dict[str, Any]:
    """Return nodes, their places on the map and their positions, and arcs."""
    places, site = node_positions(mission), site_of(mission)
    given = places_of(mission.graph.nodes)
    pos = [[*given[node]] if node in given else None for node in mission.nodes]
    labels: list[object] | None = None  # what JSON cannot hold is not written to files
    with suppress(ValueError):
        labels = list(map(plain_label, mission.nodes))
    return {
        "names": shown_names(mission.nodes),
        "labels": labels,
        "base": site.base,
        "rewards": mission.rewards.tolist(),
        "reward_texts": number_texts(mission.rewards.tolist()),
        "places": places.tolist(),
        "pos": None if pos == places.tolist() else pos,  # None: the same as the places
        "placing": "".join(f"{note[0].upper()}{note[1:]}." for note in layout_notes(mission)),
        "arcs": [site.tail.tolist(), site.head.tolist(), probability_codes(site.safest)],
        # For what is drawn along trails; each is exact to what a picture can show.
        "arc_lengths": _seven_digits(site.length),
        "arc_survival": [*map(_seven_digits, site.survival)],
        **_kinds(mission, site),
    }


def _seven_digits(values: FloatArray) -> list[float]:
    return [float(f"{value:.7g}") for value in values]


def picture_data(background: Background | None) -> dict[str, Any] | None:
    """Return a map behind the graph as a picture, and where it lies: left, right, bottom, top.

    It is grey, and the more transparent the lighter the map, so that it suits dark pages too.
    """
    if background is None:
        return None
    shade = np.round(127 * background.shares).astype(np.uint8)  # half of black: it is to be faint
    pixels, file = np.stack([np.full_like(shade, 128), shade], axis=2), io.BytesIO()
    Image.fromarray(pixels, "LA").save(file, "PNG", optimize=True)
    picture = base64.b64encode(file.getvalue()).decode()
    return {"href": f"data:image/png;base64,{picture}", "extent": background.extent}


def _kinds(mission: Mission, site: Site) -> dict[str, Any]:
    """Return what the page shows of kinds and of rewards on return; empty for a plain mission."""
    names = [kind.name for kind in mission.kinds]
    several = len(names) > 1
    arcs, nodes = only_some(site.survival > 0), only_some(site.collects)
    return {
        "kinds": names if several else [],
        "kind_of": [names.index(kind.name) for kind in mission.kind_of] if several else [],
        "ends": site.ends if site.has_ends else [],
        "depots": site.depots.tolist(),
        "rings": [] if site.all_return else site.returning.tolist(),
        # Sets of kinds, and the arcs and nodes that only they can take and collect.
        "only": [
            [kinds, *(np.flatnonzero(of.get(kinds, [])).tolist() for of in (arcs, nodes))]
            for kinds in {**arcs, **nodes}
        ],
        "arc_codes": [*map(probability_codes, site.survival)] if several else [],
        "node_notes": _node_notes(mission, site),
        "key": " ".join(_key(site)),
    }


def _node_notes(mission: Mission, site: Site) -> list[str]:
    """Write when each node pays, and for whom not always; nothing for a plain mission."""
    if mission.is_plain:
        return []
    notes: list[list[str]] = [[] for _ in mission.nodes]
    for node in site.depots:
        notes[node].append("depot")
    for node in site.returning:
        notes[node].append("pays on return")
    names = [kind.name if len(mission.kinds) > 1 else "a robot" for kind in mission.kinds]
    for name, share in zip(names, mission.world.team.share.reshape(len(names), -1), strict=True):
        for node in np.flatnonzero((share < 1) & site.collects.any(axis=0)):
            chance = f"collects it with {share[node]:g}" if share[node] > 0 else "cannot collect it"
            notes[node].append(f"{name} {chance}")
    return [", ".join(of_node) for of_node in notes]


def _key(site: Site) -> list[str]:
    """Write how to read the marks of kinds and of places."""
    said = []
    if site.has_ends:
        hollow = ", a hollow one where it ends" if any(a != b for a, b in site.ends) else ""
        said.append(f"A triangle is where a kind of robots starts{hollow}.")
    if len(only_some(site.survival > 0)) + len(only_some(site.collects)):
        said.append("What not all kinds can take or collect has the colours of those that can.")
    if len(site.depots):
        said.append("Thin squares are depots.")
    if len(site.returning):
        all_return = "All rewards count on return."
        said.append(all_return if site.all_return else "Nodes with a ring pay on return.")
    return said
