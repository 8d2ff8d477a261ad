"""Champions: their file, their test, their pictures."""

import json
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from ncrs.automaton.growth import grow
from ncrs.automaton.nca import NCA
from ncrs.cli import main
from ncrs.engines.evaluate import evaluate
from ncrs.runs.assessment import Proportion, assess, find_assessment
from ncrs.runs.champion import Champion, load_champion_file
from ncrs.runs.checkpoint import CheckpointError, write_state
from ncrs.runs.engine_settings import ConfigError
from ncrs.runs.published import load_champion
from ncrs.viz.pictures import episode_frames
from ncrs_envs.rendering import RenderError
from ncrs_envs.scenario import ScenarioError
from ncrs_envs.tasks import TaskSettings


@pytest.fixture
def champion(full_genome):
    body = grow(NCA().set_genome(full_genome))
    return Champion(full_genome, body, TaskSettings(), 0.4, 0.25, 7, "mean")


@pytest.fixture
def run_dir(champion, tmp_path):
    champion.save(tmp_path / "champion.npz")
    return tmp_path


def test_round_trip(champion, run_dir):
    for path in (run_dir, run_dir / "champion.npz"):
        loaded = load_champion_file(path)
        np.testing.assert_array_equal(loaded.genome, champion.genome)
        np.testing.assert_array_equal(loaded.body, champion.body)
        assert (loaded.task, loaded.fitness, loaded.source) == (champion.task, 0.4, "mean")
        np.testing.assert_array_equal(loaded.nca.genome(), champion.genome)


def test_a_published_champion_can_be_saved_too(tmp_path):
    published = load_champion("light_chase/best")
    published.save(tmp_path / "champion.npz")
    np.testing.assert_array_equal(load_champion_file(tmp_path).genome, published.genome)


def test_shares_are_as_precise_as_the_episodes_allow():
    assert str(Proportion.of(998, 1000)) == (
        "998 of 1000 episodes (99.8%; 95 % interval 99.3% to 99.9%)"
    )
    assert Proportion.of(25, 100).percentages() == ("25%", "18%", "34%")


def test_missing_and_foreign_files(tmp_path):
    with pytest.raises(ConfigError, match="does not exist"):
        load_champion_file(tmp_path)
    write_state(tmp_path / "champion.npz", {"something": 1})
    with pytest.raises(CheckpointError, match="does not hold a champion"):
        load_champion_file(tmp_path)
    (tmp_path / "champion.npz").write_text("no zip")
    with pytest.raises(CheckpointError, match="not a whole checkpoint"):
        load_champion_file(tmp_path)


def test_assessment_counts_fresh_episodes(champion):
    result = assess(champion, episodes=8, seed=3)
    assert result.success.episodes == 8
    assert result.crossed is None
    assert 0.0 < result.fitness < 1.0
    assert result.fitness_standard_error > 0.0
    # Training's scenarios of the same seed are others.
    assert evaluate(champion.genome, "light_chase", episodes=8, seed=3).fitness[0] != result.fitness
    assert assess(champion, episodes=8, seed=3) == result
    obstacle = assess(replace(champion, task=TaskSettings(name="obstacle")), episodes=2)
    assert obstacle.crossed is not None
    assert len(obstacle.lines()) == 3
    with pytest.raises(ScenarioError, match="positive integer"):
        assess(champion, episodes=0)


def test_the_task_settings_travel_with_the_champion(champion):
    easy = replace(champion, task=TaskSettings(success_radius=500.0))
    assert assess(easy, episodes=4).success.fraction == 1.0


def test_a_test_in_another_construction_is_not_the_champions(champion, run_dir, capsys):
    main(["evaluate", str(run_dir), "--episodes", "3"])
    words = ["--construction", "jointed", "--hull-density", "0.1"]
    main(["evaluate", str(run_dir), "--episodes", "3", *words])
    assert "3 fresh episodes on box2d, construction=jointed, hull_density=0.1:" in (
        capsys.readouterr().out
    )
    own, other = (
        json.loads((run_dir / name).read_text())
        for name in ("evaluation.json", "evaluation_jointed-0.1.json")
    )
    assert (own["construction"], own["hull_density"]) == ("rigid", 1.0)
    assert (other["construction"], other["hull_density"]) == ("jointed", 0.1)
    assert own["fitness"] != other["fitness"]
    jointed = replace(champion, task=TaskSettings(construction="jointed", hull_density=0.1))
    assert assess(jointed, episodes=3).fitness == other["fitness"]
    assert find_assessment(run_dir, champion).fitness == own["fitness"]
    assert find_assessment(run_dir, jointed) is None
    with pytest.raises(SystemExit, match="2"):
        main(["evaluate", str(run_dir), "--engine", "batched", *words])
    assert "has construction=jointed, which only Box2D runs" in capsys.readouterr().err


def test_frames_show_an_episode(champion):
    frames, other = episode_frames(champion, episodes=2, seed=1, size=96)
    assert len(frames) == len(other) == 51
    assert frames[0].shape == (96, 96, 3)
    assert np.abs(frames[0].astype(int) - frames[-1]).max() > 50
    with pytest.raises(RenderError):
        episode_frames(champion, size=0)


def test_evaluate_command(run_dir, capsys):
    main(["evaluate", str(run_dir), "--episodes", "4", "--seed", "2", "--engine", "box2d"])
    saved = json.loads((run_dir / "evaluation.json").read_text())
    assert saved["success"]["episodes"] == 4
    assert saved["seed"] == 2
    printed = capsys.readouterr().out
    assert f"{saved['fitness']:.4f}" in printed
    assert "95 % interval" in printed


def test_render_command(run_dir, capsys):
    main(["render", str(run_dir), "--size", "96"])
    with Image.open(run_dir / "body.png") as picture:
        assert picture.size == (96, 96)
    with Image.open(run_dir / "episodes.gif") as animation:
        assert animation.n_frames > 80
        assert animation.size == (96, 96)
    assert "episodes.gif" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["evaluate", "{run}/nowhere"], "does not exist"),
        (["evaluate", "{run}", "--episodes", "0"], "positive integer"),
        (["render", "{run}", "--size", "3"], "render_size"),
    ],
)
def test_bad_input_is_one_sentence(run_dir, arguments, message, capsys):
    with pytest.raises(SystemExit) as caught:
        main([word.format(run=run_dir) for word in arguments])
    assert caught.value.code == 2
    error = capsys.readouterr().err
    assert message in error
    assert "Traceback" not in error
