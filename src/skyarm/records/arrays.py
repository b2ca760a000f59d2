"""Types of arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
"""Array of doubles; the shape stands in the docstring that names it."""

AnyArray = npt.NDArray[Any]
"""Array of doubles, integers or booleans."""
