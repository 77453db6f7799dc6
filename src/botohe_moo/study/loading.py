"""Reading a study file, and checking all of it before anything runs."""

import itertools
import json
import math
import operator
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from pydantic import BaseModel, ValidationError

from botohe_moo.algorithms.registry import algorithm_parameters, make_algorithm
from botohe_moo.base.documents import Document
from botohe_moo.base.files import FilePath, Source
from botohe_moo.base.messages import FaultsError, quoted
from botohe_moo.base.parameters import changes_nothing, faults_in, plain_value, raised_faults
from botohe_moo.base.registry import is_path
from botohe_moo.indicators import INDICATORS
from botohe_moo.mission.formats.graphs import mission_content
from botohe_moo.mission.formats.reading import is_file_name
from botohe_moo.mission.loading import load_mission, mission_origin, relative_to
from botohe_moo.mission.model import mission_digest
from botohe_moo.problem import BOTOHE, find_problem
from botohe_moo.study import content as c
from botohe_moo.study import model as m

Place: TypeAlias = tuple[int | str, ...]  # keys and positions on the way to a value
Fault: TypeAlias = tuple[Place, str]  # what is wrong there, as a sentence

_MOST_RUNS = 250_000  # each takes 200 bytes of memory, and a file


def load_study(source: FilePath | Mapping[str, Any]) -> m.Study:
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
        content = plain_value(dict(source))
        if content is NotImplemented:
            raise m.StudyError(f"Expected what a study file can hold, got {quoted(source)}.")
        text = json.dumps(content, indent=1, ensure_ascii=False) + "\n"  # JSON is YAML, too
    else:
        path = Path(source)
        read = Source(path)
        try:
            text, document = read.text, read.yaml
        except FaultsError as error:
            raise m.StudyError(f"{error}.") from None
        except ValueError as error:
            raise m.StudyError(f"{path}: {error}") from None
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
        file = c.StudyFile.model_validate(content)
    except ValidationError as invalid:
        return faults_in(content, invalid, known_keys=_known_keys)
    n_runs = _n_members(file.missions) * _n_members(file.algorithms) * len(file.seeds)
    if n_runs > _MOST_RUNS:
        return [(("seeds",), f"expected at most {_MOST_RUNS:,} runs, found {n_runs:,}.")]
    if faults := [*_of_main(content)]:
        return faults
    if problem := file.problem:
        for _, said in raised_faults(find_problem, {"problem": problem}):
            return [(("problem",), said)]
    read_mission = partial(_read_mission, file, folder)
    missions = _read_all("mission", file.missions, read_mission, faults)
    read_algorithm = partial(_read_algorithm, problem)
    algorithms = _read_all("algorithm", file.algorithms, read_algorithm, faults)
    if faults:
        return faults
    study = m.Study(file, text, tuple(missions), tuple(algorithms), tuple(file.seeds))
    return [*_faults_together(study)] or study


def _n_members(entries: Mapping[str, Any]) -> int:
    """Return how many missions or algorithms the entries are, with their grids expanded."""
    return sum(math.prod(map(len, entry.grid.values())) for entry in entries.values())


def _read_all(
    kind: str, entries: Mapping[str, Any], read: Callable[..., Any], faults: list[Fault]
) -> list[Any]:
    """Read the missions or algorithms of entries; note what keeps some from being read."""
    found: list[Any] = []
    for family, entry in entries.items():
        for label, grid in entry.members(family):
            given = {"entry": entry, "grid": grid, "label": label, "family": family}
            for key, said in raised_faults(lambda **each: found.append(read(**each)), given):
                where = [name for name in ("grid", "parameters") if key in getattr(entry, name)]
                known = key if where or key in type(entry).model_fields else None
                place = (f"{kind}s", family, *where, known or kind)
                faults.append((place, said if known else f"{getattr(entry, kind)!r}: {said}"))
    return found


def _read_mission(
    file: c.StudyFile, folder: Path, entry: c.MissionEntry, grid: Mapping[str, Any], **labels: Any
) -> m.StudyMission:
    """Load a mission that can be saved with the study, and is the same each time."""
    name = entry.mission
    budget = entry.budget or file.budget
    if budget is None:
        raise ValueError("expected a budget of its own or of the study, found neither")
    if is_file_name(name):
        name = str(folder / name)
    parameters = dict(relative_to(folder, name, {**entry.parameters, **grid}))
    if entry.robots is not None:
        if "robots" in parameters:
            raise ValueError("expected robots once, found it among the parameters, too")
        parameters["robots"] = entry.robots
    mission, package = load_mission(name, **parameters), mission_origin(name)["package"]
    mission_content(mission)  # raises if it cannot be saved
    foreign = ":" in name or package not in (None, "botohe-moo")
    if foreign and load_mission(name, **parameters) != mission:
        raise ValueError("it gives another mission each time; it needs a seed as a parameter")
    limit = math.inf if entry.max_length == "unlimited" else entry.max_length
    kind = find_problem(file.problem) if file.problem else BOTOHE
    problem = kind(mission, min_survival=entry.min_survival, max_length=limit)
    return m.StudyMission(
        mission=mission,
        source={"name_or_path": name, **parameters},
        min_survival=entry.min_survival,
        max_length=problem.max_length,
        budget=budget,
        digest=mission_digest(mission),
        own_objectives=problem.objectives if file.problem else None,
        grid=grid,
        **labels,
    )


def _read_algorithm(
    problem: str | None, entry: c.AlgorithmEntry, grid: Mapping[str, Any], **labels: Any
) -> m.StudyAlgorithm:
    """Make an algorithm once, to see that it can be made, and find out what identifies it."""
    name, parameters = entry.algorithm, {**entry.parameters, **grid}
    made, stated = make_algorithm(name, **parameters), algorithm_parameters(name)
    defaults = {p.name: p.default for p in stated if p.own and not p.required}
    # A method that takes any keywords may give its class other defaults, which are not stated.
    handed_on = {p.name: getattr(made, p.name, NotImplemented) for p in stated if not p.own}
    values = {k: plain_value(v) for k, v in {**handed_on, **defaults, **parameters}.items()}
    return m.StudyAlgorithm(
        algorithm=name,
        parameters=parameters,
        # An empty list, such as that of plans to start from, says nothing.
        effective={k: v for k, v in values.items() if v not in (NotImplemented, [])},
        neutral=frozenset(p.name for p in stated if changes_nothing(p.hint)),
        origin=m.algorithm_origin(name, parameters, problem),
        grid=grid,
        **labels,
    )


def _of_main(content: Any, place: Place = ()) -> Iterator[Fault]:
    """Yield what ``__main__`` defines: the processes that perform runs cannot import it."""
    if isinstance(content, dict | list):
        for key, value in content.items() if isinstance(content, dict) else enumerate(content):
            yield from _of_main(value, (*place, key))
    elif isinstance(content, str) and content.startswith("__main__:"):
        name = content.partition(":")[2]
        yield (
            place,
            "runs are performed in other processes, which cannot import what a notebook or script "
            f"defines; save {name} in a file, such as mine.py, and write mine:{name}.",
        )


def _faults_together(study: m.Study) -> Iterator[Fault]:
    """Yield what is wrong with missions and algorithms that are right one by one."""
    file, missions = study.file, study.missions
    tried = [mission for mission in missions if not mission.mission.is_plain]
    if file.problem:
        tried = tried or [missions[0]]
    for algorithm, mission in itertools.product(study.algorithms, tried):
        given = {"algorithm": algorithm, "problem": mission.problem(file.problem)}
        for _, said in raised_faults(_set_up, given):
            place = ("algorithms", algorithm.family, "algorithm")
            yield place, f"{algorithm.algorithm!r}: {said}"
    most, scale = missions[0].objectives.bounds, missions[0].own_objectives or missions[0].mission
    front = {"points": np.empty((0, len(most))), "reference": np.array([most]), "mission": scale}
    for i, name in enumerate(file.indicators):  # each is tried before anything runs
        find = INDICATORS.load if is_path(name) else INDICATORS.find
        wrong = raised_faults(find, {"name": name}) or raised_faults(INDICATORS[name], front)
        for _, said in wrong:
            yield ("indicators", i), f"{name!r}: {said}"
    others = [quoted(mission.label) for mission in missions if not mission.library_name]
    if file.reference == "best-known" and others:
        yield ("reference",), f"{others[0]} is not a mission of the library with its own limits."
    if len({mission.objectives.columns for mission in missions}) > 1:
        yield ("problem",), f"{file.problem!r}: expected the same objectives for all missions."
    first: dict[str, m.Run] = {}
    for run in replace(study, seeds=study.seeds[:1]).runs():
        mission, algorithm, other = run.mission, run.algorithm, first.setdefault(run.digest, run)
        if other.mission is not mission:
            said = f"{quoted(mission.label)} is the same as {quoted(other.mission.label)}."
            yield ("missions", mission.family), said
        elif other is not run:
            said = f"{quoted(algorithm.label)} is the same as {quoted(other.algorithm.label)}"
            why = "defaults and numbers of threads make no other run"
            yield ("algorithms", algorithm.family), f"{said}: {why}."
    known = [algorithm.label for algorithm in study.algorithms]
    if (control := file.comparison.control) not in (None, *known):
        said = f"there is no algorithm {quoted(control)}; known are {', '.join(known)}."
        yield ("comparison", "control"), said


def _set_up(algorithm: m.StudyAlgorithm, problem: BOTOHE) -> None:
    """Set an algorithm up, as ``minimize`` does, to see whether it refuses a problem."""
    made = make_algorithm(algorithm.algorithm, **algorithm.parameters)
    made.setup(problem, termination=("n_eval", 1), seed=1)


def study_schema() -> str:
    """Return the JSON Schema of study files, with which editors check them."""
    return json.dumps(c.StudyFile.model_json_schema(), indent=1) + "\n"


def _known_keys(place: Place) -> list[str]:
    """Return the keys that the mapping at a place may have."""
    models: dict[Any, type[BaseModel]] = {
        "missions": c.MissionEntry,
        "algorithms": c.AlgorithmEntry,
        "budget": c.Budget,
        "recording": c.Recording,
        "comparison": c.Comparison,
        "bounds": c.Bounds,
    }
    last = place[2:] or place[:1]  # the second is the label of a mission or algorithm
    return list(models[last[0]].model_fields if last else c.StudyFile.model_fields)


def _lines(faults: Iterable[Fault], path: Path, document: Document | None) -> list[str]:
    """Return a line of text for each fault, each once, in the order of the file if there is one."""
    numbered = {}
    for place, sentence in faults:
        text = f"{'.'.join(map(str, place))}: {sentence}" if place else sentence
        numbered[" ".join(text.split())] = document.line(place) if document else 0
    ordered = sorted(numbered.items(), key=operator.itemgetter(1))
    return [f"{path}:{line}: {text}" if document else text for text, line in ordered]
