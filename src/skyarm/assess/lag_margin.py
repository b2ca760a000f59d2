"""The lag of the motors against the attitude loop."""

from __future__ import annotations

from skyarm.assess.finding import FAULT, OK, WARNING, Finding
from skyarm.control.blocks.default_gains import RATIO_ATTITUDE, RATIO_RATE
from skyarm.vehicle.vehicle_records import Vehicle

SHARE = 0.5
"""Of the lag at which the loop begins to oscillate: above it little damping is left."""


def largest_lag() -> float:
    """Lag (s) at which the default attitude loop oscillates.

    Routh: lag s^3 + s^2 + k_w s + k_R has imaginary roots where k_R lag = k_w.
    """
    return RATIO_RATE[0] / RATIO_ATTITUDE[0]


def motor_lag(vehicle: Vehicle) -> list[Finding]:
    """Slowest time constant of a rotor against the default attitude gains (10 rad/s)."""
    if not vehicle.rotors:
        return []
    rotor, field = max(
        ((rotor, field) for rotor in vehicle.rotors for field in ("time_constant_up", "time_constant_down")),
        key=lambda each: float(getattr(*each)),
    )
    lag, most = float(getattr(rotor, field)), largest_lag()
    level = FAULT if lag >= most else WARNING if lag > SHARE * most else OK
    name = f"rotors[{rotor.name}].{field}"
    bandwidth = 0.7 / lag if lag > 0.0 else float("inf")
    text = f"{1e3 * lag:.3g} ms of lag carry an attitude loop of {bandwidth:.3g} rad/s; the default gains ask for 10"
    return [
        Finding(
            question="motor lag",
            level=level,
            text=text,
            field=name,
            value=lag,
            limit=most if level == FAULT else SHARE * most,
            unit="s",
            remedy="" if level == OK else f"faster motors, lower attitude gains, or check {name} (s, not ms)",
        )
    ]
