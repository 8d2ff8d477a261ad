"""One job of Hydra's: a single run, or a run of a sweep, which is skipped, resumed or started."""

from __future__ import annotations

import shutil
import signal
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig

from ncrs.runs.assessment import Assessment, assess, find_assessment, save_assessment
from ncrs.runs.champion import Champion, find_champion
from ncrs.runs.checkpoint import CHECKPOINT_FOLDER, generations_done
from ncrs.runs.engine_settings import ConfigError
from ncrs.runs.failure import clear_failure, save_failure, save_refusal
from ncrs.runs.lock import RunIsLockedError
from ncrs.runs.settings import TrainConfig, check_same_settings, lasting_settings, load_config
from ncrs.runs.wording import program_name
from ncrs.training.files import holds_run
from ncrs.training.hydra import BASIC_SWEEPER, train_config
from ncrs.training.signals import OF_SCHEDULERS
from ncrs.training.state import TrainingResult
from ncrs.training.summary import exit_code, finished_lines, job_line, stopped_lines
from ncrs.training.trainer import train
from ncrs_envs.cores import available_cores
from ncrs_envs.errors import NCRSError

NO_CHAMPION = 0.0
"""Result for a sweeper of a run without a champion: no body was valid."""


class _ForeignRunError(ConfigError):
    """A job whose folder holds a run with other settings."""


def run_job(composed: DictConfig) -> float:
    """Run one job and return the champion's fitness, for Hydra's sweepers."""
    hydra = HydraConfig.get()
    folder = _relative(Path(hydra.runtime.output_dir))
    if hydra.mode == RunMode.MULTIRUN:
        return _run_job_of_sweep(composed, folder)
    try:
        with _no_folder_if_refused(folder):
            config = train_config(composed, list(hydra.overrides.task))
        if config.resume is not None:
            folder = _relative(Path(config.resume))
        result, assessment = _trained(config, folder)
    except NCRSError as error:
        # Hydra would print the traceback of an exception.
        print(f"{program_name()}: {error}", file=sys.stderr)
        raise SystemExit(2) from error
    print("\n".join(finished_lines(result, config, assessment)))
    return NO_CHAMPION if result.champion is None else result.champion.fitness


def _relative(folder: Path) -> Path:
    """Return a path from here, which is shorter, if the folder lies below."""
    try:
        return folder.resolve().relative_to(Path.cwd())
    except ValueError:
        return folder


@contextmanager
def _no_folder_if_refused(folder: Path) -> Iterator[None]:
    """Remove what Hydra wrote for a job if its settings are refused in the block."""
    try:
        yield
    except NCRSError:
        if {path.name for path in folder.iterdir()} <= {".hydra"}:
            shutil.rmtree(folder)
        raise


def _trained(config: TrainConfig, folder: Path) -> tuple[TrainingResult, Assessment | None]:
    """Train and test the champion; leave the process if a signal ended the training."""
    result = train(config, folder)
    _leave_if_stopped(result)
    if result.champion is None:
        return result, None
    assessment = assess(result.champion)
    save_assessment(assessment, folder)
    return result, assessment


def _leave_if_stopped(result: TrainingResult) -> None:
    if result.stopped_by is None:
        return
    print("\n".join(stopped_lines(result, result.stopped_by)), flush=True)
    if result.stopped_by.name in OF_SCHEDULERS:
        signal.raise_signal(result.stopped_by)  # the scheduler's handler queues the job again
    sys.exit(exit_code(result.stopped_by))


def _run_job_of_sweep(composed: DictConfig, folder: Path) -> float:
    """Run a job of a sweep; a failure is recorded in its folder.

    A grid's other jobs go on after a failure; a sweeper that learns from the results is told.
    """
    hydra = HydraConfig.get()
    overrides = list(hydra.overrides.task)
    try:
        champion = _continued(train_config(composed, overrides), folder)
        clear_failure(folder)
    except Exception as error:
        if isinstance(error, _ForeignRunError | RunIsLockedError):
            save_refusal(folder, str(error))
        else:
            trace = None if isinstance(error, NCRSError) else traceback.format_exc()
            save_failure(folder, str(error), overrides, trace)
        print(f"{folder.name} failed: {error}", file=sys.stderr, flush=True)
        if hydra.sweeper["_target_"] != BASIC_SWEEPER:
            raise
        return float("nan")
    return NO_CHAMPION if champion is None else champion.fitness


def _continued(config: TrainConfig, folder: Path) -> Champion | None:
    """Start the run of a job, or resume it, or skip it if it has finished."""
    if holds_run(folder):
        try:
            check_same_settings(lasting_settings(load_config(folder)), lasting_settings(config))
        except ConfigError as error:
            raise _ForeignRunError(
                f"{folder} holds another run. {error} Use another hydra.sweep.dir."
            ) from error
        if generations_done(folder / CHECKPOINT_FOLDER) == config.generations:
            champion = find_champion(folder)
            assessment = find_assessment(folder, champion)
            if champion is None or assessment is not None:
                print(f"Finished before: {job_line(folder, champion, assessment)}", flush=True)
                return champion
        config = replace(config, resume=str(folder))
    result, assessment = _trained(_with_share_of_cores(config), folder)
    print(job_line(folder, result.champion, assessment), flush=True)
    return result.champion


def _with_share_of_cores(config: TrainConfig) -> TrainConfig:
    """Give the engine this job's share of the cores, where a launcher runs several at once."""
    side_by_side = HydraConfig.get().launcher.get("n_jobs") or 1
    if side_by_side == 1 or config.engine.workers is not None:
        return config
    cores = available_cores()
    jobs = cores if side_by_side < 0 else side_by_side
    return replace(config, engine=replace(config.engine, workers=max(1, cores // jobs)))
