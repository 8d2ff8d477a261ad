"""A small run made by hand, its report, and a reader of the report's data."""

import base64
import json

import numpy as np
import pytest

from ncrs.automaton.channels import nca_layout
from ncrs.report import ReportOptions, build_report
from ncrs.runs.champion import CHAMPION_FILE, Champion
from ncrs.runs.elites import ARCHIVE_FILE, EliteArchive, make_archive
from ncrs.runs.settings import TrainConfig, save_config
from ncrs_envs.body import body_measures
from ncrs_envs.tasks import default_body

EPISODES = 2


def make_run(folder, task="light_chase", elites=45, with_champion=True, grid_size=5):
    """A run with random genomes on bodies that differ in their number of wheels and sensors.

    The bodies are not those that the genomes grow, which a report must not mind.
    """
    config = TrainConfig()
    config.task.name = task
    config.task.grid_size = grid_size
    settings = config.task
    rng = np.random.default_rng(7)
    archive = make_archive(settings)
    length = nca_layout(settings.task).num_parameters
    base = default_body(settings.task, settings.grid_size)
    bodies = []
    while len(bodies) < elites:
        body = base.copy()
        free = np.flatnonzero(body.reshape(-1) == 0)
        chosen = rng.choice(free, size=rng.integers(0, 14), replace=False)
        body.reshape(-1)[chosen] = rng.choice([1, 2, 4], size=len(chosen))
        known = {tuple(body_measures(b)) for b in bodies}
        if tuple(body_measures(body)) not in known:
            bodies.append(body)
    bodies = np.reshape(bodies, (elites, *base.shape)).astype(np.int8)
    archive.add(
        rng.normal(scale=0.1, size=(elites, length)),
        rng.uniform(0.2, 0.6, size=elites),
        body_measures(bodies),
        bodies,
        success=rng.integers(0, 13, size=elites) / 12,
        generation=3,
    )
    folder.mkdir(parents=True, exist_ok=True)
    save_config(config, folder)
    if elites:
        EliteArchive(config.task, archive, 12).save(folder / ARCHIVE_FILE)
    if with_champion:
        Champion(
            genome=rng.normal(scale=0.1, size=length).astype(np.float32),
            body=base,
            task=config.task,
            fitness=0.51234,
            success=0.25,
            generation=9,
            source="sample",
        ).save(folder / CHAMPION_FILE)
    rows = ["generation,fitness/best,fitness/mean,progress/evaluations"]
    rows += [f"{i},{0.3 + 0.01 * i},{0.2 + 0.01 * i},{64 * (i + 1)}" for i in range(10)]
    (folder / "metrics.csv").write_text("\n".join(rows) + "\n")
    return folder


def read_file(folder, name):
    """Kind, index and value of a data file."""
    text = (folder / "data" / f"{name}.js").read_text().strip()
    assert text.startswith("NCRSReport.receive(")
    assert text.endswith(");")
    return json.loads("[" + text[len("NCRSReport.receive(") : -2] + "]")


def unpack(text, dtype, limit=None):
    """An array that was packed with ``limit``."""
    raw = np.frombuffer(base64.b64decode(text), dtype=np.dtype(dtype).newbyteorder("<"))
    return raw if limit is None else raw * (limit / np.iinfo(dtype).max)


@pytest.fixture(scope="session")
def small_run():
    return make_run


@pytest.fixture(scope="session")
def read_data():
    return read_file


@pytest.fixture(scope="session")
def values():
    return unpack


@pytest.fixture(scope="session")
def run_dir(tmp_path_factory):
    return make_run(tmp_path_factory.mktemp("runs") / "small")


@pytest.fixture(scope="session")
def report(run_dir):
    return build_report(run_dir, options=ReportOptions(episodes=EPISODES))


@pytest.fixture
def page(chromium, report):
    from tests.browser import Page

    return Page(chromium, report.page.resolve())
