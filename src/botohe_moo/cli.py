"""The ``botohe`` command: a thin layer over the library.

Only typer is imported here; what a command needs it imports when it runs, so that ``--help``
answers at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

if TYPE_CHECKING:
    from botohe_moo.mission.model import Mission

app = typer.Typer(
    name="botohe",
    help="Plan trails for robot teams in hazardous environments: reward against survival.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
missions_app = typer.Typer(help="List, show and check missions.", invoke_without_command=True)
app.add_typer(missions_app, name="missions")

BAD_INPUT = 2
INTERRUPTED = 130

MissionArgument = Annotated[
    str, typer.Argument(metavar="MISSION", help="A mission's name, or a mission file.")
]
RobotsOption = Annotated[int | None, typer.Option("--robots", help="Another team size.")]
MissionParameterOption = Annotated[
    list[str] | None,
    typer.Option(
        "--mission-parameter",
        "-m",
        metavar="NAME=VALUE",
        help="A parameter of the mission, such as nodes=500 or seed=3. Repeatable.",
    ),
]


def main() -> None:
    """Run the command line."""
    app()


def _fail(message: object) -> NoReturn:
    typer.echo(f"botohe: {message}", err=True)
    raise typer.Exit(BAD_INPUT)


@contextmanager
def _bad_input() -> Iterator[None]:
    """Turn what is wrong with the input into one message and exit status 2."""
    try:
        yield
    except (ValueError, OSError) as error:
        _fail(error)


def _parameters(pairs: list[str] | None) -> dict[str, Any]:
    """Read NAME=VALUE pairs; values as in YAML: 3, 0.5, true and text mean what they say."""
    import yaml

    found: dict[str, Any] = {}
    for pair in pairs or []:
        name, equals, value = pair.partition("=")
        if not equals or not name.isidentifier():
            raise ValueError(f"Expected a parameter as NAME=VALUE, got {pair!r}.")
        if name in found:
            raise ValueError(f"Expected each parameter once, got {name!r} twice.")
        try:
            found[name] = yaml.safe_load(value)
        except yaml.YAMLError:
            raise ValueError(
                f"Expected a number, true, false or text for {name!r}, got {value!r}."
            ) from None
    return found


def _load(mission: str, robots: int | None, pairs: list[str] | None) -> Mission:
    from botohe_moo.mission import load_mission

    return load_mission(mission, robots=robots, **_parameters(pairs))


@app.command()
def solve(
    mission: MissionArgument,
    algorithm: Annotated[
        str, typer.Option("--algorithm", "-a", help="One of `botohe algorithms`.")
    ] = "bo-aco",
    parameter: Annotated[
        list[str] | None,
        typer.Option(
            "--parameter",
            "-p",
            metavar="NAME=VALUE",
            help="A parameter of the algorithm, such as n_ants=50. Repeatable.",
        ),
    ] = None,
    evaluations: Annotated[
        int, typer.Option("--evaluations", "-n", min=1, help="Trail plans to evaluate, at most.")
    ] = 100_000,
    seed: Annotated[
        int, typer.Option("--seed", "-s", min=0, help="Seed of the random numbers.")
    ] = 1,
    robots: RobotsOption = None,
    mission_parameter: MissionParameterOption = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder to write to.  [default: results/MISSION]"),
    ] = None,
) -> None:
    """Search for the Pareto front of a mission; write it as tables and pictures.

    Writes front.csv, plans.json, front.png and mission.png. Ctrl-C stops the search and writes
    what was found.
    """
    from botohe_moo.algorithms import make_algorithm
    from botohe_moo.solve import Solution, prepare_folder, search

    with _bad_input():
        loaded = _load(mission, robots, mission_parameter)
        parameters = _parameters(parameter)
        built = make_algorithm(algorithm, **parameters)
        folder = prepare_folder(out if out is not None else Path("results") / loaded.name)
    typer.echo(
        f"{loaded.title}: {len(loaded.nodes)} nodes, {loaded.arrays.n_arcs} arcs, "
        f"{loaded.robots} robots, total reward {loaded.total_reward:g}"
    )
    solution: Solution = search(
        loaded, built, name=algorithm, parameters=parameters, evaluations=evaluations, seed=seed
    )
    typer.echo(solution.describe())
    with _bad_input():
        for path in solution.write(folder):
            typer.echo(f"wrote {path}")
    if solution.interrupted:
        raise typer.Exit(INTERRUPTED)


@missions_app.callback()
def missions(context: typer.Context) -> None:
    """List, show and check missions."""
    if context.invoked_subcommand is None:
        list_missions()


@missions_app.command("list")
def list_missions() -> None:
    """List the named missions and the generators."""
    from botohe_moo.mission import mission_names
    from botohe_moo.mission.library import describe_mission

    names = mission_names()
    width = max(map(len, names), default=0)
    for name in names:
        typer.echo(f"{name:{width}}  {describe_mission(name)}")


@missions_app.command("show")
def show_mission(
    mission: MissionArgument,
    robots: RobotsOption = None,
    mission_parameter: MissionParameterOption = None,
    picture: Annotated[
        Path | None, typer.Option("--picture", help="Also draw the mission to this PNG file.")
    ] = None,
) -> None:
    """Say what a mission is like; on request, draw it."""
    with _bad_input():
        loaded = _load(mission, robots, mission_parameter)
    typer.echo(_description(loaded))
    if picture is not None:
        from botohe_moo.plots import plot_mission, save_plot

        with _bad_input():
            save_plot(plot_mission(loaded), picture)
        typer.echo(f"wrote {picture}")


@missions_app.command("check")
def check_missions(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Mission files.")],
) -> None:
    """Check mission files; name everything that is wrong with them."""
    from botohe_moo.mission import read_mission

    failed = False
    for path in files:
        try:
            loaded = read_mission(path)
        except ValueError as error:
            typer.echo(f"botohe: {error}", err=True)
            failed = True
        else:
            typer.echo(f"{path}: a valid mission. {loaded!r}")
    if failed:
        raise typer.Exit(BAD_INPUT)


@app.command()
def algorithms(
    name: Annotated[
        str | None, typer.Argument(metavar="[NAME]", help="Show the parameters of this one.")
    ] = None,
) -> None:
    """List the algorithms, or the parameters of one."""
    from botohe_moo.algorithms import algorithm_names
    from botohe_moo.algorithms.registry import algorithm_parameters, describe_algorithm

    if name is None:
        names = algorithm_names()
        width = max(map(len, names), default=0)
        for known in names:
            typer.echo(f"{known:{width}}  {describe_algorithm(known)}")
        return
    with _bad_input():
        parameters = algorithm_parameters(name)
        typer.echo(f"{name}: {describe_algorithm(name)}\n")
    for parameter in parameters:
        typer.echo(f"  {parameter.name} = {parameter.default!r}")
        typer.echo(f"      {parameter.description}" if parameter.description else "")


def _description(mission: Mission) -> str:
    arrays = mission.arrays
    rewards = arrays.reward[arrays.reward > 0]
    lines = [
        f"{mission.name}: {mission.title}",
        f"  nodes         {arrays.n_nodes} ({len(rewards)} with a reward)",
        f"  arcs          {arrays.n_arcs}{'' if mission.balanced else ', dead ends possible'}",
        f"  robots        {mission.robots} at base {mission.base!r}",
        f"  total reward  {mission.total_reward:g}",
    ]
    if arrays.n_arcs:
        lines.append(f"  survival      {arrays.survival.min():g} to {arrays.survival.max():g}")
    return "\n".join(lines)
