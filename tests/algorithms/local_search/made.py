"""Searches, what they have found, and every child that they make, for tests to judge."""

from itertools import pairwise

import numpy as np
import pytest

from botohe_moo import TrailPlan
from botohe_moo.algorithms.local_search import engine
from botohe_moo.algorithms.local_search.engine import Costs, LocalSearch, LocalSearchSettings
from botohe_moo.algorithms.local_search.kernels import moves, plans, search, state
from botohe_moo.algorithms.local_search.kernels.state import NEVER
from botohe_moo.core.ordered import best_reward, nearest_place, read_front
from botohe_moo.core.world import CHECKING, find_arc
from botohe_moo.trails import PlanBatch
from tests import twins
from tests.twins import plain_local_search

# In plain Python ten thousand fruitless parents would take their time.
FEW = 50


def unstarted(mission, *, seed=0, min_survival=0.0, max_length=None, **settings):
    """A search that knows no plan."""
    return LocalSearch(
        mission,
        Costs(mission.limited(min_survival, max_length)),
        random_state=np.random.default_rng(seed),
        settings=LocalSearchSettings(**settings),
    )


def started(mission, start=(), **options):
    """A search that has been started with everybody at home, and with given plans."""
    found = unstarted(mission, **options)
    home = mission.stay_home(found.world)
    found.insert(PlanBatch.from_plans([home, *start], mission.robots))
    return found


def random_plans(mission, n):
    """Plans along any arcs of a mission where each has one back: there is no dead end but base."""
    rng, graph, base = np.random.default_rng(3), mission.world.graph, mission.index(mission.base)
    arcs = list(zip(graph.tail.tolist(), graph.head.tolist(), strict=True))
    trails = []
    for _ in range(n * mission.robots):
        trail, unused = [base], {}
        for tail, head in rng.permutation(arcs).tolist():
            unused.setdefault(tail, []).append(head)
        while unused[trail[-1]] and (trail[-1] != base or rng.random() < 0.7):
            trail.append(unused[trail[-1]].pop())
        trails.append(trail)
    plans = [trails[i : i + mission.robots] for i in range(0, len(trails), mission.robots)]
    return mission.batch([TrailPlan(plan) for plan in plans])


def outcome(found):
    """All that a search has found, to the bit, and all that it remembers but for times."""
    batch, objectives, serials = found.plans()
    front = found._front
    return (
        [plan.trails for plan in batch],
        objectives.tolist(),
        serials.tolist(),
        front.slots["tried"][read_front(front)[0]].tolist(),
        found._states.tolist(),
        found._memory[0].item(),
        found.statistics[["tried", "entered"]].to_numpy().tolist(),
    )


def keeps_limits(mission, some, floor, budget):
    """Whether all robots of some plans keep the limits, to rounding."""
    limits = mission.limits(floor, budget).loosened(CHECKING)
    alive, lengths = mission.robot_survival(some), mission.trail_lengths(some)
    return bool((alive >= limits.floors).all() and (lengths <= limits.budgets).all())


def check(found, floor=0.0, budget=None):
    """Whether the front is one, its objectives are exact, and every trail is somebody's.

    And nothing is left of a parent.
    """
    batch, objectives, serials = found.plans()
    mission, front, store = found.mission, found._front, found._store
    assert len(found) == len(batch) == len(serials) == len(set(serials.tolist()))
    assert serials.max(initial=-1) < found.version
    assert np.array_equal(mission.evaluate(batch), objectives)
    assert keeps_limits(mission, batch, floor, budget)
    assert (np.diff(objectives[:, 0]) < 0).all()
    assert (np.diff(objectives[:, 1]) > 0).all()
    users = np.bincount(front.plan[read_front(front)[0]].ravel(), minlength=len(store.trails))
    assert store.trails["n_users"].tolist() == users.tolist()
    spare = store.spare[: store.n.spare].tolist()
    assert sorted([*spare, *np.flatnonzero(users).tolist()]) == list(range(len(users)))
    check_clean(found)


def check_clean(found):
    """Whether the workspace holds nothing of a parent."""
    work = found._work
    assert work.nodes["marginal"].tolist() == found.world.graph.reward.tolist()
    assert (work.nodes["unreached"] == -1.0).all()
    assert (work.nodes["met"] == NEVER).all()
    assert (work.nodes["later"] == 0.0).all()
    assert (work.arcs["position"] == -1).all()


def front_of(objectives, apart=0.0):
    """The non-dominated of some points by descending reward, as far as they are apart in E[S]."""
    kept, most = [], -1.0
    for reward, survivors in sorted(objectives.tolist(), reverse=True):
        if survivors > most * (1 + apart):
            kept.append((reward, survivors))
            most = survivors
    return np.array(kept)


def write_child(found, nodes):
    """Make a trail, in indices of kernels, the child of a workspace; return how many arcs it has.

    There is room for more than is used.
    """
    arcs = [find_arc(found.world.graph, *hop) for hop in pairwise(nodes)]
    found._work.child[: len(arcs)], found._work.child[len(arcs) :] = arcs, -1
    return len(arcs)


def trail_of(parts, trail, robot=0):
    """A stored trail of a robot as indices of kernels."""
    graph, store = parts.world.graph, parts.store
    arcs = store.arc[store.trails[trail].first_arc : store.trails[trail].end_arc]
    return (int(parts.world.team.start[robot]), *graph.head[arcs].tolist())


def plan_of(parts, trails):
    """The plan of stored trails."""
    return TrailPlan([trail_of(parts, trail, robot) for robot, trail in enumerate(trails)])


class Child:
    """What a move has made, and what the search takes it for.

    ``others`` are the trails of the other robots, ``fixed`` their E[R] as the search adds it, and
    ``gained`` is what the robot gains, −1 where the child does not enter; ``needed`` is the E[R] to
    exceed.
    """

    def __init__(self, found, gained):
        front, work, graph = found._front, found._work, found.world.graph
        draft, self.robot, self.mission = work.draft, int(work.draft.robot), found.mission
        self.limits = found.world.limits
        parent = plan_of(found.parts, work.parent).trails
        self.others = [trail for robot, trail in enumerate(parent) if robot != self.robot]
        laid, start = work.steps["arc"].tolist(), parent[self.robot][:1]
        self.parent = (*start, *graph.head[laid[: draft.length]].tolist())
        self.fixed, self.gained = float(draft.others), gained
        self.arcs = [
            *laid[: draft.prefix],
            *work.middle[: draft.n_middle].tolist(),
            *laid[draft.suffix : draft.length],
        ]
        n = moves.write_child(work)
        assert work.child[:n].tolist() == self.arcs
        self.tails, self.heads = graph.tail[self.arcs].tolist(), graph.head[self.arcs].tolist()
        self.trail = (*start, *self.heads)
        self.alive = twins.survival_of(self.mission, self.trail)
        self.needed = best_reward(front, (draft.survivors + self.alive) * (1 - CHECKING))

    def check(self):
        """Whether it is a trail, another one, and its figures are those of the formulas."""
        mission, n_nodes = self.mission, len(self.mission.nodes)
        start, end = twins.ends_of(mission, self.robot)
        assert [start, *self.heads] == [*self.tails, end]
        assert len(set(self.arcs)) == len(self.arcs)
        assert self.trail != self.parent
        others = list(mission.kind_of)
        kind = others.pop(self.robot)
        named = [[node % n_nodes for node in trail] for trail in [*self.others, self.trail]]
        before = twins.evaluate(mission, named[:-1], others)[0]
        gains = twins.evaluate(mission, named, [*others, kind])[0] - before
        near = {"rel": 1e-12, "abs": 1e-13 * (mission.total_reward + mission.robots)}
        assert self.fixed == pytest.approx(before, **near)
        floor, budget = self.limits.floors[self.robot], self.limits.budgets[self.robot]
        walked = twins.length_of(mission, self.trail)
        if self.gained >= 0:
            assert self.gained == pytest.approx(gains, **near)
            assert self.fixed + self.gained > self.needed
            assert self.alive >= floor * (1 - 1e-12)
            assert walked <= budget * (1 + 1e-12)
        elif self.alive >= floor * (1 + 1e-12) and walked <= budget * (1 - 1e-12):
            # There is a plan as good.
            assert self.needed >= (self.fixed + gains) * (1 - 2e-12) - near["abs"]


def note_entering(patch):
    """Return a list of plans that enter a front from now on, with their E[R] and E[S] there."""
    insert_trails, entering = plans.insert_trails, []

    def noted(parts, tolerance):
        entered = insert_trails(parts, tolerance)
        if entered:
            slot = parts.front.order[nearest_place(parts.front, parts.work.memory.newest)]
            objectives = [parts.front.slots[slot].reward, parts.front.slots[slot].survivors]
            entering.append((plan_of(parts, parts.front.plan[slot]), objectives))
        return entered

    patch.setattr(plans, "insert_trails", noted)
    return entering


def watched(mission, start, n_evaluations, *, full_up_to=state.FULL_UP_TO, constants=(), **options):
    """Search in plain Python, with other constants; the search, and every child made on the way."""
    with plain_local_search() as patch:
        for module, name, value in constants:
            patch.setattr(module, name, value)
        for module in (state, engine):
            patch.setattr(module, "FULL_UP_TO", full_up_to)
        patch.setattr(state, "NEAR", 2)
        found, made = started(mission, start, **options), []
        patch.setattr(search, "MAX_FRUITLESS", FEW)
        evaluate_child = moves.evaluate_child

        def noted(*arguments):
            gained = evaluate_child(*arguments)
            made.append(Child(found, gained))
            return gained

        patch.setattr(moves, "evaluate_child", noted)
        if len(found):
            found.run(n_evaluations)
    return found, made
