"""Interface of optimizers that know what their genomes are for."""

from __future__ import annotations

from abc import abstractmethod

from ncrs.evolution.optimizers.base import Optimizer
from ncrs_envs.tasks import Task


class TaskOptimizer(Optimizer):
    """An optimizer that is told the search's task before it is first asked."""

    @abstractmethod
    def set_task(self, task: Task) -> None:
        """Propose genomes for this task.

        Raises:
            OptimizerError: If its genomes have another length.
        """
