"""Errors of predictions of held-out flights, by predictor and horizon."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from skyarm.records.immutable import immutable

HORIZONS = (0.01, 0.1, 0.5, 1.0)
"""Horizons (s) of the reported errors."""

SHORTEST = HORIZONS[0]
"""Shortest horizon (s); all others are its multiples and whole steps of the clock."""

CURVE = (SHORTEST, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 1.0)
"""Horizons (s) of a figure, those of the table among them."""

IDENTIFIED, PAST, START, HOLD = "identified", "with past", "start vehicle", "hold"
"""Predictors; "with past" estimates the unexplained wrench from the flight before the
prediction."""

ORDER = (IDENTIFIED, PAST, START, HOLD)
"""Order of the predictors in tables and figures."""


@immutable
class HorizonErrors:
    """Root mean square errors of a prediction over one horizon.

    Attributes:
        horizon: s. begins: number of predictions.
        position: m. velocity: m/s. attitude: rad, angle of the rotation between both.
            rate: rad/s.
    """

    horizon: float
    begins: int
    position: float
    velocity: float
    attitude: float
    rate: float


@immutable
class OneStep:
    """Root mean square errors of the mean accelerations over one accelerometer period.

    Attributes:
        specific_force: m/s^2. angular_acceleration: rad/s^2; both of the vector's
            length.
    """

    specific_force: float
    angular_acceleration: float


@immutable
class HeldOut:
    """Prediction errors in flights that were not used for the identification.

    Attributes:
        flights: names.
        period: s, of the one step: that of the accelerometer's samples, in whole steps
            of the clock.
        horizons: s.
        errors: predictor -> errors over each horizon; position, velocity and attitude
            are NaN if ``has_poses`` is not.
        one_step: predictor -> errors of accelerations; of holding, the spread of what
            is measured about its mean.
        has_poses: some flight measures position or velocity, and attitude.
        notes: notes on how poses were made, a line each.
    """

    flights: tuple[str, ...]
    period: float
    horizons: tuple[float, ...]
    errors: Mapping[str, Sequence[HorizonErrors]]
    one_step: Mapping[str, OneStep]
    has_poses: bool
    notes: tuple[str, ...]


def table_horizons(held_out: HeldOut) -> list[int]:
    """Indices of the predicted horizons that a report's table shows."""
    return [k for k, horizon in enumerate(held_out.horizons) if horizon in HORIZONS]
