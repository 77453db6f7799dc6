"""What ``module:name`` leads to: it is called only if it states that it makes what is wanted."""

import functools
import inspect
import pkgutil
from collections.abc import Callable
from types import MethodType
from typing import Annotated, Any, Self, get_args, get_origin

from botohe_moo._plugins.entry_points import PluginError, PluginGroup, imported
from botohe_moo._plugins.types import UNIONS, resolved


def is_path(name: str) -> bool:
    """Return whether a name is ``module:Class`` or ``module.Class``, not a registered one."""
    return ":" in name or "." in name


def declared_factory(path: str, group: PluginGroup, wanted: type) -> Callable[..., Any]:
    """Import ``module:name`` or ``module.name``, and make sure that it may be called.

    Importing the module runs it. A PluginError is raised if it cannot be imported, or neither
    states that it makes what is wanted nor is registered in the group.
    """
    found = imported(functools.partial(named, path), "it")
    registered = {entry.value for claimants in group.claims().values() for entry in claimants}
    if path not in registered and not says_it_makes(found, wanted):
        kind = wanted.__name__
        article = "an" if kind[0] in "AEIOU" else "a"
        raise PluginError(
            f"it is not called, because it does not state that it makes {article} {kind}; name a "
            f"class derived from {kind}, annotate what the function returns (-> {kind}), or "
            f"register it as entry point of {group.group!r}"
        )
    return found  # type: ignore[no-any-return]


def named(path: str) -> Any:
    """Import ``module:name`` or ``module.name``, such as a class's method, and call nothing.

    An ImportError, AttributeError or ValueError is raised if there is none.
    """
    return pkgutil.resolve_name(path)


def says_it_makes(factory: Any, wanted: type) -> bool:
    """Return whether something states that calling it makes what is wanted; it is not called.

    Classes state it, and functions and class methods by the annotation of what they return:
    ``wanted``, a class derived from it, a union of these, or ``Self``.
    """
    while isinstance(factory, functools.partial):
        factory = factory.func
    if isinstance(factory, type):
        return issubclass(factory, wanted)
    owner = factory.__self__ if isinstance(factory, MethodType) else None
    function = inspect.unwrap(getattr(factory, "__func__", factory))
    if not inspect.isfunction(function):
        return False
    stated = resolved(function.__annotations__.get("return"), function.__globals__)
    if get_origin(stated) is Annotated:
        stated = get_args(stated)[0]
    members = get_args(stated) if get_origin(stated) in UNIONS else (stated,)
    kinds = [owner if member is Self else member for member in members]
    return all(isinstance(kind, type) and issubclass(kind, wanted) for kind in kinds)
