"""Recordings for the Rerun viewer: a pair, its docked poses, an insertion path, a session of the loop.

    python -m pegfit.rerun scene.toml --rerun pair.rrd --poses poses.csv --path path.csv --log run.csv

reads what `pegfit dock -o`, `pegfit path -o` and `pegfit feel --log` wrote.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any, Optional, Union

import numpy as np
import rerun
from numpy.typing import NDArray

from pegfit._errors import PegfitError
from pegfit._insertion_path import InsertionPath
from pegfit._loop import Run
from pegfit._mesh import Mesh
from pegfit._pair import Docking, Pair

Float = NDArray[np.float64]
File = Union[str, "PathLike[str]"]

_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")

#: Colours of the parts, the fixed one half transparent.
_FIXED, _MOVING = (148, 163, 184, 110), (37, 99, 235, 255)

#: Numbers of a docked pose that are drawn as curves.
_RANKS = ("hold", "information", "quality", "overlap")


class _Columns:
    """Columns of a file of rows, by name."""

    def __init__(self, file: File) -> None:
        self._file = os.fspath(file)
        self._columns: Mapping[str, Sequence[Any]]
        if self._file.endswith(".parquet"):
            from pyarrow import parquet

            self._columns = parquet.read_table(self._file).to_pydict()
            return
        with open(self._file, newline="", encoding="utf-8") as rows:
            read = csv.DictReader(rows)
            names, kept = read.fieldnames or [], list(read)
        self._columns = {name: [row[name] for row in kept] for name in names}

    def text(self, name: str) -> list[str]:
        """A column as it stands."""
        if name not in self._columns:
            found = ", ".join(self._columns) or "none"
            message = f"{self._file}: expected a column '{name}', found {found}"
            raise PegfitError(message, file=self._file, item=name, found=found)
        return ["" if cell is None else str(cell) for cell in self._columns[name]]

    def numbers(self, name: str) -> Float:
        """A column of numbers; NaN for an empty cell."""
        try:
            return np.array([float(cell) if cell else np.nan for cell in self.text(name)])
        except ValueError as error:
            message = f"{self._file}: column '{name}': {error}"
            raise PegfitError(message, file=self._file, item=name, found=str(error)) from None

    def matrix(self, *names: str) -> Float:
        """Columns side by side, `(n, k)`."""
        return np.stack([self.numbers(name) for name in names], axis=1)


def record(
    file: File,
    pair: Pair,
    *,
    docking: Union[Docking, File, None] = None,
    path: Union[InsertionPath, File, None] = None,
    session: Union[Run, File, None] = None,
) -> None:
    """Writes a recording, `.rrd`: both parts, and the moving one on a timeline for each of the rest.

    Args:
        file: The recording.
        pair: The parts, where the scene places them.
        docking: Docked poses, or the CSV of `pegfit dock -o`: timeline `pose`, the best is 0, with
            their mates as text.
        path: An insertion path, or the CSV of `pegfit path -o`: timeline `path`, the number of its
            pose, with energy, force, torque and penetration as curves.
        session: A run of the loop, or the log of `pegfit feel --log` (CSV or Parquet): timeline
            `time`, with energy, force and torque.

    Raises:
        PegfitError: A column is missing, or not of numbers.
        OSError: A file cannot be read or written.

    >>> import os, tempfile
    >>> from pegfit import peg_in_hole
    >>> pair = Pair(*peg_in_hole("rectangular", clearance=2e-4))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     record(os.path.join(folder, "pair.rrd"), pair, path=pair.path(solids_only=True))
    ...     os.listdir(folder)
    ['pair.rrd']
    """
    # Whatever cannot be read is refused before a file is begun.
    docked = None if docking is None else _docked(docking)
    inserted = None if path is None else _inserted(path)
    felt = None if session is None else _felt(session)
    with open(file, "wb"):
        pass  # Rerun reports a file that it cannot write on standard error only.
    stream = rerun.RecordingStream("pegfit")
    stream.save(os.fspath(file))
    try:
        _log_part(stream, "fixed", pair.fixed, _FIXED)
        _log_part(stream, "moving", pair.moving, _MOVING)
        if docked is not None:
            _log_docked(stream, *docked)
        if inserted is not None:
            index = rerun.TimeColumn("path", sequence=np.arange(len(inserted[0])))
            _log_motion(stream, "path", index, *inserted)
        if felt is not None:
            seconds, poses, numbers = felt
            index = rerun.TimeColumn("time", duration=seconds)
            _log_motion(stream, "session", index, poses, numbers)
        stream.flush()
    finally:
        stream.disconnect()


def _log_part(stream: Any, name: str, mesh: Mesh, colour: tuple[int, int, int, int]) -> None:
    """A mesh with a corner of its own for each face: so its edges stay sharp."""
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    drawn = rerun.Mesh3D(
        vertex_positions=corners.reshape(-1, 3),
        vertex_normals=np.repeat(normals, 3, axis=0),
        albedo_factor=colour,
    )
    stream.log(name, drawn, static=True)


def _log_motion(
    stream: Any, name: str, index: Any, poses: Float, numbers: Mapping[str, Float]
) -> None:
    """Poses of the moving part along a timeline, and a curve for each number."""
    if len(poses) == 0:
        return
    placed = rerun.Transform3D.columns(translation=poses[:, :3], quaternion=poses[:, 3:])
    stream.send_columns("moving", indexes=[index], columns=placed)
    for curve, values in numbers.items():
        if np.isfinite(values).any():
            drawn = rerun.Scalars.columns(scalars=values)
            stream.send_columns(f"{name}/{curve}", indexes=[index], columns=drawn)


def _log_docked(stream: Any, poses: Float, numbers: dict[str, Float], mates: list[str]) -> None:
    index = rerun.TimeColumn("pose", sequence=np.arange(len(poses)))
    _log_motion(stream, "docking", index, poses, numbers)
    if mates:
        said = rerun.TextDocument.columns(text=mates)
        stream.send_columns("docking/mate", indexes=[index], columns=said)


def _docked(docking: Union[Docking, File]) -> tuple[Float, dict[str, Float], list[str]]:
    if isinstance(docking, Docking):
        numbers = {name: getattr(docking, name) for name in _RANKS}
        return docking.poses, numbers, [joint.kind for joint in docking.joints]
    rows = _Columns(docking)
    return rows.matrix(*_POSE), {name: rows.numbers(name) for name in _RANKS}, rows.text("joint")


def _inserted(path: Union[InsertionPath, File]) -> tuple[Float, dict[str, Float]]:
    if isinstance(path, InsertionPath):
        poses, energy, overlap = path.poses, path.energy, path.overlap
        force, torque = path.force, path.torque
    else:
        rows = _Columns(path)
        poses, energy, overlap = rows.matrix(*_POSE), rows.numbers("energy"), rows.numbers("overlap")
        force, torque = rows.matrix("fx", "fy", "fz"), rows.matrix("tx", "ty", "tz")
    return poses, {"energy": energy, "penetration": overlap, **_sizes(force, torque)}


def _felt(session: Union[Run, File]) -> tuple[Float, Float, dict[str, Float]]:
    """Seconds, poses in the scene and numbers of all ticks that had an input."""
    if isinstance(session, Run):
        ticks = session.ticks
        time, poses, energy = ticks["time"], ticks["object"], ticks["energy"]
        force, torque = ticks["force"], ticks["torque"]
    else:
        rows = _Columns(session)
        time, energy = rows.numbers("time"), rows.numbers("energy")
        poses = rows.matrix(*(f"object_{name}" for name in _POSE))
        force, torque = rows.matrix("fx", "fy", "fz"), rows.matrix("tx", "ty", "tz")
    kept = np.isfinite(poses).all(axis=1)
    numbers = {"energy": energy, **_sizes(force, torque)}
    return time[kept], poses[kept], {name: values[kept] for name, values in numbers.items()}


def _sizes(force: Float, torque: Float) -> dict[str, Float]:
    """Newtons and newton metres."""
    pairs = (("force", force), ("torque", torque))
    return {name: np.linalg.norm(vectors, axis=1) for name, vectors in pairs}


def main(words: Optional[Sequence[str]] = None) -> int:
    """The command; its exit code."""
    about = "Writes a recording for the Rerun viewer."
    parser = argparse.ArgumentParser(prog="python -m pegfit.rerun", description=about)
    parser.add_argument("scene", help="scene file")
    parser.add_argument("--rerun", required=True, metavar="FILE.rrd", help="the recording")
    parser.add_argument("--poses", metavar="CSV", help="poses of pegfit dock -o")
    parser.add_argument("--path", metavar="CSV", help="path of pegfit path -o")
    parser.add_argument("--log", metavar="FILE", help="session of pegfit feel --log")
    given = parser.parse_args(words)
    try:
        pair = Pair.from_scene(given.scene)
        record(given.rerun, pair, docking=given.poses, path=given.path, session=given.log)
    except (PegfitError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
