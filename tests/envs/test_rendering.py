"""Pictures and their content, drawn without a display."""

import dataclasses

import numpy as np
import pytest

from ncrs_envs.body import parse_body
from ncrs_envs.canvas import AMBER, GREEN, GROUND, SKY, TISSUE, VERMILION, WALL
from ncrs_envs.rendering import RenderError, Scene, Window, check_render_size, draw_body, draw_scene
from ncrs_envs.scenario import Scenario, wall_quads
from ncrs_envs.tasks import playfield

EMPTY_QUADS = np.empty((0, 4, 2))
BODY = parse_body(["L#T", "W.W", "###"])
REACH = 1.1 * 60.0 * 1.01


@pytest.fixture
def scene():
    body = np.zeros((5, 5), dtype=np.int8)
    body[1:4, 1:4] = BODY
    return Scene(
        extent=playfield(5),
        body=parse_body(body),
        pose=(0.0, 0.0, 0.0),
        sensor_values=np.full((5, 5), 0.5, dtype=np.float32),
        action=np.zeros((5, 5), dtype=np.float32),
        light=None,
        ball=None,
        target=None,
        wall_quads=EMPTY_QUADS,
        path=np.zeros((1, 2)),
        success=False,
        success_radius=20.0,
    )


def _at(frame, x, y):
    """The colour at a world point."""
    size = frame.shape[0]
    column = int((x + REACH) / (2 * REACH) * size)
    row = int((REACH - y) / (2 * REACH) * size)
    return frame[row, column].astype(int)


def _close(color, expected, tolerance=30):
    return np.abs(np.asarray(color) - expected).max() <= tolerance


@pytest.mark.parametrize("size", [64, 100, 512, 2048])
def test_a_frame_has_the_size_asked_for(scene, size):
    frame = draw_scene(scene, size)
    assert frame.shape == (size, size, 3)
    assert frame.dtype == np.uint8
    assert frame.flags.c_contiguous
    assert frame.std() > 1.0


@pytest.mark.parametrize("size", [63, 2049, 0, -1, 512.0, "512", True, None])
def test_other_sizes_are_refused(scene, size):
    with pytest.raises(RenderError, match="from 64 to 2048 pixels"):
        check_render_size(size)
    with pytest.raises(RenderError):
        draw_scene(scene, size)
    with pytest.raises(RenderError):
        draw_body(BODY, size)


def test_drawing_is_deterministic(scene):
    assert np.array_equal(draw_scene(scene, 128), draw_scene(scene, 128))


def test_up_is_up_and_right_is_right(scene):
    frame = draw_scene(dataclasses.replace(scene, target=(36.0, 18.0)), 512)
    edge = 4.7
    assert _close(_at(frame, 36.0 + edge, 18.0), SKY)
    assert _close(_at(frame, 36.0, 18.0 + edge), SKY)
    for x, y in ((-36.0, 18.0), (36.0, -18.0), (-36.0, -18.0)):
        assert _close(_at(frame, x + edge, y), GROUND)


def test_cells_stand_where_the_pose_puts_them(scene):
    # The back row of the body is tissue: cells at (-2, -2), (0, -2) and (2, -2) of its frame.
    frame = draw_scene(scene, 1024)
    assert _close(_at(frame, 0.0, -2.0), TISSUE)
    turned = draw_scene(dataclasses.replace(scene, pose=(20.0, 10.0, np.pi / 2)), 1024)
    assert _close(_at(turned, 22.0, 10.0), TISSUE)
    assert _close(_at(turned, 18.0, 10.0), TISSUE)  # the middle of the front row, heading -x
    assert _close(_at(turned, 0.0, -2.0), GROUND)


def test_goals_ball_and_success_ring(scene):
    light = draw_scene(dataclasses.replace(scene, light=(30.0, 30.0), success=True), 1024)
    assert _at(light, 30.0, 30.0).min() > 150
    assert _close(_at(light, 50.0, 30.0), AMBER, 60)
    ball = draw_scene(dataclasses.replace(scene, ball=(-20.0, 0.0)), 1024)
    assert _close(_at(ball, -20.0, 0.0), AMBER)


def test_walls_reach_the_edge_of_the_picture(scene):
    walls = ([(-66.0, -66.0), (-10.0, 6.0)], [(66.0, -66.0), (10.0, 6.0)])
    quads = wall_quads(Scenario(start=(0, 0), light=(0, 30), walls=walls), 5)
    frame = draw_scene(dataclasses.replace(scene, wall_quads=quads), 512)
    for x, y in ((-65.0, 0.0), (65.0, 0.0), (-65.0, -60.0), (65.0, -60.0), (-20.0, 3.0)):
        assert _close(_at(frame, x, y), WALL)
    assert _close(_at(frame, 5.0, -24.0), GROUND)


def test_the_path_is_drawn(scene):
    path = np.array([[-30.0, -40.0], [0.0, -40.0], [30.0, -40.0]])
    frame = draw_scene(dataclasses.replace(scene, path=path), 512)
    older, newer = _at(frame, -15.0, -40.0), _at(frame, 15.0, -40.0)
    assert np.all(older > np.add(GROUND, 40))
    assert np.all(newer > older)


def _difference(first, second):
    return int((np.abs(first.astype(int) - second.astype(int)).max(axis=2) > 40).sum())


def test_each_kind_of_cell_looks_different():
    pictures = [draw_body(parse_body(np.full((3, 3), code)), 128).astype(int) for code in range(5)]
    for i in range(5):
        for j in range(i):
            assert _difference(pictures[i], pictures[j]) > 0.1 * 128**2


def test_sensors_glow_with_their_value(scene):
    dark = draw_scene(dataclasses.replace(scene, sensor_values=np.zeros((5, 5))), 1024)
    bright = draw_scene(dataclasses.replace(scene, sensor_values=np.ones((5, 5))), 1024)
    for x in (-2.0, 2.0):
        assert np.all(_at(bright, x, 2.0) > _at(dark, x, 2.0) + 50)
    assert np.array_equal(_at(bright, 0.0, -2.0), _at(dark, 0.0, -2.0))


@pytest.mark.parametrize(("gas", "color", "dy"), [(1.0, GREEN, 0.2), (-1.0, VERMILION, -0.5)])
def test_wheels_show_their_thrust(scene, gas, color, dy):
    frame = draw_scene(dataclasses.replace(scene, action=np.full((5, 5), gas)), 2048)
    assert _close(_at(frame, -2.0, dy), color)
    idle = draw_scene(scene, 2048)
    assert _at(idle, -2.0, dy).max() < 60


def test_the_close_up_makes_way(scene):
    """The robot shows larger in a corner, and the corner is one where nothing is hidden."""
    frame = draw_scene(scene, 512)
    corner = frame[:100, :100].astype(int)
    assert (np.abs(corner - TISSUE).max(axis=2) < 30).sum() > 300
    moved = draw_scene(dataclasses.replace(scene, pose=(-50.0, 50.0, 0.0)), 512)
    other = moved[:100, -100:].astype(int)
    assert (np.abs(other - TISSUE).max(axis=2) < 30).sum() > 300


def test_a_window_shows_frames_and_survives_its_user(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    import pygame

    window = Window("test", 1000.0)
    frame = np.full((64, 96, 3), 7, dtype=np.uint8)
    frame[0, 1] = (250, 0, 0)
    window.show(frame)
    assert pygame.display.get_surface().get_size() == (96, 64)
    assert tuple(pygame.display.get_surface().get_at((1, 0)))[:3] == (250, 0, 0)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    window.show(frame)
    assert window.closed
    assert not pygame.display.get_init()
    window.show(frame)
    assert not pygame.display.get_init()
    window.close()
