"""The content of a study file, checked: shapes, names, parameters, missions, grids."""

import math
import os
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from botohe_moo._base.checks import nearest_first, quoted
from botohe_moo.algorithms.origin import OPERATORS, algorithm_identity, algorithm_origin
from botohe_moo.algorithms.registry import algorithm_faults
from botohe_moo.mission.digest import mission_digest
from botohe_moo.mission.formats.files import SUFFIXES
from botohe_moo.mission.formats.nodelink import mission_content
from botohe_moo.mission.library import COMMON, load_mission, mission_faults, mission_origin
from botohe_moo.mission.model import Mission
from botohe_moo.problem import BOTOHE
from botohe_moo.study.file.config import AlgorithmEntry, Budget, MissionEntry, StudyFile
from botohe_moo.study.file.digest import canonical
from botohe_moo.study.file.grids import Member, members, seeds_of
from botohe_moo.study.file.model import Study, StudyAlgorithm, StudyMission
from botohe_moo.study.file.problems import find_problem, problem_on, refusal, stated_bounds
from botohe_moo.study.file.shape import Faults, Place, file_faults, misspelt

MAX_RUNS = 250_000  # a study takes 200 bytes for each, and every run a file
_MAX_LISTED = 20  # labels in a message


class CheckedContent:
    """The content of a study file, checked as far as it can be.

    ``faults`` and ``notices`` are places and what is wrong there, or allowed but without effect.
    """

    def __init__(self, content: Any, folder: Path, packages: Mapping[str, str]) -> None:
        self.faults = Faults()
        self.notices: list[tuple[Place, str]] = []
        self._folder = folder
        self._packages = packages
        self._file: StudyFile | None = None
        for place, said in file_faults(content):
            self.faults.add(place, said)
            if self.faults.full:
                break
        if not self.faults:
            self._file = StudyFile.model_validate(content)
        content = content if isinstance(content, dict) else {}
        self._default_budget = _valid(Budget, content.get("budget"))
        self._missions = list(self._read_missions(_entries(content, "missions", MissionEntry)))
        self._check_budgets(content)
        self._problem = self._find_problem(content)
        algorithms = _entries(content, "algorithms", AlgorithmEntry)
        self._algorithms = list(self._read_algorithms(algorithms))
        self._check_refusals()
        self._check_different()
        self._check_control(content)
        self._seeds = seeds_of(self._file.seeds) if self._file and not self.faults else ()
        n_runs = len(self._missions) * len(self._algorithms) * len(self._seeds)
        if n_runs > MAX_RUNS:
            self.faults.add(("seeds",), f"expected at most {MAX_RUNS:,} runs, found {n_runs:,}.")
        if self._file:
            self.notices += _notices(self._file, [mission.budget for mission in self._missions])

    def study(self, text: str) -> Study:
        """Give the study, if there are no faults; ``text`` is that of its file."""
        assert self._file is not None  # there would be faults
        return Study(self._file, text, tuple(self._missions), tuple(self._algorithms), self._seeds)

    def _read_missions(self, entries: Mapping[str, MissionEntry]) -> Iterator[StudyMission]:
        for label, entry in entries.items():
            for name in ("name_or_path", *_common(entry)):
                for key in ("parameters", "grid"):
                    if name in getattr(entry, key):
                        said = f"{name} stands in the mission's own keys."
                        self.faults.add(("missions", label, key, name), said)
        for member in members("missions", entries, self.faults):
            name = member.entry.mission
            if Path(name).suffix.lower() in SUFFIXES or "/" in name or os.sep in name:
                name = str(self._folder / name)
            given = {**_common(member.entry), **member.parameters}
            source = {"name_or_path": name, **given} | {"name_or_path": name}
            if mission := self._load(source, member):
                limit = member.entry.max_length
                limit = math.inf if limit == "unlimited" else limit
                yield StudyMission(
                    label=member.label,
                    mission=mission,
                    source=source,
                    origin=mission_origin(source["name_or_path"]),
                    min_survival=member.entry.min_survival,
                    max_length=BOTOHE(mission, max_length=limit).max_length,
                    budget=member.entry.budget or self._default_budget or Budget(evaluations=1),
                    digest=mission_digest(mission),
                    family=member.family,
                    grid=member.grid,
                )

    def _load(self, source: dict[str, Any], member: Member) -> Mission | None:
        name, path = source["name_or_path"], member.path
        parameters = {key: value for key, value in source.items() if key != "name_or_path"}
        try:
            mission = load_mission(**source)
        except (Exception, SystemExit) as error:  # whatever another package's code may do
            unknown = f"{type(error).__name__}: {error}"
            found = mission_faults(name, parameters, plain=True)
            for blamed, message in found or [(None, unknown)]:
                said = message if blamed else self._said_of(name, message)
                self.faults.add((*path, *_place(blamed, member.entry)), said)
            return None
        foreign = ":" in name or mission_origin(name)["package"] not in (None, "botohe-moo")
        if foreign and load_mission(**source) != mission:  # its function might draw at random
            said = "gives another mission each time; it needs a seed among its parameters"
            self.faults.add((*path, "mission"), f"{name!r} {said}.")
            return None
        try:
            mission_content(mission)  # it will be saved with the study
        except ValueError as error:
            self.faults.add((*path, "mission"), str(error))
            return None
        return mission

    def _said_of(self, name: str, message: str) -> str:
        """Say what is wrong with a whole, and which package that it was from is missing."""
        package = self._packages.get(name)
        missing = f" It is from the package {package}, which is not installed." if package else ""
        return f"{name!r}: {message}{missing}"

    def _read_algorithms(self, entries: Mapping[str, AlgorithmEntry]) -> Iterator[StudyAlgorithm]:
        origins: dict[str, dict[str, str | None]] = {}  # files are read once
        for member in members("algorithms", entries, self.faults):
            name = member.entry.algorithm
            found = algorithm_faults(name, member.parameters, plain=True)
            for blamed, message in found:
                said = message if blamed else self._said_of(name, message)
                self.faults.add((*member.path, *_place(blamed, member.entry)), said)
            if not found:
                code = f"{name} {[member.parameters.get(kind) for kind in OPERATORS]}"
                if code not in origins:
                    origins[code] = algorithm_origin(name, member.parameters, self._problem)
                yield StudyAlgorithm(
                    label=member.label,
                    algorithm=name,
                    parameters=member.parameters,
                    origin=origins[code],
                    identity=algorithm_identity(name, member.parameters),
                    family=member.family,
                    grid=member.grid,
                )

    def _find_problem(self, content: Mapping[str, Any]) -> str | None:
        """Find the study's own problem, if it has one, and what bounds it states on missions."""
        path = content.get("problem")
        if not isinstance(path, str) or any(at[:1] == ("problem",) for at, _ in self.faults):
            return None
        if content.get("bounds") is not None:
            said = f"bounds are proved of E[R] and E[S], not of the objectives of {path!r}."
            self.faults.add(("bounds",), said)
        try:
            find_problem(path)
            self._missions = [
                replace(mission, objective_bounds=stated_bounds(mission, path))
                for mission in self._missions
            ]
        except ValueError as error:
            self.faults.add(("problem",), self._said_of(path, f"{error}."))
            return None
        return path

    def _check_refusals(self) -> None:
        """Say which algorithms refuse the study's own problem, before anything runs."""
        if self._problem is None or not self._missions:
            return
        for algorithm in self._algorithms:
            problem = problem_on(self._missions[0], self._problem)
            if said := refusal(problem, algorithm.algorithm, dict(algorithm.parameters)):
                place = ("algorithms", algorithm.family, "algorithm")
                self.faults.add(place, f"{algorithm.algorithm!r}: {said}")

    def _check_budgets(self, content: Mapping[str, Any]) -> None:
        """Say which missions have no budget, where no key that is misspelt or wrong is to blame."""
        if content.get("budget") is not None or misspelt(
            "budget", [key for key in content if key not in StudyFile.model_fields]
        ):
            return
        entries = _entries(content, "missions", MissionEntry)
        without = [label for label, entry in entries.items() if entry.budget is None]
        if without and "budget" in content:
            said = '"budget:" has no value: expected evaluations or seconds, or both.'
            self.faults.add(("budget",), said)
            return
        for label in without:
            said = "expected a budget, the mission's own or the study's."
            self.faults.add(("missions", label), said)

    def _check_different(self) -> None:
        """Refuse what stands in a study under two labels: its runs would be the same."""
        # Where one mission's runs are not limited by seconds, threads change nothing there.
        budgets = [mission.budget for mission in self._missions]
        budget = next((b for b in budgets if b.seconds is None), Budget(seconds=1))
        self._check_results("missions", [(m, m.decides()) for m in self._missions])
        self._check_results("algorithms", [(a, a.decides(budget)) for a in self._algorithms])
        self._check_labels("missions", self._missions)
        self._check_labels("algorithms", self._algorithms)

    def _check_labels(self, kind: str, found: Sequence[StudyMission | StudyAlgorithm]) -> None:
        """Refuse labels that are the same, or look the same."""
        seen: dict[str, StudyMission | StudyAlgorithm] = {}
        for member in found:
            other = seen.setdefault(unicodedata.normalize("NFC", member.label), member)
            repeated = other.family == member.family and other.grid == member.grid  # said before
            if other is not member and not repeated:
                how = "have" if other.label == member.label else "look as if they had"
                said = f"two entries {how} the label {quoted(member.label)}."
                self.faults.add((kind, member.family), said)

    def _check_results(self, kind: str, found: Sequence[tuple[Any, dict[str, Any]]]) -> None:
        """Refuse missions or algorithms on which all results depend in the same way."""
        seen: dict[str, Any] = {}
        for member, decides in found:
            other = seen.setdefault(canonical(decides), member)
            if other.label == member.label:
                continue
            said = f"{quoted(member.label)} is the same as {quoted(other.label)}"
            if kind == "algorithms" and (member.algorithm, member.parameters) != (
                other.algorithm,
                other.parameters,
            ):
                said += ": defaults, spellings and numbers of threads make no other run"
            self.faults.add((kind, member.family), f"{said}.")

    def _check_control(self, content: Mapping[str, Any]) -> None:
        comparison = content.get("comparison")
        control = comparison.get("control") if isinstance(comparison, dict) else None
        labels = [algorithm.label for algorithm in self._algorithms]
        wrong = any(path[:1] == ("algorithms",) for path, _ in self.faults)
        if isinstance(control, str) and control not in labels and not wrong:
            known = ", ".join(nearest_first(control, labels)[:_MAX_LISTED])
            self.faults.add(
                ("comparison", "control"),
                f"there is no algorithm {quoted(control)} in this study; its labels are {known}.",
            )


def _notices(file: StudyFile, budgets: list[Budget]) -> Iterator[tuple[Place, str]]:
    """List what has no effect, and was probably meant to have one."""
    given: list[tuple[Place, Budget | None]] = [(("budget",), file.budget)]
    given += [(("missions", label, "budget"), e.budget) for label, e in file.missions.items()]
    for path, budget in given:
        if budget and budget.seconds is None and "grace_seconds" in budget.model_fields_set:
            said = "it has no effect without seconds, as no run is killed."
            yield (*path, "grace_seconds"), said
    limits = [budget.evaluations for budget in budgets]
    if not limits or None in limits:
        return
    most = max(limit for limit in limits if limit is not None)
    beyond = [(n, position) for position, n in enumerate(file.recording.at) if n > most]
    if beyond:
        first, position = min(beyond)
        more = f", nor {len(beyond) - 1:,} further numbers" if len(beyond) > 1 else ""
        said = f"no run makes {first:,} evaluations{more}: the largest budget is {most:,}."
        yield ("recording", "at", position), said


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


def _common(entry: MissionEntry) -> dict[str, Any]:
    """Give the parameters that every mission takes, where they are keys of the entry's own."""
    return {name: value for name in COMMON if (value := getattr(entry, name))}


def _place(name: str | None, entry: MissionEntry | AlgorithmEntry) -> Place:
    """Say where in an entry a parameter stands."""
    if name is None:
        return ("algorithm",) if isinstance(entry, AlgorithmEntry) else ("mission",)
    if name in entry.grid:
        return ("grid", name)
    own = isinstance(entry, MissionEntry) and name in COMMON
    return (name,) if own and name not in entry.parameters else ("parameters", name)
