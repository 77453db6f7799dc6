"""The commands ``botohe choose`` and ``botohe explore``: from a front to a plan."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from botohe_moo.cli.options import PICTURES, out_option, path_option
from botohe_moo.cli.shell import FAILED, fail, failing, paragraph, say, tell

if TYPE_CHECKING:
    from botohe_moo.decide import Choice
    from botohe_moo.mission.model import Mission
    from botohe_moo.solution import Solution
    from botohe_moo.trails import TrailPlan

SolutionArgument = Annotated[Path, typer.Argument(metavar="DIR", help="Folder that `solve` wrote.")]
WishArgument = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="WISH",
        help='Such as "survivors >= 2" or "P(reward >= 5) >= 0.8". All are to be met.',
    ),
]
MostOption = Annotated[
    str | None,
    typer.Option(
        "--most",
        metavar="reward|survivors",
        help="What the plan is to have most of; by default the reward, or the survivors if all "
        "wishes are of the form `reward >= X`.",
    ),
]
TowardOption = Annotated[
    tuple[float, float] | None,
    typer.Option(
        "--toward",
        metavar="REWARD SURVIVORS",
        help="Choose the plan nearest to this point instead.",
    ),
]
PlanOption = Annotated[
    int | None,
    typer.Option("--plan", metavar="ID", help="Take this plan of front.csv."),
]
ChooseOption = Annotated[
    list[str] | None,
    typer.Option(
        "--choose",
        metavar="WISH",
        help='Choose a plan, as `botohe choose` does: "survivors >= 2". Repeatable; all wishes are '
        "to be met.",
    ),
]
OpenOption = Annotated[bool, typer.Option("--open", help="Open the page in the browser.")]
PlanFileOption = Annotated[
    Path | None,
    out_option(
        "PATH",
        "Write the plan: .json, .csv (waypoints), .geojson, .plan (QGroundControl, with "
        "--altitude and --vehicle), drawn on the map as .png, .svg or .pdf, or, without a suffix, "
        "a folder with files for Nav2.",
    ),
]
AltitudeOption = Annotated[
    float | None,
    typer.Option(
        "--altitude",
        metavar="M",
        help="Height of waypoints above the start, in metres: for --out FILE.plan. Below 0 for a "
        "submarine; a rover and a boat need none.",
    ),
]
VehicleOption = Annotated[
    str,
    typer.Option(
        "--vehicle",
        metavar="VEHICLE",
        help="Which vehicle --out FILE.plan is for: multicopter, fixed-wing, vtol, rover, boat or "
        "submarine.",
    ),
]


def choose_plan(
    folder: SolutionArgument,
    wish: WishArgument = None,
    most: MostOption = None,
    toward: TowardOption = None,
    plan: PlanOption = None,
    out: PlanFileOption = None,
    altitude: AltitudeOption = None,
    vehicle: VehicleOption = "multicopter",
) -> None:
    """Choose the best plan of a front that meets all wishes.

    Wishes: `survivors >= 2` and `reward >= 5` (expected), `P(survivors >= 2) >= 0.9`,
    `P(reward >= 5) >= 0.8`, `CVaR(reward, 0.1) >= 2` (mean of the lowest tenth; of survivors, too),
    `worst case of 1 loss >= 5` (expected reward if the worst robot never leaves),
    `every robot >= 0.5` (survives), `reach NODE >= 0.9`; several, or joined by ` and `. Where there
    are several kinds of robots, also `KIND survivors >= 1`.

    Without a wish, some ten plans to look at are listed: the ends of the front, its knee, and plans
    that represent the others.

    The exit status is 1 if no plan meets all wishes; then the nearest one is shown, and no file is
    written. It is 2 for bad input, and if the file cannot be written.
    """
    with failing():
        from botohe_moo.decide.choosing import taken
        from botohe_moo.decide.export import check_plan_path
        from botohe_moo.decide.fronts import check_row
        from botohe_moo.solution import read_solution

        asked = {"wishes": bool(wish), "--toward": toward is not None, "--plan": plan is not None}
        _check_options(asked, most, out)
        if out is not None:
            check_plan_path(out, altitude, vehicle, PICTURES)
            _check_not_of_solution(folder, out)
        solution = read_solution(folder)
        if toward is not None:
            choice = solution.toward(reward=toward[0], survivors=toward[1])
        elif wish:
            choice = solution.choose(*wish, most=most)  # type: ignore[arg-type]
        elif plan is not None:
            row = check_row("--plan", plan, len(solution.plans))
            choice = taken(solution.mission, solution.plans, row)
        else:
            more = (
                "The knee is a mark, not a verdict. Say what you wish, as in "
                '`botohe choose DIR "survivors >= 2"`, or look at one with `--plan ID`.'
            )
            tell(f"{solution.describe()}\n\n{paragraph(more)}")
            return
        tell_choice(solution.mission, choice, folder)
    if wish and not choice.met:
        fail("no plan meets all wishes" + ("; nothing is written." if out else "."), FAILED)
    if out is not None:
        _write(solution.mission, choice.plan, out, altitude, vehicle)


def _check_not_of_solution(folder: Path, out: Path) -> None:
    from botohe_moo.solution.model import FILES

    if any(out.resolve() == (folder / name).resolve() for name in FILES):
        raise ValueError(f"{out}: a file of the solution itself; give another name.")


def _write(
    mission: Mission, plan: TrailPlan, path: Path, altitude: float | None, vehicle: str
) -> None:
    from botohe_moo.decide import write_plan
    from botohe_moo.solution.model import draw_picture

    with failing():
        if path.suffix.lower() in PICTURES:
            from botohe_moo.plots import plot_plan

            draw_picture(path, plot_plan, mission, plan)
            files: tuple[Path, ...] = (path,)
        else:
            files = write_plan(mission, plan, path, altitude=altitude, vehicle=vehicle)
    for file in files:
        tell(f"wrote {file}")


def _check_options(asked: dict[str, bool], most: str | None, out: Path | None) -> None:
    given = [name for name, there in asked.items() if there]
    if len(given) > 1:
        raise ValueError(f"Expected only one of {', '.join(asked)}; got {' and '.join(given)}.")
    if most is not None and not asked["wishes"]:
        raise ValueError("Expected wishes with --most, got none.")
    if out is not None and not given:
        raise ValueError("Expected wishes, --toward or --plan with --out, got none of them.")


def tell_choice(mission: Mission, choice: Choice, folder: Path) -> None:
    """Print a choice, the trails of its plan, and how to look at it."""
    title, *sentences = str(choice).split("\n")  # labels may hold other ends of lines
    tell("\n".join([title, *(paragraph(sentence) for sentence in sentences)]))
    tell(f"\n{trails_text(mission, choice.plan)}")
    tell(f"\n`botohe explore {shlex.quote(str(folder))}` makes a page that shows it on the map.")


def trails_text(mission: Mission, plan: TrailPlan) -> str:
    """Write the trails of a plan, a line for each robot."""
    from botohe_moo.base.numbers import probability_text
    from botohe_moo.decide.wishes import label_text

    lines = []
    survivals = mission.robot_survival([plan])[0].tolist()
    for robot, trail in enumerate(mission.labels(plan)):
        nodes = " -> ".join(map(label_text, trail))
        way = f"stays at {nodes}" if len(trail) == 1 else nodes
        kind = f"{mission.kind_of[robot].name}, " if len(mission.kinds) > 1 else ""
        first = f"robot {robot} ({kind}survival {probability_text(survivals[robot], 3)}): "
        lines.append(paragraph(way, first=first, indent=" " * 4))
    return "\n".join(lines)


def explore_front(
    folder: SolutionArgument,
    out: Annotated[
        Path | None,
        out_option("FILE.html", "File to write; by default DIR/explorer.html."),
    ] = None,
    wish: ChooseOption = None,
    background: Annotated[
        Path | None,
        path_option(
            "--background",
            metavar="MAP.yaml",
            help="Map of the site, as for ROS's map server, to draw behind the graph.",
        ),
    ] = None,
    open_page: OpenOption = False,
) -> None:
    """Write a page to walk along a front and compare its plans.

    One HTML file that needs no network: the front beside the map of the site, distributions of
    reward and survivors, up to four plans side by side, filters, and export of plans.

    The plan that --choose chooses is marked on it. If no plan meets all wishes, it is the nearest
    one, and the exit status is still 0. It is 2 for bad input, and if the page cannot be written.
    """
    with failing():
        from botohe_moo.explorer.page import check_page_file
        from botohe_moo.solution import read_solution
        from botohe_moo.solution.model import PAGE

        solution = read_solution(folder)
        path = check_page_file(folder / PAGE if out is None else out)
        choice = solution.choose(*wish) if wish else None
    if choice is not None:
        tell(paragraph(choice.why))
    write_page(solution, path, choice, background)
    if open_page:
        open_in_browser(path)


def write_page(
    solution: Solution, path: Path, choice: Choice | None, background: Path | None = None
) -> None:
    """Write the page of a solution, with a choice marked, and say so."""
    with failing():
        wishes = () if choice is None else [choice]
        solution.explore(path, wishes=wishes, background=background)
    tell(f"wrote {path}")


def open_in_browser(path: Path) -> None:
    """Open a page, or say that it cannot be opened."""
    import webbrowser

    if not webbrowser.open(path.resolve().as_uri()):
        say(f"there is no browser here that could be started; open {path} in one.")
