"""Search spaces: the points that an optimizer moves among, and the genomes they stand for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncrs.automaton.channels import NCALayout
from ncrs_envs.errors import NCRSError
from ncrs_envs.registry import Registry

Values = NDArray[np.float64]

WEIGHTS = "weights"
"""Name of the space of all weights."""
CARRIER = "carrier"
"""Name of the space of the gains of a robot by hand, see ``ncrs.automaton.carrier``."""
SPARE, REPAIRING = "spare_parts", "repairing"
"""Names of the spaces of the gains of robots that go on after damage, see
``ncrs.automaton.survivor``: one with spare parts, and one that grows back."""
RELAYS = "relays"
"""Name of the space of ``ncrs.automaton.relays``, in a grown body."""


class SpaceError(NCRSError, ValueError):
    """A search space that is unknown, malformed, or does not fit the search."""


class SearchSpace(ABC):
    """Points of D numbers, each of which stands for a genome.

    Args:
        layout: Layout of the search's task.
        start: Point at which the search starts, finite, shape ``(D,)``.

    Raises:
        SpaceError: If ``start`` is not such a vector.
    """

    def __init__(self, layout: NCALayout, start: Any) -> None:
        values = np.array(start, dtype=np.float64)
        if values.ndim != 1 or not values.size or not np.isfinite(values).all():
            raise SpaceError(
                "A search space starts at a vector of finite numbers, got shape "
                f"{values.shape} with {np.count_nonzero(~np.isfinite(values))} that are not finite."
            )
        self.layout = layout
        self.start: Values = values

    @property
    def dimension(self) -> int:
        """Number D of coordinates."""
        return self.start.size

    @abstractmethod
    def genomes(self, points: Values) -> Values:
        """Return the genomes of points ``(P, D)``, float64 ``(P, num_parameters)``."""


class AllWeights(SearchSpace):
    """The genomes themselves."""

    def genomes(self, points: Values) -> Values:
        """Return the points."""
        return points


class _Moves(NamedTuple):
    """K moves, each of which adds a multiple of a coordinate to a weight."""

    weights: NDArray[Any]
    coordinates: NDArray[Any]
    steps: Values


class _MovedWeights(SearchSpace):
    """Genomes around a base, by moves."""

    def __init__(self, layout: NCALayout, start: Values, base: Values, moves: _Moves) -> None:
        super().__init__(layout, start)
        self._base, self._moves = base, moves

    def genomes(self, points: Values) -> Values:
        """Return the base with the moved weights."""
        weights, coordinates, steps = self._moves
        added = steps * points[:, coordinates]
        return np.stack([self._base + np.bincount(weights, one, len(self._base)) for one in added])


class WeightMap(_MovedWeights):
    """Some weights around a genome, each of which follows a coordinate.

    ``genome[weights[k]] = base[weights[k]] + steps[k] * point[coordinates[k]]``: a mask where each
    has its own coordinate, tied weights where several share one, and step sizes by weight.

    Args:
        layout: Layout of the search's task.
        base: Genome at the start, where all coordinates are 0; None for zeros.
        weights: Indices in the genome, shape ``(K,)``, none twice.
        coordinates: Index of the coordinate that each follows, ``(K,)``; None for its own.
        steps: Factor of each, ``(K,)``, or one for all.

    Raises:
        SpaceError: If the arrays do not fit each other or the genome.
    """

    def __init__(
        self,
        layout: NCALayout,
        base: Values | None,
        weights: Any,
        coordinates: Any = None,
        steps: Any = 1.0,
    ) -> None:
        places = np.asarray(weights)
        followed = np.arange(places.size) if coordinates is None else np.asarray(coordinates)
        for name, values in (("weights", places), ("coordinates", followed)):
            whole = np.issubdtype(values.dtype, np.integer) and values.ndim == 1 and values.size
            if not whole or values.shape != places.shape or values.min() < 0:
                raise SpaceError(
                    f"{name} must be indices from 0, one for each weight, got {values!r:.60}."
                )
        if places.max() >= layout.num_parameters or np.unique(places).size < places.size:
            raise SpaceError(
                f"weights must be different indices below {layout.num_parameters}, got "
                f"{np.unique(places).size} different ones up to {places.max()}."
            )
        count = int(followed.max()) + 1
        if np.unique(followed).size < count:
            raise SpaceError(f"Each of the {count} coordinates must move at least one weight.")
        factors = np.broadcast_to(np.asarray(steps, dtype=np.float64), places.shape)
        if not (np.isfinite(factors) & (factors != 0)).all():
            raise SpaceError("steps must be finite and not 0.")
        zeros = np.zeros(layout.num_parameters)
        around = zeros if base is None else np.asarray(base, dtype=np.float64)
        super().__init__(layout, np.zeros(count), around, _Moves(places, followed, factors))


class LinearMap(_MovedWeights):
    """Combinations of directions around a genome: ``base + matrix @ point``.

    Args:
        layout: Layout of the search's task.
        base: Genome where all coordinates are 0, ``(num_parameters,)``.
        matrix: Change of the genome by coordinate, ``(num_parameters, D)``.
        start: Point at which the search starts; None for zeros.

    Raises:
        SpaceError: If the arrays do not fit each other or the genome, or are not finite.
    """

    def __init__(
        self, layout: NCALayout, base: Values, matrix: Values, start: Values | None = None
    ) -> None:
        size = layout.num_parameters
        around, directions = np.array(base, float), np.array(matrix, float)
        if around.shape != (size,) or directions.ndim != 2 or len(directions) != size:
            raise SpaceError(
                f"base must have shape ({size},) and matrix ({size}, D), got {around.shape} "
                f"and {directions.shape}."
            )
        if not (np.isfinite(around).all() and np.isfinite(directions).all()):
            raise SpaceError("base and matrix must be finite.")
        count = directions.shape[1]
        weights, coordinates = np.nonzero(directions)
        moves = _Moves(weights, coordinates, directions[weights, coordinates])
        super().__init__(layout, np.zeros(count) if start is None else start, around, moves)
        if self.start.shape != (count,):
            raise SpaceError(f"start must have shape ({count},), got {self.start.shape}.")


class GainSpace(SearchSpace):
    """Gains by name, from which a function makes a genome, such as a ``Circuit`` and a body.

    Each coordinate is a gain in units of its size at the start, so that one step size fits all.

    Args:
        layout: Layout of the search's task.
        gains: Value of each gain at the start, not 0.
        genome: Function from the values by name to a genome ``(num_parameters,)``.

    Raises:
        SpaceError: If a gain is 0 or not finite, or the function's result is no genome.
    """

    def __init__(
        self,
        layout: NCALayout,
        gains: Mapping[str, float],
        genome: Callable[[Mapping[str, float]], NDArray[Any]],
    ) -> None:
        self._gains, self._genome = dict(gains), genome
        zeros = [name for name, value in gains.items() if not value]
        if zeros:
            raise SpaceError(f"Gains are searched in units of their start, which is 0 for {zeros}.")
        super().__init__(layout, np.ones(len(gains)))
        layout.check_genomes(self.genomes(self.start[None]))

    def named(self, point: Values) -> dict[str, float]:
        """Return the gains of a point ``(D,)`` by name."""
        values = zip(self._gains.items(), point, strict=True)
        return {name: float(start * factor) for (name, start), factor in values}

    def genomes(self, points: Values) -> Values:
        """Make a genome of each point's gains."""
        return np.stack([np.asarray(self._genome(self.named(point)), float) for point in points])


SpaceFactory = Callable[[NCALayout, "Values | None"], SearchSpace]
"""Makes a space for a layout and the genome of ``start_from``, None if there is none."""


def _all_weights(layout: NCALayout, start: Values | None) -> SearchSpace:
    return AllWeights(layout, np.zeros(layout.num_parameters) if start is None else start)


def _carrier_gains(layout: NCALayout, start: Values | None) -> SearchSpace:
    from ncrs.automaton.carrier import GAINS, TASK, Carrier  # needs torch, which takes a second

    if start is not None or layout.task.name != TASK:
        raise SpaceError(f"The space {CARRIER} is for {TASK}, and has a start of its own.")
    return GainSpace(layout, GAINS, Carrier())


def _survivor_gains(name: str) -> SpaceFactory:
    def make(layout: NCALayout, start: Values | None) -> SearchSpace:
        from ncrs.automaton import chaser, survivor

        if start is not None or layout.task.name != chaser.TASK:
            raise SpaceError(f"The space {name} is for {chaser.TASK}, and has its own start.")
        if name == SPARE:
            genome = survivor.Survivor(survivor.SPARE_BODY)
        else:
            genome = survivor.Survivor(survivor.REPAIR_BODY, regrows=True)
        return GainSpace(layout, survivor.GAINS, genome)

    return make


def _relays(layout: NCALayout, start: Values | None) -> SearchSpace:
    from ncrs.automaton.grow_to import grow_to
    from ncrs.automaton.relays import BODIES, RelayMap

    relays = RelayMap(layout)
    if start is None:
        task = layout.task.name
        if task not in BODIES:
            raise SpaceError(
                f"The space {RELAYS} has no body for {task}: grow one, numpy.save('body.npy', "
                f"ncrs.grow_to(BODY, {task!r})), and start from it with start_from=body.npy."
            )
        start = grow_to(BODIES[task], task).astype(np.float64)
    point = relays.coordinates_of(start)
    if point is None:
        raise SpaceError(
            f"The space {RELAYS} starts from a body that ncrs.grow_to has grown, or from a genome "
            "of this space; start_from names another genome."
        )
    body = np.where(relays.is_control, 0.0, start)
    return LinearMap(layout, relays.base + body, relays.matrix, point)


SPACES: Registry[SpaceFactory] = Registry(
    "search space",
    {
        WEIGHTS: _all_weights,
        CARRIER: _carrier_gains,
        SPARE: _survivor_gains(SPARE),
        REPAIRING: _survivor_gains(REPAIRING),
        RELAYS: _relays,
    },
)


def register_search_space(name: str, factory: SpaceFactory) -> None:
    """Make a search space known by a name, for the setting ``space``.

    Args:
        name: Name of the space.
        factory: Function of the task's layout and of the genome that ``start_from`` names, or None,
            which returns the space; the same one every time.

    Raises:
        ExtensionError: If another space has that name.
    """
    SPACES.register(name, factory)


def check_space(name: str) -> str:
    """Return the name of a space; raise ``SpaceError`` if it is unknown."""
    if name not in SPACES:
        raise SpaceError(f"Unknown search space {name!r}; choose one of {', '.join(SPACES)}.")
    return name
