"""The commands ``botohe missions ...``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from botohe_moo.base.messages import counted
from botohe_moo.cli.from_map import mission_from_map
from botohe_moo.cli.options import (
    BaseOption,
    DangerOption,
    HazardOption,
    MissionArgument,
    MissionParameterOption,
    RobotsOption,
    mission_options,
    mission_source,
    out_option,
    path_option,
    read_kind,
)
from botohe_moo.cli.shell import (
    BAD_INPUT,
    brief,
    failing,
    listing,
    paragraph,
    parameter_text,
    say,
    tell,
)

if TYPE_CHECKING:
    from botohe_moo.mission.model import Mission

missions_app = typer.Typer(invoke_without_command=True)


@missions_app.callback()
def missions(context: typer.Context) -> None:
    """List, show, check and import missions, or make them from maps."""
    if context.invoked_subcommand is None:
        list_missions()


@missions_app.command("list")
def list_missions() -> None:
    """List the named missions and the generators."""
    from botohe_moo.base.parameters import summary_of
    from botohe_moo.mission import mission_names
    from botohe_moo.mission.loading import PLUGINS

    tell(listing((name, summary_of(PLUGINS.load(name))) for name in mission_names()))
    more = (
        "`botohe missions show NAME` tells more. Generators take parameters: "
        "`botohe missions show terrain -m nodes=50 -m seed=3`."
    )
    tell(f"\n{paragraph(more)}")


@missions_app.command("show")
def show_mission(
    mission: MissionArgument,
    robots: RobotsOption = None,
    base: BaseOption = None,
    danger: DangerOption = None,
    hazard: HazardOption = None,
    mission_parameter: MissionParameterOption = None,
    picture: Annotated[
        Path | None,
        path_option(
            "--picture", metavar="FILE", help="Also draw the mission to this file: PNG, PDF or SVG."
        ),
    ] = None,
) -> None:
    """Describe a mission; on request, draw it."""
    with failing():
        own = {"robots": robots, "base": base, "danger": danger, "hazard": hazard}
        source = mission_source(mission, mission_parameter, **own)
        from botohe_moo.mission.loading import load_mission, mission_parameters

        loaded = load_mission(**source)
    tell(_describe(loaded))
    for parameter in () if Path(mission).exists() else mission_parameters(mission):
        tell(f"\n{parameter_text(parameter)}")
    if picture is not None:
        from botohe_moo.plots import plot_mission, save_plot

        with failing():
            save_plot(plot_mission(loaded), picture)
        tell(f"wrote {picture}")


def _describe(mission: Mission) -> str:
    """Describe a mission, a line for each of its traits."""
    graph, n_arcs = mission.world.graph, len(mission.graph.edges)
    lines = [
        f"{mission.name}: {mission.title}",
        f"  nodes         {len(mission.nodes)} ({(mission.rewards > 0).sum()} with a reward)",
        f"  arcs          {n_arcs}{'' if mission.balanced else ', dead ends possible'}",
        f"  team          {mission.team} at base {mission.base!r}",
        f"  total reward  {mission.total_reward:g}",
    ]
    lines += _describe_kinds(mission)
    if graph.n_arcs:
        lines.append(f"  survival      {graph.survival.min():g} to {graph.survival.max():g}")
        if any("length" in arc for *_, arc in mission.graph.edges(data=True)):
            lines.append(f"  length        {graph.length.min():g} to {graph.length.max():g}")
    if mission.max_length is not None:
        lines.append(f"  max_length    {mission.max_length:g}, the travel budget of every robot")
    return "\n".join(lines)


def _describe_kinds(mission: Mission) -> list[str]:
    """Describe each kind of robots in a line, and what is credited on return, and where."""
    from botohe_moo.core.world import AT_NEXT_DEPOT, AT_THIS_DEPOT
    from botohe_moo.mission.rules import ONLY_KIND, Kind

    n, paying = len(mission.nodes), (mission.rewards > 0).tolist()
    arcs = (mission.world.graph.tail // n).tolist()
    collects = (mission.world.graph.reward > 0).reshape(-1, n)
    lines = []
    for k, kind in enumerate(mission.kinds):
        if kind == Kind(ONLY_KIND, kind.robots):
            continue
        start, end = kind.ends(mission.base)
        traits = [
            f"{counted(kind.robots, 'robot')} from {start!r} to {end!r}",
            f"can take {counted(arcs.count(k), 'arc')}",
            f"collects at {collects[k].sum()} of {sum(paying)} paying nodes",
        ]
        if kind.min_survival:
            traits.append(f"min_survival {kind.min_survival:g}")
        if kind.max_length is not None:
            traits.append(f"max_length {kind.max_length:g}")
        lines.append(f"  {kind.name:12}  {', '.join(traits)}")
    if (returns := mission.world.returns) is not None:
        of_nodes = list(zip(mission.nodes, returns.credit.tolist(), paying, strict=False))
        on_return = sum(pays and when == AT_NEXT_DEPOT for _, when, pays in of_nodes)
        depots = [repr(node) for node, when, _ in of_nodes if when == AT_THIS_DEPOT]
        lines.append(f"  on return     {on_return} of {sum(paying)} paying nodes")
        lines.append(f"  depots        {', '.join(depots)}")
    return lines


@missions_app.command("check")
def check_missions(
    files: Annotated[list[Path], typer.Argument(metavar="FILE", help="Mission files.")],
    robots: RobotsOption = None,
    base: BaseOption = None,
    danger: DangerOption = None,
    hazard: HazardOption = None,
    mission_parameter: MissionParameterOption = None,
) -> None:
    """Check mission files; name everything that is wrong with them."""
    from botohe_moo.mission import load_mission

    with failing():
        own = {"robots": robots, "base": base, "danger": danger, "hazard": hazard}
        options = mission_options(mission_parameter, **own)
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
        raise typer.Exit(BAD_INPUT)


@missions_app.command("import")
def import_mission(
    nodes: Annotated[
        Path,
        typer.Option(
            "--nodes",
            metavar="FILE",
            help="CSV with the columns label and reward; optional: x and y, zone; share, or "
            "share:NAME for kinds of robots; pays (arrival, return); depot (yes, no).",
        ),
    ],
    arcs: Annotated[
        Path,
        typer.Option(
            "--arcs",
            metavar="FILE",
            help="CSV with the columns tail, head and survival; optional: length; survival:NAME "
            "for kinds of robots: a kind whose cell is empty cannot take the arc, unless there is "
            "a number in the column survival.",
        ),
    ],
    base: Annotated[str, typer.Option("--base", metavar="LABEL", help="Label of the base.")],
    out: Annotated[
        Path,
        out_option("FILE", "Mission file to write: .json, .graphml, .geojson."),
    ],
    robots: Annotated[
        int | None,
        typer.Option("--robots", metavar="K", help="Number of robots, if all are alike."),
    ] = None,
    kind: Annotated[
        list[str] | None,
        typer.Option(
            "--kind",
            metavar="NAME=K,...",
            help="K robots of a kind, such as drone=2 or drone=2,start=roof,end=gate,"
            "min_survival=0.5,max_length=300. Repeatable, instead of --robots.",
        ),
    ] = None,
    pays: Annotated[
        str | None,
        typer.Option(
            "--pays",
            metavar="WHEN",
            help="When nodes pay whose cell in the column pays is empty: on arrival (the default), "
            "or on return, when a robot that has been there gets to a depot, such as the base.",
        ),
    ] = None,
    both_ways: Annotated[
        bool, typer.Option("--both-ways", help="Every row of arcs is an arc in both directions.")
    ] = False,
    max_length: Annotated[
        float | None,
        typer.Option(
            "--max-length",
            metavar="L",
            help="Travel budget of every robot, in the unit of length.",
        ),
    ] = None,
    lengths_from_pos: Annotated[
        bool,
        typer.Option(
            "--lengths-from-pos", help="Every arc is as long as its nodes are apart, by x and y."
        ),
    ] = False,
    title: Annotated[
        str | None, typer.Option("--title", metavar="TEXT", help="Title, for pictures.")
    ] = None,
    danger: DangerOption = None,
    hazard: HazardOption = None,
    mission_parameter: MissionParameterOption = None,
) -> None:
    """Make a mission file of two tables (CSV): nodes and arcs.

    Labels are texts. Names of columns may be in upper or lower case; further columns become
    attributes. What is wrong is named by file and row.
    """
    from botohe_moo.base.files import read_table
    from botohe_moo.base.messages import ParameterError, unknown_parameter
    from botohe_moo.mission import mission_from_tables, save_mission
    from botohe_moo.mission.formats.reading import stem_of
    from botohe_moo.mission.loading import OF_FILES

    with failing():
        given = mission_options(
            mission_parameter,
            base=base,
            robots=robots,
            pays=pays,
            both_ways=both_ways or None,
            max_length=max_length,
            title=title,
            danger=danger,
            hazard=hazard,
        )
        if kind:
            given["kinds"] = [read_kind(text) for text in kind]
        if unknown := given.keys() - {*OF_FILES, "max_length", "title"}:
            raise ParameterError(unknown_parameter(min(unknown), OF_FILES), min(unknown))
        tables = read_table(nodes), read_table(arcs)
        loaded = mission_from_tables(*tables, **{"name": stem_of(out), **given})
        if lengths_from_pos:
            loaded = loaded.with_lengths_from_pos()
        save_mission(loaded, out)
    tell(f"wrote {out}: {brief(loaded, loaded.max_length)}")


missions_app.command("from-map")(mission_from_map)
