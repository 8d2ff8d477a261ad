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


def _run(directory: Path) -> list[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(directory)])}
    command = [sys.executable, "-c", "import ncrs_test_kernel"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return done.stdout.split()


def test_a_constant_that_changes_in_another_file_is_noticed(sources):
    assert _run(sources) == ["6.0", "Counter()"]
    value, *hits = _run(sources)
    assert value == "6.0"
    assert hits != ["Counter()"]  # came from disk
    (sources / "ncrs_test_constants.py").write_text("FACTOR = 5.0\n")
    assert _run(sources) == ["10.0", "Counter()"]


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
