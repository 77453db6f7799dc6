"""One plan as files: JSON, waypoints as CSV, GeoJSON, and what robots take."""

from __future__ import annotations

import csv
import glob
import io
import json
import os
from collections.abc import Callable, Hashable, Sequence
from pathlib import Path
from typing import Any

from botohe_moo.base.files import check_file, check_folder, check_suffix, replace_file
from botohe_moo.decide.driving import MULTICOPTER, altitude_of, json_text, nav2_files, qgc_plans
from botohe_moo.decide.robots import robot_rows
from botohe_moo.mission.formats.nodelink import plain_label
from botohe_moo.mission.hazards import places_of
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.outcomes import collect_probabilities, reach_probabilities, team_reach
from botohe_moo.trails import TrailPlan

WAYPOINT_COLUMNS = ("robot", "step", "node", "x", "y")


def plan_json(mission: Mission, plan: TrailPlan) -> str:
    """Write a plan as JSON; ``mission.plan(json.loads(text)["trails"])`` gives an equal one.

    Keys are ``mission`` (its name), ``robots``, ``reward`` (E[R]), ``survivors`` (E[S]),
    ``robot_survival``, ``trail_lengths`` and ``trails`` (node labels), of each robot. With several
    kinds of robots, or rewards on return, also ``robot_kinds`` (names) and ``robot_rewards``, the
    E[R] of each robot alone.

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
    rows = _more_of_robots(mission, plan)
    content = {
        "mission": mission.name,
        "robots": mission.robots,
        "reward": reward,
        "survivors": survivors,
        "robot_survival": mission.robot_survival([plan])[0].tolist(),
        "trail_lengths": mission.trail_lengths([plan])[0].tolist(),
        **{f"robot_{of}s": [row[of] for row in rows] for of in ("kind", "reward") if of in rows[0]},
        "trails": [[plain_label(node) for node in trail] for trail in mission.labels(plan)],
    }
    return json_text(content)


def plan_csv(mission: Mission, plan: TrailPlan) -> str:
    """Write the waypoints of a plan as CSV: ``robot``, ``step``, ``node``, ``x``, ``y``.

    Robots and steps count from 0; step 0 is where a robot starts. Labels that are not text are
    written as JSON. ``x`` and ``y`` are empty for nodes without a position. With several kinds of
    robots there is also the column ``kind``.

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
    places = places_of(mission.graph.nodes)
    text = io.StringIO(newline="")
    # The writer quotes what its end of a line has: with both signs, either of them in a label.
    writer = csv.writer(text, lineterminator="\r\n")
    several = len(mission.kinds) > 1
    writer.writerow([*WAYPOINT_COLUMNS, *(["kind"] if several else [])])
    for robot, trail in enumerate(mission.labels(plan)):
        kind = [mission.kind_of[robot].name] if several else []
        for step, node in enumerate(trail):
            writer.writerow([robot, step, _cell(node), *places.get(node, ("", "")), *kind])
    return text.getvalue()


def plan_geojson(mission: Mission, plan: TrailPlan) -> str:
    """Write a plan as GeoJSON: a line for each robot's trail, and a point for each visited node.

    Coordinates are the nodes' ``pos`` as they are; maps of the world take them for longitude and
    latitude (RFC 7946). A robot that stays at base has a point instead of a line. Lines have the
    properties ``robot``, ``survival`` and ``nodes``, points ``node``, ``reward`` and ``reached``,
    the probability that some robot reaches the node. With several kinds of robots, or rewards on
    return, lines also have ``kind``, ``length`` and ``reward``, the E[R] of the robot alone, and
    points ``collected``, the probability that the node's reward is collected.

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
    collected = team_reach(collect_probabilities(mission, plan))
    rows = _more_of_robots(mission, plan)
    places = places_of(mission.graph.nodes)
    trails = mission.labels(plan)
    visited = sorted({node for trail in trails for node in trail}, key=mission.index)
    if missing := [node for node in visited if node not in places]:
        raise ValueError(
            f"Node {missing[0]!r}: expected pos [x, y] for GeoJSON, found none; a .csv or .json "
            "file needs no positions."
        )
    features = []
    for robot, trail in enumerate(trails):
        line = [places[node] for node in trail]
        shape, at = ("LineString", line) if len(line) > 1 else ("Point", line[0])
        nodes = [plain_label(node) for node in trail]
        known = {"robot": robot, "survival": survival[robot], "nodes": nodes, **rows[robot]}
        features.append(_feature(shape, at, known))
    for node in visited:
        known = {
            "node": plain_label(node),
            "reward": float(mission.graph.nodes[node]["reward"]),
            "reached": float(reached[mission.index(node)]),
        }
        if not mission.is_plain:
            known["collected"] = float(collected[mission.index(node)])
        features.append(_feature("Point", places[node], known))
    content = {"type": "FeatureCollection", "features": features}
    return json_text(content)


_TEXTS: dict[str, Callable[[Mission, TrailPlan], str]] = {
    ".json": plan_json,
    ".csv": plan_csv,
    ".geojson": plan_geojson,
}
_QGC = ".plan"
_SUFFIXES = (*_TEXTS, _QGC)


def write_plan(
    mission: Mission,
    plan: TrailPlan,
    path: str | os.PathLike[str],
    *,
    altitude: float | None = None,
    vehicle: str = MULTICOPTER,
) -> tuple[Path, ...]:
    """Write a plan to files, in the format of the path; each appears complete, or not at all.

    Parameters
    ----------
    mission, plan
        As for :func:`plan_json`.
    path
        Ends in ``.json``, ``.csv``, ``.geojson`` or ``.plan``, or has no suffix: then it is a
        folder, which is made, for the files of :func:`nav2_files`. A ``.plan`` is for one robot: of
        a team, ``site-0.plan`` and so on are written for ``site.plan``, but for robots that stay.
    altitude, vehicle
        Height of waypoints in a ``.plan``, and for which vehicle it is, as for :func:`qgc_plans`;
        for it alone.

    Returns
    -------
    tuple of pathlib.Path
        The files.

    Raises
    ------
    ValueError
        If the suffix is another, the format cannot hold the plan, ``altitude`` is missing or not
        one of the vehicle, or the vehicle is unknown.
    PlanError
        If the plan is not valid for the mission.
    OSError
        If a file cannot be written, or the folder holds files of more robots.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import write_plan
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1]])
    >>> [file] = write_plan(toy, plan, "plan.csv")
    >>> file.read_text().splitlines()[:2]
    ['robot,step,node,x,y', '0,0,1,0.0,0.5']
    >>> [file.name for file in write_plan(toy, plan, "nav2")]
    ['graph.geojson', 'robot_0.json', 'robot_1.json']
    """
    path = Path(path)
    check_plan_path(path, altitude, vehicle)
    texts = _texts(mission, plan, path, altitude, vehicle)
    if not path.suffix:
        path.mkdir(parents=True, exist_ok=True)
    for file in texts:  # all of them before any is written
        check_file(file)
    for file, text in texts.items():
        replace_file(file, text.encode())
    return tuple(texts)


def check_plan_path(
    path: Path, altitude: float | None, vehicle: str, pictures: Sequence[str] = ()
) -> None:
    """Refuse a path that no plan can be written to, and an altitude that a ``.plan`` cannot have.

    ``pictures`` are suffixes that are right, too.
    """
    if path.suffix:
        check_suffix(path, (*_SUFFIXES, *pictures))
        check_file(path)
    else:
        check_folder(path)
    if path.suffix.lower() == _QGC:
        altitude_of(vehicle, altitude)
    elif altitude is not None or vehicle != MULTICOPTER:
        raise ValueError(f"{path}: expected altitude and vehicle with a .plan only.")


def _texts(
    mission: Mission, plan: TrailPlan, path: Path, altitude: float | None, vehicle: str
) -> dict[Path, str]:
    """Return what is to be written, by file."""
    suffix = path.suffix.lower()
    if suffix in _TEXTS:
        return {path: _TEXTS[suffix](mission, plan)}
    if suffix == _QGC:
        plans = qgc_plans(mission, plan, altitude=altitude, vehicle=vehicle)
        if not plans:
            raise ValueError(f"{path}: expected a robot that leaves where it starts, found none.")
        numbered = {
            path.with_name(f"{path.stem}-{robot}{path.suffix}"): text
            for robot, text in plans.items()
        }
        files = numbered if mission.robots > 1 else {path: plans[0]}
        beside = path.parent.glob(f"{glob.escape(path.stem)}-[0-9]*{path.suffix}")
    else:
        files = {path / name: text for name, text in nav2_files(mission, plan).items()}
        beside = path.glob("robot_*.json")
    if others := sorted({*beside} - {*files}):
        raise FileExistsError(f"{others[0]}: a file of another plan; give another name.")
    return files


def _more_of_robots(mission: Mission, plan: TrailPlan) -> list[dict[str, Any]]:
    """Return what is written of each robot only if there are kinds, or rewards on return."""
    if mission.is_plain:
        return [{}] * mission.robots
    names = ["kind", "length", "reward"][len(mission.kinds) == 1 :]
    return [{name: row[name] for name in names} for row in robot_rows(mission, plan)]


def _feature(shape_type: str, coordinates: Any, properties: dict[str, Any]) -> dict[str, Any]:
    shape = {"type": shape_type, "coordinates": coordinates}
    return {"type": "Feature", "geometry": shape, "properties": properties}


def _cell(node: Hashable) -> str:
    return node if isinstance(node, str) else json.dumps(plain_label(node), ensure_ascii=False)
