"""What is found among poses: scores over displacements, and where the part may belong."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Optional

import numpy as np
from numpy.typing import NDArray

from pegfit import _core
from pegfit._counts import count
from pegfit._errors import SceneError

if TYPE_CHECKING:
    from matplotlib.axes import Axes as _Axes

    from pegfit._pair import Pair

Float = NDArray[np.float64]


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
            expected, found = "metres, not negative", str(apart)
            message = f"apart: expected {expected}, found {found}"
            raise SceneError(message, item="apart", expected=expected, found=found)
        highest = _core.highest(self.values, count(k, "k", SceneError), radius)
        index = np.array(highest, dtype=np.intp).reshape(-1, 3)
        displacements = self.origin + self.spacing * index
        poses = _core.poses_at(self._pair._core, self.rotation, displacements)
        return poses, self.values[tuple(index.T)].astype(np.float64)

    def plot(self, ax: Optional[_Axes] = None) -> _Axes:
        """Draws the score on the plane of y in which it is highest (needs matplotlib)."""
        from pegfit._plots import score_map

        return score_map(self, ax)

    def __repr__(self) -> str:
        shape = " x ".join(str(n) for n in self.values.shape)
        return (
            f"Scores at {shape} displacements every {1e3 * self.spacing:.4g} mm, "
            f"highest {float(self.values.max()):.4g} m³"
        )


@dataclass(frozen=True, repr=False)
class Docking:
    """Poses where the moving part may belong, lowest energy first, unrefined ones last.

    Attributes:
        poses: `(k, 7)`, x y z qx qy qz qw, in the fixed part's frame or the scene.
        energy: Under the docking weights, joules, `(k,)`.
        depth: Energy as a share of the deepest pose's, `(k,)`.
        quality: Score as a share of what the smaller part would score in a perfect mould of itself,
            0 to 1, `(k,)`.
        mating_area: Area of the moving part's faces that lie against opposite faces of the fixed one,
            square metres, `(k,)`.
        model_energy: Energy under the pair's own model, joules, `(k,)`.
        half_width: How far the energy takes to rise to half, metres, `(k,)`; infinite if it does not
            within the moving part.
        overlap: Share of the moving part's volume that the fixed one fills as well, measured from
            the surfaces, `(k,)`.
        penetration: How deep a point of either part lies in the other at most, metres, `(k,)`.
        condition: How far the terms of the score cancel, `(k,)`; NaN for all but the best.
        refined: False where downhill led out of the domain, `(k,)`.
        scored: Rotations scored.
        rotations: Rotations looked at.
    """

    poses: Float
    energy: Float
    depth: Float
    quality: Float
    mating_area: Float
    model_energy: Float
    half_width: Float
    overlap: Float
    penetration: Float
    condition: Float
    refined: NDArray[np.bool_]
    scored: int
    rotations: int

    def __len__(self) -> int:
        return len(self.poses)

    def __repr__(self) -> str:
        text = f"Docking: {len(self)} poses of {self.scored} of {self.rotations} rotations"
        if len(self) == 0:
            return text
        return f"{text}, deepest {1e3 * self.energy[0]:.4g} mJ"
