#!/usr/bin/env python3
"""One rotation of an exhaustive search: pegfit beside pyTME, in one run.

    pip install -r benches/peers/requirements.txt
    cargo build --release -p pegfit-benches --bin correlate
    python benches/peers/correlation.py [--sizes 64 96 128]

pyTME correlates one real grid (its `CC` score: one transform in, one back) with linear resampling of
the template; pegfit two (2 + 1 transforms) for the real part of a product of complex fields. Template
and target have N/2 points along each axis, transforms N. Both run on one thread; pegfit one rotation
by itself, and four at a time that differ by half turns, as in a search. pyTME's time is the slope
between a few and many rotations, so that its preparation does not count.
"""
import argparse
import csv
import os
import pathlib
import subprocess
import tempfile
import time

for name in ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"]:
    os.environ[name] = "1"

import numpy as np
from scipy.spatial.transform import Rotation
from tme.matching_data import MatchingData
from tme.matching_exhaustive import MATCHING_EXHAUSTIVE_REGISTER, match_exhaustive
from tme.analyzer import MaxScoreOverRotations


def pytme_seconds(n, rotations):
    """Seconds of a search over so many rotations, preparation included."""
    draw = np.random.default_rng(1)
    grid = lambda side: draw.standard_normal((side,) * 3).astype(np.float32)
    matrices = Rotation.random(rotations, random_state=2).as_matrix().astype(np.float32)
    # Padded to n points: the sum of both sides less one.
    data = MatchingData(target=grid(n // 2), template=grid(n // 2 + 1), rotations=matrices)
    setup, score = MATCHING_EXHAUSTIVE_REGISTER["CC"]
    began = time.perf_counter()
    match_exhaustive(
        data, score, setup, MaxScoreOverRotations, job_schedule=(1, 1), pad_target_edges=True,
        interpolation_order=1,
    )
    return time.perf_counter() - began


def pytme_per_rotation(n, repeat):
    few, many = 2, max(10, 3_000_000 // n**2 // 10)
    pytme_seconds(n, few)  # plans and compiles
    slopes = [
        (pytme_seconds(n, many) - pytme_seconds(n, few)) / (many - few) for _ in range(repeat)
    ]
    return min(slopes)


def ours(program, sizes):
    """Seconds per rotation on one thread by size and rotations at once, half support and window."""
    with tempfile.TemporaryDirectory() as out:
        words = [program, "--out", out, *map(str, sizes)]
        subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
        with (pathlib.Path(out) / "correlate.csv").open() as file:
            rows = list(csv.DictReader(file))
    return {
        (int(r["n"]), int(r["at_once"])): 1e-3 * float(r["total_ms"])
        for r in rows
        if r["case"] == "half" and r["threads"] == "1"
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", default="target/release/correlate")
    parser.add_argument("--sizes", type=int, nargs="+", default=[64, 96, 128])
    parser.add_argument("--repeat", type=int, default=3)
    args = parser.parse_args()
    mine = ours(args.program, args.sizes)
    print(f"{'N':>4}{'at once':>9}{'pegfit ms':>11}{'pyTME ms':>10}{'ratio':>8}")
    for n in args.sizes:
        theirs = pytme_per_rotation(n, args.repeat)
        for at_once in [1, 4]:
            own = mine[n, at_once]
            print(f"{n:4}{at_once:9}{1e3 * own:11.2f}{1e3 * theirs:10.2f}{own / theirs:8.3f}")


if __name__ == "__main__":
    main()
