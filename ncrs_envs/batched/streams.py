"""numpy's random streams in compiled code, so that thousands can be seeded and used at once.

A stream equals ``Generator(PCG64(SeedSequence(entropy, spawn_key=key)))`` bit for bit. Sources:
numpy's ``SeedSequence`` (NEP 19; M. O'Neill's seed sequences), PCG XSL-RR 128/64 (O'Neill 2014),
and bounded integers by multiplication (Lemire 2019), as ``Generator`` draws them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncrs_envs.batched.compiler import kernel

Words = NDArray[np.uint64]
"""Numbers below 2^32."""
Stream = NDArray[np.uint64]
"""State of a stream: its 128-bit state and increment, each the upper half first; 1 if half of a
64-bit number is left over; and that half."""
STREAM_SIZE = 6
WORD = 2**32
_POOL = 4
"""Number of words in a seed sequence's pool."""

# numba would mix signed and unsigned numbers into floating-point ones.
_32, _16, _11, _1, _0 = (np.uint64(number) for number in (32, 16, 11, 1, 0))
_LOW = np.uint64(2**32 - 1)
_INIT_A, _MULT_A = np.uint64(0x43B0D7E5), np.uint64(0x931E8875)
_INIT_B, _MULT_B = np.uint64(0x8B51F9DD), np.uint64(0x58F38DED)
_MIX_LEFT, _MIX_RIGHT = np.uint64(0xCA01F9DD), np.uint64(0x4973F715)
_MULT_HIGH, _MULT_LOW = np.uint64(2549297995355413924), np.uint64(4865540595714422341)
_ROTATION = np.uint64(58)
_63, _64 = np.uint64(63), np.uint64(64)
_ULP = 1.0 / 2**53


def seed_words(entropy: int) -> list[int]:
    """Return the words of an entropy that a seed sequence mixes into its pool.

    The words of the spawn key follow: the key's numbers, if they are below 2^32.
    """
    words: list[int] = []
    while entropy or len(words) < _POOL:
        words.append(entropy % WORD)
        entropy //= WORD
    return words


def generator_state(stream: Stream) -> dict[str, Any]:
    """Return the state with which numpy's ``PCG64`` continues a stream."""
    high, low, increment_high, increment_low, is_half_left, half = map(int, stream)
    state = {"state": (high << 64) | low, "inc": (increment_high << 64) | increment_low}
    halves = {"has_uint32": is_half_left, "uinteger": half}
    return {"bit_generator": "PCG64", "state": state, **halves}


def read_generator(generator: np.random.Generator) -> Stream:
    """Return the stream with which a generator on ``PCG64`` would go on."""
    state: Mapping[str, Any] = generator.bit_generator.state
    numbers = [
        number for name in ("state", "inc") for number in divmod(state["state"][name], 2**64)
    ]
    return np.array([*numbers, state["has_uint32"], state["uinteger"]], dtype=np.uint64)


@kernel
def _hashed(value: np.uint64, constant: np.uint64, factor: np.uint64) -> np.uint64:
    """Hash a word with a constant; the next constant is this one times the factor."""
    mixed = ((value ^ constant) * ((constant * factor) & _LOW)) & _LOW
    return mixed ^ (mixed >> _16)


@kernel
def _mixed(a: np.uint64, b: np.uint64) -> np.uint64:
    mixed = (_MIX_LEFT * a - _MIX_RIGHT * b) & _LOW
    return mixed ^ (mixed >> _16)


@kernel
def _product_high(a: np.uint64, b: np.uint64) -> np.uint64:
    """Return the upper half of the 128-bit product."""
    a_low, a_high, b_low, b_high = a & _LOW, a >> _32, b & _LOW, b >> _32
    first = a_high * b_low + ((a_low * b_low) >> _32)
    second = a_low * b_high + (first & _LOW)
    return a_high * b_high + (first >> _32) + (second >> _32)


@kernel
def _advance(stream: Stream) -> None:
    """Multiply the state, and add the increment."""
    high, low = stream[0], stream[1]
    product = low * _MULT_LOW
    carry = _product_high(low, _MULT_LOW) + high * _MULT_LOW + low * _MULT_HIGH
    stream[1] = product + stream[3]
    stream[0] = carry + stream[2] + (_1 if stream[1] < product else _0)


@kernel
def seed_stream(words: Words, stream: Stream) -> None:
    """Seed a stream.

    Args:
        words: Those of ``seed_words``, and those of the spawn key.
        stream: Output.
    """
    pool = np.zeros(_POOL, dtype=np.uint64)
    constant = _INIT_A
    for i in range(_POOL):
        pool[i] = _hashed(words[i], constant, _MULT_A)
        constant = (constant * _MULT_A) & _LOW
    for source in range(_POOL):
        for i in range(_POOL):
            if source != i:
                pool[i] = _mixed(pool[i], _hashed(pool[source], constant, _MULT_A))
                constant = (constant * _MULT_A) & _LOW
    for source in range(_POOL, len(words)):
        for i in range(_POOL):
            pool[i] = _mixed(pool[i], _hashed(words[source], constant, _MULT_A))
            constant = (constant * _MULT_A) & _LOW
    # The state is the first two numbers of 64 bits, the increment twice the others, plus 1.
    constant = _INIT_B
    for i in range(4):
        low = _hashed(pool[2 * i % _POOL], constant, _MULT_B)
        constant = (constant * _MULT_B) & _LOW
        high = _hashed(pool[(2 * i + 1) % _POOL], constant, _MULT_B)
        constant = (constant * _MULT_B) & _LOW
        stream[i] = low | (high << _32)
    high, low = stream[0], stream[1]
    stream[2] = (stream[2] << _1) | (stream[3] >> _63)
    stream[3] = (stream[3] << _1) | _1
    stream[0], stream[1] = stream[2], stream[3]  # zero, advanced
    stream[1] += low
    stream[0] += high + (_1 if stream[1] < low else _0)
    _advance(stream)
    stream[4], stream[5] = _0, _0


@kernel
def _next_64(stream: Stream) -> np.uint64:
    _advance(stream)
    value: np.uint64 = stream[0] ^ stream[1]
    turn: np.uint64 = stream[0] >> _ROTATION
    return (value >> turn) | (value << ((_64 - turn) & _63))


@kernel
def _next_32(stream: Stream) -> np.uint64:
    if stream[4] == _1:
        stream[4] = _0
        left: np.uint64 = stream[5]
        return left
    value = _next_64(stream)
    stream[4] = _1
    stream[5] = value >> _32
    return value & _LOW


@kernel
def next_number(stream: Stream) -> float:
    """Draw a number in [0, 1), as ``Generator.random`` does."""
    return np.float64(_next_64(stream) >> _11) * _ULP


@kernel
def next_integer(stream: Stream, low: int, high: int) -> np.int64:
    """Draw an integer from ``low`` to ``high - 1``, as ``Generator.integers`` does."""
    count = np.uint64(high - low)
    product = _next_32(stream) * count
    if product & _LOW < count:
        smallest = (_LOW - count + _1) % count
        while product & _LOW < smallest:
            product = _next_32(stream) * count
    return np.int64(product >> _32) + low
