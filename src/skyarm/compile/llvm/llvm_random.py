"""Uniform random numbers inside a compiled loop: Philox4x32-10 on vectors of lanes.

Lane k of seed s draws what :mod:`skyarm.scalars.philox` draws for (seed, episode k, channel, step), bit for bit, on
every engine, width and thread count.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from skyarm.compile.llvm.llvm_text import Writer
from skyarm.scalars.philox import KEY_INCREMENTS, MULTIPLIERS, ROUNDS

LOW = 0xFFFFFFFF

Splat = Callable[[int], str]


def write_uniforms(writer: Writer, draws: Sequence[tuple[int, int]], *, own_seeds: bool = False) -> list[str]:
    """Write the draws of this step; returns the names of vectors of numbers in (0, 1).

    Args:
        writer: of the loop's function.
        draws: (channel, how many numbers) pairs.
        own_seeds: the seed of each lane stands at ``%seeds.ptr``, in place of the one for all in ``%keys``.

    The function has ``%keys`` = [seed, key of every lane] as 64-bit integers, ``%episodes.ptr`` at this block's
    first key, and ``%step``. A lane's key is its episode in the low 32 bits and, in the high ones, what is to be added
    to ``%step`` for the step of that lane (both modulo 2^32): episodes may begin at different steps.
    """
    width = writer.lanes.width
    words = f"<{width} x i64>"

    def splat(value: int) -> str:
        return writer.lanes.splat(f"i64 {value}")

    def broadcast(name: str) -> str:
        first = writer.emit(f"insertelement {words} poison, i64 {name}, i64 0")
        zeros = writer.lanes.splat("i32 0")
        return writer.emit(f"shufflevector {words} {first}, {words} poison, <{width} x i32> {zeros}")

    if own_seeds:
        seed = writer.emit(f"load {words}, ptr %seeds.ptr, align 8")
    else:
        seed = broadcast(writer.emit("load i64, ptr %keys, align 8"))
    keys = [
        writer.emit(f"and {words} {seed}, {splat(LOW)}"),
        writer.emit(f"lshr {words} {seed}, {splat(32)}"),
    ]
    key = writer.emit(f"load {words}, ptr %episodes.ptr, align 8")
    episode = writer.emit(f"and {words} {key}, {splat(LOW)}")
    ahead = writer.emit(f"lshr {words} {key}, {splat(32)}")
    step = writer.emit(f"add {words} {broadcast('%step')}, {ahead}")
    step = writer.emit(f"and {words} {step}, {splat(LOW)}")
    numbers: list[str] = []
    for channel, count in draws:
        units: list[str] = []
        for block in range((count + 1) // 2):
            counter = [splat(block), step, splat(channel), episode]
            out = _philox(writer, words, counter, keys, splat)
            units += [_unit(writer, words, out[0], out[1], splat), _unit(writer, words, out[2], out[3], splat)]
        numbers += units[:count]
    return numbers


def _philox(writer: Writer, words: str, counter: list[str], keys: list[str], splat: Splat) -> list[str]:
    c0, c1, c2, c3 = counter
    k0, k1 = keys
    for index in range(ROUNDS):
        if index:
            k0 = writer.emit(
                f"and {words} {writer.emit(f'add {words} {k0}, {splat(KEY_INCREMENTS[0])}')}, {splat(LOW)}"
            )
            k1 = writer.emit(
                f"and {words} {writer.emit(f'add {words} {k1}, {splat(KEY_INCREMENTS[1])}')}, {splat(LOW)}"
            )
        p0 = writer.emit(f"mul {words} {c0}, {splat(MULTIPLIERS[0])}")
        p1 = writer.emit(f"mul {words} {c2}, {splat(MULTIPLIERS[1])}")
        high0, high1 = (writer.emit(f"lshr {words} {p}, {splat(32)}") for p in (p0, p1))
        low0, low1 = (writer.emit(f"and {words} {p}, {splat(LOW)}") for p in (p0, p1))
        n0 = writer.emit(f"xor {words} {writer.emit(f'xor {words} {high1}, {c1}')}, {k0}")
        n2 = writer.emit(f"xor {words} {writer.emit(f'xor {words} {high0}, {c3}')}, {k1}")
        c0, c1, c2, c3 = n0, low1, n2, low0
    return [c0, c1, c2, c3]


def _unit(writer: Writer, words: str, low: str, high: str, splat: Splat) -> str:
    """(2 (x >> 12) + 1) 2^-53: the upper 52 bits become the fraction of a number in [1, 2)."""
    lanes = writer.lanes
    double = f"<{lanes.width} x double>"

    def number(value: str) -> str:
        return lanes.splat(f"double {value}")

    joined = writer.emit(f"or {words} {writer.emit(f'shl {words} {high}, {splat(32)}')}, {low}")
    kept = writer.emit(f"lshr {words} {joined}, {splat(12)}")
    bits = writer.emit(f"or {words} {kept}, {splat(0x3FF0000000000000)}")
    shifted = writer.emit(f"bitcast {words} {bits} to {double}")
    from_zero = writer.emit(f"fsub {double} {shifted}, {number('1.0')}")
    result = writer.emit(f"fadd {double} {from_zero}, {number('0x3CA0000000000000')}")
    return writer.emit(f"fptrunc {double} {result} to {lanes.vector}") if lanes.single else result
