"""The hybrid computed torque in the paper's own Euler form, for the paper's planar
two-joint arm.

Equal to :func:`skyarm.control.laws.paper.hybrid_computed_torque` away from a pitch of
90 degrees, where Euler rates do not exist; the simulation ends an episode that comes
near with that cause. The body form has no such limit and is the default. Of the
ablations it knows those without C and without feed-forward.
"""

from __future__ import annotations

from typing import Any

from skyarm.algebra import E_Z, Quaternion, Vec3
from skyarm.algebra.quaternion import euler_angles
from skyarm.algebra.scalars import add, mul
from skyarm.control.blocks.actuators import limit_efforts
from skyarm.control.laws.paper import (
    geometric_accelerations,
    joint_accelerations,
    with_friction,
    with_weighted_rates,
)
from skyarm.control.model import Parameters
from skyarm.dynamics.actuators import Command, mix
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement
from skyarm.vehicle.vehicle_records import Vehicle
from support.euler_lagrange import parameters_of
from support.euler_lagrange.coriolis import coriolis_force
from support.euler_lagrange.mass import mass_matrix
from support.euler_lagrange.transforms import (
    body_torque,
    euler_acceleration,
    euler_rates,
    singularity_measure,
)

SINGULAR_COSINE = 1e-3
"""|cos pitch| below which Euler accelerations exceed body accelerations a thousandfold
and the form is given up."""


def require_paper_vehicle(vehicle: Vehicle) -> None:
    """Raise ValueError, naming the field, if the vehicle is not a planar two-joint arm
    at the base's centre of mass.
    """
    parameters_of(vehicle)


def distance_to_singularity(quaternion: Quaternion) -> Any:
    """|cos pitch| squared of an attitude: zero where the Euler form fails."""
    cosine = singularity_measure(euler_angles(quaternion.rotation())[1])
    return cosine * cosine


def hybrid_computed_torque_euler(
    memory: Any,
    measurement: Measurement,
    reference: Reference,
    dt: Any,
    *,
    par: Parameters,
) -> tuple[Any, Command]:
    """Computed torque in Euler coordinates: tau = M(q) qdd_des + C(q, qd) qd, gravity
    once, inside qdd_des.

    qdd_des = [-a_d; Q^-1 (alpha_d - Qdot Phid); etadd_des] with (95); tau_quad = Q^-T
    tau_Phi with (94).

    Source: Barakou et al. 2026, eq. (86)-(96).
    """
    del dt
    arm = parameters_of(par.model.vehicle)
    R, a_d, alpha = geometric_accelerations(
        par, measurement, reference, feedforward=par.terms.feedforward
    )
    angles = euler_angles(R)
    rates = euler_rates(angles, measurement.rate)
    q = (*measurement.position, *angles, *measurement.joints)
    qd = (*measurement.velocity, *rates, *measurement.joint_rates)
    wanted = joint_accelerations(par, measurement, with_weighted_rates(par, reference))
    qdd = (*(-a_d), *euler_acceleration(angles, tuple(rates), alpha), *wanted)
    inertial = _product(mass_matrix(arm, q), qdd)
    velocity = coriolis_force(arm, q, qd) if par.terms.coriolis else [0] * 8
    tau = [add(a, b) for a, b in zip(inertial, velocity, strict=True)]
    thrust = Vec3(*tau[:3]).dot(R.apply(E_Z))
    speeds, _ = mix(par.mixer, body_torque(angles, Vec3(*tau[3:6])), thrust)
    efforts = with_friction(par, measurement, reference, tau[6:])
    return memory, Command(rotor_speeds=speeds, efforts=limit_efforts(par, efforts))


def _product(M: list[list[Any]], v: tuple[Any, ...]) -> list[Any]:
    rows = []
    for row in M:
        total: Any = 0
        for entry, value in zip(row, v, strict=True):
            total = add(total, mul(entry, value))
        rows.append(total)
    return rows
