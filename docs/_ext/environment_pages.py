"""A page for each environment, from its docstring and its specification, with an animation."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

import ncrs_envs
from ncrs.runs.published import load_champion
from ncrs.viz.pictures import encode_animation, episode_frames
from ncrs_envs.env import RobotEnv

SHOWN = {
    "NCRS-LightChase-v0": "light_chase/best",
    "NCRS-Obstacle-v0": "obstacle/best",
    "NCRS-CarryBall-v0": "carry_ball/compiled",
}
"""Champions that the animations show; others show a body at full throttle."""
BLIND = "..C../.WLW./.WWW./..#../....."
PICTURES = Path(__file__).parents[1] / "_generated"
_EPISODES, _SIZE = 2, 320
_FRAME_MS, _LAST_FRAME_MS = 40, 800


def environment(env_id: str) -> str:
    """Describe an environment: animation, table of spaces, the sections of its docstring."""
    with gymnasium.make(env_id) as env:
        assert isinstance(env.unwrapped, RobotEnv)
        summary, _, sections = inspect.getdoc(type(env.unwrapped)).partition("\n\n")
        table = _table(env_id, env)
    picture, shown = _animation(env_id).name, SHOWN.get(env_id)
    caption = f"`{shown}`, a robot of the package" if shown else f"`{BLIND}` at full throttle"
    return (
        f"# {ncrs_envs.get_task(_task(env_id)).title}\n\n{summary}\n\n"
        f"![Two episodes](../_generated/{picture})\n\n"
        f"*{caption}, in two episodes.*\n\n{table}\n\n{sections}\n"
    )


def _task(env_id: str) -> str:
    return next(name for name, task in ncrs_envs.TASKS.items() if task.env_id == env_id)


def _table(env_id: str, env: gymnasium.Env[Any, Any]) -> str:
    rows = {
        "import": f'`gymnasium.make("{env_id}")`, after `import ncrs_envs`',
        "thousands at once": f'`gymnasium.make_vec("{env_id}", num_envs=4096)`',
        "action space": f"`{env.action_space}`",
        "observation space": f"`{env.observation_space}`",
        "reward": "0 to 1 in every step",
        "steps in an episode": str(env.spec.max_episode_steps),
        "steps in a second": str(env.metadata["render_fps"]),
        "render modes": ", ".join(f"`{mode}`" for mode in env.metadata["render_modes"]),
        "simulators": "Box2D in `make`; the batched simulator in `make_vec`",
    }
    return "\n".join(["| | |", "|---|---|", *(f"| {key} | {row} |" for key, row in rows.items())])


def _animation(env_id: str) -> Path:
    """Draw the champion's episodes as a GIF, unless a build has drawn them already."""
    path = PICTURES / f"{env_id}.gif"
    if not path.is_file():
        PICTURES.mkdir(exist_ok=True)
        if env_id in SHOWN:
            champion = load_champion(SHOWN[env_id])
            episodes = episode_frames(champion, episodes=_EPISODES, size=_SIZE)
        else:
            episodes = [_full_throttle(env_id, seed) for seed in range(_EPISODES)]
        frames, durations = [], []
        for episode in episodes:
            frames += episode
            durations += [_FRAME_MS] * (len(episode) - 1) + [_LAST_FRAME_MS]
        path.write_bytes(encode_animation(frames, durations))
    return path


def _full_throttle(env_id: str, seed: int) -> list[NDArray[np.uint8]]:
    """Drive a body at full throttle and return the frames of the episode."""
    with gymnasium.make(env_id, body=BLIND, render_mode="rgb_array", render_size=_SIZE) as env:
        env.reset(seed=seed)
        frames, is_over = [env.render()], False
        while not is_over:
            *_, is_over, _ = env.step(np.ones(env.action_space.shape, dtype=np.float32))
            frames.append(env.render())
    return frames[::2]
