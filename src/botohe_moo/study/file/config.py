"""The study file: what may stand in it, as pydantic models."""

from collections import Counter
from collections.abc import Callable
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    StringConstraints,
    model_validator,
)
from pydantic_core import PydanticCustomError

from botohe_moo._base.checks import quoted
from botohe_moo.indicators import INDICATORS

MAX_EVALUATIONS = 10**12
MAX_SEED = 2**32 - 1
MAX_SEEDS = 100_000


def _label(value: str) -> str:
    """Refuse what files, figures and LaTeX cannot show; matplotlib hides what begins with _."""
    if not value.isprintable() or value.startswith("_"):
        raise ValueError(
            "expected a label of printable characters that does not begin with _, "
            f"got {quoted(value)}"
        )
    return value


def _different(values: list[str], of: str = "") -> list[str]:
    value, count = Counter(values).most_common(1)[0] if values else ("", 1)
    if count > 1:
        raise ValueError(f"expected each{of} once, got {quoted(value)} {count} times")
    return values


def _printable(value: str) -> str:
    """Refuse what pages and LaTeX cannot show."""
    if not all(character.isprintable() or character in "\n\t" for character in value):
        raise ValueError(f"expected a text of printable characters, got {quoted(value)}")
    return value


def _indicator(value: Any) -> Any:
    """Refuse what is not among the indicators there are now, as a Literal would."""
    if not isinstance(value, str) or value not in INDICATORS:
        *first, last = map(repr, INDICATORS)
        said = {"expected": f"{', '.join(first)} or {last}", "found": quoted(value)}
        raise PydanticCustomError("literal_error", "Input should be {expected}, got {found}", said)
    return value


def _list_indicators(schema: dict[str, Any]) -> None:
    schema["enum"] = [*INDICATORS]


def _default_indicators(schema: dict[str, Any]) -> None:
    schema |= {"uniqueItems": True, "default": [*INDICATORS]}


IndicatorName = Annotated[
    str, BeforeValidator(_indicator), Field(json_schema_extra=_list_indicators)
]
NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._-]*$"
Text = Annotated[str, StringConstraints(min_length=1, max_length=200, pattern=r"^\S(.*\S)?$")]
Label = Annotated[Text, AfterValidator(_label)]
Name = Annotated[str, StringConstraints(max_length=100, pattern=NAME_PATTERN)]
Count = Annotated[int, Field(ge=1, le=MAX_EVALUATIONS)]
Length = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Seed = Annotated[int, Field(ge=0, le=MAX_SEED)]
Values = Annotated[list[Any], Field(min_length=1)]


def _shorthand(*schemas: dict[str, Any]) -> Callable[[dict[str, Any]], None]:
    """State in the JSON Schema that something shorter may stand for the mapping."""

    def add(schema: dict[str, Any]) -> None:
        whole = dict(schema)
        schema.clear()
        schema.update(anyOf=[*schemas, whole])

    return add


class _Entry(BaseModel):
    """A mapping in the study file: nothing is converted, and no key is ignored."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, use_attribute_docstrings=True
    )


class Budget(_Entry):
    """What a run may spend: evaluations, seconds, or whichever is spent first."""

    evaluations: Count | None = None
    """Trail plans to evaluate; no run evaluates more."""
    seconds: Annotated[float, Field(gt=0, le=1e9, allow_inf_nan=False)] | None = None
    """The algorithm's own time, without recording. The iteration in which it is up is the last."""
    grace_seconds: Annotated[float, Field(ge=0, le=1e9, allow_inf_nan=False)] = 10.0
    """How long after the time is up a run is killed that does not come to the end of an
    iteration."""

    @model_validator(mode="after")
    def _is_limited(self) -> Self:
        if self.evaluations is None and self.seconds is None:
            raise ValueError("expected evaluations or seconds, or both, found neither")
        return self


class _NamedEntry(_Entry):
    """A mapping that its first value, a name, may stand for."""

    model_config = ConfigDict(json_schema_extra=_shorthand({"type": "string"}))

    @model_validator(mode="before")
    @classmethod
    def _from_name(cls, value: Any) -> Any:
        return {next(iter(cls.model_fields)): value} if isinstance(value, str) else value


class MissionEntry(_NamedEntry):
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


class AlgorithmEntry(_NamedEntry):
    """One algorithm with parameters, or several by a grid."""

    algorithm: Text
    """A registered algorithm's name, or module:Class."""
    parameters: dict[str, Any] = {}
    """Its parameters; `botohe algorithms NAME` lists them."""
    grid: dict[str, Values] = {}
    """Parameters with several values each; every combination is an algorithm."""


class Seeds(_Entry):
    """The seeds of the repetitions: how many, or which."""

    model_config = ConfigDict(
        json_schema_extra=_shorthand(
            {"type": "integer", "minimum": 1},
            {"type": "array", "items": {"type": "integer", "minimum": 0}, "minItems": 1},
        )
    )

    count: Annotated[int, Field(ge=1, le=MAX_SEEDS)] | None = None
    """How many repetitions."""
    seed: Seed | None = None
    """Seed of the study, from which and from its number each repetition's seed derives; without
    it the seeds are 1, 2, ..., count."""
    values: Annotated[list[Seed], Field(min_length=1, max_length=MAX_SEEDS)] | None = None
    """The seeds themselves, instead of a count."""

    @model_validator(mode="before")
    @classmethod
    def _from_short(cls, value: Any) -> Any:
        if isinstance(value, list):
            return {"values": value}
        return value if isinstance(value, dict) or value is None else {"count": value}

    @model_validator(mode="after")
    def _says_which(self) -> Self:
        if (self.count is None) == (self.values is None):
            found = "neither" if self.count is None else "both"
            raise ValueError(f"expected either count or values, found {found}")
        if self.values is not None and self.seed is not None:
            raise ValueError("expected no seed beside values, which are the seeds themselves")
        if self.values is not None and len(set(self.values)) < len(self.values):
            twice = min(seed for seed, count in Counter(self.values).items() if count > 1)
            raise ValueError(f"expected each seed once, got {twice} twice")
        return self


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

    seconds: Annotated[float, Field(gt=0, le=1e9, allow_inf_nan=False)]
    """Time for the bound of a mission, when its runs are done."""


def _given_bounds(value: Any) -> Any:
    if value is None:
        raise ValueError('"bounds:" has no value: expected seconds')
    return value


class StudyFile(_Entry):
    """A comparative study: algorithms on missions, each for several seeds."""

    name: Name
    """Short name: letters, digits, dots, dashes, underscores. Also the name of the folder."""
    title: Annotated[Text, AfterValidator(_printable)] | None = None
    """What the study is, in a line."""
    description: Annotated[str, AfterValidator(_printable)] | None = None
    """What the study is for."""
    missions: Annotated[dict[Label, MissionEntry], Field(min_length=1)]
    """Missions under labels of your own; or a list of names and files, which are the labels."""
    algorithms: Annotated[dict[Label, AlgorithmEntry], Field(min_length=1)]
    """Algorithms under labels of your own; or a list of names, which are the labels."""
    problem: Text | None = None
    """Objectives of your own: module:Class, derived from BOTOHE; default: E[R] and E[S]."""
    budget: Budget | None = None
    """What each run may spend; a mission may have its own."""
    seeds: Seeds
    """A count, or a list of seeds."""
    recording: Recording = Recording()
    """When fronts are recorded."""
    indicators: Annotated[
        list[IndicatorName],
        Field(
            default_factory=lambda: [*INDICATORS],
            min_length=1,
            json_schema_extra=_default_indicators,
        ),
        AfterValidator(_different),
    ]
    """What fronts are judged by."""
    comparison: Comparison = Comparison()
    """The control algorithm, if any, and the significance level."""
    bounds: Annotated[Bounds | None, BeforeValidator(_given_bounds)] = None
    """Bounds to be proved on the missions' fronts; default: none. No run depends on them."""

    @model_validator(mode="before")
    @classmethod
    def _label_lists(cls, value: Any) -> Any:
        if not isinstance(value, dict):
            return value
        listed = {}
        for key in ("missions", "algorithms"):
            names = value.get(key)
            if isinstance(names, list) and all(isinstance(name, str) for name in names):
                listed[key] = {name: name for name in _different(names, f" of {key}")}
        return {**value, **listed}
