"""Imports point one way: a file uses what stands above it, and light imports stay light."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

FORBIDDEN = {
    # Files, and what they must not import, at any depth of their own statements.
    "ncrs_envs/body.py": ("gymnasium", "ncrs", "torch", "Box2D", "numba", "ncrs_envs.tasks"),
    "ncrs_envs/tasks.py": ("gymnasium", "ncrs", "torch", "Box2D", "numba", "ncrs_envs.scenario"),
    "ncrs_envs/scenario.py": ("gymnasium", "ncrs", "torch", "Box2D", "numba"),
    "ncrs_envs/box2d_world.py": ("ncrs_envs.batched", "ncrs", "torch", "numba", "gymnasium"),
    "ncrs_envs/*.py": ("ncrs", "torch"),
    "ncrs_envs/batched/*.py": ("ncrs_envs.box2d_world", "ncrs_envs.episode", "Box2D", "ncrs"),
    "ncrs/optimizers/*.py": ("torch", "hydra", "omegaconf", "ncrs_envs", "ncrs.automaton.nca"),
    "ncrs/training/trainer.py": ("hydra", "omegaconf"),
    "ncrs/runs/settings.py": ("hydra", "omegaconf", "torch"),
    "ncrs/engines/*.py": (
        "hydra",
        "omegaconf",
        "ncrs.evolution.optimizers",
        "ncrs.training.trainer",
    ),
}

# For its linear algebra; the other optimizers import that file only when they need it.
ALLOWED = {("cholesky_sampler.py", "torch")}


def imported(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module


@pytest.mark.parametrize("pattern", FORBIDDEN)
def test_no_import_points_down(pattern):
    paths = list(ROOT.glob(pattern))
    assert paths
    for path in paths:
        for name in imported(path):
            for other in FORBIDDEN[pattern]:
                if (path.name, other) in ALLOWED:
                    continue
                assert name != other, f"{path.name} imports {name}"
                assert not name.startswith(other + "."), f"{path.name} imports {name}"


@pytest.mark.parametrize(
    ("module", "absent"),
    [
        ("ncrs_envs", ("torch", "Box2D", "pygame", "numba", "ncrs")),
        ("ncrs_envs.env", ("torch", "pygame", "numba", "ncrs")),
        ("ncrs", ("Box2D", "pygame", "numba", "hydra", "cma", "tensorboard")),
        ("ncrs.evolution.optimizers.cma_es", ("ncrs.evolution.optimizers.cholesky_sampler",)),
        ("ncrs.training.trainer", ("hydra", "omegaconf", "pygame", "matplotlib")),
        ("ncrs.cli", ("matplotlib", "pygame", "imageio_ffmpeg", "jinja2")),
    ],
)
def test_light_imports_stay_light(module, absent):
    code = f"import sys, {module}; print([n for n in {absent!r} if n in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert done.stdout.strip() == "[]", done.stdout + done.stderr
