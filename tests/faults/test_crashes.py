"""Crashes at the file operations of every command, see ``harness``: nothing is lost."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.faults.harness import COMMANDS

ROOT = Path(__file__).parents[2]
QUICK = {"train sep_cma_es": 600}
"""Commands of the quick tests, and of how many of their operations one is tried."""

pytestmark = pytest.mark.skipif(
    not hasattr(os, "fork") or not Path("/proc/self/fd").exists(), reason="forks, and reads /proc"
)


def examine(command, every):
    if command == "pyribs":
        pytest.importorskip("ribs")
    words = [sys.executable, "-m", "tests.faults.harness", command, "--every", str(every)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout.splitlines()[-1])
    print(f"{command}: {result['operations']} operations, {result['tried']} crashes")
    assert result["tried"] >= result["operations"] / every
    assert result["findings"] == []


@pytest.mark.parametrize("command", QUICK)
def test_some_operations_may_be_the_last(command):
    examine(command, QUICK[command])


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_every_operation_may_be_the_last(command):
    examine(command, 1)
