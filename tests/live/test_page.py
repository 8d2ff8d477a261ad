"""The page in Chromium: robots grow and drive, and hands and keys change them."""

import numpy as np
import pytest

import ncrs
from tests.live.hands import choose, click_cell, grown, press_at, settle, state, steps

from selenium.webdriver.common.keys import Keys  # isort: skip


def test_it_opens_grows_and_drives_without_errors(live):
    live.driver.get_log("browser")
    live.open()
    assert state(live)["phase"] == "growing"
    live.wait(lambda: state(live)["step"] > 3)
    assert state(live)["body"] == ncrs.load_champion("light_chase/best").body.ravel().tolist()
    assert live.driver.get_log("browser") == []
    assert not live.find("#problem").is_displayed()
    assert live.find("#hud [data-field=success]").text in ("not yet", "at 1.1 s")
    assert live.find("#numbers [data-field=published]").text == "0.650"
    assert "of 1,000 episodes" in live.find("#numbers [data-field=success]").text


@pytest.mark.slow
def test_it_holds_all_champions(live):
    ids = live.js("return [...document.querySelectorAll('#robots button')].map(b => b.dataset.id)")
    assert sorted(ids[:-1]) == ncrs.champions()
    assert ids[-1] == "by_hand/chaser"


def test_the_light_is_dragged_and_the_robot_follows(live):
    choose(live, "by_hand/chaser")
    grown(live)
    settle(live)
    for place in ((40, -30), (-35, 25), (10, 40)):
        press_at(live, 20, 20, place)
        light = live.js("return NCRSLive.app.session.scenario.light")
        assert light == pytest.approx(place, abs=0.5)
        after = steps(live, 150)
        assert np.hypot(after["x"] - light[0], after["y"] - light[1]) < 10
    assert after["success"]


@pytest.mark.slow
def test_episodes_repeat_on_the_courses_until_hands_change_one(live):
    live.js("NCRSLive.app.play(false)")
    light = grown(live) and live.js("return NCRSLive.app.session.scenario.light")
    run = """
    const { app } = NCRSLive;
    app.play(true);
    for (let i = 0; i < arguments[0]; i++) app.advance(0.1);
    app.play(false);
    return [app.episodes, app.successes, app.session.step];
    """
    episodes, successes, step = live.js(run, 40)
    assert (episodes, successes) == (1, 1)
    assert 0 < step < 100
    assert live.js("return NCRSLive.app.session.scenario.light") != light
    live.js("NCRSLive.app.moveThing('light', [30, 30])")
    live.js(run, 30)
    assert live.js("return NCRSLive.app.session.scenario.light") == [30, 30]
    live.find("#repeat").click()
    assert live.js(run, 60)[2] > 150


def test_keys_move_the_light_and_run_the_robot(live):
    grown(live)
    before = live.js("return NCRSLive.app.session.scenario.light")
    live.find("#stage").click()
    before = live.js("return NCRSLive.app.session.scenario.light")
    live.press(Keys.ARROW_LEFT, Keys.ARROW_UP)
    after = live.js("return NCRSLive.app.session.scenario.light")
    assert after == pytest.approx([before[0] - 2, before[1] + 2])
    live.press(".", ".")
    assert state(live)["step"] == 2
    live.press("-", "-", "-", "-")
    assert live.js("return NCRSLive.app.speed") == 0.125
    live.press("+", "+", "+", "+", "+", "+")
    assert live.js("return NCRSLive.app.speed") == 4
    live.js("NCRSLive.app.setSpeed(-3)")
    live.press("r", " ")
    assert state(live)["step"] < 2
    live.press("g")
    assert state(live)["phase"] == "growing"


def test_cells_are_cut_off_and_painted_while_it_drives(live):
    grown(live)
    before = steps(live, 5)
    click_cell(live, 0, 0)
    after = state(live)
    assert before["body"][0] == 2
    assert after["body"] == [0, *before["body"][1:]]
    # The grid stays where it was; the other cells keep their states.
    center = "return NCRSLive.app.session.center()"
    assert after["x"] != before["x"]
    place = live.js(center)
    live.js("document.querySelector('#palette [data-code=\"4\"]').click()")
    click_cell(live, 0, 0)
    assert state(live)["body"][0] == 4
    assert live.js(center) == pytest.approx(place, abs=1e-9)
    cells = sum(code != 0 for code in after["body"])
    assert len(after["brain"]) == 8 * cells
    assert after["brain"] == before["brain"][8:]
    assert steps(live, 3)["step"] == 8


@pytest.mark.slow
def test_the_last_cell_cannot_be_cut(live):
    grown(live)
    cut = "return NCRSLive.app.session.setCell(arguments[0], 0)"
    assert [live.js(cut, i) for i in range(25)] == [True] * 24 + [False]
    assert sum(state(live)["body"]) > 0


def test_it_grows_again_from_the_seed_or_from_what_is_left(live):
    whole = grown(live)["body"]
    for i in range(10):
        live.js("NCRSLive.app.session.setCell(arguments[0], 0)", i)
    live.js("NCRSLive.app.growAgain(false)")
    left = state(live)
    assert (left["phase"], left["body"]) == ("growing", [0] * 10 + whole[10:])
    again = grown(live)["body"]
    assert again[:10] != [0] * 10
    live.js("NCRSLive.app.growAgain(true)")
    assert sum(code != 0 for code in state(live)["body"]) == 1
    assert grown(live)["body"] == whole


@pytest.mark.slow
def test_larger_grids(live):
    live.click(live.find('#sizes [data-value="9"]'))
    body = grown(live)["body"]
    champion = ncrs.load_champion("light_chase/best")
    assert body == ncrs.grow(champion.nca, 9).ravel().tolist()
    assert live.find('#sizes [aria-checked="true"]').text == "9"
    steps(live, 10)


def test_walls_stop_the_robot_until_they_are_erased(live):
    choose(live, "by_hand/chaser")
    grown(live)
    settle(live)
    live.js("NCRSLive.app.moveThing('light', [0, 50])")
    live.find('#tools [data-value="wall"]').click()
    press_at(live, 30, 25, (-30, 25))
    walls = "return NCRSLive.app.session.scenario.walls.length"
    assert live.js(walls) == 1
    stopped = steps(live, 100)
    assert stopped["y"] < 25
    assert stopped["touched"]
    press_at(live, 0, stopped["y"], (10, stopped["y"]))
    assert live.js(walls) == 1
    assert "robot" in live.find("#status").get_attribute("textContent")
    live.find('#tools [data-value="erase"]').click()
    press_at(live, 20, 25)
    assert live.js(walls) == 0
    assert steps(live, 60)["y"] > 30


@pytest.mark.slow
def test_the_ball_and_the_target_are_dragged(live):
    choose(live, "carry_ball/best")
    grown(live)
    settle(live)
    ball = live.js("return NCRSLive.app.ball()")
    press_at(live, *ball, (10, 20))
    assert live.js("return NCRSLive.app.ball()") == pytest.approx([10, 20], abs=0.5)
    press_at(live, -30, -30)
    assert live.js("return NCRSLive.app.session.scenario.target") == pytest.approx(
        [-30, -30], abs=0.5
    )
    parts = live.js(
        "return [...document.querySelectorAll('#palette button')].map(b => b.innerText)"
    )
    assert [text.strip() for text in parts][1:] == [
        "tissue",
        "ball sensor",
        "target sensor",
        "wheel",
    ]


@pytest.mark.slow
def test_touch_leads_the_robot(live):
    grown(live)
    settle(live)
    box = live.js("const b = document.getElementById('stage').getBoundingClientRect();"
                  "return [b.x + b.width / 2, b.y + b.height / 4]")  # fmt: skip
    for kind in ("touchStart", "touchEnd"):
        points = [{"x": box[0], "y": box[1]}] if kind == "touchStart" else []
        live.driver.execute_cdp_cmd(
            "Input.dispatchTouchEvent", {"type": kind, "touchPoints": points}
        )
    light = live.js("return NCRSLive.app.session.scenario.light")
    assert light[0] == pytest.approx(0, abs=0.5)
    assert light[1] > 25


@pytest.mark.parametrize(
    "width",
    [360, pytest.param(390, marks=pytest.mark.slow), pytest.param(768, marks=pytest.mark.slow)],
)
def test_narrow_screens_need_no_sideways_scrolling(live, width):
    live.open(width=width, height=800)
    assert live.js("return document.documentElement.scrollWidth") <= width
    small = live.js("""
    return [...document.querySelectorAll('button, select, summary')]
        .filter((e) => e.offsetParent && e.getBoundingClientRect().height < 30).length;
    """)
    assert small <= 1  # the line that unfolds the keys


@pytest.mark.slow
def test_all_controls_have_names(live):
    nameless = live.js("""
    return [...document.querySelectorAll('button, canvas[role], input, [role=radiogroup]')]
        .filter((e) => !e.textContent.trim() && !e.getAttribute('aria-label')
            && !e.getAttribute('aria-labelledby') && !e.closest('label')).map((e) => e.id);
    """)
    assert nameless == []
