"""Digests of missions, by which results are known to belong to them."""

import hashlib
import json

import numpy as np

from botohe_moo.mission.model import Mission


def mission_digest(mission: Mission) -> str:
    """Return the digest of all that results depend on: not of names and positions."""
    return _digest(mission, [[repr(node) for node in mission.nodes], repr(mission.base)])


def numbers_digest(mission: Mission) -> str:
    """Return the digest without labels, whose types may change when they are read from a file."""
    return _digest(mission, [mission.arrays.base])


def _digest(mission: Mission, first: list[object]) -> str:
    limits: list[object] = [] if mission.max_length is None else [mission.max_length]
    of_kinds = [[kind.min_survival, kind.max_length] for kind in mission.kinds]
    if of_kinds != [[0.0, None]]:
        limits += [of_kinds]
    text = json.dumps([*first, mission.robots, *limits], separators=(",", ":"))
    hashed = hashlib.sha256(text.encode())
    arrays = mission.arrays
    numbers = [arrays.tail, arrays.head, arrays.survival, arrays.reward]
    if (arrays.length != 1.0).any():  # without lengths every hop is one long
        numbers.append(arrays.length)
    if arrays.kinds is not None:
        numbers += arrays.kinds[:-1]
    for values in numbers:
        hashed.update(np.ascontiguousarray(values, f"<{values.dtype.kind}8").tobytes())
    return hashed.hexdigest()[:16]
