"""Expressions of a function in JavaScript, with their types."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from typing import Any, NamedTuple

from ncrs.live.translate import Program, Source, literal, python_function, safe_name
from ncrs.live.types import (
    BOOL,
    FLOAT,
    FLOAT32,
    INT,
    NUMBERS,
    Array,
    Scalar,
    Struct,
    TranslationError,
    Tuple,
    Type,
    constant_type,
    joined,
)

_ARITHMETIC = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
_COMPARISONS = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "===",
    ast.NotEq: "!==",
}
_EQUALITIES = (ast.Eq, ast.NotEq)


class Code(NamedTuple):
    """An expression in JavaScript."""

    text: str
    type: Type
    is_atom: bool = True
    """False if it needs brackets beside an operator."""

    @property
    def operand(self) -> str:
        """The text, in brackets if it needs them."""
        return self.text if self.is_atom else f"({self.text})"


class Expressions:
    """Translator of expressions in the scope of one function."""

    def __init__(self, program: Program, source: Source) -> None:
        self.program = program
        self.source = source
        self.locals: dict[str, Type] = {}
        self.lost: set[str] = set()
        """Names of finished loops, which would differ from Python's."""

    def refuse(self, node: ast.AST, reason: str) -> TranslationError:
        """Make the error for a construct."""
        return self.source.refuse(node, reason)

    def expression(self, node: ast.expr) -> Code:
        """Translate an expression."""
        translate = getattr(self, f"_{type(node).__name__.lower()}", None)
        if translate is None:
            raise self.refuse(node, f"the expression {type(node).__name__} is not known")
        code: Code = translate(node)
        return code

    def condition(self, node: ast.expr) -> str:
        """Translate an expression that must be true or false."""
        code = self.expression(node)
        if code.type != BOOL:
            raise self.refuse(node, "a condition must be a bool")
        return code.text

    def number(self, node: ast.expr) -> Code:
        """Translate an expression that must be a number; truth values are 0 or 1."""
        code = self.expression(node)
        if code.type == BOOL:
            return Code(f"Number({code.text})", INT)
        if code.type not in NUMBERS:
            raise self.refuse(node, "a number is expected here")
        return code

    def integer(self, node: ast.expr) -> Code:
        """Translate an expression that must be an integer."""
        code = self.number(node)
        if code.type != INT:
            raise self.refuse(node, "an integer is expected here")
        return code

    def array(self, node: ast.expr) -> tuple[Code, Array]:
        """Translate an expression that must be an array, and return its type too."""
        code = self.expression(node)
        if not isinstance(code.type, Array):
            raise self.refuse(node, "an array is expected here")
        return code, code.type

    def value_of(self, node: ast.expr) -> Any:
        """Return the Python value of a name that is not local, or of an attribute of one.

        Raises:
            TranslationError: If there is no such value.
        """
        if isinstance(node, ast.Name) and node.id not in self.locals:
            if node.id not in self.source.names:
                raise self.refuse(node, f"the name {node.id} is not known")
            return self.source.names[node.id]
        if isinstance(node, ast.Attribute):
            return getattr(self.value_of(node.value), node.attr)
        raise self.refuse(node, "a name of the module is expected here")

    def is_local(self, node: ast.expr) -> bool:
        """Return True if an expression begins with a local name."""
        while isinstance(node, ast.Attribute | ast.Subscript):
            node = node.value
        return not isinstance(node, ast.Name) or node.id in self.locals

    def _constant(self, node: ast.Constant) -> Code:
        made = constant_type(node.value)
        if made is None:
            raise self.refuse(node, f"the constant {node.value!r} is not known")
        return Code(literal(node.value), made)

    def _name(self, node: ast.Name) -> Code:
        if node.id in self.lost:
            raise self.refuse(node, f"{node.id} is read after its loop")
        if node.id in self.locals:
            return Code(safe_name(node.id), self.locals[node.id])
        return self._module_value(node, node.id, self.value_of(node))

    def _module_value(self, node: ast.expr, name: str, value: Any) -> Code:
        made = constant_type(value)
        if made is None:
            raise self.refuse(node, f"{name} is neither local nor a constant")
        if isinstance(made, Scalar):
            text = literal(value)
            return Code(text, made, not text.startswith("-"))
        return Code(self.program.constant(name, value), made)

    def _attribute(self, node: ast.Attribute) -> Code:
        if not self.is_local(node):
            if isinstance(node.value, ast.Name):
                holder = self.value_of(node.value)
                if isinstance(holder, tuple):  # a named constant's field
                    return self._field(node, self.expression(node.value))
            return self._module_value(node, node.attr, self.value_of(node))
        base = self.expression(node.value)
        if isinstance(base.type, Array) and node.attr == "size":
            return Code(f"{data_of(base)}.length", INT)
        return self._field(node, base)

    def _field(self, node: ast.Attribute, base: Code) -> Code:
        found = base.type.field(node.attr) if isinstance(base.type, Struct | Tuple) else None
        if found is None:
            raise self.refuse(node, f"the attribute {node.attr} is not known")
        return Code(f"{base.text}.{safe_name(node.attr)}", found)

    def _subscript(self, node: ast.Subscript) -> Code:
        if isinstance(node.value, ast.Attribute) and node.value.attr == "shape":
            return self._side(node)
        if isinstance(node.value, ast.Attribute) and node.value.attr == "flat":
            base, made = self.array(node.value.value)
            return Code(f"{data_of(base)}[{self.integer(node.slice).text}]", made.element)
        base = self.expression(node.value)
        if isinstance(base.type, Tuple) and base.type.kind is None:
            return self._item(node, base, base.type)
        if not isinstance(base.type, Array):
            raise self.refuse(node, "only arrays and plain tuples have items")
        made = base.type
        indices = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if isinstance(node.slice, ast.Slice):
            return self._slice(node, node.slice, base)
        if len(indices) > made.rank:
            raise self.refuse(node, f"{len(indices)} indices for {made.rank} axes")
        if len(indices) < made.rank:
            for index in indices:
                base = self._part(base, self.integer(index))
            return base
        return Code(f"{data_of(base)}[{self._offset(base, indices)}]", made.element)

    def _item(self, node: ast.Subscript, base: Code, made: Tuple) -> Code:
        index = node.slice.value if isinstance(node.slice, ast.Constant) else None
        if not isinstance(index, int) or not 0 <= index < len(made.items):
            raise self.refuse(node, "the index of a tuple must be a constant within it")
        return Code(f"{base.text}[{index}]", made.items[index])

    def _side(self, node: ast.Subscript) -> Code:
        assert isinstance(node.value, ast.Attribute)
        base, made = self.array(node.value.value)
        axis = node.slice.value if isinstance(node.slice, ast.Constant) else None
        if not isinstance(axis, int) or not 0 <= axis < made.rank:
            raise self.refuse(node, "the axis must be a constant within the array's rank")
        return Code(f"{base.text}.length" if made.rank == 1 else f"{base.text}.shape[{axis}]", INT)

    def _offset(self, base: Code, indices: Sequence[ast.expr]) -> str:
        """Return the place of an element in an array's data."""
        offset = self.integer(indices[0])
        for axis, index in enumerate(indices[1:], start=1):
            following = self.integer(index)
            offset = Code(
                f"{offset.operand} * {base.text}.shape[{axis}] + {following.operand}", INT, False
            )
        return offset.text

    def _part(self, base: Code, index: Code) -> Code:
        """Return the part of an array at an index of its first axis."""
        made = base.type
        assert isinstance(made, Array)
        if isinstance(made.item, Struct):
            raise TranslationError(f"{base.text}: records have one axis.")
        return Code(f"part({base.text}, {index.text})", Array(made.item, made.rank - 1))

    def _slice(self, node: ast.Subscript, part: ast.Slice, base: Code) -> Code:
        made = base.type
        assert isinstance(made, Array)
        if made.rank != 1 or part.step is not None:
            raise self.refuse(node, "slices have one axis and no step")
        low = "0" if part.lower is None else self.integer(part.lower).text
        high = "" if part.upper is None else f", {self.integer(part.upper).text}"
        method = "slice" if isinstance(made.item, Struct) else "subarray"
        return Code(f"{base.text}.{method}({low}{high})", made)

    def _binop(self, node: ast.BinOp) -> Code:
        left, right = self.number(node.left), self.number(node.right)
        kind = type(node.op)
        if kind in _ARITHMETIC:
            made = _result(left.type, right.type)
            if kind is ast.Div and made == INT:
                made = FLOAT
            text = f"{left.operand} {_ARITHMETIC[kind]} {right.operand}"
            if made == FLOAT32:
                return Code(f"Math.fround({text})", FLOAT32)
            return Code(text, made, False)
        if kind is ast.Pow:
            return self._power(node, left)
        if kind in (ast.FloorDiv, ast.Mod) and left.type == right.type == INT:
            if kind is ast.FloorDiv:
                return Code(f"Math.floor({left.operand} / {right.operand})", INT)
            return Code(f"modulo({left.text}, {right.text})", INT)
        raise self.refuse(node, f"the operator {kind.__name__} is not known for these types")

    def _power(self, node: ast.BinOp, base: Code) -> Code:
        exponent = node.right.value if isinstance(node.right, ast.Constant) else None
        if exponent == 0.5 and base.type == FLOAT:
            return Code(f"Math.sqrt({base.text})", FLOAT)
        if exponent == 2 and base.type in (FLOAT, INT) and base.is_atom:
            return Code(f"{base.text} * {base.text}", base.type, False)
        raise self.refuse(node, "only squares and square roots are known among powers")

    def _unaryop(self, node: ast.UnaryOp) -> Code:
        if isinstance(node.op, ast.Not):
            return Code(f"!({self.condition(node.operand)})", BOOL)
        if isinstance(node.op, ast.USub):
            code = self.number(node.operand)
            return Code(f"-{code.operand}", code.type, False)
        raise self.refuse(node, f"the operator {type(node.op).__name__} is not known")

    def _boolop(self, node: ast.BoolOp) -> Code:
        sign = " && " if isinstance(node.op, ast.And) else " || "
        parts = [f"({self.condition(value)})" for value in node.values]
        return Code(sign.join(parts), BOOL, False)

    def _compare(self, node: ast.Compare) -> Code:
        if len(node.ops) == 1 and isinstance(node.ops[0], ast.In):
            return self._contains(node)
        operands = [node.left, *node.comparators]
        if len(operands) > 2 and not all(
            isinstance(middle, ast.Name | ast.Constant) for middle in operands[1:-1]
        ):
            raise self.refuse(node, "the middle of a chain of comparisons must be a name")
        parts = []
        for operator, first, second in zip(node.ops, operands, operands[1:], strict=False):
            left, right = self.expression(first), self.expression(second)
            if type(operator) not in _COMPARISONS:
                raise self.refuse(node, f"the comparison {type(operator).__name__} is not known")
            numbers = left.type in NUMBERS and right.type in NUMBERS
            truths = left.type == right.type == BOOL and isinstance(operator, _EQUALITIES)
            if not numbers and not truths:
                raise self.refuse(node, "only numbers, or equal truths, can be compared")
            parts.append(f"{left.operand} {_COMPARISONS[type(operator)]} {right.operand}")
        if len(parts) == 1:
            return Code(parts[0], BOOL, False)
        return Code(" && ".join(parts), BOOL, False)

    def _contains(self, node: ast.Compare) -> Code:
        choices = node.comparators[0]
        if not isinstance(choices, ast.Tuple) or not isinstance(node.left, ast.Name):
            raise self.refuse(node, "only names are looked for, and only in tuples of numbers")
        left = self.number(node.left)
        parts = [f"{left.text} === {self.number(item).operand}" for item in choices.elts]
        return Code(" || ".join(parts), BOOL, False)

    def _ifexp(self, node: ast.IfExp) -> Code:
        yes, no = self.expression(node.body), self.expression(node.orelse)
        made = joined(yes.type, no.type)
        if made is None:
            raise self.refuse(node, "both values of a choice must have one type")
        return Code(f"({self.condition(node.test)}) ? {yes.operand} : {no.operand}", made, False)

    def _tuple(self, node: ast.Tuple) -> Code:
        parts = [self.expression(item) for item in node.elts]
        text = f"[{', '.join(part.text for part in parts)}]"
        return Code(text, Tuple(tuple(part.type for part in parts)))

    def _call(self, node: ast.Call) -> Code:
        from ncrs.live.builtins import BUILTINS

        value = self.value_of(node.func)
        if value in BUILTINS:
            return BUILTINS[value](self, node)
        if isinstance(value, type) and issubclass(value, tuple) and hasattr(value, "_fields"):
            return self._construct(node, value)
        function = python_function(value)
        if function is None or node.keywords:
            raise self.refuse(node, f"{ast.unparse(node.func)} cannot be called so")
        arguments = [self.expression(argument) for argument in node.args]
        signature = self.program.signature(function, [code.type for code in arguments])
        for argument, code, wanted in zip(node.args, arguments, signature.arguments, strict=True):
            if code.type != wanted and joined(code.type, wanted) != wanted:
                raise self.refuse(
                    argument, f"the argument is {code.type}, in an earlier call {wanted}"
                )
        text = f"{signature.name}({', '.join(code.text for code in arguments)})"
        return Code(text, signature.result)

    def _construct(self, node: ast.Call, kind: Any) -> Code:
        given = dict(zip(kind._fields, node.args, strict=False))
        given |= {str(word.arg): word.value for word in node.keywords}
        if set(given) != set(kind._fields):
            raise self.refuse(node, f"{kind.__name__} takes {', '.join(kind._fields)}")
        fields = {name: self.expression(given[name]) for name in kind._fields}
        text = ", ".join(f"{safe_name(name)}: {code.text}" for name, code in fields.items())
        return Code(f"{{ {text} }}", Tuple(tuple(code.type for code in fields.values()), kind))


def data_of(base: Code) -> str:
    """Return the typed array, or the list of records, behind an array."""
    assert isinstance(base.type, Array)
    return base.text if base.type.rank == 1 else f"{base.text}.data"


def _result(left: Type, right: Type) -> Type:
    """Return the type of a sum or product, which is numpy's: float32 with integers is float64."""
    if left == right:
        return left
    return FLOAT
