"""One plan as files: JSON, waypoints as CSV, GeoJSON, and what robots take.

Robots take files for the route server of Nav2, and for QGroundControl.
"""

from __future__ import annotations

import csv
import glob
import io
import json
import math
import os
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import FiniteFloat

from botohe_moo import outcomes
from botohe_moo.base import files as f
from botohe_moo.base.messages import check_choice, quoted
from botohe_moo.base.parameters import check
from botohe_moo.mission.formats.graphs import as_json, plain_label
from botohe_moo.mission.formats.routes import write_route_graph
from botohe_moo.mission.hazards import places_of
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.trails import TrailPlan

if TYPE_CHECKING:
    import pandas as pd

# The MAV_TYPE that QGroundControl writes for each class of vehicles.
VEHICLES = {"multicopter": 2, "fixed-wing": 1, "vtol": 20, "rover": 10, "boat": 11, "submarine": 12}
MULTICOPTER = "multicopter"
# Altitudes, which are above 0 for vehicles that fly.
_ALTITUDES: dict[str, dict[str, int]] = {"rover": {}, "boat": {}, "submarine": {"le": 0}}
# QGroundControl's defaults; its format of plans is version 1, missions are version 2, for PX4 (12).
# Waypoints (MAV_CMD_NAV_WAYPOINT, 16) have heights above the start (MAV_FRAME_GLOBAL_RELATIVE_ALT).
_QGC = json.loads(Path(__file__).with_name("qgroundcontrol.json").read_text("utf-8"))


def robot_table(mission: Mission, plan: TrailPlan) -> pd.DataFrame:
    """Return what each robot of a plan risks, and what it brings.

    Parameters
    ----------
    mission, plan
        A mission, and a plan of it; a PlanError is raised if it is not valid.

    Returns
    -------
    pandas.DataFrame
        A row for each robot: ``robot``, its number from 0; ``kind``, the name of its kind;
        ``survival``, the probability that it survives; ``length`` of its trail; and ``reward``, the
        E[R] of this robot alone. Robots that collect the same rewards bring less together.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import robot_table
    >>> toy = load_mission("toy")
    >>> robot_table(toy, toy.plan([[1, 2, 4, 2, 1], [1]])).round(3)
       robot   kind  survival  length  reward
    0      0  robot     0.656     4.0    3.24
    1      1  robot     1.000     0.0    0.00
    """
    import pandas as pd

    return pd.DataFrame(_robot_columns(mission, plan))


def _robot_columns(mission: Mission, plan: TrailPlan) -> dict[str, Sequence[Any]]:
    return {
        "robot": range(check_mission(mission).robots),
        "kind": [kind.name for kind in mission.kind_of],
        "survival": mission.robot_survival([plan])[0].tolist(),
        "length": mission.trail_lengths([plan])[0].tolist(),
        "reward": outcomes.rewards_alone(mission, plan).tolist(),
    }


def plan_json(mission: Mission, plan: TrailPlan) -> str:
    """Write a plan as JSON; ``mission.plan(json.loads(text)["trails"])`` gives an equal one.

    Keys are ``mission`` (its name), ``robots``, ``reward`` (E[R]), ``survivors`` (E[S]),
    and of each robot ``robot_kinds`` (names), ``robot_survival``, ``trail_lengths``,
    ``robot_rewards`` (the E[R] of each alone) and ``trails`` (node labels).

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
    robots = _robot_columns(mission, plan)
    content = {
        "mission": mission.name,
        "robots": mission.robots,
        "reward": reward,
        "survivors": survivors,
        "robot_kinds": robots["kind"],
        "robot_survival": robots["survival"],
        "trail_lengths": robots["length"],
        "robot_rewards": robots["reward"],
        "trails": [[*map(plain_label, trail)] for trail in mission.labels(plan)],
    }
    return _json_text(content)


def plan_csv(mission: Mission, plan: TrailPlan) -> str:
    """Write the waypoints of a plan as CSV: ``robot``, ``kind``, ``step``, ``node``, ``x``, ``y``.

    Robots and steps count from 0; step 0 is where a robot starts. Labels that are not text are
    written as JSON. ``x`` and ``y`` are empty for nodes without a position.

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
    robot,kind,step,node,x,y
    0,robot,0,1,0.0,0.5
    0,robot,1,2,0.5,1.0
    """
    check_mission(mission).evaluate([plan])
    places = places_of(mission.graph.nodes)
    text = io.StringIO(newline="")
    # The writer quotes what its end of a line has: with both signs, either of them in a label.
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(["robot", "kind", "step", "node", "x", "y"])
    for robot, trail in enumerate(mission.labels(plan)):
        kind = mission.kind_of[robot].name
        for step, node in enumerate(trail):
            label = node if isinstance(node, str) else as_json(plain_label(node))
            writer.writerow([robot, kind, step, label, *places.get(node, ("", ""))])
    return text.getvalue()


def plan_geojson(mission: Mission, plan: TrailPlan) -> str:
    """Write a plan as GeoJSON: a line for each robot's trail, and a point for each visited node.

    Coordinates are the nodes' ``pos`` as they are; maps of the world take them for longitude and
    latitude (RFC 7946). A robot that stays at base has a point instead of a line. Lines have the
    columns of :func:`robot_table` and ``nodes``, points ``node``, ``reward``, ``reached``, the
    probability that some robot reaches the node, and ``collected``, that its reward is collected.

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
    robots = _robot_columns(mission, plan)
    chances = outcomes.reach_probabilities, outcomes.collect_probabilities
    reached, collected = (outcomes.team_chances(of, mission, plan).tolist() for of in chances)
    places, trails = places_of(mission.graph.nodes), mission.labels(plan)
    visited = sorted({node for trail in trails for node in trail}, key=mission.index)
    if missing := [node for node in visited if node not in places]:
        raise ValueError(f"Node {missing[0]!r}: expected pos [x, y] for GeoJSON, found none.")
    features = []
    for robot, trail in enumerate(trails):
        line = [places[node] for node in trail]
        shape, at = ("LineString", line) if len(line) > 1 else ("Point", line[0])
        known = {name: column[robot] for name, column in robots.items()}
        features.append(_feature(shape, at, known | {"nodes": [*map(plain_label, trail)]}))
    for node in visited:
        i = mission.index(node)
        pays = float(mission.rewards[i])
        known = {"node": plain_label(node), "reward": pays}
        known |= {"reached": reached[i], "collected": collected[i]}
        features.append(_feature("Point", places[node], known))
    return _json_text({"type": "FeatureCollection", "features": features})


def _feature(shape_type: str, coordinates: Any, properties: dict[str, Any]) -> dict[str, Any]:
    shape = {"type": shape_type, "coordinates": coordinates}
    return {"type": "Feature", "geometry": shape, "properties": properties}


def _json_text(content: dict[str, Any]) -> str:
    """Write a file of a plan as JSON; a ValueError is raised for what JSON cannot hold."""
    return json.dumps(content, ensure_ascii=False, allow_nan=False, indent=1) + "\n"


def nav2_files(mission: Mission, plan: TrailPlan) -> dict[str, str]:
    """Write a plan for robots that drive with Nav2.

    ``graph.geojson`` is the route graph for its route server, as :func:`botohe_moo.save_mission`
    writes it. ``robot_0.json`` and so on hold the name of the ``mission``, a row of
    :func:`robot_table`, the node ``start`` and the ``legs``, one for each arc of the trail: the id
    of the ``edge``, the ids of its nodes ``start`` and ``goal``, and ``survival``, the probability
    that the robot is still there after it. Start and legs have ``node``, the label of where the
    robot is then, its ``frame`` (default: map), and the ``pose``, as a ``geometry_msgs/Pose``, that
    faces along the leg. A robot that stays has no legs.

    Parameters
    ----------
    mission, plan
        A mission whose nodes have ``pos``, and a plan of it.

    Returns
    -------
    dict
        The content of each file, by its name.

    Raises
    ------
    ValueError
        If a node has no position.
    PlanError
        If the plan is not valid for the mission.

    Examples
    --------
    >>> import json
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import nav2_files
    >>> toy = load_mission("toy")
    >>> files = nav2_files(toy, toy.plan([[1, 2, 4, 2, 1], [1]]))
    >>> list(files)
    ['graph.geojson', 'robot_0.json', 'robot_1.json']
    >>> [leg["goal"] for leg in json.loads(files["robot_0.json"])["legs"]]
    [2, 4, 2, 1]
    """
    robots = _robot_columns(mission, plan)
    files = {"graph.geojson": write_route_graph(mission).decode()}
    features = [of["properties"] for of in json.loads(files["graph.geojson"])["features"]]
    id_of = {node: of["id"] for node, of in zip(mission.nodes, features, strict=False)}
    edges = {(of["startid"], of["endid"]): of["id"] for of in features if "startid" in of}
    graph = mission.world.graph
    ends = zip(graph.tail.tolist(), graph.head.tolist(), strict=True)
    survival = dict(zip(ends, graph.survival.T, strict=True))  # in each scenario
    for robot, (nodes, trail) in enumerate(zip(mission.labels(plan), plan.trails, strict=True)):
        start, *stops = _stops(mission, nodes)
        on_arcs = np.array([survival[arc] for arc in pairwise(trail)])
        alive = on_arcs.reshape(-1, graph.n_scenarios).cumprod(axis=0) @ graph.probability
        ways = zip(pairwise(map(id_of.get, nodes)), alive.tolist(), stops, strict=True)
        legs = [
            {"edge": edges[ends], "start": ends[0], "goal": ends[1], "survival": chance, **stop}
            for ends, chance, stop in ways
        ]
        content = {"mission": mission.name}
        content |= {name: column[robot] for name, column in robots.items()}
        content |= {"start": {"id": id_of[nodes[0]], **start}, "legs": legs}
        files[f"robot_{robot}.json"] = _json_text(content)
    return files


def _stops(mission: Mission, nodes: Sequence[Any]) -> list[dict[str, Any]]:
    """Return labels, frames and poses; a robot faces where it goes from the node before."""
    places = places_of(mission.graph.nodes)
    at = [places[node] for node in nodes]  # none lacks one: the graph is written
    ways = [math.atan2(y2 - y1, x2 - x1) for (x1, y1), (x2, y2) in pairwise(at)]
    stops = []
    for node, (x, y), way in zip(nodes, at, [*ways[:1], *ways] or [0.0], strict=True):
        turn = {"x": 0.0, "y": 0.0, "z": math.sin(way / 2), "w": math.cos(way / 2)}
        pose = {"position": {"x": x, "y": y, "z": 0.0}, "orientation": turn}
        frame = str(mission.graph.nodes[node].get("frame") or "map")
        stops.append({"node": plain_label(node), "frame": frame, "pose": pose})
    return stops


def _altitude(vehicle: str, altitude: float | None) -> float:
    """Return a checked altitude of waypoints, by default 0 for vehicles that stay on a surface."""
    check_choice("vehicle", vehicle, VEHICLES)
    allowed = _ALTITUDES.get(vehicle, {"gt": 0})
    if altitude is None and allowed:
        what = f"an altitude for the {vehicle}, in metres (--altitude)"
        raise ValueError(f"Expected {what}, got none.")
    if altitude is None:
        return 0.0
    return float(check(f"altitude (of a {vehicle}, in metres)", altitude, FiniteFloat, **allowed))


def check_geographic(mission: Mission) -> None:
    """Refuse a mission whose positions are not said to be longitudes and latitudes."""
    if not mission.graph.graph.get("geographic"):
        how = "graph attribute geographic, or -m geographic=true"
        expected = f"a mission whose positions are longitudes and latitudes ({how})"
        raise ValueError(f"Expected {expected}; {mission.name!r} does not say so.")


def qgc_plans(
    mission: Mission, plan: TrailPlan, *, altitude: float | None = None, vehicle: str = MULTICOPTER
) -> dict[int, str]:
    """Write a plan for vehicles that QGroundControl plans for: a ``.plan`` each.

    It has a waypoint for each node of a trail but the first, which is the planned home position.
    Take-off and landing, which depend on the vehicle, are added in QGroundControl. Its developer
    guide describes the `format
    <https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html>`__:
    ``vehicleType`` is a ``MAV_TYPE`` of MAVLink, and all plans have both ``hoverSpeed``, for
    multicopters, and ``cruiseSpeed``. Both are QGroundControl's defaults here.

    Parameters
    ----------
    mission, plan
        A mission whose nodes have ``pos`` [longitude, latitude], in degrees, and a plan of it.
    altitude
        Height of waypoints above the home position, in metres: above 0 for vehicles that fly, and
        at most 0 for a submarine, as ArduSub expects it. A rover and a boat need none; their
        autopilots ignore it.
    vehicle
        ``"multicopter"``, ``"fixed-wing"``, ``"vtol"``, ``"rover"``, ``"boat"`` or ``"submarine"``.

    Returns
    -------
    dict
        The content of a file for each robot that leaves where it starts, by its number from 0.

    Raises
    ------
    ValueError
        If the graph of the mission has no attribute ``geographic`` that is true, a node on a trail
        has no longitude and latitude, the vehicle is unknown, or the altitude is not one of that
        vehicle.
    PlanError
        If the plan is not valid for the mission.

    Examples
    --------
    >>> import json
    >>> from botohe_moo import Mission, load_mission
    >>> from botohe_moo.decide import qgc_plans
    >>> graph = load_mission("toy").graph.copy()
    >>> graph.graph["geographic"] = True  # its places are longitudes and latitudes
    >>> toy = Mission(graph)
    >>> files = qgc_plans(toy, toy.plan([[1, 2, 4, 2, 1], [1]]), altitude=30)
    >>> [item["params"][4:] for item in json.loads(files[0])["mission"]["items"]]
    [[1.0, 0.5, 30.0], [0.5, 1.0, 30.0], [1.0, 0.5, 30.0], [0.5, 0.0, 30.0]]
    """
    height = _altitude(vehicle, altitude)
    check_mission(mission).evaluate([plan])
    check_geographic(mission)
    files, places = {}, places_of(mission.graph.nodes)
    for robot, trail in enumerate(mission.labels(plan)):
        home, *stops = (_on_earth(node, places.get(node)) for node in trail)
        params = ([0, 0, 0, None, *at, height] for at in stops)
        items = [
            {**_QGC["item"], "params": of, "Altitude": height, "doJumpId": i}
            for i, of in enumerate(params, 1)
        ]
        own = {"vehicleType": VEHICLES[vehicle], "plannedHomePosition": [*home, 0], "items": items}
        if items:
            files[robot] = _json_text({**_QGC["plan"], "mission": {**_QGC["mission"], **own}})
    return files


def _on_earth(node: Any, place: tuple[float, float] | None) -> list[float]:
    """Return latitude and longitude."""
    if place is None or abs(place[0]) > 180 or abs(place[1]) > 90:
        expected = "expected pos [longitude, latitude] in degrees"
        raise ValueError(f"Node {quoted(node)}: {expected}, found {place}.")
    return [place[1], place[0]]


_TEXTS = {".json": plan_json, ".csv": plan_csv, ".geojson": plan_geojson}


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
        folder, which is made, for the files of :func:`nav2_files`. A ``.plan`` is for one robot:
        ``site-0.plan`` and so on are written for ``site.plan``, but for robots that stay. Files of
        an earlier plan are replaced.
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
    ['robot,kind,step,node,x,y', '0,robot,0,1,0.0,0.5']
    >>> [file.name for file in write_plan(toy, plan, "nav2")]
    ['graph.geojson', 'robot_0.json', 'robot_1.json']
    """
    path = Path(path)
    check_plan_path(path, altitude, vehicle)
    suffix = path.suffix.lower()
    beside: set[Path] = set()  # files of other robots
    if suffix == ".plan":
        plans = qgc_plans(mission, plan, altitude=altitude, vehicle=vehicle)
        if not plans:
            raise ValueError(f"{path}: expected a robot that leaves where it starts, found none.")
        texts = {path.with_name(f"{path.stem}-{i}{path.suffix}"): plans[i] for i in plans}
        beside = {*path.parent.glob(f"{glob.escape(path.stem)}-[0-9]*{path.suffix}")}
    elif suffix:
        texts = {path: _TEXTS[suffix](mission, plan)}
    else:
        texts = {path / name: text for name, text in nav2_files(mission, plan).items()}
        beside = {*path.glob("robot_*.json")}
        path.mkdir(parents=True, exist_ok=True)
    if others := sorted(beside - {*texts}):
        raise FileExistsError(f"{others[0]}: a file of another plan; give another name.")
    for file in texts:  # all of them before any is written
        f.check_file(file)
    for file, text in texts.items():
        f.replace_file(file, text.encode())
    return tuple(texts)


def check_plan_path(
    path: Path, altitude: float | None, vehicle: str, pictures: Sequence[str] = ()
) -> None:
    """Refuse a path that no plan can be written to, and an altitude that a ``.plan`` cannot have.

    ``pictures`` are suffixes that are right, too.
    """
    if path.suffix:
        f.check_suffix(path, (*_TEXTS, ".plan", *pictures))
        f.check_file(path)
    else:
        f.check_folder(path)
    if path.suffix.lower() == ".plan":
        _altitude(vehicle, altitude)
    elif altitude is not None or vehicle != MULTICOPTER:
        raise ValueError(f"{path}: expected altitude and vehicle with a .plan only.")
