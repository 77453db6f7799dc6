"""Digests of missions: of all that results depend on, which names and positions are not."""

import hashlib
import json

import numpy as np

from botohe_moo.mission.model import Mission


def mission_digest(mission: Mission) -> str:
    """Return the digest of labels, base, robots, arcs with their numbers, rewards, max_length."""
    return _digest(mission, [[repr(node) for node in mission.nodes], repr(mission.base)])


def numbers_digest(mission: Mission) -> str:
    """Return the digest without labels, whose types may change when they are read from a file."""
    return _digest(mission, [mission.arrays.base])


def _digest(mission: Mission, first: list[object]) -> str:
    limits = [] if mission.max_length is None else [mission.max_length]
    text = json.dumps([*first, mission.robots, *limits], separators=(",", ":"))
    hashed = hashlib.sha256(text.encode())
    arrays = mission.arrays
    for ends in (arrays.tail, arrays.head):
        hashed.update(np.ascontiguousarray(ends, "<i8").tobytes())
    for values in (arrays.survival, arrays.reward):
        hashed.update(np.ascontiguousarray(values, "<f8").tobytes())
    if (arrays.length != 1.0).any():  # without lengths every hop is one long
        hashed.update(np.ascontiguousarray(arrays.length, "<f8").tobytes())
    return hashed.hexdigest()[:16]
