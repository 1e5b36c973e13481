"""Objects that other processes make again."""

import multiprocessing
import pickle
import sys

import numpy as np
import pytest

import pegfit
from conftest import random_poses


def energies(source, poses):
    return source.query(poses, threads=1).energy


def test_meshes_and_pairs_are_what_they_were(pair, placed):
    mesh = pegfit.peg_in_hole("combined")[1]
    copy = pickle.loads(pickle.dumps(mesh))
    np.testing.assert_array_equal(copy.vertices, mesh.vertices)
    np.testing.assert_array_equal(copy.faces, mesh.faces)
    assert copy.name == mesh.name
    for one in (pair, placed):
        other = pickle.loads(pickle.dumps(one))
        assert repr(other) == repr(one) and other.spacing == one.spacing
        np.testing.assert_array_equal(other.assembled, one.assembled)


def test_other_processes_answer_alike(evaluator, table):
    poses = random_poses(40, reach=0.008, angle=0.1, seed=2)
    tasks = [(source, part) for source in (evaluator, table) for part in (poses[:20], poses[20:])]
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        found = pool.starmap(energies, tasks)
    for source, parts in ((evaluator, found[:2]), (table, found[2:])):
        np.testing.assert_array_equal(np.concatenate(parts), energies(source, poses))


def test_a_closed_table_is_refused(pair, tmp_path):
    table = pair.bake(tmp_path / "t.zarr", half_extent=0.004, angle_deg=5, step_deg=5)
    table.close()
    with pytest.raises(pegfit.TableError, match="closed"):
        pickle.dumps(table)


def test_responses_are_cut_and_told_as_tables(evaluator):
    poses = random_poses(9, reach=0.008, angle=0.1, seed=3)
    found = evaluator.query(poses)
    part = found[3:7]
    assert len(part) == 4 and np.shares_memory(part.force, found.force)
    np.testing.assert_array_equal(part.force, found.force[3:7])
    np.testing.assert_array_equal(found[-1].torque, found.torque[-1:])
    np.testing.assert_array_equal(found[np.int64(2)].energy, found.energy[2:3])
    low = found.energy < np.median(found.energy)
    np.testing.assert_array_equal(found[low].energy, found.energy[low])
    np.testing.assert_array_equal(found[[4, 1]].coverage, found.coverage[[4, 1]])
    assert len(list(found)) == 9
    for number in (9, -10):
        with pytest.raises(IndexError):
            found[number]
    copy = pickle.loads(pickle.dumps(found))
    np.testing.assert_array_equal(copy.torque, found.torque)


def test_responses_as_pandas(evaluator):
    pytest.importorskip("pandas")
    found = evaluator.query(random_poses(5, reach=0.008, angle=0.1, seed=4))
    frame = found.to_pandas()
    assert list(frame) == ["energy", "fx", "fy", "fz", "tx", "ty", "tz", "coverage"]
    np.testing.assert_array_equal(frame[["fx", "fy", "fz"]], found.force)
    np.testing.assert_array_equal(frame["tz"], found.torque[:, 2])


def test_responses_as_xarray(evaluator):
    pytest.importorskip("xarray")
    found = evaluator.query(random_poses(5, reach=0.008, angle=0.1, seed=4))
    data = found.to_xarray()
    assert dict(data.sizes) == {"pose": 5, "axis": 3} and data.torque.units == "N m"
    np.testing.assert_array_equal(data.force.sel(axis="y"), found.force[:, 1])
    assert set(data.coords) == {"axis"}


def test_poses_become_coordinates(evaluator):
    pytest.importorskip("xarray")
    poses = random_poses(4, reach=0.008, angle=0.1, seed=5)
    found = evaluator.query(poses)
    data = found.to_xarray(poses)
    for k, name in enumerate(("x", "y", "z", "qx", "qy", "qz", "qw")):
        np.testing.assert_array_equal(data[name], poses[:, k])
    assert data.x.units == "m" and data.x.dims == ("pose",)
    with pytest.raises(pegfit.PoseError, match="expected 4 poses, found 3") as caught:
        found.to_xarray(poses[:3])
    assert caught.value.item == "poses"


@pytest.mark.parametrize("package", ["xarray", "pandas"])
def test_a_missing_package_is_named(package, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ModuleNotFoundError, match=f"needs {package}: pip install {package}"):
        getattr(pegfit.Response.empty(1), f"to_{package}")()


def test_what_a_package_misses_itself_is_not_renamed(monkeypatch):
    pytest.importorskip("xarray")
    for name in [name for name in sys.modules if name.split(".")[0] == "xarray"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ModuleNotFoundError) as caught:
        pegfit.Response.empty(1).to_xarray()
    assert caught.value.name == "pandas" and "xarray: pip" not in str(caught.value)
