"""Gains at which a loop reaches the edge of stability, read from its frequency response.

With T from what is added to some commands to these commands themselves, closed, a common factor k on them puts an
eigenvalue on the unit circle where 1 / (k - 1) is an eigenvalue of T and real. Eigenvalues are followed from one
frequency to the next, and each passage of the real axis is found between two frequencies of the grid.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

ROUNDS = 4
"""Of the search between two frequencies, all passages at once: the grid is dense, the last leaves 1e-6 of a gain."""

REAL = 1e-9
"""Largest imaginary part, relative, of an eigenvalue that counts as real at zero frequency and at that of Nyquist."""

WIDEST = 150.0
"""Factor of gains beyond which, and below whose inverse, a passage is not looked for."""

NEAR = 1.3
"""Passages are searched for exactly whose gain lies within this factor of the nearest one, seen from 1."""


@dataclass(slots=True, eq=False)
class _Passages:
    """Where eigenvalues pass the real axis: between frequencies a and b, from ``first`` to ``second``."""

    block: npt.NDArray[np.int64]
    a: Array
    b: Array
    first: Complex
    second: Complex

    @property
    def share(self) -> Array:
        """How far between both the imaginary part is zero, on a line."""
        return np.asarray(self.first.imag / (self.first.imag - self.second.imag))

    @property
    def gain(self) -> Array:
        """Gain of each passage, on a line."""
        with np.errstate(all="ignore"):
            return np.asarray(1.0 + 1.0 / (self.first.real + self.share * (self.second.real - self.first.real)))

    def only(self, kept: npt.NDArray[np.bool_]) -> _Passages:
        """Those that are kept."""
        return _Passages(self.block[kept], self.a[kept], self.b[kept], self.first[kept], self.second[kept])


def gain_edges(
    T: Complex, frequencies: Array, blocks: Sequence[Sequence[int]], at: Callable[[Array], Complex], period: float
) -> list[Array]:
    """Gains above 0, but 1, with which the loop is on the edge of stability, those near 1; ascending, for each block.

    Args:
        T: (frequencies, channels, channels) closed-loop responses between commands.
        frequencies: rad/s, ascending.
        blocks: the channels that have a gain in common.
        at: the same responses at other frequencies.
        period: s; zero frequency and Nyquist's are where real eigenvalues leave the circle.
    """
    passages = _nearest(_all_passages([_part(T, block) for block in blocks], frequencies))
    for _ in range(ROUNDS):
        if not len(passages.a):
            break
        _narrow(passages, at, blocks)
    ends = at(np.array([0.0, np.pi / period]))
    found = []
    for i, block in enumerate(blocks):
        values = _eigenvalues(_part(ends, block)).ravel()
        real = values[np.abs(values.imag) <= REAL * np.abs(values)].real
        with np.errstate(all="ignore"):
            gains = np.concatenate([passages.gain[passages.block == i], 1.0 + 1.0 / real])
        found.append(np.sort(gains[np.isfinite(gains) & (gains > 1.0 / WIDEST) & (gains < WIDEST)]))
    return found


def _part(T: Complex, block: Sequence[int]) -> Complex:
    return T[:, block][:, :, block]


def _eigenvalues(T: Complex) -> Complex:
    """Of each matrix; zero where a response is not finite, as it is on an eigenvalue of the loop itself."""
    finite = np.isfinite(T).all(axis=(1, 2), keepdims=True)
    T = np.where(finite, T, 0.0)
    return np.asarray(T[:, :, 0] if T.shape[1] == 1 else np.linalg.eigvals(T))


def _all_passages(parts: Sequence[Complex], frequencies: Array) -> _Passages:
    """Every change of sign of an imaginary part, each eigenvalue followed from one frequency to the next."""
    found = []
    for i, part in enumerate(parts):
        loci, following = _followed(np.where(np.isfinite(part).all(axis=(1, 2), keepdims=True), part, 0.0))
        k, which = np.nonzero(loci.imag * following.imag < 0.0)
        found.append((np.full(len(k), i), frequencies[k], frequencies[k + 1], loci[k, which], following[k, which]))
    columns = [np.concatenate(column) for column in zip(*found, strict=True)]
    return _Passages(*columns)


def _followed(T: Complex) -> tuple[Complex, Complex]:
    """Eigenvalues at every frequency but the last, and what each has become at the next.

    That is the one whose vector has the largest share of its own: with V the vectors, V_k^-1 V_k+1 is the identity but
    for the step between both, up to order and size.
    """
    if T.shape[1] == 1:
        return T[:-1, :, 0], T[1:, :, 0]
    values, vectors = np.linalg.eig(T)
    # vectors that are nearly alike belong to values that are, so that a pseudo-inverse is good enough
    shares = np.abs(np.linalg.pinv(vectors[:-1]) @ vectors[1:])
    return values[:-1], np.take_along_axis(values[1:], np.argmax(shares, axis=2), axis=1)


def _nearest(passages: _Passages) -> _Passages:
    """Those whose gain may be the nearest to 1 of its block, from above or from below."""
    gain = passages.gain
    kept = np.zeros(len(gain), dtype=bool)
    for i in np.unique(passages.block):
        for side in ((gain > 1.0) & (gain < WIDEST), (gain > 1.0 / WIDEST) & (gain < 1.0)):
            here = side & (passages.block == i)
            away = np.abs(np.log(np.where(here, gain, 1.0)))
            kept |= here & (away <= np.log(NEAR) + away[here].min(initial=np.inf))
    return passages.only(kept)


def _narrow(passages: _Passages, at: Callable[[Array], Complex], blocks: Sequence[Sequence[int]]) -> None:
    """Put one end of each interval where a line through both has its zero."""
    share = passages.share
    w = passages.a + share * (passages.b - passages.a)
    wanted = passages.first + share * (passages.second - passages.first)
    T = at(w)
    middle = np.empty(len(w), dtype=complex)
    for i in np.unique(passages.block):
        here = passages.block == i
        values = _eigenvalues(_part(T[here], blocks[i]))
        nearest = np.argmin(np.abs(values - wanted[here][:, None]), axis=1)
        middle[here] = values[np.arange(len(values)), nearest]
    lower = np.sign(middle.imag) == np.sign(passages.first.imag)
    passages.a, passages.first = np.where(lower, w, passages.a), np.where(lower, middle, passages.first)
    passages.b, passages.second = np.where(lower, passages.b, w), np.where(lower, passages.second, middle)
