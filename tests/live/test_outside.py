"""What comes into the page from outside, links and files, is data that is checked, never markup."""

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
from tests.live.hands import choose, grown, state, steps

HOSTILE = "</script><img src=x onerror=window.hit=1>\"'&\u2028"


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
