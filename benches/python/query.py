"""Rates of Table.query beside those of the Rust library and of the command, and what one call costs.

    just python-bench

Uses the installed package. PEGFIT_RATE is the program `rate` of pegfit-benches; without it, and
without a `pegfit` on the path, the package is measured alone. Both answer the same pieces of the same
poses in turns, and the fastest of three of each piece counts. On one thread that is seconds of the
processor, so that what else runs on the machine matters little; on all threads it is the clock's, which
wants a quiet machine.
"""

from __future__ import annotations

import argparse
import os
import platform
import shutil
import signal
import subprocess
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

import pegfit

#: Poses of a piece.
PIECE = 50_000


def random_poses(count: int, low, high) -> np.ndarray:
    """Within a box, turned by up to 4 degrees."""
    rng = np.random.default_rng(1)
    axis = rng.normal(size=(count, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    half = 0.5 * np.radians(4) * rng.uniform(size=(count, 1)) ** (1 / 3)
    return np.hstack([rng.uniform(low, high, (count, 3)), np.sin(half) * axis, np.cos(half)])


def timed(call, clock=time.perf_counter) -> float:
    """Seconds of one call."""
    began = clock()
    call()
    return clock() - began


def best(call, times: int = 3) -> float:
    """Seconds of the fastest of some calls."""
    return min(timed(call) for _ in range(times))


def per_call(call, count: int = 4000) -> float:
    """Microseconds of the processor per call."""

    def many() -> None:
        for _ in range(count):
            call()

    return 1e6 * min(timed(many, time.process_time) for _ in range(5)) / count


class Rust:
    """The program `rate` on a table and poses."""

    def __init__(self, program: str, table: Path, poses: Path) -> None:
        words, pipe = [program, table, poses], subprocess.PIPE
        self.process = subprocess.Popen(words, stdin=pipe, stdout=pipe, text=True)

    def seconds(self, first: int, count: int, threads: str) -> float:
        """Of the processor for one thread, of the clock for all."""
        before = self._busy()
        self.process.stdin.write(f"{first} {count} {threads}\n")
        self.process.stdin.flush()
        elapsed = float(self.process.stdout.readline())
        return elapsed if threads == "all" else self._busy() - before

    def _busy(self) -> float:
        tasks = Path(f"/proc/{self.process.pid}/task").glob("*/schedstat")
        return 1e-9 * sum(int(task.read_text().split()[0]) for task in tasks)

    def close(self) -> None:
        self.process.communicate()


def compare(name: str, table, poses: np.ndarray, folder: Path) -> None:
    """Prints the rates at these poses."""
    program = os.environ.get("PEGFIT_RATE")
    rust = None
    if program:
        poses.tofile(folder / "poses.f64")
        rust = Rust(program, Path(table.path), folder / "poses.f64")
    for threads, number, clock in (
        ("one", 1, time.process_time),
        ("all", None, time.perf_counter),
    ):
        ours = theirs = 0.0
        for first in range(0, len(poses), PIECE):
            piece = poses[first : first + PIECE]
            out = pegfit.Response.empty(len(piece))
            taken = []
            for _ in range(3):
                python = timed(lambda: table.query(piece, threads=number, out=out), clock)
                taken.append((python, rust.seconds(first, len(piece), threads) if rust else 0.0))
            ours += min(t for t, _ in taken)
            theirs += min(t for _, t in taken)
        text = f"{name}, {len(poses)} poses, threads: {threads:<4}Python {len(poses) / ours:>9.0f}/s"
        if rust:
            text += f"   Rust {len(poses) / theirs:>9.0f}/s   share {100 * theirs / ours:>5.1f} %"
        print(text, flush=True)
    if rust:
        rust.close()


def command(table, poses: np.ndarray, folder: Path) -> None:
    """Prints the rate of the command on the path."""
    program = shutil.which("pegfit")
    if not program:
        return
    rows = folder / "in.csv"
    np.savetxt(rows, poses, "%.17g", ",", header="x,y,z,qx,qy,qz,qw", comments="")
    words = [program, "score", "--table", table.path, "--poses", rows, "-o", folder / "out.csv", "-q"]
    taken = best(lambda: subprocess.run(words, check=True, capture_output=True))
    print(f"pegfit score, from and to CSV, start included: {len(poses) / taken:.0f}/s", flush=True)


def interrupt(call, after: float = 0.7) -> float:
    """Milliseconds from Ctrl-C to the exception."""
    sent = []

    def send() -> None:
        sent.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    threading.Timer(after, send).start()
    try:
        call()
    except KeyboardInterrupt:
        return 1e3 * (time.perf_counter() - sent[0])
    raise SystemExit("it ended before Ctrl-C came")


def one_pose(table, pose: np.ndarray) -> None:
    """Prints what a call for a single pose costs beyond the query."""
    out, many = pegfit.Response.empty(1), np.tile(pose, (100_000, 1))
    times = (timed(lambda: table.query(many, threads=1), time.process_time) for _ in range(5))
    alone = 1e6 * min(times) / len(many)
    plain = per_call(lambda: table.query(pose))
    reused = per_call(lambda: table.query(pose, out=out))
    print(f"one pose: {plain:.2f} µs a call, {reused:.2f} µs with out; the query itself {alone:.2f} µs")


def ctrl_c(table, folder: Path) -> None:
    """Prints how soon long calls end."""
    fine = pegfit.Pair(*pegfit.peg_in_hole("combined"), spacing=0.0005)
    fine.correlate(window=0.001)
    evaluator = fine.evaluator()
    hole, poses = pegfit.peg_in_hole("combined")[0], random_poses(1_000_000, -8e-3, 8e-3)
    for name, call in [
        ("density", lambda: pegfit.density(hole, spacing=1e-4)),
        ("bake", lambda: fine.bake(folder / "u.zarr", step_deg=2.0)),
        ("dock", lambda: fine.dock(exhaustive=True)),
        ("query", lambda: evaluator.query(poses)),
    ]:
        print(f"Ctrl-C in {name}: {interrupt(call):.1f} ms", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--free", type=int, default=1_000_000, help="poses out of contact")
    parser.add_argument("--contact", type=int, default=1_000_000, help="poses in contact")
    options = parser.parse_args()
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, "
          f"Python {platform.python_version()}, numpy {np.__version__}")
    pair = pegfit.Pair(*pegfit.peg_in_hole("rectangular"), spacing=0.001)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        reach = [0.01, 0.01, 0.04]
        table = pair.bake(folder / "t.zarr", half_extent=reach, angle_deg=5, step_deg=2.5)
        print(table, flush=True)
        free = random_poses(options.free, [-8e-3, -8e-3, 36e-3], [8e-3, 8e-3, 39e-3])
        compare("out of contact", table, free, folder)
        touching = random_poses(options.contact, -8e-3, 8e-3)
        compare("in contact", table, touching, folder)
        command(table, touching[:100_000], folder)
        one_pose(table, free[:1])
        ctrl_c(table, folder)


if __name__ == "__main__":
    main()
