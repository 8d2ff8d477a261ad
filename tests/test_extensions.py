"""Extensions: names that users register, in Python, from a module and from an entry point."""

import json
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import ncrs
import ncrs_envs
from ncrs.engines.base import EngineSettingError
from ncrs.evolution.optimizers import OPTIMIZERS, OptimizerSettings, register_optimizer
from ncrs.runs.engine_settings import ConfigError
from ncrs_envs import Cell, ExtensionError, Scenario, Task, TaskError
from ncrs_envs.mirroring import ScenarioSampling
from ncrs_envs.registry import Registry, load_extensions
from ncrs_envs.tasks import TASKS

ROOT = Path(__file__).parents[1]
PARTS = ((Cell.LIGHT_SENSOR, 1), (Cell.WHEEL, 2))
MODULE = '''
    from dataclasses import dataclass

    import ncrs_envs
    from ncrs.evolution.optimizers import SepCMAESSettings, register_optimizer
    from ncrs.evolution.optimizers.cma_es import CMAES
    from ncrs_envs import Cell, Scenario, Task


    @dataclass
    class MineSettings(SepCMAESSettings):
        """sep-CMA-ES under another name."""

        name: str = "mine"


    def to_the_right(episode):
        return 0.5 + episode.pose[0] / 200.0


    def beside(rng, region, grid_size, noise):
        return Scenario(start=(0.0, 0.0), light=(30.0, rng.uniform(-9.0, 9.0)))


    PARTS = ((Cell.LIGHT_SENSOR, 1), (Cell.WHEEL, 2))
    RACE = Task("race", "Race-v0", 20.0, PARTS, has_light=True, place=beside, reward=to_the_right)
    ncrs_envs.register_task(RACE)
    register_optimizer(MineSettings, CMAES)
'''
TINY = [
    "optimizer.population=16", "generations=2", "episodes=2", "champion_every=1",
    "champion_episodes=2", "start_from=light_chase/best", "optimizer.sigma=0.01",
]  # fmt: skip


def train(folder, *arguments, here=ROOT, **environment):
    program = str(ROOT / "train.py")
    command = [sys.executable, program, *TINY, f"hydra.run.dir={folder}/run", *arguments]
    return subprocess.run(
        command, cwd=here, capture_output=True, text=True, env={**os.environ, **environment}
    )


@pytest.fixture
def package(tmp_path):
    """A module, and the metadata of an installed package that names it as an extension."""
    (tmp_path / "lab_tasks.py").write_text(textwrap.dedent(MODULE))
    info = tmp_path / "lab-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: lab\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[ncrs_extensions]\nlab = lab_tasks\n")
    return tmp_path


@pytest.mark.slow
def test_an_installed_extension_trains_on_two_workers(package):
    done = train(
        package, "task=race", "optimizer=mine", "engine.workers=2", PYTHONPATH=str(package)
    )
    assert done.returncode == 0, done.stdout + done.stderr
    config = json.loads((package / "run" / "config.json").read_text())
    assert config["task"]["name"] == "race"
    assert config["optimizer"]["name"] == "mine"
    assert config["engine"]["name"] == "box2d"  # its reward is a function


def test_a_module_that_is_missing_is_named(monkeypatch):
    monkeypatch.setenv("NCRS_EXTENSIONS", "no_such_lab")
    with pytest.raises(ExtensionError, match="NCRS_EXTENSIONS names the module 'no_such_lab'"):
        load_extensions()


@pytest.mark.parametrize("folder", [".", pytest.param("elsewhere", marks=pytest.mark.slow)])
def test_a_module_named_in_the_environment_is_found(folder, tmp_path):
    module = tmp_path / folder / "lab_tasks.py"
    module.parent.mkdir(exist_ok=True)
    module.write_text(textwrap.dedent(MODULE))
    named = {"PYTHONPATH": str(tmp_path / "elsewhere"), "NCRS_EXTENSIONS": "lab_tasks"}
    unknown = train(tmp_path, "optimizer=yours", here=tmp_path, **named)
    assert unknown.returncode == 2
    assert (
        "choose one of cma_es, cma_mae, cma_me, drafts, iso_cma_es, map_elites, mine"
        in unknown.stderr
    )


@pytest.fixture
def registered(monkeypatch):
    """Registers a task for one test."""

    def register(**changes):
        monkeypatch.setattr(TASKS, "_entries", dict(TASKS._entries))
        values = {"has_light": True, **changes}
        task = Task("lab", "Lab-v0", 20.0, **{"required_parts": PARTS, **values})
        ncrs_envs.register_task(task)
        return task

    yield register
    gymnasium.registry.pop("Lab-v0", None)


def place(rng, region, grid_size, noise):
    return Scenario(start=(0.0, 0.0), light=(10.0 * region, rng.uniform(20.0, 25.0)))


def test_a_task_of_existing_pieces_runs_on_both_engines(registered, full_genome):
    registered(place=place)
    results = [
        ncrs.evaluate(full_genome, "lab", engine=engine, episodes=4, seed=1)
        for engine in ("batched", "box2d")
    ]
    np.testing.assert_allclose(results[0].episode_fitness, results[1].episode_fitness, atol=1e-3)
    env, envs = gymnasium.make("Lab-v0"), gymnasium.make_vec("Lab-v0", num_envs=2)
    _, info = env.reset(seed=3, options={"region": 2})
    _, infos = envs.reset(seed=[3, 4], options={"region": 2})
    assert 20.0 < info["distance"] < 33.0
    assert infos["distance"][0] == pytest.approx(info["distance"])


def test_own_reward_and_success_count_on_box2d_alone(registered, full_genome):
    registered(
        place=place, reward=lambda episode: 0.25, succeeds=lambda episode: episode.pose[1] > 1e9
    )
    result = ncrs.evaluate(full_genome, "lab", episodes=4, seed=1)
    np.testing.assert_allclose(result.episode_fitness, 0.25)
    assert not result.success.any()
    with pytest.raises(EngineSettingError, match=r"only Box2D runs: choose the engine box2d"):
        ncrs.evaluate(full_genome, "lab", engine="batched", seed=1)
    with pytest.raises(TaskError, match="vectorization_mode='sync'"):
        gymnasium.make_vec("Lab-v0", num_envs=2)
    assert gymnasium.make_vec("Lab-v0", num_envs=2, vectorization_mode="sync").num_envs == 2


def test_a_reward_that_is_not_finite_is_an_error(registered):
    registered(reward=lambda episode: float("nan"))
    env = gymnasium.make("Lab-v0")
    env.reset(seed=0)
    with pytest.raises(TaskError, match=r"reward of lab must be finite, got nan"):
        env.step(env.action_space.sample())


def test_a_ball_among_walls_is_box2ds(registered):
    parts = ((Cell.LIGHT_SENSOR, 1), (Cell.TARGET_SENSOR, 1), (Cell.WHEEL, 2))
    registered(required_parts=parts, has_light=False, has_ball=True, has_walls=True)
    with pytest.raises(TaskError, match=r"lab has a ball and walls, .* only Box2D runs"):
        gymnasium.make_vec("Lab-v0", num_envs=2)
    with pytest.raises(EngineSettingError, match=r"lab has a ball and walls, .* engine box2d"):
        ncrs.evaluate(np.zeros(4873), "lab", engine="batched")


def test_placements_are_checked(registered):
    registered(place=lambda *_: Scenario(start=(0.0, 0.0), light=(1e3, 0.0)))
    with pytest.raises(ncrs_envs.ScenarioError, match="light must lie in the playfield"):
        ncrs_envs.sample_scenario("lab", np.random.default_rng(0))


def test_a_sampling_is_checked_and_kept(monkeypatch):
    from ncrs_envs import mirroring

    def short(task, seed, episodes, grid_size):
        return ncrs_envs.sample_scenarios(task, seed, episodes, grid_size)[: episodes - 1]

    monkeypatch.setattr(mirroring.SAMPLINGS, "_entries", dict(mirroring.SAMPLINGS._entries))
    ncrs_envs.register_sampling("whole", ncrs_envs.sample_scenarios)
    ncrs_envs.register_sampling("short", short)
    drawn = ScenarioSampling(kind="whole").draw("obstacle", 5, 3)
    assert drawn == ncrs_envs.sample_scenarios("obstacle", 5, 3)
    with pytest.raises(ncrs_envs.ScenarioError, match="'short' must return a list of 3 scenarios"):
        ScenarioSampling(kind="short").draw("obstacle", 5, 3)
    with pytest.raises(ConfigError, match=r"one of \['standard', 'whole', 'short'\], got 'other'"):
        ncrs.train("unused", scenarios="other")


def test_names_are_taken_once_and_well_formed():
    registry = Registry("thing", {"first": 1})
    registry.register("second", 2)
    registry.register("second", 2)
    assert dict(registry) == {"first": 1, "second": 2}
    with pytest.raises(ExtensionError, match="already a thing 'first'; choose another"):
        registry.register("first", 3)
    with pytest.raises(ExtensionError, match="letters, digits and underscores"):
        registry.register("not a name", 3)
    with pytest.raises(ExtensionError, match=r"need defaults; OptimizerSettings has none for name"):
        register_optimizer(OptimizerSettings, OPTIMIZERS["cma_es"].optimizer)
