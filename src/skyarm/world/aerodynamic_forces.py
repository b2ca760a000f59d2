"""Aerodynamic forces: ground effect, drag of the arm's links, inflow and translational
lift of the rotors.

None of them is in a vehicle's own records; ``[[environment.forces]]`` of a scenario
adds them with their numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from skyarm.algebra import Scalar, Scalars
from skyarm.algebra.scalars import maximum, mul, sqrt
from skyarm.dynamics.actuators.rotor import push, speed_size
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.field_rules import checked
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.vehicle import Vehicle
from skyarm.world.component import Force, NoMemory, Wrench


@immutable
@checked("ground_effect")
class GroundEffect(Force[NoMemory]):
    """Ground effect by image rotors: the thrust of each rotor increases near the ground
    plane z = 0.

    The thrust of rotor i grows by 1 / (1 - s), s = sum_j (R^2 / 2) z / (d_ij^2 + 4
    z^2)^(3/2), with d_ij the distance between hubs and z the height of rotor i. Of a
    rotor alone s = (R / 4 z)^2. Lower than ``lowest`` radii the effect is that at this
    height; the images' flow holds for rotors that are nearly level, and the lift of the
    fountain below the body is left out. The thrust is that of a whole rotor.

    Attributes:
        others: True if the images of the other rotors count.
    Source: Cheeseman, Bennett 1955 (a rotor alone); Sanchez-Cuevas, Heredia, Ollero
    2017 (several, by their images).
    """

    radius: Annotated[Scalar, positive("m", "radius of a rotor")]
    others: bool = True
    lowest: Annotated[
        Scalar,
        Unit(
            "",
            "least height above the ground, in rotor radii; the effect grows no further"
            " below",
            low=0.5,
        ),
    ] = 0.5

    def wrenches(
        self,
        memory: NoMemory,
        t: Scalar,
        motion: PointMotion,
        rotor_speeds: Sequence[Scalar],
    ) -> Sequence[Wrench]:
        """Additional upward force at each rotor due to the ground effect, as wrenches
        on the base.
        """
        wrenches = []
        rotors = motion.vehicle.rotors
        for i, (rotor, speed, left) in enumerate(
            zip(rotors, rotor_speeds, motion.rotor_shares, strict=True)
        ):
            z = maximum(motion.position(rotor.position).z, self.lowest * self.radius)
            ratio = self.radius * self.radius / (16.0 * z * z)
            for j, other in enumerate(rotors):
                # the own image is the first term already
                if self.others and j != i:
                    away = other.position - rotor.position
                    square = away.dot(away) + 4.0 * z * z
                    ratio = ratio + 0.5 * self.radius * self.radius * z / (
                        square * sqrt(square)
                    )
            extra = (
                # the growth alone: the thrust itself is a force of the rotors
                rotor.thrust_coefficient * push(rotor, speed) * (ratio / (1.0 - ratio))
            )
            force_W = motion.rotation.apply(rotor.axis * mul(left, extra))
            wrenches.append(Wrench(force_W=force_W, point=rotor.position))
        return wrenches


@immutable
@checked("link_drag")
class LinkDrag(Force[NoMemory]):
    """Quadratic aerodynamic drag of the arm's links, acting at each link's centre of
    mass.

    v is the velocity of that point against the air there. One area for every direction,
    as of a sphere: a slender link across the flow has its largest area there. Torques
    about the centre of mass are left out.

    Attributes:
        area: drag coefficient times reference area, one for each link in the vehicle's
            order.
    Source: Hoerner 1965, chapter 1 (quadratic drag).
    """

    area: Annotated[
        Scalars,
        nonnegative(
            "m^2",
            "drag coefficient times reference area of each link, in the vehicle's"
            " order",
        ),
    ]
    air_density: Annotated[Scalar, nonnegative("kg/m^3", "density of the air")] = 1.225

    def require_vehicle(self, vehicle: Vehicle, period: float, gravity: Scalar) -> None:
        """Refuse a vehicle whose number of links differs from the number of drag
        areas.
        """
        if len(self.area) != vehicle.n:
            raise ValueError(
                f"area: {len(self.area)} numbers, must be {vehicle.n}, one for each"
                " link"
            )

    def wrenches(
        self,
        memory: NoMemory,
        t: Scalar,
        motion: PointMotion,
        rotor_speeds: Sequence[Scalar],
    ) -> Sequence[Wrench]:
        """Aerodynamic drag force on every arm link, as a list of wrenches."""
        wrenches = []
        for i, (link, area) in enumerate(
            zip(motion.vehicle.links, self.area, strict=True)
        ):
            v = motion.velocity(link.body.com, i) - motion.air_velocity(
                link.body.com, i
            )
            factor = -0.5 * self.air_density * area * v.smooth_norm()
            wrenches.append(Wrench(force_W=v * factor, point=link.body.com, body=i))
        return wrenches


@immutable
@checked("rotor_drag")
class RotorDrag(Force[NoMemory]):
    """Change of each rotor's thrust with the air speed: loss in climb and gain by
    translational lift.

    v is the velocity of the hub against the air, v_n its part along the axis, v_perp
    the rest. Drag in the rotor's plane and the rolling moment are numbers of the rotor
    itself (``drag_coefficient``).

    Source: Svacha, Mohta, Kumar 2017, section II; Folk, Paulos, Kumar 2023 (RotorPy),
    eqs. 4 and 5.
    """

    inflow: Annotated[
        Scalar,
        nonnegative(
            "N s^2/(rad m)",
            "thrust lost per speed of the rotor and climb speed along its axis",
        ),
    ] = 0
    lift: Annotated[
        Scalar,
        nonnegative(
            "N s^2/m^2", "translational lift per squared air speed across the axis"
        ),
    ] = 0

    def wrenches(
        self,
        memory: NoMemory,
        t: Scalar,
        motion: PointMotion,
        rotor_speeds: Sequence[Scalar],
    ) -> Sequence[Wrench]:
        """Additional thrust force at each rotor hub, as wrenches on the base."""
        wrenches = []
        for rotor, speed, left in zip(
            motion.vehicle.rotors, rotor_speeds, motion.rotor_shares, strict=True
        ):
            v = motion.velocity(rotor.position) - motion.air_velocity(rotor.position)
            axis = motion.rotation.apply(rotor.axis)
            along = v.dot(axis)
            across = v - axis * along
            extra: Scalar = (
                self.lift * across.dot(across)
                - self.inflow * speed_size(rotor, speed) * along
            )
            # a fault takes its share of this thrust, too
            wrenches.append(
                Wrench(force_W=axis * mul(left, extra), point=rotor.position)
            )
        return wrenches
