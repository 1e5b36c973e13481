"""Two parts: their scores, where they fit, their tables."""

from __future__ import annotations

import json
import warnings
from dataclasses import dataclass, field
from html import escape
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pegfit import _core
from pegfit._errors import SceneError, count, count_or_none
from pegfit._insertion_path import InsertionPath
from pegfit._mesh import Mesh, MeshLike, Path, as_mesh
from pegfit._notebook import (
    Surface,
    axis_of,
    direction_words,
    drawing,
    number,
    pose_words,
    table,
)
from pegfit._poses import RotationLike, quaternion, rows, three
from pegfit._progress import Progress, Reporting
from pegfit._source import Evaluator, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes as _Axes

Float = NDArray[np.float64]

#: A box of displacements, metres: half its sides about zero (one number or three), or its least and
#: greatest corner.
Window = Union[ArrayLike, tuple[ArrayLike, ArrayLike]]


def _corners(window: Window) -> tuple[Float, Float]:
    if isinstance(window, tuple) and len(window) == 2:
        return three(window[0], "window"), three(window[1], "window")
    half = three(window, "window")
    return -half, half


def _refused(item: str, expected: str, found: str) -> SceneError:
    message = f"{item}: expected {expected}, found {found}"
    return SceneError(message, item=item, expected=expected, found=found)


def _end(given: Union[str, ArrayLike], word: str, item: str) -> Optional[Float]:
    """One end of a path: a pose `(7,)`, or `None` for the word."""
    if isinstance(given, str):
        if given != word:
            words = "fit, best" if item == "to" else word
            raise _refused(item, f"{words} or a pose", repr(given))
        return None
    pose: Float = rows(np.asarray(given, dtype=np.float64)[None])[0]
    return pose


@dataclass(frozen=True, repr=False)
class Scores:
    """The score of one rotation over displacements.

    Attributes:
        values: Cubic metres, `(nx, ny, nz)`; the energy is minus gamma times it.
        origin: First displacement, metres.
        spacing: Metres between displacements.
        rotation: Of the moving part, x y z w.
    """

    values: NDArray[np.float32]
    origin: Float
    spacing: float
    rotation: Float
    _pair: Pair

    def _axis(self, k: int) -> Float:
        return np.asarray(self.origin[k] + self.spacing * np.arange(self.values.shape[k]))

    @property
    def x(self) -> Float:
        """Displacements of the pivot along the fixed part's own x axis, metres, `(nx,)`."""
        return self._axis(0)

    @property
    def y(self) -> Float:
        """The same along y, `(ny,)`."""
        return self._axis(1)

    @property
    def z(self) -> Float:
        """The same along z, `(nz,)`."""
        return self._axis(2)

    def top(self, k: int = 10, *, apart: Optional[float] = None) -> tuple[Float, Float]:
        """The highest local maxima: their poses `(m, 7)` and scores `(m,)`, m at most `k`, highest
        first, more than `apart` metres from each other (two spacings if `None`).

        >>> from pegfit import Pair, peg_in_hole
        >>> scores = Pair(*peg_in_hole("combined"), spacing=0.003).correlate(window=0.006)
        >>> poses, values = scores.top(1)
        >>> poses.shape, bool(values[0] == scores.values.max())
        ((1, 7), True)
        """
        radius = 2.0 if apart is None else apart / self.spacing
        if not radius >= 0:
            raise _refused("apart", "metres, not negative", str(apart))
        highest = _core.highest(self.values, count(k, "k", SceneError), radius)
        index = np.array(highest, dtype=np.intp).reshape(-1, 3)
        displacements = self.origin + self.spacing * index
        poses = _core.poses_at(self._pair._core, self.rotation, displacements)
        return poses, self.values[tuple(index.T)].astype(np.float64)

    def plot(self, ax: Optional[_Axes] = None) -> _Axes:
        """Draws the score on the plane of y in which it is highest (needs matplotlib)."""
        from pegfit._plots import score_map

        return score_map([self.x, self.y, self.z], self.values, ax)

    def __repr__(self) -> str:
        shape = " x ".join(str(n) for n in self.values.shape)
        return (
            f"Scores at {shape} displacements every {1e3 * self.spacing:.4g} mm, "
            f"highest {float(self.values.max()):.4g} m³"
        )


@dataclass(frozen=True)
class Joint:
    """What contact leaves free: the mate of two parts.

    Attributes:
        kind: `"fixed"`, `"prismatic"`, `"revolute"`, `"cylindrical"`, `"screw"`, `"planar"`, `"ball"`
            or `"undetermined"`.
        freedoms: Motions that are free.
        axis: Direction in the fixed part's frame or the scene, `(3,)`; NaN without an axis.
        point: A point of the axis, or the centre of a ball, metres, `(3,)`; NaN without one.
        pitch: Metres per turn of a screw, positive if right-handed; else 0.
        slide: Travel along the axis from the pose, metres, `(2,)`; NaN where there is none.
        turn: Travel about the axis, radians, `(2,)`.
    """

    kind: str
    freedoms: int
    axis: Float
    point: Float
    pitch: float
    slide: Float
    turn: Float


def _axis_words(joint: Joint) -> str:
    along = f"along ({direction_words(joint.axis)})" if np.isfinite(joint.axis).all() else ""
    return f"{joint.kind} {along}".strip()


@dataclass(frozen=True, repr=False)
class Docking:
    """Poses where the moving part may belong, the best first.

    Attributes:
        poses: `(k, 7)`, x y z qx qy qz qw, in the fixed part's frame or the scene.
        hold: What ranks poses by contact, nats, `(k,)`: how it holds the part, less what overlaps.
        information: How much contact says about the pose, nats, `(k,)`.
        mating_area: Area of the moving part's faces that lie against opposite faces of the fixed one,
            square metres, `(k,)`.
        mating_share: The same as a share of the moving part's surface, `(k,)`.
        escape: Share of the directions in which nothing blocks a displacement, `(k,)`.
        overlap: Share of the moving part's volume that the fixed one fills as well, `(k,)`.
        penetration: How deep a point of either part lies in the other at most, metres, `(k,)`.
        joints: What contact leaves free, a `Joint` of each pose.
        alike: Other poses in which the same contact holds the part, an array `(n, 7)` of each pose.
        quality: Score as a share of what the smaller part would score in a perfect mould of itself,
            0 to 1, `(k,)`.
        energy: Under the docking weights, joules, `(k,)`; NaN if the fields cannot be computed.
        model_energy: Energy under the pair's own model, joules, `(k,)`.
        half_width: How far the energy takes to rise to half, metres, `(k,)`; NaN of poses that were
            ranked by contact.
        condition: How far the terms of the score cancel, `(k,)`; NaN for all but the best of a search
            by energy.
        refined: False where downhill led out of the domain, `(k,)`.
        scored: Rotations scored by energy; 0 without such a search.
        rotations: Rotations looked at by energy.

    A notebook shows a table of the poses, with pictures.
    """

    poses: Float
    hold: Float
    information: Float
    mating_area: Float
    mating_share: Float
    escape: Float
    overlap: Float
    penetration: Float
    joints: list[Joint]
    alike: list[Float]
    quality: Float
    energy: Float
    model_energy: Float
    half_width: Float
    condition: Float
    refined: NDArray[np.bool_]
    scored: int
    rotations: int
    _pair: Optional[Pair] = field(default=None, compare=False)

    @property
    def depth(self) -> Float:
        """Energy as a share of the deepest pose's, `(k,)`."""
        return np.asarray(self.energy / np.min(self.energy, initial=0.0))

    def __len__(self) -> int:
        return len(self.poses)

    def __repr__(self) -> str:
        text = f"Docking: {len(self)} pose{'s' * (len(self) != 1)}"
        if len(self) == 0:
            return text
        best = self.joints[0]
        return f"{text}, best {best.kind}, {self.information[0]:.1f} nats"

    def _repr_html_(self) -> str:
        """A row per pose for a notebook: picture, place, mate, information, quality, overlap."""
        head = ["", "pose", "mate", "free motions", "information", "quality", "overlap"]
        rows = []
        for k, (pose, joint) in enumerate(zip(self.poses, self.joints)):
            rows.append([
                "" if self._pair is None else self._pair._picture(pose, joint),
                escape(pose_words(pose)),
                escape(_axis_words(joint)),
                str(joint.freedoms),
                number(self.information[k], ".1f") + " nats",
                number(self.quality[k]),
                number(100 * self.overlap[k], ".2g") + " %",
            ])
        return table(head, rows, repr(self))


@dataclass(frozen=True)
class _SceneSource:
    """What a pair of meshes was made of, to write it as a scene."""

    fixed: Mesh
    moving: Mesh
    spacing: Optional[float]
    model: str
    cache: Optional[Path]
    peak_force: float
    gamma: Optional[float]
    half_extent: Optional[Float]

    def write(self, folder: FilePath) -> FilePath:
        """Writes meshes and scene into a folder; the scene's path."""
        for name, mesh in (("fixed", self.fixed), ("moving", self.moving)):
            lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist()]
            lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.faces.tolist()]
            (folder / f"{name}.obj").write_text("\n".join(lines) + "\n")
        energy = f"gamma = {self.gamma!r}"
        if self.gamma is None:
            energy = f"peak_force = {float(self.peak_force)!r}"
        words = ['unit = "m"', 'fixed = "fixed.obj"', 'moving = "moving.obj"']
        if self.cache is not None:
            words.append(f"cache = {json.dumps(str(FilePath(self.cache).resolve()))}")
        words += ["[model]", f"preset = {json.dumps(self.model)}", "[energy]", energy]
        if self.spacing is not None:
            words += ["[lattice]", f"spacing = {float(self.spacing)!r}"]
        if self.half_extent is not None:
            words += ["[window]", f"half_extent = {[float(x) for x in self.half_extent]}"]
        scene = folder / "scene.toml"
        scene.write_text("\n".join(words) + "\n")
        return scene


#: Settings of a pair of meshes, in the order in which the compiled half takes them.
_Options = tuple[
    Optional[float],
    str,
    Optional[Path],
    float,
    Optional[float],
    Optional[Float],
    Optional[int],
]


def _of_parts(fixed: Mesh, moving: Mesh, options: _Options) -> Pair:
    spacing, model, cache, peak_force, gamma, half, memory = options
    return Pair(
        fixed,
        moving,
        spacing=spacing,
        model=model,
        cache=cache,
        peak_force=peak_force,
        gamma=gamma,
        half_extent=half,
        memory=memory,
    )


def _of_scene(path: str, fixed: Optional[str], memory: Optional[int]) -> Pair:
    with warnings.catch_warnings():
        # They were told when the pair was made.
        warnings.simplefilter("ignore")
        return Pair.from_scene(path, fixed=fixed, memory=memory)


class Pair:
    """A part that stays and one that moves, modelled in the pose in which they fit.

    Nothing is computed before the first call that needs the density fields; then they are kept. Of a
    large part beside a small one only what poses reach is computed.

    Args:
        fixed: The part that stays: a `Mesh`, a file, or an object with vertices and faces.
        moving: The part that moves.
        unit: Of meshes that state none.
        spacing: Metres between lattice nodes; chosen from the parts if `None`.
        model: `"guided"`, a funnel into the fit with walls that hold, or `"paper"`.
        cache: Folder in which density fields are kept between runs.
        peak_force: Scale of the energy: the greatest force, newtons, while the assembled part is
            moved straight through the fit.
        gamma: Instead of that, joules per cubic metre of score.
        half_extent: Half the sides of the box of displacements of interest, metres; half the moving
            part's longest side if `None`. `dock` looks everywhere if `None`.
        memory: Bytes that computations may use; nine tenths of what is free if `None`.

    Raises:
        MeshError: A mesh cannot be used, or its unit is not known.
        SceneError: A number is out of range, or the fields do not fit in memory.

    >>> from pegfit import peg_in_hole
    >>> Pair(*peg_in_hole("rectangular"), spacing=0.002)
    Pair of 'rectangular hole' and 'rectangular peg': 32 and 12 faces, spacing 2 mm
    """

    def __init__(
        self,
        fixed: MeshLike,
        moving: MeshLike,
        unit: Optional[str] = None,
        spacing: Optional[float] = None,
        model: str = "guided",
        cache: Optional[Path] = None,
        *,
        peak_force: float = 5.0,
        gamma: Optional[float] = None,
        half_extent: Optional[ArrayLike] = None,
        memory: Optional[int] = None,
    ) -> None:
        meshes = [as_mesh(fixed, unit, "fixed"), as_mesh(moving, unit, "moving")]
        self._names = [mesh.name for mesh in meshes]
        half = None if half_extent is None else three(half_extent, "half_extent")
        self._scene: Union[Path, _SceneSource] = _SceneSource(
            meshes[0], meshes[1], spacing, model, cache, peak_force, gamma, half
        )
        limit = count_or_none(memory, "memory", SceneError)
        options = (spacing, model, cache, peak_force, gamma, half, limit)
        self._core = _core.Pair.of_meshes(meshes[0]._core, meshes[1]._core, *options)
        self._made: tuple[Any, ...] = (_of_parts, (*meshes, options))

    @classmethod
    def from_scene(
        cls, path: Path, *, fixed: Optional[str] = None, memory: Optional[int] = None
    ) -> Pair:
        """The pair of a scene file (`docs/scene.md`): poses are then those of the scene.

        Args:
            path: The file.
            fixed: Of several fixed parts, the name of one.
            memory: Bytes that computations may use.

        Raises:
            SceneError: The file, a value in it or what it asks for cannot be used.
            MeshError: A mesh cannot be used.
        """
        pair = cls.__new__(cls)
        memory = count_or_none(memory, "memory", SceneError)
        pair._core = _core.Pair.from_scene(path, fixed, memory)
        pair._names = [str(path)]
        pair._scene = path
        pair._made = (_of_scene, (str(FilePath(path).resolve()), fixed, memory))
        for warning in pair._core.warnings():
            warnings.warn(warning, stacklevel=2)
        return pair

    def __reduce__(self) -> tuple[Any, ...]:
        """For `pickle`: meshes and settings, or the scene's path. Density fields are made anew, or
        read from the `cache`."""
        return self._made

    def _write_scene(self, folder: FilePath) -> FilePath:
        """A scene file of the pair, for the command."""
        if isinstance(self._scene, _SceneSource):
            return self._scene.write(folder)
        return FilePath(self._scene)

    @property
    def spacing(self) -> float:
        """Metres between lattice nodes."""
        return self._core.describe()[0]

    @property
    def assembled(self) -> Float:
        """The pose in which the parts fit, `(7,)`."""
        return np.array(self._core.assembled())

    @property
    def fixed(self) -> Mesh:
        """The fixed part, where the scene places it; a new mesh."""
        return self._placed("fixed")

    @property
    def moving(self) -> Mesh:
        """The moving part, where the scene places it; a new mesh. Poses move it from there.

        >>> from pegfit import peg_in_hole
        >>> Pair(*peg_in_hole("rectangular"), spacing=0.002).moving
        Mesh 'rectangular peg': 8 vertices, 12 faces, 0.02 x 0.02 x 0.03 m
        """
        return self._placed("moving")

    def _placed(self, role: str) -> Mesh:
        moving = role == "moving"
        name = self._names[moving] if len(self._names) == 2 else f"{role} of {self._names[0]}"
        return Mesh(*self._core.placed(moving), unit="m", name=name)

    @property
    def pivot(self) -> Float:
        """The point of the moving part that displacements speak of, metres, `(3,)`."""
        return np.array(self._core.pivot())

    def evaluator(
        self,
        tolerance: Optional[float] = None,
        *,
        max_points: Optional[int] = None,
        progress: Progress = None,
    ) -> Evaluator:
        """Energy at any pose by direct quadrature.

        Args:
            tolerance: Errors of force and of torque, the rms of each as a share of its own rms, at
                poses over the pair's box and rotations, by comparison with half the spacing: 0.05
                for 5 %. The spacing is refined until they are within it; the pair's own if `None`.
            max_points: Instead of that, quadrature points at most: a coarser lattice is taken where
                the pair's own has more. `REAL_TIME_POINTS` are what a 1 kHz loop has time for.
            progress: `True` for a bar, or a function of the units done and their number.

        Raises:
            SceneError: A number is out of range, both are given, a part has no interior on its
                lattice, or no lattice that fits in memory meets the tolerance.
            KeyboardInterrupt: Within 50 ms of Ctrl-C.

        Two millimetres out of the fit, the peg is drawn back in:

        >>> from pegfit import peg_in_hole
        >>> source = Pair(*peg_in_hole(), spacing=0.002).evaluator()
        >>> response = source.query([[0, 0, 0.002, 0, 0, 0, 1]])
        >>> bool(response.energy[0] < 0 and response.force[0, 2] < 0)
        True
        """
        if tolerance is not None and max_points is not None:
            expected, found = "this or max_points", "both"
            raise _refused("tolerance", expected, found)
        max_points = count_or_none(max_points, "max_points", SceneError)
        with Reporting(progress) as report:
            core, points, error = self._core.evaluator(tolerance, max_points, report)
        return Evaluator(core, self, points, error, (tolerance, max_points))

    def correlate(
        self,
        rotation: RotationLike = (0.0, 0.0, 0.0, 1.0),
        window: Optional[Window] = None,
        *,
        progress: Progress = None,
    ) -> Scores:
        """The score of one rotation at every displacement of a window, by FFT.

        Args:
            rotation: Of the moving part: x y z w, a matrix `(3, 3)` or a `Rotation`.
            window: Displacements of the pivot along the fixed part's own axes, metres: half the
                sides of a box about zero, or its two corners; the pair's own box if `None`.
            progress: `True` for a bar, or a function of the units done and their number.

        Raises:
            PoseError: The rotation is none.
            SceneError: The window has no node or too many, or does not fit in memory.

        >>> from pegfit import peg_in_hole
        >>> scores = Pair(*peg_in_hole(), spacing=0.002).correlate(window=0.006)
        >>> scores.values.shape
        (7, 7, 7)
        >>> poses, values = scores.top(1)
        >>> poses.round(6)
        array([[0., 0., 0., 0., 0., 0., 1.]])
        """
        turn = quaternion(rotation)
        corners = None if window is None else _corners(window)
        with Reporting(progress) as report:
            values, origin, spacing = _core.correlate(self._core, turn, corners, report)
        return Scores(values, np.array(origin), spacing, turn, self)

    def dock(
        self,
        top: int = 10,
        tolerance: Optional[float] = None,
        *,
        rank: str = "contact",
        near: Optional[ArrayLike] = None,
        axis: Optional[ArrayLike] = None,
        keep_apart: Sequence[Mesh] = (),
        exhaustive: bool = False,
        state: Optional[Path] = None,
        progress: Progress = None,
    ) -> Docking:
        """Searches the poses where the moving part belongs, from any start.

        Args:
            top: Distinct poses to return, at most.
            tolerance: Relative L2 error allowed in the density fields, 1e-5 to 1e-2.
            rank: `"contact"`: by how contact holds the part; or `"energy"`.
            near: Only poses near this one, `(7,)`: within a quarter of the moving part's size and 30
                degrees.
            axis: A known axis of the moving part's turns, `(2, 3)`: a point, metres, and a direction.
            keep_apart: Parts that are there already: the moving part may touch them but does not
                overlap them.
            exhaustive: By energy, score every rotation, without a coarse screening.
            state: File that keeps what was scored by energy; a later call goes on from there.
            progress: `True` for a bar, or a function of the units done and their number.

        Raises:
            SceneError: A number is out of range, the search does not fit in memory, or the state
                file is of another search.
            KeyboardInterrupt: Within 50 ms of Ctrl-C; what was scored is in the state file.

        >>> from pegfit import peg_in_hole
        >>> found = Pair(*peg_in_hole("combined"), spacing=0.002).dock(top=1)
        >>> found.joints[0].kind, bool(abs(found.poses[0, :3]).max() < 5e-4)
        ('prismatic', True)
        """
        top = count(top, "top", SceneError)
        if rank not in ("contact", "energy"):
            raise _refused("rank", '"contact" or "energy"', repr(rank))
        at = None if near is None else rows(np.asarray(near, dtype=np.float64)[None])[0].tolist()
        line = None
        if axis is not None:
            given = np.asarray(axis, dtype=np.float64)
            if given.shape != (2, 3) or not np.isfinite(given).all() or not given[1].any():
                raise _refused("axis", "a point and a direction, (2, 3)", repr(axis))
            line = given.tolist()
        search = (top, tolerance, exhaustive, state, rank == "energy")
        known = (at, line, [mesh._core for mesh in keep_apart])
        with Reporting(progress) as report:
            poses, values, refined, counts, mates = _core.dock(self._core, search, known, report)
        energy, quality, mating, own, width, overlap, penetration, condition, hold = (
            values[:, k].copy() for k in range(9)
        )
        information, share, escape = (values[:, k].copy() for k in range(9, 12))
        joints = [
            Joint(
                kind,
                freedoms,
                np.array(direction),
                np.array(point),
                pitch,
                np.array(slide),
                np.array(turn),
            )
            for kind, freedoms, direction, point, pitch, slide, turn, _ in mates
        ]
        scored, rotations = (int(n) for n in counts)
        return Docking(
            poses,
            hold,
            information,
            mating,
            share,
            escape,
            overlap,
            penetration,
            joints,
            [mate[-1] for mate in mates],
            quality,
            energy,
            own,
            width,
            condition,
            refined,
            scored,
            rotations,
            self,
        )

    def path(
        self,
        to: Union[str, ArrayLike] = "fit",
        from_: Union[str, ArrayLike] = "outside",
        *,
        tolerance: Optional[float] = None,
        step: Optional[float] = None,
        seconds: float = 60.0,
        allow_overlap: bool = False,
        solids_only: bool = False,
        progress: Progress = None,
    ) -> InsertionPath:
        """Searches an insertion path of the moving part to where it fits, or proves that there is none.

        Args:
            to: The goal: `"fit"`, `"best"` (docks first), or a pose, `(7,)` or `(4, 4)`.
            from_: The start: `"outside"`, beside the fixed part, or a pose.
            tolerance: Overlaps up to this depth count as contact, metres; a thousandth of the moving
                part's radius if `None`.
            step: Largest motion of any point of the part between two poses, metres; a thirtieth of
                its radius if `None`.
            seconds: The search gives up after this time.
            allow_overlap: Continue if the parts overlap at the goal or start.
            solids_only: No fields and no energies: seconds less.
            progress: `True` for a bar, or a function of the units done and their number.

        Raises:
            PoseError: A pose is none.
            SceneError: A number is out of range, the parts overlap at the goal or start
                and that is not allowed, or they lie beside each other at the goal.
            KeyboardInterrupt: Within 50 ms of Ctrl-C.

        >>> from pegfit import peg_in_hole
        >>> path = Pair(*peg_in_hole("rectangular", clearance=2e-4)).path(solids_only=True)
        >>> path.free, len(path.words), path.words[0].startswith("push")
        (True, 1, True)
        >>> path.poses[-1].round(9)
        array([0., 0., 0., 0., 0., 0., 1.])
        """
        goal: Union[str, ArrayLike] = to
        if isinstance(goal, str) and goal == "best":
            found = self.dock(top=1, progress=progress)
            if len(found) == 0:
                raise _refused("to", "a pair in which docking finds a pose", "none")
            goal = found.poses[0]
        ends = (_end(goal, "fit", "to"), _end(from_, "outside", "from_"))
        with Reporting(progress) as report:
            core = _core.path(
                self._core,
                *ends,
                (tolerance, step),
                seconds,
                allow_overlap,
                solids_only,
                report,
            )
        return InsertionPath(core)

    def bake(
        self,
        path: Path,
        half_extent: Optional[ArrayLike] = None,
        angle_deg: Optional[float] = None,
        step_deg: Optional[float] = None,
        tolerance: Optional[float] = None,
        resume: bool = False,
        *,
        progress: Progress = None,
    ) -> Table:
        """Tabulates the energy, measures the table's error and reads it.

        Args:
            path: Folder of the new table.
            half_extent: Half the sides of the box of displacements, metres.
            angle_deg: Radius of the ball of rotations, degrees; the scene's rotations, or 20, if
                neither this nor `step_deg` is given.
            step_deg: Angle between rotations, degrees; 5. With a tolerance, where its choice begins.
            tolerance: Errors of force and of torque, the rms of each as a share of its own rms, 0.1
                for 10 %: spacing and step are chosen, the coarsest that do.
            resume: Go on with a table that is there.
            progress: `True` for a bar, or a function of the units done and their number.

        Raises:
            TableError: A table is there already, is one of another pair, or cannot be written, or
                no table meets the tolerance.
            SceneError: A number is out of range, or it does not fit in memory.
            KeyboardInterrupt: Within 50 ms of Ctrl-C; rotations that were finished stay, and
                `resume` goes on from them.

        >>> import os, tempfile
        >>> from pegfit import peg_in_hole
        >>> pair = Pair(*peg_in_hole(), spacing=0.003)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     table = pair.bake(os.path.join(folder, "t.zarr"), half_extent=0.009, angle_deg=5)
        >>> table.rotations
        125
        >>> bool(table.query([[0, 0, 0.002, 0, 0, 0, 1]]).force[0, 2] < 0)
        True
        """
        half = None if half_extent is None else three(half_extent, "half_extent")
        with Reporting(progress) as report:
            core, description = _core.bake_table(
                self._core, path, half, angle_deg, step_deg, tolerance, resume, report
            )
        return Table(core, description, self)

    def _picture(self, pose: Float, joint: Optional[Joint] = None) -> str:
        """Both parts at a pose, an SVG element."""
        fixed, moving = (Surface(*self._core.placed(which)) for which in (False, True))
        axis = None if joint is None else axis_of(joint.point, joint.axis)
        return drawing(fixed, moving.moved(pose), axis, f"the parts at {pose_words(pose)}")

    def _repr_html_(self) -> str:
        """For a notebook: the parts in the pose in which they fit."""
        figure = self._picture(self.assembled)
        return f"<figure>{figure}<figcaption>{escape(repr(self))}</figcaption></figure>"

    def __repr__(self) -> str:
        spacing, fixed, moving = self._core.describe()
        name = " and ".join(f"'{name}'" for name in self._names)
        return f"Pair of {name}: {fixed} and {moving} faces, spacing {1e3 * spacing:.4g} mm"
