"""Masses, lengths and inertias of the paper's vehicle: a quadrotor with a planar arm of
two links and a point mass.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm.algebra import Mat3, Sym3, Vec3
from skyarm.algebra.scalars import Scalar, add, divide, mul, neg, sub
from skyarm.records.coerce import concrete
from skyarm.vehicle.linkage import BASE, Body, Link
from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True, kw_only=True, slots=True)
class PlanarArmParameters:
    """Parameters of the 8x8 form: both joint axes are body +y; joint 1 at the base
    origin, the base centre of mass.

    Attributes:
        mb: base mass, kg.
        Ib: base inertia about its centre of mass, base axes, kg m^2.
        m1, m2: link masses, kg.
        me: point mass at the tip, kg.
        L1, L2: link lengths, m.
        lc1, lc2: joint to centre of mass of each link, m; the paper's formulas write
            L/2.
        I1yy, I2yy: link inertias about their centre of mass and body y, kg m^2; the
            paper has no other moment.

    Source: Barakou, Tzafestas, Valavanis 2026, Table 1 and section 2.2.
    """

    mb: Scalar
    Ib: Sym3
    m1: Scalar
    m2: Scalar
    me: Scalar
    L1: Scalar
    L2: Scalar
    lc1: Scalar
    lc2: Scalar
    I1yy: Scalar
    I2yy: Scalar

    @property
    def mass(self) -> Scalar:
        """Total mass, kg."""
        total: Scalar = add(add(add(self.mb, self.m1), self.m2), self.me)
        return total


TABLE_1 = PlanarArmParameters(
    mb=0.716,
    Ib=Sym3.from_numbers(7.0e-3, 7.0e-3, 1.2e-2),
    m1=0.04,
    m2=0.04,
    me=0.01,
    L1=0.15,
    L2=0.15,
    lc1=0.075,
    lc2=0.075,
    I1yy=7.5e-5,
    I2yy=7.5e-5,
)
"""Barakou, Tzafestas, Valavanis 2026, Table 1."""


def parameters_of(vehicle: Vehicle) -> PlanarArmParameters:
    """Read the parameters of a vehicle that is the paper's: two y joints in a row,
    links along -z, planar inertias.

    Raises:
        ValueError: names the field by which the vehicle differs.
    """
    if vehicle.n != 2:
        raise _differs(vehicle, f"{vehicle.n} joints", "2")
    if vehicle.followers:
        raise _differs(vehicle, f"{len(vehicle.followers)} followers", "none")
    first, second = vehicle.links
    _zero(vehicle, "armature", first.joint.armature, second.joint.armature)
    _zero(vehicle, "base.com", *vehicle.base.com)
    _zero(vehicle, "joint 1 position", *first.joint.position)
    _zero(
        vehicle,
        "joint 2 position.x and .y",
        second.joint.position.x,
        second.joint.position.y,
    )
    _planar(vehicle, first, BASE)
    _planar(vehicle, second, 0)
    _zero(vehicle, f"link '{first.name}' inertia.xx", first.body.inertia.xx)
    reach = (
        neg(vehicle.frame(vehicle.end_effector).position.z)
        if vehicle.end_effector
        else neg(second.body.com.z)
    )
    m2, lc2, me, I2yy = _without_tip(second.body, reach)
    return PlanarArmParameters(
        mb=vehicle.base.mass,
        Ib=vehicle.base.inertia,
        m1=first.body.mass,
        m2=m2,
        me=me,
        L1=neg(second.joint.position.z),
        L2=reach,
        lc1=neg(first.body.com.z),
        lc2=lc2,
        I1yy=first.body.inertia.yy,
        I2yy=I2yy,
    )


def _without_tip(body: Body, reach: Any) -> tuple[Any, Any, Any, Any]:
    """Mass, lever and I_yy of link 2, and the point mass at ``reach`` that was joined
    to it.

    A rod of the paper has no I_xx, so what the whole has about its centre of mass is m2
    me / (m2 + me) d^2, with d the distance of the two masses; with the whole's mass and
    lever that determines both.
    """
    mass, lever, inertia = body.mass, neg(body.com.z), body.inertia
    if concrete(inertia.xx) and inertia.xx == 0:
        return mass, lever, 0, inertia.yy
    k = mul(mass, sub(reach, lever))  # = m2 d
    m2 = divide(mul(k, k), add(inertia.xx, divide(mul(k, k), mass)))
    return m2, sub(reach, divide(k, m2)), sub(mass, m2), sub(inertia.yy, inertia.xx)


def _planar(vehicle: Vehicle, link: Link, parent: int) -> None:
    joint, inertia = link.joint, link.body.inertia
    if link.parent != parent:
        raise _differs(
            vehicle, f"parent of link '{link.name}' = {link.parent}", str(parent)
        )
    if (
        joint.kind != "revolute"
        or joint.axis != Vec3(0, 1, 0)
        or joint.rotation != Mat3.identity()
    ):
        raise _differs(
            vehicle, f"joint '{joint.name}'", "revolute about +y of the base axes"
        )
    _zero(vehicle, f"link '{link.name}' com.x and .y", link.body.com.x, link.body.com.y)
    _zero(
        vehicle,
        f"link '{link.name}' inertia.zz, .xy, .xz, .yz",
        inertia.zz,
        inertia.xy,
        inertia.xz,
        inertia.yz,
    )


def _zero(vehicle: Vehicle, field: str, *values: Any) -> None:
    if not concrete(*values) or any(value != 0 for value in values):
        raise _differs(vehicle, f"{field} = {values}", "zero")


def _differs(vehicle: Vehicle, found: str, allowed: str) -> ValueError:
    return ValueError(
        f"vehicle '{vehicle.name}' is not the paper's planar arm: {found}, allowed"
        f" {allowed}"
    )
