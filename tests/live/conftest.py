"""The page of published champions, in Chromium."""

import pytest

from ncrs.live.build import write_page
from ncrs.live.robots import published_robots


@pytest.fixture(scope="session")
def live_file(tmp_path_factory):
    return write_page(tmp_path_factory.mktemp("live") / "live.html", published_robots()).path


@pytest.fixture
def live(chromium, live_file):
    from tests.browser import Page

    page = Page(chromium, live_file)
    page.open()
    return page
