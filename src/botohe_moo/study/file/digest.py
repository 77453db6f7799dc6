"""Values of a study file as texts and digests that are the same wherever the values are."""

import hashlib
import json
from typing import Any

import numpy as np

from botohe_moo.mission.model import Mission


def mission_digest(mission: Mission) -> str:
    """Give the digest of all that a result can depend on, which names and positions are not."""
    arrays = mission.arrays
    hashed = hashlib.sha256(
        canonical(
            [[repr(node) for node in mission.nodes], repr(mission.base), mission.robots]
        ).encode()
    )
    for values, dtype in (
        (arrays.tail, "<i8"),
        (arrays.head, "<i8"),
        (arrays.survival, "<f8"),
        (arrays.reward, "<f8"),
    ):
        hashed.update(np.ascontiguousarray(values, dtype).tobytes())
    return hashed.hexdigest()[:16]


def value_text(value: Any) -> str:
    """Write a parameter's value as a study file would: a text as it is, all others as JSON."""
    if isinstance(value, str) and value.isprintable():
        return value
    text = json.dumps(value, ensure_ascii=False)
    return text if text.isprintable() else json.dumps(value)


def canonical(value: Any) -> str:
    """Write what a study file can hold so that equal values give equal texts."""
    return json.dumps(_one_number(value), sort_keys=True, separators=(",", ":"))


def _one_number(value: Any) -> Any:
    """Write 1.0 as 1: whether a number may be one is checked before, and it is the same number."""
    if isinstance(value, float) and value.is_integer():
        return int(value)
    if isinstance(value, dict):
        return {key: _one_number(item) for key, item in value.items()}
    return [_one_number(item) for item in value] if isinstance(value, list | tuple) else value
