"""A study as data: its missions, algorithms and runs, and what each run's result depends on."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pydantic import InstanceOf

from botohe_moo.algorithms.origin import AlgorithmIdentity
from botohe_moo.mission.model import Mission
from botohe_moo.study.file.code_here import installed_versions
from botohe_moo.study.file.config import Budget, Recording, StudyFile

__all__ = [
    "Run",
    "Study",
    "StudyAlgorithm",
    "StudyMission",
    "canonical",
    "mission_digest",
    "value_text",
]


@dataclass(frozen=True)
class StudyMission:
    """A mission as a study plans for it.

    Attributes
    ----------
    label
        What the study calls it.
    mission
        The mission itself.
    source
        What :func:`load_mission` made it from.
    origin
        Package and version it is from.
    min_survival
        Survival floor of every robot.
    budget
        What each run on it may spend.
    digest
        Digest of all that a result can depend on: labels, arcs, survivals, rewards, base, robots.
    family
        Label of the entry in the file that it is from.
    grid
        Its values of the entry's grid; empty without one.
    """

    label: str
    mission: InstanceOf[Mission]
    source: Mapping[str, Any]
    origin: Mapping[str, str | None]
    min_survival: float
    budget: Budget
    digest: str
    family: str
    grid: Mapping[str, Any]

    def decides(self) -> dict[str, Any]:
        """Say what results depend on, whatever the mission is called."""
        return {
            "mission": self.digest,
            "min_survival": float(self.min_survival),
            "budget": _spent(self.budget),
        }


@dataclass(frozen=True)
class StudyAlgorithm:
    """An algorithm with parameters, under the study's label.

    Attributes
    ----------
    label
        What the study calls it.
    algorithm
        Name by which it is registered, or ``module:Class``, as in the file.
    parameters
        Its parameters, as in the file.
    origin
        Package, version and source it is from.
    identity
        What of all this results depend on.
    family
        Label of the entry in the file that it is from.
    grid
        Its values of the entry's grid; empty without one.
    """

    label: str
    algorithm: str
    parameters: Mapping[str, Any]
    origin: Mapping[str, str | None]
    identity: AlgorithmIdentity
    family: str
    grid: Mapping[str, Any]

    def decides(self, budget: Budget) -> dict[str, Any]:
        """Say what results depend on, however the algorithm is written and called.

        Parameters
        ----------
        budget
            What a run may spend: more threads get further where seconds limit it.
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
    """One mission × algorithm × seed.

    Attributes
    ----------
    mission, algorithm
        What is planned for, and by what.
    seed
        Seed of the run's random numbers.
    recording
        When its front is recorded.
    setting
        Everything that its result depends on, but for the seed; of all its repetitions the same.
    digest
        Digest of ``identity``: the run's name.
    """

    mission: StudyMission
    algorithm: StudyAlgorithm
    seed: int
    recording: Recording
    setting: Mapping[str, Any] = field(repr=False)
    digest: str

    @property
    def identity(self) -> dict[str, Any]:
        """Everything that its result depends on."""
        return {**self.setting, "seed": self.seed}


@dataclass(frozen=True)
class Study:
    """A study that has been read and checked; :func:`load_study` makes it.

    Attributes
    ----------
    file
        What the study file says.
    text
        The file itself.
    missions, algorithms
        What is compared on what, grids expanded, in the order of the file.
    seeds
        Seeds of the repetitions.
    versions
        Of the packages that every result depends on.
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

    def runs(self) -> tuple[Run, ...]:
        """List the runs: mission by mission, algorithm by algorithm, seed by seed."""
        return tuple(
            run
            for mission in self.missions
            for algorithm in self.algorithms
            for run in _runs(mission, algorithm, self)
        )

    def manifest(self) -> dict[str, Any]:
        """Say what the study is, for those who read its tables."""
        return {
            "name": self.name,
            "title": self.file.title,
            "description": self.file.description,
            "version": self.versions["version"],
            "missions": {
                mission.label: {
                    "file": f"missions/{mission.digest}.json",
                    "source": dict(mission.source),
                    **mission.origin,
                    "min_survival": mission.min_survival,
                    "budget": mission.budget.model_dump(exclude={"grace_seconds"}),
                    "digest": mission.digest,
                    "family": mission.family,
                    "grid": dict(mission.grid),
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
            "seeds": list(self.seeds),
            "recording": self.file.recording.model_dump(),
            "indicators": list(self.file.indicators),
            "comparison": self.file.comparison.model_dump(),
            "tables": None,
        }


def _runs(mission: StudyMission, algorithm: StudyAlgorithm, study: Study) -> Iterator[Run]:
    recording = study.file.recording
    setting = {
        **mission.decides(),
        **algorithm.decides(mission.budget),
        "recording": _recorded(recording, mission.budget),
        "seed": None,
        **study.versions,
    }
    # Keys are sorted, so seeds take their place in a text that is made once.
    before, mark, after = canonical(setting).rpartition('"seed":null')
    for seed in study.seeds:
        text = f"{before}{mark.removesuffix('null')}{seed}{after}"
        digest = hashlib.sha256(text.encode()).hexdigest()[:16]
        yield Run(mission, algorithm, seed, recording, setting, digest)


def _spent(budget: Budget) -> dict[str, Any]:
    """Give what a result depends on of a budget: nobody is killed who has no limit of time."""
    return budget.model_dump(exclude={"grace_seconds"} if budget.seconds is None else None)


def _recorded(recording: Recording, budget: Budget) -> dict[str, Any]:
    """Give what a result depends on of a recording: further counts in order, within the budget."""
    limit = math.inf if budget.evaluations is None else budget.evaluations
    return {**recording.model_dump(), "at": sorted({n for n in recording.at if n <= limit})}


def mission_digest(mission: Mission) -> str:
    """Give the digest of all that a result can depend on, which names and positions are not.

    Parameters
    ----------
    mission
        The mission.
    """
    arrays = mission.arrays
    hashed = hashlib.sha256(
        canonical(
            [[repr(node) for node in mission.nodes], repr(mission.base), mission.robots]
        ).encode()
    )
    for values, dtype in (
        (arrays.tail, "<i8"),
        (arrays.head, "<i8"),
        (arrays.survival, "<f8"),
        (arrays.reward, "<f8"),
    ):
        hashed.update(np.ascontiguousarray(values, dtype).tobytes())
    return hashed.hexdigest()[:16]


def value_text(value: Any) -> str:
    """Write a parameter's value as a study file would: a text as it is, all others as JSON.

    Parameters
    ----------
    value
        What a study file can hold.
    """
    if isinstance(value, str) and value.isprintable():
        return value
    text = json.dumps(value, ensure_ascii=False)
    return text if text.isprintable() else json.dumps(value)


def canonical(value: Any) -> str:
    """Write what a study file can hold so that equal values give equal texts.

    Parameters
    ----------
    value
        Mappings, lists, texts, numbers, flags and None.
    """
    return json.dumps(_one_number(value), sort_keys=True, separators=(",", ":"))


def _one_number(value: Any) -> Any:
    """Write 1.0 as 1: whether a number may be one is checked before, and it is the same number."""
    if isinstance(value, float) and value.is_integer():
        return int(value)
    if isinstance(value, dict):
        return {key: _one_number(item) for key, item in value.items()}
    return [_one_number(item) for item in value] if isinstance(value, list | tuple) else value
