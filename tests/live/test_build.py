"""The page's text, its robots, and the command."""

import base64
import hashlib
import json
import re
import zlib
from dataclasses import replace

import numpy as np
import pytest

import ncrs
from ncrs.cli import main
from ncrs.live.build import GRID_SIZES, page_text
from ncrs.live.robots import LiveError, live_robot, published_robots, run_robots
from ncrs.runs.engine_settings import ConfigError
from tests.report.conftest import make_run

BEST = "light_chase/best"


def read(text):
    """The content of a page and its genomes."""
    stored = json.loads(re.search(r'id="data">(.*?)</script>', text)[1])
    inflate = lambda part: zlib.decompress(base64.b64decode(part), -zlib.MAX_WBITS)  # noqa: E731
    content = json.loads(inflate(stored["content"]))
    return content, np.frombuffer(inflate(stored["genomes"]), "<f4")


@pytest.fixture(scope="module")
def text():
    return page_text([live_robot(ncrs.load_champion(BEST))])


def test_a_dozen_champions_take_less_than_400_kb():
    robots = published_robots()
    assert len(robots) >= 12
    assert len(page_text(robots).encode()) < 400_000


def test_the_page_is_one_file(text):
    assert re.findall(r"""(?:src|href)=["'](?!#|data:,)([^"']*)""", text) == []
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)", text)
    assert re.search(r"@\w+@", text) is None


def test_its_policy_allows_its_own_scripts_and_style_alone(text):
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', text)[1]
    assert policy.startswith("default-src 'none'; ")
    assert "unsafe" not in policy
    parts = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
    parts += re.findall(r"<style>(.*?)</style>", text, re.DOTALL)
    digests = [hashlib.sha256(part.encode()).digest() for part in parts]
    found = re.findall(r"'sha256-([^']*)'", policy)
    assert [base64.b64encode(digest).decode() for digest in digests] == found


def test_it_holds_what_is_known_of_a_robot(text):
    content, genomes = read(text)
    champion = ncrs.load_champion(BEST)
    np.testing.assert_array_equal(genomes, champion.genome)
    (robot,) = content["robots"]
    test = champion.card["tests"]["box2d"]
    assert (robot["id"], robot["fitness"]) == (BEST, test["fitness"])
    assert (robot["success"], robot["episodes"]) == (test["success"]["fraction"], 1000)
    assert [list(sizes) for sizes in content["worlds"].values()] == [list(map(str, GRID_SIZES))] * 3


def test_courses_follow_from_the_seed():
    robots = [live_robot(ncrs.load_champion(BEST))]
    first, second, other = (read(page_text(robots, seed))[0]["worlds"] for seed in (0, 0, 1))
    assert first == second != other


def test_a_page_needs_a_robot_that_the_engine_can_run():
    with pytest.raises(LiveError, match="at least one"):
        page_text([])


def test_a_runs_champion_and_the_fittest_elites_of_all_sizes(tmp_path):
    run = make_run(tmp_path / "run")
    robots = run_robots(run, 6)
    assert len(robots) == 7
    assert robots[0].fitness == pytest.approx(0.51234)
    cells = [robot.robot.measures[2] for robot in robots[1:]]
    assert cells == sorted(cells)
    assert len(set(cells)) > 3
    assert all(robot.episodes == 12 for robot in robots[1:])
    assert len(run_robots(run, 0)) == 1
    assert len(run_robots(run, 1000)) == 46
    with pytest.raises(LiveError, match="0 or more, got -1"):
        run_robots(run, -1)
    with pytest.raises(ConfigError, match="neither"):
        run_robots(tmp_path)


def test_the_command_writes_a_runs_page_and_a_robots(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    run = make_run(tmp_path / "run", elites=3)
    main(["live", str(run), "--elites", "2"])
    content, _ = read((run / "live.html").read_text())
    assert len(content["robots"]) == 3
    assert "3 robots" in capsys.readouterr().out
    main(["live", BEST, "--output", "one"])
    content, _ = read((tmp_path / "one" / "live.html").read_text())
    assert [robot["id"] for robot in content["robots"]] == [BEST]
    with pytest.raises(SystemExit, match="2"):
        main(["live", "nowhere"])


def test_robots_of_other_settings_keep_them():
    champion = ncrs.load_champion(BEST)
    task = replace(champion.task, distance_score="inverse_square", success_radius=7.0)
    robot = live_robot(replace(champion, task=task))
    content, _ = read(page_text([robot]))
    assert content["robots"][0]["successRadius"] == 7.0
    assert content["worlds"]["light_chase"]["5"]["distanceScore"] == "inverse_square"
