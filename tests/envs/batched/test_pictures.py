"""Frames of many environments, in Gymnasium's wrappers too."""

import sys
from types import SimpleNamespace

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers.vector import HumanRendering, RecordVideo
from PIL import Image

from ncrs_envs.batched.pictures import check_render_envs, frame_size
from ncrs_envs.interface import OptionError
from ncrs_envs.rendering import RenderError

COUNT = 6


@pytest.fixture
def envs():
    made = gymnasium.make_vec(
        "NCRS-LightChase-v0", COUNT, render_mode="rgb_array", max_episode_steps=3
    )
    yield made
    made.close()


def run(envs, steps=5):
    envs.reset(seed=0)
    for _ in range(steps):
        envs.step(np.ones((COUNT, 5, 5), dtype=np.float32))


def test_all_environments_are_drawn_unless_fewer_are_chosen():
    assert check_render_envs(None, 5) == (0, 1, 2, 3, 4)
    assert check_render_envs([4, 1, 4], 5) == (4, 1)
    for wrong in ([5], [-1]):
        with pytest.raises(OptionError, match="indices from 0 to 4"):
            check_render_envs(wrong, 5)


@pytest.mark.parametrize(
    ("count", "side"),
    [(1, 512), (16, 512), (17, 496), (64, 256), (1024, 64), (100_000, 64)],
)
def test_frames_shrink_as_environments_become_more(count, side):
    assert frame_size(None, count) == side
    assert frame_size(100, count) == 100
    with pytest.raises(RenderError):
        frame_size(10, count)


def test_paths_begin_with_each_episode(envs):
    run(envs, steps=3)
    assert envs.unwrapped.scene(5).path.shape == (4, 2)
    envs.step(np.ones((COUNT, 5, 5), dtype=np.float32))  # the next episode
    assert envs.unwrapped.scene(5).path.shape == (1, 2)


def test_gymnasium_records_them(envs, tmp_path):
    recorded = RecordVideo(envs, tmp_path / "videos", episode_trigger=lambda episode: episode < 2)
    run(recorded)
    frame = recorded.recorded_frames[-1]
    assert frame.shape == (2 * 512, 3 * 512, 3)
    recorded.close()
    assert len(list((tmp_path / "videos").glob("*.mp4"))) == 2


def test_gymnasium_records_the_first_alone(tmp_path):
    envs = gymnasium.make_vec(
        "NCRS-LightChase-v0", COUNT, render_mode="rgb_array", render_envs=[0], render_size=64
    )
    recorded = RecordVideo(envs, tmp_path / "videos", record_first_only=True)
    run(recorded)
    assert recorded.recorded_frames[-1].shape == (64, 64, 3)
    assert recorded.recorded_frames[-1].any()
    recorded.close()


def test_gymnasium_shows_them_in_a_window(envs, monkeypatch):
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")

    def resize(image, size):
        return np.asarray(Image.fromarray(image).resize(size))

    # Gymnasium needs nothing else of this large package.
    monkeypatch.setitem(sys.modules, "cv2", SimpleNamespace(resize=resize))
    shown = HumanRendering(envs, screen_size=(300, 300))
    run(shown, steps=2)
    pixels = [shown.window.get_at((x, y))[:3] for y in (50, 150) for x in (50, 150, 250)]
    assert (0, 0, 0) not in pixels
    shown.close()
