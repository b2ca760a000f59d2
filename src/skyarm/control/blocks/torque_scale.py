"""Estimate of joint torque scale errors from the arm's weight in free flight, and
standard error of the tip force.

A joint that is commanded tau gives (1 + s) tau. In free flight it holds the known
weight of the links, so that the disturbance observer reports d = s tau, plus the error
of that weight. With prior deviations sigma_s of the scale and sigma_m of the weight
torques (:class:`Tolerances`), sums A of tau^2 and B of d tau with a fading memory, and
the error epsilon by which d is known
(:class:`skyarm.control.blocks.tip_force.ForceErrors`), the linear estimate is

    s = B sigma_s^2 / (A (sigma_s^2 + sigma_m^2) + epsilon^2 T),
    var s = sigma_s^2 (1 - K),

K the factor of B times A / B. Without an error of the weights all of d is scale,
without one of the scale none. The disturbance less s tau is that of a joint with the
right scale.

Errors of the scales of different joints are taken as independent; that of a weight goes
to the bias of the tip's force, and counts until the bias has learned it.

Source: Gauss-Markov estimate with a prior; Kay 1993, theorem 10.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

from skyarm.algebra import Scalar, Scalars, Vec3
from skyarm.algebra.scalars import add, data, divide, maximum, mul, sqrt, sub, where
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.blocks.tip_force import ForceErrors, TipLevers, effort_shares
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit

MEMORY = 0.5
"""Forgetting rate (1/s) of the torque scale estimate while it is updated; chosen: two
seconds of another pose outweigh what was before."""

CORRELATED = 0.1
"""Correlation time (s) of the errors of the observed disturbance; chosen, some time
constants of the joints' observer (1/34 s)."""


@immutable
class Tolerances:
    """Standard deviations of joint torque scales and arm weight in a tip force estimate
    from joint torques.
    """

    torques: Annotated[
        Scalar,
        Unit("", "standard deviation of the scale of a joint's torque, relative"),
    ]
    masses: Annotated[
        Scalar, Unit("", "standard deviation of the arm's weight torques, relative")
    ]


@immutable
class TorqueScale:
    """State of the torque scale estimate: least-squares sums of each joint, and
    standard error of the tip force.

    Attributes:
        squares, products: fading sums of tau^2 and d tau over time.
        unlearned: share of the weight's error that the bias of the force has not
            learned.
        met: 1 once the tip has touched anything.
        deviation: standard error of the tip's force along the normal.
    """

    squares: Annotated[
        Scalars,
        Unit("N^2 m^2 s or N^2 s", "fading sum of the squared torque of each joint"),
    ]
    products: Annotated[
        Scalars,
        Unit(
            "N^2 m^2 s or N^2 s",
            "fading sum of torque times observed torque error of each joint",
        ),
    ]
    unlearned: Annotated[
        Scalar,
        Unit(
            "",
            "fraction of the weight's error that the force bias has not absorbed, 0"
            " to 1",
        ),
    ] = 1.0
    met: Annotated[Scalar, Unit("", "1 once the tip has been in contact")] = 0.0
    deviation: Annotated[
        Scalar, Unit("N", "standard error of the tip force along the normal")
    ] = 0.0

    def factors(self, by: Tolerances, errors: ForceErrors, at: TipLevers) -> Scalars:
        """Ratio of each joint's torque scale error to the integral of disturbance times
        torque, 1 / (N^2 m^2 s).
        """
        prior = by.torques * by.torques
        both = prior + by.masses * by.masses
        rows = zip(self.squares, at.vehicle.links, strict=True)
        return tuple(
            divide(prior, both * A + divide(CORRELATED, errors.weight_of(link)))
            for A, link in rows
        )

    def correct(
        self,
        by: Tolerances,
        errors: ForceErrors,
        at: TipLevers,
        d: Disturbance,
        efforts: Sequence[Scalar],
    ) -> Disturbance:
        """Observed disturbance minus the joint efforts that torque scale errors cause:
        d - s tau.
        """
        rows = zip(
            d.efforts, self.factors(by, errors, at), self.products, efforts, strict=True
        )
        return replace(
            d,
            efforts=tuple(
                sub(seen, mul(mul(factor, B), effort))
                for seen, factor, B, effort in rows
            ),
        )

    def learn(
        self,
        by: Tolerances,
        errors: ForceErrors,
        at: TipLevers,
        d: Disturbance,
        efforts: Sequence[Scalar],
        n: Vec3,
        free: Scalar,
        rate: Scalar,
        dt: Scalar,
    ) -> TorqueScale:
        """State of the torque scale estimate one period later.

        Args:
            by: tolerances.
            errors: weights of the tip force estimate.
            at: levers of the tip.
            d: observed disturbance, uncorrected.
            efforts: joint efforts of the command that acted, N m or N.
            n: normal, unit, world axes.
            free: whether nothing but its weight loads the arm.
            rate: bandwidth at which the force's bias is estimated then, rad/s.
            dt: s.
        """
        variance: Scalar = 0.0
        rows = zip(
            self.squares,
            self.factors(by, errors, at),
            efforts,
            effort_shares(errors, at, n),
            strict=True,
        )
        weight = mul(by.masses, self.unlearned)
        for A, factor, effort, share in rows:
            left = add(
                # 1 - K is at least 0, but for rounding
                mul(by.torques * by.torques, maximum(1.0 - mul(factor, A), 0.0)),
                mul(weight, weight),
            )
            size = mul(share, effort)
            variance = add(variance, mul(left, mul(size, size)))

        def fading(total: Scalar, rate: Scalar) -> Scalar:
            return data(where(free, total + (rate - MEMORY * total) * dt, total))

        return TorqueScale(
            squares=tuple(
                fading(A, mul(tau, tau))
                for A, tau in zip(self.squares, efforts, strict=True)
            ),
            products=tuple(
                fading(B, mul(seen, tau))
                for B, seen, tau in zip(self.products, d.efforts, efforts, strict=True)
            ),
            unlearned=data(
                where(free, self.unlearned * (1.0 - rate * dt), self.unlearned)
            ),
            met=self.met,
            deviation=data(sqrt(maximum(variance, 0.0))),
        )


def first_scale(joints: int) -> TorqueScale:
    """Initial state of the torque scale estimate: no data yet."""
    return TorqueScale(squares=(0.0,) * joints, products=(0.0,) * joints)
