"""Crash a command at every one of its file operations, and see what is left.

    python -m tests.faults.harness COMMAND [--every N] [--modes die ENOSPC ...] [--once]

Prints one JSON line: the numbers of operations and of crashes tried, and the findings. A training
run must resume to the end that an undisturbed one has, a command that writes files must leave each
of them as it was or as it becomes, and nothing else; every error must be a sentence.

Each crash happens in a process of its own, forked from this one, which has compiled all kernels.
"""

from __future__ import annotations

import argparse
import contextlib
import gzip
import hashlib
import io
import json
import os
import pickle
import shutil
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import torch
from tqdm import tqdm

import ncrs
from ncrs.cli import main
from ncrs.evolution.optimizers import OPTIMIZERS
from ncrs.runs.assessment import assess
from ncrs.runs.champion import load_champion_file
from ncrs.runs.checkpoint import CHECKPOINT_FOLDER, CheckpointFolder
from ncrs.training import jobs
from ncrs.training.files import holds_run
from ncrs_envs.errors import NCRSError
from tests.faults.file_layer import DIED, MODES, FileLayer, modes_of

REFUSED, FOUND = 2, 3
EMITTERS = {"sigma": 0.02, "population": 8, "emitters": 2, "diagonal": True}
OPTIMIZER_SETTINGS: dict[str, dict[str, Any]] = {
    "cma_es": {"sigma": 0.02, "population": 8, "parents": None},
    "sep_cma_es": {"sigma": 0.02, "population": 8, "parents": None},
    "iso_cma_es": {"sigma": 0.02, "population": 8, "parents": None},
    "cma_me": EMITTERS,
    "cma_mae": EMITTERS,
    "map_elites": {"population": 8, "initial_genomes": 8},
    "drafts": {"population": 8, "descent_steps": 60},
}
WRITERS = {
    "evaluate": (["--episodes", "2"], ["--episodes", "4"]),
    "archive": (["--export", "csv"], ["--export", "csv"]),
    "reestimate": (["--reestimate", "--episodes", "1"], ["--reestimate", "--episodes", "2"]),
    "pyribs": (["--export", "pyribs"], ["--export", "pyribs"]),
    "results": ([], []),
    "render": (["--size", "64"], ["--size", "96"]),
    "figures": (["--episodes", "1"], ["--episodes", "2"]),
    "film": (
        ["--episodes", "1", "--speed", "4", "--height", "240"],
        ["--episodes", "1", "--speed", "4", "--height", "360"],
    ),
    "report": (
        ["--episodes", "1", "--elites", "champion"],
        ["--episodes", "2", "--elites", "champion"],
    ),
}
"""Options of commands that write files, and those of the older files that they replace."""
ARCHIVE = ("archive", "reestimate", "pyribs")
TRAIN, RESUME, SWEEP = "train", "resume", "sweep"
COMMANDS = (*(f"{TRAIN} {name}" for name in OPTIMIZERS), RESUME, SWEEP, *WRITERS)
_GENERATIONS = 2


def settings_of(optimizer: str) -> dict[str, Any]:
    """Settings of a run that takes a fraction of a second and does all that runs do."""
    settings = {
        "optimizer": {"name": optimizer, **OPTIMIZER_SETTINGS[optimizer]},
        "engine": {"name": "batched", "workers": 1},
        "generations": _GENERATIONS, "episodes": 2, "champion_every": 1, "champion_episodes": 2,
        "checkpoint_seconds": 0, "seed": 4,
    }  # fmt: skip
    if optimizer == "map_elites":  # with this seed 16 random genomes grow a valid body
        return settings
    if optimizer == "drafts":
        return {**settings, "symmetric": False}
    return {**settings, "start_from": "light_chase/best"}


def in_child(work: Callable[[], Any], layer: FileLayer | None = None) -> tuple[int, Any]:
    """Run in a forked process: its exit code, and its result or error as JSON values."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        code, result = _guarded(work, layer)
        with os.fdopen(writer, "w") as stream:
            json.dump(result, stream)
        os._exit(code)
    os.close(writer)
    with os.fdopen(reader) as stream:
        text = stream.read()
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status), json.loads(text) if text else None


def _guarded(work: Callable[[], Any], layer: FileLayer | None) -> tuple[int, Any]:
    errors = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(errors):
        warnings.simplefilter("ignore")
        if layer is not None:
            layer.install()
        try:
            result = work()
        except NCRSError as error:
            return (FOUND if "Traceback" in errors.getvalue() else REFUSED), str(error)
        except SystemExit as error:
            is_refused = error.code in (REFUSED, 1) and "Traceback" not in errors.getvalue()
            return (REFUSED if is_refused else FOUND), errors.getvalue()[-2000:]
        except BaseException:
            return FOUND, traceback.format_exc()[-2000:]
    return 0, layer.points if layer is not None else result


def digest(value: Any) -> str:
    """Digest of nested dicts and lists of arrays, but for what differs between equal runs."""
    if isinstance(value, dict):
        names = sorted(set(value) - {"seconds", "versions"})
        value = "".join(name + digest(value[name]) for name in names)
    elif isinstance(value, list):
        value = "".join(map(digest, value))
    data = value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode()
    return hashlib.sha256(data).hexdigest()


def outcome_of_run(folder: Path) -> dict[str, Any]:
    """All that a run is for: its last state, its champion, and its curves."""
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    from ncrs.runs.metrics import read_metrics

    events = EventAccumulator(str(folder), size_guidance={"scalars": 0})
    events.Reload()
    metrics = read_metrics(folder)
    curves = [name for name in metrics if not name.startswith("time/") and "per_s" not in name]
    archive = ncrs.load_archive(folder).archive
    return {
        "state": digest(CheckpointFolder(folder / CHECKPOINT_FOLDER).load()),
        "champion": digest(load_champion_file(folder).genome),
        "archive": digest(archive.state()),
        "metrics": {name: digest(metrics[name]) for name in curves},
        "events": {
            tag: [event.step for event in events.Scalars(tag)]
            for tag in events.Tags()["scalars"]
            if not tag.startswith("time/")  # of the generation before, in the same process
        },
        "leftovers": leftovers(folder),
    }


def leftovers(folder: Path) -> list[str]:
    """Temporary files in a folder."""
    return sorted(path.name for path in folder.rglob("*") if path.name.endswith(".tmp"))


@dataclass
class Subject:
    """A command to crash: how to begin, what to run, also after a crash, and what must come."""

    prepare: Callable[[Path], None]
    run: Callable[[Path], Any]
    outcome: Callable[[Path], Any]
    intact: Callable[[Path, bool], None]
    """Raises ``AssertionError`` if what is left is not as promised, after a crash (True) or after
    an error."""


def training(optimizer: str, done: int) -> Subject:
    """A run of an optimizer, after ``done`` generations."""

    def begin(folder: Path) -> None:
        if done:
            code, error = in_child(lambda: train(folder, done))
            assert code == 0, error

    def train(folder: Path, generations: int = _GENERATIONS) -> None:
        settings = {**settings_of(optimizer), "generations": generations}
        if holds_run(folder):
            settings = {"generations": generations, "resume": True}
        ncrs.train(folder, progress=False, **settings)

    def readable(folder: Path, is_dead: bool) -> None:
        assert is_dead or not leftovers(folder), leftovers(folder)
        if holds_run(folder):
            for read in (load_champion_file, ncrs.load_archive):
                with contextlib.suppress(NCRSError):
                    read(folder)
            main(["results", str(folder), "--output", str(folder.parent / "results")])

    return Subject(begin, train, outcome_of_run, readable)


def sweep() -> Subject:
    """A sweep over two seeds, with Hydra's own launcher."""
    words = [
        "-m", "seed=0,1", "optimizer=sep_cma_es", "optimizer.population=8",
        "optimizer.parents=null", "optimizer.sigma=0.02",
        "generations=1", "episodes=2", "champion_every=1", "champion_episodes=2",
        "start_from=light_chase/best", "engine.workers=1",
    ]  # fmt: skip

    def run(folder: Path) -> None:
        with mock.patch.object(jobs, "assess", partial(assess, episodes=2)):
            main(["train", *words, f"hydra.sweep.dir={folder}"])

    def outcome(folder: Path) -> Any:
        table = (folder / "results.csv").read_text()
        return {"table": table, "leftovers": leftovers(folder)}

    return Subject(lambda _: None, run, outcome, lambda *_: None)


def writer(name: str, run_folder: Path, old: Path, new: Path) -> Subject:
    """A command that writes files about a run, over older ones.

    Args:
        name: Name in ``WRITERS``.
        run_folder: Folder of the run.
        old: Folder for the older files.
        new: Folder for the files that replace them.
    """
    command = "archive" if name in ARCHIVE else name

    def run(folder: Path, options: Sequence[str] = WRITERS[name][0]) -> None:
        main([command, str(run_folder), *options, "--output", str(folder)])

    run(old, WRITERS[name][1])
    run(new)
    before, after = files(old), files(new)

    def intact(folder: Path, is_dead: bool) -> None:
        left = files(folder)
        if is_dead:  # the next command clears away what is hidden
            left = {path: left[path] for path in left if not path.split("/")[-1].startswith(".")}
        for path, content in left.items():
            assert content in (before.get(path), after.get(path)), path
        assert set(before) & set(after) <= set(left), sorted(left)

    def prepare(folder: Path) -> None:
        shutil.copytree(old, folder)

    return Subject(prepare, run, files, intact)


def files(folder: Path) -> dict[str, str]:
    """Names and digests of the files in a folder, temporary ones included."""
    return {
        str(path.relative_to(folder)): _content(path)
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def _content(path: Path) -> str:
    if path.name.endswith(".pkl.gz"):  # the empty cells of pyribs' archives hold anything
        with gzip.open(path) as stream:
            return digest(dict(pickle.load(stream).data()))
    return hashlib.sha256(path.read_bytes()).hexdigest()


@contextlib.contextmanager
def subject_of(command: str) -> Iterator[Subject]:
    """Make the subject of one of ``COMMANDS``; writers get a run to write about."""
    with tempfile.TemporaryDirectory() as place:
        if command.startswith(TRAIN):
            yield training(command.removeprefix(f"{TRAIN} "), 0)
        elif command == RESUME:
            yield training("sep_cma_es", 1)
        elif command == SWEEP:
            yield sweep()
        else:
            folder = Path(place, "run")
            settings = settings_of("map_elites" if command in ARCHIVE else "sep_cma_es")
            code, error = in_child(lambda: ncrs.train(folder, progress=False, **settings) and None)
            assert code == 0, error
            quiet = contextlib.redirect_stderr(io.StringIO())
            with contextlib.redirect_stdout(io.StringIO()), quiet:
                subject = writer(command, folder, Path(place, "old"), Path(place, "new"))
            yield subject


def crash(subject: Subject, folder: Path, expected: Any, point: str, mode: str) -> str | None:
    """Crash once; the finding, or None."""
    code, error = in_child(lambda: subject.run(folder), FileLayer(folder, point, mode))
    if code == FOUND:
        return f"raw error: {error}"
    if code not in (0, REFUSED, DIED):
        return f"ended with {code}"
    is_dead = code == DIED
    code, error = in_child(lambda: subject.intact(folder, is_dead))
    if code:
        return f"left something: {error}"
    code, error = in_child(lambda: subject.run(folder))
    if code:
        return f"cannot go on: {error}"
    code, outcome = in_child(lambda: subject.outcome(folder))
    if code:
        return f"cannot be read: {outcome}"
    if outcome != expected:
        return f"ends otherwise: {_differences(expected, outcome)}"
    return None


def _differences(expected: Any, found: Any) -> str:
    """Say in which members two outcomes differ."""
    if not isinstance(expected, dict) or not isinstance(found, dict):
        return f"{expected!r} -> {found!r}"
    names = [name for name in {**expected, **found} if expected.get(name) != found.get(name)]
    differences = [
        f"{name}: {_differences(expected.get(name), found.get(name))}" for name in names[:3]
    ]
    return "; ".join(differences)


def examine(command: str, every: int, modes: Sequence[str], once: bool = False) -> dict[str, Any]:
    """Crash a command at every ``every``-th of its operations, in each of ``modes`` that fits.

    Args:
        command: One of ``COMMANDS``.
        every: Distance of the operations.
        modes: What goes wrong, some of ``MODES``.
        once: Whether only the first mode that fits is tried at each.
    """
    findings: list[str] = []
    tried = 0
    with subject_of(command) as subject, tempfile.TemporaryDirectory() as place:
        reference, folder = Path(place, "reference"), Path(place, "folder")
        warm_up(subject)
        subject.prepare(reference)
        code, points = in_child(lambda: subject.run(reference), FileLayer(reference))
        assert code == 0, points
        code, expected = in_child(lambda: subject.outcome(reference))
        assert code == 0, expected
        for point in tqdm(points[::every], command, disable=None):  # nothing but on a terminal
            fitting = [mode for mode in modes_of(point) if mode in modes]
            for mode in fitting[: 1 if once else None]:
                shutil.rmtree(folder, ignore_errors=True)
                subject.prepare(folder)
                finding = crash(subject, folder, expected, point, mode)
                tried += 1
                if finding is not None:
                    findings.append(f"{mode} at {point}: {finding}")
    return {"command": command, "operations": len(points), "tried": tried, "findings": findings}


def warm_up(subject: Subject) -> None:
    """Import and compile all that the children need; leave no threads to torch."""
    torch.set_num_threads(1)
    quiet = contextlib.redirect_stderr(io.StringIO())
    with tempfile.TemporaryDirectory() as place, contextlib.redirect_stdout(io.StringIO()), quiet:
        folder = Path(place, "folder")
        subject.prepare(folder)
        subject.run(folder)
        subject.intact(folder, False)
        subject.outcome(folder)


def run_harness() -> None:
    """Read the command line, and print the findings."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("command", choices=COMMANDS)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--modes", nargs="+", choices=MODES, default=MODES)
    parser.add_argument("--once", action="store_true", help="crash once at each operation")
    options = parser.parse_args()
    sys.argv = ["ncrs"]
    print(json.dumps(examine(options.command, options.every, options.modes, options.once)))


if __name__ == "__main__":
    run_harness()
