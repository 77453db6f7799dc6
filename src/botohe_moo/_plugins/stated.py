"""What a factory of algorithms or missions can be given, as it states it itself.

By its signature and docstring, or by a pydantic model: the attribute ``Parameters``.
"""

import functools
import inspect
import re
import typing
import warnings
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Any, TypeAlias

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    PlainValidator,
    PydanticUserError,
    TypeAdapter,
    ValidationError,
    WrapValidator,
)
from pydantic.fields import FieldInfo

from botohe_moo._plugins.docstrings import described_parameters
from botohe_moo._plugins.messages import fault_messages
from botohe_moo._plugins.types import (
    changes_nothing,
    is_plain,
    is_scalar,
    plain_number,
    range_text,
    type_text,
)

Factory: TypeAlias = Callable[..., Any]

_EMPTY = inspect.Parameter.empty
_BY_KEYWORD = (inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
# Types that only a text can be asked about, because their names lead nowhere at runtime.
_PLAIN_WORDS = r"\b(int|float|bool|str|Any|object|Literal|Real|Integral)\b"


@dataclass(frozen=True)
class Parameter:
    """One parameter of a factory, as its signature or model, and its docstring state it."""

    name: str
    default: Any = _EMPTY  # where a value must be given
    hint: Any = Any  # the type; ``Any`` where there is none, or its name leads nowhere
    annotation: str = ""  # the type as text
    description: str = ""
    plain: bool = True  # whether numbers, flags or texts can be its value, as far as one can tell
    own: bool = True  # whether its default holds: a method with ** may give its class another

    @property
    def range(self) -> str:
        """The range that its type states, such as ``in (0, 1)``; may be empty."""
        return range_text(self.hint)

    @property
    def same_result(self) -> bool:
        """Whether its type says that no result depends on it: :class:`SameResult`."""
        return changes_nothing(self.hint)

    @property
    def required(self) -> bool:
        """Whether there is no default."""
        return self.default is _EMPTY

    @functools.cached_property
    def adapter(self) -> TypeAdapter[Any] | None:
        """What checks values by the type; None where pydantic cannot tell."""
        try:
            return TypeAdapter(self.hint, config=ConfigDict(arbitrary_types_allowed=True))
        except PydanticUserError:  # pydantic's own models bring their configuration
            return TypeAdapter(self.hint)
        except Exception:  # whatever another package's type does when it is looked at
            return None

    def checked(self, value: Any) -> tuple[Any, list[str]]:
        """Give a value as its type has it, and what keeps it from being of that type.

        pydantic's strict rules hold: "100" is not an integer, neither are 1.5 and True, but an
        integer is a number. What pydantic cannot check is in order.
        """
        if self.hint is Any or self.adapter is None:
            return value, []
        value = plain_number(value)
        try:
            return self.adapter.validate_python(value, strict=True), []
        except ValidationError as error:
            errors = error.errors(include_url=False)
            return value, fault_messages(self.name, value, errors, self.range)
        except Exception as error:  # whatever another package's validator raises
            return value, [f"{self.name}: {type(error).__name__}: {error}"]


@dataclass(frozen=True)
class Accepted:
    """All that a factory can be given by name."""

    parameters: tuple[Parameter, ...]
    needed: tuple[str, ...] = ()  # required
    ungivable: tuple[str, ...] = ()  # required, but cannot be given by name
    any_name: bool = False  # whether it would take other names, too
    model: type[BaseModel] | None = None  # checks and converts all values; None: the signature

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the parameters."""
        return tuple(parameter.name for parameter in self.parameters)


def accepted_parameters(factory: Factory, *, hidden: Collection[str] = ()) -> Accepted:
    """Find out what a factory can be given: a function, a class or one of its methods.

    A factory that is a class's method and takes any keywords, such as :meth:`BOACO.journal`,
    states what it changes, and its class the rest. The names in ``hidden`` cannot be given, and
    neither can names that are not stated, even to a factory that takes any.
    """
    model = _model_of(factory)
    if model is not None:
        parameters = tuple(_from_model(model, factory))
        needed = tuple(parameter.name for parameter in parameters if parameter.required)
        return Accepted(parameters, needed, model=model)
    signature = _signature(factory)
    own = signature.parameters.values() if signature else ()
    takes_any = signature is None or any(p.kind is p.VAR_KEYWORD for p in own)
    stated = {p.name: p for p in signature_parameters(factory) if p.name not in hidden}
    owner = getattr(factory, "__self__", None)
    if isinstance(owner, type) and signature is not None and takes_any:
        model = _model_of(owner)
        for parameter in _from_model(model, owner) if model else signature_parameters(owner):
            if parameter.name in hidden:
                continue
            known = stated.get(parameter.name) or replace(parameter, own=False)
            # A factory often only refers to its class, which tells the meaning.
            description = parameter.description or known.description
            plain = known.plain if model is None else is_plain(known.hint)  # nothing converts it
            stated[parameter.name] = replace(known, description=description, plain=plain)
    without_default = [
        p.name for p in own if p.default is _EMPTY and p.kind in (*_BY_KEYWORD, p.POSITIONAL_ONLY)
    ]
    return Accepted(
        tuple(stated.values()),
        needed=tuple(name for name in without_default if name in stated),
        ungivable=tuple(name for name in without_default if name not in stated),
        any_name=takes_any,
    )


def _model_of(factory: Factory) -> type[BaseModel] | None:
    model = getattr(factory, "Parameters", None)
    return model if isinstance(model, type) and issubclass(model, BaseModel) else None


def _from_model(model: type[BaseModel], factory: Factory) -> Iterator[Parameter]:
    described = described_parameters(factory) | described_parameters(model)
    for name, field in model.model_fields.items():
        hint: Any = field.annotation
        for constraint in field.metadata:
            hint = Annotated[hint, constraint]
        try:
            default = field.get_default(call_default_factory=True)
        except Exception:  # made of other fields' values, or by another package's code
            default = None
        yield Parameter(
            name,
            _EMPTY if field.is_required() else default,
            hint,
            type_text(field.annotation),
            field.description or described.get(name, ""),
            plain=_from_text(field),
        )


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


def signature_parameters(function: Factory) -> Iterator[Parameter]:
    """Give the parameters of a signature that can be given by name."""
    described = described_parameters(function)
    for stated in (_signature(function) or inspect.Signature()).parameters.values():
        if stated.kind not in _BY_KEYWORD:
            continue
        hint = _hint(function, stated)
        text = stated.annotation if stated.annotation is not _EMPTY else ""
        if not isinstance(text, str):
            text = inspect.formatannotation(text)
        if "Annotated[" in repr(hint) or is_scalar(hint):
            text = type_text(hint)
        resolved = hint is not Any
        plain = is_plain(hint) if resolved else not text or re.search(_PLAIN_WORDS, text)
        marks = getattr(hint, "__metadata__", ())
        said = [m.description for m in marks if isinstance(m, FieldInfo) and m.description]
        description = described.get(stated.name) or (said[0] if said else "")
        yield Parameter(stated.name, stated.default, hint, text, description, bool(plain))


def _signature(function: Factory) -> inspect.Signature | None:
    try:
        return inspect.signature(function)
    except (TypeError, ValueError):  # some compiled callables do not tell
        return None


def _hint(function: Factory, parameter: inspect.Parameter) -> Any:
    """Resolve an annotation where it was written; ``Any`` if that cannot be done."""
    if parameter.annotation is _EMPTY:
        return Any
    scope: dict[str, Any] = {}
    for home in _homes(function):
        if getattr(home, "__annotations__", {}).get(parameter.name) == parameter.annotation:
            scope = home.__globals__
            break

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
