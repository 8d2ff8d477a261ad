"""The command that trains: ``ncrs train``, which ``train.py`` also is."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import hydra
from hydra.errors import HydraException
from hydra.experimental.callback import Callback
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from ncrs.runs.engine_settings import ConfigError
from ncrs.runs.failure import clear_refusals, refusals
from ncrs.runs.resources import resource_folder
from ncrs.runs.wording import override, program_name, train_command
from ncrs.training.arguments import Sweep, check_arguments
from ncrs.training.hydra import CONFIG_NAME, HYDRA_VERSION, config_error, register
from ncrs_envs.errors import NCRSError

_FULL_ERROR = "HYDRA_FULL_ERROR"
_INTERRUPTED = 130
"""The shell's code for a process that Ctrl-C ended."""
_started: list[Path] = []
"""Folder of the sweep that this process runs."""


class SweepCallback(Callback):
    """Hydra's callback, which remembers the folder of a sweep and prepares it."""

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Make the folder, and let a sweeper build its study again from the runs in it."""
        folder = Path(str(config.hydra.sweep.dir))
        folder.mkdir(parents=True, exist_ok=True)
        _started.append(folder)
        clear_refusals(folder)
        storage = OmegaConf.select(config, "hydra.sweeper.storage")
        study = folder / "study.db"
        if storage == f"sqlite:///{config.hydra.sweep.dir}/study.db" and study.exists():
            # The runs are the record: finished ones return their results at once, so that the same
            # sampler proposes the same trials again, and goes on from there.
            study.replace(study.with_name("study.previous.db"))


def launch(arguments: Sequence[str]) -> None:
    """Run the command line; bad input ends with one sentence and exit code 2."""
    # Hydra's parser takes flags before or after all settings, not among them.
    arguments = sorted(arguments, key=lambda word: word not in ("-m", "--multirun"))
    try:
        register()
        folder = resource_folder("conf")
        if list(arguments[-1:]) in (["--config-dir"], ["-cd"]):
            print(folder)
            return
        sweep = check_arguments(arguments, folder)
        from ncrs.training.jobs import (
            run_job,  # torch takes seconds: refused settings need not wait
        )

        main = hydra.main(
            version_base=HYDRA_VERSION, config_path=str(folder), config_name=CONFIG_NAME
        )(run_job)
        if sweep is None:
            _run(main, arguments)
        else:
            _run_sweep(main, arguments, sweep)
    except NCRSError as error:
        print(f"{program_name()}: {error}", file=sys.stderr)
        raise SystemExit(2) from error
    except OSError as error:
        place = error.filename or "the folder of the run"
        print(
            f"{program_name()}: Could not write {place}: {error.strerror or error}. Use another "
            "folder, or change permissions.",
            file=sys.stderr,
        )
        raise SystemExit(2) from error


def _run(main: Callable[[], Any], arguments: Sequence[str]) -> None:
    previous, shown = sys.argv, os.environ.get(_FULL_ERROR)
    sys.argv = [previous[0], *arguments]
    os.environ[_FULL_ERROR] = "1"  # else Hydra prints a traceback of its own, and exits
    try:
        try:
            main()
        except (HydraException, OmegaConfBaseException) as error:
            raise config_error(error) from error
    finally:
        sys.argv = previous
        if shown is None:
            del os.environ[_FULL_ERROR]
        else:
            os.environ[_FULL_ERROR] = shown


def _run_sweep(main: Callable[[], Any], arguments: Sequence[str], sweep: Sweep) -> None:
    """Run a sweep, report its results, and fail if one of its jobs did."""
    for message in sweep.refused:
        print(f"{program_name()}: one job will be refused: {message}", file=sys.stderr)
    _started.clear()
    code: Any = 0
    try:
        _run(main, [*arguments, *sweep.overrides])
    except KeyboardInterrupt:
        code = _INTERRUPTED
    except SystemExit as error:
        code = error.code
    except Exception as error:  # a launcher's or a sweeper's own, such as a missing SLURM
        if not _started:
            raise
        print(f"{program_name()}: the sweep ended early: {error}", file=sys.stderr)
        code = 1
    if not _started:
        raise SystemExit(code)
    folder = _started[0]
    complete = _report(folder, sweep.jobs)
    if code or not complete:
        rest = [word for word in arguments if not word.startswith("hydra.sweep.dir=")]
        words = [*map(shlex.quote, rest), override("hydra.sweep.dir", folder)]
        command = " ".join([train_command(), *words])
        print(f"To resume the unfinished runs and repeat the failed ones:\n  {command}")
        raise SystemExit(code or 1)


def _report(folder: Path, jobs: int | None) -> bool:
    """Print and save the table of a sweep; return True if each of its jobs has finished."""
    from ncrs.runs.results import Results, collect_results, save_results

    try:
        results = collect_results([folder])
    except ConfigError:  # no job has written anything yet
        results = Results((), (), ())
    print()
    print("\n".join(results.lines()))
    missing = 0 if jobs is None else max(0, jobs - len(results.rows))
    if missing:
        print(f"Not started: {missing} of {jobs} jobs.")
    paths = save_results(results, folder) if results.rows else []
    for path in paths:
        print(f"Saved {path}")
    return missing == 0 and results.complete and not refusals(folder)
