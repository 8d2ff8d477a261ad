"""The environments under Gymnasium's own tools: checker, wrappers, vectors, specs, processes."""

import multiprocessing
import os
import pickle
import subprocess
import sys
import warnings
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import Box2D  # noqa: F401 - SWIG's own deprecation warnings are not what is tested here
import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import RecordEpisodeStatistics, RecordVideo

import ncrs_envs
from ncrs_envs.tasks import PAPER_TASKS

ROOT = Path(__file__).parents[2]
HEADINGS = [
    "Description",
    "Action Space",
    "Observation Space",
    "Info",
    "Rewards",
    "Starting State",
    "Episode End",
    "Arguments",
    "Version History",
]
ZERO = np.zeros((5, 5), dtype=np.float32)


def _python(*arguments, **variables):
    """Standard output of a fresh interpreter."""
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, *arguments],
        env={**os.environ, "PYTHONPATH": path, **variables},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.fixture
def _no_display(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


@pytest.mark.usefixtures("_no_display")
def test_check_env_is_silent(env_id, monkeypatch):
    said = []
    for level in ("warn", "deprecation", "error"):
        monkeypatch.setattr(gymnasium.logger, level, lambda *args: said.append(args))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make(env_id, render_mode="rgb_array")
        check_env(env.unwrapped)
        env.close()
    assert said == []


def test_record_video(env_id, tmp_path):
    folder = tmp_path / "videos"
    env = RecordVideo(gymnasium.make(env_id, render_mode="rgb_array", render_size=64), folder)
    env.reset(seed=0)
    for _ in range(100):
        env.step(ZERO)
    env.close()
    (video,) = folder.glob("*.mp4")
    assert video.stat().st_size > 1000


def test_record_episode_statistics(env_id):
    env = RecordEpisodeStatistics(gymnasium.make(env_id))
    env.reset(seed=0)
    total = 0.0
    for _ in range(100):
        _, reward, _, truncated, info = env.step(ZERO)
        total += reward
    assert truncated
    assert info["episode"]["l"] == 100
    assert info["episode"]["r"] == pytest.approx(total, abs=1e-5)


def _rollout(envs, steps=105):
    """Observations and rewards of a vector environment beyond the end of its first episodes."""
    rng = np.random.default_rng(0)
    observation, _ = envs.reset(seed=5)
    seen = [observation.copy()]
    rewards = []
    for _ in range(steps):
        action = rng.uniform(-1, 1, envs.action_space.shape).astype(np.float32)
        observation, reward, *_ = envs.step(action)
        seen.append(observation.copy())
        rewards.append(reward)
    return np.array(seen), np.array(rewards)


def test_sync_and_async_vectors_agree(env_id, body):
    results = []
    for mode in ("sync", "async"):
        envs = gymnasium.make_vec(env_id, 2, vectorization_mode=mode, body=body)
        results.append(_rollout(envs))
        envs.close()
    (observations, rewards), (async_observations, async_rewards) = results
    assert observations.shape == (106, 2, 3, 3)
    assert np.array_equal(observations, async_observations)
    assert np.array_equal(rewards, async_rewards)
    assert not np.array_equal(observations[:, 0], observations[:, 1])


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_bodies_are_sticky_through_autoreset(env_id, body, mode):
    grid = np.rot90(ncrs_envs.parse_body(body))
    envs = gymnasium.make_vec(env_id, 2, vectorization_mode=mode, body=body)
    envs.reset(seed=0, options={"body": grid.tolist()})
    idle = np.zeros((2, 3, 3), dtype=np.float32)
    ended = np.zeros(2, dtype=bool)
    for _ in range(130):
        *_, truncated, infos = envs.step(idle)
        ended |= truncated
    envs.close()
    assert ended.all()
    assert np.array_equal(infos["body"][0], grid)
    assert np.array_equal(infos["body"][1], grid)


def test_spawned_workers_can_make_the_environments():
    envs = gymnasium.make_vec("NCRS-LightChase-v0", 1, "async", vector_kwargs={"context": "spawn"})
    observation, _ = envs.reset(seed=5)
    envs.close()
    plain, _ = gymnasium.make("NCRS-LightChase-v0").reset(seed=5)
    assert np.array_equal(observation[0], plain)


def _first_observation(spec):
    return gymnasium.make(spec).reset(seed=5)[0]


def test_a_spec_makes_the_environment_in_a_spawned_process(env_id):
    spec = gymnasium.make(f"ncrs_envs:{env_id}").spec
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        observation = pool.submit(_first_observation, spec).result(timeout=60)
    assert np.array_equal(observation, _first_observation(spec))


def test_make_needs_no_import(env_id):
    code = (
        f"import gymnasium; env = gymnasium.make('ncrs_envs:{env_id}'); env.reset(seed=0);"
        "print(env.step(env.action_space.sample())[0].shape)"
    )
    assert _python("-W", "error::UserWarning", "-c", code) == "(5, 5)"


def test_seeded_replay_is_bit_equal_in_another_process():
    names = [task.env_id for task in PAPER_TASKS]
    script = str(Path(__file__).with_name("replay.py"))
    first = _python(script, *names, PYTHONHASHSEED="1")
    assert len(set(first.split())) == 6
    assert _python(script, *names, PYTHONHASHSEED="2") == first


def test_import_is_light():
    heavy = "['torch', 'Box2D', 'pygame', 'numba', 'cma', 'hydra', 'ncrs']"
    show = f"import sys; print([m for m in {heavy} if m in sys.modules])"
    assert _python("-c", f"import ncrs_envs; {show}") == "[]"
    assert _python("-c", f"import ncrs_envs.rendering, ncrs_envs.wrappers; {show}") == "[]"
    assert _python("-c", f"import ncrs_envs.env; {show}") == "['Box2D']"


@pytest.mark.parametrize("notation", ["array", "lists", "rows"])
def test_every_make_argument_survives_json_and_pickling(env_id, body, notation):
    grid = ncrs_envs.parse_body(body)
    arguments = {
        "body": {"array": grid, "lists": grid.tolist(), "rows": body}[notation],
        "grid_size": 3,
        "render_mode": "rgb_array",
        "distance_score": "inverse_square",
        "success_radius": np.float64(12.5),
        "terminate_on_success": True,
        "render_size": 80,
    }
    env = gymnasium.make(env_id, **arguments)
    for spec in (
        env.spec,
        EnvSpec.from_json(env.spec.to_json()),
        pickle.loads(pickle.dumps(env.spec)),
    ):
        again = gymnasium.make(spec)
        assert again.unwrapped.body.tolist() == grid.tolist()
        assert again.unwrapped.settings == env.unwrapped.settings
        assert again.unwrapped.settings.distance_score == "inverse_square"
        assert again.unwrapped.settings.radius == 12.5
        assert again.unwrapped.terminate_on_success is True
        again.reset(seed=0)
        assert again.render().shape == (80, 80, 3)
        assert again.spec == env.spec


def test_stepping_or_rendering_before_reset_is_refused(env_id):
    env = gymnasium.make(env_id, render_mode="rgb_array")
    for target in (env, env.unwrapped):
        with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
            target.step(ZERO)
        with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
            target.render()
    assert env.unwrapped.scenario is None


@pytest.mark.parametrize("size", [64, 300])
def test_rgb_frames_at_any_size(env_id, size):
    env = gymnasium.make(env_id, render_mode="rgb_array", render_size=size)
    env.reset(seed=0)
    first = env.render()
    for _ in range(20):
        env.step(np.ones((5, 5), dtype=np.float32))
    second = env.render()
    assert first.shape == second.shape == (size, size, 3)
    assert first.dtype == np.uint8
    assert not np.array_equal(first, second)
    assert env.unwrapped.scene.path.shape == (21, 2)


@pytest.mark.usefixtures("_no_display")
def test_human_mode_opens_and_closes_a_window(env_id):
    import pygame

    env = gymnasium.make(env_id, render_mode="human", render_size=64)
    env.unwrapped.metadata = {**env.unwrapped.metadata, "render_fps": 1000}
    env.reset(seed=0)
    env.step(ZERO)
    assert pygame.display.get_surface().get_size() == (64, 64)
    assert env.render() is None
    env.close()
    env.close()
    assert not pygame.display.get_init()


def test_rendering_without_a_mode_warns(env_id):
    env = gymnasium.make(env_id).unwrapped
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render_mode"):
        assert env.render() is None


def test_bad_rendering_arguments_are_refused(env_id):
    with pytest.raises(ValueError, match="render_size must be an integer from 64 to 2048"):
        gymnasium.make(env_id, render_size=10)
    with pytest.raises(ncrs_envs.OptionError, match="render_mode must be None or one of"):
        gymnasium.make(env_id).unwrapped.__class__(render_mode="ansi")


def test_docstrings_have_gymnasiums_headings(env_id):
    text = gymnasium.make(env_id).unwrapped.__class__.__doc__
    found = [line.strip()[3:] for line in text.splitlines() if line.strip().startswith("## ")]
    assert found == HEADINGS
    assert env_id in text
    assert "{" not in text.replace('{"', "")
    for name in gymnasium.make(env_id).unwrapped.__class__.__init__.__annotations__:
        assert name == "return" or f"`{name}`" in text
