"""Meshes: read, given, refused."""

import numpy as np
import pytest

import pegfit
from conftest import FIXTURES


def cube(side):
    corners = np.array([[x, y, z] for x in (0, side) for y in (0, side) for z in (0, side)], float)
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = np.array([f for a, b, c, d in sides for f in ([a, b, c], [a, c, d])])
    return corners, faces


class Trimesh:
    """As much of one as is looked at."""

    def __init__(self, units=None):
        self.vertices, self.faces = cube(10)
        self.units = units


def test_a_mesh_is_that_of_the_file():
    mesh = pegfit.Mesh.load(FIXTURES / "rectangular_hole.obj", unit="m")
    assert mesh.vertices.shape == (16, 3) and mesh.faces.shape == (32, 3)
    assert mesh.faces.dtype == np.uint32
    np.testing.assert_allclose(mesh.bounds, [[-0.02, -0.02, -0.015], [0.02, 0.02, 0.015]])
    report = mesh.check()
    # A block of 40 x 40 x 30 mm less a hole of 20 x 20 mm: exact but for rounding.
    assert report.volume == pytest.approx((0.04**2 - 0.02**2) * 0.03, rel=1e-12)
    assert report.watertight and report.warnings == []
    orders = [axis["order"] for axis in report.symmetry]
    assert {"finite": 4} in orders and len(orders) == 5
    assert "rectangular_hole" in repr(mesh) and "32 faces" in repr(mesh)


def test_a_mesh_tells_what_was_read_of_its_file(tmp_path):
    vertices, faces = cube(10)
    lines = ["v {} {} {}".format(*v) for v in vertices]
    lines += ["f {} {} {}".format(*(f + 1)) for f in faces] + ["l 1 2", "surf 0 1 0 1 1 2 3 4"]
    path = tmp_path / "cube.obj"
    path.write_text("\n".join(lines))
    with pytest.raises(pegfit.MeshError, match="surf"):
        pegfit.Mesh.load(path, unit="mm")
    ledger = pegfit.Mesh.load(path, unit="mm", lossy=True).check().ledger
    told = {(entry["kind"], entry["item"]): entry["count"] for entry in ledger}
    assert told[("read", "v")] == 8 and told[("read", "f")] == 12
    assert told[("ignored", "l")] == told[("ignored", "surf")] == told[("assumed", "unit")] == 1
    assert pegfit.Mesh(vertices, faces, unit="mm").check().ledger == []
    with pytest.raises(pegfit.MeshError, match="step_time_limit"):
        pegfit.Mesh.load(path, unit="mm", step_time_limit=0)


@pytest.mark.parametrize("unit, metre", [("m", 1.0), ("mm", 1e-3), ("inch", 0.0254)])
def test_units_scale(unit, metre):
    vertices, faces = cube(2)
    report = pegfit.Mesh(vertices, faces, unit=unit).check()
    assert report.volume == pytest.approx((2 * metre) ** 3, rel=1e-12)
    assert report.area == pytest.approx(6 * (2 * metre) ** 2, rel=1e-12)


def test_arrays_of_any_kind_give_the_same_mesh():
    vertices, faces = cube(10)
    reference = pegfit.Mesh(vertices, faces, unit="mm").vertices
    spread = np.zeros((8, 6))
    spread[:, ::2] = vertices
    for given in [
        vertices.tolist(),
        vertices.astype(np.float32),
        np.asfortranarray(vertices),
        spread[:, ::2],
    ]:
        np.testing.assert_array_equal(pegfit.Mesh(given, faces, unit="mm").vertices, reference)
    for given in [faces.tolist(), faces.astype(np.uint8), faces.astype(np.int32)]:
        assert pegfit.Mesh(vertices, given, unit="mm").faces.shape == (12, 3)


def test_what_has_vertices_and_faces_is_a_mesh():
    pair = pegfit.Pair(Trimesh("mm"), Trimesh("millimeters"))
    assert "12 and 12 faces" in repr(pair)
    assert "12 and 12 faces" in repr(pegfit.Pair(Trimesh(), Trimesh(), unit="mm"))


def test_the_real_trimesh_is_a_mesh():
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box([0.01, 0.02, 0.03])
    field = pegfit.density(box, unit="m", spacing=0.002)
    nodes = np.indices(field.values.shape).reshape(3, -1).T * field.spacing + field.origin
    away = np.abs(nodes) - [0.005, 0.01, 0.015]
    outside = np.linalg.norm(np.maximum(away, 0), axis=1)
    expected = outside + np.minimum(away.max(axis=1), 0)
    near = np.abs(expected) < 0.002
    found = field.signed_distance.reshape(-1)
    np.testing.assert_allclose(found[near], expected[near], atol=1e-7)


def test_a_vertex_that_is_none_is_named():
    vertices, faces = cube(10)
    vertices[3, 1] = np.nan
    with pytest.raises(pegfit.MeshError) as caught:
        pegfit.Mesh(vertices, faces, unit="mm", name="holey")
    error = caught.value
    assert (error.file, error.item) == ("holey", "vertex 3")
    assert "finite" in error.expected and "NaN" in error.found and isinstance(error, pegfit.PegfitError)


@pytest.mark.parametrize("index", [8, -1, 2**40])
def test_an_index_of_no_vertex(index):
    vertices, faces = cube(10)
    faces = faces.astype(np.int64)
    faces[5, 2] = index
    with pytest.raises(pegfit.MeshError, match="triangle 5"):
        pegfit.Mesh(vertices, faces, unit="mm")


def test_refusals_name_what_is_missing(tmp_path):
    vertices, faces = cube(10)
    cases = [
        (lambda: pegfit.Mesh(vertices, faces), "unit"),
        (lambda: pegfit.Mesh(vertices, faces, unit="furlong"), "unit"),
        (lambda: pegfit.Mesh(vertices[:, :2], faces, unit="mm"), "vertices"),
        (lambda: pegfit.Mesh(vertices, faces + 0.5, unit="mm"), "faces"),
        (lambda: pegfit.Mesh("cube", faces, unit="mm"), "vertices and faces"),
        (lambda: pegfit.Mesh(vertices, faces[:4], unit="mm"), "missing share of the area"),
        (lambda: pegfit.Mesh.load(FIXTURES / "circular_peg.obj"), "unit"),
        (lambda: pegfit.Mesh.load(tmp_path / "none.stl", unit="mm"), "file"),
        (lambda: pegfit.Mesh.load(FIXTURES / "README.md", unit="mm"), "ending"),
        (lambda: pegfit.density(3), "mesh"),
        (lambda: pegfit.peg_in_hole("triangular"), "section"),
        (lambda: pegfit.peg_in_hole(clearance=-1.0), "clearance"),
    ]
    for call, item in cases:
        with pytest.raises(pegfit.MeshError) as caught:
            call()
        assert caught.value.item == item, caught.value
        assert caught.value.expected and caught.value.found, caught.value
