"""Numbers and commands as text."""

from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path


def duration(seconds: float) -> str:
    """Format a time span in its two largest units: "2 h 5 min", "3 min 20 s" or "4 s"."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"


def override(name: str, value: object) -> str:
    """Format a setting for the shell, so that Hydra reads the value as it is.

    Folders of sweeps have commas and equals signs in their names, others spaces.
    """
    text = str(value)
    if not re.fullmatch(r"[\w./:+-]+", text, re.ASCII):
        escaped = text.replace("'", "\\'")
        text = f"'{escaped}'"
    word = f"{name}={text}"
    if "'" in word and not re.search(r'["$`\\!]', word):
        return f'"{word}"'  # easier to read than single quotes in single quotes
    return shlex.quote(word)


def train_command() -> str:
    """Return the command that trains, as this process was started: train.py's, or ncrs's own."""
    return "python train.py" if Path(sys.argv[0]).name == "train.py" else "ncrs train"


def program_name() -> str:
    """Return the name of the program that trains, to begin its error messages with."""
    return train_command().removeprefix("python ")
