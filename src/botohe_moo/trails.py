"""Trail plans as ragged arrays of node indices, independent of any mission."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Self, TypeAlias, overload

import numpy as np
from numpy.typing import ArrayLike

from botohe_moo.base.messages import quoted
from botohe_moo.base.parameters import check
from botohe_moo.base.types import IntArray, ObjectArray, OffsetArray

__all__ = ["PlanBatch", "TrailPlan"]

_MAX_INDEX = np.iinfo(np.int32).max


def _offsets(lengths: ArrayLike) -> OffsetArray:
    """Return where pieces of these lengths begin, and the end of the last one."""
    return np.concatenate([[0], np.cumsum(lengths, dtype=np.int64)])


class TrailPlan:
    """The trails of a team of robots, one per robot, as node indices.

    Immutable, hashable and picklable. Robots are identical, so a plan is a multiset of trails:
    plans that differ only in the order of the robots are equal, while {A, A, B} and {A, B, B}
    are not. A robot that stays at base has the trail ``(base,)``.

    Parameters
    ----------
    trails
        One sequence of node indices (int, at least 0) per robot, each of at least one node; a
        ValueError names the robot of anything else.

    Examples
    --------
    >>> from botohe_moo import TrailPlan
    >>> plan = TrailPlan([[0, 1, 0], [0]])
    >>> plan == TrailPlan([[0], [0, 1, 0]])
    True
    >>> plan.trails
    ((0, 1, 0), (0,))
    """

    # No __len__ and __getitem__: numpy would take a plan for a sequence and unpack it.
    __slots__ = ("_key", "_nodes", "_offsets")

    # In bytes, since most plans are only compared or packed; `nodes` and `offsets` are views.
    _nodes: bytes
    _offsets: bytes
    _key: tuple[bytes, ...] | None

    def __init__(self, trails: Iterable[Sequence[int]]) -> None:
        arrays = [_indices(trail, robot) for robot, trail in enumerate(trails)]
        if not arrays:
            raise ValueError("Expected at least one trail, got none.")
        self._nodes = np.concatenate(arrays).tobytes()
        self._offsets = _offsets([len(array) for array in arrays]).tobytes()
        self._key = None

    @classmethod
    def _wrap(cls, nodes: bytes, offsets: bytes) -> Self:
        """Take the bytes of arrays (int32, int64) that are known to be well-formed."""
        plan = cls.__new__(cls)
        plan._nodes, plan._offsets = nodes, offsets
        plan._key = None
        return plan

    @property
    def nodes(self) -> IntArray:
        """Node indices of all trails, one after another (read-only)."""
        return np.frombuffer(self._nodes, np.int32)

    @property
    def offsets(self) -> OffsetArray:
        """Where each trail begins in ``nodes``, and their length at the end (n_robots + 1)."""
        return np.frombuffer(self._offsets, np.int64)

    @property
    def n_robots(self) -> int:
        """Number of trails."""
        return len(self._offsets) // 8 - 1

    @property
    def trails(self) -> tuple[tuple[int, ...], ...]:
        """The trails as tuples of node indices, robot by robot."""
        flat, cuts = self.nodes.tolist(), self.offsets.tolist()
        return tuple(tuple(flat[i:j]) for i, j in pairwise(cuts))

    def _multiset(self) -> tuple[bytes, ...]:
        if self._key is None:
            cuts = (4 * self.offsets).tolist()
            self._key = tuple(sorted(self._nodes[i:j] for i, j in pairwise(cuts)))
        return self._key

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, TrailPlan):
            return NotImplemented
        return self._multiset() == other._multiset()

    def __hash__(self) -> int:
        return hash(self._multiset())

    def __reduce__(self) -> tuple[object, ...]:
        return type(self)._wrap, (self._nodes, self._offsets)

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        return self

    def __repr__(self) -> str:
        return f"TrailPlan({[list(trail) for trail in self.trails]})"


def _indices(trail: Sequence[int], robot: int) -> IntArray:
    try:
        array = np.asarray(trail)
    except ValueError:  # sequences of several lengths inside the trail
        array = np.empty((0, 0))
    if array.ndim != 1 or array.size == 0:
        raise ValueError(
            f"Robot {robot}: expected a trail, a sequence of node indices, got {trail!r}; "
            "a robot that stays at base has the trail (base,)."
        )
    if array.dtype.kind not in "iu" or array.min() < 0 or array.max() > _MAX_INDEX:
        raise ValueError(f"Robot {robot}: expected node indices (integers from 0), got {trail!r}.")
    return array.astype(np.int32)


class PlanBatch:
    """Many plans of one team size in ragged arrays: ``batch[i]`` is a plan, ``batch[i:j]`` a batch.

    Parameters
    ----------
    nodes
        Node indices of all trails of all plans, one after another (int32). A mission checks them
        when it evaluates the plans.
    offsets
        Where each trail begins in ``nodes``, and their length at the end
        (n_plans · n_robots + 1, int64). A ValueError is raised if both do not fit together.
    n_robots
        Trails per plan.

    Examples
    --------
    >>> from botohe_moo import TrailPlan
    >>> from botohe_moo.trails import PlanBatch
    >>> plans = [TrailPlan([[0, 1, 0], [0]]), TrailPlan([[0], [0]])]
    >>> batch = PlanBatch.from_plans(plans, 2)
    >>> batch
    <PlanBatch of 2 plans, 2 robots, 6 nodes>
    >>> batch[0]
    TrailPlan([[0, 1, 0], [0]])
    >>> batch.nodes, batch.offsets
    (array([0, 1, 0, 0, 0, 0], dtype=int32), array([0, 3, 4, 5, 6]))
    """

    __slots__ = ("_nodes", "_offsets", "n_robots")

    _nodes: IntArray
    _offsets: OffsetArray
    n_robots: int

    def __init__(self, nodes: IntArray, offsets: OffsetArray, n_robots: int) -> None:
        n_robots = check("n_robots", n_robots, int, ge=1)
        nodes = np.asarray(nodes).astype(np.int32, casting="same_kind")
        offsets = np.asarray(offsets).astype(np.int64, casting="same_kind")
        sizes = np.diff(offsets, prepend=0, append=len(nodes))
        if len(offsets) == 0 or sizes[0] != 0 or sizes[-1] != 0 or sizes.min() < 0:
            expected = f"offsets that ascend from 0 to the number of nodes ({len(nodes)})"
            raise ValueError(f"Expected {expected}, got {offsets}.")
        if (len(offsets) - 1) % n_robots:
            expected = f"a multiple of n_robots = {n_robots} trails"
            raise ValueError(f"Expected {expected}, got {len(offsets) - 1}.")
        self._nodes, self._offsets, self.n_robots = nodes, offsets, n_robots

    @classmethod
    def _wrap(cls, nodes: IntArray, offsets: OffsetArray, n_robots: int) -> Self:
        """Wrap arrays that a kernel has made, without checks and copies."""
        batch = cls.__new__(cls)
        batch._nodes, batch._offsets, batch.n_robots = nodes, offsets, n_robots
        return batch

    @property
    def nodes(self) -> IntArray:
        """Node indices of all trails of all plans, one after another (read-only)."""
        view = self._nodes.view()
        view.flags.writeable = False
        return view

    @property
    def offsets(self) -> OffsetArray:
        """Where each trail begins in ``nodes``, and their length at the end (read-only)."""
        view = self._offsets.view()
        view.flags.writeable = False
        return view

    @property
    def arrays(self) -> tuple[IntArray, OffsetArray]:
        """Nodes and offsets as kernels take them, compiled for writable arrays; do not change."""
        return self._nodes, self._offsets

    @classmethod
    def from_plans(cls, plans: Iterable[TrailPlan] | ObjectArray, n_robots: int) -> Self:
        """Pack plans of ``n_robots`` trails, for example ``result.X``, into one batch.

        A TypeError names what is not a TrailPlan, a ValueError a plan of another number of trails.
        """
        n_robots = check("n_robots", n_robots, int, ge=1)
        if isinstance(plans, TrailPlan):
            raise TypeError("Expected a sequence of TrailPlans, got one TrailPlan: put it in [ ].")
        listed = list(plans.ravel()) if isinstance(plans, np.ndarray) else list(plans)
        for i, plan in enumerate(listed):
            if not isinstance(plan, TrailPlan):
                made = "mission.plan(trails) makes one from node labels"
                raise TypeError(f"Plan {i}: expected a TrailPlan, got {quoted(plan)}; {made}.")
            if plan.n_robots != n_robots:
                raise ValueError(f"Plan {i}: expected {n_robots} trails, got {plan.n_robots}.")
        if not listed:
            return cls._wrap(np.empty(0, np.int32), np.zeros(1, np.int64), n_robots)
        # Joined in bytearrays, since kernels are compiled for writable arrays.
        nodes = np.frombuffer(bytearray().join([plan._nodes for plan in listed]), np.int32)
        cuts = np.frombuffer(b"".join([plan._offsets for plan in listed]), np.int64)
        lengths = np.diff(cuts.reshape(-1, n_robots + 1), axis=1)
        return cls._wrap(nodes, _offsets(lengths), n_robots)

    @classmethod
    def concatenate(cls, batches: Sequence[Self]) -> Self:
        """Concatenate at least one batch, all of teams of one size."""
        offsets = _offsets(np.concatenate([np.diff(batch._offsets) for batch in batches]))
        nodes = np.concatenate([batch._nodes for batch in batches])
        return cls._wrap(nodes, offsets, batches[0].n_robots)

    def __len__(self) -> int:
        return (len(self._offsets) - 1) // self.n_robots

    @overload
    def __getitem__(self, index: int) -> TrailPlan: ...
    @overload
    def __getitem__(self, index: slice) -> Self: ...
    def __getitem__(self, index: int | slice) -> TrailPlan | Self:
        if isinstance(index, slice):
            return self.take(np.arange(len(self))[index])
        cut = range(len(self))[index] * self.n_robots
        offsets = self._offsets[cut : cut + self.n_robots + 1]
        nodes = self._nodes[offsets[0] : offsets[-1]]
        return TrailPlan._wrap(nodes.tobytes(), (offsets - offsets[0]).tobytes())

    def take(self, plans: ArrayLike) -> Self:
        """Return some of the plans, by their indices in that order or a mask (n_plans,)."""
        chosen = np.asarray(plans)
        chosen = np.flatnonzero(chosen) if chosen.dtype == bool else chosen.astype(np.int64)
        trails = (chosen[:, np.newaxis] * self.n_robots + np.arange(self.n_robots)).ravel()
        lengths = np.diff(self._offsets)[trails]
        offsets = _offsets(lengths)
        shift = np.repeat(self._offsets[trails] - offsets[:-1], lengths)
        return self._wrap(self._nodes[np.arange(len(shift)) + shift], offsets, self.n_robots)

    def __iter__(self) -> Iterator[TrailPlan]:
        n_plans, n_robots = len(self), self.n_robots
        starts = self._offsets[:-1].reshape(n_plans, n_robots)
        stops = self._offsets[n_robots::n_robots]
        offsets = (np.column_stack([starts, stops]) - starts[:, :1]).tobytes()
        nodes, width = self._nodes.tobytes(), 8 * (n_robots + 1)
        cuts = zip((4 * starts[:, 0]).tolist(), (4 * stops).tolist(), strict=True)
        for i, (start, stop) in enumerate(cuts):
            yield TrailPlan._wrap(nodes[start:stop], offsets[i * width : (i + 1) * width])

    def to_array(self) -> ObjectArray:
        """Unpack into an object array of shape (n_plans, 1), as pymoo holds it in ``X``."""
        array = np.empty((len(self), 1), dtype=object)
        array[:, 0] = list(self)
        return array

    def __repr__(self) -> str:
        return f"<PlanBatch of {len(self)} plans, {self.n_robots} robots, {len(self._nodes)} nodes>"


# A batch, any iterable of plans, or an array such as ``result.X``.
Plans: TypeAlias = PlanBatch | Iterable[TrailPlan] | ObjectArray


def listed_plans(plans: Iterable[TrailPlan] | ObjectArray) -> list[TrailPlan]:
    """List plans to start from: an iterable of them, an array as ``result.X``, or a population."""
    found = plans.get("X") if hasattr(plans, "get") and not isinstance(plans, Mapping) else plans
    if isinstance(found, np.ndarray):
        found = found.ravel()
    listed = list(found) if isinstance(found, Iterable) else [found]
    for plan in listed:
        if not isinstance(plan, TrailPlan):
            raise TypeError(f"Expected sampling to hold TrailPlans, got {plan!r}.")
    return listed
