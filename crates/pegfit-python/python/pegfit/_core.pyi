from collections.abc import Sequence
from os import PathLike
from typing import Any, Callable, Optional, final

import numpy as np
from numpy.typing import NDArray

_F64 = NDArray[np.float64]
_Path = str | PathLike[str]
_Progress = Optional[Callable[[str, int, int], object]]
_Three = tuple[float, float, float] | Sequence[float] | _F64
_Four = Sequence[float] | _F64

__all__ = [
    "BodyForce",
    "Felt",
    "ForcePath",
    "Mesh",
    "Pair",
    "Source",
    "REAL_TIME_POINTS",
    "VERSION",
    "Way",
    "assemble",
    "bake_table",
    "command",
    "correlate",
    "density",
    "dock",
    "feel",
    "from_matrices",
    "highest",
    "open_table",
    "path",
    "peg_in_hole",
    "poses_at",
    "tick_columns",
    "write_text",
]

VERSION: str
REAL_TIME_POINTS: int

@final
class Mesh:
    @staticmethod
    def load(
        path: _Path,
        unit: Optional[str],
        solid: Optional[str],
        segments_per_turn: int,
        step_time_limit: int,
        lossy: bool,
    ) -> Mesh: ...
    @staticmethod
    def from_arrays(name: str, vertices: _F64, faces: NDArray[np.int64], unit: str) -> Mesh: ...
    def vertices(self) -> _F64: ...
    def faces(self) -> NDArray[np.uint32]: ...
    def name(self) -> str: ...
    def size(self) -> tuple[int, int]: ...
    def bounds(self) -> tuple[list[float], list[float]]: ...
    def check(self) -> str: ...

@final
class Pair:
    @staticmethod
    def of_meshes(
        fixed: Mesh,
        moving: Mesh,
        spacing: Optional[float],
        model: str,
        cache: Optional[_Path],
        peak_force: float,
        gamma: Optional[float],
        half_extent: Optional[_Three],
        memory: Optional[int],
    ) -> Pair: ...
    @staticmethod
    def from_scene(path: _Path, fixed: Optional[str], memory: Optional[int]) -> Pair: ...
    def warnings(self) -> list[str]: ...
    def describe(self) -> tuple[float, int, int]: ...
    def assembled(self) -> list[float]: ...
    def placed(self, moving: bool) -> tuple[_F64, NDArray[np.uint32]]: ...
    def pivot(self) -> list[float]: ...
    def evaluator(
        self, tolerance: float | None, max_points: int | None, progress: _Progress
    ) -> tuple[Source, int, float | None]: ...

@final
class Felt:
    def ticks(self) -> _F64: ...
    def summary(self) -> str: ...
    def page(self) -> str: ...

@final
class Way:
    def numbers(self) -> _F64: ...
    def words(self) -> list[str]: ...
    def summary(self) -> str: ...
    def table(self) -> str: ...
    def page(self) -> str: ...

@final
class Source:
    def query(
        self,
        poses: _F64,
        energy: _F64,
        force: _F64,
        torque: _F64,
        coverage: _F64,
        threads: Optional[int],
    ) -> None: ...
    def close(self) -> None: ...
    def is_closed(self) -> bool: ...

@final
class BodyForce:
    def __new__(cls, source: Source) -> BodyForce: ...
    def step(
        self,
        pose: _F64 | Sequence[float],
        center: _Three,
        twist: _F64 | Sequence[float],
        free: _F64 | Sequence[float],
        mobility: _F64 | Sequence[Sequence[float]],
        dt: float,
        elapsed: float,
    ) -> tuple[list[float], list[float], float, float, int]: ...
    def release(self) -> None: ...

@final
class ForcePath:
    def __new__(cls, source: Source, config: str, grip: _Three) -> ForcePath: ...
    def step(
        self, pose: _F64 | Sequence[float], time: float
    ) -> tuple[list[float], list[float], float, float, float, int]: ...
    def stiffness(self) -> list[float]: ...

def assemble(
    parts: list[tuple[str, Mesh]],
    known: tuple[Optional[int], list[tuple[int, list[float]]]],
    search: tuple[Optional[float], int, int, float],
    resume: Optional[str],
    progress: _Progress,
) -> str: ...
def correlate(
    pair: Pair,
    rotation: _Four,
    window: Optional[tuple[_Three, _Three]],
    progress: _Progress,
) -> tuple[NDArray[np.float32], list[float], float]: ...
def poses_at(pair: Pair, rotation: _Four, displacements: _F64) -> _F64: ...
def dock(
    pair: Pair,
    search: tuple[int, Optional[float], bool, Optional[_Path], bool],
    known: tuple[Optional[list[float]], Optional[list[list[float]]], list[Mesh]],
    progress: _Progress,
) -> tuple[_F64, _F64, NDArray[np.bool_], list[float], list[tuple[Any, ...]]]: ...
def path(
    pair: Pair,
    goal: Optional[_F64],
    start: Optional[_F64],
    lengths: tuple[Optional[float], Optional[float]],
    seconds: float,
    allow_overlap: bool,
    solids_only: bool,
    progress: _Progress,
) -> Way: ...
def bake_table(
    pair: Pair,
    path: _Path,
    half_extent: Optional[_Three],
    angle_deg: Optional[float],
    step_deg: Optional[float],
    tolerance: Optional[float],
    resume: bool,
    progress: _Progress,
) -> tuple[Source, str]: ...
def density(
    mesh: Mesh,
    spacing: Optional[float],
    sigma: float,
    tolerance: float,
    margin: Optional[float],
    progress: _Progress,
) -> tuple[NDArray[np.complex64], NDArray[np.complex64], NDArray[np.float32], list[float], float]: ...
def from_matrices(matrices: _F64) -> _F64: ...
def highest(scores: NDArray[np.float32], count: int, radius: float) -> list[list[int]]: ...
def open_table(path: _Path, memory: Optional[int]) -> tuple[Source, str]: ...
def feel(
    pair: Pair,
    source: Source,
    script: str,
    seconds: float,
    hand: str,
    real_time: bool,
    subject: str,
    progress: _Progress,
) -> Felt: ...
def peg_in_hole(section: str, clearance: float) -> tuple[Mesh, Mesh]: ...
def tick_columns() -> list[str]: ...
def write_text(path: _Path, text: str) -> None: ...
def command(arguments: Sequence[str]) -> int: ...
