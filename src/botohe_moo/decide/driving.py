"""A plan as files that robots take: for the route server of Nav2, and for QGroundControl."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Sequence
from itertools import accumulate, pairwise
from operator import mul
from typing import Any

from botohe_moo.base.messages import check_choice, check_number, quoted
from botohe_moo.decide.robots import robot_rows
from botohe_moo.mission.formats.nodelink import plain_label
from botohe_moo.mission.formats.routes import write_route_graph
from botohe_moo.mission.hazards import places_of
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.trails import TrailPlan

_GRAPH = "graph.geojson"
_FRAME = "map"  # of nodes that name no other
# MAV_CMD_NAV_WAYPOINT, and heights above where the vehicle starts.
_WAYPOINT, _RELATIVE_TO_HOME, _RELATIVE_MODE = 16, 3, 1
_PX4 = 12  # as QGroundControl has it by default
# The MAV_TYPE that QGroundControl writes for each class; altitudes of those that do not fly.
VEHICLES = {"multicopter": 2, "fixed-wing": 1, "vtol": 20, "rover": 10, "boat": 11, "submarine": 12}
_ALTITUDES: dict[str, dict[str, float]] = {"rover": {}, "boat": {}, "submarine": {"at_most": 0.0}}
MULTICOPTER = "multicopter"


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
    rows = robot_rows(check_mission(mission), plan)
    files = {_GRAPH: write_route_graph(mission).decode()}
    features = [feature["properties"] for feature in json.loads(files[_GRAPH])["features"]]
    id_of = {node: of["id"] for node, of in zip(mission.nodes, features, strict=False)}
    edges = {(of["startid"], of["endid"]): of["id"] for of in features if "startid" in of}
    for row, nodes, chances in zip(rows, mission.labels(plan), _alive(mission, plan), strict=True):
        start, *others = _stops(mission, nodes)
        ids = [id_of[node] for node in nodes]
        legs = [
            {"edge": edges[ends], "start": ends[0], "goal": ends[1], "survival": chance, **stop}
            for ends, chance, stop in zip(pairwise(ids), chances, others, strict=True)
        ]
        content = {"mission": mission.name, **row, "start": {"id": ids[0], **start}, "legs": legs}
        files[f"robot_{row['robot']}.json"] = json_text(content)
    return files


def _alive(mission: Mission, plan: TrailPlan) -> list[list[float]]:
    """Return how likely each robot is still there after each of its arcs."""
    graph = mission.world.graph
    arcs = zip(graph.tail.tolist(), graph.head.tolist(), strict=True)
    survival = dict(zip(arcs, graph.survival.tolist(), strict=True))
    return [[*accumulate((survival[arc] for arc in pairwise(t)), mul)] for t in plan.trails]


def _stops(mission: Mission, nodes: Sequence[Any]) -> list[dict[str, Any]]:
    """Return labels, frames and poses; a robot faces where it goes from the node before."""
    places = places_of(mission.graph.nodes)
    at = [places[node] for node in nodes]  # none lacks one: the graph is written
    ways = [(x2 - x1, y2 - y1) for (x1, y1), (x2, y2) in pairwise(at)]
    stops = []
    for node, (x, y), way in zip(nodes, at, [*ways[:1], *ways] or [(1.0, 0.0)], strict=True):
        half = math.atan2(way[1], way[0]) / 2
        turn = {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)}
        pose = {"position": {"x": x, "y": y, "z": 0.0}, "orientation": turn}
        frame = str(mission.graph.nodes[node].get("frame") or _FRAME)
        stops.append({"node": plain_label(node), "frame": frame, "pose": pose})
    return stops


def altitude_of(vehicle: str, altitude: float | None) -> float:
    """Return a checked altitude of waypoints, by default 0 for vehicles that stay on a surface."""
    check_choice("vehicle", vehicle, VEHICLES)
    allowed = _ALTITUDES.get(vehicle, {"above": 0.0})
    if altitude is None and not allowed:
        return 0.0
    return check_number(f"altitude (of a {vehicle}, in metres)", altitude, **allowed)


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
        If a node on a trail has no longitude and latitude, the vehicle is unknown, or the altitude
        is not one of that vehicle.
    PlanError
        If the plan is not valid for the mission.

    Warns
    -----
    UserWarning
        If the graph of the mission has no attribute ``geographic`` that is true.

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
    height = altitude_of(vehicle, altitude)
    check_mission(mission).evaluate([plan])
    if not mission.graph.graph.get("geographic"):
        warnings.warn(
            "Positions are taken for longitudes and latitudes: set the graph attribute geographic "
            "to true if they are.",
            stacklevel=2,
        )
    places = places_of(mission.graph.nodes)
    files = {}
    for robot, trail in enumerate(mission.labels(plan)):
        at = [_on_earth(node, places.get(node)) for node in trail]
        if len(at) > 1:
            files[robot] = _qgc_plan(at, height, VEHICLES[vehicle])
    return files


def _on_earth(node: Any, place: tuple[float, float] | None) -> list[float]:
    """Return latitude and longitude."""
    if place is None or abs(place[0]) > 180 or abs(place[1]) > 90:
        found = "none" if place is None else quoted([*place])
        raise ValueError(
            f"Node {quoted(node)}: expected pos [longitude, latitude] in degrees, found {found}."
        )
    return [place[1], place[0]]


def _qgc_plan(at: Sequence[list[float]], altitude: float, vehicle_type: int) -> str:
    """Write a file in the format of QGroundControl, version 1, with a mission of version 2."""
    items = [
        {
            "type": "SimpleItem",
            "command": _WAYPOINT,
            "frame": _RELATIVE_TO_HOME,
            "params": [0, 0, 0, None, *place, altitude],
            "AltitudeMode": _RELATIVE_MODE,
            "Altitude": altitude,
            "AMSLAltAboveTerrain": None,
            "autoContinue": True,
            "doJumpId": number,
        }
        for number, place in enumerate(at[1:], 1)
    ]
    return json_text(
        {
            "fileType": "Plan",
            "version": 1,
            "groundStation": "QGroundControl",
            "geoFence": {"circles": [], "polygons": [], "version": 2},
            "rallyPoints": {"points": [], "version": 2},
            "mission": {
                "version": 2,
                "firmwareType": _PX4,
                "vehicleType": vehicle_type,
                "globalPlanAltitudeMode": _RELATIVE_MODE,
                "cruiseSpeed": 15,
                "hoverSpeed": 5,
                "plannedHomePosition": [*at[0], 0],
                "items": items,
            },
        }
    )


def json_text(content: dict[str, Any]) -> str:
    """Write a file of a plan as JSON; a ValueError is raised for what JSON cannot hold."""
    return json.dumps(content, ensure_ascii=False, allow_nan=False, indent=1) + "\n"
