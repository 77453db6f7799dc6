"""The command ``botohe missions from-map``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from botohe_moo.cli.options import PICTURES, out_option, path_option
from botohe_moo.cli.shell import brief, failing, tell


def mission_from_map(
    map_file: Annotated[
        Path,
        typer.Argument(
            metavar="MAP", help="Map of obstacles: YAML as the map server of Nav2 reads it."
        ),
    ],
    out: Annotated[
        Path,
        out_option("FILE", "Mission file to write: .json, .geojson."),
    ],
    robots: Annotated[int, typer.Option("--robots", metavar="K", help="Number of robots.")] = 3,
    radius: Annotated[
        float, typer.Option("--radius", metavar="R", help="Radius of a robot, in metres.")
    ] = 0.3,
    spacing: Annotated[
        float | None,
        typer.Option(
            "--spacing",
            metavar="D",
            help="Nodes along a way are at most so far apart, in metres; by default there are "
            "nodes only where ways meet and end.",
        ),
    ] = None,
    base: Annotated[
        str,
        typer.Option(
            "--base",
            metavar="NODE",
            help="The base: a node's number, or a place X,Y on the map, to which it is the "
            "nearest node.",
        ),
    ] = "0,0",
    danger: Annotated[
        float,
        typer.Option(
            "--danger",
            metavar="D",
            help="Rate of loss for a metre: robots survive a way with exp(−D · length).",
        ),
    ] = 0.01,
    hazard: Annotated[
        Path | None,
        path_option(
            "--hazard",
            metavar="FILE",
            help="Map of where it is dangerous: YAML with mode: scale. --danger is the rate where "
            "it is black.",
        ),
    ] = None,
    picture: Annotated[
        Path | None,
        path_option(
            "--picture",
            metavar="FILE",
            help="Picture of the graph on the map: PNG, PDF or SVG; by default FILE-graph.png "
            "beside the mission file.",
        ),
    ] = None,
) -> None:
    """Make a mission file of a map of obstacles: the ways on which robots get through.

    Nodes are where ways meet or end, and their numbers are in the picture. All have reward 1, but
    the base 0. Needs pip install "botohe-moo[maps]".
    """
    from botohe_moo.base.files import check_file, check_suffix
    from botohe_moo.mission import Mission, roadmap_from_map, save_mission
    from botohe_moo.plots import plot_mission, save_plot

    drawn = out.with_name(f"{out.stem}-graph.png") if picture is None else picture
    with failing():
        check_suffix(out, (".json", ".geojson"))  # in GraphML, numbers as labels become texts
        check_suffix(drawn, PICTURES)
        for file in (out, drawn):
            check_file(file)
        start = _node_or_place(base)
        graph = roadmap_from_map(
            map_file, radius=radius, spacing=spacing, base=start, danger=danger, hazard=hazard
        )
        made = Mission(graph, robots=robots, name=out.stem)
        save_mission(made, out)
        save_plot(plot_mission(made, background=map_file), drawn)
    tell(f"wrote {out}: {brief(made, made.max_length)}")
    tell(f"wrote {drawn}")


def _node_or_place(text: str) -> Any:
    """Read a node's number, or a place X,Y."""
    try:
        return tuple(map(float, text.split(","))) if "," in text else int(text)
    except ValueError:
        expected = "a node's number, or a place X,Y"
        raise ValueError(f"Expected --base to be {expected}, got {text!r}.") from None
