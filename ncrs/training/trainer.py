"""The training loop: the one place where evaluation meets optimizer. Source: paper section 5."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ncrs.automaton.channels import GenomeError
from ncrs.automaton.torch_settings import plain_torch
from ncrs.engines.base import Engine, EngineError, EvaluationInterrupted, make_engine
from ncrs.evolution.archive import ArchiveError
from ncrs.evolution.optimizers import OptimizerError
from ncrs.runs.engine_settings import ConfigError
from ncrs.runs.lock import RunError, locked
from ncrs.runs.settings import TrainConfig, save_config
from ncrs.training.files import RunFiles, check_new_run
from ncrs.training.generation import Generation
from ncrs.training.logs import RunLog
from ncrs.training.search import Search
from ncrs.training.selection import ChampionSelection
from ncrs.training.signals import StopRequest
from ncrs.training.state import RunState, TrainingResult
from ncrs.training.timing import PhaseTimer
from ncrs.training.watch import DEFAULT_WATCH, Watch


class Trainer:
    """A run in a folder: evolve, log, checkpoint.

    Args:
        config: Settings of the run.
        run_dir: Folder of the run, made if missing.
        watch: Progress bar and callback.

    Raises:
        ConfigError: If the optimizer refuses a setting at this size, or ``start_from`` is missing
            or does not fit.
        InstallationError: If the installation is incomplete and has no champions to start from.
        CheckpointError: If the file to start from is damaged.
    """

    def __init__(self, config: TrainConfig, run_dir: Path, watch: Watch = DEFAULT_WATCH) -> None:
        self._config = config
        self._watch = watch
        self._run_dir = run_dir
        self._search = Search(config)
        self._selection = ChampionSelection(config, self._search.objective)
        self._files = RunFiles(config, run_dir, self._search, self._selection)
        self._state = RunState()
        self._timer = PhaseTimer()

    def run(self) -> TrainingResult:
        """Train until the last generation, or until SIGINT or SIGTERM; both save.

        Raises:
            ConfigError: If settings of a resumed run would change.
            RunError: If another process writes there; if the folder holds a run and
                ``config.resume`` is not set; or if the genomes or the fitness of a generation are
                not finite.
            CheckpointError: If there is no whole checkpoint to resume from, the folder cannot be
                written, or the disk is full.
            EngineSettingError: If the engine cannot be used here.
            EngineError: If a worker was lost.
        """
        config = self._config
        settings = config.engine
        engine = make_engine(settings.name, config.task, settings.workers, **settings.own())
        with engine, locked(self._run_dir):
            try:
                self._start()
                with StopRequest() as stop:
                    self._train(engine, stop)
            finally:
                self._files.wait()
        archive = self._search.archive
        return TrainingResult(
            run_dir=self._run_dir,
            state=self._state,
            champion=self._selection.champion,
            filled=len(archive),
            triples=len(archive.space.triples),
            stopped_by=stop.received,
        )

    def _start(self) -> None:
        started = self._files.exist
        if self._config.resume is not None:
            self._state = self._files.load()
        else:
            check_new_run(self._run_dir)
        if self._state.generation > self._config.generations:
            raise ConfigError(
                f"The run has done {self._state.generation} generations, more than "
                f"generations={self._config.generations}."
            )
        save_config(self._config, self._run_dir)
        if not started:
            # A run that is killed in its first generation can be resumed, too.
            self._files.save(self._state)

    def _train(self, engine: Engine, stop: StopRequest) -> None:
        watch, generation = self._watch, self._state.generation
        with RunLog(self._run_dir, self._config, generation, watch.progress) as log:
            with suppress(EvaluationInterrupted):  # resuming repeats that generation
                self._loop(engine, log, stop)
            if stop():
                self._save(log)

    def _save(self, log: RunLog) -> None:
        log.sync()
        self._files.save(self._state)

    def _loop(self, engine: Engine, log: RunLog, stop: StopRequest) -> None:
        search, state, timer = self._search, self._state, self._timer
        while not (self._is_done or stop()):
            timer.begin()
            with self._saved_on_failure(log):
                self._reestimate_if_due(engine, stop)
                with timer.phase("ask"), plain_torch():
                    genomes = search.ask()
                scenarios = search.draw(state.generation, len(genomes))
                with timer.phase("evaluate"):
                    evaluation = engine.evaluate(genomes, scenarios.rows, stop)
                with timer.phase("archive"):
                    added = search.add(genomes, evaluation, scenarios, state.generation)
                with timer.phase("tell"), plain_torch():
                    search.tell(evaluation, added)
            generation = Generation(state.generation, genomes, evaluation, added)
            state.count(evaluation)
            self._crown_if_due(generation, engine, log)
            metrics = {**self._metrics(generation), **engine.metrics()}
            with timer.phase("log"):
                log.generation(generation, metrics, search.archive)
            self._watch.generation(generation, metrics, stop)
            if self._is_done or self._files.are_due:
                with timer.phase("checkpoint"):
                    self._save(log)

    @property
    def _is_done(self) -> bool:
        return self._state.generation == self._config.generations

    @contextmanager
    def _saved_on_failure(self, log: RunLog) -> Iterator[None]:
        """Save the state before a generation that cannot be completed; resuming repeats it."""
        try:
            yield
        except EngineError:
            self._save(log)
            raise
        except (OptimizerError, ArchiveError, GenomeError) as error:
            self._save(log)
            raise RunError(
                f"Generation {self._state.generation} cannot be completed: {error} The state "
                f"before it is saved in {self._run_dir}."
            ) from error

    def _reestimate_if_due(self, engine: Engine, stop: StopRequest) -> None:
        every, generation = self._config.reestimate_every, self._state.generation
        if every and generation and generation % every == 0:
            with self._timer.phase("reestimate"):
                self._state.dropped += self._search.reestimate(engine, generation, stop)

    def _crown_if_due(self, generation: Generation, engine: Engine, log: RunLog) -> None:
        if self._state.generation % self._config.champion_every and not self._is_done:
            return
        with self._timer.phase("champion"):
            candidates = self._search.candidates(generation)
            self._selection.crown(candidates, engine, generation.index)
        if self._selection.champion is not None:
            log.champion(self._selection.champion)

    def _metrics(self, generation: Generation) -> dict[str, float]:
        return {
            **generation.metrics(self._timer.elapsed),
            **self._state.metrics(),
            **self._search.metrics(),
            **self._timer.take(),
        }


def train(config: TrainConfig, run_dir: str | Path) -> TrainingResult:
    """Train in a folder; raise as ``Trainer`` and ``Trainer.run`` do."""
    return Trainer(config, Path(run_dir)).run()
