"""Pictures of a robot: its body and its growth as PNGs, an episode as an animated GIF."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ncrs.runs.checkpoint import write_atomically
from ncrs.runs.robot import EvolvedRobot
from ncrs.viz.recording import record_episodes
from ncrs_envs.rendering import MIN_RENDER_SIZE, check_render_size, draw_body, draw_scene
from ncrs_envs.tasks import REGIONS

BODY_FILE = "body.png"
STORY_FILE = "growth_and_episodes.png"
EPISODES_FILE = "episodes.gif"
DEFAULT_SIZE = 400
_STEPS_PER_FRAME = 2
_FRAME_MS = 40
"""Duration of a frame: two steps of 20 ms, in real time."""
_LAST_FRAME_MS = 1500
_GROWTH_FRAME_MS = 200
_COLORS = 128
_BODIES = 10

Frame = NDArray[np.uint8]


def episode_frames(
    robot: EvolvedRobot, *, episodes: int = 1, seed: int = 0, size: int = DEFAULT_SIZE
) -> list[list[Frame]]:
    """Drive a robot through Box2D episodes and draw every second step.

    Args:
        robot: Robot to draw.
        episodes: Number of episodes; the regions take turns.
        seed: Seed for sampling the scenarios.
        size: Side of a frame in pixels.

    Returns:
        RGB frames of each episode, uint8 ``(size, size, 3)``, from the start to the end.

    Raises:
        RenderError: If the size cannot be drawn.
    """
    check_render_size(size)
    drawn = []
    for recording in record_episodes(robot, episodes, seed):
        last = len(recording.scenes) - 1
        drawn.append(
            [
                draw_scene(scene, size)
                for step, scene in enumerate(recording.scenes)
                if step % _STEPS_PER_FRAME == 0 or step == last
            ]
        )
    return drawn


def encode_animation(frames: Sequence[Frame], durations: Sequence[int]) -> bytes:
    """Encode frames as a GIF that repeats; ``durations`` are in milliseconds, one per frame."""
    images = [Image.fromarray(frame).quantize(_COLORS) for frame in frames]
    stream = io.BytesIO()
    images[0].save(
        stream,
        format="GIF",
        save_all=True,
        append_images=images[1:],
        duration=list(durations),
        loop=0,
    )
    return stream.getvalue()


def _durations(episode: Sequence[Frame]) -> list[int]:
    """Time an episode's frames in milliseconds: real time, with a pause on the last."""
    return [_FRAME_MS] * (len(episode) - 1) + [_LAST_FRAME_MS]


def growth_and_episode(robot: EvolvedRobot, size: int) -> tuple[list[Frame], list[int]]:
    """Draw growth and one episode; returns frames, and their durations in milliseconds."""
    bodies = [draw_body(body, size) for body in robot.growth().bodies]
    episode = episode_frames(robot, size=size)[0]
    return bodies + episode, [_GROWTH_FRAME_MS] * len(bodies) + _durations(episode)


def story(robot: EvolvedRobot, ends: Sequence[Frame]) -> Frame:
    """Draw growth from the seed cell above and the ends of episodes below, from left to right.

    Args:
        robot: Robot whose growth is shown.
        ends: Last frame of each of E episodes: RGB, uint8 ``(size, size, 3)``.

    Returns:
        RGB, uint8 ``(height, E * size, 3)``.
    """
    grown = robot.growth().bodies
    steps = np.linspace(0, len(grown) - 1, min(_BODIES, len(grown))).round().astype(int)
    bodies = grown[steps]
    below = np.concatenate(ends, axis=1)
    width = below.shape[1]
    side = width // len(bodies)
    above = np.empty((side, width, 3), dtype=np.uint8)
    above[:] = below[0, 0]
    left = (width - side * len(bodies)) // 2
    for index, body in enumerate(bodies):
        start = left + index * side
        above[:, start : start + side] = draw_body(body, max(side, MIN_RENDER_SIZE))[:side, :side]
    return np.concatenate([above, below], axis=0)


def save_pictures(
    robot: EvolvedRobot, folder: Path, *, seed: int = 0, size: int = DEFAULT_SIZE
) -> list[Path]:
    """Draw body, growth and an episode in each region; returns the paths of the files.

    Raises:
        CheckpointError: If a file cannot be written; an older one is intact then.
    """
    body_path, story_path, episodes_path = (
        folder / name for name in (BODY_FILE, STORY_FILE, EPISODES_FILE)
    )
    episodes = episode_frames(robot, episodes=REGIONS, seed=seed, size=size)
    _save_png(body_path, draw_body(robot.body, size))
    _save_png(story_path, story(robot, [episode[-1] for episode in episodes]))
    frames = [frame for episode in episodes for frame in episode]
    durations = [duration for episode in episodes for duration in _durations(episode)]
    animation = encode_animation(frames, durations)
    write_atomically(episodes_path, lambda stream: stream.write(animation))
    return [body_path, story_path, episodes_path]


def _save_png(path: Path, picture: Frame) -> None:
    image = Image.fromarray(picture)
    write_atomically(path, lambda stream: image.save(stream, format="PNG"))
