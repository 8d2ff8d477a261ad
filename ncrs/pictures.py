"""Pictures of a robot: its body and its growth as PNGs, an episode as an animated GIF."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ncrs.champion import Champion
from ncrs.recording import record_episodes, record_growth
from ncrs_envs.rendering import MIN_RENDER_SIZE, check_render_size, draw_body, draw_scene

BODY_FILE = "body.png"
STORY_FILE = "growth_and_episode.png"
EPISODE_FILE = "episode.gif"
DEFAULT_SIZE = 400
_STEPS_PER_FRAME = 2
_FRAME_MS = 40
"""Two steps of 20 ms: real time."""
_LAST_FRAME_MS = 1500
_GROWTH_FRAME_MS = 200
_COLORS = 128
_BODIES = 10
_SCENES = 4

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
    check_render_size(size)
    recording = record_episodes(champion, 1, seed)[0]
    last = len(recording.scenes) - 1
    return [
        draw_scene(scene, size)
        for step, scene in enumerate(recording.scenes)
        if step % _STEPS_PER_FRAME == 0 or step == last
    ]


def encode_animation(frames: Sequence[Frame], durations: Sequence[int]) -> bytes:
    """Frames as a GIF that repeats; ``durations`` in milliseconds, one per frame."""
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


def save_animation(frames: Sequence[Frame], path: Path) -> None:
    """Write frames as a GIF that repeats, in real time, pausing on the last."""
    durations = [_FRAME_MS] * (len(frames) - 1) + [_LAST_FRAME_MS]
    path.write_bytes(encode_animation(frames, durations))


def growth_and_episode(champion: Champion, size: int) -> tuple[list[Frame], list[int]]:
    """Frames of the growth and of one episode, and how long to show each, in milliseconds."""
    bodies = [draw_body(body, size) for body in record_growth(champion).bodies]
    episode = episode_frames(champion, size=size)
    durations = [_GROWTH_FRAME_MS] * len(bodies) + [_FRAME_MS] * (len(episode) - 1)
    return bodies + episode, [*durations, _LAST_FRAME_MS]


def story(champion: Champion, frames: list[Frame]) -> Frame:
    """Growth from the seed cell above, an episode below, each from left to right.

    Args:
        champion: whose growth is shown.
        frames: of an episode, RGB, uint8 ``(size, size, 3)``.

    Returns:
        RGB, uint8 ``(height, _SCENES * size, 3)``.
    """
    grown = record_growth(champion).bodies
    steps = np.linspace(0, len(grown) - 1, min(_BODIES, len(grown))).round().astype(int)
    bodies = grown[steps]
    chosen = [
        frames[index] for index in np.linspace(0, len(frames) - 1, _SCENES).round().astype(int)
    ]
    below = np.concatenate(chosen, axis=1)
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
    champion: Champion, folder: Path, *, seed: int = 0, size: int = DEFAULT_SIZE
) -> list[Path]:
    """Draw body, growth and an episode into a folder; returns the paths of the files."""
    body_path, story_path, episode_path = (
        folder / name for name in (BODY_FILE, STORY_FILE, EPISODE_FILE)
    )
    frames = episode_frames(champion, seed=seed, size=size)
    Image.fromarray(draw_body(champion.body, size)).save(body_path)
    Image.fromarray(story(champion, frames)).save(story_path)
    save_animation(frames, episode_path)
    return [body_path, story_path, episode_path]
