"""Uniform random numbers inside JAX: Philox4x32-10 on words of 32 bits.

Lane k of seed s draws what :mod:`skyarm.scalars.philox` draws for (seed, episode k, channel, step), bit for bit. Only
the last step of a double needs 64-bit integers, so that single precision runs where JAX has none.

Source: Salmon, Moraes, Dror, Shaw 2011, section 3.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from skyarm.compile.machine_code import missing_extra
from skyarm.scalars.philox import KEY_INCREMENTS, MULTIPLIERS, ROUNDS

try:
    import jax.numpy as jnp
    from jax import lax
except ImportError as error:  # pragma: no cover  (the library is there when this is tested)
    raise missing_extra("jax") from error

Words = tuple[Any, Any, Any, Any]


def uniforms(seed: Any, episode: Any, step: Any, draws: Sequence[tuple[int, int]], dtype: Any) -> list[Any]:
    """Numbers in (0, 1) of one lane and step, equal to those of :mod:`skyarm.scalars.philox`.

    Args:
        seed: low and high word, uint32.
        episode: uint32.
        step: uint32.
        draws: (channel, how many numbers) pairs.
        dtype: float64, or float32, to which the same numbers are rounded.
    """
    unit = _unit64 if dtype == np.float64 else _unit32
    # as JAX's own numbers: NumPy's scalars warn where they wrap around
    key = (jnp.uint32(seed[0]), jnp.uint32(seed[1]))
    numbers: list[Any] = []
    for channel, count in draws:
        units: list[Any] = []
        for block in range((count + 1) // 2):
            counter = (jnp.uint32(block), step, jnp.uint32(channel), episode)
            w0, w1, w2, w3 = _philox(counter, key)
            units += [unit(w0, w1), unit(w2, w3)]
        numbers += units[:count]
    return numbers


def _product(a: int, b: Any) -> tuple[Any, Any]:
    """High and low word of a product, from halves of 16 bits: no 64-bit integers are needed."""
    half = np.uint32(16)
    a_high, a_low = np.uint32(a >> 16), np.uint32(a & 0xFFFF)
    b_high, b_low = b >> half, b & np.uint32(0xFFFF)
    bottom, cross, other = a_low * b_low, a_high * b_low, a_low * b_high
    middle = (bottom >> half) + (cross & np.uint32(0xFFFF)) + other  # at most 2**32 - 1: cannot overflow
    return a_high * b_high + (cross >> half) + (middle >> half), np.uint32(a) * b


def _philox(counter: Words, key: tuple[Any, Any]) -> Words:
    c0, c1, c2, c3 = counter
    k0, k1 = key
    for index in range(ROUNDS):
        if index:
            k0, k1 = k0 + np.uint32(KEY_INCREMENTS[0]), k1 + np.uint32(KEY_INCREMENTS[1])
        (high0, low0), (high1, low1) = _product(MULTIPLIERS[0], c0), _product(MULTIPLIERS[1], c2)
        c0, c1, c2, c3 = high1 ^ c1 ^ k0, low1, high0 ^ c3 ^ k1, low0
    return c0, c1, c2, c3


def _unit64(low: Any, high: Any) -> Any:
    """(2 (x >> 12) + 1) 2**-53: the upper 52 bits become the fraction of a number in [1, 2)."""
    wide = [lax.convert_element_type(word, np.uint64) for word in (low, high)]
    kept = (wide[1] << np.uint64(20)) | (wide[0] >> np.uint64(12))
    one_to_two = lax.bitcast_convert_type(kept | np.uint64(0x3FF0000000000000), np.float64)
    return (one_to_two - 1.0) + 2.0**-53


def _unit32(low: Any, high: Any) -> Any:
    """The same number rounded once to single precision: its 53 bits stand left-aligned in two words.

    The upper word is normalised; a last bit that stands for all lower ones keeps ties from being rounded wrongly.
    """
    lower = ((low >> np.uint32(12)) << np.uint32(12)) | np.uint32(1 << 11)
    tiny = high == np.uint32(0)
    upper, lower = lax.select(tiny, lower, high), lax.select(tiny, lax.full_like(lower, 0), lower)
    shift = lax.clz(upper)
    spilled = lax.shift_right_logical(lower, np.uint32(32) - shift)  # XLA: a shift by 32 gives 0
    sticky = lax.convert_element_type((lower << shift) != np.uint32(0), np.uint32)
    number = lax.convert_element_type((upper << shift) | spilled | sticky, np.float32)
    power = lax.select(tiny, lax.full_like(shift, 127 - 64), lax.full_like(shift, 127 - 32)) - shift
    return number * lax.bitcast_convert_type(power << np.uint32(23), np.float32)
