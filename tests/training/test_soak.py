"""Long use, and use with little: memory, files and threads stay bounded. All slow."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import ncrs

ROOT = Path(__file__).parents[2]
MEGABYTE = 2**20

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads /proc"),
]


def usage():
    """Resident bytes, open files and threads of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    files = len(os.listdir("/proc/self/fd"))
    return pages * os.sysconf("SC_PAGE_SIZE"), files, threading.active_count()


def check_growth(before, after, megabytes):
    assert after[0] - before[0] < megabytes * MEGABYTE
    assert after[1] <= before[1] + 2
    assert after[2] <= before[2]


def test_two_thousand_generations(tmp_path):
    seen = {}

    def watch(generation, metrics):
        if generation.index in (200, 1999):
            seen[generation.index] = usage()

    ncrs.train(
        tmp_path, callback=watch, progress=False, generations=2000, episodes=2, seed=1,
        optimizer={"name": "sep_cma_es", "population": 8, "parents": None, "sigma": 0.02},
        start_from="light_chase/best", champion_every=500, champion_episodes=2,
        checkpoint_seconds=5,
    )  # fmt: skip
    check_growth(seen[200], seen[1999], megabytes=100)


def test_twenty_thousand_steps_of_a_thousand_robots():
    envs = gymnasium.make_vec("NCRS-Obstacle-v0", 1024, autoreset_mode="SameStep")
    envs.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1, 1, (10, *envs.action_space.shape))
    before = None
    for step in range(20_000):
        envs.step(actions[step % 10].astype(np.float32))
        if step == 1000:
            before = usage()
    check_growth(before, usage(), megabytes=20)
    envs.close()


LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, (12 * 2**30, 12 * 2**30))
resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64))
sys.argv = ["ncrs", *sys.argv[1:]]
from ncrs.cli import main
main()
"""


@pytest.mark.parametrize("side", [5, 15])
def test_no_home_little_memory_and_few_files(tmp_path, side):
    kept = {name: os.environ[name] for name in ("PATH",) if name in os.environ}
    (tmp_path / "a file").touch()  # below it not even root can make a folder
    home = str(tmp_path / "a file" / "home")
    environment = {**kept, "PYTHONPATH": str(ROOT), "HOME": home, "LC_ALL": "C"}
    run = tmp_path / "läuft"
    command = [
        sys.executable, "-X", "faulthandler", "-c", LIMITED, "train",
        f"task.grid_size={side}", "generations=1", "episodes=2", "optimizer.population=16",
        "champion_every=1", "champion_episodes=2", f"hydra.run.dir='{run}'",
    ]  # fmt: skip
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, timeout=500, check=False
    )
    assert done.returncode == 0, done.stderr.decode(errors="replace")
    assert done.stdout.startswith(b"Finished 1 generations")
    assert ncrs.load_archive(run).task.grid_size == side


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 400 kB."""
    place = tmp_path / "disk"
    place.mkdir()
    mounting = ["mount", "-t", "tmpfs", "-o", "size=400k", "tmpfs", str(place)]
    try:
        subprocess.run(mounting, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError) as error:
        pytest.skip(f"cannot mount a file system here: {error}")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def test_a_small_disk_ends_a_run_in_a_sentence_and_keeps_what_was_saved(small_disk):
    command = [
        sys.executable, "-m", "ncrs", "train", "generations=40", "optimizer.population=16",
        "episodes=2", "champion_every=1", "champion_episodes=2", "checkpoint_seconds=0",
        f"hydra.run.dir={small_disk / 'run'}",
    ]  # fmt: skip
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "No space left on device. What was saved before is intact" in done.stderr
    assert not list(small_disk.rglob("*.tmp"))
    assert ncrs.load_archive(small_disk / "run").task.name == "light_chase"
