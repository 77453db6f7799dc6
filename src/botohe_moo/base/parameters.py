"""Typed parameters: what a factory states of them, their check, and its faults in words."""

import enum
import functools
import inspect
import os
import re
import types
import typing
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Integral, Number, Real
from pathlib import Path
from typing import (
    Annotated,
    Any,
    Literal,
    ParamSpec,
    TypeAlias,
    TypeVar,
    Union,
    get_args,
    get_origin,
)

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, PydanticUserError, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from botohe_moo.base.messages import (
    FaultsError,
    ParameterError,
    PluginError,
    nearest_first,
    quoted,
    unknown_parameter,
)

# Ranges that several algorithms, operators and missions declare.
Count: TypeAlias = Annotated[int, Field(ge=1, le=1_000_000)]
Size: TypeAlias = Annotated[int, Field(ge=1)]
Probability: TypeAlias = Annotated[float, Field(ge=0, le=1)]
Positive: TypeAlias = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative: TypeAlias = Annotated[float, Field(ge=0, allow_inf_nan=False)]
TravelBudget: TypeAlias = Annotated[float, Field(ge=0)]  # infinite: no limit
Robots: TypeAlias = Annotated[int, Field(ge=1, description="Team size.")]

UNIONS = (Union, types.UnionType)
_SCALARS = (int, float, bool, str, type(None))
_COMPARED = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}


class SameResult:
    """Marks a parameter that changes no result, only the time: a number of threads.

    Runs of a study that differ in such parameters only are one run, where no seconds limit them.

    Examples
    --------
    >>> from typing import Annotated
    >>> from botohe_moo.algorithms import SameResult
    >>> def search(*, workers: Annotated[int, SameResult()] = 1): ...
    """


def resolved(annotation: Any, scope: Mapping[str, Any]) -> Any:
    """Evaluate an annotation that may be a text; ``Any`` where its names lead nowhere."""
    holder: Any = types.SimpleNamespace(__annotations__={"it": annotation})
    try:
        return typing.get_type_hints(holder, globalns=dict(scope), include_extras=True)["it"]
    except Exception:  # names that are for type checkers only, and whatever else a name may do
        return Any


def changes_nothing(hint: Any) -> bool:
    """Return whether a type is marked by :class:`SameResult`."""
    marks = getattr(hint, "__metadata__", ())
    return any(mark is SameResult or isinstance(mark, SameResult) for mark in marks) or (
        get_origin(hint) in (Annotated, *UNIONS) and any(map(changes_nothing, get_args(hint)))
    )


def range_text(hint: Any) -> str:
    """Return the range that an ``Annotated`` type states, such as ``in (0, 1)`` or ``>= 1``.

    It is empty where the type states none.
    """
    if get_origin(hint) in UNIONS:
        return " or ".join(filter(None, map(range_text, get_args(hint))))
    if get_origin(hint) is not Annotated:
        return ""
    bounds = _bounds(hint)
    low = next((name for name in ("ge", "gt") if name in bounds), "")
    high = next((name for name in ("le", "lt") if name in bounds), "")
    if low and high:
        opening, closing = "[" if low == "ge" else "(", "]" if high == "le" else ")"
        return f"in {opening}{bounds[low]}, {bounds[high]}{closing}"
    if name := low or high:
        return f"{_COMPARED[name]} {bounds[name]}"
    return range_text(get_args(hint)[0])


def _bounds(hint: Any) -> dict[str, str]:
    """Collect the bounds that constraints state, such as ``Ge(1)`` or a pydantic ``Field``."""
    return {
        name: bound_text(bound)
        for part in FieldInfo.from_annotation(hint).metadata
        for name in _COMPARED
        if (bound := getattr(part, name, None)) is not None
    }


def bound_text(bound: Any) -> str:
    """Write a bound; an integer that pydantic has made a float as an integer."""
    return str(int(bound)) if isinstance(bound, float) and bound.is_integer() else str(bound)


def type_text(hint: Any) -> str:
    """Write a type as in source, without its ``Annotated`` constraints."""
    origin, args = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return type_text(args[0])
    if origin in UNIONS:
        return " | ".join(map(type_text, args))
    if origin is Literal:
        return f"Literal[{', '.join(map(repr, args))}]"
    if isinstance(hint, type) and issubclass(hint, enum.Enum):
        return f"Literal[{', '.join(repr(member.value) for member in hint)}]"
    if hint in (None, type(None)):
        return "None"
    if hint is Ellipsis:
        return "..."
    if isinstance(hint, list):  # the arguments of a Callable
        return f"[{', '.join(map(type_text, hint))}]"
    name = getattr(origin or hint, "__name__", None) or str(hint)
    return f"{name}[{', '.join(map(type_text, args))}]" if args else name


def is_scalar(hint: Any) -> bool:
    """Return whether all values of a type are numbers, flags, texts or None."""
    origin, args = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return is_scalar(args[0])
    return all(map(is_scalar, args)) if origin in UNIONS else origin is Literal or hint in _SCALARS


def plain_number(value: Any) -> Any:
    """Return numpy's numbers, and other kinds of numbers, as Python's; anything else unchanged."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Integral):
        return value if isinstance(value, bool) else int(value)
    return float(value) if isinstance(value, Real) else value


def plain_value(value: Any) -> Any:
    """Write a value as a text file would hold it; ``NotImplemented`` for what none can hold."""
    if isinstance(value, enum.Enum):
        value = value.value
    elif isinstance(value, os.PathLike):
        value = os.fspath(value)
    elif isinstance(value, Number | np.generic):
        value = plain_number(value)
    if type(value) in _SCALARS:
        return value
    if isinstance(value, list | tuple):
        items = [plain_value(item) for item in value]
        return NotImplemented if any(item is NotImplemented for item in items) else items
    if isinstance(value, dict) and all(isinstance(key, str) for key in value):
        pairs = {key: plain_value(item) for key, item in value.items()}
        return NotImplemented if any(v is NotImplemented for v in pairs.values()) else pairs
    return NotImplemented


M = TypeVar("M", bound=BaseModel)
Error: TypeAlias = Mapping[str, Any]  # one of pydantic's `ErrorDetails`
Place: TypeAlias = tuple[Any, ...]  # the keys and indices that lead to a value

_EXPECTED = {
    "int_type": "to be an integer",
    "float_type": "to be a number",
    "bool_type": "to be true or false",
    "string_type": "to be a text",
    "none_required": "to be null",
    "list_type": "to be a list",
    "tuple_type": "to be a list",
    "dict_type": "to be a mapping",
    "mapping_type": "to be a mapping",
    "model_type": "to be a mapping",
    "literal_error": "to be {expected}",
    "enum": "to be {expected}",
    "is_instance_of": "to be of type {class}",
    "finite_number": "to be a finite number",
    "multiple_of": "to be a multiple of {multiple_of}",
    "greater_than": "> {gt}",
    "greater_than_equal": ">= {ge}",
    "less_than": "< {lt}",
    "less_than_equal": "<= {le}",
    "too_short": "to have {min_length} or more entries",
    "too_long": "to have at most {max_length} entries",
    "string_too_short": "to have {min_length} or more characters",
    "string_too_long": "to have at most {max_length} characters",
}
# A text that could be read as a number, and 1.5 for an integer, are values of another type.
_ALIKE = {"int_parsing": "int_type", "int_from_float": "int_type", "float_parsing": "float_type"}
_ALIKE |= {"bool_parsing": "bool_type", "int_parsing_size": "int_type"}
_BOUNDS = frozenset({"greater_than", "greater_than_equal", "less_than", "less_than_equal"})
_NUMBERS = frozenset({"int_type", "float_type", "finite_number"})


def fault_messages(name: str, value: Any, errors: Iterable[Error], bounds: str = "") -> list[str]:
    """Describe what is wrong with a value that is called ``name``, a message for each of its parts.

    ``bounds`` is the range that it has to be in, as :func:`range_text` gives it.
    """
    found: dict[Place, list[Error]] = {}
    for error in errors:
        found.setdefault(way_into(value, error["loc"]), []).append(error)
    # Of a union, the type that fits the deepest part was meant.
    depth = max(map(len, found), default=0)
    messages = []
    for way, those in found.items():
        if len(way) == depth:
            part = "".join(f"[{key!r}]" for key in way)
            messages.append(wrong_value(name + part, *those, bounds="" if way else bounds))
    return messages


def way_into(value: Any, location: Sequence[Any]) -> Place:
    """Leave out of a location what names types rather than parts of the value."""
    way = []
    for key in location:
        try:
            value = value[key]
        except (TypeError, LookupError):
            continue
        way.append(key)
    return tuple(way)


def own_message(error: Error) -> str:
    """Return what a validator raised, or else what pydantic says."""
    return str((error.get("ctx") or {}).get("error", error["msg"]))


def wrong_value(name: str, *errors: Error, bounds: str = "") -> str:
    """Describe what is wrong with one value, given an error for each type that it may have."""
    got = f"got {quoted(errors[0]['input'])}."
    kinds = [_ALIKE.get(error["type"], error["type"]) for error in errors]
    # Of two numeric types, nothing says which one the range belongs to.
    ranged = sum(kind in _BOUNDS or kind in _NUMBERS for kind in kinds) == 1
    phrases = []
    for kind, error in zip(kinds, errors, strict=True):
        details = error.get("ctx") or {}
        if kind == "missing":
            return f"Expected {name} to have {error['loc'][-1]!r}, {got}"
        if kind not in _EXPECTED:
            return f"{name}: {own_message(error).rstrip('.')}, {got}"
        phrase = _EXPECTED[kind].format(**{key: bound_text(d) for key, d in details.items()})
        if bounds and ranged and kind in _BOUNDS:
            phrase = bounds
        elif bounds and ranged and kind in _NUMBERS:
            phrase = f"{phrase} {bounds}"
        phrases.append(phrase)
    first, *rest = dict.fromkeys(phrases)
    expected = " or ".join([first, *(phrase.removeprefix("to be ") for phrase in rest)])
    return f"Expected {name} {expected}, {got}"


def content_faults(
    content: Any,
    invalid: ValidationError,
    known_keys: Callable[[Place], Sequence[str]] = lambda _: (),
) -> Iterator[tuple[Place, str]]:
    """Yield each place of a file's content at which something is wrong, and a sentence about it.

    ``known_keys`` returns the keys that the mapping at a place may have.
    """
    found: dict[Place, list[Error]] = {}
    for error in invalid.errors(include_url=False):
        place = way_into(content, error["loc"])
        if not place or error["type"] == "missing":
            place += error["loc"][-1:]  # a key that is not there
        found.setdefault(place, []).append(error)
    for place, errors in found.items():
        kind, name = errors[0]["type"], "the file"
        for key in place:
            name = key if isinstance(key, str) else f"{name}[{key}]"
        if kind == "missing":
            said = f"expected the key {name!r}, which is missing."
        elif kind == "extra_forbidden":
            known = ", ".join(nearest_first(name, known_keys(place[:-1])))
            said = f"there is no key {quoted(name)}{f'; known are {known}' if known else ''}."
        elif kind == "value_error":
            said = f"{own_message(errors[0]).rstrip('.')}."
        else:
            said = wrong_value(name, *errors).removeprefix(f"{name}: ")
        yield place, said


def validated(content: Any, model: type[M], line: Callable[[Place], int] | None = None) -> M:
    """Return the content of a file as a model; a FaultsError lists all faults.

    They begin with the line that ``line`` returns for the place of a fault.
    """
    try:
        return model.model_validate(content)
    except ValidationError as invalid:
        faults = []
        for place, said in content_faults(content, invalid):
            where = f"line {line(place)}: " if line else ""
            faults.append(f"{where}{said[0].lower()}{said[1:].rstrip('.')}")
        raise FaultsError(faults, "The file") from None


def json_record(path: Path, data: bytes, model: type[M]) -> M:
    """Return the content of a JSON file that this package wrote; a ValueError names one fault."""
    try:
        return model.model_validate_json(data)
    except ValidationError as error:
        first = error.errors()[0]
    if first["type"] == "json_invalid":
        raise ValueError(f"{path}: {first['msg']}.")
    way = first["loc"][:-1] if first["type"] == "missing" else first["loc"]
    name = ".".join(map(str, way)) or "its content"
    raise ValueError(f"{path}: {wrong_value(name, first)}")


Factory: TypeAlias = Callable[..., Any]

_EMPTY = inspect.Parameter.empty
_BY_KEYWORD = (inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)


@dataclass(frozen=True)
class Parameter:
    """One parameter of a factory, as its signature or model, and its docstring state it."""

    name: str
    default: Any = _EMPTY  # where a value must be given
    hint: Any = Any  # the type; ``Any`` where there is none, or its name leads nowhere
    annotation: str = ""  # the type as text
    description: str = ""
    own: bool = True  # else a method with ** hands it on to its class, maybe with another default
    by_model: bool = False  # whether a model checks and converts its values, all at once

    @property
    def range(self) -> str:
        """The range that its type states, such as ``in (0, 1)``; may be empty."""
        return range_text(self.hint)

    @property
    def required(self) -> bool:
        """Whether there is no default."""
        return self.default is _EMPTY

    @functools.cached_property
    def adapter(self) -> TypeAdapter[Any] | None:
        """The check of values by the type; None for types that pydantic does not know."""
        try:
            return TypeAdapter(self.hint, config=ConfigDict(arbitrary_types_allowed=True))
        except Exception:  # whatever another package's type does when it is looked at
            return None

    @functools.cached_property
    def plain(self) -> bool:
        """Whether numbers, flags, texts, or lists and mappings of them can be its value."""
        if self.adapter is None:
            return False
        try:
            # It warns of types in a union that JSON does not have; one that it has is enough.
            with warnings.catch_warnings(action="ignore"):
                return self.adapter.json_schema().get("type") != "null"  # which is no value
        except PydanticUserError:  # a class that is only known by isinstance
            return False

    @property
    def is_path(self) -> bool:
        """Whether its type is that of paths."""
        members = get_args(self.hint) if get_origin(self.hint) in UNIONS else (self.hint,)
        kinds = (get_origin(member) or member for member in members)
        return any(isinstance(kind, type) and issubclass(kind, os.PathLike) for kind in kinds)

    def checked(self, value: Any) -> tuple[Any, list[str]]:
        """Return a value as its type has it, and what keeps it from being of that type.

        pydantic's strict rules hold: "100" is not an integer, neither are 1.5 and True, but an
        integer is a number. What pydantic cannot check is accepted, and what a model checks.
        """
        if self.hint is Any or self.adapter is None or self.by_model:
            return value, []
        value = plain_number(value)
        try:
            return self.adapter.validate_python(value, strict=True), []
        except ValidationError as error:
            errors = error.errors(include_url=False)
            return value, fault_messages(self.name, value, errors, self.range)
        except Exception as error:  # whatever another package's validator raises
            return value, [f"{self.name}: {type(error).__name__}: {error}"]


def accepted_parameters(factory: Factory, *, hidden: Collection[str] = ()) -> tuple[Parameter, ...]:
    """List the parameters that a factory takes by name: a function, a class or a class method.

    A factory that is a class's method and takes any keywords, such as :meth:`BOACO.journal`,
    states what it changes, and its class the rest. The names in ``hidden`` cannot be given, and
    neither can names that are not stated, even to a factory that takes any.
    """
    if model := model_of(factory):
        return tuple(_model_parameters(model, factory))
    stated = {p.name: p for p in signature_parameters(factory)}
    owner = getattr(factory, "__self__", None)
    if isinstance(owner, type) and takes_any_name(factory):
        for parameter in accepted_parameters(owner):
            known = stated.get(parameter.name) or replace(parameter, own=False)
            # A factory often only refers to its class, which describes the meaning.
            described = parameter.description or known.description
            stated[parameter.name] = replace(known, description=described)
    return tuple(p for name, p in stated.items() if name not in hidden)


def model_of(factory: Factory) -> type[BaseModel] | None:
    """Return the pydantic model that states a factory's parameters, if there is one."""
    model = getattr(factory, "Parameters", None)
    return model if isinstance(model, type) and issubclass(model, BaseModel) else None


def _model_parameters(model: type[BaseModel], factory: Factory) -> Iterator[Parameter]:
    described = described_parameters(factory) | described_parameters(model)
    for name, field in model.model_fields.items():
        hint: Any = field.annotation
        for constraint in field.metadata:
            hint = Annotated[hint, constraint]
        default = _EMPTY if field.is_required() else field.get_default(call_default_factory=True)
        description = field.description or described.get(name, "")
        yield Parameter(name, default, hint, type_text(hint), description, by_model=True)


def takes_any_name(factory: Factory) -> bool:
    """Return whether a factory takes keywords that it does not state."""
    return any(p.kind is p.VAR_KEYWORD for p in _signature(factory).parameters.values())


def signature_parameters(function: Factory) -> Iterator[Parameter]:
    """Yield the parameters of a signature that can be given by name."""
    described = described_parameters(function)
    scope = _scope(function)
    for stated in _signature(function).parameters.values():
        if stated.kind not in _BY_KEYWORD:
            continue
        annotation = stated.annotation
        hint = Any if annotation is _EMPTY else resolved(annotation, scope)
        text = annotation if isinstance(annotation, str) else ""
        if hint is not Any or annotation is Any:
            text = type_text(hint)
        description = described.get(stated.name) or FieldInfo.from_annotation(hint).description
        yield Parameter(stated.name, stated.default, hint, text, description or "")


def _signature(function: Factory) -> inspect.Signature:
    try:
        return inspect.signature(function)
    except (TypeError, ValueError):  # some compiled callables have none
        return inspect.Signature()


def _scope(function: Any) -> Mapping[str, Any]:
    """Return the names that a function's annotations are evaluated with."""
    while isinstance(function, functools.partial):
        function = function.func
    if isinstance(function, type):
        function = function.__init__  # type: ignore[misc]
    elif not inspect.isroutine(function):
        function = type(function).__call__
    return getattr(inspect.unwrap(function), "__globals__", {})


def _docstring_of(function: Callable[..., Any]) -> str:
    """Return the docstring of a function or class, also of one with some arguments fixed."""
    # A partial would answer with what partials are.
    documented = function.func if isinstance(function, functools.partial) else function
    return inspect.getdoc(documented) or ""


def summary_of(function: Callable[..., Any]) -> str:
    """Return the paragraph that a docstring begins with, in one line; may be empty."""
    return " ".join(_docstring_of(function).partition("\n\n")[0].split())


def described_parameters(function: Callable[..., Any]) -> dict[str, str]:
    """Read the Parameters sections of the numpydoc docstrings of a function, or class and bases."""
    sources = function.__mro__[-2::-1] if isinstance(function, type) else (function,)
    described: dict[str, str] = {}
    for source in sources:
        described |= _described_by(source)
    return described


def _described_by(function: Callable[..., Any]) -> dict[str, str]:
    section = re.search(
        r"^Parameters\n-+\n(.*?)(?=^\S[^\n]*\n-+\n|\Z)", _docstring_of(function), re.M | re.S
    )
    described: dict[str, str] = {}
    names: list[str] = []
    for line in section[1].splitlines() if section else []:
        if line[:1].strip():
            names = [name.strip(" *") for name in line.partition(":")[0].split(",")]
        elif line.strip():
            for parameter in names:
                described[parameter] = f"{described.get(parameter, '')} {line.strip()}".strip()
    return described


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
    botohe_moo.base.messages.ParameterError: Expected depth in [1, 30], got 31.
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
