"""Densities: where they lie, what they are, what is refused."""

import numpy as np
import pytest

import pegfit


def box_distance(points, half):
    """Signed distance to a box about the origin."""
    q = np.abs(points) - half
    outside = np.linalg.norm(np.maximum(q, 0), axis=-1)
    return outside + np.minimum(q.max(axis=-1), 0)


@pytest.fixture(scope="module")
def peg():
    return pegfit.peg_in_hole("rectangular")[1]


@pytest.fixture(scope="module")
def field(peg):
    return pegfit.density(peg, spacing=0.0013, sigma=0.2)


def nodes(field):
    return np.stack(np.meshgrid(*(field.axis(k) for k in range(3)), indexing="ij"), axis=-1)


def test_the_signed_distance_is_that_of_the_box(field):
    expected = box_distance(nodes(field), np.array([0.01, 0.01, 0.015]))
    # Stored in single precision: 1e-7 of a few centimetres.
    np.testing.assert_allclose(field.signed_distance, expected, atol=5e-9)


def test_the_density_ends_at_the_boundary(field):
    inside = field.signed_distance < -1e-6
    outside = field.signed_distance > 1e-6
    assert np.all(field.exterior[inside] == 0) and np.all(field.interior[outside] == 0)
    assert np.all(field.interior[inside].imag > 0)
    np.testing.assert_array_equal(field.values, field.exterior + field.interior)


def test_just_inside_a_large_face_it_is_that_of_a_half_space():
    plate = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [f for a, b, c, d in sides for f in ([a, b, c], [a, c, d])]
    mesh = pegfit.Mesh(plate, faces, unit="m")
    field = pegfit.density(mesh, spacing=0.05, sigma=0.2, margin=0.1)
    i, j = (int(np.argmin(np.abs(field.axis(k)))) for k in range(2))
    k = int(np.argmin(np.abs(field.axis(2) - 0.975)))
    assert field.signed_distance[i, j, k] == pytest.approx(-0.025, rel=1e-5)
    # docs/conventions.md, half space of sigma 0.2: a = -0.069830, b = 0.531771, in single precision
    # within the field's tolerance of 1e-3.
    assert field.interior[i, j, k] == pytest.approx(-0.069830 + 0.531771j, abs=1e-3)


def test_xarray_gets_names_and_units(field):
    pytest.importorskip("xarray")
    data = field.to_xarray()
    assert data.density.dims == ("x", "y", "z") and data.x.attrs["units"] == "m"
    at = data.signed_distance.sel(x=0.0, y=0.0, z=0.0, method="nearest")
    assert float(at) < -0.008


def test_it_draws_itself(field):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    assert "Density" in field.plot().get_title()


def test_refusals(peg):
    cases = [
        (dict(spacing=-1.0), "spacing"),
        (dict(spacing=float("nan")), "spacing"),
        (dict(sigma=0.9), "sigma"),
        (dict(tolerance=0.5), "tolerance"),
        (dict(spacing=1e-9), "nodes"),
        (dict(spacing=1.9e-5), "the density"),
    ]
    for options, item in cases:
        with pytest.raises(pegfit.SceneError) as caught:
            pegfit.density(peg, **options)
        assert caught.value.item == item, caught.value


def test_progress_is_told_and_its_exceptions_are_raised():
    hole = pegfit.peg_in_hole("combined")[0]
    told = []
    pegfit.density(hole, spacing=3e-4, progress=lambda done, total: told.append((done, total)))
    assert told and told[-1][0] == told[-1][1] and all(d <= t for d, t in told)

    class Stop(Exception):
        pass

    def stop(done, total):
        raise Stop

    with pytest.raises(Stop):
        pegfit.density(hole, spacing=3e-4, progress=stop)
