"""End-of-run summary."""

from __future__ import annotations

import signal

from ncrs.runs.assessment import EPISODES, REFERENCE_ENGINE, assess
from ncrs.runs.settings import TrainConfig
from ncrs.runs.wording import duration
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
        f"  python train.py resume={result.run_dir}",
    ]


def finished_lines(result: TrainingResult, config: TrainConfig) -> list[str]:
    """Summarise a run that finished: the champion, the folder, and commands to try next."""
    lines = [f"Finished {_effort(result)}.", ""]
    champion = result.champion
    if champion is None:
        lines.append("No genome grew a body that the task can use; try more generations.")
    else:
        sensors, wheels, cells = champion.measures
        assessment = assess(champion)
        lines += [
            f"Champion, from generation {champion.generation} ({champion.source}): "
            f"{cells} cells, {wheels} wheels, {sensors} sensors",
            *("  " + " ".join(row) for row in body_to_characters(champion.body).splitlines()),
            "  (. empty  # tissue  L light or ball sensor  T target sensor  W wheel)",
            f"On {EPISODES} fresh episodes, on {REFERENCE_ENGINE}:",
            *("  " + line for line in assessment.lines()),
        ]
    lines.append(
        f"Archive: an elite for {result.filled:,} of {result.triples:,} combinations of sensors, "
        "wheels and cells"
    )
    longer = 2 * config.generations
    return [
        *lines,
        "",
        f"Everything is in {result.run_dir}",
        "Next:",
        f"  ncrs render {result.run_dir}",
        f"  ncrs evaluate {result.run_dir}",
        f"  python train.py resume={result.run_dir} generations={longer}",
        f"  tensorboard --logdir {result.run_dir.parent}",
    ]
