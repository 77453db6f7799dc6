"""What is wrong with a trail plan, in words."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import numpy as np

from botohe_moo.kernels.plans import evaluate as kernels
from botohe_moo.trails import PlanBatch

_FAULTS = {
    kernels.BAD_OFFSETS: "expected the batch's offsets to cut its nodes into trails",
    kernels.EMPTY_TRAIL: "expected a trail of at least one node, the base, got an empty one",
    kernels.NOT_FROM_BASE: "expected the trail to begin at base",
    kernels.NOT_BACK_AT_BASE: "expected the trail to end at base",
    kernels.MISSING_ARC: "is missing in",
    kernels.ARC_USED_TWICE: "is used twice in this trail; a trail uses an arc at most once, in",
}


class PlanError(ValueError):
    """A trail plan is not valid for the mission; names the robot, the position and the arc."""


def trail_indices(
    mission: str, index: Mapping[Any, int], robot: int, trail: Sequence[Hashable]
) -> list[int]:
    """Convert the node labels of a robot's trail to indices; ``mission`` is the mission's name."""
    if isinstance(trail, str | bytes) or not isinstance(trail, Sequence | np.ndarray):
        raise PlanError(f"Robot {robot}: expected a sequence of node labels, got {trail!r}.")
    if len(trail) == 0:
        raise PlanError(f"Robot {robot}: {_FAULTS[kernels.EMPTY_TRAIL]}.")
    indices = []
    for position, label in enumerate(trail):
        try:
            indices.append(index[label])
        except (KeyError, TypeError):
            raise PlanError(
                f"Robot {robot}, position {position}: mission {mission!r} has no node {label!r}."
            ) from None
    return indices


def fault_text(
    mission: str, nodes: Sequence[Any], base: Hashable, batch: PlanBatch, fault: Sequence[int]
) -> str:
    """Describe a fault that the kernel ``evaluate`` found: its kind, plan, robot and position.

    ``mission`` is the name of a mission with ``nodes`` and ``base``.
    """
    kind, plan, robot, position = fault
    where = f"Robot {robot}" if len(batch) == 1 else f"Plan {plan}, robot {robot}"
    if kind in (kernels.EMPTY_TRAIL, kernels.BAD_OFFSETS):
        return f"{where}: {_FAULTS[kind]}."
    start = batch.offsets[plan * batch.n_robots + robot]
    node = int(batch.nodes[start + position])
    where = f"{where}, position {position}"
    if kind == kernels.UNKNOWN_NODE:
        known = f"mission {mission!r} has {len(nodes)} nodes"
        return f"{where}: node index {node} is unknown, {known}."
    label = nodes[node]
    if kind in (kernels.NOT_FROM_BASE, kernels.NOT_BACK_AT_BASE):
        return f"{where}: {_FAULTS[kind]} {base!r}, got {label!r}."
    tail = nodes[int(batch.nodes[start + position - 1])]
    return f"{where}: arc {tail!r} -> {label!r} {_FAULTS[kind]} mission {mission!r}."
