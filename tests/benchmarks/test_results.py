"""Training on a champion's card: all stages, as they ended."""

import dataclasses
import json

import pytest
import yaml

import ncrs
from benchmarks.results import command_of, training_of
from ncrs.runs.engine_settings import ConfigError
from ncrs.runs.metrics import MetricsFile
from ncrs.runs.settings import TrainConfig


@pytest.fixture
def make_run(tmp_path):
    """A folder with what a run leaves of how it was trained, after so many generations of 10."""

    def make(name, generations, overrides=(), begun_with=None, **settings):
        run = tmp_path / name
        (run / ".hydra").mkdir(parents=True)
        config = dataclasses.asdict(TrainConfig(generations=generations, **settings))
        (run / "config.json").write_text(json.dumps(config))
        (run / ".hydra" / "overrides.yaml").write_text(yaml.safe_dump(list(overrides)))
        begun = {"generations": begun_with or generations}
        (run / ".hydra" / "config.yaml").write_text(yaml.safe_dump(begun))
        table = MetricsFile(run, 0)
        for generation in range(generations):
            done = {"progress/evaluations": 10 * (generation + 1)}
            table.add(generation, {**done, "progress/env_steps": 700 * (generation + 1)})
        return run

    return make


def test_the_efforts_of_all_stages_add_up(make_run):
    first = make_run("first", 3, ["seed=1"])
    (first / "champion.npz").touch()
    second = make_run("second", 2, [f"start_from={first}"], start_from=str(first))
    file = str(second / "champion.npz")
    (second / "champion.npz").touch()
    third = make_run("third", 4, [f"start_from={file}"], start_from=file)
    training = training_of(third)
    assert (training.generations, training.evaluations, training.env_steps) == (9, 90, 6300)
    assert training.commands == [
        "python train.py seed=1 hydra.run.dir=runs/first",
        "python train.py start_from=runs/first hydra.run.dir=runs/second",
        "python train.py start_from=runs/second hydra.run.dir=runs/third",
    ]


def test_what_a_published_champion_cost_is_counted(make_run):
    name = "light_chase/best"
    card = ncrs.load_champion(name).card
    run = make_run("next", 2, [f"start_from={name}"], start_from=name)
    training = training_of(run)
    assert training.evaluations == card["evaluations"] + 20
    assert training.commands[:-1] == card["commands"]
    assert f"start_from={name} " in training.commands[-1]


def test_a_missing_stage_is_not_passed_over(make_run, tmp_path):
    gone = str(tmp_path / "gone")
    with pytest.raises(ConfigError, match="gone"):
        training_of(make_run("after", 2, start_from=gone))


@pytest.mark.parametrize("overrides", [["generations=2"], []])
def test_a_resumed_run_has_the_command_of_its_end(make_run, overrides):
    run = make_run("long", 5, overrides, begun_with=2)
    assert command_of(run) == "python train.py generations=5 hydra.run.dir=runs/long"
