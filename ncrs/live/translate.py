"""A translator of kernels to JavaScript, from their Python source.

The kernels of both simulators' fast side are functions of scalars, records, named tuples and
arrays. Types flow from the entries' annotations through every call, as numba's do, so that each
expression's type is known: products of float32 values are rounded to float32, products of float64
values are left alone, and an index of two axes is an offset. What is not known is refused with its
file, line and column. A function is translated once, for the types of the first call that is met.

Constants of modules become numbers; numba's own loops and tests of names are not imitated. Three
habits of the kernels are relied upon, not checked: indices are not negative, integers stay below
2**53, and those in arrays below 2**31.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np

from ncrs.live.types import (
    STORES,
    Array,
    Scalar,
    Struct,
    TranslationError,
    Tuple,
    Type,
    array_shape,
    constant_type,
    from_annotation,
    record_fields,
)
from ncrs_envs.batched.dtypes import Record

_RESERVED = frozenset((
    "arguments", "await", "break", "case", "catch", "class", "const", "continue", "debugger",
    "default", "delete", "do", "else", "enum", "eval", "export", "extends", "finally", "for",
    "function", "if", "implements", "import", "in", "instanceof", "interface", "let", "new",
    "null", "package", "private", "protected", "public", "return", "static", "super", "switch",
    "this", "throw", "try", "typeof", "var", "void", "while", "with", "yield",
))  # fmt: skip


@dataclass(frozen=True)
class Entry:
    """A function to translate."""

    function: Callable[..., Any]
    ranks: Mapping[str, int] = field(default_factory=dict)
    """Ranks of the arguments that are arrays of several axes, or whose fields are such arrays, as
    in "brain.states"."""


@dataclass(frozen=True)
class Signature:
    """A translated function."""

    name: str
    arguments: tuple[Type, ...]
    result: Type


@dataclass
class Source:
    """A function's syntax tree, and where its names come from."""

    tree: ast.FunctionDef
    file: str
    names: Mapping[str, Any]
    """Values of the names that are not local."""
    indent: int
    """Number of columns by which the tree was moved to the left."""

    def refuse(self, node: ast.AST, reason: str) -> TranslationError:
        """Make the error for a construct."""
        line, column = getattr(node, "lineno", 0), getattr(node, "col_offset", 0) + self.indent + 1
        return TranslationError(f"{self.file}:{line}:{column}: {reason}.")


def python_function(value: Any) -> Any | None:
    """Return the Python function behind a kernel or a plain function, None for anything else."""
    function = getattr(value, "py_func", value)
    return function if inspect.isfunction(function) else None


def _source_of(function: Any) -> Source:
    lines, first = inspect.getsourcelines(function)
    tree = ast.parse(textwrap.dedent("".join(lines)))
    ast.increment_lineno(tree, first - 1)
    definition = tree.body[0]
    file = Path(inspect.getsourcefile(function) or "?").name
    if not isinstance(definition, ast.FunctionDef):
        raise TranslationError(f"{file}:{first}:1: a function must be declared by def.")
    cells = inspect.getclosurevars(function)
    names = {**cells.builtins, **function.__globals__, **cells.nonlocals}
    return Source(definition, file, names, len(lines[0]) - len(lines[0].lstrip()))


class Program:
    """Functions, constants and records in JavaScript, each once, in the order of their use."""

    def __init__(self) -> None:
        self._signatures: dict[Any, Signature] = {}
        self._functions: list[str] = []
        self._constants: dict[int, tuple[str, Any]] = {}
        self._declared: list[str] = []
        self._records: dict[type[Record], str] = {}
        self._names: set[str] = set()
        self._open: set[Any] = set()

    def add(self, entry: Entry) -> Signature:
        """Translate a function, and all that it calls, for the types that it declares.

        Raises:
            TranslationError: If a construct in it is not known.
        """
        function = python_function(entry.function)
        if function is None:
            raise TranslationError(f"{entry.function!r} is not a function.")
        hints = get_type_hints(function, include_extras=True)
        names = list(inspect.signature(function).parameters)
        types = [_ranked(from_annotation(hints[name]), name, entry.ranks) for name in names]
        return self.signature(function, types)

    def signature(self, function: Any, types: Sequence[Type]) -> Signature:
        """Return the translation of a function for arguments of the given types."""
        from ncrs.live.statements import FunctionTranslator

        if function in self._signatures:
            return self._signatures[function]
        source = _source_of(function)
        if function in self._open:
            raise source.refuse(source.tree, "recursion is not known")
        self._open.add(function)
        name = self._name(function)
        translator = FunctionTranslator(self, source, types)
        code = translator.translate(name)
        self._open.remove(function)
        self._functions.append(f"// {function.__module__}\n{code}")
        made = Signature(name, tuple(types), translator.result)
        self._signatures[function] = made
        return made

    def _name(self, function: Any) -> str:
        name = safe_name(function.__name__)
        if name in self._names:
            name = f"{function.__module__.rpartition('.')[2]}_{name.lstrip('_')}"
        while name in self._names:
            name += "_"
        self._names.add(name)
        return name

    def constant(self, name: str, value: Any) -> str:
        """Declare a module's constant that is not a number, and return its name."""
        if id(value) not in self._constants:
            unique = safe_name(name)
            while unique in self._names:
                unique += "_"
            self._names.add(unique)
            self._constants[id(value)] = (unique, value)
            self._declared.append(f"const {unique} = {literal(value)};")
        return self._constants[id(value)][0]

    def record(self, kind: type[Record]) -> str:
        """Declare a record's factory, and return its name."""
        if kind not in self._records:
            name = f"make{kind.__name__}"
            self._records[kind] = name
            fields = record_fields(kind)  # type: ignore[arg-type] # it is hashable
            for made in fields.values():
                if isinstance(made, Array) and isinstance(made.item, Struct):
                    self.record(made.item.kind)
            parts = [f"{safe_name(n)}: {self._blank(kind, n, t)}" for n, t in fields.items()]
            self._declared.append(f"const {name} = () => ({{ {', '.join(parts)} }});")
        return self._records[kind]

    def _blank(self, kind: type[Record], name: str, made: Type) -> str:
        """Return the expression of a field that is all zeros."""
        if isinstance(made, Scalar):
            return "false" if made.name == "bool" else "0"
        if not isinstance(made, Array):
            raise TranslationError(f"{kind.__name__}.{name} is neither a scalar nor an array.")
        shape = array_shape(kind, name)
        if isinstance(made.item, Struct):
            return f"Array.from({{ length: {shape[0]} }}, {self.record(made.item.kind)})"
        return new_array(STORES[made.item], [str(side) for side in shape])

    def code(self) -> str:
        """Return all declarations."""
        return "\n".join([*self._declared, "", *self._functions])


def _ranked(made: Type, name: str, ranks: Mapping[str, int]) -> Type:
    """Return an argument's type with the ranks of an entry."""
    if isinstance(made, Array):
        return Array(made.item, ranks.get(name, made.rank))
    if isinstance(made, Tuple) and made.kind is not None:
        pairs = zip(made.names, made.items, strict=True)
        items = tuple(_ranked(item, f"{name}.{part}", ranks) for part, item in pairs)
        return Tuple(items, made.kind)
    return made


def safe_name(name: str) -> str:
    """Return a name that JavaScript takes."""
    return f"{name}_" if name in _RESERVED else name


def new_array(store: str, shape: Sequence[str]) -> str:
    """Return the expression of a new array of zeros."""
    if len(shape) == 1:
        return f"new {store}({shape[0]})"
    return f"newGrid({store}, [{', '.join(shape)}])"


def literal(value: Any) -> str:
    """Return a constant in JavaScript."""
    made = constant_type(value)
    if isinstance(made, Array):
        numbers = ", ".join(literal(item) for item in value.tolist())
        return f"{STORES[str(made.item)]}.of({numbers})"
    if isinstance(made, Tuple):
        fields = zip(value._fields, value, strict=True)
        return "{ " + ", ".join(f"{safe_name(n)}: {literal(v)}" for n, v in fields) + " }"
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    if isinstance(value, int | np.integer):
        return str(int(value))
    if isinstance(value, float | np.floating):
        number = float(value)
        if number != number:
            return "NaN"
        return repr(number).replace("inf", "Infinity")
    raise TranslationError(f"The constant {value!r} is none that the translator knows.")
