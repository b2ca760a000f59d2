"""The stepped computed torque ready to fly, and the ladder of its steps."""

from __future__ import annotations

from collections.abc import Mapping

from skyarm.actuation import Command
from skyarm.actuation.hover import hover_trim
from skyarm.control.blocks.common import make_parameters
from skyarm.control.blocks.disturbance_observer import ObserverGains, first_observed
from skyarm.control.blocks.extrapolation import Channel
from skyarm.control.blocks.select import data
from skyarm.control.controller import Controller
from skyarm.control.laws.ladder.law import stepped_computed_torque
from skyarm.control.laws.ladder.parameters import StepMemory, StepParameters, Steps, nothing
from skyarm.control.model import GeometricGains, JointGains, Model
from skyarm.control.options import positive, three, whole
from skyarm.scalars import minimum

UNFILTERED = 1e6
"""rad/s: the observer takes the pose as measured."""

LADDER: Mapping[str, Steps] = {
    "ct_coupled_thrust": Steps(coupled_thrust=True),
    "ct_consistent": Steps(coupled_thrust=True, consistent=True),
    "ct_observer": Steps(coupled_thrust=True, consistent=True, observer=True),
    "ct_feedforward": Steps(coupled_thrust=True, consistent=True, observer=True, feedforward=True),
    "ct_extrapolation": Steps(
        coupled_thrust=True, consistent=True, observer=True, feedforward=True, extrapolation=True
    ),
    "ct_lag_inversion": Steps(
        coupled_thrust=True, consistent=True, observer=True, feedforward=True, extrapolation=True, lag_inversion=True
    ),
}
"""Every law of the ladder has the steps of the one before it. Below them: ``hybrid_computed_torque``, and under it
``ct_level_gravity``, which is the paper's text to the letter."""


def make_stepped(
    model: Model,
    *,
    name: str,
    gains: GeometricGains | None = None,
    joint_gains: JointGains | None = None,
    mixer_policy: str = "clip",
    observer: tuple[float, float, float] = (25.0, 30.0, 40.0),
    reference_period: float = 0.02,
    lag_share: float = 1.0,
    delay_periods: int = 0,
) -> Controller:
    """A law of the ladder for any vehicle.

    Args:
        model: what it believes.
        name: a key of ``LADDER``.
        gains: of the base, as the paper's.
        joint_gains: on acceleration, 1/s^2 and 1/s.
        mixer_policy: see :class:`skyarm.actuation.Mixer`.
        observer: bandwidths of force, torque and joint torques, rad/s.
        reference_period: between published samples, s.
        lag_share: of the motors' lag that rotor commands undo, 0 to 1.
        delay_periods: known age of the measurement in control periods.
    """
    steps = LADDER[name]
    force, torque, joints = three("observer", observer)
    par = make_parameters(
        StepParameters,
        model,
        gains=gains,
        joint_gains=joint_gains,
        mixer_policy=mixer_policy,
        steps=steps,
        observer=ObserverGains(force=force, torque=torque, joints=joints, pose=UNFILTERED),
        reference_period=positive("reference_period", reference_period),
        lag_share=positive("lag_share", lag_share, zero=True),
        delay_periods=whole("delay_periods", delay_periods),
    )
    return Controller(name=name, law=stepped_computed_torque, par=par, memory=_first(model, par))


def _first(model: Model, par: StepParameters) -> StepMemory:
    """Memory before the first measurement: a level hover with the joints at zero."""
    vehicle, steps = model.vehicle, par.steps
    trim = hover_trim(vehicle, (0.0,) * vehicle.n, model.gravity)
    speeds = tuple(data(minimum(w, r.max_speed)) for w, r in zip(trim.speeds, vehicle.rotors, strict=True))
    standing = Command(rotor_speeds=speeds, efforts=tuple(data(effort) for effort in trim.efforts))
    return StepMemory(
        started=0.0,
        observed=first_observed(vehicle.n, speeds) if steps.observer else nothing(),
        sent=(standing,) * (par.delay_periods + 1) if steps.observer else (),
        free=(1.0,) * (1 + vehicle.n) if steps.observer else (),
        age=0.0,
        channels=(Channel(),) * (4 + vehicle.n) if steps.extrapolation else (),
    )
