"""Hydra's side of the settings."""

from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir

from ncrs.engines.base import ENGINES
from ncrs.evolution.optimizers.base import OPTIMIZERS
from ncrs.runs.settings import ConfigError, TrainConfig, save_config
from ncrs.training.hydra import check_arguments, register, train_config
from ncrs_envs.tasks import TASKS

CONF = Path(__file__).parents[2] / "conf"


@pytest.fixture
def composed():
    register()
    with initialize_config_dir(str(CONF), version_base="1.3"):
        yield lambda *overrides: train_config(compose("config", list(overrides)), overrides)


def names(folder):
    return {path.stem for path in (CONF / folder).glob("*.yaml")}


def test_the_groups_are_what_the_code_knows():
    assert names("task") == set(TASKS)
    assert names("optimizer") == set(OPTIMIZERS)
    assert names("engine") == {*ENGINES, "auto"}


@pytest.mark.parametrize("group", ["task", "optimizer", "engine"])
def test_each_choice_composes_and_names_itself(composed, group):
    for name in names(group) - {"auto"}:
        assert getattr(composed(f"{group}={name}"), group).name == name


def test_auto_is_recorded_as_the_engine_that_it_stands_for(composed):
    assert composed("engine=auto").engine.name == "batched"


@pytest.mark.parametrize(
    ("overrides", "mirroring"),
    [
        ([], "front_back"),
        (["symmetric=false"], "all"),
        (["task=obstacle"], "none"),
        (["task=carry_ball", "symmetric=false"], "all"),
        (["mirroring=none"], "none"),
    ],
)
def test_mirroring_follows_the_task_and_the_symmetry(composed, overrides, mirroring):
    assert composed(*overrides).mirroring == mirroring


@pytest.mark.parametrize("task", sorted(TASKS))
def test_the_papers_cma_es(composed, task):
    config = composed(f"experiment=paper/{task}_cma_es")
    assert config.task.name == task
    assert config.optimizer.name == "cma_es"
    assert config.optimizer.sigma == 0.01
    assert config.optimizer.population == 112
    assert config.optimizer.told_popsize is True
    assert (config.generations, config.episodes) == (20000, 12)
    assert (config.symmetric, config.mirroring) == (False, "none")
    score = "inverse_square" if task == "carry_ball" else "exponential"
    assert config.task.distance_score == score


@pytest.mark.parametrize("task", sorted(TASKS))
def test_the_papers_cma_me(composed, task):
    config = composed(f"experiment=paper/{task}_cma_me")
    assert config.task.name == task
    optimizer = config.optimizer
    assert (optimizer.name, optimizer.ranking) == ("cma_me", "improvement")
    assert (optimizer.sigma, optimizer.population) == (0.01, 128)
    assert (optimizer.emitters, optimizer.patience) == (15, 500)
    assert optimizer.diagonal is False
    assert (config.generations, config.episodes) == (60000, 12)
    assert (config.symmetric, config.mirroring) == (False, "none")
    score = "inverse_square" if task == "carry_ball" else "exponential"
    assert config.task.distance_score == score


def test_the_command_line_wins_over_an_experiment(composed):
    config = composed("experiment=paper/obstacle_cma_es", "seed=4", "optimizer.told_popsize=false")
    assert config.seed == 4
    assert config.optimizer.told_popsize is False


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["generation=5"], "Did you mean generations"),
        (["optimizer.sgima=1"], "Did you mean optimizer.sigma"),
        (["+extra=1"], "Unknown setting 'extra'"),
        (["resume=/nowhere"], "holds no run"),
        (["task=[,"], "Cannot read"),
    ],
)
def test_unknown_names_are_refused_with_the_known_ones(arguments, message):
    with pytest.raises(ConfigError, match=message):
        check_arguments(arguments)


def test_hydras_own_settings_and_sweeps_pass():
    check_arguments(["-m", "task=light_chase,obstacle", "seed=0,1", "hydra.run.dir=/tmp/x"])
    check_arguments(["--multirun", "hydra/launcher=basic", "experiment=paper/obstacle_cma_es"])


def test_impossible_values_are_refused(composed):
    with pytest.raises(ConfigError, match="episodes must be at least 1"):
        composed("episodes=0")


def test_a_resumed_run_keeps_its_settings(composed, tmp_path):
    own = TrainConfig(seed=9, generations=50)
    own.engine.workers = 2
    save_config(own, tmp_path)
    resumed = composed(f"resume={tmp_path}")
    assert resumed.seed == 9
    assert resumed.generations == 50
    assert resumed.engine.workers == 2
    longer = composed(f"resume={tmp_path}", "generations=80", "engine.workers=1")
    assert (longer.generations, longer.engine.workers, longer.seed) == (80, 1, 9)
    check_arguments([f"resume={tmp_path}", "seed=9", "task=light_chase", "optimizer.sigma=null"])
    check_arguments([f"resume={tmp_path}", "engine=auto"])
    for argument, message in [
        ("seed=1", r"its seed is 9, 1 was given.*generations"),
        ("task=obstacle", r"its task.name is 'light_chase', 'obstacle' was given"),
        ("optimizer=cma_es", r"its optimizer.name is 'sep_cma_es', 'cma_es' was given"),
        ("optimizer.sigma=0.5", r"its optimizer.sigma is None, 0.5 was given"),
        ("mirroring=all", r"its mirroring is 'none', 'all' was given"),
        ("experiment=best/obstacle", "leave out experiment"),
    ]:
        with pytest.raises(ConfigError, match=message):
            check_arguments([f"resume={tmp_path}", argument])
    with pytest.raises(ConfigError, match="multirun"):
        check_arguments(["-m", f"resume={tmp_path}"])
