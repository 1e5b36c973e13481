"""Pictures, for those who have matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Callable, Optional

import numpy as np
from numpy.typing import NDArray

from pegfit._optional import needed_by

if TYPE_CHECKING:
    from matplotlib.axes import Axes as _Axes

Float = NDArray[np.float64]


def _drawn_on(ax: Optional[_Axes]) -> _Axes:
    if ax is not None:
        return ax
    with needed_by("plot", "matplotlib", "plot"):
        from matplotlib import pyplot

    return pyplot.subplots()[1]


def _map(ax: Optional[_Axes], x: Any, z: Any, values: Any, label: str, title: str) -> _Axes:
    drawn = _drawn_on(ax)
    mesh = drawn.pcolormesh(1e3 * x, 1e3 * z, values.T, shading="nearest", cmap="RdBu_r")
    most = float(np.max(np.abs(values))) or 1.0
    mesh.set_clim(-most, most)
    figure = drawn.figure
    figure.colorbar(mesh, ax=drawn, label=label)
    drawn.set(xlabel="x (mm)", ylabel="z (mm)", title=title, aspect="equal")
    return drawn


def density_map(axes: list[Float], values: Any, y: float, ax: Optional[_Axes]) -> _Axes:
    """Im density on the plane of nodes nearest to `y`; `values` over the three axes, metres."""
    j = int(np.argmin(np.abs(axes[1] - y)))
    title = f"Density, y = {1e3 * axes[1][j]:.3g} mm"
    return _map(ax, axes[0], axes[2], values[:, j].imag, "Im density", title)


def score_map(axes: list[Float], values: Any, ax: Optional[_Axes]) -> _Axes:
    """The score on the plane of y in which it is highest; `values` over the three axes, metres."""
    j = int(np.unravel_index(int(np.argmax(values)), values.shape)[1])
    title = f"Score, y = {1e3 * axes[1][j]:.3g} mm"
    return _map(ax, axes[0], axes[2], values[:, j], "score (m³)", title)


def energy_lines(
    window: Float, energy: Callable[[Float], Float], title: str, ax: Optional[_Axes]
) -> _Axes:
    """Energy along x, y and z through the identity, as far as the window goes, metres `(2, 3)`."""
    drawn = _drawn_on(ax)
    low, high = window
    for k, name in enumerate("xyz"):
        poses = np.zeros((201, 7))
        poses[:, 6] = 1.0
        poses[:, k] = np.linspace(low[k], high[k], len(poses))
        drawn.plot(1e3 * poses[:, k], 1e3 * energy(poses), label=f"along {name}")
    drawn.set(xlabel="displacement (mm)", ylabel="energy (mJ)", title=title)
    drawn.legend()
    return drawn
