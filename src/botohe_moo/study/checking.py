"""The content of a study file, checked: shapes, names, parameters, missions, grids."""

from __future__ import annotations

import itertools
import json
import math
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from botohe_moo._checks import nearest_first
from botohe_moo.algorithms.origin import algorithm_identity, algorithm_origin
from botohe_moo.algorithms.registry import check_algorithm
from botohe_moo.mission.files import SUFFIXES
from botohe_moo.mission.library import check_mission, load_mission, mission_origin
from botohe_moo.mission.model import Mission
from botohe_moo.mission.nodelink import mission_content
from botohe_moo.study.config import (
    AlgorithmEntry,
    Budget,
    MissionEntry,
    Seeds,
    StudyFile,
    file_faults,
)
from botohe_moo.study.grid import Study, StudyAlgorithm, StudyMission, canonical, mission_digest

__all__ = ["CheckedContent"]

_MAX_RUNS = 1_000_000
_MAX_COMBINATIONS = 1_000  # of a grid
_Path = tuple[int | str, ...]


class CheckedContent:
    """Everything that can be said of a study file's content at once.

    Parameters
    ----------
    content
        What the file says.
    folder
        Where it is.
    packages
        Packages that are not installed any more, by the names of what they registered.

    Attributes
    ----------
    faults
        The path of keys and positions to each culprit, and what is wrong with it.
    """

    def __init__(self, content: Any, folder: Path, packages: Mapping[str, str]) -> None:
        self.faults: list[tuple[_Path, str]] = list(file_faults(content))
        self._folder = folder
        self._file: StudyFile | None = None
        if not self.faults:
            self._file = StudyFile.model_validate(content)
        content = content if isinstance(content, dict) else {}
        self._packages = packages
        self._default_budget = _valid(Budget, content.get("budget"))
        self._missions = list(self._read_missions(_entries(content, "missions", MissionEntry)))
        self._algorithms = list(
            self._read_algorithms(_entries(content, "algorithms", AlgorithmEntry))
        )
        self._check_different()
        self._check_control(content)
        self._seeds = _seeds(self._file.seeds) if self._file else ()
        n_runs = len(self._missions) * len(self._algorithms) * len(self._seeds)
        if n_runs > _MAX_RUNS:
            self._fault(("seeds",), f"expected at most {_MAX_RUNS:,} runs, found {n_runs:,}.")

    def study(self, text: str) -> Study:
        """Give the study, if there are no faults.

        Parameters
        ----------
        text
            The file itself.
        """
        assert self._file is not None  # there would be faults
        return Study(self._file, text, tuple(self._missions), tuple(self._algorithms), self._seeds)

    def _fault(self, path: _Path, message: str) -> None:
        self.faults.append((path, " ".join(message.split())))  # a fault is a line

    def _read_missions(self, entries: Mapping[str, MissionEntry]) -> Iterator[StudyMission]:
        for label, entry in entries.items():
            path: _Path = ("missions", label)
            budget = entry.budget or self._default_budget
            if budget is None and not any(where[:1] == ("budget",) for where, _ in self.faults):
                self._fault(path, "expected a budget, the mission's own or the study's.")
            for name in ("name_or_path", *(["robots"] if entry.robots is not None else [])):
                for key in ("parameters", "grid"):
                    if name in getattr(entry, key):
                        self._fault((*path, key, name), f"{name} stands in the mission's own keys.")
            for full, parameters, grid in self._expanded(label, entry, path):
                source = self._mission_source(entry, parameters)
                if mission := self._load(source, path):
                    yield StudyMission(
                        label=full,
                        mission=mission,
                        source=source,
                        origin=mission_origin(source["name_or_path"]),
                        min_survival=entry.min_survival,
                        budget=budget or Budget(evaluations=1),
                        digest=mission_digest(mission),
                        family=label,
                        grid=grid,
                    )

    def _mission_source(self, entry: MissionEntry, parameters: dict[str, Any]) -> dict[str, Any]:
        name = entry.mission
        if Path(name).suffix.lower() in SUFFIXES or "/" in name or os.sep in name:
            name = str(self._folder / name)
        robots = {} if entry.robots is None else {"robots": entry.robots}
        return {"name_or_path": name, **robots, **parameters}

    def _load(self, source: dict[str, Any], path: _Path) -> Mission | None:
        parameters = {key: value for key, value in source.items() if key != "name_or_path"}
        try:
            mission = load_mission(**source)
        except (Exception, SystemExit) as error:  # whatever another package's code may do
            unknown = f"{type(error).__name__}: {error}"
            found = check_mission(source["name_or_path"], parameters, plain=True)
            for name, message in found or [(None, unknown)]:
                said = message if name else self._said_of(source["name_or_path"], message)
                self._fault((*path, *_place(name)), said)
            return None
        if _is_foreign(source["name_or_path"]) and load_mission(**source) != mission:
            said = "gives another mission each time; it needs a seed among its parameters"
            self._fault((*path, "mission"), f"{source['name_or_path']!r} {said}.")
            return None
        try:
            mission_content(mission)  # it will be saved with the study
        except ValueError as error:
            self._fault((*path, "mission"), str(error))
            return None
        return mission

    def _said_of(self, name: str, message: str) -> str:
        """Say what is wrong with a whole, and which package that it was from is missing."""
        package = self._packages.get(name)
        missing = f" It is from the package {package}, which is not installed." if package else ""
        return f"{name!r}: {message}{missing}"

    def _read_algorithms(self, entries: Mapping[str, AlgorithmEntry]) -> Iterator[StudyAlgorithm]:
        for label, entry in entries.items():
            path: _Path = ("algorithms", label)
            for full, parameters, grid in self._expanded(label, entry, path):
                found = check_algorithm(entry.algorithm, parameters, plain=True)
                for name, message in found:
                    said = message if name else self._said_of(entry.algorithm, message)
                    self._fault((*path, *_place(name, entry)), said)
                if not found:
                    yield StudyAlgorithm(
                        label=full,
                        algorithm=entry.algorithm,
                        parameters=parameters,
                        origin=algorithm_origin(entry.algorithm),
                        identity=algorithm_identity(entry.algorithm, parameters),
                        family=label,
                        grid=grid,
                    )

    def _expanded(
        self, label: str, entry: MissionEntry | AlgorithmEntry, path: _Path
    ) -> Iterator[tuple[str, dict[str, Any], dict[str, Any]]]:
        """Give label and parameters of every combination of a grid, and the combination."""
        for name in entry.grid.keys() & entry.parameters.keys():
            self._fault((*path, "grid", name), f"{name} stands in parameters, too.")
        for name, values in entry.grid.items():
            if len({canonical(value) for value in values}) < len(values):
                self._fault((*path, "grid", name), "expected different values.")
        n_combinations = math.prod(map(len, entry.grid.values()))
        if n_combinations > _MAX_COMBINATIONS:
            said = f"expected at most {_MAX_COMBINATIONS:,} combinations, got {n_combinations:,}."
            self._fault((*path, "grid"), said)
            return
        for combination in itertools.product(*entry.grid.values()):
            chosen = dict(zip(entry.grid, combination, strict=True))
            named = ", ".join(f"{name}={_brief(value)}" for name, value in chosen.items())
            full = f"{label} ({named})" if named else label
            yield full, {**entry.parameters, **chosen}, chosen

    def _check_different(self) -> None:
        """Refuse what stands in a study under two labels: its runs would be the same."""
        alike: dict[str, StudyMission | StudyAlgorithm] = {}
        for mission in self._missions:
            self._note("missions", mission, canonical(mission.decides()), alike)
        # Where one mission's runs are not limited by seconds, threads change nothing there.
        budgets = [mission.budget for mission in self._missions]
        budget = next((b for b in budgets if b.seconds is None), Budget(seconds=1))
        alike = {}
        for algorithm in self._algorithms:
            self._note("algorithms", algorithm, canonical(algorithm.decides(budget)), alike)
        for labels in (
            [mission.label for mission in self._missions],
            [algorithm.label for algorithm in self._algorithms],
        ):
            for label in sorted({label for label in labels if labels.count(label) > 1}):
                self._fault((), f"two entries have the label {label!r}.")

    def _note(
        self,
        kind: str,
        member: StudyMission | StudyAlgorithm,
        key: str,
        alike: dict[str, StudyMission | StudyAlgorithm],
    ) -> None:
        other = alike.setdefault(key, member)
        if other.label == member.label:
            return
        said = f"{member.label!r} is the same as {other.label!r}"
        written = [
            (algorithm.algorithm, algorithm.parameters)
            for algorithm in (member, other)
            if isinstance(algorithm, StudyAlgorithm)
        ]
        if written and written[0] != written[1]:
            said += ": defaults, spellings and numbers of threads make no other run"
        self._fault((kind, member.family), f"{said}.")

    def _check_control(self, content: Mapping[str, Any]) -> None:
        comparison = content.get("comparison")
        control = comparison.get("control") if isinstance(comparison, dict) else None
        labels = [algorithm.label for algorithm in self._algorithms]
        wrong = any(path[:1] == ("algorithms",) for path, _ in self.faults)
        if isinstance(control, str) and control not in labels and not wrong:
            known = ", ".join(nearest_first(control, labels))
            self._fault(
                ("comparison", "control"),
                f"there is no algorithm {control!r} in this study; its labels are {known}.",
            )


def _is_foreign(mission: str) -> bool:
    """Tell whether a mission is made by a function that is not this package's."""
    return ":" in mission or mission_origin(mission)["package"] not in (None, "botohe-moo")


def _entries(content: Mapping[str, Any], key: str, model: type[Any]) -> dict[str, Any]:
    """Give those entries that are well-formed, whatever is wrong with the others."""
    given = content.get(key)
    if isinstance(given, list):
        given = {name: name for name in given if isinstance(name, str)}
    if not isinstance(given, dict):
        return {}
    valid = {label: _valid(model, entry) for label, entry in given.items()}
    return {label: entry for label, entry in valid.items() if entry is not None}


def _valid(model: type[Any], content: Any) -> Any:
    try:
        return None if content is None else model.model_validate(content)
    except ValidationError:
        return None


def _place(name: str | None, entry: AlgorithmEntry | None = None) -> _Path:
    """Say where in an entry a parameter stands."""
    if name is None:
        return ("algorithm",) if entry else ("mission",)
    if name == "robots" and entry is None:
        return ("robots",)
    return ("grid", name) if entry and name in entry.grid else ("parameters", name)


def _seeds(seeds: Seeds) -> tuple[int, ...]:
    """Give the seeds of the repetitions; a repetition's never depends on how many there are."""
    if seeds.values is not None:
        return tuple(seeds.values)
    numbers = range(1, (seeds.count or 0) + 1)
    if seeds.seed is None:
        return tuple(numbers)
    return tuple(
        int(np.random.SeedSequence([seeds.seed, number]).generate_state(1)[0]) for number in numbers
    )


def _brief(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)
