"""Loose parts put together."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from os import PathLike, fspath
from pathlib import PurePath
from typing import Any, Mapping, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pegfit import _core
from pegfit._errors import SceneError, count
from pegfit._mesh import Mesh, MeshLike, as_mesh
from pegfit._pair import Joint
from pegfit._poses import rows
from pegfit._progress import Progress, Reporting

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Mate:
    """Two parts of an assembly that touch.

    Attributes:
        parts: Their names; the first one is larger.
        joint: What their contact alone leaves free: motions of the second part, in the assembly.
        information: How much contact says about their relative pose, nats.
        mating_area: Area of the second part that mates, square metres.
        overlap: Share of the second part's volume that lies in the first.
    """

    parts: tuple[str, str]
    joint: Joint
    information: float
    mating_area: float
    overlap: float


@dataclass(frozen=True, repr=False)
class Assembly:
    """Parts put together.

    Attributes:
        order: Names of the placed parts in the order in which they go together.
        poses: `(n, 7)`, x y z qx qy qz qw: from each part's own frame to the assembly, in that order.
        left_over: Names of the parts that contact holds nowhere.
        mates: The parts that touch, and how.
        score: How well contact holds the parts, nats: what ranks assemblies.
        comes_apart: Whether it comes apart again; `None` if that was not tried.
        locked: Parts that block each other, in groups.
        steps: What goes in, step by step, in words.
        certain: Whether no other assembly is nearly as good.
        alternatives: Other assemblies, the best first; none of an alternative.
        summary: The result of `pegfit assemble --json`, by name.
    """

    order: list[str]
    poses: Float
    left_over: list[str]
    mates: list[Mate]
    score: float
    comes_apart: Optional[bool]
    locked: list[list[str]]
    steps: list[str]
    certain: bool
    alternatives: list[Assembly] = field(default_factory=list)
    summary: dict[str, Any] = field(default_factory=dict)

    def pose(self, part: str) -> Float:
        """The pose of a part by its name, `(7,)`.

        Raises:
            SceneError: No such part is placed.
        """
        if part not in self.order:
            expected = "one of " + ", ".join(self.order)
            message = f"part: expected {expected}, found {part!r}"
            raise SceneError(message, item="part", expected=expected, found=repr(part))
        found: Float = self.poses[self.order.index(part)]
        return found

    def __len__(self) -> int:
        return len(self.order)

    def __repr__(self) -> str:
        left = f", {len(self.left_over)} left over" if self.left_over else ""
        sure = "" if self.certain else ", not certain"
        return f"Assembly of {', '.join(self.order)}: {self.score:.1f} nats{left}{sure}"


def _or_nan(values: Optional[list[float]], length: int) -> Float:
    return np.full(length, np.nan) if values is None else np.array(values, dtype=np.float64)


def _mate(told: dict[str, Any]) -> Mate:
    first, second = told["parts"]
    joint = Joint(
        told["joint"],
        told["freedoms"],
        _or_nan(told["axis"], 3),
        _or_nan(told["point"], 3),
        told["pitch"] or 0.0,
        _or_nan(told["slide"], 2),
        _or_nan(told["turn"], 2),
    )
    numbers = (told[key] for key in ("information", "mating_area", "overlap"))
    return Mate((first, second), joint, *numbers)


def _assembly(told: dict[str, Any], certain: bool, **more: Any) -> Assembly:
    placed = told["placed"]
    return Assembly(
        order=[p["part"] for p in placed],
        poses=np.array([p["pose"] for p in placed], dtype=np.float64).reshape(-1, 7),
        left_over=told["left_over"],
        mates=[_mate(mate) for mate in told["mates"]],
        score=told["score"],
        comes_apart=told["comes_apart"],
        locked=told["locked"],
        steps=told["steps"],
        certain=certain,
        **more,
    )


def _named(
    parts: Union[Mapping[str, MeshLike], Sequence[MeshLike]], unit: Optional[str]
) -> dict[str, Mesh]:
    """The parts by name: keys, names of files without ending, names of meshes; equal ones numbered."""
    if isinstance(parts, Mapping):
        return {name: as_mesh(part, unit, name) for name, part in parts.items()}
    found: dict[str, Mesh] = {}
    for number, part in enumerate(parts, 1):
        mesh = as_mesh(part, unit, f"part {number}")
        given = PurePath(fspath(part)).stem if isinstance(part, (str, PathLike)) else mesh.name
        name, again = given, 2
        while name in found:
            name, again = f"{given} {again}", again + 1
        found[name] = mesh
    return found


def assemble(
    parts: Union[Mapping[str, MeshLike], Sequence[MeshLike]],
    unit: Optional[str] = None,
    *,
    fix: Optional[str] = None,
    place: Optional[Mapping[str, ArrayLike]] = None,
    mating_clearance: Optional[float] = None,
    beam: int = 4,
    top: int = 3,
    seconds: float = 10.0,
    resume: Optional[Union[str, PathLike[str]]] = None,
    progress: Progress = None,
) -> Assembly:
    """Puts loose parts together, by their shapes alone: which part belongs to which, where, and in
    which order.

    Args:
        parts: A `Mesh`, a file or an object with `vertices` and `faces` each, wherever it lies; by
            name, or in a list, and then called after file or mesh.
        unit: Of what states none: m, cm, mm, um, inch or foot.
        fix: Name of the part whose own frame is that of the assembly; the largest if `None`.
        place: Poses `(7,)` by name, of parts whose places are known.
        mating_clearance: Faces at most so far apart count as mating, metres; by default from each
            part's size.
        beam: Subassemblies of the same parts that are kept at a time.
        top: Assemblies to return, at most: the best one and its `alternatives`.
        seconds: Time for one try to take a part or group off; 0 does not take assemblies apart, and
            then no order is known.
        resume: A file that keeps what is found. A search of the same parts that was stopped, or had
            a narrower beam, goes on from there.
        progress: `True` for a bar, or a function of the units done and their number.

    Returns:
        The best assembly.

    Raises:
        MeshError: A part cannot be used.
        SceneError: There are fewer than two parts or too many, a name is no part's, a number is out
            of range, `resume` is of other parts or was changed, or contact holds no part in any
            other.
        KeyboardInterrupt: Within 50 ms of Ctrl-C.

    >>> from pegfit import peg_in_hole
    >>> hole, peg = peg_in_hole("rectangular", clearance=2e-4)
    >>> moved = Mesh(peg.vertices + [0.3, 0.1, 0.0], peg.faces, "m")
    >>> found = assemble({"hole": hole, "peg": moved})
    >>> found.order, found.comes_apart
    (['hole', 'peg'], True)
    >>> found.mates[0].joint.kind
    'prismatic'
    """
    meshes = _named(parts, unit)
    names = list(meshes)

    def number(item: str, name: str) -> int:
        if name not in meshes:
            expected = "one of " + ", ".join(names)
            message = f"{item}: expected {expected}, found {name!r}"
            raise SceneError(message, item=item, expected=expected, found=repr(name))
        return names.index(name)

    fixed = None if fix is None else number("fix", fix)
    placed = []
    for name, pose in (place or {}).items():
        row = rows(np.asarray(pose, dtype=np.float64)[None])[0]
        placed.append((number("place", name), row.tolist()))
    search = (
        mating_clearance,
        count(beam, "beam", SceneError),
        count(top, "top", SceneError),
        seconds,
    )
    cores = [(name, mesh._core) for name, mesh in meshes.items()]
    path = None if resume is None else fspath(resume)
    with Reporting(progress) as report:
        summary = json.loads(_core.assemble(cores, (fixed, placed), search, path, report))
    best, *others = summary["assemblies"]
    certain = summary["certain"]
    alternatives = [_assembly(told, False) for told in others]
    return _assembly(best, certain, alternatives=alternatives, summary=summary)
