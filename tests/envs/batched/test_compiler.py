"""Kernels kept on disk must follow the sources they were compiled from."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("numba")

from ncrs_envs.batched.compiler import source_digest

ROOT = Path(__file__).parents[3]
KERNEL = """\
from ncrs_envs.batched.compiler import kernel
from ncrs_test_middle import FACTOR

@kernel
def scaled(x):
    return FACTOR * x

print(scaled(2.0))
print(scaled.stats.cache_hits)
"""


@pytest.fixture
def sources(tmp_path) -> Path:
    (tmp_path / "ncrs_test_kernel.py").write_text(KERNEL)
    (tmp_path / "ncrs_test_middle.py").write_text("from ncrs_test_constants import FACTOR\n")
    (tmp_path / "ncrs_test_constants.py").write_text("FACTOR = 3.0\n")
    (tmp_path / "ncrs_test_other.py").write_text("FACTOR = 3.0\n")
    return tmp_path


def _finished(
    directory: Path, code: str = "import ncrs_test_kernel", **variables: str
) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(ROOT), str(directory)])
    environment = {**os.environ, "PYTHONPATH": path, **variables}
    command = [sys.executable, "-c", code]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=True)


def _run(directory: Path) -> list[str]:
    return _finished(directory).stdout.split()


@pytest.mark.slow
def test_a_constant_that_changes_in_another_file_is_noticed(sources):
    assert _run(sources) == ["6.0", "Counter()"]
    value, *hits = _run(sources)
    assert value == "6.0"
    assert hits != ["Counter()"]  # came from disk
    (sources / "ncrs_test_constants.py").write_text("FACTOR = 5.0\n")
    assert _run(sources) == ["10.0", "Counter()"]


def test_compilation_is_announced_once_and_only_when_it_happens(sources):
    twice = "import ncrs_test_kernel; print(ncrs_test_kernel.scaled(3))"  # of another type
    done = _finished(sources, twice, NCRS_QUIET="")
    assert done.stdout.split()[-1] == "9.0"
    assert done.stderr.startswith("ncrs: compiling the simulator for this computer, once")
    assert done.stderr.count("\n") == 1
    assert "NCRS_QUIET=1" in done.stderr
    assert _finished(sources, twice, NCRS_QUIET="0").stderr == ""  # came from disk


def test_the_notice_can_be_hidden_and_workers_give_none(sources):
    assert _finished(sources, NCRS_QUIET="1").stderr == ""
    (sources / "ncrs_test_constants.py").write_text("FACTOR = 5.0\n")
    worker = (
        "import multiprocessing; multiprocessing.current_process().name = 'SpawnProcess-1'; "
        "import ncrs_test_kernel"
    )
    done = _finished(sources, worker, NCRS_QUIET="0")
    assert done.stdout.split() == ["10.0", "Counter()"]
    assert done.stderr == ""


def test_digest_covers_imports_however_deep_and_nothing_else(sources, monkeypatch):
    monkeypatch.syspath_prepend(str(sources))
    __import__("ncrs_test_middle")
    digest = source_digest("ncrs_test_middle")
    (sources / "ncrs_test_other.py").write_text("FACTOR = 4.0\n")
    assert source_digest("ncrs_test_middle") == digest
    (sources / "ncrs_test_constants.py").write_text("FACTOR = 4.0\n")
    assert source_digest("ncrs_test_middle") != digest
    for name in ("ncrs_test_middle", "ncrs_test_constants"):
        monkeypatch.delitem(sys.modules, name)
