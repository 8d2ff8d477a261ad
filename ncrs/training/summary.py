"""End-of-run summary."""

from __future__ import annotations

import shlex
import signal
from pathlib import Path

from ncrs.runs.assessment import REFERENCE_ENGINE, Assessment
from ncrs.runs.champion import Champion
from ncrs.runs.settings import TrainConfig
from ncrs.runs.wording import duration, override, train_command
from ncrs.training.state import TrainingResult
from ncrs_envs.body import body_to_characters


def _effort(result: TrainingResult) -> str:
    state = result.state
    return (
        f"{state.generation} generations, {state.evaluations:,} evaluations, "
        f"{state.env_steps:,} environment steps in {duration(state.seconds)}"
    )


def exit_code(stopped_by: signal.Signals) -> int:
    """Return the shell's code for a process that a signal ended."""
    return 128 + stopped_by


def stopped_lines(result: TrainingResult, stopped_by: signal.Signals) -> list[str]:
    """Summarise a run that a signal ended."""
    return [
        f"Stopped by {stopped_by.name} after {_effort(result)}. All is saved; continue with:",
        f"  {train_command()} {override('resume', result.run_dir)}",
    ]


def finished_lines(
    result: TrainingResult, config: TrainConfig, assessment: Assessment | None
) -> list[str]:
    """Summarise a run that finished: the champion, the folder, and commands to try next.

    Args:
        result: Result of the training.
        config: Settings of the run.
        assessment: Test of the champion on fresh episodes; None without one.
    """
    lines = [f"Finished {_effort(result)}.", ""]
    champion = result.champion
    if champion is None or assessment is None:
        lines.append("No genome grew a body that the task can use; try more generations.")
    else:
        sensors, wheels, cells = champion.measures
        lines += [
            f"Champion, from generation {champion.generation} ({champion.source}): "
            f"{cells} cells, {wheels} wheels, {sensors} sensors",
            *("  " + " ".join(row) for row in body_to_characters(champion.body).splitlines()),
            "  (. empty  # tissue  L light or ball sensor  T target sensor  W wheel)",
            f"On {assessment.success.episodes} fresh episodes, on {REFERENCE_ENGINE}:",
            *("  " + line for line in assessment.lines()),
        ]
    lines.append(
        f"Archive: an elite for {result.filled:,} of {result.triples:,} combinations of sensors, "
        "wheels and cells"
    )
    longer = 2 * config.generations
    quoted = shlex.quote(str(result.run_dir))
    return [
        *lines,
        "",
        f"Everything is in {result.run_dir}",
        "Next:",
        f"  ncrs render {quoted}",
        f"  ncrs evaluate {quoted}",
        f"  {train_command()} {override('resume', result.run_dir)} generations={longer}",
        f"  tensorboard --logdir {shlex.quote(str(result.run_dir.parent))}",
    ]


def job_line(folder: Path, champion: Champion | None, assessment: Assessment | None) -> str:
    """Summarise a finished run of a sweep in one line.

    Args:
        folder: Folder of the run.
        champion: Champion of the run; None if no body was valid.
        assessment: Test of the champion on fresh episodes; None without one.
    """
    if champion is None:
        return f"{folder}: no genome grew a body that the task can use."
    if assessment is None:
        return f"{folder}: fitness {champion.fitness:.3f}."
    fraction, low, high = assessment.success.percentages()
    return (
        f"{folder}: fitness {assessment.fitness:.3f}, success {fraction} "
        f"(95 % interval {low} to {high})."
    )
