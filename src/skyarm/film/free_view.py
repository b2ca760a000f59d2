"""From which side a flight is looked at: from where no surface of its world hides the tip."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from skyarm.drawing.sight_lines import hidden_share
from skyarm.film.filmed_flight import FilmedFlight

Array = npt.NDArray[np.float64]

AZIMUTH, ELEVATION = 125.0, -16.0
"""deg: the camera looks along +x turned by the azimuth about z, and downwards by -elevation."""

SIDES = (AZIMUTH, 180.0 - AZIMUTH, -AZIMUTH, AZIMUTH - 180.0)
"""Azimuths that are tried: from ahead and the right, from behind and the right, and the same from the left."""

LOOKS = 24
"""Instants at which is looked."""


def looking_towards(azimuth: float, elevation: float = ELEVATION) -> Array:
    """Unit vector (3,) along which a camera looks; deg."""
    az, el = math.radians(azimuth), math.radians(elevation)
    return np.array([math.cos(el) * math.cos(az), math.cos(el) * math.sin(az), math.sin(el)])


def free_azimuth(flights: Sequence[FilmedFlight]) -> float:
    """Azimuth, deg, from which surfaces hide the tips least; the usual one where nothing hides them."""
    if not any(flight.surfaces for flight in flights):
        return AZIMUTH
    hidden = [sum(_hidden(flight, -looking_towards(side)) for flight in flights) for side in SIDES]
    return SIDES[int(np.argmin(hidden))]


def _hidden(flight: FilmedFlight, towards: Array) -> float:
    """Share of the instants at which something stands between the tip and a camera in a direction (3,)."""
    chosen = np.unique(np.linspace(0, len(flight.tip) - 1, LOOKS).astype(int))
    solids = [replace(each, position=each.position[chosen], rotation=each.rotation[chosen]) for each in flight.surfaces]
    return hidden_share(solids, flight.tip[chosen], towards)
