"""Scenarios of many episodes: as records for the kernels, and as objects on demand."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.dtypes import assign
from ncrs_envs.batched.env_streams import EnvStreams
from ncrs_envs.batched.layout import Scenario as ScenarioRecord
from ncrs_envs.batched.layout import Scenarios, make_scenarios
from ncrs_envs.batched.records import scenario_records
from ncrs_envs.batched.sampling import MAX_QUADS, RANDOM_REGION, Sample
from ncrs_envs.perturbations import Damage
from ncrs_envs.scenario import NOISE, Scenario, sample_scenario
from ncrs_envs.tasks import Task

Indices = NDArray[np.intp]


class ScenarioTable:
    """Scenarios of ``count`` episodes of one task; initially there are none.

    Attributes:
        records: Records of all episodes, with room for the wall quads of every scenario so far.
    """

    def __init__(self, task: Task, count: int, grid_size: int) -> None:
        self._task = task
        self._grid_size = grid_size
        self.records = make_scenarios(count, MAX_QUADS if task.has_walls else 0)
        self._makers: list[Callable[[], Scenario] | None] = [None] * count

    def __getitem__(self, episode: int) -> Scenario | None:
        """Return the scenario of an episode, or None."""
        make = self._makers[episode]
        return None if make is None else make()

    def perturbed(self, episode: int) -> Scenario | None:
        """Return the scenario of an episode if anything happens to its robot, or None."""
        make = self._makers[episode]
        scenario = make() if isinstance(make, _Kept) else None  # what is drawn here is plain
        return scenario if scenario is not None and scenario.is_perturbed else None

    def damage(self, damages: Mapping[int, Damage]) -> None:
        """Put damages, by episode, in the place of those of the scenarios."""
        for episode, damage in damages.items():
            scenario = self[episode]
            if scenario is not None:
                self._makers[episode] = _Kept(replace(scenario, damage=damage))

    def start(self, episode: int) -> tuple[float, float]:
        """Return the start position of an episode's robot."""
        record: ScenarioRecord = self.records.scenarios[episode]
        return float(record.start_x), float(record.start_y)

    def put(self, episodes: Sequence[int], scenarios: Sequence[Scenario]) -> None:
        """Set the scenarios of episodes to checked ones."""
        if not scenarios:
            return
        self._write(episodes, scenario_records(scenarios, self._grid_size))
        for episode, scenario in zip(episodes, scenarios, strict=True):
            self._makers[episode] = _Kept(scenario)

    def _write(self, episodes: Sequence[int], rows: Scenarios) -> None:
        width, needed = self.records.quads.shape[1], rows.quads.shape[1]
        if needed > width:
            quads = np.pad(self.records.quads, ((0, 0), (0, needed - width)))
            self.records = self.records._replace(quads=quads)
        assign(self.records.scenarios, episodes, rows.scenarios)
        assign(self.records.quads, (episodes, slice(needed)), rows.quads)

    def draw(
        self,
        episodes: Sequence[int],
        streams: EnvStreams,
        regions: Sequence[int | None] | None = None,
    ) -> None:
        """Set the scenarios of episodes to those that ``sample_scenario`` would draw.

        Args:
            episodes: Indices of the episodes.
            streams: Streams of all episodes.
            regions: Region of each episode, or None for a random one; None for random ones.
        """
        if not episodes:
            return
        given = [None if regions is None else regions[episode] for episode in episodes]
        if self._task.place is not None:
            pairs = zip(map(streams.generator, episodes), given, strict=True)
            drawn = [sample_scenario(self._task, g, region, self._grid_size) for g, region in pairs]
            self.put(episodes, drawn)
            return
        numbers = [RANDOM_REGION if region is None else region for region in given]
        own = streams.take(episodes)
        sample = Sample(self._task, own, np.array(numbers), self._grid_size, NOISE)
        streams.put(episodes, own)
        self._write(episodes, sample.records)
        for i, episode in enumerate(episodes):
            self._makers[episode] = _Drawn(sample, i)


class _Kept:
    """Maker of a scenario that exists already."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario

    def __call__(self) -> Scenario:
        return self._scenario


class _Drawn:
    """Maker of a scenario from a sample."""

    def __init__(self, sample: Sample, index: int) -> None:
        self._sample = sample
        self._index = index

    def __call__(self) -> Scenario:
        return self._sample[self._index]
