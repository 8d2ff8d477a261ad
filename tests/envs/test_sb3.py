"""The adapter to Stable-Baselines3, under its own tools."""

import gymnasium
import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the extra sb3")

from stable_baselines3 import PPO
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import VecFrameStack, VecMonitor, VecNormalize

from ncrs_envs import FixedBodyView, OptionError
from ncrs_envs.sb3 import SB3VecEnv
from ncrs_envs.wrappers import vector
from ncrs_envs.wrappers.signals import ViewError

ID = "NCRS-LightChase-v0"
BODY = ["L#L", "W#W", "W#W"]
OTHER = ["LWL", "W.W", "W#."]


def make(count=4, **kwargs):
    envs = gymnasium.make_vec(ID, count, body=BODY, autoreset_mode="SameStep", **kwargs)
    return SB3VecEnv(vector.FixedBodyView(envs))


def test_a_single_environment_passes_the_checker():
    check_env(FixedBodyView(gymnasium.make(ID, body=BODY)))


def test_it_steps_like_sb3s_own_vector_of_single_environments():
    ours = make()
    theirs = make_vec_env(
        lambda: FixedBodyView(gymnasium.make(ID, body=BODY)), n_envs=4, monitor_kwargs={}
    )
    for envs in (ours, theirs):
        envs.seed(3)
    np.testing.assert_allclose(ours.reset(), theirs.reset(), atol=1e-6)
    rng = np.random.default_rng(0)
    for step in range(100):
        actions = rng.uniform(-1, 1, (4, 4)).astype(np.float32)
        seen, rewards, dones, infos = ours.step(actions)
        other, other_rewards, other_dones, other_infos = theirs.step(actions)
        np.testing.assert_allclose(rewards, other_rewards, atol=1e-4)
        assert dones.tolist() == other_dones.tolist() == [step == 99] * 4
        assert rewards.dtype == np.float32
        if step < 99:
            np.testing.assert_allclose(seen, other, atol=1e-4)
            assert infos == [{}] * 4
    for info, other_info in zip(infos, other_infos, strict=True):
        last = info["terminal_observation"]
        np.testing.assert_allclose(last, other_info["terminal_observation"], atol=1e-4)
        assert info["TimeLimit.truncated"] is other_info["TimeLimit.truncated"] is True
        assert info["is_success"] == bool(other_info["success"])
        np.testing.assert_allclose(info["pose"], other_info["pose"], atol=1e-2)
    assert np.abs(seen - 1.0).max() < 1.0  # the first observation of the next episode
    assert ours.reset_infos[0]["pose"].tolist() == [0.0, 0.0, 0.0]


def test_success_that_ends_an_episode_is_no_truncation():
    envs = make(terminate_on_success=True, success_radius=500.0)
    envs.reset()
    _, _, dones, infos = envs.step(np.zeros((4, 4)))
    assert dones.all()
    assert infos[0]["TimeLimit.truncated"] is False
    assert infos[0]["is_success"] is True


def test_options_and_attributes():
    envs = make()
    envs.set_options([{"body": body, "region": i} for i, body in enumerate([BODY, OTHER] * 2)])
    envs.reset()
    bodies = envs.get_attr("body")
    assert [int((body != 0).sum()) for body in bodies] == [9, 7, 9, 7]
    lights = [scenario.light for scenario in envs.get_attr("scenario", [0, 2])]
    assert lights[0][0] < 0 < lights[1][0]
    assert envs.get_attr("render_mode") == [None] * 4
    assert envs.env_is_wrapped(vector.FixedBodyView) == [True] * 4
    assert envs.env_is_wrapped(vector.ProgressReward, 1) == [False]
    assert envs.env_method("scene", indices=[1])[0].body.tolist() == bodies[1].tolist()
    with pytest.raises(OptionError, match="set_options"):
        envs.set_attr("body", BODY)
    envs.set_options([{"body": BODY}, {}, {}, {}])
    with pytest.raises(OptionError, match="all environments"):
        envs.reset()


def test_other_autoreset_modes_are_refused():
    with pytest.raises(ViewError, match="SameStep"):
        SB3VecEnv(gymnasium.make_vec(ID, 2))


def test_it_trains_inside_sb3s_wrappers():
    envs = VecNormalize(VecFrameStack(VecMonitor(make(8)), 2))
    model = PPO("MlpPolicy", envs, n_steps=100, batch_size=400, n_epochs=1, seed=0, device="cpu")
    model.learn(800)
    assert len(model.ep_info_buffer) == 8
    mean, spread = evaluate_policy(model, envs, n_eval_episodes=8, warn=False)
    assert np.isfinite([mean, spread]).all()
    envs.close()


def test_pictures_of_the_rendered_environments():
    envs = make(render_mode="rgb_array", render_size=64)
    envs.reset()
    assert envs.render().shape == (128, 128, 3)
