"""Ways in."""

import json

import numpy as np
import pytest

import pegfit


@pytest.fixture(scope="module")
def loose():
    return pegfit.Pair(*pegfit.peg_in_hole("combined", clearance=2e-4), spacing=0.003)


@pytest.fixture(scope="module")
def way(loose):
    return loose.path()


def test_a_peg_is_drawn_in_and_forces_do_the_work(loose, way):
    assert way.free and way.outcome == "free"
    n = len(way)
    assert way.poses.shape == (n, 7) and way.force.shape == way.torque.shape == (n, 3)
    np.testing.assert_allclose(way.poses[-1], loose.assembled, atol=1e-12)
    assert way.length[0] == 0 and np.all(np.diff(way.length) > 0)
    assert way.overlap.max() <= way.summary["tolerance"]
    assert len(way.words) == 1 and way.words[0].startswith("push ")
    # One straight motion: the work of the force alone, by trapezoids of a third of a cell.
    steps = np.diff(way.poses[:, :3], axis=0)
    work = np.sum(0.5 * (way.force[1:] + way.force[:-1]) * steps)
    assert abs(work / (way.energy[0] - way.energy[-1]) - 1) < 0.05
    assert way.depth > 0 and 0 <= way.barrier < 0.2 * way.depth
    energy = loose.evaluator().query(way.poses).energy
    np.testing.assert_allclose(energy, way.energy, atol=1e-12)


def test_ways_are_those_of_the_scene(placed):
    way = placed.path(solids_only=True, tolerance=2e-4, allow_overlap=True)
    np.testing.assert_allclose(way.poses[-1], placed.assembled, atol=1e-12)
    assert np.isnan(way.energy).all() and way.barrier is None and way.depth is None


def test_a_way_begins_and_ends_where_it_is_asked_to(loose):
    start, goal = [0.05, 0, 0.03, 0, 0, 0, 1], [0, 0, 0.004, 0, 0, 0, 1]
    way = loose.path(goal, start, solids_only=True)
    np.testing.assert_allclose(way.poses[[0, -1]], [start, goal], atol=1e-12)
    assert way.free
    matrix = np.eye(4)
    matrix[2, 3] = 0.004
    np.testing.assert_allclose(loose.path(matrix, solids_only=True).poses[-1], goal, atol=1e-12)


def test_reports_say_what_the_command_would(way, tmp_path):
    for ending in ["html", "csv", "json"]:
        way.report(tmp_path / f"way.{ending}")
    assert way.words[0] in (tmp_path / "way.html").read_text()
    rows = np.genfromtxt(tmp_path / "way.csv", delimiter=",", names=True)
    np.testing.assert_allclose(rows["energy"], way.energy, rtol=1e-12)
    np.testing.assert_allclose(rows["x"], way.poses[:, 0], atol=1e-15)
    np.testing.assert_allclose(rows["fz"], way.force[:, 2], rtol=1e-12)
    assert json.loads((tmp_path / "way.json").read_text()) == way.summary
    with pytest.raises(pegfit.PegfitError, match="html"):
        way.report(tmp_path / "way.txt")


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
