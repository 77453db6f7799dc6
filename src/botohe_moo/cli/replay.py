"""The command ``botohe replay``: a mission that is played, as a page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from botohe_moo.cli.choose import OpenOption, SolutionArgument, open_in_browser
from botohe_moo.cli.options import SeedOption, out_option
from botohe_moo.cli.replan import PriceOption, UnderWayOption
from botohe_moo.cli.shell import failing, paragraph, tell


def replay_mission(
    folder: SolutionArgument,
    plan: UnderWayOption,
    out: Annotated[Path, out_option("FILE.html", "File to write.")],
    policy: Annotated[
        str,
        typer.Option(
            "--policy",
            metavar="NAME",
            help='When the plan is made anew: "losses", after each; "arrivals", whenever robots '
            'get to a node; "one by one", for robots that go one after another; "static", never.',
        ),
    ] = "losses",
    price: PriceOption = None,
    number: Annotated[
        int, typer.Option("--number", metavar="N", help="Which mission of the seed, from 0.")
    ] = 0,
    evaluations: Annotated[
        int,
        typer.Option("--evaluations", "-n", metavar="N", help="Trail plans to evaluate each time."),
    ] = 400,
    seed: SeedOption = 1,
    open_page: OpenOption = False,
) -> None:
    """Play a mission, and write a page that shows it step by step.

    Robots move along their trails, some are lost, and the plan is made anew. Who is lost depends on
    the number and the seed, and not on the policy until robots go elsewhere.

    The exit status is 2 for bad input, and if the page cannot be written.
    """
    with failing():
        from botohe_moo.decide.fronts import check_row
        from botohe_moo.explorer import replay
        from botohe_moo.explorer.page import check_page_file
        from botohe_moo.solution import read_solution
        from botohe_moo.underway import play_mission, robot_price

        check_page_file(out)
        solution = read_solution(folder)
        mission, row = solution.mission, check_row("--plan", plan, len(solution.plans))
        played = play_mission(
            mission,
            solution.plans[row],
            policy,
            price=robot_price(mission, solution.objectives, row) if price is None else price,
            seed=seed,
            number=number,
            evaluations=evaluations,
            min_survival=solution.min_survival,
            max_length=solution.max_length,
        )
    tell(paragraph(str(played)))
    with failing():
        replay(played, out)
    tell(f"wrote {out}")
    if open_page:
        open_in_browser(out)
