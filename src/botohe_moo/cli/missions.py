"""The commands ``botohe missions ...`` and ``botohe library ...``."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any

import typer

import botohe_moo as bm
from botohe_moo import plots
from botohe_moo.base import files
from botohe_moo.base.messages import ParameterError, counted, listed, unknown_parameter
from botohe_moo.cli import common
from botohe_moo.cli.common import brief, command, failing, frame_table, paragraph, say, tell

missions_app = typer.Typer(invoke_without_command=True)
library_app = typer.Typer(no_args_is_help=True)

_TABLE = {  # columns of `botohe library list`: title and format
    **{name: (name, "") for name in ("mission", "family", "size")},
    **{name: (name, "") for name in ("nodes", "arcs", "robots", "plans")},
    "area": ("area", ".6f"),
    "gap": ("gap", ".2%"),
}

Selection = Annotated[str, typer.Argument(parser=lambda text: text.removeprefix("library:"))]


@missions_app.callback()
def missions(context: typer.Context) -> None:
    """List, show, check and import missions, or make them from maps."""
    if context.invoked_subcommand is None:
        list_missions()


@command(missions_app, "list")
def list_missions() -> None:
    """List the named missions and the generators."""
    from botohe_moo.base.parameters import summary_of
    from botohe_moo.mission.loading import MISSIONS

    rows = ((name, common.plain(summary_of(MISSIONS[name]))) for name in bm.mission_names())
    tell(common.table(rows, wrap=True))
    example = "`botohe missions show terrain -m nodes=50 -m seed=3`"
    more = f"`botohe missions show NAME` tells more. Generators take parameters: {example}."
    tell(f"\n{paragraph(more)}")


@command(missions_app)
def show(mission: str, options: dict[str, Any], *, picture: Path | None = None) -> None:
    """Describe a mission and its parameters. With --picture, draw it.

    Parameters
    ----------
    picture : FILE
        Picture of the mission: PNG, PDF or SVG.
    """
    from botohe_moo.mission.loading import mission_parameters

    with failing():
        loaded = bm.load_mission(mission, **options)
    tell(loaded.describe())
    for parameter in () if Path(mission).exists() else mission_parameters(mission):
        tell(f"\n{common.parameter_text(parameter)}")
    if picture is not None:
        with failing():
            plots.save_plot(plots.plot_mission(loaded), picture)
        tell(f"wrote {picture}")


@command(missions_app)
def check(files: list[Path], options: dict[str, Any]) -> None:
    """Check mission files or named missions, and name all faults.

    The exit status is 2 if one is wrong.

    Parameters
    ----------
    files : MISSION
        Mission files, or names of missions.
    """
    failed = False
    for path in files:
        try:
            loaded = bm.load_mission(str(path), **options)  # names are checked, too
        except ValueError as error:
            say(error)
            failed = True
        else:
            tell(f"{path}: a valid mission, {brief(loaded, loaded.max_length)}")
            tell(_numbers(loaded))
    if failed:
        raise typer.Exit(common.BAD_INPUT)


def _numbers(mission: bm.Mission) -> str:
    """Say which numbers a mission has, and which attributes of nodes and arcs have no effect."""
    from botohe_moo.mission.rules import KNOWN

    nodes, arcs = mission.graph.nodes(data=True), mission.graph.edges(data=True)
    survivals = [arc["survival"] for *_, arc in arcs]
    of_kinds = [v for s in survivals for v in (s.values() if isinstance(s, dict) else [s])]
    spans = {"rewards": mission.rewards.tolist(), "survivals": of_kinds}
    text = ", ".join(f"{name} {_span(values)}" for name, values in spans.items() if values)
    others = {name for *_, attributes in (*nodes, *arcs) for name in attributes} - KNOWN
    return f"  {text}{f'; without effect: {listed(sorted(others))}' if others else ''}"


def _span(values: Any) -> str:
    low, high = f"{min(values):.4g}", f"{max(values):.4g}"
    return low if low == high else f"{low} to {high}"


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
        kind of robots, or for a scenario that is given. If both survivals of a kind are empty, it
        cannot take the arc.
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
        from botohe_moo.mission.formats.reading import stem_of
        from botohe_moo.mission.loading import OF_FILES

        lengths_from_pos = options.pop("lengths_from_pos", False)
        kinds = [_read_kind(text) for text in kind or ()] or None
        if unknown := options.keys() - {*OF_FILES, "title"}:
            raise ParameterError(unknown_parameter(min(unknown), OF_FILES), min(unknown))
        own = {"both_ways": both_ways, "max_length": max_length, "kinds": kinds}
        given = {"name": stem_of(out), **common.with_options(options, base=base, **own)}
        tables = files.read_table(nodes), files.read_table(arcs)
        loaded = bm.mission_from_tables(*tables, **given)
        if lengths_from_pos:
            loaded = loaded.with_lengths_from_pos()
        bm.save_mission(loaded, out)
    tell(f"wrote {out}: {brief(loaded, loaded.max_length)}\n{_numbers(loaded)}")


def _read_kind(text: str) -> Any:
    """Read a kind of robots, written as NAME=ROBOTS or NAME=ROBOTS,start=LABEL,...

    Labels may have commas in them.
    """
    name, equals, rest = text.partition("=")
    if not equals:
        raise ValueError(f"Expected a kind as NAME=ROBOTS or NAME=ROBOTS,start=..., got {text!r}.")
    pairs = re.split(r",(?=\s*\w+\s*=)", f"robots={rest}")
    return {"name": name.strip(), **common.read_parameters(pairs)}


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
    picture = out.with_name(f"{out.stem}-graph.png")
    with failing():
        files.check_suffix(out, (".json", ".geojson"))  # in GraphML, numbers as labels become texts
        for file in (out, picture):
            files.check_file(file)
        start = _node_or_place(base)
        graph = bm.roadmap_from_map(
            map_file, radius=radius, spacing=spacing, base=start, danger=danger, hazard=hazard
        )
        made = bm.Mission(graph, robots=robots, name=out.stem)
        bm.save_mission(made, out)
        plots.save_plot(plots.plot_mission(made, background=map_file), picture)
    tell(f"wrote {out}: {brief(made, made.max_length)}\nwrote {picture}")


def _node_or_place(text: str) -> Any:
    """Read a node's number, or a place X,Y."""
    try:
        return tuple(map(float, text.split(","))) if "," in text else int(text)
    except ValueError:
        expected = "a node's number, or a place X,Y"
        raise ValueError(f"Expected --base to be {expected}, got {text!r}.") from None


@library_app.callback()
def library() -> None:
    """Missions with best known fronts and certified bounds."""


@command(library_app, "list")
def list_library(selection: Selection = "all", *, library: Path | None = None) -> None:
    """List missions, best known areas and certified gaps."""
    with failing():
        from botohe_moo.library import FOLDER, library_table

        table = library_table(selection, folder=library or FOLDER)
    tell(frame_table(table, _TABLE, n_texts=3))
    tell("\n`botohe solve library:NAME` searches. `botohe library add DIR` adds what it found.")


@command(library_app, "check")
def check_library(selection: Selection = "all", *, library: Path | None = None) -> None:
    """Evaluate all plans of the best known fronts again.

    Names each file that does not match its plans.

    The exit status is 1 if something is wrong, and 2 for bad input.
    """
    with failing():
        from botohe_moo.library import FOLDER, check_library, library_names

        names = library_names(selection)
        faults = check_library(names, folder=library or FOLDER)
    for name in names:
        (say if name in faults else tell)(faults.get(name, f"{name}: right"))
    if faults:
        raise typer.Exit(common.FAILED)
    tell(f"\n{counted(len(names), 'mission')}: each plan was evaluated again, none is dominated")


@command(library_app, "add")
def add_to_library(
    found: Annotated[Path, typer.Argument(exists=True, file_okay=False)],
    *,
    by: str,
    library: Path | None = None,
) -> None:
    """Merge plans into the best known fronts.

    The plans come from a solution or a study. Dominated plans are dropped. The order of additions
    does not change the files.

    Parameters
    ----------
    found : DIR
        Folder that `solve` or `study run` wrote, on missions of the library.
    by : NAME
        Who found the plans.
    """
    with failing():
        from botohe_moo.library import FOLDER, add_plans
        from botohe_moo.study.runner import found_plans

        changed = add_plans(found_plans(found, by=by), folder=library or FOLDER)
    for name, (before, after, path) in changed.items():
        was, now = ({*map(tuple, front.objectives.tolist())} for front in (before, after))
        n_new = len(now - was)
        grown = f" ({100 * (after.area / before.area - 1):+.4f} %)" if before.area and n_new else ""
        wrote = "" if path is None else f"; wrote {path}"
        tell(f"{name}: {counted(n_new, 'new plan')}, area {after.area:.6f}{grown}{wrote}")
