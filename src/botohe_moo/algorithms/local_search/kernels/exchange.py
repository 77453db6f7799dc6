"""What searches for one mission tell each other: plans new in their fronts, and turns of parents.

Turns are shared: else each search would try every plan as often as one search alone does.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.algorithms.local_search.kernels.plans import NOT_STORED, add_trail, insert
from botohe_moo.algorithms.local_search.kernels.trail_store import (
    TrailStore,
    fits,
    place_of,
    release,
)
from botohe_moo.algorithms.local_search.kernels.workspace import TOLERANCE, Search
from botohe_moo.core.compile import helper, kernel
from botohe_moo.core.graph import Graph
from botohe_moo.core.kinds import has_kinds
from botohe_moo.core.ordered import OrderedFront, best_reward, find_place
from botohe_moo.core.rng import hash_stretch
from botohe_moo.core.sharing import shared


class News(NamedTuple):
    """Plans with their trails, each trail once, and turns of plans that need not be among them."""

    # Of each plan the numbers of its trails (n_plans, n_robots), E[R] and E[S], and its turns as a
    # parent, at least 1: its finder takes the first one, so others count it already (n_plans).
    plan: IntArray
    reward: FloatArray
    survivors: FloatArray
    tried: OffsetArray
    # The arcs of trail t are ``arc[first[t]:first[t + 1]]``; their hash (n_trails).
    first: OffsetArray
    arc: IntArray
    hash: SeedArray
    # E[R] and E[S] of other plans that have been parents (n_parents, 2), and how often (n_parents).
    parent: FloatArray
    turns: OffsetArray


@kernel
def gather_news(search: Search, since: int) -> News:
    """Copy those plans of the front before which ``since`` plans or more had entered.

    Also take away the turns of other plans that have not been told before: ``take_over`` counts
    them again, in all searches.
    """
    search = shared(search)
    store, front, n_robots = search.store, search.front, search.work.parent.shape[0]
    number = np.empty(store.trails.shape[0], np.int64)  # of each trail among those copied
    used = np.empty(store.trails.shape[0], np.int64)  # trails that are copied, in this order
    number[:] = NOT_STORED
    plan = np.empty((front.n.plans, n_robots), np.int32)
    reward, survivors = np.empty(front.n.plans), np.empty(front.n.plans)
    tried = np.empty(front.n.plans, np.int64)
    parent, turns = np.empty((front.n.plans, 2)), np.empty(front.n.plans, np.int64)
    n = n_parents = n_trails = n_arcs = 0
    for at in range(front.n.blocks):
        block = front.directory[at]
        for place in range(front.size[block]):
            found = front.places[block, place]
            untold, front.untold[found.slot] = front.untold[found.slot], 0
            if front.serial[found.slot] < since:
                if untold > 0:
                    parent[n_parents, 0], parent[n_parents, 1] = found.reward, found.survivors
                    turns[n_parents] = untold
                    front.tried[found.slot] -= untold
                    n_parents += 1
                continue
            reward[n], survivors[n] = found.reward, found.survivors
            tried[n] = max(1, front.tried[found.slot])
            for k in range(n_robots):
                trail = np.int64(front.plan[found.slot, k])
                if number[trail] == NOT_STORED:
                    number[trail], used[n_trails] = n_trails, trail
                    n_trails += 1
                    n_arcs += store.trails[trail].n_arcs
                plan[n, k] = number[trail]
            n += 1
    first, arc = np.zeros(n_trails + 1, np.int64), np.empty(n_arcs, np.int32)
    hashes = np.empty(n_trails, np.uint64)
    for t in range(n_trails):
        stored = store.trails[used[t]]
        if stored.hash == 0:
            stored.hash = hash_stretch(store.arc, stored.first_arc, stored.end_arc)
        hashes[t] = stored.hash
        store.told[place_of(store, stored.hash)] = used[t]
        for i in range(stored.n_arcs):
            arc[first[t] + i] = store.arc[stored.first_arc + i]
        first[t + 1] = first[t] + stored.n_arcs
    entered = plan[:n], reward[:n], survivors[:n], tried[:n]
    return News(*entered, first, arc, hashes, parent[:n_parents], turns[:n_parents])


def join_news(parts: Sequence[News]) -> News:
    """Return the news of several searches as one."""
    n_trails = np.cumsum([0, *(len(part.first) - 1 for part in parts)])
    n_arcs = np.cumsum([0, *(len(part.arc) for part in parts)])
    plans = [part.plan + np.int32(n) for part, n in zip(parts, n_trails[:-1], strict=True)]
    firsts = [part.first[:-1] + n for part, n in zip(parts, n_arcs[:-1], strict=True)]
    joined = News._make(map(np.concatenate, zip(*parts, strict=True)))
    first = np.append(np.concatenate(firsts), n_arcs[-1])
    return joined._replace(plan=np.concatenate(plans), first=first)


@kernel
def take_over(search: Search, news: News, begin: int) -> int:
    """Insert plans into the front, from the one with number ``begin`` on; then count turns.

    Returns the number of the first plan for which there was no room, or how many plans there are.
    """
    search, news = shared(search), shared(news)
    graph, store, n_robots = search.graph, search.store, search.work.parent.shape[0]
    number = np.empty(news.first.shape[0] - 1, np.int64)  # of each trail in the store
    number[:] = NOT_STORED
    n = begin
    while n < news.reward.shape[0] and search.front.n.spare > 0 and fits(graph, store, n_robots):
        _insert_plan(search, news, n, number)
        n += 1
    for trail in number:
        if trail != NOT_STORED:
            release(store, trail)
    if n == news.reward.shape[0]:
        _add_turns(search.front, news)
    return n


@helper
def _insert_plan(search: Search, news: News, plan: int, number: OffsetArray) -> None:
    """Insert a plan into the front, unless that has one as good; store its trails if need be."""
    store, front, work = search.store, search.front, search.work
    reward, survivors = news.reward[plan], news.survivors[plan]
    if best_reward(front, survivors * (1.0 - TOLERANCE)) >= reward * (1.0 - TOLERANCE):
        return
    for k in range(work.trails.shape[0]):
        trail = np.int64(news.plan[plan, k])
        if number[trail] == NOT_STORED:
            number[trail] = _hold_trail(search, news, int(trail), k)
        work.trails[k] = number[trail]
    insert(store, front, work.trails, reward, survivors, TOLERANCE)
    at, place = find_place(front, survivors)
    front.tried[front.places[front.directory[at], place].slot] = news.tried[plan]


@helper
def _hold_trail(search: Search, news: News, trail: int, robot: int) -> int:
    """Find a trail in the store, or store it; return its number, of which there is a user more."""
    graph, store, work = search.graph, search.store, search.work
    begin, stop = news.first[trail], news.first[trail + 1]
    place = place_of(store, news.hash[trail])
    told = int(store.told[place])
    if _is_trail(graph, store, told, news, begin, stop):
        store.trails[told].n_users += 1
        return told
    for i in range(begin, stop):
        work.child[i - begin] = news.arc[i]
    added = add_trail(graph, store, work, robot, stop - begin)
    store.told[place] = added
    store.trails[added].hash = news.hash[trail]
    return int(added)


@helper
def _is_trail(
    graph: Graph, store: TrailStore, trail: int, news: News, begin: int, stop: int
) -> bool:
    """Return whether a trail that some plan has consists of these arcs.

    Trails without arcs differ by kind, and are stored anew.
    """
    stored = store.trails[trail]
    if stored.n_users == 0 or stored.n_arcs != stop - begin:
        return False
    if stop == begin and has_kinds(graph.kinds):
        return False
    i = 0
    while i < stored.n_arcs and store.arc[stored.first_arc + i] == news.arc[begin + i]:
        i += 1
    return bool(i == stored.n_arcs)


@helper
def _add_turns(front: OrderedFront, news: News) -> None:
    """Count the turns of those parents that are still in the front."""
    for i in range(news.turns.shape[0]):
        reward, survivors = news.parent[i, 0], news.parent[i, 1]
        at, place = find_place(front, survivors)
        if at < front.n.blocks:
            found = front.places[front.directory[at], place]
            if found.survivors == survivors and found.reward == reward:
                front.tried[found.slot] += news.turns[i]
