"""Films of a robot that grows and then drives, its sensors, wheels and channels beside it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import growth_steps
from ncrs.runs.robot import EvolvedRobot
from ncrs.viz.film_files import FilmWriter, open_writers
from ncrs.viz.options import FilmOptions
from ncrs.viz.recording import Recording, record_episodes
from ncrs.viz.stills import Lettering, Picture, ground, ramp, write
from ncrs_envs.body import sensor_mask, wheel_mask
from ncrs_envs.canvas import BORDER, SIGNED, SIGNED_LIMIT, TISSUE
from ncrs_envs.physics import DT
from ncrs_envs.rendering import draw_body, draw_scene
from ncrs_envs.tasks import MAX_EPISODE_STEPS

FPS = 25
_GROWTH_SECONDS = 0.4
"""Time for which each step of growth is shown."""
_PAUSE_SECONDS = 1.0
_CHANNEL_COLUMNS = 5


@dataclass(frozen=True)
class FilmSize:
    """Positions in a frame, in pixels; all even, as video encoders need."""

    height: int

    @classmethod
    def of(cls, options: FilmOptions) -> FilmSize:
        """Lay out the frames of a film."""
        return cls(options.height // 2 * 2)

    @property
    def side(self) -> int:
        """Width of the panel beside the square picture."""
        return self.height // 2 // 2 * 2

    @property
    def width(self) -> int:
        """Width of a frame."""
        return self.height + self.side

    @property
    def closeup(self) -> int:
        """Side of the enlarged robot."""
        return round(0.65 * self.side)

    @property
    def text(self) -> int:
        """Size of the text."""
        return max(10, self.height // 34)


def growth_frames(robot: EvolvedRobot, size: FilmSize) -> Iterator[Picture]:
    """Draw a frame for every state of growth, the seed first."""
    growth = robot.growth()
    last = len(growth.states) - 1
    for step, (state, body) in enumerate(zip(growth.states, growth.bodies, strict=True)):
        lines = [*_heading(robot), f"growth, step {step} of {last}"]
        panel = _panel(size, lines, None, state)
        yield np.concatenate([draw_body(body, size.height), panel], axis=1)


def episode_frames(
    recording: Recording, heading: list[str], number: int, episodes: int, size: FilmSize
) -> Iterator[Picture]:
    """Draw a frame for every step of an episode, the start first."""
    for step, (scene, state) in enumerate(zip(recording.scenes, recording.states, strict=True)):
        earned = float(recording.rewards[:step].mean()) if step else 0.0
        lines = [
            *heading,
            f"episode {number} of {episodes}, {step * DT:.2f} s",
            f"fitness {earned:.3f}{'   solved' if scene.success else ''}",
            _levels("sensors", scene.sensor_values[sensor_mask(scene.body)]),
            _levels("wheels", np.clip(scene.action[wheel_mask(scene.body)], -1.0, 1.0)),
        ]
        robot = draw_body(
            scene.body,
            size.closeup,
            sensor_values=scene.sensor_values,
            action=scene.action,
        )
        picture = draw_scene(scene, size.height, inset=False)
        yield np.concatenate([picture, _panel(size, lines, robot, state)], axis=1)


def _heading(robot: EvolvedRobot) -> list[str]:
    return [robot.task.task.title, robot.title]


def _levels(name: str, values: NDArray[np.floating]) -> str:
    if not len(values):  # all of them were lost
        return f"no {name}"
    return f"{name} {values.min():.2f} to {values.max():.2f}"


def _panel(
    size: FilmSize, lines: list[str], robot: Picture | None, state: NDArray[np.float32]
) -> Picture:
    """Draw the panel: text, the enlarged robot, and the NCA's channels below."""
    panel = ground(size.height, size.side)
    panel[:, :2] = BORDER
    margin = size.text
    if robot is not None:
        top, left = round(9.5 * size.text), (size.side - robot.shape[1]) // 2
        panel[top : top + robot.shape[0], left : left + robot.shape[1]] = robot
    channels = channel_picture(state, size.side - 2 * margin)
    top = size.height - margin - channels.shape[0]
    panel[top : top + channels.shape[0], margin : margin + channels.shape[1]] = channels
    panel = write(panel, (margin, margin), lines[0], Lettering(size.text))
    panel = write(panel, (margin, 2.6 * margin), "\n".join(lines[1:]), Lettering(size.text, TISSUE))
    caption = f"{state.shape[-1]} channels of the NCA, {-SIGNED_LIMIT:g} to {SIGNED_LIMIT:g}"
    small = Lettering(size.text * 4 // 5, TISSUE, "ls")
    return write(panel, (margin, top - 0.5 * margin), caption, small)


def channel_picture(state: NDArray[np.float32], width: int) -> Picture:
    """Draw the channels of a state ``(n, n, C)`` as small maps in rows, at most ``width`` wide."""
    n, _, channels = state.shape
    gap = 4
    pixels = max(1, (width + gap) // _CHANNEL_COLUMNS - gap) // n
    side = pixels * n + gap
    rows = -(-channels // _CHANNEL_COLUMNS)
    picture = ground(rows * side - gap, _CHANNEL_COLUMNS * side - gap)
    for channel in range(channels):
        row, column = divmod(channel, _CHANNEL_COLUMNS)
        colors = ramp(state[..., channel], -SIGNED_LIMIT, SIGNED_LIMIT, SIGNED)
        cells = colors.repeat(pixels, axis=0).repeat(pixels, axis=1)
        top, left = row * side, column * side
        picture[top : top + cells.shape[0], left : left + cells.shape[1]] = cells
    return picture


def timed_frames(robot: EvolvedRobot, options: FilmOptions) -> Iterator[tuple[Picture, float]]:
    """Draw all frames of a film, each with its duration in seconds."""
    size = FilmSize.of(options)
    for frame in growth_frames(robot, size):
        yield frame, _GROWTH_SECONDS
    yield frame, _PAUSE_SECONDS
    heading = _heading(robot)
    recordings = record_episodes(robot, options.episodes, options.seed, options.perturbations)
    for number, recording in enumerate(recordings, start=1):
        for frame in episode_frames(recording, heading, number, options.episodes, size):
            yield frame, DT / options.speed
        yield frame, _PAUSE_SECONDS


def frame_count(robot: EvolvedRobot, options: FilmOptions) -> int:
    """Count what ``timed_frames`` yields: states of growth and of episodes, and their pauses."""
    growth = growth_steps(robot.task.grid_size) + 2
    return growth + options.episodes * (MAX_EPISODE_STEPS + 2)


def save_film(
    robot: EvolvedRobot,
    paths: list[Path],
    options: FilmOptions | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write one film as MP4, GIF, or both; the robot's title is on every frame.

    Args:
        robot: Robot to film.
        paths: Files to write, ``.mp4`` or ``.gif``.
        options: Episodes, speed and size; None for the defaults.
        progress: Function to call with the number of frames drawn, and the number of all.

    Raises:
        VizError: If a suffix is unknown, or there is no video encoder.
        CheckpointError: If a film could not be written whole; an older one is intact then.
        ScenarioError: If the number of episodes is not a positive integer.
    """
    options = FilmOptions() if options is None else options
    size = FilmSize.of(options)
    writers: list[FilmWriter] = open_writers(paths, (size.width, size.height), FPS)
    time = 0.0
    written = 0
    done = False
    total = frame_count(robot, options)
    try:
        for drawn, (frame, seconds) in enumerate(timed_frames(robot, options), start=1):
            time += seconds
            copies = max(0, round(time * FPS) - written)
            written += copies
            for writer in writers:
                writer.add(frame, copies)
            if progress is not None:
                progress(drawn, total)
        done = True
    finally:
        with ExitStack() as stack:  # each is closed, whatever happens to another
            for writer in writers:
                stack.callback(writer.close, keep=done)
