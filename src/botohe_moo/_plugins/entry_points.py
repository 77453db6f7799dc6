"""What other packages register, found through entry points; nothing is imported before its use."""

import contextlib
import functools
import os
import re
import sys
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib.metadata import Distribution, EntryPoint, entry_points
from types import MethodType
from typing import Any

from botohe_moo._base.checks import nearest_first

_OURS = "botohe-moo"


class PluginError(ValueError):
    """Says why a name is not registered, or cannot be used."""


@dataclass(frozen=True)
class PluginGroup:
    """One entry-point group; the built-in entries are found in it like those of other packages."""

    group: str
    kind: str  # what its entries are, for messages: "mission", "algorithm"

    def source(self, name: object) -> str:
        """Say what a message is about, to begin it with."""
        return f"{self.kind.capitalize()} {name!r}"

    def origin(self, name: str) -> str:
        """Say what a name stands for, and in which package; ``it`` if it is not registered."""
        if name not in self.claims():
            return "it"
        entry = self.entry(name)
        return f"{entry.value} of package {_package(entry)}"

    def claims(self) -> dict[str, list[EntryPoint]]:
        """Find out, without importing anything, who registers which name."""
        claims: dict[str, list[EntryPoint]] = {}
        for entry in _registered(entry_points, self.group, tuple(map(_as_it_is, sys.path))):
            claims.setdefault(entry.name, []).append(entry)
        return claims

    def names(self) -> tuple[str, ...]:
        """Give the names that can be loaded, sorted.

        What cannot be imported, or has the name of another package's entry, is left out with a
        warning that names it.
        """
        names = []
        for name in sorted(self.claims()):
            try:
                self.load(name)
            except PluginError as error:
                warnings.warn(f"{self.source(name)}: {error}; it is left out.", stacklevel=3)
            else:
                names.append(name)
        return tuple(names)

    def load(self, name: str) -> Callable[..., Any]:
        """Import the entry of that name; a PluginError says why it cannot be had or called."""
        origin = self.origin(name)
        function = imported(self.entry(name).load, origin)
        if not callable(function):
            raise PluginError(f"expected {origin} to be a function or class, got {function!r}")
        return function  # type: ignore[no-any-return]

    def name_of(self, found: object, package: str) -> str | None:
        """Give the name by which a top-level package's entry registers something; None for none."""
        for name, claimants in sorted(self.claims().items()):
            if all(re.split(r"[.:]", entry.value)[0].strip() != package for entry in claimants):
                continue
            # One that is broken is not the one that was found.
            with contextlib.suppress(PluginError), warnings.catch_warnings(action="ignore"):
                if same_factory(self.load(name), found):
                    return name
        return None

    def entry(self, name: str) -> EntryPoint:
        """Find, without importing anything, the entry of that name; a PluginError if it fails."""
        claims = self.claims()
        if name not in claims:
            known = ", ".join(nearest_first(name, claims))
            raise PluginError(
                f"there is no such {self.kind}; known are {known}; "
                "a package that registers it may not be installed"
                if known
                else f"no {self.kind}s are registered; is the package {_OURS} installed?"
            )
        return self._choose(name, claims[name])

    def _choose(self, name: str, claimants: list[EntryPoint]) -> EntryPoint:
        """Choose who a name belongs to: this package, or else the only one that claims it."""
        ours = [entry for entry in claimants if _package(entry) == _OURS]
        others = [entry for entry in claimants if _package(entry) != _OURS]
        named = " and ".join(map(_package, others))
        if ours and others:
            warnings.warn(
                f"{self.source(name)} of package {named} is left out: {_OURS} has it.", stacklevel=5
            )
        elif len({entry.value for entry in others}) > 1:
            raise PluginError(f"the packages {named} both register this name")
        return (ours or others)[0]


def same_factory(one: object, other: object) -> bool:
    """Tell whether two names lead to one thing; a class's method is made anew at each look."""
    return one is other or (isinstance(one, MethodType) and one == other)


def imported(load: Callable[[], Any], origin: str) -> Any:
    """Import another package's code, which can neither end the process nor print among results.

    Whatever ``load`` raises becomes a PluginError that begins with ``origin``, what it is.
    """
    try:
        # What a module prints when it is imported would stand in a table that is piped.
        with contextlib.redirect_stdout(sys.stderr):
            return load()
    except (Exception, SystemExit) as error:  # whatever another package's code may raise
        found = f"{type(error).__name__}: {error}"
        raise PluginError(f"{origin} cannot be imported ({found})") from error


@functools.lru_cache(maxsize=16)
def _registered(
    look: Callable[..., Iterable[EntryPoint]], group: str, _: tuple[object, ...]
) -> tuple[EntryPoint, ...]:
    """Remember what is installed, as long as no folder of the path changes: looking takes 10 ms."""
    return tuple(look(group=group))


def _as_it_is(folder: str) -> tuple[str, int]:
    try:
        return folder, os.stat(folder or ".").st_mtime_ns  # noqa: PTH116
    except (OSError, ValueError):
        return folder, 0


def _package(entry: EntryPoint) -> str:
    name = _name_of(entry.dist) if entry.dist else None
    return re.sub(r"[-_.]+", "-", name).lower() if name else "(unknown)"


@functools.lru_cache(maxsize=256)
def _name_of(package: Distribution) -> str | None:
    """Read a package's name, once; None where its metadata are broken."""
    return package.name
