"""Writes expected.txt: of every model here, per body with solids, what MuJoCo says of it.

A line is: model, body, sum of the geoms' volumes, least and greatest corner of their bounds, in
metres. Geoms that touch count, or those to look at of a body that has no others. Run again with
`python3 expected.py` after a change of the models (needs mujoco, numpy).
"""
import pathlib

import mujoco
import numpy as np

HERE = pathlib.Path(__file__).parent
PARTS = {"part.xml", "sub.xml"}


def reach(kind, size, turn):
    """Half the sides of the box around a primitive that is turned."""
    a, b, c = size
    z = turn[:, 2]
    if kind == "SPHERE":
        return np.full(3, a)
    if kind == "BOX":
        return np.abs(turn) @ size
    if kind == "ELLIPSOID":
        return np.sqrt((turn * size) ** 2 @ np.ones(3))
    if kind == "CAPSULE":
        return a + b * np.abs(z)
    return b * np.abs(z) + a * np.sqrt(np.maximum(0, 1 - z * z))  # CYLINDER


def volume(kind, size):
    a, b, c = size
    return {
        "SPHERE": 4 / 3 * np.pi * a**3,
        "BOX": 8 * a * b * c,
        "ELLIPSOID": 4 / 3 * np.pi * a * b * c,
        "CAPSULE": np.pi * a * a * (4 / 3 * a + 2 * b),
        "CYLINDER": np.pi * a * a * 2 * b,
    }[kind]


def geom(model, data, g):
    """Volume, least and greatest corner."""
    kind = mujoco.mjtGeom(model.geom_type[g]).name.removeprefix("mjGEOM_")
    turn, at = data.geom_xmat[g].reshape(3, 3), data.geom_xpos[g]
    if kind == "MESH":
        m = model.geom_dataid[g]
        v = model.mesh_vert[model.mesh_vertadr[m]:][:model.mesh_vertnum[m]].astype(float)
        f = model.mesh_face[model.mesh_faceadr[m]:][:model.mesh_facenum[m]]
        a, b, c = (v[f[:, i]] for i in range(3))
        used = v[np.unique(f)] @ turn.T + at
        six = np.einsum("ij,ij->i", a, np.cross(b, c)).sum()
        return abs(six) / 6, used.min(0), used.max(0)
    half = reach(kind, model.geom_size[g], turn)
    return volume(kind, model.geom_size[g]), at - half, at + half


def lines(path):
    spec = mujoco.MjSpec.from_file(str(path))
    spec.compiler.fusestatic = spec.compiler.discardvisual = False
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    pairs = set(model.pair_geom1.tolist() + model.pair_geom2.tolist())
    for body in range(model.nbody):
        solid = [
            g for g in range(model.ngeom)
            if model.geom_bodyid[g] == body
            and mujoco.mjtGeom(model.geom_type[g]).name not in ("mjGEOM_PLANE", "mjGEOM_HFIELD")
        ]
        touching = [g for g in solid if model.geom_contype[g] or model.geom_conaffinity[g] or g in pairs]
        found = [geom(model, data, g) for g in touching or solid]
        if not found:
            continue
        low, high = np.min([f[1] for f in found], 0), np.max([f[2] for f in found], 0)
        name = model.body(body).name or f"body-{body}"
        numbers = [sum(f[0] for f in found), *low, *high]
        yield f"{path.stem} {name} " + " ".join(f"{x:.9e}" for x in numbers)


models = sorted(p for p in HERE.glob("*.xml") if p.name not in PARTS)
text = f"# MuJoCo {mujoco.__version__}\n"
text += "".join(line + "\n" for p in models for line in lines(p))
(HERE / "expected.txt").write_text(text)
