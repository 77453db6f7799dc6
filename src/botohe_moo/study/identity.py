"""What results depend on: digests, versions, and the identity and code of an algorithm."""

import functools
import hashlib
import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from botohe_moo.algorithms.registry import ALGORITHMS, accepted_by, find_algorithm
from botohe_moo.base.parameters import call_factory, changes_nothing, plain_value
from botohe_moo.base.registry import is_path, package_of
from botohe_moo.problem import find_problem, problem_path
from botohe_moo.study.content import canonical

PACKAGES = {"version": "botohe-moo", "pymoo": "pymoo"}  # algorithms derive from pymoo's
# Parameters that name operators.
OPERATORS = ("sampling", "crossover", "mutation", "repair")
# Their versions identify them; all other modules are identified by their file.
_VERSIONED = frozenset({"botohe_moo", "pymoo"})


def digest_of(identity: Any) -> str:
    """Return the digest of all that a run's or a bound's result depends on."""
    return text_digest(canonical(identity))


def text_digest(text: str) -> str:
    """Return the first 16 hexadecimal digits of a text's SHA-256."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


@functools.cache  # versions are read from files
def installed_versions() -> Mapping[str, str]:
    """Return the versions of the packages that every result depends on."""
    return {name: metadata.version(package) for name, package in PACKAGES.items()}


@dataclass(frozen=True)
class AlgorithmIdentity:
    """The name and the parameters of an algorithm, the same for all ways to write them."""

    name: str  # by which it is registered; ``module:Class`` if not registered
    parameters: Mapping[str, Any]  # those that differ from their defaults
    neutral: frozenset[str]  # names of parameters that change no result: SameResult
    effective: Mapping[str, Any]  # values of all parameters, if they are known and plain


def algorithm_identity(name: str, parameters: Mapping[str, Any]) -> AlgorithmIdentity:
    """Return the identity of an algorithm with parameters that have been checked.

    Examples
    --------
    >>> spelt = algorithm_identity("botohe_moo:BOACO", {"n_ants": 100, "evaporation": 0.5})
    >>> spelt.name, spelt.parameters
    ('bo-aco', {'evaporation': 0.5})
    """
    factory = find_algorithm(name)
    accepted = accepted_by(factory)
    # A method that takes any keywords may give its class other defaults, which are not stated.
    stated = [p for p in accepted if p.own and not p.required]
    defaults = {p.name: plain_value(p.default) for p in stated}
    made = call_factory(ALGORITHMS.source(name), factory, accepted, parameters)
    given = {key: plain_value(value) for key, value in parameters.items()}
    effective = {**_attributes(made), **defaults, **_plain(getattr(made, "settings", {})), **given}
    return AlgorithmIdentity(
        name=_canonical_name(name),
        parameters={
            key: value
            for key, value in parameters.items()
            if key not in defaults or not _are_equal(plain_value(value), defaults[key])
        },
        neutral=frozenset(p.name for p in accepted if changes_nothing(p.hint)),
        effective={k: value for k, value in effective.items() if value is not NotImplemented},
    )


def _attributes(made: Any) -> dict[str, Any]:
    """Return the parameters of an algorithm's class and bases that are among its attributes.

    Bases are looked at up to the first one of this package or pymoo, which states all parameters.
    """
    values = getattr(made, "__dict__", {})
    found: dict[str, Any] = {}
    for kind in type(made).__mro__:
        found |= {p.name: values[p.name] for p in accepted_by(kind) if p.name in values}
        if kind.__module__.partition(".")[0] in _VERSIONED:
            break
    return _plain(found)


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values as text files hold them, ``NotImplemented`` for objects and lists of plans."""
    plain = {name: plain_value(value) for name, value in values.items()}
    return {k: NotImplemented if isinstance(v, list) else v for k, v in plain.items()}


def _are_equal(value: Any, default: Any) -> bool:
    """Return whether plain values are equal: 1 is 1.0, but True is not 1."""
    return isinstance(value, bool) == isinstance(default, bool) and bool(value == default)


def _canonical_name(name: str) -> str:
    """Return the registered name of an algorithm, or else ``module:Class`` where it is defined."""
    if not is_path(name):
        return name
    found = resolve_name(name)
    if isinstance(owner := getattr(found, "__self__", None), type):  # of a class's method
        path = f"{owner.__module__}:{owner.__qualname__}.{found.__name__}"
    elif hasattr(found, "__module__") and hasattr(found, "__qualname__"):
        path = f"{found.__module__}:{found.__qualname__}"
    else:
        path = name
    values = {entry.value: known for known, (entry, *_) in ALGORITHMS.claims().items()}
    return values.get(path) or values.get(name) or path


def algorithm_origin(
    name: str, parameters: Mapping[str, Any] | None = None, problem: str | None = None
) -> dict[str, str | None]:
    """Return where an algorithm's code comes from; results of other code are not the same.

    ``package`` and ``version`` are those of the distribution that registers the algorithm or owns
    its module, or None. ``source`` is the SHA-256 of the files that define the algorithm, the
    operators that ``parameters`` name, and ``problem`` (``module:Class`` of a problem of your own,
    which adds further keys). It is None if all of these belong to this package or pymoo, which
    their versions identify. Modules that the files import are not looked at.
    """
    factory = find_algorithm(name)
    path = _canonical_name(name)
    entry = None if is_path(path) else ALGORITHMS.entry(path)
    origin = package_of(entry.dist if entry else _distribution_of(path))
    parts = [(entry.value if entry else name, factory)]
    if parameters and any(kind in parameters for kind in OPERATORS):
        from botohe_moo.operators.registry import named_operators  # loads all operators

        parts += named_operators(parameters)
    if problem is not None:
        kind = find_problem(problem)
        parts.append((problem, kind))
        owner = package_of(_distribution_of(problem if is_path(problem) else kind.__module__))
        origin |= {"problem": problem_path(kind), **{f"problem_{key}": owner[key] for key in owner}}
    return {**origin, "source": _source_digest(parts)}


@functools.cache
def _distribution_of(path: str) -> metadata.Distribution | None:
    """Return the distribution that installed a module; None for one that is only on the path."""
    package = re.split("[:.]", path)[0]
    # A distribution installed for editing lists no modules, but often has its package's name.
    for owner in (*metadata.packages_distributions().get(package, ()), package):
        try:
            return metadata.distribution(owner)
        except metadata.PackageNotFoundError:
            pass
    return None


def _source_digest(parts: Iterable[tuple[str, Any]]) -> str | None:
    """Return the digest of the files of modules that name or define functions and classes."""
    files = []
    for path, factory in parts:
        while isinstance(factory, functools.partial):
            factory = factory.func
        for module in (path.partition(":")[0], getattr(factory, "__module__", "")):
            file = getattr(sys.modules.get(module), "__file__", None)
            if file and module.partition(".")[0] not in _VERSIONED:
                files.append(file)
    code = b"".join(Path(file).read_bytes() for file in dict.fromkeys(files))
    return hashlib.sha256(code).hexdigest() if files else None
