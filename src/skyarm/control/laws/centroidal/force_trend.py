"""Trend of the observed external force: its rate of change, weighted by how well past
predictions matched.

A steady turn of the wind can be predicted, turbulence and noise cannot. The rate comes
from a second-order tracker,

    level' = rate + 2 w (d - level),    rate' = w^2 (d - level),

d the observer's force. Force and rate then pass the same chain of three first-order
filters of together ``horizon`` seconds: horizon late(rate) predicts d - late(d). The
slope of the least squares between both, over the last seconds, is the trust in the
rate: none up to a half, full at 1. Rates as steep as a step's are not trusted. The
force that is compensated now, and the attitude that turns against it, have the rate
times the slope itself: over their short delays turbulence is predicted, too.

Sources: Gao 2003 (poles of the tracker); the slope is the Wiener coefficient of a
prediction by one regressor.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from skyarm.algebra import ZERO3, ZERO3_DATA, Scalar, Vec3
from skyarm.algebra.scalars import clip, divide, exp, maximum
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.laws.centroidal.parameters import CentroidalParameters, OptionalPart
from skyarm.control.laws.centroidal.step_records import Effect
from skyarm.records.immutable import immutable
from skyarm.records.leaves import as_data
from skyarm.records.units import Unit

STAGES = 3
"""Number of first-order lags in the delay chain of force and rate."""

HORIZON, FORGET = 0.25, 0.7
"""Prediction horizon (s) and forgetting rate (1/s) of the force trend, as in
:class:`TrendGains`; chosen."""

CHANCE = 0.5
"""Regression slope of past predictions up to which a force rate is not used: turbulence
reaches it by chance. Chosen."""

AHEAD = 1.0
"""Least observer bandwidth (rad/s) assumed in the delay over which a force is
predicted."""

SLOWEST, STEEPEST = 0.1, 5.0
"""Rates of the force per mass (m/s^3) that are too small to detect, and too large to
continue; chosen. A rate that was trusted by chance and from steps lost the hexarotor
with six joints in gusts."""


@immutable
class TrendGains(OptionalPart):
    """Constants of the force trend: filter of force and force rate, and weight of the
    rate from past predictions.
    """

    bandwidth: Annotated[
        Scalar,
        Unit(
            "rad/s",
            "bandwidth of the filter that tracks the observed force and its rate",
        ),
    ]
    horizon: Annotated[
        Scalar, Unit("s", "prediction time of the force by which its rate is judged")
    ]
    forget: Annotated[
        Scalar, Unit("1/s", "rate at which past predictions are forgotten")
    ]
    noise: Annotated[
        Scalar,
        Unit(
            "(N/s)^2",
            "mean square of force rates that are indistinguishable from noise",
            effect="higher values trust the force's rate later and amplify less noise",
        ),
    ]
    steep: Annotated[
        Scalar, Unit("N/s", "force rate above which a change counts as a step")
    ]

    def start(self, joints: int) -> ForceTrend:
        """Initial state of the force trend: zero force, and zero weight of the force
        rate.
        """
        chain = (ZERO3_DATA,) * STAGES
        # large at first, so that a few chance agreements do not make a slope
        # (a quarter of the square of the steepest rate: a choice)
        size = 0.25 * self.steep * self.steep
        return ForceTrend(
            level=ZERO3_DATA,
            rate=ZERO3_DATA,
            forces=chain,
            rates=chain,
            agreement=0.0,
            size=size,
        )


@immutable
class ForceTrend:
    """Filter state of the force trend: tracked force and rate, delay lines and
    prediction statistics.
    """

    level: Annotated[Vec3, Unit("N", "filtered force, world axes")]
    rate: Annotated[Vec3, Unit("N/s", "filtered rate of the force, world axes")]
    forces: Annotated[
        tuple[Vec3, ...], Unit("N", "force in each stage of the filter, world axes")
    ]
    rates: Annotated[
        tuple[Vec3, ...],
        Unit("N/s", "rate of the force in each stage of the filter, world axes"),
    ]
    agreement: Annotated[
        Scalar,
        Unit("(N/s)^2", "mean product of the predicted and the observed force rate"),
    ]
    size: Annotated[Scalar, Unit("(N/s)^2", "mean square of the predicted force rate")]


def trend_gains(bandwidth: float, mass: float) -> TrendGains:
    """Constants of the force trend for a tracker bandwidth (rad/s) and a vehicle mass
    (kg).
    """
    return TrendGains(
        bandwidth=bandwidth,
        horizon=HORIZON,
        forget=FORGET,
        noise=(SLOWEST * mass) * (SLOWEST * mass),
        steep=STEEPEST * mass,
    )


def update_trend(
    gains: TrendGains, memory: ForceTrend, force: Vec3, dt: Scalar
) -> ForceTrend:
    """Filter state of the force trend after one period, with the observed ``force`` (N,
    world axes).
    """
    b = exp(-(gains.bandwidth * dt))
    ahead = memory.level + memory.rate * dt
    miss = force - ahead
    # both poles of the filter at b: critically damped
    level = ahead + miss * (1.0 - b * b)
    rate = memory.rate + miss * divide((1.0 - b) * (1.0 - b), dt)
    share = 1.0 - exp(-divide(STAGES * dt, gains.horizon))
    forces = _advance_delay(memory.forces, force, share)
    rates = _advance_delay(memory.rates, rate, share)
    change = (force - forces[-1]) * divide(1.0, gains.horizon)
    predicted = rates[-1] * _no_step(gains, change)
    slow = low_pass_share(gains.forget, dt)
    return as_data(
        ForceTrend(
            level=level,
            rate=rate,
            forces=forces,
            rates=rates,
            agreement=memory.agreement
            + slow * (predicted.dot(change) - memory.agreement),
            size=memory.size + slow * (predicted.dot(rates[-1]) - memory.size),
        )
    )


def _advance_delay(
    chain: tuple[Vec3, ...], value: Vec3, share: Scalar
) -> tuple[Vec3, ...]:
    """Delay line one period later: a chain of first-order lags driven by ``value``."""
    delayed = []
    for each in chain:
        value = as_data(each + (value - each) * share)
        delayed.append(value)
    return tuple(delayed)


def rate_weights(gains: TrendGains, memory: ForceTrend) -> tuple[Scalar, Scalar]:
    """Weights (0 to 1) of the force rate, from the accuracy of past force predictions
    with that rate.

    The first one, for a prediction over the shift's delay, is none up to chance. The
    second one, for the delays of observer and attitude, a tenth of a second, is the
    slope itself, the least squares of a prediction.
    """
    slope = divide(memory.agreement, memory.size + gains.noise)
    even = _no_step(gains, memory.rate)
    far = clip((slope - CHANCE) * (1.0 / (1.0 - CHANCE)), 0.0, 1.0)
    return far * even, clip(slope, 0.0, 1.0) * even


def lateness(par: CentroidalParameters) -> Scalar:
    """Delay (s) of the observer's force estimate behind a steadily changing force."""
    if par.observer.accelerometer is None:
        return divide(2.0, maximum(par.observer.force, AHEAD))
    return divide(1.0, maximum(par.observer.accelerometer.force, AHEAD))


@immutable
class Foreseen:
    """Disturbance forecast by the weighted rate of the force.

    Attributes:
        unknown: compensated disturbance, now. near_rate: rate of its force by which the
            attitude turns, N/s.
        steady: force that the attitude balances, N, world axes. rate: its rate, N/s.
    """

    unknown: Disturbance
    steady: Vec3
    rate: Vec3 = ZERO3
    near_rate: Vec3 = ZERO3


def foresee(
    par: CentroidalParameters,
    trend: ForceTrend | None,
    effect: Effect,
    slow: Vec3,
    adapted: Vec3,
) -> Foreseen:
    """Disturbance predicted ahead by observer and filter delay; the force rate is not
    used while the tip is in contact.

    ``slow`` is the observed force, slowly filtered, and ``adapted`` that of the
    feed-forward, N, world axes.
    """
    unknown = effect.unknown
    steady = (slow if par.mode == "tip" else effect.force) + adapted
    gains = par.parts.trend
    if not isinstance(gains, TrendGains) or trend is None:
        return Foreseen(
            unknown=unknown,
            steady=steady,
            rate=effect.force_rate,
            near_rate=effect.force_rate,
        )
    late = lateness(par)
    slope = trend.rate
    # an int is structure: without contact parts no force at the tip is told apart
    if type(effect.external) is not int:
        slope = slope * (1.0 - effect.external)
    rate, near = (slope * weight for weight in rate_weights(gains, trend))
    unknown = replace(unknown, force=unknown.force + near * late)
    if par.mode == "tip":
        late = late + divide(1.0, maximum(par.tip.shift_rate, AHEAD))
    ahead = effect.force_rate
    return Foreseen(
        unknown=unknown,
        steady=steady + rate * late,
        rate=rate + ahead,
        near_rate=near + ahead,
    )


def _no_step(gains: TrendGains, rate: Vec3) -> Scalar:
    """Weight of a force rate: near 1 below the rate of a step change, near 0 far
    above.
    """
    square = rate.dot(rate) * divide(1.0, gains.steep * gains.steep)
    return divide(1.0, square * square + 1.0)
