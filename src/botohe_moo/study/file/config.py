"""The content of a study file, as pydantic models."""

from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationInfo,
    field_validator,
    model_validator,
)

from botohe_moo.base.messages import check_choice, quoted
from botohe_moo.indicators import INDICATORS
from botohe_moo.mission.loading import ENTRIES, PREFIX, SELECTIONS, library_names
from botohe_moo.study.file.values import Label, Name, Text, all_distinct, check_distinct

MAX_EVALUATIONS = 10**12
MAX_SEED = 2**32 - 1
MAX_SEEDS = 100_000


def _check_indicator(value: str) -> str:
    check_choice("an indicator", value, INDICATORS)
    return value


def labelled_missions(value: Any) -> Any:
    """Return a list of names as a mapping, and several missions of the library one by one.

    Those of a list have their own names as labels. Those of an entry with a label are labelled
    "LABEL (NAME)", as the members of a grid are.
    """
    entries = labelled(value)
    if not isinstance(entries, dict):
        return entries
    expanded: list[tuple[Any, Any]] = []
    for label, entry in entries.items():
        name = entry.get("mission") if isinstance(entry, dict) else entry
        selection = str(name).removeprefix(PREFIX)
        if selection == name or selection not in (*SELECTIONS, *ENTRIES):
            expanded.append((label, entry))
            continue
        for member in library_names(selection):
            own = label if selection in ENTRIES else f"{label} ({member})"
            mission = f"{PREFIX}{member}"
            one = {**entry, "mission": mission} if isinstance(entry, dict) else mission
            expanded.append((member if label == name else own, one))
    check_distinct("mission", [label for label, _ in expanded])
    return dict(expanded)


def labelled(value: Any) -> Any:
    """Return a list of names as a mapping of which they are the labels; all else as it is."""
    if isinstance(value, list) and all(isinstance(name, str) for name in value):
        return {name: name for name in check_distinct("name", value)}
    return value


IndicatorName = Annotated[
    str,
    AfterValidator(_check_indicator),
    Field(json_schema_extra=lambda schema: schema.update(enum=[*INDICATORS])),
]
Names = Annotated[list[str], Field(min_length=1)]
Count = Annotated[int, Field(ge=1, le=MAX_EVALUATIONS)]
Seconds = Annotated[float, Field(gt=0, le=1e9)]
Length = Annotated[float, Field(ge=0)]
Seed = Annotated[int, Field(ge=0, le=MAX_SEED)]
SeedList = Annotated[list[Seed], Field(min_length=1, max_length=MAX_SEEDS), all_distinct("seed")]
Values = Annotated[list[Any], Field(min_length=1), all_distinct("value")]


class _Entry(BaseModel):
    """A mapping in the study file: nothing is converted, and no key is ignored."""

    model_config = ConfigDict(
        allow_inf_nan=False,
        extra="forbid",
        frozen=True,
        strict=True,
        use_attribute_docstrings=True,
    )


class Budget(_Entry):
    """What a run may spend: evaluations, seconds, or whichever is spent first."""

    evaluations: Count | None = None
    """Trail plans to evaluate; no run evaluates more."""
    seconds: Seconds | None = None
    """The algorithm's own time, without recording. The iteration in which it is up is the last."""
    grace_seconds: Annotated[float, Field(ge=0, le=1e9)] = 10.0
    """How long after the time is up a run is killed that does not come to the end of an
    iteration."""

    @model_validator(mode="after")
    def _check_that_one_is_given(self) -> Self:
        if self.evaluations is None and self.seconds is None:
            raise ValueError("expected evaluations or seconds, or both, found neither")
        return self


def _or_name(key: str, model: type[_Entry]) -> BeforeValidator:
    """Accept a name instead of the mapping ``{key: name}``."""

    def from_name(value: Any) -> Any:
        if isinstance(value, str):
            return {key: value}
        if not isinstance(value, dict | model):
            expected = f"a name, or a mapping with {key}: NAME"
            raise ValueError(f"expected {expected}, got {quoted(value)}")
        return value

    return BeforeValidator(from_name, json_schema_input_type=str | model)


class MissionEntry(_Entry):
    """One mission, or several by a grid."""

    mission: Text
    """A mission's name, or a mission file, relative to the study file."""
    robots: Annotated[int, Field(ge=1)] | None = None
    """Team size; default: the mission's own."""
    lengths_from_pos: bool = False
    """Whether every arc is as long as its nodes are apart, by their pos."""
    parameters: dict[str, Any] = {}
    """Parameters of a named mission, such as a generator's nodes and seed."""
    grid: dict[str, Values] = {}
    """Parameters with several values each; every combination is a mission."""
    min_survival: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Survival floor: every robot has to survive with at least this probability."""
    max_length: Length | Literal["unlimited"] | None = None
    """Travel budget: every robot's trail is at most this long, in the unit of the arcs' length;
    default: the mission's own, if it has one, which "unlimited" lifts."""
    budget: Budget | None = None
    """Budget of the runs on this mission; default: the study's."""

    @property
    def own_parameters(self) -> dict[str, Any]:
        """Parameters that every mission takes, which are keys of the entry."""
        given = {"robots": self.robots, "lengths_from_pos": self.lengths_from_pos}
        return {name: value for name, value in given.items() if value}

    @model_validator(mode="after")
    def _check_parameters(self) -> Self:
        keys = ["name_or_path", *self.own_parameters]
        check_distinct("parameter", [*keys, *self.parameters, *self.grid])
        return self


class AlgorithmEntry(_Entry):
    """One algorithm with parameters, or several by a grid."""

    algorithm: Text
    """A registered algorithm's name, or module:Class."""
    parameters: dict[str, Any] = {}
    """Its parameters; `botohe algorithms NAME` lists them."""
    grid: dict[str, Values] = {}
    """Parameters with several values each; every combination is an algorithm."""

    @model_validator(mode="after")
    def _check_parameters(self) -> Self:
        check_distinct("parameter", [*self.parameters, *self.grid])
        return self


MissionOrName = Annotated[MissionEntry, _or_name("mission", MissionEntry)]
AlgorithmOrName = Annotated[AlgorithmEntry, _or_name("algorithm", AlgorithmEntry)]


class Seeds(_Entry):
    """The seeds of the repetitions: how many, or which."""

    count: Annotated[int, Field(ge=1, le=MAX_SEEDS)] | None = None
    """How many repetitions."""
    seed: Seed | None = None
    """Seed of the study, from which and from its number each repetition's seed derives; without
    it the seeds are 1, 2, ..., count."""
    values: SeedList | None = None
    """The seeds themselves, instead of a count."""

    @model_validator(mode="after")
    def _check_that_one_is_given(self) -> Self:
        if (self.count is None) == (self.values is None):
            found = "neither" if self.count is None else "both"
            raise ValueError(f"expected either count or values, found {found}")
        if self.values is not None and self.seed is not None:
            raise ValueError("expected no seed beside values, which are the seeds themselves")
        return self


def _seeds(value: Any) -> Any:
    """Accept a count or a list of seeds instead of a mapping."""
    if isinstance(value, list):
        return {"values": value}
    return value if isinstance(value, dict | Seeds) or value is None else {"count": value}


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
        BeforeValidator(labelled_missions, json_schema_input_type=dict[str, MissionOrName] | Names),
    ]
    """Missions under labels of your own; or a list of names and files, which are the labels.
    "library:small", "library:tunnel" and so on are several missions, with their own names."""
    algorithms: Annotated[
        dict[Label, AlgorithmOrName],
        Field(min_length=1),
        BeforeValidator(labelled, json_schema_input_type=dict[str, AlgorithmOrName] | Names),
    ]
    """Algorithms under labels of your own; or a list of names, which are the labels."""
    problem: Text | None = None
    """Objectives of your own: module:Class, derived from BOTOHE; default: E[R] and E[S]."""
    budget: Annotated[Budget | None, Field(validate_default=True)] = None
    """What each run may spend; a mission may have its own."""
    seeds: Annotated[
        Seeds,
        BeforeValidator(
            _seeds, json_schema_input_type=Seeds | Annotated[int, Field(ge=1)] | list[Seed]
        ),
    ]
    """A count, or a list of seeds."""
    recording: Recording = Recording()
    """When fronts are recorded."""
    indicators: Annotated[
        list[IndicatorName],
        Field(default_factory=lambda: [*INDICATORS], min_length=1),
        all_distinct("indicator"),
    ]
    """What fronts are judged by."""
    reference: Literal["runs", "best-known"] = "runs"
    """What fronts are compared with: what all runs on a mission found together, or with it the best
    known front and the bound of the library."""
    comparison: Comparison = Comparison()
    """The control algorithm, if any, and the significance level."""
    bounds: Bounds | None = None
    """Bounds to be proved on the missions' fronts; default: none. No run depends on them."""

    @field_validator("budget")
    @classmethod
    def _check_budget(cls, budget: Budget | None, info: ValidationInfo) -> Budget | None:
        missions = info.data.get("missions", {})  # none if they are not valid
        without = [label for label, entry in missions.items() if entry.budget is None]
        if budget is None and without:
            raise ValueError(
                f"expected a budget, as the mission {without[0]!r} has none of its own"
            )
        return budget

    @field_validator("bounds", "reference")
    @classmethod
    def _check_objectives(cls, value: Any, info: ValidationInfo) -> Any:
        if value not in (None, "runs") and (problem := info.data.get("problem")):
            raise ValueError(f"expected E[R] and E[S], not the objectives of {problem!r}")
        return value
