"""Functions of Python, numpy and the tiles that translated functions may call."""

from __future__ import annotations

import ast
import builtins
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ncrs.engines import tiles
from ncrs.live.expressions import Code, Expressions, data_of
from ncrs.live.translate import new_array
from ncrs.live.types import (
    BOOL,
    FLOAT,
    INT,
    NONE,
    STORES,
    Array,
    Scalar,
    Type,
    dtype_name,
    joined,
)

Builtin = Callable[[Expressions, ast.Call], Code]

TILE = Scalar("tile")


def _arguments(scope: Expressions, node: ast.Call, count: int) -> list[ast.expr]:
    if len(node.args) != count or node.keywords:
        raise scope.refuse(node, f"{ast.unparse(node.func)} takes {count} arguments here")
    return node.args


def _extreme(name: str) -> Builtin:
    def call(scope: Expressions, node: ast.Call) -> Code:
        first, second = (scope.number(item) for item in _arguments(scope, node, 2))
        made = joined(first.type, second.type)
        if made is None:
            raise scope.refuse(node, "both arguments must have one type")
        return Code(f"{name}({first.text}, {second.text})", made)

    return call


def _function(name: str, count: int = 1, made: Type | None = FLOAT) -> Builtin:
    """Make a call of a function of numbers; its result has the argument's type without another."""

    def call(scope: Expressions, node: ast.Call) -> Code:
        codes = [scope.number(item) for item in _arguments(scope, node, count)]
        text = f"{name}({', '.join(code.text for code in codes)})"
        return Code(text, codes[0].type if made is None else made)

    return call


def _float(scope: Expressions, node: ast.Call) -> Code:
    code = scope.number(_arguments(scope, node, 1)[0])
    return Code(code.text, FLOAT, code.is_atom)


def _bool(scope: Expressions, node: ast.Call) -> Code:
    argument = _arguments(scope, node, 1)[0]
    return Code(scope.condition(argument), BOOL, False)


def _len(scope: Expressions, node: ast.Call) -> Code:
    code, made = scope.array(_arguments(scope, node, 1)[0])
    return Code(f"{code.text}.length" if made.rank == 1 else f"{code.text}.shape[0]", INT)


def _isfinite(scope: Expressions, node: ast.Call) -> Code:
    code = scope.number(_arguments(scope, node, 1)[0])
    return Code(f"Number.isFinite({code.text})", BOOL)


def _argmax(scope: Expressions, node: ast.Call) -> Code:
    code, made = scope.array(_arguments(scope, node, 1)[0])
    if made.rank != 1:
        raise scope.refuse(node, "argmax takes an array of one axis")
    return Code(f"indexOfMax({code.text})", INT)


def _dtype(scope: Expressions, node: ast.Call) -> str:
    for word in node.keywords:
        if word.arg == "dtype":
            return dtype_name(np.dtype(scope.value_of(word.value)))
        raise scope.refuse(node, f"the argument {word.arg} is not known")
    return "float64"


def _new(scope: Expressions, node: ast.Call, count: int) -> tuple[str, Array]:
    if len(node.args) != count:
        raise scope.refuse(node, f"{ast.unparse(node.func)} takes {count} arguments here")
    shape = node.args[0]
    sides = shape.elts if isinstance(shape, ast.Tuple) else [shape]
    item = _dtype(scope, node)
    text = new_array(STORES[item], [scope.integer(side).text for side in sides])
    return text, Array(item, len(sides))


def _zeros(scope: Expressions, node: ast.Call) -> Code:
    return Code(*_new(scope, node, 1))


def _ones(scope: Expressions, node: ast.Call) -> Code:
    text, made = _new(scope, node, 1)
    return Code(f"filled({text}, 1)", made)


def _full(scope: Expressions, node: ast.Call) -> Code:
    text, made = _new(scope, node, 2)
    return Code(f"filled({text}, {scope.number(node.args[1]).text})", made)


def _like(scope: Expressions, node: ast.Call) -> Code:
    code, made = scope.array(_arguments(scope, node, 1)[0])
    return Code(f"zerosLike({code.text})", made)


def _repeat_row(scope: Expressions, node: ast.Call) -> Code:
    rows, lanes, array, offset = _arguments(scope, node, 4)
    values, _ = scope.array(array)
    sizes = f"{scope.integer(rows).text}, {scope.integer(lanes).text}"
    return Code(f"repeatRow({sizes}, {data_of(values)}, {scope.integer(offset).text})", TILE)


def _add_outer_product(scope: Expressions, node: ast.Call) -> Code:
    tile, weights, start, inputs, first, stride = _arguments(scope, node, 6)
    parts = [
        _tile(scope, tile),
        data_of(scope.array(weights)[0]),
        scope.integer(start).text,
        data_of(scope.array(inputs)[0]),
        scope.integer(first).text,
        scope.integer(stride).text,
    ]
    return Code(f"addOuterProduct({', '.join(parts)})", TILE)


def _store_rectified(scope: Expressions, node: ast.Call) -> Code:
    tile, array, first, stride = _arguments(scope, node, 4)
    parts = [
        _tile(scope, tile),
        data_of(scope.array(array)[0]),
        scope.integer(first).text,
        scope.integer(stride).text,
    ]
    return Code(f"storeRectified({', '.join(parts)})", NONE)


def _store_clipped_sum(scope: Expressions, node: ast.Call) -> Code:
    tile, limit, inputs, outputs, first, stride = _arguments(scope, node, 6)
    parts = [
        _tile(scope, tile),
        scope.number(limit).text,
        data_of(scope.array(inputs)[0]),
        data_of(scope.array(outputs)[0]),
        scope.integer(first).text,
        scope.integer(stride).text,
    ]
    return Code(f"storeClippedSum({', '.join(parts)})", NONE)


def _tile(scope: Expressions, node: ast.expr) -> str:
    code = scope.expression(node)
    if code.type != TILE:
        raise scope.refuse(node, "a tile is expected here")
    return code.text


BUILTINS: Mapping[Any, Builtin] = {
    builtins.min: _extreme("minimum"),
    builtins.max: _extreme("maximum"),
    builtins.abs: _function("Math.abs", made=None),
    builtins.float: _float,
    builtins.bool: _bool,
    builtins.len: _len,
    math.sqrt: _function("Math.sqrt"),
    math.sin: _function("Math.sin"),
    math.cos: _function("Math.cos"),
    math.exp: _function("Math.exp"),
    math.copysign: _function("copySign", 2),
    math.isfinite: _isfinite,
    np.isfinite: _isfinite,
    np.argmax: _argmax,
    np.zeros: _zeros,
    np.empty: _zeros,
    np.ones: _ones,
    np.full: _full,
    np.zeros_like: _like,
    np.empty_like: _like,
    tiles.repeat_row: _repeat_row,
    tiles.add_outer_product: _add_outer_product,
    tiles.store_rectified: _store_rectified,
    tiles.store_clipped_sum: _store_clipped_sum,
}
"""By the function that is called."""
