"""Vectors of time signals, and coloured noise added to them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

from skyarm.algebra import ZERO3, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import exp, mul, sqrt
from skyarm.algebra.scalars.philox import normals
from skyarm.records.coerce import concrete
from skyarm.records.field_rules import checked
from skyarm.records.files import filled_list, shown
from skyarm.records.files.toml import Entry
from skyarm.records.immutable import immutable
from skyarm.records.units import nonnegative, positive
from skyarm.reference.signal_tables import component_from
from skyarm.reference.signals import Constant, Signal
from skyarm.reference.tip_motion import vector_derivatives

NONE = Constant(0)
"""Absent component of a signal vector: a structural zero."""


@immutable
@checked("vector of signals")
class SignalVector:
    """Vector of three time signals, such as a force; in a scenario file a list of three
    entries.
    """

    x: Signal = NONE
    y: Signal = NONE
    z: Signal = NONE

    def to_entry(self) -> list[Entry]:
        """File entry of a vector of time signals: a list of three signals."""
        return [each.to_entry() for each in self.signals]

    @classmethod
    def from_table(cls, entry: Entry, where: str) -> SignalVector:
        """Read a vector of three time signals from a value of a scenario file."""
        signals = zip(
            "xyz",
            filled_list(entry, where, "a list of three signals of time, x, y and z", 3),
            strict=True,
        )
        return cls(
            **{axis: component_from(each, f"{where}.{axis}") for axis, each in signals}
        )

    @property
    def signals(self) -> tuple[Signal, Signal, Signal]:
        """Signals of x, y and z."""
        return self.x, self.y, self.z

    def at(self, t: Scalar) -> Vec3:
        """Value of the vector at time t (s)."""
        return vector_derivatives(self.signals, t)[0]


NO_SIGNALS = SignalVector()


DEVIATIONS = ("force", "torque", "velocity")
"""Quantities that may have coloured noise."""


@immutable
@checked("noise")
class ColouredNoise:
    """First-order Gauss-Markov noise added to a force, torque or air velocity.

    Its standard deviation does not depend on the control period, its spectrum is flat
    up to ``bandwidth_hz`` and falls with 20 dB per decade above: the autocovariance is
    sigma^2 exp(-2 pi bandwidth |tau|).

    Source: Brown, Hwang 2012, section 3.9 (first-order Gauss-Markov process).
    """

    force: Annotated[
        Vec3, nonnegative("N", "standard deviation of the force", folds=True)
    ] = ZERO3
    torque: Annotated[
        Vec3, nonnegative("N m", "standard deviation of the torque", folds=True)
    ] = ZERO3
    velocity: Annotated[
        Vec3,
        nonnegative("m/s", "standard deviation of the velocity of the air", folds=True),
    ] = ZERO3
    bandwidth_hz: Annotated[
        Scalar,
        positive(
            "Hz",
            "frequency at which the spectrum has fallen to a half",
            effect="higher values make faster changes of the same size",
        ),
    ]

    def require_only(self, *own: str) -> None:
        """Refuse noise of other quantities than those named, such as a force noise of
        the wind.

        Raises:
            ValueError: one line with the field, its value and what there is.
        """
        for name in DEVIATIONS:
            value = getattr(self, name)
            if name not in own and not all(
                concrete(each) and each == 0.0 for each in value
            ):
                has = " and ".join(f"noise.{each}" for each in own)
                raise ValueError(
                    f"noise.{name} = {shown([*value])}: must be left out; here there is"
                    f" {has}"
                )

    def first(self, draws: Sequence[Scalar], count: int) -> Scalars:
        """Initial unit-variance noise with ``count`` components, drawn from the
        stationary distribution.
        """
        return tuple(normals(draws)[:count])

    def next(
        self, memory: Sequence[Scalar], dt: Scalar, draws: Sequence[Scalar]
    ) -> Scalars:
        """Unit-variance noise of the next control period."""
        left = exp(-2.0 * math.pi * self.bandwidth_hz * dt)
        # the variance stays 1, whatever the period is
        fresh = sqrt(1.0 - left * left)
        return tuple(
            left * old + fresh * new
            # an odd number of components leaves one normal number over
            for old, new in zip(memory, normals(draws), strict=False)
        )


def scale_noise(sigma: Vec3, numbers: Sequence[Scalar]) -> Vec3:
    """Unit-variance noise multiplied by standard deviations, as a vector."""
    return Vec3(
        *(mul(each, number) for each, number in zip(sigma, numbers, strict=True))
    )
