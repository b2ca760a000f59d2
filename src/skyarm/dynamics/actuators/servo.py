"""Joint servos: geared DC motors with a position or rate loop, as in hobby and robot
servos.

The proportional and derivative parts act at every stage of the integrator: a servo's
own loop runs at 1 kHz and faster, which is as good as continuous beside a control
period. What has a memory (the integral, the goal that its speed limit moves, setpoints
on their way, the encoder's rounding) is stepped once per control period.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Annotated, ClassVar

from skyarm.algebra import Scalar, Scalars
from skyarm.algebra.scalars import (
    add,
    clip,
    divide,
    floor,
    logical_and,
    maximum,
    minimum,
    mul,
    sub,
    where,
)
from skyarm.dynamics.actuators.drive import Drive
from skyarm.records.coerce import RecordError, concrete
from skyarm.records.field_rules import accept_fields
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit, nonnegative, positive


@immutable
class ServoMemory:
    """Internal state of a servo between control periods: loop setpoint, integral,
    encoder rounding, delayed setpoints.

    Attributes:
        goal: the setpoint that its loop holds, rad or m, or their rates.
        integral: integral of the loop's error, rad s or rad.
        rounding: rounding error of the encoder's last reading, rad or m.
        waiting: setpoints on their way, oldest first.
    """

    goal: Annotated[Scalar, Unit("rad or m, or per s", "goal of the servo's loop")]
    integral: Annotated[Scalar, Unit("rad s or rad", "integral of the loop's error")]
    rounding: Annotated[
        Scalar, Unit("rad or m", "rounding error of the position when it was read")
    ]
    waiting: Annotated[
        Scalars, Unit("rad or m, or per s", "setpoints in transit, oldest first")
    ]


NEEDS = {
    "voltage": ("torque_constant", "resistance"),
    "current_limit": ("torque_constant",),
}
"""Motor constants that turn a limit of voltage or current into one of torque."""


@immutable
class Servo(Drive):
    """Base class of joint servos: geared DC motors with a position or rate control
    loop.

    Motor and supply bound the torque. The current is at most ``current_limit``, and
    what the supply drives through the winding against the motor's counter-voltage:
    between (-U - k_e qd) / R and (U - k_e qd) / R with k_e = gear ``torque_constant``.
    That is the line of a data sheet from the stall torque gear ``torque_constant``
    ``efficiency`` U / R at rest to zero at the no-load speed U / k_e. Source: Spong,
    Hutchinson, Vidyasagar 2006, section 6.1.

    The gains are torque per error of the joint. A loop on voltage has them too: a gain
    of V/rad times the stall torque over U is one of N m/rad, and its motor's
    counter-voltage adds stall torque / no-load speed to the damping.

    Attributes:
        inertia: the least that the joint moves about its axis with its armature, kg m^2
            (or kg): with the gains it says how long a step of the integrator may be.
    """

    inertia: Annotated[
        Scalar,
        positive(
            "kg m^2 or kg",
            "least inertia that the joint moves about its axis, armature included",
        ),
    ]
    integral: Annotated[
        Scalar,
        nonnegative(
            "N m/(rad s) or N m/rad",
            "torque per integral of the loop's error",
            effect="higher values remove a steady error sooner and overshoot more",
        ),
    ] = 0.0
    gear: Annotated[
        Scalar, positive("", "gear ratio: turns of the motor per turn of the joint")
    ] = 1.0
    efficiency: Annotated[
        Scalar,
        nonnegative(
            "",
            "efficiency of the gear: stall torque / (stall current * gear *"
            " torque_constant)",
            high=1.0,
            effect="lower values leave less torque at the joint",
        ),
    ] = 1.0
    torque_constant: Annotated[
        Scalar,
        positive(
            "N m/A",
            "torque constant of the motor: voltage / (no-load speed * gear)",
        ),
    ] = 1.0
    resistance: Annotated[
        Scalar,
        positive(
            "ohm",
            "resistance of the motor's winding: voltage / stall current",
            effect="higher values lower the stall torque",
        ),
    ] = 1.0
    voltage: Annotated[
        Scalar,
        nonnegative(
            "V",
            "voltage of the servo's supply",
            infinite=True,
            usual=1000.0,
            effect="lower values lower stall torque and no-load speed",
        ),
    ] = math.inf
    current_limit: Annotated[
        Scalar,
        nonnegative(
            "A",
            "largest current of the motor",
            infinite=True,
            effect="lower values limit the torque at low speed",
        ),
    ] = math.inf
    torque_limit: Annotated[
        Scalar, nonnegative("N m or N", "largest effort at the joint", infinite=True)
    ] = math.inf
    speed_limit: Annotated[
        Scalar,
        nonnegative(
            "rad/s or m/s",
            "largest rate of the servo's goal",
            infinite=True,
            effect="lower values make the joint lag behind fast setpoints",
        ),
    ] = math.inf
    latency: Annotated[
        Scalar,
        nonnegative(
            "s",
            "dead time before a setpoint takes effect; the same in all episodes",
            effect="longer dead times delay the joint and destabilize loops around it",
        ),
    ] = 0.0

    def __post_init__(self) -> None:
        accept_fields(self, "")
        # 0 passes the rule of the field, but would leave no torque at all
        if concrete(self.efficiency) and not self.efficiency > 0.0:
            raise RecordError(
                f"efficiency = {self.efficiency!r}: must be above 0 and at most 1"
            )

    @classmethod
    def require_stated(cls, stated: Collection[str]) -> None:
        """Refuse a voltage or current limit without the motor constants that turn it
        into a torque limit.
        """
        for given, needed in NEEDS.items():
            for name in needed:
                if given in stated and name not in stated:
                    raise ValueError(
                        f"{name}: must be stated beside {given}, which bounds the"
                        " torque by it"
                    )

    def bounds(self, rate: Scalar) -> tuple[Scalar, Scalar]:
        """Least and largest torque (N m) or force (N) that motor and supply can give at
        a joint rate.
        """
        per_volt = mul(self.gear, self.torque_constant)
        # the counter-voltage constant equals the torque constant in SI units
        counter = mul(per_volt, rate)
        per_ampere = mul(per_volt, self.efficiency)
        low = maximum(
            divide(sub(-self.voltage, counter), self.resistance), -self.current_limit
        )
        high = minimum(
            divide(sub(self.voltage, counter), self.resistance), self.current_limit
        )
        # beyond the no-load speed the winding brakes, with no more than the current
        # limit either
        low = minimum(low, self.current_limit)
        high = maximum(high, -self.current_limit)
        # the torque limit is one at the joint, so after gear and losses
        most = self.torque_limit
        return clip(mul(low, per_ampere), -most, most), clip(
            mul(high, per_ampere), -most, most
        )

    @property
    def no_load_speed(self) -> float:
        """Joint speed (rad/s or m/s) at which the motor's back-EMF equals the supply
        voltage; may be infinite.
        """
        return float(self.voltage) / (float(self.gear) * float(self.torque_constant))

    def largest_effort(self) -> Scalar:
        """Torque (N m) or force (N) of the stalled motor, within the limits of current
        and torque.
        """
        # at rest there is no counter-voltage: the stall torque
        return self.bounds(0.0)[1]

    def start(self, position: Scalar) -> ServoMemory:
        """Raise an error: the initial state of a servo requires a setpoint and a
        control period.
        """
        raise RecordError(
            f"{type(self).__name__}: begins with a setpoint and a control period"
        )

    def why_short_steps(self) -> str:
        """Text with the motor and loop constants that require short integration
        steps.
        """
        names = [
            name
            for name in ("stiffness", "gain", "damping")
            if getattr(self, name, 0.0)
        ]
        if math.isfinite(self.voltage):
            names += ["gear", "torque_constant", "resistance"]
        return ", ".join(
            f"{name} = {float(getattr(self, name)):g}" for name in (*names, "inertia")
        )

    def _half_time(self, D: float, K: float) -> float:
        """Half the fastest time constant (s) of the joint under the servo's loop and of
        the motor.

        RK4 then errs by (1/2)^5 / 120 of the motion in a step at most.
        """
        J = float(self.inertia)
        split = D * D - 4.0 * K * float(self.inertia)
        # complex poles have the magnitude sqrt(K / J); of two real ones the faster
        loop = math.sqrt(K / J) if split < 0.0 else (D + math.sqrt(split)) / (2.0 * J)
        per_ampere = float(self.gear) * float(self.torque_constant)
        # the bounds fall by k_e^2 efficiency / R per speed, which damps as a viscous
        # loss
        motor = per_ampere**2 * float(self.efficiency) / (float(self.resistance) * J)
        # an infinite supply never bounds, so its motor adds no damping
        return 0.5 / max(loop, motor if math.isfinite(self.voltage) else 0.0)

    def steady_memory(
        self, memory: ServoMemory, position: Scalar, setpoint: Scalar
    ) -> ServoMemory:
        """Steady state of a servo for a constant setpoint."""
        waiting = (setpoint,) * len(memory.waiting)
        # no load is known: an integral would stand for one
        return ServoMemory(
            goal=self._loop_setpoint(setpoint),
            integral=0.0,
            rounding=0.0,
            waiting=waiting,
        )

    def begin(self, position: Scalar, setpoint: Scalar, dt: float) -> ServoMemory:
        """Initial state of a servo: steady at a setpoint, with a queue of delayed
        setpoints.
        """
        if not concrete(self.latency):
            raise RecordError(
                "latency: must be the same in all episodes: it says how many setpoints"
                " are on their way"
            )
        # 0.07 / 0.01 is seven up to rounding
        count = math.ceil(self.latency / dt - 1e-9)
        empty = ServoMemory(
            goal=0.0, integral=0.0, rounding=0.0, waiting=(0.0,) * count
        )
        return self.steady_memory(empty, position, setpoint)

    def advance(
        self,
        memory: ServoMemory,
        setpoint: Scalar,
        position: Scalar,
        rate: Scalar,
        dt: float,
    ) -> ServoMemory:
        """State of a servo one control period later: delayed setpoints, loop setpoint,
        rounding, integral.
        """
        received, waiting = self._arriving_setpoint(memory, setpoint, dt)
        goal = self._next_goal(memory.goal, received, dt)
        rounding = self._rounding(position)
        # torque before this period's error is added: it tells whether a limit is
        # reached
        error, demanded = self._loop(goal, memory.integral, position + rounding, rate)
        integral = self._integrate(memory, error, demanded, rate, dt)
        return ServoMemory(
            goal=goal, integral=integral, rounding=rounding, waiting=waiting
        )

    def effort(
        self, memory: ServoMemory, setpoint: Scalar, position: Scalar, rate: Scalar
    ) -> Scalar:
        """Torque (N m) or force (N) of the servo's loop, clipped to the bounds of motor
        and supply.
        """
        low, high = self.bounds(rate)
        return clip(
            self._loop(memory.goal, memory.integral, position + memory.rounding, rate)[
                1
            ],
            low,
            high,
        )

    def _loop_setpoint(self, setpoint: Scalar) -> Scalar:
        """Setpoint of the servo's control loop after its quantisation, if any."""
        return setpoint

    def _next_goal(self, goal: Scalar, received: Scalar, dt: float) -> Scalar:
        """Setpoint that the servo's loop tracks after a control period in which
        ``received`` arrived.
        """
        raise NotImplementedError(f"{type(self).__name__} must define _next_goal()")

    def _rounding(self, position: Scalar) -> Scalar:
        """Rounding error of the encoder at a joint position."""
        return 0.0

    def _loop(
        self, goal: Scalar, integral: Scalar, position: Scalar, rate: Scalar
    ) -> tuple[Scalar, Scalar]:
        """Control error of the servo's loop, and its torque before the limits."""
        raise NotImplementedError(f"{type(self).__name__} must define _loop()")

    def _arriving_setpoint(
        self, memory: ServoMemory, setpoint: Scalar, dt: float
    ) -> tuple[Scalar, Scalars]:
        """Mean of the delayed setpoints that arrive in a control period, and the queue
        of later ones.
        """
        count = len(memory.waiting)
        if count == 0:
            return setpoint, ()
        seen = (*memory.waiting, setpoint)
        # the older of the two between which the latency lies, and its share of the
        # period
        older = seen[0]
        newer = seen[1]
        share = clip(self.latency / dt - (count - 1), 0.0, 1.0)
        return newer + (older - newer) * share, seen[1:]

    def _integrate(
        self,
        memory: ServoMemory,
        error: Scalar,
        demanded: Scalar,
        rate: Scalar,
        dt: float,
    ) -> Scalar:
        """Integral of the control error after a period, which stops growing at a torque
        limit (anti-windup).

        Source: conditional integration; Astrom, Hagglund 2006, section 3.5.
        """
        low, high = self.bounds(rate)
        moved = memory.integral + error * dt
        pushing_up = logical_and(demanded > high, error > 0.0)
        pushing_down = logical_and(demanded < low, error < 0.0)
        return where(
            pushing_up, memory.integral, where(pushing_down, memory.integral, moved)
        )


@immutable
class PositionServo(Servo):
    """Position servo, whose setpoint is an angle (rad) or a length (m).

    torque = stiffness (goal - q) - damping qd + integral times the integral of (goal -
    q). The derivative is of the measured position, so that a step of the setpoint gives
    no kick. The goal follows the setpoint no faster than ``speed_limit``. Goal and
    position are given in multiples of ``resolution``; the position's rounding is that
    of its reading at the beginning of a control period.
    """

    takes: ClassVar[str] = "rad or m"

    stiffness: Annotated[
        Scalar,
        positive(
            "N m/rad or N/m",
            "torque per position error of the joint",
            effect=(
                "higher values hold the joint more tightly and oscillate sooner with"
                " latency"
            ),
        ),
    ]
    damping: Annotated[
        Scalar,
        nonnegative(
            "N m s/rad or N s/m",
            "torque per measured rate of the joint",
            effect="higher values damp the joint more and make it slower",
        ),
    ] = 0.0
    resolution: Annotated[
        Scalar,
        nonnegative(
            "rad or m",
            "step to which goal and measured position are rounded; 0 disables rounding",
            effect="coarser steps make the joint chatter within one step",
        ),
    ] = 0

    def __post_init__(self) -> None:
        # a subclass of slots is made anew: super() without its class would look at the
        # first
        Servo.__post_init__(self)
        if concrete(self.resolution) and self.resolution == 0.0:
            object.__setattr__(self, "resolution", 0)

    @property
    def largest_step(self) -> float | None:  # type: ignore[override]
        """Largest integration step, s: half the fastest time constant of loop and
        motor.
        """
        return self._half_time(float(self.damping), float(self.stiffness))

    def _loop_setpoint(self, setpoint: Scalar) -> Scalar:
        return self._quantize(setpoint)

    def _next_goal(self, goal: Scalar, received: Scalar, dt: float) -> Scalar:
        step = mul(self.speed_limit, dt)
        return goal + clip(self._quantize(received) - goal, -step, step)

    def _rounding(self, position: Scalar) -> Scalar:
        return self._quantize(position) - position

    def standing(self, effort: Scalar, position: Scalar) -> Scalar:
        """Setpoint that holds the joint under a torque: joint position plus the loop's
        spring deflection.
        """
        return position + divide(effort, self.stiffness)

    def setpoint(
        self,
        memory: ServoMemory,
        effort: Scalar,
        position: Scalar,
        rate: Scalar,
        dt: float,
    ) -> Scalar:
        """Setpoint by which the position loop gives a desired torque or force."""
        # advance adds the error of this period before the effort is taken
        per_error = add(self.stiffness, mul(self.integral, dt))
        return position + divide(
            effort + self.damping * rate - self.integral * memory.integral, per_error
        )

    def _loop(
        self, goal: Scalar, integral: Scalar, position: Scalar, rate: Scalar
    ) -> tuple[Scalar, Scalar]:
        error = goal - position
        return (
            error,
            self.stiffness * error - self.damping * rate + self.integral * integral,
        )

    def _quantize(self, value: Scalar) -> Scalar:
        # an int 0 is structure: no rounding is in the program
        if type(self.resolution) is int:
            return value
        # rounded to the nearest step: floor alone would bias by half a step
        return self.resolution * floor(value / self.resolution + 0.5)


@immutable
class VelocityServo(Servo):
    """Velocity servo, whose setpoint is the joint's rate (rad/s or m/s).

    torque = gain (goal - qd) + integral times the integral of (goal - qd). The goal is
    the setpoint within ``speed_limit``.
    """

    takes: ClassVar[str] = "rad/s or m/s"

    gain: Annotated[
        Scalar,
        positive(
            "N m s/rad or N s/m",
            "torque per rate error of the joint",
            effect=(
                "higher values hold the commanded rate more tightly and oscillate"
                " sooner with latency"
            ),
        ),
    ]

    @property
    def largest_step(self) -> float | None:  # type: ignore[override]
        """Largest integration step, s: half the fastest time constant of loop and
        motor.
        """
        return self._half_time(float(self.gain), 0.0)

    def _next_goal(self, goal: Scalar, received: Scalar, dt: float) -> Scalar:
        return clip(received, -self.speed_limit, self.speed_limit)

    def standing(self, effort: Scalar, position: Scalar) -> Scalar:
        """Rate setpoint by which the servo holds a motionless joint."""
        return divide(effort, self.gain)

    def setpoint(
        self,
        memory: ServoMemory,
        effort: Scalar,
        position: Scalar,
        rate: Scalar,
        dt: float,
    ) -> Scalar:
        """Setpoint by which the velocity loop gives a desired torque or force."""
        # the integral grows by this error, too, before the effort acts
        return rate + divide(
            effort - self.integral * memory.integral,
            add(self.gain, mul(self.integral, dt)),
        )

    def _loop(
        self, goal: Scalar, integral: Scalar, position: Scalar, rate: Scalar
    ) -> tuple[Scalar, Scalar]:
        error = goal - rate
        return error, add(mul(self.gain, error), mul(self.integral, integral))
