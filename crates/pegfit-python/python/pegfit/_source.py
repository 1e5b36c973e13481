"""What answers with energy, force and torque at poses."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Any, Optional, Protocol

import numpy as np
from numpy.typing import NDArray

from pegfit import _core
from pegfit._errors import TableError, count_or_none
from pegfit._mesh import Path
from pegfit._poses import PosesLike, rows
from pegfit._response import Response, check_out

if TYPE_CHECKING:
    from types import TracebackType

    from matplotlib.axes import Axes as _Axes

Float = NDArray[np.float64]

#: Quadrature points that a 1 kHz loop on one core has time for.
REAL_TIME_POINTS: int = _core.REAL_TIME_POINTS


class Source(Protocol):
    """A table or an evaluator."""

    def query(
        self, poses: PosesLike, threads: Optional[int] = None, out: Optional[Response] = None
    ) -> Response:
        """Energy, force and torque at poses."""
        ...


class PairLike(Protocol):
    """What sources know of the pair that made them: a `Pair`."""

    _core: _core.Pair

    def evaluator(
        self, tolerance: Optional[float] = None, *, max_points: Optional[int] = None
    ) -> Evaluator:
        """Energy at any pose by direct quadrature."""
        ...


class _Source:
    """What tables and evaluators have in common."""

    _core: _core.Source
    _pair: Optional[PairLike]

    def query(
        self, poses: PosesLike, threads: Optional[int] = None, out: Optional[Response] = None
    ) -> Response:
        """Energy, force and torque on the moving part at poses.

        Args:
            poses: `(n, 7)` as x y z qx qy qz qw, `(n, 4, 4)`, or a pair of translations and a
                `scipy.spatial.transform.Rotation`; metres. Quaternions and matrices within 1e-3 of
                a rotation are taken for rounded ones.
            threads: One per core if `None`. Any number of Python threads may ask at once.
            out: Arrays to write to, as `Response.empty(n)` makes them; they are returned. If a pose
                is refused, those before it have been written.

        Raises:
            PoseError: A wrong shape, a number that is not finite, or no rotation.
            TableError: The table was closed.
            SceneError: What the poses reach does not fit in memory.
            KeyboardInterrupt: Within 50 ms of Ctrl-C.

        >>> from pegfit import Pair, Response, peg_in_hole
        >>> source = Pair(*peg_in_hole(), spacing=0.003).evaluator()
        >>> out = Response.empty(2)
        >>> matrices = np.stack([np.eye(4), np.eye(4)])
        >>> matrices[1, 2, 3] = 0.001
        >>> source.query(matrices, out=out) is out
        True
        >>> bool(out.energy[0] < out.energy[1])
        True
        """
        array, threads = rows(poses), count_or_none(threads, "threads")
        if out is None:
            response = Response.empty(len(array))
        else:
            response = check_out(out, len(array))
        self._core.query(
            array, response.energy, response.force, response.torque, response.coverage, threads
        )
        return response


class Evaluator(_Source):
    """Energy by direct quadrature: any pose, no table; 0.1 to 10 ms a pose.

    Made by `Pair.evaluator`. Of a large part beside a small one it computes what poses reach when they
    ask, about a second for the first pose somewhere; a loop has it compute the rest before it begins.

    Attributes:
        points: Quadrature points: the most lookups that one pose takes.
        error: If a tolerance was asked for, the greater error of force and torque by which the
            lattice was chosen, as a share of the rms; else `None`.
    """

    def __init__(
        self,
        core: _core.Source,
        pair: PairLike,
        points: int,
        error: Optional[float],
        asked: tuple[Optional[float], Optional[int]],
    ) -> None:
        self._core = core
        self._pair: PairLike = pair
        self.points = points
        self.error = error
        self._asked = asked

    def __reduce__(self) -> tuple[Any, ...]:
        """For `pickle`: the pair, and what was asked of `Pair.evaluator`."""
        return _evaluator, (self._pair, *self._asked)

    def __repr__(self) -> str:
        error = "" if self.error is None else f", error {100 * self.error:.2g} %"
        return f"Evaluator of {self._pair!r}: {self.points} points{error}"


def _evaluator(pair: PairLike, tolerance: Optional[float], max_points: Optional[int]) -> Evaluator:
    return pair.evaluator(tolerance, max_points=max_points)


def _reopened(path: str, pair: Optional[PairLike]) -> Table:
    table = Table.open(path)
    table._pair = pair
    return table


class Table(_Source):
    """Energies over a grid of rotations and displacements, interpolated: microseconds a pose.

    Made by `Pair.bake` and `Table.open`. Force and torque are the exact gradient of the
    interpolated energy. Close it, or use it in a `with`, to give its memory back early.
    """

    def __init__(self, core: _core.Source, description: str, pair: Optional[PairLike]) -> None:
        self._core = core
        self._pair = pair
        self._said: dict[str, Any] = json.loads(description)

    @classmethod
    def open(cls, path: Path, memory: Optional[int] = None) -> Table:
        """Reads all of a table into memory.

        Args:
            path: The table's folder (or URL, in a build with object stores).
            memory: Bytes that it may take; nine tenths of what is free if `None`.

        Raises:
            TableError: There is no table, it is not finished yet, damaged, of another format, or
                too large.

        >>> import os, tempfile
        >>> from pegfit import Pair, peg_in_hole
        >>> pair = Pair(*peg_in_hole(), spacing=0.003, half_extent=0.006)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = os.path.join(folder, "t.zarr")
        ...     pair.bake(path, angle_deg=5).close()
        ...     table = Table.open(path)
        >>> table.window[1]
        array([0.006, 0.006, 0.006])
        >>> table.closed
        False
        """
        core, description = _core.open_table(path, count_or_none(memory, "memory", TableError))
        return cls(core, description, None)

    @property
    def path(self) -> str:
        """Where it is."""
        return str(self._said["path"])

    @property
    def window(self) -> Float:
        """Least and greatest displacement of the pivot, metres, `(2, 3)`, along the axes of the
        fixed part's own frame."""
        return np.array([self._said["window_min"], self._said["window_max"]])

    @property
    def pivot(self) -> Float:
        """The point of the moving part, its own frame, whose displacement counts, metres."""
        return np.array(self._said["pivot"])

    @property
    def spacing(self) -> float:
        """Metres between displacements."""
        return float(self._said["spacing"])

    @property
    def rotations(self) -> int:
        """Rotation nodes."""
        return int(self._said["rotations"])

    @property
    def memory(self) -> int:
        """Bytes of energies in memory."""
        return int(self._said["memory"])

    @property
    def error(self) -> Optional[dict[str, Any]]:
        """What the table says of its own error: rms, 99th percentile and worst of energy (J), force
        (N) and torque (N m), each beside the rms of the quantity itself (`scale`)."""
        error: Optional[dict[str, Any]] = self._said["error"]
        return error

    def to_dict(self) -> dict[str, Any]:
        """Everything that is known of it, by name."""
        return dict(self._said)

    def plot(self, ax: Optional[_Axes] = None) -> _Axes:
        """Draws the energy along x, y and z through the modelled pose (needs matplotlib)."""
        from pegfit._plots import energy_lines

        return energy_lines(self.window, lambda poses: self.query(poses).energy, self.path, ax)

    def close(self) -> None:
        """Gives the memory back once queries that are under way have ended."""
        self._core.close()

    @property
    def closed(self) -> bool:
        """Whether it was closed."""
        return self._core.is_closed()

    def __enter__(self) -> Table:
        return self

    def __exit__(
        self,
        kind: Optional[type[BaseException]],
        error: Optional[BaseException],
        trace: Optional[TracebackType],
    ) -> None:
        self.close()

    def __reduce__(self) -> tuple[Any, ...]:
        """For `pickle`: its path, from where it is read again. A closed one is refused."""
        if self.closed:
            expected, found = "an open table", "a closed one"
            message = f"{self.path}: expected {expected}, found {found}"
            raise TableError(message, file=self.path, expected=expected, found=found)
        return _reopened, (os.path.abspath(self.path), self._pair)

    def __repr__(self) -> str:
        nodes = " x ".join(str(n) for n in self._said["displacements"])
        state = "closed" if self.closed else f"{self.memory / 2**20:.1f} MiB"
        return f"Table '{self.path}': {self.rotations} rotations x {nodes} displacements, {state}"
