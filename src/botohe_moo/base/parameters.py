"""Typed parameters: what a factory states, their check by pydantic, and its errors in words."""

import functools
import inspect
import json
import re
import types
import typing
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Annotated, Any, ParamSpec, TypeAlias, TypeVar, get_args, get_origin

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

# Ranges that several algorithms, operators and missions declare.
Count: TypeAlias = Annotated[int, Field(ge=1, le=1_000_000)]
Size: TypeAlias = Annotated[int, Field(ge=1)]
Probability: TypeAlias = Annotated[float, Field(ge=0, le=1)]
Positive: TypeAlias = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative: TypeAlias = Annotated[float, Field(ge=0, allow_inf_nan=False)]
TravelBudget: TypeAlias = Annotated[float, Field(ge=0)]  # infinite: no limit
Robots: TypeAlias = Annotated[int, Field(ge=1, description="Team size.")]

_EMPTY = inspect.Parameter.empty
# What a JSON Schema calls bounds.
_BOUNDS = {"minimum": ">=", "exclusiveMinimum": ">", "maximum": "<=", "exclusiveMaximum": "<"}
# What pydantic's messages say, and what is said here.
_WORDS = {
    "be greater than or equal to": ">=",
    "be greater than": ">",
    "be less than or equal to": "<=",
    "be less than": "<",
    "a valid integer": "an integer",
    "a valid boolean": "true or false",
    "a valid string": "a text",
    "a valid tuple": "a list",
    "a valid dictionary": "a mapping",
    "a valid ": "a ",
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
    def required(self) -> bool:
        """Whether there is no default."""
        return self.default is _EMPTY

    @functools.cached_property
    def adapter(self) -> TypeAdapter[Any]:
        """The check of values by the type; types that pydantic does not know are not checked."""
        try:
            return TypeAdapter(self.hint, config=ConfigDict(arbitrary_types_allowed=True))
        except Exception:  # whatever another package's type does when it is looked at
            return TypeAdapter(Any)

    @functools.cached_property
    def schema(self) -> dict[str, Any]:
        """The JSON Schema of the type; that of null for types without one."""
        try:
            # It warns of types in a union that JSON does not have; one that it has is enough.
            with warnings.catch_warnings(action="ignore"):
                return self.adapter.json_schema()
        except PydanticUserError:  # a class that is only known by isinstance
            return {"type": "null"}

    @property
    def plain(self) -> bool:
        """Whether numbers, flags, texts, or lists and mappings of them can be its value."""
        return self.schema.get("type") != "null"

    @property
    def is_scalar(self) -> bool:
        """Whether all its values are numbers, flags, texts or None."""
        kinds = self.annotation.split(" | ")
        return all(re.fullmatch(r"int|float|bool|str|None|Literal\[.*\]", kind) for kind in kinds)

    @property
    def range(self) -> str:
        """The range that its type states, such as ``in (0, 1)``; may be empty."""
        members = self.schema.get("anyOf", [self.schema])
        return " or ".join(filter(None, map(_range_text, members)))

    def checked(self, value: Any) -> tuple[Any, list[str]]:
        """Return a value as its type has it, and what keeps it from being of that type.

        pydantic's strict rules hold: "100" is not an integer, neither are 1.5 and True, but an
        integer is a number. numpy's numbers become Python's.
        """
        value = value.item() if isinstance(value, np.generic) else value
        try:
            return self.adapter.validate_python(value, strict=True), []
        except ValidationError as invalid:
            found = faults_in(value, invalid, name=self.name, bounds=self.range)
            return value, [said for _, said in found]

    def check(self, value: Any) -> Any:
        """Return a value as its type has it, or raise a ParameterError."""
        value, faults = self.checked(value)
        if faults:
            raise m.ParameterError(" ".join(faults), self.name)
        return value


def check(name: str, value: Any, hint: Any, **bounds: Any) -> Any:
    """Return a value as its type has it, or raise the ParameterError that says what was expected.

    >>> check("depth", 31, int, ge=1, le=30)
    Traceback (most recent call last):
    botohe_moo.base.messages.ParameterError: Expected depth in [1, 30], got 31.
    """
    return _parameter(name, hint, **bounds).check(value)


@functools.lru_cache(maxsize=256)  # some are checked in every iteration of a search
def _parameter(name: str, hint: Any, **bounds: Any) -> Parameter:
    return Parameter(name, hint=Annotated[hint, Field(**bounds)] if bounds else hint)


def check_weights(
    name: str, given: Any, known: Collection[str], *, needed: str = ""
) -> dict[str, float]:
    """Return a mapping from known names to weights >= 0, or raise a ParameterError.

    With ``needed``, what one of them is called, some weight has to be above 0.
    """
    weights: dict[str, float] = check(name, given, Mapping[str, NotNegative])
    for each in weights:
        m.check_choice(name, each, known)
    if needed and not any(weights.values()):
        raise m.ParameterError(f"Expected a {needed} of weight above 0, got {given}.", name)
    return weights


def accepted_parameters(factory: Factory, *, hidden: Collection[str] = ()) -> tuple[Parameter, ...]:
    """List the parameters that a factory takes by name: a function, a class or a class method.

    A class method that takes any keywords, such as :meth:`BOACO.journal`, states what it changes,
    and its class the rest. The names in ``hidden`` cannot be given, and neither can names that are
    not stated, even to a factory that takes any.
    """
    stated = {p.name: p for p in signature_parameters(factory)}
    owner = getattr(factory, "__self__", None)
    if isinstance(owner, type) and takes_any_name(factory):
        for each in accepted_parameters(owner):
            known = stated.get(each.name) or replace(each, own=False)
            # A factory often only refers to its class, which describes the meaning.
            stated[each.name] = replace(known, description=each.description or known.description)
    return tuple(p for name, p in stated.items() if name not in hidden)


def takes_any_name(factory: Factory) -> bool:
    """Return whether a factory takes keywords that it does not state."""
    return any(p.kind is p.VAR_KEYWORD for p in inspect.signature(factory).parameters.values())


def signature_parameters(function: Factory) -> Iterator[Parameter]:
    """Yield the parameters of a signature that can be given by name."""
    described = _described_parameters(function)
    for stated in inspect.signature(function).parameters.values():
        if stated.kind not in (stated.KEYWORD_ONLY, stated.POSITIONAL_OR_KEYWORD):
            continue
        annotation = stated.annotation
        hint = Any if annotation is _EMPTY else resolved(annotation, scope_of(function))
        text = "" if annotation is _EMPTY else type_text(hint)
        description = described.get(stated.name) or FieldInfo.from_annotation(hint).description
        yield Parameter(stated.name, stated.default, hint, text, description or "")


def scope_of(function: Any) -> Mapping[str, Any]:
    """Return the names that a function's annotations are evaluated with."""
    function = getattr(function, "func", function)  # of a partial
    made_by: Any = function.__init__ if isinstance(function, type) else function  # type: ignore[misc]
    return getattr(inspect.unwrap(made_by), "__globals__", {})


def _docstring_of(function: Factory) -> str:
    # A partial would answer with what partials are.
    return inspect.getdoc(getattr(function, "func", function)) or ""


def summary_of(function: Factory) -> str:
    """Return the paragraph that a docstring begins with, in one line; may be empty."""
    return " ".join(_docstring_of(function).partition("\n\n")[0].split())


def _described_parameters(function: Factory) -> dict[str, str]:
    """Read what the numpydoc docstrings of a function, or a class and its bases, say of names."""
    described: dict[str, str] = {}
    for source in function.__mro__[:-1] if isinstance(function, type) else (function,):
        for entry in re.split(r"\n(?=\S)", _docstring_of(source)):
            head, _, text = entry.partition("\n")
            for name in head.partition(":")[0].split(",") if text else ():
                described.setdefault(name.strip(" *"), " ".join(text.split()))
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
    marks = hint is SameResult or isinstance(hint, SameResult)
    return marks or any(map(changes_nothing, get_args(hint)))


def _range_text(schema: Mapping[str, Any]) -> str:
    """Return the range that a JSON Schema states, such as ``in (0, 1)`` or ``>= 1``; or nothing."""
    match [(key, schema[key]) for key in _BOUNDS if key in schema]:
        case [(low, least), (high, most)]:
            start, end = "[" if low == "minimum" else "(", "]" if high == "maximum" else ")"
            return f"in {start}{least}, {most}{end}"
        case [(key, bound)]:
            return f"{_BOUNDS[key]} {bound}"
    return ""


def type_text(hint: Any) -> str:
    """Write a type as in source, without its ``Annotated`` constraints and names of modules."""
    holder: Any = types.SimpleNamespace(__annotations__={"it": hint})
    bare = typing.get_type_hints(holder)["it"]
    if get_origin(bare) in (typing.Union, types.UnionType):
        return " | ".join(map(type_text, get_args(bare)))
    text = inspect.formatannotation(bare).replace("NoneType", "None")
    return re.sub(r"[\w.]+\.(?=[A-Za-z_])", "", text)


def plain_value(value: Any) -> Any:
    """Write a value as a text file would hold it; ``NotImplemented`` for what none can hold."""
    try:
        return json.loads(json.dumps(value, default=np.generic.item))
    except (TypeError, ValueError):
        return NotImplemented


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
        The range that the content has to be in, such as ``in (0, 1)``.
    known_keys
        Returns the keys that the mapping at a place may have.
    """
    found: dict[Place, list[Any]] = {}
    for error in invalid.errors(include_url=False):
        place = _way_into(content, error["loc"])
        if error["type"] == "missing":
            place += error["loc"][-1:]
        found.setdefault(place, []).append(error)
    faults = []
    for place, errors in found.items():
        if any(place == deeper[: len(place)] != deeper for deeper in found):
            continue  # of a union, the type that fits a deeper part was meant
        called = name + "".join(f"[{key!r}]" for key in place) if name else _key_of(place)
        phrases = dict.fromkeys(_expected(error, "" if place else bounds) for error in errors)
        kind, message = errors[0]["type"], errors[0]["msg"].removeprefix("Value error, ")
        if kind == "missing":
            said = f"expected the key {called!r}, which is missing."
        elif kind == "extra_forbidden":
            known = ", ".join(m.nearest_first(called, known_keys(place[:-1])))
            said = f"there is no key {m.quoted(called)}{f'; known are {known}' if known else ''}."
        elif "" in phrases:
            said = f"{name}{name and ': '}{message.rstrip('.')}."
        else:
            expected = " or ".join(phrases).replace(" or to be ", " or ")
            said = f"Expected {called} {expected}, got {m.quoted(errors[0]['input'])}."
        faults.append((place, said))
    return faults


def _way_into(value: Any, location: Sequence[Any]) -> Place:
    """Leave out of a location what names types rather than parts of the value."""
    way = []
    for key in location:
        with suppress(TypeError, LookupError):
            value = value[key]
            way.append(key)
    return tuple(way)


def _key_of(place: Place) -> str:
    """Name a place of a file by its last key, and the indices behind it."""
    name = "the file"
    for key in place:
        name = key if isinstance(key, str) else f"{name}[{key}]"
    return name


def _expected(error: Any, bounds: str) -> str:
    """Say what one of pydantic's errors expected; nothing if only its own message says it."""
    said = error["msg"].partition(" should ")[2]
    for theirs, ours in _WORDS.items():
        said = said.replace(theirs, ours)
    said = re.split(", (?:got|unable|error)| after validation| or instance of", said)[0]
    if said.startswith(("<", ">")):
        return bounds or said
    whole = said.endswith(("number", "integer"))
    return f"to {said} {bounds if whole else ''}".rstrip() if said else ""


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
    try:
        if isinstance(data := content, bytes):
            content = read_json(data)
            return model.model_validate_json(data)
        return model.model_validate(content)
    except ValidationError as invalid:
        faults = []
        for place, said in faults_in(content, invalid):
            where = f"line {line(place)}" if line else ".".join(map(str, place[:-1]))
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
    # Listed at the first call, since it would slow imports down.
    scalars = functools.cache(lambda: [p for p in signature_parameters(function) if p.is_scalar])

    @functools.wraps(function)
    def call(*args: P.args, **given: P.kwargs) -> R:
        for each in scalars():
            if each.name in given:
                given[each.name] = each.check(given[each.name])
        return function(*args, **given)

    return call


def check_keywords(kind: type, given: Iterable[str], known: Iterable[str]) -> None:
    """Refuse, with a TypeError, keywords that a class neither states nor knows otherwise."""
    known = {*known, *(p.name for p in signature_parameters(kind))}
    for name in given:
        if name not in known:
            raise TypeError(f"{kind.__name__}: {m.unknown_parameter(name, known)}")


def call_factory(
    source: str,
    factory: Factory,
    accepted: Sequence[Parameter],
    values: Mapping[str, Any],
    *,
    wanted: type = object,
) -> Any:
    """Call a factory with checked values.

    A ParameterError lists what is unknown or refused, and a PluginError says that the factory has
    not returned what is ``wanted``. Messages begin with ``source``. A FaultsError of the factory is
    not changed.
    """
    known = {parameter.name for parameter in accepted}
    faults: list[m.Fault] = [
        (str(name), m.unknown_parameter(name, known)) for name in values if name not in known
    ]
    for parameter in accepted:
        value = values.get(parameter.name, parameter.default)
        if value is not parameter.default:
            faults += [(parameter.name, said) for said in parameter.checked(value)[1]]
    if faults:
        raise m.ParameterError(" ".join(s for _, s in faults), faults[0][0], faults, source)
    try:
        made = factory(**values)
    except m.FaultsError:
        raise
    except (TypeError, ValueError) as error:
        said = str(error).removeprefix(f"{source}: ")
        raise m.ParameterError(said, getattr(error, "parameter", None), source=source) from error
    if not isinstance(made, wanted):
        expected = f"expected an object of type {wanted.__name__}"
        raise m.PluginError(f"{source}: {expected}, got {m.quoted(made)}.")
    return made


def raised_faults(make: Callable[..., Any], values: Mapping[str, Any]) -> list[m.Fault]:
    """List everything that keeps something from being made with values; it is made to see that."""
    try:
        make(**values)
    except (Exception, SystemExit) as error:  # whatever another package's code may raise
        kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
        faults = getattr(error, "faults", [f"{kind}{error}"])
        return [fault if isinstance(fault, tuple) else (None, fault) for fault in faults]
    return []
