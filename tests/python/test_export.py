"""Docked pairs as models of MuJoCo, with the joint that contact leaves."""

import json
import shutil

import numpy as np
import pytest

from conftest import FIXTURES, quaternion_product, turned

mujoco = pytest.importorskip("mujoco")

SCENE = """
unit = "m"
cache = "cache"
fixed = "{0}_hole.obj"
moving = "{0}_peg.obj"

[lattice]
spacing = 0.002
"""

#: The pose of the moving shape in the placed scene of conftest.
PLACED_MOVING = np.array([-0.1, 0.5, 0.4, -0.5, 0.5, 0.5, 0.5])


@pytest.fixture(scope="module", params=["rectangular", "circular", "placed"])
def docked(request, command, scene, tmp_path_factory):
    """Name, best pose, mates, and the models of a docked pair by the ending of their files."""
    name = request.param
    folder = tmp_path_factory.mktemp("export")
    if name != "placed":
        for part in ("hole", "peg"):
            shutil.copy(FIXTURES / f"{name}_{part}.obj", folder)
        scene = folder / "scene.toml"
        scene.write_text(SCENE.format(name))
    files = {ending: folder / f"out.{ending}" for ending in ("urdf", "xml", "json")}
    code, _, complaints = command(
        "dock", scene, "--top", 1, "-o", folder / "best.csv", "--urdf", files["urdf"],
        "--mjcf", files["xml"], "--mates", files["json"],
    )
    assert code == 0, complaints
    best = np.loadtxt(folder / "best.csv", delimiter=",", skiprows=1, usecols=range(7))
    models = {e: mujoco.MjModel.from_xml_path(str(files[e])) for e in ("urdf", "xml")}
    for model in models.values():
        model.opt.gravity[:] = 0
    return name, best, json.loads(files["json"].read_text()), models


def moving_body(model):
    names = [model.body(i).name for i in range(model.nbody)]
    [index] = [i for i, name in enumerate(names) if name.endswith("-moving")]
    return index


def response(model, force, torque):
    """How far the moving part's centre of mass went, and how far the part turned, under a load."""
    data, body = mujoco.MjData(model), moving_body(model)
    mujoco.mj_forward(model, data)
    place, turn = data.xipos[body].copy(), data.xquat[body].copy()
    data.xfrc_applied[body] = np.hstack([force, torque])
    for _ in range(20):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    angle = np.empty(3)
    mujoco.mju_subQuat(angle, data.xquat[body], turn)
    return data.xipos[body] - place, np.linalg.norm(angle)


@pytest.mark.parametrize("ending", ["xml", "urdf"])
def test_the_moving_part_starts_where_it_docked(docked, ending):
    name, best, _, models = docked
    model = models[ending]
    data, body = mujoco.MjData(model), moving_body(model)
    mujoco.mj_forward(model, data)
    place, turn = best[:3], best[3:]
    if name == "placed":
        place = place + turned(turn, PLACED_MOVING[:3])
        turn = quaternion_product(turn, PLACED_MOVING[3:])
    found = np.roll(data.xquat[body], -1)
    assert abs(found @ turn) > 1 - 1e-9
    if ending == "xml":
        # A link of URDF has its origin on the joint's axis, a body of MJCF that of its part.
        np.testing.assert_allclose(data.xpos[body], place, atol=1e-9)
    assert data.ncon == 0


@pytest.mark.parametrize("ending", ["xml", "urdf"])
def test_what_is_free_moves_and_the_rest_holds(docked, ending):
    name, _, mates, models = docked
    model = models[ending]
    joint = mates["joint"]
    round_peg = name == "circular"
    assert joint["kind"] == ("cylindrical" if round_peg else "prismatic")
    axis = turned(mates["placed"]["rotation"], joint["axis"])
    zero = np.zeros(3)
    # A hundredth of a newton, a ten-thousandth of a newton metre: some millimetres, some degrees.
    shift, turn = response(model, 0.01 * axis, zero)
    assert shift @ axis > 1e-5 and np.linalg.norm(shift - (shift @ axis) * axis) < 1e-9
    assert turn < 1e-9
    shift, turn = response(model, zero, 1e-5 * axis)
    assert np.linalg.norm(shift) < 1e-6
    assert turn > 1e-3 if round_peg else turn < 1e-9
    for seed in range(3):
        across = np.cross(axis, np.random.default_rng(seed).normal(size=3))
        across /= np.linalg.norm(across)
        for load in ((0.01 * across, zero), (zero, 1e-5 * across)):
            shift, turn = response(model, *load)
            # A force across the axis also turns what is free to turn, if mass lies off the axis.
            assert abs(shift @ axis) < 1e-9 and np.linalg.norm(shift) < 1e-6
            assert turn < 1e-6


def test_joint_ranges_are_the_travel(docked):
    _, _, mates, models = docked
    model = models["xml"]
    [slide] = [i for i in range(model.njnt) if model.jnt_type[i] == mujoco.mjtJoint.mjJNT_SLIDE]
    np.testing.assert_allclose(model.jnt_range[slide], mates["joint"]["slide"]["range"], atol=1e-8)


def test_masses_are_those_of_the_meshes(docked):
    _, _, _, models = docked
    masses = [model.body_mass[moving_body(model)] for model in models.values()]
    assert masses[0] == pytest.approx(masses[1], rel=1e-9)


def test_mates_name_the_walls(docked):
    name, _, mates, _ = docked
    kinds = [m["kind"] for m in mates["mates"]]
    if name == "rectangular":
        assert kinds.count("coincident-planes") == 4
    elif name == "circular":
        assert kinds == ["concentric-cylinders"]
    else:
        assert kinds.count("coincident-planes") >= 3
    for part in ("fixed", "moving"):
        for mate in mates["mates"]:
            assert mate[part]["faces"] and max(mate[part]["faces"]) < mates[part]["triangles"]
