"""Basic operations and random numbers in JAX, with derivatives that stay finite where
the value is finite.

``where`` evaluates both of its branches, and so does its derivative: an infinite slope
in the branch that is not taken (sqrt at 0, a division by 0) becomes 0 * inf = NaN. Such
a slope is 0 here, a subgradient of every length |v|. |x| and copysign take their slope
at 0 from the sign bit, so that atan2 keeps its slope of 1 there.

Lane k of seed s draws what :mod:`skyarm.algebra.scalars.philox` draws for (seed,
episode k, channel, step), bit for bit. Only the last step of a double needs 64-bit
integers, so that single precision runs where JAX has none.
Source: Salmon, Moraes, Dror, Shaw 2011, section 3.3.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from skyarm.algebra.scalars.philox import KEY_INCREMENTS, MULTIPLIERS, ROUNDS
from skyarm.compile.machine_code import missing_extra
from skyarm.compile.tracing.tracer import Lowered, Node, is_condition

try:
    import jax
    import jax.numpy as jnp
    from jax import Array, lax
    from jax.typing import ArrayLike
except (
    ImportError
) as error:  # pragma: no cover  (the library is there when this is tested)
    raise missing_extra("jax") from error

Float = type[np.float64] | type[np.float32]
"""Floating-point type of all numbers in a program that JAX evaluates."""


def _layout(x: Array) -> tuple[type[np.int64 | np.int32], int, int]:
    """Integer type, mantissa bits and exponent bias of the floating-point type of an
    array.
    """
    return (np.int64, 52, 1023) if x.dtype == np.float64 else (np.int32, 23, 127)


def _like(x: Array, value: float) -> Array:
    return lax.full_like(x, value)


def _bits(x: Array) -> Array:
    return lax.bitcast_convert_type(x, _layout(x)[0])


def power_of_two(k: Array) -> Array:
    """Power 2**k for a whole number k, written directly into the exponent bits."""
    integer, shift, bias = _layout(k)
    # 1.5 times 2 to the mantissa's bits: the sum has the integer in its low bits
    bits = _bits(lax.add(k, _like(k, 1.5 * 2.0**shift)))
    moved = lax.shift_left(bits, _like(bits, shift))
    return lax.bitcast_convert_type(lax.add(moved, integer(bias << shift)), k.dtype)


def exponent(x: Array) -> Array:
    """Binary exponent of a normal number, as a float."""
    integer, shift, bias = _layout(x)
    field = lax.bitwise_and(
        lax.shift_right_logical(_bits(x), integer(shift)), integer(2 * bias + 1)
    )
    return lax.sub(lax.convert_element_type(field, x.dtype), _like(x, bias))


@jax.custom_jvp
def mantissa(x: Array) -> Array:
    """Mantissa of a number, in [1, 2) with its sign."""
    integer, shift, bias = _layout(x)
    mask = ~integer((2 * bias + 1) << shift)
    return lax.bitcast_convert_type(
        lax.bitwise_or(lax.bitwise_and(_bits(x), mask), integer(bias << shift)), x.dtype
    )


# of x = m 2**e: dm/dx = 2**-e
mantissa.defjvps(lambda dx, _, x: dx * power_of_two(-exponent(x)))


@jax.custom_jvp
def divide(a: Array, b: Array) -> Array:
    """Quotient a / b; its derivative is 0 where b is 0."""
    return lax.div(a, b)


@divide.defjvp
def _(primals: tuple[Array, ...], tangents: tuple[Array, ...]) -> tuple[Array, Array]:
    (a, b), (da, db) = primals, tangents
    q = lax.div(a, b)
    zero = b == 0.0
    # an infinite or undefined slope would spoil gradients of branches not taken
    safe, scale = lax.select(zero, _like(b, 1.0), b), lax.select(zero, _like(q, 0.0), q)
    slope = (da - scale * db) / safe
    return q, lax.select(zero, _like(slope, 0.0), slope)


@jax.custom_jvp
def sqrt(x: Array) -> Array:
    """Square root; its derivative at 0 is 0."""
    return lax.sqrt(x)


@sqrt.defjvps
def _(dx: Array, root: Array, _x: Array) -> Array:
    positive = root > 0.0
    slope = 0.5 / lax.select(positive, root, _like(root, 1.0))
    return dx * lax.select(positive, slope, _like(root, 0.0))


def _negative(x: Array) -> Array:
    """True if the sign bit of a number is set, as for -0.0."""
    return _bits(x) < 0


@jax.custom_jvp
def absolute(x: Array) -> Array:
    """Absolute value of a number."""
    return lax.abs(x)


absolute.defjvps(
    lambda dx, _, x: dx * lax.select(_negative(x), _like(x, -1.0), _like(x, 1.0))
)


@jax.custom_jvp
def copysign(size: Array, sign: Array) -> Array:
    """Number with the magnitude of the first argument and the sign of the second."""
    return lax.select(_negative(sign), -lax.abs(size), lax.abs(size))


def _slope_of_size(dsize: Array, _: Array, size: Array, sign: Array) -> Array:
    turned = lax.ne(_negative(size), _negative(sign))
    return dsize * lax.select(turned, _like(size, -1.0), _like(size, 1.0))


copysign.defjvps(_slope_of_size, None)


def at_most(a: Array, b: Array) -> Array:
    """Comparison a <= b of JAX scalars; False for NaN."""
    return lax.bitwise_or(lax.lt(a, b), lax.eq(a, b))


OPERATIONS: dict[str, Callable[..., Array]] = {
    "add": lax.add,
    "sub": lax.sub,
    "mul": lax.mul,
    "div": divide,
    "neg": lax.neg,
    "lt": lax.lt,
    "le": at_most,
    "where": lax.select,
    "and": lax.bitwise_and,
    "or": lax.bitwise_or,
    "not": lax.bitwise_not,
    "abs": absolute,
    "sqrt": sqrt,
    "floor": lax.floor,
    "copysign": copysign,
    "power_of_two": power_of_two,
    "exponent": exponent,
    "mantissa": mantissa,
}
"""Basic operations by name, on JAX scalars."""


def evaluate(program: Lowered, inputs: Sequence[Array], dtype: Float) -> list[Array]:
    """Evaluate a traced program on JAX scalars of one floating-point type; returns the
    outputs.
    """
    values: dict[int, ArrayLike] = {
        node.index: value for node, value in zip(program.inputs, inputs, strict=True)
    }
    for node in program.nodes:
        if node.op == "const":
            values[node.index] = _constant(node, dtype)
        elif node.op in ("slot", "repeat", "item"):
            raise ValueError(
                "a program with loops is for machine code: trace it without loops"
                " for JAX"
            )
        elif node.op != "input":
            values[node.index] = OPERATIONS[node.op](
                *(values[arg.index] for arg in node.args)
            )
    return [
        lax.convert_element_type(values[node.index], dtype) for node in program.outputs
    ]


def _constant(node: Node, dtype: Float) -> ArrayLike:
    if is_condition(node):
        return np.bool_(node.value)
    with np.errstate(over="ignore"):  # 1e300 is inf in single precision
        return dtype(node.value)


Words = tuple[Array, Array, Array, Array]


def uniforms(
    seed: Array,
    episode: Array,
    step: Array,
    draws: Sequence[tuple[int, int]],
    dtype: Float,
) -> list[Array]:
    """Uniform random numbers in (0, 1) in JAX for one flight and step, equal to those
    of NumPy.

    Args:
        seed: low and high word, uint32.
        episode: uint32.
        step: uint32.
        draws: (channel, how many numbers) pairs.
        dtype: float64, or float32, to which the same numbers are rounded within a unit
            of the last place.
    """
    unit = _unit64 if dtype == np.float64 else _unit32
    # as JAX's own numbers: NumPy's scalars warn where they wrap around
    key = (jnp.uint32(seed[0]), jnp.uint32(seed[1]))
    numbers: list[Array] = []
    for channel, count in draws:
        units: list[Array] = []
        for block in range((count + 1) // 2):
            counter = (jnp.uint32(block), step, jnp.uint32(channel), episode)
            w0, w1, w2, w3 = _philox(counter, key)
            units += [unit(w0, w1), unit(w2, w3)]
        numbers += units[:count]
    return numbers


def _product(a: int, b: Array) -> tuple[Array, Array]:
    """High and low 32-bit word of a product, computed without 64-bit integers."""
    # halves of 16 bits, since a product of two of them fits into 32
    half = np.uint32(16)
    a_high, a_low = np.uint32(a >> 16), np.uint32(a & 0xFFFF)
    b_high, b_low = b >> half, b & np.uint32(0xFFFF)
    bottom, cross, other = a_low * b_low, a_high * b_low, a_low * b_high
    # at most 2**32 - 1: cannot overflow
    middle = (bottom >> half) + (cross & np.uint32(0xFFFF)) + other
    return a_high * b_high + (cross >> half) + (middle >> half), np.uint32(a) * b


def _philox(counter: Words, key: tuple[Array, Array]) -> Words:
    c0, c1, c2, c3 = counter
    k0, k1 = key
    # words of 32 bits wrap around by themselves: no mask
    for index in range(ROUNDS):
        if index:
            k0, k1 = (
                k0 + np.uint32(KEY_INCREMENTS[0]),
                k1 + np.uint32(KEY_INCREMENTS[1]),
            )
        (high0, low0), (high1, low1) = (
            _product(MULTIPLIERS[0], c0),
            _product(MULTIPLIERS[1], c2),
        )
        c0, c1, c2, c3 = high1 ^ c1 ^ k0, low1, high0 ^ c3 ^ k1, low0
    return c0, c1, c2, c3


def _unit64(low: Array, high: Array) -> Array:
    """Map a 64-bit integer x to (2 (x >> 12) + 1) 2**-53, a double in (0, 1)."""
    wide = [lax.convert_element_type(word, np.uint64) for word in (low, high)]
    # bits of a number in [1, 2): no conversion, which would round 64 bits
    top = (wide[1] << np.uint64(20)) | (wide[0] >> np.uint64(12))
    one_to_two = lax.bitcast_convert_type(
        top | np.uint64(0x3FF0000000000000), np.float64
    )
    return (one_to_two - 1.0) + 2.0**-53


def _unit32(low: Array, high: Array) -> Array:
    """Map two 32-bit words to a single-precision number in (0, 1], without 64-bit
    integers; the highest words round to 1.
    """
    # both words as one fraction, and half a step of doubles, so that 0 never comes
    upper, lower = (lax.convert_element_type(word, np.float32) for word in (high, low))
    return (upper + lower * np.float32(2.0**-32)) * np.float32(2.0**-32) + np.float32(
        2.0**-53
    )
