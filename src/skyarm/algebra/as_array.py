"""Vectors, quaternions and matrices as NumPy arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np


def as_array(of: Any, numbers: Sequence[Any], dtype: Any, copy: bool | None) -> Any:
    """An array of numbers, whose scalars may be arrays of one shape: their axes follow.

    Raises:
        TypeError: a number that has no value, as a traced one.
        ValueError: ``copy=False``, which cannot be had.
    """
    if copy is False:
        raise ValueError(f"{type(of).__name__}: its numbers lie apart, an array of them is a copy")
    for number in numbers:
        for each in number if isinstance(number, tuple) else (number,):
            if not isinstance(each, (int, float, np.ndarray, np.generic)) and not hasattr(each, "__array__"):
                what = f"{type(of).__name__} of {type(each).__name__}"
                raise TypeError(f"{what}: has no values yet, so that no array can be made of it")
    return np.array(numbers, dtype=float if dtype is None else dtype)
