"""Small runs to look at."""

import dataclasses

import pytest

from ncrs.evolution.optimizers import MAPElitesSettings, SepCMAESSettings
from ncrs.runs.engine_settings import EngineSettings
from ncrs.runs.settings import TrainConfig
from ncrs.training.trainer import Trainer, train
from ncrs.training.watch import Watch


def small(**changes):
    return dataclasses.replace(
        TrainConfig(
            optimizer=SepCMAESSettings(sigma=0.1, population=16, parents=None, step_size="csa"),
            engine=EngineSettings(name="batched", workers=1),
            symmetric=False,
            mirroring="none",
            generations=2,
            episodes=1,
            champion_every=1,
            champion_episodes=1,
            seed=1,
        ),
        **changes,
    )


@pytest.fixture(scope="session")
def sweep(tmp_path_factory):
    """Two seeds of one optimizer, and a run of another, in one folder."""
    folder = tmp_path_factory.mktemp("sweep")
    stopped = Watch(progress=False, callback=lambda generation, _: generation.index == 1)
    Trainer(small(generations=3), folder / "0", stopped).run()
    train(small(seed=2, generations=3), folder / "1")
    other = MAPElitesSettings(population=16)
    train(small(optimizer=other), folder / "2")
    return folder
