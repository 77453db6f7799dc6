"""What a name stands for: an entry that a package registers, or ``module:name``."""

import contextlib
import functools
import pkgutil
import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from importlib.metadata import Distribution, EntryPoint, entry_points
from typing import Any, Self

from botohe_moo.base.messages import PluginError, nearest_first
from botohe_moo.base.parameters import resolved, scope_of

_OURS = "botohe-moo"


@dataclass(frozen=True, eq=False)
class Registry:
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
        return iter({**self.own, **self.entries})

    def __contains__(self, name: object) -> bool:
        return name in self.own or name in self.entries

    def __getitem__(self, name: str) -> Any:
        """Return what a name stands for, as `find` does."""
        return self.find(name)

    @property
    def entries(self) -> dict[str, EntryPoint]:
        """The entry points by name, sorted, which need not be imported."""
        return _registered(self.group, tuple(sys.path))

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
        entry = self.entries.get(name)
        if entry:
            load, origin = entry.load, f"{entry.value} of package {entry.dist and entry.dist.name}"
        elif is_path(name):
            load, origin = functools.partial(pkgutil.resolve_name, name), "it"
        else:
            known = ", ".join(nearest_first(name, self))
            hint = "a package that registers it may not be installed"
            raise PluginError(f"no such {self.kind}; known are {known}; {hint}")
        try:
            with contextlib.redirect_stdout(sys.stderr):  # results, which may be piped, are printed
                found = load()
        except (Exception, SystemExit) as error:
            raised = f"{type(error).__name__}: {error}"
            raise PluginError(f"{origin} cannot be imported ({raised})") from error
        if makes and not entry and not says_it_makes(found, makes):
            raise PluginError(
                f"expected a class derived from {makes.__name__}, or a function that makes one (-> "
                f"{makes.__name__}), got {found!r}; or register it as entry point of {self.group!r}"
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


def package_of(owner: Distribution | None) -> dict[str, str | None]:
    """Return the ``package`` and the ``version`` of a distribution; None for code without one."""
    return {"package": owner.name if owner else None, "version": owner.version if owner else None}


def is_path(name: str) -> bool:
    """Return whether a name is ``module:Class`` or ``module.Class``, not a registered one."""
    return ":" in name or "." in name


def says_it_makes(factory: Any, wanted: type) -> bool:
    """Return whether something states that calling it makes what is wanted; it is not called.

    Classes state it, and functions by the annotation of what they return.
    """
    factory = getattr(factory, "func", factory)  # of a partial
    if isinstance(factory, type):
        return issubclass(factory, wanted)
    annotation = getattr(factory, "__annotations__", {}).get("return")
    stated = resolved(annotation, scope_of(factory))
    kind = factory.__self__ if stated is Self else stated
    return isinstance(kind, type) and issubclass(kind, wanted)


@functools.lru_cache(maxsize=16)
def _registered(group: str, _path: tuple[str, ...]) -> dict[str, EntryPoint]:
    """Return the entry points of a group, looked up once for each search path: it takes 10 ms.

    Of a name that several packages register, this package's entry is taken.
    """
    found = entry_points(group=group)
    ours_last = sorted(found, key=lambda e: (e.name, bool(e.dist and e.dist.name == _OURS)))
    return {entry.name: entry for entry in ours_last}
