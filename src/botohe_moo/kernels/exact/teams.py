"""The Pareto front over all multisets of K trails, by branch and bound.

Robots choose trails one after another, in an order that ascends: each multiset comes up once. What
the others may still add is bounded by the diminishing returns of reward: n further robots add at
most the sum of what each would add alone to the team as it stands, hence no more than n times a
point of the upper concave hull of (reward added, survival) over the trails left to choose from. A
team is given up when the front covers that whole bound. What a trail adds can only shrink deeper
down, so that a trail that has been given up stays so.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.kernels.compile import inline, kernel

DEPTH, FRONT, LOOKS = 0, 1, 2
N_COUNTS = 3
FINISHED, FULL, PAUSED = 0, 1, 2


class Choices(NamedTuple):
    """Trails to choose from, and the team as it stands.

    Attributes
    ----------
    survives, reached
        Of each trail, by descending survival, and the probability to reach each goal
        (n_trails, n_goals).
    slack
        By how much of reward and of survivors a team must be better to count as better (2).
    listed, gain, n_listed, at
        For each robot the trails that it may choose, what each adds to the team before it, how
        many they are, and the position of the one that is chosen or comes next.
    hull_gain, hull_survives, n_hull
        For each robot the upper concave hull of its choices, by ascending gain.
    left
        For each robot the reward of each goal, times the probability that none before it gets
        there.
    figures
        For each robot E[R] and E[S] of those before it.
    """

    survives: FloatArray
    reached: FloatArray
    slack: FloatArray
    listed: OffsetArray
    gain: FloatArray
    n_listed: OffsetArray
    at: OffsetArray
    hull_gain: FloatArray
    hull_survives: FloatArray
    n_hull: OffsetArray
    left: FloatArray
    figures: FloatArray


class Front(NamedTuple):
    """Teams that none is better than, by descending E[R].

    Attributes
    ----------
    reward, survivors
        E[R], without that of the base, and E[S].
    team
        The trails of each (n, n_robots); below 0 in the first column for teams known beforehand.
    """

    reward: FloatArray
    survivors: FloatArray
    team: OffsetArray


def new_choices(
    survives: FloatArray, reached: FloatArray, reward: FloatArray, slack: FloatArray, n_robots: int
) -> Choices:
    """Make room for a search in which no robot has chosen.

    Parameters
    ----------
    survives, reached, slack
        As in :class:`Choices`.
    reward
        Of each goal.
    n_robots
        How many robots choose.
    """
    shape = (n_robots, len(survives))
    left = np.zeros((n_robots, len(reward)))
    left[0] = reward
    return Choices(
        survives=survives,
        reached=reached,
        slack=slack,
        listed=np.zeros(shape, np.int64),
        gain=np.zeros(shape),
        n_listed=np.zeros(n_robots, np.int64),
        at=np.zeros(n_robots, np.int64),
        hull_gain=np.zeros(shape),
        hull_survives=np.zeros(shape),
        n_hull=np.zeros(n_robots, np.int64),
        left=left,
        figures=np.zeros((n_robots, 2)),
    )


def new_front(n: int, n_robots: int) -> Front:
    """Make room for a front.

    Parameters
    ----------
    n
        For how many teams.
    n_robots
        How many robots each has.
    """
    return Front(np.zeros(n), np.zeros(n), np.zeros((n, n_robots), np.int64))


@inline
def _covering(front: Front, n_front: int, reward: float) -> int:
    """Count the teams of the front with at least that reward."""
    low, high = 0, n_front
    while low < high:
        middle = (low + high) // 2
        if front.reward[middle] >= reward:
            low = middle + 1
        else:
            high = middle
    return low


@kernel
def is_covered(front: Front, n_front: int, reward: float, survivors: float) -> bool:
    """Tell whether a team of the front is at least as good.

    Parameters
    ----------
    front, n_front
        The front.
    reward, survivors
        What to compare it with.
    """
    n = _covering(front, n_front, reward)
    return n > 0 and front.survivors[n - 1] >= survivors


@kernel
def insert(
    front: Front, counts: OffsetArray, reward: float, survivors: float, team: OffsetArray
) -> None:
    """Take a team that is not covered into the front, and those out that it is as good as.

    There must be room for it.
    """
    n = counts[FRONT]
    start = 0
    while start < n and front.reward[start] > reward:
        start += 1
    stop = start
    while stop < n and front.survivors[stop] <= survivors:
        stop += 1
    shift = start + 1 - stop
    if shift > 0:
        for i in range(n - 1, stop - 1, -1):
            front.reward[i + 1], front.survivors[i + 1] = front.reward[i], front.survivors[i]
            front.team[i + 1] = front.team[i]
    elif shift < 0:
        for i in range(stop, n):
            front.reward[i + shift] = front.reward[i]
            front.survivors[i + shift] = front.survivors[i]
            front.team[i + shift] = front.team[i]
    front.reward[start], front.survivors[start], front.team[start] = reward, survivors, team
    counts[FRONT] = n + shift


@kernel
def make_hull(choices: Choices, robot: int) -> None:
    """Find the upper concave hull of a robot's choices, which come by descending survival."""
    xs, ys = choices.hull_gain[robot], choices.hull_survives[robot]
    n = 0
    for i in range(choices.n_listed[robot]):
        x, y = choices.gain[robot, i], choices.survives[choices.listed[robot, i]]
        if n > 0 and x <= xs[n - 1]:
            continue
        while n > 0 and ys[n - 1] <= y:
            n -= 1
        while n > 1 and (ys[n - 2] - ys[n - 1]) * (x - xs[n - 1]) >= (ys[n - 1] - y) * (
            xs[n - 1] - xs[n - 2]
        ):
            n -= 1
        xs[n], ys[n] = x, y
        n += 1
    choices.n_hull[robot] = n


@kernel
def is_hopeful(
    choices: Choices,
    front: Front,
    n_front: int,
    robot: int,
    n_more: int,
    reward: float,
    survivors: float,
) -> bool:
    """Tell whether a team may get beyond the front with more robots.

    Parameters
    ----------
    choices, front, n_front
        The hulls, and the front.
    robot, n_more
        Whose hull to take, and how many robots choose from it.
    reward, survivors
        E[R] and E[S] of the team without them.
    """
    reward -= choices.slack[0]
    survivors -= choices.slack[1]
    if n_more == 0:
        return not is_covered(front, n_front, reward, survivors)
    xs, ys, last = choices.hull_gain[robot], choices.hull_survives[robot], choices.n_hull[robot] - 1
    most_reward, most_survivors = reward + n_more * xs[last], survivors + n_more * ys[0]
    start = _covering(front, n_front, most_reward)
    if start == 0 or most_survivors > front.survivors[n_front - 1]:
        return True
    # The front is a staircase: the bound gets beyond it where it gets beyond an inner corner.
    for i in range(start - 1, n_front - 1):
        if front.survivors[i] >= most_survivors:
            return False
        each = (front.reward[i + 1] - reward) / n_more
        while last > 0 and xs[last - 1] >= each:
            last -= 1
        if last == 0 and each <= xs[0]:
            return True
        share = (xs[last] - each) / (xs[last] - xs[last - 1])
        there = ys[last] + share * (ys[last - 1] - ys[last])
        if survivors + n_more * there > front.survivors[i]:
            return True
    return False


@kernel
def list_choices(choices: Choices, front: Front, n_front: int, robot: int) -> None:
    """List the trails that a robot may choose, given those before it.

    Parameters
    ----------
    choices
        Changed in place, for ``robot`` only.
    front, n_front
        The front.
    robot
        Which robot.
    """
    n_robots = len(choices.at)
    start, stop = 0, len(choices.survives)
    if robot > 0:
        start, stop = choices.at[robot - 1], choices.n_listed[robot - 1]
    n = 0
    for i in range(start, stop):
        trail = i if robot == 0 else choices.listed[robot - 1, i]
        gain = 0.0
        for goal in range(choices.left.shape[1]):
            gain += choices.left[robot, goal] * choices.reached[trail, goal]
        choices.listed[robot, n], choices.gain[robot, n] = trail, gain
        n += 1
    choices.n_listed[robot], choices.at[robot] = n, 0
    n_more = n_robots - robot - 1
    if n_more > 0:
        make_hull(choices, robot)
    n_kept = 0
    reward, survivors = choices.figures[robot]
    for i in range(n):
        trail, gain = choices.listed[robot, i], choices.gain[robot, i]
        alive = survivors + choices.survives[trail]
        if is_hopeful(choices, front, n_front, robot, n_more, reward + gain, alive):
            choices.listed[robot, n_kept], choices.gain[robot, n_kept] = trail, gain
            n_kept += 1
    choices.n_listed[robot] = n_kept


@kernel
def choose_teams(choices: Choices, front: Front, counts: OffsetArray, n_looks: int) -> int:
    """Go on with the search for teams.

    Parameters
    ----------
    choices, front, counts
        Its state; changed in place. ``counts`` has the robot whose turn it is, the teams in the
        front, and how many trails have been looked at as choices.
    n_looks
        After how many of those looks to come back.

    Returns
    -------
    int
        Whether it is FINISHED, the front is FULL, or it has only PAUSED.
    """
    n_robots, limit = len(choices.at), counts[LOOKS] + n_looks
    team = np.empty(n_robots, np.int64)
    while counts[LOOKS] < limit:
        robot = counts[DEPTH]
        at = choices.at[robot]
        if at == choices.n_listed[robot]:
            if robot == 0:
                return FINISHED
            counts[DEPTH] -= 1
            choices.at[robot - 1] += 1
            continue
        n_front, n_more = counts[FRONT], n_robots - robot - 1
        if n_front == len(front.reward):
            return FULL
        counts[LOOKS] += 1
        trail = choices.listed[robot, at]
        reward = choices.figures[robot, 0] + choices.gain[robot, at]
        survivors = choices.figures[robot, 1] + choices.survives[trail]
        if not is_hopeful(choices, front, n_front, robot, n_more, reward, survivors):
            choices.at[robot] += 1
        elif n_more > 0:
            counts[DEPTH] += 1
            counts[LOOKS] += choices.n_listed[robot] - at
            choices.figures[robot + 1] = reward, survivors
            choices.left[robot + 1] = choices.left[robot] * (1.0 - choices.reached[trail])
            list_choices(choices, front, n_front, robot + 1)
        else:
            for i in range(n_robots):
                team[i] = choices.listed[i, choices.at[i]]
            insert(front, counts, reward, survivors, team)
            choices.at[robot] += 1
    return PAUSED
