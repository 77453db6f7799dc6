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

from botohe_moo.base.types import FloatArray, OffsetArray, RecordArray
from botohe_moo.core.compile import helper, kernel, shared
from botohe_moo.core.ordered import OrderedFront, best_reward, find_place, insert

# The state of a search: whose turn it is to choose, −1 before it begins; and how many choices have
# been looked at.
TURN = np.dtype([("robot", np.int64), ("n_looks", np.int64)])
# A robot: how many trails it may choose from, the position of the one that it has chosen or tries
# next, and how many are on the hull of its choices; E[R] and E[S] of the robots before it.
ROBOT = np.dtype(
    [(name, np.int64) for name in ("n_listed", "at", "n_hull")]
    + [(name, np.float64) for name in ("reward", "survivors")]
)


class Choices(NamedTuple):
    """Trails to choose from, and those that the robots have chosen."""

    # Of each trail its survival, which descends (n_trails), and the probability to reach each goal
    # (n_trails, n_goals).
    survives: FloatArray
    reached: FloatArray
    # By how much of reward and of survivors a team must be better to count as better (2).
    slack: FloatArray
    turn: RecordArray  # a ``TURN`` (1)
    robots: RecordArray  # as ``ROBOT`` (n_robots)
    # For each robot the trails that it may choose and what each adds to the robots before it, and
    # the upper concave hull of these choices, by ascending gain (n_robots, n_trails).
    listed: OffsetArray
    gain: FloatArray
    hull_gain: FloatArray
    hull_survives: FloatArray
    # For each robot the reward of each goal, times the probability that none before it gets there
    # (n_robots, n_goals).
    left: FloatArray


def new_choices(
    survives: FloatArray, reached: FloatArray, reward: FloatArray, slack: FloatArray, n_robots: int
) -> Choices:
    """Return room for a search in which no robot has chosen."""
    shape = (n_robots, len(survives))
    choices = Choices(
        survives=survives,
        reached=reached,
        slack=slack,
        turn=np.array([(-1, 0)], TURN).view(np.recarray),
        robots=np.zeros(n_robots, ROBOT).view(np.recarray),
        listed=np.zeros(shape, np.int64),
        gain=np.zeros(shape),
        hull_gain=np.zeros(shape),
        hull_survives=np.zeros(shape),
        left=np.zeros((n_robots, len(reward))),
    )
    choices.listed[0], choices.left[0] = np.arange(len(survives)), reward
    choices.robots["n_listed"][0] = len(survives)
    return choices


@helper
def _make_hull(choices: Choices, robot: int) -> None:
    """Find the upper concave hull of a robot's choices, which come by descending survival."""
    xs, ys = choices.hull_gain[robot], choices.hull_survives[robot]
    n = 0
    for i in range(choices.robots[robot].n_listed):
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
    choices.robots[robot].n_hull = n


@helper
def _is_hopeful(
    choices: Choices, front: OrderedFront, robot: int, reward: float, survivors: float
) -> bool:
    """Return whether a team with E[R] and E[S] may get beyond the front by robots after ``robot``.

    They choose from the hull of that robot.
    """
    n_more = choices.robots.shape[0] - robot - 1
    reward -= choices.slack[0]
    survivors -= choices.slack[1]
    if n_more == 0:
        return best_reward(front, survivors) < reward
    gain, alive = choices.hull_gain[robot], choices.hull_survives[robot]
    last = choices.robots[robot].n_hull - 1
    most_reward, most_survivors = reward + n_more * gain[last], survivors + n_more * alive[0]
    # The front is a staircase: the bound gets beyond it where it gets beyond an inner corner.
    place = find_place(front, most_survivors)
    if place == front.n.plans:
        return True
    right = 0
    while True:
        corner_reward = front.slots[front.order[place]].reward
        if most_reward <= corner_reward:
            return False
        place -= 1
        if place < 0:
            return True
        each = (corner_reward - reward) / n_more
        while right < last and gain[right] < each:
            right += 1
        if right == 0:
            return True
        share = (gain[right] - each) / (gain[right] - gain[right - 1])
        bound = survivors + n_more * (alive[right] + share * (alive[right - 1] - alive[right]))
        if bound > front.slots[front.order[place]].survivors:
            return True


@helper
def _list_choices(choices: Choices, front: OrderedFront, robot: int) -> None:
    """List the trails that a robot may choose, given those before it."""
    before, own = choices.robots[max(0, robot - 1)], choices.robots[robot]
    start, n = before.at, before.n_listed - before.at
    for i in range(n):
        trail, gain = choices.listed[max(0, robot - 1), start + i], 0.0
        for goal in range(choices.left.shape[1]):
            gain += choices.left[robot, goal] * choices.reached[trail, goal]
        choices.listed[robot, i], choices.gain[robot, i] = trail, gain
    own.n_listed, own.at = n, 0
    if robot + 1 < choices.robots.shape[0]:
        _make_hull(choices, robot)
    n_kept = 0
    for i in range(n):
        trail, gain = choices.listed[robot, i], choices.gain[robot, i]
        reward, survivors = own.reward + gain, own.survivors + choices.survives[trail]
        if _is_hopeful(choices, front, robot, reward, survivors):
            choices.listed[robot, n_kept], choices.gain[robot, n_kept] = trail, gain
            n_kept += 1
    own.n_listed = n_kept


@kernel
def choose_teams(choices: Choices, front: OrderedFront, n_looks: int, most_reward: bool) -> bool:
    """Go on with the search for teams; return whether it has ended.

    It pauses after a number of looks at choices, and where the front has no room. With
    ``most_reward`` only the most rewarding team is looked for: teams are put into the front as if
    all robots survived for sure.
    """
    choices, front = shared(choices), shared(front)
    state, n_robots = choices.turn[0], choices.robots.shape[0]
    limit = state.n_looks + n_looks
    if state.robot < 0:
        state.robot = 0
        _list_choices(choices, front, 0)
    while state.n_looks < limit and front.n.spare > 0:
        robot, own = state.robot, choices.robots[state.robot]
        if own.at == own.n_listed:
            if robot == 0:
                return True
            state.robot -= 1
            choices.robots[robot - 1].at += 1
            continue
        state.n_looks += 1
        trail = choices.listed[robot, own.at]
        reward = own.reward + choices.gain[robot, own.at]
        survivors = own.survivors + choices.survives[trail]
        if not _is_hopeful(choices, front, robot, reward, survivors):
            own.at += 1
        elif robot + 1 < n_robots:
            state.robot += 1
            state.n_looks += own.n_listed - own.at
            after = choices.robots[robot + 1]
            after.reward, after.survivors = reward, survivors
            for goal in range(choices.left.shape[1]):
                missed = 1.0 - choices.reached[trail, goal]
                choices.left[robot + 1, goal] = choices.left[robot, goal] * missed
            _list_choices(choices, front, robot + 1)
        else:
            slot = insert(front, reward, np.inf if most_reward else survivors)
            for i in range(n_robots):
                front.plan[slot, i] = choices.listed[i, choices.robots[i].at]
            own.at += 1
    return False
