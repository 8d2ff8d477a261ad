"""The translator: its JavaScript computes what Python does, and it refuses what is unknown."""

import linecache
import math
import re
import textwrap

import numpy as np
import pytest

from ncrs.live.build import page_part
from ncrs.live.engine import ENTRIES, engine_code
from ncrs.live.translate import Entry, Program
from ncrs.live.types import TranslationError
from tests.live import samples

_CALLS = [
    (samples.whole_numbers, (7, 2)),
    (samples.whole_numbers, (-7, 2)),
    (samples.whole_numbers, (7, -4)),
    (samples.extremes, (2.0, -1.0)),
    (samples.chained, (2,)),
    (samples.chained, (1,)),
    (samples.chained, (4,)),
    (samples.named, (samples.Pair(-2.0, -3.5),)),
    (samples.filled, (4,)),
    (samples.loops, (9,)),
    (samples.reused, (5,)),
    (samples.reused, (50,)),
]


@pytest.fixture(scope="module")
def translated():
    program = Program()
    for function in {function for function, _ in _CALLS} | {samples.rounded, samples.moved}:
        program.add(Entry(function))
    return f"{page_part('runtime.js')}\n{program.code()}\n"


@pytest.fixture
def run(chromium, translated):
    chromium.get("about:blank")
    return lambda code, *arguments: chromium.execute_script(translated + code, *arguments)


@pytest.mark.parametrize(
    ("function", "arguments"), _CALLS, ids=lambda v: getattr(v, "__name__", str(v))
)
def test_results_are_pythons(run, function, arguments):
    given = [a._asdict() if isinstance(a, tuple) else a for a in arguments]
    expected = function(*arguments)
    result = run(f"return {function.__name__}(...arguments);", *given)
    assert result == (list(expected) if isinstance(expected, tuple) else expected)


def test_nan_and_signed_zeros_compare_as_in_python(run):
    shown = run("return [[NaN, 1], [1, NaN], [0, -0]].map((p) => extremes(...p).map(String));")
    assert shown == [
        [str(v).replace("nan", "NaN").removesuffix(".0") for v in samples.extremes(a, b)]
        for a, b in ((math.nan, 1.0), (1.0, math.nan), (0.0, 0.0))
    ]


def test_float32_values_are_rounded_after_each_operation(run):
    values = np.random.default_rng(0).normal(size=50).astype(np.float32)
    result = run("return rounded(Float32Array.from(arguments[0]));", values.tolist())
    assert result == samples.rounded(values)
    assert result != float(values[0] + values[1:].astype(float).sum() * 0.1)


def test_records_are_changed_in_place(run):
    code = """
    const points = [0, 1, -2].map((x) => Object.assign(makePoint(), { x }));
    const total = moved(points[0], points);
    return [total, points];
    """
    program = Program()
    program.record(samples.Point)
    total, points = run(program.code() + code)
    assert total == 3.0
    assert [point["y"] for point in points] == [0.0, 1.0, 3.0]


def _made(code):
    """Make a function out of code in a file of its own."""
    text = textwrap.dedent(code)
    name = f"/made/{abs(hash(text))}.py"
    linecache.cache[name] = (len(text), None, text.splitlines(keepends=True), name)
    names = {"np": np, "math": math, "NDArray": samples.NDArray, "OTHER": object()}
    exec(compile(text, name, "exec"), names)
    return names["function"]


@pytest.mark.parametrize(
    ("code", "place", "reason"),
    [
        ("def function(a: int) -> int:\n    return [i for i in range(a)]", "2:12", "ListComp"),
        ("def function(a: int) -> int:\n    with a:\n        return a", "2:5", "With"),
        ("def function(a: int) -> int:\n    return a if a else 1", "2:17", "must be a bool"),
        ("def function(a: int) -> int:\n    return a ** 3", "2:12", "squares"),
        ("def function(a: float) -> float:\n    return a // 2", "2:12", "FloorDiv"),
        ("def function(a: int) -> int:\n    return math.gcd(a, 2)", "2:12", "math.gcd"),
        ("def function(a: int) -> int:\n    return OTHER", "2:12", "OTHER"),
        ("def function(a: int) -> int:\n    return b", "2:12", "b is not known"),
        ("def function(a: int) -> int:\n    b = 1\n    b = True\n    return b", "3:5", "before"),
        ("def function(a: int) -> int:\n    for i in [1]:\n        pass", "2:5", "range"),
        (
            "def function(a: int) -> int:\n    for i in range(3, 0, -1):\n        a += i",
            "2:5",
            "step",
        ),
        (
            "def function(a: int) -> int:\n    for i in range(3):\n        a += i\n    return i",
            "4:12",
            "after its loop",
        ),
        (
            "def function(a: int) -> int:\n    for i in range(3):\n        i = 2",
            "3:9",
            "loop around",
        ),
        ("def function(a: int = 1) -> int:\n    return a", "1:1", "defaults"),
        ("def function(a: int) -> int:\n    return function(a)", "1:1", "recursion"),
        ("def function(a: NDArray[np.int8]) -> int:\n    return a[0, 1]", "2:12", "2 indices"),
        ("def function(a: NDArray[np.int8]) -> int:\n    return a[::2]", "2:12", "no step"),
        ("def function(a: NDArray[np.int8]) -> int:\n    a[0] = 0.5\n    return 1", "2:5", "float"),
        ("def function(a: float) -> bool:\n    return a is a", "2:12", "Is"),
        ("def function(a: float) -> float:\n    return 1 if a < 1 else True", "2:12", "one type"),
    ],
)
def test_unknown_constructs_are_refused_with_their_place(code, place, reason):
    with pytest.raises(TranslationError, match=re.escape(reason)) as found:
        Program().add(Entry(_made(code)))
    assert re.search(rf"\.py:{place}: ", str(found.value)), found.value


def test_foreign_annotations_are_refused():
    with pytest.raises(TranslationError, match="str"):
        Program().add(Entry(_made("def function(a: str) -> int:\n    return 1")))


def test_the_engine_holds_every_entry_once():
    code = engine_code()
    for entry in ENTRIES:
        name = entry.function.py_func.__name__
        assert len(re.findall(rf"^function {name}\(", code, flags=re.MULTILINE)) == 1
    assert code == engine_code.__wrapped__()
