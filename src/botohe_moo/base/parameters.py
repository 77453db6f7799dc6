"""Typed parameters: what a factory states, their check by pydantic, and its errors in words."""

import functools
import inspect
import os
import re
import types
import typing
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Integral, Real
from typing import Annotated, Any, Literal, ParamSpec, TypeAlias, TypeVar, get_args, get_origin

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, PydanticUserError, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from botohe_moo.base import messages as m
from botohe_moo.base.files import read_json

P = ParamSpec("P")
R = TypeVar("R")
M = TypeVar("M", bound=BaseModel)
Factory: TypeAlias = Callable[..., Any]
Place: TypeAlias = tuple[Any, ...]  # the keys and indices that lead to a value
# The parameter that is wrong, or None for all together, and what is wrong with it.
Fault: TypeAlias = tuple[str | None, str]

# Ranges that several algorithms, operators and missions declare.
Count: TypeAlias = Annotated[int, Field(ge=1, le=1_000_000)]
Size: TypeAlias = Annotated[int, Field(ge=1)]
Probability: TypeAlias = Annotated[float, Field(ge=0, le=1)]
Positive: TypeAlias = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative: TypeAlias = Annotated[float, Field(ge=0, allow_inf_nan=False)]
TravelBudget: TypeAlias = Annotated[float, Field(ge=0)]  # infinite: no limit
Robots: TypeAlias = Annotated[int, Field(ge=1, description="Team size.")]

UNIONS = (typing.Union, types.UnionType)
_SCALARS = (int, float, bool, str, type(None))
_EMPTY = inspect.Parameter.empty
_COMPARED = {"ge": ">=", "gt": ">", "le": "<=", "lt": "<"}
# What pydantic calls "a valid ...", where that has another name here.
_VALID = {
    "integer": "an integer",
    "boolean": "true or false",
    "string": "a text",
    "tuple": "a list",
    "dictionary": "a mapping",
}


class SameResult:
    """Marks a parameter that changes no result, only the time: a number of threads.

    Runs of a study that differ in such parameters only are one run, where no seconds limit them.

    Examples
    --------
    >>> from typing import Annotated
    >>> from botohe_moo.algorithms import SameResult
    >>> def search(*, workers: Annotated[int, SameResult()] = 1): ...
    """


@dataclass(frozen=True)
class Parameter:
    """One parameter of a factory, as its signature and its docstring state it."""

    name: str
    default: Any = _EMPTY  # where a value must be given
    hint: Any = Any  # the type; ``Any`` where there is none, or its name leads nowhere
    annotation: str = ""  # the type as text
    description: str = ""
    own: bool = True  # else a method with ** hands it on to its class, maybe with another default

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
        try:
            # It warns of types in a union that JSON does not have; one that it has is enough.
            with warnings.catch_warnings(action="ignore"):
                schema = self.adapter.json_schema() if self.adapter else {"type": "null"}
        except PydanticUserError:  # a class that is only known by isinstance
            return False
        return schema.get("type") != "null"

    @property
    def is_path(self) -> bool:
        """Whether its type is that of paths."""
        members = get_args(self.hint) if get_origin(self.hint) in UNIONS else (self.hint,)
        kinds = (get_origin(member) or member for member in members)
        return any(isinstance(kind, type) and issubclass(kind, os.PathLike) for kind in kinds)

    def checked(self, value: Any) -> tuple[Any, list[str]]:
        """Return a value as its type has it, and what keeps it from being of that type.

        pydantic's strict rules hold: "100" is not an integer, neither are 1.5 and True, but an
        integer is a number. What pydantic cannot check is accepted.
        """
        if self.adapter is None:
            return value, []
        value = plain_number(value)
        try:
            return self.adapter.validate_python(value, strict=True), []
        except ValidationError as invalid:
            found = faults_in(value, invalid, name=self.name, bounds=self.range)
            return value, [said for _, said in found]


def accepted_parameters(factory: Factory, *, hidden: Collection[str] = ()) -> tuple[Parameter, ...]:
    """List the parameters that a factory takes by name: a function, a class or a class method.

    A class method that takes any keywords, such as :meth:`BOACO.journal`, states what it changes,
    and its class the rest. The names in ``hidden`` cannot be given, and neither can names that are
    not stated, even to a factory that takes any.
    """
    stated = {p.name: p for p in signature_parameters(factory)}
    owner = getattr(factory, "__self__", None)
    if isinstance(owner, type) and takes_any_name(factory):
        for parameter in accepted_parameters(owner):
            known = stated.get(parameter.name) or replace(parameter, own=False)
            # A factory often only refers to its class, which describes the meaning.
            described = parameter.description or known.description
            stated[parameter.name] = replace(known, description=described)
    return tuple(p for name, p in stated.items() if name not in hidden)


def takes_any_name(factory: Factory) -> bool:
    """Return whether a factory takes keywords that it does not state."""
    return any(p.kind is p.VAR_KEYWORD for p in _signature(factory).parameters.values())


def signature_parameters(function: Factory) -> Iterator[Parameter]:
    """Yield the parameters of a signature that can be given by name."""
    described = _described_parameters(function)
    scope = _scope(function)
    for stated in _signature(function).parameters.values():
        if stated.kind not in (stated.KEYWORD_ONLY, stated.POSITIONAL_OR_KEYWORD):
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


def _docstring_of(function: Factory) -> str:
    # A partial would answer with what partials are.
    return inspect.getdoc(getattr(function, "func", function)) or ""


def summary_of(function: Factory) -> str:
    """Return the paragraph that a docstring begins with, in one line; may be empty."""
    return " ".join(_docstring_of(function).partition("\n\n")[0].split())


def _described_parameters(function: Factory) -> dict[str, str]:
    """Read the Parameters sections of the numpydoc docstrings of a function, or class and bases."""
    described: dict[str, str] = {}
    for source in function.__mro__[-2::-1] if isinstance(function, type) else (function,):
        section = re.search(
            r"^Parameters\n-+\n(.*?)(?=^\S[^\n]*\n-+\n|\Z)", _docstring_of(source), re.M | re.S
        )
        for entry in re.split(r"\n(?=\S)", section[1]) if section else ():
            head, _, text = entry.partition("\n")
            names = [name.strip(" *") for name in head.partition(":")[0].split(",")]
            described |= dict.fromkeys(names, " ".join(text.split()))
    return described


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
    parts = FieldInfo.from_annotation(hint).metadata
    stated = [(name, getattr(part, name, None)) for name in _COMPARED for part in parts]
    match [(name, _bound_text(bound)) for name, bound in stated if bound is not None]:
        case [(low, least), (high, most)]:
            return f"in {'[' if low == 'ge' else '('}{least}, {most}{']' if high == 'le' else ')'}"
        case [(name, bound)]:
            return f"{_COMPARED[name]} {bound}"
    return range_text(get_args(hint)[0])


def _bound_text(bound: Any) -> str:
    """Write a bound; an integer that pydantic has made a float as an integer."""
    return str(int(bound)) if isinstance(bound, float) and bound.is_integer() else str(bound)


def type_text(hint: Any) -> str:
    """Write a type as in source, without its ``Annotated`` constraints and names of modules."""
    holder: Any = types.SimpleNamespace(__annotations__={"it": hint})
    bare = typing.get_type_hints(holder)["it"]
    if get_origin(bare) in UNIONS:
        return " | ".join(map(type_text, get_args(bare)))
    text = inspect.formatannotation(bare).replace("NoneType", "None")
    return re.sub(r"[\w.]+\.(?=[A-Za-z_])", "", text)


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
    if isinstance(value, bool) or not isinstance(value, Real):
        return value
    return int(value) if isinstance(value, Integral) else float(value)


def plain_value(value: Any) -> Any:
    """Write a value as a text file would hold it; ``NotImplemented`` for what none can hold."""
    if isinstance(value, os.PathLike):
        value = os.fspath(value)
    if isinstance(value, list | tuple):
        items = [plain_value(item) for item in value]
        return NotImplemented if any(item is NotImplemented for item in items) else items
    if isinstance(value, dict) and all(isinstance(key, str) for key in value):
        items = plain_value([*value.values()])
        return items if items is NotImplemented else dict(zip(value, items, strict=True))
    value = plain_number(value)
    return value if type(value) in _SCALARS else NotImplemented


def faults_in(
    content: Any,
    invalid: ValidationError,
    *,
    name: str = "",
    bounds: str = "",
    known_keys: Callable[[Place], Sequence[str]] = lambda _: (),
) -> list[tuple[Place, str]]:
    """List the places of content at which something is wrong, and a sentence about each.

    Parameters
    ----------
    content
        What pydantic has refused: a value, or the content of a file.
    invalid
        Its errors.
    name
        What the content is called: the name of a parameter. Without it, places are called by their
        own keys, as in a file.
    bounds
        The range that the content has to be in, as :func:`range_text` gives it.
    known_keys
        Returns the keys that the mapping at a place may have.
    """
    found: dict[Place, list[Any]] = {}
    for error in invalid.errors(include_url=False):
        place = _way_into(content, error["loc"])
        if not (place or name) or error["type"] == "missing":
            place += error["loc"][-1:]  # a key that is not there
        found.setdefault(place, []).append(error)
    faults = []
    for place, errors in found.items():
        if any(place == deeper[: len(place)] != deeper for deeper in found):
            continue  # of a union, the type that fits a deeper part was meant
        called = name + "".join(f"[{key!r}]" for key in place) if name else _key_of(place)
        kind, own = errors[0]["type"], str((errors[0].get("ctx") or {}).get("error", ""))
        if kind == "missing":
            said = f"expected the key {_key_of(place)!r}, which is missing."
        elif kind == "extra_forbidden":
            known = ", ".join(m.nearest_first(called, known_keys(place[:-1])))
            said = f"there is no key {m.quoted(called)}{f'; known are {known}' if known else ''}."
        elif not _expected(errors[0]):
            said = f"{own or errors[0]['msg']}".rstrip(".") + "."
            said = f"{name}: {said}" if name else said
        else:
            whole = "" if place else bounds
            phrases = dict.fromkeys(_expected(error, whole) for error in errors)
            expected = " or ".join(phrases).replace(" or to be ", " or ")
            said = f"Expected {called} {expected}, got {m.quoted(errors[0]['input'])}."
        faults.append((place, said))
    return faults


def _way_into(value: Any, location: Sequence[Any]) -> Place:
    """Leave out of a location what names types rather than parts of the value."""
    way = []
    for key in location:
        try:
            value = value[key]
        except (TypeError, LookupError):
            continue
        way.append(key)
    return tuple(way)


def _key_of(place: Place) -> str:
    """Name a place of a file by its last key, and the indices behind it."""
    name = "the file"
    for key in place:
        name = key if isinstance(key, str) else f"{name}[{key}]"
    return name


def _expected(error: Any, bounds: str = "") -> str:
    """Say what one of pydantic's errors expected; nothing if only its own message says it."""
    for name, bound in (error.get("ctx") or {}).items():
        if name in _COMPARED:
            return bounds or f"{_COMPARED[name]} {_bound_text(bound)}"
    _, should, said = error["msg"].partition(" should ")
    said = re.sub("(, (got|unable|error)| after validation| or instance of).*", "", said)
    said = re.sub(r"a valid (\w+)", lambda found: _VALID.get(found[1], f"a {found[1]}"), said)
    said = f"to {said}" if should else ""
    return f"{said} {bounds}" if bounds and said.endswith(("number", "integer")) else said


def validated(
    content: Any,
    model: type[M],
    line: Callable[[Place], int] | None = None,
    source: str = "The file",
) -> M:
    """Return the content of a file, or the bytes of a JSON file, as a model.

    A FaultsError of ``source`` lists all faults, each with the line that ``line`` returns for its
    place, or with the keys that lead to it.
    """
    data = content if isinstance(content, bytes) else None
    try:
        if data is None:
            return model.model_validate(content)
        content = read_json(data)
        return model.model_validate_json(data)
    except ValidationError as invalid:
        faults = []
        for place, said in faults_in(content, invalid):
            above = place[
                : max((i for i, key in enumerate(place) if isinstance(key, str)), default=0)
            ]
            where = f"line {line(place)}" if line else ".".join(map(str, above))
            faults.append(f"{where}{where and ': '}{said[0].lower()}{said[1:].rstrip('.')}")
        raise m.FaultsError(faults, source) from None
    except ValueError as error:
        raise m.FaultsError(str(error), source) from None


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
        faults: list[Fault] = []
        for parameter in _scalars(function):
            name = parameter.name
            if name in given:
                given[name], said = parameter.checked(given[name])
                faults += [(name, each) for each in said]
        if faults:
            raise m.ParameterError(" ".join(said for _, said in faults), faults[0][0])
        return function(*args, **given)

    return call


@functools.cache
def _scalars(function: Factory) -> tuple[Parameter, ...]:
    """List the parameters that are checked; at the first call, since it would slow imports down."""
    return tuple(p for p in signature_parameters(function) if is_scalar(p.hint))


def check_keywords(given: Iterable[str], known: Collection[str], kinds: Sequence[type]) -> None:
    """Refuse keywords that are not known.

    The TypeError names the first of the classes that does not state the keyword itself, which it
    would then have handed on, and lists what that class states.
    """
    for name in given:
        if name not in known:
            stated = {kind: {p.name for p in signature_parameters(kind)} for kind in kinds}
            refusing = next((kind for kind in kinds if name not in stated[kind]), kinds[-1])
            among = ", ".join(m.nearest_first(name, {*known, *stated[refusing]}))
            raise TypeError(f"{refusing.__name__} has no parameter {name!r}; known are {among}.")


def call_factory(
    source: str,
    factory: Factory,
    accepted: Sequence[Parameter],
    values: Mapping[str, Any],
    *,
    wanted: type = object,
    also: Collection[str] = (),
) -> Any:
    """Call a factory with checked values.

    A ParameterError lists what is unknown, missing or refused, and a PluginError says that the
    factory has not returned what is ``wanted``. Messages begin with ``source``, and list the names
    in ``also`` as known. A FaultsError of the factory is not changed.
    """
    known = {*also, *(parameter.name for parameter in accepted)}
    faults: list[Fault] = [
        (str(name), m.unknown_parameter(name, known)) for name in values if name not in known
    ]
    for parameter in accepted:
        name, value = parameter.name, values.get(parameter.name, parameter.default)
        if value is _EMPTY:
            faults.append((name, f"missing a required parameter {name!r}."))
        elif value is not parameter.default:
            faults += [(name, said) for said in parameter.checked(value)[1]]
    if faults:
        raise m.ParameterError(" ".join(s for _, s in faults), faults[0][0], faults, source)
    try:
        made = factory(**values)
    except m.FaultsError:
        raise
    except (TypeError, ValueError) as error:
        said = str(error).removeprefix(f"{source}: ")
        # It is about the parameter that it holds, or the one with which its message begins.
        first = said.removeprefix("Expected ").partition(" ")[0].rstrip(":,")
        name = (getattr(error, "parameter", None) or first).partition("[")[0]
        raise m.ParameterError(said, name if name in values else None, source=source) from error
    if not isinstance(made, wanted):
        expected = f"expected an object of type {wanted.__name__}"
        raise m.PluginError(f"{source}: {expected}, got {m.quoted(made)}.")
    return made


def raised_faults(make: Callable[..., Any], values: Mapping[str, Any]) -> list[Fault]:
    """List everything that keeps something from being made with values; it is made to see that."""
    try:
        make(**values)
    except m.FaultsError as error:
        return [(None, fault) for fault in error.faults]
    except m.ParameterError as error:
        return [*error.faults]
    except (Exception, SystemExit) as error:  # whatever another package's code may raise
        kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
        return [(None, f"{kind}{error}")]
    return []
