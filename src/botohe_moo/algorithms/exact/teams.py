"""The Pareto front over all multisets of K trails, by branch and bound.

Robots choose trails one after another, in ascending order, so that each multiset comes up once. A
bound on what further robots add follows from the diminishing returns of reward. n of them add at
most the sum of what each would add alone to the team as it is. This is at most n times a point of
the upper concave hull of (reward added, survival) over the trails left to choose from. A team is
given up when no point of its bound gets beyond the front. What a trail adds only shrinks as the
team grows: a trail that has been given up for a robot is not tried again for those after it.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray, RecordArray
from botohe_moo.core.compile import helper, kernel
from botohe_moo.core.ordered import OrderedFront, best_reward, find_place, insert, place_before

# Whose turn it is to choose, −1 before the search; and how many choices have been looked at.
TURN = np.dtype([("robot", np.int64), ("n_looks", np.int64)])
FINISHED, FULL, PAUSED = 0, 1, 2


class Choices(NamedTuple):
    """Trails to choose from, and those that the robots have chosen."""

    # Of each trail its survival, which descends (n_trails), and the probability to reach each goal
    # (n_trails, n_goals).
    survives: FloatArray
    reached: FloatArray
    # By how much of reward and of survivors a team must be better to count as better (2).
    slack: FloatArray
    # For each robot the trails that it may choose and what each adds to the robots before it
    # (n_robots, n_trails); how many there are, and the position of the one that it has chosen or
    # tries next (n_robots).
    listed: OffsetArray
    gain: FloatArray
    n_listed: OffsetArray
    at: OffsetArray
    # For each robot the upper concave hull of its choices, by ascending gain (n_robots, n_trails),
    # and its size (n_robots).
    hull_gain: FloatArray
    hull_survives: FloatArray
    n_hull: OffsetArray
    # For each robot the reward of each goal, times the probability that none before it gets there
    # (n_robots, n_goals).
    left: FloatArray
    objectives: FloatArray  # for each robot E[R] and E[S] of those before it (n_robots, 2)
    turn: RecordArray  # the state of the search, a ``TURN`` (1)


def new_choices(
    survives: FloatArray, reached: FloatArray, reward: FloatArray, slack: FloatArray, n_robots: int
) -> Choices:
    """Return room for a search in which no robot has chosen."""
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
        objectives=np.zeros((n_robots, 2)),
        turn=np.array([(-1, 0)], TURN).view(np.recarray),
    )


@helper
def _make_hull(choices: Choices, robot: int) -> None:
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


@helper
def _is_hopeful(
    choices: Choices, front: OrderedFront, robot: int, reward: float, survivors: float
) -> bool:
    """Return whether a team with E[R] and E[S] may get beyond the front by robots after ``robot``.

    They choose from the hull of that robot.
    """
    n_more = choices.at.shape[0] - robot - 1
    reward -= choices.slack[0]
    survivors -= choices.slack[1]
    if n_more == 0:
        return best_reward(front, survivors) < reward
    gain, alive = choices.hull_gain[robot], choices.hull_survives[robot]
    last = choices.n_hull[robot] - 1
    most_reward, most_survivors = reward + n_more * gain[last], survivors + n_more * alive[0]
    # The front is a staircase: the bound gets beyond it where it gets beyond an inner corner.
    at, place = find_place(front, most_survivors)
    if at == front.n.blocks:
        return True
    right = 0
    while True:
        corner_reward = front.places[front.directory[at], place].reward
        if most_reward <= corner_reward:
            return False
        at, place = place_before(front, at, place)
        if at < 0:
            return True
        each = (corner_reward - reward) / n_more
        while right < last and gain[right] < each:
            right += 1
        if right == 0:
            return True
        share = (gain[right] - each) / (gain[right] - gain[right - 1])
        bound = survivors + n_more * (alive[right] + share * (alive[right - 1] - alive[right]))
        if bound > front.places[front.directory[at], place].survivors:
            return True


@helper
def _list_choices(choices: Choices, front: OrderedFront, robot: int) -> None:
    """List the trails that a robot may choose, given those before it."""
    start, stop = 0, choices.survives.shape[0]
    if robot > 0:
        start, stop = choices.at[robot - 1], choices.n_listed[robot - 1]
    n = stop - start
    for i in range(n):
        trail = i if robot == 0 else choices.listed[robot - 1, start + i]
        gain = 0.0
        for goal in range(choices.left.shape[1]):
            gain += choices.left[robot, goal] * choices.reached[trail, goal]
        choices.listed[robot, i], choices.gain[robot, i] = trail, gain
    choices.n_listed[robot], choices.at[robot] = n, 0
    if robot + 1 < choices.at.shape[0]:
        _make_hull(choices, robot)
    n_kept = 0
    reward, survivors = choices.objectives[robot, 0], choices.objectives[robot, 1]
    for i in range(n):
        trail, gain = choices.listed[robot, i], choices.gain[robot, i]
        alive = survivors + choices.survives[trail]
        if _is_hopeful(choices, front, robot, reward + gain, alive):
            choices.listed[robot, n_kept], choices.gain[robot, n_kept] = trail, gain
            n_kept += 1
    choices.n_listed[robot] = n_kept


@kernel
def choose_teams(choices: Choices, front: OrderedFront, n_looks: int, most_reward: bool) -> int:
    """Continue the search for teams, and pause after a number of looks at choices.

    With ``most_reward`` only the most rewarding team is looked for: teams are put into the front as
    if all robots survived for sure. Returns ``FINISHED``, ``FULL`` where the front has no room, or
    ``PAUSED``.
    """
    state, n_robots = choices.turn[0], choices.at.shape[0]
    limit = state.n_looks + n_looks
    if state.robot < 0:
        state.robot = 0
        _list_choices(choices, front, 0)
    while state.n_looks < limit:
        robot = state.robot
        at = choices.at[robot]
        if at == choices.n_listed[robot]:
            if robot == 0:
                return FINISHED
            state.robot -= 1
            choices.at[robot - 1] += 1
            continue
        if front.n.spare == 0:
            return FULL
        state.n_looks += 1
        trail = choices.listed[robot, at]
        reward = choices.objectives[robot, 0] + choices.gain[robot, at]
        survivors = choices.objectives[robot, 1] + choices.survives[trail]
        if not _is_hopeful(choices, front, robot, reward, survivors):
            choices.at[robot] += 1
        elif robot + 1 < n_robots:
            state.robot += 1
            state.n_looks += choices.n_listed[robot] - at
            choices.objectives[robot + 1, 0], choices.objectives[robot + 1, 1] = reward, survivors
            for goal in range(choices.left.shape[1]):
                missed = 1.0 - choices.reached[trail, goal]
                choices.left[robot + 1, goal] = choices.left[robot, goal] * missed
            _list_choices(choices, front, robot + 1)
        else:
            slot = insert(front, reward, np.inf if most_reward else survivors)
            for i in range(n_robots):
                front.plan[slot, i] = choices.listed[i, choices.at[i]]
            choices.at[robot] += 1
    return PAUSED
