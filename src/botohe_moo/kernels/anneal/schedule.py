"""Simulated annealing of one trail plan: moves, evaluation and acceptance in one loop."""

import math

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.compile import kernel
from botohe_moo.kernels.plans.evaluate import either, find_arc
from botohe_moo.kernels.plans.moves import CANNOT, change_trail
from botohe_moo.kernels.rng import uniform

# What is known of the two plans of a search besides their trails, as indices into one array.
REWARD = 0  # E[R] and E[S] of the plan the search is at
SURVIVORS = 1
BEST_REWARD = 2  # and of the best one it has evaluated
BEST_SURVIVORS = 3
BEST_SCORE = 4
TEMPERATURE = 5
N_FIGURES = 6


@kernel
def _walk(
    first: OffsetArray,
    head: IntArray,
    survival: FloatArray,
    nodes: IntArray,
    length: int,
    visited: OffsetArray,
    walk: int,
    met: IntArray,
    reach: FloatArray,
) -> tuple[int, float]:
    """List the nodes of a trail by first visit, and the chance to reach each.

    Gives their number, and the chance to survive.
    """
    alive = 1.0
    visited[nodes[0]] = walk
    met[0], reach[0] = nodes[0], 1.0
    n = 1
    for i in range(1, length):
        alive *= survival[find_arc(first, head, nodes[i - 1], nodes[i])]
        if visited[nodes[i]] != walk:
            visited[nodes[i]] = walk
            met[n], reach[n] = nodes[i], alive
            n += 1
    return n, alive


@kernel
def _precedes(one: IntArray, length: int, other: IntArray, other_length: int) -> bool:
    """Tell whether a trail comes before another in lexicographic order."""
    for i in range(min(length, other_length)):
        if one[i] != other[i]:
            return bool(one[i] < other[i])
    return bool(length < other_length)


@kernel
def _appraise(
    reward: FloatArray,
    nodes: IntArray,
    lengths: OffsetArray,
    met: IntArray,
    n_met: OffsetArray,
    reach: FloatArray,
    alive: FloatArray,
    slots: OffsetArray,
    order: OffsetArray,
    touched: IntArray,
    touched_by: OffsetArray,
    reached: FloatArray,
    number: int,
) -> tuple[float, float]:
    """Give E[R] and E[S] of the plan in ``slots``: the arithmetic, and the bits, of ``evaluate``.

    Its trails have been walked, which is most of the work: those that have not changed are not
    walked again.
    """
    n_robots = slots.shape[0]
    for k in range(n_robots):
        place = k
        slot, length = slots[k], lengths[slots[k], k]
        while place > 0:
            before = order[place - 1]
            if not _precedes(
                nodes[slot, k],
                length,
                nodes[slots[before], before],
                lengths[slots[before], before],
            ):
                break
            order[place] = before
            place -= 1
        order[place] = k
    n = 0
    survivors = 0.0
    for i in range(n_robots):
        k = order[i]
        slot = slots[k]
        for j in range(n_met[slot, k]):
            node = met[slot, k, j]
            if touched_by[node] != number:
                touched_by[node] = number
                reached[node] = reach[slot, k, j]
                touched[n] = node
                n += 1
            else:
                reached[node] = either(reached[node], reach[slot, k, j])
        survivors += alive[slot, k]
    expected_reward = 0.0
    for i in range(n):
        expected_reward += reward[touched[i]] * reached[touched[i]]
    return expected_reward, survivors


@kernel
def _score(
    weight: float, total_reward: float, n_robots: int, reward: float, survivors: float
) -> float:
    return weight * (reward / total_reward) + (1.0 - weight) * (survivors / n_robots)


@kernel
def _dominates(reward: float, survivors: float, other: float, other_survivors: float) -> bool:
    """Tell whether one plan is at least as good as another in both, and better in one."""
    return (reward >= other and survivors > other_survivors) or (
        reward > other and survivors >= other_survivors
    )


@kernel
def _append(
    rows: IntArray,
    size: int,
    row_offsets: OffsetArray,
    row: int,
    nodes: IntArray,
    lengths: OffsetArray,
    slots: OffsetArray,
) -> IntArray:
    """Write the plan in ``slots`` behind others; a larger array takes the place of a full one."""
    n_robots = slots.shape[0]
    needed = size
    for k in range(n_robots):
        needed += lengths[slots[k], k]
    if needed > rows.shape[0]:
        larger = np.empty(2 * needed, np.int32)
        larger[:size] = rows[:size]
        rows = larger
    for k in range(n_robots):
        for i in range(lengths[slots[k], k]):
            rows[size] = nodes[slots[k], k, i]
            size += 1
        row_offsets[row * n_robots + k + 1] = size
    return rows


@kernel
def anneal(
    first: OffsetArray,
    head: IntArray,
    survival: FloatArray,
    reward: FloatArray,
    base: int,
    min_survival: float,
    kinds: FloatArray,
    max_tries: int,
    every_robot: bool,
    total_reward: float,
    weight: float,
    cooling: float,
    return_probability: float,
    n_steps: int,
    record: bool,
    current: IntArray,
    current_lengths: OffsetArray,
    best: IntArray,
    best_lengths: OffsetArray,
    figures: FloatArray,
    states: SeedArray,
) -> tuple[IntArray, OffsetArray, FloatArray]:
    """Anneal one plan for a number of steps, each of which evaluates one plan.

    A step changes the trail of one robot, or each robot's, by one move. The score is
    ``weight · E[R] / total_reward + (1 − weight) · E[S] / n_robots``. A worse plan is accepted with
    probability exp(difference / temperature); when it is rejected, the search goes back to the best
    plan with ``return_probability``. Kirkpatrick, Gelatt and Vecchi, "Optimization by simulated
    annealing", Science 220, 1983.

    Parameters
    ----------
    first, head, survival, reward, base
        The mission's arcs, grouped by tail node, its rewards and its base.
    min_survival
        Survival floor, which every robot of every plan keeps, the first one's included; 0 sets
        none.
    kinds, max_tries
        How likely each kind of move is to be drawn, and how often to draw; see ``change_trail``.
    every_robot
        Whether a step changes every robot's trail.
    total_reward
        Sum of all rewards, or 1 where there is none.
    weight
        The weight on reward, in [0, 1].
    cooling
        The factor by which the temperature falls after each step.
    return_probability
        With what probability a rejected step ends at the best plan.
    n_steps
        How many steps to make.
    record
        Whether to give all evaluated plans that those at hand do not dominate.
    current, current_lengths, best, best_lengths
        The plan the search is at, and the best one it has evaluated: one trail a row
        (n_robots, n_arcs + 1), and the trails' lengths (n_robots); updated.
    figures
        What is known of both (``REWARD`` to ``TEMPERATURE``); updated. ``BEST_SCORE`` may be −inf
        at first, whatever plan ``best`` is: then the best plan is among those evaluated now.
    states
        Random numbers, one state (1, 2), advanced.

    Returns
    -------
    tuple
        Nodes, offsets and objectives of the plans recorded: each plan evaluated, but for those
        that the plan the search was at or its best dominates.
    """
    n_robots, n_nodes, n_arcs = current.shape[0], reward.shape[0], head.shape[0]
    # Each robot has two slots: one holds its trail in the plan the search is at, the other its
    # trail in the plan it tries. To accept is to change slots.
    nodes = np.empty((2, n_robots, n_arcs + 1), np.int32)
    lengths = np.empty((2, n_robots), np.int64)
    met = np.empty((2, n_robots, n_nodes), np.int32)
    n_met = np.empty((2, n_robots), np.int64)
    reach = np.empty((2, n_robots, n_nodes))
    alive = np.empty((2, n_robots))
    here, tried = np.zeros(n_robots, np.int64), np.zeros(n_robots, np.int64)
    spare = np.empty(n_arcs + 1, np.int32)
    used, visited = np.full(n_arcs, -1, np.int64), np.full(n_nodes, -1, np.int64)
    touched_by, reached = np.full(n_nodes, -1, np.int64), np.empty(n_nodes)
    touched, order = np.empty(n_nodes, np.int32), np.empty(n_robots, np.int64)
    rows, row_offsets = np.empty(0, np.int32), np.zeros(n_steps * n_robots + 1, np.int64)
    row_objectives = np.empty((n_steps, 2))
    n_rows = mark = int(row_offsets[0])  # a plain 0 has a type of its own: all would compile twice

    for k in range(n_robots):
        lengths[0, k] = current_lengths[k]
        for i in range(lengths[0, k]):
            nodes[0, k, i] = current[k, i]
        n_met[0, k], alive[0, k] = _walk(
            first, head, survival, nodes[0, k], lengths[0, k], visited, k, met[0, k], reach[0, k]
        )
    walk = n_robots
    score = _score(weight, total_reward, n_robots, figures[REWARD], figures[SURVIVORS])
    for step in range(n_steps):
        low, high = 0, n_robots
        if not every_robot and n_robots > 1:
            low = int(uniform(states, 0) * n_robots)
            high = low + 1
        for k in range(n_robots):
            tried[k] = here[k]
        for k in range(low, high):
            slot = here[k]
            other = 1 - slot
            length = lengths[slot, k]
            for i in range(length):
                nodes[other, k, i] = nodes[slot, k, i]
            changed = change_trail(
                first,
                head,
                survival,
                base,
                min_survival,
                kinds,
                max_tries,
                nodes[other, k],
                length,
                spare,
                used,
                mark,
                states,
                0,
            )
            mark += 1
            if changed == CANNOT:
                continue
            lengths[other, k] = changed
            n_met[other, k], alive[other, k] = _walk(
                first,
                head,
                survival,
                nodes[other, k],
                changed,
                visited,
                walk,
                met[other, k],
                reach[other, k],
            )
            walk += 1
            tried[k] = other
        gained, survivors = _appraise(
            reward,
            nodes,
            lengths,
            met,
            n_met,
            reach,
            alive,
            tried,
            order,
            touched,
            touched_by,
            reached,
            step,
        )
        if record and not (
            _dominates(figures[REWARD], figures[SURVIVORS], gained, survivors)
            or _dominates(figures[BEST_REWARD], figures[BEST_SURVIVORS], gained, survivors)
        ):
            size = row_offsets[n_rows * n_robots]
            rows = _append(rows, size, row_offsets, n_rows, nodes, lengths, tried)
            row_objectives[n_rows, 0], row_objectives[n_rows, 1] = gained, survivors
            n_rows += 1

        new_score = _score(weight, total_reward, n_robots, gained, survivors)
        if new_score > figures[BEST_SCORE]:
            figures[BEST_REWARD], figures[BEST_SURVIVORS] = gained, survivors
            figures[BEST_SCORE] = new_score
            for k in range(n_robots):
                best_lengths[k] = lengths[tried[k], k]
                for i in range(best_lengths[k]):
                    best[k, i] = nodes[tried[k], k, i]
        change = new_score - score
        if change >= 0.0 or uniform(states, 0) < math.exp(change / figures[TEMPERATURE]):
            for k in range(n_robots):
                here[k] = tried[k]
            figures[REWARD], figures[SURVIVORS] = gained, survivors
            score = new_score
        elif return_probability > 0.0 and uniform(states, 0) < return_probability:
            for k in range(n_robots):
                slot = here[k]
                lengths[slot, k] = best_lengths[k]
                for i in range(best_lengths[k]):
                    nodes[slot, k, i] = best[k, i]
                n_met[slot, k], alive[slot, k] = _walk(
                    first,
                    head,
                    survival,
                    nodes[slot, k],
                    best_lengths[k],
                    visited,
                    walk,
                    met[slot, k],
                    reach[slot, k],
                )
                walk += 1
            figures[REWARD], figures[SURVIVORS] = figures[BEST_REWARD], figures[BEST_SURVIVORS]
            score = figures[BEST_SCORE]
        figures[TEMPERATURE] *= cooling

    for k in range(n_robots):
        current_lengths[k] = lengths[here[k], k]
        for i in range(current_lengths[k]):
            current[k, i] = nodes[here[k], k, i]
    size = row_offsets[n_rows * n_robots]
    return rows[:size].copy(), row_offsets[: n_rows * n_robots + 1].copy(), row_objectives[:n_rows]
