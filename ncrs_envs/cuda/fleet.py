"""Many environments in the memory of one GPU."""

from __future__ import annotations

from collections.abc import Callable
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
from ncrs_envs.cuda.gpu import Launcher, device_array, free_memory, to_device, to_host, wait
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

_Make = Callable[[tuple[int, ...], Any], Any]
"""Function of shape and dtype that makes an array."""


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
        n = settings.grid_size
        self._count, self._cells, self._shared = count, n * n, shared
        self._rules = Rules(Room(n, playfield(n), NOISE), settings.task.has_walls, *ends)
        _check_memory(count, _bytes_per_env(settings))
        setting = records(Settings, 1)
        setting[0] = settings_record(settings)
        failures, self._failures = shared.zeros((1,), np.int64)
        own = _own_arrays(settings, count, device_array)
        self._fleet = Fleet(to_device(setting), *own, failures)
        readings = _reading_shapes(self._cells)
        made, self.readings = self._shared_arrays(readings, count)
        self._readings = Readings(**made)
        made, self.last = self._shared_arrays(readings, count if self._rules.resets_at_once else 1)
        self._last = Readings(**made)
        made, self.turn = self._shared_arrays(_turn_shapes(self._cells), count)
        self._turn = Turn(**made)
        self._start, self._step = Launcher(start_envs), Launcher(step_envs)
        self._scatter = Launcher(scatter)

    def _shared_arrays(
        self, shapes: dict[str, Any], count: int
    ) -> tuple[dict[str, Any], dict[str, torch.Tensor]]:
        """Return new arrays as kernels and as learners see them, by name."""
        made = {
            name: self._shared.zeros((count, *shape), dtype)
            for name, (shape, dtype) in shapes.items()
        }
        arrays = {name: array for name, (array, _) in made.items()}
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
            wait()  # for what was started on torch's stream
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
        chosen, words = to_device(np.asarray(envs, dtype=np.int64)), to_device(_words(rows))
        wait()  # for the copies, which are not on torch's stream
        self._launch(self._scatter, len(envs), chosen, words, _words(place))

    def start(self, kinds: NDArray[np.int8], regions: NDArray[np.int64]) -> None:
        """Start episodes; arguments as in ``kernels.start_envs``.

        Raises:
            ScenarioError: No start free of walls was found.
        """
        what = (to_device(kinds), to_device(regions))
        wait()
        arguments = (self._fleet, self._readings, self._turn, self._rules, what)
        self._launch(self._start, self._count, *arguments)
        self._check_starts()

    def _check_starts(self) -> None:
        if int(self._failures.item()):
            self._failures.zero_()
            raise no_start(self._rules.room.grid_size)

    def step(self, actions: torch.Tensor) -> None:
        """Advance every environment by one step, or start its next episode.

        Args:
            actions: Gas per cell, ``(count, n, n)`` on the GPU.

        Raises:
            ActionError: An action is not finite.
            ScenarioError: A start in the last step was not free of walls.
        """
        finite = torch.isfinite(actions)
        if not bool(finite.all() & (self._failures == 0)):
            self._check_starts()
            index = tuple(torch.nonzero(~finite)[0].tolist())
            raise ActionError(f"action must be finite, got {actions[index].item()} at {index}.")
        self.turn["actions"].copy_(actions.reshape(self._count, self._cells)).clamp_(-1.0, 1.0)
        arguments = (self._fleet, self._readings, self._last, self._turn, self._rules)
        self._launch(self._step, self._count, *arguments)

    def _launch(self, kernel: Launcher, threads: int, *arguments: Any) -> None:
        blocks = (-(-threads // _THREADS),)
        kernel(blocks, _THREADS, 0, *arguments, stream=self._shared.stream)


def _own_arrays(
    settings: TaskSettings, count: int, make: _Make
) -> tuple[Robots, Scenarios, Any, Any, Any, Walls]:
    """Make the arrays of ``Fleet`` between its settings and its failures."""
    n, has_walls = settings.grid_size, settings.task.has_walls
    scenarios = make_scenarios(1, MAX_QUADS if has_walls else 0)
    contacts = len(make_scratch(n).contacts)
    walls = count if has_walls else 1
    return (
        Robots(*(make((count, *array.shape[1:]), array.dtype) for array in make_robots(1, n))),
        Scenarios(*(make((count, *array.shape[1:]), array.dtype) for array in scenarios)),
        make((count,), dtype_of(State)),
        make((count, contacts), dtype_of(Contact)),
        make((count, STREAM_SIZE), _WORD),
        Walls(
            make((walls, 2), np.int64),
            make((walls, 2, MAX_VERTICES, 2), np.float64),
            make((walls, MAX_QUADS, 4, 2), np.float64),
        ),
    )


def _reading_shapes(cells: int) -> dict[str, Any]:
    """Return shape and dtype of the fields of ``Readings``, for one environment."""
    return {
        "observations": ((cells,), np.float32),
        "poses": ((3,), np.float64),
        "distances": ((2,), np.float64),
        "success": ((), np.bool_),
        "crossed": ((), np.bool_),
    }


def _turn_shapes(cells: int) -> dict[str, Any]:
    """Return shape and dtype of the fields of ``Turn``, for one environment."""
    return {
        "actions": ((cells,), np.float32),
        "rewards": ((), np.float64),
        "terminated": ((), np.bool_),
        "truncated": ((), np.bool_),
        "is_done": ((), np.bool_),
        "steps": ((), np.int64),
    }


def _words(array: Any) -> Any:
    """Return records as rows of 64-bit words, in the same memory."""
    rows = array.shape[0]
    return array.view(_WORD).reshape(rows, array.nbytes // (rows * _WORD.itemsize))


def _bytes_per_env(settings: TaskSettings) -> int:
    sizes: list[int] = []

    def measure(shape: tuple[int, ...], dtype: Any) -> None:
        sizes.append(int(np.prod(shape)) * np.dtype(dtype).itemsize)

    _own_arrays(settings, 1, measure)
    cells = settings.grid_size**2
    for shapes in (_reading_shapes(cells), _reading_shapes(cells), _turn_shapes(cells)):
        for shape, dtype in shapes.values():
            measure(shape, dtype)
    return sum(sizes)


def _check_memory(count: int, each: int) -> None:
    free = free_memory()
    if count * each > free:
        raise OptionError(
            f"num_envs={count} needs about {count * each / 1e9:.1f} GB on the GPU, of which "
            f"{free / 1e9:.1f} are free: at most {free // each:,} environments fit."
        )
