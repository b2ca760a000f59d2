"""The clock of a governor that pauses: the law is led along the reference more slowly while it cannot follow.

The rate r of the reference's time is to be r* (:mod:`skyarm.reference.governor.pause`), and follows it with a
bounded acceleration a: a' = 4 k (clip(k (r* - r), -A, A) - a), a critically damped pair that overshoots nothing: time
never runs backwards. What the law is told are the reference's derivatives by the flight's time. The reference
itself, and errors, go on with the flight's time.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from skyarm.actuation import Command
from skyarm.records.leaves import blend
from skyarm.reference.governor.path_time import by_flight_time
from skyarm.reference.splines import uniform_curve
from skyarm.reference.tip_motion import counted_error
from skyarm.reference.trajectory import Reference
from skyarm.scalars import Scalar, clip, divide, maximum, sqrt
from skyarm.scenario.scenario_record import Scenario
from skyarm.sensors.measurement import Measurement
from skyarm.simulate.due_period import due
from skyarm.simulate.tip_and_goal import goal_of, tip_at

QUICKNESS = 5.0
"""1/s, with which the rate follows."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Pace:
    """Time of the reference, in control periods, and its derivatives by the flight's: 1, 1/s, 1/s^2."""

    place: Scalar
    rate: Scalar
    acceleration: Scalar
    jerk: Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class PaceClock:
    """The clock between two periods: the pace now, and that of the sample that is held; () where each is published."""

    now: Pace
    held: Pace | tuple[()]


class Paces:
    """A scenario's governor that pauses, over any scalar.

    Args:
        scenario: whose numbers may be traced.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._pause, self._trajectory = scenario.pause, scenario.trajectory
        self._rate = float(scenario.rates.control)
        self._ratio = scenario.rates.control // scenario.rates.reference
        self._vehicle = scenario.controller.par.model.vehicle
        path = scenario.path_time
        self._path = None if path is None else uniform_curve([float(p) for p in path.points], 0.0, float(path.step))

    def first(self) -> PaceClock:
        """The clock before the first period."""
        now = Pace(place=0.0, rate=1.0, acceleration=0.0, jerk=0.0)
        return PaceClock(now=now, held=() if self._ratio == 1 else now)

    def begun_at(self, ticks: Any) -> PaceClock:
        """The clock of a reference that takes over in a control period of the flight."""
        first = self.first()
        now = dataclasses.replace(first.now, place=ticks)
        return PaceClock(now=now, held=now if isinstance(first.held, Pace) else ())

    def held(self, clock: PaceClock, ticks: Any) -> Pace:
        """The pace of the sample that holds in a period: taken in it where it publishes one."""
        if not isinstance(clock.held, Pace):
            return clock.now
        held: Pace = blend(due(ticks, self._ratio), clock.now, clock.held)
        return held

    def path_time(self, clock: PaceClock) -> Any:
        """How far along the reference the law is led, s."""
        time = clock.now.place / self._rate
        return time if self._path is None else self._path.derivatives(time)[0]

    def told(self, clock: PaceClock, ticks: Any) -> Reference:
        """What the law is told."""
        pace = self.held(clock, ticks)
        time = pace.place / self._rate
        chain = (time, pace.rate, pace.acceleration, pace.jerk, 0)
        if self._path is None:
            return by_flight_time(self._trajectory.at(time), chain)
        s = self._path.derivatives(time)
        return by_flight_time(by_flight_time(self._trajectory.at(s[0]), s), chain)

    def following(self, clock: PaceClock, ticks: Any, measurement: Measurement, told: Any, command: Command) -> Any:
        """The clock one control period later."""
        if self._pause is None:
            raise AssertionError("a clock needs its bounds")
        tip = tip_at(self._vehicle, measurement.position, measurement.quaternion, measurement.joints)
        away = counted_error(tip - goal_of(self._vehicle, told).tool, told.push, tip)
        share: Any = 0.0
        for rotor, speed in zip(self._vehicle.rotors, command.rotor_speeds, strict=True):
            part = divide(speed, rotor.max_speed)
            share = maximum(share, part * part)
        wanted = self._pause.rate(sqrt(away.dot(away)), share)
        now, dt, most = clock.now, 1.0 / self._rate, self._pause.acceleration
        jerk = 4.0 * QUICKNESS * (clip(QUICKNESS * (wanted - now.rate), -most, most) - now.acceleration)
        acceleration = now.acceleration + jerk * dt
        rate = clip(now.rate + acceleration * dt, 0.0, 1.0)
        following = Pace(place=now.place + 0.5 * (now.rate + rate), rate=rate, acceleration=acceleration, jerk=jerk)
        return PaceClock(now=following, held=() if self._ratio == 1 else self.held(clock, ticks))
