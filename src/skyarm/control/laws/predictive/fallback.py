"""Fallback of predictive control: acceptance test of a plan, waiting time, and
substitute law.

A plan is trusted if all its numbers are finite and it costs at most :func:`worst_cost`,
which no flight that goes well reaches. The first one that is not hands over to the
paper's computed torque law, which needs no plan, no iterations and no memory; it is
given the observer's disturbance and leans 35 degrees at most. Plans go on being made
meanwhile; after enough good ones in a row, and a rest that doubles with each hand-over
that follows soon, they are flown again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from skyarm.algebra import Motion, Scalar, Vec3, differences
from skyarm.algebra.scalars import atan2, cos, divide, maximum, minimum, mul, sin, sqrt
from skyarm.control.blocks.common import (
    make_command,
    turn_towards,
    wanted_specific_force,
)
from skyarm.control.blocks.geometric import yaw_of
from skyarm.control.blocks.prediction import Disturbance, no_disturbance
from skyarm.control.laws.paper import (
    generalized_force,
    joint_accelerations,
    make_hybrid_computed_torque,
)
from skyarm.control.laws.predictive.cost import Weights
from skyarm.control.laws.predictive.preview import SampledReference
from skyarm.control.laws.predictive.solver import Compiled, MotionPlan
from skyarm.control.model import Model, Parameters
from skyarm.dynamics.actuators import AllocationError, Command
from skyarm.records.arrays import Array
from skyarm.records.immutable import positional
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement, blank_measurement

WORST = {"position": 0.15, "velocity": 1.5, "tool": 0.15, "joints": 1.0}
"""Errors of a flight (m, m/s, m, and rad or m) that are acceptable for a moment;
chosen."""

TIMES = 10.0
"""Largest cost of an acceptable plan, over that of the errors :data:`WORST`. Plans that
lead nowhere cost 1e5 and more."""

GOOD = 10
"""Number of acceptable plans in a row before plans are flown again; chosen: a
tenth of a second with a plan in each second period of 5 ms."""

REST = (0.3, 5.0)
"""Least time (s) under the substitute law, computed torque, at first and after many
hand-overs; chosen. It doubles, so that a law that fails again and again flies less."""

FLOOR = 0.4
"""Smallest vertical force of the substitute law over the vehicle's weight; chosen."""

LEAN = 0.7
"""Tangent of the largest tilt of the substitute law: 35 degrees, at which a hover takes
1.22 times its thrust. One that leans further may not climb as well."""

TURN = 0.5
"""Largest heading error (rad) of the substitute law; a larger one is clipped.
Chosen."""

SMALL = 1e-9
"""Horizontal specific force (m/s^2) below which its direction is undefined."""

FORGIVEN = 3.0
"""Time (s) of flight by plans after which a further hand-over counts as the first;
chosen."""


@positional
class Trust:
    """Acceptance history of motion plans, which decides whether plans or the substitute
    law control the vehicle.

    Attributes:
        good: plans to be trusted in a row. resting: s for which the plans are not flown
            yet; 0 while they are.
        rest: s of the last rest. calm: s of flight by plans since then.
    """

    good: int = 0
    resting: float = 0.0
    rest: float = 0.0
    calm: float = 0.0

    @property
    def flies_plans(self) -> bool:
        """True while the plans control the vehicle, False while the substitute law
        does.
        """
        return self.resting <= 0.0


def worst_cost(weights: Weights, mode: str, joints: int, horizon: float) -> float:
    """Largest cost of an acceptable plan: :data:`TIMES` the cost of constant errors
    :data:`WORST`.
    """
    names = ["position", "velocity"] + ["joints"] * joints
    if mode != "joints":
        names.append("tool")
    errors = [float(getattr(weights, name)) * WORST[name] for name in names]
    # stages count by their time, the last one by its weight
    return (
        TIMES
        * (horizon + float(weights.final))
        * sum(error * error for error in errors)
    )


def is_flyable(plan: MotionPlan, most: float) -> bool:
    """Return True if a plan may be flown: finite, with a cost of at most ``most``."""
    # a comparison with NaN is false: a plan without a cost is none
    return bool(
        plan.cost <= most and np.isfinite(plan.u).all() and np.isfinite(plan.K).all()
    )


def after_plan(trust: Trust, good: bool) -> Trust:
    """Acceptance history (:class:`Trust`) updated by a new plan."""
    if good:
        count = trust.good + 1
        resting = 0.0 if trust.resting <= SPENT and count >= GOOD else trust.resting
        return replace(trust, good=count, resting=resting)
    # a bad plan while the substitute flies starts the count anew, not the rest
    if not trust.flies_plans:
        return replace(trust, good=0, calm=0.0)
    least, most = REST
    forgiven = trust.calm > FORGIVEN or not trust.rest
    rest = least if forgiven else min(2.0 * trust.rest, most)
    return Trust(0, rest, rest, 0.0)


def after_period(trust: Trust, dt: float) -> Trust:
    """Acceptance history (:class:`Trust`) after ``dt`` seconds."""
    if trust.flies_plans:
        # before the first hand-over no time of calm flight is asked for
        return replace(trust, calm=trust.calm + dt) if trust.rest else trust
    # what is left stays above zero until the plans are good
    return replace(trust, resting=max(trust.resting - dt, SPENT), calm=0.0)


SPENT = 1e-9
"""Remaining waiting time (s) that counts as over, while acceptable plans are
awaited."""


class Stabiliser:
    """Compiled substitute law: computed torque of Barakou et al. 2026 with RotorS's
    gains scaled to the model.

    Args:
        model: the controller's model.
    """

    def __init__(self, model: Model) -> None:
        joints = model.vehicle.n
        self.law = Compiled(
            partial(_computed_torque, _parameters(model)),
            blank_measurement(joints, len(model.vehicle.rotors)),
            no_disturbance(joints),
            ((0.0,) * (4 + joints),) * 3,
        )

    def command(
        self, reading: Array, disturbance: Array, sample: SampledReference
    ) -> Command:
        """Command of the law that flies while model predictive control has no good
        plan.
        """
        return self.law.record(reading, disturbance, *sample.motion)


def _computed_torque(
    par: Parameters,
    reading: Measurement,
    unknown: Disturbance,
    signals: Sequence[Sequence[Scalar]],
) -> Command:
    """Command of computed torque with limited tilt and compensated disturbance."""
    model, (values, rates, accelerations) = par.model, signals
    vehicle = model.vehicle
    R = reading.rotation
    pushed = unknown.force * divide(1.0, vehicle.mass)
    # the attitude error is the sine of the turn: a nose that points backwards would
    # take the torque from the tilt, so it turns by no more at once, the shorter way
    heading = yaw_of(reading.quaternion)
    off = values[3] - heading
    off = atan2(sin(off), cos(off))
    goal = Reference(
        position=Vec3(*values[:3]),
        velocity=Vec3(*rates[:3]),
        acceleration=Vec3(*accelerations[:3]) - pushed,
        yaw=heading + maximum(-TURN, minimum(off, TURN)),
        yaw_rate=rates[3],
        joints=tuple(values[4:]),
        joint_rates=tuple(rates[4:]),
        joint_accelerations=tuple(accelerations[4:]),
    )
    up = _climbable(wanted_specific_force(par, reading, goal), model.gravity)
    # the rotors push along up, and base and arm move by what rotors and disturbance
    # give together
    base = Motion(
        turn_towards(par, reading, goal, R, up),
        R.apply_T(up + pushed),
    )
    force, torques = generalized_force(
        par, R, reading, base, joint_accelerations(par, reading, goal)
    )
    return make_command(
        par,
        force.torque - unknown.torque,
        (force.force - R.apply_T(unknown.force)).z,
        differences(torques, unknown.efforts),
    )


def _climbable(force: Vec3, gravity: Scalar) -> Vec3:
    """Specific force (m/s^2, world axes) with limited tilt and a minimum upward part.

    Rotors that carry nothing have no torque to give, and a thrust that lies down does
    not come up again.
    """
    up = maximum(force.z, mul(FLOOR, gravity))
    across = sqrt(force.x * force.x + force.y * force.y)
    share = minimum(1.0, divide(mul(LEAN, up), maximum(across, SMALL)))
    return Vec3(force.x * share, force.y * share, up)


def _parameters(model: Model) -> Parameters:
    """Constants of the substitute law: RotorS's gains scaled to the model, torque
    before thrust if possible.
    """
    try:
        made = make_hybrid_computed_torque(model, mixer_policy="priority")
    except AllocationError:
        made = make_hybrid_computed_torque(model)
    par: Parameters = made.par
    return par
