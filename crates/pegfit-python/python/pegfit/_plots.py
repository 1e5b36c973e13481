"""Pictures, for those who have matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Optional

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes as _Axes

    from pegfit._mesh import Density
    from pegfit._search import Scores
    from pegfit._source import Table


def _drawn_on(ax: Optional[_Axes]) -> _Axes:
    if ax is not None:
        return ax
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


def density_map(density: Density, y: float, ax: Optional[_Axes]) -> _Axes:
    """Im density on the plane of nodes nearest to `y`."""
    along = density.axis(1)
    j = int(np.argmin(np.abs(along - y)))
    values = (density.exterior[:, j] + density.interior[:, j]).imag
    title = f"Density, y = {1e3 * along[j]:.3g} mm"
    return _map(ax, density.axis(0), density.axis(2), values, "Im density", title)


def score_map(scores: Scores, ax: Optional[_Axes]) -> _Axes:
    """The score on the plane of y in which it is highest."""
    j = int(np.unravel_index(int(np.argmax(scores.values)), scores.values.shape)[1])
    title = f"Score, y = {1e3 * scores.y[j]:.3g} mm"
    return _map(ax, scores.x, scores.z, scores.values[:, j], "score (m³)", title)


def energy_lines(table: Table, ax: Optional[_Axes]) -> _Axes:
    """Energy along x, y and z through the identity, as far as the window goes."""
    drawn = _drawn_on(ax)
    low, high = table.window
    for k, name in enumerate("xyz"):
        poses = np.zeros((201, 7))
        poses[:, 6] = 1.0
        poses[:, k] = np.linspace(low[k], high[k], len(poses))
        drawn.plot(1e3 * poses[:, k], 1e3 * table.query(poses).energy, label=f"along {name}")
    drawn.set(xlabel="displacement (mm)", ylabel="energy (mJ)", title=table.path)
    drawn.legend()
    return drawn
