"""A study as data: its missions, algorithms and runs, and what each run's result depends on."""

import functools
import hashlib
import math
import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from importlib import metadata
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import numpy as np
from pydantic import InstanceOf

from botohe_moo.algorithms.registry import ALGORITHMS, accepted_by, find_algorithm
from botohe_moo.base.parameters import call_factory, changes_nothing, plain_value
from botohe_moo.base.registry import is_path, package_of
from botohe_moo.base.types import FloatArray
from botohe_moo.mission.loading import library_name_of
from botohe_moo.mission.model import Mission, numbers_digest
from botohe_moo.objectives import SLACK, Objectives
from botohe_moo.problem import BOTOHE, find_problem, problem_path
from botohe_moo.study.content import Budget, Recording, Seeds, StudyFile, canonical

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


MANIFEST = "study.json"


class StudyError(ValueError):
    """A study or its folder has faults; each is a line that says where it is and what is wrong.

    Examples
    --------
    >>> from botohe_moo.study import StudyError, load_study
    >>> trial = {"name": "trial", "missions": ["toy"], "algorithms": ["greedy"], "seeds": 3}
    >>> try:
    ...     load_study({**trial, "budget": {"evaluations": 0}})
    ... except StudyError as error:
    ...     print(error)
    budget.evaluations: Expected evaluations >= 1, got 0.
    """


def study_folder(name: object, out: str | os.PathLike[str] | None = None) -> Path:
    """Return the folder of a study's results: ``out``, or ``results/NAME``."""
    return Path("results") / str(name) if out is None else Path(out)


@dataclass(frozen=True)
class StudyMission:
    """A mission of a study, with the limits of its plans and the budget of its runs."""

    label: str
    mission: InstanceOf[Mission]
    source: Mapping[str, Any]  # arguments of load_mission
    origin: Mapping[str, str | None]  # package and version
    min_survival: float
    budget: Budget
    digest: str  # of labels, arcs, survivals, rewards, base and robots
    family: str  # label of its entry in the file
    grid: Mapping[str, Any]  # its values of the entry's grid; empty without one
    max_length: float | None = None  # travel budget, the entry's or the mission's own, if any
    own_objectives: Objectives | None = None  # of the study's own problem, if any

    @property
    def objectives(self) -> Objectives:
        """The objectives of the mission, or of the study's own problem."""
        return self.own_objectives or Objectives.of(self.mission)

    @property
    def longest(self) -> float:
        """The travel budget, infinite where there is none."""
        return math.inf if self.max_length is None else self.max_length

    @property
    def library_name(self) -> str | None:
        """Its name in the library, if it has the same numbers and limits as a mission there."""
        if self.min_survival or self.max_length != self.mission.max_length:
            return None
        return library_name_of(numbers_digest(self.mission))

    @property
    def bound_digest(self) -> str:
        """Digest of all that a bound on its front depends on, which names the bound's file."""
        return digest_of(self.limited())

    def limited(self) -> dict[str, Any]:
        """Return the mission and the limits of its plans, as a run's result depends on them."""
        limit = {} if self.max_length is None else {"max_length": float(self.max_length)}
        return {"mission": self.digest, "min_survival": float(self.min_survival), **limit}

    def problem(self, path: str | None) -> BOTOHE:
        """Make the problem of a class ``module:Class``, or BOTOHE, with the mission's limits."""
        kind = BOTOHE if path is None else find_problem(path)
        return kind(self.mission, min_survival=self.min_survival, max_length=self.longest)


@dataclass(frozen=True)
class StudyAlgorithm:
    """An algorithm with parameters, under the study's label."""

    label: str
    algorithm: str  # registered name or module:Class, as in the file
    parameters: Mapping[str, Any]  # as in the file
    origin: Mapping[str, str | None]  # package, version and source
    identity: AlgorithmIdentity  # its name and parameters, however the file writes them
    family: str  # label of its entry in the file
    grid: Mapping[str, Any]  # its values of the entry's grid; empty without one


def result_key(
    mission: StudyMission, algorithm: StudyAlgorithm, recording: Recording
) -> dict[str, Any]:
    """Return everything that the result of a run depends on, besides its seed and the versions.

    This table is all that changes a run's digest, and so what makes a run to be performed again:

    ================ ============================================ ================================
    key              value                                        it does not depend on
    ================ ============================================ ================================
    ``mission``      digest of labels, arcs, survivals, rewards,  the label, name and file of the
                     base and robots                              mission
    ``min_survival`` survival floor
    ``max_length``   travel budget, if there is one
    ``budget``       evaluations and seconds                      ``grace_seconds``, unless
                                                                  seconds limit the run
    ``algorithm``    registered name, or ``module:Class``         the label and other spellings
    ``parameters``   those that differ from their defaults        those marked ``SameResult``
                                                                  (threads), unless seconds limit
                                                                  the run
    ``origin``       package, version, and SHA-256 of the files   modules that these files import
                     of code that is not ours or pymoo's
    ``recording``    ``per_decade``, ``start``, ``at``            counts above the budget
    ``seed``         seed of the run
    ``version``      version of botohe-moo                        versions of all other packages
    ``pymoo``        version of pymoo
    ================ ============================================ ================================
    """
    budget, identity = mission.budget, algorithm.identity
    unlimited = budget.seconds is None
    neutral = identity.neutral if unlimited else frozenset()
    most = math.inf if budget.evaluations is None else budget.evaluations
    at = sorted({count for count in recording.at if count <= most})
    return {
        **mission.limited(),
        "budget": budget.model_dump(exclude={"grace_seconds"} if unlimited else None),
        "algorithm": identity.name,
        "parameters": {k: v for k, v in identity.parameters.items() if k not in neutral},
        "origin": dict(algorithm.origin),
        "recording": {**recording.model_dump(), "at": at},
    }


@dataclass(frozen=True, slots=True)
class Run:
    """One mission × algorithm × seed."""

    mission: StudyMission
    algorithm: StudyAlgorithm
    seed: int
    recording: Recording
    setting: Mapping[str, Any] = field(repr=False)  # all that its result depends on, but the seed
    digest: str  # of its identity, which names the run's file

    @property
    def identity(self) -> dict[str, Any]:
        """Everything that the result of the run depends on."""
        return {**self.setting, "seed": self.seed}

    @property
    def problem(self) -> str | None:
        """A problem of your own as ``module:Class``; None for BOTOHE."""
        return self.algorithm.origin.get("problem")


def seeds_of(seeds: Seeds) -> tuple[int, ...]:
    """Return the seeds of the repetitions; none of them depends on how many there are."""
    if seeds.values is not None:
        return tuple(seeds.values)
    numbers = range(1, (seeds.count or 0) + 1)
    if seeds.seed is None:
        return tuple(numbers)
    sequences = (np.random.SeedSequence([seeds.seed, number]) for number in numbers)
    return tuple(int(sequence.generate_state(1)[0]) for sequence in sequences)


@dataclass(frozen=True)
class Study:
    """A study that was read and checked by :func:`load_study`.

    Attributes
    ----------
    file, text
        The study file: its content, and its text.
    missions, algorithms
        All missions and algorithms, with grids expanded, in the order of the file.
    seeds, versions
        Seeds of the repetitions, and versions of the packages that every result depends on.

    Examples
    --------
    >>> from botohe_moo.study import Study, load_study
    >>> trial = {
    ...     "name": "trial",
    ...     "missions": ["toy"],
    ...     "algorithms": ["greedy"],
    ...     "budget": {"evaluations": 50},
    ...     "seeds": 3,
    ... }
    >>> study = load_study(trial)
    >>> study.name, study.seeds, [mission.label for mission in study.missions]
    ('trial', (1, 2, 3), ['toy'])
    """

    file: StudyFile
    text: str
    missions: tuple[StudyMission, ...]
    algorithms: tuple[StudyAlgorithm, ...]
    seeds: tuple[int, ...]
    versions: Mapping[str, str] = field(default_factory=installed_versions)

    @property
    def name(self) -> str:
        """The study's name."""
        return self.file.name

    @property
    def bound_seconds(self) -> float:
        """Seconds for the bound of each mission; 0 if none is asked for."""
        return self.file.bounds.seconds if self.file.bounds else 0.0

    @property
    def bounded(self) -> tuple[StudyMission, ...]:
        """The missions whose fronts are to be bounded: all or none."""
        return self.missions if self.file.bounds else ()

    @property
    def best_known(self) -> dict[str, str]:
        """Names in the library of the missions whose best known fronts are references."""
        if self.file.reference != "best-known":
            return {}
        return {m.label: name for m in self.missions if (name := m.library_name)}

    def runs(self) -> tuple[Run, ...]:
        """List the runs: mission by mission, algorithm by algorithm, seed by seed."""
        return tuple(
            run
            for mission in self.missions
            for algorithm in self.algorithms
            for run in self._runs_of(mission, algorithm)
        )

    def _runs_of(self, mission: StudyMission, algorithm: StudyAlgorithm) -> Iterator[Run]:
        recording = self.file.recording
        setting = {**result_key(mission, algorithm, recording), "seed": None, **self.versions}
        # For speed, the canonical text is made once, with null for the seed.
        before, _, after = canonical(setting).rpartition('"seed":null')
        for seed in self.seeds:
            digest = text_digest(f'{before}"seed":{seed}{after}')
            yield Run(mission, algorithm, seed, recording, setting, digest)

    def manifest(self) -> dict[str, Any]:
        """Describe the study for readers of its tables."""
        own = {"missions", "algorithms", "problem", "budget", "seeds"}
        return {
            **self.file.model_dump(exclude=own),
            "version": self.versions["version"],
            "missions": {mission.label: _mission_entry(mission) for mission in self.missions},
            "algorithms": {a.label: _algorithm_entry(a) for a in self.algorithms},
            "problem": self._problem_entry(),
            "seeds": list(self.seeds),
        }

    def _problem_entry(self) -> dict[str, Any] | None:
        """Describe the study's own problem; None if objectives are E[R] and E[S]."""
        origin = self.algorithms[0].origin
        owner = {key: origin.get(f"problem_{key}") for key in ("package", "version")}
        return {"problem": self.file.problem, **owner} if self.file.problem else None


def _mission_entry(mission: StudyMission) -> dict[str, Any]:
    return {
        "file": f"missions/{mission.digest}.json",
        "source": dict(mission.source),
        **mission.origin,
        "min_survival": mission.min_survival,
        "max_length": mission.max_length,
        "budget": mission.budget.model_dump(exclude={"grace_seconds"}),
        "digest": mission.digest,
        "family": mission.family,
        "grid": dict(mission.grid),
        "objectives": asdict(mission.objectives),
    }


def _algorithm_entry(algorithm: StudyAlgorithm) -> dict[str, Any]:
    return {
        "algorithm": algorithm.algorithm,
        "parameters": dict(algorithm.parameters),
        **{key: algorithm.origin[key] for key in ("package", "version")},
        "name": algorithm.identity.name,
        "effective": dict(algorithm.identity.effective),
        "family": algorithm.family,
        "grid": dict(algorithm.grid),
    }


def check_objectives(problem: BOTOHE, points: FloatArray) -> None:
    """Raise a ValueError if points are outside the bounds that a problem states."""
    stated = problem.objectives
    outside = points[~((points >= -SLACK) & (points <= stated.bounds_with_slack)).all(axis=1)]
    if len(outside):
        kind = type(problem)
        raise ValueError(
            f"{problem_path(kind)} says by its objectives that −F is at least 0 and at most "
            f"{[*stated.bounds]}, and gives {outside[0].tolist()}"
        )
