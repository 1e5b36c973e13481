"""Insertion paths."""

import json

import numpy as np
import pytest

import pegfit


@pytest.fixture(scope="module")
def loose():
    return pegfit.Pair(*pegfit.peg_in_hole("combined", clearance=2e-4), spacing=0.003)


@pytest.fixture(scope="module")
def found(loose):
    return loose.path()


def test_a_peg_is_drawn_in_and_forces_do_the_work(loose, found):
    assert found.free and found.outcome == "free"
    n = len(found)
    assert found.poses.shape == (n, 7) and found.force.shape == found.torque.shape == (n, 3)
    np.testing.assert_allclose(found.poses[-1], loose.assembled, atol=1e-12)
    assert found.length[0] == 0 and np.all(np.diff(found.length) > 0)
    assert found.overlap.max() <= found.summary["tolerance"]
    assert len(found.words) == 1 and found.words[0].startswith("push ")
    # One straight motion: the work of the force alone, by trapezoids of a third of a cell.
    steps = np.diff(found.poses[:, :3], axis=0)
    work = np.sum(0.5 * (found.force[1:] + found.force[:-1]) * steps)
    assert abs(work / (found.energy[0] - found.energy[-1]) - 1) < 0.05
    assert found.depth > 0 and 0 <= found.barrier < 0.2 * found.depth
    energy = loose.evaluator().query(found.poses).energy
    np.testing.assert_allclose(energy, found.energy, atol=1e-12)


def test_paths_are_those_of_the_scene(placed):
    found = placed.path(solids_only=True, tolerance=2e-4, allow_overlap=True)
    np.testing.assert_allclose(found.poses[-1], placed.assembled, atol=1e-12)
    assert np.isnan(found.energy).all() and found.barrier is None and found.depth is None


def test_a_path_begins_and_ends_where_it_is_asked_to(loose):
    start, goal = [0.05, 0, 0.03, 0, 0, 0, 1], [0, 0, 0.004, 0, 0, 0, 1]
    found = loose.path(goal, start, solids_only=True)
    np.testing.assert_allclose(found.poses[[0, -1]], [start, goal], atol=1e-12)
    assert found.free
    matrix = np.eye(4)
    matrix[2, 3] = 0.004
    np.testing.assert_allclose(loose.path(matrix, solids_only=True).poses[-1], goal, atol=1e-12)


def test_reports_say_what_the_command_would(found, tmp_path):
    for ending in ["html", "csv", "json"]:
        found.report(tmp_path / f"path.{ending}")
    assert found.words[0] in (tmp_path / "path.html").read_text()
    rows = np.genfromtxt(tmp_path / "path.csv", delimiter=",", names=True)
    np.testing.assert_allclose(rows["energy"], found.energy, rtol=1e-12)
    np.testing.assert_allclose(rows["x"], found.poses[:, 0], atol=1e-15)
    np.testing.assert_allclose(rows["fz"], found.force[:, 2], rtol=1e-12)
    assert json.loads((tmp_path / "path.json").read_text()) == found.summary
    with pytest.raises(pegfit.PegfitError, match="html"):
        found.report(tmp_path / "path.txt")


def test_the_old_name_still_works():
    with pytest.deprecated_call(match="InsertionPath"):
        assert pegfit.Way is pegfit.InsertionPath
    assert not hasattr(pegfit, "Ways")


@pytest.mark.parametrize(
    "options, kind, said",
    [
        (dict(to="there"), pegfit.SceneError, "fit, best or a pose"),
        (dict(from_="here"), pegfit.SceneError, "outside or a pose"),
        (dict(to=[0, 0, 0]), pegfit.PoseError, "n, 7"),
        (dict(from_=[0, 0, 0, 0, 0, 0, 2]), pegfit.PoseError, "quaternion"),
        (dict(seconds=float("nan")), pegfit.SceneError, "seconds"),
        (dict(tolerance=0), pegfit.SceneError, "tolerance"),
        (dict(to=[0.005, 0, 0, 0, 0, 0, 1]), pegfit.SceneError, "overlap by"),
        (dict(to=[0, 0, 0.05, 0, 0, 0, 1]), pegfit.SceneError, "beside each other"),
    ],
)
def test_questions_without_an_answer_are_refused(loose, options, kind, said):
    with pytest.raises(kind, match=said):
        loose.path(solids_only=True, **options)
