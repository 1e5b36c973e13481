"""Pairs, poses and what is true of them: the same for every tool."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

import pegfit

LENGTH = 0.030


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


def row(at) -> np.ndarray:
    """The pose that only displaces."""
    return np.array([*at, 0.0, 0.0, 0.0, 1.0])


def random_poses(count: int) -> np.ndarray:
    """Up to 1 mm aside, from 5 mm above the seat to 35 mm, turned by up to 2 degrees: the first of
    more poses are the same ones."""
    poses = np.empty((count, 7))
    for n in range(count):
        rng = np.random.default_rng([7, n])
        axis = rng.normal(size=3)
        half = 0.5 * np.radians(2) * rng.uniform() ** (1 / 3)
        at = rng.uniform([-1e-3, -1e-3, 5e-3], [1e-3, 1e-3, 35e-3])
        if n % 3 == 0:
            # A third of them where the play of a hole lets a peg be.
            at[:2] *= 0.1
            half *= 0.02
        poses[n] = [*at, *(np.sin(half) * axis / np.linalg.norm(axis)), np.cos(half)]
    return poses


def meshes(section: str, clearance: float, triangles: int) -> list[trimesh.Trimesh]:
    """Hole and peg, their faces cut in four until there are as many as asked for."""
    found = []
    for mesh in pegfit.peg_in_hole(section, clearance):
        cut = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        while len(cut.faces) < triangles:
            cut = cut.subdivide()
        found.append(cut)
    return found


def overlaps(section: str, clearance: float, poses: np.ndarray, folder: Path) -> np.ndarray:
    """Volume of the exact boolean of the uncut meshes, over the peg's, at every pose; kept in a file
    of the folder."""
    import manifold3d

    kept = folder / f"overlap-{section}-{1e6 * clearance:g}-{len(poses)}.npy"
    if kept.exists():
        return np.load(kept)
    solids = []
    for mesh in pegfit.peg_in_hole(section, clearance):
        raw = manifold3d.Mesh64(
            vert_properties=np.asarray(mesh.vertices), tri_verts=mesh.faces.astype(np.uint64)
        )
        solids.append(manifold3d.Manifold(raw))
    hole, peg = solids
    whole = peg.volume()
    shares = [(hole ^ peg.transform(matrix(at)[:3])).volume() / whole for at in poses]
    np.save(kept, shares)
    return np.array(shares)
