"""Fits of windows and flights on a clock, made up."""

from __future__ import annotations

import math

import numpy as np

from skyarm.flight_data.flight_data import Channel
from skyarm.identify.window_errors import WindowStates
from skyarm.identify.window_fit import WindowFit
from skyarm.identify.windows import Clocked
from support.flights import GRAVITY, QUAD


def fit_of(values, curvature, blocks=20, **changes):
    """Fit of so many blocks that tell the same, beside very little that was known
    before.
    """
    size = len(values)
    information = np.linalg.inv(curvature)
    empty = np.zeros((1, 1))
    parts = {
        "values": np.asarray(values, dtype=float),
        "curvature": curvature,
        "covariance": curvature,
        "prior_information": np.zeros((size, size)),
        "block_information": np.stack([information / blocks] * blocks),
        "stretch_information": information[None],
        "stretch_scores": np.zeros((1, size)),
        "noise": empty,
        "spread": np.zeros(6),
        "errors": empty,
        "counted": empty > 0,
        "states": WindowStates({}, empty),
        "settled": True,
    }
    return WindowFit(**{**parts, **changes})


STEP = 0.002
HOVER = math.sqrt(
    GRAVITY * float(QUAD.mass) / (4.0 * float(QUAD.rotors[0].thrust_coefficient))
)


def channel(time, values):
    values = np.asarray(values, dtype=float)
    return Channel(
        time=np.asarray(time, dtype=float),
        values=values.reshape(len(time), -1),
        source="a table",
    )


def clocked(
    size, usable=None, name="flight", step=STEP, channels=None, speeds=None, **more
):
    """Flight on a clock whose steps are usable but where it is said."""
    speeds = (
        channel(step * np.arange(size), np.full((size, 4), HOVER))
        if speeds is None
        else speeds
    )
    values = {
        "name": name,
        "begin": 0.0,
        "step": step,
        "size": size,
        "channels": channels or {},
        "speeds": speeds,
        "efforts": None,
        "setpoints": None,
        "voltage": np.ones(size),
        "since": step * np.arange(size),
        "usable": np.ones(size, dtype=bool) if usable is None else usable,
    }
    return Clocked(**{**values, **more})
