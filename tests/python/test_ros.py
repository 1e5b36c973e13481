"""The ROS 2 node of `examples/ros2`, with messages and a node that stand in for ROS."""

import importlib.util
import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

import pegfit
from conftest import ROOT, about, quaternion_product, random_poses, turned

NODE = ROOT / "examples" / "ros2" / "wrench_node.py"


def vector():
    return SimpleNamespace(x=0.0, y=0.0, z=0.0)


class Header(SimpleNamespace):
    def __init__(self):
        super().__init__(frame_id="", stamp=SimpleNamespace(sec=0, nanosec=0))


class PoseStamped:
    """As ROS makes it: a quaternion of zeros but for w."""

    def __init__(self):
        self.header = Header()
        orientation = SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0)
        self.pose = SimpleNamespace(position=vector(), orientation=orientation)


class WrenchStamped:
    def __init__(self):
        self.header = Header()
        self.wrench = SimpleNamespace(force=vector(), torque=vector())


class Node:
    """What a node does with topics, parameters and its log."""

    given = {}

    def __init__(self, name):
        self.name, self.sent, self.heard, self.warnings = name, [], {}, []

    def declare_parameter(self, name, default):
        return SimpleNamespace(value=self.given.get(name, default))

    def create_publisher(self, kind, topic, depth):
        assert (kind, topic, depth) == (WrenchStamped, "wrench", 1)
        return SimpleNamespace(publish=self.sent.append)

    def create_subscription(self, kind, topic, callback, depth):
        assert (kind, depth) == (PoseStamped, 1)
        self.heard[topic] = callback

    def get_logger(self):
        return SimpleNamespace(warning=lambda text, throttle_duration_sec: self.warnings.append(text))


@pytest.fixture()
def ros(monkeypatch):
    """The example, imported over stand-ins."""
    names = ("rclpy", "rclpy.node", "geometry_msgs", "geometry_msgs.msg")
    modules = {name: ModuleType(name) for name in names}
    modules["rclpy.node"].Node = Node
    modules["geometry_msgs.msg"].PoseStamped = PoseStamped
    modules["geometry_msgs.msg"].WrenchStamped = WrenchStamped
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setattr(Node, "given", {})
    spec = importlib.util.spec_from_file_location("wrench_node", NODE)
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    return example


def stamped(pose, frame="hole"):
    message = PoseStamped()
    message.header.frame_id = frame
    message.header.stamp.sec = 7
    at, turn = message.pose.position, message.pose.orientation
    at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w = pose.tolist()
    return message


def numbers(vector):
    assert all(type(value) is float for value in (vector.x, vector.y, vector.z))
    return np.array([vector.x, vector.y, vector.z])


def test_a_pose_is_answered_by_the_power_that_its_wrench_would_do(ros, table, monkeypatch):
    """Energy falls at the rate of the wrench times a twist about the frame's origin."""
    monkeypatch.setattr(Node, "given", {"table": table.path, "frame": "hole"})
    node = ros.WrenchNode()
    # Steps and bounds as in test_mujoco.py: sums in single precision, kinks at cells.
    h, step = 1e-3, 2e-5
    for pose in random_poses(4, reach=0.006, angle=0.1, seed=8) + [0, 0, 0.002, 0, 0, 0, 0]:
        node.sent.clear()
        node.heard["pose"](stamped(pose))
        (answer,) = node.sent
        assert answer.header.frame_id == "hole" and answer.header.stamp.sec == 7
        force, torque = numbers(answer.wrench.force), numbers(answer.wrench.torque)
        # The part of it that the node adds is seen.
        assert np.abs(np.cross(pose[:3], force)).max() > 0.1 * np.abs(torque).max()
        for axis in np.eye(3):

            def energy(sign):
                turn = about(axis, sign * h)
                at = np.append(turned(turn, pose[:3]), quaternion_product(turn, pose[3:]))
                return table.query(at[None]).energy[0]

            slope = (energy(1) - energy(-1)) / (2 * h)
            assert abs(torque @ axis + slope) < 0.03 * np.abs(torque).max()
            shift = np.append(step * axis, np.zeros(4))
            rise = table.query(np.array([pose + shift, pose - shift])).energy
            slope = (rise[0] - rise[1]) / (2 * step)
            assert abs(force @ axis + slope) < 0.03 * np.abs(force).max()


def test_what_is_no_pose_of_the_frame_is_refused_and_the_node_goes_on(ros, table, monkeypatch):
    monkeypatch.setattr(Node, "given", {"frame": "hole"})
    node = ros.WrenchNode(table)
    whole = np.array([0, 0, 0.002, 0, 0, 0, 1.0])
    node.answer(stamped(whole, frame="map"))
    node.answer(stamped(0 * whole))
    node.answer(stamped(whole * np.nan))
    assert not node.sent and len(node.warnings) == 3
    assert "expected poses in 'hole', found 'map'" in node.warnings[0]
    node.answer(stamped(whole))
    assert len(node.sent) == 1 and node.sent[0].wrench.force.z != 0


def test_without_a_table_the_node_says_so(ros):
    with pytest.raises(pegfit.TableError):
        ros.WrenchNode()
