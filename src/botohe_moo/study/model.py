"""A study as data: its missions, algorithms and runs, and what each run's result depends on."""

import hashlib
import itertools
import math
import os
import sys
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

from pydantic import InstanceOf, TypeAdapter

from botohe_moo.algorithms.registry import ALGORITHMS, find_algorithm
from botohe_moo.base.registry import is_path, package_of
from botohe_moo.mission.loading import library_name_of
from botohe_moo.mission.model import Mission, numbers_digest
from botohe_moo.objectives import Objectives
from botohe_moo.problem import BOTOHE, find_problem
from botohe_moo.study.content import Budget, Recording, StudyFile, canonical

MANIFEST = "study.json"
PATIENCE = 3600.0
# Their versions identify their modules; all others are identified by their file.
_VERSIONED = {"botohe_moo": "botohe-moo", "pymoo": "pymoo"}


def digest_of(identity: Any) -> str:
    """Return the digest of all that a run's or a bound's result depends on."""
    return hashlib.sha256(canonical(identity).encode()).hexdigest()[:16]


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
    min_survival: float
    max_length: float | None  # travel budget, the entry's or the mission's own, if any
    budget: Budget
    digest: str  # of labels, arcs, survivals, rewards, base and robots
    family: str  # label of its entry in the file
    grid: Mapping[str, Any]  # its values of the entry's grid; empty without one
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
    algorithm: str  # registered name or module:Class
    parameters: Mapping[str, Any]  # as in the file
    neutral: frozenset[str]  # names of parameters that change no result: SameResult
    effective: Mapping[str, Any]  # values of all parameters that are known and plain
    origin: Mapping[str, str | None]  # what identifies its code
    family: str  # label of its entry in the file
    grid: Mapping[str, Any]  # its values of the entry's grid; empty without one


def algorithm_origin(
    name: str, parameters: Mapping[str, Any], problem: str | None = None
) -> dict[str, str | None]:
    """Return what identifies the code of an algorithm.

    These are the versions of this package and pymoo, from which all results derive, and ``package``
    and ``version`` of the distribution that registers the algorithm, None for code of your own.
    ``source`` is the SHA-256 of the files that define the algorithm, the operators that
    ``parameters`` name, and the study's ``problem``, which is a further key. It is None if all of
    these belong to this package or pymoo, which their versions identify. Modules that the files
    import are not looked at.
    """
    factory = find_algorithm(name)
    if is_path(name):
        path, package = name, _VERSIONED.get(name.partition(":")[0].partition(".")[0])
        owner = metadata.distribution(package) if package else None
    else:
        entry = ALGORITHMS.entries[name]
        path, owner = entry.value, entry.dist
    parts: list[tuple[str, Any]] = [(path, factory)]
    if {"sampling", "crossover", "mutation", "repair"} & parameters.keys():
        from botohe_moo.operators.variation import named_operators  # loads all operators

        parts += named_operators(parameters)
    versions = {package: metadata.version(package) for package in _VERSIONED.values()}
    origin = {**versions, **package_of(owner)}
    if problem is not None:
        parts.append((problem, find_problem(problem)))
        origin["problem"] = problem
    return {**origin, "source": _source_digest(parts)}


def _source_digest(parts: Iterable[tuple[str, Any]]) -> str | None:
    """Return the digest of the files of modules that name or define functions and classes."""
    files = []
    for path, factory in parts:
        made_by = getattr(factory, "func", factory)  # of a functools.partial
        for module in (path.partition(":")[0], getattr(made_by, "__module__", "")):
            file = getattr(sys.modules.get(module), "__file__", None)
            if file and module.partition(".")[0] not in _VERSIONED:
                files.append(file)
    code = b"".join(Path(file).read_bytes() for file in dict.fromkeys(files))
    return hashlib.sha256(code).hexdigest() if files else None


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
    ``algorithm``    registered name, or ``module:Class``         the label
    ``parameters``   values of all parameters, given or default   those marked ``SameResult``
                                                                  (threads), unless seconds limit
                                                                  the run
    ``origin``       versions of botohe-moo and pymoo; package,   modules that these files import,
                     version, and SHA-256 of the files of code    versions of all other packages
                     that is not ours or pymoo's
    ``recording``    ``per_decade``, ``start``, ``at``
    ``seed``         seed of the run
    ================ ============================================ ================================
    """
    budget, unlimited = mission.budget, mission.budget.seconds is None
    neutral = algorithm.neutral if unlimited else frozenset()
    return {
        **mission.limited(),
        "budget": budget.model_dump(exclude={"grace_seconds"} if unlimited else None),
        "algorithm": algorithm.algorithm,
        "parameters": {k: v for k, v in algorithm.effective.items() if k not in neutral},
        "origin": dict(algorithm.origin),
        "recording": recording.model_dump(),
    }


@dataclass(frozen=True, slots=True)
class Run:
    """One mission × algorithm × seed."""

    mission: StudyMission
    algorithm: StudyAlgorithm
    seed: int
    setting: Mapping[str, Any] = field(repr=False)  # all that its result depends on, but the seed
    digest: str  # of its identity, which names the run's file
    # Seconds without an evaluation after which a run of another package's algorithm fails, unless
    # it has a budget of seconds. Not part of the identity: no result depends on it.
    patience: float = PATIENCE

    @property
    def identity(self) -> dict[str, Any]:
        """Everything that the result of the run depends on."""
        return {**self.setting, "seed": self.seed}

    @property
    def problem(self) -> str | None:
        """A problem of your own as ``module:Class``; None for BOTOHE."""
        return self.algorithm.origin.get("problem")

    @property
    def seconds_allowed(self) -> float:
        """Seconds for the run; without a budget of seconds, those between its evaluations."""
        budget, origin = self.mission.budget, self.algorithm.origin
        if budget.seconds is not None:
            return budget.seconds + budget.grace_seconds
        ours = origin["package"] == "botohe-moo" and origin["source"] is None
        return math.inf if ours else self.patience


def check_code(run: Run) -> None:
    """Raise a ValueError if this process has other code than the study that a run is of."""
    name, wanted = run.algorithm.algorithm, run.algorithm.origin
    found = algorithm_origin(name, run.algorithm.parameters, run.problem)
    if found != wanted:
        raise ValueError(f"the worker has {name!r} from {found}, the study from {wanted}")


@dataclass(frozen=True)
class Study:
    """A study that was read and checked by :func:`load_study`.

    Attributes
    ----------
    file, text
        The study file: its content, and its text.
    missions, algorithms
        All missions and algorithms, with grids expanded, in the order of the file.
    seeds
        Seeds of the repetitions.

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
        runs = []
        for mission, algorithm in itertools.product(self.missions, self.algorithms):
            key = result_key(mission, algorithm, self.file.recording)
            for seed in self.seeds:
                digest = digest_of({**key, "seed": seed})
                runs.append(Run(mission, algorithm, seed, key, digest))
        return tuple(runs)

    def manifest(self) -> dict[str, Any]:
        """Describe the study for readers of its tables; `restored` makes it of this again."""
        kept = STUDY.dump_python(self, mode="json", exclude={"missions": {"__all__": {"mission"}}})
        missions, algorithms = kept["missions"], kept["algorithms"]
        for mission, entry in zip(self.missions, missions, strict=True):
            file = f"missions/{mission.digest}.json"
            entry |= {"file": file, "objectives": asdict(mission.objectives)}
        for entry in algorithms:
            entry |= {"name": entry["algorithm"], **entry["origin"]}
        return {
            **kept["file"],
            **kept,
            "missions": {entry["label"]: entry for entry in missions},
            "algorithms": {entry["label"]: entry for entry in algorithms},
            "problem": self.file.problem and {"problem": self.file.problem},
        }

    @classmethod
    def restored(cls, manifest: Mapping[str, Any], missions: Mapping[str, Mission]) -> "Study":
        """Make the study of its manifest and its missions, by label; no code is imported."""
        entries = [{**manifest["missions"][k], "mission": v} for k, v in missions.items()]
        algorithms = [*manifest["algorithms"].values()]
        return STUDY.validate_python({**manifest, "missions": entries, "algorithms": algorithms})


STUDY = TypeAdapter(Study)
