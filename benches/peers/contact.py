"""Contact of a peg and its hole by the tools that people use for it, side by side.

    pip install -r benches/peers/contact-requirements.txt && pip install .
    python benches/peers/contact.py [--quick] [--out FILE]

One run, one thread, the same seeded poses for all. `contact_tools.py` says what depth means for each
tool. Columns of the table:

- set-up: seconds and MiB (resident, of the process) until the first query can be asked;
- p50, p99: microseconds a query, energy or depth and force;
- false: share of the poses without overlap that the tool calls contact; missed: share of the poses
  with overlap that it does not. Overlap is the volume of the exact boolean (manifold3d): more than a
  millionth of the peg is overlap, none at all is none, between them is not counted;
- rises: along the straight way in, on the axis, from a length above the hole to the seat, the sum of
  what the depth, or pegfit's energy, rises by, over the size of its range (0: monotone);
- torque: largest difference between the torque and finite differences of the energy, over the largest
  torque; for tools without an energy there is nothing to compare;
- loop: work of the force around a closed loop, a circle of 0.5 mm across the axis where the peg is
  half in, over the sum of the absolute work on the way;
- pull: how far above the seat, in lengths of the peg, the force along the axis is still more than 1 %
  of its largest, looked for up to 1.15; 0 for tools that only push where there is contact.
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
import tempfile
import time

os.environ.setdefault("RAYON_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import trimesh

import pegfit
from contact_tools import TOOLS, Pegfit, matrix

LENGTH = 0.030
COLUMNS = ["pair", "clearance, mm", "triangles", "tool", "set-up, s", "MiB", "p50, µs", "p99, µs",
           "false, %", "missed, %", "rises", "torque", "loop", "pull"]


def random_poses(count: int) -> np.ndarray:
    """Up to 1 mm aside, from 5 mm above the seat to 35 mm, turned by up to 2 degrees."""
    rng = np.random.default_rng(7)
    axis = rng.normal(size=(count, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    half = 0.5 * np.radians(2) * rng.uniform(size=(count, 1)) ** (1 / 3)
    at = rng.uniform([-1e-3, -1e-3, 5e-3], [1e-3, 1e-3, 35e-3], (count, 3))
    # A third of them where the play of a hole lets a peg be.
    at[::3, :2] *= 0.1
    half[::3] *= 0.02
    return np.hstack([at, np.sin(half) * axis, np.cos(half)])


def meshes(section: str, clearance: float, triangles: int):
    """Hole and peg, their faces cut in four until there are as many as asked for."""
    found = []
    for mesh in pegfit.peg_in_hole(section, clearance):
        cut = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        while len(cut.faces) < triangles:
            cut = cut.subdivide()
        found.append(cut)
    return found


def overlaps(section: str, clearance: float, poses: np.ndarray) -> np.ndarray:
    """Volume of the exact boolean of the uncut meshes, over the peg's, at every pose."""
    import manifold3d

    solids = []
    for mesh in pegfit.peg_in_hole(section, clearance):
        raw = manifold3d.Mesh64(
            vert_properties=np.asarray(mesh.vertices), tri_verts=mesh.faces.astype(np.uint64)
        )
        solids.append(manifold3d.Manifold(raw))
    hole, peg = solids
    whole = peg.volume()
    share = lambda row: (hole ^ peg.transform(matrix(row)[:3])).volume() / whole  # noqa: E731
    return np.array([share(row) for row in poses])


def row(at) -> np.ndarray:
    return np.array([*at, 0.0, 0.0, 0.0, 1.0])


def rises(tool) -> float:
    values = np.array([tool.ask(row([0, 0, z]))[1] for z in np.linspace(LENGTH * 1.1, 0, 200)])
    size = np.ptp(values)
    return float(np.maximum(np.diff(values), 0).sum() / size) if size > 0 else 0.0


def loop(tool, steps: int = 240) -> float:
    angle = np.linspace(0, 2 * np.pi, steps + 1)
    at = np.stack([5e-4 * np.cos(angle), 5e-4 * np.sin(angle), np.full_like(angle, 0.015)], axis=1)
    forces = np.array([tool.ask(row(p))[2] for p in at])
    work = (0.5 * (forces[1:] + forces[:-1]) * np.diff(at, axis=0)).sum(axis=1)
    total = np.abs(work).sum()
    return float(abs(work.sum()) / total) if total > 0 else 0.0


def torque_error(tool, poses: np.ndarray) -> float:
    h, worst, largest = 1e-4, 0.0, 0.0
    for pose in poses:
        tool.ask(pose)
        torque = tool.torque
        for k in range(3):
            energies = []
            for sign in (1, -1):
                step = np.append(np.sin(0.5 * sign * h) * np.eye(3)[k], np.cos(0.5 * h))
                v, w, u, s = step[:3], step[3], pose[3:6], pose[6]
                turned = np.append(w * u + s * v + np.cross(v, u), w * s - v @ u)
                energies.append(tool.ask(np.append(pose[:3], turned))[1])
            slope = -(energies[0] - energies[1]) / (2 * h)
            worst = max(worst, abs(slope - torque[k]))
        largest = max(largest, float(np.linalg.norm(torque)))
    return worst / largest


def pull(tool) -> float:
    heights = np.linspace(0.0, 1.15 * LENGTH, 150)
    along = np.array([-tool.ask(row([0, 0, z]))[2][2] for z in heights])
    felt = heights[along > 0.01 * along.max()] if along.max() > 0 else heights[:0]
    return float(felt.max() / LENGTH) if len(felt) else 0.0


def resident() -> float:
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize() / 2**20


def measure(tool, parts, poses, share, folder) -> list:
    before, began = resident(), time.perf_counter()
    tool.set_up(*parts, folder)
    tool.ask(poses[0])
    seconds, memory = time.perf_counter() - began, resident() - before
    times, touches = [], []
    for pose in poses:
        start = time.perf_counter()
        touch, _, _ = tool.ask(pose)
        times.append(time.perf_counter() - start)
        touches.append(touch)
    p50, p99 = 1e6 * np.quantile(times, [0.5, 0.99])
    said = "-", "-"
    if not isinstance(tool, Pegfit):
        touches = np.array(touches, bool)
        free, deep = share <= 0, share > 1e-6
        wrong = [touches[free].mean() if free.any() else np.nan,
                 (~touches[deep]).mean() if deep.any() else np.nan]
        said = tuple(f"{100 * w:.1f}" for w in wrong)
    torque, reach = "-", "0"
    if isinstance(tool, Pegfit):
        torque, reach = f"{torque_error(tool, poses[:50]):.3f}", f"{pull(tool):.2f}"
    return [f"{seconds:.2f}", f"{memory:.0f}", f"{p50:.1f}", f"{p99:.1f}", *said,
            f"{rises(tool):.3f}", torque, f"{loop(tool):.3f}", reach]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few poses, one pair, few triangles")
    parser.add_argument("--out", help="file for the table, Markdown (default: standard output)")
    options = parser.parse_args()
    count = 300 if options.quick else 10_000
    sections = ["rectangular"] if options.quick else ["circular", "rectangular", "combined"]
    clearances = [0.0, 1e-4] if options.quick else [0.0, 5e-5, 1e-4, 5e-4]
    sizes = [400] if options.quick else [400, 10_000, 100_000]
    poses = random_poses(count)
    out = open(options.out, "w", encoding="utf-8") if options.out else sys.stdout
    print("| " + " | ".join(COLUMNS) + " |", file=out)
    print("|" + "---|" * len(COLUMNS), file=out, flush=True)
    for section in sections:
        for clearance in clearances:
            share = overlaps(section, clearance, poses)
            for size in sizes:
                parts = meshes(section, clearance, size)
                for make in TOOLS:
                    tool = make()
                    with tempfile.TemporaryDirectory() as folder:
                        try:
                            found = measure(tool, parts, poses, share, folder)
                        except (ImportError, NotImplementedError) as why:
                            found = [str(why)] + [""] * 9
                    cells = [section, f"{1e3 * clearance:g}", str(size), tool.name, *found]
                    print("| " + " | ".join(cells) + " |", file=out, flush=True)


if __name__ == "__main__":
    main()
