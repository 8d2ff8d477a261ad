"""Statements of a function in JavaScript."""

from __future__ import annotations

import ast
from collections.abc import Sequence

from ncrs.live.expressions import Code, Expressions, data_of
from ncrs.live.translate import Program, Source, safe_name
from ncrs.live.types import FLOAT, FLOAT32, INT, NONE, NUMBERS, Array, Struct, Tuple, Type, joined

_INDENT = "  "
_UNUSED = "_"


class FunctionTranslator(Expressions):
    """Translator of one function, for arguments of given types.

    Attributes:
        result: Type of what the function returns, once it is translated.
    """

    def __init__(self, program: Program, source: Source, types: Sequence[Type]) -> None:
        super().__init__(program, source)
        self.result: Type = NONE
        self._returned: Type | None = None
        self._lines: list[str] = []
        self._depth = 1
        self._declared: list[str] = []
        self._loops: list[str] = []
        arguments = source.tree.args
        if arguments.vararg or arguments.kwarg or arguments.kwonlyargs or arguments.defaults:
            raise source.refuse(source.tree, "arguments must be plain, without defaults")
        self._parameters = [item.arg for item in (*arguments.posonlyargs, *arguments.args)]
        if len(self._parameters) != len(types):
            raise source.refuse(source.tree, f"it takes {len(self._parameters)} arguments")
        self.locals.update(zip(self._parameters, types, strict=True))

    def translate(self, name: str) -> str:
        """Return the function in JavaScript under a name."""
        self._block(self.source.tree.body)
        if self._returned is not None:
            self.result = self._returned
        head = ", ".join(safe_name(parameter) for parameter in self._parameters)
        declared = [f"{_INDENT}let {', '.join(self._declared)};"] if self._declared else []
        return "\n".join([f"function {name}({head}) {{", *declared, *self._lines, "}"])

    def _write(self, line: str) -> None:
        self._lines.append(_INDENT * self._depth + line)

    def _block(self, statements: Sequence[ast.stmt]) -> None:
        for statement in statements:
            translate = getattr(self, f"_on_{type(statement).__name__.lower()}", None)
            if translate is None:
                raise self.refuse(
                    statement, f"the statement {type(statement).__name__} is not known"
                )
            translate(statement)

    def _indented(self, statements: Sequence[ast.stmt]) -> None:
        self._depth += 1
        self._block(statements)
        self._depth -= 1

    def _on_expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            return
        if not isinstance(node.value, ast.Call):
            raise self.refuse(node, "an expression without effect")
        self._write(f"{self.expression(node.value).text};")

    def _on_assign(self, node: ast.Assign) -> None:
        if len(node.targets) > 1 and any(isinstance(part, ast.Call) for part in ast.walk(node)):
            raise self.refuse(node, "a call's result is given to one target at a time")
        for target in node.targets:
            self._assign(target, node.value)

    def _on_annassign(self, node: ast.AnnAssign) -> None:
        if node.value is None:
            raise self.refuse(node, "a declaration without a value")
        self._assign(node.target, node.value)

    def _on_augassign(self, node: ast.AugAssign) -> None:
        load = ast.parse(ast.unparse(node.target), mode="eval").body
        for part in (load, combined := ast.BinOp(load, node.op, node.value)):
            ast.copy_location(part, node)
        self._assign(node.target, combined)

    def _on_if(self, node: ast.If) -> None:
        self._write(f"if ({self.condition(node.test)}) {{")
        self._indented(node.body)
        while len(node.orelse) == 1 and isinstance(node.orelse[0], ast.If):
            node = node.orelse[0]
            self._write(f"}} else if ({self.condition(node.test)}) {{")
            self._indented(node.body)
        if node.orelse:
            self._write("} else {")
            self._indented(node.orelse)
        self._write("}")

    def _on_while(self, node: ast.While) -> None:
        if node.orelse:
            raise self.refuse(node, "while with else is not known")
        self._write(f"while ({self.condition(node.test)}) {{")
        self._indented(node.body)
        self._write("}")

    def _on_for(self, node: ast.For) -> None:
        call = node.iter
        is_range = isinstance(call, ast.Call) and ast.unparse(call.func) == "range"
        if not is_range or node.orelse or not isinstance(node.target, ast.Name):
            raise self.refuse(node, "only loops over a range are known, without else")
        assert isinstance(call, ast.Call)
        limits = [self.integer(argument) for argument in call.args]
        start = limits[0].text if len(limits) > 1 else "0"
        stop = limits[1] if len(limits) > 1 else limits[0]
        step = limits[2].text if len(limits) > 2 else "1"
        if not step.isdigit() or step == "0":
            raise self.refuse(node, "the step of a range must be a positive constant")
        name = node.target.id
        variable = f"loop{self._depth}" if name == _UNUSED else safe_name(name)
        if name in self._loops:
            raise self.refuse(node, f"{name} is the variable of two loops, one in the other")
        head = f"let {variable} = {start}"
        end = stop.text
        if not stop.text.isdigit():
            end = f"{variable}End"
            head += f", {end} = {stop.text}"
        move = f"{variable}++" if step == "1" else f"{variable} += {step}"
        self._write(f"for ({head}; {variable} < {end}; {move}) {{")
        before = self.locals.get(name)
        self._loops.append(name)
        self.lost.discard(name)
        self.locals[name] = INT
        self._indented(node.body)
        self._loops.pop()
        self._write("}")
        del self.locals[name]
        if before is not None:
            self.locals[name] = before
        self.lost.add(name)

    def _on_return(self, node: ast.Return) -> None:
        if node.value is None:
            self._write("return;")
            return
        code = self.expression(node.value)
        made = code.type if self._returned is None else joined(self._returned, code.type)
        if made is None:
            raise self.refuse(node, f"it returns {code.type}, elsewhere {self._returned}")
        self._returned = made
        self._write(f"return {code.text};")

    def _on_break(self, node: ast.Break) -> None:
        self._write("break;")

    def _on_continue(self, node: ast.Continue) -> None:
        self._write("continue;")

    def _assign(self, target: ast.expr, value: ast.expr) -> None:
        if isinstance(target, ast.Tuple):
            self._unpack(target, value)
            return
        code = self.expression(value)
        if isinstance(target, ast.Subscript) and self._fill(target, code):
            return
        self._write(f"{self._target(target, code.type)} = {code.text};")

    def _unpack(self, target: ast.Tuple, value: ast.expr) -> None:
        code = self.expression(value)
        if not isinstance(code.type, Tuple) or len(code.type.items) != len(target.elts):
            raise self.refuse(target, f"{len(target.elts)} values are expected here")
        parts = []
        for item, made in zip(target.elts, code.type.items, strict=True):
            unused = isinstance(item, ast.Name) and item.id == _UNUSED
            parts.append("" if unused else self._target(item, made))
        if code.type.kind is None:
            self._write(f"[{', '.join(parts).rstrip(', ')}] = {code.text};")
            return
        named = zip(code.type.names, parts, strict=True)
        fields = ", ".join(f"{safe_name(name)}: {part}" for name, part in named if part)
        self._write(f"({{ {fields} }} = {code.text});")

    def _target(self, target: ast.expr, made: Type) -> str:
        """Return a place that a value of a type is written to."""
        if isinstance(target, ast.Name):
            return self._variable(target, made)
        if not isinstance(target, ast.Attribute | ast.Subscript):
            raise self.refuse(target, f"nothing can be assigned to {type(target).__name__}")
        place = self.expression(target)
        if isinstance(place.type, Struct | Tuple | Array):
            raise self.refuse(target, "only numbers and truth values can be written there")
        if made not in NUMBERS and made != place.type:
            raise self.refuse(target, f"{made} cannot be written into {place.type}")
        if place.type == INT and made in (FLOAT, FLOAT32):
            raise self.refuse(target, "a float cannot be written into an integer")
        return place.text

    def _variable(self, target: ast.Name, made: Type) -> str:
        name = target.id
        if name in self._loops:
            raise self.refuse(target, f"{name} is the variable of a loop around this")
        if made == NONE:
            raise self.refuse(target, "the call returns nothing")
        known = self.locals.get(name)
        if known is None:
            self._declared.append(safe_name(name))
            self.locals[name] = made
        else:
            both = joined(known, made)
            if both is None or (both != known and self._depth > 1):
                raise self.refuse(target, f"{name} is {known} before, {made} here")
            self.locals[name] = both
        self.lost.discard(name)
        return safe_name(name)

    def _fill(self, target: ast.Subscript, code: Code) -> bool:
        """Write a value into a part of an array; return False if the target is an element."""
        whole = isinstance(target.slice, ast.Slice)
        if whole:
            assert isinstance(target.slice, ast.Slice)
            if target.slice.lower is not None or target.slice.upper is not None:
                raise self.refuse(target, "only whole arrays can be written at once")
            part, made = self.array(target.value)
        else:
            place = self.expression(target)
            if not isinstance(place.type, Array):
                return False
            part, made = place, place.type
        if isinstance(made.item, Struct):
            raise self.refuse(target, "records cannot be written at once")
        method = "set" if isinstance(code.type, Array) else "fill"
        content = code.text
        if isinstance(code.type, Array):
            if (code.type.item, code.type.rank) != (made.item, made.rank):
                raise self.refuse(target, "arrays of different types")
            content = data_of(code)
        elif code.type not in NUMBERS:
            raise self.refuse(target, "only numbers fill an array")
        self._write(f"{data_of(part)}.{method}({content});")
        return True
