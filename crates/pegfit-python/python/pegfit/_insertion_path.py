"""An insertion path: poses, forces, and its description."""

from __future__ import annotations

import json
from html import escape
from os import PathLike
from typing import Any, Optional, Union

import numpy as np
from numpy.typing import NDArray

from pegfit import _core
from pegfit._report import write_report

Float = NDArray[np.float64]


class InsertionPath:
    """The insertion path from outside, or from a pose, to the goal: n poses at equal steps, none if none
    was found. Reversed, it is the removal path.

    Attributes:
        poses: `(n, 7)`, x y z qx qy qz qw, in the fixed part's frame or the scene.
        length: Path length of the farthest-going point since the start, metres, `(n,)`.
        overlap: Penetration depth: of the deepest point of either part in the other, metres, `(n,)`.
        energy: Joules, `(n,)`; this and the next two are NaN with `solids_only`.
        force: On the moving part, newtons, `(n, 3)`.
        torque: Newton metres, `(n, 3)`, about where the pose takes the origin of the moving part's
            frame.
        words: Descriptions of the motions inwards, such as `push 12.0 mm along (0.00, 0.00, -1.00)`.
        summary: The result of `pegfit path --json`, by name.
    """

    def __init__(self, core: _core.Way) -> None:
        self._core = core
        numbers = core.numbers()
        self.poses: Float = numbers[:, :7].copy()
        self.length, self.overlap, self.energy = (numbers[:, k].copy() for k in (7, 8, 9))
        self.force: Float = numbers[:, 10:13].copy()
        self.torque: Float = numbers[:, 13:].copy()
        self.words: list[str] = core.words()
        self.summary: dict[str, Any] = json.loads(core.summary())

    @property
    def free(self) -> bool:
        """Whether no overlap along the path is deeper than contact."""
        return bool(self.summary["outcome"] == "free")

    @property
    def outcome(self) -> str:
        """`free`; `overlapping`: deeper than contact, as the goal may be allowed to; `blocked`: at the
        steps of the search everything was tried; `not found`: time ran out."""
        return str(self.summary["outcome"])

    @property
    def barrier(self) -> Optional[float]:
        """The energy barrier: the highest climb of the energy on the path in, joules; `None` without
        energies."""
        climb = self.summary["climb"]
        return None if climb is None else float(climb["energy"])

    @property
    def depth(self) -> Optional[float]:
        """How far the goal lies below the energy out of reach, joules; `None` without energies."""
        depth = self.summary["depth"]
        return None if depth is None else float(depth)

    def report(self, path: Union[str, PathLike[str]]) -> None:
        """Writes the path.

        Args:
            path: Its ending chooses: `.html` the page of `pegfit path --html`, which plays it,
                `.csv` the rows of `pegfit path -o`, `.json` the summary.

        Raises:
            PegfitError: Another ending, or the file cannot be written.

        >>> import os, tempfile
        >>> from pegfit import Pair, peg_in_hole
        >>> path = Pair(*peg_in_hole("rectangular", clearance=2e-4)).path(solids_only=True)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path.report(os.path.join(folder, "path.html"))
        ...     os.listdir(folder)
        ['path.html']
        """
        core = self._core
        write_report(path, page=core.page, table=core.table, summary=core.summary)

    def _repr_html_(self) -> str:
        """For a notebook: the page that plays the path, in a frame."""
        style = "width: 100%; height: 640px; border: 1px solid #e2e8f0"
        page = escape(self._core.page())
        return f'<iframe srcdoc="{page}" style="{style}" title="{escape(repr(self))}"></iframe>'

    def __len__(self) -> int:
        return len(self.poses)

    def __repr__(self) -> str:
        if len(self) == 0:
            return f"InsertionPath: {self.outcome}"
        words = "; ".join(self.words) or "no motion worth a word"
        return f"InsertionPath of {len(self)} poses, {self.outcome}: {words}"
