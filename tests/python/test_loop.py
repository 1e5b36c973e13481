"""The loop with the simulated hand, and a single tick."""

import csv
import re
from xml.etree import ElementTree

import numpy as np
import pytest

import pegfit


@pytest.fixture(scope="module")
def run(table):
    return pegfit.feel(table, "snap", seconds=3.0, hand={"seed": 5})


def test_a_run_is_repeatable_and_whole(run, table):
    assert run.ticks.dtype == pegfit.TICK and len(run.ticks) == 3000
    again = pegfit.feel(table, "snap", seconds=3.0, hand={"seed": 5})
    np.testing.assert_array_equal(again.ticks.view("f8"), run.ticks.view("f8"))
    other = pegfit.feel(table, "snap", seconds=3.0, hand={"seed": 6})
    assert not np.array_equal(other.ticks["force"], run.ticks["force"])
    np.testing.assert_allclose(run.ticks["time"], np.arange(3000) * 1e-3, atol=1e-9)
    peak = np.linalg.norm(run.ticks["force"], axis=1).max()
    assert run.summary["peak_force"] == pytest.approx(peak, rel=1e-12)
    assert 0 < peak <= 5.0 + 1e-9


def test_energies_of_a_run_are_those_of_the_source(run, table):
    later = run.ticks[1000::37]
    found = table.query(np.ascontiguousarray(later["object"]))
    # A tick says the energy where it asked last, a step of the coupling from where the part then is.
    np.testing.assert_allclose(found.energy, later["energy"], rtol=1e-2)


def test_a_report_is_what_the_run_says(run, tmp_path):
    run.report(tmp_path / "r.json")
    assert '"peak_force"' in (tmp_path / "r.json").read_text()
    run.report(tmp_path / "r.csv")
    with open(tmp_path / "r.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3000
    assert float(rows[777]["fz"]) == run.ticks["force"][777, 2]
    assert float(rows[777]["object_qw"]) == run.ticks["object"][777, 6]
    run.report(tmp_path / "r.html")
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    figures = re.findall(r'role="tab"[^>]*>([^<]+)</button>', page)
    assert {"force", "torque", "energy"} <= set(figures), figures
    charts = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    assert len(charts) >= 3
    for chart in charts:
        assert len(list(ElementTree.fromstring(chart))) > 5
    with pytest.raises(pegfit.PegfitError) as caught:
        run.report(tmp_path / "r.txt")
    assert caught.value.item == "path"
    with pytest.raises(pegfit.PegfitError, match="none"):
        run.report(tmp_path / "none" / "r.json")


def test_a_table_that_was_opened_needs_its_pair(table, pair):
    opened = pegfit.Table.open(table.path)
    with pytest.raises(pegfit.DeviceError) as caught:
        pegfit.feel(opened, seconds=0.1)
    assert caught.value.item == "pair"
    assert len(pegfit.feel(opened, seconds=0.1, pair=pair).ticks) == 100


def test_settings_that_are_none_are_refused(table):
    for call, said in [
        (lambda: pegfit.feel(table, "dance"), "script"),
        (lambda: pegfit.feel(table, seconds=float("nan")), "seconds"),
        (lambda: pegfit.feel(table, hand={"finger": 1.0}), "hand: finger"),
        (lambda: pegfit.feel(table, hand={"mass": 0.0}), "hand: mass"),
        (lambda: pegfit.ForcePath(table, {"rate_hz": 1.0}), "rate_hz"),
        (lambda: pegfit.ForcePath(table, {"limits": {"forse": 1.0}}), "config"),
        (lambda: pegfit.ForcePath(table, grip=[0, 0, float("inf")]), "grip"),
    ]:
        with pytest.raises(pegfit.DeviceError) as caught:
            call()
        assert caught.value.item == said, caught.value
    with pytest.raises(pegfit.PegfitError):
        pegfit.feel("table")


def hold(path, pose, ticks, start=0):
    for tick in range(start, start + ticks):
        wrench = path.step(pose, tick * 1e-3)
    return wrench


def test_a_held_part_feels_spring_and_energy_in_balance(table):
    path = pegfit.ForcePath(table, {"ramp_s": 0.05})
    pose = [0.0, 0.0, 0.004, 0, 0, 0, 1]
    force, torque = hold(path, pose, 1500)
    assert path.gain == 1 and path.coverage == 1 and path.flags == 0
    # The virtual part rests where the spring holds the energy's pull: F = k (object - held), and F
    # is the energy's force there. It lies on the z axis by symmetry of the pull.
    stiffness = 1000.0
    there = np.array([[0.0, 0.0, 0.004 + force[2] / stiffness, 0, 0, 0, 1]])
    there[0, :2] = force[:2] / stiffness
    felt = table.query(there)
    assert felt.force[0, 2] < 0
    np.testing.assert_allclose(force, felt.force[0], atol=0.1 * np.linalg.norm(felt.force[0]))


def test_forces_are_limited_and_begin_from_nothing(table):
    path = pegfit.ForcePath(table, {"limits": {"force": 0.5, "force_rate": 100.0}})
    first, _ = path.step([0.003, 0, 0, 0, 0, 0, 1], 0.0)
    assert np.linalg.norm(first) < 0.11
    forces = [np.linalg.norm(path.step([0.003, 0, 0, 0, 0, 0, 1], k * 1e-3)[0]) for k in range(1, 900)]
    assert max(forces) <= 0.5 + 1e-9 and forces[-1] > 0.3


def test_time_runs_forward_and_poses_are_poses(table):
    path = pegfit.ForcePath(table)
    path.step(np.eye(4), 1.0)
    with pytest.raises(pegfit.DeviceError) as caught:
        path.step(np.eye(4), 0.5)
    assert caught.value.item == "t"
    for pose in ([0] * 7, [0, 0, 0, 0, 0, 0, float("nan")], np.zeros((3, 3))):
        with pytest.raises(pegfit.PoseError):
            path.step(pose, 2.0)
    path.step([0, 0, 0, 0, 0, 0, 1], 2.0)
