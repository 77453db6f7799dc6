"""The commands ``botohe missions ...``."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from botohe_moo.base.messages import counted
from botohe_moo.cli import common
from botohe_moo.cli.common import brief, command, failing, paragraph, say, tell

if TYPE_CHECKING:
    from botohe_moo.mission.model import Mission

missions_app = typer.Typer(invoke_without_command=True)


@missions_app.callback()
def missions(context: typer.Context) -> None:
    """List, show, check and import missions, or make them from maps."""
    if context.invoked_subcommand is None:
        list_missions()


@command(missions_app, "list")
def list_missions() -> None:
    """List the named missions and the generators."""
    from botohe_moo.base.parameters import summary_of
    from botohe_moo.mission import mission_names
    from botohe_moo.mission.loading import PLUGINS

    tell(common.listing((name, summary_of(PLUGINS.load(name))) for name in mission_names()))
    more = (
        "`botohe missions show NAME` tells more. Generators take parameters: "
        "`botohe missions show terrain -m nodes=50 -m seed=3`."
    )
    tell(f"\n{paragraph(more)}")


@command(missions_app)
def show(mission: str, options: dict[str, Any], *, picture: Path | None = None) -> None:
    """Describe a mission and its parameters. With --picture, draw it.

    Parameters
    ----------
    picture : FILE
        Picture of the mission: PNG, PDF or SVG.
    """
    from botohe_moo.mission.loading import load_mission, mission_parameters

    with failing():
        loaded = load_mission(mission, **options)
    tell("\n".join([f"{loaded.name}: {loaded.title}", *_described(loaded)]))
    for parameter in () if Path(mission).exists() else mission_parameters(mission):
        tell(f"\n{common.parameter_text(parameter)}")
    if picture is not None:
        from botohe_moo.plots import plot_mission, save_plot

        with failing():
            save_plot(plot_mission(loaded), picture)
        tell(f"wrote {picture}")


def _described(mission: Mission) -> Iterator[str]:
    """Describe a mission, a line for each of its traits."""
    n_arcs, graph = len(mission.graph.edges), mission.world.graph
    traits = {
        "nodes": f"{len(mission.nodes)} ({(mission.rewards > 0).sum()} with a reward)",
        "arcs": f"{n_arcs}{'' if mission.balanced else ', dead ends possible'}",
        "team": f"{mission.team} at base {mission.base!r}",
        "total reward": f"{mission.total_reward:g}",
        **_kinds_described(mission),
    }
    if graph.n_arcs:
        traits["survival"] = f"{graph.survival.min():g} to {graph.survival.max():g}"
        if any("length" in arc for *_, arc in mission.graph.edges(data=True)):
            traits["length"] = f"{graph.length.min():g} to {graph.length.max():g}"
    if mission.max_length is not None:
        traits["max_length"] = f"{mission.max_length:g}, the travel budget of every robot"
    return (f"  {name:12}  {text}" for name, text in traits.items())


def _kinds_described(mission: Mission) -> dict[str, str]:
    """Describe each kind of robots, which nodes pay on return, and the depots."""
    from botohe_moo.core.world import AT_NEXT_DEPOT, AT_THIS_DEPOT
    from botohe_moo.mission.rules import ONLY_KIND, Kind

    n_nodes, paying = len(mission.nodes), mission.rewards > 0
    kind_of_arc = (mission.world.graph.tail // n_nodes).tolist()
    collects = (mission.world.graph.reward > 0).reshape(-1, n_nodes).sum(axis=1)
    lines = {}
    for k, kind in enumerate(mission.kinds):
        if kind == Kind(ONLY_KIND, kind.robots):
            continue
        start, end = kind.ends(mission.base)
        limit = f", min_survival {kind.min_survival:g}" if kind.min_survival else ""
        limit += f", max_length {kind.max_length:g}" if kind.max_length is not None else ""
        lines[kind.name] = (
            f"{counted(kind.robots, 'robot')} from {start!r} to {end!r}, "
            f"can take {counted(kind_of_arc.count(k), 'arc')}, "
            f"collects at {collects[k]} of {paying.sum()} paying nodes{limit}"
        )
    if (returns := mission.world.returns) is not None:
        credit = returns.credit[:n_nodes]
        on_return = (paying & (credit == AT_NEXT_DEPOT)).sum()
        lines["on return"] = f"{on_return} of {paying.sum()} paying nodes"
        depots = (credit == AT_THIS_DEPOT).nonzero()[0].tolist()
        lines["depots"] = ", ".join(repr(mission.nodes[v]) for v in depots)
    return lines


@command(missions_app)
def check(files: list[Path], options: dict[str, Any]) -> None:
    """Check mission files, and name everything that is wrong with them.

    The exit status is 2 if a file is wrong.

    Parameters
    ----------
    files : FILE
        Mission files.
    """
    from botohe_moo.mission import load_mission

    failed = False
    for path in files:
        try:
            loaded = load_mission(path, **options)
        except ValueError as error:
            say(error)
            failed = True
        else:
            tell(f"{path}: a valid mission, {brief(loaded, loaded.max_length)}")
    if failed:
        raise typer.Exit(common.BAD_INPUT)


@command(missions_app, "import")
def import_mission(
    options: dict[str, Any],
    *,
    nodes: Path,
    arcs: Path,
    base: str,
    out: Path,
    kind: list[str] | None = None,
    both_ways: bool = False,
    max_length: float | None = None,
) -> None:
    """Make a mission file of two tables (CSV): nodes and arcs.

    Labels are texts. Names of columns may be in upper or lower case. Further columns become
    attributes. Each fault is named by file and row.

    Parameters (-m) for tables: title=TEXT; pays=return, if rewards count when a robot brings them
    to a depot; lengths_from_pos=true, if x and y give the lengths of the arcs.

    Parameters
    ----------
    nodes : FILE
        CSV with the columns label and reward. Optional columns: x and y; zone; share, or share:NAME
        for a kind of robots; pays (arrival, return); depot (yes, no).
    arcs : FILE
        CSV with the columns tail, head and survival. Optional columns: length; survival:NAME for a
        kind of robots. If both survivals of a kind are empty, it cannot take the arc.
    base : LABEL
        Label of the base.
    out : -o FILE
        Mission file: .json, .graphml, .geojson.
    kind : NAME=K,...
        K robots of a kind, such as drone=2 or
        drone=2,start=roof,end=gate,min_survival=0.5,max_length=300. Repeatable, instead of
        --robots.
    both_ways
        Each row of arcs is an arc in both directions.
    """
    with failing():
        from botohe_moo.base.files import read_table
        from botohe_moo.base.messages import ParameterError, unknown_parameter
        from botohe_moo.mission import mission_from_tables, save_mission
        from botohe_moo.mission.formats.reading import stem_of
        from botohe_moo.mission.loading import OF_FILES

        lengths_from_pos = options.pop("lengths_from_pos", False)
        if unknown := options.keys() - {*OF_FILES, "title"}:
            raise ParameterError(unknown_parameter(min(unknown), OF_FILES), min(unknown))
        options |= {"both_ways": True} if both_ways else {}
        loaded = mission_from_tables(
            read_table(nodes),
            read_table(arcs),
            base=base,
            kinds=[_read_kind(text) for text in kind or ()] or None,
            max_length=max_length,
            **{"name": stem_of(out), **options},
        )
        if lengths_from_pos:
            loaded = loaded.with_lengths_from_pos()
        save_mission(loaded, out)
    tell(f"wrote {out}: {brief(loaded, loaded.max_length)}")


def _read_kind(text: str) -> Any:
    """Read a kind of robots, written as NAME=ROBOTS or NAME=ROBOTS,start=LABEL,...

    Labels may have commas in them. What should be a number and is none stays text.
    """
    name, equals, rest = text.partition("=")
    if not equals:
        raise ValueError(f"Expected a kind as NAME=ROBOTS or NAME=ROBOTS,start=..., got {text!r}.")
    robots, *pairs = re.split(r",(?=\s*\w+\s*=)", rest)
    kind: dict[str, Any] = {"name": name.strip(), "robots": robots.strip()}
    for pair in pairs:
        key, _, value = pair.partition("=")
        if key.strip() in kind:
            raise ValueError(f"Expected {key.strip()!r} of a kind once, got {text!r}.")
        kind[key.strip()] = value.strip()
    for key, number in (("robots", int), ("min_survival", float), ("max_length", float)):
        with suppress(KeyError, ValueError):
            kind[key] = number(kind[key])
    return kind


@command(missions_app, "from-map")
def from_map(
    map_file: Path,
    *,
    out: Path,
    radius: float = 0.3,
    spacing: float | None = None,
    robots: int = 3,
    base: str = "0,0",
    danger: float = 0.01,
    hazard: Path | None = None,
) -> None:
    """Make a mission file from a map of obstacles.

    Nodes are where ways through the free space meet or end. Each has reward 1, but the base 0.
    FILE-graph.png beside the mission file shows the numbers of the nodes on the map.

    Needs pip install "botohe-moo[maps]".

    Parameters
    ----------
    map_file : MAP
        Map of obstacles: YAML for the map server of Nav2.
    out : -o FILE
        Mission file: .json, .geojson.
    radius : R
        Radius of a robot, in metres.
    spacing : D
        Greatest distance of nodes along a way, in metres. By default nodes are only where ways meet
        or end.
    base : NODE
        The base: a node's number, or a place X,Y whose nearest node it is.
    """
    from botohe_moo.base.files import check_file, check_suffix
    from botohe_moo.mission import Mission, roadmap_from_map, save_mission
    from botohe_moo.plots import plot_mission, save_plot

    picture = out.with_name(f"{out.stem}-graph.png")
    with failing():
        check_suffix(out, (".json", ".geojson"))  # in GraphML, numbers as labels become texts
        for file in (out, picture):
            check_file(file)
        start = _node_or_place(base)
        graph = roadmap_from_map(
            map_file, radius=radius, spacing=spacing, base=start, danger=danger, hazard=hazard
        )
        made = Mission(graph, robots=robots, name=out.stem)
        save_mission(made, out)
        save_plot(plot_mission(made, background=map_file), picture)
    tell(f"wrote {out}: {brief(made, made.max_length)}\nwrote {picture}")


def _node_or_place(text: str) -> Any:
    """Read a node's number, or a place X,Y."""
    try:
        return tuple(map(float, text.split(","))) if "," in text else int(text)
    except ValueError:
        expected = "a node's number, or a place X,Y"
        raise ValueError(f"Expected --base to be {expected}, got {text!r}.") from None
