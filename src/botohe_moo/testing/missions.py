"""What studies rest on: the rules for missions of other packages."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from botohe_moo.algorithms.greedy.planner import SequentialPlanner
from botohe_moo.base.parameters import accepted_parameters, takes_any_name
from botohe_moo.mission.loading import read_mission, save_mission
from botohe_moo.mission.model import Mission, mission_digest
from botohe_moo.testing.rules import Rules, Subject, expect
from botohe_moo.testing.watching import revived

RULES = Rules()


@RULES.add("Let it be called without arguments, and return a Mission.", comes_first=True)
def can_be_made(subject: Subject) -> None:
    """Without arguments, a mission is made."""
    made = subject.make()
    expect(isinstance(made, Mission), f"it gives {type(made).__name__}, not a Mission")


@RULES.add("State each parameter in the signature, by name, with its type and its default.")
def parameters_stated(subject: Subject) -> None:
    """All parameters are in the signature, with their types."""
    stated = accepted_parameters(subject.factory)
    untyped = [parameter.name for parameter in stated if not parameter.annotation]
    expect(not untyped, f"no type is stated of {', '.join(untyped)}")
    takes_any = takes_any_name(subject.factory)
    expect(not takes_any, "it takes keywords that it does not state, such as misspelt ones")


@RULES.add("Draw random numbers from a generator made of a parameter `seed`, and of nothing else.")
def same_twice(subject: Subject) -> None:
    """The same parameters give the same mission."""
    one, other = (mission_digest(subject.make()) for _ in range(2))
    expect(one == other, "two missions made with the same parameters differ")


@RULES.add("Give nodes labels that are texts, integers, or tuples of these, and plain attributes.")
def file_round_trip(subject: Subject) -> None:
    """The mission is the same when it is saved and read again."""
    mission = subject.make()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "mission.json")
        save_mission(mission, path)
        expect(
            mission_digest(read_mission(path)) == mission_digest(mission),
            "the mission differs when it is saved as JSON and read again",
        )


@RULES.add("Hold nothing in the graph that cannot be pickled, such as lambdas and open files.")
def can_be_pickled(subject: Subject) -> None:
    """The mission is the same in another process."""
    mission = subject.make()
    same = mission_digest(revived(mission)) == mission_digest(mission)
    expect(same, "the mission differs when it is pickled and unpickled")


@RULES.add("Let an arc leave the base from which ways lead on to a reward, and home.")
def something_to_gain(subject: Subject) -> None:
    """A robot that leaves its start can collect a reward and come home."""
    mission = subject.make()
    plan = SequentialPlanner(mission).plan(1.0)
    reward, at_home = mission.evaluate([plan, mission.stay_home()])[:, 0]
    gained = reward - at_home
    expect(np.isfinite(gained) and gained > 0.0, "no robot can collect anything and come home")
