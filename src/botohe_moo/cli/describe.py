"""What the command line says about missions and algorithms."""

from __future__ import annotations

import json
import re
import shutil
import textwrap
from collections.abc import Mapping
from typing import TYPE_CHECKING

from botohe_moo._base.words import counted

if TYPE_CHECKING:
    from collections.abc import Iterable

    from botohe_moo._plugins.stated import Parameter
    from botohe_moo.mission.model import Mission

_MAX_WIDTH = 100


def brief(mission: Mission, max_length: float | None) -> str:
    """Return a mission's size and the travel budget in a line."""
    limit = "" if max_length is None else f", travel budget {max_length:g}"
    return (
        f"{len(mission.nodes)} nodes, {mission.arrays.n_arcs} arcs, {_team(mission)}, "
        f"total reward {mission.total_reward:g}{limit}"
    )


def describe(mission: Mission) -> str:
    """Describe a mission, a line for each of its traits."""
    arrays = mission.arrays
    lines = [
        f"{mission.name}: {mission.title}",
        f"  nodes         {arrays.n_nodes} ({(arrays.reward > 0).sum()} with a reward)",
        f"  arcs          {arrays.n_arcs}{'' if mission.balanced else ', dead ends possible'}",
        f"  team          {_team(mission)} at base {mission.base!r}",
        f"  total reward  {mission.total_reward:g}",
    ]
    if arrays.n_arcs:
        lines.append(f"  survival      {arrays.survival.min():g} to {arrays.survival.max():g}")
        if any("length" in arc for *_, arc in mission.graph.edges(data=True)):
            lines.append(f"  length        {arrays.length.min():g} to {arrays.length.max():g}")
    if mission.max_length is not None:
        lines.append(f"  max_length    {mission.max_length:g}, the travel budget of every robot")
    return "\n".join(lines)


def _team(mission: Mission) -> str:
    return counted(mission.robots, "robot")


def parameter_text(parameter: Parameter) -> str:
    """Return a parameter's name, default, type, range and meaning, as the command line has them."""
    kind = re.sub(r"Literal\[([^]]*)\]", r"\1", parameter.annotation).replace(" | ", " or ")
    kind = ", ".join(filter(None, (kind, parameter.range)))
    kind = f"  ({kind})" if kind else ""
    headline = parameter.name
    if not parameter.plain:
        kind = "  (from Python only)"
    elif not parameter.required:
        headline += f" = {_default(parameter)}"
    lines = [paragraph(f"{headline}{kind}", first="  ", indent=" " * 6)]
    if parameter.description:
        lines.append(paragraph(parameter.description, first=" " * 6, indent=" " * 6))
    return "\n".join(lines)


def parameter_example(parameter: Parameter) -> str:
    """Return a parameter as it is written on the command line."""
    return f"{parameter.name}={'VALUE' if parameter.required else _default(parameter)}"


def _default(parameter: Parameter) -> str:
    default = parameter.default
    if isinstance(default, Mapping):
        return "{" + ", ".join(f"{name}: {value}" for name, value in default.items()) + "}"
    return json.dumps(default) if default is None or isinstance(default, bool) else str(default)


def listing(entries: Iterable[tuple[str, str]]) -> str:
    """Lay out names and their descriptions in two columns."""
    entries = list(entries)
    widest = max((len(name) for name, _ in entries), default=0)
    return "\n".join(
        paragraph(text, first=f"{name:{widest}}  ", indent=" " * (widest + 2))
        for name, text in entries
    )


def paragraph(text: str, *, first: str = "", indent: str = "") -> str:
    """Free text from docstring markup; wrap it to the terminal, if there is one."""
    text = re.sub(r":\w+:`~?([^`]*)`", r"\1", text).replace("``", "")
    columns = shutil.get_terminal_size((0, 0)).columns
    if not columns:
        return f"{first}{text}".rstrip()
    return textwrap.fill(
        text,
        max(min(columns, _MAX_WIDTH), len(indent) + 20),
        initial_indent=first,
        subsequent_indent=indent,
        break_on_hyphens=False,
        break_long_words=False,
    )
