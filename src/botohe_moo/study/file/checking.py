"""Checking what a study file says: its names and parameters, and the missions that it loads."""

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from pydantic import TypeAdapter, ValidationError

from botohe_moo.algorithms.registry import algorithm_faults
from botohe_moo.base.messages import most_alike, quoted
from botohe_moo.bounds.plain import check_boundable
from botohe_moo.mission.formats.nodelink import mission_content
from botohe_moo.mission.formats.reading import is_file_name
from botohe_moo.mission.loading import load_mission, mission_faults, mission_origin, relative_to
from botohe_moo.mission.model import Mission, mission_digest
from botohe_moo.problem import BOTOHE
from botohe_moo.study.file.code import find_problem, problem_on, refusal, stated_bounds
from botohe_moo.study.file.config import (
    AlgorithmEntry,
    AlgorithmOrName,
    Budget,
    MissionEntry,
    MissionOrName,
    StudyFile,
    labelled,
    labelled_missions,
)
from botohe_moo.study.file.model import StudyAlgorithm, StudyMission, seeds_of
from botohe_moo.study.file.origin import OPERATORS, algorithm_identity, algorithm_origin
from botohe_moo.study.file.values import canonical, value_text

Place: TypeAlias = tuple[int | str, ...]  # keys and positions on the way to a value
Fault: TypeAlias = tuple[Place, str]  # what is wrong there, as a sentence

MAX_RUNS = 250_000  # each takes 200 bytes of memory, and a file
_BUDGET = TypeAdapter(Budget)
_MISSION: TypeAdapter[MissionEntry] = TypeAdapter(MissionOrName)
_ALGORITHM: TypeAdapter[AlgorithmEntry] = TypeAdapter(AlgorithmOrName)


class Member(NamedTuple):
    """A mission or algorithm of an entry: one combination of its grid, or all there is."""

    family: str  # label of the entry
    label: str  # that of the entry, and the combination in brackets
    entry: Any
    parameters: dict[str, Any]  # those of the entry and of the combination
    grid: dict[str, Any]  # those of the combination only


class CheckedContent:
    """The missions and algorithms of a study file, and the faults in its content.

    Entries that are not well-formed are left out: ``file`` is None then, and its error lists them.
    ``packages`` are packages that are not installed any more, by the names that are from them.
    """

    def __init__(
        self, content: Any, file: StudyFile | None, folder: Path, packages: Mapping[str, str]
    ) -> None:
        self.faults: list[Fault] = []
        self.missions: list[StudyMission] = []
        self.algorithms: list[StudyAlgorithm] = []
        self._folder = folder
        self._packages = packages
        content = content if isinstance(content, dict) else {}
        missions = _entries(_MISSION, content.get("missions"), labelled_missions)
        algorithms = _entries(_ALGORITHM, content.get("algorithms"), labelled)
        n_seeds = len(seeds_of(file.seeds)) if file else 1
        n_runs = _n_members(missions) * _n_members(algorithms) * n_seeds
        if n_runs > MAX_RUNS:
            self._add(("seeds",), f"expected at most {MAX_RUNS:,} runs, found {n_runs:,}.")
            return
        self.missions += self._read_missions(missions, _valid(_BUDGET, content.get("budget")))
        problem = self._find_problem(content.get("problem"))
        self.algorithms += self._read_algorithms(algorithms, problem)
        self._check_refusals(problem)
        if content.get("bounds") is not None:
            self._check_bounds()
        if content.get("reference") == "best-known" and problem is None:
            self._check_references()
        # Two algorithms that differ in their number of threads are the same on a mission whose runs
        # are not limited by seconds.
        budgets = [mission.budget for mission in self.missions]
        budget = next((b for b in budgets if b.seconds is None), Budget(seconds=1))
        self._check_different("missions", [(m, m.decides()) for m in self.missions])
        self._check_different("algorithms", [(a, a.decides(budget)) for a in self.algorithms])
        if file and not self.faults:
            self._check_control(file.comparison.control)

    def _add(self, place: Place, message: str) -> None:
        self.faults.append((place, message))

    def _read_missions(
        self, entries: Mapping[str, MissionEntry], budget: Budget | None
    ) -> Iterator[StudyMission]:
        for member in _members(entries):
            entry: MissionEntry = member.entry
            name = entry.mission
            if is_file_name(name):
                name = str(self._folder / name)
            parameters = relative_to(self._folder, name, member.parameters)
            source = {"name_or_path": name, **entry.own_parameters, **parameters}
            if mission := self._load(source, member):
                limit = math.inf if entry.max_length == "unlimited" else entry.max_length
                try:
                    problem = BOTOHE(mission, min_survival=entry.min_survival, max_length=limit)
                except ValueError as error:
                    self._add(("missions", member.family), str(error))
                    continue
                yield StudyMission(
                    label=member.label,
                    mission=mission,
                    source=source,
                    origin=mission_origin(name),
                    min_survival=entry.min_survival,
                    max_length=problem.max_length,
                    budget=entry.budget or budget or Budget(evaluations=1),
                    digest=mission_digest(mission),
                    family=member.family,
                    grid=member.grid,
                )

    def _load(self, source: dict[str, Any], member: Member) -> Mission | None:
        """Load a mission, or note why it cannot be loaded."""
        name = source["name_or_path"]
        try:
            mission = load_mission(**source)
            mission_content(mission)  # raises if it cannot be saved with the study
            foreign = ":" in name or mission_origin(name)["package"] not in (None, "botohe-moo")
            again = load_mission(**source) if foreign else mission
        except (Exception, SystemExit) as error:  # whatever another package's code may do
            parameters = {key: value for key, value in source.items() if key != "name_or_path"}
            faults = mission_faults(name, parameters, plain=True)
            self._add_faults(
                "mission", member, name, faults or [(None, f"{type(error).__name__}: {error}")]
            )
            return None
        if again != mission:  # its function draws at random
            self._add(
                ("missions", member.family, "mission"),
                f"{name!r} gives another mission each time; it needs a seed among its parameters.",
            )
            return None
        return mission

    def _read_algorithms(
        self, entries: Mapping[str, AlgorithmEntry], problem: str | None
    ) -> Iterator[StudyAlgorithm]:
        origins: dict[str, dict[str, str | None]] = {}  # each reads files, and many are the same
        for member in _members(entries):
            name = member.entry.algorithm
            if faults := algorithm_faults(name, member.parameters, plain=True):
                self._add_faults("algorithm", member, name, faults)
                continue
            code = f"{name} {[member.parameters.get(kind) for kind in OPERATORS]}"
            if code not in origins:
                origins[code] = algorithm_origin(name, member.parameters, problem)
            yield StudyAlgorithm(
                label=member.label,
                algorithm=name,
                parameters=member.parameters,
                origin=origins[code],
                identity=algorithm_identity(name, member.parameters),
                family=member.family,
                grid=member.grid,
            )

    def _add_faults(
        self, kind: str, member: Member, name: str, faults: Iterable[tuple[str | None, str]]
    ) -> None:
        """Add faults of a mission's or algorithm's parameters, or of itself, at their places."""
        for parameter, message in faults:
            place: Place = (f"{kind}s", member.family)
            if parameter is None:
                self._add((*place, kind), self._about(name, message))
            elif parameter in member.entry.grid or parameter in member.entry.parameters:
                key = "grid" if parameter in member.entry.grid else "parameters"
                self._add((*place, key, parameter), message)
            else:
                self._add((*place, parameter), message)

    def _about(self, name: str, message: str) -> str:
        """Return a message about a name, and its package if that is not installed any more."""
        package = self._packages.get(name)
        missing = f" It is from the package {package}, which is not installed." if package else ""
        return f"{name!r}: {message}{missing}"

    def _find_problem(self, path: Any) -> str | None:
        """Import the problem of the study, if it has one, and note its bounds on each mission."""
        if not isinstance(path, str):
            return None
        try:
            find_problem(path)
            self.missions = [
                replace(mission, objective_bounds=stated_bounds(mission, path))
                for mission in self.missions
            ]
        except ValueError as error:
            self._add(("problem",), self._about(path, f"{error}."))
            return None
        return path

    def _check_refusals(self, path: str | None) -> None:
        """Note which algorithms refuse the problem, or a mission, before anything runs."""
        tried = [mission for mission in self.missions if not mission.mission.is_plain]
        if path is not None and not tried:
            tried = self.missions[:1]
        for algorithm in self.algorithms:
            given = algorithm.algorithm, dict(algorithm.parameters)
            reasons = (refusal(problem_on(mission, path), *given) for mission in tried)
            if why := next(filter(None, reasons), None):
                place = ("algorithms", algorithm.family, "algorithm")
                self._add(place, f"{algorithm.algorithm!r}: {why}")

    def _check_bounds(self) -> None:
        """Note the first mission whose bounds cannot be proved."""
        try:
            for mission in self.missions:
                check_boundable(mission.mission, "bound_front")
        except ValueError as error:
            self._add(("bounds",), str(error))

    def _check_references(self) -> None:
        """Note the missions that have no best known front."""
        for mission in self.missions:
            if mission.library_name is None:
                self._add(
                    ("missions", mission.family),
                    "reference: best-known expects missions of the library with their own robots "
                    f"and limits; {quoted(mission.label)} is not one, or has others.",
                )

    def _check_different(self, kind: str, members: Sequence[tuple[Any, dict[str, Any]]]) -> None:
        """Refuse missions or algorithms that are the same in all that results depend on."""
        seen: dict[str, Any] = {}
        for member, decides in members:
            other = seen.setdefault(canonical(decides), member)
            if other is member:
                continue
            message = f"{quoted(member.label)} is the same as {quoted(other.label)}"
            if kind == "algorithms":
                message += ": defaults, spellings and numbers of threads make no other run"
            self._add((kind, member.family), f"{message}.")

    def _check_control(self, control: str | None) -> None:
        labels = [algorithm.label for algorithm in self.algorithms]
        if control is not None and control not in labels:
            message = f"there is no algorithm {quoted(control)}{most_alike(control, labels)}."
            self._add(("comparison", "control"), message)


def _n_members(entries: Mapping[str, MissionEntry | AlgorithmEntry]) -> int:
    """Return how many missions or algorithms the entries are, with their grids expanded."""
    return sum(math.prod(map(len, entry.grid.values())) for entry in entries.values())


def _members(entries: Mapping[str, MissionEntry | AlgorithmEntry]) -> Iterator[Member]:
    """Expand the grids of all missions or algorithms."""
    for family, entry in entries.items():
        for combination in itertools.product(*entry.grid.values()):
            grid = dict(zip(entry.grid, combination, strict=True))
            values = ", ".join(f"{name}={value_text(value)}" for name, value in grid.items())
            label = f"{family} ({values})" if values else family
            yield Member(family, label, entry, {**entry.parameters, **grid}, grid)


def _entries(
    entry: TypeAdapter[Any], content: Any, labelled: Callable[[Any], Any]
) -> dict[str, Any]:
    """Return the entries that are well-formed, by their labels."""
    try:
        entries = labelled(content)
    except ValueError:  # a name is repeated
        return {}
    if not isinstance(entries, dict):
        return {}
    valid = {label: _valid(entry, value) for label, value in entries.items()}
    return {label: value for label, value in valid.items() if value is not None}


def _valid(kind: TypeAdapter[Any], content: Any) -> Any:
    """Return content as its type, None where it is not valid."""
    try:
        return kind.validate_python(content)
    except ValidationError:
        return None
