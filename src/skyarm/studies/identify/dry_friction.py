"""Dry friction of a joint whose rate is measured with noise: mean of its tanh over what the rate may have been."""

from __future__ import annotations

import math

import numpy as np

from skyarm.records.arrays import Array

BLUR = math.sqrt(0.5 * math.pi)
"""Standard deviations of a rate by which the bend of its tanh widens: E[sign] of a normal is near that tanh."""

NODES = np.arange(-2.5, 2.6, 0.5)
SHARES = np.exp(-NODES * NODES / 1.5) / np.exp(-NODES * NODES / 1.5).sum()
"""Places of normals in deviations of the whole, and their shares: of a variance of 3/4, as each has one of 1/4."""


def mean_bend(mean: Array, spread: Array, bend: float) -> Array:
    """Mean (K,) of tanh(rate / bend) over normal rates of given means and standard deviations (K,), rad/s or m/s.

    The normal is a sum of narrow ones, half a deviation wide and apart, whose tanh is widened.
    """
    bent = np.hypot(bend, 0.5 * BLUR * spread)
    return np.asarray(sum(w * np.tanh((mean + x * spread) / bent) for x, w in zip(NODES, SHARES, strict=True)))
