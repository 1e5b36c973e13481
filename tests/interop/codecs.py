"""Size and time of a table's coefficients by several codecs, one thread.

usage: codecs.py TABLE     (in the virtual environment of requirements.txt)

The stored bytes are those of this table's files; times of gzip are those of Python's zlib.
"""

import pathlib
import sys
import time
import zlib

import numpy as np
import zarr
from numcodecs import Blosc, Shuffle, Zstd


def timed(work, items):
    """What `work` makes of the items, and the seconds that it took."""
    began = time.perf_counter()
    made = [work(item) for item in items]
    return made, time.perf_counter() - began


def main(path):
    array = zarr.open_group(path, mode="r")["coefficients"]
    rows = [np.ascontiguousarray(array[row]) for row in range(array.shape[0])]
    raw = sum(row.nbytes for row in rows)
    files = pathlib.Path(path, "coefficients").glob("c.*")
    stored = sum(file.stat().st_size for file in files)
    print(f"{path}: {array.shape} {array.dtype}, {raw / 1e6:.2f} MB, stored {stored / raw:.3f}")
    shuffle, blosc = Shuffle(2), Blosc("lz4", 5, Blosc.SHUFFLE)
    codecs = {
        "blosc lz4, shuffle": (blosc.encode, blosc.decode),
        "gzip 2": (lambda row: zlib.compress(row, 2), zlib.decompress),
        "gzip 6": (lambda row: zlib.compress(row, 6), zlib.decompress),
        "zstd 3": (Zstd(3).encode, Zstd(3).decode),
        "shuffle, gzip 2": (
            lambda row: zlib.compress(bytes(shuffle.encode(row)), 2),
            lambda packed: shuffle.decode(zlib.decompress(packed)),
        ),
    }
    for name, (pack, unpack) in codecs.items():
        packed, packing = timed(pack, rows)
        _, unpacking = timed(unpack, packed)
        share = sum(map(len, packed)) / raw
        speeds = [raw / 1e6 / seconds for seconds in (packing, unpacking)]
        print(f"  {name:20} {share:.3f}  {speeds[0]:6.0f} MB/s in  {speeds[1]:6.0f} MB/s out")


if __name__ == "__main__":
    main(*sys.argv[1:])
