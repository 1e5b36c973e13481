"""A force between two bodies of a MuJoCo model, from a table or an evaluator.

MuJoCo's own contact of these two must be off (`contype="0" conaffinity="0"`, or an `exclude`): it
takes meshes for their convex hulls, which closes the hole.
"""

from __future__ import annotations

from types import TracebackType
from typing import Any, Optional, Union

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pegfit import _core
from pegfit._errors import PegfitError
from pegfit._loop import source_of
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


def _others(model: mujoco.MjModel, data: mujoco.MjData) -> Float:
    """The generalized forces of a step that are known while passive ones are gathered: all but those
    of contacts and other constraints; those of actuators are the step before's."""
    bias: Float = np.empty(model.nv)
    mujoco.mj_rne(model, data, 0, bias)
    forces: Float = data.qfrc_passive + data.qfrc_applied + data.qfrc_actuator - bias
    for body in np.flatnonzero(data.xfrc_applied.any(axis=1)):
        force, torque = data.xfrc_applied[body, :3], data.xfrc_applied[body, 3:]
        mujoco.mj_applyFT(model, data, force, torque, data.xipos[body], int(body), forces)
    return forces


class PassiveForce:
    """Adds force and torque of a pair to two bodies in every step, equal and opposite.

    Works while a `with` lasts, or between `install` and `remove`; several may, each for a pair of
    its own, and a callback that was there before is still called. MuJoCo compiles no model while a
    callback is set, so make all models before.

    The force is that of the end of the step, found with the bodies' own inertia (an implicit step),
    so a light body stands in a kink of the energy instead of being kicked out of it. What bodies and
    pair hold together never grows by the force: a step that would gain takes motion instead, as a
    soft contact does. Where the energy is level there is no force and no damping at all. This holds
    for the integrators Euler, implicit and implicitfast, whose steps end where their velocity leads.

    Args:
        model: The model.
        source: A `Table`, an `Evaluator` or a `Pair` (then with `REAL_TIME_POINTS`).
        fixed: Name or number of the body that the fixed part belongs to; it may move.
        moving: That of the moving part.
        fixed_frame: Where the fixed mesh's frame lies in its body's, x y z qx qy qz qw; the same if
            `None`.
        moving_frame: The same for the moving one.
        raw: The bare force of the energy where the step begins. At zero clearance it jumps, and
            throws a light body about in steps of a millisecond.

    Attributes:
        energy: Joules, where the last step leads; with `raw`, where it began.
        coverage: 1 where the source knows that pose.
        force: On the moving part in the world's axes, newtons, `(3,)`.
        torque: About the moving mesh's origin in the world's axes, newton metres, `(3,)`.

    Raises:
        PegfitError: There is no such body.

    >>> from pegfit import peg_in_hole
    >>> geom = '<geom type="box" size="0.01 0.01 0.015" contype="0" conaffinity="0"/>'
    >>> peg = f'<body name="peg" pos="0 0 0.002"><freejoint/>{geom}</body>'
    >>> bodies = f'<body name="hole"/>{peg}'
    >>> model = mujoco.MjModel.from_xml_string(
    ...     f'<mujoco><option gravity="0 0 0"/><worldbody>{bodies}</worldbody></mujoco>'
    ... )
    >>> data, pair = mujoco.MjData(model), Pair(*peg_in_hole(), spacing=0.003)
    >>> with PassiveForce(model, pair, "hole", "peg") as force:
    ...     mujoco.mj_step(model, data)
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
        raw: bool = False,
    ) -> None:
        self._bodies = _body(model, fixed), _body(model, moving)
        self._frames = _Frame(fixed_frame), _Frame(moving_frame)
        if isinstance(source, Pair):
            source = source.evaluator(max_points=REAL_TIME_POINTS)
        self._source = source
        self._raw = raw
        self._step = _core.BodyForce(source_of(source))
        self._time = np.inf
        self._out = Response.empty(1)
        self._at = np.zeros((2, 3))
        self._turn = np.zeros((2, 4))
        self._row = np.zeros((1, 7))
        self._jacobian = np.zeros((2, 2, 3, model.nv))
        self._model = model
        self.energy, self.coverage = 0.0, 0.0
        self.force, self.torque = np.zeros(3), np.zeros(3)

    def reset(self) -> None:
        """Forgets what was: the bodies were put somewhere else. Done by itself when time goes back."""
        self._step.release()
        self._time = np.inf

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
            force, torque, point = found.force[0], found.torque[0], self._at[1]
            self.energy, self.coverage = float(found.energy[0]), float(found.coverage[0])
        else:
            point = data.xipos[self._bodies[1]].copy()
            force, torque = self._held(model, data, point)
        mujoco.mju_rotVecQuat(self.force, force, self._turn[0])
        mujoco.mju_rotVecQuat(self.torque, torque, self._turn[0])
        fixed, moving = self._bodies
        into = data.qfrc_passive
        mujoco.mj_applyFT(model, data, self.force, self.torque, point, moving, into)
        mujoco.mj_applyFT(model, data, -self.force, -self.torque, point, fixed, into)
        self.torque += np.cross(point - self._at[1], self.force)

    def _held(
        self, model: mujoco.MjModel, data: mujoco.MjData, point: Float
    ) -> tuple[Float, Float]:
        """Force and torque about `point`, the moving body's centre, for the step that begins."""
        elapsed = data.time - self._time if np.isfinite(self._time) else 0.0
        if elapsed < 0.0:
            self.reset()
            elapsed = 0.0
        self._time = data.time
        turned = np.empty(9)
        mujoco.mju_quat2Mat(turned, self._turn[0])
        axes = turned.reshape(3, 3).T
        for k, body in enumerate(self._bodies):
            mujoco.mj_jac(model, data, self._jacobian[k, 1], self._jacobian[k, 0], point, body)
        # Of the moving body against the fixed one, its turning first, in the fixed part's axes.
        between = (axes @ (self._jacobian[1] - self._jacobian[0])).reshape(6, model.nv)
        pushed = np.empty_like(between)
        mujoco.mj_solveM(model, data, pushed, between)
        twist = between @ data.qvel
        seconds = model.opt.timestep
        free = twist + seconds * (pushed @ _others(model, data))
        center = np.empty(3)
        undo = np.empty(4)
        mujoco.mju_negQuat(undo, self._turn[1])
        mujoco.mju_rotVecQuat(center, point - self._at[1], undo)
        force, torque, self.energy, self.coverage, _ = self._step.step(
            self._row[0], center, twist, free, pushed @ between.T, seconds, elapsed
        )
        return np.array(force), np.array(torque)

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
        way = ", raw" if self._raw else ""
        return f"PassiveForce of {self._source!r} on bodies {fixed} and {moving}{way}"


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
