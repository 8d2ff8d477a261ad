"""The shell blocks of the pages run, with small settings where they train.

The README's are in ``tests/test_readme.py``, which also parses every line of all documents.
"""

from __future__ import annotations

import re
import shlex
import shutil

import numpy as np
import pytest

import ncrs
from ncrs.automaton.relays import BODIES
from tests.documents import COMMAND, DOCS, PAGES, TINY, TRAIN, blocks, call, command_lines, name_of

pytestmark = pytest.mark.slow

ELSEWHERE = ("tcp://", "PARTITION", "FOLDER", "engine=futures", "engine=cuda", "ncrs play")
"""Words of lines that need other machines, a GPU, a window, or a folder of the reader's."""
LINES = [
    pytest.param(line, id=f"{name_of(page)}: {line}")
    for page in PAGES
    for line in dict.fromkeys(command_lines(page))
    if line.startswith(("ncrs ", "python train.py")) and not any(w in line for w in ELSEWHERE)
]
RUNS = (
    "runs/RUN", "RUN_A", "RUN_B", "runs/sweep_DATE/seed=0", "runs/first", "runs/wide",
    "runs/drafts",
)  # fmt: skip
"""Folders of runs that lines name."""
STAGE = "runs/carry_ball_1"
"""Folder of a run that a later stage starts from."""
SMALLER = {
    r"^generations=.*": "generations=1",
    r"^episodes=.*": "episodes=2",
    r"^champion_episodes=.*": "champion_episodes=2",
    r"^optimizer\.population=.*": "optimizer.population=16",
    r"^seed=(range.*|[\d,]*,.*)": "seed=0,1",
    r"^optimizer\.sigma=[\d.]+,.*": "optimizer.sigma=0.01,0.03",
    r"^hydra\.launcher\.n_jobs=.*": "hydra.launcher.n_jobs=1",
}
"""Settings of a line, and what they are made so that it takes seconds."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with what the lines name: runs, a sweep, a genome, and an elite's measures."""
    folder = tmp_path_factory.mktemp("pages")
    start = ["start_from=light_chase/best", "optimizer.sigma=0.01"]
    call([*TRAIN, *shlex.split(TINY), *start, "hydra.run.dir=RUN_DIR"], folder)
    for name in RUNS:
        shutil.copytree(folder / "RUN_DIR", folder / name)
    stage = [*shlex.split(TINY), "experiment=best/carry_ball_1", f"hydra.run.dir={STAGE}"]
    call([*TRAIN, *stage], folder)
    np.save(folder / "body.npy", ncrs.grow_to(BODIES["light_chase"], "light_chase"))
    genome = ncrs.load_champion("obstacle/best").genome
    np.save(folder / "genome.npy", genome)
    return folder


def _measures(folder):
    return ncrs.load_archive(folder / "RUN_DIR").archive.measures[0].tolist()


def _small(words):
    """Make a line's settings small, and add those of a tiny run that it does not name."""
    for pattern, smaller in SMALLER.items():
        words = [re.sub(pattern, smaller, word) for word in words]
    named = {word.split("=")[0] for word in words}
    if "hydra/sweeper=ncrs_optuna" in words:
        words = [*words, "hydra.sweeper.n_trials=2"]
    return [*words, *(word for word in shlex.split(TINY) if word.split("=")[0] not in named)]


@pytest.mark.parametrize("line", LINES)
def test_a_pages_command_runs(line, folder, tmp_path):
    shutil.copytree(folder, tmp_path / "here")
    for made in re.findall(r"hydra\.run\.dir=(\S+)", line):  # a new run needs a new folder
        shutil.rmtree(tmp_path / "here" / made, ignore_errors=True)
    program, *words = shlex.split(line)
    if program == "python" or words[0] == "train":
        command = [*TRAIN, *_small(words[1:])]
    else:
        if "--measures" in words:
            at = words.index("--measures") + 1
            words[at : at + 3] = map(str, _measures(folder))
        command = [*COMMAND, *words]
    if "runs/mine" in line and "train" not in words[0]:
        shutil.copytree(folder / "runs" / "sweep_DATE", tmp_path / "here" / "runs" / "mine")
    call(command, tmp_path / "here")


def test_the_blocks_about_archives_run(folder):
    call([*COMMAND, "archive", "RUN_DIR", "--export", "pyribs"], folder)
    code = "\n".join(blocks(DOCS / "quality_diversity.md", "python"))
    measures = tuple(_measures(folder))
    code = code.replace("measures=(2, 8, 25)", f"measures={measures}")
    printed = call([COMMAND[0], "-"], folder, f"{code}\nprint(elite.measures, bodies.shape[1:])")
    assert printed.splitlines()[-1] == f"{measures} (5, 5)"
