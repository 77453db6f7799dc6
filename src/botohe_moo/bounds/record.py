"""Lines and steps, what is proved of a front, and the files that hold them."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, FiniteFloat, PositiveInt, ValidationError

from botohe_moo.base.files import read_bytes
from botohe_moo.base.messages import quoted
from botohe_moo.base.parameters import NotNegative, Probability
from botohe_moo.mission.model import Mission, numbers_digest

FORMAT: Literal["botohe-front-bound-1"] = "botohe-front-bound-1"

LineProof = Literal["everything", "relaxed", "exact"]


class Line(NamedTuple):
    """E[R] ≤ most − mu · x, where ``n_robots`` move whose survivals sum to x or more.

    Attributes
    ----------
    n_robots
        How many robots move, 1 or more.
    most, mu
        Where the line begins, and by how much it falls for each robot that survives.
    proof
        ``"everything"`` (each node is reached along the safest way), ``"relaxed"`` (no relaxed
        trail is worth more than the line says) or ``"exact"`` (no trail is).
    """

    n_robots: PositiveInt
    most: FiniteFloat
    mu: NotNegative
    proof: LineProof


class Step(NamedTuple):
    """E[R] ≤ most, where ``n_robots`` move whose survivals sum to ``least`` or more.

    Attributes
    ----------
    n_robots
        How many robots move, 1 or more.
    most, least
        The E[R] that is not exceeded, and where the step begins.
    proof
        ``"front"`` (it follows from the true front) or ``"exact"`` (no team of trails collects
        more).
    """

    n_robots: PositiveInt
    most: FiniteFloat
    least: NotNegative
    proof: Literal["front", "exact"]


class BoundRecord(BaseModel):
    """A bound as it is in files."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)

    format: Literal["botohe-front-bound-1"]
    mission_digest: str
    lines: tuple[Line, ...]
    steps: tuple[Step, ...]
    most_survival: Probability
    min_survival: Probability
    max_length: NotNegative | None
    seconds: NotNegative
    notes: tuple[str, ...]
    version: str | None = None  # of this package, which proved it; not in earlier versions' files


def read_record(path: Path, mission: Mission) -> BoundRecord:
    """Read the bound of a mission; an OSError or a ValueError names the file."""
    try:
        record = BoundRecord.model_validate_json(read_bytes(path))
    except ValidationError as error:
        fault = error.errors()[0]
        where = ".".join(map(str, fault["loc"])) or "the whole"
        found = "" if fault["type"] == "missing" else f", found {quoted(fault['input'])}"
        raise ValueError(f"{path} is not a bound: {where}: {fault['msg']}{found}.") from None
    if record.mission_digest != numbers_digest(mission):
        raise ValueError(f"{path} bounds another mission than {mission.name!r}.")
    numbers = set(range(1, mission.robots + 1))
    with_lines = {line.n_robots for line in record.lines}
    with_steps = {step.n_robots for step in record.steps}
    for what, moving in (("lines", with_lines), ("steps", with_steps)):
        if not moving <= numbers or (what == "lines" and moving != numbers):
            raise ValueError(
                f"{path} is not a bound: expected {what} for 1 to {mission.robots} robots that "
                f"move, found {what} for {sorted(moving)}."
            )
    return record
