"""The wrappers for vector environments do what those for single ones do."""

import gymnasium
import numpy as np
import pytest

from ncrs_envs import ActionError, BodyError, Damage
from ncrs_envs import wrappers as single
from ncrs_envs.wrappers import vector
from ncrs_envs.wrappers.signals import SensorContrast, ViewError, sides

ID = "NCRS-CarryBall-v0"
BODIES = [["L#T", "W.W", "##W"], ["W#W", "L.T", "##W"], ["T.L", "WWW", "..."]]
MODES = ["NextStep", "SameStep"]


def make_vec(mode="NextStep", batched=True, **kwargs):
    bodies = np.stack([_grid(body) for body in BODIES])
    if batched:
        return gymnasium.make_vec(ID, 3, body=bodies, autoreset_mode=mode, **kwargs)
    modes = {"autoreset_mode": gymnasium.vector.AutoresetMode(mode)}
    envs = [lambda body=body: gymnasium.make(ID, body=body, **kwargs) for body in BODIES]
    return gymnasium.vector.SyncVectorEnv(envs, **modes)


def _grid(rows):
    return np.array([[".#LTW".index(cell) for cell in row] for row in rows], dtype=np.int8)


def wrapped(module, env):
    view = module.FixedBodyView(env)
    view = module.DifferentialDrive(module.SensorDifferences(view))
    return module.ProgressReward(view, success_bonus=5.0)


@pytest.mark.parametrize("mode", MODES)
def test_all_aids_equal_those_of_single_environments(mode):
    envs = wrapped(vector, make_vec(mode))
    singles = [wrapped(single, gymnasium.make(ID, body=body)) for body in BODIES]
    observations, _ = envs.reset(seed=7)
    expected = [env.reset(seed=7 + i)[0] for i, env in enumerate(singles)]
    np.testing.assert_allclose(observations, expected, atol=1e-4)
    assert observations.shape == (3, 2 * 2 + 2)
    rng = np.random.default_rng(0)
    for _ in range(99):
        actions = rng.uniform(-1, 1, (3, 2)).astype(np.float32)
        observations, rewards, _, truncated, infos = envs.step(actions)
        steps = [env.step(action) for env, action in zip(singles, actions, strict=True)]
        np.testing.assert_allclose(observations, [step[0] for step in steps], atol=2e-2)
        np.testing.assert_allclose(rewards, [step[1] for step in steps], atol=1e-2)
        assert not truncated.any()
    observations, rewards, _, truncated, infos = envs.step(actions)
    last = [env.step(action)[0] for env, action in zip(singles, actions, strict=True)]
    assert truncated.all()
    if mode == "SameStep":
        np.testing.assert_allclose(np.stack(infos["final_obs"]), last, atol=2e-2)
    else:
        np.testing.assert_allclose(observations, last, atol=2e-2)
        observations, rewards, *_ = envs.step(actions)
        assert rewards.tolist() == [0.0, 0.0, 0.0]
    assert np.all(observations[:, -2:] == 0.0)  # a new episode: nothing has changed yet
    rewards = envs.step(actions)[1]
    assert rewards.tolist() == [0.0, 0.0, 0.0]


def test_progress_adds_up_to_the_change_of_the_reward():
    plain, aided = make_vec(), vector.ProgressReward(make_vec(), scale=50.0)
    plain.reset(seed=1)
    aided.reset(seed=1)
    actions = np.ones((3, 3, 3), dtype=np.float32)
    rewards = np.stack([plain.step(actions)[1] for _ in range(100)])
    progress = np.stack([aided.step(actions)[1] for _ in range(100)])
    np.testing.assert_allclose(progress.sum(axis=0), 50.0 * (rewards[-1] - rewards[0]))


@pytest.mark.parametrize("batched", [True, False])
def test_bodies_of_different_shape_share_a_view(batched):
    envs = vector.FixedBodyView(make_vec(batched=batched))
    grids = make_vec(batched=batched)
    values, _ = envs.reset(seed=3)
    plain, _ = grids.reset(seed=3)
    assert values.tolist() == [
        [plain[0, 0, 0], plain[0, 0, 2]],
        [plain[1, 1, 0], plain[1, 1, 2]],
        [plain[2, 0, 0], plain[2, 0, 2]],
    ]
    assert envs.single_action_space.shape == (3,)
    values = envs.step(np.ones((3, 3)))[0]
    assert values.shape == (3, 2)
    with pytest.raises(ActionError, match=r"\(3, 3\)"):
        envs.step(np.ones((3, 4)))


def test_wrappers_argument_of_make_vec_in_sync_mode():
    envs = gymnasium.make_vec(
        ID, 2, vectorization_mode="sync", wrappers=[single.FixedBodyView], body=BODIES[0]
    )
    assert envs.reset(seed=0)[0].shape == (2, 2)


def test_a_body_with_other_parts_is_refused_and_the_old_ones_stay():
    envs = vector.FixedBodyView(make_vec())
    envs.reset(seed=0)
    with pytest.raises(BodyError, match="2 sensors and 3 wheels"):
        envs.reset(options={"body": ["LLT", "W.W", "##W"]})
    assert vector.bodies_of(envs).tolist() == np.stack([_grid(b) for b in BODIES]).tolist()
    values, _ = envs.reset(seed=0, options={"body": BODIES[1]})
    assert values.shape == (3, 2)
    bodies = np.stack([_grid(BODIES[0]), _grid(["LLT", "W.W", "##W"])])
    uneven = gymnasium.make_vec(ID, 2, body=bodies)
    with pytest.raises(BodyError, match="equally many"):
        vector.FixedBodyView(uneven)


@pytest.mark.parametrize("step", [0, 1])
def test_a_masked_reset_leaves_a_damaged_robot_as_it_is(step):
    envs = vector.FixedBodyView(make_vec())
    lost = Damage(step, [(0, 0), (1, 0), (2, 2)])  # of the first body a sensor and two wheels
    values, _ = envs.reset(seed=0, options={"damage": [lost, None, None]})
    assert values[0, 0] == 0.0 if step == 0 else values[0, 0] > 0.0
    values, *_ = envs.step(np.ones((3, 3)))
    assert values[0, 0] == 0.0
    assert np.all(values[0, 1:] > 0.0)
    assert np.all(values[1:] > 0.0)
    damaged = vector.bodies_of(envs)
    pose = envs.unwrapped.scene(0).pose
    mask = np.array([False, True, False])
    kept, _ = envs.reset(options={"reset_mask": mask})
    assert kept[[0, 2]].tolist() == values[[0, 2]].tolist()
    with pytest.raises(BodyError, match="environment 1"):
        envs.reset(options={"reset_mask": mask, "body": ["LLT", "W.W", "##W"]})
    assert vector.bodies_of(envs).tolist() == damaged.tolist()
    assert envs.unwrapped.scene(0).pose == pose
    values, _ = envs.reset(seed=0)
    assert np.all(values > 0.0)
    whole = np.stack([_grid(body) for body in BODIES])
    assert vector.bodies_of(envs).tolist() == whole.tolist()


def test_masked_resets_of_single_environments():
    envs = vector.FixedBodyView(make_vec(batched=False))
    envs.reset(seed=0, options={"damage": Damage(0, [(0, 0), (1, 0)])})
    mask = np.array([False, True, True])
    with pytest.raises(BodyError, match="environment 1"):
        envs.reset(options={"reset_mask": mask, "body": ["LLT", "W.W", "##W"]})
    expected = [[".#T", "..W", "##W"], *BODIES[1:]]
    assert vector.bodies_of(envs).tolist() == [_grid(body).tolist() for body in expected]


def test_body_conditioned_view_shows_each_body():
    envs = vector.BodyConditionedView(make_vec("SameStep"))
    observations, _ = envs.reset(seed=0)
    assert envs.single_observation_space["body"].contains(observations["body"][0])
    assert observations["body"].tolist() == [_grid(body).tolist() for body in BODIES]
    for _ in range(100):
        observations, *_, infos = envs.step(np.zeros((3, 3, 3), dtype=np.float32))
    assert infos["final_obs"][1]["body"].tolist() == _grid(BODIES[1]).tolist()
    assert infos["final_obs"][1]["sensors"].shape == (3, 3)


@pytest.mark.parametrize("batched", [True, False])
@pytest.mark.parametrize("mode", MODES)
def test_body_conditioned_view_shows_what_damage_leaves(mode, batched):
    envs = vector.BodyConditionedView(make_vec(mode, batched, max_episode_steps=2))
    whole = [_grid(body).tolist() for body in BODIES]
    damage = Damage(1, [(0, 0)])
    left = [damage.left(_grid(body)).tolist() for body in BODIES]
    observations, _ = envs.reset(seed=0, options={"damage": damage})
    assert observations["body"].tolist() == whole
    actions = np.zeros((3, 3, 3), dtype=np.float32)
    assert envs.step(actions)[0]["body"].tolist() == left
    observations, *_, infos = envs.step(actions)
    if mode == "SameStep":
        assert [final["body"].tolist() for final in infos["final_obs"]] == left
    else:
        assert observations["body"].tolist() == left
        observations, *_ = envs.step(actions)
    assert observations["body"].tolist() == whole


@pytest.mark.parametrize("batched", [True, False])
@pytest.mark.parametrize("step", [0, 1])
def test_lost_cells_keep_their_places_in_all_aids(step, batched):
    envs = wrapped(vector, make_vec("SameStep", batched, max_episode_steps=3))
    singles = [wrapped(single, gymnasium.make(ID, body=body)) for body in BODIES]
    options = {"damage": Damage(step, [(0, 0)])}  # a light sensor, a wheel, a target sensor
    observations, _ = envs.reset(seed=7, options=options)
    expected = [env.reset(seed=7 + i, options=options)[0] for i, env in enumerate(singles)]
    np.testing.assert_allclose(observations, expected, atol=1e-4)
    actions = np.array([[1, -1], [0.5, 1], [-1, 0.3]], dtype=np.float32)
    for _ in range(3):
        observations, _, _, truncated, infos = envs.step(actions)
        steps = [env.step(action) for env, action in zip(singles, actions, strict=True)]
        seen = np.stack(infos["final_obs"]) if truncated.all() else observations
        np.testing.assert_allclose(seen, [step[0] for step in steps], atol=2e-2)
        means, changes = seen[:, 2:4], seen[:, 4:]
        assert (means == 0.0).tolist() == [[True, False], [False, False], [False, True]]
        assert (changes == 0.0).tolist() == [[True, False], [False, False], [True, False]]
    assert truncated.all()
    assert np.all(observations[:, 2:4] > 0.0)  # a new episode: all robots are whole


def test_views_need_vectors():
    with pytest.raises(ViewError, match="FixedBodyView first"):
        vector.SensorDifferences(make_vec())
    with pytest.raises(ViewError, match="FixedBodyView first"):
        vector.DifferentialDrive(make_vec())
    with pytest.raises(ViewError, match="FixedBodyView first"):
        single.SensorDifferences(gymnasium.make(ID))


def test_contrast_by_hand():
    body = _grid(["L#L", "T.W", "..W"])
    contrast = SensorContrast(body, 10.0, 100.0)
    values = np.array([0.5, 0.3, 0.7], dtype=np.float32)
    result = contrast(values, np.array([0.5, 0.2, 0.8], dtype=np.float32), body)
    np.testing.assert_allclose(result, [1, -1, 0, 0.4, 0.7, 0, 10, -10], atol=1e-5)
    assert contrast.size == 8


def test_contrast_by_hand_without_a_lost_sensor():
    contrast = SensorContrast(_grid(["LLL", "T.W", "..W"]), 10.0, 100.0)
    values = np.array([0.0, 0.5, 0.3, 0.7], dtype=np.float32)
    previous = np.array([0.5, 0.5, 0.2, 0.8], dtype=np.float32)
    result = contrast(values, previous, _grid([".LL", "T.W", "..W"]))
    np.testing.assert_allclose(result, [0, 1, -1, 0, 0.4, 0.7, 0, 0, 10, -10], atol=1e-5)


def test_sides_by_hand():
    assert sides(_grid(["WWW", "L.T", "W.."])).tolist() == [[1, 0], [0.5, 0.5], [0, 1], [1, 0]]
