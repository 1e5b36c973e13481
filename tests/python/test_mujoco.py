"""The force between two MuJoCo bodies, and the insertion task."""

import numpy as np
import pytest

import pegfit
from conftest import about

mujoco = pytest.importorskip("mujoco")

MODEL = """
<mujoco>
  <option timestep="0.001" gravity="0 0 0"/>
  <worldbody>
    <body name="hole" pos="0.1 -0.2 0.3">
      <freejoint/><inertial pos="0.01 0 0.02" mass="0.4" diaginertia="4e-4 3e-4 2e-4"/>
    </body>
    <body name="peg" pos="0 0 0">
      <freejoint/><inertial pos="0 0.003 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/>
    </body>
  </worldbody>
</mujoco>
"""


def product(a, b):
    found = np.empty(4)
    mujoco.mju_mulQuat(found, a, b)
    return found


@pytest.fixture()
def assembled():
    """A hole that lies anywhere, and its peg 2 mm out and a little turned."""
    from pegfit import mujoco as pm

    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    turn = np.roll(about([1, -2, 0.5], 1.1), 1)
    out = np.empty(3)
    mujoco.mju_rotVecQuat(out, np.array([5e-4, -3e-4, 2e-3]), turn)
    data.qpos[3:7] = turn
    data.qpos[7:10] = data.qpos[:3] + out
    data.qpos[10:14] = product(turn, np.roll(about([1, 1, 1], 0.05), 1))
    mujoco.mj_forward(model, data)
    return pm, model, data


def test_generalized_forces_are_minus_the_gradient_of_the_energy(assembled, evaluator):
    pm, model, data = assembled
    force = pm.PassiveForce(model, evaluator, "hole", "peg", raw=True)
    rest = data.qpos.copy()

    def energy(velocity, h):
        data.qpos[:] = rest
        mujoco.mj_integratePos(model, data.qpos, velocity, h)
        mujoco.mj_forward(model, data)
        return evaluator.query(force.pose(data)[None]).energy[0]

    with force:
        mujoco.mj_forward(model, data)
        found = data.qfrc_passive.copy()
    h = 2e-5
    for k in range(model.nv):
        unit = np.eye(model.nv)[k]
        step = h if k % 6 < 3 else 1e-3
        slope = -(energy(unit, step) - energy(unit, -step)) / (2 * step)
        # Sums in single precision, kinks of trilinear interpolation at cells.
        scale = np.abs(found[[i for i in range(model.nv) if (i % 6 < 3) == (k % 6 < 3)]]).max()
        assert abs(slope - found[k]) < 0.03 * scale, (k, slope, found[k])


def test_the_pair_pushes_nobody_else(assembled, table):
    """Momentum and angular momentum of both bodies together stay zero."""
    pm, model, data = assembled
    with pm.PassiveForce(model, table, "hole", "peg", config={"ramp_s": 0.02}) as force:
        for _ in range(500):
            mujoco.mj_step(model, data)
    assert force.coverage > 0 and np.abs(data.qvel).max() > 1e-3
    mujoco.mj_subtreeVel(model, data)
    mass, momentum = model.body_mass.sum(), np.zeros(3)
    for body in (1, 2):
        momentum += model.body_mass[body] * data.subtree_linvel[body]
    speed = np.abs(data.subtree_linvel[1:]).max()
    # Semi-implicit steps keep it to rounding, and to second order where bodies spin.
    assert np.abs(momentum).max() < 2e-2 * mass * speed


def test_a_peg_comes_to_rest_in_a_tight_hole(tmp_path):
    from pegfit import mujoco as pm

    pair = pegfit.Pair(*pegfit.peg_in_hole("rectangular"), spacing=0.001, half_extent=0.008)
    table = pair.bake(tmp_path / "t.zarr", angle_deg=8, step_deg=4)
    model = mujoco.MjModel.from_xml_string(MODEL.replace("<freejoint/>", "", 1))
    model.dof_damping[:] = 1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3
    data = mujoco.MjData(model)
    data.qpos[:3] = [0.1 + 4e-4, -0.2 - 3e-4, 0.3 + 6e-3]
    with pm.PassiveForce(model, table, "hole", "peg", config={"ramp_s": 0.1}) as force:
        energies = []
        for _ in range(4000):
            mujoco.mj_step(model, data)
            energies.append(force.energy)
        pose = force.pose(data)
    # Half a lattice step across; along the hole the well is broad.
    assert np.abs(pose[:2]).max() < 5e-4 and abs(pose[2]) < 2e-3
    assert np.abs(data.qvel[:3]).max() < 1e-2 and energies[-1] < 0.9 * energies[0]


def test_callbacks_are_put_back(assembled, table):
    pm, model, data = assembled
    # MuJoCo compiles no model while a callback is set.
    other = mujoco.MjModel.from_xml_string(MODEL)
    heard = []
    before = lambda *_: heard.append(1)  # noqa: E731
    mujoco.set_mjcb_passive(before)
    try:
        one = pm.PassiveForce(model, table, "hole", "peg")
        two = pm.PassiveForce(other, table, 1, 2)
        with one, two:
            mujoco.mj_step(model, data)
            assert heard and np.isfinite(one.energy) and one.energy != 0 and two.energy == 0
        assert mujoco.get_mjcb_passive() is before
    finally:
        mujoco.set_mjcb_passive(None)


def test_time_may_go_back_to_the_start(assembled, table):
    pm, model, data = assembled
    start = data.qpos.copy()
    found = []
    with pm.PassiveForce(model, table, "hole", "peg", config={"ramp_s": 0.01}):
        for _ in range(2):
            mujoco.mj_resetData(model, data)
            data.qpos[:] = start
            for _ in range(100):
                mujoco.mj_step(model, data)
            found.append(data.qpos.copy())
    np.testing.assert_array_equal(found[0], found[1])


def test_bodies_and_frames_that_are_none_are_refused(assembled, table):
    pm, model, _ = assembled
    for words in [("hole", "pin"), (1, 7), (-2, 1)]:
        with pytest.raises(pegfit.PegfitError) as caught:
            pm.PassiveForce(model, table, *words)
        assert caught.value.item == "body"
    with pytest.raises(pegfit.PegfitError):
        pm.PassiveForce(model, table, 1, 2, fixed_frame=[0, 0, 0])
    with pytest.raises(pegfit.DeviceError):
        pm.PassiveForce(model, table, 1, 2, config={"ramp": 1})


@pytest.fixture(scope="module")
def task():
    pytest.importorskip("gymnasium")
    from pegfit import gym

    return gym, gym.tabulate("rectangular")


def test_the_task_is_one_for_gymnasium(task):
    gym, table = task
    checker = pytest.importorskip("gymnasium.utils.env_checker")
    with pytest.warns(UserWarning, match="infinity"):
        checker.check_env(gym.PegInsertion(table=table), skip_render_check=True)


def test_gymnasium_makes_the_task_by_its_name(task):
    gym, table = task
    env = pytest.importorskip("gymnasium").make("pegfit/PegInsertion-v0", table=table)
    assert isinstance(env.unwrapped, gym.PegInsertion)
    observation, _ = env.reset(seed=1)
    assert observation.shape == (18,) and env.step(gym.scripted(observation))[1] < 0


def episode(gym, env, seed):
    observation, _ = env.reset(seed=seed)
    while True:
        observation, reward, seated, cut, told = env.step(gym.scripted(observation))
        if seated or cut:
            return seated, reward, told


def test_the_same_seed_is_the_same_episode(task):
    gym, table = task
    one, two = (gym.PegInsertion(table=table) for _ in range(2))
    a, b = episode(gym, one, 3), episode(gym, two, 3)
    assert a == b and a[0] and a[1] > 9 and a[2]["distance"] < 1e-3
    assert episode(gym, one, 4) != a


@pytest.mark.slow
@pytest.mark.parametrize(
    "section, width", [("rectangular", 0.02), ("circular", 0.02), ("circular", 0.008)]
)
def test_the_scripted_policy_seats_the_peg_from_a_hundred_starts(task, section, width):
    gym, _ = task
    env = gym.PegInsertion(section, width)
    assert sum(episode(gym, env, seed)[0] for seed in range(100)) == 100
