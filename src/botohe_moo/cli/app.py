"""The ``botohe`` command: a thin layer over the library.

Only typer is imported here; what a command needs it imports when it runs, so that ``--help``
answers at once.
"""

from __future__ import annotations

import shlex
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from botohe_moo.cli.bound import bound_mission, certify
from botohe_moo.cli.check import check_conformance
from botohe_moo.cli.choose import ChooseOption, choose_plan, explore_front, tell_choice, write_page
from botohe_moo.cli.library import library_app
from botohe_moo.cli.missions import missions_app
from botohe_moo.cli.options import (
    BaseOption,
    DangerOption,
    HazardOption,
    MaxLengthOption,
    MinSurvivalOption,
    MissionArgument,
    MissionParameterOption,
    ParameterOption,
    RobotsOption,
    SeedOption,
    mission_source,
    out_option,
    read_parameters,
)
from botohe_moo.cli.replan import replan_mission
from botohe_moo.cli.replay import replay_mission
from botohe_moo.cli.shell import (
    FAILED,
    INTERRUPTED,
    brief,
    fail,
    failing,
    listing,
    paragraph,
    parameter_example,
    parameter_text,
    run,
    stoppable,
    tell,
)
from botohe_moo.cli.simulate import simulate_missions
from botohe_moo.cli.study import study_app

if TYPE_CHECKING:
    from pymoo.core.algorithm import Algorithm

    from botohe_moo.problem import BOTOHE
    from botohe_moo.solution import Solution

_STARTED = time.perf_counter()
_PLAIN_ONLY = " Not for kinds of robots, nor for rewards that count on return."
_STOPPING = "stopping; what was found will be written. Press Ctrl-C again to break off."

app = typer.Typer(
    name="botohe",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # its help breaks lines within sentences, and gives flags a value
)
app.command("bound")(bound_mission)
app.command("check")(check_conformance)
app.command("choose")(choose_plan)
app.command("explore")(explore_front)
app.command("replan")(replan_mission)
app.command("replay")(replay_mission)
app.command("simulate")(simulate_missions)
app.add_typer(library_app, name="library")
app.add_typer(missions_app, name="missions")
app.add_typer(study_app, name="study")


def main() -> None:
    """Run the command line and end the process."""
    # module:Class may be in the current folder; last, so that it shadows nothing.
    sys.path.append(str(Path.cwd()))
    run(app)


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        tell(f"botohe-moo {version('botohe-moo')}")
        raise typer.Exit


@app.callback()
def botohe(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Show the version and exit."
        ),
    ] = False,
) -> None:
    """Plan trails for robot teams in hazardous environments: reward against survival."""


@app.command("solve")
def solve_mission(
    mission: MissionArgument,
    algorithm: Annotated[
        str, typer.Option("--algorithm", "-a", help="One of `botohe algorithms`.")
    ] = "pareto-local-search",
    parameter: ParameterOption = None,
    evaluations: Annotated[
        int,
        typer.Option("--evaluations", "-n", metavar="N", help="Trail plans to evaluate."),
    ] = 100_000,
    seed: SeedOption = 1,
    robots: RobotsOption = None,
    base: BaseOption = None,
    danger: DangerOption = None,
    hazard: HazardOption = None,
    mission_parameter: MissionParameterOption = None,
    min_survival: MinSurvivalOption = 0.0,
    max_length: MaxLengthOption = None,
    islands: Annotated[
        int | None,
        typer.Option(
            "--islands",
            metavar="L",
            help="Searches that go on side by side, where the algorithm has islands; by default 8. "
            "The front depends on it.",
        ),
    ] = None,
    threads: Annotated[
        int | None,
        typer.Option(
            "--threads",
            metavar="T",
            help="Threads, also of --certify; by default one for each processor. The front does "
            "not depend on it.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        out_option("DIR", "Folder to write to; by default a new one, results/solve/MISSION."),
    ] = None,
    show_all: Annotated[
        bool,
        typer.Option("--all", help="Print all plans of the front, not only some ten."),
    ] = False,
    wish: ChooseOption = None,
    explore: Annotated[
        bool,
        typer.Option("--explore", help="Also write explorer.html, as `botohe explore` does."),
    ] = False,
    certify_for: Annotated[
        float | None,
        typer.Option(
            "--certify",
            metavar="S",
            help="Seconds to prove, as `botohe bound` does, how far the front is from the best "
            "there is. Also writes bound.json, and draws the bound in front.png.",
        ),
    ] = None,
) -> None:
    """Search for the Pareto front of a mission.

    Prints some ten plans along the front: its ends, its knee, and plans that represent the others.

    Writes the whole front: front.csv, plans.json, mission.json, front.png and mission.png. In the
    folder that --out names they replace those of an earlier search; without it, every search gets a
    new folder.

    Ctrl-C stops the search and writes what was found, without --choose, --explore and --certify.
    While --certify proves, it keeps what is proved.

    The exit status is 1 if nothing was found or it cannot be written, or if no plan meets all
    wishes of --choose; 2 for bad input.
    """
    with failing():
        own = {"robots": robots, "base": base, "danger": danger, "hazard": hazard}
        source = mission_source(mission, mission_parameter, **own)
        parameters = read_parameters(parameter)
        from botohe_moo.algorithms.registry import algorithm_parameters
        from botohe_moo.base.messages import check_integer, check_number
        from botohe_moo.decide import parse_wishes
        from botohe_moo.mission import load_mission
        from botohe_moo.problem import BOTOHE
        from botohe_moo.solving import make_for_this_machine

        known = {each.name for each in algorithm_parameters(algorithm)}
        for name, value in (("islands", islands), ("threads", threads)):
            if value is not None:
                check_integer(f"--{name}", value, at_least=1, at_most=1_024)
                if f"n_{name}" not in known:
                    raise ValueError(f"Algorithm {algorithm!r} has no {name}: leave out --{name}.")
                if f"n_{name}" in parameters:
                    raise ValueError(f"Expected --{name} or the parameter n_{name}, got both.")
                parameters[f"n_{name}"] = value
        loaded = load_mission(**source)
        wishes = parse_wishes(loaded, wish) if wish else ()
        built, parameters = make_for_this_machine(algorithm, parameters)
        problem = BOTOHE(loaded, min_survival=min_survival, max_length=max_length)
        check_integer("--evaluations", evaluations, at_least=1)
        check_integer("--seed", seed, at_least=0)
        if certify_for is not None:
            from botohe_moo.bounds.plain import check_boundable

            check_number("--certify", certify_for, above=0)
            check_boundable(loaded, "--certify")
    solution, folder = _search_and_write(
        problem,
        built,
        out,
        evaluations=evaluations,
        seed=seed,
        record={"algorithm": algorithm, "parameters": parameters, "source": source},
        show_all=show_all,
    )
    choice = solution.choose(*wishes) if wishes else None
    if explore:
        from botohe_moo.solution.model import PAGE

        write_page(solution, folder / PAGE, choice)
    if choice is not None:
        tell("")
        tell_choice(loaded, choice, folder)
    if certify_for is not None:
        certify(solution, folder, certify_for, threads)
    if choice is None:
        where, wish_for = shlex.quote(str(folder)), f'"survivors >= {2 * loaded.robots / 3:.2g}"'
        tell(f"\nNext:\n  botohe explore {where} --open\n  botohe choose {where} {wish_for}")
    elif not choice.met:
        fail("no plan meets all wishes.", FAILED)


def _search_and_write(
    problem: BOTOHE, algorithm: Algorithm, out: Path | None, *, show_all: bool, **how: Any
) -> tuple[Solution, Path]:
    from botohe_moo.base.files import check_folder, new_folder
    from botohe_moo.cli.progress import showing_search
    from botohe_moo.mission.formats.reading import stem_of
    from botohe_moo.solution import PictureError
    from botohe_moo.solving import RefusalError, search

    default = Path("results", "solve", stem_of(how["record"]["source"]["name_or_path"]))
    with stoppable(_STOPPING) as stop, ExitStack() as stack:
        with failing():
            check_folder(default.parent if out is None else out)
            folder = stack.enter_context(new_folder(default)) if out is None else out
        tell(f"{problem.mission.title}: {brief(problem.mission, problem.max_length)}\n")
        try:
            with showing_search(how["evaluations"]) as progress:
                solution = search(
                    problem, algorithm, progress=progress, stop=stop, started=_STARTED, **how
                )
        except RefusalError as error:
            fail(error)
        if not solution.plans:
            found = f"{solution.algorithm} found no plan in {solution.evaluations} evaluations"
            fail(f"{found}; nothing is written.", INTERRUPTED if stop.is_set() else FAILED)
        with failing(FAILED):
            try:
                paths = solution.write(
                    folder, before_pictures=lambda: tell(solution.describe(all_plans=show_all))
                )
            except PictureError as error:
                fail(f"{error} The tables are in {folder}.", FAILED)
        tell("\n" + "\n".join(f"wrote {path}" for path in paths))
    return solution, folder


@app.command()
def algorithms(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="Show the parameters of this one.")
    ] = None,
) -> None:
    """List the algorithms, or the parameters of one."""
    from botohe_moo.algorithms import algorithm_names
    from botohe_moo.algorithms.registry import (
        algorithm_parameters,
        describe_algorithm,
        plans_for_kinds,
    )

    if name is None:
        names = algorithm_names()
        plain = {known: "" if plans_for_kinds(known) else _PLAIN_ONLY for known in names}
        tell(listing((known, f"{describe_algorithm(known)}{plain[known]}") for known in names))
        tell(f"\n{paragraph('`botohe algorithms NAME` shows the parameters of one.')}")
        return
    with failing():
        parameters = algorithm_parameters(name)
        summary = describe_algorithm(name)
    tell(paragraph(f"{name}: {summary}" if summary else name))
    if not plans_for_kinds(name):
        tell(paragraph(_PLAIN_ONLY.strip()))
    for parameter in parameters:
        tell(f"\n{parameter_text(parameter)}")
    if given := next((known for known in parameters if known.plain), None):
        example = f"botohe solve MISSION -a {name} -p {parameter_example(given)}"
        tell(f"\nGive one as in `{example}`.")
