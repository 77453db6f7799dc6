"""Pages of fronts and of played missions: one HTML file with its data, styles and scripts."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import os
import zlib
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jinja2

from botohe_moo.base.files import check_file, check_suffix, replace_file
from botohe_moo.base.messages import price_text
from botohe_moo.decide import Choice
from botohe_moo.decide.wishes import Wish
from botohe_moo.explorer import data as d
from botohe_moo.mission.model import Mission
from botohe_moo.underway import POLICIES, PlayedMission, PlayedStep

if TYPE_CHECKING:
    from botohe_moo.solution import Solution

_REPLAY_SCRIPTS = ("data", "room", "map", "site", "replay")


def replay(played: PlayedMission, path: str | os.PathLike[str]) -> Path:
    """Write a page on which robots move along their trails, are lost, and get new trails.

    One HTML file that needs no network.

    Parameters
    ----------
    played
        A mission that was played.
    path
        File to write or to replace; ends in ``.html``.

    Returns
    -------
    pathlib.Path
        The file.

    Raises
    ------
    ValueError
        If the ``pos`` of a node is not two finite numbers, or the path ends otherwise.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.underway import play_mission
    >>> from botohe_moo.explorer import replay
    >>> toy = load_mission("toy")
    >>> played = play_mission(toy, toy.plan([[1, 2, 4, 2, 1], [1, 3, 1]]), price=2)
    >>> replay(played, "replay.html").name
    'replay.html'
    """
    path = check_page_file(path)
    replace_file(path, replay_page(played).encode())
    return path


def replay_page(played: PlayedMission) -> str:
    """Return the page that :func:`replay` writes, as text.

    Parameters
    ----------
    played
        As for :func:`replay`, which also says what is raised.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.underway import play_mission
    >>> from botohe_moo.explorer import replay_page
    >>> toy = load_mission("toy")
    >>> replay_page(play_mission(toy, toy.stay_home(), price=2))[:15]
    '<!DOCTYPE html>'
    """
    return render(played.mission.title, replay_data(played), "replay.html.j2", _REPLAY_SCRIPTS)


def replay_data(played: PlayedMission) -> dict[str, Any]:
    """Compute the data of the page; its plans are those of the steps."""
    mission, steps = played.mission, played.steps
    number = {trail: i for i, trail in enumerate(dict.fromkeys(t for s in steps for t in s.trails))}
    plans = [[number[trail] for trail in step.trails] for step in steps]
    known = list(zip(plans, (step.lost for step in steps), strict=True))
    price = price_text(played.price)
    return {
        "about": d.sentence(
            f"Mission {played.number} of seed {played.seed}: {POLICIES[played.policy]}; {price}"
        ),
        "robots": mission.robots,
        **d.site_data(mission),
        "trails": [[mission.index(node) for node in trail] for trail in number],
        "plans": plans,
        "at": [step.at for step in steps],
        "lost": [step.lost for step in steps],
        "reached": [_codes(mission, step) for step in steps],
        "banked": d.number_texts(step.reward for step in steps),
        "said": [*map(d.sentence, played.sentences)],
        "told": [i for i in range(1, len(steps)) if known[i] != known[i - 1]],
    }


def _codes(mission: Mission, step: PlayedStep) -> list[int]:
    """Return codes of the nodes on the trails, by their indices: 0 for those not visited yet.

    Those of the others are shares of their rewards that count, or `LITTLE` where none does.
    """
    ways = zip(step.trails, step.at, strict=True)
    visited = {node for trail, at in ways for node in trail[: at + 1]}
    nodes = sorted({node for trail in step.trails for node in trail}, key=mission.index)
    pays = dict(zip(mission.nodes, mission.rewards.tolist(), strict=True))
    shares = [step.collected.get(node, 0.0) / (pays[node] or 1.0) for node in nodes]
    codes = zip(nodes, d.probability_codes(shares), strict=True)
    return [(code or d.LITTLE) if node in visited else 0 for node, code in codes]


SCRIPTS = ("data", "state", "front", "room", "map", "site", "strips", "tables", "files", "main")
_HEIGHT = 900  # pixels of a frame in a notebook
_NOTEBOOK_PLANS = 100  # few, since a notebook keeps the page of each output


def explore(
    front: Solution,
    path: str | os.PathLike[str],
    *,
    wishes: Iterable[str | Wish | Choice] = (),
    background: str | os.PathLike[str] | None = None,
) -> Path:
    """Write a page on which to walk along a front, look at its plans and compare them.

    One HTML file that needs no network: plans on the map of the site, their distributions of
    reward and survivors, differences between them, filters, and export of a plan.

    Parameters
    ----------
    front
        A solution.
    path
        File to write or to replace; ends in ``.html``.
    wishes
        For each of them the plan that :func:`botohe_moo.decide.choose` chooses is marked; wishes
        that are joined by ``and`` are to be met together. A choice is marked as it is.
    background
        File of a map of the site, YAML as for ROS's map server, to draw faintly behind the graph.
        Its origin and resolution are in the units of ``pos``.

    Returns
    -------
    pathlib.Path
        The file.

    Raises
    ------
    ValueError
        If there is no plan, a wish cannot be read, a choice is not of these plans, the ``pos`` of a
        node is not two finite numbers, the background cannot be read, there is one and not all
        nodes have positions, or the path ends otherwise.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> from botohe_moo import solve
    >>> from botohe_moo.explorer import explore
    >>> solution = solve("toy", "greedy", evaluations=100)
    >>> explore(solution, "front.html", wishes=["survivors >= 1.5"]).name
    'front.html'
    """
    path = check_page_file(path)
    replace_file(path, explorer_page(front, wishes=wishes, background=background).encode())
    return path


def check_page_file(path: str | os.PathLike[str]) -> Path:
    """Refuse a file name that does not end in ``.html``, or whose folder does not exist."""
    path = Path(path)
    check_suffix(path, (".html", ".htm"))
    check_file(path)
    return path


def explorer_page(
    front: Solution,
    *,
    wishes: Iterable[str | Wish | Choice] = (),
    background: str | os.PathLike[str] | None = None,
) -> str:
    """Return the page that :func:`explore` writes, as text.

    Fronts of more than 500 plans are thinned: the plans stay that dominate the most area alone,
    the ends, those that are marked, and those with which a chosen plan is compared. Where the exact
    distribution of a plan's reward takes too long, it is simulated, and the page says so.

    Parameters
    ----------
    front, wishes, background
        As for :func:`explore`, which also says what is raised.

    Examples
    --------
    >>> from botohe_moo import solve
    >>> from botohe_moo.explorer import explorer_page
    >>> page = explorer_page(solve("toy", "greedy", evaluations=100))
    >>> page[:15]
    '<!DOCTYPE html>'
    """
    return render(front.mission.title, d.page_data(front, wishes, background=background))


def render(
    title: str,
    data: Mapping[str, Any],
    template: str = "page.html.j2",
    scripts: Sequence[str] = SCRIPTS,
) -> str:
    """Return a page with its data."""
    packed = zlib.compress(json.dumps(data, separators=(",", ":"), allow_nan=False).encode(), 9)
    folder = files("botohe_moo.explorer")
    style = folder.joinpath("assets", "style.css").read_text("utf-8")
    library = folder.joinpath("vendor", "d3.min.js").read_text("utf-8")
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("botohe_moo.explorer", "assets"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
    )
    script = own_script(scripts)
    return environment.get_template(template).render(
        title=title,
        allowed_scripts=f"{_digest(library)} {_digest(script)}",
        allowed_style=_digest(style),
        style=style,
        library=library,
        script=script,
        data=base64.b64encode(packed).decode(),
    )


def own_script(scripts: Sequence[str] = SCRIPTS) -> str:
    """Join the modules of a page's script: one scope, which nothing outside can see."""
    folder = files("botohe_moo.explorer").joinpath("assets")
    parts = [folder.joinpath(f"{name}.js").read_text("utf-8") for name in scripts]
    return '(() => {\n"use strict";\n' + "\n".join(parts) + "})();\n"


def _digest(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def notebook_frame(front: Solution) -> str:
    """Return the HTML that shows the page in a notebook, in a frame that cannot reach out of it.

    Fronts of more than 100 plans are thinned.
    """
    data = d.page_data(front, max_plans=_NOTEBOOK_PLANS)
    page = html.escape(render(front.mission.title, data))
    return (
        f'<iframe srcdoc="{page}" sandbox="allow-scripts allow-downloads" title="explorer" '
        f'style="width: 100%; height: {_HEIGHT}px; border: 0"></iframe>'
    )
