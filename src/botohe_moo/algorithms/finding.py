"""Finding what makes an algorithm: by a registered name, or by ``module:Class``."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Hashable
from typing import Any

from pymoo.core.algorithm import Algorithm

from botohe_moo._plugins.entry_points import PluginError, PluginGroup
from botohe_moo._plugins.factories import declared_factory
from botohe_moo._plugins.stated import Accepted, accepted_parameters

PLUGINS = PluginGroup("botohe_moo.algorithms", "algorithm")
# Classes of pymoo's that loop inside of one generation, where no budget ends them.
_ENDLESS = {
    "pymoo.algorithms.moo.ctaea:CTAEA": (
        "pymoo's CTAEA never ends where there are fewer plans than directions, which is what "
        "leaving out duplicates does: its diversity archive looks for plans in as many directions "
        "as there are plans, until it has all of them"
    ),
}
# Who runs an algorithm decides on these, through ``minimize``.
_PYMOOS_OWN = frozenset(inspect.signature(Algorithm).parameters)


def is_path(name: str) -> bool:
    """Tell ``module:Class`` from a registered name."""
    return ":" in name or "." in name


def find_algorithm(name: str) -> Callable[..., Any]:
    """Import what makes an algorithm; a ValueError says why it cannot be had or called."""
    if not isinstance(name, str):
        raise ValueError(f"Expected the name of an algorithm, got {name!r}.")
    try:
        if is_path(name):
            found = declared_factory(name, PLUGINS, Algorithm)
            if isinstance(found, type) and (reason := never_ends(found)):
                raise PluginError(f"cannot be used; {reason}")
            from botohe_moo.algorithms.wired import wired  # loads all operators

            return wired(name, found)
        return PLUGINS.load(name)
    except PluginError as error:
        raise ValueError(f"{PLUGINS.source(name)}: {error}.") from error


def never_ends(kind: type) -> str | None:
    """Return why algorithms of a class, or of one derived from it, never end; None if they do."""
    names = (f"{base.__module__}:{base.__qualname__}" for base in kind.__mro__)
    return next((_ENDLESS[name] for name in names if name in _ENDLESS), None)


def accepted_by(factory: Callable[..., Any]) -> Accepted:
    """Find out what a factory can be given: what it states, but for pymoo's own options."""
    return _accepted(factory) if isinstance(factory, Hashable) else _accepted.__wrapped__(factory)


@functools.lru_cache(maxsize=64)  # a grid asks for every combination
def _accepted(factory: Callable[..., Any]) -> Accepted:
    return accepted_parameters(factory, hidden=_PYMOOS_OWN, closed=True)
