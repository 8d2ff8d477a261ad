"""The page in Chromium: robots grow and drive, and hands, keys, files and links change them."""

import json
import time

import numpy as np
import pytest

import ncrs
from ncrs.live.build import write_page
from ncrs.live.robots import LiveRobot
from ncrs.runs.champion import Champion
from ncrs_envs.tasks import TaskSettings
from tests.browser import Page

from selenium.webdriver.common.action_chains import ActionChains  # isort: skip
from selenium.webdriver.common.keys import Keys  # isort: skip

HOSTILE = "</script><img src=x onerror=window.hit=1>\"'&\u2028"
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


@pytest.mark.parametrize("before", [pytest.param(0, marks=pytest.mark.slow), 12])
def test_a_link_restores_the_very_moment(live, before):
    choose(live, "obstacle/best")
    if before:
        grown(live)
        steps(live, before)
        live.js("NCRSLive.app.session.setCell(22, 0); NCRSLive.app.addWall([-50, 30], [-20, 40])")
        steps(live, 5)
    else:
        live.js("NCRSLive.app.play(false); NCRSLive.app.step(); NCRSLive.app.step();")
    link = live.driver.execute_async_script(
        "NCRSLive.encode(NCRSLive.snapshot(NCRSLive.app)).then(arguments[0])"
    )
    saved = state(live)
    later = grown(live) if not before else steps(live, 40)
    live.open(fragment=link)
    assert state(live) == saved
    assert live.js("return NCRSLive.app.robot.id") == "obstacle/best"
    assert (grown(live) if not before else steps(live, 40)) == later


@pytest.mark.slow
@pytest.mark.parametrize(
    "link",
    ["#z=AAAA", "#j=bm90IGpzb24", "#j=e30", "#j=eyJ2ZXJzaW9uIjoxLCJyb2JvdCI6eyJpZCI6IngifX0"],
)
def test_bad_links_are_refused_in_words(live, link):
    live.open(fragment=link)
    assert live.find("#problem").text.startswith("The link cannot be used: ")
    assert state(live)["phase"] == "growing"


@pytest.mark.slow
@pytest.mark.parametrize(
    "damage",
    [
        "saved.counters.step = '<img src=x onerror=window.hit=1>'",
        "saved.state = { ...saved.state, x: { odd: 'toString' } }",
        "saved.state = { ...saved.state, x: { odd: 'NaN' } }",
        "saved.body[0] = 7",
        "saved.scenario.walls = [[[0, 0], [1, 0], [1, 1], [0, 1e300]]]",
        "saved.gridSize = 'constructor'",
        "saved.brain = saved.brain.slice(4)",
        "saved.robot = { id: '__proto__' }",
    ],
)
def test_damaged_states_are_refused_in_words(live, damage):
    grown(live)
    steps(live, 3)
    link = live.driver.execute_async_script(f"""
    const saved = structuredClone({{ ...NCRSLive.snapshot(NCRSLive.app) }}), [done] = arguments;
    {damage};
    NCRSLive.encode(saved).then(done);
    """)
    live.open(fragment=link)
    assert live.find("#problem").text.startswith("The link cannot be used: ")
    assert live.js("return window.hit") is None
    assert state(live)["phase"] == "growing"


def dropped(page, path):
    page.find("#file").send_keys(str(path))
    page.wait(lambda: page.js("return document.getElementById('file').files.length === 0"))
    time.sleep(0.3)


def save_npy(path, genome):
    np.save(path, genome)


def save_foreign_npz(path, genome):
    np.savez_compressed(path, genome=genome.astype(np.float64))


def save_champion(path, genome):
    champion = ncrs.load_champion("carry_ball/best")
    Champion(
        champion.genome, champion.body, TaskSettings("carry_ball"), 0.5, 0.07, 3, "sample"
    ).save(path)


def save_json(path, genome):
    record = {"task": "obstacle", "grid_size": 5, "fitness": 0.3, "genome": genome.tolist()}
    path.write_text(json.dumps(record))


@pytest.mark.parametrize(
    ("name", "save", "task"),
    [
        pytest.param("a.npy", save_npy, "light_chase", marks=pytest.mark.slow),
        pytest.param("b.npz", save_foreign_npz, "light_chase", marks=pytest.mark.slow),
        ("c.npz", save_champion, "carry_ball"),
        ("d.json", save_json, "obstacle"),
    ],
)
def test_genomes_from_files_live(live, tmp_path, name, save, task):
    genome = ncrs.load_champion("light_chase/best").genome
    save(tmp_path / name, genome)
    dropped(live, tmp_path / name)
    live.wait(lambda: live.find("#robot-title").text == name[0])
    assert live.js("return NCRSLive.app.robot.task") == task
    wanted = ncrs.load_champion("carry_ball/best").genome if task == "carry_ball" else genome
    assert live.js("return Array.from(NCRSLive.app.session.genome)") == wanted.tolist()
    assert grown(live)["phase"] == "driving"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("a.txt", b"x", "give a .npz, .npy or .json"),
        ("a.npy", b"x" * 40, "not a numpy file"),
        ("a.npz", b"PK\x05\x06", "not a whole zip file"),
        ("a.json", b"{", "not valid JSON"),
        ("a.json", b'{"genome": [1, 2]}', "4572 or 4873 weights, this one 2"),
        ("a.json", b'{"genome": {}}', "lacks the list"),
    ],
)
def test_foreign_files_are_refused_in_words(live, tmp_path, name, content, reason):
    (tmp_path / name).write_bytes(content)
    dropped(live, tmp_path / name)
    live.wait(lambda: live.find("#problem").is_displayed())
    assert reason in live.find("#problem").text


@pytest.mark.slow
def test_weights_that_are_not_finite_are_refused(live, tmp_path):
    genome = ncrs.load_champion("light_chase/best").genome.copy()
    genome[7] = np.nan
    np.save(tmp_path / "nan.npy", genome)
    dropped(live, tmp_path / "nan.npy")
    live.wait(lambda: "finite" in live.find("#problem").text)
    path = tmp_path / "cut.npz"
    save_champion(path, genome)
    path.write_bytes(path.read_bytes().replace(genome[1000:1001].tobytes(), b"\0\0\0\0"))
    whole = bytearray(path.read_bytes())
    whole[5000] ^= 1
    path.write_bytes(bytes(whole))
    dropped(live, path)
    live.wait(lambda: "checksum" in live.find("#problem").text)


def test_hostile_names_are_data(chromium, tmp_path):
    champion = ncrs.load_champion("light_chase/best")
    robot = Champion(champion.genome, champion.body, champion.task, 0.5, 0.5, 1, HOSTILE)
    object.__setattr__(robot, "name", HOSTILE)
    page = Page(chromium, tmp_path / "live.html")
    write_page(page.path, [LiveRobot(robot, float("nan"), float("nan"), 0, HOSTILE)])
    page.open()
    assert page.find("#robot-title").get_attribute("textContent") == HOSTILE
    assert HOSTILE.strip() in page.find("#robot-note").get_attribute("textContent")
    assert page.js("return document.querySelectorAll('img').length") == 0
    file = tmp_path / "<img src=x onerror=window.hit=1>.npy"
    np.save(file, champion.genome)
    dropped(page, file)
    page.wait(lambda: page.find("#robot-title").text == file.stem)
    (tmp_path / "<b>.json").write_text("{")
    dropped(page, tmp_path / "<b>.json")
    page.wait(lambda: "<b>.json" in page.find("#problem").text)
    assert page.js("return window.hit") is None


def test_the_policy_forbids_all_but_the_page(live):
    live.js("""
    window.broken = [];
    document.addEventListener('securitypolicyviolation', (e) => broken.push(e.effectiveDirective));
    const script = document.createElement('script');
    script.textContent = 'window.hit = 1';
    document.body.append(script);
    const image = document.createElement('img');
    image.src = 'https://example.org/x.png';
    document.body.append(image);
    const style = document.createElement('style');
    style.textContent = 'body { display: none }';
    document.body.append(style);
    fetch('https://example.org/').catch(() => {});
    """)
    wanted = {"connect-src", "img-src", "script-src-elem", "style-src-elem"}
    live.wait(lambda: set(live.js("return broken")) == wanted)
    assert live.js("return window.hit") is None


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
