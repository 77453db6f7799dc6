"""One plan as a file: JSON, waypoints as CSV, and GeoJSON."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Callable, Hashable
from pathlib import Path
from typing import Any

from botohe_moo._base.files import check_suffix, replace_file
from botohe_moo.mission.formats.nodelink import plain_label
from botohe_moo.mission.graphs import given_places
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.outcomes import reach_probabilities, team_reach
from botohe_moo.trails import TrailPlan

WAYPOINT_COLUMNS = ("robot", "step", "node", "x", "y")


def plan_json(mission: Mission, plan: TrailPlan) -> str:
    """Write a plan as JSON; ``mission.plan(json.loads(text)["trails"])`` gives an equal one.

    Keys are ``mission`` (its name), ``robots``, ``reward`` (E[R]), ``survivors`` (E[S]),
    ``robot_survival``, ``trail_lengths`` and ``trails`` (node labels), of each robot.

    Parameters
    ----------
    mission, plan
        A mission, and a plan of it.

    Raises
    ------
    ValueError
        If JSON cannot hold a label.
    PlanError
        If the plan is not valid for the mission.

    Examples
    --------
    >>> import json
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import plan_json
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1]])
    >>> text = plan_json(toy, plan)
    >>> toy.plan(json.loads(text)["trails"]) == plan
    True
    """
    ((reward, survivors),) = check_mission(mission).evaluate([plan]).tolist()
    content = {
        "mission": mission.name,
        "robots": mission.robots,
        "reward": reward,
        "survivors": survivors,
        "robot_survival": mission.robot_survival([plan])[0].tolist(),
        "trail_lengths": mission.trail_lengths([plan])[0].tolist(),
        "trails": [[plain_label(node) for node in trail] for trail in mission.labels(plan)],
    }
    return json.dumps(content, ensure_ascii=False, allow_nan=False, indent=1) + "\n"


def plan_csv(mission: Mission, plan: TrailPlan) -> str:
    """Write the waypoints of a plan as CSV: ``robot``, ``step``, ``node``, ``x``, ``y``.

    Robots and steps count from 0; step 0 is the base. Labels that are not text are written as JSON.
    ``x`` and ``y`` are empty for nodes without a position.

    Parameters
    ----------
    mission, plan
        As for :func:`plan_json`, which also says what is raised.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import plan_csv
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1]])
    >>> print(*plan_csv(toy, plan).splitlines()[:3], sep=chr(10))
    robot,step,node,x,y
    0,0,1,0.0,0.5
    0,1,2,0.5,1.0
    """
    check_mission(mission).evaluate([plan])
    places = given_places(mission.graph)
    text = io.StringIO(newline="")
    # The writer quotes what its end of a line has: with both signs, either of them in a label.
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(WAYPOINT_COLUMNS)
    for robot, trail in enumerate(mission.labels(plan)):
        for step, node in enumerate(trail):
            writer.writerow([robot, step, _cell(node), *(places[node] or ("", ""))])
    return text.getvalue()


def plan_geojson(mission: Mission, plan: TrailPlan) -> str:
    """Write a plan as GeoJSON: a line for each robot's trail, and a point for each visited node.

    Coordinates are the nodes' ``pos`` as they are; maps of the world take them for longitude and
    latitude (RFC 7946). A robot that stays at base has a point instead of a line. Lines have the
    properties ``robot``, ``survival`` and ``nodes``, points ``node``, ``reward`` and ``reached``,
    the probability that some robot reaches the node.

    Parameters
    ----------
    mission, plan
        As for :func:`plan_json`, which also says what is raised; also a ValueError if a visited
        node has no position.

    Examples
    --------
    >>> import json
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import plan_geojson
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1]])
    >>> [shape["geometry"]["type"] for shape in json.loads(plan_geojson(toy, plan))["features"]]
    ['LineString', 'Point', 'Point', 'Point', 'Point']
    """
    survival = check_mission(mission).robot_survival([plan])[0].tolist()
    reached = team_reach(reach_probabilities(mission, plan))
    places = given_places(mission.graph)
    trails = mission.labels(plan)
    visited = sorted({node for trail in trails for node in trail}, key=mission.index)
    if missing := [node for node in visited if places[node] is None]:
        raise ValueError(
            f"Node {missing[0]!r}: expected pos [x, y] for GeoJSON, found none; a .csv or .json "
            "file needs no positions."
        )
    features = []
    for robot, trail in enumerate(trails):
        line = [places[node] for node in trail]
        shape = ("LineString", line) if len(line) > 1 else ("Point", line[0])
        nodes = [plain_label(node) for node in trail]
        features.append(_feature(*shape, robot=robot, survival=survival[robot], nodes=nodes))
    for node in visited:
        known = {
            "node": plain_label(node),
            "reward": float(mission.graph.nodes[node]["reward"]),
            "reached": float(reached[mission.index(node)]),
        }
        features.append(_feature("Point", places[node], **known))
    content = {"type": "FeatureCollection", "features": features}
    return json.dumps(content, ensure_ascii=False, allow_nan=False, indent=1) + "\n"


PLAN_FORMATS: dict[str, Callable[[Mission, TrailPlan], str]] = {
    ".json": plan_json,
    ".csv": plan_csv,
    ".geojson": plan_geojson,
}


def write_plan(mission: Mission, plan: TrailPlan, path: str | os.PathLike[str]) -> None:
    """Write a plan to a file, in the format of its suffix; it appears complete, or not at all.

    Parameters
    ----------
    mission, plan
        As for :func:`plan_json`.
    path
        Ends in ``.json``, ``.csv`` or ``.geojson``.

    Raises
    ------
    ValueError
        If the suffix is another, or the format cannot hold the plan.
    PlanError
        If the plan is not valid for the mission.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import write_plan
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1]])
    >>> write_plan(toy, plan, "plan.csv")
    >>> Path("plan.csv").read_text().splitlines()[:2]
    ['robot,step,node,x,y', '0,0,1,0.0,0.5']
    """
    path = Path(path)
    check_suffix(path, PLAN_FORMATS)
    replace_file(path, PLAN_FORMATS[path.suffix.lower()](mission, plan).encode())


def _feature(kind: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    shape = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "geometry": shape, "properties": properties}


def _cell(node: Hashable) -> str:
    return node if isinstance(node, str) else json.dumps(plain_label(node), ensure_ascii=False)
