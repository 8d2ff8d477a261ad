"""pycma comes without its warnings about plotting."""

import subprocess
import sys


def test_importing_the_optimizers_is_silent_without_matplotlib():
    code = (
        "import sys; sys.modules['matplotlib'] = sys.modules['matplotlib.pyplot'] = None; "
        "import ncrs.evolution.optimizers.cma_es"
    )
    done = subprocess.run(
        [sys.executable, "-W", "always::UserWarning", "-c", code], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
