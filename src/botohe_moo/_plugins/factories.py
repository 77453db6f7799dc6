"""What ``module:name`` leads to: it is called only if it says that it makes what is wanted."""

import ast
import functools
import inspect
import pkgutil
import re
import sys
from collections.abc import Callable, Mapping
from types import MethodType, ModuleType
from typing import Annotated, Any, Self, get_args, get_origin

from botohe_moo._plugins.entry_points import PluginError, PluginGroup, imported
from botohe_moo._plugins.types import UNIONS

_CACHED = type(functools.cache(callable))


def is_path(name: str) -> bool:
    """Tell ``module:Class`` from a registered name."""
    return ":" in name or "." in name


def declared_factory(path: str, group: PluginGroup, wanted: type) -> Callable[..., Any]:
    """Import ``module:name`` or ``module.name``, and make sure that it may be called.

    Importing the module runs it. What is registered in the group may be called, too. A PluginError
    is raised if it cannot be imported, or does not say that it makes what is wanted.
    """
    package = re.split(r"[.:]", path)[0]
    found = None
    if package not in sys.stdlib_module_names:  # which makes nothing of this kind
        found = imported(functools.partial(named, path), "it")
        if says_it_makes(found, wanted) or group.name_of(found, package):
            return found  # type: ignore[no-any-return]
    what = f"{_described(found)} does not say" if found is not None else "nothing there says"
    kind = wanted.__name__
    article = "an" if kind[0] in "AEIOU" else "a"
    raise PluginError(
        f"it is not called, because {what} that it makes {article} {kind}; name a class derived "
        f"from {kind}, state what the function returns (-> {kind}), or register it as entry point "
        f"of {group.group!r}"
    )


def named(path: str) -> Any:
    """Import ``module:name`` or ``module.name``, such as a class's attribute, and call nothing.

    An ImportError, AttributeError or ValueError is raised if there is no such thing, or the path
    leads through anything but modules and classes, or through names such as ``__class__``.
    """
    if hidden := re.search(r"(?<![^.:])__\w*", path):
        raise ValueError(f"names such as {hidden[0]!r} are not for this")
    module, colon, names = path.partition(":")
    rest = names.split(".") if colon else []
    found = _module(module) if colon else None
    if found is None:
        module, *rest = module.split(".")
        found = _module(module)
        while rest and (deeper := _module(f"{module}.{rest[0]}", maybe=True)):
            module, found = f"{module}.{rest.pop(0)}", deeper
    for name in rest:
        found = _attribute(found, name)
    return found


def _module(name: str, *, maybe: bool = False) -> Any:
    try:
        return pkgutil.resolve_name(f"{name}:")
    except ModuleNotFoundError as error:
        if maybe and error.name == name:
            return None
        raise


def _attribute(owner: Any, name: str) -> Any:
    if not isinstance(owner, type | ModuleType):
        raise AttributeError(f"{name!r} is looked for in {_described(owner)}")
    found = getattr(owner, name)
    if isinstance(owner, type) and inspect.isfunction(found):
        kinds = (vars(base)[name] for base in owner.__mro__ if name in vars(base))
        if not isinstance(next(kinds, None), staticmethod):
            raise AttributeError(f"{name!r} is a method of the instances of {_described(owner)}")
    return found


def says_it_makes(factory: Any, wanted: type) -> bool:
    """Tell whether something says that calling it makes what is wanted; it is not called.

    Classes say it, functions and class methods whose annotation names ``wanted``, a class derived
    from it or ``Self``, and what ``functools.partial`` and ``functools.cache`` make of them.
    """
    while type(factory) in (functools.partial, _CACHED):
        factory = factory.func if type(factory) is functools.partial else factory.__wrapped__
    if isinstance(factory, type):
        return issubclass(factory, wanted)
    owner = factory.__self__ if isinstance(factory, MethodType) else None
    if isinstance(factory, MethodType):
        factory = factory.__func__
    if not isinstance(owner, type | None) or not inspect.isfunction(factory):
        return False
    factory = inspect.unwrap(factory)  # in whose module the names of its annotations are
    stated = factory.__annotations__.get("return")
    return _is_kind(stated, wanted, factory.__globals__, owner)


def _is_kind(stated: Any, wanted: type, scope: Mapping[str, Any], owner: type | None) -> bool:
    """Tell whether an annotation stands for classes that are wanted."""
    while isinstance(stated, str):  # one within the other, where a quoted one is postponed, too
        try:
            stated = _looked_up(ast.parse(stated.strip(), mode="eval").body, scope)
        except (SyntaxError, ValueError, RecursionError, MemoryError, LookupError, AttributeError):
            return False
    if isinstance(stated, list) or get_origin(stated) in UNIONS:
        members = stated if isinstance(stated, list) else get_args(stated)
        return all(_is_kind(member, wanted, scope, owner) for member in members)
    if get_origin(stated) is Annotated:
        return _is_kind(get_args(stated)[0], wanted, scope, owner)
    if stated is Self:
        return owner is not None and issubclass(owner, wanted)
    return isinstance(stated, type) and issubclass(stated, wanted)


def _looked_up(node: ast.expr, scope: Mapping[str, Any]) -> Any:
    """Find what names in an annotation stand for, without evaluating anything; a union as list."""
    if isinstance(node, ast.Name):
        return scope[node.id]
    if isinstance(node, ast.Attribute):
        return _attribute(_looked_up(node.value, scope), node.attr)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitOr):
        return [_looked_up(node.left, scope), _looked_up(node.right, scope)]
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    raise LookupError


def _described(found: Any) -> str:
    """Say what something is without asking it: its own ``__repr__`` is code, too."""
    if isinstance(found, type):
        return f"the class {found.__module__}.{found.__qualname__}"
    if inspect.isroutine(found):
        return f"the function {getattr(found, '__qualname__', '')}"
    if isinstance(found, ModuleType):
        return f"the module {found.__name__}"
    return f"an object of type {type(found).__qualname__}"
