"""Assembly forces from two meshes: score, dock, bake, find insertion paths, and feel.

Metres, newtons, newton metres, joules, seconds. A pose takes the moving part's frame to the fixed
part's (or the scene's): x y z qx qy qz qw. Energy is lowest where the parts fit; force and torque
are minus its gradient. `docs/python.md` is the page to read.
"""

from pegfit._assembly import Assembly, Mate, assemble
from pegfit._core import VERSION as __version__
from pegfit._errors import DeviceError, MeshError, PegfitError, PoseError, SceneError, TableError
from pegfit._insertion_path import InsertionPath
from pegfit._loop import TICK, ForcePath, Run, feel
from pegfit._mesh import Density, Mesh, MeshReport, density, peg_in_hole
from pegfit._pair import Docking, Joint, Pair, Scores
from pegfit._play import Page, play
from pegfit._response import Response
from pegfit._source import REAL_TIME_POINTS, Evaluator, Source, Table

__all__ = [
    "REAL_TIME_POINTS",
    "TICK",
    "Assembly",
    "Density",
    "DeviceError",
    "Docking",
    "Evaluator",
    "ForcePath",
    "InsertionPath",
    "Joint",
    "Mate",
    "Mesh",
    "MeshError",
    "MeshReport",
    "Page",
    "Pair",
    "PegfitError",
    "PoseError",
    "Response",
    "Run",
    "SceneError",
    "Scores",
    "Source",
    "Table",
    "TableError",
    "__version__",
    "assemble",
    "density",
    "feel",
    "peg_in_hole",
    "play",
]


def __getattr__(name: str) -> object:
    """Old names, for one release."""
    if name == "Way":
        import warnings

        warnings.warn("pegfit.Way is now pegfit.InsertionPath", DeprecationWarning, stacklevel=2)
        return InsertionPath
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
