"""One class per tool: `set_up` gets the two meshes, `pose` puts a row x y z qx qy qz qw into the
tool's own form, `query` asks (which is what is timed), and `read` makes of the answer whether the tool
says that the parts touch or overlap, its depth, and the force that its depth and normals make.

What depth means is said before anything is measured:

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
from contact_cases import matrix


class MuJoCo:
    """Contacts of two mesh geoms: their convex hulls, or signed distance fields."""

    def __init__(self, kind: str) -> None:
        self.kind = kind

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

    def pose(self, row):
        return row[[0, 1, 2, 6, 3, 4, 5]]

    def query(self, pose):
        data = self.data
        data.qpos[:7] = pose
        self.mujoco.mj_kinematics(self.model, data)
        self.mujoco.mj_collision(self.model, data)
        return data

    def read(self, data):
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

    def pose(self, row):
        place = matrix(row)
        return self.coal.Transform3s(place[:3, :3], place[:3, 3])

    def query(self, pose):
        coal, (hole, peg) = self.coal, self.parts
        found = coal.CollisionResult()
        if coal.collide(hole, self.still, peg, pose, self.request, found):
            return found, None
        apart = coal.DistanceResult()
        coal.distance(hole, self.still, peg, pose, coal.DistanceRequest(), apart)
        return None, apart

    def read(self, answer):
        found, apart = answer
        if found is None:
            return False, -apart.min_distance, np.zeros(3)
        contacts = [found.getContact(k) for k in range(found.numContacts())]
        depths = np.array([abs(c.penetration_depth) for c in contacts])
        normals = np.array([c.normal for c in contacts])
        return True, float(depths.max()), (depths[:, None] * normals).sum(axis=0)


class Fcl:
    """trimesh's manager of FCL objects: internal collision, and distance where there is none."""

    def set_up(self, hole, peg, folder: str) -> None:
        import trimesh

        self.manager = trimesh.collision.CollisionManager()
        self.manager.add_object("hole", hole)
        self.manager.add_object("peg", peg)

    def pose(self, row):
        return matrix(row)

    def query(self, pose):
        self.manager.set_transform("peg", pose)
        touch, contacts = self.manager.in_collision_internal(return_data=True)
        return contacts, None if touch else self.manager.min_distance_internal()

    def read(self, answer):
        contacts, apart = answer
        if apart is not None:
            return False, -apart, np.zeros(3)
        depths = np.array([abs(c.depth) for c in contacts])
        normals = np.array([c.normal for c in contacts])
        return True, float(depths.max()), (depths[:, None] * normals).sum(axis=0)


class Drake:
    """A rigid hole and a compliant peg, for which only a convex one comes without a volume mesh."""

    modulus = 1e7

    def set_up(self, hole, peg, folder: str) -> None:
        import pydrake.geometry as geometry
        from pydrake.common.value import Value
        from pydrake.math import RigidTransform

        if not peg.is_convex:
            raise NotImplementedError("a peg that is not convex needs a volume mesh")
        for name, mesh in (("hole", hole), ("peg", peg)):
            mesh.export(os.path.join(folder, f"drake-{name}.obj"))
        self.geometry, self.value, self.transform = geometry, Value, RigidTransform
        self.scene = geometry.SceneGraph()
        source = self.scene.RegisterSource("bench")
        self.frame = self.scene.RegisterFrame(source, geometry.GeometryFrame("peg"))
        self.width = float(peg.extents[:2].min())
        rigid, soft = geometry.ProximityProperties(), geometry.ProximityProperties()
        geometry.AddRigidHydroelasticProperties(properties=rigid)
        geometry.AddCompliantHydroelasticProperties(self.width, self.modulus, soft)
        shape, still = geometry.Mesh(os.path.join(folder, "drake-hole.obj")), RigidTransform()
        fixed = geometry.GeometryInstance(still, shape, "hole")
        fixed.set_proximity_properties(rigid)
        self.scene.RegisterAnchoredGeometry(source, fixed)
        shape = geometry.Convex(os.path.join(folder, "drake-peg.obj"))
        moving = geometry.GeometryInstance(still, shape, "peg")
        moving.set_proximity_properties(soft)
        self.peg = self.scene.RegisterGeometry(source, self.frame, moving)
        self.context = self.scene.CreateDefaultContext()
        self.port = self.scene.get_source_pose_port(source)

    def pose(self, row):
        poses = self.geometry.FramePoseVector()
        poses.set_value(self.frame, self.transform(matrix(row)))
        return self.value(poses)

    def query(self, pose):
        self.port.FixValue(self.context, pose)
        query = self.scene.get_query_output_port().Eval(self.context)
        kind = self.geometry.HydroelasticContactRepresentation.kTriangle
        return query.ComputeContactSurfaces(kind)

    def read(self, surfaces):
        if not surfaces:
            return False, 0.0, np.zeros(3)
        force, most = np.zeros(3), 0.0
        for surface in surfaces:
            mesh, field = surface.tri_mesh_W(), surface.tri_e_MN()
            pressure = np.array([field.EvaluateAtVertex(v) for v in range(mesh.num_vertices())])
            most = max(most, float(pressure.max()))
            # Normals point out of N into M.
            sense = 1.0 if surface.id_M() == self.peg else -1.0
            for t in range(mesh.num_triangles()):
                element = mesh.element(t)
                mean = np.mean([pressure[element.vertex(k)] for k in range(3)])
                force += sense * mean * mesh.area(t) * mesh.face_normal(t)
        return True, 0.5 * self.width * most / self.modulus, force


class Pegfit:
    """The product: from a table, or by direct quadrature."""

    def __init__(self, kind: str, spacing: float = 1e-3) -> None:
        self.kind, self.spacing = kind, spacing

    def set_up(self, hole, peg, folder: str) -> None:
        parts = [pegfit.Mesh(m.vertices, m.faces, unit="m") for m in (hole, peg)]
        reach = [0.004, 0.004, 0.036]
        pair = pegfit.Pair(*parts, spacing=self.spacing, half_extent=reach)
        if self.kind == "table":
            with tempfile.TemporaryDirectory() as place:
                path = os.path.join(place, "t.zarr")
                self.source = pair.bake(path, angle_deg=5, step_deg=2.5)
        else:
            self.source = pair.evaluator()
        self.out = pegfit.Response.empty(1)

    def pose(self, row):
        return row[None]

    def query(self, pose):
        return self.source.query(pose, threads=1, out=self.out)

    def read(self, found):
        self.torque = found.torque[0].copy()
        return None, float(found.energy[0]), found.force[0].copy()


#: By the name that the table gives them.
TOOLS = {
    "MuJoCo mesh": lambda: MuJoCo("mesh"),
    "MuJoCo sdf": lambda: MuJoCo("sdf"),
    "coal": Coal,
    "trimesh/FCL": Fcl,
    "Drake hydroelastic": Drake,
    "pegfit table": lambda: Pegfit("table"),
    "pegfit direct": lambda: Pegfit("direct"),
}
