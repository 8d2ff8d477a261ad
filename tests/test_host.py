"""A program that uses this package may have set anything: results stay, and so do its settings."""

import subprocess
import sys

import pytest

HOSTILE = """
import decimal, locale, logging, os, random, signal, sys, warnings
import matplotlib, multiprocessing, numba, numpy, torch

warnings.simplefilter("error")
numpy.seterr(all="raise")
numpy.set_printoptions(precision=1, threshold=3, linewidth=20)
torch.set_printoptions(precision=1)
torch.set_default_dtype(torch.float64)
torch.set_default_device("meta")
torch.set_grad_enabled(False)
torch.use_deterministic_algorithms(True)
torch.backends.mkldnn.enabled = False
torch.set_num_threads(2)
torch.autocast("cpu", dtype=torch.bfloat16).__enter__()
numba.set_num_threads(1)
matplotlib.rcParams.update({"text.usetex": True, "font.size": 30, "savefig.dpi": 20})
multiprocessing.set_start_method("spawn", force=True)
logging.disable(logging.CRITICAL)
signal.signal(signal.SIGINT, signal.SIG_IGN)
decimal.getcontext().prec = 2
sys.setrecursionlimit(500)
for name in ("de_DE.UTF-8", "C"):
    try:
        locale.setlocale(locale.LC_ALL, name)
    except locale.Error:
        continue
os.umask(0o077)
os.chdir("/")
"""

WORK = """
import hashlib, pathlib, random, sys
import gymnasium, numpy, torch
import ncrs, ncrs_envs
from ncrs.cli import main
from ncrs.runs.checkpoint import read_state

folder = pathlib.Path(sys.argv[1])

def digest(value):
    if isinstance(value, dict):
        parts = [name + digest(value[name]) for name in sorted(value) if name != "seconds"]
        value = "".join(parts).encode()
    if isinstance(value, numpy.ndarray):
        value = value.tobytes()
    if not isinstance(value, bytes):
        value = repr(value).encode()
    return hashlib.sha256(value).hexdigest()

def state():
    return {
        "numpy": numpy.random.get_state()[1], "python": random.getstate(),
        "torch": torch.random.get_rng_state().numpy(),
        "errors": numpy.geterr(), "printing": numpy.get_printoptions(),
        "threads": torch.get_num_threads(), "dtype": torch.get_default_dtype(),
        "onednn": torch.backends.mkldnn.enabled, "autocast": torch.is_autocast_enabled("cpu"),
    }

random.seed(1), numpy.random.seed(1), torch.manual_seed(1)
before = digest(state())
genome = ncrs.load_champion("carry_ball/best").genome
for engine, workers in (("batched", 2), ("box2d", 1)):
    found = ncrs.evaluate(
        genome, "carry_ball", engine=engine, episodes=2, seed=1, workers=workers
    )
    print(engine, workers, digest(found.episode_fitness), digest(found.bodies))
envs = gymnasium.make_vec("NCRS-Obstacle-v0", 130)
print("vector environments", digest(envs.reset(seed=0)[0]))
for _ in range(5):
    step = envs.step(numpy.ones(envs.action_space.shape, dtype=numpy.float32))
print("a step", digest(step[0]), digest(step[1]))
env = gymnasium.make("NCRS-LightChase-v0", render_mode="rgb_array")
env.reset(seed=0)
print("picture", digest(env.render()))
run = folder / "run"
ncrs.train(
    run, optimizer={"name": "sep_cma_es", "population": 16, "sigma": 0.02}, generations=1,
    episodes=2, champion_every=1, champion_episodes=2, start_from="light_chase/best", seed=3,
    progress=False,
)
print("run", digest(read_state(sorted((run / "checkpoints").iterdir())[-1])))
main(["figures", str(run), "--episodes", "1", "--output", str(folder / "figures")])
for file in sorted((folder / "figures").iterdir()):
    print(file.name, digest(file.read_bytes()))
print("untouched", digest(state()) == before)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="sets limits and masks of POSIX")
def test_whatever_a_program_has_set_results_stay_and_so_do_its_settings(tmp_path):
    pytest.importorskip("matplotlib")
    running = []
    for name, code in (("plain", WORK), ("hostile", HOSTILE + WORK)):
        folder = tmp_path / name / "run"
        folder.mkdir(parents=True)
        command = [sys.executable, "-c", code, str(folder)]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        running.append(subprocess.Popen(command, text=True, **pipes))
    outputs = []
    for process in running:
        output, errors = process.communicate()
        assert process.returncode == 0, errors
        outputs.append([line for line in output.splitlines() if not line.startswith("Saved")])
    plain, hostile = outputs
    assert len(plain) > 15
    assert plain[-1] == "untouched True"
    assert hostile == plain
