"""What studies rest on: the rules for missions, in the order in which they are best fixed."""

import pickle
import tempfile
from pathlib import Path

from botohe_moo.algorithms.greedy.planner import SequentialPlanner
from botohe_moo.base.parameters import accepted_parameters, takes_any_name
from botohe_moo.mission.loading import read_mission, save_mission
from botohe_moo.mission.model import Mission, mission_digest
from botohe_moo.testing.rules import Check


def can_be_made(check: Check) -> None:
    """A call without arguments makes a mission.

    Let it be called without arguments, and return a Mission.
    """
    made = check.make()
    assert isinstance(made, Mission), f"it gives {type(made).__name__}, not a Mission"


def parameters_stated(check: Check) -> None:
    """The signature states all parameters with their types.

    State each parameter in the signature, by name, with its type and its default.
    """
    untyped = [each.name for each in accepted_parameters(check.factory) if not each.annotation]
    assert not untyped, f"no type is stated of {', '.join(untyped)}"
    takes_any = takes_any_name(check.factory)
    assert not takes_any, "it takes keywords that it does not state, such as misspelt ones"


def same_twice(check: Check) -> None:
    """The same parameters give the same mission.

    Draw random numbers from a generator made of a parameter `seed`, and of nothing else.
    """
    one, other = (mission_digest(check.make()) for _ in range(2))
    assert one == other, "two missions made with the same parameters differ"


def file_round_trip(check: Check) -> None:
    """The mission is the same after it is saved and read again.

    Give nodes labels that are texts, integers, or tuples of these, and plain attributes.
    """
    mission = check.make()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "mission.json")
        save_mission(mission, path)
        same = mission_digest(read_mission(path)) == mission_digest(mission)
    assert same, "the mission differs when it is saved as JSON and read again"


def can_be_pickled(check: Check) -> None:
    """The mission is the same in another process.

    Hold nothing in the graph that cannot be pickled, such as lambdas and open files.
    """
    mission = check.make()
    same = mission_digest(pickle.loads(pickle.dumps(mission))) == mission_digest(mission)
    assert same, "the mission differs when it is pickled and unpickled"


def something_to_gain(check: Check) -> None:
    """A robot can leave its start, collect a reward and come home.

    Let an arc leave the base from which ways lead on to a reward, and home.
    """
    mission = check.make()
    plan = SequentialPlanner(mission).plan(1.0)
    reward, at_home = mission.evaluate([plan, mission.stay_home()])[:, 0]
    assert reward > at_home, "no robot can collect anything and come home"
