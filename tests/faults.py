"""What keeps algorithms and missions from being made, as study files report it."""

from functools import partial

from botohe_moo import load_mission, make_algorithm
from botohe_moo.base.parameters import raised_faults


def algorithm_faults(name, parameters=None):
    return raised_faults(partial(make_algorithm, name), parameters or {})


def mission_faults(name, parameters=None):
    return raised_faults(partial(load_mission, name), parameters or {})
