"""A small part beside a large one: what poses need is loaded when they ask."""

import numpy as np
import pytest

import pegfit
from conftest import random_poses


def box(*sides):
    """A box about the origin."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
    return pegfit.Mesh(0.5 * signs * sides, np.array(faces), unit="m")


@pytest.fixture(scope="module")
def parts():
    return box(0.2, 0.2, 0.01), box(0.006, 0.006, 0.02)


def same(a, b):
    for name in ("energy", "force", "torque", "coverage"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


def test_energies_depend_neither_on_what_is_loaded_nor_on_the_order(parts):
    poses = random_poses(14, reach=0.05, angle=3.0, seed=21)
    poses[:, 2] *= 0.2
    together = pegfit.Pair(*parts, spacing=1.5e-3).evaluator().query(poses)
    assert np.count_nonzero(together.energy) > 5
    # The fields of the plate take 8 MB.
    little = pegfit.Pair(*parts, spacing=1.5e-3, memory=7_000_000).evaluator()
    same(little.query(poses), together)
    for i in (9, 2, 9):
        same(little.query(poses[i : i + 1]), together[i : i + 1])


def test_what_fits_in_no_memory_is_refused_before_it_is_computed(parts):
    with pytest.raises(pegfit.SceneError) as caught:
        pegfit.Pair(*parts, spacing=1.5e-3, memory=1_000_000)
    assert caught.value.item == "the density fields"


def test_scores_of_a_window_are_the_energies_there(parts):
    pair = pegfit.Pair(*parts, spacing=1.5e-3, gamma=1.0)
    scores = pair.correlate(window=([-0.003, -0.003, 0.008], [0.003, 0.003, 0.014]))
    poses, values = scores.top(2)
    energies = pair.evaluator().query(poses).energy
    # Correlation reads the turned lattice once more: some per cent (test_search.py).
    np.testing.assert_allclose(-energies, values, atol=0.05 * np.abs(scores.values).max())
