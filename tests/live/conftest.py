"""The page of published champions, in Chromium."""

import pytest

from ncrs.live.build import write_page
from ncrs.live.robots import published_robots, robot_by_hand


@pytest.fixture(scope="session")
def live_file(tmp_path_factory):
    robots = [*published_robots(), robot_by_hand()]
    return write_page(tmp_path_factory.mktemp("live") / "live.html", robots).path


@pytest.fixture
def live(chromium, live_file):
    from tests.browser import Page

    page = Page(chromium, live_file)
    page.open()
    return page
