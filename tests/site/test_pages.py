"""Every command and every piece of Python on a page is run, in the order of the page, or marked with
the reason why not."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import pegfit
from pages import ROOT, Block, blocks, differs, pages

#: A pair of 2 cm on a lattice that makes every command a matter of seconds.
SCENE = """
unit = "mm"
fixed = "hole.obj"
moving = "peg.obj"
[lattice]
spacing = 2
[window]
half_extent = 8
[rotations]
kind = "ball"
angle_deg = 5
step_deg = 5
"""

POSES = "x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1\n0.001,0,0.004,0,0,0.0087265,0.9999619\n"

#: Seconds that a block may take.
LIMIT = 300


def write_obj(path: Path, **solids: pegfit.Mesh) -> None:
    """In millimetres."""
    lines, first = [], 1
    for name, mesh in solids.items():
        lines.append(f"o {name}")
        lines += [f"v {x} {y} {z}" for x, y, z in (1e3 * mesh.vertices).tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (mesh.faces.astype(int) + first).tolist()]
        first += len(mesh.vertices)
    path.write_text("\n".join(lines) + "\n")


def write_stl(path: Path, mesh: pegfit.Mesh) -> None:
    """The same as STL."""
    lines = ["solid part"]
    for face in mesh.faces:
        corners = [f"vertex {x} {y} {z}" for x, y, z in (1e3 * mesh.vertices[face]).tolist()]
        lines += ["facet normal 0 0 0", "outer loop", *corners, "endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid"]) + "\n")


@pytest.fixture(scope="session")
def samples(tmp_path_factory):
    """The files that pages speak of."""
    folder = tmp_path_factory.mktemp("samples")
    hole, peg = pegfit.peg_in_hole("rectangular", clearance=2e-4)
    for mesh, names in ((hole, ("hole", "housing")), (peg, ("peg", "shaft", "part"))):
        for name in names:
            write_obj(folder / f"{name}.obj", part=mesh)
            write_stl(folder / f"{name}.stl", mesh)
    write_obj(folder / "assembly.obj", block=hole, peg=peg)
    (folder / "scene.toml").write_text(SCENE)
    (folder / "in.csv").write_text(POSES)
    (folder / "poses.csv").write_text(POSES)
    binary = ["pegfit", "bake", "scene.toml", "-o", "table.zarr", "--quiet", "--poses", "50"]
    subprocess.run(binary, cwd=folder, check=True)
    return folder


def environment() -> dict[str, str]:
    """Programs of this Python's folder first: the command and the converters."""
    scripts = str(Path(sys.executable).parent)
    return {**os.environ, "PATH": scripts + os.pathsep + os.environ["PATH"], "MPLBACKEND": "agg"}


def prepare(block: Block, folder: Path) -> None:
    """What a block writes anew must not be there; what it has said before is done."""
    for line in block.text.split("\n"):
        words = line.split("#")[0].split()
        fresh = not {"--rank", "--resume", "--status"} & set(words)
        if "bake" in words and "-o" in words and fresh:
            shutil.rmtree(folder / words[words.index("-o") + 1], ignore_errors=True)
    if "also" in block.marks:
        subprocess.run(["bash", "-ec", block.marks["also"]], cwd=folder, check=True)


def run(block: Block, folder: Path) -> str:
    """What it prints."""
    prepare(block, folder)
    if block.language == "file":
        (folder / block.marks["file"]).write_text(block.text + "\n")
        return ""
    if block.language == "python":
        script = folder / "block.py"
        script.write_text(block.text + "\n")
        words = [sys.executable, script.name]
    else:
        words = ["bash", "-euo", "pipefail", "-c", block.text]
    done = subprocess.run(
        words,
        cwd=folder,
        env=environment(),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=LIMIT,
    )
    right = [int(code) for code in block.marks.get("exit", "0").split()]
    assert done.returncode in right, f"exit {done.returncode}\n{block.text}\n{done.stderr}"
    return done.stdout


def compare(block: Block, printed: list[tuple[str, str]]) -> None:
    """What a page says is printed with what was: texts of blocks and what they printed."""
    words = block.marks["printed by"]
    outputs = [output for text, output in printed if words in text]
    assert outputs, f"no block that was run holds `{words}`"
    difference = differs(block.text, outputs[-1])
    assert not difference, difference


def to_run(page: Path) -> list[Block]:
    return [b for b in blocks(page.read_text()) if b.runs and "not run" not in b.marks]


def begins_another(page: Path) -> bool:
    """Whether another page does all that this one does, in its order, and goes on from there."""
    lines = [[line for line in b.text.split("\n") if line] for b in to_run(page)]
    others = (to_run(other) for other in pages() if other != page)
    longer = (other for other in others if len(other) > len(lines) > 0)
    return any(
        lines == [[line for line in b.text.split("\n") if line] for b in other[: len(lines)]]
        for other in longer
    )


@pytest.mark.parametrize(
    "page",
    [page for page in pages() if to_run(page) and not begins_another(page)],
    ids=lambda p: str(p.relative_to(ROOT)),
)
def test_what_a_page_says_can_be_done(page, samples, tmp_path):
    folder = tmp_path / "work"
    shutil.copytree(samples, folder)
    printed: list[tuple[str, str]] = []
    for block in to_run(page):
        try:
            if "printed by" in block.marks:
                compare(block, printed)
            else:
                printed.append((block.text, run(block, folder)))
        except (AssertionError, subprocess.SubprocessError) as error:
            pytest.fail(f"{page.relative_to(ROOT)}:{block.line}: {error}", pytrace=False)


def test_the_first_page_shows_what_the_readme_runs():
    """Its five lines are those of README.md, which are run; only spaces and comments may differ."""

    def code(page):
        first = next(b for b in blocks((ROOT / page).read_text()) if b.language == "python")
        return [line.split("#")[0].rstrip() for line in first.text.split("\n")]

    assert code("docs/index.md") == code("README.md") and len(code("README.md")) == 5


@pytest.mark.parametrize("page", sorted((ROOT / "docs/how-to").glob("*.md")), ids=lambda p: p.stem)
def test_a_how_to_ends_with_what_one_should_see(page):
    """Printed by a command that is run, or a picture that a command makes."""
    end = page.read_text().rpartition("\n## ")[2]
    assert end.startswith("What you should see\n"), end.split("\n")[0]
    assert "<!-- printed by: " in end


def test_what_is_printed_is_compared():
    said = "3 parts\n\nforce  1.25 N\ntook 2 s\n"
    for page in (
        "3 parts\nforce 1.24 N\ntook 2 s",
        "3 parts\nforce 1.3 N\n...",
        "...\ntook ...",
        "... parts\n...",
        "3 parts\n...\ntook 2 s",
    ):
        assert not differs(page, said), page
    for page in (
        "4 parts\n...",
        "3 parts\nforce 1.23 N\n...",
        "3 parts\nforce -1.25 N\n...",
        "3 parts\nforce 1.25 N",
        "3 parts\ntook 2 s",
        "...\n3 parts",
        "...\ntook 2 s\nand more",
    ):
        assert differs(page, said), page
    assert not differs("error 1.2e-7", "error 1.3e-7") and differs("error 1.2e-7", "error 1.2e-6")


def test_what_is_not_run_says_why():
    for page in pages():
        for block in blocks(page.read_text()):
            for mark in ("not run", "without"):
                why = block.marks.get(mark, "why: it is long").split(":")[-1]
                assert len(why) > 5, f"{page}:{block.line}: {mark}"


def test_blocks_and_their_marks_are_seen():
    text = "\n".join([
        "Say", "", "    pegfit check a.obj", "", "    pegfit bake s", "", "then", "",
        "<!-- not run: it is long -->", "```sh", "pegfit demo", "```", "",
        "<!-- file: s.toml -->", "", "```toml", "x = 1", "```", "", "<!-- exit: 3 -->", "words", "",
        "```sh", "ls", "```", "```python", "1", "```",
    ])
    first, second, file, shell, python = blocks(text)
    assert first.text == "pegfit check a.obj\n\npegfit bake s" and first.runs and first.line == 3
    assert second.marks == {"not run": "it is long"} and second.runs
    assert file.language == "file" and file.marks["file"] == "s.toml" and file.text == "x = 1"
    assert not shell.runs and shell.marks == {}
    assert python.runs and python.line == 26


def test_a_scene_of_a_step_assembly(tmp_path):
    """What `docs/how-to/from-cad.md` says of STEP; the file is that of the first tutorial."""
    gmsh = pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
    gmsh.initialize(interruptible=False)
    cad = gmsh.model.occ
    plate, hole = cad.addBox(-20, -20, 0, 40, 40, 12), cad.addCylinder(0, 0, -1, 0, 0, 14, 8.1)
    cad.cut([(3, plate)], [(3, hole)])
    cad.addCylinder(0, 0, 0, 0, 0, 20, 8)
    cad.synchronize()
    gmsh.write(str(tmp_path / "assembly.step"))
    gmsh.finalize()
    for words in (
        "scene assembly.step --moving 2 -o scene.toml",
        "check scene.toml",
        "path scene.toml --solids-only",
    ):
        subprocess.run(["pegfit", *words.split()], cwd=tmp_path, env=environment(), check=True)
    text = (tmp_path / "scene.toml").read_text()
    assert 'unit = "mm"' in text and len(list((tmp_path / "scene-parts").iterdir())) == 2
