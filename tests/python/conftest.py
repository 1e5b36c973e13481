"""Parts that tests share: small, coarse, neither aligned nor symmetric where that would hide a mistake."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pegfit

# A job that a shell starts in the background ignores Ctrl-C, and so would all that it starts.
signal.signal(signal.SIGINT, signal.default_int_handler)

ROOT = Path(__file__).resolve().parents[2]
FIXTURES = ROOT / "fixtures"

#: A scene whose parts are turned and shifted, each in its own way.
PLACED = """
unit = "m"
cache = "cache"

[fixed]
mesh = "combined_hole.obj"
position = [0.3, -0.2, 0.9]
rotation = [0.18257418583505536, -0.3651483716701107, 0.5477225575051661, 0.7302967433402214]

[moving]
mesh = "combined_peg.obj"
position = [-0.1, 0.5, 0.4]
rotation = [-0.5, 0.5, 0.5, 0.5]

[fit]
position = {position}
rotation = {rotation}

[lattice]
spacing = 0.002

[window]
half_extent = 0.01

[rotations]
kind = "ball"
center = {rotation}
angle_deg = 10
step_deg = 5
"""


def quaternion_product(a, b):
    """Of x y z w rows, broadcast."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    v, w = a[..., :3], a[..., 3:]
    u, s = b[..., :3], b[..., 3:]
    xyz = w * u + s * v + np.cross(v, u)
    return np.concatenate([xyz, w * s - np.sum(v * u, axis=-1, keepdims=True)], axis=-1)


def turned(q, v):
    """The vectors turned by x y z w rows."""
    q, v = np.asarray(q, float), np.asarray(v, float)
    u = q[..., :3]
    t = 2 * np.cross(u, v)
    return v + q[..., 3:] * t + np.cross(u, t)


def about(axis, angle):
    """x y z w of a turn by `angle` about `axis`."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    return np.append(np.sin(angle / 2) * axis, np.cos(angle / 2))


def random_poses(count, *, reach, angle, seed, center=None):
    """Rows near `center`: displaced by up to `reach` along each axis, turned by up to `angle`."""
    rng = np.random.default_rng(seed)
    center = np.array([0, 0, 0, 0, 0, 0, 1.0]) if center is None else np.asarray(center, float)
    rows = np.empty((count, 7))
    rows[:, :3] = center[:3] + rng.uniform(-reach, reach, (count, 3))
    axes, angles = rng.normal(size=(count, 3)), rng.uniform(0, angle, count)
    turns = np.array([about(a, g) for a, g in zip(axes, angles)])
    rows[:, 3:] = quaternion_product(turns, center[3:])
    return rows


@pytest.fixture(scope="session")
def pair():
    return pegfit.Pair(*pegfit.peg_in_hole("combined", 2e-4), spacing=0.002, half_extent=0.01)


@pytest.fixture(scope="session")
def evaluator(pair):
    return pair.evaluator()


@pytest.fixture(scope="session")
def table(pair, tmp_path_factory):
    path = tmp_path_factory.mktemp("table") / "t.zarr"
    return pair.bake(path, half_extent=0.01, angle_deg=10, step_deg=5)


@pytest.fixture(scope="session")
def scene(tmp_path_factory):
    """The placed scene's file: the pose in which its parts fit is P_f P_m^-1."""
    folder = tmp_path_factory.mktemp("scene")
    for name in ("combined_hole.obj", "combined_peg.obj"):
        shutil.copy(FIXTURES / name, folder)
    fixed_q = np.array([0.18257418583505536, -0.3651483716701107, 0.5477225575051661,
                        0.7302967433402214])
    moving_q = np.array([-0.5, 0.5, 0.5, 0.5])
    inverse = moving_q * [-1, -1, -1, 1]
    rotation = quaternion_product(fixed_q, inverse)
    position = np.array([0.3, -0.2, 0.9]) - turned(rotation, [-0.1, 0.5, 0.4])
    text = PLACED.format(position=position.tolist(), rotation=rotation.tolist())
    path = folder / "scene.toml"
    path.write_text(text)
    return path


@pytest.fixture(scope="session")
def placed(scene):
    return pegfit.Pair.from_scene(scene)


@pytest.fixture(scope="session")
def command():
    """Runs the command that came with the wheel; its exit code, output and complaints."""
    program = Path(sys.executable).parent / "pegfit"

    def run(*words, **options):
        words = [str(program), *map(str, words)]
        done = subprocess.run(words, capture_output=True, text=True, timeout=300, **options)
        return done.returncode, done.stdout, done.stderr

    return run
