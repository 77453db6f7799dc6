"""What packages register by name: found through entry points, imported when asked for."""

import contextlib
import functools
import inspect
import pkgutil
import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import Distribution, EntryPoint, entry_points
from types import MethodType
from typing import Annotated, Any, Self, get_args, get_origin

from botohe_moo.base.messages import PluginError, nearest_first
from botohe_moo.base.parameters import UNIONS, resolved

_OURS = "botohe-moo"


def package_of(owner: Distribution | None) -> dict[str, str | None]:
    """Return the ``package`` and the ``version`` of a distribution; None for code without one."""
    return {
        "package": owner.name if owner else None,
        "version": owner.version if owner else None,
    }


@dataclass(frozen=True)
class PluginGroup:
    """One entry-point group; the built-in entries are found in it like those of other packages."""

    group: str
    kind: str  # what its entries are, for messages: "mission", "algorithm"
    type: Any = Callable  # what they have to be instances of

    def source(self, name: object) -> str:
        """Return the words with which messages about an entry begin."""
        return f"{self.kind.capitalize()} {name!r}"

    def origin(self, name: str) -> str:
        """Return what a name leads to, and in which package; ``it`` if it is not registered."""
        if name not in self.claims():
            return "it"
        entry = self.entry(name)
        return f"{entry.value} of package {_package(entry)}"

    def claims(self) -> dict[str, list[EntryPoint]]:
        """Find all entries by name, without importing them."""
        claims: dict[str, list[EntryPoint]] = {}
        for entry in _registered(self.group, tuple(sys.path)):
            claims.setdefault(entry.name, []).append(entry)
        return claims

    def load_all(self) -> dict[str, Any]:
        """Import all entries; return them by name, sorted.

        Entries that cannot be imported, and names that two packages register, are left out with a
        warning.
        """
        found = {}
        for name in sorted(self.claims()):
            try:
                found[name] = self.load(name)
            except PluginError as error:
                warnings.warn(f"{self.source(name)}: {error}; it is left out.", stacklevel=3)
        return found

    def is_ours(self, name: str) -> bool:
        """Return whether the entry of a name is built in."""
        return _package(self.entry(name)) == _OURS

    def load(self, name: str) -> Callable[..., Any]:
        """Import the entry of that name; a PluginError says why this is not possible."""
        origin = self.origin(name)
        found = imported(self.entry(name).load, origin)
        if not isinstance(found, self.type):
            expected = "function or class" if self.type is Callable else self.type.__name__
            raise PluginError(f"expected {origin} to be a {expected}, got {found!r}")
        return found  # type: ignore[no-any-return]

    def entry(self, name: str) -> EntryPoint:
        """Find the entry of that name, without importing it; a PluginError if there is not one.

        A name that this package registers is this package's, whoever else registers it.
        """
        claims = self.claims()
        if name not in claims:
            known = ", ".join(nearest_first(name, claims))
            raise PluginError(
                f"there is no such {self.kind}; known are {known}; "
                "a package that registers it may not be installed"
            )
        first, *others = claims[name]
        if all(other.value == first.value for other in others):
            return first
        packages = {_package(entry): entry for entry in claims[name]}
        if _OURS not in packages:
            raise PluginError(f"the packages {' and '.join(packages)} both register this name")
        return packages[_OURS]


def imported(load: Callable[[], Any], origin: str) -> Any:
    """Import another package's code, which can neither end the process nor print among results.

    Whatever ``load`` raises becomes a PluginError that begins with ``origin``.
    """
    try:
        # What a module prints when it is imported would be part of a table that is piped.
        with contextlib.redirect_stdout(sys.stderr):
            return load()
    except (Exception, SystemExit) as error:  # whatever another package's code may raise
        found = f"{type(error).__name__}: {error}"
        raise PluginError(f"{origin} cannot be imported ({found})") from error


@functools.lru_cache(maxsize=16)
def _registered(group: str, _path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """Return the entry points of a group, looked up once for each search path: it takes 10 ms."""
    return tuple(entry_points(group=group))


def _package(entry: EntryPoint) -> str:
    return (entry.dist and entry.dist.name) or "(unknown)"


def is_path(name: str) -> bool:
    """Return whether a name is ``module:Class`` or ``module.Class``, not a registered one."""
    return ":" in name or "." in name


def declared_factory(path: str, group: PluginGroup, wanted: type) -> Callable[..., Any]:
    """Import ``module:name`` or ``module.name``, and make sure that it may be called.

    Importing the module runs it. A PluginError is raised if it cannot be imported, or neither
    states that it makes what is wanted nor is registered in the group.
    """
    found = imported(functools.partial(pkgutil.resolve_name, path), "it")
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
