"""Opens a table with zarr-python and xarray and compares it with `pegfit score`.

usage: check.py PEGFIT TABLE
"""

import csv
import io
import json
import pathlib
import subprocess
import sys

import numpy as np
import xarray
import zarr


def rotate(q, v):
    """v turned by the quaternion q = x, y, z, w."""
    u, w = q[:3], q[3]
    return v + 2 * np.cross(u, np.cross(u, v) + w * v)


def times(p, q):
    """The quaternion that turns by q, then by p."""
    v = p[3] * q[:3] + q[3] * p[:3] + np.cross(p[:3], q[:3])
    return np.append(v, p[3] * q[3] - p[:3] @ q[:3])


def to_scene(placement, position, rotation):
    """The pose in the scene for a pose of the shapes: position, rotation."""
    fixed, moving = (
        [np.array(placement[part][key]) for key in ["position", "rotation"]]
        for part in ["fixed", "moving"]
    )
    back = moving[1] * [-1, -1, -1, 1]
    turn = times(times(fixed[1], rotation), back)
    at = rotate(fixed[1], position) + fixed[0] - rotate(turn, moving[0])
    return np.concatenate([at, turn])


def poses(table, pegfit, nodes):
    """Poses of (rotation, x, y, z) nodes as the rows that `pegfit score` reads."""
    placement = pegfit["table"]["placement"]
    pivot = np.array(pegfit["table"]["provenance"]["pivot"])
    for r, i, j, k in nodes:
        q = table.quaternion.values[r]
        d = np.array([table.x.values[i], table.y.values[j], table.z.values[k]])
        yield to_scene(placement, pivot + d - rotate(q, pivot), q)


#: Of contact, in widths of the smoothing.
REACH = 3.75


def smoothing(pegfit):
    """Width with which both densities together are smoothed, metres."""
    return pegfit["table"]["provenance"]["fixed"]["sampling"]["smoothed"]["sharpening"] ** 0.5


def gap(table, pegfit, node):
    """Height of the moving part above the fixed one at a node, at most their distance, metres."""
    r, i, j, k = node
    pivot = np.array(pegfit["table"]["provenance"]["pivot"])
    displacement = np.array([table.x.values[i], table.y.values[j], table.z.values[k]])
    turned = rotate(table.quaternion.values[r], table.moving_vertices.values - pivot)
    return (turned + pivot + displacement)[:, 2].min() - table.fixed_vertices.values[:, 2].max()


def chart(table, pegfit):
    """Nodes along the three axes of the rotations' chart for each row, and which lie in the ball."""
    rotations = pegfit["table"]["rotations"]
    center = np.array(rotations["center"])
    relative = np.array([times(q, center * [-1, -1, -1, 1]) for q in table.quaternion.values])
    angles = np.arctan(relative[:, :3] / relative[:, 3:])
    nodes = angles / np.radians(0.5 * rotations["step_deg"])
    assert np.abs(nodes - nodes.round()).max() < 1e-6
    turned = 2 * np.degrees(np.arccos(np.minimum(1, abs(relative[:, 3]))))
    return nodes.round().astype(int), turned < rotations["angle_deg"]


def at_nodes(coefficients, nodes, inside):
    """Values of the splines at the nodes; NaN outside of the ball and at the window's faces."""
    for axis in (1, 2, 3):
        c = np.moveaxis(coefficients, axis, 0)
        sums = np.full_like(c, np.nan)
        sums[1:-1] = (c[:-2] + 4 * c[1:-1] + c[2:]) / 6
        coefficients = np.moveaxis(sums, 0, axis)
    row = {tuple(node): r for r, node in enumerate(nodes)}
    values = np.full_like(coefficients, np.nan)
    for r in np.flatnonzero(inside):
        near = np.array(list(np.ndindex(3, 3, 3)))
        weights = np.array([1, 4, 1])[near].prod(axis=1) / 6**3
        rows = [row[tuple(nodes[r] + offset - 1)] for offset in near]
        values[r] = np.tensordot(weights, coefficients[rows], 1)
    return values


def scores(program, path, rows):
    text = "x,y,z,qx,qy,qz,qw\n" + "".join(",".join(map(repr, map(float, r))) + "\n" for r in rows)
    command = [program, "score", "--table", path, "--poses", "-", "-q"]
    out = subprocess.run(command, input=text, capture_output=True, text=True, check=True).stdout
    return np.array([float(row["energy"]) for row in csv.DictReader(io.StringIO(out))])


def main(program, path):
    table = xarray.open_zarr(path, consolidated=False)
    pegfit = table.attrs["pegfit"]
    described = json.loads(
        subprocess.run(
            [program, "table", path, "--json"], capture_output=True, text=True, check=True
        ).stdout
    )
    assert pegfit["format"] == 6, pegfit["format"]
    assert pegfit["table"]["provenance"] == described["spec"]["provenance"]
    assert pegfit["error"]["force"]["rms"] == described["error"]["force"]["rms"]
    shape = (described["rotations"], *described["displacements"])
    assert table.coefficients.dims == ("rotation", "x", "y", "z"), table.coefficients.dims
    assert table.coefficients.shape == shape, (table.coefficients.shape, shape)
    spacing = pegfit["table"]["window"]["spacing"]
    assert np.allclose(np.diff(table.x.values), spacing)
    assert np.allclose(np.linalg.norm(table.quaternion.values, axis=1), 1)

    # By the CF attributes coefficients are in joules.
    joules = table.coefficients
    assert joules.attrs["units"] == "J", joules.attrs
    assert all("long_name" in table[name].attrs for name in ["coefficients", "x", "quaternion"])
    assert [table[axis].attrs["units"] for axis in "xyz"] == ["m"] * 3

    # The same numbers through zarr-python.
    group = zarr.open_group(path, mode="r")
    raw = group["coefficients"][:]
    joules_too = raw.astype("f8") * pegfit["energy_unit"]
    assert np.isfinite(joules_too).all()
    np.testing.assert_allclose(joules.values, joules_too, rtol=1e-6)

    # A rotation that is not there has no numbers.
    chunk = pathlib.Path(path, "coefficients", "c.0.0.0.0")
    moved = chunk.with_name("away")
    chunk.rename(moved)
    absent = xarray.open_zarr(path, consolidated=False).coefficients[0].values
    moved.rename(chunk)
    assert np.isnan(absent).all()

    # The surfaces are there: closed, of the sizes of the parts.
    for part in ["fixed", "moving"]:
        corners = table[f"{part}_vertices"].values[table[f"{part}_triangles"].values]
        area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert np.allclose(area.sum(axis=0), 0, atol=1e-12 * np.abs(area).sum()), part

    # At a node out of contact's reach the energy is the splines' sum; a query sums in single
    # precision. Within it contact adds, and the array alone is not the energy.
    random = np.random.default_rng(1)
    energy = at_nodes(joules_too, *chart(table, pegfit))
    inside = [tuple(node) for node in np.argwhere(np.isfinite(energy))]
    rows = [inside[n] for n in random.choice(len(inside), 600, replace=False)]
    near = np.array([gap(table, pegfit, node) < REACH * smoothing(pegfit) for node in rows])
    expected = np.array([energy[n] for n in rows])
    largest = np.nanmax(np.abs(energy))
    found = scores(program, path, poses(table, pegfit, rows))
    assert near.sum() > 50 and (~near).sum() > 50, near.sum()
    assert np.abs(found - expected)[near].max() > 0.01 * largest
    found, expected = found[~near], expected[~near]
    assert np.ptp(expected) > 1e-3 * largest
    difference = np.abs(found - expected).max() / largest
    assert difference < 1e-5, difference
    print(f"{path}: {shape}, {raw.dtype}, {len(found)} energies agree within {difference:.1e}")


if __name__ == "__main__":
    main(*sys.argv[1:])
