"""What has come of a mission that was played, step by step."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from botohe_moo.base.messages import counted
from botohe_moo.decide.fronts import short_text
from botohe_moo.decide.wishes import label_text
from botohe_moo.mission.model import Mission
from botohe_moo.mission.underway import Event
from botohe_moo.trails import TrailPlan
from botohe_moo.underway.replanning import Replan

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class PlayedStep:
    """A step of a mission that was played: each robot that moves tries one arc.

    Attributes
    ----------
    events
        What happened to the robots that moved.
    trails
        The trail of each robot after the step: where it has been, and where it is to go, by the new
        plan if one was made. That of a lost robot ends with the node to which it was on its way.
    at
        The position on its trail of the node where each robot is; or, if it is lost, came from.
    lost
        The robots that are lost by now.
    collected
        The reward that counts by now, by node; only of nodes of which some does.
    replan
        The plan made anew after these events, if one was. Its ``before`` and ``objectives`` are
        what is expected from now on without it and with it.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.underway import PlayedStep, play_mission
    >>> toy = load_mission("toy")
    >>> start = play_mission(toy, toy.plan([[1, 2, 1], [1]]), price=1).steps[0]
    >>> isinstance(start, PlayedStep), start.trails, start.at
    (True, ((1, 2, 1), (1,)), (0, 0))
    """

    events: tuple[Event, ...]
    trails: tuple[tuple[Hashable, ...], ...]
    at: tuple[int, ...]
    lost: tuple[int, ...]
    collected: dict[Hashable, float]
    replan: Replan | None

    @property
    def reward(self) -> float:
        """The reward that counts by now."""
        return math.fsum(self.collected.values())


@dataclass(frozen=True)
class PlayedMission:
    """A mission that was played, as `play_mission` returns it.

    Attributes
    ----------
    mission, plan, policy, price, seed, number
        As for :func:`play_mission`.
    steps
        The start, at which nothing has happened yet, and each step after it.
    reward, survivors
        What has come of it. The reward is to be expected where a ``share`` is not 1.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.underway import PlayedMission, play_mission
    >>> toy = load_mission("toy")
    >>> played = play_mission(toy, toy.stay_home(), price=1)
    >>> isinstance(played, PlayedMission), len(played.steps)
    (True, 1)
    >>> print(played)
    No robot is lost. The mission ends with 0 reward and 2 of 2 robots.
    """

    mission: Mission
    plan: TrailPlan
    policy: str
    price: float
    seed: int
    number: int
    steps: tuple[PlayedStep, ...]
    reward: float
    survivors: int

    def __str__(self) -> str:
        losses = [loss for step in self.steps for loss in self._losses(step, "")]
        replans = sum(step.replan is not None for step in self.steps)
        times = "once" if replans == 1 else f"{replans:,} times"
        anew = f" The plan is made anew {times}." if replans else ""
        lost = f"Lost: {', '.join(losses)}." if losses else "No robot is lost."
        return f"{lost}{anew} {self._end()}"

    @property
    def sentences(self) -> tuple[str, ...]:
        """What happened in each step, in words."""
        return tuple(" ".join(self._sentences(i)) for i in range(len(self.steps)))

    @property
    def table(self) -> pd.DataFrame:
        """A row for each step.

        The columns are ``step``, ``reward`` (that counts by now), ``robots`` (not lost by now),
        ``lost`` (in this step), ``replanned``, and, if it was, what is expected from then on:
        ``reward_before``, ``survivors_before``, ``reward_after`` and ``survivors_after``.
        """
        import pandas as pd

        columns = ("reward_before", "survivors_before", "reward_after", "survivors_after")
        rows = []
        for number, step in enumerate(self.steps):
            new = step.replan
            expected = [math.nan] * 4 if new is None else [*new.before, *new.objectives]
            rows.append(
                {
                    "step": number,
                    "reward": step.reward,
                    "robots": self.mission.robots - len(step.lost),
                    "lost": len(self._losses(step)),
                    "replanned": new is not None,
                    **dict(zip(columns, expected, strict=True)),
                }
            )
        return pd.DataFrame(rows)

    def _sentences(self, number: int) -> Iterator[str]:
        step = self.steps[number]
        if number == 0:
            [expected] = self.mission.evaluate([self.plan]).tolist()
            yield f"Start: {_expected(expected)} expected."
        else:
            moved = len(step.events)
            on = f"{counted(moved, 'robot')} move{'s' if moved == 1 else ''} on"
            yield f"Step {number}: {', '.join(self._losses(step)) or on}."
        if step.replan is not None:
            now = f"{_expected(step.replan.objectives)} expected from now on"
            if step.replan.gain <= 0.0:
                yield f"The plan is made anew and stays as it is: {now}."
            else:
                before = " and ".join(map(short_text, step.replan.before))
                yield f"The plan is made anew: {now}, instead of {before}."
        if number == len(self.steps) - 1:
            yield self._end()

    def _losses(self, step: PlayedStep, verb: str = "is lost ") -> list[str]:
        """Write which robots are lost in a step, and where."""
        lost = [int(event.robot) for event in step.events if event.what == "lost"]
        ways = {robot: map(label_text, step.trails[robot][-2:]) for robot in lost}
        return [
            f"{self._name(robot)} {verb}between {' and '.join(way)}" for robot, way in ways.items()
        ]

    def _name(self, robot: int) -> str:
        several = len(self.mission.kinds) > 1
        return f"{self.mission.kind_of[robot].name if several else 'robot'} {robot}"

    def _end(self) -> str:
        team = counted(self.mission.robots, "robot")
        reward = short_text(self.reward)
        return f"The mission ends with {reward} reward and {self.survivors} of {team}."


def _expected(objectives: Iterable[float]) -> str:
    reward, survivors = map(short_text, objectives)
    return f"{reward} reward and {survivors} survivors"
