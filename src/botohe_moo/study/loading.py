"""Reading a study file, and checking all of it before anything runs."""

import itertools
import json
import math
import operator
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias, TypeVar, get_args

import numpy as np
from pydantic import BaseModel, ValidationError

from botohe_moo.algorithms.registry import make_algorithm
from botohe_moo.base.documents import Document, DocumentError
from botohe_moo.base.files import read_bytes
from botohe_moo.base.messages import most_alike, quoted
from botohe_moo.base.parameters import faults_in, raised_faults
from botohe_moo.bounds.plain import check_boundable
from botohe_moo.indicators import INDICATORS
from botohe_moo.mission.formats.nodelink import mission_content
from botohe_moo.mission.formats.reading import is_file_name
from botohe_moo.mission.loading import load_mission, mission_origin, relative_to
from botohe_moo.mission.model import mission_digest
from botohe_moo.problem import BOTOHE, PROBLEMS, find_problem
from botohe_moo.study import model as m
from botohe_moo.study.content import StudyFile, canonical, value_text
from botohe_moo.study.model import algorithm_identity, algorithm_origin

T = TypeVar("T")
Place: TypeAlias = tuple[int | str, ...]  # keys and positions on the way to a value
Fault: TypeAlias = tuple[Place, str]  # what is wrong there, as a sentence

_MOST_RUNS = 250_000  # each takes 200 bytes of memory, and a file


def load_study(source: str | os.PathLike[str] | Mapping[str, Any]) -> m.Study:
    """Read a study file, and check all of it before anything runs.

    Parameters
    ----------
    source
        Path of a YAML file, or the content of one as a mapping.

    Raises
    ------
    StudyError
        If there are faults; lists each with its file and line, what was expected and found. Names
        and parameters are checked once every key has a value of its type.

    Examples
    --------
    >>> from botohe_moo.study import load_study
    >>> study = load_study({
    ...     "name": "trial",
    ...     "missions": ["toy"],
    ...     "algorithms": {"ants": "bo-aco", "NSGA-II": {"algorithm": "nsga2"}},
    ...     "budget": {"evaluations": 1000},
    ...     "seeds": 5,
    ... })
    >>> len(study.runs())
    10
    """
    path, document = Path(), None
    if isinstance(source, Mapping):
        try:
            content = json.loads(json.dumps(source, default=_plain))
        except (TypeError, RecursionError, ValueError) as error:  # such as one that holds itself
            raise m.StudyError(f"Expected what a study file can hold: {error}.") from None
        text = json.dumps(content, indent=1, ensure_ascii=False) + "\n"  # JSON is YAML, too
    else:
        path = Path(source)
        text = _read_text(path)
        try:
            document = Document(text)
        except DocumentError as error:
            raise m.StudyError(f"{path}:{error}") from None
        content = document.content
    found = validate(content, text, path.parent)
    if isinstance(found, m.Study):
        return found
    raise m.StudyError("\n".join(_lines(found, path, document)))


def validate(content: Any, text: str = "", folder: Path = Path()) -> m.Study | list[Fault]:
    """Check the content of a study file; return the study, or everything that is wrong with it.

    ``text`` is kept with the study, and paths in the content are relative to ``folder``. The code
    of missions, algorithms and a problem is imported, and missions are loaded.
    """
    try:
        file = StudyFile.model_validate(content)
    except ValidationError as invalid:
        return faults_in(content, invalid, known_keys=_known_keys)
    seeds = m.seeds_of(file.seeds)
    n_runs = _n_members(file.missions) * _n_members(file.algorithms) * len(seeds)
    if n_runs > _MOST_RUNS:
        return [(("seeds",), f"expected at most {_MOST_RUNS:,} runs, found {n_runs:,}.")]
    faults: list[Fault] = []
    read_mission = partial(_read_mission, file=file, folder=folder)
    missions = _read_all("mission", file.missions, read_mission, faults)
    problem = file.problem
    if problem is not None:
        try:
            missions = _with_objectives(missions, problem)
        except ValueError as error:
            said = str(error).removeprefix(f"{PROBLEMS.source(problem)}: ").rstrip(".")
            faults.append((("problem",), f"{problem!r}: {said}."))
            problem = None
    read_algorithm = partial(_read_algorithm, problem=problem)
    algorithms = _read_all("algorithm", file.algorithms, read_algorithm, faults)
    if not faults:
        faults += _faults_together(file, missions, algorithms)
    return faults or m.Study(file, text, tuple(missions), tuple(algorithms), seeds)


@dataclass(frozen=True)
class _Member:
    """A mission or algorithm of an entry: one combination of its grid, or all there is."""

    family: str  # label of the entry
    label: str  # that of the entry, and the combination in brackets
    entry: Any
    parameters: dict[str, Any]  # those of the entry and of the combination
    grid: dict[str, Any]  # those of the combination only

    def place(self, kind: str, parameter: str | None) -> Place:
        """Return where the file gives a parameter, or for None its name."""
        key = [key for key in ("grid", "parameters") if parameter in getattr(self.entry, key)]
        return (f"{kind}s", self.family, *key, parameter or kind)


def _n_members(entries: Mapping[str, Any]) -> int:
    """Return how many missions or algorithms the entries are, with their grids expanded."""
    return sum(math.prod(map(len, entry.grid.values())) for entry in entries.values())


def _members(entries: Mapping[str, Any]) -> Iterator[_Member]:
    """Expand the grids of all missions or algorithms."""
    for family, entry in entries.items():
        for combination in itertools.product(*entry.grid.values()):
            grid = dict(zip(entry.grid, combination, strict=True))
            values = ", ".join(f"{name}={value_text(value)}" for name, value in grid.items())
            label = f"{family} ({values})" if values else family
            yield _Member(family, label, entry, {**entry.parameters, **grid}, grid)


def _read_all(
    kind: str, entries: Mapping[str, Any], read: Callable[[_Member], T], faults: list[Fault]
) -> list[T]:
    """Read the missions or algorithms of entries; note what keeps some from being read."""
    found: list[T] = []
    for member in _members(entries):
        for key, said in raised_faults(lambda each: found.append(read(each)), {"each": member}):
            name = getattr(member.entry, kind)
            faults.append((member.place(kind, key), said if key else f"{name!r}: {said}"))
    return found


def _read_mission(member: _Member, file: StudyFile, folder: Path) -> m.StudyMission:
    """Load a mission that can be saved with the study, and is the same each time."""
    entry, name = member.entry, member.entry.mission
    budget: Any = entry.budget or file.budget  # one of them is there, as pydantic has checked
    _refuse_main(name)
    if is_file_name(name):
        name = str(folder / name)
    parameters = {**entry.own_parameters, **relative_to(folder, name, member.parameters)}
    mission, origin = load_mission(name, **parameters), mission_origin(name)
    mission_content(mission)  # raises if it cannot be saved
    foreign = ":" in name or origin["package"] not in (None, "botohe-moo")
    if foreign and load_mission(name, **parameters) != mission:
        raise ValueError("it gives another mission each time; it needs a seed as a parameter")
    limit = math.inf if entry.max_length == "unlimited" else entry.max_length
    problem = BOTOHE(mission, min_survival=entry.min_survival, max_length=limit)
    return m.StudyMission(
        label=member.label,
        mission=mission,
        source={"name_or_path": name, **parameters},
        origin=origin,
        min_survival=entry.min_survival,
        max_length=problem.max_length,
        budget=budget,
        digest=mission_digest(mission),
        family=member.family,
        grid=member.grid,
    )


def _read_algorithm(member: _Member, problem: str | None) -> m.StudyAlgorithm:
    """Make an algorithm once, to see that it can be made, and find out what identifies it."""
    name, parameters = member.entry.algorithm, member.parameters
    _refuse_main(name, *parameters.values())
    make_algorithm(name, **parameters)
    return m.StudyAlgorithm(
        label=member.label,
        algorithm=name,
        parameters=parameters,
        origin=algorithm_origin(name, parameters, problem),
        identity=algorithm_identity(name, parameters),
        family=member.family,
        grid=member.grid,
    )


def _refuse_main(*values: Any) -> None:
    """Refuse what ``__main__`` defines: the processes that perform runs cannot import it."""
    for value in values:
        if isinstance(value, str) and value.startswith("__main__:"):
            name = value.partition(":")[2]
            raise ValueError(
                "runs are performed in other processes, which cannot import what a notebook or "
                f"script defines; save {name} in a file, such as mine.py, and write mine:{name}"
            )


def _with_objectives(missions: Iterable[m.StudyMission], path: str) -> list[m.StudyMission]:
    """Return missions with a problem's objectives; a ValueError says what is wrong with it."""
    _refuse_main(path)
    find_problem(path)
    judged: list[m.StudyMission] = []
    for mission in missions:
        try:
            problem = mission.problem(path)
        except (Exception, SystemExit) as error:  # whatever another package's code may raise
            raise ValueError(f"it cannot be made ({type(error).__name__}: {error})") from error
        stated = problem.objectives
        if problem.n_obj != len(stated):
            expected = f"expected n_obj = {len(stated)}, as its objectives state"
            raise ValueError(f"{expected}, got {problem.n_obj}")
        first = judged[0].own_objectives if judged else None
        if first is not None and (first.names, first.columns) != (stated.names, stated.columns):
            pair = f"{judged[0].label!r} and {mission.label!r}"
            raise ValueError(f"expected the same objectives for all missions; {pair} differ")
        judged.append(replace(mission, own_objectives=stated))
    return judged


def _faults_together(
    file: StudyFile, missions: Sequence[m.StudyMission], algorithms: Sequence[m.StudyAlgorithm]
) -> Iterator[Fault]:
    """Yield what is wrong with missions and algorithms that are right one by one."""
    tried = [mission for mission in missions if not mission.mission.is_plain]
    if file.problem:
        tried = tried or [missions[0]]
    for algorithm in algorithms:
        reasons = (_refusal(algorithm, mission.problem(file.problem)) for mission in tried)
        if why := next(filter(None, reasons), None):
            place = ("algorithms", algorithm.family, "algorithm")
            yield place, f"{algorithm.algorithm!r}: {why}"
    most, scale = missions[0].objectives.bounds, missions[0].own_objectives or missions[0].mission
    for name in file.indicators:  # each is tried before anything runs
        try:
            INDICATORS[name](np.empty((0, len(most))), np.array([most]), scale)
        except ValueError as error:
            yield ("indicators",), str(error)
    if file.bounds:
        try:
            for mission in missions:
                check_boundable(mission.mission, "bound_front")
        except ValueError as error:
            yield ("bounds",), str(error)
    for mission in missions:
        if file.reference == "best-known" and mission.library_name is None:
            yield (
                ("missions", mission.family),
                "reference: best-known expects missions of the library with their own robots "
                f"and limits; {quoted(mission.label)} is not one, or has others.",
            )
    # Two algorithms that differ in their number of threads are the same on a mission whose runs
    # are not limited by seconds.
    unlimited = [mission for mission in missions if mission.budget.seconds is None]
    first = (unlimited or missions)[0]
    each = [m.result_key(mission, algorithms[0], file.recording) for mission in missions]
    yield from _same_keys("missions", missions, each, "")
    each = [m.result_key(first, algorithm, file.recording) for algorithm in algorithms]
    why = ": defaults, spellings and numbers of threads make no other run"
    yield from _same_keys("algorithms", algorithms, each, why)
    labels = [algorithm.label for algorithm in algorithms]
    if (control := file.comparison.control) is not None and control not in labels:
        known = most_alike(control, labels)
        yield ("comparison", "control"), f"there is no algorithm {quoted(control)}{known}."


def _refusal(algorithm: m.StudyAlgorithm, problem: BOTOHE) -> str | None:
    """Return why an algorithm refuses a problem, in the words of ``minimize``; None if not."""
    try:
        made = make_algorithm(algorithm.algorithm, **algorithm.parameters)
        made.setup(problem, termination=("n_eval", 1), seed=1)
    except TypeError as error:
        return str(error)
    except (Exception, SystemExit):  # not a refusal: its runs will fail, and say why
        pass
    return None


def _same_keys(kind: str, members: Sequence[Any], keys: Iterable[Any], why: str) -> Iterator[Fault]:
    """Yield the missions or algorithms whose results depend on the same as those of another."""
    seen: dict[str, Any] = {}
    for member, key in zip(members, keys, strict=True):
        other = seen.setdefault(canonical(key), member)
        if other is not member:
            same = f"{quoted(member.label)} is the same as {quoted(other.label)}"
            yield (kind, member.family), f"{same}{why}."


def study_schema() -> str:
    """Return the JSON Schema of study files, with which editors check them."""
    schema = StudyFile.model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    return json.dumps(schema, indent=1) + "\n"


def _known_keys(place: Place) -> list[str]:
    """Return the keys that the mapping at a place may have."""
    model: type[BaseModel] = StudyFile
    for step in place[:1] + place[2:]:  # the second is the label of a mission or algorithm
        model = _model_in(model.model_fields[str(step)].annotation) or model
    return list(model.model_fields)


def _model_in(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(_model_in, get_args(annotation))), None)


def _lines(faults: Iterable[Fault], path: Path, document: Document | None) -> list[str]:
    """Return a line of text for each fault, each once, in the order of the file if there is one."""
    numbered = {}
    for place, sentence in faults:
        text = f"{'.'.join(map(str, place))}: {sentence}" if place else sentence
        numbered[" ".join(text.split())] = document.line(place) if document else 0
    ordered = sorted(numbered.items(), key=operator.itemgetter(1))
    return [f"{path}:{line}: {text}" if document else text for text, line in ordered]


def _plain(value: Any) -> Any:
    """Return what is no type of JSON as one that is: mappings and numbers of numpy."""
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"got {quoted(value)}")


def _read_text(path: Path) -> str:
    try:
        return read_bytes(path).decode("utf-8-sig")
    except FileNotFoundError:
        beside = most_alike(path.name, (p.name for p in path.parent.glob("[!.]*.y*ml")))
        raise m.StudyError(f"{path}: no such file{beside}.") from None
    except (OSError, ValueError) as error:  # such as text that is not UTF-8
        raise m.StudyError(f"{path}: cannot be read ({error}).") from None
