"""Pictures of a robot: its body as a PNG, and an episode as an animated GIF."""

from __future__ import annotations

from pathlib import Path

import gymnasium
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ncrs.champion import Champion
from ncrs.control import Controller
from ncrs_envs.rendering import check_render_size, draw_body

BODY_FILE = "body.png"
EPISODE_FILE = "episode.gif"
DEFAULT_SIZE = 400
_STEPS_PER_FRAME = 2
_FRAME_MS = 40
"""Two steps of 20 ms: real time."""
_LAST_FRAME_MS = 1500
_COLORS = 128

Frame = NDArray[np.uint8]


def episode_frames(champion: Champion, *, seed: int = 0, size: int = DEFAULT_SIZE) -> list[Frame]:
    """Drive the champion through one Box2D episode and draw every second step.

    Args:
        champion: genome, body and task.
        seed: of the episode.
        size: side of a frame in pixels.

    Returns:
        RGB frames, uint8 ``(size, size, 3)``, the first of the start.

    Raises:
        RenderError: a size that cannot be drawn.
    """
    settings = champion.task_settings
    env = gymnasium.make(
        f"ncrs_envs:{settings.task.env_id}",
        body=champion.body.tolist(),
        render_mode="rgb_array",
        distance_score=settings.score,
        success_radius=settings.success_radius,
        render_size=check_render_size(size),
    )
    controller = Controller(champion.nca, champion.body)
    observation, _ = env.reset(seed=seed)
    frames = [_frame(env)]
    truncated, step = False, 0
    while not truncated:
        observation, _, _, truncated, _ = env.step(controller.act(observation))
        step += 1
        if step % _STEPS_PER_FRAME == 0 or truncated:
            frames.append(_frame(env))
    env.close()
    return frames


def _frame(env: gymnasium.Env[Frame, Frame]) -> Frame:
    return np.asarray(env.render(), dtype=np.uint8)


def save_animation(frames: list[Frame], path: Path) -> None:
    """Write frames as a GIF that repeats, in real time, pausing on the last."""
    images = [Image.fromarray(frame).quantize(_COLORS) for frame in frames]
    durations = [_FRAME_MS] * (len(images) - 1) + [_LAST_FRAME_MS]
    images[0].save(path, save_all=True, append_images=images[1:], duration=durations, loop=0)


def save_pictures(
    champion: Champion, folder: Path, *, seed: int = 0, size: int = DEFAULT_SIZE
) -> list[Path]:
    """Write ``body.png`` and ``episode.gif`` into a folder; returns their paths."""
    body_path, episode_path = folder / BODY_FILE, folder / EPISODE_FILE
    frames = episode_frames(champion, seed=seed, size=size)
    Image.fromarray(draw_body(champion.body, size)).save(body_path)
    save_animation(frames, episode_path)
    return [body_path, episode_path]
