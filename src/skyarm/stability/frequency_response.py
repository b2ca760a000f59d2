"""The frequency response of a sampled loop, by one reduction to Hessenberg form for all frequencies.

Source: A. J. Laub 1981, Efficient multivariable frequency response computations, IEEE TAC 26, 407-408.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

LOWEST = 0.02
"""rad/s, where a grid of frequencies begins; no loop of a vehicle closes slower than a minute."""

DECADE = 32
"""Frequencies of the grid in a decade, beside those around each resonance."""

AROUND = (-4.0, -2.0, -1.0, -0.5, -0.2, 0.0, 0.2, 0.5, 1.0, 2.0, 4.0)
"""Frequencies around a resonance, in half its width at half its height."""

WIDE = 0.5
"""Half the width of a resonance over its frequency above which the even grid, 7 per cent wide, shows all of it."""

DEAD = 1e-2
"""Largest magnitude of an eigenvalue that leaves no resonance: below, it dies out within three periods."""

BLOCK = 16
"""Rows of the back substitution that are solved at once; the others are products of matrices."""

AT_ONCE = 96
"""Frequencies whose matrices are eliminated together: some ten megabytes."""


def frequency_grid(z: Complex, period: float) -> Array:
    """Frequencies of a loop, rad/s, ascending up to that of Nyquist, dense around the resonances of its eigenvalues.

    Args:
        z: eigenvalues per control period.
        period: s.
    """
    highest = np.pi / period
    even = np.geomspace(LOWEST, highest, max(2, round(DECADE * np.log10(highest / LOWEST)) + 1))
    s = np.log(z[np.abs(z) > DEAD].astype(complex)) / period
    s = s[(s.imag > 0.0) & (np.abs(s.real) < WIDE * s.imag)]
    around = s.imag[:, None] + np.maximum(np.abs(s.real), 1e-6)[:, None] * np.array(AROUND)
    found = np.unique(np.concatenate([even, around.ravel()]))
    return np.asarray(found[(found >= LOWEST) & (found <= highest)])


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """``C (z - A)^-1 B`` at any frequency.

    Attributes:
        hessenberg: (n, n) A in an orthonormal basis in which only its first subdiagonal is not zero.
        enters: (n, inputs) B in that basis. leaves: (outputs, n) C in it. period: s, z = exp(i w period).
    """

    hessenberg: Array
    enters: Array
    leaves: Array
    period: float

    def at(self, frequencies: Array) -> Complex:
        """Responses (frequencies, outputs, inputs) at frequencies in rad/s; infinite on an eigenvalue."""
        z = np.exp(1j * np.asarray(frequencies, dtype=float) * self.period)
        parts = [self._at(z[k : k + AT_ONCE]) for k in range(0, len(z), AT_ONCE)]
        shape = (0, len(self.leaves), self.enters.shape[1])
        return np.concatenate(parts) if parts else np.zeros(shape, dtype=complex)

    def _at(self, z: Complex) -> Complex:
        """Gaussian elimination of one subdiagonal with row exchanges, then back substitution in blocks."""
        n, m, count = len(self.hessenberg), self.enters.shape[1], len(z)
        rows = np.empty((n, n + m, count), dtype=complex)
        rows[:, :n] = -self.hessenberg[:, :, None]
        rows[:, n:] = self.enters[:, :, None]
        rows[np.arange(n), np.arange(n)] += z
        for k in range(n - 1):
            upper, lower = rows[k, k:], rows[k + 1, k:]
            exchanged = np.abs(lower[0]) > np.abs(upper[0])
            pivot, other = np.where(exchanged, lower, upper), np.where(exchanged, upper, lower)
            # a column of zeros only has nothing to eliminate; z on an eigenvalue gives an infinite response
            with np.errstate(all="ignore"):
                factor = np.where(other[0] == 0.0, 0.0, other[0] / pivot[0])
                rows[k, k:], rows[k + 1, k:] = pivot, other - factor * pivot
        rows = np.ascontiguousarray(np.moveaxis(rows, 2, 0))
        upper, found = rows[:, :, :n], rows[:, :, n:]
        infinite = ~(np.abs(np.diagonal(upper, axis1=1, axis2=2)) > 0.0).all(axis=1) | ~np.isfinite(rows).all(
            axis=(1, 2)
        )
        upper[infinite], found[infinite] = np.eye(n), 0.0
        for start in range((n - 1) // BLOCK * BLOCK, -1, -BLOCK):
            here, after = slice(start, min(start + BLOCK, n)), slice(min(start + BLOCK, n), n)
            found[:, here] -= upper[:, here, after] @ found[:, after]
            found[:, here] = np.linalg.solve(upper[:, here, here], found[:, here])
        responses = np.asarray(self.leaves @ found)
        responses[infinite] = np.inf
        return responses


def response(A: Array, B: Array, C: Array, period: float) -> Response:
    """The frequency response of x+ = A x + B v, y = C x."""
    H, B, C = A.copy(), B.copy(), C.copy()
    for k in range(len(A) - 2):
        column = H[k + 1 :, k]
        size = np.linalg.norm(column)
        if size == abs(column[0]):
            continue
        # Householder's reflection that leaves the column its first entry only
        v = column.copy()
        v[0] += np.copysign(size, v[0])
        v *= np.sqrt(2.0) / np.linalg.norm(v)
        H[k + 1 :, k:] -= np.outer(v, v @ H[k + 1 :, k:])
        H[:, k + 1 :] -= np.outer(H[:, k + 1 :] @ v, v)
        H[k + 2 :, k] = 0.0
        B[k + 1 :] -= np.outer(v, v @ B[k + 1 :])
        C[:, k + 1 :] -= np.outer(C[:, k + 1 :] @ v, v)
    return Response(H, B, C, period)
