"""The training loop: the one place where evaluation meets optimizer. Source: paper section 5."""

from __future__ import annotations

import signal
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from ncrs.automaton.channels import GenomeError, nca_layout
from ncrs.engines.base import (
    Engine,
    EngineError,
    Evaluation,
    EvaluationInterrupted,
    make_engine,
)
from ncrs.evolution.archive import SEED_LENGTH, AddResult, AddStatus, ArchiveError
from ncrs.evolution.objective import objective
from ncrs.evolution.optimizers import OptimizerError, make_optimizer
from ncrs.evolution.optimizers.base import Fitness, Genomes
from ncrs.evolution.reestimation import reestimate, seed_row
from ncrs.evolution.standstill import standing_still_fitness
from ncrs.runs.champion import CHAMPION_FILE, Champion
from ncrs.runs.checkpoint import CheckpointFolder
from ncrs.runs.elites import ARCHIVE_FILE, EliteArchive, make_archive
from ncrs.runs.lock import RunError, locked
from ncrs.runs.settings import (
    ConfigError,
    TrainConfig,
    check_same_settings,
    lasting_settings,
    save_config,
)
from ncrs.training.logs import (
    PhaseTimer,
    RunLog,
    generation_metrics,
    versions,
    warn_of_other_versions,
)
from ncrs.training.signals import StopRequest
from ncrs.training.start import start_genome
from ncrs_envs.scenario import Scenario, sample_scenarios

CHECKPOINT_FOLDER = "checkpoints"

# First keys of the streams that a run's seed is split into; assessment has 3, the command line's
# re-estimation 5.
_OPTIMIZER_STREAM, _SCENARIO_STREAM, _CHAMPION_STREAM = range(3)
_REESTIMATION_STREAM = 4


@dataclass(frozen=True)
class TrainingResult:
    """How a run ended."""

    run_dir: Path
    generation: int
    """Generations done."""
    best_fitness: float
    """Best fitness of any genome in any generation: a lucky draw, on its own scenarios."""
    champion: Champion | None
    """The best re-evaluated genome; None if no candidate had a body that the task can use, or the
    run was stopped before the first round."""
    filled: int
    """Feature triples that have an elite in the archive."""
    triples: int
    """Feature triples that bodies can have."""
    evaluations: int
    env_steps: int
    seconds: float
    stopped_by: signal.Signals | None
    """The signal that ended the run early; None if it finished."""


class Trainer:
    """A run in a folder: evolve, log, checkpoint.

    Args:
        config: Settings of the run.
        run_dir: the run's folder, made if missing.

    Raises:
        ConfigError: a setting that the optimizer refuses at this size; a ``start_from`` that is
            missing or does not fit; or a run that is resumed with other settings than its own.
        ChampionError: there are no champions to start from: the installation is not whole.
        RunError: another process writes there; or the folder holds a run and ``config.resume`` is
            not set; or a generation's genomes or fitness were not finite, so that nothing can be
            learned from them.
        CheckpointError: there is no whole checkpoint to go on from; or the file to start from is
            damaged; or the folder cannot be written, or the disk is full.
    """

    def __init__(self, config: TrainConfig, run_dir: Path) -> None:
        self._config = config
        self._run_dir = run_dir
        self._settings = config.task
        self._layout = nca_layout(self._settings.task)
        self._sampling = config.sampling()
        try:
            self._optimizer = make_optimizer(
                config.optimizer,
                self._layout.num_parameters,
                self._stream(_OPTIMIZER_STREAM),
            )
            if config.start_from is not None and config.resume is None:
                start = start_genome(config.start_from, self._layout, config.symmetric)
                self._optimizer.start_from(start)
        except OptimizerError as error:
            raise ConfigError(str(error)) from error
        self._archive = make_archive(self._settings)
        self._optimizer.attach(self._archive)
        self._champion_scenarios = sample_scenarios(
            self._settings.task,
            self._stream(_CHAMPION_STREAM),
            config.champion_episodes,
            self._settings.grid_size,
        )
        self._checkpoints = CheckpointFolder(run_dir / CHECKPOINT_FOLDER)
        self._generation = 0
        self._evaluations = 0
        self._env_steps = 0
        self._seconds = 0.0
        self._best_fitness = -np.inf
        self._champion: Champion | None = None
        self._champion_objective = -np.inf
        self._dropped = 0
        self._timer = PhaseTimer()

    def _stream(self, *key: int) -> np.random.SeedSequence:
        return np.random.SeedSequence(self._config.seed, spawn_key=key)

    def run(self) -> TrainingResult:
        """Train until the last generation, or until SIGINT or SIGTERM; both save."""
        with locked(self._run_dir):
            try:
                self._start()
                with StopRequest() as stop:
                    self._loop(stop)
            finally:
                self._checkpoints.wait()
        return TrainingResult(
            run_dir=self._run_dir,
            generation=self._generation,
            best_fitness=float(self._best_fitness),
            champion=self._champion,
            filled=len(self._archive),
            triples=len(self._archive.space.triples),
            evaluations=self._evaluations,
            env_steps=self._env_steps,
            seconds=self._seconds,
            stopped_by=stop.received,
        )

    def _start(self) -> None:
        started = bool(self._checkpoints.paths())
        if self._config.resume is not None:
            self._load_state(self._checkpoints.load())
        elif started:
            raise RunError(
                f"{self._run_dir} already holds a run; continue it with resume={self._run_dir}, or "
                "use another folder."
            )
        if self._generation > self._config.generations:
            raise ConfigError(
                f"The run has done {self._generation} generations, more than "
                f"generations={self._config.generations}."
            )
        save_config(self._config, self._run_dir)
        if not started:
            self._save()  # so that even a run killed in its first generation can be resumed

    def _loop(self, stop: StopRequest) -> None:
        config = self._config
        saved_at = perf_counter()
        started_at = perf_counter() - self._seconds
        with (
            make_engine(config.engine.name, self._settings, config.engine.workers) as engine,
            RunLog(self._run_dir, config, self._generation) as log,
        ):
            while self._generation < config.generations:
                start = perf_counter()
                try:
                    if self._is_time_to_reestimate:
                        with self._timer.phase("reestimate"):
                            stream = self._stream(_REESTIMATION_STREAM, self._generation)
                            self._dropped += reestimate(
                                self._archive, engine, stream, config.episodes, stop, self._sampling
                            )
                    genomes, evaluation, added = self._evolve(engine, stop)
                except EvaluationInterrupted:
                    break
                except EngineError:
                    self._save()  # the generation can be repeated from here
                    raise
                except (OptimizerError, ArchiveError, GenomeError) as error:
                    self._save()
                    raise RunError(
                        f"Generation {self._generation} cannot be completed: {error} The state "
                        f"before it is saved in {self._run_dir}."
                    ) from error
                self._count(evaluation)
                generation = self._generation
                self._generation += 1
                if self._generation % config.champion_every == 0 or self._is_last:
                    with self._timer.phase("champion"):
                        candidates = self._candidates(genomes, evaluation)
                        result = engine.evaluate(candidates, self._champion_scenarios)
                        self._crown(candidates, result)
                    if self._champion is not None:
                        log.champion(self._champion)
                metrics = self._metrics(evaluation, added, perf_counter() - start)
                with self._timer.phase("log"):
                    log.generation(generation, metrics, self._best_fitness)
                    log.population(generation, evaluation.fitness, genomes, self._archive)
                self._seconds = perf_counter() - started_at
                is_due = perf_counter() - saved_at >= config.checkpoint_seconds
                # One that is still being written is not waited for: the next comes later instead.
                if (is_due and not self._checkpoints.is_writing) or self._is_last:
                    with self._timer.phase("checkpoint"):
                        self._save()
                    saved_at = perf_counter()
                if stop():
                    break
            self._seconds = perf_counter() - started_at
            if stop():
                self._save()

    @property
    def _is_last(self) -> bool:
        return self._generation == self._config.generations

    @property
    def _is_time_to_reestimate(self) -> bool:
        every = self._config.reestimate_every
        return every > 0 and self._generation > 0 and self._generation % every == 0

    def _evolve(self, engine: Engine, stop: StopRequest) -> tuple[Genomes, Evaluation, AddResult]:
        """One generation: propose, evaluate, add to the archive, learn."""
        with self._timer.phase("ask"):
            genomes = self._searched(self._optimizer.ask())
        streams = self._scenario_streams(len(genomes))
        rows = [self._scenarios(stream) for stream in streams]
        with self._timer.phase("evaluate"):
            evaluation = engine.evaluate(genomes, rows, stop)
        with self._timer.phase("archive"):
            added = self._archive.add(
                genomes,
                evaluation.fitness,
                evaluation.measures,
                evaluation.bodies,
                success=evaluation.success.mean(axis=1),
                standing_still=np.resize(
                    standing_still_fitness(self._settings, rows), len(genomes)
                ),
                generation=self._generation,
                seeds=np.resize(
                    [seed_row(stream) for stream in streams], (len(genomes), SEED_LENGTH)
                ),
            )
        with self._timer.phase("tell"):
            self._optimizer.tell(self._objective(evaluation), added)
        return genomes, evaluation, added

    def _scenario_streams(self, population: int) -> list[np.random.SeedSequence]:
        """Streams of the current generation's scenarios: one for all genomes, or one for each."""
        key = (_SCENARIO_STREAM, self._generation)
        if self._config.common_scenarios:
            return [self._stream(*key)]
        return [self._stream(*key, genome) for genome in range(population)]

    def _scenarios(self, stream: np.random.SeedSequence) -> list[Scenario]:
        settings = self._settings
        episodes, size = self._config.episodes, settings.grid_size
        return self._sampling.draw(settings.task, stream, episodes, size)

    def _count(self, evaluation: Evaluation) -> None:
        self._evaluations += len(evaluation.fitness)
        self._env_steps += evaluation.env_steps
        self._best_fitness = max(self._best_fitness, float(np.nanmax(evaluation.fitness)))

    def _candidates(self, genomes: Genomes, evaluation: Evaluation) -> Genomes:
        """The generation's best genome, and the search's mean or the archive's best elite: often
        those are better than a lucky draw."""
        best = genomes[int(np.nanargmax(self._objective(evaluation)))]
        return np.stack([best, self._searched(self._optimizer.mean[None])[0]])

    def _searched(self, genomes: Genomes) -> Genomes:
        """What the optimizer proposes, as it is evaluated: the nearest genomes that are searched
        among."""
        return self._layout.symmetric(genomes) if self._config.symmetric else genomes

    def _objective(self, evaluation: Evaluation) -> Fitness:
        config = self._config
        bonuses = config.success_bonus, config.approach_bonus
        return objective(evaluation, self._settings, *bonuses)

    def _crown(self, candidates: Genomes, result: Evaluation) -> None:
        sources: Sequence[str] = ("sample", self._optimizer.candidate_source)
        values = self._objective(result)
        for index, source in enumerate(sources):
            value = float(values[index])
            beaten = value <= self._champion_objective
            if not result.valid[index] or not np.isfinite(value) or beaten:
                continue
            self._champion_objective = value
            self._champion = Champion(
                genome=candidates[index].astype(np.float32),
                body=result.bodies[index],
                task=self._config.task,
                fitness=float(result.fitness[index]),
                success=float(result.success[index].mean()),
                generation=self._generation - 1,
                source=source,
            )

    def _metrics(
        self, evaluation: Evaluation, added: AddResult, seconds: float
    ) -> dict[str, float]:
        phases = self._timer.take()
        return {
            **generation_metrics(evaluation),
            "fitness/best_so_far": float(self._best_fitness),
            **{f"optimizer/{key}": value for key, value in self._optimizer.metrics().items()},
            **{f"archive/{key}": value for key, value in self._archive.statistics().items()},
            "archive/new": float((added.status == AddStatus.NEW).sum()),
            "archive/improved": float((added.status == AddStatus.IMPROVED).sum()),
            "archive/dropped": float(self._dropped),
            "progress/evaluations": float(self._evaluations),
            "progress/env_steps": float(self._env_steps),
            "speed/evaluations_per_s": len(evaluation.fitness) / seconds,
            "speed/env_steps_per_s": evaluation.env_steps / seconds,
            **{f"time/{name}_s": value for name, value in phases.items()},
        }

    def _save(self) -> None:
        # The checkpoint in the background: at full covariance it is large.
        self._checkpoints.save_in_background(self._generation, self._state())
        if self._champion is not None:
            self._champion.save(self._run_dir / CHAMPION_FILE)
        config = self._config
        elites = EliteArchive(config.task, self._archive, config.episodes, self._sampling)
        elites.save(self._run_dir / ARCHIVE_FILE)

    def _state(self) -> dict[str, Any]:
        return {
            "generation": self._generation,
            "evaluations": self._evaluations,
            "env_steps": self._env_steps,
            "seconds": self._seconds,
            "best_fitness": float(self._best_fitness),
            "champion_objective": float(self._champion_objective),
            "champion": None if self._champion is None else self._champion.state(),
            "optimizer": self._optimizer.state(),
            "archive": self._archive.state(),
            "settings": self._own_settings(),
            "dropped": self._dropped,
            "versions": versions(),
        }

    def _own_settings(self) -> dict[str, Any]:
        """What a run keeps when it goes on; the optimizer's are part of its own state, and where it
        started is past."""
        settings = lasting_settings(self._config)
        del settings["optimizer"], settings["start_from"]
        return settings

    def _load_state(self, state: dict[str, Any]) -> None:
        warn_of_other_versions(state["versions"])
        # Older checkpoints name the task alone.
        check_same_settings(
            state.get("settings", {"task": state.get("task")}), self._own_settings()
        )
        try:
            self._optimizer.load_state(state["optimizer"])
            self._archive.load_state(state["archive"])
        except (OptimizerError, ArchiveError) as error:
            raise ConfigError(str(error)) from error
        self._generation = state["generation"]
        self._evaluations = state["evaluations"]
        self._env_steps = state["env_steps"]
        self._seconds = state["seconds"]
        self._best_fitness = state["best_fitness"]
        self._dropped = state.get("dropped", 0)
        champion = state["champion"]
        # Checkpoints written before there were bonuses have no objective: it was the fitness.
        plain = -np.inf if champion is None else champion["fitness"]
        self._champion_objective = state.get("champion_objective", plain)
        self._champion = None if champion is None else Champion.from_state(champion)


def train(config: TrainConfig, run_dir: str | Path) -> TrainingResult:
    """Train in a folder; see ``Trainer`` for what is raised."""
    return Trainer(config, Path(run_dir)).run()
