"""Meshes and their densities."""

from __future__ import annotations

import json
from dataclasses import dataclass
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pegfit import _core
from pegfit._errors import MeshError, count
from pegfit._optional import needed_by
from pegfit._progress import Progress, Reporting

if TYPE_CHECKING:
    import xarray as _xarray
    from matplotlib.axes import Axes as _Axes

#: A file.
Path = Union[str, "PathLike[str]"]

#: A `Mesh`, a file, or anything with `vertices` and `faces` (a `trimesh.Trimesh`).
MeshLike = Union["Mesh", Path, Any]

_UNITS = {"meters": "m", "centimeters": "cm", "millimeters": "mm", "inches": "inch", "feet": "foot"}


def _refuse(name: str, item: str, expected: str, found: str) -> MeshError:
    message = f"{name}: {item}: expected {expected}, found {found}"
    return MeshError(message, file=name, item=item, expected=expected, found=found)


@dataclass(frozen=True)
class MeshReport:
    """What was found in a mesh and repaired.

    Attributes:
        name: File or name of the mesh.
        watertight: Whether the surface encloses a solid.
        volume: Cubic metres.
        area: Square metres.
        warnings: A sentence for each thing that was repaired or is uncertain; none for a good mesh.
        symmetry: Axes about which the mesh may be turned onto itself: `point` (metres),
            `direction`, and `order`, `{"finite": n}` or `"continuous"`.
        details: Every count, by name.
        ledger: What was read of the file, ignored and assumed: a dict with `kind` (`"read"`,
            `"ignored"` or `"assumed"`), `item`, `count` and `reason` for each; none without a file.
    """

    name: str
    watertight: bool
    volume: float
    area: float
    warnings: list[str]
    symmetry: list[dict[str, Any]]
    details: dict[str, Any]
    ledger: list[dict[str, Any]]


class Mesh:
    """A closed triangle mesh, repaired where it could be, in metres.

    Args:
        vertices: Positions in `unit`, `(n, 3)`.
        faces: Indices of vertices, counter-clockwise seen from outside, `(m, 3)`.
        unit: One of m, cm, mm, um, inch, foot.
        name: What errors and reports call it.

    Raises:
        MeshError: The unit is missing or unknown, a vertex is not finite, an index is out of range,
            or too much of the surface is missing.

    >>> corners = [[x, y, z] for x in (0, 10) for y in (0, 10) for z in (0, 10)]
    >>> sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    >>> faces = [f for a, b, c, d in sides for f in ([a, b, c], [a, c, d])]
    >>> Mesh(corners, faces, unit="mm", name="cube")
    Mesh 'cube': 8 vertices, 12 faces, 0.01 x 0.01 x 0.01 m
    """

    def __init__(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        unit: Optional[str] = None,
        *,
        name: str = "mesh",
    ) -> None:
        if unit is None:
            raise _refuse(name, "unit", "one of m, cm, mm, um, inch, foot", "none")
        try:
            points = np.ascontiguousarray(vertices, dtype=np.float64)
            indices = np.asarray(faces)
        except (TypeError, ValueError) as error:
            raise _refuse(name, "vertices and faces", "arrays of numbers", str(error)) from None
        if points.ndim != 2 or points.shape[1] != 3:
            raise _refuse(name, "vertices", "an array (n, 3)", f"one of shape {points.shape}")
        if indices.ndim != 2 or indices.shape[1] != 3 or indices.dtype.kind not in "iu":
            found = f"{indices.dtype} of shape {indices.shape}"
            raise _refuse(name, "faces", "whole numbers (m, 3)", found)
        triangles = np.ascontiguousarray(indices, dtype=np.int64)
        self._core = _core.Mesh.from_arrays(name, points, triangles, unit)

    @classmethod
    def _of(cls, core: _core.Mesh) -> Mesh:
        mesh = cls.__new__(cls)
        mesh._core = core
        return mesh

    @classmethod
    def load(
        cls,
        path: Path,
        unit: Optional[str] = None,
        solid: Optional[str] = None,
        *,
        segments_per_turn: int = 64,
        step_time_limit: int = 120,
        lossy: bool = False,
    ) -> Mesh:
        """Reads OBJ, STL, PLY, glTF, 3MF, or STEP (through Gmsh).

        Args:
            path: The file.
            unit: Of formats that state none (OBJ, STL, PLY).
            solid: Name or number, from 1, of the solid to use; all of them if `None`.
            segments_per_turn: STEP: edges around a full turn of a curved face.
            step_time_limit: STEP: seconds of processor time after which a converter is stopped.
            lossy: Leave out what changes a solid and cannot be read (negative parts of slicers,
                beam lattices, free-form surfaces), instead of refusing it; `check().ledger` lists
                it.

        Raises:
            MeshError: The file cannot be read or used, or its unit is not known.

        >>> import os, tempfile
        >>> corners = ["v 0 0 0", "v 1 0 0", "v 0 1 0", "v 0 0 1"]
        >>> faces = ["f 1 3 2", "f 1 2 4", "f 1 4 3", "f 2 3 4"]
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = os.path.join(folder, "corner.obj")
        ...     with open(path, "w") as file:
        ...         print(*corners, *faces, sep=os.linesep, file=file)
        ...     mesh = Mesh.load(path, unit="mm")
        >>> mesh.bounds[1]
        array([0.001, 0.001, 0.001])
        >>> [(entry["item"], entry["count"]) for entry in mesh.check().ledger]
        [('v', 4), ('f', 4), ('unit', 1)]
        """
        segments = count(segments_per_turn, "segments_per_turn", MeshError, most=1000)
        seconds = count(step_time_limit, "step_time_limit", MeshError, most=86400)
        return cls._of(_core.Mesh.load(path, unit, solid, segments, seconds, lossy))

    @property
    def name(self) -> str:
        """File or name."""
        return self._core.name()

    @property
    def vertices(self) -> NDArray[np.float64]:
        """Positions in metres, `(n, 3)`; a new array."""
        return self._core.vertices()

    @property
    def faces(self) -> NDArray[np.uint32]:
        """Indices of vertices, counter-clockwise seen from outside, `(m, 3)`; a new array."""
        return self._core.faces()

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Least and greatest corner of the box around it, metres, `(2, 3)`."""
        return np.array(self._core.bounds())

    def check(self) -> MeshReport:
        """Says what was repaired, and about which axes the mesh is symmetric.

        >>> report = peg_in_hole("rectangular")[1].check()
        >>> report.watertight, report.warnings, len(report.symmetry)
        (True, [], 5)
        >>> round(1e6 * report.volume, 6)
        12.0
        """
        said = json.loads(self._core.check())
        report = said["report"]
        return MeshReport(
            name=report["name"],
            watertight=report["watertight"],
            volume=report["volume"],
            area=report["area"],
            warnings=said["warnings"],
            symmetry=said["symmetry"],
            details=report,
            ledger=said["ledger"],
        )

    def __reduce__(self) -> tuple[Any, ...]:
        """For `pickle`: vertices, faces and name."""
        return _remade, (self.vertices, self.faces, self.name)

    def __repr__(self) -> str:
        vertices, faces = self._core.size()
        size = " x ".join(f"{side:.4g}" for side in np.ptp(self.bounds, axis=0))
        return f"Mesh '{self.name}': {vertices} vertices, {faces} faces, {size} m"


def _remade(vertices: NDArray[np.float64], faces: NDArray[np.uint32], name: str) -> Mesh:
    return Mesh(vertices, faces, "m", name=name)


def as_mesh(mesh: MeshLike, unit: Optional[str], name: str) -> Mesh:
    """The mesh itself, or one made of a file or of an object's vertices and faces."""
    if isinstance(mesh, Mesh):
        return mesh
    if isinstance(mesh, (str, PathLike)):
        return Mesh.load(fspath(mesh), unit)
    if hasattr(mesh, "vertices") and hasattr(mesh, "faces"):
        stated = getattr(mesh, "units", None)
        unit = unit or _UNITS.get(str(stated), stated)
        return Mesh(mesh.vertices, mesh.faces, unit, name=name)
    expected = "a Mesh, a file, or an object with vertices and faces"
    raise _refuse(name, "mesh", expected, type(mesh).__name__)


def peg_in_hole(section: str = "rectangular", clearance: float = 0.0) -> tuple[Mesh, Mesh]:
    """One of the paper's three examples: a block of 40 x 40 x 30 mm with a through hole along z, and
    the peg that fills it, assembled.

    Args:
        section: `"circular"` (radius 10 mm), `"rectangular"` (20 mm square) or `"combined"` (the
            circle with a key 8 mm wide).
        clearance: Metres by which the hole is wider on every side, 0 to 0.005.

    Returns:
        The hole and the peg.

    Raises:
        MeshError: There is no such section, or the clearance is out of range.

    >>> peg_in_hole("rectangular", clearance=1e-3)[0]
    Mesh 'rectangular hole': 16 vertices, 32 faces, 0.04 x 0.04 x 0.03 m
    """
    hole, peg = _core.peg_in_hole(section, clearance)
    return Mesh._of(hole), Mesh._of(peg)


@dataclass(frozen=True, repr=False)
class Density:
    """The skeletal density of one part on a lattice (`docs/conventions.md`).

    Attributes:
        exterior: Unit density outside the part, no unit, complex `(nx, ny, nz)`.
        interior: Unit density inside it.
        signed_distance: Metres, negative inside, `(nx, ny, nz)`.
        origin: Position of node `[0, 0, 0]`, metres, the mesh's frame.
        spacing: Metres between nodes.
        sigma: Thickness of the kernel.
    """

    exterior: NDArray[np.complex64]
    interior: NDArray[np.complex64]
    signed_distance: NDArray[np.float32]
    origin: NDArray[np.float64]
    spacing: float
    sigma: float

    @property
    def values(self) -> NDArray[np.complex64]:
        """The density with weights 1 and 1, complex `(nx, ny, nz)`; a new array."""
        return self.exterior + self.interior

    def axis(self, k: int) -> NDArray[np.float64]:
        """Coordinates of the nodes along x, y or z (`k` = 0, 1, 2), metres."""
        count = self.signed_distance.shape[k]
        return np.asarray(self.origin[k] + self.spacing * np.arange(count))

    def to_xarray(self) -> _xarray.Dataset:
        """Density and signed distance over x, y, z (needs xarray)."""
        with needed_by("Density.to_xarray", "xarray", "data"):
            import xarray

        dims = ("x", "y", "z")
        return xarray.Dataset(
            {
                "density": (dims, self.values, {"units": "1"}),
                "signed_distance": (dims, self.signed_distance, {"units": "m"}),
            },
            coords={d: (d, self.axis(k), {"units": "m"}) for k, d in enumerate(dims)},
            attrs={"sigma": self.sigma},
        )

    def plot(self, y: float = 0.0, ax: Optional[_Axes] = None) -> _Axes:
        """Draws the imaginary part on the plane of nodes nearest to `y` (needs matplotlib)."""
        from pegfit._plots import density_map

        axes = [self.axis(k) for k in range(3)]
        return density_map(axes, self.exterior + self.interior, y, ax)

    def __repr__(self) -> str:
        shape = " x ".join(str(n) for n in self.signed_distance.shape)
        return f"Density on {shape} nodes of {1e3 * self.spacing:.4g} mm, sigma {self.sigma}"


def density(
    mesh: MeshLike,
    *,
    spacing: Optional[float] = None,
    sigma: float = 0.1,
    tolerance: float = 1e-3,
    margin: Optional[float] = None,
    unit: Optional[str] = None,
    progress: Progress = None,
) -> Density:
    """The density of a part on a lattice around it.

    Args:
        mesh: A `Mesh`, a file, or an object with vertices and faces.
        spacing: Metres between nodes; 48 cells along the longest side if `None`.
        sigma: Thickness of the kernel, 0.03 to 0.5.
        tolerance: Relative L2 error allowed, 1e-5 to 1e-2.
        margin: How far around the part, metres; a quarter of its longest side if `None`.
        unit: Of a mesh that states none.
        progress: `True` for a bar, or a function of the units done and their number.

    Raises:
        SceneError: A number is out of range, or the field does not fit in memory.
        KeyboardInterrupt: Within 50 ms of Ctrl-C.

    >>> field = density(peg_in_hole()[1], spacing=0.002)
    >>> field
    Density on 18 x 18 x 24 nodes of 2 mm, sigma 0.1
    >>> bool(field.values.imag.max() > 0 > field.signed_distance.min())
    True
    """
    part = as_mesh(mesh, unit, "mesh")
    with Reporting(progress) as report:
        exterior, interior, distance, origin, step = _core.density(
            part._core, spacing, sigma, tolerance, margin, report
        )
    return Density(exterior, interior, distance, np.array(origin), step, sigma)
