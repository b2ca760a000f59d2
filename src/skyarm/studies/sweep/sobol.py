"""Sobol sequence with random access by point number."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

BITS = 32

# degree, inner coefficients of the primitive polynomial as bits, first odd numbers;
# from the second dimension on
_JOE_KUO = """\
1 0 1
2 1 1 3
3 1 1 3 1
3 2 1 1 1
4 1 1 1 3 3
4 4 1 3 5 13
5 2 1 1 5 5 17
5 4 1 1 5 5 5
5 7 1 1 7 11 19
5 11 1 1 5 1 1
5 13 1 1 1 3 11
5 14 1 3 5 5 31
6 1 1 3 3 9 7 49
6 13 1 1 1 15 21 21
6 16 1 3 1 13 27 49
6 19 1 1 1 15 7 5
6 22 1 3 1 15 13 25
6 25 1 1 5 5 19 61
7 1 1 3 7 11 23 15 103
7 4 1 3 7 13 13 15 69
"""
_ROWS = [[*map(int, line.split())] for line in _JOE_KUO.splitlines()]

DIMENSIONS = 1 + len(_ROWS)
"""Largest number of dimensions for which there are direction numbers."""


def direction_numbers(dimension: int) -> npt.NDArray[np.uint64]:
    """Direction numbers of a dimension (from 0): ``BITS`` integers below 2**BITS.

    Source: Joe, Kuo 2008, "Constructing Sobol sequences with better two-dimensional
        projections", eq. 2 and the authors' table new-joe-kuo-6.
    """
    if dimension == 0:
        m = [1] * BITS
    else:
        degree, inner, *m = _ROWS[dimension - 1]
        for k in range(degree, BITS):
            value = m[k - degree] ^ (m[k - degree] << degree)
            for i in range(1, degree):
                if inner >> (degree - 1 - i) & 1:
                    value ^= m[k - i] << i
            m.append(value)
    return np.array(
        [number << (BITS - 1 - k) for k, number in enumerate(m)], dtype=np.uint64
    )


def sobol(indices: npt.ArrayLike, dimension: int) -> npt.NDArray[np.uint64]:
    """One coordinate of the Sobol points of given indices, as integers below 2**BITS.

    The order is that of the Gray code, in which the points are usually generated one
    after the other.

    Source: Antonov, Saleev 1979.
    """
    index = np.asarray(indices, dtype=np.uint64)
    gray = index ^ (index >> np.uint64(1))
    result = np.zeros_like(gray)
    for bit, direction in enumerate(direction_numbers(dimension)):
        result ^= np.where(
            gray >> np.uint64(bit) & np.uint64(1), direction, np.uint64(0)
        )
    return result
