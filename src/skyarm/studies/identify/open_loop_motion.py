"""Open-loop motion of a vehicle's model next to a measured flight, set back to the measured state again and again.

The model's base moves by the recorded commands alone, as in :mod:`skyarm.studies.identify.open_loop`; an open loop
drifts, so that after each horizon the model begins anew from the measured position, attitude, velocity and rate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from skyarm.flight_data.flight_data import FlightData
from skyarm.flight_data.motion import Motion, PredictedMotion, join_motions, measured_motion
from skyarm.flight_data.quantities import GRAVITY
from skyarm.records.arrays import Array
from skyarm.records.files import one_line
from skyarm.studies.identify.held_out import SHORTEST, poses_of
from skyarm.studies.identify.identified_parts import Surroundings
from skyarm.studies.identify.logged_commands import commanded_speeds, sampling_period
from skyarm.studies.identify.motion_model import Stretch
from skyarm.studies.identify.open_loop import BaseStates, begins_of, hold, predict_ahead
from skyarm.studies.identify.stretches import stretches_of
from skyarm.vehicle.vehicle_records import Vehicle

NEEDED = ("position", "quaternion", "gyro")
"""Channels without which a model has no state to begin from."""

COMMANDS = ("rotor_commands", "rotor_speed_commands")


class OpenLoopFlight:
    """Measured flight whose motion a vehicle's model predicts over horizons of any length.

    Args:
        flight: with position, quaternion, gyro and commands of the rotors; joint positions for a vehicle with joints.
        vehicle: whose model is used.
        about: delays and offsets.
        gravity: m/s^2.
        full_voltage: V, of the rotors' data; 0 leaves the battery's voltage out.

    Raises:
        ValueError: one line: a channel is missing or does not fit the vehicle, or the vehicle is nowhere in the air.
    """

    def __init__(
        self,
        flight: FlightData,
        vehicle: Vehicle,
        about: Surroundings | None = None,
        *,
        gravity: float = GRAVITY,
        full_voltage: float = 0.0,
    ) -> None:
        _require_channels(flight, vehicle)
        self.measured = measured_motion(flight, vehicle)
        self._vehicle, self._about, self._gravity = vehicle, about or Surroundings(), gravity
        if "accelerometer" not in flight:  # stretches have it, and no open loop uses it
            rate = flight["gyro"]
            flight = flight.with_channels({"accelerometer": replace(rate, values=0.0 * rate.values)})
        # a stretch must lie where poses are measured
        posed = flight.section(float(self.measured.time[0]), float(self.measured.time[-1]))
        if empty := [
            name for name, each in posed.channels.items() if name in (*NEEDED, *COMMANDS) and not each.time.size
        ]:
            raise ValueError(f"{flight.name}: {empty[0]}: must be measured at the same time as position and quaternion")
        # commands that were logged seldom set the period of a fit, not the step of an integration
        step = SHORTEST if sampling_period(commanded_speeds(posed, vehicle)) else 0.0
        stretches = stretches_of(posed, vehicle, period=step, full_voltage=full_voltage)
        self._stretches = [(each, poses_of(flight, each)) for each in stretches]

    def over(self, horizon: float) -> PredictedMotion:
        """Motion of the model, and of held velocity and rate, set back to the measured state after each horizon, s."""
        model, held, begins = list[Motion](), list[Motion](), list[Array]()
        for stretch, poses in self._stretches:
            first = begins_of(stretch, 1, self._vehicle, self._about)[:1]
            periods = max(1, round(horizon / stretch.period))
            rows = [k for each in first for k in range(each, stretch.size, periods)]
            if not rows:
                continue
            # the last one ends with the stretch
            parts = [(rows[:-1], periods)] if rows[1:] else []
            parts.append((rows[-1:], stretch.size - rows[-1]))
            for some, count in parts:
                ahead = predict_ahead(self._vehicle, self._about, stretch, poses, some, count, self._gravity)
                still = [hold(stretch, poses, some, k * stretch.period) for k in range(count + 1)]
                model += self._motions(stretch, some, ahead)
                held += self._motions(stretch, some, still)
            begins.append(_instants(stretch, rows))
        return PredictedMotion(
            model=join_motions(model), held=join_motions(held), begins=np.concatenate([np.zeros(0), *begins])
        )

    def _motions(self, stretch: Stretch, rows: Sequence[int], states: Sequence[BaseStates]) -> list[Motion]:
        """Motion of each of several predictions from their states after 0, 1, ... periods."""
        position, quaternion = (
            np.stack([getattr(each, name) for each in states]) for name in ("position", "quaternion")
        )
        return [
            Motion(
                time=_instants(stretch, range(row, row + len(states))),
                position=position[:, i],
                quaternion=quaternion[:, i],
                joints=stretch.joints[row : row + len(states)],
            )
            for i, row in enumerate(rows)
        ]


def _instants(stretch: Stretch, rows: Sequence[int]) -> Array:
    """Times of the instants of a stretch, s, on the flight's clock."""
    return stretch.start + stretch.period * np.asarray(rows, dtype=float)


def _require_channels(flight: FlightData, vehicle: Vehicle) -> None:
    """Raise an error that lists all that a flight lacks for a prediction."""
    lacking = [name for name in (*NEEDED, *(["joint_positions"] if vehicle.n else [])) if name not in flight]
    if not any(name in flight for name in COMMANDS):
        lacking.append(" or ".join(COMMANDS))
    if lacking:
        there = ", ".join(flight) or "no channel"
        raise ValueError(one_line(f"{flight.name}: must hold {' and '.join(lacking)}; there is {there}"))
