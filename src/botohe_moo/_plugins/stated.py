"""What a factory of algorithms or missions can be given, as it states it itself.

By its signature and docstring, or by a pydantic model: the attribute ``Parameters``.
"""

import functools
import inspect
import os
import re
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, TypeAlias, get_args, get_origin

from pydantic import BaseModel, ConfigDict, PydanticUserError, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from botohe_moo._plugins.faults import fault_messages
from botohe_moo._plugins.types import UNIONS, plain_number, range_text, resolved, type_text

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
