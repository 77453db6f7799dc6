"""Bounds on what a trail is worth, by relaxed trails and by search."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import NamedTuple, TypeVar

import numpy as np

from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.bounds.deadline import Deadline
from botohe_moo.bounds.kernels.labels import (
    Labels,
    LabelSearch,
    new_frontiers,
    new_labels,
    raise_by_labels,
)
from botohe_moo.bounds.kernels.relaxed import Rule, Tables, Worth, follow, look_ahead
from botohe_moo.bounds.kernels.states import EPSILON, Net, States, find_states
from botohe_moo.bounds.kernels.trails import (
    Completions,
    Stairs,
    TrailRule,
    find_trails,
    new_corners,
    new_depths,
)
from botohe_moo.bounds.net import MOST_SLOPES, RelaxedTrail, Remembered

_SLACK = 1e-9  # in shares of all reward: stairs are raised by as much more, to skip equal trails
_TOLERANCE = 1e-9  # in shares of all reward: values are raised only where they rise by more
_Scratch = TypeVar("_Scratch")

_SECONDS_A_MOVE = 9e-8  # of a search, on a usual processor
_SECONDS_A_VALUE = 8e-8  # that lies ahead
_MOST_TRAIL = 400  # links of a relaxed trail that are looked at
# Steps at which a relaxed trail takes the second best link, to find others; −1 for none.
_TURNS = (-1, 0, 1, 2, 4, 7, 11)
_STEEPEST = 20.0  # of the slopes of hulls, in shares of all reward
_ENOUGH = 1e-4  # of all reward: how far hulls may lie above what is true, nearly
FIRST_BITS, _MOST_BITS = 14, 20  # that a node remembers at most, at first and in the end
_FIRST_STATES = 15_000  # of relaxed trails at first
_MOST_STATES = 40_000  # of relaxed trails that have learned what to remember
_MOST_MASKS = 50_000_000  # of all nodes together
_N_SEEN = 1 << 18  # sets of arcs that a depth-first search recognises when it meets them again
# When relaxed trails learn, states grow to the larger of this number and this many times as many.
_FREE_STATES, _GROWTH = 4_000, 1.5
BYTES_A_LABEL = 40.0  # three floats, and three integers of 4 bytes
MOST_LABELS = 1 << 20  # that are kept at once
_MOST_OUTCOMES = 8_000_000  # of links that labels look at, for each unit of effort
_SECONDS_AN_OUTCOME = 1e-7  # on a usual processor
_LOSS = 2e-5  # of all reward: how much stairs are higher, so that labels may be left out
_FINE = 0.02  # ``LabelSearch.fine``, divided by the effort
_MOST_FOUND = 50_000  # trails that a search returns
_MOST_FOUND_ARCS = 1 << 22  # room for the arcs of all these trails
LEVELS = 24  # of probabilities to be alive, or up to twice as many
MOST_LINES = 8  # prices under which a search bounds what lies ahead


class Ahead(NamedTuple):
    """What lies ahead of each state, at most, under some prices.

    The rest of a trail, in a state of the base's piece and alive with probability p, is worth at
    most ``values`` at p plus ``spare``. Between two levels, values lie on chords.
    """

    states: States  # of relaxed trails, as far as they remembered then
    worth: Worth  # the prices
    tables: Tables  # of pieces beyond bridges, which prices of survival share
    values: FloatArray  # of the base's piece (n_states there, n_levels + 1)
    spare: float  # what has to be added to values, for rounding and tolerance
    most: float  # no trail is worth more, with ``spare``
    beside: FloatArray  # by how much at most a search's prices exceed these (n_nodes)


class Relaxation:
    """Relaxed trails of a mission, which learn what to remember: ``n_bits`` at each node at first.

    ``fits`` limits their states, ``n_masks`` the masks of all nodes together (2 ** bits for each
    node), and ``n_labels`` the labels.
    """

    def __init__(
        self,
        net: Net,
        n_bits: int,
        random_state: np.random.Generator,
        deadline: Deadline,
        fits: int,
        n_masks: int,
        n_labels: int,
    ) -> None:
        self.net, self.deadline = net, deadline
        self._n_masks = max(net.graph.n_nodes, min(_MOST_MASKS, n_masks))
        n_nodes = net.graph.n_nodes
        self._most_states = max(n_nodes + 1, min(_MOST_STATES, fits))
        # Whether there was too little memory to learn more.
        self.is_full = False
        self.total = float(net.graph.reward.sum())
        n_room = max(1, min(_MOST_FOUND, _MOST_FOUND_ARCS // max(1, net.graph.n_arcs)))
        # Scratch that no thread uses; more is made when it is needed.
        self._new_depths = partial(
            new_depths, net, random_state, _N_SEEN, n_room, MOST_LINES, 2 * LEVELS
        )
        self._depths = [self._new_depths()]
        self._new_labels = partial(new_labels, max(1, n_labels), self._most_states)
        self._labels: list[Labels] = []
        self._remembered = Remembered(net, n_bits)
        while not self._find_states(min(max(n_nodes + 1, _FIRST_STATES), self._most_states)):
            n_bits -= 1
            self._remembered = Remembered(net, n_bits)

    def _find_states(self, n_most: int) -> bool:
        """Find the states of what is remembered; return whether they are at most ``n_most``."""
        states = find_states(self.net, self._remembered.pack(), n_most, self._n_masks)
        if len(states.node):
            self.states = states
        return len(states.node) > 0

    def look_ahead(self, prices: FloatArray, mus: Sequence[float]) -> list[Ahead]:
        """Bound all trails that leave the base, under prices of visits and each ``mu``."""
        net, states = self.net, self.states
        cap = float(prices[:, -1].sum()) * (1.0 + 1e-12)
        rule = Rule(_TOLERANCE * self.total, cap, _STEEPEST * self.total, _ENOUGH * self.total)
        tables = new_tables(net, states, prices.shape[1] - 1)
        values = np.zeros((len(mus), int(states.begin[1]), prices.shape[1]))
        short = look_ahead(net, states, prices, np.array(mus), rule, tables, values)
        self.deadline.work += _SECONDS_A_VALUE * (values.size + tables.values.size)
        # A step adds some ten roundings, for which 36 leave room. An error in a level counts once
        # for each level, since a price may rise in the last one alone. A trail has at most as many
        # steps as there are arcs, and excursions add one each.
        n_arcs, n_levels, found = net.graph.n_arcs, prices.shape[1] - 1, list[Ahead]()
        room, none = (np.empty(2, np.int64), np.empty(2, np.int64)), np.zeros(net.graph.n_nodes)
        for mu, own in zip(mus, values, strict=True):
            worth = Worth(prices, mu)
            scale = self.total + mu + float(own.max(initial=0.0))
            scale += float(tables.values.max(initial=0.0))
            spare = 2 * n_arcs * (short + (36 + 4 * n_levels) * EPSILON * scale)
            _, best = follow(net, states, worth, tables, own, -1, *room)
            found.append(Ahead(states, worth, tables, own, spare, best + spare, none))
        return found

    def best_trails(self, ahead: Ahead) -> list[RelaxedTrail]:
        """Return the best relaxed trail and similar ones, in which visits worth nothing do not pay.

        Of long ones only the first steps are returned, and some do not come home.
        """
        net, n_levels = self.net, ahead.values.shape[1] - 1
        found: list[RelaxedTrail] = []
        arcs, paid = np.empty(_MOST_TRAIL, np.int64), np.empty(_MOST_TRAIL, np.int64)
        for turn in _TURNS:
            given = net, ahead.states, ahead.worth, ahead.tables, ahead.values
            n, _ = follow(*given, turn, arcs, paid)
            if n > max(turn, 0):
                heads, alive = net.graph.head[arcs[:n]], net.graph.mean_survival[arcs[:n]].cumprod()
                high = np.minimum((alive / net.reach[heads] * n_levels).astype(int) + 1, n_levels)
                is_worth = (paid[:n] > 0) & (ahead.worth.prices[heads, high] > 1e-12)
                found.append(RelaxedTrail(arcs[:n].tolist(), is_worth.tolist()))
        return found

    def search(self, ahead: Ahead, least: float, n_most: int) -> tuple[bool, float, list[int]]:
        """Find the trail that is worth the most, if more than ``least``.

        Returns whether the search has ended, the value that no trail exceeds then, and its arcs.
        """
        stairs = Stairs(np.array([least]), width=np.inf, least=0.0)  # one step, which is raised
        # A bound without prices of survival, and without anything beside prices.
        line = ahead._replace(worth=ahead.worth._replace(mu=0.0))
        rule = TrailRule(every=False, slack=0.0, n_most=n_most)
        ended, arcs, n_arcs = self._search(ahead.worth, [line], stairs, rule)
        last = arcs[-1, : n_arcs[-1]].tolist() if len(arcs) else []
        return ended, float(stairs.heights[0]) + ahead.spare, last

    def raise_stairs(
        self, prices: FloatArray, lines: Sequence[Ahead], stairs: Stairs, n_most: int
    ) -> tuple[bool, list[list[int]]]:
        """Raise stairs above all trails; return whether the search has ended, and trails found."""
        rule = TrailRule(every=False, slack=_SLACK * self.total, n_most=n_most)
        ended, arcs, n_arcs = self._search(Worth(prices, mu=0.0), lines, stairs, rule)
        stairs.heights[:] += max(ahead.spare for ahead in lines)
        return ended, [row[:n].tolist() for row, n in zip(arcs, n_arcs.tolist(), strict=True)]

    def raise_by_labels(
        self, prices: FloatArray, lines: Sequence[Ahead], stairs: Stairs, effort: int
    ) -> bool:
        """Raise stairs above all trails, by labels of relaxed ones; return whether that has ended.

        All lines are under the same prices of visits. Each link that a trail takes loses one
        tolerance at most, when a label is left out in favour of another that is worth less. There
        are at most as many links as arcs, as an excursion is one for two arcs. So half of ``_LOSS``
        is lost at most, and all of it is added. ``spare`` is added twice: for what lies ahead, and
        for labels.
        """
        net, states = self.net, lines[0].states
        with _lent(self._labels, self._new_labels) as labels:
            search = LabelSearch(
                net=net,
                states=states,
                prices=prices,
                ahead=completions(lines),
                stairs=stairs,
                corners=new_corners(len(stairs.heights), len(lines)),
                most=np.empty(len(lines)),
                frontiers=new_frontiers(net, prices.shape[1] - 1),
                labels=labels,
                tolerance=_LOSS * self.total / (2 * net.graph.n_arcs),
                slack=_SLACK * self.total,
                cap=float(prices[:, -1].sum()) * (1.0 + 1e-12),
                fine=_FINE / effort,
                n_most=0,
            )
            ended = self.deadline.run(
                lambda n_most: raise_by_labels(search._replace(n_most=n_most)),
                _MOST_OUTCOMES * effort,
                _SECONDS_AN_OUTCOME,
            )
        stairs.heights[:] += 2 * max(each.spare for each in lines) + _LOSS * self.total
        return ended

    def find_all(
        self, prices: FloatArray, lines: Sequence[Ahead], stairs: Stairs, n_most: int
    ) -> tuple[OffsetArray, OffsetArray] | None:
        """Find all trails above the stairs.

        Returns their arcs (n, n_arcs), and how many they are (n); None where they are too many.
        """
        spare = max(ahead.spare for ahead in lines) + _SLACK * self.total
        lowered = stairs._replace(heights=stairs.heights - spare)
        rule = TrailRule(every=True, slack=0.0, n_most=n_most)
        ended, arcs, n_arcs = self._search(Worth(prices, mu=0.0), lines, lowered, rule)
        return (arcs, n_arcs) if ended else None

    def _search(
        self, worth: Worth, lines: Sequence[Ahead], stairs: Stairs, rule: TrailRule
    ) -> tuple[bool, OffsetArray, OffsetArray]:
        """Search for trails; return whether the search ended, and what it has found.

        These are the arcs of trails (n, n_arcs), and how many they are (n).
        """
        given = self.net, lines[0].states, worth, completions(lines), stairs
        with _lent(self._depths, self._new_depths) as depths:
            ended = self.deadline.run(
                lambda n_most: find_trails(*given, rule._replace(n_most=n_most), depths),
                rule.n_most,
                _SECONDS_A_MOVE,
            )
            n_found = min(int(depths.found.n_trails), len(depths.n_arcs))
            return ended, depths.arcs[:n_found].copy(), depths.n_arcs[:n_found].copy()

    def remember(self, trails: Sequence[RelaxedTrail]) -> bool:
        """Remember what relaxed trails do twice; return whether there was room for more.

        What the first trails do comes first.
        """
        before = self._remembered.bits
        n_most = min(self._most_states, max(_FREE_STATES, int(_GROWTH * len(self.states.node)) + 1))
        twice = [each for trail in trails for each in self._remembered.forgets(trail)]
        while twice:
            if self._remembered.add(twice, _MOST_BITS) and self._find_states(n_most):
                return True
            self._remembered.bits = before
            twice = twice[: len(twice) // 2]
        self.is_full = n_most == self._most_states < _MOST_STATES
        return False

    def allows(self, trail: RelaxedTrail) -> bool:
        """Return whether this is still a relaxed trail, with what is remembered at present."""
        states, pieces, n_arcs = self.states, self.net.pieces, self.net.graph.n_arcs
        state, after = 0, list[int]()
        for arc, pays in zip(*trail, strict=True):
            if pieces.is_back[arc]:
                state = after.pop()
                continue
            into = pieces.into[arc]
            move = arc if into < 0 else n_arcs + pieces.first_option[into]
            first, end = states.first[state : state + 2].tolist()
            found = first + np.flatnonzero(states.move[first:end] == move)
            if len(found) == 0 or (into < 0 and pays and not states.pays[found[0]]):
                return False
            state = int(states.to[found[0]])
            if into >= 0:
                after.append(state)
                state = int(states.begin[into])
        return True


@contextmanager
def _lent(free: list[_Scratch], new: Callable[[], _Scratch]) -> Iterator[_Scratch]:
    """Lend scratch that no other thread uses."""
    try:
        scratch = free.pop()
    except IndexError:
        scratch = new()
    try:
        yield scratch
    finally:
        free.append(scratch)


def completions(lines: Sequence[Ahead]) -> Completions:
    """Return bounds under several prices, all of the same states, as the kernel takes them."""
    unique = {id(ahead.tables): ahead.tables for ahead in lines}
    numbers = {key: number for number, key in enumerate(unique)}
    return Completions(
        np.stack([ahead.values for ahead in lines]),
        np.array([ahead.worth.mu for ahead in lines]),
        np.stack([ahead.beside for ahead in lines]),
        np.array([numbers[id(ahead.tables)] for ahead in lines]),
        *(np.stack(arrays) for arrays in list(zip(*unique.values(), strict=True))[2:]),
    )


def new_tables(net: Net, states: States, n_levels: int) -> Tables:
    """Return empty tables: none for the base's piece, and for dead ends of one node."""
    n_moves = net.graph.n_arcs + len(net.pieces.of_option)
    n_slopes = np.diff(net.pieces.first_option)
    n_slopes[n_slopes == 1] = 0
    n_rows = n_slopes * np.diff(states.begin)
    shape = len(n_slopes), MOST_SLOPES
    first = np.append(0, n_rows.cumsum())[:-1, None]
    return Tables(
        there=np.zeros((n_levels + 1, n_moves)),
        paid=np.zeros((n_levels + 1, n_moves)),
        n_slopes=np.zeros(len(n_slopes), np.int64),
        slope=np.zeros(shape),
        row=first + np.arange(MOST_SLOPES) * np.diff(states.begin)[:, None],
        values=np.zeros((int(n_rows.sum()), n_levels + 1)),
    )
