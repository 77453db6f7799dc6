"""A study as data: its missions, algorithms and runs, and what each run's result depends on."""

import functools
import hashlib
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, InstanceOf

from botohe_moo.indicators import Scale, largest_objectives
from botohe_moo.mission.loading import library_name_of
from botohe_moo.mission.model import Mission, numbers_digest
from botohe_moo.study.file.config import Budget, Recording, Seeds, StudyFile
from botohe_moo.study.file.origin import AlgorithmIdentity
from botohe_moo.study.file.values import canonical

MANIFEST = "study.json"
PACKAGES = {"version": "botohe-moo", "pymoo": "pymoo"}  # algorithms derive from pymoo's


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


@functools.cache  # versions are read from files
def installed_versions() -> Mapping[str, str]:
    """Return the versions of the packages that every result depends on."""
    return {name: version(package) for name, package in PACKAGES.items()}


def study_folder(name: object, out: str | os.PathLike[str] | None = None) -> Path:
    """Return the folder of a study's results: ``out``, or ``results/NAME``."""
    return Path("results") / str(name) if out is None else Path(out)


ObjectiveBounds = Annotated[tuple[float, float], AfterValidator(largest_objectives)]


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
    objective_bounds: ObjectiveBounds | None = None  # of the study's own problem, if any

    @property
    def scale(self) -> Scale:
        """The most that both objectives can be, by the mission or by the study's own problem."""
        return self.mission if self.objective_bounds is None else self.objective_bounds

    @property
    def library_name(self) -> str | None:
        """Its name in the library, if it has the same numbers and limits as a mission there."""
        if self.min_survival or self.max_length != self.mission.max_length:
            return None
        return library_name_of(numbers_digest(self.mission))

    def decides(self) -> dict[str, Any]:
        """Return everything that results depend on; labels are not part of it."""
        # Without a budget of seconds no run is killed when its grace is over.
        unused = {"grace_seconds"} if self.budget.seconds is None else None
        return {**self._limited(), "budget": self.budget.model_dump(exclude=unused)}

    @property
    def bound_digest(self) -> str:
        """Digest of all that a bound on its front depends on, which names the bound's file."""
        return digest_of(self._limited())

    def _limited(self) -> dict[str, Any]:
        """Return the mission and the limits of its plans."""
        # Left out where there is none, so that runs of earlier versions keep their digests.
        limit = {} if self.max_length is None else {"max_length": float(self.max_length)}
        return {"mission": self.digest, "min_survival": float(self.min_survival), **limit}


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

    def decides(self, budget: Budget) -> dict[str, Any]:
        """Return everything that results depend on.

        Numbers of threads are part of it only if seconds limit a run.
        """
        neutral = self.identity.neutral if budget.seconds is None else frozenset()
        return {
            "algorithm": self.identity.name,
            "parameters": {
                name: value
                for name, value in self.identity.parameters.items()
                if name not in neutral
            },
            "origin": dict(self.origin),
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
    return tuple(
        int(np.random.SeedSequence([seeds.seed, number]).generate_state(1)[0]) for number in numbers
    )


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
            for run in _runs(mission, algorithm, self)
        )

    @property
    def _problem(self) -> dict[str, Any] | None:
        """The study's own problem, with its package; None if objectives are E[R] and E[S]."""
        origin = self.algorithms[0].origin
        owner = {key: origin.get(f"problem_{key}") for key in ("package", "version")}
        return {"problem": self.file.problem, **owner} if self.file.problem else None

    def manifest(self) -> dict[str, Any]:
        """Describe the study for readers of its tables."""
        own = {"missions", "algorithms", "problem", "budget", "seeds"}
        return {
            **self.file.model_dump(exclude=own),
            "version": self.versions["version"],
            "missions": {
                mission.label: {
                    "file": f"missions/{mission.digest}.json",
                    "source": dict(mission.source),
                    **mission.origin,
                    "min_survival": mission.min_survival,
                    "max_length": mission.max_length,
                    "budget": mission.budget.model_dump(exclude={"grace_seconds"}),
                    "digest": mission.digest,
                    "family": mission.family,
                    "grid": dict(mission.grid),
                    "objective_bounds": mission.objective_bounds,
                }
                for mission in self.missions
            },
            "algorithms": {
                algorithm.label: {
                    "algorithm": algorithm.algorithm,
                    "parameters": dict(algorithm.parameters),
                    **{key: algorithm.origin[key] for key in ("package", "version")},
                    "name": algorithm.identity.name,
                    "effective": dict(algorithm.identity.effective),
                    "family": algorithm.family,
                    "grid": dict(algorithm.grid),
                }
                for algorithm in self.algorithms
            },
            "problem": self._problem,
            "seeds": list(self.seeds),
        }


def _runs(mission: StudyMission, algorithm: StudyAlgorithm, study: Study) -> Iterator[Run]:
    recording = study.file.recording
    # Counts above the budget, their order and their repetition make no difference to a run.
    limit = math.inf if mission.budget.evaluations is None else mission.budget.evaluations
    at = sorted({count for count in recording.at if count <= limit})
    setting = {
        **mission.decides(),
        **algorithm.decides(mission.budget),
        "recording": {**recording.model_dump(), "at": at},
        "seed": None,
        **study.versions,
    }
    # For speed, the canonical text is made once, with null in the place of the seed.
    before, _, after = canonical(setting).rpartition('"seed":null')
    for seed in study.seeds:
        digest = _digest(f'{before}"seed":{seed}{after}')
        yield Run(mission, algorithm, seed, recording, setting, digest)


def digest_of(identity: Mapping[str, Any]) -> str:
    """Return the digest of all that a run's or a bound's result depends on."""
    return _digest(canonical(identity))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]
