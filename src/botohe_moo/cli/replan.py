"""The command ``botohe replan``: a plan made anew for a mission under way."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from botohe_moo.cli.choose import SolutionArgument, trails_text
from botohe_moo.cli.options import SeedOption, out_option
from botohe_moo.cli.shell import failing, paragraph, tell

if TYPE_CHECKING:
    from botohe_moo.solution import Solution
    from botohe_moo.trails import TrailPlan
    from botohe_moo.underway import Replan

PICTURE = "replan.png"

UnderWayOption = Annotated[
    int, typer.Option("--plan", metavar="ID", help="The plan of front.csv that is under way.")
]
PriceOption = Annotated[
    float | None,
    typer.Option(
        "--price",
        metavar="REWARD",
        help="What a robot more is worth; by default the slope of the front at the plan.",
    ),
]
ReplansOption = Annotated[
    int,
    typer.Option("--evaluations", "-n", metavar="N", help="Trail plans to evaluate each time."),
]


def plan_under_way(
    folder: Path, plan: int, price: float | None
) -> tuple[Solution, TrailPlan, dict[str, Any]]:
    """Return a solution, one of its plans, and the price and limits with which it is replanned."""
    from botohe_moo.decide.fronts import check_row
    from botohe_moo.solution import read_solution
    from botohe_moo.underway import robot_price

    solution = read_solution(folder)
    row = check_row("--plan", plan, len(solution.plans))
    if price is None:
        price = robot_price(solution.mission, solution.objectives, row)
    limits = {"min_survival": solution.min_survival, "max_length": solution.max_length}
    return solution, solution.plans[row], {"price": price, **limits}


def replan_mission(
    folder: SolutionArgument,
    events: Annotated[
        Path,
        typer.Argument(
            metavar="EVENTS",
            help="CSV file with the columns robot (its row in the plan, from 0, or the name of its "
            "kind, if it is the only one), event (reached, lost or home) and node.",
        ),
    ],
    plan: UnderWayOption,
    price: PriceOption = None,
    evaluations: Annotated[
        int, typer.Option("--evaluations", "-n", metavar="N", help="Trail plans to evaluate.")
    ] = 1_000,
    seed: SeedOption = 1,
    out: Annotated[
        Path | None,
        out_option(
            "DIR",
            "Write what is left of the mission and its front to this folder, as `solve` does, and "
            f"{PICTURE}, the new plan beside what is left of the old one.",
        ),
    ] = None,
) -> None:
    """Make a plan anew after some events of a mission under way.

    `reached` a node means the next visit of it, and all nodes of the trail before, too. The node of
    a robot that is `lost` is the one to which it was on its way, or empty. A robot that is `home`
    has followed its trail to the end, and stays there.

    The new plan is never worth less than what is left of the old one, at the price of a robot.

    With --out, `botohe choose`, `explore` and `replan` go on from that folder.

    The exit status is 2 for bad input, and if files cannot be written.
    """
    with failing():
        from botohe_moo.base.files import check_folder
        from botohe_moo.cli.progress import showing
        from botohe_moo.underway import read_events, replan

        solution, chosen, how = plan_under_way(folder, plan, price)
        if out is not None:
            if out.resolve() == folder.resolve():
                raise ValueError(f"{out}: the folder of the plan itself; give another one.")
            check_folder(out)
        happened = read_events(solution.mission, events)
        with showing("searching"):
            found = replan(
                solution.mission, chosen, happened, evaluations=evaluations, seed=seed, **how
            )
    left = found.left
    reward, survivors = found.objectives.tolist()
    tell(
        paragraph(
            f"Rewards of {left.banked:.4g} count already. {found} Expected from now on: "
            f"{reward:.4g} reward and {survivors:.4g} survivors."
        )
    )
    tell(f"\n{trails_text(left.mission, found.plan)}")
    if any(new != old for new, old in enumerate(left.robots)):
        rows = ", ".join(f"row {new} was row {old}" for new, old in enumerate(left.robots))
        tell(f"\nRobots have new rows: {rows}.")
    if out is not None:
        with failing():
            _write(solution, found, evaluations, seed, out)


def _write(solution: Solution, found: Replan, evaluations: int, seed: int, out: Path) -> None:
    from dataclasses import replace

    from botohe_moo.plots import plot_replan
    from botohe_moo.solution.model import draw_picture

    rest = replace(
        solution,
        mission=found.left.mission,
        plans=found.plans,
        objectives=found.front,
        algorithm="pareto-local-search",
        parameters={},
        seed=seed,
        evaluations=evaluations,
        seconds=None,
        interrupted=False,
        source={},
        min_survival=0.0,
        max_length=None,
    )
    for path in rest.write(out):
        tell(f"wrote {path}")
    draw_picture(out / PICTURE, plot_replan, found)
    tell(f"wrote {out / PICTURE}")
    row, where = found.plans.index(found.plan), shlex.quote(str(out))
    tell(f"\nThe new plan is plan {row} of {out}:\n  botohe choose {where} --plan {row}")
