"""Crossovers, mutations and repairs of plans, and operators by name, also of other packages."""

import contextlib
import time
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Generic, TypeVar

import numpy as np
from pydantic import Field
from pymoo.core.crossover import Crossover
from pymoo.core.duplicate import DuplicateElimination
from pymoo.core.mutation import Mutation
from pymoo.core.population import Population
from pymoo.core.repair import Repair
from pymoo.core.sampling import Sampling

from botohe_moo.base.messages import ParameterError, PluginError, nearest_first, quoted
from botohe_moo.base.parameters import (
    Factory,
    Positive,
    Probability,
    check,
    checked,
    signature_parameters,
    takes_any_name,
)
from botohe_moo.base.registry import Registry, is_path, says_it_makes
from botohe_moo.base.types import ObjectArray, OffsetArray, Rng
from botohe_moo.core.rng import draw_state
from botohe_moo.core.threads import in_spans
from botohe_moo.core.world import World
from botohe_moo.mission.model import Mission
from botohe_moo.mission.rules import PlanError
from botohe_moo.operators import kernels as k
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
            trails = k.read_trails(*drafts[begin:end].arrays)
            nodes, offsets, changes = k.repair(world, how, trails)
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

    _how = k.SAFEST_PATH


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

    _how = k.TRUNCATE


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


class Mixture(Generic[Part]):
    """Several operators, one of which is drawn for each plan, pair or sample.

    ``parts`` are operators of the class ``kind``, or a mapping from them to weights above 0.
    Messages call an operator a ``what``.
    """

    def __init__(
        self, what: str, kind: type[Any], parts: Sequence[Part] | Mapping[Part, float]
    ) -> None:
        if isinstance(parts, str) or not isinstance(parts, Iterable):
            expected = f"a sequence of {kind.__name__}s or a mapping from them to weights"
            raise TypeError(f"Expected {expected}, got {parts!r}.")
        self.parts: tuple[Part, ...] = tuple(parts)
        if not self.parts:
            raise ValueError(f"Expected at least one {what}, got none.")
        for part in self.parts:
            if not isinstance(part, kind):
                raise TypeError(f"Expected a {what} to be a {kind.__name__}, got {part!r}.")
        weights = parts.values() if isinstance(parts, Mapping) else [1.0] * len(self.parts)
        name = f"weight of a {what}"
        self.weights = np.array([check(name, weight, Positive) for weight in weights])

    def do(
        self, problem: BOTOHE, X: ObjectArray, *args: Any, random_state: Rng, **options: Any
    ) -> ObjectArray:
        """Change plans, or cross pairs of parents, each by an operator drawn for it."""
        made, places = [], []
        for part, chosen in self.draw(random_state, X.shape[-2]):
            operator: Any = part
            options["random_state"] = random_state
            made.append(operator._do(problem, X[..., chosen, :], *args, **options))
            places.append(chosen)
        return np.concatenate(made, axis=-2)[..., np.argsort(np.concatenate(places)), :]

    def draw(self, rng: Rng, n: int) -> list[tuple[Part, OffsetArray]]:
        """Draw an operator for each of ``n`` plans; return those drawn, with the plans' indices."""
        drawn = rng.choice(len(self.parts), n, p=self.weights / self.weights.sum())
        return [(self.parts[i], np.flatnonzero(drawn == i)) for i in np.unique(drawn)]


class PlanCrossover(Crossover):
    """A pymoo crossover of two trail plans.

    Parameters
    ----------
    prob
        Probability of crossing a pair of parents; otherwise the children are copies of
        their parents.
    n_offsprings
        Children of each pair.
    repair
        Makes valid plans of the children; default: :class:`SafestPathRepair`.

    Examples
    --------
    >>> from botohe_moo import TrailPlan, solve
    >>> from botohe_moo.operators import PlanCrossover
    >>> from botohe_moo.trails import PlanBatch
    >>> class Tandem(PlanCrossover):
    ...     '''Let the first robot do what one parent's does, and the others what the other's do.'''
    ...     def _draft(self, mission, parents, rng):
    ...         half = len(parents) // 2
    ...         pairs = [pair for i in range(half) for pair in ((i, half + i), (half + i, i))]
    ...         drafts = [
    ...             TrailPlan([parents[i].trails[0], *parents[j].trails[1:]]) for i, j in pairs
    ...         ]
    ...         return PlanBatch.from_plans(drafts, mission.robots)
    >>> solve("toy", "nsga2", crossover=Tandem(), pop_size=20, evaluations=200).evaluations
    200
    """

    @checked
    def __init__(
        self,
        *,
        prob: Probability = 0.9,
        n_offsprings: Annotated[int, Field(ge=1, le=2)] = 2,
        repair: PlanRepair | None = None,
    ) -> None:
        super().__init__(2, n_offsprings, prob=prob)
        self.plan_repair = check_part("repair", repair, PlanRepair, SafestPathRepair)

    def _draft(self, mission: Mission, parents: PlanBatch, rng: Rng) -> PlanBatch:
        """Return drafts of both children of each pair, one pair after another.

        ``parents`` are all first parents, then all second ones.
        """
        raise NotImplementedError

    def _do(
        self, problem: BOTOHE, X: ObjectArray, *_: Any, random_state: Rng, **__: Any
    ) -> ObjectArray:
        mission, n_pairs = problem.mission, X.shape[1]
        drafts = self._draft(mission, mission.batch(X), random_state)
        _check_drafts(self, drafts, 2 * n_pairs)
        if self.n_offsprings == 1:
            drafts = drafts[::2]
        children = self.plan_repair.repair_batch(mission, drafts).to_array()
        return children.reshape(n_pairs, self.n_offsprings, 1).swapaxes(0, 1)


class TrailSplice(PlanCrossover):
    """Children in which a trail of one parent continues as a trail of the other.

    Of each parent a trail is drawn among those that leave the base, and a node that both visit. The
    children swap what comes after it. Trails that share no node but the base are swapped whole.

    Examples
    --------
    >>> from botohe_moo import solve
    >>> from botohe_moo.operators import TrailSplice
    >>> crossover = TrailSplice(prob=0.8)
    >>> solve("toy", "nsga2", crossover=crossover, pop_size=20, evaluations=200).evaluations
    200
    """

    def _draft(self, mission: Mission, parents: PlanBatch, rng: Rng) -> PlanBatch:
        world, (nodes, offsets) = mission.world, parents.arrays
        pieces, counts = k.new_pieces(len(offsets) - 1), np.zeros(world.graph.n_nodes, np.int64)
        k.splice(k.read_trails(nodes, offsets), world.team, counts, draw_state(rng), pieces)
        return PlanBatch._wrap(*k.join_pieces(nodes, pieces), mission.robots)


class MixedCrossover(Crossover):
    """One of several crossovers, drawn for each pair.

    Parameters
    ----------
    crossovers
        Crossovers with equal numbers of parents and children, whose own ``prob`` does not matter,
        or a mapping from them to weights above 0.
    prob
        Probability of crossing a pair of parents.

    Examples
    --------
    >>> from botohe_moo import solve
    >>> from botohe_moo.operators import MixedCrossover, TrailSplice, TruncateRepair
    >>> crossover = MixedCrossover({TrailSplice(): 2, TrailSplice(repair=TruncateRepair()): 1})
    >>> solve("toy", "nsga2", crossover=crossover, pop_size=20, evaluations=200).evaluations
    200
    """

    @checked
    def __init__(
        self,
        crossovers: Sequence[Crossover] | Mapping[Crossover, float],
        *,
        prob: Probability = 0.9,
    ) -> None:
        self.mixture = Mixture("crossover", Crossover, crossovers)
        shapes = {(part.n_parents, part.n_offsprings) for part in self.mixture.parts}
        if len(shapes) > 1:
            found = " and ".join(f"{parents} and {born}" for parents, born in sorted(shapes))
            said = f"as many parents and children as each other, got {found}"
            raise ParameterError(f"Expected crossovers that are mixed to have {said}.", "crossover")
        super().__init__(*shapes.pop(), prob=prob)

    def _do(self, *args: Any, **options: Any) -> ObjectArray:
        return self.mixture.do(*args, **options)


class PlanMutation(Mutation):
    """A pymoo mutation of trail plans.

    Parameters
    ----------
    prob
        Probability of changing a plan at all.
    repair
        Makes valid plans of the children; default: :class:`SafestPathRepair`.

    Examples
    --------
    >>> import numpy as np
    >>> from botohe_moo import TrailPlan, load_mission
    >>> from botohe_moo.operators import PlanMutation
    >>> from botohe_moo.trails import PlanBatch
    >>> class Loop(PlanMutation):
    ...     '''Let each robot go where it goes first, and home.'''
    ...     def _draft(self, mission, plans, rng):
    ...         drafts = [TrailPlan([[*trail[:2], trail[-1]] for trail in p.trails]) for p in plans]
    ...         return PlanBatch.from_plans(drafts, mission.robots)
    >>> toy = load_mission("toy")
    >>> plans = toy.batch([toy.plan([[1, 2, 4, 2, 1], [1]])])
    >>> toy.labels(Loop().mutate_batch(toy, plans, np.random.default_rng(1))[0])
    ((1, 2, 1), (1,))
    """

    @checked
    def __init__(self, *, prob: Probability = 1.0, repair: PlanRepair | None = None) -> None:
        # The base class applies prob: to apply it again in _do would mutate at prob².
        super().__init__(prob=prob)
        self.plan_repair = check_part("repair", repair, PlanRepair, SafestPathRepair)

    def mutate_batch(self, mission: Mission, plans: PlanBatch, random_state: Rng) -> PlanBatch:
        """Change every plan of a batch; return a new batch in the same order.

        Parameters
        ----------
        mission, plans
            A mission, and plans for its team, or a PlanError is raised; also for an empty trail.
        random_state
            Where all random numbers come from.
        """
        plans = mission.batch(plans)
        lengths = np.diff(plans.offsets)
        if (lengths < 1).any():
            plan, robot = divmod(int(np.argmin(lengths)), plans.n_robots)
            raise PlanError(f"Plan {plan}, robot {robot}: expected at least one node, got none.")
        if len(plans) == 0:
            return plans
        drafts = self._draft(mission, plans, random_state)
        _check_drafts(self, drafts, len(plans))
        return self.plan_repair.repair_batch(mission, drafts)

    def _draft(self, mission: Mission, plans: PlanBatch, rng: Rng) -> PlanBatch:
        """Return a changed draft of each plan, in their order; its trails may hold any nodes."""
        raise NotImplementedError

    def _do(
        self, problem: BOTOHE, X: ObjectArray, *_: Any, random_state: Rng, **__: Any
    ) -> ObjectArray:
        plans = problem.mission.batch(X)
        return self.mutate_batch(problem.mission, plans, random_state).to_array()


def _check_drafts(operator: object, drafts: PlanBatch, n: int) -> None:
    if len(drafts) != n:
        expected = f"_draft of {type(operator).__name__} to give {n} drafts"
        raise ValueError(f"Expected {expected}, got {len(drafts)}.")


class RuinRecreate(PlanMutation):
    """Cut a segment out of one robot's trail and put in up to a few other nodes instead.

    The robot and the number of new nodes are drawn uniformly. There is at least one new node where
    nothing would be cut. The repair joins what is left. Some changes are small: they cut a short
    segment and put in neighbours. The others may cut any segment and put in any nodes.

    Parameters
    ----------
    max_via
        The largest number of new nodes.
    prob_small
        Probability of a small change: the logarithm of the segment's length is uniform, and an arc
        leads to each new node from the one before. Otherwise both ends of the segment are uniform,
        and so are new nodes.
    **options
        As for :class:`PlanMutation`: ``prob`` and ``repair``.

    Notes
    -----
    Ruin and recreate: Schrimpf, Schneider, Stamm-Wilbrandt and Dueck, "Record breaking
    optimization results using the ruin and recreate principle", Journal of Computational Physics
    159(2), 2000. Small changes are not published. How many there are was chosen by experiment.

    Examples
    --------
    >>> import numpy as np
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.operators import RuinRecreate
    >>> toy = load_mission("toy")
    >>> plans = toy.batch([toy.plan([[1, 2, 4, 2, 1], [1]])])
    >>> toy.labels(RuinRecreate(max_via=1).mutate_batch(toy, plans, np.random.default_rng(5))[0])
    ((1, 2, 4, 2, 1), (1, 3, 1))
    """

    @checked
    def __init__(
        self,
        *,
        max_via: Annotated[int, Field(ge=0, le=100)] = 2,
        prob_small: Probability = 0.5,
        **options: Any,
    ) -> None:
        super().__init__(**options)
        self.max_via = max_via
        self.prob_small = prob_small

    def _draft(self, mission: Mission, plans: PlanBatch, rng: Rng) -> PlanBatch:
        nodes, offsets = plans.arrays
        pieces, via = k.whole_trails(offsets), np.empty((len(plans), self.max_via), np.int32)
        trails, states, world = k.read_trails(nodes, offsets), draw_state(rng), mission.world
        k.ruin(trails, world.team, world.graph, self.prob_small, states, via, pieces)
        drafts = k.join_pieces(np.concatenate([nodes, via.ravel()]), pieces)
        return PlanBatch._wrap(*drafts, plans.n_robots)


class ShareTrails(PlanMutation):
    """Let one robot copy another's trail, or two robots swap the ends of their trails.

    Both are robots of one kind. They swap from a node that both visit. Where there is none, they
    swap from any place, and the repair joins the parts. A robot that is alone of its kind changes
    nothing.

    Parameters
    ----------
    prob_copy
        Probability of copying rather than swapping.
    **options
        As for :class:`PlanMutation`: ``prob`` and ``repair``.

    Examples
    --------
    >>> import numpy as np
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.operators import ShareTrails
    >>> toy = load_mission("toy")
    >>> plans = toy.batch([toy.plan([[1, 2, 4, 2, 1], [1]])])
    >>> toy.labels(ShareTrails(prob_copy=1).mutate_batch(toy, plans, np.random.default_rng(1))[0])
    ((1, 2, 4, 2, 1), (1, 2, 4, 2, 1))
    """

    @checked
    def __init__(self, *, prob_copy: Probability = 0.5, **options: Any) -> None:
        super().__init__(**options)
        self.prob_copy = prob_copy

    def _draft(self, mission: Mission, plans: PlanBatch, rng: Rng) -> PlanBatch:
        nodes, offsets = plans.arrays
        pieces, counts = k.whole_trails(offsets), np.zeros(mission.world.graph.n_nodes, np.int64)
        trails, states = k.read_trails(nodes, offsets), draw_state(rng)
        k.share(trails, mission.world.team, self.prob_copy, counts, states, pieces)
        return PlanBatch._wrap(*k.join_pieces(nodes, pieces), plans.n_robots)


class MixedMutation(Mutation):
    """One of several mutations, drawn for each plan.

    Parameters
    ----------
    mutations
        Mutations, whose own ``prob`` does not matter, or a mapping from them to weights above 0.
    prob
        Probability of changing a plan at all.

    Examples
    --------
    >>> from botohe_moo import solve
    >>> from botohe_moo.operators import MixedMutation, RuinRecreate, ShareTrails
    >>> mutation = MixedMutation({RuinRecreate(): 2, ShareTrails(): 1})
    >>> solve("toy", "nsga2", mutation=mutation, pop_size=20, evaluations=200).evaluations
    200
    """

    @checked
    def __init__(
        self, mutations: Sequence[Mutation] | Mapping[Mutation, float], *, prob: Probability = 1.0
    ) -> None:
        super().__init__(prob=prob)
        self.mixture = Mixture("mutation", Mutation, mutations)

    def _do(self, *args: Any, **options: Any) -> ObjectArray:
        return self.mixture.do(*args, **options)


# The kinds of operators, by the parameters of algorithms that take them.
KINDS: Mapping[str, type] = {
    "sampling": Sampling,
    "crossover": Crossover,
    "mutation": Mutation,
    "repair": Repair,
}
OPERATORS = Registry("botohe_moo.operators", "operator")


def find_operator(kind: str, name: Any) -> Factory:
    """Import what makes an operator of a kind: ``sampling``, ``crossover``, ...

    ``name`` is a registered one or ``module:Class``. A ParameterError says what keeps it from being
    used.
    """
    if not isinstance(name, str) or not (is_path(name) or name in OPERATORS):
        raise _unknown(kind, name)
    if name.startswith("pymoo."):
        raise _fault(kind, name, "pymoo's own operators do not work on trail plans")
    try:
        factory: Factory = OPERATORS.find(name, makes=KINDS[kind])
    except PluginError as error:
        raise _fault(kind, name, str(error)) from error
    if isinstance(factory, type) and not says_it_makes(factory, KINDS[kind]):
        raise _unknown(kind, name, f", which is not derived from pymoo's {KINDS[kind].__name__}")
    return factory


def _unknown(kind: str, name: object, why: str = "") -> ParameterError:
    """Return the error for what is not an operator of a kind; it lists those that are."""
    with warnings.catch_warnings(action="ignore"):
        found = OPERATORS.loaded()
    known = [one for one, factory in found.items() if says_it_makes(factory, KINDS[kind])]
    among = ", ".join(nearest_first(str(name), known))
    return ParameterError(f"Expected {kind} among {among}, got {quoted(name)}{why}.", kind)


def named_operators(parameters: Mapping[str, Any]) -> list[tuple[str, Factory]]:
    """List the path and the factory of each operator that parameters name.

    What is not the name of an operator is left out.
    """
    found: list[tuple[str, Factory]] = []
    for kind in KINDS.keys() & parameters.keys():
        given = parameters[kind]
        names = [given] if isinstance(given, str) else given if isinstance(given, Mapping) else ()
        for name in names:
            with contextlib.suppress(ParameterError):
                factory = find_operator(kind, name)
                path = name if is_path(name) else OPERATORS.entries[name].value
                found.append((path, factory))
    return sorted(found, key=lambda pair: pair[0])


def make_operator(kind: str, name: Any, wanted: type, **offered: Any) -> Any:
    """Make the operator of that name, with those offered parameters that its factory takes.

    A ParameterError is raised if it cannot be made, or is not of the class ``wanted``.
    """
    factory = find_operator(kind, name)
    try:
        made = factory(**_taken_options(factory, offered))
    except (Exception, SystemExit) as error:  # whatever another package's code may raise
        raise _fault(kind, name, f"cannot be made ({type(error).__name__}: {error})") from error
    if not isinstance(made, wanted):
        found = f"expected an object of type {wanted.__name__}, got {type(made).__qualname__}"
        raise _fault(kind, name, found)
    return made


def _fault(kind: str, name: str, found: str) -> ParameterError:
    return ParameterError(f"{kind.capitalize()} {quoted(name)}: {found}.", kind)


def _taken_options(factory: Factory, offered: Mapping[str, Any]) -> dict[str, Any]:
    """Return the offered parameters that a factory's signature names, or all if it takes any.

    Classes that derive from pymoo's only take other parameters under such names: they get ``prob``.
    """
    names = {parameter.name for parameter in signature_parameters(factory)}
    if takes_any_name(factory):
        bases = getattr(factory, "__mro__", ())
        pymoos = bases and not any(base.__module__.startswith("botohe_moo.") for base in bases)
        names |= {"prob"} if pymoos else offered.keys()
    return {name: value for name, value in offered.items() if name in names}
