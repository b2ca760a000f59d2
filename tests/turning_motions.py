"""Motion along x that turns about z."""

from __future__ import annotations

import numpy as np

from skyarm.log.motion import PoseSeries


def turning(time, rate=0.8, speed=2.0):
    """Motion along x that turns about z, with quaternions of alternating sign."""
    time = np.asarray(time, dtype=float)
    zero, half = 0.0 * time, 0.5 * rate * time
    signs = np.where(np.arange(len(time)) % 2, -1.0, 1.0)[:, None]
    return PoseSeries(
        time=time,
        position=np.stack([speed * time, zero, zero], axis=1),
        quaternion=signs * np.stack([np.cos(half), zero, zero, np.sin(half)], axis=1),
        joints=time[:, None],
    )
