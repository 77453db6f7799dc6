"""The command ``botohe simulate``: what replanning is worth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from botohe_moo.cli.choose import SolutionArgument
from botohe_moo.cli.options import SeedOption, out_option
from botohe_moo.cli.replan import PriceOption, ReplansOption, UnderWayOption, plan_under_way
from botohe_moo.cli.shell import failing, tell


def simulate_missions(
    folder: SolutionArgument,
    plan: UnderWayOption,
    policy: Annotated[
        list[str] | None,
        typer.Option(
            "--policy",
            metavar="NAME",
            help='When the plan is made anew, as for `replay`. Repeatable; by default "losses" and '
            '"one by one".',
        ),
    ] = None,
    price: PriceOption = None,
    missions: Annotated[
        int, typer.Option("--missions", metavar="N", help="How many are played under each policy.")
    ] = 1_000,
    evaluations: ReplansOption = 400,
    workers: Annotated[
        int, typer.Option("--workers", metavar="W", help="Processes that play missions.")
    ] = 1,
    seed: SeedOption = 1,
    out: Annotated[
        Path | None, out_option("FILE.png", "Draw what came of each mission, beside the front.")
    ] = None,
) -> None:
    """Play many missions, and say what it is worth to make the plan anew.

    The gain is what a mission is worth more than with the plan as it is, at the price of a robot;
    `gain_se` is its standard error. `replay` shows one of these missions.

    The exit status is 2 for bad input, and if the picture cannot be written.
    """
    with failing():
        from botohe_moo.base.files import check_parent, check_suffix
        from botohe_moo.cli.progress import showing
        from botohe_moo.plots import plot_policies, save_plot
        from botohe_moo.plots.draw.style import FORMATS
        from botohe_moo.underway import simulate_policy

        if out is not None:
            check_suffix(out, FORMATS)
            check_parent(out)
        solution, chosen, how = plan_under_way(folder, plan, price)
        with showing("playing missions") as show:
            outcomes = simulate_policy(
                solution.mission,
                chosen,
                policy or ("losses", "one by one"),
                missions=missions,
                evaluations=evaluations,
                workers=workers,
                seed=seed,
                progress=lambda n: show(f"{n:,} missions", n, missions),
                **how,
            )
    tell(str(outcomes))
    if out is not None:
        with failing():
            save_plot(plot_policies(outcomes, solution.objectives), out)
        tell(f"wrote {out}")
