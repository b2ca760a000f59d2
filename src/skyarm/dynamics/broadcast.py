"""Arrays as scalars and back: the last axes hold components, the leading axes broadcast.

One state becomes plain floats, many become lanes, so that the fronts of the dynamics run the same laws on both.
"""

from __future__ import annotations

import numbers
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Mat3, Quaternion
from skyarm.files import shown

Array = npt.NDArray[np.float64]
ArrayLike = npt.ArrayLike

QUATERNION_TOLERANCE = 1e-6
"""How far a quaternion's length may be off 1: six printed digits."""


def components(name: str, value: ArrayLike, size: int) -> tuple[Any, ...]:
    """Last axis as scalars: floats for one state, arrays over the leading axes for many.

    Raises:
        ValueError: what is given are no finite numbers, or the last axis has not ``size`` entries; the message says
            ``name``.
    """
    array = finite_numbers(name, value)
    if array.ndim == 0 or array.shape[-1] != size:
        raise ValueError(f"{name}: shape {array.shape}, allowed (..., {size})")
    if array.ndim == 1:
        return tuple(array.tolist())
    return tuple(array[..., i] for i in range(size))


def finite_numbers(name: str, value: Any, allowed: str = "finite numbers") -> Array:
    """Array of floats; text, truth values, complex numbers and what is not finite are refused by name.

    Raises:
        ValueError: says ``name`` and what was given.
    """
    try:
        array = np.asarray(value)
        if array.dtype.kind == "O" and all(isinstance(each, numbers.Real) for each in array.flat):
            array = array.astype(float)
    except (TypeError, ValueError, OverflowError) as error:  # ragged rows; values of a trace
        raise ValueError(f"{name} = {shown(value)}: must be {allowed}") from error
    if array.dtype.kind not in "fiu":
        raise ValueError(f"{name} = {shown(value)}: must be {allowed}")
    array = array.astype(float, copy=False)
    if not np.isfinite(array).all():
        raise ValueError(f"{name} = {shown(value)}: must be {allowed}")
    return array


def one_number(name: str, value: Any) -> float:
    """One finite number, such as gravity.

    Raises:
        ValueError: anything else.
    """
    array = finite_numbers(name, value, "one finite number")
    if array.ndim:
        raise ValueError(f"{name} = {shown(value)}: must be one finite number")
    return float(array.item())


def unit_quaternion(quaternion_wxyz: ArrayLike) -> Quaternion:
    """Attitude of (..., 4) numbers, base to world, of unit length to 1e-6; its length is then made exact.

    Raises:
        ValueError: wrong shape, or further off unit length.
    """
    array = finite_numbers("quaternion_wxyz", quaternion_wxyz)
    wxyz = components("quaternion_wxyz", array, 4)
    length = np.linalg.norm(array, axis=-1)
    if not np.all(np.abs(length - 1.0) <= QUATERNION_TOLERANCE):
        worst = float(np.ravel(length)[np.argmax(np.abs(np.ravel(length) - 1.0))])
        raise ValueError(f"quaternion_wxyz: length {worst:.9g}, allowed 1 within {QUATERNION_TOLERANCE:g}")
    return Quaternion.of(wxyz).normalized()


def unit_rotation(quaternion_wxyz: ArrayLike) -> Mat3:
    """R_WB of (..., 4) numbers, checked as :func:`unit_quaternion` does."""
    return unit_quaternion(quaternion_wxyz).rotation()


def stacked(values: Any, lead: tuple[int, ...]) -> Array:
    """Nested lists of scalars as one array with the leading axes first."""
    if isinstance(values, (list, tuple)):
        parts = [stacked(value, lead) for value in values]
        return np.stack(parts, axis=len(lead)) if parts else np.zeros((*lead, 0))
    return np.broadcast_to(np.asarray(values, dtype=float), lead)


def leading_axes(*arrays: ArrayLike) -> tuple[int, ...]:
    """Axes that arguments have before their last one, broadcast against each other.

    Raises:
        ValueError: they do not broadcast; the message lists them.
    """
    shapes = [np.asarray(a, dtype=float).shape[:-1] for a in arrays]
    try:
        return np.broadcast_shapes(*shapes)
    except ValueError as error:
        raise ValueError(f"leading axes {shapes} do not broadcast") from error
