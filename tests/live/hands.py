"""Hands on the page of live robots."""

import time

import pytest

pytest.importorskip("selenium", reason="selenium is not installed")

from selenium.webdriver.common.action_chains import ActionChains

_STATE = """
const { session } = NCRSLive.app, { memories, ...state } = session.state;
const { phase, step, total } = session;
return { ...state, closest_target: 0, phase, step, total,
  body: Array.from(session.body.data), brain: Array.from(session.brain?.states.data ?? []) };
"""


def state(page):
    return page.js(_STATE)


def grown(page):
    """Let the robot grow at once, and stop it at its start."""
    page.js("""
    const { app } = NCRSLive;
    app.play(false);
    while (app.session.phase === 'growing') app.step();
    """)
    return state(page)


def steps(page, number):
    page.js("for (let i = 0; i < arguments[0]; i++) NCRSLive.app.step();", number)
    return state(page)


def press_at(page, x, y, to=None):
    """Press the pointer at a point of the playfield, in units, and drag it to another."""
    canvas = page.find("#stage")
    page.js("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'});", canvas)
    page.wait(lambda: abs(page.js("return NCRSLive.app.session.world.extent")) > 0)
    side = canvas.size["width"]
    extent = page.js("const w = NCRSLive.app.session.world; return w.extent * w.wallExtent * 1.01")
    pixel = lambda p: (round(p[0] / extent * side / 2), round(-p[1] / extent * side / 2))  # noqa: E731
    chain = ActionChains(page.driver).move_to_element_with_offset(canvas, *pixel((x, y)))
    chain.click_and_hold()
    if to is not None:
        chain.move_to_element_with_offset(canvas, *pixel(to))
    chain.release().perform()


def settle(page):
    """Wait until the camera, without gliding there, shows the whole playfield."""
    page.js("NCRSLive.app.isCalm = true")
    time.sleep(0.2)


def choose(page, name):
    page.js("document.querySelector(`#robots [data-id='${arguments[0]}']`).click();", name)


def click_cell(page, row, column):
    canvas = page.find("#body")
    page.js("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'});", canvas)
    n = page.js("return NCRSLive.app.session.world.gridSize")
    side = canvas.size["width"] / (n + 0.6)
    x, y = round((column - (n - 1) / 2) * side), round((row - (n - 1) / 2) * side)
    ActionChains(page.driver).move_to_element_with_offset(canvas, x, y).click().perform()
