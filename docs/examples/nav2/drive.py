"""Drive the trail of one robot with Nav2.

The route server has to have loaded graph.geojson, the file beside the
robot's.
"""

import argparse
import json
from pathlib import Path

import rclpy
from geometry_msgs.msg import PoseStamped
from nav2_simple_commander.robot_navigator import BasicNavigator, TaskResult


def pose_of(navigator, stop):
    """Return where a robot is to be as a message."""
    message = PoseStamped()
    message.header.frame_id = stop["frame"]
    message.header.stamp = navigator.get_clock().now().to_msg()
    for part, axes in stop["pose"].items():
        for axis, value in axes.items():
            setattr(getattr(message.pose, part), axis, value)
    return message


def drive(navigator, leg):
    """Drive along one edge; return whether the robot is at its end."""
    found = navigator.getRoute(leg["start"], leg["goal"])
    edges = [edge.edgeid for edge in found[1].edges] if found else []
    if edges == [leg["edge"]]:
        is_accepted = navigator.followPath(found[0])
    else:  # the router knows a cheaper way, which is not in the plan
        is_accepted = navigator.goToPose(pose_of(navigator, leg))
    if not is_accepted:  # the result would be that of the task before
        return False
    while not navigator.isTaskComplete():
        pass
    return navigator.getResult() == TaskResult.SUCCEEDED


def main():
    """Drive from the start to the end of a trail, or to where it fails."""
    parser = argparse.ArgumentParser()
    parser.add_argument("file", type=Path)
    parser.add_argument("--namespace", default="", help="of the robot")
    given = parser.parse_args()
    plan = json.loads(given.file.read_text("utf-8"))
    rclpy.init()
    navigator = BasicNavigator(namespace=given.namespace)
    navigator.setInitialPose(pose_of(navigator, plan["start"]))
    navigator.waitUntilNav2Active()
    for leg in plan["legs"]:
        if not drive(navigator, leg):
            raise SystemExit(
                f"Robot {plan['robot']} did not get to {leg['node']}."
            )
        print(f"Robot {plan['robot']} is at {leg['node']}.")
    rclpy.shutdown()


if __name__ == "__main__":
    main()
