# Lets MuJoCo compile a model and writes its geoms at the reference pose as JSON. Run by Pegfit:
#   python compile.py MODEL.xml OUT.json
# Exits with 69 if MuJoCo cannot be imported or is too old.
import json
import os
import sys

# Nothing is drawn, and no pool of threads needs address space.
os.environ["MUJOCO_GL"] = "disabled"
os.environ["OPENBLAS_NUM_THREADS"] = "1"

try:
    import mujoco
    import numpy
except (ImportError, OSError) as missing:
    print(missing)
    sys.exit(69)

KINDS = {
    "mjGEOM_SPHERE": "sphere",
    "mjGEOM_CAPSULE": "capsule",
    "mjGEOM_ELLIPSOID": "ellipsoid",
    "mjGEOM_CYLINDER": "cylinder",
    "mjGEOM_BOX": "box",
    "mjGEOM_MESH": "mesh",
    "mjGEOM_SDF": "sdf",
    "mjGEOM_PLANE": "plane",
    "mjGEOM_HFIELD": "hfield",
}


def compiled(source):
    """The model, with every body and geom that the file has."""
    spec = mujoco.MjSpec.from_file(source)
    compiler = getattr(spec, "compiler", spec)
    # Both are for speed, and would join bodies to others and leave solids out.
    compiler.fusestatic = False
    compiler.discardvisual = False
    return spec.compile()


def mesh(model, index):
    """Corners and triangles in the frame of the mesh's file, which MuJoCo moves and turns."""
    first, count = model.mesh_vertadr[index], model.mesh_vertnum[index]
    corners = model.mesh_vert[first:first + count].astype(float)
    turn = numpy.zeros(9)
    mujoco.mju_quat2Mat(turn, model.mesh_quat[index])
    corners = corners @ turn.reshape(3, 3).T + model.mesh_pos[index]
    first, count = model.mesh_faceadr[index], model.mesh_facenum[index]
    faces = model.mesh_face[first:first + count]
    return {
        "name": model.mesh(index).name,
        "vertices": corners.tolist(),
        "triangles": faces.tolist(),
        "spare": len(corners) - len(set(faces.ravel().tolist())),
    }


def geoms(model, data):
    """Every geom in the world, meshes by the frames of their files."""
    # A geom that only a pair names does touch something.
    paired = set(model.pair_geom1.tolist()) | set(model.pair_geom2.tolist())
    for index in range(model.ngeom):
        kind = mujoco.mjtGeom(model.geom_type[index]).name
        at, turn = data.geom_xpos[index].copy(), numpy.zeros(4)
        mujoco.mju_mat2Quat(turn, data.geom_xmat[index])
        told = {"kind": KINDS.get(kind, kind), "mesh": None}
        if told["kind"] in ("mesh", "sdf"):
            used = told["mesh"] = int(model.geom_dataid[index])
            back, undo = numpy.zeros(3), numpy.zeros(4)
            mujoco.mju_negPose(back, undo, model.mesh_pos[used], model.mesh_quat[used])
            mujoco.mju_mulPose(at, turn, at.copy(), turn.copy(), back, undo)
        untouched = not model.geom_contype[index] and not model.geom_conaffinity[index]
        told.update(
            body=int(model.geom_bodyid[index]),
            size=model.geom_size[index].tolist(),
            position=at.tolist(),
            quaternion=turn.tolist(),
            visual=bool(untouched and index not in paired),
        )
        yield told


def main():
    source, target = sys.argv[1:]
    if not hasattr(mujoco, "MjSpec") or not hasattr(mujoco.MjSpec, "from_file"):
        print(f"MuJoCo {mujoco.__version__} is too old, 3.2.7 is not")
        return 69
    try:
        model = compiled(source)
    except Exception as wrong:  # Whatever it is, its words are what the user needs.
        print(" ".join(str(wrong).split()))
        return 1
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found = {
        "version": mujoco.__version__,
        "bodies": [model.body(i).name for i in range(model.nbody)],
        "meshes": [mesh(model, i) for i in range(model.nmesh)],
        "geoms": list(geoms(model, data)),
        "joints": model.njnt,
        "keys": model.nkey,
        "flexes": model.nflex,
        "skins": model.nskin,
        "sites": model.nsite,
    }
    with open(target, "w", encoding="utf-8") as out:
        json.dump(found, out, allow_nan=False)
    return 0


sys.exit(main())
