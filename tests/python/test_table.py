"""Tables: baked, resumed, opened, refused."""

import hashlib
import json
import shutil

import numpy as np
import pytest

import pegfit
from conftest import random_poses

SMALL = dict(half_extent=0.006, angle_deg=10, step_deg=5)


def energies(folder):
    """Names and hashes of the files that hold energies."""
    files = sorted(f for f in (folder / "coefficients").rglob("*") if f.is_file())
    return {str(f.relative_to(folder)): hashlib.sha256(f.read_bytes()).hexdigest() for f in files}


def test_a_table_is_as_wrong_as_it_says(table, evaluator):
    force = table.error["force"]
    poses = random_poses(400, reach=0.009, angle=np.radians(9), seed=11)
    difference = table.query(poses).force - evaluator.query(poses).force
    rms = np.sqrt(np.mean(np.sum(difference**2, axis=1)))
    # Other poses, more of them near the fit, where forces change most: of the same size.
    assert 0.3 * force["rms"] < rms < 3 * force["rms"]
    assert table.rotations == 343 and table.spacing == 0.002 and table.memory > 0


def test_a_table_that_was_stored_is_the_same(table):
    poses = random_poses(50, reach=0.009, angle=0.1, seed=12)
    with pegfit.Table.open(table.path) as opened:
        np.testing.assert_array_equal(opened.query(poses).energy, table.query(poses).energy)
        assert opened.to_dict() == table.to_dict()
        core = opened
    assert core.closed and "closed" in repr(core)
    with pytest.raises(pegfit.TableError, match="closed") as caught:
        core.query(poses)
    assert isinstance(caught.value, OSError)


def test_closing_one_leaves_another_alone(table):
    first, second = pegfit.Table.open(table.path), pegfit.Table.open(table.path)
    first.close()
    first.close()
    assert len(second.query([[0, 0, 0, 0, 0, 0, 1]])) == 1


class Enough(Exception):
    pass


def test_an_interrupted_bake_goes_on_to_the_same_bytes(pair, tmp_path):
    whole, parts = tmp_path / "whole.zarr", tmp_path / "parts.zarr"
    pair.bake(whole, **SMALL)

    def stop(done, total):
        # 343 rotations, of which some are done by now.
        if total == 343 and done > 0:
            raise Enough

    fine = pegfit.Pair(*pegfit.peg_in_hole("combined", 2e-4), spacing=0.0008)
    with pytest.raises(Enough):
        fine.bake(parts, half_extent=0.01, angle_deg=10, step_deg=5, progress=stop)
    with pytest.raises(pegfit.TableError) as caught:
        pegfit.Table.open(parts)
    assert caught.value.item == "rotation nodes" and caught.value.file == str(parts)
    assert 0 < len(energies(parts))

    # Byte for byte, without waiting for a long bake: take chunks away and bake again.
    reference = energies(whole)
    chunks = sorted((whole / "coefficients").rglob("c.*"))
    for chunk in [c for c in chunks if c.is_file()][::3]:
        chunk.unlink()
    with pytest.raises(pegfit.TableError):
        pegfit.Table.open(whole)
    with pytest.raises(pegfit.TableError) as caught:
        pair.bake(whole, **SMALL)
    assert caught.value.item == "table" and "resume" in caught.value.expected
    table = pair.bake(whole, resume=True, **SMALL)
    assert energies(whole) == reference and table.rotations == 343


@pytest.mark.slow
def test_a_tolerance_is_met_or_refused(tmp_path):
    pair = pegfit.Pair(*pegfit.peg_in_hole("rectangular", 1e-3), half_extent=0.003)
    table = pair.bake(tmp_path / "t.zarr", angle_deg=2, step_deg=2, tolerance=0.3)
    assert table.error["force"]["rms"] <= 0.3 * table.error["force"]["scale"]
    again = pair.bake(tmp_path / "t.zarr", angle_deg=2, step_deg=2, tolerance=0.3, resume=True)
    assert again.rotations == table.rotations
    with pytest.raises(pegfit.SceneError) as caught:
        pair.bake(tmp_path / "u.zarr", tolerance=-1)
    assert caught.value.item == "tolerance"


def test_refusals(pair, table, tmp_path):
    other = pegfit.Pair(*pegfit.peg_in_hole("circular"), spacing=0.002, half_extent=0.01)
    scene = pegfit.SceneError
    broken = tmp_path / "broken.zarr"
    shutil.copytree(table.path, broken)
    header = json.loads((broken / "zarr.json").read_text())
    (broken / "zarr.json").write_text(json.dumps({**header, "attributes": {}}))
    calls = [
        (lambda: pegfit.Table.open(tmp_path), pegfit.TableError),
        (lambda: pegfit.Table.open(tmp_path / "none.zarr"), pegfit.TableError),
        (lambda: pegfit.Table.open(broken), pegfit.TableError),
        (lambda: pegfit.Table.open(table.path, memory=1000), pegfit.TableError),
        (lambda: pegfit.Table.open(table.path, memory=-1), pegfit.TableError),
        (lambda: other.bake(table.path, angle_deg=10, resume=True), pegfit.TableError),
        (lambda: pair.bake(tmp_path / "no" / "t.zarr", **SMALL), pegfit.TableError),
        (lambda: pair.bake(tmp_path / "t.zarr", half_extent=-1.0), scene),
        (lambda: pair.bake(tmp_path / "t.zarr", half_extent=1e9), scene),
        (lambda: pair.bake(tmp_path / "t.zarr", angle_deg=500.0), scene),
        (lambda: pair.bake(tmp_path / "t.zarr", step_deg=0.0), scene),
    ]
    for call, kind in calls:
        with pytest.raises(kind) as caught:
            call()
        assert caught.value.item, repr(caught.value)


def test_pairs_refuse_what_makes_none(tmp_path):
    hole, peg = pegfit.peg_in_hole()
    for options, item in [
        (dict(spacing=0.0), "spacing"),
        (dict(model="soft"), "model"),
        (dict(gamma=-1.0), "gamma"),
        (dict(peak_force=float("inf")), "peak_force"),
        (dict(half_extent=[1, 1, 0]), "half_extent"),
        (dict(spacing=1.0), "fixed"),
        (dict(spacing=1e-4, memory=10**6), "the density fields"),
        (dict(memory=-(10**9)), "memory"),
    ]:
        with pytest.raises(pegfit.SceneError) as caught:
            pegfit.Pair(hole, peg, **options)
        assert caught.value.item == item, caught.value
    scene = tmp_path / "scene.toml"
    scene.write_text('unit = "mm"\nfixed = "a.obj"\nmoving = 3\n')
    with pytest.raises(pegfit.SceneError) as caught:
        pegfit.Pair.from_scene(scene)
    assert caught.value.file == str(scene) and caught.value.item == "line 3"
    scene.write_text('unit = "mm"\nfixed = "a.obj"\nmoving = "b.obj"\n')
    with pytest.raises(pegfit.MeshError):
        pegfit.Pair.from_scene(scene)
    with pytest.raises(pegfit.SceneError):
        pegfit.Pair.from_scene(tmp_path / "none.toml")


def test_it_opens_in_zarr_and_draws_itself(table):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    assert table.plot().get_xlabel() == "displacement (mm)"


def test_xarray_reads_it(table):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("zarr")
    data = xarray.open_zarr(table.path, consolidated=False)
    assert "coefficients" in data and data.coefficients.shape[0] == table.rotations
