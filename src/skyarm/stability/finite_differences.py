"""Derivatives of a sampled loop by central differences of fourth order, on rotation vectors where it turns.

Source: B. Fornberg 1988, Table 1 (first derivative, fourth order).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Quaternion

Array = npt.NDArray[np.float64]

STEP_SIZE = 1e-4
"""Step of a difference, in the number's unit or relative where the number is above 1: fourth order leaves 1e-12."""

STENCIL = ((-2.0, 1.0 / 12.0), (-1.0, -2.0 / 3.0), (1.0, 2.0 / 3.0), (2.0, -1.0 / 12.0))
"""(step, weight) of the first derivative, fourth order."""


def stencil_points(base: Array, attitude: Quaternion) -> tuple[Array, Array]:
    """Every point of the stencils, (leaves, directions * 4), and the step of each direction (directions,).

    Args:
        base: the point (leaves,): three of position, four of attitude (wxyz), then plain numbers.
        attitude: the same as ``base[3:7]``.
    """
    count = len(base)
    widths = STEP_SIZE * np.maximum(1.0, np.abs(np.delete(base, 3)))  # a rotation has one direction less
    turns = slice(3, 6)
    widths[turns] = STEP_SIZE
    found = np.repeat(base[:, None], 4 * (count - 1), axis=1)
    for direction, width in enumerate(widths):
        for j, (steps, _) in enumerate(STENCIL):
            column = 4 * direction + j
            if 3 <= direction < 6:
                v = [0.0, 0.0, 0.0]
                v[direction - 3] = 0.5 * steps * width
                found[3:7, column] = list(_turned(attitude, v))
            else:
                found[direction if direction < 3 else direction + 1, column] += steps * width
    return found, widths


def derivatives(result: Array, still: Array, widths: Array, outs: list[int]) -> list[Array]:
    """Jacobians of next state, measurement, memory and command by every direction.

    Args:
        result: outputs at the points of :func:`stencil_points` (outputs, directions * 4).
        still: outputs at the point itself (outputs,).
        widths: step of each direction (directions,).
        outs: how many outputs each of the four has; those of the state come first.
    """
    directions = len(widths)
    state = _tangent(result[: outs[0]], still[: outs[0]])
    values = np.vstack([state, result[outs[0] :] - still[outs[0] :, None]])
    weights = np.array([weight for _, weight in STENCIL])
    slopes = values.reshape(len(values), directions, len(STENCIL)) @ weights / widths
    ends = np.cumsum([outs[0] - 1, *outs[1:]])
    return np.split(slopes, ends[:-1].tolist())


def _turned(q: Quaternion, half: Sequence[float]) -> Quaternion:
    """q times the rotation of twice the vector ``half``, first order with unit length to 1e-16."""
    x, y, z = half
    w = float(np.sqrt(1.0 - x * x - y * y - z * z))
    turned: Quaternion = Quaternion(*(float(c) for c in q)) * Quaternion(w, x, y, z)
    return turned


def _tangent(states: Array, still: Array) -> Array:
    """Differences of states (leaves, lanes) from one; the attitude's as twice the vector part of q0^-1 q."""
    w, x, y, z = still[3:7]
    a, b, c, d = states[3:7]
    turn = 2.0 * np.array([w * b - x * a - y * d + z * c, w * c + x * d - y * a - z * b, w * d - x * c + y * b - z * a])
    return np.vstack([states[:3] - still[:3, None], turn, states[7:] - still[7:, None]])
