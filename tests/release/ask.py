"""What an installed package is asked, and what came of it in a folder, for two machines to compare.

usage: python ask.py FOLDER
"""

import sys
from pathlib import Path

import numpy as np

import pegfit


#: Of the table.
SPACING, STEP_DEG = 0.002, 4.0


def poses(count: int) -> np.ndarray:
    """In the window and the rotations of the table, the same on every machine."""
    random = np.random.default_rng(7)
    rows = np.zeros((count, 7))
    rows[:, :3] = random.uniform(-0.004, 0.004, (count, 3))
    rows[:, 3:6] = random.uniform(-0.03, 0.03, (count, 3))
    rows[:, 6] = np.sqrt(1 - (rows[:, 3:6] ** 2).sum(axis=1))
    return rows


def main(folder: Path) -> None:
    hole, peg = pegfit.peg_in_hole("rectangular", clearance=5e-4)
    pair = pegfit.Pair(hole, peg, spacing=SPACING, half_extent=0.006)
    source = pair.evaluator()
    response = source.query([[0, 0, 0.004, 0, 0, 0, 1]])
    # Four millimetres above its place, it is drawn down.
    assert response.energy[0] < 0 and response.force[0][2] < 0, response
    table = pair.bake(folder / "table.zarr", angle_deg=8, step_deg=STEP_DEG)
    field = pegfit.density(hole, spacing=SPACING)
    asked = {"direct": source.query(poses(200)), "table": table.query(poses(200))}
    ticks = pegfit.feel(source, "collision", seconds=0.4).ticks
    answers = {f"{name} {what}": getattr(said, what)
               for name, said in asked.items() for what in ("energy", "force", "torque")}
    np.savez(
        folder / "answers.npz",
        density=field.values,
        distance=field.signed_distance,
        felt=ticks["force"],
        steps=[SPACING, np.radians(STEP_DEG)],
        **answers,
    )
    print(f"pegfit {pegfit.__version__} answers")


main(Path(sys.argv[1]))
