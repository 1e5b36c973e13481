"""Rates of Table.query beside those of the Rust library and of the command, and what one call costs.

    just python-bench

Uses the installed package. PEGFIT_RATE is the program `rate` of pegfit-benches; without it, and
without a `pegfit` on the path, the package is measured alone.
"""

from __future__ import annotations

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

POSES = 1_000_000


def random_poses(count: int) -> np.ndarray:
    """Within 8 mm and 9 degrees of the fit."""
    rng = np.random.default_rng(1)
    axis = rng.normal(size=(count, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    half = 0.5 * np.radians(9) * rng.uniform(size=(count, 1)) ** (1 / 3)
    return np.hstack([rng.uniform(-8e-3, 8e-3, (count, 3)), np.sin(half) * axis, np.cos(half)])


def best(call, times: int = 3) -> float:
    """Seconds of the fastest of some calls."""
    taken = []
    for _ in range(times):
        began = time.perf_counter()
        call()
        taken.append(time.perf_counter() - began)
    return min(taken)


def per_call(call, count: int = 20_000) -> float:
    """Microseconds per call."""
    began = time.perf_counter()
    for _ in range(count):
        call()
    return 1e6 * (time.perf_counter() - began) / count


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


def main() -> None:
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, "
          f"Python {platform.python_version()}, numpy {np.__version__}")
    pair = pegfit.Pair(*pegfit.peg_in_hole("rectangular"), spacing=0.001)
    poses = random_poses(POSES)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "t.zarr"
        table = pair.bake(path, half_extent=0.01, angle_deg=10, step_deg=2.5)
        print(table)
        out = pegfit.Response.empty(POSES)
        rates = [POSES / best(lambda: table.query(poses, threads=n, out=out)) for n in (1, None)]
        print(f"Table.query      one thread {rates[0]:>10.0f}/s   all threads {rates[1]:>10.0f}/s")
        program = os.environ.get("PEGFIT_RATE")
        if program:
            raw = Path(folder) / "poses.f64"
            poses.tofile(raw)
            said = subprocess.run([program, path, raw], capture_output=True, text=True, check=True)
            rust = [float(word) for word in said.stdout.split()]
            print(f"Rust             one thread {rust[0]:>10.0f}/s   all threads {rust[1]:>10.0f}/s")
            shares = [100 * a / b for a, b in zip(rates, rust)]
            print(f"share            one thread {shares[0]:>9.1f} %   all threads {shares[1]:>9.1f} %")
        command = shutil.which("pegfit")
        if command:
            rows = Path(folder) / "in.csv"
            few = poses[:100_000]
            np.savetxt(rows, few, "%.17g", ",", header="x,y,z,qx,qy,qz,qw", comments="")
            words = [command, "score", "--table", path, "--poses", rows, "-o", f"{folder}/out.csv", "-q"]
            taken = best(lambda: subprocess.run(words, check=True, capture_output=True))
            print(f"pegfit score     from and to CSV, all threads, start included "
                  f"{len(few) / taken:>10.0f}/s")
        one, single = poses[:1], pegfit.Response.empty(1)
        alone = best(lambda: table.query(poses[:200_000], threads=1, out=None)) / 200_000 * 1e6
        print(f"one pose         {per_call(lambda: table.query(one)):.2f} µs a call, "
              f"{per_call(lambda: table.query(one, out=single)):.2f} µs with out, "
              f"of which {alone:.2f} µs is the query")
        fine = pegfit.Pair(*pegfit.peg_in_hole("combined"), spacing=0.0005)
        fine.correlate(window=0.001)
        evaluator = fine.evaluator()
        for name, call in [
            ("density", lambda: pegfit.density(pegfit.peg_in_hole("combined")[0], spacing=1e-4)),
            ("bake", lambda: fine.bake(Path(folder) / "u.zarr", step_deg=2.0)),
            ("dock", lambda: fine.dock(exhaustive=True)),
            ("query", lambda: evaluator.query(poses)),
        ]:
            print(f"Ctrl-C in {name:<8}{interrupt(call):>6.1f} ms")


if __name__ == "__main__":
    main()
