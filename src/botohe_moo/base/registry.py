"""What a name stands for: an entry that a package registers, or ``module:name``."""

import contextlib
import functools
import inspect
import pkgutil
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib.metadata import Distribution, EntryPoint, entry_points
from typing import Any, Self, get_args, get_origin

from botohe_moo.base.messages import PluginError, nearest_first
from botohe_moo.base.parameters import UNIONS, resolved

_OURS = "botohe-moo"


@dataclass(frozen=True, eq=False)
class Registry(Mapping[str, Any]):
    """The entries of a group of entry points, by name; they are imported when they are asked for.

    Algorithms, operators, missions, formats and indicators are registered like this. What this
    package registers comes before what others register under the same name.

    Parameters
    ----------
    group
        The name of the group.
    kind
        What an entry is called in messages, such as "mission".
    holds
        The type of entries: ``Callable`` for factories.
    own
        Entries that need not be imported; they come first.
    """

    group: str
    kind: str
    holds: Any = Callable
    own: dict[str, Any] = field(default_factory=dict)

    def __iter__(self) -> Iterator[str]:
        return iter([*self.own, *sorted(self.claims().keys() - self.own.keys())])

    def __len__(self) -> int:
        return len(self.claims().keys() | self.own.keys())

    def __contains__(self, name: object) -> bool:
        return name in self.own or name in self.claims()

    def __getitem__(self, name: str) -> Any:
        """Return what a name stands for, as `find` does."""
        return self.find(name)

    def source(self, name: object) -> str:
        """Return the words with which messages about an entry begin."""
        return f"{self.kind.capitalize()} {name!r}"

    def find(self, name: str, makes: type | None = None) -> Any:
        """Import what a name stands for: that of an entry, ``module:name`` or ``module.name``.

        Importing a module runs it. A PluginError says why there is no such entry, why it cannot be
        imported, or that what is not registered does not state that it ``makes`` such objects:
        then it is not called, since files name it.
        """
        if name in self.own:
            return self.own[name]
        if name in self or not is_path(name):
            entry = self.entry(name)
            origin = f"{entry.value} of package {_package(entry)}"
            found = _imported(entry.load, origin)
        else:
            origin = "it"
            found = _imported(functools.partial(pkgutil.resolve_name, name), origin)
            targets = {entry.value for entries in self.claims().values() for entry in entries}
            if makes and name not in targets and not says_it_makes(found, makes):
                raise PluginError(
                    f"expected a class derived from {makes.__name__}, or a function that returns "
                    f"one (-> {makes.__name__}), got {found!r}; or register it as entry point of "
                    f"{self.group!r}"
                )
        if not isinstance(found, self.holds):
            expected = "function or class" if self.holds is Callable else self.holds.__name__
            raise PluginError(f"expected {origin} to be a {expected}, got {found!r}")
        return found

    def loaded(self) -> dict[str, Any]:
        """Import all entries; return them by name, and warn of those that cannot be imported."""
        found = {}
        for name in self:
            try:
                found[name] = self.find(name)
            except PluginError as error:
                warnings.warn(f"{self.source(name)}: {error}; it is left out.", stacklevel=3)
        return found

    def claims(self) -> dict[str, list[EntryPoint]]:
        """List the entry points of each name, without importing them."""
        claims: dict[str, list[EntryPoint]] = {}
        for entry in _registered(self.group, tuple(sys.path)):
            claims.setdefault(entry.name, []).append(entry)
        return claims

    def entry(self, name: str) -> EntryPoint:
        """Find the entry point of a name; a PluginError if there is none, or packages disagree."""
        claims = self.claims()
        if name not in claims:
            known = ", ".join(nearest_first(name, self))
            raise PluginError(
                f"there is no such {self.kind}; known are {known}; "
                "a package that registers it may not be installed"
            )
        packages = {_package(entry): entry for entry in reversed(claims[name])}
        if _OURS not in packages and len({entry.value for entry in claims[name]}) > 1:
            raise PluginError(f"the packages {' and '.join(packages)} both register this name")
        return packages.get(_OURS, claims[name][0])

    def is_ours(self, name: str) -> bool:
        """Return whether this package registers the entry of a name."""
        return name in self.own or _package(self.entry(name)) == _OURS


def package_of(owner: Distribution | None) -> dict[str, str | None]:
    """Return the ``package`` and the ``version`` of a distribution; None for code without one."""
    found = (owner.name, owner.version) if owner else (None, None)
    return dict(zip(("package", "version"), found, strict=True))


def is_path(name: str) -> bool:
    """Return whether a name is ``module:Class`` or ``module.Class``, not a registered one."""
    return ":" in name or "." in name


def says_it_makes(factory: Any, wanted: type) -> bool:
    """Return whether something states that calling it makes what is wanted; it is not called.

    Classes state it, and functions by the annotation of what they return.
    """
    while isinstance(factory, functools.partial):
        factory = factory.func
    if isinstance(factory, type):
        return issubclass(factory, wanted)
    function = inspect.unwrap(getattr(factory, "__func__", factory))
    stated = getattr(function, "__annotations__", {}).get("return")
    stated = resolved(stated, getattr(function, "__globals__", {}))
    members = get_args(stated) if get_origin(stated) in UNIONS else (stated,)
    kinds = [factory.__self__ if member is Self else member for member in members]
    return all(isinstance(kind, type) and issubclass(kind, wanted) for kind in kinds)


def _imported(load: Callable[[], Any], origin: str) -> Any:
    """Import another package's code; a PluginError says what that raises.

    It can neither end the process nor print among results, which may be piped.
    """
    try:
        with contextlib.redirect_stdout(sys.stderr):
            return load()
    except (Exception, SystemExit) as error:
        found = f"{type(error).__name__}: {error}"
        raise PluginError(f"{origin} cannot be imported ({found})") from error


@functools.lru_cache(maxsize=16)
def _registered(group: str, _path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """Return the entry points of a group, looked up once for each search path: it takes 10 ms."""
    return tuple(entry_points(group=group))


def _package(entry: EntryPoint) -> str:
    return (entry.dist and entry.dist.name) or "(unknown)"
