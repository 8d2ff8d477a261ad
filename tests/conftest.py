"""Helpers for all tests."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

os.environ.setdefault("NCRS_QUIET", "1")  # notices would differ from one computer to the next
# The tests run in a process per core: torch's threads would wait for each other, not compute.
os.environ.setdefault("OMP_NUM_THREADS", "1")
DATA = Path(__file__).parent / "data"


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Order files so that one process compiles the kernels while another runs what needs none.

    Else both compile the same ones. The longest of the other files come first, so that both end
    at about the same time.
    """
    sizes = Counter(item.path for item in items)

    def rank(item: pytest.Item) -> tuple[int, int, str]:
        compiles = item.path.name == "test_readme.py"
        needs_none = item.path.parent.name == "optimizers"
        return (0 if compiles else 1 if needs_none else 2, -sizes[item.path], str(item.path))

    items.sort(key=rank)


@pytest.fixture
def golden() -> Callable[[str], Any]:
    """Loads recordings of the published implementation by file stem."""

    def load(name: str) -> Any:
        with np.load(DATA / f"{name}.npz", allow_pickle=False) as file:
            return dict(file)

    return load


@pytest.fixture
def golden_genome() -> Callable[[Any, str], Any]:
    """Joins a recorded genome's layers, such as those of "g03", into the flat vector."""

    def join(record: Any, prefix: str) -> Any:
        names = [f"conv{layer}_{kind}" for layer in (1, 2, 3) for kind in ("weight", "bias")]
        return np.concatenate([record[f"{prefix}_{name}"].ravel() for name in names])

    return join


@pytest.fixture
def genomes() -> Callable[..., Any]:
    """Normal random genomes; with sigma 0.1 and seed 0 about one in seven grows a valid body."""

    def draw(count: int, length: int = 4572, sigma: float = 0.1, seed: int = 0) -> Any:
        return np.random.default_rng(seed).normal(0.0, sigma, (count, length))

    return draw


@pytest.fixture
def full_genome() -> Any:
    """A LightChase genome that grows a valid body of 25 cells (found by random search)."""
    with np.load(DATA / "full_body_genome.npz", allow_pickle=False) as file:
        return file["genome"]


@pytest.fixture(scope="module")
def chromium(tmp_path_factory):
    pytest.importorskip("selenium", reason="selenium is not installed")
    from benchmarks.browser import CHROMIUM, DRIVER, start_chromium

    if CHROMIUM is None or DRIVER is None:
        pytest.skip("Chromium or its driver is not installed (Debian: chromium chromium-driver)")
    driver = start_chromium(tmp_path_factory.mktemp("chromium"))
    yield driver
    driver.quit()
