"""Labels of the search for all trails: what one may still get, and which stand for which.

Label A stands for label B at the same node when A has used no arc that B may still need, reached
every goal at least as probably, and is alive at least as probably. Proof: any way on from B is one
from A, too. A goal that B first reaches on it, with alive(B) · x, A either reaches there, too, with
alive(A) · x, or has reached before, with no less than alive(A); both are no less. Goals that B has
reached before, A has reached at least as probably. And A survives with alive(A) times what the way
on is survived with. What B may still need are the unused arcs that lie between it and the base: an
arc that no unused arcs lead to, or from which none lead home, counts as used.

For one robot the objective is linear in the probabilities, and less is needed for A to stand for
B: its collected reward, less what B could still collect at goals that only A has reached, is at
least that of B.

Labels are compared where they have reached the same goals. For teams hardly any others stand for
each other. A single robot keeps more labels so (half as many again on the art museum), and is done
sooner.
"""

import numpy as np

from botohe_moo._base.types import OffsetArray, SeedArray
from botohe_moo.kernels.compile import inline, kernel
from botohe_moo.kernels.exact.tables import LABELS, Here, Labels, Site


@inline
def has(bits: SeedArray, i: int) -> bool:
    """Tell whether bit ``i`` is set."""
    return bool((bits[i >> 6] >> np.uint64(i & 63)) & np.uint64(1))


@inline
def mixed(i: int) -> np.uint64:
    """Mix a number to 64 bits, as SplitMix64 finishes its numbers."""
    bits = np.uint64(i + 1) * np.uint64(0x9E3779B97F4A7C15)
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return bits ^ (bits >> np.uint64(31))


@inline
def put(bits: SeedArray, i: int) -> None:
    """Set bit ``i``."""
    bits[i >> 6] |= np.uint64(1) << np.uint64(i & 63)


@kernel
def look_around(site: Site, here: Here, node: int) -> None:
    """Find the safest ways from a node over arcs that can be used, and give up arcs of no use.

    Parameters
    ----------
    site
        The mission.
    here
        ``used`` is read and gets the arcs of no use; the rest is written.
    node
        Where the label is.
    """
    n_nodes = len(site.goal)
    here.reach[:], here.settled[:], here.entry[:] = 0.0, 0, -1
    here.reach[node] = 1.0
    while True:
        at, best = -1, 0.0
        for v in range(n_nodes):
            if here.settled[v] == 0 and here.reach[v] > best:
                at, best = v, here.reach[v]
        if at < 0:
            break
        here.settled[at] = 1
        for arc in range(site.first[at], site.first[at + 1]):
            there = site.head[arc]
            alive = best * site.survival[arc]
            if alive > here.reach[there] and here.settled[there] == 0 and not has(here.used, arc):
                here.reach[there], here.entry[there] = alive, arc
    here.homeward[:] = 1
    if not site.balanced:  # otherwise what can be reached leads home
        here.homeward[:] = 0
        here.homeward[site.base] = 1
        grows = True
        while grows:
            grows = False
            for arc in range(len(site.head)):
                tail, leads = site.tail[arc], here.homeward[site.head[arc]] == 1
                if leads and here.homeward[tail] == 0 and not has(here.used, arc):
                    here.homeward[tail] = 1
                    grows = True
    for arc in range(len(site.head)):
        if here.reach[site.tail[arc]] == 0.0 or here.homeward[site.head[arc]] == 0:
            put(here.used, arc)


@kernel
def look_ahead(site: Site, here: Here, alive: float) -> float:
    """Bound what a label may still get, after ``look_around``.

    Parameters
    ----------
    site
        The mission.
    here
        ``prospect`` is written.
    alive
        Probability to have got to where the label is.

    Returns
    -------
    float
        At most with what probability the robot survives if it goes on to a goal that it has not
        reached; −1 where there is none.
    """
    survives = -1.0
    here.prospect[:] = here.reached
    for node in range(len(site.goal)):
        goal = site.goal[node]
        if goal < 0 or here.reached[goal] > 0.0 or here.homeward[node] == 0:
            continue
        reach = alive * here.reach[node]
        if reach > 0.0:
            here.prospect[goal] = reach
            survives = max(survives, reach * site.home[node])
    return survives


@kernel
def stands_for(site: Site, labels: Labels, label: int, here: Here, alive: float) -> bool:
    """Tell whether a label that is known makes the one at hand needless.

    Parameters
    ----------
    site, labels, label
        The label that is known, at the same node.
    here, alive
        The label at hand: ``used``, ``reached``, ``prospect``, and the probability to get there.
    """
    if labels.alive[label] < alive:
        return False
    for word in range(len(here.used)):
        if labels.used[label, word] & ~here.used[word]:
            return False
    if not site.single:
        for goal in range(len(here.reached)):
            if labels.reached[label, goal] < here.reached[goal]:
                return False
        return True
    ahead = 0.0
    for goal in range(len(here.reached)):
        known, own = labels.reached[label, goal], here.reached[goal]
        if known > 0.0 and own == 0.0:
            own = here.prospect[goal]
        ahead += site.reward[goal] * (known - own)
    return ahead >= 0.0


@kernel
def key_of(here: Here, node: int) -> np.uint64:
    """Hash a node and the goals that have been reached.

    Parameters
    ----------
    here, node
        The label at hand.
    """
    key = mixed(node)
    for goal in range(len(here.reached)):
        if here.reached[goal] > 0.0:
            key ^= mixed(-2 - goal)
    return key


@kernel
def is_needless(
    site: Site, labels: Labels, here: Here, node: int, alive: float, itself: int
) -> bool:
    """Tell whether some known label, other than ``itself``, stands for the one at hand."""
    key = key_of(here, node)
    label = labels.last[np.int64(key & np.uint64(len(labels.last) - 1))]
    while label >= 0:
        same = label != itself and labels.key[label] == key and labels.node[label] == node
        if same and stands_for(site, labels, label, here, alive):
            return True
        label = labels.before[label]
    return False


@kernel
def add_label(
    labels: Labels, counts: OffsetArray, here: Here, parent: int, arc: int, node: int, alive: float
) -> None:
    """Put the label at hand into the next row, and into its chain; there must be room for it."""
    row = counts[LABELS]
    counts[LABELS] += 1
    labels.parent[row], labels.arc[row], labels.node[row] = parent, arc, node
    labels.alive[row], labels.reached[row], labels.used[row] = alive, here.reached, here.used
    labels.key[row] = key_of(here, node)
    chain(labels, row)


@kernel
def chain(labels: Labels, row: int) -> None:
    """Put a label at the end of its chain.

    Parameters
    ----------
    labels, row
        Which label; ``before`` and ``last`` are changed.
    """
    place = np.int64(labels.key[row] & np.uint64(len(labels.last) - 1))
    labels.before[row], labels.last[place] = labels.last[place], row


@kernel
def chain_again(labels: Labels, n_labels: int) -> None:
    """Make all chains anew, where there is room for more of them.

    Parameters
    ----------
    labels, n_labels
        Which labels; ``before`` and ``last`` are changed.
    """
    labels.last[:] = -1
    for row in range(n_labels):
        chain(labels, row)
