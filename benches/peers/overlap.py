"""Overlap along insertion paths against exact booleans of the meshes.

    pip install -r benches/peers/path-requirements.txt
    cargo build --release -p pegfit -p pegfit-benches --bin pegfit --bin path
    target/release/path --scenes SCENES [--frames N] [--only PAIR]
    python benches/peers/overlap.py SCENES [--poses N] [--seconds S] [--pegfit PROGRAM] [--out FILE]

For each scene `pegfit path` looks for a path, solids only; manifold3d intersects the two solids at poses
evenly spread along it and at the deepest one, and, where they overlap at all, the volumes are compared
with the command's. A path that is called free may overlap by its tolerance; the layer of that thickness
on the whole moving part is the most that its volume could be.
"""

from __future__ import annotations

import argparse
import csv
import json
import subprocess
import tomllib
from collections import defaultdict
from pathlib import Path

import manifold3d
import numpy as np
from scipy.spatial.transform import Rotation

COLUMNS = "| pair | paths | free | poses | most shared, mm³ | said, mm³ | tolerance layer, mm³ |"


def read(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (mm) and faces of an OBJ of triangles."""
    rows = [line.split() for line in path.read_text().splitlines()]
    vertices = [list(map(float, r[1:4])) for r in rows if r and r[0] == "v"]
    faces = [[int(x.split("/")[0]) - 1 for x in r[1:4]] for r in rows if r and r[0] == "f"]
    return 1e3 * np.array(vertices), np.array(faces, dtype=np.uint64)


def solid(vertices: np.ndarray, faces: np.ndarray) -> manifold3d.Manifold:
    made = manifold3d.Manifold(manifold3d.Mesh64(vertices, faces))
    if made.status() != manifold3d.Error.NoError:
        raise RuntimeError(f"no solid: {made.status()}")
    return made


def area(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, k].astype(int)] for k in range(3))
    return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


def shared(fixed: manifold3d.Manifold, moving: tuple[np.ndarray, np.ndarray], pose) -> float:
    """Volume, mm³, at a pose of seven numbers in metres."""
    turned = Rotation.from_quat(pose[3:]).apply(moving[0]) + 1e3 * np.array(pose[:3])
    return (fixed ^ solid(turned, moving[1])).volume()


def look(folder: Path, program: str, seconds: float) -> tuple[dict, list[list[float]]]:
    """What the command says, and the poses of its path."""
    path = folder / "path.csv"
    words = [program, "path", str(folder / "scene.toml"), "--solids-only", "--json", "-q"]
    words += ["--seconds", str(seconds), "-o", str(path)]
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(done.stderr)
    with path.open() as rows:
        poses = [[float(x) for x in row[:7]] for row in list(csv.reader(rows))[1:]]
    return json.loads(done.stdout), poses


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", type=Path)
    parser.add_argument("--poses", type=int, default=60)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--pegfit", default="pegfit", metavar="PROGRAM")
    parser.add_argument("--out", type=Path)
    args = parser.parse_args()
    rows: dict[str, list[tuple[bool, int, float, float, float]]] = defaultdict(list)
    for folder in sorted(p.parent for p in args.scenes.glob("*/scene.toml")):
        name = (folder / "scene.toml").read_text().splitlines()[0].removeprefix("# ")
        said, poses = look(folder, args.pegfit, args.seconds)
        if not poses:
            continue
        fixed = solid(*read(folder / "fixed.obj"))
        moving = read(folder / "moving.obj")
        some = np.unique(np.linspace(0, len(poses) - 1, args.poses).round().astype(int))
        chosen = [poses[i] for i in some]
        if said["deepest_at"]:
            chosen.append(said["deepest_at"])
        most = max(shared(fixed, moving, pose) for pose in chosen)
        layer = 1e3 * said["tolerance"] * area(*moving)
        row = (said["outcome"] == "free", len(chosen), most, 1e9 * said["overlap_volume"], layer)
        rows[name].append(row)
        print(folder.name, said["outcome"], *(f"{x:.3g}" for x in row[1:]), flush=True)
    lines = [COLUMNS, "|---|---|---|---|---|---|---|"]
    for name, all_of in rows.items():
        free, count, most, told, layer = (np.array(x) for x in zip(*all_of, strict=True))
        numbers = f"{most.max():.2g} | {told.max():.2g} | {layer.min():.2g}"
        lines.append(f"| {name} | {len(free)} | {free.sum()} | {count.sum()} | {numbers} |")
    text = "\n".join(lines)
    print(text)
    if args.out:
        args.out.write_text(text + "\n")


if __name__ == "__main__":
    main()
