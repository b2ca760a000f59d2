"""Types of arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
"""Array of doubles; the shape stands in the docstring that names it."""

Complex = npt.NDArray[np.complex128]
"""Array of complex numbers."""

IntArray = npt.NDArray[np.int_]
"""Array of integers."""

Mask = npt.NDArray[np.bool_]
"""Array of booleans."""

Pixels = npt.NDArray[np.uint8]
"""Picture (rows, columns, channels), 0 to 255."""

AnyArray = npt.NDArray[Any]
"""Array of doubles, integers or booleans."""
