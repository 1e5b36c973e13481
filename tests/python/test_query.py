"""Energy, force and torque: against differences, against the command, in every form of poses."""

import csv

import numpy as np
import pytest

import pegfit
from conftest import about, quaternion_product, random_poses, turned

ANGLE = np.radians(6)


@pytest.fixture(scope="module")
def placed_source(placed):
    return placed.evaluator()


@pytest.fixture(scope="module", params=["direct", "table", "placed"])
def case(request, evaluator, table, placed_source, placed):
    """A source and poses within its domain."""
    if request.param == "placed":
        center = placed.assembled
        return placed_source, random_poses(12, reach=0.006, angle=ANGLE, seed=3, center=center)
    source = evaluator if request.param == "direct" else table
    return source, random_poses(12, reach=0.006, angle=ANGLE, seed=4)


def perturbed(poses, direction, h):
    """R -> exp([omega]x) R, t -> t + v, with `direction` = (v, omega) and amount `h`."""
    moved = poses.copy()
    moved[:, :3] += h * direction[:3]
    if np.any(direction[3:]):
        moved[:, 3:] = quaternion_product(about(direction[3:], h), poses[:, 3:])
    return moved


def test_force_and_torque_are_minus_the_gradient_of_the_energy(case, placed_source):
    source, poses = case
    found = source.query(poses)
    wrench = np.hstack([found.force, found.torque])
    scale = np.array([np.abs(found.force).max()] * 3 + [np.abs(found.torque).max()] * 3)
    for k, direction in enumerate(np.eye(6)):
        # A hundredth of a cell at most, also where the part lies far from the origin about which
        # it is turned: small enough to stay within one cell nearly always, large enough for
        # energies in single precision. Kinks at cells, and rounding, leave a few per mille.
        lever = 0.02 if source is not placed_source else 0.7
        h = 2e-5 if k < 3 else 2e-5 / lever
        ends = [source.query(perturbed(poses, direction, s * h)).energy for s in (1, -1)]
        slope = -(ends[0] - ends[1]) / (2 * h)
        error = np.abs(slope - wrench[:, k]) / scale[k]
        assert np.median(error) < 5e-3 and error.max() < 0.1, (k, error)


def test_every_form_of_poses_gives_the_same(evaluator):
    rows = random_poses(5, reach=0.01, angle=3.0, seed=5)
    expected = evaluator.query(rows)
    matrices = np.tile(np.eye(4), (5, 1, 1))
    for column in range(3):
        matrices[:, :3, column] = turned(rows[:, 3:], np.eye(3)[column])
    matrices[:, :3, 3] = rows[:, :3]
    forms = [
        rows.tolist(),
        rows.astype(np.float32),
        np.asfortranarray(rows),
        np.repeat(rows, 2, axis=0)[::2],
        -rows * [-1, -1, -1, 1, 1, 1, 1],
        matrices,
    ]
    transform = pytest.importorskip("scipy.spatial.transform")
    forms.append((rows[:, :3], transform.Rotation.from_quat(rows[:, 3:])))
    for form in forms:
        found = evaluator.query(form)
        # float32 moves a pose by 1e-7 of its size; all others are the same poses to rounding.
        np.testing.assert_allclose(found.energy, expected.energy, rtol=1e-4)
        np.testing.assert_allclose(found.force, expected.force, rtol=2e-3, atol=1e-3)


def test_one_rotation_serves_many_translations(evaluator):
    transform = pytest.importorskip("scipy.spatial.transform")
    turn = transform.Rotation.from_euler("xyz", [0.1, -0.2, 0.3])
    at = np.random.default_rng(1).uniform(-0.01, 0.01, (4, 3))
    rows = np.hstack([at, np.tile(turn.as_quat(), (4, 1))])
    np.testing.assert_array_equal(
        evaluator.query((at, turn)).energy, evaluator.query(rows).energy
    )


def test_a_turn_that_maps_the_peg_onto_itself_changes_nothing():
    source = pegfit.Pair(*pegfit.peg_in_hole("rectangular", 1e-4), spacing=0.001).evaluator()
    poses = random_poses(20, reach=0.005, angle=0.2, seed=6)
    quarter = poses.copy()
    quarter[:, 3:] = quaternion_product(poses[:, 3:], about([0, 0, 1], np.pi / 2))
    a, b = source.query(poses), source.query(quarter)
    # The lattice maps onto itself under a quarter turn; fields are computed to 1e-3.
    np.testing.assert_allclose(a.energy, b.energy, atol=2e-3 * np.abs(a.energy).max())
    np.testing.assert_allclose(a.force, b.force, atol=5e-3 * np.abs(a.force).max())


@pytest.mark.parametrize("kind", ["scene", "table"])
def test_the_command_says_the_same(kind, tmp_path, command, scene, placed, placed_source):
    if kind == "scene":
        source, words = placed_source, ["--scene", scene]
    else:
        source = placed.bake(tmp_path / "placed.zarr")
        words = ["--table", tmp_path / "placed.zarr"]
    poses = random_poses(50, reach=0.008, angle=ANGLE, seed=7, center=placed.assembled)
    text = "x,y,z,qx,qy,qz,qw\n" + "\n".join(",".join(map(repr, r)) for r in poses.tolist())
    (tmp_path / "in.csv").write_text(text)
    code, _, said = command(
        "score", *words, "--poses", tmp_path / "in.csv", "-o", tmp_path / "out.csv"
    )
    assert code == 0, said
    with open(tmp_path / "out.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    found = source.query(poses)
    columns = {
        "energy": found.energy,
        **{f"f{a}": found.force[:, k] for k, a in enumerate("xyz")},
        **{f"t{a}": found.torque[:, k] for k, a in enumerate("xyz")},
        "coverage": found.coverage,
    }
    for name, values in columns.items():
        told = np.array([float(row[name]) for row in rows])
        # The same numbers, once by way of text; threads do not change them.
        scale = np.abs(values).max()
        np.testing.assert_allclose(told, values, rtol=1e-9, atol=1e-9 * scale, err_msg=name)


def test_threads_and_out_change_no_bit(table):
    poses = random_poses(3000, reach=0.009, angle=ANGLE, seed=8)
    first = table.query(poses, threads=1)
    out = pegfit.Response.empty(len(poses))
    for threads in (2, 5, None):
        again = table.query(poses, threads=threads, out=out)
        assert again is out
        for name in ("energy", "force", "torque", "coverage"):
            np.testing.assert_array_equal(getattr(out, name), getattr(first, name))
    alone = [table.query(poses[n : n + 1]).energy[0] for n in range(20)]
    np.testing.assert_array_equal(alone, first.energy[:20])


def test_outside_a_table_there_is_nothing(table):
    far = table.query([[1.0, 0, 0, 0, 0, 0, 1], [0, 0, 0, 0, 1, 0, 0]])
    np.testing.assert_array_equal(far.coverage, 0)
    np.testing.assert_array_equal(far.force, 0)


def test_no_poses_are_no_trouble(table, evaluator):
    for source in (table, evaluator):
        assert len(source.query(np.zeros((0, 7)))) == 0


GOOD = [0.0, 0, 0, 0, 0, 0, 1]


@pytest.mark.parametrize(
    "poses",
    [
        GOOD,
        [GOOD[:6]],
        np.zeros((2, 3, 3)),
        np.zeros((2, 4, 5)),
        np.zeros((1, 4, 4)),
        -np.eye(4)[None],
        np.diag([1.0, 1, -1, 1])[None],
        [["a"] * 7],
        None,
        [[np.nan, 0, 0, 0, 0, 0, 1]],
        [[0, np.inf, 0, 0, 0, 0, 1]],
        [[0, 0, 0, 0, 0, 0, 1.01]],
        [[0, 0, 0, 0, 0, 0, 0]],
        [[0, 0, 0, 0, 0, 0, np.nan]],
        [[1, 2], [3]],
    ],
)
def test_what_is_no_pose_is_refused_and_nothing_breaks(poses, table):
    with pytest.raises(pegfit.PoseError) as caught:
        table.query(poses)
    assert isinstance(caught.value, ValueError)
    assert caught.value.item and caught.value.expected and caught.value.found
    assert len(table.query([GOOD])) == 1


@pytest.mark.parametrize("count, bad", [(3, 1), (5000, 4321), (5000, 17)])
def test_the_first_bad_pose_is_named(count, bad, table):
    poses = np.tile(GOOD, (count, 1))
    poses[bad:, 6] = 2.0
    with pytest.raises(pegfit.PoseError) as caught:
        table.query(poses)
    assert caught.value.item == f"pose {bad}"


def test_out_that_does_not_fit_is_refused(table):
    poses = np.tile(GOOD, (4, 1))
    for name, array in [
        ("energy", np.empty(3)),
        ("force", np.empty((4, 2))),
        ("torque", np.empty((4, 3), np.float32)),
        ("force", np.empty((4, 6))[:, ::2]),
        ("coverage", [0.0] * 4),
    ]:
        out = pegfit.Response.empty(4)
        setattr(out, name, array)
        with pytest.raises(pegfit.PoseError) as caught:
            table.query(poses, out=out)
        assert caught.value.item == f"out.{name}"
    shared = np.empty(4)
    out = pegfit.Response(shared, np.empty((4, 3)), np.empty((4, 3)), shared)
    with pytest.raises(pegfit.PegfitError):
        table.query(poses, out=out)


@pytest.mark.parametrize("count", [1, 2000])
@pytest.mark.parametrize("threads", [0, 5000, -1, 1.5, 2**70])
def test_numbers_of_threads_that_are_none_are_refused(threads, count, table):
    with pytest.raises(pegfit.PegfitError) as caught:
        table.query(np.tile(GOOD, (count, 1)), threads=threads)
    assert caught.value.item == "threads"


def relative(found, truth):
    """Rms errors of force and torque as shares of their own rms."""
    pairs = [(found.force, truth.force), (found.torque, truth.torque)]
    return [np.linalg.norm(a - b) / np.linalg.norm(b) for a, b in pairs]


@pytest.mark.parametrize("section, clearance", [("rectangular", 3e-4), ("circular", 1e-4)])
def test_an_evaluator_meets_the_tolerance_asked_for(section, clearance):
    """Against a finer lattice than the one it was held to, at poses of our own."""
    parts = pegfit.peg_in_hole(section, clearance)
    settings = dict(half_extent=0.004, gamma=1e4)
    coarse = pegfit.Pair(*parts, spacing=0.0025, **settings)
    found = coarse.evaluator(tolerance=0.1)
    assert found.error <= 0.1 and f"{100 * found.error:.2g} %" in repr(found)
    truth = pegfit.Pair(*parts, spacing=0.0005, **settings).evaluator()
    poses = random_poses(200, reach=0.004, angle=0.3, seed=11)
    expected = truth.query(poses)
    # Other poses than those of the choice: a third more.
    assert max(relative(found.query(poses), expected)) < 0.13
    own = coarse.evaluator()
    # The pair's own lattice would not do.
    assert own.error is None and own.points < found.points
    assert max(relative(own.query(poses), expected)) > 0.1


def test_an_evaluator_has_as_few_points_as_asked_for(pair, evaluator):
    few = pair.evaluator(max_points=evaluator.points // 3)
    assert few.points <= evaluator.points // 3
    poses = random_poses(50, reach=0.004, angle=0.1, seed=12)
    assert max(relative(few.query(poses), evaluator.query(poses))) < 0.3
    assert pair.evaluator(max_points=evaluator.points).points == evaluator.points


@pytest.mark.parametrize(
    "options, item",
    [
        (dict(tolerance=0.0), "tolerance"),
        (dict(tolerance=float("nan")), "tolerance"),
        (dict(tolerance=0.1, max_points=100), "tolerance"),
        (dict(max_points=0), "max_points"),
        (dict(max_points=-5), "max_points"),
        (dict(max_points="few"), "max_points"),
    ],
)
def test_evaluators_that_cannot_be_are_refused(options, item, pair):
    with pytest.raises(pegfit.SceneError) as caught:
        pair.evaluator(**options)
    assert caught.value.item == item


def test_a_tolerance_beyond_reach_is_refused_with_what_was_reached():
    parts = pegfit.peg_in_hole("rectangular", 1e-3)
    pair = pegfit.Pair(*parts, spacing=0.002, half_extent=0.003, memory=60 * 2**20)
    with pytest.raises(pegfit.SceneError) as caught:
        pair.evaluator(tolerance=1e-4)
    assert caught.value.item == "tolerance" and "at least" in caught.value.expected
