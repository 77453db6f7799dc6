"""What a factory of algorithms or missions can be given, as it states it itself.

By its signature and docstring, or by a pydantic model: the attribute ``Parameters``.
"""

from __future__ import annotations

import functools
import inspect
import re
import typing
import warnings
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Any, TypeAlias

from pydantic import BaseModel, BeforeValidator, PlainValidator, TypeAdapter, WrapValidator
from pydantic.fields import FieldInfo

from botohe_moo._plugins.docstrings import described_parameters
from botohe_moo._plugins.results import changes_nothing
from botohe_moo._plugins.types import is_plain, range_text, type_text

__all__ = ["Accepted", "Factory", "Parameter", "accepted_parameters"]

Factory: TypeAlias = Callable[..., Any]

_EMPTY = inspect.Parameter.empty
_BY_KEYWORD = (inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
# Types that only a text can be asked about, because their names lead nowhere at runtime.
_PLAIN_WORDS = r"\b(int|float|bool|str|Any|object|Literal|Real|Integral)\b"


@dataclass(frozen=True)
class Parameter:
    """One parameter of a factory, as its signature or model, and its docstring state it.

    Attributes
    ----------
    name, default
        ``default`` is ``inspect.Parameter.empty`` where a value must be given.
    annotation
        The type, as text; empty where there is none.
    description
        From the docstring or the model's field; may be empty.
    range
        The range that the type states, such as ``in (0, 1)``; may be empty.
    plain
        Whether numbers, flags or texts can be its value, as far as the type tells.
    hint
        The type itself; ``Any`` where there is none, or its name leads nowhere.
    own
        Whether the factory states it itself, so that its default holds. A class's method that
        takes any keywords may give its class another.
    """

    name: str
    default: Any = _EMPTY
    annotation: str = ""
    description: str = ""
    range: str = ""
    plain: bool = True
    hint: Any = Any
    own: bool = True

    @property
    def same_result(self) -> bool:
        """Whether its type says that no result depends on it: :class:`SameResult`."""
        return changes_nothing(self.hint)

    @property
    def required(self) -> bool:
        """Whether there is no default."""
        return self.default is _EMPTY


@dataclass(frozen=True)
class Accepted:
    """All that a factory can be given by name.

    Attributes
    ----------
    parameters
        What it states, in its order.
    needed
        Names of what it cannot be called without.
    nameless
        What it cannot be called without, and cannot be given by name.
    any_name
        Whether it takes other names, too.
    model
        Checks all values at once, and converts them; None where there is only a signature.
    """

    parameters: tuple[Parameter, ...]
    needed: tuple[str, ...] = ()
    nameless: tuple[str, ...] = ()
    any_name: bool = False
    model: type[BaseModel] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the parameters."""
        return tuple(parameter.name for parameter in self.parameters)


def accepted_parameters(
    factory: Factory, *, hidden: Collection[str] = (), closed: bool = False
) -> Accepted:
    """Find out what a factory can be given.

    A factory that is a class's method and takes any keywords, such as :meth:`BOACO.journal`,
    states what it changes, and its class the rest.

    Parameters
    ----------
    factory
        A function, a class or one of its methods.
    hidden
        Names that a signature may have, but nobody is to give.
    closed
        Whether only stated names are accepted, even of a factory that takes any.
    """
    model = _model_of(factory)
    if model is not None:
        parameters = _from_model(model, factory)
        needed = tuple(parameter.name for parameter in parameters if parameter.required)
        return Accepted(parameters, needed, model=model)
    signature = _signature(factory)
    takes_any = signature is None or _takes_any(signature)
    own = signature.parameters.values() if signature else ()
    without_default = [p for p in own if p.default is _EMPTY]
    stated = {p.name: p for p in _from_signature(factory) if p.name not in hidden}
    owner = getattr(factory, "__self__", None)
    if isinstance(owner, type) and signature is not None and takes_any:
        model = _model_of(owner)
        for parameter in _from_model(model, owner) if model else _from_signature(owner):
            if parameter.name in hidden:
                continue
            known = stated.get(parameter.name) or replace(parameter, own=False)
            # A factory often only refers to its class, which tells the meaning and the range.
            description = parameter.description or known.description
            plain = known.plain if model is None else is_plain(known.hint)  # nothing converts it
            stated[parameter.name] = replace(known, description=description, plain=plain)
    return Accepted(
        tuple(stated.values()),
        needed=tuple(p.name for p in without_default if p.kind in _BY_KEYWORD),
        nameless=tuple(p.name for p in without_default if p.kind is p.POSITIONAL_ONLY),
        any_name=takes_any and not closed,
    )


def _model_of(factory: Factory) -> type[BaseModel] | None:
    model = getattr(factory, "Parameters", None)
    return model if isinstance(model, type) and issubclass(model, BaseModel) else None


def _from_model(model: type[BaseModel], factory: Factory) -> tuple[Parameter, ...]:
    described = described_parameters(factory) | described_parameters(model)
    parameters = []
    for name, field in model.model_fields.items():
        hint = field.annotation
        for constraint in field.metadata:
            hint = Annotated[hint, constraint]  # type: ignore[assignment]
        parameters.append(
            Parameter(
                name,
                _EMPTY if field.is_required() else _field_default(field),
                type_text(field.annotation),
                field.description or described.get(name, ""),
                range_text(hint),
                _from_text(field),
                hint,
            )
        )
    return tuple(parameters)


def _field_default(field: Any) -> Any:
    try:
        return field.get_default(call_default_factory=True)
    except Exception:  # made of other fields' values, or by whatever another package's code does
        return None


def _from_text(field: Any) -> bool:
    """Whether a model can make a field's value of what a text holds."""
    converters = BeforeValidator | PlainValidator | WrapValidator
    if is_plain(field.annotation) or any(isinstance(c, converters) for c in field.metadata):
        return True
    try:
        with warnings.catch_warnings(action="ignore"):
            TypeAdapter(field.annotation).json_schema()
    except Exception:  # of types that pydantic only tells by isinstance
        return False
    return True


def _from_signature(function: Factory) -> Iterator[Parameter]:
    described = described_parameters(function)
    for parameter in (_signature(function) or inspect.Signature()).parameters.values():
        if parameter.kind not in _BY_KEYWORD:
            continue
        hint = _hint(function, parameter)
        text = _annotation(parameter)
        if "Annotated" in text and hint is not Any:
            text = type_text(hint)
        plain = not text or (
            re.search(_PLAIN_WORDS, text) is not None if hint is Any else is_plain(hint)
        )
        yield Parameter(
            parameter.name,
            parameter.default,
            text,
            described.get(parameter.name) or _field_description(hint),
            range_text(hint),
            plain,
            hint,
        )


def _field_description(hint: Any) -> str:
    """Give what a ``Field`` says in an ``Annotated`` type."""
    fields = (part for part in getattr(hint, "__metadata__", ()) if isinstance(part, FieldInfo))
    return next((field.description for field in fields if field.description), "")


def _signature(function: Factory) -> inspect.Signature | None:
    try:
        return inspect.signature(function)
    except (TypeError, ValueError):  # some compiled callables do not tell
        return None


def _takes_any(signature: inspect.Signature) -> bool:
    return any(p.kind is p.VAR_KEYWORD for p in signature.parameters.values())


def _annotation(parameter: inspect.Parameter) -> str:
    if parameter.annotation is parameter.empty:
        return ""
    if isinstance(parameter.annotation, str):
        return parameter.annotation
    return inspect.formatannotation(parameter.annotation)


def _hint(function: Factory, parameter: inspect.Parameter) -> Any:
    """Resolve an annotation where it was written; ``Any`` if that cannot be done."""
    if parameter.annotation is parameter.empty:
        return Any
    for home in _homes(function):
        if getattr(home, "__annotations__", {}).get(parameter.name) == parameter.annotation:
            scope = home.__globals__
            break
    else:
        scope = {}

    def holder() -> None: ...

    holder.__annotations__ = {"it": parameter.annotation}
    try:
        return typing.get_type_hints(holder, globalns=scope, include_extras=True)["it"]
    except Exception:  # names that are for type checkers only, and whatever else a name may do
        return Any


def _homes(function: Any) -> Iterator[Any]:
    """Give the functions that parameters may come from, those that are called first."""
    while isinstance(function, functools.partial):
        function = function.func
    function = inspect.unwrap(getattr(function, "__func__", function))
    if isinstance(function, type):
        functions = [vars(base).get("__init__") for base in function.__mro__]
    elif inspect.isfunction(function):
        functions = [function]
    else:
        functions = [vars(base).get("__call__") for base in type(function).__mro__]
    yield from (inspect.unwrap(f) for f in functions if inspect.isfunction(f))
