"""Share of a rotation that rarely logged rotor commands explain, by correlation:
without it no search can succeed.

A controller that moves its motors faster than the log shows leaves samples that tell
nothing of the motion between them. The torque of the logged commands is then no cause
of what the gyroscope measures.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from skyarm.dynamics.actuators.mixer import allocation_matrix
from skyarm.flight_data.flight_data import FlightData
from skyarm.flight_data.series import columns_at, means_of, values_at
from skyarm.identify.logged_commands import (
    command_samples,
    commanded_speeds,
    sampling_period,
    thrusts_of,
)
from skyarm.records.arrays import doubles
from skyarm.vehicle import Vehicle

GRID, LATEST = 0.02, 0.16
"""Step (s) of the compared series, below the period of any commands that are slow;
longest delay and lag (s) of the rotors that is tried."""

LEAST, FEWEST = 0.15, 50
"""Least explained share of the variance of roll or pitch; number of compared instants
from which the share counts."""

LOGGING: Mapping[object, str] = {
    "PX4": (
        "set SDLOG_PROFILE to 17 (default and high rate), or 9 (default and system"
        " identification), and fly again"
    ),
    # ArduCopter writes RCOU in ten_hz_logging_loop (Copter.cpp), whatever the bits of
    # LOG_BITMASK
    "ArduPilot": (
        "RCOU is written at 10 Hz; record /mavros/rc/out at 50 Hz or more, and fly"
        " again"
    ),
    "Betaflight": "raise blackbox_sample_rate, and fly again",
}
"""Vehicle of a flight -> what makes it log its motors faster."""


def slow_commands(
    flight: FlightData, start: Vehicle, spans: Sequence[tuple[float, float]]
) -> Iterator[tuple[str, str, str]]:
    """Yield channel, finding and remedy of rotor commands that are too rare for the
    motion of a flight.

    Args:
        flight: measured.
        start: vehicle with its rotors' places.
        spans: (begin, end), s, in the air.
    """
    commands = commanded_speeds(flight, start)
    period = sampling_period(commands)
    share = explained_rotation(flight, start, spans, period) if period else 1.0
    if share < LEAST:
        finding = (
            f"at {1.0 / period:.3g} Hz explain {100.0 * share:.1g} % of roll and pitch:"
            " too rare for this flight"
        )
        yield (
            "rotor_commands",
            finding,
            LOGGING.get(flight.facts.get("vehicle"), "log them at 50 Hz or more"),
        )


def explained_rotation(
    flight: FlightData,
    start: Vehicle,
    spans: Sequence[tuple[float, float]],
    period: float,
) -> float:
    """Largest share of the variance of roll or pitch acceleration that the torques of
    the commands explain.

    Both are means over about the period (s) of the commands; the start vehicle's
    inertia and lag do not matter.
    """
    samples = command_samples(commanded_speeds(flight, start))
    gyro = flight["gyro"]
    grid = np.arange(samples.time[0], samples.time[-1], GRID)
    pushes = np.stack(thrusts_of(start, values_at(samples, grid)), axis=1)
    torques = pushes @ np.array(allocation_matrix(start), dtype=float)[:2].T
    inside = np.any(
        [(grid > begin + period) & (grid < end - period) for begin, end in spans],
        axis=0,
    )
    time = grid[
        inside & (grid > gyro.time[0] + period) & (grid < gyro.time[-1] - period)
    ]
    if time.size < FEWEST:
        # too short to judge: nothing is accused
        return 1.0
    mean = means_of(gyro.time, gyro.values[:, :2])
    # rates half a period on each side, so that their difference is the mean
    # acceleration
    turned = mean(time + 0.5 * period, time + period) - mean(
        time - period, time - 0.5 * period
    )
    # delay and lag are not known, so the best shift counts
    best = 0.0
    for late in np.arange(0.0, LATEST, 0.5 * GRID):
        both = np.hstack([turned, columns_at(time - late, grid, torques)])
        with np.errstate(invalid="ignore"):  # of a torque that is constant
            related = doubles(np.nan_to_num(np.corrcoef(both.T)))
        # a gyroscope whose axes are exchanged, or turned about z, is a fault of its
        # own, which is looked for later
        exchanged = min(abs(related[0, 3]), abs(related[1, 2]))
        behind = min(-related[0, 2], -related[1, 3])
        best = max(best, related[0, 2], related[1, 3], exchanged, behind)
    return float(best) ** 2
