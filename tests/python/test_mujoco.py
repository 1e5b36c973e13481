"""The force between two MuJoCo bodies, and the insertion task."""

import re

import numpy as np
import pytest

import pegfit
from conftest import ROOT, about

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
    with pm.PassiveForce(model, table, "hole", "peg") as force:
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
    with pm.PassiveForce(model, table, "hole", "peg") as force:
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
    with pm.PassiveForce(model, table, "hole", "peg"):
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
    with pytest.raises(pegfit.PegfitError):
        pm.PassiveForce(model, "table", 1, 2)


FREE = """
<mujoco>
  <option timestep="0.001" integrator="implicitfast" gravity="0 0 {gravity}"/>
  <worldbody>
    <body name="hole"/>
    <body name="peg" pos="{at}">
      <joint type="free"/>
      <geom type="box" size="0.01 0.01 0.015" mass="{mass}" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
</mujoco>
"""


def let_go(source, mass, at, gravity=0.0, steps=1500, speed=(0.0, 0.0, 0.0)):
    """Positions of a peg let go, and the sum of its energies after every step."""
    from pegfit import mujoco as pm

    text = FREE.format(gravity=gravity, mass=mass, at=" ".join(map(str, at)))
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qvel[:3] = speed
    force = pm.PassiveForce(model, source, "hole", "peg")
    mujoco.mj_forward(model, data)
    first = source.query(force.pose(data)[None]).energy[0] - mass * gravity * at[2]
    first += 0.5 * mass * np.dot(speed, speed)
    places, total = [], [first]
    with force:
        for _ in range(steps):
            mujoco.mj_step(model, data)
            v, inertia = data.qvel, model.body_inertia[2]
            moving = 0.5 * mass * v[:3] @ v[:3] + 0.5 * (inertia * v[3:]) @ v[3:]
            total.append(moving + force.energy - mass * gravity * data.qpos[2])
            places.append(data.qpos[:3].copy())
    return np.array(places), np.array(total), force


@pytest.fixture(scope="module", params=["rectangular", "circular", "combined"])
def tight(request):
    pair = pegfit.Pair(*pegfit.peg_in_hole(request.param, clearance=0.0), spacing=0.002)
    return pair.evaluator(max_points=4000)


@pytest.mark.parametrize("mass", [0.001, 0.005, 0.02, 0.1])
def test_a_free_peg_is_not_thrown_out_of_a_tight_hole(tight, mass):
    """What peg and field hold together never grows, whatever the mass: so what begins below the
    energy of a free peg stays in the hole. A weight of 1 N falls through: the field holds no more."""
    for at, gravity in [((1e-3, 5e-4, 6e-3), 0.0), ((2e-4, -1e-4, -4e-3), -9.81)]:
        places, total, _ = let_go(tight, mass, at, gravity, steps=400)
        # A step's rotation is that of its start: rounding and second order.
        assert total.max() - total[0] < 2e-5, (mass, at, total.max() - total[0])
        assert total[0] < 0.0
        if gravity == 0.0 or mass <= 0.02:
            assert np.abs(places[-1]).max() < 0.02


def test_a_body_far_away_falls_freely(tight):
    places, _, force = let_go(tight, 0.1, (0.5, 0.0, 5.0), -9.81, steps=600)
    fallen = 5.0 - places[-1][2]
    # Semi-implicit steps: g dt^2 n (n + 1) / 2.
    assert abs(fallen - 9.81e-6 * 600 * 601 / 2) < 1e-9
    assert force.energy == 0 and not force.force.any() and not force.torque.any()


def test_a_peg_through_another_joint_is_held_by_its_inertia(tight):
    """A peg on a slide of its own: nothing but the slide can move."""
    from pegfit import mujoco as pm

    text = FREE.format(gravity=0, mass=0.02, at="0 0 0.004")
    text = text.replace('<joint type="free"/>', '<joint type="slide" axis="0 0 1"/>')
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    total = []
    with pm.PassiveForce(model, tight, "hole", "peg") as force:
        for _ in range(300):
            mujoco.mj_step(model, data)
            total.append(0.01 * data.qvel[0] ** 2 + force.energy)
    assert np.diff(total).max() < 1e-9 and total[0] < 0
    assert -0.03 < data.qpos[0] < 0.03


def page():
    """The Python of `docs/how-to/mujoco.md`."""
    text = (ROOT / "docs" / "how-to" / "mujoco.md").read_text()
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    return code


def run_page(code):
    names = {}
    exec(compile(code, "mujoco.md", "exec"), names)
    return names["model"], names["data"], names["force"]


def test_the_page_seats_a_peg_against_gravity(capsys):
    model, data, force = run_page(page())
    assert "energy" in capsys.readouterr().out
    weight = model.body_mass[2] * np.linalg.norm(model.opt.gravity)
    assert model.opt.gravity[2] < -9 and weight > 0.19
    # At rest in the seat, and what holds it is the weight.
    assert np.abs(data.xpos[2]).max() < 1e-3 and np.abs(data.qvel[:3]).max() < 1e-4
    assert abs(force.force[2] - weight) < 0.02 * weight
    assert np.abs(force.force[:2]).max() < 0.02 * weight


@pytest.mark.parametrize(
    "change", [("with force:", "if True:"), ('mass="0.02"', 'mass="0.2"')], ids=["no force", "200 g"]
)
def test_without_the_force_or_too_heavy_the_peg_of_the_page_falls(change):
    code = page()
    assert code.count(change[0]) == 1
    _, data, _ = run_page(code.replace(*change).split("assert")[0])
    assert data.xpos[2][2] < -0.1


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


def drawing(gym, table):
    try:
        return gym.PegInsertion(table=table, render_mode="rgb_array")
    except pegfit.PegfitError as error:
        pytest.skip(str(error))


def test_pictures_are_of_the_task(task):
    gym, table = task
    env = drawing(gym, table)
    env.reset(seed=1)
    first = env.render()
    assert first.shape == (480, 480, 3) and first.dtype == np.uint8 and first.std() > 1
    for _ in range(20):
        env.step(np.array([0, 0, -1, 0, 0, 0], np.float32))
    assert (env.render() != first).any()
    env.close()


def test_render_modes_that_are_none_are_refused(task):
    gym, table = task
    assert "human" not in gym.PegInsertion.metadata["render_modes"]
    with pytest.raises(pegfit.PegfitError) as caught:
        gym.PegInsertion(table=table, render_mode="human")
    assert caught.value.item == "render_mode"
    assert gym.PegInsertion(table=table).render() is None


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_actions_that_are_not_finite_are_refused(task, bad):
    gym, table = task
    env = gym.PegInsertion(table=table)
    before, _ = env.reset(seed=1)
    action = np.zeros(6, np.float32)
    action[4] = bad
    with pytest.raises(pegfit.PegfitError) as caught:
        env.step(action)
    assert caught.value.item == "action"
    with pytest.raises(pegfit.PegfitError):
        env.step(np.zeros(5, np.float32))
    # Nothing was done.
    other = gym.PegInsertion(table=table)
    other.reset(seed=1)
    still = np.zeros(6, np.float32)
    np.testing.assert_array_equal(env.step(still)[0], other.step(still)[0])


def test_a_reset_leaves_nothing_of_the_last_episode(task):
    gym, table = task
    env = gym.PegInsertion(table=table)
    fresh, _ = env.reset(seed=5)
    for _ in range(60):
        env.step(np.array([0.2, 0, -1, 0, 0.1, 0], np.float32))
    again, _ = env.reset(seed=5)
    np.testing.assert_array_equal(again, fresh)


@pytest.mark.parametrize("what", ["qpos", "qvel"])
def test_an_episode_that_mujoco_resets_is_cut_off_without_reward(task, what):
    gym, table = task
    env = gym.PegInsertion(table=table)
    env.reset(seed=2)
    getattr(env._data, what)[0] = np.nan
    observation, reward, seated, cut, told = env.step(np.zeros(6, np.float32))
    assert (reward, seated, cut, told["failed"]) == (0.0, False, True, True)
    assert np.isfinite(observation).all()
    env.reset(seed=2)
    assert env.step(np.zeros(6, np.float32))[4]["failed"] is False


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
