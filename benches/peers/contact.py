"""Contact of a peg and its hole by the tools that people use for it, side by side.

    pip install -r benches/peers/contact-requirements.txt && pip install .
    python benches/peers/contact.py [--quick] [--minutes M] [--page FILE]

One thread, the same seeded poses for all, a process of its own for each row. `contact_tools.py` says
what depth means for each tool. Columns:

- set-up: seconds and MiB (resident) until the first query has been answered;
- poses: how many of the random poses were asked within the time given for a row;
- p50, p99: microseconds of the query itself; times are those of the processor, so that what else runs
  on the machine matters little;
- false: share of the poses without overlap that the tool calls contact; missed: share of the poses
  with overlap that it does not. Overlap is the volume of the exact boolean (manifold3d): more than a
  millionth of the peg is overlap, none at all is none, between them is not counted;
- rises: along the straight insertion path, on the axis, from a length above the hole to the seat,
  the sum of what the depth, or pegfit's energy, rises by, over the size of its range (0: it falls
  all the way, as an energy should; 1: it rises all the way, as minus a distance should; else it
  goes up and down);
- torque: largest difference between the torque and finite differences of the energy, over the largest
  torque; for tools without an energy there is nothing to compare;
- loop: work of the force around a closed loop, a circle of 0.5 mm across the axis where the peg is
  half in, over the sum of the absolute work on the way;
- pull: how far above the seat, in lengths of the peg, the force along the axis is still more than 1 %
  of its largest, looked for up to 1.15; 0 for tools that only push where there is contact.

Rows that are in the file of results already are not measured again, so it can be run in pieces.
"""

from __future__ import annotations

import argparse
import csv
import multiprocessing
import os
import resource
import signal
import tempfile
import time
from pathlib import Path

for variable in ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

from contact_cases import meshes, overlaps, random_poses
from contact_measures import measure
from contact_page import COLUMNS, write_page
from contact_tools import TOOLS

SECTIONS = ["circular", "rectangular", "combined"]
CLEARANCES = [0.0, 5e-5, 1e-4, 5e-4]
TRIANGLES = [400, 10_000, 100_000]

#: Where sizes and clearances cross: these rows come first, then the sizes and the clearances that the
#: page has.
MIDDLE = 1e-4, 400


def cases(options) -> list[tuple[str, float, int, str]]:
    every = [
        (section, clearance, size, name)
        for section in options.sections
        for clearance in options.clearances
        for size in options.triangles
        for name in options.tools
    ]
    return sorted(every, key=lambda case: (case[1] != MIDDLE[0]) * 2 + (case[2] != MIDDLE[1]))


def child(sender, case, poses, share, options) -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (options.limit, options.limit + 1))
    section, clearance, size, name = case
    parts = meshes(section, clearance, size)
    try:
        with tempfile.TemporaryDirectory() as folder:
            found = measure(TOOLS[name](), parts, poses, share, folder, options.seconds)
    except NotImplementedError as why:
        found = {"note": str(why)}
    except RuntimeError as why:
        # The tool's own.
        said = " ".join(str(why).split())
        found = {"note": f"it fails: {said.split('=')[0].strip()}"}
    sender.send(found)


def row_of(case, poses, share, options) -> dict:
    """One row, measured in a process of its own, which the kernel ends if it takes too long."""
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=child, args=(sender, case, poses, share, options))
    process.start()
    sender.close()
    try:
        found = receiver.recv()
    except EOFError:
        process.join()
        found = {"note": f"ended by signal {-process.exitcode}"}
        if process.exitcode in (-signal.SIGXCPU, -signal.SIGKILL):
            found["note"] = f"not done in {options.limit} s"
    process.join()
    section, clearance, size, name = case
    start = {"pair": section, "clearance": f"{1e3 * clearance:g}", "triangles": size, "tool": name}
    return {**start, **found}


def key(row: dict) -> tuple[str, ...]:
    return tuple(str(row[name]) for name in COLUMNS[:4])


def read(path: Path) -> list[dict]:
    if not path.exists():
        return []
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def run(options, path: Path) -> None:
    began = time.monotonic()
    done = {key(row) for row in read(path)}
    poses = random_poses(options.poses)
    new = not path.exists()
    with open(path, "a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS)
        if new:
            writer.writeheader()
        for case in cases(options):
            section, clearance, size, name = case
            if (section, f"{1e3 * clearance:g}", str(size), name) in done:
                continue
            if time.monotonic() - began > 60 * options.minutes:
                print("rows are left: run it again")
                return
            share = overlaps(section, clearance, poses, path.parent)
            row = row_of(case, poses, share, options)
            writer.writerow(row)
            file.flush()
            print(*key(row), *(f"{k} {v}" for k, v in list(row.items())[4:]), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("--quick", action="store_true", help="few poses, one pair, few triangles")
    add("--out", default="out/contact-peers", help="folder of results")
    add("--page", help="file whose part between the marks is written afresh")
    add("--minutes", type=float, default=1e9, help="begin no row after so long")
    add("--seconds", type=float, default=60.0, help="processor seconds of random poses a row")
    add("--limit", type=int, default=900, help="processor seconds after which a row is given up")
    add("--poses", type=int, default=10_000)
    add("--sections", nargs="+", default=SECTIONS, choices=SECTIONS)
    add("--clearances", nargs="+", type=float, default=CLEARANCES, help="metres")
    add("--triangles", nargs="+", type=int, default=TRIANGLES)
    add("--tools", nargs="+", default=list(TOOLS), choices=list(TOOLS))
    options = parser.parse_args()
    if options.quick:
        options.poses, options.sections = 300, ["rectangular"]
        options.clearances, options.triangles = [0.0, 1e-4], [400]
    folder = Path(options.out)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / ("quick.csv" if options.quick else "rows.csv")
    run(options, path)
    if options.page:
        write_page(Path(options.page), read(path), MIDDLE)


if __name__ == "__main__":
    main()
