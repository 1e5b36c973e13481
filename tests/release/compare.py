"""By how much the answers of two machines differ.

usage: python compare.py ONE OTHER

Prints, of each quantity, the largest difference as a share of its largest value, and how many files
of both tables hold the same bytes. Exit code 1 if a share is beyond its bound.
"""

import sys
from pathlib import Path

import numpy as np

#: Largest difference as a share of the largest value. Sums of single-precision products in another
#: order differ by a few 1e-7 of what is summed; energies cancel some ten times that, wrenches more.
BOUND = 1e-4

#: A table's number that lies between two of 11 bits may become either: that much of the energy, and
#: of its slopes that much over the step between two numbers.
ROUNDING = 2.0**-11


def bounds(answers) -> dict[str, float]:
    """The bound of each quantity."""
    largest = {name: np.abs(answers[name]).max() for name in answers.files}
    energy = ROUNDING * largest["table energy"]
    across, turning = answers["steps"]
    tables = {
        "table energy": energy,
        "table force": energy / across,
        "table torque": energy / turning,
    }
    return {name: BOUND for name in largest} | {
        name: bound / largest[name] for name, bound in tables.items()
    }


def chunks(folder: Path) -> dict[str, bytes]:
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def main(one: Path, other: Path) -> int:
    beyond = False
    with np.load(one / "answers.npz") as a, np.load(other / "answers.npz") as b:
        assert set(a.files) == set(b.files)
        for name, bound in bounds(a).items():
            share = np.abs(a[name] - b[name]).max() / np.abs(a[name]).max()
            beyond |= not share <= bound
            print(f"{name:<14} differs by {share:.1e} of its largest value, {bound:.1e} allowed")
    ours, theirs = (chunks(folder / "table.zarr") for folder in (one, other))
    assert set(ours) == set(theirs)
    same = sum(ours[name] == theirs[name] for name in ours)
    print(f"table          {same} of {len(ours)} files hold the same bytes")
    return int(beyond)


sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2])))
