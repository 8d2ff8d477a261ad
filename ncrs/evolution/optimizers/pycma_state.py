"""The state of a pycma evolution strategy as plain data, without pickle.

pycma keeps its state in attributes of a small tree of its own objects. ``capture`` copies those
that hold data; ``restore`` writes them into a new strategy with the same options, which provides
the code.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ncrs.evolution.optimizers.pycma import ElapsedWCTime
from ncrs.evolution.optimizers.settings import OptimizerError

# Not state: options and values that follow from them, logs, clocks, arguments of the last call, and
# pycma's copies of the sampler's matrices.
_LEFT_OUT = frozenset(
    {
        "opts", "inopts", "_es_opts", "sp", "sp0", "logger", "timer", "more_to_write",
        "_tell2_args", "ary", "pop", "pop_sorted", "archive", "sent_solutions", "_stopdict",
        "boundary_handler", "gp", "_round_integer_variables", "_injected_solutions_archive",
        "B", "C", "D", "dC", "_parameters", "_lam", "_mueff", "randn",
    }
)  # fmt: skip
_SAMPLER = "sm"
_SAMPLER_MATRICES = frozenset({"B", "C", "D"})


class PycmaStateError(OptimizerError):
    """A state that does not fit pycma's objects, such as one of another pycma version."""


def _is_pycma_object(value: Any) -> bool:
    return type(value).__module__.split(".")[0] == "cma" and hasattr(value, "__dict__")


def _is_plain(value: Any) -> bool:
    if value is None or isinstance(value, bool | int | float | str | np.generic | np.ndarray):
        return True
    return isinstance(value, list | tuple) and all(_is_plain(item) for item in value)


def _members(owner: Any, name: str) -> Iterator[tuple[str, Any]]:
    kept = _SAMPLER_MATRICES if name == _SAMPLER else frozenset()
    for key, value in vars(owner).items():
        if key in kept or key not in _LEFT_OUT:
            yield key, value


def _copy(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        # In the same memory layout: products with the eigenvectors round differently in another.
        return value.copy(order="K")
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, list | tuple):
        return [_copy(item) for item in value]
    return value


def capture(strategy: Any, *, sampler: bool = True) -> dict[str, Any]:
    """Copy a strategy's state into nested dicts of arrays and JSON values.

    Args:
        strategy: ``cma.CMAEvolutionStrategy`` to copy from.
        sampler: True to include the sampler, which holds nearly all the memory.
    """
    state = _capture(strategy, "")
    if sampler:
        own = _keeps_own_state(strategy.sm)
        state[_SAMPLER] = strategy.sm.state() if own else _capture(strategy.sm, _SAMPLER)
    return state


def _keeps_own_state(sampler: Any) -> bool:
    """Return True for a sampler of our own, whose matrices are not numpy's."""
    return hasattr(sampler, "load_state")


def _capture(owner: Any, name: str) -> dict[str, Any]:
    state: dict[str, Any] = {}
    for key, value in _members(owner, name):
        if _is_plain(value):
            state[key] = _copy(value)
        elif _is_pycma_object(value) and key != _SAMPLER:
            state[key] = _capture(value, key)
    return state


def restore(strategy: Any, state: dict[str, Any]) -> None:
    """Write a captured state into a strategy made with the same options.

    Raises:
        PycmaStateError: If the state has parts that the strategy does not have.
    """
    state = dict(state)
    if _keeps_own_state(strategy.sm):
        strategy.sm.load_state(state.pop(_SAMPLER))
    _restore(strategy, state, "")
    strategy._updateBDfromSM(strategy.sm)
    strategy.timer = ElapsedWCTime()  # pycma makes its clock in the first ask


def _restore(owner: Any, state: dict[str, Any], name: str) -> None:
    members = dict(_members(owner, name))
    for key, value in state.items():
        if isinstance(value, dict):
            if not _is_pycma_object(members.get(key)):
                raise PycmaStateError(
                    f"The state holds {key!r}, which this version of pycma does not have; "
                    "continue with the version that wrote it."
                )
            _restore(members[key], value, key)
        else:
            setattr(owner, key, _copy(value))
