"""The disk cache of kernels: damaged, missing, full or forbidden, compiling still works."""

from __future__ import annotations

import importlib
import sys
import warnings

import numba
import pytest

from ncrs_envs.batched import kernel_cache
from ncrs_envs.batched.kernel_cache import KernelCacheWarning

NAME = "ncrs_test_cached"
MODULE = """\
from ncrs_envs.batched.compiler import kernel

@kernel
def doubled(x):
    return 2.0 * x
"""


@pytest.fixture
def compiled(tmp_path, monkeypatch):
    """Makes a kernel as a new process would, calls it, and counts what came from the disk."""
    (tmp_path / f"{NAME}.py").write_text(MODULE)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(kernel_cache, "_warned", set())

    def make():
        sys.modules.pop(NAME, None)
        kernel = importlib.import_module(NAME).doubled
        assert kernel(3.0) == 6.0
        return sum(kernel.stats.cache_hits.values())

    yield make
    sys.modules.pop(NAME, None)


def damage_truncated(data):
    return data[: len(data) // 2]


def damage_emptied(data):
    return b""


def damage_zeroed(data):
    return bytes(len(data))


def damage_flipped(data):
    return data[:-50] + bytes([data[-50] ^ 1]) + data[-49:]


@pytest.mark.parametrize(
    "damage", [damage_truncated, damage_emptied, damage_zeroed, damage_flipped]
)
@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
def test_damaged_files_are_compiled_again(compiled, tmp_path, damage, suffix):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert [compiled(), compiled()] == [0, 1]
        (file,) = (tmp_path / "cache").rglob(f"*{suffix}")
        file.write_bytes(damage(file.read_bytes()))
        assert [compiled(), compiled()] == [0, 1]


@pytest.mark.skipif(sys.platform == "win32", reason="limits are of POSIX")
def test_a_full_disk_costs_one_line(compiled, tmp_path):
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
    try:
        with pytest.warns(KernelCacheWarning, match=r"on disk \(File too large\)") as caught:
            assert [compiled(), compiled()] == [0, 0]
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert len(caught) == 1
    assert list((tmp_path / "cache").rglob("*.tmp*")) == []
    assert [compiled(), compiled()] == [0, 1]


def test_no_place_for_a_cache_costs_one_line(compiled, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "file" / "cache"))
    monkeypatch.setattr(numba.config, "CACHE_LOCATOR_CLASSES", "UserProvidedCacheLocator")
    with pytest.warns(KernelCacheWarning, match="NUMBA_CACHE_DIR") as caught:
        assert [compiled(), compiled()] == [0, 0]
    assert len(caught) == 1
