"""Digests of missions: of all that results depend on, which names and positions are not."""

import hashlib
import json

import numpy as np

from botohe_moo.mission.model import Mission


def mission_digest(mission: Mission) -> str:
    """Give the digest of labels, base, robots, arcs, survivals and rewards."""
    return _digest(mission, [[repr(node) for node in mission.nodes], repr(mission.base)])


def numbers_digest(mission: Mission) -> str:
    """Give the digest without labels, of which some are of another type when read from a file."""
    return _digest(mission, [mission.arrays.base])


def _digest(mission: Mission, first: list[object]) -> str:
    text = json.dumps([*first, mission.robots], separators=(",", ":"))
    hashed = hashlib.sha256(text.encode())
    arrays = mission.arrays
    for ends in (arrays.tail, arrays.head):
        hashed.update(np.ascontiguousarray(ends, "<i8").tobytes())
    for values in (arrays.survival, arrays.reward):
        hashed.update(np.ascontiguousarray(values, "<f8").tobytes())
    return hashed.hexdigest()[:16]
