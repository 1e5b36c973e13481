"""Loose parts put together."""

import numpy as np
import pytest

import pegfit
from conftest import quaternion_product, turned

#: The pose of the peg in its file.
MOVED = np.array([0.3, -0.1, 0.2, 0.5, 0.5, 0.5, 0.5])


@pytest.fixture(scope="module")
def parts():
    hole, peg = pegfit.peg_in_hole("combined", clearance=2e-4)
    vertices = [turned(MOVED[3:], v) + MOVED[:3] for v in peg.vertices]
    return {"hole": hole, "peg": pegfit.Mesh(vertices, peg.faces, "m", name="peg")}


@pytest.fixture(scope="module")
def found(parts):
    heard = []
    assembly = pegfit.assemble(parts, progress=lambda done, total: heard.append((done, total)))
    assert heard and all(done <= total for done, total in heard)
    return assembly


def test_a_moved_peg_comes_home(found):
    assert found.order == ["hole", "peg"] and len(found) == 2 and not found.left_over
    np.testing.assert_allclose(found.pose("hole"), [0, 0, 0, 0, 0, 0, 1], atol=1e-12)
    pose = found.pose("peg")
    # Where the pose takes the peg as it lies in its file: up to a half turn about its key.
    place = pose[:3] + turned(pose[3:], MOVED[:3])
    assert np.linalg.norm(place[:2]) < 5e-4
    turn = quaternion_product(pose[3:], MOVED[3:])
    assert abs(turned(turn, np.array([0.0, 0.0, 1.0]))[2]) > 0.9999


def test_mates_tell_the_joint(found):
    [mate] = found.mates
    assert sorted(mate.parts) == ["hole", "peg"]
    assert mate.joint.kind == "prismatic" and mate.joint.freedoms == 1
    assert abs(mate.joint.axis[2]) > 0.999 and mate.joint.slide.shape == (2,)
    assert mate.information > 8 and mate.overlap < 1e-3 and mate.mating_area > 0


def test_it_comes_apart_and_says_how(found):
    assert found.comes_apart is True and found.locked == []
    assert len(found.steps) == 1 and found.steps[0].startswith("peg onto hole: ")
    assert found.summary["certain"] == found.certain
    assert len(found.alternatives) == len(found.summary["assemblies"]) - 1
    assert repr(found).startswith("Assembly of hole, peg: ")


def test_a_known_place_is_kept(parts):
    place = {"hole": [0.5, 0, 0, 0, 0, 0, 1]}
    found = pegfit.assemble(parts, place=place, seconds=0)
    np.testing.assert_allclose(found.pose("hole"), place["hole"], atol=1e-9)
    assert found.comes_apart is None and found.steps == []


def test_what_cannot_be_assembled_is_refused(parts):
    with pytest.raises(pegfit.SceneError, match="2 to 200 parts, found 1"):
        pegfit.assemble([parts["peg"]])
    with pytest.raises(pegfit.SceneError, match="one of hole, peg") as refused:
        pegfit.assemble(parts, fix="lid")
    assert refused.value.item == "fix"
    with pytest.raises(pegfit.SceneError, match="beam"):
        pegfit.assemble(parts, beam=0)
    with pytest.raises(pegfit.SceneError, match="seconds"):
        pegfit.assemble(parts, seconds=float("nan"))
    with pytest.raises(pegfit.SceneError, match="mating_clearance"):
        pegfit.assemble(parts, mating_clearance=-1.0)
    with pytest.raises(pegfit.PoseError):
        pegfit.assemble(parts, place={"peg": [0, 0, 0, 0, 0, 0, 2]})


def test_equal_names_are_numbered(parts):
    hole = parts["hole"]
    with pytest.raises(pegfit.SceneError, match="one of .* hole, combined hole 2"):
        pegfit.assemble([hole, hole], fix="none")
