"""Gains at a share of their bandwidth: stiffnesses go with its square, dampings and observers with the share."""

from __future__ import annotations

import dataclasses
from typing import Any

from skyarm.control.laws.centroidal.parameters import CentroidalParameters


def at_shares(par: CentroidalParameters, rotors: Any, joints: Any) -> CentroidalParameters:
    """The constants with the rotors' loops (position, attitude, their observer) and the joints' at shares of both."""
    base, arm, tip, observer = par.base, par.joint_gains, par.tip, par.observer
    felt = par.accelerometer
    once, twice = rotors * rotors, joints * joints
    return dataclasses.replace(
        par,
        base=dataclasses.replace(
            base,
            position=base.position * once,
            velocity=base.velocity * rotors,
            attitude=base.attitude * once,
            rate=base.rate * rotors,
        ),
        joint_gains=dataclasses.replace(
            arm,
            stiffness=tuple(each * twice for each in arm.stiffness),
            damping=tuple(each * joints for each in arm.damping),
        ),
        tip=dataclasses.replace(tip, position=tip.position * twice, velocity=tip.velocity * joints),
        observer=dataclasses.replace(
            observer, force=observer.force * rotors, torque=observer.torque * rotors, joints=observer.joints * joints
        ),
        accelerometer=felt if felt is None else dataclasses.replace(felt, force=felt.force * rotors),
    )
