"""All trails that some best team may need, by labels: partial trails that leave the base.

A trail matters to a team by the probabilities that its robot reaches each goal (a node with reward,
the base excepted) and that it survives; for a team of one robot by its reward and survival. Team
objectives rise with each of them, so a trail that is at least as good as another in all of them
replaces it in any plan. So does it replace a label all of whose figures, each taken as high as it
can still get, it has: that label is dropped, as one is for which another stands (see
``exact_labels``).

After the last goal that a robot is the first time at, it goes home by the safest way over unused
arcs. So trails end where a label has just reached a goal, and a label goes on only as long as it
may still reach one.
"""

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.compile import kernel
from botohe_moo.kernels.exact.labels import (
    add_label,
    chain_again,
    has,
    is_needless,
    look_ahead,
    look_around,
    put,
)
from botohe_moo.kernels.exact.tables import LABELS, NEXT, SHELF, TRAILS, Here, Labels, Site, Trails
from botohe_moo.kernels.rng import uniform

# What falls short of the survival floor by less, when multiplied in another order, goes on.
_ROUNDING = 1e-12


@kernel
def is_covered(trails: Trails, n_trails: int, reached: FloatArray, survives: float) -> bool:
    """Tell whether a known trail is at least as good in everything.

    Parameters
    ----------
    trails, n_trails
        The trails that are known.
    reached, survives
        What to compare them with.
    """
    for shelf in range((n_trails + SHELF - 1) // SHELF):
        if trails.shelf_survives[shelf] < survives:
            continue
        possible = True
        for column in range(len(reached)):
            if trails.shelf_reached[shelf, column] < reached[column]:
                possible = False
                break
        if not possible:
            continue
        for trail in range(shelf * SHELF, min(n_trails, (shelf + 1) * SHELF)):
            better = trails.survives[trail] >= survives
            for column in range(len(reached)):
                if not better:
                    break
                better = trails.reached[trail, column] >= reached[column]
            if better:
                return True
    return False


@kernel
def add_trail(
    trails: Trails,
    counts: OffsetArray,
    parent: int,
    arc: int,
    reached: FloatArray,
    survives: float,
) -> None:
    """Put a trail into the next row, unless one that is known is at least as good.

    There must be room for it.
    """
    row = counts[TRAILS]
    if is_covered(trails, row, reached, survives):
        return
    counts[TRAILS] += 1
    trails.parent[row], trails.arc[row] = parent, arc
    trails.survives[row], trails.reached[row] = survives, reached
    shelf = row // SHELF
    if row % SHELF == 0:
        trails.shelf_survives[shelf], trails.shelf_reached[shelf] = survives, reached
    trails.shelf_survives[shelf] = max(trails.shelf_survives[shelf], survives)
    for column in range(len(reached)):
        trails.shelf_reached[shelf, column] = max(
            trails.shelf_reached[shelf, column], reached[column]
        )


@kernel
def as_column(site: Site, here: Here, reached: FloatArray) -> None:
    """Write what ``Trails`` keeps of the probabilities to reach each goal."""
    if not site.single:
        here.column[:] = reached
        return
    collected, total = 0.0, 0.0
    for goal in range(len(reached)):
        collected += site.reward[goal] * reached[goal]
        total += site.reward[goal]
    here.column[0] = collected / total if total > 0.0 else 0.0


@kernel
def go_home(
    site: Site, here: Here, trails: Trails, counts: OffsetArray, parent: int, arc: int, alive: float
) -> None:
    """Add the trail that goes home from the label at hand by the safest way."""
    survives = alive * here.reach[site.base]
    if survives < site.least:
        return
    here.prospect[:] = here.reached
    at = site.base
    while here.entry[at] >= 0:
        goal = site.goal[at]
        if goal >= 0 and here.reached[goal] == 0.0:
            here.prospect[goal] = alive * here.reach[at]
        at = site.tail[here.entry[at]]
    as_column(site, here, here.prospect)
    add_trail(trails, counts, parent, arc, here.column, survives)


@kernel
def step(
    site: Site,
    labels: Labels,
    trails: Trails,
    counts: OffsetArray,
    here: Here,
    parent: int,
    arc: int,
) -> None:
    """Go on from a label by one arc; what is worth it becomes a label, a trail, or both."""
    node = site.head[arc]
    alive = labels.alive[parent] * site.survival[arc]
    here.used[:], here.reached[:] = labels.used[parent], labels.reached[parent]
    put(here.used, arc)
    look_around(site, here, node)
    if alive * here.reach[site.base] <= 0.0:  # a dead end, or one to any precision
        return
    goal = site.goal[node]
    fresh = goal >= 0 and here.reached[goal] == 0.0
    if fresh:
        here.reached[goal] = alive
    survives = look_ahead(site, here, alive)
    if is_needless(site, labels, here, node, alive, -1):
        return
    if fresh:
        go_home(site, here, trails, counts, parent, arc, alive)
        look_ahead(site, here, alive)
    if survives <= 0.0 or survives < site.least * (1.0 - _ROUNDING):
        return
    as_column(site, here, here.prospect)
    if not is_covered(trails, counts[TRAILS], here.column, survives):
        add_label(labels, counts, here, parent, arc, node, alive)


@kernel
def begin(site: Site, labels: Labels, counts: OffsetArray, here: Here) -> None:
    """Put the label of a robot that has not left the base into the first row.

    Parameters
    ----------
    site, here
        The mission, and the new scratch for it.
    labels, counts
        Changed in place.
    """
    look_around(site, here, site.base)
    if look_ahead(site, here, 1.0) > 0.0:
        add_label(labels, counts, here, -1, -1, site.base, 1.0)


@kernel
def expand(
    site: Site, labels: Labels, trails: Trails, counts: OffsetArray, here: Here, parent: int
) -> None:
    """Go on from a label by every arc that it can use."""
    node = labels.node[parent]
    for arc in range(site.first[node], site.first[node + 1]):
        if not has(labels.used[parent], arc):
            step(site, labels, trails, counts, here, parent, arc)


@kernel
def grow(
    site: Site, labels: Labels, trails: Trails, counts: OffsetArray, here: Here, n_looks: int
) -> bool:
    """Go on from labels in the order in which they were found.

    Parameters
    ----------
    site
        The mission.
    labels, trails, counts
        What is known; changed in place. ``counts`` has how many there are of each, the next label
        to go on from.
    here
        Scratch.
    n_looks
        How many labels to go on from at most.

    Returns
    -------
    bool
        Whether it ended because there may be no room for what the next label becomes.
    """
    for _ in range(n_looks):
        parent = counts[NEXT]
        if parent == counts[LABELS]:
            return False
        node = labels.node[parent]
        degree = site.first[node + 1] - site.first[node]
        room = min(len(labels.node) - counts[LABELS], len(trails.survives) - counts[TRAILS])
        if room < degree:
            return True
        counts[NEXT] += 1
        here.used[:], here.reached[:] = labels.used[parent], labels.reached[parent]
        alive = labels.alive[parent]
        look_around(site, here, node)
        survives = look_ahead(site, here, alive)
        # What has been found since may stand for it, or be as good as all it can become.
        if is_needless(site, labels, here, node, alive, parent):
            continue
        as_column(site, here, here.prospect)
        if is_covered(trails, counts[TRAILS], here.column, survives):
            continue
        expand(site, labels, trails, counts, here, parent)
    return False


@kernel
def tidy(trails: Trails, counts: OffsetArray) -> None:
    """Sort the trails by descending survival, and drop those that another is as good as.

    Parameters
    ----------
    trails, counts
        Changed in place.
    """
    n = counts[TRAILS]
    parent, arc = trails.parent[:n].copy(), trails.arc[:n].copy()
    survives, reached = trails.survives[:n].copy(), trails.reached[:n].copy()
    total = np.empty(n)
    for trail in range(n):
        total[trail] = reached[trail].sum()
    # Of trails that survive alike, one that another is as good as comes after it.
    order = np.argsort(-total, kind="mergesort")
    order = order[np.argsort(-survives[order], kind="mergesort")]
    counts[TRAILS] = 0
    for trail in order:
        add_trail(trails, counts, parent[trail], arc[trail], reached[trail], survives[trail])


@kernel
def dive(
    site: Site,
    labels: Labels,
    trails: Trails,
    counts: OffsetArray,
    here: Here,
    states: SeedArray,
) -> float:
    """Estimate the number of labels from those that one random descent meets.

    A label has n children that go on, one of which is drawn, and counts for the product of the n
    before it: Knuth, "Estimating the efficiency of backtrack programs", Mathematics of Computation
    29(129), 1975. Without bias for the labels of a search that compares them with those of the same
    descent only; where all are compared there are fewer.

    Parameters
    ----------
    site
        The mission.
    labels, trails, counts
        Labels, of which the first one stays; trails to compare with, which grow in number; and how
        many there are.
    here
        Scratch.
    states
        State of the generator (1, 2).

    Returns
    -------
    float
        The estimate, from as far down as there was room for labels; −1 where there was none for
        trails.
    """
    counts[LABELS] = 1
    chain_again(labels, 1)
    label, weight, total = 0, 1.0, 1.0
    while True:
        node, low = labels.node[label], counts[LABELS]
        degree = site.first[node + 1] - site.first[node]
        if len(trails.survives) - counts[TRAILS] < degree:
            tidy(trails, counts)
        if len(trails.survives) - counts[TRAILS] < degree:
            return -1.0
        if len(labels.node) - low < degree:
            return total
        expand(site, labels, trails, counts, here, label)
        n = counts[LABELS] - low
        if n == 0:
            return total
        weight *= n
        total += weight
        label = low + int(uniform(states, 0) * n)


@kernel
def way_home(site: Site, labels: Labels, here: Here, label: int, arc: int) -> IntArray:
    """Give the nodes of a trail after its last label: where ``arc`` leads, and the way home.

    Parameters
    ----------
    site, labels
        The mission, and the labels.
    here
        Scratch.
    label, arc
        As ``Trails`` knows the trail.
    """
    here.used[:], here.reached[:] = labels.used[label], labels.reached[label]
    put(here.used, arc)
    start = site.head[arc]
    look_around(site, here, start)
    nodes = np.empty(len(site.goal), np.int32)
    n, at = 0, site.base
    while at != start:
        nodes[n] = at
        n += 1
        at = site.tail[here.entry[at]]
    nodes[n] = start
    return nodes[: n + 1][::-1].copy()
