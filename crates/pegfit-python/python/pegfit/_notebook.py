"""What a notebook shows of a pair and of docked poses: HTML that needs neither network nor script."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import Optional

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Whole = NDArray[np.intp]

#: Size of a picture, its margin, and the grid to which corners are rounded at first, pixels.
_WIDTH, _HEIGHT, _MARGIN, _CELL = 200.0, 150.0, 6.0, 0.5

#: Faces and lines of a part that a picture has at most: finer ones are merged.
_MOST_FACES, _MOST_LINES = 1500, 2000

#: Right and up on the picture, and towards the viewer, who stands 30 degrees above the x-y plane.
_RIGHT = np.array([0.8, 0.6, 0.0])
_UP = np.array([-0.3, 0.4, np.sqrt(0.75)])
_TOWARDS = np.cross(_RIGHT, _UP)

_LIGHT = np.array([0.35, -0.45, 0.82])


@dataclass(frozen=True)
class Surface:
    """Vertices `(n, 3)` in metres, and faces `(m, 3)`."""

    vertices: Float
    faces: NDArray[np.uint32]

    def moved(self, pose: Float) -> Surface:
        """Where a pose `(7,)` takes it."""
        return Surface(turned(pose[3:], self.vertices) + pose[:3], self.faces)


def turned(rotation: Float, vectors: Float) -> Float:
    """Vectors `(n, 3)` turned by x y z w."""
    axis, twice = rotation[:3], 2 * np.cross(rotation[:3], vectors)
    return np.asarray(vectors + rotation[3] * twice + np.cross(axis, twice))


class _Sheet:
    """From metres to pixels, so that some points fill the picture."""

    def __init__(self, points: Float) -> None:
        flat = points @ np.array([_RIGHT, -_UP]).T
        low, high = flat.min(axis=0), flat.max(axis=0)
        room = np.array([_WIDTH, _HEIGHT]) - 2 * _MARGIN
        self._scale = float(np.min(room / np.maximum(high - low, 1e-300)))
        self._shift = np.array([_WIDTH, _HEIGHT]) / 2 - self._scale * (low + high) / 2

    def pixels(self, points: Float) -> Float:
        """`(n, 2)`, y downwards."""
        return np.asarray(self._scale * (points @ np.array([_RIGHT, -_UP]).T) + self._shift)


def _normals(surface: Surface) -> Float:
    a, b, c = (surface.vertices[surface.faces[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    lengths = np.linalg.norm(cross, axis=1, keepdims=True)
    return np.asarray(cross / np.maximum(lengths, 1e-300))


def _merged(shapes: Float, most: int) -> tuple[Float, Whole]:
    """Polygons `(n, k, 2)` on the finest grid of pixels that leaves at most so many different ones,
    and which they are. Those of no extent are left out."""
    cell = _CELL
    while True:
        grid = np.round(shapes / cell).astype(np.int64)
        flat = grid.reshape(len(grid), 2 * shapes.shape[1])
        alike = (grid == np.roll(grid, 1, axis=1)).all(axis=2).any(axis=1)
        kept = np.flatnonzero(~alike)
        _, first = np.unique(flat[kept], axis=0, return_index=True)
        kept = np.sort(kept[first])
        if len(kept) <= most:
            return np.asarray(cell * grid[kept]), np.asarray(kept)
        cell *= 1.5


def _outline(points: Float, close: str) -> str:
    return "M" + "L".join(f"{x:.4g} {y:.4g}" for x, y in points.tolist()) + close


def _lines(surface: Surface, sheet: _Sheet) -> str:
    """Sharp edges, and those where the surface turns away from the viewer."""
    normals = _normals(surface)
    sides = surface.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    order = np.lexsort(np.sort(sides, axis=1).T[::-1])
    sides, owners = np.sort(sides, axis=1)[order], np.repeat(np.arange(len(normals)), 3)[order]
    # An edge of a closed surface has two faces, side by side once sorted.
    pairs = np.flatnonzero((sides[1:] == sides[:-1]).all(axis=1))
    one, other = normals[owners[pairs]], normals[owners[pairs + 1]]
    sharp = np.einsum("ij,ij->i", one, other) < 0.9
    drawn = sharp | ((one @ _TOWARDS > 0) != (other @ _TOWARDS > 0))
    ends = sheet.pixels(surface.vertices)[sides[pairs[drawn]]]
    merged, _ = _merged(ends, _MOST_LINES)
    return "".join(_outline(points, "") for points in merged)


def _faces(surface: Surface, sheet: _Sheet) -> tuple[Float, Whole, Float]:
    """Faces towards the viewer in pixels, the farthest first; their numbers and brightness."""
    normals = _normals(surface)
    front = np.flatnonzero(normals @ _TOWARDS > 0)
    near = (surface.vertices[surface.faces[front]].mean(axis=1)) @ _TOWARDS
    front = front[np.argsort(near, kind="stable")]
    merged, kept = _merged(sheet.pixels(surface.vertices)[surface.faces[front]], _MOST_FACES)
    numbers = front[kept]
    return merged, numbers, np.clip(normals[numbers] @ _LIGHT, 0, 1)


def drawing(
    fixed: Surface, moving: Surface, axis: Optional[tuple[Float, Float]] = None, label: str = ""
) -> str:
    """An SVG element: the fixed part as lines, the moving one solid, the axis of a joint dashed."""
    everything = np.concatenate([fixed.vertices, moving.vertices])
    sheet = _Sheet(everything)
    polygons, _, _ = _faces(fixed, sheet)
    glass = "".join(_outline(points, "Z") for points in polygons)
    parts = [f'<path d="{glass}" fill="currentColor" fill-opacity="0.07"/>']
    polygons, _, bright = _faces(moving, sheet)
    for points, light in zip(polygons, bright.tolist()):
        colour = f"hsl(212 70% {30 + 35 * light:.0f}%)"
        parts.append(f'<path d="{_outline(points, "Z")}" fill="{colour}" stroke="{colour}"/>')
    lines = _lines(fixed, sheet)
    parts.append(f'<path d="{lines}" fill="none" stroke="currentColor" stroke-opacity="0.6"/>')
    if axis is not None:
        point, along = axis
        reach = 0.7 * float(np.linalg.norm(np.ptp(moving.vertices, axis=0)))
        ends = sheet.pixels(point + reach * np.array([[-1.0], [1.0]]) * along)
        parts.append(
            f'<path d="{_outline(ends, "")}" stroke="#d97706" stroke-width="1.2" '
            'stroke-dasharray="5 3"/>'
        )
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" '
        f'width="{_WIDTH:g}" height="{_HEIGHT:g}" stroke-width="0.6" role="img" '
        f'aria-label="{escape(label)}">'
    )
    return head + "".join(parts) + "</svg>"


def axis_of(point: Float, along: Float) -> Optional[tuple[Float, Float]]:
    """A line to draw, if it is one."""
    return (point, along) if np.isfinite([*point, *along]).all() else None


def pose_words(pose: Float) -> str:
    """A pose in words: millimetres to the micrometre, and degrees about an axis."""
    at = ", ".join(f"{_tidy(1e3 * x):.3f}" for x in pose[:3])
    turn = 2 * np.degrees(np.arctan2(np.linalg.norm(pose[3:6]), abs(pose[6])))
    if turn < 0.05:
        return f"({at}) mm"
    axis = np.sign(pose[6] or 1.0) * pose[3:6] / np.linalg.norm(pose[3:6])
    return f"({at}) mm, {turn:.1f}° about ({direction_words(axis)})"


def direction_words(vector: Float) -> str:
    """Two digits of each component."""
    return ", ".join(f"{_tidy(x):.2f}" for x in vector)


def _tidy(number: float) -> float:
    """Without a sign on what prints as zero."""
    return 0.0 if abs(number) < 5e-4 else float(number)


def number(value: float, form: str = ".3g") -> str:
    """A number, or a dash for what is not known."""
    return format(value, form) if np.isfinite(value) else "–"


def table(head: list[str], rows: list[list[str]], caption: str) -> str:
    """An HTML table of cells that are HTML already."""
    top = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    # A narrow page scrolls the table, not itself.
    return (
        f'<div style="overflow-x: auto"><table><caption>{escape(caption)}</caption>'
        f"<thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>"
    )
