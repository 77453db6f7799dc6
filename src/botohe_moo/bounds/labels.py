"""Stairs above all relaxed trails, which take time that searches for trails may not end in."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

from botohe_moo.base.types import FloatArray
from botohe_moo.bounds.deadline import Deadline
from botohe_moo.bounds.kernels.labels import (
    Frontiers,
    LabelRule,
    Labels,
    new_frontiers,
    new_labels,
    raise_by_labels,
    settle_excursion,
)
from botohe_moo.bounds.kernels.states import Net, States
from botohe_moo.bounds.kernels.trails import Completions, Stairs
from botohe_moo.bounds.net import RelaxedTrail
from botohe_moo.bounds.relaxation import SLACK, BoundLines, completions, paying

BYTES_A_LABEL = 56.0
MOST_LABELS = 1 << 20  # at once
_MOST_OUTCOMES = 8_000_000  # of links that are looked at, for each unit of effort
_SECONDS_AN_OUTCOME = 1e-7  # on a usual processor
_LOSS = 2e-5  # of all reward: how much stairs are higher, so that labels may be left out
# Excursions stand for others that are worth as much, up to this share of what a trail above the
# stairs can be worse than the best, divided by the effort.
_FINE = 0.02
_NONE = False
_MOST_TRAILS = 16  # that are returned
_SAME = 1e-9  # how far shares may differ, relative


class _Given(NamedTuple):
    """What all labels of some stairs are found with."""

    net: Net
    states: States
    prices: FloatArray
    ahead: Completions
    stairs: Stairs
    rule: LabelRule
    frontiers: Frontiers
    labels: Labels


class LabelStairs:
    """Raises stairs above relaxed trails; ``n_room`` labels are kept at once by each thread."""

    def __init__(self, net: Net, n_room: int, most_states: int, deadline: Deadline) -> None:
        self._net, self._deadline = net, deadline
        self._new_labels = partial(new_labels, n_room, most_states)
        self._free: list[Labels] = []  # scratch that no thread uses

    def raise_above(
        self, prices: FloatArray, lines: BoundLines, stairs: Stairs, effort: int
    ) -> tuple[bool, list[RelaxedTrail]]:
        """Raise stairs above all relaxed trails, under prices of all nodes.

        Returns whether that has ended, and some of the relaxed trails that have raised them. On its
        way, a trail is left out in favour of others that are worth less by the tolerance once for
        each of its arcs and excursions at most. So twice as many tolerances as there are arcs are
        added, and what rounding takes, twice: from what lies ahead, and from labels.
        """
        net, (first, _) = self._net, lines[0]
        try:
            labels = self._free.pop()
        except IndexError:
            labels = self._new_labels()
        total = float(net.graph.reward.sum())
        rule = LabelRule(
            tolerance=_LOSS * total / (2 * net.graph.n_arcs),
            cap=float(prices[:, -1].sum()) * (1.0 + 1e-12),
            slack=SLACK * total,
            fine=_FINE / effort,
            n_most=int(min(_MOST_OUTCOMES * effort, self._deadline.left / _SECONDS_AN_OUTCOME)),
        )
        frontiers = new_frontiers(net, prices.shape[1] - 1)
        ahead = completions(lines)
        given = _Given(net, first.states, prices, ahead, stairs, rule, frontiers, labels)
        try:
            n = raise_by_labels(*given)
            self._deadline.work += _SECONDS_AN_OUTCOME * abs(n)
            if n < 0:
                return False, []
            stairs.heights[:] += 2 * max(each.spare for each, _ in lines) + _LOSS * total
            ends = labels.ends[1 : labels.ends[0] + 1].tolist()
            if _NONE: return True, []
            walks = [_walk(labels, end) for end in ends[:: len(ends) // _MOST_TRAILS + 1]]
            return True, [paying(net, prices, *self._trail(given, walk)) for walk in walks]
        finally:
            self._free.append(labels)

    def _trail(self, given: _Given, walk: list[_Step]) -> RelaxedTrail:
        """Return the arcs of steps through states, and whether each pays."""
        graph, pieces, trail = given.net.graph, given.net.pieces, RelaxedTrail([], [])
        for link, alive, share in walk:
            move, pays = int(given.states.move[link]), bool(given.states.pays[link])
            if move < graph.n_arcs:
                trail.arcs.append(move)
                trail.paid.append(pays)
                continue
            child = int(pieces.of_option[move - graph.n_arcs])
            trail.arcs.append(int(pieces.arc[child]))
            trail.paid.append(True)
            if pieces.first_option[child + 1] - pieces.first_option[child] > 1:
                inner = self._trail(given, self._excursion(given, child, alive, share))
                trail.arcs.extend(inner.arcs)
                trail.paid.extend(inner.paid)
            trail.arcs.append(int(pieces.back[child]))
            trail.paid.append(False)
        return trail

    def _excursion(self, given: _Given, child: int, alive: float, share: float) -> list[_Step]:
        """Return the steps of the best excursion that comes back with a share of ``alive``."""
        net, labels = given.net, given.labels
        arc, back = net.pieces.arc[child], net.pieces.back[child]
        out = alive * net.graph.survival[arc]
        self._deadline.work += _SECONDS_AN_OUTCOME * abs(settle_excursion(*given, child, out))
        ends = labels.ends[1 : labels.ends[0] + 1]
        shares = labels.alive[ends] * net.graph.survival[back] / alive  # which fall
        n = int((shares >= share * (1.0 - _SAME)).sum())
        return _walk(labels, int(ends[max(0, n - 1)]))


class _Step(NamedTuple):
    """A link of a relaxed trail, the probability to be alive before it, and the share kept."""

    link: int
    alive: float
    share: float


def _walk(labels: Labels, label: int) -> list[_Step]:
    """Return the steps that lead to a label."""
    found = list[_Step]()
    while (parent := int(labels.parent[label])) >= 0:
        alive, share = float(labels.alive[parent]), float(labels.share[label])
        found.append(_Step(int(labels.link[label]), alive, share))
        label = parent
    return found[::-1]
