"""Symmetric disk margins: how much gain and phase together a loop bears, and several loops at once.

A channel is multiplied by f = (1 + d / 2) / (1 - d / 2) with any complex d, also one that changes with frequency, of
magnitude below a: the disk margin a is the largest for which the loop stays stable. With S the sensitivity it is 1 over
the largest |S - 1/2| of all frequencies; with several channels, each under a d of its own, the structured singular
value stands in place of the magnitude, here its upper bound (:mod:`skyarm.stability.structured_bound`), so that the
margin of several is never overstated. 2 is the largest: any positive gain and any phase below 90 degrees are borne.

Source: Seiler, Packard, Gahinet 2020, An Introduction to Disk Margins, IEEE Control Systems Magazine 40 (5), eq. (11)
with skew 0, theorem 1, and the section on multiple-loop margins.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

MOST = 2.0
"""Largest symmetric disk margin: S is 1 far above a sampled loop's bandwidth, so that |S - 1/2| reaches a half."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LoopMargin:
    """Of one channel, or of several under factors of their own.

    Attributes:
        name: of the channel or of the group. group: of the channel. port: "commands" or "measurements".
        channels: how many are changed at once.
        disk: a, from 0 (unstable) to 2. frequency: rad/s at which the loop is most delicate.
        delay: s of dead time in this one channel that the loop bears; inf beyond what is looked at, and of several.
    """

    name: str
    group: str
    port: str
    channels: int = 1
    disk: float
    frequency: float
    delay: float = math.inf

    @property
    def gain(self) -> tuple[float, float]:
        """Factors between which the gain may lie, with no change of phase."""
        return (2.0 - self.disk) / (2.0 + self.disk), (
            (2.0 + self.disk) / (2.0 - self.disk) if self.disk < MOST else math.inf
        )

    @property
    def phase(self) -> float:
        """Radians by which the phase may move either way, with no change of gain."""
        return 2.0 * math.atan(0.5 * self.disk)

    def plain(self) -> dict[str, Any]:
        """As plain data; null stands for none found."""
        gain = [value if math.isfinite(value) else None for value in self.gain]
        return {
            "name": self.name,
            "group": self.group,
            "port": self.port,
            "channels": self.channels,
            "disk_margin": self.disk,
            "gain": gain,
            "phase": self.phase,
            "frequency": self.frequency,
            "delay_margin": self.delay if math.isfinite(self.delay) else None,
        }


def disk_of(size: float) -> float:
    """The disk margin where |S - 1/2|, or its structured singular value, is ``size`` at its largest."""
    return min(MOST, 1.0 / size) if size > 0.0 else MOST


def delay_of(T: Complex, frequencies: Array, longest: float) -> float:
    """Least dead time, s, in one channel at which the loop reaches the edge of stability; inf beyond ``longest``.

    Args:
        T: response (frequencies,) from what is added to a channel to the channel itself.
        frequencies: rad/s, ascending.
        longest: s.
    """
    # what is fed back is T / (1 + T), of magnitude 1 where the real part of T is -1/2
    side = T.real + 0.5
    here = np.flatnonzero(side[:-1] * side[1:] < 0.0)
    share = side[here] / (side[here] - side[here + 1])
    w = frequencies[here] + share * (frequencies[here + 1] - frequencies[here])
    # at -1/2 + j y its phase is pi - 2 atan(2 y), from 0 to 2 pi
    y = T.imag[here] + share * (T.imag[here + 1] - T.imag[here])
    least = float(((math.pi - 2.0 * np.arctan(2.0 * y)) / w).min(initial=math.inf))
    return least if least <= longest else math.inf
