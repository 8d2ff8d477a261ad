"""The command that trains, within this process: another one takes seconds to start."""

import contextlib
import io
import subprocess
import sys
from pathlib import Path

import pytest

from ncrs.training.launch import launch

ROOT = Path(__file__).parents[2]


@pytest.fixture
def launched(monkeypatch):
    """Runs ``train.py`` with some arguments; its exit code and output, as from ``subprocess``."""

    def run(*arguments):
        monkeypatch.chdir(ROOT)
        monkeypatch.setattr(sys, "argv", ["train.py"])
        output, errors, code = io.StringIO(), io.StringIO(), 0
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
            try:
                launch(arguments)
            except SystemExit as left:
                code = left.code or 0
        return subprocess.CompletedProcess(arguments, code, output.getvalue(), errors.getvalue())

    return run
