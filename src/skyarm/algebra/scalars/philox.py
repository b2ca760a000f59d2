"""Counter-based random numbers (Philox4x32-10), the same in all simulators for the same
keys.

A draw has no memory: it is a pure function of (seed, episode, channel, step), whatever
was drawn before it, in whatever order and on whatever engine. The layout is a promise;
an engine that draws noise itself must follow it bit by bit.

=========  =============================================================================
key        ``k0`` = low 32 bits of the seed, ``k1`` = its high 32 bits (seeds have 64
           bits)
counter    ``c0`` = block, ``c1`` = step, ``c2`` = channel, ``c3`` = episode (32 bits
           each, unsigned)
output     four words ``w0 w1 w2 w3`` a block
uniform j  block ``j // 2``; ``x = w0 + 2**32 w1`` for even j, ``x = w2 + 2**32 w3``
           for odd j; ``u = (2 (x >> 12) + 1) * 2**-53``: odd multiples of 2**-53, exact
           doubles, never 0 or 1, symmetric about 1/2
normal j   from the two uniforms ``a``, ``b`` of block ``j // 2``: ``sqrt(-2 log a)``
           times ``cos(2 pi b)`` for even j, times ``sin(2 pi b)`` for odd j; the
           largest magnitude is sqrt(106 log 2) = 8.57
=========  =============================================================================

Words, uniforms and normals are equal on all engines to the bit: log, sin and cos are
those of :mod:`skyarm.algebra.scalars.elementary`. The step is a whole number of 32
bits: 49 days at 1 kHz.

Source: Salmon, Moraes, Dror, Shaw 2011, "Parallel random numbers: as easy as 1, 2, 3",
section 3.3; Box, Muller 1958.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skyarm.algebra.scalars import elementary
from skyarm.algebra.scalars.fold import Scalar
from skyarm.algebra.scalars.functions import sqrt

ROUNDS = 10
"""Rounds of the source's Philox4x32-10; with seven it passes the same tests
(BigCrush)."""
MULTIPLIERS = (0xD2511F53, 0xCD9E8D57)
KEY_INCREMENTS = (0x9E3779B9, 0xBB67AE85)
_WORD = 0xFFFFFFFF
TWO_PI = 6.283185307179586

Words = NDArray[np.uint64]


def philox4x32(
    counter: tuple[ArrayLike, ArrayLike, ArrayLike, ArrayLike],
    key: tuple[ArrayLike, ArrayLike],
) -> tuple[Words, Words, Words, Words]:
    """Philox4x32 block function: four 32-bit random words from a counter and a key.

    Args:
        counter: c0 ... c3, numbers or arrays below 2**32 that broadcast.
        key: k0, k1, likewise.
    Source: Salmon et al. 2011, section 3.3: the key is bumped between rounds, not
    before the first.
    """
    # in 64 bits, since the product of two words has both its halves in use
    shift, mask = np.uint64(32), np.uint64(_WORD)
    c0, c1, c2, c3 = (np.asarray(c, dtype=np.uint64) for c in counter)
    k0, k1 = (np.asarray(k, dtype=np.uint64) for k in key)
    m0, m1 = map(np.uint64, MULTIPLIERS)
    for index in range(ROUNDS):
        if index:
            k0, k1 = (
                (k0 + np.uint64(KEY_INCREMENTS[0])) & mask,
                (k1 + np.uint64(KEY_INCREMENTS[1])) & mask,
            )
        first, second = m0 * c0, m1 * c2
        c0, c1, c2, c3 = (
            (second >> shift) ^ c1 ^ k0,
            second & mask,
            (first >> shift) ^ c3 ^ k1,
            first & mask,
        )
    return c0, c1, c2, c3


def uniform(
    seed: int, episode: ArrayLike, channel: int, steps: ArrayLike
) -> NDArray[np.float64]:
    """One uniform random number in (0, 1) for each episode and step; both arrays
    broadcast.

    Args:
        seed: whole number of 64 bits.
        episode: whole numbers of 32 bits.
        channel: whole number of 32 bits.
        steps: whole numbers of 32 bits.

    Raises:
        ValueError: a number outside its range; names it.
    """
    return uniforms(seed, episode, channel, steps, 1)[..., 0]


def uniforms(
    seed: ArrayLike, episode: ArrayLike, channel: int, steps: ArrayLike, count: int
) -> NDArray[np.float64]:
    """Independent uniform random numbers, ``count`` for each episode and step along a
    new last axis.
    """
    key = _whole("seed", seed, 64)
    c1, c2, c3 = (
        _whole("step", steps, 32),
        _whole("channel", channel, 32),
        _whole("episode", episode, 32),
    )
    # a block of four words gives two uniforms
    blocks = np.arange((int(_whole("count", count, 32)) + 1) // 2, dtype=np.uint64)
    c1, c2, c3 = (c[..., None] for c in np.broadcast_arrays(c1, c2, c3))
    words = philox4x32(
        (blocks, c1, c2, c3), (key & np.uint64(_WORD), key >> np.uint64(32))
    )
    pairs = np.stack((_unit(words[0], words[1]), _unit(words[2], words[3])), axis=-1)
    return pairs.reshape(*pairs.shape[:-2], -1)[..., :count]


def normal(
    seed: int, episode: ArrayLike, channel: int, steps: ArrayLike, count: int
) -> NDArray[np.float64]:
    """Independent standard normal random numbers, ``count`` for each episode and step
    along a new last axis.

    The first numbers do not depend on ``count``. Arguments and errors as
    :func:`uniform`.
    Source: Box, Muller 1958.
    """
    # whole pairs, so that the first numbers are the same for any count
    pairs = uniforms(seed, episode, channel, steps, count + count % 2)
    both = np.stack(
        [*map(np.asarray, normal_pair(pairs[..., 0::2], pairs[..., 1::2]))], axis=-1
    )
    return both.reshape(*pairs.shape)[..., :count]


def normal_pair(a: Scalar, b: Scalar) -> tuple[Scalar, Scalar]:
    """Two independent standard normal numbers from two uniform ones, by the Box-Muller
    transform.

    Source: Box, Muller 1958.
    """
    # of elementary, not of the scalars' libraries: the same bits on every engine
    radius, angle = sqrt(-2.0 * elementary.log(a)), TWO_PI * b
    return radius * elementary.cos(angle), radius * elementary.sin(angle)


def normals(uniforms: Sequence[Scalar]) -> list[Scalar]:
    """Convert an even number of uniform random numbers in (0, 1) to as many standard
    normal ones (Box and Muller).

    Args:
        uniforms: uniform random numbers, such as the draws of a part.
    """
    numbers: list[Scalar] = []
    for a, b in zip(uniforms[0::2], uniforms[1::2], strict=True):
        numbers += normal_pair(a, b)
    return numbers


def _unit(low: Words, high: Words) -> NDArray[np.float64]:
    """Uniform numbers in (0, 1) from pairs of random 32-bit words."""
    # 52 bits: each number is the middle of its interval, so that none is 0 or 1
    bits = ((high << np.uint64(32)) | low) >> np.uint64(12)
    return (bits * np.uint64(2) + np.uint64(1)).astype(np.float64) * 2.0**-53


def _whole(name: str, value: ArrayLike, bits: int) -> Words:
    """Convert whole numbers to uint64; refuse those outside the range of ``bits``
    bits.
    """
    numbers = np.asarray(value)
    whole = numbers.dtype.kind in "iu"
    # numbers of 64 bits are below 2**64 by their type, and NumPy has no 2**64
    if (
        not whole
        or bool(np.any(numbers < 0))
        or (bits < 64 and bool(np.any(numbers >= 2**bits)))
    ):
        shown = value if numbers.ndim == 0 else f"{numbers.dtype} array"
        raise ValueError(
            f"{name} = {shown!r}: must be whole numbers from 0 to 2**{bits} - 1"
        )
    return numbers.astype(np.uint64)
