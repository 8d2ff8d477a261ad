"""Tests of the published champions and of runs, and publication of a run's champion.

    python -m benchmarks.results                      # the table of docs/results.md
    python -m benchmarks.results --runs RUN ...       # the same for runs, with their cost
    python -m benchmarks.results --collect RUN NAME   # RUN's champion becomes assets/champions/NAME

The test is 1,000 fresh episodes, on Box2D and on the batched engine, as ``ncrs evaluate`` runs them
with ``--episodes 1000 --seed 1``. No robot or setting was chosen by these episodes.
"""

from __future__ import annotations

import argparse
import re
import shutil
import tempfile
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import yaml
from PIL import Image

from ncrs.commands.archive import reestimated
from ncrs.engines.base import AUTO_ENGINE, usable_engines
from ncrs.engines.evaluate import EPISODES
from ncrs.runs.assessment import Assessment, assess
from ncrs.runs.champion import CHAMPION_FILE, Champion, load_champion_file
from ncrs.runs.checkpoint import write_json
from ncrs.runs.elites import load_archive
from ncrs.runs.metrics import read_metrics
from ncrs.runs.published import (
    CARD_SUFFIX,
    CHAMPION_SUFFIX,
    PICTURE_SUFFIX,
    champions,
    champions_folder,
    file_stem,
    load_champion,
)
from ncrs.runs.settings import load_config
from ncrs.viz.pictures import STORY_FILE, save_pictures

TEST_EPISODES, SEED = 1000, 1
PICTURE_SIZE = 240
HEADINGS = (
    "evaluations | fitness, Box2D | success, Box2D (95 %) | crossed | fitness, batched | "
    "success, batched"
)
_RULE = "---|" * (HEADINGS.count("|") + 1)
_NAME = re.compile(r"[a-z0-9_]+/[a-z0-9_]+")
_ARCHIVE_KEYS = ("filled", "filled_fraction", "qd_score", "best", "beat_standing_still", "succeed")


def tested(champion: Champion) -> dict[str, Assessment]:
    """Assess a champion on each engine."""
    return {
        engine: assess(champion, engine=engine, episodes=TEST_EPISODES, seed=SEED)
        for engine in usable_engines()
    }


@dataclass(frozen=True)
class Training:
    """Training behind a run's champion: its own run and all earlier stages."""

    commands: list[str]
    """Command lines, in order."""
    generations: int
    evaluations: int
    env_steps: int


def training_of(run: Path) -> Training:
    """Sum up the training of a run's champion, from its stages' folders and the card it began with.

    Raises:
        ConfigError: If a stage is missing.
    """
    start = load_config(run).start_from
    if start is None:
        before = Training([], 0, 0, 0)
    elif not Path(start).exists() and start in champions():
        card = load_champion(start).card
        before = Training(**{field.name: card[field.name] for field in fields(Training)})
    else:
        before = training_of(_folder(start))
    table = read_metrics(run)
    return Training(
        commands=[*before.commands, command_of(run)],
        generations=before.generations + len(table["generation"]),
        evaluations=before.evaluations + int(table["progress/evaluations"][-1]),
        env_steps=before.env_steps + int(table["progress/env_steps"][-1]),
    )


def command_of(run: Path) -> str:
    """Reconstruct the command line that trained a run, in a folder of its own name.

    ``generations`` has its last value, since resuming may have raised it.
    """
    recorded = run / ".hydra"
    words = yaml.safe_load((recorded / "overrides.yaml").read_text())
    words = [word for word in words if not word.startswith(("hydra.", "resume="))]
    generations = load_config(run).generations
    if yaml.safe_load((recorded / "config.yaml").read_text())["generations"] != generations:
        words = [word for word in words if not word.startswith("generations=")]
        words.append(f"generations={generations}")
    return " ".join(["python train.py", *map(_shortened, words), f"hydra.run.dir=runs/{run.name}"])


def _shortened(word: str) -> str:
    name, _, value = word.partition("=")
    return f"{name}={_start_name(value)}" if name == "start_from" else word


def _start_name(start: str) -> str:
    return start if start in champions() else f"runs/{_folder(start).name}"


def _folder(start: str) -> Path:
    """Find the folder of a run that ``start_from`` names by folder or champion's file."""
    path = Path(start)
    return path.parent if path.name == CHAMPION_FILE else path


def archive_of(run: Path) -> dict[str, Any]:
    """Compute an archive's statistics as training left it, and with all elites re-estimated."""
    elites = load_archive(run)
    fresh, _ = reestimated(elites, AUTO_ENGINE, 0, EPISODES)
    return {
        name: {key: one.archive.statistics()[key] for key in _ARCHIVE_KEYS}
        for name, one in (("trained", elites), ("reestimated", fresh))
        if len(one.archive)
    }


def collect(run: Path, name: str) -> None:
    """Test a run's champion and write its genome, card and picture."""
    if not _NAME.fullmatch(name):
        raise SystemExit(f"NAME must be a task and a recipe, such as light_chase/best, got {name}.")
    champion = load_champion_file(run)
    config, training = asdict(load_config(run)), training_of(run)
    if config["start_from"] is not None:
        config["start_from"] = _start_name(config["start_from"])
    stem = champions_folder() / file_stem(name)
    stem.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(run / CHAMPION_FILE, stem.with_suffix(CHAMPION_SUFFIX))
    card = {
        "name": name,
        **asdict(training),
        "config": {key: value for key, value in config.items() if key != "resume"},
        "generation": champion.generation,
        "source": champion.source,
        "tests": {engine: result.as_json() for engine, result in tested(champion).items()},
        "archive": archive_of(run),
    }
    write_json(stem.with_suffix(CARD_SUFFIX), card)
    with tempfile.TemporaryDirectory() as folder:
        save_pictures(champion, Path(folder), size=PICTURE_SIZE)
        with Image.open(Path(folder) / STORY_FILE) as picture:
            picture.quantize(128).save(stem.with_suffix(PICTURE_SUFFIX), optimize=True)
    print(f"Published {name} in {stem.parent}")


def cells_of(champion: Champion) -> str:
    """Test a champion, and format the results as cells of a table's row."""
    results = tested(champion)
    reference, batched = results["box2d"], results["batched"]
    success, low, high = reference.success.percentages()
    crossed = "-" if reference.crossed is None else reference.crossed.percentages()[0]
    return (
        f"{reference.fitness:.4f} | {success} ({low} to {high}) | {crossed} "
        f"| {batched.fitness:.4f} | {batched.success.percentages()[0]} |"
    )


def table() -> None:
    """Print a row for each champion, tested again."""
    print(f"| champion | {HEADINGS} |")
    print(f"|---|{_RULE}")
    for name in champions():
        champion = load_champion(name)
        evaluations = champion.card["evaluations"]
        print(f"| `{name}` | {evaluations:,} | {cells_of(champion)}", flush=True)


def table_of_runs(runs: list[Path]) -> None:
    """Print a row for each run: its settings, its cost, and the test of its champion."""
    print(f"| task | optimizer | triples filled | {HEADINGS} |")
    print(f"|---|---|---|{_RULE}")
    for run in runs:
        config, archive = load_config(run), load_archive(run).archive
        evaluations = training_of(run).evaluations
        found = (run / CHAMPION_FILE).is_file()
        cells = cells_of(load_champion_file(run)) if found else "no valid body | | | | |"
        print(
            f"| {config.task.name} | {config.optimizer.name} | {len(archive):,} "
            f"| {evaluations:,} | {cells}",
            flush=True,
        )


def main() -> None:
    """Collect a run, or print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    either = parser.add_mutually_exclusive_group()
    either.add_argument("--collect", nargs=2, metavar=("RUN", "NAME"))
    either.add_argument("--runs", nargs="+", type=Path, metavar="RUN")
    options = parser.parse_args()
    if options.runs is not None:
        table_of_runs(options.runs)
    elif options.collect is None:
        table()
    else:
        collect(Path(options.collect[0]), options.collect[1])


if __name__ == "__main__":
    main()
