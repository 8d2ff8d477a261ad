"""A page in headless Chromium, for the tests of reports and of live robots."""

import time

import pytest

pytest.importorskip("selenium.webdriver", reason="selenium is not installed")

from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

from benchmarks.browser import resize

WAIT_S = 30
SETTLE_S = 0.1
# Scrolls to an element; its centre, or null while something else is there.
_PLACE = """
const element = arguments[0];
element.scrollIntoView({block: 'center', behavior: 'instant'});
const box = element.getBoundingClientRect();
const x = box.x + box.width / 2, y = box.y + box.height / 2;
const there = document.elementFromPoint(x, y);
return there && (element.contains(there) || there.contains(element)) ? [x, y, scrollY] : null;
"""


class Page:
    """A page in the browser."""

    def __init__(self, driver, path):
        self.driver = driver
        self.path = path

    def open(self, width=1440, height=900, fragment=""):
        self.driver.get("about:blank")
        resize(self.driver, width, height)
        self.driver.get(self.path.as_uri() + fragment)
        self.wait(lambda: self.js("return document.body.dataset.ready === 'true'"))

    def js(self, script, *arguments):
        return self.driver.execute_script(script, *arguments)

    def wait(self, condition):
        WebDriverWait(self.driver, WAIT_S, 0.05).until(lambda _: condition())

    def find(self, css):
        """Return the first such element, once there is one: pages make some after a click."""
        self.wait(lambda: self.all(css))
        return self.all(css)[0]

    def all(self, css):
        return self.driver.find_elements(By.CSS_SELECTOR, css)

    def cell(self, measures):
        return self.find(f'[data-measures="{"-".join(map(str, measures))}"]')

    def click(self, element):
        self.wait(lambda: self._is_settled(element))
        ActionChains(self.driver).move_to_element(element).click().perform()

    def _is_settled(self, element):
        """True if the element rests in view, uncovered: parts that load late move the page."""
        places = []
        for _ in range(2):
            places.append(self.js(_PLACE, element))
            time.sleep(SETTLE_S)
        return places[0] is not None and places[0] == places[1]

    def press(self, *keys):
        ActionChains(self.driver).send_keys(*keys).perform()

    def shown(self, place=0):
        """Title and numbers of a card that is complete."""
        self.wait(lambda: len(self.all(".card[data-ready]")) > place)
        card = self.all(".card")[place]
        fields = {
            field.get_attribute("data-field"): field.text
            for field in card.find_elements(By.CSS_SELECTOR, "[data-field]")
        }
        return card.find_element(By.TAG_NAME, "h3").text, fields
