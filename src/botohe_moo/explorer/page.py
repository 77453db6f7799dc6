"""The page: one HTML file with its data, styles and scripts in it."""

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

from botohe_moo.base.files import check_parent, check_suffix, replace_file
from botohe_moo.decide import Choice
from botohe_moo.decide.wishes import Wish
from botohe_moo.explorer.data import page_data

if TYPE_CHECKING:
    from botohe_moo.solution import Solution

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
    check_parent(path)
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
    return render(front.mission.title, page_data(front, wishes, background=background))


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
    data = page_data(front, max_plans=_NOTEBOOK_PLANS)
    page = html.escape(render(front.mission.title, data))
    return (
        f'<iframe srcdoc="{page}" sandbox="allow-scripts allow-downloads" title="explorer" '
        f'style="width: 100%; height: {_HEIGHT}px; border: 0"></iframe>'
    )
