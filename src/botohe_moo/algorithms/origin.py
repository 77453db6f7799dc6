"""What results of an algorithm depend on: its name, parameters and code."""

import functools
import hashlib
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from botohe_moo._plugins.checks import call_factory
from botohe_moo._plugins.entry_points import is_path
from botohe_moo._plugins.types import plain_value
from botohe_moo.algorithms.registry import PLUGINS, accepted_by, find_algorithm

# Parameters that name operators.
OPERATORS = ("sampling", "crossover", "mutation", "repair")
# Their versions identify them; all other modules are identified by their file.
_VERSIONED = frozenset({"botohe_moo", "pymoo"})


@dataclass(frozen=True)
class AlgorithmIdentity:
    """What results of an algorithm with parameters depend on, however it was written."""

    name: str  # by which it is registered; ``module:Class`` if not registered
    parameters: Mapping[str, Any]  # that differ from their defaults
    neutral: frozenset[str]  # names of parameters that change no result: SameResult
    effective: Mapping[str, Any]  # what it runs with, as far as known and a text can hold it


def algorithm_identity(name: str, parameters: Mapping[str, Any]) -> AlgorithmIdentity:
    """Return what results of an algorithm depend on, given parameters that are known to be right.

    Examples
    --------
    >>> spelt = algorithm_identity("botohe_moo:BOACO", {"n_ants": 100, "evaporation": 0.5})
    >>> spelt.name, spelt.parameters
    ('bo-aco', {'evaporation': 0.5})
    """
    factory = find_algorithm(name)
    accepted = accepted_by(factory)
    # Of a method that takes any keywords only itself knows which defaults its class has then.
    stated = [p for p in accepted if p.own and not p.required]
    defaults = {p.name: plain_value(p.default) for p in stated}
    made = call_factory(PLUGINS.source(name), factory, accepted, parameters)
    given = {key: plain_value(value) for key, value in parameters.items()}
    effective = {**_attributes(made), **defaults, **_plain(getattr(made, "settings", {})), **given}
    return AlgorithmIdentity(
        name=_one_name(name),
        parameters={
            key: value
            for key, value in parameters.items()
            if key not in defaults or not _same(plain_value(value), defaults[key])
        },
        neutral=frozenset(p.name for p in accepted if p.same_result),
        effective={k: value for k, value in effective.items() if value is not NotImplemented},
    )


def _attributes(made: Any) -> dict[str, Any]:
    """Read what an algorithm's attributes say of the parameters of its class.

    And of its bases, to which a class may hand values, up to the first one of this package or
    pymoo, which states all of its own.
    """
    values = getattr(made, "__dict__", {})
    found: dict[str, Any] = {}
    for kind in type(made).__mro__:
        found |= {p.name: values[p.name] for p in accepted_by(kind) if p.name in values}
        if kind.__module__.partition(".")[0] in _VERSIONED:
            break
    return _plain(found)


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Write values as a text holds them; ``NotImplemented`` for objects and lists of plans."""
    plain = {name: plain_value(value) for name, value in values.items()}
    return {k: NotImplemented if isinstance(v, list) else v for k, v in plain.items()}


def _same(value: Any, default: Any) -> bool:
    """Compare plain values: 1 is 1.0, but no flag is a number."""
    return isinstance(value, bool) == isinstance(default, bool) and bool(value == default)


def _one_name(name: str) -> str:
    """Return the same name for all spellings of one algorithm: the registered one, if it has one.

    Else it is ``module:Class``, where the class, function or method is defined.
    """
    if not is_path(name):
        return name
    found = resolve_name(name)
    owner = getattr(found, "__self__", None)  # of a class's method
    module = getattr(owner if isinstance(owner, type) else found, "__module__", None)
    within = getattr(found, "__qualname__", None)
    if isinstance(owner, type):
        within = f"{owner.__qualname__}.{found.__name__}"
    path = f"{module}:{within}" if module and within else name
    values = {entry.value: known for known, (entry, *_) in PLUGINS.claims().items()}
    return values.get(path) or values.get(name) or path


def algorithm_origin(
    name: str, parameters: Mapping[str, Any] | None = None, problem: str | None = None
) -> dict[str, str | None]:
    """Return where an algorithm's code is from, to tell results of other code apart.

    There are ``package`` and ``version`` of the distribution that registers it, or of the one that
    owns its module; None where there is none. ``source`` is the SHA-256 of the files that define
    it, the operators that ``parameters`` name and ``problem``, ``module:Class`` of a problem of
    your own, which has further keys; it is None where all of these are of this package or pymoo,
    which their versions identify. Other modules that the files import are not looked at.
    """
    factory = find_algorithm(name)
    path = _one_name(name)
    parts = [(name, factory)]
    if is_path(path):
        owner = _distribution_of(path.partition(":")[0])
    else:
        entry = PLUGINS.entry(path)
        owner = entry.dist
        parts = [(entry.value, factory)]
    if any(isinstance((parameters or {}).get(kind), str | Mapping) for kind in OPERATORS):
        from botohe_moo.operators.naming import named_operators  # loads all operators

        parts += named_operators(parameters or {})
    origin = _distribution(owner)
    if problem is not None:
        parts.append((problem, resolve_name(problem)))
        theirs = _distribution(_distribution_of(problem.partition(":")[0]))
        origin |= {"problem": problem, **{f"problem_{key}": theirs[key] for key in theirs}}
    return {**origin, "source": _source_digest(parts)}


def _distribution(owner: metadata.Distribution | None) -> dict[str, str | None]:
    return {
        "package": owner.name if owner else None,
        "version": owner.version if owner else None,
    }


@functools.cache
def _distribution_of(module: str) -> metadata.Distribution | None:
    """Find the distribution that installed a module; None for one that is only on the path."""
    package = module.partition(".")[0]
    # What is installed for editing lists none of its modules, but often has its package's name.
    for owner in (*metadata.packages_distributions().get(package, ()), package):
        try:
            return metadata.distribution(owner)
        except metadata.PackageNotFoundError:
            pass
    return None


def _source_digest(parts: Iterable[tuple[str, Any]]) -> str | None:
    """Digest the files of the modules that name and that define some functions or classes."""
    files = []
    for path, factory in parts:
        while isinstance(factory, functools.partial):
            factory = factory.func
        for module in (path.partition(":")[0], getattr(factory, "__module__", "")):
            file = getattr(sys.modules.get(module), "__file__", None)
            if file and module.partition(".")[0] not in _VERSIONED:
                files.append(file)
    digest = hashlib.sha256()
    for file in dict.fromkeys(files):
        digest.update(Path(file).read_bytes())
    return digest.hexdigest() if files else None
