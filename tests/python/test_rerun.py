"""Recordings for Rerun, read back by its own program; no viewer is opened."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pegfit
from conftest import ROOT, turned

pytest.importorskip("rerun")

from pegfit import rerun as recordings  # noqa: E402

PROGRAM = [sys.executable, "-m", "rerun_cli", "rrd"]


def ask(*words):
    done = subprocess.run([*PROGRAM, *map(str, words)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout


def rows(file):
    """The cells of every chunk, by entity and timeline: `[[index, value...], ...]`, as text."""
    ask("verify", file)
    found = {}
    for chunk in re.split(r"\nChunk\(", ask("print", "-vvv", file))[1:]:
        entity = re.search(r"entity_path: (\S+)", chunk)[1]
        timeline = re.search(r"index_name: (\w+)", chunk)
        table = [re.split(r" ┆ ", line)[1:] for line in chunk.split("\n") if "│ row_" in line]
        found.setdefault((entity, timeline and timeline[1]), []).extend(table)
    return found


def numbers(cells):
    return np.array([[float(x) for x in re.findall(r"-?\d[\d.e+-]*", cell)] for cell in cells])


@pytest.fixture(scope="module")
def loose():
    return pegfit.Pair(*pegfit.peg_in_hole("rectangular", clearance=2e-4), spacing=0.002)


@pytest.fixture(scope="module")
def results(loose):
    docking, path = loose.dock(top=2), loose.path()
    return docking, path, pegfit.feel(loose, "snap", seconds=0.1)


def test_dock_path_and_session_are_one_recording(loose, results, tmp_path):
    docking, path, session = results
    file = tmp_path / "pair.rrd"
    recordings.record(file, loose, docking=docking, path=path, session=session)
    found = rows(file)
    energy = found["/path/energy", "path"]
    assert [int(row[0].strip()) for row in energy] == list(range(len(path)))
    np.testing.assert_array_equal(numbers([row[1] for row in energy])[:, 0], path.energy)
    information = numbers([row[1] for row in found["/docking/information", "pose"]])
    np.testing.assert_array_equal(information[:, 0], docking.information)
    mates = [row[1].strip(' │[]"') for row in found["/docking/mate", "pose"]]
    assert mates == [joint.kind for joint in docking.joints]
    assert len(found["/moving", "path"]) == len(path)
    assert len(found["/moving", "pose"]) == len(docking)
    assert len(found["/moving", "time"]) == len(found["/session/force", "time"]) > 90
    assert ("/fixed", None) in found and ("/moving", None) in found


def test_files_of_the_command_say_the_same(scene, command, tmp_path):
    """What `dock`, `path` and `feel` write, against the objects of Python."""
    files = {name: tmp_path / name for name in ("poses.csv", "path.csv", "run.csv", "a.rrd")}
    for words in (
        ("dock", scene, "--top", 2, "-o", files["poses.csv"]),
        ("path", scene, "-o", files["path.csv"]),
        ("feel", scene, "--script", "snap", "--seconds", 0.1, "--log", files["run.csv"]),
    ):
        code, _, said = command(*words)
        assert code == 0, said
    words = [scene, "--rerun", files["a.rrd"], "--poses", files["poses.csv"]]
    words += ["--path", files["path.csv"], "--log", files["run.csv"]]
    assert recordings.main([*map(str, words)]) == 0
    found = rows(files["a.rrd"])
    poses = np.genfromtxt(files["poses.csv"], delimiter=",", names=True)
    information = numbers([row[1] for row in found["/docking/information", "pose"]])[:, 0]
    np.testing.assert_allclose(information, np.atleast_1d(poses["information"]), rtol=1e-12)
    path = np.genfromtxt(files["path.csv"], delimiter=",", names=True)
    force = np.linalg.norm([path["fx"], path["fy"], path["fz"]], axis=0)
    got = numbers([row[1] for row in found["/path/force", "path"]])[:, 0]
    np.testing.assert_allclose(got, force, rtol=1e-12)
    assert len(found["/session/energy", "time"]) > 50


def test_a_log_in_parquet_is_the_same(loose, results, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    pyarrow = pytest.importorskip("pyarrow")
    run = results[2]
    run.report(tmp_path / "run.csv")
    table = np.genfromtxt(tmp_path / "run.csv", delimiter=",", names=True)
    columns = {name: [None if np.isnan(x) else x for x in table[name]] for name in table.dtype.names}
    parquet.write_table(pyarrow.table(columns), tmp_path / "run.parquet")
    for name in ("csv", "parquet"):
        recordings.record(tmp_path / f"{name}.rrd", loose, session=tmp_path / f"run.{name}")
    one, other = (rows(tmp_path / f"{name}.rrd") for name in ("csv", "parquet"))
    key = ("/session/energy", "time")
    assert one[key] == other[key] and len(one[key]) > 90


def test_what_cannot_be_recorded_is_refused_before_a_file_is_there(loose, tmp_path, capsys):
    wrong, file = tmp_path / "wrong.csv", tmp_path / "a.rrd"
    wrong.write_text("x,y\n1,2\n")
    with pytest.raises(pegfit.PegfitError, match="expected a column 'z', found x, y") as caught:
        recordings.record(file, loose, path=wrong)
    assert caught.value.item == "z" and not file.exists()
    wrong.write_text("x,y,z,qx,qy,qz,qw\n1,2,3,0,0,0,one\n")
    with pytest.raises(pegfit.PegfitError, match="qw"):
        recordings.record(file, loose, docking=wrong)
    with pytest.raises(OSError):
        recordings.record(tmp_path / "no-such-folder" / "a.rrd", loose)
    assert recordings.main([str(tmp_path / "none.toml"), "--rerun", str(file)]) == 1
    assert "none.toml" in capsys.readouterr().err


def test_the_page_can_be_done(scene, command, tmp_path, monkeypatch):
    """The Python of the page, in a folder with what it speaks of."""
    page = (ROOT / "docs" / "how-to" / "rerun.md").read_text()
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    for name, mesh in zip(("hole", "peg"), pegfit.peg_in_hole("rectangular", clearance=2e-4)):
        lines = [f"v {x} {y} {z}" for x, y, z in (1e3 * mesh.vertices).tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (mesh.faces.astype(int) + 1).tolist()]
        Path(f"{name}.obj").write_text("\n".join(lines))
    exec(compile(code, "rerun.md", "exec"), {})
    assert len(rows("pair.rrd")["/moving", "path"]) > 5
