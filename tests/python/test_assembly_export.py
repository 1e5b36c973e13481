"""Assemblies as models of MuJoCo: bodies where the parts lie, joints of the mates."""

import json
import shutil

import numpy as np
import pytest

from conftest import FIXTURES

mujoco = pytest.importorskip("mujoco")


@pytest.fixture(scope="module")
def exported(command, tmp_path_factory):
    """The best assembly of the report, and the models by the ending of their files."""
    folder = tmp_path_factory.mktemp("assembly")
    (folder / "parts").mkdir()
    for part in ("hole", "peg"):
        shutil.copy(FIXTURES / f"rectangular_{part}.obj", folder / "parts" / f"{part}.obj")
    files = {ending: folder / f"out.{ending}" for ending in ("urdf", "xml")}
    code, _, complaints = command(
        "assemble", folder / "parts", "--unit", "m", "-o", folder / "out.toml", "--seconds", 0,
        "--urdf", files["urdf"], "--mjcf", files["xml"],
    )
    assert code == 0, complaints
    report = json.loads((folder / "out.json").read_text())
    models = {e: mujoco.MjModel.from_xml_path(str(files[e])) for e in files}
    return report["assemblies"][0], models


def test_bodies_lie_where_the_parts_do(exported):
    best, models = exported
    model = models["xml"]
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert model.nbody == 1 + len(best["placed"])
    for placed in best["placed"]:
        body, pose = model.body(placed["part"]).id, np.array(placed["pose"])
        np.testing.assert_allclose(data.xpos[body], pose[:3], atol=1e-9)
        # w x y z, of either sign.
        assert abs(abs(data.xquat[body] @ np.roll(pose[3:], 1)) - 1) < 1e-9


def test_a_urdf_has_the_same_freedoms(exported):
    best, models = exported
    assert models["urdf"].njnt == models["xml"].njnt == best["mates"][0]["freedoms"]
