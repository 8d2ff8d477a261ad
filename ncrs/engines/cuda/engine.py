"""Engine on GPUs.

Results depend neither on the number of GPUs nor on how a population is split over them, since every
value of an episode is computed by threads that work on that episode alone.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.device_genomes import DeviceGenomes
from ncrs.engines.arguments import GivenBodies, ScenarioRows, happens_in
from ncrs.engines.base import (
    Engine,
    EngineSettingError,
    EvaluationInterrupted,
    RolloutResult,
    StopCheck,
)
from ncrs.engines.batched import check_compiled_rules, scenario_table
from ncrs.engines.cuda.devices import check_devices, on_device
from ncrs.engines.cuda.part import Device, PartResult
from ncrs_envs.batched.layout import Scenarios
from ncrs_envs.cuda.gpu import IS_SIMULATED
from ncrs_envs.cuda.tensors import kernel_view
from ncrs_envs.tasks import TaskSettings


class CUDAEngine(Engine):
    """``Engine`` on GPUs, with the physics of the batched simulator.

    The kernels are compiled on first use, which takes about 20 s.

    Args:
        settings: Task and its settings.
        workers: Not used: one thread waits for each GPU.
        devices: Indices of the GPUs that genomes are spread over.

    Raises:
        EngineSettingError: A GPU cannot be used, or the task needs Box2D.
    """

    name = "cuda"

    def __init__(
        self,
        settings: TaskSettings,
        workers: int | None = None,
        devices: Sequence[int] = (0,),
    ) -> None:
        check_compiled_rules(settings)
        super().__init__(settings, workers)
        check_devices(devices)
        self.devices = tuple(devices)
        self._made: dict[int, Device] = {}

    def _check_genomes(self, genomes: Any) -> Any:
        if not isinstance(genomes, DeviceGenomes) or not self._takes(genomes):
            return super()._check_genomes(genomes)
        weights = genomes.tensor.float()
        if not bool(weights.isfinite().all()):
            return super()._check_genomes(genomes)  # says which
        return DeviceGenomes(weights)

    def _takes(self, genomes: DeviceGenomes) -> bool:
        """Return True if genomes lie where they are to be evaluated, and have the right length."""
        device, fits = genomes.tensor.device, genomes.shape[1] == self.layout.num_parameters
        is_there = device.type == "cpu" if IS_SIMULATED else self.devices == (device.index,)
        return fits and is_there and len(self.devices) == 1

    def _rollout(
        self,
        genomes: Any,  # or DeviceGenomes
        rows: ScenarioRows,
        should_stop: StopCheck,
        bodies: GivenBodies,
    ) -> RolloutResult:
        if happens_in(rows):
            raise EngineSettingError(
                "engine=cuda simulates no damage, failing wheels, noise or repair; choose "
                "engine=batched or engine=box2d."
            )
        scenarios = scenario_table(rows, self.settings.grid_size)
        shares = np.array_split(np.arange(len(genomes)), min(len(self.devices), len(genomes)))
        lock = Lock()

        def stop() -> bool:
            with lock:  # callers' functions need not bear threads
                return should_stop()

        def evaluate(share: NDArray[np.int64], index: int) -> list[PartResult]:
            with on_device(index):
                if index not in self._made:
                    self._made[index] = Device(self.settings, self.layout)
                device, parts = self._made[index], []
                for part in device.parts(len(share), len(rows[0])):
                    if stop():
                        raise EvaluationInterrupted
                    chosen = share[part]
                    own = scenarios
                    if len(rows) > 1:
                        own = Scenarios(scenarios.scenarios[chosen], scenarios.quads[chosen])
                    given = None if bodies is None else bodies[chosen]
                    if isinstance(genomes, DeviceGenomes):  # on the only GPU
                        weights = kernel_view(genomes.tensor[part])
                    else:
                        weights = genomes[chosen]
                    parts.append(device.evaluate(weights, own, given))
            return parts

        if len(shares) == 1:
            parts = evaluate(shares[0], self.devices[0])
        else:
            with ThreadPoolExecutor(len(shares), "ncrs-cuda") as pool:
                parts = list(itertools.chain(*pool.map(evaluate, shares, self.devices)))
        whole = PartResult(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))
        return RolloutResult(
            whole.bodies,
            whole.episode_fitness,
            whole.success,
            whole.crossed,
            whole.closest,
            whole.finite,
        )

    def close(self) -> None:
        """Release the memory on the GPUs."""
        self._made.clear()
