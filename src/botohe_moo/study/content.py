"""The content of a study file, as pydantic models."""

import itertools
import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Annotated, Any, Literal, Self

import pydantic
from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo

from botohe_moo.base.messages import quoted
from botohe_moo.base.parameters import NotNegative, Probability, Size
from botohe_moo.indicators import INDICATORS
from botohe_moo.mission.loading import ENTRIES, PREFIX, SELECTIONS, library_names

_MAX_SEEDS = 100_000


def value_text(value: Any) -> str:
    """Return a parameter's value as a study file has it: a text as it is, all others as JSON."""
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def parameter_words(parameters: Mapping[str, Any]) -> str:
    """Return parameters as name=value."""
    return ", ".join(f"{name}={value_text(value)}" for name, value in parameters.items())


def canonical(value: Any) -> str:
    """Return any value of a study file as a text; equal values, as 1 and 1.0, give equal texts."""
    return json.dumps(json.loads(json.dumps(value), parse_int=float), sort_keys=True)


def _check_distinct(what: str, values: Sequence[Any]) -> Sequence[Any]:
    """Refuse values if two of them are equal, as 1 and 1.0 are."""
    texts = [canonical(value) for value in values]
    for text, count in Counter(texts).items():
        if count > 1:
            value = quoted(values[texts.index(text)])
            raise ValueError(f"expected each {what} once; {value} is there {count} times")
    return values


def _all_distinct(what: str) -> AfterValidator:
    return AfterValidator(partial(_check_distinct, what))


def _counted_seeds(value: Any) -> Any:
    """Return a count of seeds as the list of them; all else as it is."""
    is_count = isinstance(value, int) and not isinstance(value, bool)
    if not (is_count or isinstance(value, list)):
        raise ValueError(f"expected a count or a list of seeds, got {quoted(value)}")
    return [*range(1, min(value, _MAX_SEEDS + 1) + 1)] if is_count else value


def _labelled(value: Any) -> Any:
    """Return a list of names as a mapping with the names as labels; all else as it is."""
    if isinstance(value, list) and all(isinstance(name, str) for name in value):
        return {name: name for name in _check_distinct("name", value)}
    return value


def _labelled_missions(value: Any) -> Any:
    """Return a list of names as a mapping, and several missions of the library one by one.

    Those of a list have their own names as labels. Those of an entry with a label are labelled
    "LABEL (NAME)", as the members of a grid are.
    """
    entries = _labelled(value)
    if not isinstance(entries, dict):
        return entries
    expanded = [pair for label, entry in entries.items() for pair in _members_of(label, entry)]
    _check_distinct("mission", [label for label, _ in expanded])
    return dict(expanded)


def _members_of(label: str, entry: Any) -> Iterator[tuple[str, Any]]:
    name = entry.get("mission") if isinstance(entry, dict) else entry
    selection = str(name).removeprefix(PREFIX)
    if selection == name or selection not in (*SELECTIONS, *ENTRIES):
        yield label, entry
        return
    for member in library_names(selection):
        own = label if selection in ENTRIES else f"{label} ({member})"
        mission = f"{PREFIX}{member}"
        one = {**entry, "mission": mission} if isinstance(entry, dict) else mission
        yield (member if label == name else own), one


Text = Annotated[str, Field(max_length=200, pattern=r"^\S(.*\S)?$")]
# matplotlib leaves labels that begin with _ out of legends.
Label = Annotated[str, Field(max_length=200, pattern=r"^[^\s_](.*\S)?$")]
Name = Annotated[str, Field(max_length=100, pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")]
Count = Annotated[int, Field(ge=1, le=10**12)]
Seconds = Annotated[float, Field(gt=0, le=1e9)]
Seed = Annotated[int, Field(ge=0, le=2**32 - 1)]
SeedList = Annotated[list[Seed], Field(min_length=1, max_length=_MAX_SEEDS), _all_distinct("seed")]
Values = Annotated[list[Any], Field(min_length=1), _all_distinct("value")]


class _Entry(pydantic.BaseModel):
    """A mapping in the study file: nothing is converted, and no key is ignored."""

    model_config = pydantic.ConfigDict(
        allow_inf_nan=False, extra="forbid", frozen=True, strict=True, use_attribute_docstrings=True
    )


class Budget(_Entry):
    """What a run may spend: evaluations, seconds, or whichever is spent first."""

    evaluations: Count | None = None
    """Trail plans to evaluate; no run evaluates more."""
    seconds: Seconds | None = None
    """The algorithm's own time, without compiling and recording. The iteration in which it
    is up is the last."""
    grace_seconds: Annotated[float, Field(ge=0, le=1e9)] = 10.0
    """How long after the time is up a run is killed that does not come to the end of an
    iteration."""

    @pydantic.model_validator(mode="after")
    def _check_that_one_is_given(self) -> Self:
        if self.evaluations is None and self.seconds is None:
            raise ValueError("expected evaluations or seconds, or both, found neither")
        return self


def _or_name(key: str, model: type[_Entry]) -> BeforeValidator:
    """Accept a name instead of the mapping ``{key: name}``."""

    def from_name(value: Any) -> Any:
        return {key: value} if isinstance(value, str) else value

    return BeforeValidator(from_name, json_schema_input_type=str | model)


class _Family(_Entry):
    """An entry that stands for several: every combination of its grid is one."""

    parameters: dict[str, Any] = {}
    """Its parameters; `botohe algorithms NAME` and `botohe missions NAME` list them."""
    grid: dict[str, Values] = {}
    """Parameters with several values each; every combination is one."""

    @pydantic.model_validator(mode="after")
    def _check_parameters(self) -> Self:
        _check_distinct("parameter", [*self.parameters, *self.grid])
        return self

    def members(self, label: str) -> Iterator[tuple[str, dict[str, Any]]]:
        """Yield a label and the values of each combination of the grid; one if there is no grid."""
        for values in itertools.product(*self.grid.values()):
            grid = dict(zip(self.grid, values, strict=True))
            yield f"{label} ({parameter_words(grid)})" if grid else label, grid


class MissionEntry(_Family):
    """One mission, or several by a grid."""

    mission: Text
    """A mission's name, or a mission file, relative to the study file."""
    robots: Size | None = None
    """Team size; default: the mission's own."""
    min_survival: Probability = 0.0
    """Survival floor: every robot has to survive with at least this probability."""
    max_length: NotNegative | Literal["unlimited"] | None = None
    """Travel budget: every robot's trail is at most this long, in the unit of the arcs' length;
    default: the mission's own, if it has one, which "unlimited" lifts."""
    budget: Budget | None = None
    """Budget of the runs on this mission; default: the study's."""


class AlgorithmEntry(_Family):
    """One algorithm with parameters, or several by a grid."""

    algorithm: Text
    """A registered algorithm's name, or module:Class."""


MissionOrName = Annotated[MissionEntry, _or_name("mission", MissionEntry)]
AlgorithmOrName = Annotated[AlgorithmEntry, _or_name("algorithm", AlgorithmEntry)]


class Recording(_Entry):
    """When a run's front is recorded: at log-spaced numbers of evaluations."""

    per_decade: Annotated[int, Field(ge=1, le=1_000)] = 20
    """Records in a tenfold of evaluations."""
    start: Annotated[float, Field(gt=0, le=0.01)] = 0.001
    """Share of the evaluations with which recording begins."""
    at: list[Count] = []
    """Further numbers of evaluations at which to record."""


class Comparison(_Entry):
    """How algorithms are compared."""

    control: Label | None = None
    """Label of the algorithm that all others are compared with; default: all pairs."""
    significance: Annotated[float, Field(gt=0, lt=1)] = 0.05
    """Significance level; intervals cover 1 minus this."""


class Bounds(_Entry):
    """A bound on the front of each mission: how far the fronts found are from the best there is."""

    seconds: Seconds
    """Time for the bound of a mission, when its runs are done."""


class StudyFile(_Entry):
    """A comparative study: algorithms on missions, each for several seeds."""

    name: Name
    """Short name: letters, digits, dots, dashes, underscores. Also the name of the folder."""
    title: Text | None = None
    """What the study is, in a line."""
    description: str | None = None
    """What the study is for."""
    missions: Annotated[
        dict[Label, MissionOrName],
        Field(min_length=1),
        BeforeValidator(
            _labelled_missions, json_schema_input_type=dict[str, MissionOrName] | list[str]
        ),
    ]
    """Missions under labels of your own; or a list of names and files, which are the labels.
    "library:small", "library:tunnel" and so on are several missions, with their own names."""
    algorithms: Annotated[
        dict[Label, AlgorithmOrName],
        Field(min_length=1),
        BeforeValidator(_labelled, json_schema_input_type=dict[str, AlgorithmOrName] | list[str]),
    ]
    """Algorithms under labels of your own; or a list of names, which are the labels."""
    problem: Text | None = None
    """Objectives of your own: module:Class, derived from BOTOHE; default: E[R] and E[S]."""
    budget: Budget | None = None
    """What each run may spend; a mission may have its own."""
    seeds: Annotated[
        SeedList, BeforeValidator(_counted_seeds, json_schema_input_type=Count | list[Seed])
    ]
    """A count, for the seeds 1, 2, ..., or a list of seeds."""
    recording: Recording = Recording()
    """When fronts are recorded."""
    indicators: Annotated[
        list[str],
        Field(default_factory=lambda: [*INDICATORS], min_length=1),
        _all_distinct("indicator"),
    ]
    """What fronts are judged by: names, or module:function."""
    reference: Literal["runs", "best-known"] = "runs"
    """What fronts are compared with: what all runs on a mission found together, or with it the best
    known front and the bound of the library."""
    comparison: Comparison = Comparison()
    """The control algorithm, if any, and the significance level."""
    bounds: Bounds | None = None
    """Bounds to be proved on the missions' fronts; default: none. No run depends on them."""

    @pydantic.field_validator("bounds", "reference")
    @classmethod
    def _check_objectives(cls, value: Any, info: ValidationInfo) -> Any:
        if value not in (None, "runs") and (problem := info.data.get("problem")):
            raise ValueError(f"expected E[R] and E[S], not the objectives of {problem!r}")
        return value
