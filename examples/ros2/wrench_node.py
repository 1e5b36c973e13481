#!/usr/bin/env python3
"""A ROS 2 node: the pose of the moving part in, the wrench on it out.

    python3 wrench_node.py --ros-args -p table:=table.zarr -p frame:=hole

Subscribes to `pose` (geometry_msgs/PoseStamped): the moving part in the frame of the table's scene.
Publishes `wrench` (geometry_msgs/WrenchStamped), one for each pose, with its header.

Parameters:
    table: Folder of a table that `pegfit bake` wrote.
    frame: Name of the scene's frame. Poses in another are refused; empty takes any.
"""

from __future__ import annotations

import numpy as np
import pegfit
import rclpy
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.node import Node

#: Only the latest pose counts: a queue would delay the force.
DEPTH = 1

#: Seconds between warnings about the same thing.
QUIET = 5.0


def row_of(message: PoseStamped) -> np.ndarray:
    """x y z qx qy qz qw."""
    at, turn = message.pose.position, message.pose.orientation
    return np.array([at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w])


def wrench_of(source: pegfit.Source, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force and torque on the moving part along the scene's axes, the torque about the origin of the
    scene's frame, as ROS has it; pegfit's own is about the pose's translation."""
    response = source.query(pose[None], threads=1)
    force = response.force[0]
    return force, response.torque[0] + np.cross(pose[:3], force)


class WrenchNode(Node):
    """Answers each pose with a wrench."""

    def __init__(self, source: pegfit.Source | None = None) -> None:
        super().__init__("pegfit")
        table = self.declare_parameter("table", "").value
        self._frame = self.declare_parameter("frame", "").value
        self._source = source if source is not None else pegfit.Table.open(table)
        self._wrenches = self.create_publisher(WrenchStamped, "wrench", DEPTH)
        self._poses = self.create_subscription(PoseStamped, "pose", self.answer, DEPTH)

    def answer(self, message: PoseStamped) -> None:
        """Publishes the wrench at a pose, or says why there is none."""
        given = message.header.frame_id
        if self._frame and given != self._frame:
            text = f"expected poses in '{self._frame}', found '{given}'"
            self.get_logger().warning(text, throttle_duration_sec=QUIET)
            return
        try:
            force, torque = wrench_of(self._source, row_of(message))
        except pegfit.PoseError as error:
            self.get_logger().warning(str(error), throttle_duration_sec=QUIET)
            return
        answer = WrenchStamped()
        answer.header = message.header
        for vector, values in ((answer.wrench.force, force), (answer.wrench.torque, torque)):
            vector.x, vector.y, vector.z = (float(value) for value in values)
        self._wrenches.publish(answer)


def main() -> None:
    rclpy.init()
    node = WrenchNode()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
