"""From a front to a plan, and the plan on its way: choose, explore, replan, replay, simulate."""

from __future__ import annotations

import shlex
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import botohe_moo as bm
from botohe_moo import decide, explorer, plots
from botohe_moo.base import files
from botohe_moo.cli import common
from botohe_moo.cli.common import fail, failing, paragraph, say, showing, tell

if TYPE_CHECKING:
    from botohe_moo import underway

REPLAN_PICTURE = "replan.png"
_MOST_SCENARIOS = 10  # rows of a table


def choose(
    folder: Path,
    wish: list[str] | None = None,
    *,
    most: str | None = None,
    toward: tuple[float, float] | None = None,
    plan: int | None = None,
    out: Path | None = None,
    altitude: float | None = None,
    vehicle: str = "multicopter",
) -> None:
    """Choose the best plan of a front that meets all wishes.

    Wishes on expected values: `survivors >= 2`, `reward >= 5`. On probabilities:
    `P(survivors >= 2) >= 0.9`, `P(reward >= 5) >= 0.8`, `every robot >= 0.5` (survives),
    `reach NODE >= 0.9`. On bad luck: `CVaR(reward, 0.1) >= 2` (mean of the lowest tenth; also of
    survivors), `worst case of 1 loss >= 5` (expected reward if the worst robot never leaves). With
    several kinds of robots: `KIND survivors >= 1`. Join wishes by ` and `, or give several.

    Without a wish, it lists about ten plans: the ends of the front, its knee, and plans that
    represent the others.

    The exit status is 1 if no plan meets all wishes. Then the nearest plan is shown, and no file is
    written. It is 2 for bad input, and if the file cannot be written.

    Parameters
    ----------
    wish : WISH
        Such as "survivors >= 2". A plan has to meet all wishes.
    most : reward|survivors
        What to maximise. By default the reward; the survivors if all wishes are of the form
        `reward >= X`.
    toward : REWARD SURVIVORS
        Choose the plan nearest to this point instead.
    out : -o PATH
        File for the plan: .json, .csv (waypoints), .geojson, .plan (QGroundControl), or a picture:
        .png, .svg, .pdf. A name without a suffix makes a folder of files for Nav2. Files of an
        earlier plan are replaced.
    altitude : M
        Height of waypoints above the start, in metres, for a .plan file. Below 0 for a submarine. A
        rover and a boat need none.
    vehicle : NAME
        Vehicle of a .plan file: multicopter, fixed-wing, vtol, rover, boat or submarine.
    """
    with failing():
        from botohe_moo.decide.choosing import taken
        from botohe_moo.decide.fronts import check_row
        from botohe_moo.decide.plan_files import check_geographic, check_plan_path
        from botohe_moo.solution import FILES

        ways = {"wishes": wish, "--toward": toward, "--plan": plan}
        given = [name for name, value in ways.items() if value not in (None, [])]
        if len(given) > 1:
            raise ValueError(f"Expected only one of {', '.join(ways)}; got {' and '.join(given)}.")
        if most is not None and not wish:
            raise ValueError("Expected wishes with --most, got none.")
        if out is not None:
            if not given:
                raise ValueError("Expected wishes, --toward or --plan with --out, got none.")
            check_plan_path(out, altitude, vehicle, common.PICTURES)
            if out.resolve() in ((folder / name).resolve() for name in FILES):
                raise ValueError(f"{out}: a file of the solution itself; give another name.")
        solution = bm.read_solution(folder)
        if out is not None and out.suffix.lower() == ".plan":
            check_geographic(solution.mission)
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
        nothing = "; nothing is written" if out else ""
        fail(f"no plan meets all wishes{nothing}.", common.FAILED)
    if out is not None:
        with failing():
            for file in _write_plan(solution.mission, choice.plan, out, altitude, vehicle):
                tell(f"wrote {file}")


def _write_plan(
    mission: bm.Mission, plan: bm.TrailPlan, path: Path, altitude: float | None, vehicle: str
) -> tuple[Path, ...]:
    """Write a plan, or draw it, as the suffix of the path says."""
    if path.suffix.lower() not in common.PICTURES:
        return decide.write_plan(mission, plan, path, altitude=altitude, vehicle=vehicle)
    draw = plots.plot_scenarios if mission.scenarios else plots.plot_plan
    plots.save_plot(draw(mission, plan), path)
    return (path,)


def tell_choice(mission: bm.Mission, choice: decide.Choice, folder: Path) -> None:
    """Print a choice, the trails of its plan, and how to look at it."""
    title, *sentences = str(choice).split("\n")  # labels may hold other ends of lines
    tell("\n".join([title, *map(paragraph, sentences)]))
    tell(f"\n{trails_text(mission, choice.plan)}")
    if mission.scenarios:
        tell(f"\n{scenarios_text(mission, choice.plan)}")
    tell(f"\n`botohe explore {shlex.quote(str(folder))}` makes a page that shows it on the map.")


def scenarios_text(mission: bm.Mission, plan: bm.TrailPlan) -> str:
    """Write what is expected in up to ten scenarios, the least reward first."""
    table = decide.by_scenario(mission, [plan]).drop(columns="plan").sort_values("reward")
    head = ("scenario", "probability", "expected reward", "expected survivors")
    rows = [(name, *(f"{n:.3f}" for n in of)) for name, *of in table.to_numpy()[:_MOST_SCENARIOS]]
    more = [("...", "", "", "")] if len(table) > _MOST_SCENARIOS else []
    return common.table([head, *rows, *more], n_texts=1)


def trails_text(mission: bm.Mission, plan: bm.TrailPlan) -> str:
    """Write the trails of a plan, a line for each robot."""
    from botohe_moo.base.messages import probability_text
    from botohe_moo.decide.wishes import label_text

    rows = []
    survivals = mission.robot_survival([plan])[0].tolist()
    for robot, trail in enumerate(mission.labels(plan)):
        kind = f"{mission.kind_of[robot].name}, " if len(mission.kinds) > 1 else ""
        name = f"robot {robot} ({kind}survival {probability_text(survivals[robot], 3)}):"
        nodes = " -> ".join(map(label_text, trail))
        rows.append((name, f"stays at {nodes}" if len(trail) == 1 else nodes))
    return common.table(rows, wrap=True)


def explore(
    folder: Path,
    *,
    out: Path | None = None,
    choose: list[str] | None = None,
    background: Path | None = None,
    open_page: bool = False,
) -> None:
    """Write a page to walk along a front and compare its plans.

    The page is one HTML file that needs no network. It shows the front beside the map of the site,
    distributions of reward and survivors, and up to four plans side by side. It filters and exports
    plans.

    --choose marks the chosen plan on the page. If no plan meets all wishes, it marks the nearest
    plan, and the exit status is still 0. The exit status is 2 for bad input, and if the page cannot
    be written.

    Parameters
    ----------
    out : -o FILE
        Page to write. By default DIR/explorer.html.
    background : MAP
        Map of the site to draw behind the graph: YAML for the map server of Nav2.
    """
    with failing():
        from botohe_moo.explorer.page import check_page_file
        from botohe_moo.solution import PAGE

        solution = bm.read_solution(folder)
        path = check_page_file(folder / PAGE if out is None else out)
        choice = solution.choose(*choose) if choose else None
        if choice is not None:
            tell(paragraph(choice.why))
        solution.explore(path, wishes=[choice] if choice else (), background=background)
    _show_page(path, open_page)


def _show_page(path: Path, open_page: bool) -> None:
    """Say that a page is written, and open it, or say that it cannot be opened."""
    tell(f"wrote {path}")
    if open_page and not webbrowser.open(path.resolve().as_uri()):
        say(f"there is no browser here that could be started; open {path} in one.")


def replan(
    folder: Path,
    events: Path,
    *,
    plan: int,
    price: float | None = None,
    evaluations: common.Count = 400,
    seed: common.Number = 1,
    out: Path | None = None,
) -> None:
    """Make a new plan after some events of a mission under way.

    A robot that `reached` a node has also passed all nodes before it on its trail. For a robot that
    is `lost`, the node is where it was heading; it may be empty. A robot that is `home` has
    finished its trail and stays there.

    At the price of a survivor, the new plan is never worth less than the rest of the old one.

    With --out, `botohe choose`, `explore` and `replan` go on from that folder.

    The exit status is 2 for bad input, and if files cannot be written.

    Parameters
    ----------
    events : EVENTS
        CSV file with the columns robot, event (reached, lost or home) and node. A robot is its row
        in the plan, from 0, or its kind if no other robot is of that kind.
    out : -o DIR
        Folder for the rest of the mission and its front, as `solve` writes them, and replan.png,
        the new plan beside the rest of the old one.
    """
    with failing():
        from botohe_moo import underway

        solution, chosen, how = _plan_under_way(folder, plan, price)
        if out is not None:
            if out.resolve() == folder.resolve():
                raise ValueError(f"{out}: the folder of the plan itself; give another one.")
            files.check_folder(out)
        happened = underway.read_events(solution.mission, events)
        how |= {"evaluations": evaluations, "seed": seed}
        with showing("searching"):
            found = underway.replan(solution.mission, chosen, happened, **how)
    left = found.left
    reward, survivors = found.objectives.tolist()
    collected = f"Rewards of {left.banked:.4g} were collected since the plan was made."
    now = f"Expected from now on: {reward:.4g} reward and {survivors:.4g} survivors."
    tell(paragraph(f"{collected} {found} {now}"))
    tell(f"\n{trails_text(left.mission, found.plan)}")
    if any(new != old for new, old in enumerate(left.robots)):
        rows = ", ".join(f"row {new} was row {old}" for new, old in enumerate(left.robots))
        tell(f"\nRobots have new rows: {rows}.")
    if out is not None:
        with failing():
            _write_rest(found, out, evaluations, seed)


def _write_rest(found: underway.Replan, out: Path, evaluations: int, seed: int) -> None:
    """Write the rest of a mission as the solution of a search."""
    rest = bm.Solution(
        mission=found.left.mission,
        plans=found.plans,
        objectives=found.front,
        algorithm="pareto-local-search",
        parameters={},
        seed=seed,
        evaluations=evaluations,
    )
    paths = rest.write(out)
    plots.save_plot(plots.plot_replan(found), out / REPLAN_PICTURE)
    for path in (*paths, out / REPLAN_PICTURE):
        tell(f"wrote {path}")
    row, where = found.plans.index(found.plan), shlex.quote(str(out))
    tell(f"\nThe new plan is plan {row} of {out}:\n  botohe choose {where} --plan {row}")


def _plan_under_way(
    folder: Path, plan: int, price: float | None
) -> tuple[bm.Solution, bm.TrailPlan, dict[str, Any]]:
    """Return a solution, one of its plans, and the price and limits with which it is replanned."""
    from botohe_moo.decide.fronts import check_row

    solution = bm.read_solution(folder)
    row = check_row("--plan", plan, len(solution.plans))
    if price is None:
        price = solution.survivor_price(row)
    limits = {"min_survival": solution.min_survival, "max_length": solution.max_length}
    return solution, solution.plans[row], {"price": price, **limits}


def replay(
    folder: Path,
    *,
    plan: int,
    out: Path,
    policy: str = "losses",
    price: float | None = None,
    number: common.Number = 0,
    evaluations: common.Count = 400,
    seed: common.Number = 1,
    open_page: bool = False,
) -> None:
    """Play a mission, and write a page that shows it step by step.

    Robots move along their trails. Some are lost, and the plan is made anew. The number and the
    seed decide which robots are lost. The policy changes that only once robots go elsewhere.

    The exit status is 2 for bad input, and if the page cannot be written.

    Parameters
    ----------
    out : -o FILE
        Page to write: FILE.html.
    number : N
        Which mission of the seed, from 0.
    """
    with failing():
        from botohe_moo import underway
        from botohe_moo.explorer.page import check_page_file

        check_page_file(out)
        solution, chosen, how = _plan_under_way(folder, plan, price)
        how |= {"seed": seed, "number": number, "evaluations": evaluations}
        with showing("playing"):
            played = underway.play_mission(solution.mission, chosen, policy, **how)
        tell(paragraph(str(played)))
        explorer.replay(played, out)
    _show_page(out, open_page)


def simulate(
    folder: Path,
    *,
    plan: int,
    policy: list[str] | None = None,
    price: float | None = None,
    missions: Annotated[int, typer.Option(min=2)] = 1_000,
    evaluations: common.Count = 400,
    workers: common.Count = 1,
    seed: common.Number = 1,
    out: Path | None = None,
) -> None:
    """Measure what replanning gains, on many played missions.

    A mission is worth its reward plus the price of its survivors. The gain is how much more it is
    worth with replanning than with the plan as it is. The column `gain_se` is the standard error of
    the gain. `botohe replay` shows one of these missions.

    The exit status is 2 for bad input, and if the picture cannot be written.

    --policy may be given several times. By default it is "losses" and "one by one".

    Parameters
    ----------
    missions : N
        Number of missions to play under each policy.
    workers : -w N
        Processes that play.
    out : -o FILE
        Picture of the front, and of the outcome of each mission.
    """
    with failing():
        from botohe_moo import underway

        if out is not None:
            files.check_suffix(out, common.PICTURES)
            files.check_file(out)
        solution, chosen, how = _plan_under_way(folder, plan, price)
        how |= {"missions": missions, "evaluations": evaluations, "workers": workers, "seed": seed}
        with showing("playing missions") as show:
            how["progress"] = lambda n: show(f"{n:,} missions", n, missions)
            names = policy or ("losses", "one by one")
            outcomes = underway.simulate_policy(solution.mission, chosen, names, **how)
        tell(str(outcomes))
        if out is not None:
            plots.save_plot(plots.plot_policies(outcomes, solution.expected), out)
            tell(f"wrote {out}")


COMMANDS = (choose, explore, replan, replay, simulate)
