"""What is wrong with the values that a factory is given: everything, before it is called."""

import functools
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any, ParamSpec, TypeAlias, TypeVar

from pydantic import BaseModel, ValidationError

from botohe_moo._base.checks import (
    FaultsError,
    ParameterError,
    nearest_first,
    quoted,
    unknown_parameter,
)
from botohe_moo._plugins.entry_points import PluginError
from botohe_moo._plugins.faults import fault_messages, own_message
from botohe_moo._plugins.stated import Factory, Parameter, model_of, signature_parameters
from botohe_moo._plugins.types import is_scalar

P = ParamSpec("P")
R = TypeVar("R")

# The parameter that is wrong, or None for all together, and what is wrong with it.
Fault: TypeAlias = tuple[str | None, str]


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """Make a function or constructor check its parameters by their types, whenever it is called.

    Checked are arguments that are given by keyword and declared as numbers, flags, names or None.
    Numbers of all kinds arrive as ``int`` and ``float``. The function checks other types itself.

    Examples
    --------
    >>> from typing import Annotated
    >>> from pydantic import Field
    >>> @checked
    ... def dive(*, depth: Annotated[int, Field(ge=1, le=30)] = 1): ...
    >>> dive(depth=31)
    Traceback (most recent call last):
    botohe_moo._base.checks.ParameterError: Expected depth in [1, 30], got 31.
    """

    @functools.wraps(function)
    def call(*args: P.args, **given: P.kwargs) -> R:
        faults: list[tuple[str, str]] = []
        for parameter in _scalars(function):
            name = parameter.name
            if name in given:
                given[name], messages = parameter.checked(given[name])
                faults += [(name, message) for message in messages]
        if faults:
            raise ParameterError(" ".join(message for _, message in faults), faults[0][0])
        return function(*args, **given)

    return call


@functools.cache
def _scalars(function: Callable[..., Any]) -> tuple[Parameter, ...]:
    """List the parameters that are checked; at the first call, since it would slow imports down."""
    return tuple(p for p in signature_parameters(function) if is_scalar(p.hint))


def check_values(
    accepted: Sequence[Parameter],
    values: Mapping[str, Any],
    *,
    plain: bool = False,
    also: Collection[str] = (),
) -> list[Fault]:
    """List everything that is wrong with the values a factory is to be given, by name.

    With ``plain`` the values are from a text, so that they cannot be Python objects. The names in
    ``also`` are known, too; their values are not looked at.
    """
    known = {*also, *(parameter.name for parameter in accepted)}
    faults: list[Fault] = [
        (str(name), unknown_parameter(name, known)) for name in values if name not in known
    ]
    for parameter in accepted:
        name = parameter.name
        if name not in values:
            if parameter.required:
                faults.append((name, f"missing a required parameter {name!r}."))
        elif plain and not parameter.plain:
            faults.append((name, f"{name} can be given from Python only."))
        elif values[name] is not parameter.default:
            faults += [(name, message) for message in parameter.checked(values[name])[1]]
    return faults


def check_keywords(given: Iterable[str], known: Collection[str], kinds: Sequence[type]) -> None:
    """Refuse keywords that are not known.

    The TypeError names the first of the classes that does not state the keyword itself, which it
    would then have handed on, and lists what that class states.
    """
    for name in given:
        if name not in known:
            stated = {kind: {p.name for p in signature_parameters(kind)} for kind in kinds}
            refusing = next((kind for kind in kinds if name not in stated[kind]), kinds[-1])
            among = ", ".join(nearest_first(name, {*known, *stated[refusing]}))
            raise TypeError(f"{refusing.__name__} has no parameter {name!r}; known are {among}.")


def call_factory(
    source: str,
    factory: Factory,
    accepted: Sequence[Parameter],
    values: Mapping[str, Any],
    *,
    wanted: type = object,
    origin: str = "it",
    also: Collection[str] = (),
) -> Any:
    """Call a factory with checked values.

    A ParameterError says what is unknown, missing or refused; a PluginError what else the factory
    has raised, which is called ``origin``, or that it has not returned what is ``wanted``. Messages
    begin with ``source``, and list the names in ``also`` as known. A FaultsError is not changed.
    """
    faults = check_values(accepted, values, also=also)
    if not faults and (model := model_of(factory)):
        faults, values = _converted(model, values)
    if faults:
        expected = " ".join(message for _, message in faults)
        raise ParameterError(f"{source}: {expected}", faults[0][0])
    try:
        made = factory(**values)
    except (FaultsError, MemoryError):
        raise
    except (TypeError, ValueError) as error:
        blamed = raised_fault(error, values, source=source)[0]
        raise ParameterError(f"{source}: {error}", blamed) from error
    except (Exception, SystemExit) as error:  # whatever another package's code may raise
        raise PluginError(f"{source}: {origin} raised {type(error).__name__}: {error}.") from error
    if not isinstance(made, wanted):
        expected = f"expected {origin} to give an object of type {wanted.__name__}"
        raise PluginError(f"{source}: {expected}, got {quoted(made)}.")
    return made


def factory_faults(
    source: str,
    find_accepted: Callable[[], Sequence[Parameter]],
    make: Callable[..., Any],
    values: Mapping[str, Any],
    *,
    plain: bool = False,
    also: Collection[str] = (),
) -> list[Fault]:
    """List everything that keeps something from being made with values, as `check_values` does.

    If all values have the right types, it is made, to see what that raises.
    """
    try:
        if faults := check_values(find_accepted(), values, plain=plain, also=also):
            return faults
        make(**values)
    except (Exception, SystemExit) as error:  # whatever another package's code may raise
        if isinstance(error, FaultsError):
            return [(None, fault) for fault in error.faults]
        return [raised_fault(error, values, source=source)]
    return []


def _converted(
    model: type[BaseModel], values: Mapping[str, Any]
) -> tuple[list[Fault], dict[str, Any]]:
    """Let a model check and convert values, by its own rules; return the faults, and all values."""
    try:
        made = model.model_validate(values, by_name=True)
    except ValidationError as error:
        errors = error.errors(include_url=False)
    else:
        return [], {name: getattr(made, name) for name in model.model_fields}
    together = (found for found in errors if {*found["loc"][:1]} - {*values} or not found["loc"])
    faults: list[Fault] = [(None, own_message(found)) for found in together]
    for name, value in values.items():
        own = [
            {**found, "loc": found["loc"][1:]} for found in errors if found["loc"][:1] == (name,)
        ]
        faults += [(name, message) for message in fault_messages(name, value, own)]
    return faults, {}


def raised_fault(error: BaseException, names: Collection[str], *, source: str) -> Fault:
    """Turn what a factory raised into a fault of the parameter among ``names`` that it is about.

    That is what the error holds as ``parameter``, or the name with which its message begins; it may
    be a part of a parameter, such as ``moves['visit']``.
    """
    expected = isinstance(error, TypeError | ValueError)
    message = str(error) if expected else f"{type(error).__name__}: {error}"
    message = message.removeprefix(f"{source}: ")
    first = message.removeprefix("Expected ").partition(" ")[0].rstrip(":,")
    name = (getattr(error, "parameter", None) or first).partition("[")[0]
    return (name if name in names else None), message
