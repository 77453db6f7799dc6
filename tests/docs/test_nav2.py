"""The script that drives a plan, with a stub of the interface of Nav2 that it uses."""

import json
import os
import re
import subprocess
import sys

import networkx as nx
import pytest

from botohe_moo import Mission
from botohe_moo.decide import write_plan
from tests.docs.guides import DOCS

SCRIPT = DOCS / "examples" / "nav2" / "drive.py"
# The router finds the cheapest way by length and penalty, as the route server scores edges.
NAVIGATOR = """
import enum
import json
import os
from types import SimpleNamespace

import networkx as nx

TaskResult = enum.Enum("TaskResult", "UNKNOWN SUCCEEDED CANCELED FAILED", start=0)
BLOCKED, REFUSED = json.loads(os.environ["BLOCKED"]), json.loads(os.environ["REFUSED"])
WEIGHT = float(os.environ["WEIGHT"])


class BasicNavigator:
    def __init__(self, node_name="basic_navigator", namespace=""):
        self.graph = nx.DiGraph()
        for feature in json.load(open(os.environ["GRAPH"]))["features"]:
            edge = feature["properties"]
            if "startid" in edge:
                cost = edge["metadata"]["length"] + WEIGHT * edge["metadata"]["penalty"]
                self.graph.add_edge(edge["startid"], edge["endid"], cost=cost, id=edge["id"])
        self.log("namespace", namespace)

    def log(self, *what):
        with open(os.environ["LOG"], "a") as file:
            print(json.dumps(what), file=file)

    def get_clock(self):
        return SimpleNamespace(now=lambda: SimpleNamespace(to_msg=lambda: 12))

    def setInitialPose(self, initial_pose):
        at = initial_pose.pose.position
        self.log("setInitialPose", initial_pose.header.frame_id, at.x, at.y)

    def waitUntilNav2Active(self, navigator="bt_navigator", localizer="amcl"):
        self.log("waitUntilNav2Active")

    def getRoute(self, start, goal, use_start=False):
        way = nx.shortest_path(self.graph, start, goal, weight="cost")
        edges = [
            SimpleNamespace(edgeid=self.graph.edges[ends]["id"]) for ends in zip(way, way[1:])
        ]
        return [way, SimpleNamespace(edges=edges)]

    def followPath(self, path, controller_id="", goal_checker_id=""):
        self.log("followPath", *path)
        return self.begin(path[-1])

    def goToPose(self, pose, behavior_tree=""):
        at = pose.pose.position
        self.log("goToPose", at.x, at.y)
        return self.begin(None)

    def begin(self, goal):
        if goal in REFUSED:
            return False  # and the task before stays what getResult is about
        self.failed, self.polls = goal in BLOCKED, 0
        return True

    def isTaskComplete(self):
        self.polls += 1
        return self.polls > 2

    def getResult(self):
        return TaskResult.FAILED if self.failed else TaskResult.SUCCEEDED
"""


@pytest.fixture
def driven(tmp_path):
    """Drives the plan of a robot around a pond; returns what came of it, and what Nav2 was told."""
    graph = nx.DiGraph(base="dock", robots=2)
    for label, *place in [("dock", 0, 0), ("jetty", 4, 0), ("reed", 4, 3), ("hut", 0, 3)]:
        graph.add_node(label, reward=1.0, pos=place, frame="pond")
    nx.add_cycle(graph, ["dock", "jetty", "reed", "hut"], survival=0.9, length=3.0)
    graph.add_edge("dock", "reed", survival=0.5, length=5.0)  # the router goes by the jetty
    mission = Mission(graph, name="pond")
    plan = mission.plan([["dock", "reed", "hut", "dock"], ["dock"]])
    write_plan(mission, plan, tmp_path / "nav2")
    stubs = tmp_path / "stubs"
    guide = (DOCS / "robots.md").read_text("utf-8")
    [weight] = re.findall(r"PenaltyScorer:\n.*\n +weight: ([0-9.]+)", guide)
    for path, text in [
        ("rclpy/__init__.py", "def init(): ...\ndef shutdown(): ...\n"),
        ("geometry_msgs/msg.py", "from unittest.mock import MagicMock as PoseStamped\n"),
        ("nav2_simple_commander/robot_navigator.py", NAVIGATOR),
    ]:
        (stubs / path).parent.mkdir(parents=True)
        (stubs / path).write_text(text)

    def drive(robot, *options, blocked=(), refused=()):
        told = tmp_path / "told"
        own = {
            "PYTHONPATH": str(stubs),
            "GRAPH": str(tmp_path / "nav2" / "graph.geojson"),
            "LOG": str(told),
            "BLOCKED": json.dumps(blocked),
            "REFUSED": json.dumps(refused),
            "WEIGHT": weight,
        }
        command = [sys.executable, SCRIPT, tmp_path / "nav2" / f"robot_{robot}.json", *options]
        ended = subprocess.run(command, env=os.environ | own, capture_output=True, text=True)
        return ended, [json.loads(line) for line in told.read_text().splitlines()]

    return drive


def test_a_trail_is_driven_leg_by_leg(driven):
    ended, told = driven(0, "--namespace", "rover")
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout.splitlines() == [
        f"Robot 0 is at {node}." for node in ("reed", "hut", "dock")
    ]
    assert told == [
        ["namespace", "rover"],
        ["setInitialPose", "pond", 0, 0],
        ["waitUntilNav2Active"],
        ["goToPose", 4, 3],
        ["followPath", 3, 4],
        ["followPath", 4, 1],
    ]


@pytest.mark.parametrize(
    ("reason", "goal", "node"),
    [("blocked", 4, "hut"), ("refused", 4, "hut"), ("refused", 1, "dock")],
)
def test_a_robot_stops_where_it_fails(driven, reason, goal, node):
    ended, told = driven(0, **{reason: [goal]})
    assert (ended.returncode, ended.stderr) == (1, f"Robot 0 did not get to {node}.\n")
    assert told[-1][-1] == goal


def test_a_robot_that_stays(driven):
    ended, told = driven(1)
    assert (ended.returncode, ended.stdout) == (0, "")
    assert len(told) == 3
