"""Energies and what follows from them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Optional, SupportsIndex, Union

import numpy as np
from numpy.typing import NDArray

from pegfit._errors import PoseError
from pegfit._optional import needed_by
from pegfit._poses import PosesLike, rows

if TYPE_CHECKING:
    import pandas as _pandas
    import xarray as _xarray

Float = NDArray[np.float64]


class Response:
    """Energy, force and torque on the moving part at `n` poses.

    Attributes:
        energy: Joules, `(n,)`.
        force: Newtons along the axes of the scene (the fixed part's own without one), `(n, 3)`.
        torque: Newton metres along the same axes, about where the pose takes the origin of the
            moving part's frame, `(n, 3)`.
        coverage: 1 where the source knows the pose, 0 where it does not (force and torque are 0
            there), in between at its edge, `(n,)`.

    >>> from pegfit import Pair, peg_in_hole
    >>> source = Pair(*peg_in_hole(), spacing=0.003).evaluator()
    >>> response = source.query([[0, 0, 0.002, 0, 0, 0, 1], [0, 0, 1, 0, 0, 0, 1]])
    >>> response.force.shape, bool(response.force[0, 2] < 0), bool(response.energy[1] == 0)
    ((2, 3), True, True)

    A part of it, by a number, a slice, a mask or numbers, is a response again:

    >>> len(response[0]), len(response[:1]), len(response[response.energy < 0])
    (1, 1, 1)
    """

    __slots__ = ("energy", "force", "torque", "coverage")

    def __init__(self, energy: Float, force: Float, torque: Float, coverage: Float) -> None:
        self.energy = energy
        self.force = force
        self.torque = torque
        self.coverage = coverage

    @classmethod
    def empty(cls, count: int) -> Response:
        """Arrays for `count` poses, not filled: to be given as `out` again and again.

        >>> Response.empty(3).force.shape
        (3, 3)
        """
        empty = np.empty
        return cls(empty(count), empty((count, 3)), empty((count, 3)), empty(count))

    def __len__(self) -> int:
        return len(self.energy)

    def __getitem__(
        self, which: Union[SupportsIndex, slice, NDArray[np.bool_], NDArray[np.integer], list[int]]
    ) -> Response:
        """Some of the poses: slices share the arrays, other choices copy them."""
        if isinstance(which, SupportsIndex) and not isinstance(which, np.ndarray):
            number, count = which.__index__(), len(self)
            if not -count <= number < count:
                raise IndexError(f"pose {number} of {count}")
            which = slice(number % count, number % count + 1)
        arrays = (self.energy, self.force, self.torque, self.coverage)
        return Response(*(array[which] for array in arrays))

    def to_pandas(self) -> _pandas.DataFrame:
        """A row per pose: energy (J), fx, fy, fz (N), tx, ty, tz (N m), coverage (needs pandas)."""
        with needed_by("Response.to_pandas", "pandas", "data"):
            import pandas

        columns = {"energy": self.energy}
        for letter, vectors in (("f", self.force), ("t", self.torque)):
            columns |= {letter + axis: vectors[:, k] for k, axis in enumerate("xyz")}
        return pandas.DataFrame(columns | {"coverage": self.coverage})

    def to_xarray(self, poses: Optional[PosesLike] = None) -> _xarray.Dataset:
        """Energy, force, torque and coverage over `pose` and `axis` (needs xarray).

        Args:
            poses: Those that were queried. Their x, y, z (metres) and qx, qy, qz, qw become
                coordinates along `pose`.

        Raises:
            ModuleNotFoundError: There is no xarray.
            PoseError: The poses are none, or not as many as the responses.
        """
        with needed_by("Response.to_xarray", "xarray", "data"):
            import xarray

        coordinates: dict[str, Any] = {"axis": list("xyz")}
        if poses is not None:
            given = rows(poses)
            if len(given) != len(self):
                expected, found = f"{len(self)} poses", str(len(given))
                message = f"poses: expected {expected}, found {found}"
                raise PoseError(message, item="poses", expected=expected, found=found)
            for name, column in zip(("x", "y", "z", "qx", "qy", "qz", "qw"), given.T):
                units = "m" if len(name) == 1 else "1"
                coordinates[name] = ("pose", column.copy(), {"units": units})
        return xarray.Dataset(
            {
                "energy": ("pose", self.energy, {"units": "J"}),
                "force": (("pose", "axis"), self.force, {"units": "N"}),
                "torque": (("pose", "axis"), self.torque, {"units": "N m"}),
                "coverage": ("pose", self.coverage, {"units": "1"}),
            },
            coords=coordinates,
        )

    def __repr__(self) -> str:
        if len(self) == 0:
            return "Response of no poses"
        low, high = float(np.min(self.energy)), float(np.max(self.energy))
        most = float(np.max(np.linalg.norm(self.force, axis=1)))
        return (
            f"Response of {len(self)} poses: energy {low:.4g} to {high:.4g} J, "
            f"force up to {most:.4g} N"
        )


def check_out(out: Response, count: int) -> Response:
    """Refuses arrays that responses to `count` poses cannot be written to."""
    shapes = {"energy": (count,), "force": (count, 3), "torque": (count, 3), "coverage": (count,)}
    for name, shape in shapes.items():
        array = getattr(out, name)
        fits = (
            isinstance(array, np.ndarray)
            and array.shape == shape
            and array.dtype == np.float64
            and array.flags.c_contiguous
            and array.flags.writeable
        )
        if not fits:
            expected = f"a writable contiguous array {shape} of float64"
            found = f"{getattr(array, 'shape', type(array))} of {getattr(array, 'dtype', '?')}"
            message = f"out.{name}: expected {expected}, found {found}"
            raise PoseError(message, item=f"out.{name}", expected=expected, found=found)
    return out
