"""Light imports stay light; import-linter checks the direction of all imports."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


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
