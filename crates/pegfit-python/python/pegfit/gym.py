"""Peg insertion for Gymnasium: MuJoCo moves the peg, pegfit gives the contact."""

from __future__ import annotations

import os
import tempfile
from typing import Any, Optional

import gymnasium
import mujoco
import numpy as np
from numpy.typing import NDArray

from pegfit._errors import PegfitError
from pegfit._mesh import Mesh, peg_in_hole
from pegfit._pair import Pair
from pegfit._source import Table
from pegfit.mujoco import PassiveForce

Float = NDArray[np.float64]

#: Width of the example's square, and length of the peg over its width.
_WIDTH, _LENGTH = 0.020, 1.5

#: The hole, and a peg that floats: a robot carries its weight.
_MODEL = """
<mujoco>
  <option timestep="0.001" gravity="0 0 0" integrator="implicitfast"/>
  <visual><global offwidth="{size}" offheight="{size}"/></visual>
  <statistic center="0 0 {tall}" extent="{view}"/>
  <worldbody>
    <light pos="0 0 1" dir="0 0 -1"/>
    <body name="hole">
{walls}
    </body>
    <body name="peg">
      <freejoint/>
      <inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>
      <geom type="box" size="{half} {half} {tall}" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
</mujoco>
"""


#: Pixels along a side of a picture.
_SIZE = 480


def _walls(width: float) -> str:
    """What is drawn for the hole: four walls around it. They touch nothing."""
    half, thick, deep = 0.5 * width, 0.25 * width, 0.5 * _LENGTH * width
    line = '      <geom type="box" pos="{} {} 0" size="{} {} {}" mass="0" {}/>'
    look = 'contype="0" conaffinity="0" rgba="0.5 0.6 0.7 0.4"'
    away = half + thick
    walls = [(s * away, 0.0, thick, half + 2 * thick) for s in (-1, 1)]
    walls += [(0.0, s * away, half, thick) for s in (-1, 1)]
    return "\n".join(line.format(x, y, a, b, deep, look) for x, y, a, b in walls)


def tabulate(section: str = "rectangular", width: float = 0.02, clearance: float = 0.0) -> Table:
    """The table of a peg and its hole that the task needs, in memory; seconds to make.

    Args:
        section: As for `pegfit.peg_in_hole`.
        width: Of the peg, metres: the edge of its square, the diameter of its circle.
        clearance: Metres on every side.
    """
    scale = width / _WIDTH
    meshes = peg_in_hole(section, clearance / scale)
    parts = [Mesh(m.vertices * scale, m.faces, unit="m", name=m.name) for m in meshes]
    reach = np.array([0.35, 0.35, 2.1]) * width
    pair = Pair(parts[0], parts[1], spacing=0.05 * width, half_extent=reach)
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "table.zarr")
        return pair.bake(path, angle_deg=8.0, step_deg=4.0)


def _refused(item: str, expected: str, found: str) -> PegfitError:
    message = f"{item}: expected {expected}, found {found}"
    return PegfitError(message, item=item, expected=expected, found=found)


def _renderer(model: mujoco.MjModel) -> Any:
    """What draws the scene; it needs OpenGL."""
    try:
        return mujoco.Renderer(model, _SIZE, _SIZE)
    except Exception as error:  # each back end of OpenGL has errors of its own
        expected = "None where MuJoCo cannot draw (set MUJOCO_GL to egl or osmesa)"
        raise _refused("render_mode", expected, f"'rgb_array', and {error}") from error


class PegInsertion(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """A peg above a hole, held softly, is to be seated.

    The peg (50 g) hangs on a spring and a damper to a set-point, as on a compliant wrist; contact is
    a `pegfit.mujoco.PassiveForce`. A step is 20 ms.

    Observation, `(18,)`, float32, all in the hole's frame, whose z axis points out of it: position of
    the peg from its seat (widths of the peg), its rotation from the seat as axis times angle (rad),
    velocity (widths/s), angular velocity (rad/s), force (N) and torque (N times the width) of the
    contact on the peg.

    Action, `(6,)`, float32, -1 to 1: velocity of the set-point, in 5 widths per second, and its
    angular velocity, in rad/s. The set-point stays within half a width and 0.3 rad of the peg.

    Reward: minus the distance from the seat in lengths of the peg, minus the angle in radians, at
    every step; 10 more when it is seated, which ends the episode: within a twentieth of a width and
    two degrees. An episode is cut off after 400 steps. One that MuJoCo cannot go on with, because a
    number became too large, is cut off, too, with reward 0 and `failed` in what is told.

    A start is 1.05 to 1.2 lengths above the seat, up to a fifth of a width to either side, and turned
    by up to 5 degrees about any axis; `reset(seed=...)` repeats it.

    `gymnasium.make("pegfit/PegInsertion-v0")` makes one, too, once this module is imported.

    Args:
        section: As for `pegfit.peg_in_hole`.
        width: Of the peg, metres.
        clearance: Metres on every side.
        table: What `tabulate` gives for the same arguments, to be shared by many.
        render_mode: `"rgb_array"` for pictures by `render`, where MuJoCo can draw; else `None`.

    Raises:
        PegfitError: Another `render_mode`, or MuJoCo cannot draw here; from `step`, an action that is
            not finite or of another shape.
    """

    metadata: dict[str, Any] = {
        "render_modes": ["rgb_array"] if hasattr(mujoco, "Renderer") else [],
        "render_fps": 50,
    }

    #: Ticks of a millisecond per step, and steps per episode.
    TICKS, STEPS = 20, 400

    def __init__(
        self,
        section: str = "rectangular",
        width: float = 0.02,
        clearance: float = 0.0,
        table: Optional[Table] = None,
        render_mode: Optional[str] = None,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise _refused("render_mode", "None or 'rgb_array'", repr(render_mode))
        self.render_mode = render_mode
        self._table = tabulate(section, width, clearance) if table is None else table
        self._width, self._length = width, _LENGTH * width
        self._mass, self._inertia = 0.05, 0.05 * (0.5 * width) ** 2
        text = _MODEL.format(
            mass=self._mass,
            inertia=self._inertia,
            half=0.5 * width,
            tall=0.5 * self._length,
            view=2.0 * self._length,
            size=_SIZE,
            walls=_walls(width),
        )
        self._model = mujoco.MjModel.from_xml_string(text)
        self._data = mujoco.MjData(self._model)
        self._renderer = None if render_mode is None else _renderer(self._model)
        self._force = PassiveForce(self._model, self._table, "hole", "peg")
        #: Stiffness (N/m, N m/rad) of the wrist, and damping that is critical.
        self._stiffness = 400.0, 400.0 * width**2
        self._damping = (
            2.0 * float(np.sqrt(self._stiffness[0] * self._mass)),
            2.0 * float(np.sqrt(self._stiffness[1] * self._inertia)),
        )
        self._held = np.zeros(3)
        self._held_turn = np.array([1.0, 0, 0, 0])
        self._steps = 0
        space = gymnasium.spaces.Box
        self.observation_space = space(-np.inf, np.inf, (18,), np.float32)
        self.action_space = space(-1.0, 1.0, (6,), np.float32)

    def reset(
        self, *, seed: Optional[int] = None, options: Optional[dict[str, Any]] = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """A new start."""
        super().reset(seed=seed)
        random = self.np_random
        mujoco.mj_resetData(self._model, self._data)
        place = self._data.qpos
        place[:2] = random.uniform(-0.2, 0.2, 2) * self._width
        place[2] = random.uniform(1.05, 1.2) * self._length
        axis = random.normal(size=3)
        angle = random.uniform(0.0, np.radians(5.0))
        mujoco.mju_axisAngle2Quat(place[3:7], axis / np.linalg.norm(axis), angle)
        # A free joint's quaternion and all that MuJoCo keeps from step to step are new by now; the
        # force and what it tells of the last episode must be, too.
        self._force.reset()
        self._held[:], self._held_turn[:] = place[:3], place[3:7]
        self._steps = 0
        with self._force:
            mujoco.mj_forward(self._model, self._data)
        return self._observe(), {}

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """20 ms."""
        given = np.asarray(action, dtype=np.float64)
        if given.shape != (6,) or not np.isfinite(given).all():
            raise _refused("action", "six finite numbers", repr(action))
        given = np.clip(given, -1.0, 1.0)
        seconds = 1e-3
        failures = self._failures()
        with self._force:
            for _ in range(self.TICKS):
                self._move_held(5.0 * self._width * given[:3] * seconds, given[3:] * seconds)
                self._pull()
                mujoco.mj_step(self._model, self._data)
                if self._failures() != failures:
                    return self._failed()
        self._steps += 1
        at, turn = self._data.qpos[:3], self._rotation()
        distance, angle = float(np.linalg.norm(at)), float(np.linalg.norm(turn))
        seated = distance < 0.05 * self._width and angle < np.radians(2.0)
        reward = -distance / self._length - angle + (10.0 if seated else 0.0)
        cut = not seated and self._steps >= self.STEPS
        told = self._told(distance, angle)
        return self._observe(), reward, seated, cut, told

    def _told(self, distance: float, angle: float) -> dict[str, Any]:
        return {"distance": distance, "angle": angle, "energy": self._force.energy, "failed": False}

    def _failures(self) -> tuple[int, ...]:
        """How often MuJoCo found a number too large or none, after which it starts anew."""
        warning = mujoco.mjtWarning
        kinds = (warning.mjWARN_BADQPOS, warning.mjWARN_BADQVEL, warning.mjWARN_BADQACC)
        return tuple(int(self._data.warning[int(kind)].number) for kind in kinds)

    def _failed(
        self,
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """The end of an episode that MuJoCo reset: what it shows now is no peg's place."""
        told = self._told(float("nan"), float("nan")) | {"failed": True}
        return np.zeros(18, np.float32), 0.0, False, True, told

    def render(self) -> Optional[NDArray[np.uint8]]:
        """The scene as it is, `(480, 480, 3)`; `None` without a `render_mode`."""
        if self._renderer is None:
            return None
        self._renderer.update_scene(self._data)
        picture: NDArray[np.uint8] = self._renderer.render()
        return picture

    def close(self) -> None:
        """Gives back what pictures need."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _move_held(self, by: Float, turn: Float) -> None:
        """Moves the set-point, which stays near the peg."""
        at, quat = self._data.qpos[:3], self._data.qpos[3:7]
        reach = 0.5 * self._width
        self._held[:] = at + np.clip(self._held + by - at, -reach, reach)
        # In the world's axes: before what there is.
        step, turned = np.empty(4), np.empty(4)
        angle = float(np.linalg.norm(turn))
        mujoco.mju_axisAngle2Quat(step, turn / max(angle, 1e-12), angle)
        mujoco.mju_mulQuat(turned, step, self._held_turn)
        off = self._turn_between(quat, turned)
        size = float(np.linalg.norm(off))
        if size > 0.3:
            mujoco.mju_axisAngle2Quat(step, off / size, 0.3)
            mujoco.mju_mulQuat(turned, step, quat)
        self._held_turn[:] = turned

    def _pull(self) -> None:
        """The wrist's spring and damper, in the world's axes."""
        data = self._data
        velocity, spin = data.qvel[:3], np.empty(3)
        # A free joint's angular velocity is in the body's axes.
        mujoco.mju_rotVecQuat(spin, data.qvel[3:6], data.qpos[3:7])
        off = self._turn_between(data.qpos[3:7], self._held_turn)
        pull = data.xfrc_applied[2]
        pull[:3] = self._stiffness[0] * (self._held - data.qpos[:3]) - self._damping[0] * velocity
        pull[3:] = self._stiffness[1] * off - self._damping[1] * spin

    @staticmethod
    def _turn_between(start: Float, end: Float) -> Float:
        """Axis times angle, in the world's axes, of the turn from one to the other."""
        back, between, turn = np.empty(4), np.empty(4), np.empty(3)
        mujoco.mju_negQuat(back, start)
        mujoco.mju_mulQuat(between, end, back)
        mujoco.mju_quat2Vel(turn, between, 1.0)
        return turn

    def _rotation(self) -> Float:
        return self._turn_between(np.array([1.0, 0, 0, 0]), self._data.qpos[3:7])

    def _observe(self) -> NDArray[np.float32]:
        data, width = self._data, self._width
        spin = np.empty(3)
        mujoco.mju_rotVecQuat(spin, data.qvel[3:6], data.qpos[3:7])
        parts = [
            data.qpos[:3] / width,
            self._rotation(),
            data.qvel[:3] / width,
            spin,
            self._force.force,
            self._force.torque / width,
        ]
        return np.concatenate(parts).astype(np.float32)


def scripted(observation: NDArray[np.float32]) -> NDArray[np.float32]:
    """A policy for `PegInsertion`: above the hole it lines the peg up, then pushes it down."""
    at, turn = observation[:3].astype(np.float64), observation[3:6].astype(np.float64)
    aside = float(np.linalg.norm(at[:2]))
    tilt = float(np.linalg.norm(turn))
    ready = (aside < 0.02 and tilt < np.radians(2.0)) or at[2] < 0.95 * _LENGTH
    down = -at[2] if ready else 1.15 * _LENGTH - at[2]
    action = np.empty(6, dtype=np.float32)
    action[:2] = -2.0 * at[:2]
    action[2] = 2.0 * down
    action[3:] = -8.0 * turn
    return np.clip(action, -1.0, 1.0)


gymnasium.register("pegfit/PegInsertion-v0", "pegfit.gym:PegInsertion")
