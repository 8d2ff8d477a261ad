"""Small matrices held in a GPU thread's registers, for numba-cuda kernels.

A tile is ``rows x lanes`` float32 values, one register each; the loops over them are unrolled when
a kernel is compiled. Weights are read from shared memory in vectors of four, which a warp reads all
at once, since its threads read the same address. Every product and sum is one fused operation, in
the order in which the CPU's kernels compute them (``ncrs.engines.tiles``).

Offsets count float32 elements of a flat array in shared memory, are multiples of 4, and are not
checked.
"""

# numba's intrinsics are plain functions that its decorator replaces, which mypy cannot follow.
# mypy: disable-error-code="misc,no-untyped-def,no-untyped-call"

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.cuda import types
from numba.cuda.core.errors import RequireLiteralValue
from numba.cuda.extending import core_models, intrinsic, register_model

_FLOAT = ir.FloatType()
_INDEX = ir.IntType(32)
_VECTOR = 4


class TileType(types.Type):
    """numba type of a tile with ``rows`` times ``lanes`` float32 values."""

    def __init__(self, rows: int, lanes: int) -> None:
        self.rows = rows
        self.lanes = lanes
        super().__init__(name=f"CudaTile({rows} x {lanes})")


@register_model(TileType)
class _TileModel(core_models.PrimitiveModel):
    def __init__(self, manager, tile: TileType) -> None:
        super().__init__(manager, tile, ir.ArrayType(_FLOAT, tile.rows * tile.lanes))


def _constants(*values) -> list[int]:
    """Return the values of literal types; numba asks again with literals if they are not."""
    for value in values:
        if not isinstance(value, types.IntegerLiteral):
            raise RequireLiteralValue(value)
    return [value.literal_value for value in values]


class _Memory:
    """Generator of loads from and stores to one array argument."""

    def __init__(self, context, builder, array_type, value) -> None:
        self._builder = builder
        self._data = context.make_array(array_type)(context, builder, value).data

    def _pointer(self, offset, index: int, lanes: int):
        builder = self._builder
        place = builder.add(offset, ir.Constant(offset.type, index))
        pointer = builder.gep(self._data, [place])
        return builder.bitcast(pointer, ir.VectorType(_FLOAT, lanes).as_pointer())

    def load(self, offset, count: int) -> list[Any]:
        """Load ``count`` elements from ``offset`` on, four at a time."""
        builder, values = self._builder, []
        for first in range(0, count, _VECTOR):
            vector = builder.load(self._pointer(offset, first, _VECTOR), align=4 * _VECTOR)
            for lane in range(min(_VECTOR, count - first)):
                values.append(builder.extract_element(vector, ir.Constant(_INDEX, lane)))
        return values

    def _element(self, offset, index: int):
        builder = self._builder
        return builder.gep(self._data, [builder.add(offset, ir.Constant(offset.type, index))])

    def load_element(self, offset, index: int):
        """Load the element ``index`` places after ``offset``."""
        return self._builder.load(self._element(offset, index))

    def store_element(self, value, offset, index: int) -> None:
        """Store a value ``index`` places after ``offset``."""
        self._builder.store(value, self._element(offset, index))


def _shifted(builder, offset, by: int):
    return builder.add(offset, ir.Constant(offset.type, by))


def _fused(builder, a, b, c):
    return builder.fma(a, b, c)


def _unpacked(builder, tile, value) -> list[Any]:
    return [builder.extract_value(value, index) for index in range(tile.rows * tile.lanes)]


def _packed(context, builder, tile, values):
    result = ir.Constant(context.get_value_type(tile), ir.Undefined)
    for index, value in enumerate(values):
        result = builder.insert_value(result, value, index)
    return result


_MAXIMUM = ir.InlineAsm(
    ir.FunctionType(_FLOAT, [_FLOAT]), "max.NaN.f32 $0, $1, 0f00000000;", "=f,f"
)
"""``max(value, 0)`` in one instruction; NaN stays NaN."""


def _rectified(builder, value):
    return builder.call(_MAXIMUM, [value])


def _add_products(builder, sums, weights, inputs, rows, used):  # noqa: PLR0913 - operands
    """Add the products of one input per row with ``used`` weights to sums."""
    for row in range(rows):
        for lane in range(used):
            index = row * used + lane
            sums[index] = _fused(builder, weights[lane], inputs[row], sums[index])


@intrinsic
def repeat_row(typing_context, rows, lanes, array, offset):
    """Return a tile whose rows are all ``array[offset : offset + lanes]``; sizes are constants."""
    tile = TileType(*_constants(rows, lanes))

    def generate(context, builder, signature, arguments):
        memory = _Memory(context, builder, array, arguments[2])
        values = memory.load(arguments[3], tile.lanes)
        return _packed(context, builder, tile, values * tile.rows)

    return tile(rows, lanes, array, types.int64), generate


@intrinsic
def add_outer_products(  # noqa: PLR0913 - the operands of one operation
    typing_context, tile, count, stride, array, weights, inputs, apart
):
    """Return a tile to which ``count`` outer products are added, one after the other.

    ``tile[r, l] += array[weights + c * stride + l] * array[inputs + r * apart + c]`` for each ``c``
    below ``count``; ``count``, ``stride`` and ``apart`` are constants.
    """
    number, step, spacing = _constants(count, stride, apart)

    def generate(context, builder, signature, arguments):
        value, _, _, array_value, first, source, _ = arguments
        memory = _Memory(context, builder, array, array_value)
        sums = _unpacked(builder, tile, value)
        for index in range(number):
            inputs = [
                memory.load_element(source, row * spacing + index) for row in range(tile.rows)
            ]
            weight = memory.load(_shifted(builder, first, index * step), tile.lanes)
            _add_products(builder, sums, weight, inputs, tile.rows, tile.lanes)
        return _packed(context, builder, tile, sums)

    signature = tile(tile, count, stride, array, types.int64, types.int64, apart)
    return signature, generate


@intrinsic
def rectified(typing_context, tile):
    """Return ``max(tile, 0)``; NaN stays NaN."""

    def generate(context, builder, signature, arguments):
        values = [_rectified(builder, v) for v in _unpacked(builder, tile, arguments[0])]
        return _packed(context, builder, tile, values)

    return tile(tile), generate


@intrinsic
def add_units(  # noqa: PLR0913 - the operands of one operation
    typing_context, change, hidden, group, stride, length, array, second, bias, third
):
    """Return the change of the channels to which some units of the second layer are added.

    The ``group`` units are rectified sums over all of ``hidden``, the first layer's units. Their
    weights lie in ``array`` from ``second`` on, ``[unit in][unit out]`` in rows of ``stride``, and
    their biases from ``bias`` on; the weights of the third layer that read them lie from ``third``
    on, ``[unit][channel]`` in rows of ``length``.
    """
    width, step, row_length = _constants(group, stride, length)
    rows, units, channels = hidden.rows, hidden.lanes, change.lanes

    def generate(context, builder, signature, arguments):
        change_value, hidden_value, _, _, _, array_value, weights, biases, third_value = arguments
        memory = _Memory(context, builder, array, array_value)
        hidden_values = _unpacked(builder, hidden, hidden_value)
        changes = _unpacked(builder, change, change_value)
        sums = memory.load(biases, width) * rows
        for unit in range(units):
            weight = memory.load(_shifted(builder, weights, unit * step), width)
            inputs = [hidden_values[row * units + unit] for row in range(rows)]
            _add_products(builder, sums, weight, inputs, rows, width)
        for lane in range(width):
            weight = memory.load(_shifted(builder, third_value, lane * row_length), channels)
            inputs = [_rectified(builder, sums[row * width + lane]) for row in range(rows)]
            _add_products(builder, changes, weight, inputs, rows, channels)
        return _packed(context, builder, change, changes)

    places = (types.int64,) * 3
    return change(change, hidden, group, stride, length, array, *places), generate


@intrinsic
def store_clipped_sum(  # noqa: PLR0913 - the operands of one operation
    typing_context, tile, limit, array, inputs, outputs, apart
):
    """Write ``clip(array[inputs + ...] + tile, -limit, limit)`` from ``outputs`` on.

    Rows are ``apart`` elements from each other, a constant. NaN stays NaN.
    """
    (spacing,) = _constants(apart)

    def generate(context, builder, signature, arguments):
        value, high, array_value, source, target, _ = arguments
        memory = _Memory(context, builder, array, array_value)
        changes = _unpacked(builder, tile, value)
        low = builder.fsub(ir.Constant(_FLOAT, -0.0), high)
        for row in range(tile.rows):
            for lane in range(tile.lanes):
                place = row * spacing + lane
                total = builder.fadd(
                    memory.load_element(source, place), changes[row * tile.lanes + lane]
                )
                total = builder.select(builder.fcmp_ordered(">", total, high), high, total)
                total = builder.select(builder.fcmp_ordered("<", total, low), low, total)
                memory.store_element(total, target, place)
        return context.get_dummy_value()

    signature = types.void(tile, types.float32, array, types.int64, types.int64, apart)
    return signature, generate
