"""Hydra's side of the settings."""

import dataclasses
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir
from hydra.core.config_store import ConfigStore

import ncrs
from ncrs.engines.base import ENGINES
from ncrs.evolution.optimizers import OPTIMIZERS
from ncrs.runs.engine_settings import ConfigError
from ncrs.runs.settings import TrainConfig, config_from_dict, save_config
from ncrs.training.arguments import check_arguments
from ncrs.training.explanations import explanations
from ncrs.training.hydra import register, train_config
from ncrs_envs.errors import NCRSError
from ncrs_envs.tasks import PAPER_TASKS, TASKS, TaskSettings

ROOT = Path(__file__).parents[2]
CONF = ROOT / "conf"
GROUPS = {"task": TASKS, "optimizer": OPTIMIZERS, "engine": (*ENGINES, "auto")}


@pytest.fixture(autouse=True)
def _registered():
    register()


@pytest.fixture
def composed():
    def config(*overrides):
        with initialize_config_dir(str(CONF), version_base="1.3"):
            return train_config(compose("config", list(overrides)), overrides)

    return config


def test_the_defaults_of_the_command_are_those_of_the_record(composed):
    assert composed() == TrainConfig().resolved()


@pytest.mark.parametrize("group", GROUPS)
def test_the_groups_are_what_the_code_knows(group):
    stored = ConfigStore.instance().repo[group]
    assert {name.removesuffix(".yaml") for name in stored} == set(GROUPS[group])
    assert not (CONF / group).exists()


@pytest.mark.parametrize("group", ["task", "optimizer", "engine"])
def test_each_choice_composes_and_names_itself(composed, group):
    for name in set(GROUPS[group]) - {"auto"}:
        assert getattr(composed(f"{group}={name}"), group).name == name


@pytest.mark.parametrize("name", OPTIMIZERS)
def test_an_optimizers_settings_are_its_own_defaults(composed, name):
    assert composed(f"optimizer={name}").optimizer == OPTIMIZERS[name].settings()


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


@pytest.mark.parametrize("task", [task.name for task in PAPER_TASKS])
def test_the_papers_cma_es(composed, task):
    config = composed(f"experiment=paper/{task}_cma_es")
    assert config.task.name == task
    assert config.optimizer.name == "cma_es"
    assert config.optimizer.sigma == 0.01
    assert config.optimizer.population == 112
    assert config.optimizer.parents is None
    assert (config.generations, config.episodes) == (20000, 12)
    assert (config.symmetric, config.mirroring) == (False, "none")
    score = "inverse_square" if task == "carry_ball" else "exponential"
    assert config.task.distance_score == score


@pytest.mark.parametrize("task", [task.name for task in PAPER_TASKS])
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


@pytest.mark.parametrize("task", [task.name for task in PAPER_TASKS])
@pytest.mark.parametrize(
    ("optimizer", "differences"),
    [("cma_es", {"parents": 14}), ("cma_me", {"parents": 14, "ranking": "fitness"})],
)
def test_the_published_runs_differ_from_the_stated_ones(composed, task, optimizer, differences):
    stated = composed(f"experiment=paper/{task}_{optimizer}")
    published = composed(f"experiment=published/{task}_{optimizer}")
    assert stated.optimizer.parents is None
    assert published == dataclasses.replace(
        stated, optimizer=dataclasses.replace(stated.optimizer, **differences)
    )


@pytest.mark.parametrize(
    ("name", "space", "repair_steps"),
    [
        ("light_chase", "spare_parts", 0),
        ("light_chase_repair", "repairing", 10),
        ("light_chase_weights", "weights", 0),
        ("light_chase_from_nothing", "weights", 10),
    ],
)
def test_recipes_under_damage(composed, name, space, repair_steps):
    config = composed(f"experiment=robust/{name}")
    assert (config.space, config.perturbations.repair_steps) == (space, repair_steps)
    assert (config.perturbations.damage_fraction, config.perturbations.damage_until) == (0.3, 50)
    drawn = config.sampling().draw("light_chase", 0, 40, generation=1000)
    assert 20 <= sum(scenario.damage is not None for scenario in drawn) <= 40


@pytest.mark.parametrize("task", [task.name for task in PAPER_TASKS])
def test_a_large_population_on_a_gpu(composed, task):
    config = composed("experiment=gpu/map_elites", f"task={task}")
    assert (config.task.name, config.engine.name) == (task, "cuda")
    assert (config.optimizer.name, config.optimizer.population) == ("map_elites", 1024)


def test_the_command_line_wins_over_an_experiment(composed):
    config = composed("experiment=paper/obstacle_cma_es", "seed=4", "optimizer.parents=14")
    assert config.seed == 4
    assert config.optimizer.parents == 14


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["generation=5"], "Unknown setting 'generation'. Did you mean generations"),
        (["optimizer.sgima=1"], "Did you mean optimizer.sigma"),
        (["optimizer.emitters=3"], "sep_cma_es has no setting .*; cma_me and cma_mae have it"),
        (["+optimizer.emitters=3"], "sep_cma_es has no setting 'optimizer.emitters'"),
        (["optimizer=map_elites", "optimizer.sigma=1"], "map_elites has no setting"),
        (["population=10"], "Did you mean optimizer.population"),
        (["+extra=1"], "Unknown setting 'extra'"),
        (["optimizer=adam"], "Unknown optimizer 'adam'; choose one of .*sep_cma_es"),
        (["optimizer.name=cma_me"], "name must be 'sep_cma_es'.*optimizer=NAME"),
        (
            ["experiment=best/foo"],
            "Unknown experiment 'best/foo'; choose one of best/carry_ball, .*, best/obstacle.$",
        ),
        (
            ["experiment=foo"],
            "Unknown experiment 'foo'; choose one of archive/..., .*, robust/..., which --help",
        ),
        (
            ["experiment=light_chase"],
            "Unknown experiment 'light_chase'; did you mean best/light_chase or .* Else choose",
        ),
        (["seed=1.5"], "seed is invalid: Value '1.5' of type 'float'"),
        (["optimizer.sigma=big"], "optimizer.sigma is invalid: Value 'big'"),
        (["optimizer.sigma=0"], "sigma must be positive"),
        (["optimizer.parents=113"], "population 112 is smaller than the 113 parents"),
        (["task.grid_size=2"], "at least 3"),
        (["engine.workers=0"], "workers"),
        (["-m", "seed=-1,-2"], "seed must be an integer from 0"),
        (["-m", "generation=range(3,5)"], "Did you mean generations"),
        (["resume=/nowhere"], "holds no run"),
        (["task=[,"], "Cannot read"),
        (["hydra.run.dir=läuft"], r"put a value with such letters in quotes, \"hydra.run.dir='l"),
    ],
)
def test_bad_arguments_are_refused_with_what_is_allowed(arguments, message):
    with pytest.raises(NCRSError, match=message) as error:
        check_arguments(arguments, CONF)
    assert len(str(error.value)) < 500
    assert "\n" not in str(error.value)


def test_hydras_own_settings_and_sweeps_pass():
    check_arguments(["-m", "task=light_chase,obstacle", "seed=0,1", "hydra.run.dir=/tmp/x"], CONF)
    sweep = ["--multirun", "hydra/launcher=basic", "experiment=paper/obstacle_cma_es"]
    check_arguments(sweep, CONF)
    assert check_arguments(["-m", "seed=range(0,3)"], CONF).jobs == 3
    searched = ["-m", "seed=range(0,3)", "optimizer.sigma=interval(0.01,0.1)"]
    with pytest.raises(ConfigError, match="such as hydra/sweeper=ncrs_optuna"):
        check_arguments(searched, CONF)
    pytest.importorskip("hydra_plugins.hydra_optuna_sweeper")
    assert check_arguments([*searched, "hydra/sweeper=ncrs_optuna"], CONF).jobs is None
    groups = ["optimizer=choice(cma_me,cma_mae)", "optimizer.patience=3"]
    assert check_arguments(["-m", *groups, "hydra/sweeper=ncrs_optuna"], CONF).jobs is None


def test_experiments_of_ones_own_are_found_and_checked(tmp_path):
    folder = tmp_path / "my confs"
    (folder / "experiment").mkdir(parents=True)
    mine = folder / "experiment" / "mine.yaml"
    arguments = ["--config-dir", str(folder), "experiment=mine"]
    mine.write_text("# @package _global_\nseed: 3\n")
    assert check_arguments(arguments, CONF) is None
    mine.write_text("# @package _global_\nsede: 3\n")
    with pytest.raises(ConfigError, match=r"Unknown setting 'sede'\. Did you mean seed"):
        check_arguments(arguments, CONF)


@pytest.mark.parametrize(
    "group", ["launcher=ncrs_joblib", "launcher=ncrs_slurm", "sweeper=ncrs_optuna"]
)
def test_a_missing_plugin_is_named_with_its_extra(group, monkeypatch):
    store = ConfigStore.instance().repo["hydra"]
    part = group.partition("=")[0]
    for name in ("joblib", "submitit_slurm", "optuna"):
        monkeypatch.delitem(store[part], f"{name}.yaml", raising=False)
    with pytest.raises(ConfigError, match=r"needs the extra (sweep|slurm): pip install 'ncrs\["):
        check_arguments(["-m", "seed=0,1", f"hydra/{group}"], CONF)


def _records():
    yield "", TrainConfig
    yield "task.", TaskSettings
    yield "engine.", type(TrainConfig().engine)
    yield "perturbations.", type(TrainConfig().perturbations)
    for entry in OPTIMIZERS.values():
        yield "optimizer.", entry.settings


@pytest.mark.parametrize(("prefix", "record"), list(_records()))
def test_help_names_every_setting_with_its_explanation(prefix, record, printed_help):
    groups = {"task", "optimizer", "engine", "perturbations"}
    own = {item.name for item in dataclasses.fields(record)} - groups
    found = explanations(record)
    assert set(found) == own
    for name, (default, text) in found.items():
        assert getattr(record(), name) == default
        assert len(text) > 5, name
        assert f"\n{prefix}{name}" in printed_help
        assert "".join(text.split()) in "".join(printed_help.split()), name


@pytest.fixture(scope="module")
def printed_help():
    done = subprocess.run(
        [sys.executable, "train.py", "--help"], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_help_tells_defaults_and_choices(printed_help):
    lines = printed_help.splitlines()
    at = lines.index("optimizer.sigma")
    assert lines[at + 2].strip() == (
        "Default: 0.01 for cma_es, cma_me; 0.03 for sep_cma_es, iso_cma_es, cma_mae."
    )
    assert {"seed=0", "start_from=null", "symmetric=true", "task.name=light_chase"} <= set(lines)
    assert "experiment/paper: carry_ball_cma_es" in printed_help
    assert "experiment/published: carry_ball_cma_es" in printed_help
    names = "cma_es, cma_mae, cma_me, drafts, iso_cma_es, map_elites, sep_cma_es"
    assert f"optimizer: {names}" in printed_help


def test_a_foreign_setting_fails_at_once_and_leaves_nothing(tmp_path):
    before = sorted(os.listdir(ROOT))
    command = [sys.executable, "train.py", "optimizer.emitters=3", f"hydra.run.dir={tmp_path}/run"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.startswith("train.py: sep_cma_es has no setting 'optimizer.emitters'")
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "run").exists()
    assert sorted(os.listdir(ROOT)) == before


@pytest.mark.parametrize("name", ncrs.champions())
def test_the_commands_of_a_champion_give_its_settings(composed, name):
    card = ncrs.load_champion(name).card
    for command in card["commands"]:
        overrides = shlex.split(command.removeprefix("python train.py "))
        config = composed(*overrides)
    assert config == config_from_dict(card["config"])


def test_impossible_values_are_refused(composed):
    with pytest.raises(ConfigError, match="episodes must be at least 1"):
        composed("episodes=0")


def test_a_resumed_run_keeps_its_settings(composed, tmp_path):
    own = TrainConfig(seed=9, generations=50, mirroring="none").resolved()
    own.engine.workers = 2
    save_config(own, tmp_path)
    resumed = composed(f"resume={tmp_path}")
    assert resumed.seed == 9
    assert resumed.generations == 50
    assert resumed.engine.workers == 2
    longer = composed(f"resume={tmp_path}", "generations=80", "engine.workers=1")
    assert (longer.generations, longer.engine.workers, longer.seed) == (80, 1, 9)
    resume = f"resume={tmp_path}"
    check_arguments([resume, "seed=9", "task=light_chase", "optimizer.sigma=0.03"], CONF)
    check_arguments([resume, "engine=auto", "optimizer=sep_cma_es"], CONF)
    for argument, message in [
        ("seed=1", r"its seed is 9, 1 was given.*generations"),
        ("task=obstacle", r"its task.name is 'light_chase', 'obstacle' was given"),
        ("optimizer=cma_es", r"its optimizer.name is 'sep_cma_es', 'cma_es' was given"),
        ("optimizer.sigma=0.5", r"its optimizer.sigma is 0.03, 0.5 was given"),
        ("mirroring=all", r"its mirroring is 'none', 'all' was given"),
        ("experiment=best/obstacle", "leave out experiment"),
    ]:
        with pytest.raises(ConfigError, match=message):
            check_arguments([resume, argument], CONF)
    with pytest.raises(ConfigError, match="resume continues one run"):
        check_arguments(["-m", resume], CONF)


@pytest.mark.parametrize("name", ["file/run", "n" * 300])
def test_a_folder_that_cannot_be_made_is_one_sentence(name, launched, tmp_path):
    (tmp_path / "file").write_text("")
    done = launched(f"hydra.run.dir={tmp_path}/{name}", "generations=1")
    assert done.returncode == 2
    assert done.stderr.startswith("train.py: Could not write")
    assert done.stderr.count("\n") == 1


def test_a_refused_second_run_leaves_the_firsts_record(launched, tmp_path):
    tiny = ["generations=1", "optimizer.population=16", "episodes=2", "optimizer.sigma=1e-6"]
    assert launched(f"hydra.run.dir={tmp_path}", *tiny).returncode == 0
    record = {path: path.read_bytes() for path in (tmp_path / ".hydra").iterdir()}
    assert len(record) == 3
    again = launched(f"hydra.run.dir={tmp_path}", *tiny, "seed=3")
    assert again.returncode == 2
    assert "already holds a run; continue it with resume=" in again.stderr
    assert {path: path.read_bytes() for path in (tmp_path / ".hydra").iterdir()} == record
