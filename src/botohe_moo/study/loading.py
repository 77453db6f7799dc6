"""Reading a study file, and checking all of it before anything runs."""

import itertools
import json
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias, get_args

import numpy as np
from pydantic import BaseModel, ValidationError

from botohe_moo.algorithms.registry import algorithm_faults, make_algorithm
from botohe_moo.base.documents import Document, DocumentError
from botohe_moo.base.files import read_bytes
from botohe_moo.base.messages import most_alike, quoted
from botohe_moo.base.parameters import faults_in
from botohe_moo.bounds.plain import check_boundable
from botohe_moo.mission.formats.nodelink import mission_content
from botohe_moo.mission.formats.reading import is_file_name
from botohe_moo.mission.loading import load_mission, mission_faults, mission_origin, relative_to
from botohe_moo.mission.model import Mission, mission_digest
from botohe_moo.objectives import Objectives
from botohe_moo.problem import BOTOHE, PROBLEMS, find_problem
from botohe_moo.study.content import StudyFile, canonical, value_text
from botohe_moo.study.identity import OPERATORS, algorithm_identity, algorithm_origin
from botohe_moo.study.model import (
    Study,
    StudyAlgorithm,
    StudyError,
    StudyMission,
    result_key,
    seeds_of,
)

Place: TypeAlias = tuple[int | str, ...]  # keys and positions on the way to a value
Fault: TypeAlias = tuple[Place, str]  # what is wrong there, as a sentence

_MOST_RUNS = 250_000  # each takes 200 bytes of memory, and a file


def load_study(source: str | os.PathLike[str] | Mapping[str, Any]) -> Study:
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
        content = _as_json(source)
        text = json.dumps(content, indent=1, ensure_ascii=False) + "\n"  # JSON is YAML, too
    else:
        path = Path(source)
        text = _read_text(path)
        try:
            document = Document(text)
        except DocumentError as error:
            raise StudyError(f"{path}:{error}") from None
        content = _as_json(document.content, f"{path}: ")
    found = validate(content, text, path.parent)
    if isinstance(found, Study):
        return found
    raise StudyError("\n".join(_lines(found, path, document)))


def validate(content: Any, text: str = "", folder: Path = Path()) -> Study | list[Fault]:
    """Check the content of a study file; return the study, or everything that is wrong with it.

    ``text`` is kept with the study, and paths in the content are relative to ``folder``. The code
    of missions, algorithms and a problem is imported, and missions are loaded.
    """
    try:
        file = StudyFile.model_validate(content)
    except ValidationError as invalid:
        return faults_in(content, invalid, known_keys=_known_keys)
    seeds = seeds_of(file.seeds)
    n_runs = _n_members(file.missions) * _n_members(file.algorithms) * len(seeds)
    if n_runs > _MOST_RUNS:
        return [(("seeds",), f"expected at most {_MOST_RUNS:,} runs, found {n_runs:,}.")]
    faults: list[Fault] = []

    def fault(place: Place, message: str) -> None:
        faults.append((place, message))

    loaded = (_read_mission(m, file, folder, fault) for m in _members(file.missions))
    missions = [mission for mission in loaded if mission]
    problem = file.problem
    if problem is not None:
        judged = _with_objectives(missions, problem, fault)
        missions, problem = (judged, problem) if judged else (missions, None)
    algorithms = _read_algorithms(_members(file.algorithms), problem, fault)
    if not faults:
        _check_together(file, missions, algorithms, fault)
    if faults:
        return faults
    return Study(file, text, tuple(missions), tuple(algorithms), seeds)


_Note: TypeAlias = Callable[[Place, str], None]  # notes a fault


class _Member(NamedTuple):
    """A mission or algorithm of an entry: one combination of its grid, or all there is."""

    family: str  # label of the entry
    label: str  # that of the entry, and the combination in brackets
    entry: Any
    parameters: dict[str, Any]  # those of the entry and of the combination
    grid: dict[str, Any]  # those of the combination only

    def place(self, kind: str, parameter: str | None) -> Place:
        """Return where the file gives a parameter, or for None its name."""
        own: Place = (f"{kind}s", self.family)
        if parameter is None:
            return (*own, kind)
        for key in ("grid", "parameters"):
            if parameter in getattr(self.entry, key):
                return (*own, key, parameter)
        return (*own, parameter)


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


def _read_mission(
    member: _Member, file: StudyFile, folder: Path, fault: _Note
) -> StudyMission | None:
    """Load a mission with its limits, or note why it cannot be used."""
    entry, name = member.entry, member.entry.mission
    budget: Any = entry.budget or file.budget  # one of them is there, as pydantic has checked
    if is_file_name(name):
        name = str(folder / name)
    parameters = {**entry.own_parameters, **relative_to(folder, name, member.parameters)}
    try:
        mission = _load(name, parameters)
    except (Exception, SystemExit) as error:  # whatever another package's code may do
        found = [] if _is_main(name) else mission_faults(name, parameters)
        for key, said in found or [(None, _said(error))]:
            fault(member.place("mission", key), said if key else f"{name!r}: {said}")
        return None
    limit = math.inf if entry.max_length == "unlimited" else entry.max_length
    try:
        problem = BOTOHE(mission, min_survival=entry.min_survival, max_length=limit)
    except ValueError as error:
        fault(("missions", member.family), str(error))
        return None
    return StudyMission(
        label=member.label,
        mission=mission,
        source={"name_or_path": name, **parameters},
        origin=mission_origin(name),
        min_survival=entry.min_survival,
        max_length=problem.max_length,
        budget=budget,
        digest=mission_digest(mission),
        family=member.family,
        grid=member.grid,
    )


def _load(name: str, parameters: Mapping[str, Any]) -> Mission:
    """Load a mission that can be saved with the study, and is the same each time."""
    _refuse_main(name)
    mission = load_mission(name, **parameters)
    mission_content(mission)  # raises if it cannot be saved
    foreign = ":" in name or mission_origin(name)["package"] not in (None, "botohe-moo")
    if foreign and load_mission(name, **parameters) != mission:
        raise ValueError("it gives another mission each time; it needs a seed as a parameter")
    return mission


def _is_main(value: Any) -> bool:
    return isinstance(value, str) and value.startswith("__main__:")


def _refuse_main(*values: Any) -> None:
    """Refuse what ``__main__`` defines: the processes that perform runs cannot import it."""
    for value in values:
        if _is_main(value):
            name = value.partition(":")[2]
            raise ValueError(
                "runs are performed in other processes, which cannot import what a notebook or "
                f"script defines; save {name} in a file, such as mine.py, and write mine:{name}"
            )


def _read_algorithms(
    members: Iterable[_Member], problem: str | None, fault: _Note
) -> list[StudyAlgorithm]:
    """Check algorithms with their parameters; note what is wrong with them."""
    origins: dict[str, dict[str, str | None]] = {}  # each reads files, and many are the same
    algorithms = []
    for member in members:
        name, parameters = member.entry.algorithm, member.parameters
        try:
            _refuse_main(name, *parameters.values())
            found = algorithm_faults(name, parameters)
        except ValueError as error:
            found = [(None, f"{error}.")]
        for key, said in found:
            fault(member.place("algorithm", key), said if key else f"{name!r}: {said}")
        if found:
            continue
        code = f"{name} {[parameters.get(kind) for kind in OPERATORS]}"
        if code not in origins:
            origins[code] = algorithm_origin(name, parameters, problem)
        algorithms.append(
            StudyAlgorithm(
                label=member.label,
                algorithm=name,
                parameters=parameters,
                origin=origins[code],
                identity=algorithm_identity(name, parameters),
                family=member.family,
                grid=member.grid,
            )
        )
    return algorithms


def _with_objectives(
    missions: Iterable[StudyMission], path: str, fault: _Note
) -> list[StudyMission]:
    """Return missions with a problem's objectives; note what is wrong."""
    try:
        _refuse_main(path)
        find_problem(path)
        return [replace(m, own_objectives=_objectives(m, path)) for m in missions]
    except ValueError as error:
        said = str(error).removeprefix(f"{PROBLEMS.source(path)}: ").rstrip(".")
        fault(("problem",), f"{path!r}: {said}.")
        return []


def _objectives(mission: StudyMission, path: str) -> Objectives:
    try:
        problem = mission.problem(path)
    except (Exception, SystemExit) as error:  # whatever another package's code may raise
        raise ValueError(f"it cannot be made ({type(error).__name__}: {error})") from error
    if problem.n_obj != len(problem.objectives):
        expected = f"expected n_obj = {len(problem.objectives)}, as its objectives state"
        raise ValueError(f"{expected}, got {problem.n_obj}")
    return problem.objectives


def _said(error: BaseException) -> str:
    return str(error) if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"


def _check_together(
    file: StudyFile,
    missions: Sequence[StudyMission],
    algorithms: Sequence[StudyAlgorithm],
    fault: _Note,
) -> None:
    """Note what is wrong with missions and algorithms that are right one by one."""
    tried = [mission for mission in missions if not mission.mission.is_plain]
    if file.problem and not tried:
        tried = [*missions[:1]]
    for algorithm in algorithms:
        reasons = (_refusal(algorithm, mission.problem(file.problem)) for mission in tried)
        if why := next(filter(None, reasons), None):
            place = ("algorithms", algorithm.family, "algorithm")
            fault(place, f"{algorithm.algorithm!r}: {why}")
    for mission in missions:
        try:
            if file.bounds:
                check_boundable(mission.mission, "bound_front")
        except ValueError as error:
            fault(("bounds",), str(error))
            break
    for mission in missions:
        if file.reference == "best-known" and mission.library_name is None:
            fault(
                ("missions", mission.family),
                "reference: best-known expects missions of the library with their own robots "
                f"and limits; {quoted(mission.label)} is not one, or has others.",
            )
    # Two algorithms that differ in their number of threads are the same on a mission whose runs
    # are not limited by seconds.
    unlimited = [mission for mission in missions if mission.budget.seconds is None]
    first = (unlimited or missions)[0]
    keys = [result_key(mission, algorithms[0], file.recording) for mission in missions]
    _check_distinct("mission", missions, keys, "", fault)
    keys = [result_key(first, algorithm, file.recording) for algorithm in algorithms]
    _check_distinct(
        "algorithm",
        algorithms,
        keys,
        ": defaults, spellings and numbers of threads make no other run",
        fault,
    )
    labels = [algorithm.label for algorithm in algorithms]
    if (control := file.comparison.control) is not None and control not in labels:
        known = most_alike(control, labels)
        fault(("comparison", "control"), f"there is no algorithm {quoted(control)}{known}.")


def _refusal(algorithm: StudyAlgorithm, problem: BOTOHE) -> str | None:
    """Return why an algorithm refuses a problem, in the words of ``minimize``; None if not."""
    try:
        made = make_algorithm(algorithm.algorithm, **algorithm.parameters)
        made.setup(problem, termination=("n_eval", 1), seed=1)
    except TypeError as error:
        return str(error)
    except (Exception, SystemExit):  # not a refusal: its runs will fail, and say why
        pass
    return None


def _check_distinct(
    kind: str, members: Sequence[Any], keys: Iterable[Any], why: str, fault: _Note
) -> None:
    """Refuse missions or algorithms whose results depend on the same."""
    seen: dict[str, Any] = {}
    for member, key in zip(members, keys, strict=True):
        other = seen.setdefault(canonical(key), member)
        if other is not member:
            same = f"{quoted(member.label)} is the same as {quoted(other.label)}"
            fault((f"{kind}s", member.family), f"{same}{why}.")


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
    numbered: dict[tuple[int, str], None] = {}
    for place, sentence in faults:
        line = document.line(place) if document else 0
        text = f"{'.'.join(map(str, place))}: {sentence}" if place else sentence
        numbered[line, " ".join(text.split())] = None
    ordered = sorted(numbered, key=lambda entry: entry[0])
    return [f"{path}:{line}: {text}" if document else text for line, text in ordered]


def _as_json(content: Any, where: str = "") -> Any:
    """Return content with the types of JSON only: mappings, lists, texts, numbers, flags."""
    try:
        return json.loads(json.dumps(content, default=_plain))
    except (TypeError, RecursionError, ValueError) as error:  # such as one that contains itself
        raise StudyError(f"{where}Expected what a study file can hold: {error}.") from None


def _plain(value: Any) -> Any:
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
        raise StudyError(f"{path}: there is no such file{beside}.") from None
    except (OSError, ValueError) as error:  # such as text that is not UTF-8
        raise StudyError(f"{path}: cannot be read ({error}).") from None
