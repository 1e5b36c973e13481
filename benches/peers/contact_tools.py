"""One class per tool: `set_up` gets the two meshes, `ask` a pose of the moving one.

`ask` gives whether the tool says that the parts touch or overlap, its depth, and the force that the
tool's depth and normals make of it. What depth means is said before anything is measured:

- MuJoCo, coal, FCL: the largest penetration depth of any contact that the tool lists, metres; where
  there is none, minus the distance, if the tool gives one. Force: the sum over contacts of depth
  times normal on the moving part, a penalty of 1 N/m.
- Drake: the largest pressure on the contact surface over the hydroelastic modulus, which is a strain,
  times half the moving part's width. Force: the integral of the pressure.
- pegfit: no depth; the energy stands in for it. It says nothing of touching: contact is where an
  exact distance would be zero, and pegfit has none.
"""

from __future__ import annotations

import os
import tempfile

import numpy as np

import pegfit


def matrix(row: np.ndarray) -> np.ndarray:
    """4 x 4 of a row x y z qx qy qz qw."""
    x, y, z, w = row[3:]
    found = np.eye(4)
    found[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    found[:3, 3] = row[:3]
    return found


class MuJoCo:
    """Contacts of two mesh geoms: their convex hulls, or signed distance fields."""

    def __init__(self, kind: str) -> None:
        self.kind, self.name = kind, f"MuJoCo {kind}"

    def set_up(self, hole, peg, folder: str) -> None:
        import mujoco

        self.mujoco = mujoco
        for name, mesh in (("hole", hole), ("peg", peg)):
            mesh.export(os.path.join(folder, f"{name}.obj"))
        text = f"""
        <mujoco>
          <compiler meshdir="{folder}"/>
          <asset><mesh name="hole" file="hole.obj"/><mesh name="peg" file="peg.obj"/></asset>
          <worldbody>
            <geom name="hole" type="{self.kind}" mesh="hole"/>
            <body name="peg"><freejoint/><geom name="peg" type="{self.kind}" mesh="peg"/></body>
          </worldbody>
        </mujoco>"""
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)
        self.moving = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_GEOM, "peg")

    def ask(self, row):
        data = self.data
        data.qpos[:3] = row[:3]
        data.qpos[3:7] = row[[6, 3, 4, 5]]
        self.mujoco.mj_kinematics(self.model, data)
        self.mujoco.mj_collision(self.model, data)
        if data.ncon == 0:
            return False, 0.0, np.zeros(3)
        depths = -data.contact.dist
        # The normal points from the first geom to the second.
        senses = np.where(data.contact.geom[:, 1] == self.moving, 1.0, -1.0)
        normals = senses[:, None] * data.contact.frame[:, :3]
        deep = np.maximum(depths, 0.0)
        return bool(depths.max() > 0), float(depths.max()), (deep[:, None] * normals).sum(axis=0)


class Coal:
    """Trees of boxes: `collide`, and `distance` where nothing collides."""

    name = "coal"

    def set_up(self, hole, peg, folder: str) -> None:
        import coal

        self.coal = coal
        self.parts = []
        for mesh in (hole, peg):
            model = coal.BVHModelOBBRSS()
            model.beginModel(len(mesh.faces), len(mesh.vertices))
            model.addVertices(np.asarray(mesh.vertices))
            for face in mesh.faces:
                model.addTriangle(*(mesh.vertices[i] for i in face))
            model.endModel()
            self.parts.append(model)
        self.request = coal.CollisionRequest(coal.CollisionRequestFlag.CONTACT, 64)
        self.still = coal.Transform3s.Identity()

    def ask(self, row):
        coal, place = self.coal, matrix(row)
        moved = coal.Transform3s(place[:3, :3], place[:3, 3])
        hole, peg = self.parts
        found = coal.CollisionResult()
        if coal.collide(hole, self.still, peg, moved, self.request, found):
            contacts = [found.getContact(k) for k in range(found.numContacts())]
            depths = np.array([abs(c.penetration_depth) for c in contacts])
            normals = np.array([c.normal for c in contacts])
            return True, float(depths.max()), (depths[:, None] * normals).sum(axis=0)
        apart = coal.DistanceResult()
        coal.distance(hole, self.still, peg, moved, coal.DistanceRequest(), apart)
        return False, -apart.min_distance, np.zeros(3)


class Fcl:
    """trimesh's manager of FCL objects: internal collision, and distance where there is none."""

    name = "trimesh/FCL"

    def set_up(self, hole, peg, folder: str) -> None:
        import trimesh

        self.manager = trimesh.collision.CollisionManager()
        self.manager.add_object("hole", hole)
        self.manager.add_object("peg", peg)

    def ask(self, row):
        self.manager.set_transform("peg", matrix(row))
        touch, contacts = self.manager.in_collision_internal(return_data=True)
        if not touch:
            return False, -self.manager.min_distance_internal(), np.zeros(3)
        depths = np.array([abs(c.depth) for c in contacts])
        normals = np.array([c.normal for c in contacts])
        return True, float(depths.max()), (depths[:, None] * normals).sum(axis=0)


class Drake:
    """A rigid hole and a compliant peg, for which only a convex one comes without a volume mesh."""

    name, modulus = "Drake hydroelastic", 1e7

    def set_up(self, hole, peg, folder: str) -> None:
        from pydrake.geometry import (
            AddCompliantHydroelasticProperties,
            AddRigidHydroelasticProperties,
            Convex,
            GeometryFrame,
            GeometryInstance,
            Mesh,
            ProximityProperties,
            SceneGraph,
        )
        from pydrake.math import RigidTransform

        if not peg.is_convex:
            raise NotImplementedError("a peg that is not convex needs a volume mesh")
        for name, mesh in (("hole", hole), ("peg", peg)):
            mesh.export(os.path.join(folder, f"drake-{name}.obj"))
        self.scene = SceneGraph()
        source = self.scene.RegisterSource("bench")
        frame = self.scene.RegisterFrame(source, GeometryFrame("peg"))
        still = RigidTransform()
        self.width = float(peg.extents[:2].min())
        rigid, soft = ProximityProperties(), ProximityProperties()
        AddRigidHydroelasticProperties(properties=rigid)
        AddCompliantHydroelasticProperties(self.width, self.modulus, soft)
        shape = Mesh(os.path.join(folder, "drake-hole.obj"))
        fixed = GeometryInstance(still, shape, "hole")
        fixed.set_proximity_properties(rigid)
        self.scene.RegisterAnchoredGeometry(source, fixed)
        shape = Convex(os.path.join(folder, "drake-peg.obj"))
        moving = GeometryInstance(still, shape, "peg")
        moving.set_proximity_properties(soft)
        self.scene.RegisterGeometry(source, frame, moving)
        self.frame, self.source = frame, source
        self.context = self.scene.CreateDefaultContext()
        self.port = self.scene.get_source_pose_port(source)

    def ask(self, row):
        from pydrake.common.value import Value
        from pydrake.geometry import FramePoseVector, HydroelasticContactRepresentation
        from pydrake.math import RigidTransform

        poses = FramePoseVector()
        poses.set_value(self.frame, RigidTransform(matrix(row)))
        self.port.FixValue(self.context, Value(poses))
        query = self.scene.get_query_output_port().Eval(self.context)
        kind = HydroelasticContactRepresentation.kTriangle
        surfaces = query.ComputeContactSurfaces(kind)
        if not surfaces:
            return False, 0.0, np.zeros(3)
        force, most = np.zeros(3), 0.0
        for surface in surfaces:
            mesh, field = surface.tri_mesh_W(), surface.tri_e_MN()
            pressure = np.array([field.EvaluateAtVertex(v) for v in range(mesh.num_vertices())])
            most = max(most, float(pressure.max()))
            for t in range(mesh.num_triangles()):
                element = mesh.element(t)
                mean = np.mean([pressure[element.vertex(k)] for k in range(3)])
                # Normals point out of N into M; the peg was registered last and is N or M by id.
                force += mean * mesh.area(t) * mesh.face_normal(t)
        return True, 0.5 * self.width * most / self.modulus, force


class Pegfit:
    """The product: from a table, or by direct quadrature."""

    def __init__(self, kind: str, spacing: float = 1e-3) -> None:
        self.kind, self.spacing, self.name = kind, spacing, f"pegfit {kind}"

    def set_up(self, hole, peg, folder: str) -> None:
        parts = [pegfit.Mesh(m.vertices, m.faces, unit="m") for m in (hole, peg)]
        reach = [0.004, 0.004, 0.036]
        pair = pegfit.Pair(*parts, spacing=self.spacing, half_extent=reach)
        if self.kind == "table":
            with tempfile.TemporaryDirectory() as place:
                path = os.path.join(place, "t.zarr")
                self.source = pair.bake(path, angle_deg=5, step_deg=2.5)
        else:
            self.source = pair.evaluator(0.1)
        self.out = pegfit.Response.empty(1)

    def ask(self, row):
        found = self.source.query(row[None], threads=1, out=self.out)
        self.torque = found.torque[0].copy()
        return None, float(found.energy[0]), found.force[0].copy()


TOOLS = [
    lambda: MuJoCo("mesh"),
    lambda: MuJoCo("sdf"),
    Coal,
    Fcl,
    Drake,
    lambda: Pegfit("table"),
    lambda: Pegfit("direct"),
]
