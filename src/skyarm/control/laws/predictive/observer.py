"""State estimate of the predictive law: extended state observer and command delay.

Velocity and disturbance come from a second-order extended state observer.

Command delay, from the measured rotor speeds: a rotor that follows its commands k
periods late turns, at every instant, as its model did k periods before. The speeds of
the model are stored for the longest delay; the delay whose speeds were nearest to the
measured ones lately is taken once it is clearly nearer than the present one. It makes
no difference whether commands are late on their way out or measurements on their way
in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np

from skyarm.algebra import Scalar, Vec3, differences
from skyarm.algebra.scalars import divide, mul
from skyarm.control.blocks.filters import double_pole
from skyarm.control.blocks.prediction import Disturbance, motor_speeds
from skyarm.control.laws.predictive.prediction import (
    StageInputs,
    advance,
    motors,
    speeds_under,
)
from skyarm.control.laws.predictive.solver import Compiled, examples
from skyarm.control.model import Model
from skyarm.dynamics import State, mass_matrix
from skyarm.dynamics.actuators import Command, limited_effort
from skyarm.records.arrays import Array, doubles
from skyarm.records.immutable import immutable, positional
from skyarm.records.leaves import leaves
from skyarm.records.units import positive
from skyarm.sensing.measurement import Measurement, blank_measurement


@immutable
class Estimate:
    """Estimated state and disturbance at the instant of the last measurement."""

    state: State
    disturbance: Disturbance


@immutable
class Bandwidths:
    """Bandwidths (rad/s) of the predictive law's observer: linear, angular and joint
    motion.
    """

    linear: Annotated[
        Scalar,
        positive(
            "rad/s",
            "bandwidth of the observer of the base's linear motion",
            effect="higher values reject forces faster and amplify noise",
        ),
    ] = 25.0
    angular: Annotated[
        Scalar,
        positive(
            "rad/s",
            "bandwidth of the observer of the base's angular motion",
            effect="higher values reject torques faster and amplify noise",
        ),
    ] = 30.0
    joints: Annotated[
        Scalar,
        positive(
            "rad/s",
            "bandwidth of the observer of the joints' motion",
            effect="higher values reject joint efforts faster and amplify noise",
        ),
    ] = 40.0


def predict(model: Model, estimate: Estimate, command: Command, dt: Scalar) -> State:
    """Predicted state after ``dt`` seconds of a held command, with motor lag."""
    state = estimate.state
    after = motor_speeds(model, state.rotor_speeds, command, dt)
    rates = tuple(
        divide(end - start, dt)
        for end, start in zip(after, state.rotor_speeds, strict=True)
    )
    given = zip(model.vehicle.links, command.efforts, strict=True)
    efforts = tuple(limited_effort(link.joint, effort) for link, effort in given)
    return advance(
        model,
        state,
        StageInputs(rotor_accelerations=rates, efforts=efforts),
        estimate.disturbance,
        dt,
    )


def observe(
    model: Model,
    bandwidths: Bandwidths,
    before: Estimate,
    command: Command,
    measurement: Measurement,
    dt: Scalar,
) -> Estimate:
    """Observer update: next estimate from the previous one, the command in between and
    a new measurement.

    The correction is that of :mod:`skyarm.control.blocks.disturbance_observer`, of
    velocities foreseen over a whole period. Pose and joints are the measured ones.

    Source: Gao 2003 (bandwidth parameterisation); discrete poles as placed here are our
    own.
    """
    foreseen = predict(model, before, command, dt)
    n = model.vehicle.n
    R = measurement.rotation
    measured = (*measurement.velocity, *measurement.rate, *measurement.joint_rates)
    expected = (*foreseen.velocity, *foreseen.rate, *foreseen.joint_rates)
    speeds = (
        *(bandwidths.linear,) * 3,
        *(bandwidths.angular,) * 3,
        *(bandwidths.joints,) * n,
    )
    shares = [double_pole(w, dt) for w in speeds]
    e = differences(measured, expected)
    v = [x + L1 * error for x, (L1, _), error in zip(expected, shares, e, strict=True)]
    push = [divide(L2 * error, dt) for (_, L2), error in zip(shares, e, strict=True)]
    M = mass_matrix(model.vehicle, R, measurement.joints)
    d = before.disturbance
    estimated = (*d.force, *d.torque, *d.efforts)
    force = [
        x + sum(mul(m, a) for m, a in zip(row, push, strict=True))
        for x, row in zip(estimated, M, strict=True)
    ]
    state = State(
        position=measurement.position,
        quaternion=measurement.quaternion,
        velocity=Vec3(*v[:3]),
        rate=Vec3(*v[3:6]),
        joints=measurement.joints,
        joint_rates=tuple(v[6:]),
        rotor_speeds=foreseen.rotor_speeds,
    )
    return Estimate(
        state=state,
        disturbance=Disturbance(
            force=Vec3(*force[:3]), torque=Vec3(*force[3:6]), efforts=tuple(force[6:])
        ),
    )


class Observation:
    """Compiled extended state observer, and prediction over the commands sent since the
    last measurement.

    Args:
        model: the controller's. bandwidths: poles of the observer. dt: control period,
            s.
    """

    def __init__(self, model: Model, bandwidths: Bandwidths, dt: float) -> None:
        state, _, disturbance, _ = examples(model.vehicle.n, len(model.vehicle.rotors))
        estimate = Estimate(state=state, disturbance=disturbance)
        command = Command(rotor_speeds=state.rotor_speeds, efforts=state.joints)
        reading = blank_measurement(model.vehicle.n, len(model.vehicle.rotors))
        self.dt = dt
        self.joints = model.vehicle.n
        self.motors = motors(model.vehicle.rotors, dt)
        self.at = Compiled(
            lambda before, command, reading: observe(
                model, bandwidths, before, command, reading, dt
            ),
            estimate,
            command,
            reading,
        )
        """Estimate at a measurement from the one a period earlier and the command that
        acted in between."""
        self._advance = Compiled(
            lambda before, command: predict(model, before, command, dt),
            estimate,
            command,
        )

    def now(self, estimate: Array, commands: Sequence[Array]) -> Array:
        """Vehicle state and disturbance predicted over the commands sent since the last
        measurement.
        """
        for command in commands:
            state = self._advance(estimate, command)
            estimate = np.concatenate([state, estimate[len(state) :]])
        return estimate

    def first(self, measurement: Measurement) -> ObserverState:
        """Initial observer state: the measured vehicle state, no disturbance, no
        command delay.
        """
        m = measurement
        moving = (
            *m.position,
            *m.quaternion,
            *m.velocity,
            *m.rate,
            *m.joints,
            *m.joint_rates,
            *m.rotor_speeds,
        )
        estimate = doubles([*moving, *(0.0,) * (6 + self.joints)])
        return ObserverState(estimate, first_lateness(doubles(m.rotor_speeds)))

    def update(
        self, past: ObserverState, sent: Command, measurement: Measurement
    ) -> ObserverState:
        """Observer state after a new measurement, where ``sent`` is the command of the
        preceding period.
        """
        reading = doubles(leaves(replace(measurement, **NOT_READ)))
        shown = (*past.shown, sent)[-1 - LONGEST :]
        modelled = speeds_under(
            self.motors, past.late.modelled[0], np.array(sent.rotor_speeds)
        )
        late = update_lateness(
            past.late,
            modelled,
            doubles(measurement.rotor_speeds),
            self.dt,
        )
        # early in a flight fewer commands than the delay are known: the oldest acts
        acted = command_row(shown[max(len(shown) - 1 - late.periods, 0)])
        # of the quaternion's two signs the one that is nearer to the last
        if reading[4:8] @ past.estimate[3:7] < 0.0:
            reading[4:8] *= -1.0
        return ObserverState(self.at(past.estimate, acted, reading), late, shown)


def command_row(command: Command) -> Array:
    """Rotor speeds and joint efforts of a command as one array."""
    return doubles([*command.rotor_speeds, *command.efforts])


@positional
class ObserverState:
    """Observer state: last estimate, statistics of the command delay, and recent
    commands.

    Attributes:
        estimate: leaves of an :class:`Estimate` at the last measurement. late:
            statistics of the command delay.
        shown: last commands before that measurement, oldest first, if commands act at
            once.
    """

    estimate: Array
    late: Lateness
    shown: tuple[Command, ...] = ()


NOT_READ: dict[str, Any] = {"tilts": (), "tip_force": (), "switches": (), "holds": ()}
"""Channels of a measurement that only some vehicles have and that the observer does not
use."""

LONGEST = 12
"""Longest command delay (control periods) that is considered; chosen, 60 ms at 200
Hz."""

MEMORY = 0.5
"""Time constant (s) over which past differences of rotor speeds are averaged;
chosen."""

LEAST = 10
"""Number of measurements before the command delay is estimated; chosen:
rotors must have changed their speeds first."""

CLEAR = 0.25
"""Ratio of mean squared differences below which another command delay replaces the
estimated one; chosen: half of the difference, so that noise does not decide."""

NOTICED = 0.5
"""Root mean square difference of rotor speeds (rad/s) below which the estimated command
delay is not changed; chosen, a thousandth of a small rotor's speed in hover."""


@positional
class Lateness:
    """Statistics of the command delay: modelled rotor speeds and their differences from
    the measured ones.

    Attributes:
        modelled: (LONGEST + 1, rotors) speeds of rotors that obey at once, rad/s; row k
            is of k periods ago.
        squares: (LONGEST + 1,) forgotten sums of squared differences from the measured
            speeds, one a delay.
        weight: the same sum of ones. count: measurements. periods: estimated delay.
    """

    modelled: Array
    squares: Array
    weight: float = 0.0
    count: int = 0
    periods: int = 0


def first_lateness(speeds: Array) -> Lateness:
    """Initial state of the estimator of the command delay: no evidence yet, and a delay
    of zero.
    """
    return Lateness(np.tile(speeds, (LONGEST + 1, 1)), np.zeros(LONGEST + 1))


def update_lateness(
    before: Lateness, modelled: Array, measured: Array, dt: float
) -> Lateness:
    """Statistics and estimate of the command delay after one measurement.

    Args:
        before: one period earlier.
        modelled: (rotors,) speeds now of rotors that obeyed the commands so far at
            once.
        measured: (rotors,) speeds.
        dt: s.
    """
    # one row for each delay that is compared, the newest first
    rows = np.vstack([modelled, before.modelled[:-1]])
    decay = np.exp(-dt / MEMORY)
    squares = decay * before.squares + np.mean((rows - measured) ** 2, axis=1)
    late = Lateness(
        rows, squares, decay * before.weight + 1.0, before.count + 1, before.periods
    )
    now = squares[late.periods]
    best = int(np.argmin(squares))
    if (
        late.count < LEAST
        # negated, so that a speed that is no number changes nothing
        or not now > NOTICED**2 * late.weight
        or not squares[best] < CLEAR * now
    ):
        return late
    return replace(late, periods=best)
