"""Hashes of NCRS's results, to show that a change of the code leaves them as they are.

    python -m benchmarks.fingerprints --output before.json
    python -m benchmarks.fingerprints --compare before.json    # after the change

- ``evaluations``: populations of 112 genomes in 12 episodes, three tasks on both engines, and a
  smaller one on 7 x 7 cells (about 2 minutes on two cores).
- ``runs``: archive, champion and metrics of a short run of every optimizer; together they use
  every setting that changes results (about 4 minutes).
- ``reports``: the values in the reports of two of these runs.

Name one or more parts to compute only those. Hashes are comparable on one machine with the same
versions of numpy, torch and numba: elsewhere floating point may round differently.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

import ncrs
from benchmarks.workload import EPISODES, nearly_full_genomes
from ncrs.runs.champion import CHAMPION_FILE, load_champion_file
from ncrs.runs.metrics import METRICS_FILE
from ncrs_envs import TASKS

Fingerprint: TypeAlias = "str | dict[str, str | int]"
"""A hash, or one for each part of a result."""

ROOT = Path(__file__).parents[1]
PARTS = ("evaluations", "runs", "reports")
DIGITS = 16
"""Number of hexadecimal digits that are kept of a hash."""

EVALUATION_SEED = 3
LARGE_GRID = 7
LARGE_GRID_GENOMES, LARGE_GRID_EPISODES = 20, 5

COMMON_OVERRIDES: Mapping[str, str] = {
    "episodes": "4",
    "generations": "8",
    "champion_every": "2",
    "champion_episodes": "8",
    "seed": "5",
    "checkpoint_seconds": "1000",
    "reestimate_every": "4",
}
RUNS: Mapping[str, Mapping[str, str]] = {
    "default": {},
    "cma_es": {
        "optimizer": "cma_es",
        "optimizer.sigma": "0.1",
        "symmetric": "false",
        "mirroring": "none",
    },
    "cma_es_parents": {
        "optimizer": "cma_es",
        "optimizer.sigma": "0.1",
        "optimizer.parents": "14",
        "optimizer.step_size": "tpa",
        "symmetric": "false",
    },
    "sep": {
        "optimizer": "sep_cma_es",
        "optimizer.sigma": "0.1",
        "task": "carry_ball",
        "success_bonus": "0.1",
        "approach_bonus": "0.1",
        "placement_noise": "0.2",
        "common_scenarios": "false",
    },
    "sep_restart": {
        "optimizer": "sep_cma_es",
        "optimizer.sigma": "0.1",
        "optimizer.step_size": "decay",
        "optimizer.restart_sigma": "0.0999",
        "optimizer.restart_from": "elite",
    },
    "iso": {"optimizer": "iso_cma_es", "task": "obstacle", "start_from": "obstacle/best"},
    "cma_me": {
        "optimizer": "cma_me",
        "optimizer.sigma": "0.1",
        "optimizer.emitters": "3",
        "optimizer.patience": "1",
    },
    "cma_me_fitness": {
        "optimizer": "cma_me",
        "optimizer.sigma": "0.1",
        "optimizer.emitters": "3",
        "optimizer.ranking": "fitness",
        "optimizer.diagonal": "true",
    },
    "cma_mae": {
        "optimizer": "cma_mae",
        "optimizer.sigma": "0.1",
        "optimizer.emitters": "3",
        "optimizer.patience": "1",
        "task": "obstacle",
    },
    "map_elites": {
        "optimizer": "map_elites",
        "optimizer.initial_genomes": "300",
        "generations": "12",
    },
    "drafts": {
        "optimizer": "drafts",
        "optimizer.population": "16",
        "optimizer.descent_steps": "60",
        "task": "obstacle_touch",
        "generations": "2",
    },
    "map_elites_carry": {
        "optimizer": "map_elites",
        "optimizer.initial_genomes": "300",
        "task": "carry_ball",
        "task.distance_score": "inverse_square",
        "symmetric": "false",
        "mirroring": "none",
    },
    "box2d": {
        "engine": "box2d",
        "engine.workers": "2",
        "optimizer.sigma": "0.1",
        "optimizer.population": "16",
    },
}
"""Overrides of ``train.py`` for each run, on top of ``COMMON_OVERRIDES``."""
REPORTED_RUNS = ("default", "map_elites_carry")

_ARCHIVE_COLUMNS = (
    "genomes",
    "bodies",
    "fitness",
    "success",
    "standing_still",
    "generations",
    "seeds",
)
_TIMING_PREFIXES = ("time/", "speed/")
_ROBOT_COLUMNS = ("measures", "fitness", "success", "generation", "body")


def digest(*arrays: Any) -> str:
    """Hash arrays: their dtypes, shapes and bytes."""
    total = hashlib.sha256()
    for array in map(np.ascontiguousarray, arrays):
        total.update(str((array.dtype.str, array.shape)).encode())
        total.update(array.tobytes())
    return total.hexdigest()[:DIGITS]


def text_digest(lines: Iterable[str]) -> str:
    """Hash lines of text in any order, so that moving or renaming a value changes nothing."""
    return hashlib.sha256("\n".join(sorted(lines)).encode()).hexdigest()[:DIGITS]


def evaluation_digest(evaluation: ncrs.Evaluation) -> str:
    """Hash all arrays of an evaluation; modules that came back count where any were lost."""
    lost = [evaluation.recovered] if (evaluation.recovered != 1.0).any() else []
    return digest(
        evaluation.fitness,
        evaluation.episode_fitness,
        evaluation.success,
        evaluation.crossed,
        evaluation.closest,
        evaluation.bodies,
        evaluation.valid,
        evaluation.measures,
        *lost,
    )


def mixed_genomes(task: str) -> NDArray[np.float32]:
    """Make 112 genomes, ``(112, N)``, that cover all contacts, and invalid bodies too.

    80 have nearly full bodies, 24 are a champion and 23 mutants of it, 8 are random.
    """
    champion = ncrs.load_champion(f"{task}/best").genome
    rng = np.random.default_rng(1)
    mutants = champion + rng.normal(0.0, 0.02, (24, champion.size)).astype(np.float32)
    mutants[0] = champion
    random = rng.normal(0.0, 0.1, (8, champion.size)).astype(np.float32)
    genomes = [nearly_full_genomes(task, 80), mutants, random]
    return np.concatenate(genomes).astype(np.float32)


def evaluation_fingerprints(task: str) -> Iterator[tuple[str, Fingerprint]]:
    """Compute the hashes of a task's evaluations, each with its name."""
    genomes = mixed_genomes(task)
    for engine in ("batched", "box2d"):
        evaluation = ncrs.evaluate(
            genomes, task, engine=engine, episodes=EPISODES, seed=EVALUATION_SEED
        )
        yield f"{engine} {task}", evaluation_digest(evaluation)
    evaluation = ncrs.evaluate(
        genomes[:LARGE_GRID_GENOMES],
        task,
        engine="batched",
        episodes=LARGE_GRID_EPISODES,
        seed=EVALUATION_SEED,
        grid_size=LARGE_GRID,
    )
    yield f"batched{LARGE_GRID} {task}", evaluation_digest(evaluation)


def train(folder: Path, overrides: Mapping[str, str]) -> None:
    """Train a run into ``folder``.

    Raises:
        RuntimeError: If ``train.py`` fails; the message ends with its output.
    """
    settings = [f"{name}={value}" for name, value in overrides.items()]
    _call("train.py", f"hydra.run.dir={folder}", *settings)


def run_fingerprint(folder: Path) -> Fingerprint:
    """Hash a run's archive, champion and metrics, except metrics that depend on time."""
    archive = ncrs.load_archive(folder).archive
    columns = [archive.column(name) for name in _ARCHIVE_COLUMNS]
    fingerprint: dict[str, str | int] = {
        "archive": digest(archive.cells, *columns),
        "elites": len(archive),
    }
    if (folder / CHAMPION_FILE).is_file():
        champion = load_champion_file(folder)
        numbers = np.array([champion.fitness, champion.success, champion.generation])
        hashed = digest(champion.genome, champion.body, numbers)
        fingerprint["champion"] = f"{hashed} {champion.source}"
    with (folder / METRICS_FILE).open(newline="") as file:
        curves = [c for c in zip(*csv.reader(file), strict=True) if _is_computed(c[0])]
    hashed = text_digest(",".join(values) for _, *values in curves)
    fingerprint["metrics"] = f"{hashed} {len(curves)}"
    return fingerprint


def _is_computed(metric: str) -> bool:
    return not metric.startswith(_TIMING_PREFIXES)


def report_fingerprint(folder: Path) -> Fingerprint:
    """Hash the values in each data file of a run's report."""
    fingerprint: dict[str, str | int] = {}
    for path in sorted((folder / "report" / "data").glob("*.js")):
        values = data_of(path.read_text(encoding="utf-8"))
        if path.name == "overview.js":
            values = {name: values["robots"][name] for name in _ROBOT_COLUMNS}
        fingerprint[path.name] = text_digest(leaves(values))
    return fingerprint


def data_of(script: str) -> Any:
    """Parse the data of one of a report's scripts: the last argument of its only call."""
    start, end = script.index("(") + 1, script.rindex(")")
    return json.loads(f"[{script[start:end]}]")[-1]


def leaves(value: Any) -> Iterator[str]:
    """Iterate over all plain values in nested JSON, each as JSON."""
    if isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            yield from leaves(item)
    else:
        yield json.dumps(value)


def fingerprints(parts: Iterable[str], folder: Path) -> Iterator[tuple[str, Fingerprint]]:
    """Compute the given parts' fingerprints, each with its name; train runs into ``folder``."""
    parts = set(parts)
    if "evaluations" in parts:
        for task in TASKS:
            yield from evaluation_fingerprints(task)
    for name in RUNS if "runs" in parts else REPORTED_RUNS if "reports" in parts else ():
        train(folder / name, {**COMMON_OVERRIDES, **RUNS[name]})
        if "runs" in parts:
            yield f"run {name}", run_fingerprint(folder / name)
    if "reports" in parts:
        for name in REPORTED_RUNS:
            _call("-m", "ncrs", "report", str(folder / name))
            yield f"report {name}", report_fingerprint(folder / name)


def differences(
    before: Mapping[str, Fingerprint], after: Mapping[str, Fingerprint]
) -> list[tuple[str, Fingerprint | None, Fingerprint]]:
    """List name, value before (None if there was none) and value after of all that differs."""
    return [
        (name, before.get(name), value)
        for name, value in after.items()
        if before.get(name) != value
    ]


def _call(*arguments: str) -> None:
    """Call Python in the repository's root.

    Raises:
        RuntimeError: If it fails.
    """
    done = subprocess.run([sys.executable, *arguments], capture_output=True, text=True, cwd=ROOT)
    if done.returncode:
        raise RuntimeError(f"python {' '.join(arguments)} failed:\n{done.stdout}{done.stderr}")


def main() -> None:
    """Print fingerprints; save them, or compare them with saved ones, on request."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"default: {', '.join(PARTS)}")
    parser.add_argument("--output", type=Path, metavar="FILE", help="JSON file to write them to")
    parser.add_argument("--compare", type=Path, metavar="FILE", help="JSON file to compare with")
    options = parser.parse_args()
    if unknown := set(options.parts) - set(PARTS):
        parser.error(f"unknown parts {sorted(unknown)}; choose among {', '.join(PARTS)}")
    before = json.loads(options.compare.read_text()) if options.compare else None

    found: dict[str, Fingerprint] = {}
    with tempfile.TemporaryDirectory(prefix="fingerprints-") as folder:
        for name, fingerprint in fingerprints(options.parts or PARTS, Path(folder)):
            found[name] = fingerprint
            print(f"{name}: {json.dumps(fingerprint)}", flush=True)
    if options.output:
        options.output.write_text(json.dumps(found, indent=1) + "\n")
    if before is not None:
        different = differences(before, found)
        for name, old, new in different:
            print(f"\n{name} differs:\n  before {json.dumps(old)}\n  after  {json.dumps(new)}")
        print(f"\n{len(found) - len(different)} of {len(found)} fingerprints are equal.")
        sys.exit(bool(different))


if __name__ == "__main__":
    main()
