"""Mutations: small changes to the trails of one plan."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import Field
from pymoo.core.mutation import Mutation

from botohe_moo._base.checks import check_weights
from botohe_moo._base.types import ObjectArray, Rng
from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.types import Count, Probability
from botohe_moo.core.graph import NO_LIMITS
from botohe_moo.core.rng import draw_state
from botohe_moo.core.trails import read_trails
from botohe_moo.mission.model import Mission
from botohe_moo.mission.rules import PlanError
from botohe_moo.operators.base import Mixture, check_part
from botohe_moo.operators.kernels.change import MoveRule, change_plans
from botohe_moo.operators.kernels.vary import join_pieces, ruin, share, whole_trails
from botohe_moo.operators.repair import PlanRepair, SafestPathRepair
from botohe_moo.problem import BOTOHE
from botohe_moo.trails import PlanBatch


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
        return self._mutate(mission, plans, random_state) if len(plans) else plans

    def _mutate(self, mission: Mission, plans: PlanBatch, rng: Rng) -> PlanBatch:
        drafts = self._draft(mission, plans, rng)
        if len(drafts) != len(plans):
            expected = f"_draft of {type(self).__name__} to give {len(plans)} drafts"
            raise ValueError(f"Expected {expected}, got {len(drafts)}.")
        return self.plan_repair.repair_batch(mission, drafts)

    def _draft(self, mission: Mission, plans: PlanBatch, rng: Rng) -> PlanBatch:
        """Return a changed draft of each plan, in their order; its trails may hold any nodes."""
        raise NotImplementedError

    def _do(
        self, problem: BOTOHE, X: ObjectArray, *_: Any, random_state: Rng, **__: Any
    ) -> ObjectArray:
        plans = problem.mission.batch(X)
        return self.mutate_batch(problem.mission, plans, random_state).to_array()


MOVES = ("insert", "delete", "substitute", "swap", "grab", "delete-segment", "reverse")


class TrailMoves(PlanMutation):
    """One of the seven moves of the journal paper's simulated annealing, in one robot's trail.

    ``insert``, ``delete`` or ``substitute`` a node, ``swap`` two, ``grab`` a neighbour's reward and
    come straight back, ``delete-segment``, or ``reverse`` the trail. A move that would use a
    missing arc, an arc twice, or insert the base is drawn again. So valid plans stay valid; others
    are not changed. Where no move can be made, as on missions with one-way arcs, the trail takes a
    detour to another node and back along safest paths.

    Parameters
    ----------
    weights
        How likely each move is drawn, relative to the others: a mapping from names. A move that is
        not named is not drawn. By default ``reverse`` is a tenth as likely as each of the others.
    every_robot
        Whether every robot's trail is changed, rather than that of one drawn at random.
    max_tries
        How often a move is drawn before detours are tried.
    **options
        As for :class:`PlanMutation`: ``prob`` and ``repair``.

    Examples
    --------
    >>> import numpy as np
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.operators import TrailMoves
    >>> toy = load_mission("toy")
    >>> plans = toy.batch([toy.plan([[1, 2, 4, 2, 1], [1]])])
    >>> moves = TrailMoves(weights={"delete": 1})
    >>> toy.labels(moves.mutate_batch(toy, plans, np.random.default_rng(1))[0])
    ((1, 2, 1), (1,))
    """

    @checked
    def __init__(
        self,
        *,
        weights: Mapping[str, float] | None = None,
        every_robot: bool = False,
        max_tries: Count = 100,
        **options: Any,
    ) -> None:
        super().__init__(**options)
        self.every_robot = every_robot
        self.max_tries = max_tries
        given = dict.fromkeys(MOVES, 1.0) | {"reverse": 0.1} if weights is None else weights
        given = check_weights("weights", given, MOVES, needed="move")
        self.weights = np.array([given.get(name, 0.0) for name in MOVES])

    def _draft(self, mission: Mission, plans: PlanBatch, rng: Rng) -> PlanBatch:
        valid = mission.evaluate_drafts(plans)[1] == 0
        movable = plans if valid.all() else plans.take(valid)
        rule = MoveRule(self.weights, self.max_tries, self.every_robot, NO_LIMITS)
        given, states = read_trails(*movable.arrays), draw_state(rng)
        trails = change_plans(mission.arrays, rule, given, plans.n_robots, states)
        moved = PlanBatch._wrap(*trails, plans.n_robots)
        if valid.all():
            return moved
        # Back in the order of the plans.
        order = np.argsort(np.concatenate([np.flatnonzero(valid), np.flatnonzero(~valid)]))
        return PlanBatch.concatenate([moved, plans.take(~valid)]).take(order)


class RuinRecreate(PlanMutation):
    """Cut a segment out of one robot's trail and put in up to a few other nodes instead.

    The robot, both ends of the cut and the number of new nodes are drawn uniformly. There is at
    least one new node where nothing would be cut. The repair joins what is left.

    Parameters
    ----------
    max_via
        The largest number of new nodes.
    **options
        As for :class:`PlanMutation`: ``prob`` and ``repair``.

    Notes
    -----
    Ruin and recreate: Schrimpf, Schneider, Stamm-Wilbrandt and Dueck, "Record breaking
    optimization results using the ruin and recreate principle", Journal of Computational Physics
    159(2), 2000.

    Examples
    --------
    >>> import numpy as np
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.operators import RuinRecreate
    >>> toy = load_mission("toy")
    >>> plans = toy.batch([toy.plan([[1, 2, 4, 2, 1], [1]])])
    >>> toy.labels(RuinRecreate(max_via=1).mutate_batch(toy, plans, np.random.default_rng(1))[0])
    ((1, 2, 4, 5, 4, 2, 1), (1,))
    """

    @checked
    def __init__(self, *, max_via: Annotated[int, Field(ge=0, le=100)] = 2, **options: Any) -> None:
        super().__init__(**options)
        self.max_via = max_via

    def _draft(self, mission: Mission, plans: PlanBatch, rng: Rng) -> PlanBatch:
        pieces = whole_trails(plans.arrays[1])
        via = np.empty((len(plans), self.max_via), np.int32)
        trails, states = read_trails(*plans.arrays), draw_state(rng)
        ruin(trails, plans.n_robots, len(mission.nodes), states, via, pieces)
        nodes = np.concatenate([plans.nodes, via.ravel()])
        return PlanBatch._wrap(*join_pieces(nodes, pieces), plans.n_robots)


class ShareTrails(PlanMutation):
    """Let one robot copy another's trail, or two robots swap the ends of their trails.

    They swap from a node that both visit. Where there is none, they swap from any place, and the
    repair joins the parts. With a single robot nothing changes.

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
        if plans.n_robots == 1:
            return plans
        pieces, counts = whole_trails(plans.arrays[1]), np.zeros(mission.arrays.n_nodes, np.int64)
        trails, states = read_trails(*plans.arrays), draw_state(rng)
        share(trails, plans.n_robots, self.prob_copy, counts, states, pieces)
        return PlanBatch._wrap(*join_pieces(plans.arrays[0], pieces), plans.n_robots)


class MixedMutation(PlanMutation):
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

    def __init__(
        self,
        mutations: Sequence[PlanMutation] | Mapping[PlanMutation, float],
        *,
        prob: Probability = 1.0,
    ) -> None:
        super().__init__(prob=prob)
        self.mixture = Mixture("mutation", PlanMutation, mutations)

    def _mutate(self, mission: Mission, plans: PlanBatch, rng: Rng) -> PlanBatch:
        shares = self.mixture.draw(rng, len(plans))
        changed = [part.mutate_batch(mission, plans.take(chosen), rng) for part, chosen in shares]
        order = np.argsort(np.concatenate([chosen for _, chosen in shares]))
        return PlanBatch.concatenate(changed).take(order)
