"""Scores over displacements, and docking."""

import numpy as np
import pytest

import pegfit
from conftest import about, quaternion_product, turned


def test_scores_are_energies_over_minus_gamma(pair, evaluator):
    rotation = about([0.2, -1, 0.4], 0.1)
    scores = pair.correlate(rotation, window=([-0.004, -0.006, 0.0], [0.006, 0.002, 0.008]))
    assert scores.values.shape == (6, 5, 5)
    np.testing.assert_allclose(scores.x, np.linspace(-0.004, 0.006, 6), atol=1e-12)
    np.testing.assert_allclose(scores.z, np.linspace(0.0, 0.008, 5), atol=1e-12)
    grid = np.stack(np.meshgrid(scores.x, scores.y, scores.z, indexing="ij"), -1).reshape(-1, 3)
    # Displacements are those of the pivot.
    at = grid + pair.pivot - turned(rotation, pair.pivot)
    poses = np.hstack([at, np.tile(rotation, (len(at), 1))])
    energy = evaluator.query(poses).energy
    flat = scores.values.ravel()
    gamma = -(energy @ flat) / (flat @ flat)
    # Direct quadrature turns the points of one part, correlation its lattice: the difference is
    # that of two ways to interpolate, a few per cent at this coarse spacing.
    error = np.linalg.norm(energy + gamma * flat) / np.linalg.norm(energy)
    assert gamma > 0 and error < 0.05, (gamma, error)


def test_at_the_modelled_rotation_both_are_one_sum(pair, evaluator):
    scores = pair.correlate(window=0.004)
    index = np.argwhere(scores.values == scores.values)
    at = scores.origin + scores.spacing * index
    energy = evaluator.query(np.hstack([at, np.tile([0, 0, 0, 1.0], (len(at), 1))])).energy
    flat = scores.values.ravel()
    gamma = -(energy @ flat) / (flat @ flat)
    # Nodes on nodes: both interpolate alike. The evaluator leaves out the rim of a thousandth of the
    # smoothed densities, which takes a few times 1e-4 of a score.
    assert np.linalg.norm(energy + gamma * flat) < 5e-4 * np.linalg.norm(energy)


def test_the_highest_scores_are_poses_with_these_scores(placed):
    scores = placed.correlate(placed.assembled[3:], window=0.008)
    poses, values = scores.top(3)
    assert len(poses) == len(values) <= 3 and np.all(np.diff(values) <= 0)
    assert values[0] == scores.values.max()
    # The best one is the fit, to a node.
    np.testing.assert_allclose(poses[0, :3], placed.assembled[:3], atol=2.1e-3)
    energy = placed.evaluator().query(poses).energy
    assert np.all(np.diff(energy) > -0.02 * abs(energy[0]))


@pytest.mark.parametrize("options, item", [(dict(k=0), "k"), (dict(k=3, apart=float("nan")), "apart")])
def test_peaks_that_are_none_are_refused(options, item, pair):
    with pytest.raises(pegfit.SceneError) as caught:
        pair.correlate(window=0.002).top(**options)
    assert caught.value.item == item


@pytest.mark.parametrize(
    "options, kind",
    [
        (dict(rotation=[0, 0, 0, 2]), pegfit.PoseError),
        (dict(rotation=[0, 0, 1]), pegfit.PoseError),
        (dict(rotation=-np.eye(3)), pegfit.PoseError),
        (dict(window=-0.001), pegfit.SceneError),
        (dict(window=float("nan")), pegfit.SceneError),
        (dict(window=1e6), pegfit.SceneError),
        (dict(window=4.0), pegfit.SceneError),
        (dict(window=[1, 2]), pegfit.PoseError),
    ],
)
def test_rotations_and_windows_that_are_none_are_refused(options, kind, pair):
    with pytest.raises(kind) as caught:
        pair.correlate(**options)
    assert caught.value.item, caught.value


def test_rotations_come_in_every_form(pair):
    transform = pytest.importorskip("scipy.spatial.transform")
    turn = transform.Rotation.from_euler("zyx", [0.3, 0.1, -0.2])
    reference = pair.correlate(turn, window=0.002).values
    for form in (turn.as_quat(), turn.as_matrix(), turn.as_quat().tolist()):
        np.testing.assert_allclose(pair.correlate(form, window=0.002).values, reference, rtol=1e-5)


@pytest.fixture(scope="module")
def moved():
    """A hole that was turned and shifted before it was meshed, its peg, and where the peg belongs."""
    hole, peg = pegfit.peg_in_hole("combined")
    rotation, shift = about([1, 2, -1], 0.9), np.array([0.013, -0.02, 0.031])
    vertices = turned(rotation, hole.vertices) + shift
    fixed = pegfit.Mesh(vertices, hole.faces, unit="m", name="moved hole")
    return pegfit.Pair(fixed, peg, spacing=0.0015), np.append(shift, rotation)


def test_docking_finds_where_a_part_that_was_moved_belongs(moved, tmp_path):
    pair, pose = moved
    told = []
    state = tmp_path / "state"
    found = pair.dock(3, state=state, progress=lambda done, total: told.append((done, total)))
    assert len(found) >= 1 and found.energy[0] < 0 and found.refined[0] and found.scored > 0
    assert found.joints[0].kind == "prismatic" and found.information[0] > 25 and found.overlap[0] < 1e-3
    assert np.all(np.diff(found.hold) <= 0) and found.alike[0].shape[1:] == (7,)
    # Across the hole to a third of a cell; along it the ends alone hold the peg, to a cell.
    off = turned(pose[3:] * [-1, -1, -1, 1], found.poses[0, :3] - pose[:3])
    assert np.linalg.norm(off[:2]) < 5e-4 and abs(off[2]) < 1.5e-3, off
    # The peg looks the same after half a turn about its x axis, and only then.
    turns = [pose[3:], quaternion_product(pose[3:], [1, 0, 0, 0])]
    angle = min(2 * np.arccos(min(1, abs(found.poses[0, 3:] @ q))) for q in turns)
    assert np.degrees(angle) < 1
    assert told and state.exists()
    again = pair.dock(3, state=state)
    np.testing.assert_array_equal(again.poses, found.poses)


def test_docking_refuses_what_it_cannot_do(pair, tmp_path):
    for options in (dict(top=0), dict(top=-1), dict(tolerance=0.5), dict(state=tmp_path / "no" / "folder"),
                    dict(rank="depth"), dict(axis=[0, 0, 1]), dict(near=[0, 0]),
                    dict(rank="energy", axis=[[0, 0, 0], [0, 0, 1]])):
        with pytest.raises(pegfit.PegfitError):
            pair.dock(**options)
