"""Playing: the session alone, then the window with posted events and no screen."""

import numpy as np
import pytest

from ncrs.cli import main
from ncrs.runs.sources import load_robot
from ncrs.viz import play_view
from ncrs.viz.errors import VizError
from ncrs.viz.play_session import PlaySession, steering
from ncrs.viz.play_view import draw_play, layout_of
from ncrs.viz.play_window import DEFAULT_SPEED, PlayWindow
from ncrs_envs.body import BodyError, Cell, parse_body
from ncrs_envs.tasks import CARRY_BALL, LIGHT_CHASE, TaskSettings, default_body

TASK = TaskSettings()
BODY = default_body(LIGHT_CHASE, 5)
EDITED = (0, 0)


@pytest.fixture
def session():
    session = PlaySession(TASK, BODY)
    yield session
    session.close()


def test_steering_drives_both_sides():
    body = parse_body(["WLW", ".#.", "W#."])
    np.testing.assert_array_equal(steering(body, 1.0, 0.0), (body == Cell.WHEEL).astype(np.float32))
    left = steering(body, 0.0, 1.0)
    assert left[0, 2] == 1.0
    assert left[0, 0] == left[2, 0] == -1.0
    assert steering(body, 1.0, 1.0)[0].tolist() == [0.0, 0.0, 1.0]


def test_the_clock_starts_with_the_first_key(session):
    session.step(0.0, 0.0)
    assert session.yours.steps == 0
    for _ in range(30):
        session.step(1.0, 0.0)
    x, y, _ = session.yours.scene.pose
    assert y > 5.0
    assert abs(x) < 1.0
    session.step(0.0, 0.0)  # continues without keys
    assert session.yours.steps == 31
    session.restart()
    assert session.yours.scene.pose == (0.0, 0.0, 0.0)
    for _ in range(30):
        session.step(1.0, 1.0)
    assert session.yours.scene.pose[2] > 0.3  # counter-clockwise


def test_the_episode_ends_unless_it_is_endless(session):
    for _ in range(150):
        session.step(1.0, 0.0)
    assert session.finished
    assert session.yours.steps == 100
    endless = PlaySession(TASK, BODY, endless=True)
    for _ in range(150):
        endless.step(1.0, 0.0)
    assert endless.yours.steps == 150
    assert not endless.finished
    assert endless.yours.fitness == session.yours.fitness  # of the task's 100 steps
    endless.close()


def test_scenarios_take_turns(session):
    first = session.scenario
    session.next_scenario()
    assert session.scenario.light[0] * first.light[0] < 0
    assert session.yours.scene.light == session.scenario.light


def test_editing_changes_the_body_and_starts_again(session):
    session.step(1.0, 0.0)
    session.paint(*EDITED, Cell.WHEEL)
    assert session.problem is None
    assert session.yours.steps == 0
    assert session.yours.scene.body[EDITED] == Cell.WHEEL
    for column in (1, 3):
        session.paint(1, column, Cell.EMPTY)
    assert "needs at least 1 light sensor" in session.problem
    session.step(1.0, 0.0)
    assert session.yours.steps == 0
    session.paint(1, 1, Cell.LIGHT_SENSOR)
    assert session.problem is None
    session.step(1.0, 0.0)
    assert session.yours.steps == 1
    with pytest.raises(BodyError, match="has no target sensor"):
        session.paint(0, 0, Cell.TARGET_SENSOR)


def test_the_rival_replays_its_own_episode_beside_yours(sweep):
    rival = load_robot(sweep / "0")
    session = PlaySession(rival.task, BODY, rival)
    for _ in range(100):
        session.step(-1.0, 0.0)
    alone = PlaySession(rival.task, BODY, rival)
    for _ in range(100):
        alone.step(1.0, 0.5)
    assert session.rivals.steps == 100
    assert session.rivals.scene.pose == alone.rivals.scene.pose
    assert session.yours.scene.pose != alone.yours.scene.pose
    for game in (session, alone):
        game.close()


def test_pixels_and_cells(session):
    layout = layout_of(session)
    left, top = layout.editor
    cell = 200 / 6
    assert layout.cell_at(left + round(0.6 * cell), top + round(0.6 * cell)) == (0, 0)
    assert layout.cell_at(left + round(5.4 * cell), top + round(1.6 * cell)) == (1, 4)
    assert layout.cell_at(left + 2, top + 2) is None
    for index, kind in enumerate(session.cells):
        x, y = layout.palette(index)
        assert layout.palette_at(x + 5, y + 5) is kind
    assert layout.palette_at(0, 0) is None


def test_the_picture_shows_the_sensors():
    carry = PlaySession(TaskSettings("carry_ball"), default_body(CARRY_BALL, 5))
    picture = draw_play(carry, Cell.WHEEL, 0.5, "")
    width, height = layout_of(carry).size
    assert picture.shape == (height, width, 3)
    bars = [(240, 180, 20), (86, 180, 233)]
    values = carry.yours.scene.sensor_values
    x = layout_of(carry).palette(0)[0] + 180
    y = layout_of(carry).editor[1] + 24 + 6
    for index, value in enumerate((values[1, 1], values[1, 2])):
        line = picture[y + 18 * index, x : x + 110]
        assert (line == bars[index]).all(axis=-1).sum() == round(110 * float(value))
    carry.close()


@pytest.fixture
def pygame(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    return pytest.importorskip("pygame")


def test_the_window_obeys_keys_and_clicks(session, pygame):
    def post(kind, **values):
        pygame.event.post(pygame.event.Event(kind, **values))

    with PlayWindow(session) as window:
        window.frame(0.0)
        post(pygame.KEYDOWN, key=pygame.K_UP)
        window.frame(0.08)  # a quarter of real time: one step
        assert session.yours.steps == 1
        window.frame(0.16)
        assert session.yours.steps == 3
        assert session.yours.scene.action.max() == 1.0
        post(pygame.KEYUP, key=pygame.K_UP)
        post(pygame.KEYDOWN, key=pygame.K_MINUS)
        window.frame(0.16)
        assert window.speed < DEFAULT_SPEED
        assert session.yours.steps == 4
        assert session.yours.scene.action.max() == 0.0
        window.frame(60.0)  # after a pause it does not jump
        assert session.yours.steps == 9
        post(pygame.KEYDOWN, key=pygame.K_2)
        left, top = layout_of(session).editor
        post(pygame.MOUSEBUTTONDOWN, pos=(left + 20, top + 20), button=1)
        window.frame(0.0)
        assert window.chosen is Cell.LIGHT_SENSOR
        assert session.body[0, 0] == Cell.LIGHT_SENSOR
        post(pygame.MOUSEBUTTONDOWN, pos=(left + 20, top + 20), button=3)
        post(pygame.MOUSEBUTTONDOWN, pos=layout_of(session).palette(1), button=1)
        post(pygame.KEYDOWN, key=pygame.K_n)
        window.frame(0.0)
        assert session.body[0, 0] == Cell.EMPTY
        assert window.chosen is Cell.TISSUE
        assert session.scenario.light[0] > 0
        post(pygame.QUIT)
        window.frame(0.0)
        assert not window.open


@pytest.mark.parametrize("name", ["light_chase", "carry_ball"])
def test_cells_have_the_numbers_of_the_api(pygame, monkeypatch, name):
    labels = []
    real = play_view.write

    def write(picture, at, text, look):
        labels.append(text)
        return real(picture, at, text, look)

    monkeypatch.setattr(play_view, "write", write)
    play_view._palette.cache_clear()
    task = TaskSettings(name)
    with PlayWindow(PlaySession(task, default_body(task.task, 5))) as window:
        for code in range(10):
            before = window.chosen
            pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_0 + code))
            window.frame(0.0)
            known = code in (0, *map(int, task.task.part_cells))
            assert window.chosen == (code if known else before)
            label = f"{code}  {task.task.cell_label(Cell(code))}" if known else ""
            assert (label in labels) == known
        window._click(layout_at(window, row=1, column=4), 1)
        assert window._session.body[1, 4] == window.chosen == Cell.WHEEL


def layout_at(window, row, column):
    """The pixel in the middle of a cell of the editor, row 0 at the top."""
    (left, top), cell = window._layout.editor, 200 / 6
    return round(left + (column + 1) * cell), round(top + (row + 1) * cell)


def test_the_command_opens_and_closes(sweep, pygame):
    for arguments in ([str(sweep / "0")], ["--task", "carry_ball", "--body", "LTL/W#W/W#W"]):
        pygame.display.init()
        pygame.event.post(pygame.event.Event(pygame.QUIT))
        if len(arguments) > 1:
            arguments = [*arguments, "--grid-size", "3"]
        main(["play", *arguments])


def test_bad_input_is_one_sentence(capsys, tmp_path, monkeypatch):
    cases = {
        "does not exist": [str(tmp_path / "none")],
        "unknown characters": ["--body", "L?L/W#W/W#W", "--grid-size", "3"],
        "needs at least 2 wheels": ["--body", "L#L/###/W##", "--grid-size", "3"],
        "no screen": [],
    }
    monkeypatch.setenv("SDL_VIDEODRIVER", "none_such")
    for message, arguments in cases.items():
        with pytest.raises(SystemExit) as caught:
            main(["play", *arguments])
        assert caught.value.code == 2
        assert message in capsys.readouterr().err


def test_no_window_opens_where_nobody_could_see_it(session, pygame, monkeypatch):
    pygame.display.init()
    monkeypatch.delenv("SDL_VIDEODRIVER")
    monkeypatch.setattr(pygame.display, "init", lambda: None)  # the dummy driver is running
    with pytest.raises(VizError, match="only the dummy driver"):
        PlayWindow(session)
