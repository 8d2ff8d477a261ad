"""The report's data against the archive, the environments and the automaton in torch."""

import dataclasses
import errno
import json
import os
import re
import shutil

import gymnasium
import numpy as np
import pytest

import ncrs
import ncrs.report.build
from ncrs.cli import main
from ncrs.report import ReportError, ReportOptions, build_report
from ncrs.report.build import CHUNK
from ncrs.runs.champion import load_champion_file
from ncrs.runs.checkpoint import CheckpointError
from ncrs.runs.elites import ARCHIVE_FILE, load_archive
from ncrs.runs.engine_settings import ConfigError
from ncrs_envs.body import body_to_characters, sensor_mask, wheel_mask
from ncrs_envs.scenario import sample_scenarios

EPISODES = 2  # as the fixtures have it
CHAMPION_ALONE = ReportOptions(elites="champion", episodes=1)


@pytest.fixture(scope="module")
def overview(report, read_data):
    return read_data(report.page.parent, "overview")[2]


def test_table_is_the_archive_and_the_champion(run_dir, report, overview):
    archive = load_archive(run_dir).archive
    champion = load_champion_file(run_dir)
    table = overview["robots"]
    assert report.robots == report.recorded == len(archive) + 1
    assert table["elites"] == table["champion"] == len(archive)
    assert table["measures"][:-1] == archive.measures.tolist()
    assert table["fitness"] == [*archive.column("fitness").tolist(), champion.fitness]
    assert table["success"] == [*archive.column("success").tolist(), champion.success]
    assert table["generation"] == [*archive.column("generations").tolist(), 9]
    bodies = [*archive.column("bodies"), champion.body]
    assert table["body"] == [body_to_characters(body).replace("\n", "") for body in bodies]
    assert table["space"] == [1, 2, 25]


def test_curves_and_facts_come_from_the_table_of_metrics(report, overview):
    fitness = overview["charts"][0]
    assert fitness["title"] == "Fitness"
    assert fitness["lines"][0]["x"] == list(range(10))
    np.testing.assert_allclose(fitness["lines"][0]["y"], 0.3 + 0.01 * np.arange(10))
    page = report.page.read_text()
    assert re.search(r"<dt>Evaluations</dt><dd>640</dd>", page)
    assert re.search(r"<dt>Generations</dt><dd>10</dd>", page)


def test_every_genome_can_be_read_back_exactly(run_dir, report, read_data, values):
    archive = load_archive(run_dir).archive
    expected = [*archive.column("genomes"), load_champion_file(run_dir).genome]
    for index in range(-(-len(expected) // CHUNK)):
        kind, number, genomes = read_data(report.page.parent, f"genomes-{index}")
        assert (kind, number) == ("genomes", index)
        for offset, genome in enumerate(genomes):
            np.testing.assert_array_equal(
                values(genome, np.float32), expected[index * CHUNK + offset]
            )


def test_growth_is_the_automatons(run_dir, report, overview, read_data, values):
    archive = load_archive(run_dir).archive
    records = read_data(report.page.parent, "robots-0")[2]
    for row in (0, 5):
        nca = ncrs.NCA("light_chase").set_genome(archive.column("genomes")[row])
        body, states = ncrs.grow(nca, history=True)
        stored = values(records[row]["states"], np.int8, overview["limits"]["state"])
        stored = np.moveaxis(stored.reshape(11, 12, 5, 5), 1, -1)
        np.testing.assert_allclose(stored[1:], states, atol=0.51 * 5 / 127 + 1e-6)
        assert stored[0].sum() == pytest.approx(1.0, abs=0.02)
        grown = values(records[row]["bodies"], np.uint8).reshape(11, 5, 5)
        np.testing.assert_array_equal(grown[-1], body)


@pytest.mark.parametrize("task", ["light_chase", "obstacle", "carry_ball"])
def test_episodes_are_those_of_the_environment(tmp_path, task, read_data, values, small_run):
    run = small_run(tmp_path / task, task, elites=3)
    report = build_report(run, options=ReportOptions(episodes=EPISODES))
    overview = read_data(report.page.parent, "overview")[2]
    records = read_data(report.page.parent, "robots-0")[2]
    archive = load_archive(run).archive
    scenarios = sample_scenarios(task, np.random.SeedSequence(0, spawn_key=(6,)), EPISODES)
    body = archive.column("bodies")[1]
    nca = ncrs.NCA(task).set_genome(archive.column("genomes")[1])
    title = overview["world"]["title"]
    envs = gymnasium.make_vec(
        f"ncrs_envs:NCRS-{title}-v0", num_envs=EPISODES, body=np.stack([body] * EPISODES)
    )
    observations, infos = envs.reset(options={"scenario": scenarios})
    controller = ncrs.Controller(nca, np.stack([body] * EPISODES))
    poses, sensed, gas, rewards = [infos["pose"]], [observations], [], []
    for _ in range(100):
        actions = controller.act(observations)
        observations, reward, _, _, infos = envs.step(actions)
        poses.append(infos["pose"])
        sensed.append(observations)
        gas.append(np.clip(actions, -1.0, 1.0))
        rewards.append(reward)
    limits = overview["limits"]
    for index in range(EPISODES):
        episode = records[1]["episodes"][index]
        position = values(episode["position"], np.int16, limits["position"]).reshape(101, 2)
        angle = values(episode["angle"], np.int16, limits["angle"])
        pose = np.stack(poses)[:, index]
        np.testing.assert_allclose(position, pose[:, :2], atol=0.02)
        turned = np.angle(np.exp(1j * (angle - pose[:, 2])))
        np.testing.assert_allclose(turned, 0.0, atol=1e-3)
        shown = values(episode["sensors"], np.uint8, 1.0).reshape(101, -1)
        np.testing.assert_allclose(
            shown, np.stack(sensed)[:, index][:, sensor_mask(body)], atol=3e-3
        )
        driven = values(episode["gas"], np.int8, 1.0).reshape(101, -1)
        assert (driven[0] == 0).all()
        np.testing.assert_allclose(
            driven[1:], np.stack(gas)[:, index][:, wheel_mask(body)], atol=6e-3
        )
        assert episode["fitness"] == pytest.approx(np.mean(rewards, axis=0)[index], abs=1e-4)
        control = values(episode["control"], np.int8, limits["state"]).reshape(-1, 5, 5)
        expected = np.moveaxis(controller.states[index], -1, 0)
        np.testing.assert_allclose(control, expected, atol=0.03)
        assert ("ball" in episode) == (task == "carry_ball")
        assert bool(overview["world"]["scenarios"][index]["walls"]) == (task == "obstacle")


def test_report_does_not_depend_on_how_robots_are_batched(run_dir, report, tmp_path, monkeypatch):
    monkeypatch.setattr("ncrs.report.build._BATCH", CHUNK)
    other = build_report(run_dir, tmp_path / "other", ReportOptions(episodes=EPISODES))
    for path in sorted((report.page.parent / "data").iterdir()):
        assert (other.page.parent / "data" / path.name).read_text() == path.read_text()


def test_champion_alone_is_recorded_when_asked(run_dir, tmp_path, read_data):
    report = build_report(run_dir, tmp_path / "page", ReportOptions(elites="champion", episodes=1))
    assert report.recorded == 1
    overview = read_data(report.page.parent, "overview")[2]
    assert overview["records"]["first"] == overview["robots"]["champion"] == report.robots - 1
    assert len(read_data(report.page.parent, "robots-0")[2]) == 1
    assert not (report.page.parent / "data" / "robots-1.js").exists()


def test_run_without_archive_or_without_champion(tmp_path, read_data, small_run):
    options = ReportOptions(episodes=1)
    alone = build_report(small_run(tmp_path / "alone", elites=0), options=options)
    assert alone.robots == 1
    assert 'id="panels"' not in alone.page.read_text()
    run = small_run(tmp_path / "elites", elites=2, with_champion=False)
    elites = build_report(run, options=options)
    assert read_data(elites.page.parent, "overview")[2]["robots"]["champion"] is None


def test_page_names_nothing_on_the_network(report):
    for path in report.page.parent.iterdir():
        if path.is_file():
            text = path.read_text().replace("http://www.w3.org/2000/svg", "")
            assert not re.search(r"https?://|//[a-z]+\.|fetch\(|XMLHttpRequest|import\(", text), (
                path
            )


def test_text_of_a_run_is_not_read_as_html(tmp_path, small_run):
    run = small_run(tmp_path / "<b>x&y", elites=2)
    page = build_report(run, tmp_path / "page", ReportOptions(episodes=1)).page.read_text()
    assert "&lt;b&gt;x&amp;y" in page
    assert "<b>x" not in page


def test_bad_input_is_one_clear_sentence(tmp_path, run_dir, capsys, small_run):
    with pytest.raises(ConfigError, match=r"holds no run"):
        build_report(tmp_path)
    unfinished = small_run(tmp_path / "unfinished", elites=0, with_champion=False)
    with pytest.raises(ConfigError, match=r"holds neither archive.npz nor champion.npz"):
        build_report(unfinished)
    elites = small_run(tmp_path / "elites", elites=2, with_champion=False)
    with pytest.raises(ReportError, match="has no champion yet"):
        build_report(elites, options=ReportOptions(elites="champion"))
    with pytest.raises(ReportError, match="elites must be 'all' or 'champion'"):
        build_report(run_dir, options=ReportOptions(elites="best"))
    with pytest.raises(SystemExit) as stop:
        main(["report", str(run_dir), "--episodes", "0", "--output", str(tmp_path / "page")])
    assert stop.value.code == 2
    assert "positive integer" in capsys.readouterr().err
    other = small_run(tmp_path / "other", "carry_ball", elites=2, with_champion=False)
    (elites / ARCHIVE_FILE).replace(run_dir.parent / "kept.npz")
    archive = load_archive(other)
    dataclasses.replace(archive).save(elites / ARCHIVE_FILE)
    small_run(elites, elites=0)
    with pytest.raises(ReportError, match="both must be of the same run"):
        build_report(elites)


def test_nothing_but_a_report_is_written_over(run_dir, tmp_path, capsys):
    precious = tmp_path / "precious"
    precious.mkdir()
    (precious / "thesis.txt").write_text("years of work")
    with pytest.raises(ReportError, match="is not a report"):
        build_report(run_dir, precious, ReportOptions(elites="champion", episodes=1))
    assert (precious / "thesis.txt").read_text() == "years of work"
    page = tmp_path / "page"
    for _ in range(2):
        main(["report", str(run_dir), "--output", str(page), "--elites", "champion"])
        assert (page / "index.html").is_file()
    assert "with growth and episodes" in capsys.readouterr().out
    assert sorted(path.name for path in tmp_path.iterdir()) == ["page", "precious"]


@pytest.fixture
def page(run_dir, tmp_path):
    folder = tmp_path / "page"
    build_report(run_dir, folder, CHAMPION_ALONE)
    return folder


def test_files_beside_a_report_stay(run_dir, page):
    (page / "notes.txt").write_text("mine")
    (page / "data" / "own.js").write_text("mine")
    stale = page / "data" / "robots-7.js"
    stale.write_text("of an older, larger report")
    manifest = json.loads((page / "manifest.json").read_text())
    manifest["files"].append("data/robots-7.js")
    (page / "manifest.json").write_text(json.dumps(manifest))
    build_report(run_dir, page, CHAMPION_ALONE)
    assert (page / "notes.txt").read_text() == (page / "data" / "own.js").read_text() == "mine"
    assert not stale.exists()
    assert set(json.loads((page / "manifest.json").read_text())["files"]) == {
        path.relative_to(page).as_posix()
        for path in page.rglob("*")
        if path.is_file() and path.name not in ("manifest.json", "notes.txt", "own.js")
    }


def test_what_merely_looks_like_a_report_is_left_alone(run_dir, page):
    (page / "manifest.json").unlink()
    before = {path: path.read_bytes() for path in page.rglob("*") if path.is_file()}
    with pytest.raises(ReportError, match="is not a report"):
        build_report(run_dir, page, CHAMPION_ALONE)
    (page / "manifest.json").write_text('{"files": ["../outside.txt"]}')
    with pytest.raises(ReportError, match="is not a report"):
        build_report(run_dir, page, CHAMPION_ALONE)
    assert {path: path.read_bytes() for path in before} == before


def test_links_are_not_followed(run_dir, page, tmp_path):
    outside = tmp_path / "outside"
    shutil.copytree(page / "data", outside)
    shutil.rmtree(page / "data")
    (page / "data").symlink_to(outside)
    before = {path: path.read_bytes() for path in outside.iterdir()}
    with pytest.raises(ReportError, match="is a link"):
        build_report(run_dir, page, CHAMPION_ALONE)
    assert {path: path.read_bytes() for path in outside.iterdir()} == before
    (tmp_path / "link").symlink_to(page)
    with pytest.raises(ReportError, match="is a link; give the folder itself"):
        build_report(run_dir, tmp_path / "link", CHAMPION_ALONE)


def test_a_full_disk_leaves_the_older_report(run_dir, page, monkeypatch, tmp_path):
    def full(*arguments):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    before = {path: path.read_bytes() for path in page.rglob("*") if path.is_file()}
    (tmp_path / ".page.tmp").mkdir()
    (tmp_path / ".page.tmp" / "left").write_text("by a process that was killed")
    monkeypatch.setattr(ncrs.report.build, "write_data", full)
    with pytest.raises(CheckpointError, match=r"(?i)could not write.*no space left.*intact"):
        build_report(run_dir, page, CHAMPION_ALONE)
    assert {path: path.read_bytes() for path in page.rglob("*") if path.is_file()} == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["page"]
