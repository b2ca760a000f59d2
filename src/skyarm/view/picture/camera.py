"""Camera of a picture: its target, distance and direction at each instant."""

from __future__ import annotations

from skyarm.records.arrays import Array
from skyarm.records.immutable import positional

FIELD_OF_VIEW = 40.0
"""Field of view (deg), from the lower to the upper edge of a panel."""


@positional
class CameraPath:
    """Target, distance and direction of a picture's camera in each of F frames.

    Attributes:
        look_at: (F, 3) m. distance: (F,) m. azimuth, elevation: (F,) deg, as MuJoCo's free camera has them.
    """

    look_at: Array
    distance: Array
    azimuth: Array
    elevation: Array
