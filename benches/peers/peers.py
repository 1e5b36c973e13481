#!/usr/bin/env python3
"""Signed distance on a lattice: pegfit beside Open3D, libigl and parry3d, in one run.

    pip install -r benches/peers/requirements.txt
    cargo build --release -p pegfit-benches --features peers --bin peers
    python benches/peers/peers.py [--fixtures fixtures] [--points 64] [--triangles 10000 100000]

Every mesh is refined by halving edges until it has about as many triangles as asked for; every
method gets the same mesh and points. `pegfit, lattice` (distance alone) and `with density` build
their tree within the query. Times are the best of --repeat, all threads. Errors are
against brute force in f64 on every 97th point, in sizes of the part. Signs are counted as wrong
where the distance is above 1e-6 sizes.
"""
import argparse
import json
import pathlib
import subprocess
import tempfile
import time

import igl
import numpy as np
import open3d as o3d

METHODS = ["pegfit, lattice", "pegfit, with density", "pegfit, points", "parry3d", "open3d", "libigl"]


def read_obj(path):
    rows = [line.split() for line in path.read_text().splitlines()]
    vertices = np.array([[float(x) for x in r[1:4]] for r in rows if r and r[0] == "v"])
    faces = np.array([[int(i) - 1 for i in r[1:4]] for r in rows if r and r[0] == "f"])
    return vertices, faces


def refined(vertices, faces, wanted):
    """Edges halved while that brings the number of triangles nearer to `wanted`, in ratio."""
    while len(faces) * 2 <= wanted:
        vertices, faces = igl.upsample(vertices, faces)
    return np.ascontiguousarray(vertices), np.ascontiguousarray(faces, dtype=np.int64)


def open3d_distance(vertices, faces, points):
    began = time.perf_counter()
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor(vertices.astype(np.float32)), o3d.core.Tensor(faces.astype(np.uint32))
    )
    # The tree is built at the first query.
    scene.compute_signed_distance(o3d.core.Tensor(np.zeros((1, 3), np.float32)))
    build = time.perf_counter() - began
    queries = o3d.core.Tensor(points.astype(np.float32))
    began = time.perf_counter()
    distance = scene.compute_signed_distance(queries).numpy()
    return distance.astype(float), build, time.perf_counter() - began


def libigl_distance(vertices, faces, points):
    """Builds its trees within the call: build time is what a call with one point takes."""
    kind = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_FAST_WINDING_NUMBER
    began = time.perf_counter()
    igl.signed_distance(points[:1], vertices, faces, sign_type=kind)
    build = time.perf_counter() - began
    began = time.perf_counter()
    distance = igl.signed_distance(points, vertices, faces, sign_type=kind)[0]
    return distance, build, max(time.perf_counter() - began - build, 1e-9)


def ours(program, vertices, faces, lattice, folder):
    mesh = folder / "mesh.obj"
    with mesh.open("w") as out:
        out.writelines(f"v {x!r} {y!r} {z!r}\n" for x, y, z in vertices.tolist())
        out.writelines(f"f {a} {b} {c}\n" for a, b, c in (faces + 1).tolist())
    origin, spacing, n = lattice
    words = [program, mesh, folder, *map(repr, map(float, origin)), repr(float(spacing)), str(n)]
    said = subprocess.run(words, check=True, capture_output=True, text=True).stdout
    values = {name: np.fromfile(folder / f"{name}.f64") for name, _ in json.loads(said)}
    return {
        name: (values[name], t["build"], t["query"]) for name, t in json.loads(said)
    }, np.fromfile(folder / "exact.f64")


def compare(name, vertices, faces, n, repeat, program):
    low, high = vertices.min(0), vertices.max(0)
    size = (high - low).max()
    spacing = 1.5 * size / n
    # Off the symmetries of the part, so that no point lies on a face by design.
    origin = 0.5 * (low + high) - 0.75 * size + spacing * np.array([0.31, 0.37, 0.43])
    axis = np.arange(n) * spacing
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    points = np.ascontiguousarray(origin + grid)
    runs = []
    for _ in range(repeat):
        with tempfile.TemporaryDirectory() as folder:
            found, exact = ours(program, vertices, faces, (origin, spacing, n), pathlib.Path(folder))
        found["open3d"] = open3d_distance(vertices, faces, points)
        found["libigl"] = libigl_distance(vertices, faces, points)
        runs.append(found)
    print(f"\n{name}: {len(faces)} triangles, {len(points)} points")
    print(f"{'':22}{'build s':>10}{'query s':>10}{'ns/point':>10}{'ratio':>8}"
          f"{'max error':>12}{'wrong signs':>13}")
    base = min(run["pegfit, lattice"][2] for run in runs)
    for method in METHODS:
        build = min(run[method][1] for run in runs)
        query = min(run[method][2] for run in runs)
        distance = runs[0][method][0][::97]
        error = np.abs(np.abs(distance) - np.abs(exact)).max() / size
        far = np.abs(exact) > 1e-6 * size
        wrong = int((np.sign(distance) != np.sign(exact))[far].sum())
        print(f"{method:22}{build:10.4f}{query:10.4f}{1e9 * query / len(points):10.0f}"
              f"{query / base:8.2f}{error:12.1e}{wrong:8} / {int(far.sum())}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--fixtures", type=pathlib.Path, default=pathlib.Path("fixtures"))
    parser.add_argument("--program", default="target/release/peers")
    parser.add_argument("--points", type=int, default=64, help="along each axis")
    parser.add_argument("--triangles", type=int, nargs="+", default=[10_000, 100_000])
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--only", default="", help="meshes whose name contains this")
    args = parser.parse_args()
    print("ratio: time of the method over that of `pegfit, lattice`; above 1 it is slower")
    for path in sorted(args.fixtures.glob("*.obj")):
        if args.only not in path.name:
            continue
        for wanted in args.triangles:
            mesh = refined(*read_obj(path), wanted)
            compare(path.stem, *mesh, args.points, args.repeat, args.program)


if __name__ == "__main__":
    main()
