"""TensorBoard beside the scalars: content, times and file of what is written."""

import io
import re
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tensorboard.backend.event_processing.event_file_loader import EventFileLoader
from tensorboard.plugins.hparams.plugin_data_pb2 import HParamsPluginData
from torch.utils.tensorboard import SummaryWriter

from ncrs.automaton.growth import grow
from ncrs.automaton.nca import NCA
from ncrs.evolution.optimizers import SepCMAESSettings
from ncrs.runs.champion import Champion
from ncrs.runs.elites import make_archive
from ncrs.runs.settings import TrainConfig
from ncrs.training.tensorboard import (
    LAYOUT,
    Budget,
    RunPictures,
    add_end,
    add_settings,
    spread,
)
from ncrs.training.trainer import train
from ncrs_envs.body import body_measures
from ncrs_envs.tasks import TaskSettings

GENOME_LENGTH = 4572


class Clock:
    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


@pytest.fixture
def champion(full_genome):
    body = grow(NCA().set_genome(full_genome))
    return Champion(full_genome, body, TaskSettings(), 0.4, 0.2, 7, "")


@pytest.fixture
def archive(champion):
    archive = make_archive(TaskSettings())
    body = np.array(champion.body)
    bodies = [body]
    for cell in range(12):
        body = body.copy()
        body.reshape(-1)[cell] = 0
        bodies.append(body)
    bodies = np.array(bodies)
    archive.add(
        np.tile(champion.genome, (13, 1)), np.linspace(0.3, 0.5, 13), body_measures(bodies), bodies
    )
    return archive


@pytest.fixture(scope="module")
def undisturbed_tags(tmp_path_factory):
    """Tags of all curves of a short run."""
    folder = tmp_path_factory.mktemp("run")
    optimizer = SepCMAESSettings(sigma=0.01, population=16)
    settings = {"generations": 1, "episodes": 2, "champion_every": 1, "champion_episodes": 2}
    train(TrainConfig(optimizer=optimizer, start_from="light_chase/best", **settings), folder)
    return read(folder).Tags()["scalars"]


def read(folder):
    sizes = {"images": 0, "histograms": 0, "tensors": 0}
    return EventAccumulator(str(folder), size_guidance=sizes).Reload()


def test_a_budget_allows_its_share_of_the_time():
    clock = Clock()
    budget = Budget(0.01, 2.0, clock)
    done = []

    def work():
        clock.now += 1.0
        done.append(clock.now)

    assert not budget.run(work)
    clock.now = 199.0
    assert not budget.run(work)
    clock.now = 200.0
    assert budget.run(work)  # was expected to take 2 s, and took 1
    assert budget.run(work)
    assert not budget.run(work)
    assert budget.run(work, at_any_cost=True)
    clock.now = 399.0
    assert not budget.run(work)
    clock.now = 401.0
    assert budget.run(work)
    assert len(done) == 4


def test_pictures_and_histograms(tmp_path, champion, archive):
    clock = Clock()
    fitness = np.array([0.1, np.nan, 0.3])
    genomes = np.stack([champion.genome] * 3)
    with SummaryWriter(str(tmp_path)) as writer:
        pictures = RunPictures(writer, clock)
        pictures.champion(champion)
        for generation in range(3):
            pictures.generation(generation, fitness, genomes, archive, last=False)
        clock.now = 1e6  # time for everything
        pictures.champion(champion)
        pictures.generation(3, fitness, genomes, archive, last=False)
        pictures.champion(replace(champion, fitness=0.5))
        pictures.generation(4, fitness, genomes, archive, last=True)
    events = read(tmp_path)
    assert [event.step for event in events.Images("champion/body")] == [0, 4]
    assert [event.step for event in events.Images("champion/growth_and_episode")] == [3, 4]
    assert [event.step for event in events.Images("qd/archive")] == [3, 4]
    assert [event.step for event in events.Histograms("population/fitness")] == [3, 4]
    assert events.Histograms("population/fitness")[0].histogram_value.num == 2
    assert events.Histograms("population/best_genome")[0].histogram_value.num == GENOME_LENGTH
    assert events.Histograms("qd/fitness")[0].histogram_value.num == len(archive)
    animation = events.Images("champion/growth_and_episode")[0].encoded_image_string
    with Image.open(io.BytesIO(animation)) as image:
        assert image.format == "GIF"
        assert image.n_frames > 40
    with Image.open(io.BytesIO(events.Images("qd/bodies")[0].encoded_image_string)) as image:
        assert image.width > 9 * 96


@pytest.mark.parametrize(("seconds", "animations"), [(59.0, 0), (60.0, 1)])
def test_a_run_of_a_minute_ends_with_an_animation(tmp_path, champion, archive, seconds, animations):
    clock = Clock()
    with SummaryWriter(str(tmp_path)) as writer:
        pictures = RunPictures(writer, clock)
        pictures.champion(champion)
        clock.now += seconds
        pictures.generation(0, np.array([0.3]), champion.genome[None], archive, last=True)
    tags = read(tmp_path).Tags()["images"]
    assert ("champion/growth_and_episode" in tags) == bool(animations)


def hparams_records(folder):
    """The records of the HPARAMS page by kind."""
    (path,) = folder.iterdir()  # no folder beside the run's event file
    found = {}
    for event in EventFileLoader(str(path)).Load():
        for value in event.summary.value:
            if value.metadata.plugin_data.plugin_name == "hparams":
                data = HParamsPluginData.FromString(value.metadata.plugin_data.content)
                found[data.WhichOneof("data")] = data
    return found


def test_settings_are_hyperparameters_of_the_run_itself(tmp_path):
    with SummaryWriter(str(tmp_path)) as writer:
        add_settings(writer, TrainConfig(seed=5))
        writer.add_scalar("fitness/best", 1.0, 0)
        add_end(writer)
    found = hparams_records(tmp_path)
    # Without a record of the experiment, TensorBoard lists first what differs between runs.
    assert set(found) == {"session_start_info", "session_end_info"}
    session = found["session_start_info"].session_start_info.hparams
    assert session["seed"].number_value == 5.0
    assert session["task.name"].string_value == "light_chase"
    assert "resume" not in session
    assert "custom_scalars__config__" in read(tmp_path).Tags()["tensors"]


def test_fitness_and_success_come_first_and_each_chart_has_one_scale(undisturbed_tags):
    groups = sorted({tag.partition("/")[0] for tag in undisturbed_tags})
    assert groups[:2] == ["champion", "fitness"]
    assert {"champion/fitness", "champion/success"} <= set(undisturbed_tags)
    charts = [patterns for section in LAYOUT.values() for _, patterns in section.values()]
    assert ["optimizer/sigma"] in charts
    for patterns in charts:
        for pattern in patterns:
            assert any(re.search(pattern, tag) for tag in undisturbed_tags), pattern


def test_the_strip_goes_from_few_cells_to_many():
    measures = np.array([[1, 2, 9], [1, 2, 3], [2, 2, 4], [1, 2, 8]])
    fitness = np.array([0.1, 0.2, 0.3, 0.4])
    np.testing.assert_array_equal(spread(measures, fitness, 2), [2, 3])
    np.testing.assert_array_equal(spread(measures, fitness, 9), [1, 2, 3, 0])
