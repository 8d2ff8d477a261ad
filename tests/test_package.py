"""The package as users install it: a wheel in any place trains, and the sdist tests itself."""

import os
import subprocess
import sys
import sysconfig
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

import ncrs

ROOT = Path(__file__).parents[1]
PIP = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
TRAIN = [
    "seed=0,1", "-m", "generations=1", "optimizer.population=16", "episodes=2",
    "champion_episodes=2", "start_from=light_chase/best", "optimizer.sigma=0.01",
]  # fmt: skip


def call(command, folder, **environment):
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, env={**os.environ, **environment}
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def sdist(tmp_path_factory):
    """The source distribution, built from the checkout."""
    folder = tmp_path_factory.mktemp("sdist")
    code = "import setuptools.build_meta as b, sys; print(b.build_sdist(sys.argv[1]))"
    call([sys.executable, "-c", code, str(folder)], ROOT)
    (file,) = folder.glob("*.tar.gz")
    return file


@pytest.fixture(scope="module")
def wheel(sdist, tmp_path_factory):
    """A wheel, built from the source distribution."""
    folder = tmp_path_factory.mktemp("wheel")
    call([*PIP, "wheel", str(sdist), "--no-deps", "--no-build-isolation", "-w", str(folder)], ROOT)
    (file,) = folder.glob("*.whl")
    return file


def test_the_wheel_holds_configuration_and_champions(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    for file in (ROOT / "conf").rglob("*.yaml"):
        assert f"ncrs/conf/{file.relative_to(ROOT / 'conf')}" in names
    for champion in ncrs.champions():
        stem = champion.replace("/", "-")
        assert {f"ncrs/champions/{stem}.{suffix}" for suffix in ("npz", "json", "png")} <= names
    assert {"ncrs/py.typed", "ncrs_envs/py.typed", "ncrs/report/page/app.js"} <= names
    assert not [name for name in names if name.split("/")[0] in ("tests", "benchmarks")]


def _checked(python, folder, **environment):
    """Use the installed package from another folder: champions, configuration, a sweep."""
    ncrs_command = [*python, "-m", "ncrs"]
    listed = call([*ncrs_command, "champions"], folder, **environment)
    assert [line.split()[0] for line in listed.splitlines()[1:]] == ncrs.champions()
    conf = call([*ncrs_command, "train", "--config-dir"], folder, **environment).strip()
    assert (Path(conf) / "experiment" / "best" / "obstacle.yaml").is_file()
    assert not conf.startswith(str(ROOT))
    sweep = [*ncrs_command, "train", *TRAIN, "hydra.sweep.dir=sweep"]
    assert "Over seeds" in call(sweep, folder, **environment)
    report = [*ncrs_command, "report", "light_chase/best", "--output", "page"]
    call(report, folder, **environment)
    assert (folder / "page" / "index.html").is_file()


@pytest.mark.slow
def test_a_wheel_in_a_folder_of_its_own_trains(wheel, tmp_path):
    target = tmp_path / "target"
    call([*PIP, "install", "--no-deps", "--target", str(target), str(wheel)], tmp_path)
    python = [sys.executable, "-P"] if sys.version_info >= (3, 11) else [sys.executable]
    _checked(python, tmp_path, PYTHONPATH=str(target))


@pytest.mark.slow
def test_a_wheel_in_a_new_environment_trains(wheel, tmp_path):
    """With the dependencies of this environment, which take long to install again."""
    venv.create(tmp_path / "venv", with_pip=False)
    python = tmp_path / "venv" / "bin" / "python"
    call([*PIP, "--python", str(python), "install", "--no-deps", str(wheel)], tmp_path)
    purelib = sysconfig.get_path("purelib")
    site = call([str(python), "-c", "import site; print(site.getsitepackages()[0])"], tmp_path)
    # Appended, so that the wheel comes before this environment's own installation.
    (Path(site.strip()) / "borrowed.pth").write_text(f"{purelib}\n")
    _checked([str(python)], tmp_path)


@pytest.mark.slow
def test_the_sdist_passes_its_own_tests(sdist, tmp_path):
    """A part of them, without those that check the documents of a checkout."""
    with tarfile.open(sdist) as archive:
        archive.extractall(tmp_path, filter="data")
    (folder,) = tmp_path.glob("ncrs-*")
    chosen = [
        "tests/runs",
        "tests/automaton",
        "tests/test_readme.py",
        "tests/training/test_hydra.py",
    ]
    command = [sys.executable, "-m", "pytest", "-q", "-n", "2", *chosen]
    printed = call(command, folder, PYTHONPATH=str(folder))
    assert " passed" in printed
    assert "failed" not in printed
