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
from ncrs.evolution.schema import StoredStateError, check_like, check_names

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


_STATE = "The state of pycma's strategy"
_LATER = {
    "evaluations_per_f_value": 1, "number_of_injections": 1, "_isotropic_mean_shift": 1,
    "_sigma_old": 1, "mean_old": 1, "_last_multiplier": 1, "mean_old_old": 2,
}  # fmt: skip
"""Members that a new strategy does not have, with the iteration from which on it has them."""
_LATER_WITH_TPA = {"_last_z": 1, "cs": 1, "ps": 1}
_VECTORS = frozenset(
    {"_isotropic_mean_shift", "mean_old", "mean_old_old", "ps", "scaling", "x", "x_geno"}
)
"""Vectors over the variables that a new strategy does not have, or only as one number."""
_OF_POPULATION = frozenset({"fit", "bndpen", "fit_plus_pen", "idx"})
"""Arrays over the last population, which a new strategy does not have."""
_MAY_BE_INFINITE = frozenset({"f", "median_min", "median_previous", "condition_limit"})


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
        StoredStateError: If the state lacks a member, has one that pycma's objects do not have, or
            one that is malformed. The strategy is unchanged then, but for its sampler.
    """
    state = dict(state)
    own = _keeps_own_state(strategy.sm)
    if own:
        if _SAMPLER not in state:
            raise StoredStateError(f"{_STATE} lacks {_SAMPLER}: it is incomplete.")
        strategy.sm.load_state(state.pop(_SAMPLER))
    reference = capture(strategy, sampler=not own)
    check_like(state.get("countiter"), reference["countiter"], f"{_STATE}.countiter")
    population = len(state.get("_is_independent_sample", ()))
    _check(state, reference, _STATE, (state["countiter"], strategy.N, population))
    _restore(strategy, state, "")
    strategy._updateBDfromSM(strategy.sm)
    strategy.timer = ElapsedWCTime()  # pycma makes its clock in the first ask


def _check(state: Any, reference: dict[str, Any], path: str, size: tuple[int, ...]) -> None:
    """Check names, kinds, shapes and finiteness of all members.

    Args:
        state: Captured state.
        reference: State of a new strategy with the same options.
        path: Name of the state, for messages.
        size: Iterations that the strategy has done, number of its variables N, and size of its last
            population.
    """
    iteration, dimension, population = size
    later = {}
    if path == _STATE:
        later = {name: after for name, after in _LATER.items() if name != "_last_multiplier"}
    elif path.endswith("adapt_sigma"):
        later = {"_last_multiplier": 1, **(_LATER_WITH_TPA if "s" in reference else {})}
    due = [name for name, after in later.items() if iteration >= after]
    check_names(state, {*reference, *due}, path, later)
    for name, value in state.items():
        model, below = reference.get(name), f"{path}.{name}"
        if isinstance(model, dict):
            _check(value, model, below, size)
            continue
        if np.ndim(value) and (model is None or np.ndim(model) == 0):
            if name in _VECTORS:
                model = np.zeros(dimension)
            elif name in _OF_POPULATION and np.shape(value) != (population,):
                raise StoredStateError(
                    f"{below} must have shape ({population},), got {np.shape(value)}."
                )
        check_like(value, model, below, may_be_infinite=name in _MAY_BE_INFINITE)


def _restore(owner: Any, state: dict[str, Any], name: str) -> None:
    members = dict(_members(owner, name))
    for key, value in state.items():
        if isinstance(value, dict):
            _restore(members[key], value, key)
        else:
            setattr(owner, key, _copy(value))
