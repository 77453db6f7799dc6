"""What factories of algorithms and missions can be given, and what is wrong with given values."""

from botohe_moo._plugins.checks import Fault, call_factory, check_values, raised_fault
from botohe_moo._plugins.docstrings import docstring_of
from botohe_moo._plugins.factories import declared_factory, named
from botohe_moo._plugins.results import SameResult, plain_value
from botohe_moo._plugins.stated import Accepted, Parameter, accepted_parameters
from botohe_moo._plugins.types import wrong_value

__all__ = [
    "Accepted",
    "Fault",
    "Parameter",
    "SameResult",
    "accepted_parameters",
    "call_factory",
    "check_values",
    "declared_factory",
    "docstring_of",
    "named",
    "plain_value",
    "raised_fault",
    "wrong_value",
]
