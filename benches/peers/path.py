"""Removal paths by sampling planners beside `pegfit path`: same parts, frames and time limit.

    pip install -r benches/peers/path-requirements.txt
    cargo build --release -p pegfit -p pegfit-benches --bin pegfit --bin path
    target/release/path --scenes SCENES [--frames N] [--only PAIR]
    python benches/peers/path.py SCENES [--seconds S] [--shrink SHARE...] [--pegfit PROGRAM]
        [--page FILE]

The planners are OMPL's RRT-Connect and BIT* over SE(3), between the fit and a pose beside the fixed
part in a random direction; a pose is valid if coal finds no contact of the two surfaces, so that a
path that begins outside stays there. Poses along an edge are checked every hundredth of the moving
part's radius, by a function in Python. A path counts if all of its poses, ten times as dense, are
valid. The program reads scenes, computes no fields (`--solids-only`) and its seconds are the whole
run of the command; it takes overlaps of up to a thousandth of the radius for contact, the planners
none. Seconds are of processor time, over all threads, so that other work on the machine does not
count. Every try has the same limit; a try that ends without a path counts with it, and the ratio to the
command's median is then told as a bound. With `--shrink` the moving part is of such a share of its
size, about its middle: passages widen. What touches in its place, as a peg on the floor of its hole,
is left out: the planners could not begin. The captive ball is right if nothing is found.
"""

from __future__ import annotations

import argparse
import itertools
import json
import resource
import shutil
import subprocess
import tempfile
import textwrap
import time
import tomllib
from collections import defaultdict
from pathlib import Path

import coal
import numpy as np
from marks import rewrite
from ompl import base, geometric, util
from scipy.spatial.transform import Rotation

PLANNERS = {"RRT-Connect": geometric.RRTConnect, "BIT*": geometric.BITstar}


def read(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of an OBJ of triangles."""
    rows = [line.split() for line in path.read_text().splitlines()]
    vertices = [list(map(float, r[1:4])) for r in rows if r and r[0] == "v"]
    faces = [[int(x.split("/")[0]) - 1 for x in r[1:4]] for r in rows if r and r[0] == "f"]
    return np.array(vertices), np.array(faces)


def shrunk(folder: Path, share: float, into: Path) -> Path:
    """The scene of a smaller moving part in its fit."""
    there = into / f"{folder.name}-{share:g}"
    shutil.copytree(folder, there)
    vertices, faces = read(folder / "moving.obj")
    middle = vertices.mean(axis=0)
    lines = [f"v {x:.12g} {y:.12g} {z:.12g}" for x, y, z in middle + share * (vertices - middle)]
    lines += [f"f {a} {b} {c}" for a, b, c in faces + 1]
    (there / "moving.obj").write_text("\n".join(lines) + "\n")
    return there


def surface(vertices: np.ndarray, faces: np.ndarray) -> coal.BVHModelOBBRSS:
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(faces), len(vertices))
    model.addVertices(vertices)
    model.addTriangles(faces.astype(np.int64))
    model.endModel()
    return model


class Problem:
    """Two parts and the pose in which they fit."""

    def __init__(self, folder: Path) -> None:
        text = (folder / "scene.toml").read_text()
        self.name = text.splitlines()[0].removeprefix("# ")
        fit = tomllib.loads(text)["fit"]
        self.goal = np.array(fit["position"] + fit["rotation"])
        fixed, moving = read(folder / "fixed.obj"), read(folder / "moving.obj")
        # Poses of the planners are about the middle of the moving part.
        self.middle = moving[0].mean(axis=0)
        self.radius = np.linalg.norm(moving[0] - self.middle, axis=1).max()
        self.centre = 0.5 * (fixed[0].min(axis=0) + fixed[0].max(axis=0))
        self.reach = np.linalg.norm(fixed[0] - self.centre, axis=1).max() + 1.5 * self.radius
        self.fixed = surface(*fixed)
        self.moving = surface(moving[0] - self.middle, moving[1])
        self.request = coal.CollisionRequest()
        self.at = Rotation.from_quat(self.goal[3:]).apply(self.middle) + self.goal[:3]

    def free(self, place: np.ndarray, turn: np.ndarray) -> bool:
        pose = coal.Transform3s(Rotation.from_quat(turn).as_matrix(), place)
        result = coal.CollisionResult()
        coal.collide(self.moving, pose, self.fixed, coal.Transform3s(), self.request, result)
        return not result.isCollision()

    def outside(self, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        direction = rng.normal(size=3)
        place = self.centre + self.reach * direction / np.linalg.norm(direction)
        return place, Rotation.random(random_state=rng).as_quat()


def numbers(state) -> tuple[np.ndarray, np.ndarray]:
    turn = state.rotation()
    place = np.array([state.getX(), state.getY(), state.getZ()])
    return place, np.array([turn.x, turn.y, turn.z, turn.w])


def set_state(state, place: np.ndarray, turn: np.ndarray) -> None:
    state.setXYZ(*map(float, place))
    rotation = state.rotation()
    rotation.x, rotation.y, rotation.z, rotation.w = map(float, turn)


def plan(problem: Problem, planner, seconds: float, seed: int) -> tuple[bool, float]:
    """Whether a path was found that holds, and how long it took."""
    space = base.SE3StateSpace()
    bounds = base.RealVectorBounds(3)
    for k in range(3):
        bounds.setLow(k, float(problem.centre[k] - 1.2 * problem.reach))
        bounds.setHigh(k, float(problem.centre[k] + 1.2 * problem.reach))
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(lambda state: problem.free(*numbers(state)))
    information = setup.getSpaceInformation()
    resolution = 0.01 * problem.radius / space.getMaximumExtent()
    information.setStateValidityCheckingResolution(resolution)
    start, end = space.allocState(), space.allocState()
    set_state(start, problem.at, problem.goal[3:])
    set_state(end, *problem.outside(np.random.default_rng(seed)))
    setup.setStartAndGoalStates(start, end)
    # Any path will do: what goes on to shorten it ends there.
    objective = base.PathLengthOptimizationObjective(information)
    objective.setCostThreshold(base.Cost(float("inf")))
    setup.setOptimizationObjective(objective)
    setup.setPlanner(planner(information))
    began = time.process_time()
    over = base.PlannerTerminationCondition(lambda: time.process_time() - began > seconds)
    setup.solve(over)
    taken = time.process_time() - began
    if not setup.haveExactSolutionPath():
        return False, seconds
    path = setup.getSolutionPath()
    path.interpolate(int(10 * path.length() / (0.01 * problem.radius)) + 2)
    holds = all(problem.free(*numbers(state)) for state in path.getStates())
    return holds, taken if holds else seconds


def ours(folder: Path, program: str, seconds: float) -> tuple[bool, float]:
    words = [program, "path", str(folder / "scene.toml"), "--solids-only", "--json", "-q"]
    # The command's own limit is by the clock.
    words += ["--seconds", str(20 * seconds)]
    began = used()
    done = subprocess.run(words, capture_output=True, text=True)
    taken = used() - began
    if done.returncode != 0:
        raise RuntimeError(done.stderr)
    found = json.loads(done.stdout)["outcome"] == "free" and taken <= seconds
    return found, taken if found else seconds


def used() -> float:
    """Processor time of all programs that have run, seconds."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return children.ru_utime + children.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", type=Path)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--shrink", type=float, nargs="+", default=[1.0], metavar="SHARE")
    parser.add_argument("--pegfit", default="pegfit", metavar="PROGRAM")
    parser.add_argument("--page", type=Path, help="whose part between the marks is written afresh")
    args = parser.parse_args()
    util.setLogLevel(util.LogLevel.LOG_ERROR)
    util.RNG.setSeed(1)
    found: dict[tuple[str, str], dict[str, list[tuple[bool, float]]]] = {}
    folders = sorted(p.parent for p in args.scenes.glob("*/scene.toml"))
    with tempfile.TemporaryDirectory() as into:
        # A scene begins alike at all sizes.
        for (frame, folder), share in itertools.product(enumerate(folders), args.shrink):
            there = folder if share == 1 else shrunk(folder, share, Path(into))
            problem = Problem(there)
            if not problem.free(problem.at, problem.goal[3:]):
                print(there.name, "touches where it fits: left out", flush=True)
                continue
            of = found.setdefault((problem.name, f"{share:g}"), defaultdict(list))
            of["pegfit"].append(ours(there, args.pegfit, args.seconds))
            for name, planner in PLANNERS.items():
                of[name].append(plan(problem, planner, args.seconds, frame))
            print(there.name, {name: tries[-1] for name, tries in of.items()}, flush=True)
    columns = ["pair", "size", "tool", "tries", "found", "median, s", "times pegfit's"]
    lines = [f"| {' | '.join(columns)} |", "|" + "---|" * len(columns)]
    for (pair, share), of in found.items():
        medians = {name: float(np.median([s for _, s in tries])) for name, tries in of.items()}
        for name, tries in of.items():
            hits = sum(hit for hit, _ in tries)
            bound = "" if 2 * hits > len(tries) else "> "
            ratio = f"{bound}{medians[name] / medians['pegfit']:.2g}"
            cells = [pair, share, name, str(len(tries)), str(hits), f"{medians[name]:.3g}", ratio]
            lines.append(f"| {' | '.join(cells)} |")
    print("\n".join(lines))
    if args.page:
        head = (f"Processor seconds on one machine, a try's limit {args.seconds:g} s; what ended "
                "without a path counts with that. Size is that of the moving part beside the one that "
                "fits: the smaller, the wider the passage.")
        rewrite(args.page, "just path-peers", [*textwrap.wrap(head, 100), "", *lines])


if __name__ == "__main__":
    main()
