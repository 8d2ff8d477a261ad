"""The page's colours, in headless Chromium, against those of pictures and films."""

import numpy as np
import pytest

from ncrs.viz.stills import ramp
from ncrs_envs.body import CELL_CHARACTERS, body_to_characters
from ncrs_envs.canvas import SIGNED, SIGNED_LIMIT
from ncrs_envs.rendering import draw_body

PIXEL = """
const canvas = document.createElement('canvas');
canvas.style.width = '400px';
document.body.append(canvas);
NCRSReport.drawBody(canvas, arguments[0], arguments[1], arguments[2]);
const [side, at] = [canvas.width, arguments[3]];
canvas.remove();
return [...canvas.getContext('2d').getImageData(side * at[0], side * at[1], 1, 1).data].slice(0, 3);
"""


@pytest.mark.parametrize("value", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("character", ["L", "T", "W"])
def test_cells_have_the_renderers_colours(page, character, value):
    page.open()
    body = np.zeros((5, 5), dtype=np.int8)
    body[2, 2] = CELL_CHARACTERS[character]
    values = np.full((5, 5), value)
    gas = value - 0.5
    drawn = draw_body(body, 600, sensor_values=values, action=np.full((5, 5), gas))
    # In the middle of the robot: a sensor's value, or the bar of a wheel that drives backward.
    place = (300, 300) if gas < 0 or character != "W" else (285, 300)
    text = body_to_characters(body).replace("\n", "")
    # The page leaves less margin around the body.
    at = [0.5 + (pixel / 600 - 0.5) * 6.0 / 5.6 for pixel in place]
    shown = page.js(PIXEL, text, values.ravel().tolist(), [gas] * 25, at)
    np.testing.assert_allclose(shown, drawn[place[1], place[0]], atol=2)


def test_channels_have_one_colour_scale(page):
    page.open()
    page.shown()
    assert page.find(".card .scale").text.split("\n") == ["−2 or less", "2 or more"]
    for value in (-9.0, -2.0, -1.0, 0.0, 2.0, 9.0):
        (red, green, blue) = ramp(np.array(value), -SIGNED_LIMIT, SIGNED_LIMIT, SIGNED).tolist()
        assert page.js("return NCRSReport.signedColor(arguments[0])", value) == (
            f"rgb({red}, {green}, {blue})"
        )
