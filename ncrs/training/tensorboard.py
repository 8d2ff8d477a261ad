"""TensorBoard beside the curves: pictures, histograms, settings, layout.

Drawing has a budget: each kind of picture may take a fixed fraction of the run's time, so that slow
machines and fast generations get fewer pictures, not slower runs. Drawing never changes a run's
results.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tensorboard.compat.proto.summary_pb2 import Summary
from torch.utils.tensorboard import SummaryWriter
from torch.utils.tensorboard.summary import hparams

from ncrs.automaton.device_genomes import AnyGenomes
from ncrs.evolution.archive import Archive
from ncrs.runs.champion import Champion
from ncrs.runs.settings import TrainConfig, flat_settings
from ncrs.viz.archive_grid import archive_grid
from ncrs.viz.pictures import encode_animation, growth_and_episode
from ncrs.viz.stills import heatmaps, strip
from ncrs_envs.rendering import draw_body

HISTOGRAM_FRACTION = 0.002
STILLS_FRACTION = 0.003
ANIMATION_FRACTION = 0.005
"""Fractions of a run's time; together with the curves they stay under 2 %."""
_HISTOGRAM_SECONDS, _STILLS_SECONDS, _ANIMATION_SECONDS = 0.01, 0.2, 1.5
"""Assumed cost of the first of each kind."""
_LONG_RUN_SECONDS = 60.0
"""A run of at least this length ends with an animation of its champion, whatever the fraction."""
_BODY_PIXELS = 160
_ANIMATION_PIXELS = 160
_STRIP_BODIES = 10
LAYOUT: Mapping[str, Mapping[str, list[Any]]] = {
    "Run": {
        "fitness": ["Multiline", ["^fitness/(best|mean|median|best_so_far)$", "champion/fitness"]],
        "success": ["Multiline", ["success/best", "success/mean", "champion/success"]],
        "QD-score": ["Multiline", ["^qd/qd_score$", "^qd/filled_fraction$"]],
    },
    "Search": {
        "step size": ["Multiline", ["optimizer/sigma"]],
        "condition number": ["Multiline", ["optimizer/condition_number"]],
        "archive": ["Multiline", ["^qd/(new|improved)$"]],
        "bodies": ["Multiline", ["population/valid"]],
    },
    "Time": {
        "seconds": ["Multiline", ["^time/"]],
        "environment steps per second": ["Multiline", ["speed/env_steps_per_s"]],
    },
}
"""Charts of the CUSTOM SCALARS tab, by heading: tags, or patterns of tags; one scale per chart."""


class Budget:
    """Allows work that keeps within a fraction of the time.

    Args:
        fraction: Allowed fraction of the time since this was made.
        expected: Assumed seconds of the first piece of work.
        clock: Function that returns seconds since any fixed time.
    """

    def __init__(
        self, fraction: float, expected: float, clock: Callable[[], float] = perf_counter
    ) -> None:
        self._fraction, self._expected, self._clock = fraction, expected, clock
        self._start, self._spent = clock(), 0.0

    @property
    def elapsed(self) -> float:
        """Seconds since this was made."""
        return self._clock() - self._start

    def run(self, work: Callable[[], None], *, at_any_cost: bool = False) -> bool:
        """Do the work if its expected cost is within the fraction; return True if it was done."""
        start = self._clock()
        affordable = self._spent + self._expected <= self._fraction * (start - self._start)
        if not (affordable or at_any_cost):
            return False
        work()
        self._expected = self._clock() - start
        self._spent += self._expected
        return True


class RunPictures:
    """Pictures and histograms of one run.

    Args:
        writer: Writer of the run's event file.
        clock: Function that returns seconds since any fixed time, for the budgets.
    """

    def __init__(self, writer: SummaryWriter, clock: Callable[[], float] = perf_counter) -> None:
        self._writer = writer
        self._histograms = Budget(HISTOGRAM_FRACTION, _HISTOGRAM_SECONDS, clock)
        self._stills = Budget(STILLS_FRACTION, _STILLS_SECONDS, clock)
        self._animation = Budget(ANIMATION_FRACTION, _ANIMATION_SECONDS, clock)
        self._champion: Champion | None = None
        self._undrawn: Champion | None = None
        self._unmoved: Champion | None = None

    def champion(self, champion: Champion) -> None:
        """Remember the champion; a new one is drawn with the next generation."""
        if champion is not self._champion:
            self._champion = self._undrawn = self._unmoved = champion

    def generation(
        self,
        index: int,
        fitness: NDArray[np.float64],
        genomes: AnyGenomes,
        archive: Archive,
        *,
        last: bool,
    ) -> None:
        """Draw the pictures that the budgets allow.

        Args:
            index: Index of the generation.
            fitness: Fitness of its genomes, ``(P,)``; NaN is left out.
            genomes: Genomes of the generation, ``(P, N)``.
            archive: Archive after this generation.
            last: True to draw the stills, and after a long run the animation, whatever the budgets.
        """
        if self._undrawn is not None:
            body = draw_body(self._undrawn.body, _BODY_PIXELS)
            self._writer.add_image("champion/body", body, index, dataformats="HWC")
            self._undrawn = None
        self._histograms.run(lambda: self._add_histograms(index, fitness, genomes, archive))
        if len(archive):
            self._stills.run(lambda: self._add_archive(index, archive), at_any_cost=last)
        if self._unmoved is not None:
            champion = self._unmoved
            at_the_end = last and self._animation.elapsed >= _LONG_RUN_SECONDS
            if self._animation.run(
                lambda: self._add_animation(index, champion), at_any_cost=at_the_end
            ):
                self._unmoved = None

    def _add_histograms(
        self,
        index: int,
        fitness: NDArray[np.float64],
        genomes: AnyGenomes,
        archive: Archive,
    ) -> None:
        self._writer.add_histogram("population/fitness", fitness[np.isfinite(fitness)], index)
        self._writer.add_histogram(
            "population/best_genome", genomes[int(np.nanargmax(fitness))], index
        )
        if len(archive):
            self._writer.add_histogram("qd/fitness", archive.column("fitness"), index)

    def _add_archive(self, index: int, archive: Archive) -> None:
        fitness, measures = archive.column("fitness"), archive.measures
        grid = archive_grid(measures, fitness, archive.space.triples)
        panels = heatmaps(grid, float(fitness.min()), float(fitness.max()))
        self._writer.add_image("qd/archive", panels, index, dataformats="HWC")
        chosen = spread(measures, fitness, _STRIP_BODIES)
        captions = [f"{fitness[row]:.3f}\n{measures[row, 2]} cells" for row in chosen]
        bodies = strip(archive.column("bodies")[chosen], captions)
        self._writer.add_image("qd/bodies", bodies, index, dataformats="HWC")

    def _add_animation(self, index: int, champion: Champion) -> None:
        frames, durations = growth_and_episode(champion, _ANIMATION_PIXELS)
        add_encoded_image(
            self._writer,
            "champion/growth_and_episode",
            encode_animation(frames, durations),
            frames[0].shape[:2],
            index,
        )


def spread(
    measures: NDArray[np.integer], fitness: NDArray[np.floating], count: int
) -> NDArray[np.int64]:
    """Choose at most ``count`` elites from few cells to many: the fittest of each size range.

    Returns:
        Indices into ``fitness``, int64.
    """
    order = np.argsort(measures[:, 2], kind="stable")
    groups = np.array_split(order, min(count, len(order)))
    return np.array([group[np.argmax(fitness[group])] for group in groups], dtype=np.int64)


def add_curves(writer: SummaryWriter, values: Mapping[str, float], index: int) -> None:
    """Add a value to each curve, all in one event: 10 times faster than one event each."""
    points = [Summary.Value(tag=tag, simple_value=value) for tag, value in values.items()]
    _file_writer(writer).add_summary(Summary(value=points), index)


def add_encoded_image(
    writer: SummaryWriter, tag: str, data: bytes, shape: tuple[int, ...], index: int
) -> None:
    """Add an encoded picture (PNG or GIF), animated or not.

    Args:
        writer: Writer of the run's event file.
        tag: Name of the picture.
        data: Encoded picture.
        shape: Height and width in pixels.
        index: Index of the generation.
    """
    image = Summary.Image(height=shape[0], width=shape[1], colorspace=3, encoded_image_string=data)
    _file_writer(writer).add_summary(Summary(value=[Summary.Value(tag=tag, image=image)]), index)


def add_settings(writer: SummaryWriter, config: TrainConfig) -> None:
    """Add the settings as hyperparameters of this run, and the layout of the charts.

    ``SummaryWriter.add_hparams`` would make a run of its own for them, in a sub-folder, and record
    the experiment. Without that record TensorBoard compares the runs, and lists first what differs
    between them.
    """
    settings = flat_settings(asdict(config))
    given = {name: value for name, value in settings.items() if value is not None}
    _, session, _ = hparams(given, {})  # type: ignore[no-untyped-call]
    _file_writer(writer).add_summary(session)
    writer.add_custom_scalars(LAYOUT)


def add_end(writer: SummaryWriter) -> None:
    """Record that the run has finished."""
    end = hparams({}, {})[2]  # type: ignore[no-untyped-call]
    _file_writer(writer).add_summary(end)


def _file_writer(writer: SummaryWriter) -> Any:
    return writer._get_file_writer()  # type: ignore[no-untyped-call]
