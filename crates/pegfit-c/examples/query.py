#!/usr/bin/env python3
"""Energies, torques and forces of a table from Python, through the C interface; no packages needed.

    cargo build --release -p pegfit-c
    python3 crates/pegfit-c/examples/query.py target/release/libpegfit_c.so TABLE.zarr

Prints energy and force along a line through the assembled pose. `Table.query` takes any number of
poses at once; with numpy, pass `poses.ctypes.data_as(POINTER(Pose))` of an (n, 7) float64 array to
`pegfit_table_query_many` instead of building the list.
"""
import ctypes
import sys
from ctypes import POINTER, Structure, byref, c_char_p, c_double, c_int, c_size_t, c_uint64


class Pose(Structure):
    """Translation x, y, z in metres; rotation x, y, z, w."""

    _fields_ = [("translation", c_double * 3), ("rotation", c_double * 4)]


class Response(Structure):
    """Joules, newton metres about the moved origin, newtons; the scene's axes."""

    _fields_ = [
        ("energy", c_double),
        ("torque", c_double * 3),
        ("force", c_double * 3),
        ("coverage", c_double),
    ]


class Info(Structure):
    _fields_ = [
        ("pivot", c_double * 3),
        ("window_min", c_double * 3),
        ("window_max", c_double * 3),
        ("rotations", c_uint64),
        ("bytes", c_uint64),
        ("fixed", Pose),
        ("moving", Pose),
    ]


class Table:
    """A table in memory; close it or use it in a `with`."""

    def __init__(self, library, path):
        self.lib = ctypes.CDLL(library)
        self.lib.pegfit_table_load.argtypes = [c_char_p, c_uint64, POINTER(c_uint64)]
        self.lib.pegfit_table_info.argtypes = [c_uint64, POINTER(Info)]
        self.lib.pegfit_table_query_many.argtypes = [
            c_uint64, POINTER(Pose), POINTER(Response), c_size_t,
        ]
        self.lib.pegfit_table_close.argtypes = [c_uint64]
        self.lib.pegfit_last_error.argtypes = [c_char_p, c_size_t]
        self.lib.pegfit_last_error.restype = c_size_t
        for name in ["load", "info", "query_many", "close"]:
            getattr(self.lib, f"pegfit_table_{name}").restype = c_int
        self.handle = c_uint64()
        self._check(self.lib.pegfit_table_load(path.encode(), 0, byref(self.handle)))

    def _check(self, status):
        if status != 0:
            text = ctypes.create_string_buffer(1024)
            self.lib.pegfit_last_error(text, len(text))
            raise RuntimeError(text.value.decode())

    def info(self):
        info = Info()
        self._check(self.lib.pegfit_table_info(self.handle, byref(info)))
        return info

    def query(self, poses):
        """A Response for every (translation, rotation)."""
        poses = [Pose(tuple(t), tuple(q)) for t, q in poses]
        responses = (Response * len(poses))()
        array = (Pose * len(poses))(*poses)
        self._check(self.lib.pegfit_table_query_many(self.handle, array, responses, len(poses)))
        return list(responses)

    def close(self):
        self._check(self.lib.pegfit_table_close(self.handle))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def main():
    if len(sys.argv) != 3:
        sys.exit("usage: query.py LIBRARY TABLE.zarr")
    with Table(*sys.argv[1:]) as table:
        info = table.info()
        print(f"{info.rotations} rotations, {info.bytes} bytes")
        low, high = info.window_min[2], info.window_max[2]
        heights = [low + share / 6 * (high - low) for share in range(1, 6)]
        for z, at in zip(heights, table.query([((0, 0, z), (0, 0, 0, 1)) for z in heights])):
            print(f"z {z:+.4f} m  energy {at.energy:+.6f} J  force {at.force[2]:+.4f} N  "
                  f"coverage {at.coverage:.2f}")


if __name__ == "__main__":
    main()
