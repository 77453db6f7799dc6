"""Pareto local search, and islands of it: arrays and kernels, no pymoo."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from botohe_moo.algorithms.local_search.kernels import state
from botohe_moo.algorithms.local_search.kernels.moves import MOVES
from botohe_moo.algorithms.local_search.kernels.recreate import recreate
from botohe_moo.algorithms.local_search.kernels.search import improve, trim
from botohe_moo.algorithms.local_search.kernels.state import FULL_UP_TO, Given, Search, TrailStore
from botohe_moo.base.parameters import Probability, check_weights
from botohe_moo.base.types import FloatArray, IntArray, OffsetArray, RecordArray, SeedArray
from botohe_moo.core import ordered
from botohe_moo.core.compile import own_time, prepare
from botohe_moo.core.rng import draw_state
from botohe_moo.core.threads import apart, mapping
from botohe_moo.core.world import World
from botohe_moo.mission.model import Mission
from botohe_moo.trails import PlanBatch

if TYPE_CHECKING:
    import pandas as pd

# How likely each move is to be drawn, relative, by name.
DEFAULT_MOVES: Mapping[str, float] = {move.name: move.weight for move in MOVES}
RUIN_AND_RECREATE = "ruin-and-recreate"  # its row among the statistics of moves

# The n-th time that a plan is a parent it is ruined and recreated with probability 1 / n², but
# never with less than this.
_P_RECREATE = 0.02
# Nodes times robots: with more, this takes more time than it brings (results/recreate).
_RECREATED_UP_TO = 1_000

# The most that the length of the longest arc costs, and the least budget to divide by.
_MOST_COST, _LEAST_LENGTH = 1e12, 1e-300

# Scenarios that have a table of cheapest paths of their own, beside that by expected survivals.
# Paths by expected survivals alone are poor routes (results/scenarios).
_N_TABLES = 3
_LEAST_SURVIVAL = 1e-30  # by which a closed arc counts there

# How many plans the front has room for at first, and how many plans a parent adds at most.
_FIRST_PLANS, _N_ADDED = 256, state.N_CHILDREN + 1


@dataclass(frozen=True, kw_only=True)
class LocalSearchSettings:
    """What a Pareto local search can be tuned by; :class:`ParetoLocalSearch` documents it."""

    moves: Mapping[str, float] | None = None
    prob_recreate: Probability | None = None
    max_size: Annotated[int, Field(ge=10, le=1_000_000_000)] | None = None
    n_islands: Annotated[int, Field(ge=1, le=1_024)] = 1

    def __post_init__(self) -> None:
        if self.moves is not None:
            check_weights("moves", self.moves, DEFAULT_MOVES, needed="move")


class Costs:
    """What arcs cost, and the cheapest paths: one for all searches of a mission.

    ``priced`` is the ``world`` with lengths in its costs. Paths are found when they are first asked
    for, and again after unpickling.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self.priced, self._per_length = _priced(world)

    @cached_property
    def routes(self) -> state.Routes:
        """All cheapest paths: by expected survivals, and by those of the likeliest scenarios."""
        graph, worlds = self.priced.graph, [self.priced]
        if graph.n_scenarios > 1:
            for scenario in np.argsort(-graph.probability, kind="stable")[:_N_TABLES].tolist():
                survival = np.maximum(graph.survival[scenario], _LEAST_SURVIVAL)
                prices = self._per_length[graph.tail] * graph.length
                worlds.append(self.priced.with_costs(-np.log(survival) + prices))
        return state.find_routes(worlds, self._per_length)

    def __reduce__(self) -> tuple[object, ...]:
        return Costs, (self.world,)


class LocalSearch:
    """A front, and the search that improves it.

    Every robot keeps the limits of the world of ``costs``. The search's own generator takes its
    seed from ``random_state``. ``n_islands`` of the settings is for :class:`Islands`.
    """

    def __init__(
        self,
        mission: Mission,
        costs: Costs,
        *,
        random_state: np.random.Generator,
        settings: LocalSearchSettings | None = None,
    ) -> None:
        self.mission = mission
        self.costs = costs
        settings = settings or LocalSearchSettings()
        self.max_size = settings.max_size
        p_recreate = settings.prob_recreate
        if p_recreate is None:
            size = len(mission.nodes) * mission.robots
            p_recreate = _P_RECREATE if size <= _RECREATED_UP_TO else 0.0
        self._p_recreate = p_recreate if costs.world.graph.n_nodes <= FULL_UP_TO else 0.0
        moves = DEFAULT_MOVES if settings.moves is None else settings.moves
        given = [float(moves.get(move.name, 0.0)) for move in MOVES]
        self._weights: FloatArray = np.cumsum(given)
        self._states: SeedArray = draw_state(random_state)
        # An array, since numpy writes to a copy of a record alone, once it is unpickled.
        self._memory = np.array([(-1.0, 0, 0, state.QUEUE, 0)], state.MEMORY).view(np.recarray)
        self._waiting = np.zeros(state.QUEUE)
        self._tallies: RecordArray = np.zeros(len(MOVES) + 1, state.TALLY).view(np.recarray)
        self._seconds = np.zeros(len(MOVES) + 1)
        self._front = ordered.new_front(_FIRST_PLANS, mission.robots)
        self._store = self._new_store(0, 0, 0)
        self._prepare()

    @property
    def _nothing(self) -> Given:
        plan, nodes = np.empty((0, self.mission.robots), np.int32), np.empty(0, np.int64)
        hashes, offsets = np.empty(0, np.uint64), np.zeros(1, np.int64)
        return Given(plan, nodes, offsets, np.empty((0, 2)), nodes, hashes, nodes)

    def _prepare(self) -> None:
        """Compute what is not pickled: what follows from the mission, and scratch."""
        kept = self._memory, self._waiting, self._states, self._tallies, self._front, self._store
        kept = apart(kept)
        self._memory, self._waiting, self._states, self._tallies, self._front, self._store = kept
        self._work = state.new_workspace(
            self.costs.priced,
            memory=self._memory[0],
            waiting=self._waiting,
            states=self._states,
            weights=self._weights,
            tallies=self._tallies,
        )

    @property
    def world(self) -> World:
        """The mission's world, with the limits that robots keep."""
        return self.costs.world

    @property
    def parts(self) -> Search:
        """What the kernels work with."""
        costs, front = self.costs, self._front
        return Search(costs.priced, costs.routes, self._store, front, self._work, self._p_recreate)

    def let_wait(self, n_plans: int) -> None:
        """Let at most ``n_plans`` wait for ruin and recreate before it is their turn."""
        self._memory[0].most_waiting = n_plans

    def restart(self) -> None:
        """Forget all plans, but not the random numbers."""
        memory = self._memory[0]
        memory.newest, memory.idle, memory.n_waiting = -1.0, 0, 0
        self._front = ordered.new_front(*self._front.plan.shape)
        store = self._store
        self._store = state.new_store(len(store.trails), len(store.arc), len(store.node))

    def change_rewards(self, world: World) -> None:
        """Forget all plans, and go on in a world with other rewards, but the same survivals."""
        costs = Costs(world)
        costs.routes = self.costs.routes
        self.costs = costs
        self.restart()
        self._prepare()

    def insert(self, batch: PlanBatch) -> None:
        """Insert valid plans for the mission's team into the front, unless it dominates them.

        Plans that do not keep the limits are left out.
        """
        plan = np.arange(len(batch) * batch.n_robots, dtype=np.int32).reshape(-1, batch.n_robots)
        nodes, offsets = batch.arrays
        unknown, untried = np.full((len(batch), 2), np.inf), np.zeros(len(batch), np.int64)
        hashes = np.zeros(len(offsets) - 1, np.uint64)
        self.take_over(Given(plan, nodes, offsets, unknown, untried, hashes, offsets[:0]))

    def take_over(self, given: Given) -> None:
        """Insert valid plans, as :meth:`migrants` returns them, unless the front dominates them."""
        given = given._replace(nodes=given.nodes.astype(np.int64), stored=given.offsets[1:].copy())
        self._search(given, len(given.plan))

    def _find_stored(self, given: Given) -> None:
        """Note which of the given trails are stored, and that there is a user more of each."""
        trails = self._store.trails
        known = np.flatnonzero(trails["n_users"])
        known = known[np.argsort(trails["hash"][known])]
        given.stored[:] = state.NOT_STORED
        if len(known) == 0:
            return
        at = np.searchsorted(trails["hash"][known], given.hash)
        found = known[np.minimum(at, len(known) - 1)]
        is_stored = trails["hash"][found] == given.hash
        given.stored[is_stored] = found[is_stored]
        np.add.at(trails["n_users"], found[is_stored], 1)  # some may be given twice

    def run(self, n_evaluations: int) -> int:
        """Search from the plans of the front, which must not be empty.

        Returns how many plans were evaluated: fewer than ``n_evaluations`` where no move makes any
        other plan.
        """
        if self.world.graph.n_arcs == 0 or len(self) == 0:  # the kernels rely on both
            return 0
        return self._search(self._nothing, n_evaluations)

    def _search(self, given: Given, n_evaluations: int) -> int:
        """Insert the given plans, or search on if there are none; return how many there were."""
        n, is_search = 0, len(given.plan) == 0
        while n < n_evaluations:
            if not is_search:
                self._find_stored(given)
            found = self._timed(improve, given, 0 if is_search else n, n_evaluations - n)
            are_waiting = is_search and self.n_waiting >= self._memory[0].most_waiting
            if are_waiting:
                found += self._timed(recreate, n_evaluations - n - found)
            n += found
            if found == 0 and not state.has_room(self.parts):
                self._make_room()
            elif found == 0 and not are_waiting:  # no move makes another plan
                break
        if self.max_size is not None and len(self) > self.max_size:
            trim(self.parts, self.max_size)
        return n

    def _timed(self, kernel: Any, *arguments: Any) -> int:
        """Call a kernel, and divide its time, but for compiling it, among the moves."""
        before, parts = self._tallies["ticks"].copy(), self.parts
        started = own_time()
        found: int = kernel(parts, *arguments)
        seconds = own_time() - started
        ticks = self._tallies["ticks"] - before
        self._seconds += seconds * ticks / max(1, ticks.sum())
        return found

    def prepare(self) -> None:
        """Let another process begin to compile the search, before there are any plans."""
        prepare(improve, self.parts, self._nothing, 0, 0)

    @property
    def move_counts(self) -> dict[str, dict[str, int]]:
        """What each move brought, by name, as :attr:`ParetoLocalSearch.move_counts`."""
        names = [*(move.name for move in MOVES), RUIN_AND_RECREATE]
        rows = self._tallies[["tried", "entered"]].tolist()
        return {
            name: {"tried": tried, "entered": entered}
            for name, (tried, entered) in zip(names, rows, strict=True)
        }

    @property
    def statistics(self) -> pd.DataFrame:
        """The same as a table, with seconds, as :attr:`ParetoLocalSearch.statistics`."""
        import pandas as pd  # here, since importing it takes as long as importing all else

        table = pd.DataFrame.from_dict(self.move_counts, orient="index").rename_axis("move")
        return table.assign(seconds=self._seconds)

    @property
    def n_waiting(self) -> int:
        """How many plans wait for ruin and recreate."""
        return int(self._memory[0].n_waiting)

    def __len__(self) -> int:
        return int(self._front.n.plans)

    @property
    def version(self) -> int:
        """How many plans ever entered the front: changes whenever the front does."""
        return int(self._front.n.entered)

    def objectives(self) -> FloatArray:
        """Return E[R] and E[S] of the front, by descending E[R] (n_plans, 2), without its plans."""
        return ordered.read_front(self._front)[1]

    def plans(self) -> tuple[PlanBatch, FloatArray, OffsetArray]:
        """Return the front by descending E[R].

        Its plans, their E[R] and E[S] (n_plans, 2), and how many plans had entered before each.
        """
        slots, objectives = ordered.read_front(self._front)
        trails = self._front.plan[slots].ravel()
        nodes, offsets = self._read_trails(trails, np.tile(self.world.team.start, len(slots)))
        batch = PlanBatch._wrap(nodes, offsets, self.mission.robots)
        return batch, objectives, self._front.slots["serial"][slots]

    def migrants(self, since: int) -> Given:
        """Return those plans of the front before which ``since`` plans or more had entered.

        Elsewhere they count as tried once, so that they are not recreated there first.
        """
        slots, objectives = ordered.read_front(self._front)
        is_new = self._front.slots["serial"][slots] >= since
        plan = self._front.plan[slots[is_new]]
        trails, places, numbers = np.unique(plan, return_index=True, return_inverse=True)
        starts = self.world.team.start[places % self.mission.robots]
        nodes, offsets = self._read_trails(trails, starts)
        table = numbers.reshape(plan.shape).astype(np.int32)
        hashes = self._store.trails["hash"][trails]
        tried = np.maximum(1, self._front.slots["tried"][slots[is_new]])
        return Given(table, nodes, offsets, objectives[is_new], tried, hashes, offsets[:0])

    def _read_trails(self, trails: IntArray, starts: OffsetArray) -> tuple[IntArray, OffsetArray]:
        """Return the nodes of stored trails, one after another, and their offsets."""
        stored = self._store.trails[trails]
        offsets = np.append(0, np.cumsum(stored["n_arcs"] + 1))
        nodes, is_head = np.empty(offsets[-1], np.int32), np.ones(offsets[-1], bool)
        is_head[offsets[:-1]], nodes[offsets[:-1]] = False, starts
        arcs = self._store.arc[state.ragged(stored["first_arc"], stored["n_arcs"])]
        nodes[is_head] = self.world.graph.head[arcs]
        return nodes, offsets

    def _make_room(self) -> None:
        """Make room for twice as many plans and trails, and drop trails that no plan has."""
        trails = self._store.trails
        used = np.flatnonzero(trails["n_users"])
        n_arcs, n_visits = (int(trails[name][used].sum()) for name in ("n_arcs", "n_visits"))
        n_trails = max(int(used.max(initial=0)) + 1, 2 * len(used))
        store = self._new_store(n_trails, 4 * n_arcs, 4 * n_visits)
        state.copy_trails(self._store, store)
        n_plans = max(len(self._front.slots), 2 * len(self) + _N_ADDED + _FIRST_PLANS)
        self._store, self._front = store, ordered.grow_front(self._front, n_plans)

    def _new_store(self, n_trails: int, n_arcs: int, n_visits: int) -> TrailStore:
        """Return a store with this room, and room for the trails of a few parents' children."""
        graph, n_new = self.world.graph, 2 * max(state.N_TRAILS, self.mission.robots + 1)
        return state.new_store(
            n_trails + 4 * n_new + 1_000,
            n_arcs + n_new * graph.n_arcs,
            n_visits + n_new * len(self.world.team.worth),
        )

    def __getstate__(self) -> dict[str, Any]:
        return {k: value for k, value in vars(self).items() if k != "_work"}

    def __setstate__(self, kept: dict[str, Any]) -> None:
        self.__dict__.update(kept)
        self._prepare()


def _priced(world: World) -> tuple[World, FloatArray]:
    """Return the world with lengths in its costs, and what a unit of length costs in each layer.

    Without travel budgets, costs are dangers: −log of survivals. With one, lengths cost as well, so
    that the cheapest paths compromise between the safest and the shortest ones. The whole budget of
    a kind costs as much as all the danger that its survival floor allows, or as a survival of 1 / e
    without a floor. A budget that is far shorter than the longest arc costs less, so that all costs
    are finite. The second array is by node (n_nodes).
    """
    graph, team, limits = world.graph, world.team, world.limits
    prices = np.zeros(team.n_kinds)
    longest = float(graph.length.max(initial=0.0)) or 1.0
    for robot in np.unique(team.first).tolist():
        floor, budget = float(limits.floors[robot]), float(limits.budgets[robot])
        danger = -math.log(floor) if 0.0 < floor < 1.0 else 1.0
        price = min(danger / max(budget, _LEAST_LENGTH), _MOST_COST / longest)
        prices[team.start[robot] // len(team.reward)] = price
    per_length = np.repeat(prices, len(team.reward))
    if not limits.has_budgets:
        return world, per_length
    return world.with_costs(graph.cost + per_length[graph.tail] * graph.length), per_length


# Islands begin after this many evaluations. Until then, one search alone finds more.
FIRST_ALONE = 20_000
# About how many plans enter the fronts until the islands exchange them. With more, they find much
# twice; with fewer, migration takes longer than it brings. Nor do islands begin before the front
# has as many plans: with `max_size` 10, eight islands found worse fronts than one, in twice the
# time.
N_MIGRANTS = 50
# How many plans of an island wait for ruin and recreate: few, so that none takes much longer than
# the others.
_QUEUE = 8


class Islands:
    """A local search that goes on as ``n_islands`` searches, by ``n_threads``, once that pays.

    The first island holds the front of all after each call; the others take over its migrants when
    they go on. All share one ``Costs``. Results do not depend on ``n_threads``. Other arguments are
    those of :class:`LocalSearch`.
    """

    def __init__(
        self,
        mission: Mission,
        world: World,
        *,
        n_threads: int,
        random_state: np.random.Generator,
        settings: LocalSearchSettings,
    ) -> None:
        self.n_islands = settings.n_islands
        self.n_threads = n_threads
        self._new = partial(
            LocalSearch, mission, Costs(world), random_state=random_state, settings=settings
        )
        self._islands = [self._new()]
        self._n_evaluated = 0
        self._rate = 1.0  # of the last evaluations, the share that has entered a front
        self._migrants: list[Given | None] = [None]  # what each island has still to take over

    @property
    def n_running(self) -> int:
        """How many islands there are by now."""
        return len(self._islands)

    @property
    def first(self) -> LocalSearch:
        """The first island, whose front is that of all."""
        return self._islands[0]

    def run(self, n_evaluations: int) -> int:
        """Search from the plans of the front, which must not be empty.

        Returns how many plans were evaluated: fewer than ``n_evaluations`` where no move makes any
        other plan.
        """
        is_time = self._n_evaluated >= FIRST_ALONE and len(self.first) >= N_MIGRANTS
        if self.n_running < self.n_islands and is_time:
            self._split()
        if self.n_running == 1:
            n = self.first.run(n_evaluations)
        else:
            n = self._run_islands(n_evaluations)
        self._n_evaluated += n
        return n

    def _run_islands(self, n_evaluations: int) -> int:
        """Let all islands search, in rounds, each of which ends with a migration."""
        islands, n_islands, n = self._islands, self.n_running, 0
        with mapping(min(self.n_threads, n_islands)) as map_:
            while n < n_evaluations:
                n_round = min(n_evaluations - n, max(n_islands, int(N_MIGRANTS / self._rate)))
                shares = [(n_round + island) // n_islands for island in range(n_islands)]
                turns = list(zip(islands, self._migrants, shares, strict=True))
                # Islands that recreate plans take longest: they go first, so that no thread is left
                # with one when the others have finished.
                order = np.argsort([-island.n_waiting for island in islands], kind="stable")
                found = map_(_run_island, *zip(*(turns[i] for i in order), strict=True))
                spent, parts = zip(*(found[i] for i in np.argsort(order)), strict=True)
                migrants = _together(parts)
                self._migrants = [migrants] * n_islands
                self._rate = (1 + len(migrants.plan)) / (n_round + 1)
                n += sum(spent)
                if sum(spent) == 0:  # no move makes another plan, on no island
                    break
        _take_over(self.first, self._migrants[0])
        self._migrants[0] = None
        return n

    def _split(self) -> None:
        """Let the one search go on as several, which begin with its front."""
        others = [self._new() for _ in range(self.n_islands - 1)]
        self._islands += others
        for island in self._islands:
            island.let_wait(_QUEUE)
        self._migrants = [None, *[self.first.migrants(0)] * len(others)]

    @property
    def move_counts(self) -> dict[str, dict[str, int]]:
        """What each move brought, on all islands, as :attr:`LocalSearch.move_counts`."""
        counts = [island.move_counts for island in self._islands]
        return {
            move: {name: sum(of[move][name] for of in counts) for name in first}
            for move, first in counts[0].items()
        }

    @property
    def statistics(self) -> pd.DataFrame:
        """What each move brought, on all islands, as :attr:`LocalSearch.statistics`."""
        return sum((island.statistics for island in self._islands[1:]), self.first.statistics)


def _run_island(
    island: LocalSearch, migrants: Given | None, n_evaluations: int
) -> tuple[int, Given]:
    """Let an island take over migrants and search.

    Returns how many plans it evaluated, and its own migrants: the plans that entered meanwhile.
    """
    _take_over(island, migrants)
    known = island.version
    return island.run(n_evaluations), island.migrants(known)


def _take_over(island: LocalSearch, migrants: Given | None) -> None:
    if migrants is not None:
        island.take_over(migrants)


def _together(parts: Sequence[Given]) -> Given:
    """Return the migrants of several islands as one."""
    n_trails = np.cumsum([0, *(len(part.offsets) - 1 for part in parts)])
    plans = [part.plan + np.int32(n) for part, n in zip(parts, n_trails[:-1], strict=True)]
    lengths = np.concatenate([np.diff(part.offsets) for part in parts])
    joined = Given._make(map(np.concatenate, zip(*parts, strict=True)))
    return joined._replace(plan=np.concatenate(plans), offsets=np.append(0, np.cumsum(lengths)))
