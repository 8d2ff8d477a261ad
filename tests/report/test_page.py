"""The page in headless Chromium, with real clicks and keys: it shows the archive's numbers."""

import json
import shutil
import time

import numpy as np
import pytest

from ncrs.report import ReportOptions, build_report
from ncrs.runs.elites import load_archive
from tests.browser import Page

from selenium.webdriver.common.keys import Keys  # isort: skip
from selenium.webdriver.support.select import Select  # isort: skip


@pytest.fixture(scope="module")
def archive(run_dir):
    return load_archive(run_dir).archive


def counted(number, word):
    return f"{number} {word}{'' if number == 1 else 's'}"


def expected(archive, row):
    sensors, wheels, cells = archive.measures[row].tolist()
    title = ", ".join(
        [counted(sensors, "sensor"), counted(wheels, "wheel"), counted(cells, "cell")]
    )
    return title, {
        "fitness": f"{archive.column('fitness')[row]:.4f}",
        "success": f"{100 * archive.column('success')[row]:.0f} %",
        "episodes": "12 episodes",
        "generation": str(archive.column("generations")[row]),
    }


def test_page_opens_on_the_champion_without_errors(page):
    page.driver.get_log("browser")
    page.open()
    title, fields = page.shown()
    assert title == "2 sensors, 4 wheels, 9 cells"
    assert fields["fitness"] == "0.5123"
    assert fields["success"] == "25 %"
    assert fields["source"] == "sample"
    assert page.driver.get_log("browser") == []
    assert not page.find("#problem").is_displayed()


def test_clicked_cells_show_the_archives_numbers(page, archive):
    page.open()
    for row in (0, 7, 21, 40):
        page.click(page.cell(archive.measures[row]))
        page.wait(lambda: page.find(".card").get_attribute("data-shows") == str(row))  # noqa: B023
        assert page.shown() == expected(archive, row)
        selected = page.all('[aria-selected="true"]')
        assert [cell.get_attribute("data-robot") for cell in selected] == [str(row)]
        label = page.find(".card canvas").get_attribute("aria-label")
        body = archive.column("bodies")[row]
        grid = " ".join("".join(".#LTW"[code] for code in line) for line in body)
        assert label.endswith(grid)


def test_heatmap_has_a_cell_for_every_triple_coloured_by_fitness(page, archive):
    page.open()
    cells = page.js(
        "return [...document.querySelectorAll('[role=gridcell]')].map("
        "c => [c.dataset.measures, c.dataset.robot ?? null, c.style.background])"
    )
    assert len(cells) == 2300
    filled = {name: int(robot) for name, robot, _ in cells if robot is not None}
    assert filled == {"-".join(map(str, f)): i for i, f in enumerate(archive.measures.tolist())}
    colors = {int(robot): color for _, robot, color in cells if robot is not None}
    fitness = archive.column("fitness")
    assert colors[int(fitness.argmax())] == "rgb(253, 231, 37)"
    assert colors[int(fitness.argmin())] == "rgb(68, 1, 84)"
    assert all(not color for _, robot, color in cells if robot is None)
    legend = page.find("#legend").text
    assert f"{fitness.min():.4f}" in legend
    assert f"{fitness.max():.4f}" in legend
    Select(page.find("#colour-by")).select_by_value("success")
    assert page.find("#legend .high").text == "100 %"


def test_archive_by_keyboard(page, archive):
    page.open()
    best = int(archive.column("fitness").argmax())
    sensors, wheels, cells = archive.measures[best].tolist()
    page.find("#find button").send_keys(Keys.TAB)
    focused = lambda: page.js("return document.activeElement.dataset.measures")  # noqa: E731
    assert focused() == f"{sensors}-{wheels}-{cells}"
    outline = page.js("return getComputedStyle(document.activeElement).outlineWidth")
    assert outline == "3px"
    page.press(Keys.ENTER)
    page.wait(lambda: page.find(".card").get_attribute("data-shows") == str(best))
    assert page.shown() == expected(archive, best)
    page.press(Keys.PAGE_UP)
    assert focused() == f"{sensors}-{wheels}-{cells + 1}"
    page.press(Keys.ARROW_RIGHT)
    assert focused() == f"{sensors + 1}-{wheels}-{cells + 1}"
    page.press(Keys.ARROW_LEFT, Keys.PAGE_DOWN)
    assert focused() == f"{sensors}-{wheels}-{cells}"
    page.press(Keys.HOME)
    assert focused() == f"1-{wheels}-{cells}"
    page.press(Keys.ARROW_LEFT)
    assert focused() == f"1-{wheels}-{cells}"
    page.press(Keys.TAB)
    assert focused() is None  # one stop for the whole archive


def test_finding_by_numbers(page, archive):
    page.open()
    for name, value in zip(("sensors", "wheels", "cells"), archive.measures[3], strict=True):
        page.find(f"#find [name={name}]").send_keys(str(value))
    page.press(Keys.ENTER)
    page.wait(lambda: page.find(".card").get_attribute("data-shows") == "3")
    assert page.shown() == expected(archive, 3)
    page.find("#find [name=cells]").send_keys("99")
    page.press(Keys.ENTER)
    assert "No body of this task can have" in page.find("#cell-info").text


@pytest.mark.slow
def test_playing_scrubbing_and_growth(page):
    page.open()
    page.shown()
    scrubber, play = page.find(".scrubber"), page.find(".play")
    step = lambda: int(scrubber.get_property("value"))  # noqa: E731
    picture = lambda: page.js("return document.querySelector('.stage').toDataURL()")  # noqa: E731
    assert step() == 0
    first = picture()
    # At the slowest speed the episode does not end before the click, even on a busy machine.
    Select(page.find("[aria-label='Speed']")).select_by_index(0)
    page.click(play)
    page.wait(lambda: step() > 3)
    page.click(play)
    stopped = step()
    assert play.text == "Play"
    assert picture() != first
    time.sleep(0.3)
    assert step() == stopped
    page.click(page.find("[aria-label='One step on']"))
    assert step() == stopped + 1
    assert page.find(".readout").text.startswith(f"Step {stopped + 1} of 100, ")
    scrubber.send_keys(Keys.END)
    assert step() == 100
    assert page.find(".readout").text.startswith("Step 100 of 100, 2.00 s")
    Select(page.find(".episode")).select_by_index(1)
    assert step() == 0
    assert "Channels at the end of episode 2" in page.find(".card").text
    growth = page.find(".growth-step")
    growth.send_keys(Keys.HOME)
    assert page.find(".growth output").text == "seed"
    grow = page.find(".growth button")
    page.click(grow)
    page.wait(lambda: grow.text == "Grow" and page.find(".growth output").text == "step 10 of 10")


def test_shown_numbers_of_an_episode_are_those_recorded(page, report, read_data, archive):
    page.open(fragment=f"#show={'-'.join(map(str, archive.measures[2].tolist()))}")
    assert page.shown() == expected(archive, 2)
    episode = read_data(report.page.parent, "robots-0")[2][2]["episodes"][0]
    result = (
        "no success" if episode["successStep"] < 0 else f"success at step {episode['successStep']}"
    )
    text = f"Fitness in this episode {episode['fitness']:.4f}, {result}."
    assert page.find(".outcome").text == text


@pytest.mark.slow
def test_two_elites_side_by_side(page, archive):
    page.open(width=1600)
    page.click(page.cell(archive.measures[5]))
    page.wait(lambda: page.find(".card").get_attribute("data-shows") == "5")
    page.click(page.find(".compare"))
    page.click(page.cell(archive.measures[30]))
    page.wait(lambda: len(page.all(".card[data-ready]")) == 2)
    assert page.shown(0) == expected(archive, 5)
    assert page.shown(1) == expected(archive, 30)
    left, right = (card.rect for card in page.all(".card"))
    assert left["y"] == right["y"]
    assert left["x"] + left["width"] <= right["x"]
    page.click(page.find("#play-both"))
    page.wait(lambda: all(int(s.get_property("value")) > 2 for s in page.all(".scrubber")))
    names = "+".join("-".join(map(str, archive.measures[row].tolist())) for row in (5, 30))
    assert page.driver.current_url.endswith("#show=" + names)
    page.click(page.all(".close")[0])
    assert page.shown() == expected(archive, 30)
    assert len(page.all(".card")) == 1


def test_downloaded_genomes_are_exact(page, archive, tmp_path):
    page.driver.execute_cdp_cmd(
        "Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(tmp_path)}
    )
    name = "-".join(map(str, archive.measures[11].tolist()))
    page.open(fragment=f"#show={name}")
    page.shown()
    genome = archive.column("genomes")[11]
    for kind in ("npy", "json"):
        page.click(page.find(f".download-{kind}"))
        path = tmp_path / f"light_chase_{name}.{kind}"
        page.wait(path.is_file)
    loaded = np.load(tmp_path / f"light_chase_{name}.npy", allow_pickle=False)
    assert loaded.dtype == np.float32
    np.testing.assert_array_equal(loaded, genome)
    record = json.loads((tmp_path / f"light_chase_{name}.json").read_text())
    np.testing.assert_array_equal(np.array(record["genome"], dtype=np.float32), genome)
    assert record["measures"] == archive.measures[11].tolist()
    assert record["fitness"] == archive.column("fitness")[11]


def requests(driver):
    """Addresses that the browser has asked for since the last call."""
    messages = [json.loads(entry["message"])["message"] for entry in driver.get_log("performance")]
    return [
        message["params"]["request"]["url"]
        for message in messages
        if message["method"] == "Network.requestWillBeSent"
    ]


def test_nothing_is_fetched_from_elsewhere_and_data_only_when_needed(page, archive):
    requests(page.driver)
    page.open()
    page.shown()
    opening = requests(page.driver)
    # The champion comes last, after 45 elites, in the third file.
    assert [url.rsplit("/", 1)[1] for url in opening if "/data/" in url] == [
        "overview.js",
        "robots-2.js",
    ]
    for row in (0, 1, 44):
        page.click(page.cell(archive.measures[row]))
        page.wait(lambda: page.find(".card").get_attribute("data-shows") == str(row))  # noqa: B023
        page.shown()
    page.click(page.find(".download-json"))
    page.wait(lambda: page.js("return NCRSReport.genome(44).then(raw => raw.length)") > 0)
    later = requests(page.driver)
    names = [url.rsplit("/", 1)[1] for url in later if "/data/" in url]
    assert names == ["robots-0.js", "genomes-2.js"]
    folder = page.path.parent.as_uri()
    # The browser's own new tab page may still be loading when the first test begins.
    local = (folder, "data:", "about:", "blob:", "chrome://")
    assert [url for url in opening + later if not url.startswith(local)] == []
    assert page.js("return performance.getEntriesByType('resource').length") == 0


@pytest.mark.parametrize(
    "width",
    [320, 1440, *(pytest.param(width, marks=pytest.mark.slow) for width in (375, 768, 1120))],
)
def test_nothing_is_cut_off_at_any_width(page, archive, width):
    page.open(width=width, height=800)
    page.shown()
    overflow = "return document.documentElement.scrollWidth - window.innerWidth"
    assert page.js(overflow) <= 0
    # Real clicks have tests of their own; here only the layout matters.
    page.js("arguments[0].click()", page.find(".compare"))
    page.js("arguments[0].click()", page.cell(archive.measures[8]))
    page.wait(lambda: len(page.all(".card[data-ready]")) == 2)
    assert page.js(overflow) <= 0


def test_phone_goes_to_the_robot_and_back(page, archive):
    page.open(width=375, height=700)
    page.shown()
    page.click(page.cell(archive.measures[8]))
    page.wait(lambda: page.js("return document.activeElement.id") == "robots")
    page.wait(lambda: 0 <= page.find("#robots").rect["y"] - page.js("return scrollY") < 60)
    page.click(page.find(".back"))
    name = "-".join(map(str, archive.measures[8].tolist()))
    assert page.js("return document.activeElement.dataset.measures") == name


def test_dark_scheme_and_contrast(page):
    seen = []
    for scheme in ("light", "dark"):
        page.driver.execute_cdp_cmd(
            "Emulation.setEmulatedMedia",
            {"features": [{"name": "prefers-color-scheme", "value": scheme}]},
        )
        page.open()
        colors = page.js(
            "const s = getComputedStyle(document.body), q = getComputedStyle("
            "document.querySelector('.quiet')); return [s.backgroundColor, s.color, q.color]"
        )
        ground, text, quiet = (
            [int(v) for v in c[c.index("(") + 1 : -1].split(",")[:3]] for c in colors
        )
        assert contrast(ground, text) > 7
        assert contrast(ground, quiet) > 4.5
        seen.append(ground)
    page.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
    assert sum(seen[0]) > 600 > 200 > sum(seen[1])


def contrast(one, other):
    """Contrast ratio of two sRGB colours as accessibility guidelines define it."""

    def luminance(rgb):
        share = np.array(rgb) / 255
        linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
        return linear @ [0.2126, 0.7152, 0.0722]

    low, high = sorted([luminance(one), luminance(other)])
    return (high + 0.05) / (low + 0.05)


def test_missing_data_file_is_said(page, tmp_path):
    folder = tmp_path / "page"
    shutil.copytree(page.path.parent, folder)
    for path in (folder / "data").glob("robots-*.js"):
        path.unlink()
    Page(page.driver, folder / "index.html").open()
    page.wait(lambda: page.find("#problem").is_displayed())
    assert "is missing" in page.find("#problem").text
    page.driver.get_log("browser")


@pytest.mark.parametrize(("task", "grid_size"), [("obstacle", 5), ("carry_ball", 7)])
def test_page_of_a_champion_alone(chromium, small_run, tmp_path, task, grid_size):
    run = small_run(tmp_path / "run", task, elites=0, grid_size=grid_size)
    report = build_report(run, options=ReportOptions(episodes=1))
    page = Page(chromium, report.page.resolve())
    chromium.get_log("browser")
    page.open()
    _, fields = page.shown()
    assert fields["fitness"] == "0.5123"
    assert page.all(".compare") == []
    page.click(page.find(".play"))
    page.wait(lambda: int(page.find(".scrubber").get_property("value")) > 3)
    assert chromium.get_log("browser") == []


def test_elites_without_records_show_their_numbers(chromium, run_dir, archive, tmp_path):
    report = build_report(run_dir, tmp_path / "page", ReportOptions(elites="champion", episodes=1))
    page = Page(chromium, report.page.resolve())
    page.open()
    page.click(page.cell(archive.measures[4]))
    page.wait(lambda: "not in this report" in page.find(".card").text)
    assert page.find(".card [data-field=fitness]").text == expected(archive, 4)[1]["fitness"]
    assert page.all(".play, .download-npy") == []
    page.click(page.find("#show-champion"))
    page.wait(lambda: page.all(".play"))
    assert page.find(".card [data-field=fitness]").text == "0.5123"


def test_live_runs_the_robot_on_show_in_the_course_on_show(page, archive):
    page.open()
    page.click(page.cell(archive.measures[7]))
    page.shown()
    Select(page.find(".card .episode")).select_by_value("1")
    page.click(page.find(".open-live"))
    page.driver.switch_to.frame(page.find("dialog iframe"))
    page.wait(lambda: page.js("return document.body.dataset.ready === 'true'"))
    title, genome, light = page.js("""
    const { robot, session } = NCRSLive.app;
    return [robot.title, Array.from(session.genome), session.scenario.light];
    """)
    shown = page.js("return document.body.classList.contains('is-framed')")
    page.driver.switch_to.default_content()
    assert shown
    assert title == expected(archive, 7)[0]
    np.testing.assert_array_equal(np.float32(genome), archive.column("genomes")[7])
    assert light == page.js("return NCRSReport.overview.world.scenarios[1].light")
    page.click(page.find(".close-live"))
    page.wait(lambda: not page.all("dialog"))
