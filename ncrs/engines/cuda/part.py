"""Growth and rollout of part of a population on one GPU, with the memory that they need."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import NCALayout, growth_steps
from ncrs.engines.arguments import GivenBodies
from ncrs.engines.cuda.growth import growth_shared, make_growth_kernel, prepare_robots
from ncrs.engines.cuda.layout import (
    EPISODES,
    PAIR,
    Buffers,
    Courses,
    Genomes,
    Move,
    Outcome,
    places_of,
)
from ncrs.engines.cuda.rollout import roll_out
from ncrs_envs.batched.dtypes import column, dtype_of, records
from ncrs_envs.batched.layout import (
    Contact,
    Robots,
    Scenarios,
    Settings,
    State,
    make_robots,
    make_scratch,
)
from ncrs_envs.batched.records import settings_record
from ncrs_envs.cuda.gpu import (
    WARP,
    Launcher,
    device_array,
    free_memory,
    max_shared,
    processors,
    send,
    to_device,
    to_host,
)
from ncrs_envs.tasks import MAX_EPISODE_STEPS, TaskSettings

_MAX_WARPS = 16
"""Maximum number of warps per block of the rollout, from the registers that each thread uses."""
_THREADS = 64
"""Threads per block where each thread works on one robot."""
_STEPS_AT_ONCE = 4_000_000
"""Maximum number of env steps per launch, so that an evaluation can be interrupted between them."""
_MEMORY_SHARE = 0.8
"""Fraction of the free memory that may be used."""


class PartResult(NamedTuple):
    """Results of part of a population; see ``ncrs.engines.base.RolloutResult``."""

    bodies: NDArray[np.int8]
    finite: NDArray[np.bool_]
    """False if the automaton's state turned non-finite during growth."""
    episode_fitness: NDArray[np.float64]
    success: NDArray[np.bool_]
    crossed: NDArray[np.bool_]
    closest: NDArray[np.float64]


class Device:
    """The kernels and the memory of one GPU, which is current whenever it is used.

    Args:
        settings: Task and its settings.
        layout: Channels of the automaton.
    """

    def __init__(self, settings: TaskSettings, layout: NCALayout) -> None:
        self._settings = settings
        self._layout = layout
        self._kept: dict[Any, Any] = {}
        self._sizes: dict[int, int] = {}
        self._grow = Launcher(make_growth_kernel(layout.channels))
        self._prepare = Launcher(prepare_robots)
        self._roll_out = Launcher(roll_out)
        self._part_codes = to_device(np.array(layout.part_codes, dtype=np.int8))
        setting = records(Settings, 1)
        setting[0] = settings_record(settings)
        self._setting = to_device(setting)

    def parts(self, population: int, episodes: int) -> Iterator[slice]:
        """Return the parts in which a population can be evaluated on this GPU."""
        if episodes not in self._sizes:
            self._sizes[episodes] = self._part_size(episodes)
        size = self._sizes[episodes]
        for start in range(0, population, size):
            yield slice(start, min(start + size, population))

    def _part_size(self, episodes: int) -> int:
        """Return the number of genomes that fit into the memory that is free now."""
        per_genome = 4 * self._layout.num_parameters + sum(
            dtype_of(kind).itemsize * number * episodes
            for kind, number in (
                (State, 1),
                (Move, 1),
                (Outcome, 1),
                (Contact, self._contacts),
            )
        )
        fitting = int(_MEMORY_SHARE * free_memory()) // per_genome
        quick = _STEPS_AT_ONCE // (episodes * MAX_EPISODE_STEPS)
        return max(1, min(fitting, quick))

    @property
    def _contacts(self) -> int:
        """Capacity for the contacts of one robot."""
        return len(make_scratch(self._settings.grid_size).contacts)

    def evaluate(self, weights: Any, scenarios: Scenarios, given: GivenBodies) -> PartResult:
        """Grow and drive robots.

        Args:
            weights: Checked genomes, float32 ``(P, num_parameters)``, here or on the GPU.
            scenarios: Records, ``(P or 1, E)``.
            given: Bodies to drive instead of grown ones.
        """
        settings, n = self._settings, self._settings.grid_size
        population, episodes = len(weights), scenarios.scenarios.shape[1]
        genomes = Genomes(
            self._sent("weights", weights),
            self._part_codes,
            self._array("bodies", (population, n, n), np.int8)
            if given is None
            else self._sent("bodies", given),
            self._array("finite", (population,), np.bool_),
        )
        if given is None:
            shared = growth_shared(self._layout.channels, n * n)
            self._grow((population,), WARP, shared, genomes, growth_steps(n))
            bodies = to_host(genomes.bodies)[:population]
            finite = to_host(genomes.finite)[:population]
        else:
            bodies, finite = given, np.ones(population, dtype=np.bool_)
        result = PartResult(
            bodies,
            finite,
            np.zeros((population, episodes)),
            np.zeros((population, episodes), dtype=np.bool_),
            np.zeros((population, episodes), dtype=np.bool_),
            np.full((population, episodes, settings.task.distances), np.inf),
        )
        chosen = np.flatnonzero(settings.task.is_valid(bodies))
        if len(chosen):
            outcomes = self._drive(genomes, bodies, scenarios, chosen)
            result.episode_fitness[chosen] = column(outcomes, "fitness")
            result.success[chosen] = column(outcomes, "success")
            result.crossed[chosen] = column(outcomes, "crossed")
            for index, name in enumerate(("closest_goal", "closest_target")):
                if index < settings.task.distances:
                    result.closest[chosen, :, index] = column(outcomes, name)
        return result

    def _drive(
        self,
        genomes: Genomes,
        bodies: NDArray[np.int8],
        scenarios: Scenarios,
        chosen: NDArray[np.int64],
    ) -> NDArray[Outcome]:
        """Return the outcomes of the chosen genomes' episodes, ``(V, E)``."""
        places = self._settings.grid_size**2
        population, count, episodes = len(bodies), len(chosen), scenarios.scenarios.shape[1]
        cells = int(np.count_nonzero(bodies[chosen], axis=(1, 2)).max())
        driven = self._driven(count)
        for together in EPISODES:
            at_once = min(together, episodes)
            items = cells * (-(-at_once // PAIR))
            warps = max(min(_MAX_WARPS, -(-items // WARP)), -(-at_once // driven))
            shared = places_of(cells, places, at_once, warps).end
            if shared <= max_shared():
                break
        robots = Robots(
            *(
                self._array(f"robots {index}", array.shape, array.dtype)
                for index, array in enumerate(make_robots(population, self._settings.grid_size))
            )
        )
        courses = Courses(
            self._sent("chosen", chosen),
            robots,
            self._setting,
            Scenarios(
                self._sent("scenarios", scenarios.scenarios), self._sent("quads", scenarios.quads)
            ),
            MAX_EPISODE_STEPS,
            at_once,
            driven,
        )
        shape = (population, episodes)
        buffers = Buffers(
            self._array("outcomes", shape, dtype_of(Outcome)),
            self._array("states", shape, dtype_of(State)),
            self._array("moves", shape, dtype_of(Move)),
            self._array("contacts", (*shape, self._contacts), dtype_of(Contact)),
        )
        self._prepare((-(-count // _THREADS),), _THREADS, 0, genomes, courses)
        grid = (count, -(-episodes // at_once))
        self._roll_out(grid, warps * WARP, shared, genomes, courses, buffers)
        return to_host(buffers.outcomes)[:count]

    def _driven(self, robots: int) -> int:
        """Return the number of episodes whose physics one warp computes.

        Fewer are faster for one block, since threads of a warp that take different paths wait for
        each other; but where many blocks wait for their turn, fewer threads per warp are a waste.
        """
        if robots <= 2 * processors():
            return 1
        return EPISODES[0] if self._settings.task.has_walls else 3

    def _sent(self, name: str, array: NDArray[Any]) -> Any:
        """Return a copy of an array on the GPU, or what is there already."""
        if not isinstance(array, np.ndarray):
            return array
        return send(array, self._array(name, array.shape, array.dtype))

    def _array(self, name: str, shape: tuple[int, ...], dtype: Any) -> Any:
        """Return memory with undefined values, kept from call to call.

        The first axis may be longer than asked for.
        """
        key = (name, shape[1:])
        kept = self._kept.get(key)
        if kept is None or kept.shape[0] < shape[0]:
            self._kept.pop(key, None)
            kept = self._kept[key] = device_array(shape, dtype)
        return kept
