"""The documents and their blocks, for the tests that run them."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
DOCS = ROOT / "docs"
_BUILT = ("_build", "_generated", "jupyter_execute")
PAGES = [
    page
    for page in sorted(DOCS.rglob("*.md"))
    if not set(page.relative_to(DOCS).parts).intersection(_BUILT)
]
DOCUMENTS = [README, ROOT / "CONTRIBUTING.md", *PAGES]
COMMAND = [sys.executable, "-m", "ncrs"]
TRAIN = [sys.executable, str(ROOT / "train.py")]
TINY = "generations=1 episodes=2 champion_every=1 champion_episodes=2 optimizer.population=16"


def name_of(document: Path) -> str:
    """Name a document as links from the top folder, or from ``docs``, do."""
    folder = DOCS if document.is_relative_to(DOCS) else ROOT
    return document.relative_to(folder).as_posix()


def is_notebook(document: Path) -> bool:
    """Tell whether a page's cells run when the site is built."""
    return document.read_text().startswith("---\nfile_format: mystnb\n")


def blocks(document: Path, language: str) -> list[str]:
    """Return the blocks of a language; a notebook's cells count as Python."""
    fence = language
    if language == "python" and is_notebook(document):
        fence = r"\{code-cell\} ipython3"
    return re.findall(rf"```{fence}\n(.*?)```", document.read_text(), flags=re.DOTALL)


def command_lines(document: Path) -> list[str]:
    """Return the commands in the shell blocks, without comments."""
    lines = [line for block in blocks(document, "bash") for line in block.splitlines()]
    commands = [part for line in lines for part in line.split(" && ")]
    return [shlex.join(shlex.split(command, comments=True)) for command in commands if command]


def call(command: list[str], folder: Path, code: str | None = None) -> str:
    """Return the output of a command, which must succeed."""
    done = subprocess.run(command, cwd=folder, input=code, capture_output=True, text=True)
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout
