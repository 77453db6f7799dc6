"""The command ``botohe replay``: a mission that is played, as a page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from botohe_moo.cli.choose import OpenOption, SolutionArgument, open_in_browser
from botohe_moo.cli.options import SeedOption, out_option
from botohe_moo.cli.replan import PriceOption, ReplansOption, UnderWayOption, plan_under_way
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
            'get to a node; "one by one", for robots that go one after another, that with most '
            'hops first; "shortest first", the same with fewest hops first; "static", never.',
        ),
    ] = "losses",
    price: PriceOption = None,
    number: Annotated[
        int, typer.Option("--number", metavar="N", help="Which mission of the seed, from 0.")
    ] = 0,
    evaluations: ReplansOption = 400,
    seed: SeedOption = 1,
    open_page: OpenOption = False,
) -> None:
    """Play a mission, and write a page that shows it step by step.

    Robots move along their trails, some are lost, and the plan is made anew. Who is lost depends on
    the number and the seed, and not on the policy until robots go elsewhere.

    The exit status is 2 for bad input, and if the page cannot be written.
    """
    with failing():
        from botohe_moo.cli.progress import showing
        from botohe_moo.explorer import replay
        from botohe_moo.explorer.page import check_page_file
        from botohe_moo.underway import play_mission

        check_page_file(out)
        solution, chosen, how = plan_under_way(folder, plan, price)
        with showing("playing"):
            played = play_mission(
                solution.mission,
                chosen,
                policy,
                seed=seed,
                number=number,
                evaluations=evaluations,
                **how,
            )
    tell(paragraph(str(played)))
    with failing():
        replay(played, out)
    tell(f"wrote {out}")
    if open_page:
        open_in_browser(out)
