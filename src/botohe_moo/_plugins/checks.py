"""What is wrong with the values that a factory is given: everything, before it is called."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from typing import Any, TypeAlias

from pydantic import BaseModel, ValidationError

from botohe_moo._base.checks import check_parameters, nearest_first
from botohe_moo._plugins.stated import Accepted, Factory
from botohe_moo._plugins.types import bounds_text, fault_messages, value_faults

__all__ = ["Fault", "call_factory", "check_values", "raised_fault"]

# The parameter that is wrong, None for the whole, and what is wrong with it.
Fault: TypeAlias = tuple[str | None, str]

_SCALAR_TYPES = frozenset({"int_type", "float_type", "bool_type", "string_type"})


def check_values(
    accepted: Accepted,
    values: Mapping[str, Any],
    *,
    plain: bool = False,
    also: Collection[str] = (),
) -> list[Fault]:
    """Say everything that is wrong with the values a factory is to be given.

    Parameters
    ----------
    accepted
        What the factory can be given.
    values
        What it is to be given, by name.
    plain
        Whether the values are from a text, so that they cannot be Python objects.
    also
        Further names that are known; their values are not looked at.

    Returns
    -------
    list
        Pairs of a name, None for the whole, and what is wrong; empty if nothing is.
    """
    return [
        *_unknown_faults(accepted, values, also),
        *_missing_faults(accepted, values),
        *_checked(accepted, values, plain=plain)[0],
    ]


def call_factory(
    source: str,
    factory: Factory,
    accepted: Accepted,
    values: Mapping[str, Any],
    *,
    also: Collection[str] = (),
    passing: tuple[type[Exception], ...] = (),
) -> Any:
    """Call a factory with checked values.

    Parameters
    ----------
    source
        What is spoken of, to begin messages with.
    factory, accepted
        What is called, and what it can be given.
    values
        What it is given, by name.
    also
        Further names that messages list as known.
    passing
        Errors of the factory's own that say enough.

    Raises
    ------
    ValueError
        If a name is unknown or missing, or a value is refused.
    """
    check_parameters(source, values, None if accepted.any_name else accepted.names, also=also)
    if missing := _missing_faults(accepted, values):
        raise ValueError(f"{source}: {missing[0][1]}")
    faults, given = _checked(accepted, values)
    expected = " ".join(message for _, message in faults)
    if faults and accepted.model:
        raise ValueError(f"{source}: {expected}")
    try:
        made = factory(**given)
    except passing:
        raise
    except Exception as error:
        # A constructor that says what it expected knows the range, too.
        if faults and _speaks_of(str(error)) not in [name for name, _ in faults]:
            raise ValueError(f"{source}: {expected}") from error
        if not isinstance(error, TypeError | ValueError):
            raise
        raise ValueError(f"{source}: {error}") from error
    if faults:
        raise ValueError(f"{source}: {expected}")
    return made


def raised_fault(error: BaseException, names: Collection[str], *, source: str) -> Fault:
    """Turn what a factory raised into a fault, of the parameter it speaks of.

    Parameters
    ----------
    error
        What was raised.
    names
        What the factory was given.
    source
        What messages begin with, and a fault does not.
    """
    told = isinstance(error, TypeError | ValueError)
    message = str(error) if told else f"{type(error).__name__}: {error}"
    message = message.removeprefix(f"{source}: ")
    name = _speaks_of(message)
    return (name if name in names else None), message


def _speaks_of(message: str) -> str | None:
    found = re.match(r"Expected (?:an? )?(\w+)\b", message, re.IGNORECASE)
    return found[1] if found else None


def _unknown_faults(
    accepted: Accepted, values: Mapping[str, Any], also: Collection[str]
) -> Iterator[Fault]:
    known = {*accepted.names, *also}
    for name in values:
        if name in known or (accepted.any_name and isinstance(name, str)):
            continue
        among = ", ".join(nearest_first(str(name), known))
        remedy = f"known are {among}" if known else "it takes none"
        yield str(name), f"there is no parameter {name!r}; {remedy}."


def _missing_faults(accepted: Accepted, values: Mapping[str, Any]) -> list[Fault]:
    faults: list[Fault] = [
        (name, f"missing a required parameter {name!r}.")
        for name in accepted.needed
        if name not in values
    ]
    faults += [
        (name, f"missing a required parameter {name!r}, which it does not take by name.")
        for name in accepted.nameless
    ]
    return faults


def _checked(
    accepted: Accepted, values: Mapping[str, Any], *, plain: bool = False
) -> tuple[list[Fault], dict[str, Any]]:
    """Check the values of known names; give the faults, and what the factory is to be called with.

    Of a signature that is the values as they are: pydantic's own copies may be other objects.
    """
    faults: list[Fault] = []
    checked: dict[str, Any] = {}
    for parameter in accepted.parameters:
        if parameter.name not in values:
            continue
        value = values[parameter.name]
        if plain and not parameter.plain:
            message = f"{parameter.name} can be given from Python only, as {parameter.annotation}."
            faults.append((parameter.name, message))
            continue
        checked[parameter.name] = value
        if accepted.model is None and value is not parameter.default:
            messages = value_faults(parameter.name, value, parameter.hint)
            faults += [(parameter.name, message) for message in messages]
    if accepted.model is None:
        return faults, dict(values)
    found, given = _by_model(accepted.model, checked)
    skipped = {name for name, _ in faults}
    return [*faults, *(fault for fault in found if fault[0] not in skipped)], given


def _by_model(
    model: type[BaseModel], values: Mapping[str, Any]
) -> tuple[list[Fault], dict[str, Any]]:
    """Let a model check and convert values; it converts no number, flag or text to another."""
    keys = {
        name: alias if isinstance(alias := field.validation_alias, str) else name
        for name, field in model.model_fields.items()
    }
    given = {keys[name]: value for name, value in values.items()}
    try:
        errors = _scalar_errors(model, given)
        made = model.model_validate(given)
    except ValidationError as error:
        errors = {**_by_field(error), **errors}
    except Exception as error:  # whatever a validator of another package's raises
        return [(None, f"{type(error).__name__}: {error}")], {}
    if not errors:
        return [], {name: getattr(made, name) for name in model.model_fields}
    faults: list[Fault] = []
    for name, key in keys.items():
        if name in values and key in errors:  # what is missing has been said before
            bounds = bounds_text(model.model_fields[name].metadata)
            messages = fault_messages(name, values[name], errors[key], bounds)
            faults += [(name, message) for message in messages]
    for detail in errors.get(None, ()):
        faults.append((None, str((detail.get("ctx") or {}).get("error", detail["msg"]))))
    return faults, {}


def _scalar_errors(model: type[BaseModel], given: Mapping[str, Any]) -> dict[Any, list[Any]]:
    """Find where a model would take a text or a flag for a number, and the like.

    pydantic's strict rules find that, but also refuse what a text has no other way to say, such as
    a path or a member of an enumeration.
    """
    try:
        model.model_validate(given, strict=True)
    except ValidationError as error:
        return {
            key: details
            for key, details in _by_field(error).items()
            if all(
                detail["type"] in _SCALAR_TYPES
                and isinstance(detail["input"], bool | int | float | str)
                for detail in details
            )
        }
    return {}


def _by_field(error: ValidationError) -> dict[Any, list[Any]]:
    """Sort errors by the field they are in, None for the whole; locations then begin there."""
    found: dict[Any, list[Any]] = {}
    for detail in error.errors(include_url=False):
        field, *rest = detail["loc"] or (None,)
        found.setdefault(field, []).append({**detail, "loc": tuple(rest)})
    return found
