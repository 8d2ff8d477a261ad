"""Small matrices held in vector registers, for numba kernels.

A tile is ``rows x lanes`` float32 values, each row one vector of ``lanes``. Matrix products are
sums of rank-one updates of a tile, the usual inner loop of fast matrix products: one vector of
weights is loaded once and used in every row. LLVM splits the vectors to fit the processor. The loop
vectorisation of numba itself reached a sixth of the speed for the same products.

Products and sums may fuse (``contract``) but are never reordered, and NaN is never assumed away:
a NaN anywhere in the inputs of a value makes that value NaN.

Offsets count float32 elements of contiguous arrays and are not checked.
"""

# numba's intrinsics are plain functions that its decorator replaces, which mypy cannot follow.
# mypy: disable-error-code="misc,no-untyped-def,no-untyped-call"

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic, models, register_model
from numba.np.arrayobj import make_array

_ELEMENT_BYTES = 4
_FLOAT = ir.FloatType()
_INDEX = ir.IntType(32)


class TileType(types.Type):
    """numba type of a tile with ``rows`` vectors of ``lanes`` float32 values."""

    def __init__(self, rows: int, lanes: int) -> None:
        self.rows = rows
        self.lanes = lanes
        super().__init__(name=f"Tile({rows} x {lanes})")


@register_model(TileType)
class _TileModel(models.PrimitiveModel):
    def __init__(self, manager: Any, tile: TileType) -> None:
        vector = ir.VectorType(_FLOAT, tile.lanes)
        super().__init__(manager, tile, ir.ArrayType(vector, tile.rows))


class _Array:
    """Generator of loads from and stores to one array argument."""

    def __init__(self, context, builder, array_type, value) -> None:
        self._builder = builder
        self._data = make_array(array_type)(context, builder, value).data

    def _pointer(self, offset, lanes: int):
        element = self._builder.gep(self._data, [offset])
        return self._builder.bitcast(element, ir.VectorType(_FLOAT, lanes).as_pointer())

    def load(self, offset, lanes: int):
        return self._builder.load(self._pointer(offset, lanes), align=_ELEMENT_BYTES)

    def load_spread(self, offset, lanes: int):
        """Load one element into every lane."""
        value = self._builder.load(self._builder.gep(self._data, [offset]), align=_ELEMENT_BYTES)
        return _spread(self._builder, value, lanes)

    def store(self, vector, offset) -> None:
        pointer = self._pointer(offset, vector.type.count)
        self._builder.store(vector, pointer, align=_ELEMENT_BYTES)


def _spread(builder, value, lanes: int):
    undefined = ir.Constant(ir.VectorType(_FLOAT, lanes), ir.Undefined)
    first = builder.insert_element(undefined, value, ir.Constant(_INDEX, 0))
    zeros = ir.Constant(ir.VectorType(_INDEX, lanes), None)
    return builder.shuffle_vector(first, undefined, zeros)


def _build_tile(context, builder, tile: TileType, row_of):
    """Build a tile whose row ``r`` is ``row_of(r)``."""
    value = ir.Constant(context.get_value_type(tile), ir.Undefined)
    for row in range(tile.rows):
        value = builder.insert_value(value, row_of(row), row)
    return value


def _row_offsets(builder, first, stride, rows: int):
    offsets = [first]
    for _ in range(rows - 1):
        offsets.append(builder.add(offsets[-1], stride))
    return offsets


@intrinsic(prefer_literal=True)
def repeat_row(typing_context, rows, lanes, array, offset):
    """Return a tile with rows ``array[offset : offset + lanes]``; the sizes are constants."""
    tile = TileType(rows.literal_value, lanes.literal_value)

    def generate(context, builder, signature, arguments):
        vector = _Array(context, builder, array, arguments[2]).load(arguments[3], tile.lanes)
        return _build_tile(context, builder, tile, lambda _: vector)

    return tile(rows, lanes, array, types.intp), generate


@intrinsic
def add_outer_product(  # noqa: PLR0913 - the operands of one instruction
    typing_context, tile, weights, start, inputs, first, stride
):
    """Return ``tile[r, l] + weights[start + l] * inputs[first + r * stride]`` as a tile."""

    def generate(context, builder, signature, arguments):
        value, weight_array, start_value, input_array, first_value, stride_value = arguments
        vector = _Array(context, builder, weights, weight_array).load(start_value, tile.lanes)
        source = _Array(context, builder, inputs, input_array)
        offsets = _row_offsets(builder, first_value, stride_value, tile.rows)

        def row_of(row):
            factor = source.load_spread(offsets[row], tile.lanes)
            product = builder.fmul(vector, factor, flags=["contract"])
            return builder.fadd(builder.extract_value(value, row), product, flags=["contract"])

        return _build_tile(context, builder, tile, row_of)

    signature = tile(tile, weights, types.intp, inputs, types.intp, types.intp)
    return signature, generate


@intrinsic
def store_rectified(typing_context, tile, array, first, stride):
    """Write ``max(tile[r, l], 0)`` to ``array[first + r * stride + l]``; NaN stays NaN."""

    def generate(context, builder, signature, arguments):
        target = _Array(context, builder, array, arguments[1])
        offsets = _row_offsets(builder, arguments[2], arguments[3], tile.rows)
        for row, offset in enumerate(offsets):
            vector = builder.extract_value(arguments[0], row)
            zero = ir.Constant(vector.type, None)
            negative = builder.fcmp_ordered("<", vector, zero)
            target.store(builder.select(negative, zero, vector), offset)
        return context.get_dummy_value()

    return types.void(tile, array, types.intp, types.intp), generate


@intrinsic
def store_clipped_sum(  # noqa: PLR0913 - the operands of one instruction
    typing_context, tile, limit, inputs, outputs, first, stride
):
    """Write ``clip(inputs + tile, -limit, limit)`` to ``outputs``; NaN stays NaN.

    Row ``r`` reads and writes at ``first + r * stride``.
    """

    def generate(context, builder, signature, arguments):
        value, limit_value, input_array, output_array, first_value, stride_value = arguments
        source = _Array(context, builder, inputs, input_array)
        target = _Array(context, builder, outputs, output_array)
        high = _spread(builder, limit_value, tile.lanes)
        low = builder.fneg(high)
        for row, offset in enumerate(_row_offsets(builder, first_value, stride_value, tile.rows)):
            change = builder.extract_value(value, row)
            total = builder.fadd(source.load(offset, tile.lanes), change)
            total = builder.select(builder.fcmp_ordered(">", total, high), high, total)
            total = builder.select(builder.fcmp_ordered("<", total, low), low, total)
            target.store(total, offset)
        return context.get_dummy_value()

    signature = types.void(tile, types.float32, inputs, outputs, types.intp, types.intp)
    return signature, generate
