"""What tables say outside their window and rotations: no wall that the parts have not."""

import numpy as np
import pytest

import pegfit
from conftest import about

#: Half angle of the tables' rotations.
ANGLE = np.radians(12)


@pytest.fixture(scope="module", params=["rectangular", "circular", "combined"])
def edged(request, tmp_path_factory):
    """A table with the window that tables have unless told otherwise."""
    pair = pegfit.Pair(*pegfit.peg_in_hole(request.param), spacing=0.003)
    path = tmp_path_factory.mktemp("edge") / "t.zarr"
    return pair.bake(path, angle_deg=12, step_deg=6)


def sizes(table, rows):
    found = table.query(rows)
    return np.linalg.norm(found.force, axis=1), np.linalg.norm(found.torque, axis=1), found


def inside(table, rng, count):
    half = table.window[1]
    rows = np.empty((count, 7))
    rows[:, :3] = rng.uniform(-1, 1, (count, 3)) * half
    rows[:, 3:] = [about(rng.normal(size=3), ANGLE * rng.uniform()) for _ in range(count)]
    return rows


def test_no_force_outside_is_greater_than_at_the_edge(edged):
    rng = np.random.default_rng(6)
    half = edged.window[1]
    starts = inside(edged, rng, 80)
    beyond = np.linspace(0.0, 0.1, 60)
    ways = np.repeat(starts[:, None], len(beyond), axis=1)
    axis, side = rng.integers(3, size=80), rng.choice([-1, 1], 80)
    for n in range(80):
        ways[n, :, axis[n]] = side[n] * (half[axis[n]] + beyond)
    force, _, found = sizes(edged, ways.reshape(-1, 7))
    force = force.reshape(80, -1)
    # A fade over two nodes brings twice the force at the edge.
    assert force[:, 1:].max() < 1.03 * force[:, 0].max()
    assert np.median(force[:, 1:].max(axis=1) - force[:, 0]) <= 0.1
    # Beyond the moving part's radius there is nothing.
    gone = beyond > 0.06
    assert not force[:, gone].any() and not found.energy.reshape(80, -1)[:, gone].any()


def test_torques_outside_are_about_those_inside(edged):
    rng = np.random.default_rng(7)
    _, torque, _ = sizes(edged, inside(edged, rng, 1500))
    starts = inside(edged, rng, 80)
    angles = ANGLE + np.linspace(1e-3, np.pi - ANGLE, 60)
    ways = np.repeat(starts[:, None], len(angles), axis=1)
    for n in range(80):
        axis = rng.normal(size=3)
        ways[n, :, 3:] = [about(axis, angle) for angle in angles]
    _, outside, _ = sizes(edged, ways.reshape(-1, 7))
    # A fade over two steps brings ten times that.
    assert outside.max() < 1.3 * torque.max()


def test_the_force_outside_is_the_energys_slope(edged):
    """Any way round, through the edge and back, costs nothing."""
    rng = np.random.default_rng(8)
    half = edged.window[1]
    rows = inside(edged, rng, 60)
    rows[:, :3] = rng.uniform(-3, 3, (60, 3)) * half
    force, _, found = sizes(edged, rows)
    step = 2e-6
    for k in range(3):
        by = np.zeros(7)
        by[k] = step
        slope = (edged.query(rows + by).energy - edged.query(rows - by).energy) / (2 * step)
        # Energies of 30 mJ are single precision sums, 1e-9 J, over 4 µm: 0.5 mN.
        assert np.abs(slope + found.force[:, k]).max() < 5e-3
