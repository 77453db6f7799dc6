"""Searches, what they have found, and every child that they make, for tests to judge."""

from itertools import pairwise

import numpy as np
import pytest

from botohe_moo import BOTOHE, TrailPlan
from botohe_moo.algorithms import RandomTrailSampling
from botohe_moo.algorithms.local_search.engine import Costs, LocalSearch, LocalSearchSettings
from botohe_moo.algorithms.local_search.kernels import moves, plans, search
from botohe_moo.algorithms.local_search.kernels.state import NEVER
from botohe_moo.core.ordered import best_reward, nearest_place, read_front
from botohe_moo.core.world import CHECKING, find_arc
from botohe_moo.trails import PlanBatch
from tests import twins
from tests.twins import plain_local_search


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
    return RandomTrailSampling().sample_batch(BOTOHE(mission), n, np.random.default_rng(3))


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
    assert work.nodes["marginal"].tolist() == work.alone.tolist()
    n_nodes = found.world.graph.n_nodes
    assert work.alone[:n_nodes] == pytest.approx(found.world.graph.reward, rel=1e-14, abs=0)
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

    ``others`` are the trails of the other robots, ``fixed`` and ``survivors`` their objectives as
    the search adds them; ``gained`` is what the robot gains, −1 where the child does not enter, and
    ``needed`` the E[R] to exceed.
    """

    def __init__(self, found, gained):
        work, graph = found._work, found.world.graph
        draft, self.robot, self.mission = work.draft, int(work.draft.robot), found.mission
        self.limits = found.world.limits
        *self.others, parent = plan_of(found.parts, work.parent).trails
        if self.robot < len(self.others):
            self.others.append(parent)
            parent = self.others.pop(self.robot)
        self.fixed, self.survivors = float(draft.others), float(draft.survivors)
        self.gained, self.parent = gained, parent
        laid = work.steps["arc"][0, : draft.length].tolist()
        middle = work.middle[: draft.n_middle].tolist()
        self.arcs = [*laid[: draft.prefix], *middle, *laid[draft.suffix :]]
        n = moves.write_child(work)
        assert work.child[:n].tolist() == self.arcs
        self.tails = graph.tail[self.arcs].tolist()
        self.trail = (*parent[:1], *graph.head[self.arcs].tolist())
        self.alive = twins.survival_of(self.mission, self.trail)
        least = (draft.survivors + self.alive) * (1 - CHECKING)
        self.needed = best_reward(found._front, least)

    def check(self):
        """Whether it is a trail, another one, and its figures are those of the formulas."""
        mission, n_nodes, trail = self.mission, len(self.mission.nodes), self.trail
        assert (trail[0], trail[-1]) == twins.ends_of(mission, self.robot)
        assert [*trail[:-1]] == self.tails
        assert len(set(self.arcs)) == len(self.arcs)
        assert trail != self.parent
        kinds = list(mission.kind_of)
        kind = kinds.pop(self.robot)
        named = [[node % n_nodes for node in each] for each in [*self.others, trail]]
        before, survivors = twins.evaluate(mission, named[:-1], kinds)
        gains = twins.evaluate(mission, named, [*kinds, kind])[0] - before
        near = {"rel": 1e-12, "abs": 1e-13 * (mission.total_reward + mission.robots)}
        assert (self.fixed, self.survivors) == pytest.approx((before, survivors), **near)
        floor, budget = self.limits.floors[self.robot], self.limits.budgets[self.robot]
        walked = twins.length_of(mission, trail)
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


def watched(mission, start, n_evaluations, *constants, **options):
    """Search in plain Python, with other constants of modules.

    Return the search, every child made on the way, and every plan that entered.
    """
    with plain_local_search() as patch:
        # In plain Python ten thousand fruitless parents would take their time.
        for module, name, value in ((search, "MAX_FRUITLESS", 50), *constants):
            patch.setattr(module, name, value)
        entering, made, evaluate_child = note_entering(patch), [], moves.evaluate_child
        found = started(mission, start, **options)

        def noted(*arguments):
            gained = evaluate_child(*arguments)
            made.append(Child(found, gained))
            return gained

        patch.setattr(moves, "evaluate_child", noted)
        if len(found):
            found.run(n_evaluations)
    return found, made, entering
