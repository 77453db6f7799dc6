"""What studies rest on: the rules for algorithms, in the order in which they are best fixed.

Every public function is a rule. Its docstring says what is promised, and how to keep it.
"""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from typing import Any

import moocore
import networkx as nx
import numpy as np
from pymoo.core.algorithm import Algorithm

from botohe_moo.algorithms.registry import accepted_by
from botohe_moo.base.types import FloatArray
from botohe_moo.mission.generators import drones_and_rovers, random
from botohe_moo.mission.model import Mission
from botohe_moo.problem import BOTOHE
from botohe_moo.testing.rules import Check
from botohe_moo.trails import PlanBatch, TrailPlan


def can_be_made(check: Check) -> None:
    """Each call without arguments makes a new algorithm.

    Let it be called without arguments, and return a new pymoo Algorithm each time.
    """
    one, other = check.make(), check.make()
    assert isinstance(one, Algorithm), f"it gives {type(one).__name__}, not a pymoo Algorithm"
    assert one is not other, "it gives the same object twice"


def runs_end(check: Check) -> None:
    """A run ends when its budget is spent, or before.

    Evaluate plans in every generation, and set `self.termination.force_termination` when done.
    """
    _run(check, BOTOHE(_streets()))


def parameters_stated(check: Check) -> None:
    """The signature states all parameters with their types.

    State each parameter in the signature, by name, with its type and its default.
    """
    untyped = [each.name for each in accepted_by(check.factory) if not each.annotation]
    assert not untyped, f"no type is stated of {', '.join(untyped)}"


def valid_plans(check: Check) -> None:
    """The result holds valid plans, with the objectives that the problem computes for them.

    Put TrailPlans into X, made with the mission's arcs alone, and leave F as it is evaluated.
    """
    for mission in (_streets(), _streets().with_lengths_from_pos()):
        assert _true_run(check, BOTOHE(mission)).plans, "its result holds no plan"


def own_objectives(check: Check) -> None:
    """The run uses the objectives of a subclass of BOTOHE, or refuses that class by name.

    Evaluate by the problem that `setup` is given; if that cannot be, refuse the problem in `setup`,
    and say so: `evaluates_in_kernels = True` in the class.
    """
    if not _is_kernel(check):
        _true_run(check, _Halved(_streets()))


def front_of_all_evaluated(check: Check) -> None:
    """The result is the front of all evaluated plans.

    Keep all non-dominated plans of all generations: ArchiveAlgorithm has an archive.
    """
    mission = _recording_streets()
    found = _run(check, BOTOHE(mission))
    for points in (*found.fronts, np.reshape(mission.seen, (-1, 2))):
        least = points - 1e-12 * (1.0 + np.abs(points))
        as_good = (found.objectives >= least[:, None]).all(axis=2).any(axis=1)
        lost = points[~as_good].tolist()
        assert not lost, f"its result lacks a plan that it found, of E[R] and E[S] {lost[0]}"
    distinct = np.unique(found.objectives, axis=0)
    dominated = distinct[~moocore.is_nondominated(distinct, maximise=True)].tolist()
    assert not dominated, f"its result holds a dominated plan, of E[R] and E[S] {dominated[0]}"


def exact_budget(check: Check) -> None:
    """A run spends its budget exactly, unless it ends by itself.

    Evaluate no more plans than the termination still allows, and as many.
    """
    problem = BOTOHE(_streets())
    for budget in (1, 7, 45, 171):
        spent = _run(check, problem, budget).spent
        said = f"it spent {spent} of {budget} evaluations"
        assert spent <= budget, said
        if spent < budget:
            more = _run(check, problem, 2 * budget).spent
            assert more == spent, f"{said}, {more} of twice as many"


def true_budget(check: Check) -> None:
    """Every evaluated plan counts against the budget.

    Evaluate plans by `self.evaluator.eval(self.problem, population)` alone: it counts them.
    """
    mission = _recording_streets()
    if not _is_kernel(check):  # what happens in kernels cannot be seen
        spent, evaluated = _run(check, BOTOHE(mission)).spent, len(mission.seen)
        assert spent == evaluated, f"it evaluated {evaluated} plans, and counted {spent}"


def same_seed_same_front(check: Check) -> None:
    """The same seed gives the same plans in the same order, whatever ran before.

    Draw all random numbers from `self.random_state`, depend on no time and no order of sets, and
    keep nothing in the class, the module or default arguments.
    """
    one = _run(check, BOTOHE(_streets()), seed=5)
    _run(check, BOTOHE(_one_way()), seed=7)
    other = _run(check, BOTOHE(_streets()), seed=5)
    assert one.outcome == other.outcome, "two runs with the same seed differ"


def other_seed_other_front(check: Check) -> None:
    """Another seed gives other plans, unless the algorithm says that it is deterministic.

    Draw random numbers from `self.random_state`; an algorithm that draws none states so:
    `deterministic = True` in its class.
    """
    runs = [
        [_run(check, BOTOHE(_streets()), budget, seed=seed).outcome for budget in (20, 60, 200)]
        for seed in (1, 2)
    ]
    same, deterministic = runs[0] == runs[1], getattr(check.make(), "deterministic", False)
    said = "the same plans" if same else "other plans, and it says that it is deterministic"
    assert same == deterministic, f"two seeds give {said}"


def resumes_when_pickled(check: Check) -> None:
    """A run that is pickled half-way and resumed gives the same result, bit for bit.

    Hold nothing that cannot be pickled, such as lambdas, generators and open files, and leave
    nothing out that the run needs.
    """
    problem = BOTOHE(_streets())
    same = _run(check, problem, pickled=True).outcome == _run(check, problem).outcome
    assert same, "a run that is pickled and unpickled before each generation differs"


def one_way_mission(check: Check) -> None:
    """Robots collect rewards even if all arcs are one-way.

    Lead trails along the mission's arcs, in their direction, and home over unused ones.
    """
    gained = _true_run(check, BOTOHE(_one_way())).objectives[:, 0].any()
    assert gained, "no robot collects anything where all arcs are one-way"


def one_robot(check: Check) -> None:
    """A team of one robot collects rewards.

    Do not take for granted that there are two robots.
    """
    gained = _true_run(check, BOTOHE(_streets().with_robots(1))).objectives[:, 0].any()
    assert gained, "a single robot collects nothing"


def limits(check: Check) -> None:
    """Plans keep survival floors and travel budgets, even if all robots must stay at base.

    Compare CV first: `result.X` holds feasible plans alone, and is None where there are none.
    """
    mission = _streets().with_lengths_from_pos()
    for floor, budget in ((0.5, None), (1.0, None), (0.0, 0.0), (0.0, 3.0)):
        _true_run(check, BOTOHE(mission, min_survival=floor, max_length=budget))


def kinds(check: Check) -> None:
    """Each kind of robots keeps its start, end and limits, unless `supports` refuses kinds.

    Plan with `problem.world`, in which each kind has nodes of its own, from `team.start` to
    `team.end`; or let `supports(mission)` be `mission.is_plain`.
    """
    mission = drones_and_rovers(drones=2, rovers=1)
    supports = getattr(check.make(), "supports", None)
    if supports is None or supports(mission):
        assert _true_run(check, BOTOHE(mission)).plans, "its result holds no plan for kinds"


def _streets() -> Mission:
    """Make a mission of eight nodes, with arcs there and back, for two robots."""
    return random(nodes=8, arc_probability=0.4, robots=2, seed=3)


def _one_way() -> Mission:
    """Make a mission of six nodes on two rings that share the base; no arc has a reverse."""
    graph: nx.DiGraph[Any] = nx.DiGraph()
    nx.add_cycle(graph, [0, 1, 2, 3], survival=0.9)
    nx.add_cycle(graph, [0, 4, 5], survival=0.8)
    graph.add_edge(2, 4, survival=0.95)
    nx.set_node_attributes(graph, {node: float(node) for node in graph}, "reward")
    return Mission(graph, base=0, robots=2, name="one-way")


class _Recording(Mission):
    """Remembers E[R] and E[S] of all plans that it evaluates."""

    seen: list[list[float]]

    def evaluate(self, plans: Any) -> FloatArray:
        values = super().evaluate(plans)
        self.seen += values.tolist()
        return values


def _recording_streets() -> _Recording:
    plain = _streets()
    mission = _Recording(plain.graph, base=plain.base, robots=plain.robots)
    mission.seen = []
    return mission


class _Halved(BOTOHE):
    """A problem with another objective: half of E[R]."""

    def evaluate_batch(self, batch: PlanBatch) -> FloatArray:
        return super().evaluate_batch(batch) * [0.5, 1.0]


@dataclass
class _Run:
    """What is known of a run that ended."""

    plans: list[TrailPlan]  # of its result
    objectives: FloatArray  # E[R] and E[S] of these as the algorithm says (n, 2)
    fronts: list[FloatArray]  # E[R] and E[S] after each generation
    spent: int  # evaluations, by the algorithm's own count

    @property
    def outcome(self) -> tuple[list[Any], list[Any]]:
        """The trails of all plans, and their objectives."""
        return [plan.trails for plan in self.plans], self.objectives.tolist()


def _run(
    check: Check, problem: BOTOHE, budget: int = 300, *, seed: int = 1, pickled: bool = False
) -> _Run:
    """Run an algorithm until its budget is spent, as pymoo's ``minimize`` does.

    If ``pickled``, each generation is run by what was unpickled.
    """
    algorithm, fronts = check.make(), []
    algorithm.setup(problem, termination=("n_eval", budget), seed=seed)
    while algorithm.has_next():
        if pickled:
            algorithm = pickle.loads(pickle.dumps(algorithm))
        algorithm.next()
        optimum = [] if algorithm.opt is None else [one.F for one in algorithm.opt if one.feas]
        fronts.append(-np.array(optimum, float).reshape(-1, 2))
        assert len(fronts) <= 1_000 + 10 * budget, f"it goes on after {len(fronts):,} generations"
    result = algorithm.result()
    plans = [] if result.X is None else list(np.asarray(result.X, object).ravel())
    for plan in plans:
        assert isinstance(plan, TrailPlan), f"its result holds {plan!r}, which is not a TrailPlan"
    F = np.empty((0, 2)) if result.F is None else -np.atleast_2d(result.F)
    assert len(F) == len(plans), f"its result has {len(plans)} plans, and F of {len(F)}"
    return _Run(plans, F, fronts, algorithm.evaluator.n_eval)


def _true_run(check: Check, problem: BOTOHE) -> _Run:
    """Run, and assert that objectives are those of the problem, and that limits are kept."""
    found = _run(check, problem)
    true = -problem.evaluate_batch(problem.mission.batch(found.plans))
    for claimed, computed in zip(found.objectives.tolist(), true.tolist(), strict=True):
        assert claimed == computed, f"it claims E[R] and E[S] {claimed} of a plan of {computed}"
    problem.check_limits(found.plans)
    return found


def _is_kernel(check: Check) -> bool:
    """Return whether an algorithm says that it evaluates plans in kernels."""
    return getattr(check.make(), "evaluates_in_kernels", False)
