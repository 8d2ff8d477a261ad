"""The command line of training, checked before Hydra makes a folder for it."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from hydra import compose, initialize_config_dir
from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra._internal.utils import get_args_parser
from hydra.core.override_parser.types import Override
from hydra.errors import HydraException
from omegaconf import open_dict

from ncrs.runs.engine_settings import ConfigError
from ncrs.training.files import check_new_run
from ncrs.training.hydra import (
    BASIC_SWEEPER,
    CONFIG_NAME,
    HYDRA_VERSION,
    errors_of_hydra,
    parse_overrides,
    train_config,
)
from ncrs_envs.errors import NCRSError

_MOST_CHECKED_JOBS = 100
"""Number of a sweep's jobs that are checked before the first one starts: 20 take a second."""
_NAMED_KEYS = "hydra.job.config.override_dirname.exclude_keys"


class Sweep(NamedTuple):
    """What the command line of a sweep asks for."""

    jobs: int | None
    """Number of jobs; None if a sweeper decides."""
    refused: Sequence[str]
    """Messages for jobs that will be refused."""
    overrides: Sequence[str]
    """Overrides to add, by which each job's name is of what was swept alone."""


def check_arguments(arguments: Sequence[str], folder: Path) -> Sweep | None:
    """Check command-line arguments.

    Args:
        arguments: Command-line arguments.
        folder: Folder of ``config.yaml``.

    Returns:
        What a sweep asks for; None for a single run, and for flags that only print.

    Raises:
        NCRSError: If a setting is unknown, a value out of range, or ``resume`` invalid, in a single
            run or in all jobs of a sweep; or if the run's folder already holds a run.
    """
    given = get_args_parser().parse_args(list(arguments))
    prints = (given.help, given.hydra_help, given.cfg, given.info, given.shell_completion)
    if any(prints) or given.config_path or given.experimental_rerun:
        return None
    name = given.config_name or CONFIG_NAME
    with initialize_config_dir(str(folder), version_base=HYDRA_VERSION), errors_of_hydra():
        overrides = [*given.overrides, *_search_path(given)]
        if given.multirun:
            return _check_sweep(name, overrides)
        _check_run(name, overrides)
    return None


def _search_path(given: argparse.Namespace) -> list[str]:
    if given.config_dir is None:
        return []
    folder = str(Path(given.config_dir).absolute()).replace("'", "\\'")
    return [f"hydra.searchpath=['file://{folder}']"]


def _check_run(name: str, overrides: Sequence[str]) -> None:
    composed = compose(name, list(overrides), return_hydra_config=True)
    run_dir = Path(str(composed.hydra.run.dir))
    with open_dict(composed):
        del composed["hydra"]
    config = train_config(composed, overrides)
    if config.resume is None:
        check_new_run(run_dir)


def _check_sweep(name: str, overrides: Sequence[str]) -> Sweep:
    parsed = parse_overrides(overrides)
    if any(override.key_or_group == "resume" for override in parsed):
        raise ConfigError(
            "resume continues one run; start a sweep again with its hydra.sweep.dir, which "
            "resumes all its runs."
        )
    fixed = [override for override in parsed if not override.is_sweep_override()]
    first = [*(override.input_line or "" for override in fixed), *_first_choices(parsed)]
    hydra = compose(name, first, return_hydra_config=True).hydra
    grid = hydra.sweeper["_target_"] == BASIC_SWEEPER
    # What another sweeper will choose is not known: its first choices are checked.
    jobs = _jobs_of_grid(parsed) if grid else [first]
    refused: list[NCRSError | HydraException] = []
    for job in jobs[:_MOST_CHECKED_JOBS]:
        try:
            with errors_of_hydra():
                train_config(compose(name, job), job)
        except NCRSError as error:
            refused.append(error)
    if len(refused) == len(jobs):
        raise refused[0]
    chosen = any(word.startswith(_NAMED_KEYS) for word in overrides)
    exclude = [] if chosen else [override.get_key_element() for override in fixed]
    return Sweep(
        jobs=len(jobs) if grid else None,
        refused=[str(error) for error in refused],
        overrides=[f"{_NAMED_KEYS}=[{','.join(exclude)}]"] if exclude else [],
    )


def _first_choices(overrides: list[Override]) -> list[str]:
    """Choose the first value of each setting that is swept over a list."""
    swept = [override for override in overrides if override.is_sweep_override()]
    return [
        f"{override.get_key_element()}={next(iter(override.sweep_string_iterator()))}"
        for override in swept
        if override.is_discrete_sweep()
    ]


def _jobs_of_grid(overrides: list[Override]) -> list[list[str]]:
    """List the overrides of each job of a grid."""
    for override in overrides:
        if override.is_sweep_override() and not override.is_discrete_sweep():
            raise ConfigError(
                f"{override.input_line} is not a list of values: sweep over it with a sweeper that "
                "searches, such as hydra/sweeper=ncrs_optuna."
            )
    return [list(job) for job in BasicSweeper.split_arguments(overrides, None)[0]]
