"""The table of pose conventions in docs/conventions.md, row by row, with the packages where they are."""

from types import SimpleNamespace

import numpy as np
import pytest

import pegfit
from conftest import quaternion_product, random_poses, turned


@pytest.fixture(scope="module")
def bodies():
    """World poses of both bodies, rows of pegfit, and the poses of one in the frame of the other."""
    fixed = random_poses(6, reach=0.5, angle=3.0, seed=21)
    relative = random_poses(6, reach=0.004, angle=0.1, seed=22)
    moving = np.hstack([
        fixed[:, :3] + turned(fixed[:, 3:], relative[:, :3]),
        quaternion_product(fixed[:, 3:], relative[:, 3:]),
    ])
    return fixed, moving, relative


@pytest.fixture(scope="module")
def expected(evaluator, bodies):
    return evaluator.query(bodies[2])


def same(found, expected):
    """Roundings of poses half a metre out, times slopes of some newtons."""
    scale = np.abs(expected.energy).max()
    np.testing.assert_allclose(found.energy, expected.energy, rtol=0, atol=1e-5 * scale)
    np.testing.assert_allclose(
        found.force, expected.force, rtol=0, atol=1e-3 * np.abs(expected.force).max()
    )


def w_first(rows):
    return np.roll(rows[:, 3:], 1, axis=-1)


def test_mujoco(evaluator, bodies, expected):
    mujoco = pytest.importorskip("mujoco")
    fixed, moving, _ = bodies
    rows = np.empty((len(fixed), 7))
    for row, f, m in zip(rows, fixed, moving):
        back, origin, place, turn = np.empty(4), np.empty(3), np.empty(3), np.empty(4)
        mujoco.mju_negPose(origin, back, f[:3], w_first(f[None])[0])
        mujoco.mju_mulPose(place, turn, origin, back, m[:3], w_first(m[None])[0])
        row[:] = np.hstack([place, np.roll(turn, -1, axis=-1)])
    same(evaluator.query(rows), expected)


def test_ros(evaluator, bodies, expected):
    poses = [
        SimpleNamespace(
            position=SimpleNamespace(**dict(zip("xyz", row[:3]))),
            orientation=SimpleNamespace(**dict(zip("xyzw", row[3:]))),
        )
        for row in bodies[2]
    ]
    rows = []
    for pose in poses:
        p, q = pose.position, pose.orientation
        rows.append([p.x, p.y, p.z, q.x, q.y, q.z, q.w])
    same(evaluator.query(rows), expected)


def test_pinocchio(evaluator, bodies, expected):
    pinocchio = pytest.importorskip("pinocchio")
    fixed, moving, relative = bodies
    pairs = [[pinocchio.XYZQUATToSE3(row) for row in rows] for rows in (fixed, moving)]
    rows = np.array([pinocchio.SE3ToXYZQUAT(f.actInv(m)) for f, m in zip(*pairs)])
    same(evaluator.query(rows), expected)
    # A wrench: force first; its power with a twist, both at the part's origin, is the energy's rate.
    twist = np.array([0.01, -0.02, 0.015, 0.3, 0.2, -0.4])
    for row, force, torque in zip(relative, expected.force, expected.torque):
        wrench = pinocchio.Force(force, torque)
        np.testing.assert_array_equal(wrench.vector, np.hstack([force, torque]))
        # Both along the fixed part's axes, about the moving part's origin.
        there = pinocchio.SE3(np.eye(3), row[:3])
        motion = there.act(pinocchio.Motion(twist))
        about_fixed = there.act(wrench)
        step = 1e-5
        ends = []
        for sign in (1, -1):
            place = pinocchio.exp6(pinocchio.Motion(sign * step * motion.vector))
            moved = place * pinocchio.XYZQUATToSE3(row)
            ends.append(evaluator.query([pinocchio.SE3ToXYZQUAT(moved)]).energy[0])
        rate = (ends[0] - ends[1]) / (2 * step)
        scale = np.linalg.norm(force) * 0.03 + np.linalg.norm(torque) * 0.5
        assert abs(rate + about_fixed.dot(motion)) < 1e-2 * scale


def test_matrices_of_trimesh(evaluator, bodies, expected):
    transformations = pytest.importorskip("trimesh.transformations")
    matrices = []
    for f, m in zip(bodies[0], bodies[1]):
        ends = []
        for row in (f, m):
            matrix = transformations.quaternion_matrix(np.roll(row[3:], 1))
            matrix[:3, 3] = row[:3]
            ends.append(matrix)
        matrices.append(np.linalg.inv(ends[0]) @ ends[1])
    same(evaluator.query(np.array(matrices)), expected)


def test_scipy(evaluator, bodies, expected):
    Rotation = pytest.importorskip("scipy.spatial.transform").Rotation
    fixed, moving, _ = bodies
    back = Rotation.from_quat(fixed[:, 3:]).inv()
    translations = back.apply(moving[:, :3] - fixed[:, :3])
    same(evaluator.query((translations, back * Rotation.from_quat(moving[:, 3:]))), expected)


def test_drake(evaluator, bodies, expected):
    """Its `GetAsMatrix4()[None]` is one matrix of `(1, 4, 4)`."""
    matrix = np.eye(4)
    row = bodies[2][0]
    matrix[:3, :3] = turned(np.tile(row[3:], (3, 1)), np.eye(3)).T
    matrix[:3, 3] = row[:3]
    found = evaluator.query(matrix[None])
    assert found.energy[0] == pytest.approx(expected.energy[0], rel=1e-5)
