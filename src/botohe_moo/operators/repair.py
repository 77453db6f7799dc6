"""Valid and distinct plans: repairs of any sequences of nodes, and leaving out duplicates."""

import time
from dataclasses import dataclass
from typing import Any, ClassVar, TypeVar

import numpy as np
from pymoo.core.duplicate import DuplicateElimination
from pymoo.core.population import Population
from pymoo.core.repair import Repair

from botohe_moo.base.types import ObjectArray, OffsetArray
from botohe_moo.core.threads import in_spans
from botohe_moo.core.world import World
from botohe_moo.mission.model import Mission
from botohe_moo.operators.kernels import SAFEST_PATH, TRUNCATE, read_trails, repair
from botohe_moo.problem import BOTOHE
from botohe_moo.trails import PlanBatch

# Trails times arcs: threads take longer to start than they save with less.
_MUCH = 200_000

Part = TypeVar("Part")


def check_part(name: str, part: Part | None, kind: type[Part], default: type[Part]) -> Part:
    """Return a part of an operator, by default a new one; a TypeError if it is of another kind."""
    if part is not None and not isinstance(part, kind):
        raise TypeError(f"Expected {name} to be a {kind.__name__}, got {part!r}.")
    return default() if part is None else part


@dataclass
class RepairCounts:
    """What a repair has done so far.

    pymoo lets a mutation or a crossover change every plan, and then keeps a share ``prob`` of the
    changed ones. Plans that it drops are counted, too.

    Attributes
    ----------
    plans, repaired
        Plans that were looked at, and those that were changed.
    arcs_changed
        Arcs that were added to trails, and hops of drafts that were dropped; 1 for a trail that
        was changed otherwise, such as one node that is not the base.
    seconds
        Time spent.

    Examples
    --------
    >>> from botohe_moo import TrailPlan, load_mission
    >>> from botohe_moo.operators import RepairCounts, SafestPathRepair
    >>> from botohe_moo.trails import PlanBatch
    >>> mission = load_mission("toy")
    >>> drafts = PlanBatch.from_plans([TrailPlan([[0, 1, 4], [0, 1, 0]])], 2)
    >>> repair = SafestPathRepair()
    >>> repaired = repair.repair_batch(mission, drafts)
    >>> repair.counts.plans, repair.counts.repaired, repair.counts.arcs_changed
    (1, 1, 6)
    """

    plans: int = 0
    repaired: int = 0
    arcs_changed: int = 0
    seconds: float = 0.0


class PlanRepair(Repair):
    """A pymoo repair that makes valid closed trails out of any sequences of node indices.

    It draws no random numbers, and a valid plan passes unchanged. Give it to a pymoo algorithm
    (``NSGA2(repair=...)``), which then repairs every plan before it is evaluated, or to this
    package's crossovers and mutations.

    Attributes
    ----------
    counts
        What it has done so far; after a run ``result.algorithm.repair.counts``.

    Examples
    --------
    >>> from botohe_moo.operators import PlanRepair, TruncateRepair
    >>> isinstance(TruncateRepair(), PlanRepair)
    True
    """

    _how: ClassVar[int | None] = None  # one of the kernel's repairs

    def __init__(self) -> None:
        super().__init__()
        self.counts = RepairCounts()
        self.n_threads = 1  # the result does not depend on it

    def repair_batch(self, mission: Mission, drafts: PlanBatch) -> PlanBatch:
        """Repair many plans; return valid ones in the same order.

        Parameters
        ----------
        mission
            Where the trails have to lead.
        drafts
            Plans of any integers, for the mission's team (otherwise a PlanError is raised).
        """
        started = time.perf_counter()
        repaired = drafts = mission.batch(drafts)
        changes = np.zeros(len(drafts.offsets) - 1, np.int64)
        if self._how is not None:
            repaired, changes = self._repaired(mission.world, self._how, drafts)
        per_plan = changes.reshape(len(drafts), drafts.n_robots).sum(axis=1)
        self.counts.plans += len(drafts)
        self.counts.repaired += int(np.count_nonzero(per_plan))
        self.counts.arcs_changed += int(per_plan.sum())
        self.counts.seconds += time.perf_counter() - started
        return repaired

    def _repaired(self, world: World, how: int, drafts: PlanBatch) -> tuple[PlanBatch, OffsetArray]:
        """Return valid plans, and the changes of each trail."""
        is_much = len(drafts.offsets) * world.graph.n_arcs > _MUCH

        def repair_span(_: int, begin: int, end: int) -> tuple[PlanBatch, OffsetArray]:
            trails = read_trails(*drafts[begin:end].arrays)
            nodes, offsets, changes = repair(world, how, trails)
            return PlanBatch._wrap(nodes, offsets, drafts.n_robots), changes

        n_threads = self.n_threads if is_much else 1
        parts, changes = zip(*in_spans(len(drafts), n_threads, repair_span), strict=True)
        return PlanBatch.concatenate(parts), np.concatenate(changes)

    def _do(self, problem: BOTOHE, X: ObjectArray, **_: Any) -> ObjectArray:
        return self.repair_batch(problem.mission, problem.mission.batch(X)).to_array()


class SafestPathRepair(PlanRepair):
    """Bridge every gap by the safest path over arcs that the trail has not used yet.

    Nodes are taken in the order of the draft. A hop along an arc that the trail has used already
    cuts off the loop in between. A node is left out if no unused arcs lead there, or none would
    lead home after the safest path there. At the end the trail takes the safest way home.

    Examples
    --------
    >>> from botohe_moo import BOTOHE, TrailPlan, load_mission
    >>> from botohe_moo.trails import PlanBatch
    >>> from botohe_moo.operators import SafestPathRepair
    >>> mission = load_mission("toy")
    >>> drafts = PlanBatch.from_plans([TrailPlan([[4], [0, 1, 0, 1]])], 2)
    >>> SafestPathRepair().repair_batch(mission, drafts)[0]
    TrailPlan([[0, 1, 3, 4, 3, 1, 0], [0, 1, 0]])
    """

    _how = SAFEST_PATH


class TruncateRepair(PlanRepair):
    """Keep the longest valid prefix of each trail and take the safest way home.

    Valid is what begins at base, takes arcs that there are, each once, and leaves a way home over
    arcs it has not taken.

    Examples
    --------
    >>> from botohe_moo import TrailPlan, load_mission
    >>> from botohe_moo.operators import TruncateRepair
    >>> from botohe_moo.trails import PlanBatch
    >>> mission = load_mission("toy")
    >>> drafts = PlanBatch.from_plans([TrailPlan([[0, 1, 4], [0, 1, 0]])], 2)
    >>> TruncateRepair().repair_batch(mission, drafts)[0]
    TrailPlan([[0, 1, 0], [0, 1, 0]])
    """

    _how = TRUNCATE


class PenaltyOnly(PlanRepair):
    """Leave every plan as it is and let its faults count as constraint violation.

    It shows what repairing brings. The problem has to evaluate plans that are not valid:
    ``BOTOHE(mission, allow_invalid=True)``. The algorithms that
    :func:`~botohe_moo.make_algorithm` makes of pymoo's classes change the problem themselves.

    Examples
    --------
    >>> from botohe_moo import TrailPlan, load_mission
    >>> from botohe_moo.operators import PenaltyOnly
    >>> from botohe_moo.trails import PlanBatch
    >>> mission = load_mission("toy")
    >>> drafts = PlanBatch.from_plans([TrailPlan([[0, 1, 4], [0, 1, 0]])], 2)
    >>> PenaltyOnly().repair_batch(mission, drafts)[0]
    TrailPlan([[0, 1, 4], [0, 1, 0]])
    >>> reward_and_survivors, faults = mission.evaluate_drafts(drafts)
    >>> faults.tolist()
    [2.0]
    """


class PlanDuplicates(DuplicateElimination):
    """Drop plans that have the same multiset of trails as another.

    The order of the robots does not matter. Plans are hashed, which takes linear time; pymoo's own
    elimination compares every pair.

    Examples
    --------
    >>> import numpy as np
    >>> from pymoo.core.population import Population
    >>> from botohe_moo import TrailPlan
    >>> from botohe_moo.operators import PlanDuplicates
    >>> plans = np.empty((2, 1), object)
    >>> plans[:, 0] = TrailPlan([[0, 1, 0], [0]]), TrailPlan([[0], [0, 1, 0]])  # the same robots
    >>> len(PlanDuplicates().do(Population.new("X", plans)))
    1
    """

    def _do(
        self, pop: Population, other: Population | None, is_duplicate: ObjectArray
    ) -> ObjectArray:
        seen = set() if other is None else {individual.X[0] for individual in other}
        for i, individual in enumerate(pop):
            plan = individual.X[0]
            if plan in seen:
                is_duplicate[i] = True
            elif other is None:
                seen.add(plan)
        return is_duplicate
