"""Many environments in the memory of one GPU."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from ncrs_envs.batched.dtypes import dtype_of, records
from ncrs_envs.batched.layout import (
    Contact,
    Robots,
    Scenarios,
    Settings,
    State,
    make_robots,
    make_scenarios,
    make_scratch,
)
from ncrs_envs.batched.records import robot_records, settings_record
from ncrs_envs.batched.sampling import MAX_QUADS, MAX_VERTICES, Room, Walls, no_start
from ncrs_envs.batched.scenario_table import Indices
from ncrs_envs.batched.streams import STREAM_SIZE
from ncrs_envs.cuda.gpu import Launcher, device_array, free_memory, to_device, to_host
from ncrs_envs.cuda.kernels import (
    Fleet,
    Readings,
    Rules,
    Turn,
    scatter,
    start_envs,
    step_envs,
)
from ncrs_envs.cuda.tensors import SharedMemory
from ncrs_envs.interface import ActionError, OptionError
from ncrs_envs.scenario import NOISE
from ncrs_envs.tasks import TaskSettings, playfield

_THREADS = 64
"""Threads per block; each has an environment."""
_WORD = np.dtype(np.uint64)


class FleetMemory:
    """Environments on the current GPU, and the launches of their kernels.

    Args:
        settings: The task and its settings.
        count: Number of environments.
        ends: Step limit; True if success ends episodes; and True if others follow in the same step.
        shared: The GPU's memory.

    Attributes:
        readings: Tensors of the fields of ``Readings`` after the last step, by name.
        last: The same of episodes that ended in it, if others follow in the same step.
        turn: Tensors of the fields of ``Turn``, by name.

    Raises:
        OptionError: The memory does not suffice.
    """

    def __init__(
        self,
        settings: TaskSettings,
        count: int,
        ends: tuple[int, bool, bool],
        shared: SharedMemory,
    ) -> None:
        n, task = settings.grid_size, settings.task
        self._count, self._cells, self._shared = count, n * n, shared
        room = Room(n, playfield(n), NOISE)
        self._rules = Rules(room, task.has_walls, *ends)
        contacts = len(make_scratch(n).contacts)
        walls = count if task.has_walls else 1
        _check_memory(count, _bytes_per_env(settings, contacts))
        failures, self._failures = shared.zeros((1,), np.int64)
        setting = records(Settings, 1)
        setting[0] = settings_record(settings)
        self._fleet = Fleet(
            to_device(setting),
            Robots(*(device_array((count, *a.shape[1:]), a.dtype) for a in make_robots(1, n))),
            Scenarios(
                *(
                    device_array((count, *a.shape[1:]), a.dtype)
                    for a in make_scenarios(1, MAX_QUADS if task.has_walls else 0)
                )
            ),
            device_array((count,), dtype_of(State)),
            device_array((count, contacts), dtype_of(Contact)),
            device_array((count, STREAM_SIZE), _WORD),
            Walls(
                device_array((walls, 2), np.int64),
                device_array((walls, 2, MAX_VERTICES, 2), np.float64),
                device_array((walls, MAX_QUADS, 4, 2), np.float64),
            ),
            failures,
        )
        self._readings, self.readings = self._make_readings(count)
        self._last, self.last = self._make_readings(count if self._rules.resets_at_once else 1)
        self._turn, self.turn = self._make_turn()
        self._start, self._step = Launcher(start_envs), Launcher(step_envs)
        self._scatter = Launcher(scatter)

    def _make_readings(self, count: int) -> tuple[Readings, dict[str, torch.Tensor]]:
        fields = {
            "observations": ((count, self._cells), np.float32),
            "poses": ((count, 3), np.float64),
            "distances": ((count, 2), np.float64),
            "success": ((count,), np.bool_),
            "crossed": ((count,), np.bool_),
        }
        made = {name: self._shared.zeros(*kind) for name, kind in fields.items()}
        arrays = Readings(**{name: array for name, (array, _) in made.items()})
        return arrays, {name: tensor for name, (_, tensor) in made.items()}

    def _make_turn(self) -> tuple[Turn, dict[str, torch.Tensor]]:
        one = (self._count,)
        fields: dict[str, tuple[tuple[int, ...], Any]] = {
            "actions": ((self._count, self._cells), np.float32),
            "rewards": (one, np.float64),
            "terminated": (one, np.bool_),
            "truncated": (one, np.bool_),
            "is_done": (one, np.bool_),
            "steps": (one, np.int64),
        }
        made = {name: self._shared.zeros(*kind) for name, kind in fields.items()}
        arrays = Turn(**{name: array for name, (array, _) in made.items()})
        return arrays, {name: tensor for name, (_, tensor) in made.items()}

    def set_bodies(self, envs: Indices, bodies: NDArray[np.int8]) -> None:
        """Set the robots of environments to ``(len(envs) or 1, n, n)`` valid bodies."""
        for place, rows in zip(self._fleet.robots, robot_records(bodies), strict=True):
            self._put(envs, rows, place)

    def set_scenarios(self, envs: Indices, rows: Scenarios) -> None:
        """Set the scenarios of environments, which may have more walls than any before."""
        held = self._fleet.scenarios
        missing = rows.quads.shape[1] - held.quads.shape[1]
        if missing > 0:
            quads = to_device(np.pad(to_host(held.quads), ((0, 0), (0, missing))))
            held = Scenarios(held.scenarios, quads)
            self._fleet = self._fleet._replace(scenarios=held)
        self._put(envs, rows.scenarios, held.scenarios)
        if rows.quads.size:
            self._put(envs, rows.quads, held.quads)

    def set_streams(self, envs: Indices, streams: NDArray[np.uint64]) -> None:
        """Set the random streams of environments."""
        self._put(envs, streams, self._fleet.streams)

    def _put(self, envs: Indices, rows: NDArray[Any], place: Any) -> None:
        """Write rows, or the only one, into the places of environments."""
        if not len(envs):
            return
        chosen = to_device(np.asarray(envs, dtype=np.int64))
        self._scatter(
            _blocks(len(envs)), _THREADS, 0, chosen, to_device(_words(rows)), _words(place),
            stream=self._shared.stream,
        )  # fmt: skip

    def start(self, kinds: NDArray[np.int8], regions: NDArray[np.int64]) -> None:
        """Start episodes; arguments as in ``kernels.start_envs``.

        Raises:
            ScenarioError: No start free of walls was found.
        """
        what = (to_device(kinds), to_device(regions))
        arguments = (self._fleet, self._readings, self._turn, self._rules, what)
        self._start(_blocks(self._count), _THREADS, 0, *arguments, stream=self._shared.stream)
        self._check_starts()

    def _check_starts(self) -> None:
        if int(self._failures.item()):
            raise no_start(self._rules.room.grid_size)

    def step(self, actions: torch.Tensor) -> None:
        """Advance every environment by one step, or start its next episode.

        Args:
            actions: Gas per cell, ``(count, n, n)`` on the GPU.

        Raises:
            ActionError: An action is not finite.
            ScenarioError: A start in the last step was not free of walls.
        """
        if not bool(torch.isfinite(actions).all()):
            index = tuple(torch.nonzero(~torch.isfinite(actions))[0].tolist())
            raise ActionError(f"action must be finite, got {actions[index].item()} at {index}.")
        self._check_starts()
        self.turn["actions"].copy_(actions.reshape(self._count, self._cells)).clamp_(-1.0, 1.0)
        arguments = (self._fleet, self._readings, self._last, self._turn, self._rules)
        self._step(_blocks(self._count), _THREADS, 0, *arguments, stream=self._shared.stream)


def _blocks(threads: int) -> tuple[int]:
    return (-(-threads // _THREADS),)


def _words(array: Any) -> Any:
    """Return records as rows of 64-bit words, in the same memory."""
    rows = array.shape[0]
    return array.view(_WORD).reshape(rows, array.nbytes // (rows * _WORD.itemsize))


def _bytes_per_env(settings: TaskSettings, contacts: int) -> int:
    n, has_walls = settings.grid_size, settings.task.has_walls
    arrays = [*make_robots(1, n), *make_scenarios(1, MAX_QUADS if has_walls else 0)]
    own = dtype_of(State).itemsize + contacts * dtype_of(Contact).itemsize
    return own + sum(array.nbytes for array in arrays) + 8 * n * n


def _check_memory(count: int, each: int) -> None:
    free = free_memory()
    if count * each > free:
        raise OptionError(
            f"num_envs={count} needs about {count * each / 1e9:.1f} GB on the GPU, of which "
            f"{free / 1e9:.1f} are free: at most {free // each:,} environments fit."
        )
