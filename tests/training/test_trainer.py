"""Training: logs, champions, and runs that resume after a kill as if there had been none."""

import dataclasses
import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from filelock import FileLock
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from ncrs.evolution.optimizers import SepCMAESSettings
from ncrs.runs.champion import load_champion_file
from ncrs.runs.checkpoint import CheckpointError, CheckpointFolder
from ncrs.runs.engine_settings import ConfigError, EngineSettings
from ncrs.runs.lock import RunError
from ncrs.runs.metrics import MetricsFile
from ncrs.runs.settings import TrainConfig
from ncrs.training import versions
from ncrs.training.trainer import train
from ncrs_envs.tasks import TaskSettings

ROOT = Path(__file__).parents[2]
GENERATIONS = 6


def config(**changes):
    return dataclasses.replace(
        TrainConfig(
            optimizer=SepCMAESSettings(sigma=0.1, population=16, parents=None, step_size="csa"),
            engine=EngineSettings(name="box2d", workers=1),
            symmetric=False,
            mirroring="none",
            generations=GENERATIONS,
            episodes=2,
            champion_every=2,
            champion_episodes=3,
            checkpoint_seconds=0,
            seed=1,
        ),
        **changes,
    )


COMMAND = [
    sys.executable, "train.py", "engine=box2d", "engine.workers=1", "optimizer.sigma=0.1",
    "optimizer.population=16", "optimizer.parents=null", f"generations={GENERATIONS}",
    "episodes=2", "champion_every=2", "champion_episodes=3", "checkpoint_seconds=0", "seed=1",
    "symmetric=false", "mirroring=none", "optimizer.step_size=csa",
]  # fmt: skip


def final_state(run_dir):
    state = CheckpointFolder(Path(run_dir) / "checkpoints").load()
    del state["run"]["seconds"]
    return state


def assert_same(first, second, path=""):
    assert type(first) is type(second), path
    if isinstance(first, dict):
        assert first.keys() == second.keys(), path
        for key in first:
            assert_same(first[key], second[key], f"{path}/{key}")
    elif isinstance(first, list):
        assert len(first) == len(second), path
        for index, pair in enumerate(zip(first, second, strict=True)):
            assert_same(*pair, f"{path}/{index}")
    else:
        np.testing.assert_array_equal(first, second, err_msg=path)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """A whole run on the engine whose generations are slow enough to be killed between them."""
    run_dir = tmp_path_factory.mktemp("undisturbed")
    result = train(config(), run_dir)
    return run_dir, result


def quick(**changes):
    return config(engine=EngineSettings(name="batched", workers=1), **changes)


@pytest.fixture(scope="module")
def undisturbed_quick(tmp_path_factory):
    """The same on the fast engine, for what needs no other process."""
    run_dir = tmp_path_factory.mktemp("undisturbed_quick")
    train(quick(), run_dir)
    return run_dir


def scalars(run_dir):
    accumulator = EventAccumulator(str(run_dir)).Reload()
    return {tag: accumulator.Scalars(tag) for tag in accumulator.Tags()["scalars"]}


def test_a_run_finishes_and_reports(undisturbed):
    run_dir, result = undisturbed
    assert result.state.generation == GENERATIONS
    assert result.stopped_by is None
    assert result.state.evaluations == 16 * GENERATIONS
    assert result.champion is not None
    champion = load_champion_file(run_dir)
    np.testing.assert_array_equal(champion.genome, result.champion.genome)
    assert champion.fitness == result.champion.fitness


def test_tensorboard_has_the_curves(undisturbed):
    curves = scalars(undisturbed[0])
    for tag in (
        "fitness/best", "fitness/mean", "fitness/median", "fitness/std", "population/valid",
        "success/mean", "optimizer/sigma", "optimizer/condition_number", "progress/evaluations",
        "progress/env_steps", "speed/evaluations_per_s", "speed/env_steps_per_s", "time/ask_s",
        "time/evaluate_s", "time/tell_s",
    ):  # fmt: skip
        assert [event.step for event in curves[tag]] == list(range(GENERATIONS)), tag
    assert [event.value for event in curves["progress/evaluations"]] == [
        16.0 * (index + 1) for index in range(GENERATIONS)
    ]
    texts = EventAccumulator(str(undisturbed[0])).Reload().Tags()["tensors"]
    assert {"config/text_summary", "versions/text_summary"} <= set(texts)


def test_the_seed_decides_the_run_and_workers_do_not(undisturbed, tmp_path):
    train(config(engine=EngineSettings(name="box2d", workers=2)), tmp_path / "same")
    assert_same(final_state(undisturbed[0]), final_state(tmp_path / "same"))
    train(config(seed=2, generations=1), tmp_path / "other")
    assert (
        final_state(tmp_path / "other")["run"]["best_fitness"]
        != final_state(undisturbed[0])["run"]["best_fitness"]
    )


def test_a_longer_run_goes_on_where_the_shorter_ended(undisturbed_quick, tmp_path):
    train(quick(generations=4), tmp_path)
    train(quick(resume=str(tmp_path)), tmp_path)
    assert_same(final_state(undisturbed_quick), final_state(tmp_path))
    steps = [event.step for event in scalars(tmp_path)["fitness/best"]]
    assert steps == list(range(GENERATIONS))


@pytest.fixture
def start():
    """Starts or resumes a run in a process; none outlives its test."""
    processes = []

    def start_process(run_dir):
        command = [*COMMAND, f"hydra.run.dir={run_dir}"]
        if CheckpointFolder(run_dir / "checkpoints").paths():
            command = [sys.executable, "train.py", f"resume={run_dir}"]
        process = subprocess.Popen(
            command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        processes.append(process)
        return process

    yield start_process
    for process in processes:
        process.kill()
        process.wait()
        process.stdout.close()


def wait_for_checkpoint(run_dir, generation, process):
    """Wait for the checkpoint of that generation or a later one."""
    name = f"generation_{generation:08d}.npz"
    folder = CheckpointFolder(run_dir / "checkpoints")
    deadline = time.monotonic() + 120  # against hanging: a busy machine needs a minute to start
    while not any(path.name >= name for path in folder.paths()):
        assert process.poll() is None, process.stdout.read()
        assert time.monotonic() < deadline
        time.sleep(0.005)


@pytest.mark.slow
def test_a_run_killed_again_and_again_ends_bit_equal(undisturbed, start, tmp_path):
    run_dir = tmp_path / "killed"
    # Between checkpoints, while one is being written, wherever it happens to be.
    for generation, delay in ((0, 0.0), (3, 0.03)):
        process = start(run_dir)
        wait_for_checkpoint(run_dir, generation, process)
        time.sleep(delay)
        process.kill()
        process.wait()
    process = start(run_dir)
    output, _ = process.communicate(timeout=120)
    assert process.returncode == 0, output
    assert_same(final_state(undisturbed[0]), final_state(run_dir))
    assert (run_dir / "champion.npz").read_bytes() == (undisturbed[0] / "champion.npz").read_bytes()


@pytest.mark.parametrize(
    "number",
    [
        signal.SIGINT,
        pytest.param(signal.SIGTERM, marks=pytest.mark.slow),
        pytest.param(signal.SIGHUP, marks=pytest.mark.slow),
    ],
)
def test_a_polite_stop_saves_says_so_and_goes_on_exactly(undisturbed, start, tmp_path, number):
    run_dir = tmp_path / "stopped"
    process = start(run_dir)
    wait_for_checkpoint(run_dir, 1, process)
    process.send_signal(number)
    output, _ = process.communicate(timeout=60)
    assert process.returncode == 128 + number, output
    assert f"Stopped by {number.name}" in output
    assert f"resume={run_dir}" in output
    assert "Traceback" not in output
    result = train(config(resume=str(run_dir)), run_dir)
    assert result.state.generation == GENERATIONS
    assert_same(final_state(undisturbed[0]), final_state(run_dir))


def test_a_full_disk_ends_the_run_clearly_and_it_goes_on_exactly(
    undisturbed_quick, tmp_path, monkeypatch
):
    def full(self, generation, metrics):
        if generation == 3:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        add(self, generation, metrics)

    add = MetricsFile.add
    monkeypatch.setattr(MetricsFile, "add", full)
    with pytest.raises(CheckpointError, match=r"(?i)could not write.*no space left.*intact"):
        train(quick(), tmp_path)
    monkeypatch.undo()
    train(quick(resume=str(tmp_path)), tmp_path)
    assert_same(final_state(undisturbed_quick), final_state(tmp_path))


@pytest.mark.parametrize("name", ["file/run", "locked"])
def test_a_folder_that_cannot_be_written_is_a_clear_error(tmp_path, name):
    (tmp_path / "file").write_text("")
    (tmp_path / "locked" / ".lock").mkdir(parents=True)
    with pytest.raises(CheckpointError, match=r"Could not write .*free space, change permissions"):
        train(config(), tmp_path / name)


def test_genomes_that_are_not_finite_stop_the_run_and_save(tmp_path):
    optimizer = SepCMAESSettings(sigma=1e39, population=4, parents=None)  # beyond float32
    with pytest.raises(RunError, match=r"Generation 0 cannot be completed.*finite.*saved in"):
        train(config(optimizer=optimizer), tmp_path)
    assert final_state(tmp_path)["run"]["generation"] == 0


def test_other_settings_are_refused_on_resuming_with_both_values(undisturbed):
    run_dir = undisturbed[0]
    before = final_state(run_dir), (run_dir / "config.json").read_bytes()
    for changes, message in [
        ({"seed": 9}, "its seed is 1, 9 was given"),
        ({"task": TaskSettings("obstacle")}, "its task.name is 'light_chase', 'obstacle' was"),
        ({"episodes": 24}, "its episodes is 2, 24 was given"),
    ]:
        with pytest.raises(ConfigError, match=message):
            train(config(resume=str(run_dir), **changes), run_dir)
    assert_same(before[0], final_state(run_dir))
    assert (run_dir / "config.json").read_bytes() == before[1]


def test_event_files_that_cannot_be_written_are_one_sentence(tmp_path, monkeypatch):
    def full(*arguments):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    # TensorBoard's thread writes, and the next call raises what it met.
    monkeypatch.setattr("torch.utils.tensorboard.SummaryWriter.add_text", full)
    with pytest.raises(CheckpointError, match=r"Could not write .*No space left on device"):
        train(quick(generations=1), tmp_path)


def test_going_on_with_other_versions_is_warned_of(tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(versions, "version", lambda name: "0.1")
        patch.setattr("ncrs_envs.box2d_world.VERSION", "0.2")
        train(quick(generations=1), tmp_path)
    expected = r"saved with torch 0\.1 \(now .*numba 0\.1.*cma 0\.1.*Box2D 0\.2"
    with pytest.warns(versions.VersionWarning, match=expected):
        train(quick(resume=str(tmp_path), generations=2), tmp_path)


def test_two_runs_cannot_write_to_one_folder(undisturbed, tmp_path):
    with FileLock(tmp_path / ".lock"), pytest.raises(RunError, match="Another process"):
        train(config(generations=1), tmp_path)
    with pytest.raises(RunError, match="already holds a run"):
        train(config(generations=1), undisturbed[0])


def test_scenarios_per_genome(tmp_path):
    common = train(quick(generations=4), tmp_path / "common")
    own = train(quick(generations=4, common_scenarios=False), tmp_path / "own")
    assert own.state.evaluations == common.state.evaluations
    assert own.state.best_fitness != common.state.best_fitness


def test_a_population_that_is_all_invalid_is_no_error(tmp_path):
    optimizer = SepCMAESSettings(sigma=1e-6, population=4, parents=None, step_size="csa")
    result = train(config(optimizer=optimizer, generations=2), tmp_path)
    assert result.champion is None
    assert result.state.best_fitness <= 0.02
    assert not (tmp_path / "champion.npz").exists()


def test_a_typo_fails_at_once_and_leaves_nothing(launched, tmp_path):
    before = sorted(os.listdir(ROOT))
    done = launched("optimizer.sgima=1", f"hydra.run.dir={tmp_path}/run")
    assert done.returncode == 2
    assert "Did you mean optimizer.sigma" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "run").exists()
    assert sorted(os.listdir(ROOT)) == before


def test_an_impossible_value_is_one_sentence(launched, tmp_path):
    done = launched("task.name=chess", f"hydra.run.dir={tmp_path}/run")
    assert done.returncode == 2
    assert "Unknown task 'chess'" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "run").exists()
