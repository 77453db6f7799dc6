"""What results of an algorithm depend on: its name, parameters and code."""

import functools
import hashlib
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from botohe_moo._plugins.checks import call_factory
from botohe_moo._plugins.entry_points import same_factory
from botohe_moo._plugins.factories import is_path, named
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
    """Say what results of an algorithm depend on, given parameters that are known to be right.

    Examples
    --------
    >>> spelt = algorithm_identity("botohe_moo:BOACO", {"n_ants": 100, "evaporation": 0.5})
    >>> spelt.name, spelt.parameters
    ('bo-aco', {'evaporation': 0.5})
    """
    factory = find_algorithm(name)
    accepted = accepted_by(factory)
    stated = accepted.parameters
    # Of a method that takes any keywords only itself knows which defaults its class has then.
    defaults = {p.name: plain_value(p.default) for p in stated if p.own and not p.required}
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
        neutral=frozenset(p.name for p in stated if p.same_result),
        effective={k: value for k, value in effective.items() if value is not NotImplemented},
    )


def _attributes(made: Any) -> dict[str, Any]:
    """Read what an algorithm's attributes say of the parameters of its class and of all bases.

    So values are known that a class hands to its base's constructor.
    """
    values = getattr(made, "__dict__", {})
    ours = [kind for kind in type(made).__mro__ if kind.__module__.startswith("botohe_moo.")]
    # Our classes state all of theirs, and what pymoo's base classes have besides is derived.
    kinds = [kind for kind in type(made).__mro__ if kind not in ours[1:]]
    kinds = [kind for kind in kinds if not kind.__module__.startswith("pymoo.algorithms.base.")]
    names = [name for kind in kinds[::-1] for name in accepted_by(kind).names]
    return _plain({name: values[name] for name in names if name in values})


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Give values as a text holds them; ``NotImplemented`` for objects and lists of plans."""
    plain = {name: plain_value(value) for name, value in values.items()}
    return {k: NotImplemented if isinstance(v, list) else v for k, v in plain.items()}


def _same(value: Any, default: Any) -> bool:
    """Compare plain values: 1 is 1.0, but no flag is a number."""
    if isinstance(value, list) and isinstance(default, list):
        return len(value) == len(default) and all(map(_same, value, default))
    if isinstance(value, dict) and isinstance(default, dict):
        return value.keys() == default.keys() and all(_same(value[k], default[k]) for k in value)
    if default is NotImplemented or isinstance(value, bool) != isinstance(default, bool):
        return False
    return bool(value == default)


def _one_name(name: str) -> str:
    """Give the same name for all spellings of one algorithm: of what its own package calls it.

    What another module only passes on keeps that module's name: it may do more.
    """
    if not is_path(name):
        return name
    found = named(name)
    module = _module_of(name)
    package = module.partition(".")[0]
    if registered := PLUGINS.name_of(found, package):
        return registered
    written = name if ":" in name else f"{module}:{name.removeprefix(f'{module}.')}"
    owner = getattr(found, "__self__", None)
    home = owner if isinstance(owner, type) else found
    if str(getattr(home, "__module__", "")).partition(".")[0] != package:
        return written
    within = getattr(home, "__qualname__", "") + (f".{found.__name__}" if home is owner else "")
    try:
        defined = f"{home.__module__}:{within}"
        return defined if same_factory(named(defined), found) else written
    except (ImportError, AttributeError, ValueError):
        return written


def algorithm_origin(
    name: str, parameters: Mapping[str, Any] | None = None, problem: str | None = None
) -> dict[str, str | None]:
    """Say where an algorithm's code is from, to tell results of other code apart.

    Gives ``package`` and ``version`` of the distribution that registers it, or of the one that owns
    its module; None where there is none. ``source`` is the SHA-256 of its module's file, and None
    for modules of this package and pymoo's, which their versions identify. Other modules that it
    imports are not looked at, but those of operators that ``parameters`` name are part of it. So
    is that of ``problem``, ``module:Class`` of a problem of one's own, which has further keys.
    """
    factory = find_algorithm(name)
    name = _one_name(name)
    if is_path(name):
        module = _module_of(name)
        owner = _distribution_of(module.partition(".")[0])
    else:
        entry = PLUGINS.entry(name)
        module, owner = entry.module, entry.dist
    origin = {
        **_distribution(owner),
        "source": _with_operators(_source_digest(module, factory), parameters or {}),
    }
    return origin if problem is None else _with_problem(origin, problem)


def _distribution(owner: metadata.Distribution | None) -> dict[str, str | None]:
    return {
        "package": owner.name if owner else None,
        "version": owner.version if owner else None,
    }


def _with_problem(origin: dict[str, str | None], path: str) -> dict[str, str | None]:
    """Add a problem of one's own and its package, and its file to the digest."""
    kind = named(path)
    module = _module_of(path)
    owner = _distribution(_distribution_of(module.partition(".")[0]))
    if digest := _source_digest(module, kind):
        both = "".join([origin["source"] or "", digest])
        origin["source"] = hashlib.sha256(both.encode()).hexdigest()
    return {**origin, "problem": path, **{f"problem_{key}": owner[key] for key in owner}}


def _with_operators(source: str | None, parameters: Mapping[str, Any]) -> str | None:
    """Digest the files of operators, too, where parameters name those of other packages."""
    if not any(isinstance(parameters.get(kind), str | Mapping) for kind in OPERATORS):
        return source
    from botohe_moo.operators.naming import named_operators  # loads all operators

    found = sorted(named_operators(parameters).items())
    digests = [digest for module, made in found if (digest := _source_digest(module, made))]
    if not digests:
        return source
    return hashlib.sha256("".join([source or "", *digests]).encode()).hexdigest()


def _module_of(path: str) -> str:
    """Give the module's part of ``module:Class`` or ``module.Class``, which is imported already."""
    module, colon, _ = path.partition(":")
    while not colon and "." in module and module not in sys.modules:
        module = module.rpartition(".")[0]
    return module


@functools.cache
def _distribution_of(package: str) -> metadata.Distribution | None:
    """Find the distribution that installed a top-level package; None for one only on the path."""
    # What is installed for editing lists none of its modules, but often has its package's name.
    for owner in (*metadata.packages_distributions().get(package, ()), package):
        try:
            return metadata.distribution(owner)
        except metadata.PackageNotFoundError:
            pass
    return None


def _source_digest(module: str, factory: Any) -> str | None:
    """Digest the file that names a factory, and the one that defines it."""
    while isinstance(factory, functools.partial):
        factory = factory.func
    digest = None
    for name in dict.fromkeys([module, getattr(factory, "__module__", None) or module]):
        file = getattr(sys.modules.get(name), "__file__", None)
        if name.partition(".")[0] not in _VERSIONED and file and Path(file).is_file():
            digest = digest or hashlib.sha256()
            digest.update(Path(file).read_bytes())
    return digest.hexdigest() if digest else None
