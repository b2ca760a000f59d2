"""Contact material: normal force by stiffness and dissipation, friction by bristles.

With the penetration d (m), the slip v (m/s) along the surface and the bristle's
deflection z (m) the force is

* along the normal f = max(k d (1 + c dd/dt), 0),
* along the surface, against the slip, mu f z / z_s + s v_z, at most mu f, where v_z =
  dz/dt = v - z |v| / z_s and s = min(``BRISTLE_DAMPING``, ``BRISTLE_DAMPING`` f).

The bristle is the memory of friction: it bends up to its length z_s and then slides, so
that a body at rest stays at rest below the cone, which a friction of the velocity alone
does not do: that creeps. Without contact it stands up.

A step of an integrator that enters or leaves a surface sees the bend of the force at
d = 0 at a few instants only, and would win or lose energy by chance. So d is its mean
over the way |dd/dt| h that the point makes in a step h: within half of that way from
the surface a parabola stands in place of the bend, elsewhere nothing changes.

Source: Hunt, Crossley 1975 (normal force); Dahl 1968 and Canudas de Wit, Olsson,
Astrom, Lischinsky 1995 (bristle).
"""

from __future__ import annotations

from typing import Annotated

from skyarm.algebra import Scalar, Vec3
from skyarm.algebra.scalars import (
    absolute,
    divide,
    exp,
    maximum,
    minimum,
    sqrt,
    where,
)
from skyarm.algebra.vector import select
from skyarm.records.field_rules import checked
from skyarm.records.immutable import immutable
from skyarm.records.units import nonnegative, positive

BRISTLE_DAMPING = 5.0
"""Damping of a friction bristle, N s/m at one newton and more, 1/m times the force
below; it damps the vibration of a sticking tip."""

RECOVERY = 500.0
"""Decay rate (1/s) of a bristle's deflection without contact: 1 % is left after 9 ms,
and in the longest step it is 1.25 of the 2.78 to which Runge-Kutta is stable."""

LIGHTEST = 0.02
"""Least effective mass (kg) of a contact, by which steps are chosen. The tips of the
shipped arms weigh at least 23 g across a surface (1 / diag(J M^-1 J^T) in pressing
postures)."""

NORMAL_STEP = 0.85
"""Largest product of a contact's angular frequency sqrt(k / m) and a step; an elastic
bounce then loses at most 0.1 % of its energy and gains none (measured)."""

HARD_HIT = 1.2
"""Speed (m/s) of an impact whose dissipation the step bears: the contact is then
stiffer by 1 + dissipation times speed, and its damping as fast again
(:func:`skyarm.plant.joint_rate.stop_rate`)."""

DAMPED_STEP = 2.2
"""Largest product of the fastest rate of that impact and a step: Runge-Kutta is stable
to 2.78."""

LONGEST = 2.5e-3
"""Longest step in contact, s, however soft it is."""

BRISTLE_STEP = 1.5
"""Largest product of a bristle's angular frequency and a step, at the penetration
``PRESSED``. Runge-Kutta is stable to 2.78, which for 20 g is 17 N; semi-implicit Euler
with the bristle's damping to 1.77, 7 N."""

PRESSED = 1e-3
"""Penetration (m) at which the stiffness of bristles is evaluated: 5 N at 5000 N/m."""

_STILL = 1e-24
"""Small square (m^2/s^2, N^2 or m^2) under a root, for a derivative of 0 instead of NaN
at rest; also a length (m) in a denominator."""


def euler_step_of(square: Scalar, decay: Scalar) -> Scalar:
    """Semi-implicit Euler step (s) for a damped oscillator: three quarters of the
    stability limit.

    Args:
        square: square of its angular frequency, 1/s^2.
        decay: damping by inertia, 1/s.
    """
    return divide(3.0, decay + sqrt(decay * decay + 4.0 * square + _STILL))


DULLEST = 1000.0
"""Largest dissipation (s/m); bodies that arrive faster than 1 mm/s then do not
rebound."""

ROUGHEST = 100.0
"""Largest coefficient of friction; rubber has 1 to 4."""


@immutable
@checked("material")
class Material:
    """Contact material of a surface: stiffness, dissipation and friction."""

    stiffness: Annotated[
        Scalar,
        positive(
            "N/m",
            "stiffness of the contact, normal force per penetration",
            effect="higher values penetrate less and need smaller integration steps",
        ),
    ] = 5000.0
    dissipation: Annotated[
        Scalar,
        nonnegative(
            "s/m",
            "relative increase of the normal force per speed of penetration",
            high=DULLEST,
            effect="higher values bounce less",
        ),
    ] = 1.0
    friction: Annotated[
        Scalar,
        nonnegative(
            "",
            "friction coefficient, sticking and sliding",
            high=ROUGHEST,
            effect="higher values slip later",
        ),
    ] = 0.3
    bristle_length: Annotated[
        Scalar,
        positive(
            "m",
            "displacement at which friction reaches its full value",
            effect="lower values stick more rigidly and need smaller integration steps",
        ),
    ] = 2e-4

    @property
    def largest_step(self) -> Scalar:
        """Longest stable integration step (s) of contact between the vehicle and this
        material.
        """
        return self.step_of(LIGHTEST)

    def step_of(self, mass: Scalar) -> Scalar:
        """Longest stable integration step (s) of contact between this material and a
        mass (kg).
        """
        # stiffness of friction mu f / z_s under the force at that penetration
        bristles = self.friction * self.stiffness * PRESSED / self.bristle_length
        fastest = maximum(
            sqrt(self.stiffness) / NORMAL_STEP, sqrt(bristles) / BRISTLE_STEP
        )
        damped = self.stiffness * (1.0 + 2.0 * HARD_HIT * self.dissipation)
        fastest = maximum(fastest, sqrt(damped) / DAMPED_STEP)
        return minimum(sqrt(mass) / fastest, LONGEST)

    def normal_force(
        self,
        depth: Scalar,
        depth_rate: Scalar,
        step: Scalar | None = None,
        most: Scalar | None = None,
    ) -> Scalar:
        """Normal contact force (N) from the penetration and its rate, by the
        Hunt-Crossley law.

        Args:
            depth: penetration, m; negative outside.
            depth_rate: m/s.
            step: s, that the penetration is a mean over; of a contact with the vehicle
                if left out.
            most: largest damping, N s/m; that of the dissipation if left out.
        """
        way = absolute(depth_rate) * (self.largest_step if step is None else step)
        half = 0.5 * way + depth
        mean = where(
            depth + depth > way, depth, divide(half * half, way + way + _STILL)
        )
        force = self.stiffness * mean
        lost: Scalar = self.dissipation
        if most is not None:
            lost = minimum(lost, divide(most, force + _STILL))
        # a fast retreat would pull: the clamp below keeps it at 0
        force = force * (1.0 + lost * depth_rate)
        return where(half > 0.0, maximum(force, 0.0), 0.0)

    def bristle_rate(
        self, bristle: Vec3, slip: Vec3, depth: Scalar, step: Scalar
    ) -> Vec3:
        """Mean rate (m/s) of the friction bristle deflection over an integration step
        at a constant slip velocity.

        In closed form: along a way s the bristle goes to its length along the slip as
        exp(-s / z_s).

        Args:
            bristle: its deflection, m.
            slip: velocity of the point along the surface, m/s.
            depth: m.
            step: s, over which the slip is constant.
        """
        speed = slip.smooth_norm()
        gone = divide(1.0 - exp(speed * step * (-1.0 / self.bristle_length)), step)
        bending = slip * (divide(self.bristle_length, speed) * gone) - bristle * gone
        return select(depth > 0.0, bending, bristle * -RECOVERY)

    def bending_rate(self, bristle: Vec3, slip: Vec3) -> Vec3:
        """Rate (m/s) of the bristle deflection at an instant of contact."""
        return slip - bristle * (slip.smooth_norm() * (1.0 / self.bristle_length))

    def friction_force(
        self,
        bristle: Vec3,
        bristle_rate: Vec3,
        normal_force: Scalar,
        mass: Scalar = LIGHTEST,
    ) -> Vec3:
        """Friction force (N, world axes) from the bristle deflection, limited to the
        friction cone.

        Args:
            bristle: deflection, m.
            bristle_rate: m/s.
            normal_force: N.
            mass: kg that the contact moves at least: damping falls with its root, as
                its integration step does.
        """
        most = self.friction * normal_force
        # by identity: contacts of the vehicle need neither root nor product
        largest = (
            BRISTLE_DAMPING
            if mass is LIGHTEST
            else BRISTLE_DAMPING * sqrt(mass / LIGHTEST)
        )
        # a light touch has little friction, and so little damping of it
        damping = minimum(largest * normal_force, largest)
        friction = (
            bristle * (most * (1.0 / self.bristle_length)) + bristle_rate * damping
        )
        size = friction.smooth_norm()
        return friction * -minimum(divide(most, size), 1.0)
