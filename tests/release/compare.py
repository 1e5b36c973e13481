"""By how much the answers of two machines differ.

usage: python compare.py ONE OTHER

Prints, of each quantity, the largest difference as a share of its largest value, and how many files
of both tables hold the same bytes. Exit code 1 if a share is beyond the bound.
"""

import sys
from pathlib import Path

import numpy as np

#: Largest difference as a share of the largest value. Sums of single-precision products in another
#: order differ by a few 1e-7 of what is summed; energies cancel some ten times that, wrenches more.
BOUND = 1e-4


def chunks(folder: Path) -> dict[str, bytes]:
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def main(one: Path, other: Path) -> int:
    worst = 0.0
    with np.load(one / "answers.npz") as a, np.load(other / "answers.npz") as b:
        assert set(a.files) == set(b.files)
        for name in a.files:
            share = np.abs(a[name] - b[name]).max() / np.abs(a[name]).max()
            worst = max(worst, share)
            print(f"{name:<14} differs by {share:.1e} of its largest value")
    ours, theirs = (chunks(folder / "table.zarr") for folder in (one, other))
    assert set(ours) == set(theirs)
    same = sum(ours[name] == theirs[name] for name in ours)
    print(f"table          {same} of {len(ours)} files hold the same bytes")
    return int(not worst <= BOUND)


sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2])))
