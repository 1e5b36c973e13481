"""A force between two bodies of a MuJoCo model, from a table or an evaluator.

MuJoCo's own contact of these two must be off (`contype="0" conaffinity="0"`, or an `exclude`): it
takes meshes for their convex hulls, which closes the hole.
"""

from __future__ import annotations

from types import TracebackType
from typing import Any, Mapping, Optional, Union

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pegfit._errors import PegfitError
from pegfit._loop import ForcePath
from pegfit._pair import Pair
from pegfit._response import Response
from pegfit._source import REAL_TIME_POINTS, Evaluator, Table

Float = NDArray[np.float64]


def _body(model: mujoco.MjModel, body: Union[str, int]) -> int:
    found = body
    if isinstance(body, str):
        found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body)
    if not 0 <= int(found) < model.nbody:
        expected = f"the name of a body, or a number below {model.nbody}"
        message = f"body: expected {expected}, found {body!r}"
        raise PegfitError(message, item="body", expected=expected, found=repr(body))
    return int(found)


class _Frame:
    """Where a mesh lies in a body's frame, w x y z."""

    def __init__(self, pose: Optional[ArrayLike]) -> None:
        row = np.array([0, 0, 0, 0, 0, 0, 1.0]) if pose is None else np.array(pose, float)
        if row.shape != (7,):
            expected, found = "a row x y z qx qy qz qw", f"shape {row.shape}"
            message = f"frame: expected {expected}, found {found}"
            raise PegfitError(message, item="frame", expected=expected, found=found)
        self.at, self.turn = row[:3].copy(), np.roll(row[3:], 1)

    def world(self, data: mujoco.MjData, body: int, at: Float, turn: Float) -> None:
        """The mesh's frame in the world, written to `at` and `turn`."""
        mujoco.mju_mulPose(at, turn, data.xpos[body], data.xquat[body], self.at, self.turn)


class PassiveForce:
    """Adds force and torque of a pair to two bodies in every step, equal and opposite.

    Works while a `with` lasts, or between `install` and `remove`; several may, each for a pair of
    its own, and a callback that was there before is still called. MuJoCo compiles no model while a
    callback is set, so make all models before.

    Args:
        model: The model.
        source: A `Table`, an `Evaluator` or a `Pair` (then with `REAL_TIME_POINTS`).
        fixed: Name or number of the body that the fixed part belongs to; it may move.
        moving: That of the moving part.
        fixed_frame: Where the fixed mesh's frame lies in its body's, x y z qx qy qz qw; the same if
            `None`.
        moving_frame: The same for the moving one.
        config: Settings of the `ForcePath` as in the `[device]` table of a scene; its rate is one
            over the model's time step unless given, and its limits are lifted.
        grip: The point of the moving mesh that the path's coupling holds, metres; its origin.
        raw: The bare force of the energy, without a path. At zero clearance it jumps, and kicks a
            light body in a step of a millisecond.

    Attributes:
        energy: Joules, at the last step.
        coverage: 1 where the source knows the pose.
        force: On the moving part in the world's axes, newtons, `(3,)`.
        torque: About the moving mesh's origin in the world's axes, newton metres, `(3,)`.

    Raises:
        PegfitError: There is no such body.
        DeviceError: A setting is out of range.

    >>> from pegfit import peg_in_hole
    >>> free = '<freejoint/><geom size="0.005" contype="0" conaffinity="0"/>'
    >>> bodies = f'<body name="hole"/><body name="peg" pos="0 0 0.002">{free}</body>'
    >>> model = mujoco.MjModel.from_xml_string(
    ...     f'<mujoco><option gravity="0 0 0"/><worldbody>{bodies}</worldbody></mujoco>'
    ... )
    >>> data, pair = mujoco.MjData(model), Pair(*peg_in_hole(), spacing=0.003)
    >>> with PassiveForce(model, pair, "hole", "peg", config={"ramp_s": 0.01}) as force:
    ...     mujoco.mj_step(model, data, nstep=50)
    >>> bool(force.energy < 0 and force.force[2] < 0 and data.qvel[2] < 0)
    True
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        source: Union[Table, Evaluator, Pair],
        fixed: Union[str, int],
        moving: Union[str, int],
        *,
        fixed_frame: Optional[ArrayLike] = None,
        moving_frame: Optional[ArrayLike] = None,
        config: Optional[Mapping[str, Any]] = None,
        grip: ArrayLike = (0.0, 0.0, 0.0),
        raw: bool = False,
    ) -> None:
        self._bodies = _body(model, fixed), _body(model, moving)
        self._frames = _Frame(fixed_frame), _Frame(moving_frame)
        if isinstance(source, Pair):
            source = source.evaluator(max_points=REAL_TIME_POINTS)
        self._source = source
        rate = float(np.clip(1.0 / model.opt.timestep, 50.0, 10_000.0))
        free = {"force": 1e6, "torque": 1e6, "force_rate": 1e9, "torque_rate": 1e9}
        given = dict(config or {})
        self._settings = {"rate_hz": rate, **given, "limits": {**free, **given.get("limits", {})}}
        self._grip = grip
        self._raw = raw
        self._path: Optional[ForcePath] = None
        self._time = np.inf
        self._out = Response.empty(1)
        self._at = np.zeros((2, 3))
        self._turn = np.zeros((2, 4))
        self._row = np.zeros((1, 7))
        self._model = model
        self.energy, self.coverage = 0.0, 0.0
        self.force, self.torque = np.zeros(3), np.zeros(3)
        if not raw:
            self.reset()

    def reset(self) -> None:
        """Forgets what was: the force begins from nothing. Done by itself when time goes back."""
        self._path = ForcePath(self._source, self._settings, grip=self._grip)

    def pose(self, data: mujoco.MjData) -> Float:
        """Pose of the moving part in the fixed part's frame, `(7,)`; a new array."""
        self._find(data)
        row: Float = self._row[0].copy()
        return row

    def _find(self, data: mujoco.MjData) -> None:
        for k in (0, 1):
            self._frames[k].world(data, self._bodies[k], self._at[k], self._turn[k])
        back, undo = np.empty(3), np.empty(4)
        mujoco.mju_negPose(back, undo, self._at[0], self._turn[0])
        at, turn = self._row[0, :3], np.empty(4)
        mujoco.mju_mulPose(at, turn, back, undo, self._at[1], self._turn[1])
        self._row[0, 3:6], self._row[0, 6] = turn[1:], turn[0]

    def apply(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Adds the wrench at the state of `data` to `qfrc_passive`: what the callback does."""
        self._find(data)
        if self._raw:
            found = self._source.query(self._row, out=self._out)
            force, torque = found.force[0], found.torque[0]
            self.energy, self.coverage = float(found.energy[0]), float(found.coverage[0])
        else:
            if data.time < self._time and np.isfinite(self._time):
                self.reset()
            self._time = data.time
            assert self._path is not None
            force, torque = self._path.step(self._row[0], data.time)
            self.energy, self.coverage = self._path.energy, self._path.coverage
        mujoco.mju_rotVecQuat(self.force, force, self._turn[0])
        mujoco.mju_rotVecQuat(self.torque, torque, self._turn[0])
        point, into = self._at[1], data.qfrc_passive
        fixed, moving = self._bodies
        mujoco.mj_applyFT(model, data, self.force, self.torque, point, moving, into)
        mujoco.mj_applyFT(model, data, -self.force, -self.torque, point, fixed, into)

    def install(self) -> None:
        """Is called by every step from here on."""
        if self not in _INSTALLED:
            _INSTALLED.append(self)
        _listen()

    def remove(self) -> None:
        """Is called no more."""
        if self in _INSTALLED:
            _INSTALLED.remove(self)
        _listen()

    def __enter__(self) -> PassiveForce:
        self.install()
        return self

    def __exit__(
        self,
        kind: Optional[type[BaseException]],
        error: Optional[BaseException],
        trace: Optional[TracebackType],
    ) -> None:
        self.remove()

    def __repr__(self) -> str:
        fixed, moving = self._bodies
        way = "raw" if self._raw else "through a ForcePath"
        return f"PassiveForce of {self._source!r} on bodies {fixed} and {moving}, {way}"


_INSTALLED: list[PassiveForce] = []
_BEFORE: list[Any] = [None]


def _call(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    if _BEFORE[0] is not None:
        _BEFORE[0](model, data)
    for force in _INSTALLED:
        if force._model is model:
            force.apply(model, data)


def _listen() -> None:
    """Sets MuJoCo's one callback while there is anything to call, and puts back what was there."""
    current = mujoco.get_mjcb_passive()
    if _INSTALLED and current is not _call:
        _BEFORE[0] = current
        mujoco.set_mjcb_passive(_call)
    elif not _INSTALLED and current is _call:
        mujoco.set_mjcb_passive(_BEFORE[0])
        _BEFORE[0] = None
