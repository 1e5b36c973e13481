"""The haptic loop: a run with the simulated hand, and one tick for simulations of your own."""

from __future__ import annotations

import io
import json
from os import PathLike
from typing import Any, Mapping, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pegfit import _core
from pegfit._errors import DeviceError, PegfitError
from pegfit._pair import Pair
from pegfit._poses import rows, three
from pegfit._progress import Progress, Reporting
from pegfit._report import write_report
from pegfit._source import REAL_TIME_POINTS, Evaluator, PairLike, Table

Float = NDArray[np.float64]

_FIELDS = [
    ("tick", 1),
    ("time", 1),
    ("dt", 1),
    ("device_pose", 7),
    ("device_twist", 6),
    ("buttons", 1),
    ("timestamp", 1),
    ("object", 7),
    ("energy", 1),
    ("coverage", 1),
    ("torque", 3),
    ("force", 3),
    ("gain", 1),
    ("balance", 1),
    ("work_force", 1),
    ("work_torque", 1),
    ("made", 1),
    ("taken", 1),
    ("exchanged", 1),
    ("evaluations", 1),
    ("flags", 1),
]

#: One tick of the loop, SI units: `device_pose`, `device_twist` (angular first), `torque` and `force`
#: in the device's frame, `object` (the moving part) in the scene; NaN where there was no input.
TICK = np.dtype([(n, "f8") if width == 1 else (n, "f8", (width,)) for n, width in _FIELDS])


class Run:
    """What a run of the loop leaves.

    Attributes:
        ticks: Every tick, a structured array of `TICK`.
        summary: Counts, quantiles and energy balance, by name.
    """

    def __init__(self, core: _core.Felt) -> None:
        self._core = core
        ticks = core.ticks()
        self.ticks: NDArray[np.void] = ticks.view(TICK).reshape(len(ticks))
        self.summary: dict[str, Any] = json.loads(core.summary())

    def report(self, path: Union[str, PathLike[str]]) -> None:
        """Writes what was felt.

        Args:
            path: Its ending says what: `.html` the page of `pegfit feel --report` (curves, times,
                events), `.csv` every tick in the columns of `pegfit feel --log`, `.json` the
                summary.

        Raises:
            PegfitError: Another ending, or the file cannot be written.

        >>> import os, tempfile
        >>> from pegfit import Pair, peg_in_hole
        >>> run = feel(Pair(*peg_in_hole(), spacing=0.003), "snap", seconds=0.05)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     run.report(os.path.join(folder, "run.csv"))
        ...     os.listdir(folder)
        ['run.csv']
        """
        core = self._core
        write_report(path, page=core.page, table=self._table, summary=core.summary)

    def _table(self) -> str:
        flat = self.ticks.view(np.float64).reshape(len(self.ticks), -1)
        table, header = io.StringIO(), ",".join(_core.tick_columns())
        np.savetxt(table, flat, delimiter=",", header=header, comments="", fmt="%.17g")
        return table.getvalue()

    def __repr__(self) -> str:
        seconds, peak = self.summary["seconds"], self.summary["peak_force"]
        return f"Run of {len(self.ticks)} ticks, {seconds:.3g} s, force up to {peak:.3g} N"


def source_of(source: Union[Evaluator, Table, Pair]) -> _core.Source:
    """The compiled half of a source; of a pair, of an evaluator for real time."""
    if isinstance(source, Pair):
        return source.evaluator(max_points=REAL_TIME_POINTS)._core
    if isinstance(source, (Evaluator, Table)):
        return source._core
    expected, found = "an Evaluator, a Table or a Pair", type(source).__name__
    message = f"source: expected {expected}, found {found}"
    raise PegfitError(message, item="source", expected=expected, found=found)


def _pair_of(source: Union[Evaluator, Table, Pair], pair: Optional[Pair]) -> PairLike:
    known: Optional[PairLike] = source if isinstance(source, Pair) else source._pair
    if pair is None and known is None:
        expected = "the pair that the table was baked from: a table does not hold its meshes"
        message = f"pair: expected {expected}, found none"
        raise DeviceError(message, item="pair", expected=expected, found="none")
    found = pair or known
    assert found is not None
    return found


def feel(
    source: Union[Evaluator, Table, Pair],
    script: str = "snap",
    seconds: float = 10.0,
    hand: Optional[Mapping[str, float]] = None,
    *,
    pair: Optional[Pair] = None,
    real_time: bool = False,
    progress: Progress = None,
) -> Run:
    """Runs the haptic loop with a simulated hand that holds the moving part.

    Args:
        source: What gives the energy; of a `Pair` an evaluator of `REAL_TIME_POINTS`.
        script: `"collision"`, `"snap"` (the paper's two tests) or `"free"`.
        seconds: Length of the run.
        hand: Settings of the hand by name: `mass` (kg), `stiffness` (N/m), `damping`, `inertia`,
            `rotational_stiffness`, `rotational_damping`, `tremor` (m), `rotational_tremor` (rad),
            `push` (N), `seed`.
        pair: Needed for a table that was opened: where the parts fit.
        real_time: Tick by the wall clock instead of as fast as it goes.
        progress: `True` for a bar while fields are computed.

    Raises:
        DeviceError: A setting is out of range, or the loop could not run.
        TableError: The table was closed.

    >>> from pegfit import peg_in_hole
    >>> run = feel(Pair(*peg_in_hole(), spacing=0.003), "collision", seconds=0.05)
    >>> run.ticks["force"].shape
    (50, 3)
    """
    core = source_of(source)
    given = json.dumps(dict(hand or {}))
    with Reporting(progress) as report:
        held = _pair_of(source, pair)
        felt = _core.feel(
            held._core, core, script, seconds, given, real_time, repr(source), report
        )
    return Run(felt)


class ForcePath:
    """The path from a pose to a force that is safe to render, one tick at a time.

    Between the body and the energy stands a virtual coupling: a spring to a virtual part that
    minimises energy and spring together. So forces are bounded and smooth even where the energy has
    a kink (zero clearance), and a passivity controller sees to it that a body gains nothing on the
    way round a loop.

    Args:
        source: What gives the energy; of a `Pair` an evaluator of `REAL_TIME_POINTS`.
        config: Settings as in the `[device]` table of a scene (`docs/scene.md`), such as
            `{"rate_hz": 500, "coupling": {"stiffness": 500}}`.
        grip: The point of the moving part, its frame (metres), that the coupling holds; the pair's
            pivot is a good one.

    Raises:
        DeviceError: A setting is unknown or out of range.

    >>> from pegfit import peg_in_hole
    >>> path = ForcePath(Pair(*peg_in_hole(), spacing=0.003), {"ramp_s": 0.1})
    >>> for tick in range(200):
    ...     force, torque = path.step([0, 0, 0.002, 0, 0, 0, 1], tick * 1e-3)
    >>> bool(force[2] < 0)
    True
    """

    def __init__(
        self,
        source: Union[Evaluator, Table, Pair],
        config: Optional[Mapping[str, Any]] = None,
        *,
        grip: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        settings = json.dumps(dict(config or {}))
        self._core = _core.ForcePath(source_of(source), settings, three(grip, "grip"))
        #: Energy (J), coverage, strength of the force (0 to 1) and flags of the last tick.
        self.energy, self.coverage, self.gain, self.flags = 0.0, 0.0, 0.0, 0

    def step(self, pose: ArrayLike, t: float) -> tuple[Float, Float]:
        """One tick.

        Args:
            pose: Of the moving part, `(7,)` as x y z qx qy qz qw, or `(4, 4)`.
            t: Seconds on your clock, never less than before.

        Returns:
            Force (N) and torque (N m, about where the pose takes the part's origin), `(3,)` each,
            along the axes of the fixed part or scene. They rise from nothing in `ramp_s` seconds.

        Raises:
            PoseError: The pose is none.
            DeviceError: The time went back.
        """
        row = np.asarray(pose, dtype=np.float64)
        if row.shape != (7,):
            row = rows(row[None])[0]
        force, torque, self.energy, self.coverage, self.gain, self.flags = self._core.step(row, t)
        return np.array(force), np.array(torque)

    def __repr__(self) -> str:
        linear, angular = self._core.stiffness()
        return f"ForcePath: {linear:.4g} N/m, {angular:.4g} N m/rad"
