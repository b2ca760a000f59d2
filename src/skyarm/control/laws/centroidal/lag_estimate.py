"""Online estimate of unmodelled lag in the control loops; the part that is a delay is
compensated by prediction.

With a(t) the accelerations of the sent commands by the model and y(t) the measured
ones, the mean M_j of |y(t) - a(t - L_j)|^2 is followed for a bank of lags L_j, whole
control periods, in a band in which the loop is active and wind is not; the lag is the
mean of L_j weighted by exp(-sharpness (M_j - min M) / min M), the likelihood of normal
residuals with 1 / (1 + x / 8)^8 for exp(-x). Each step of lag has a price (``prior``),
large residuals count little (``robust``; Geman, McClure 1985), and no lag falls further
behind the likeliest than ``lead`` (bounded evidence, Page 1954). Lags beyond the bank
count as its longest; a lag of the sensors of pose alone is not seen. A known delay of
``OVERSTATED`` or more may be too long: the bank goes back to no delay at all, and the
lag may be negative.

The law predicts the state across the rotors' lag. A delay leaves the size of the
accelerations, a slow actuator lowers it, of roll as of pitch, the more the faster they
change: with y = c a(t - L) of an axis, c the least squares and both above the band's
lower edge once more, the bandwidth is lowered for the share of the lag that is no
delay, none for the smaller 1 / c up to ``smaller``, all from ``slow`` on; that of the
joints for what their lag exceeds the rotors' by. A load adds inertia to one axis more
than to the other. Slow swings of the loop itself, against a force not observed yet or a
late servo, look like a slow actuator, and less bandwidth swings them more.

A joint without the damping that the model believes looks late, too. What makes up for
that damping takes it from the joint's loop, which has less of it the lower its
bandwidth is: it is lowered by the same share.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from itertools import accumulate
from typing import Annotated

from skyarm.algebra import Scalar, Scalars, differences, inner_product
from skyarm.algebra.scalars import (
    add,
    clip,
    data,
    divide,
    maximum,
    minimum,
    mul,
    structural,
    sub,
    total,
    where,
)
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.laws.centroidal.parameters import (
    CentroidalParameters,
    OptionalPart,
    Step,
    at_shares,
    with_joint_damping,
)
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit, positive

TILTS = 2
"""Number of base axes used for the lag estimate: roll and pitch, which rotors turn by
thrust."""

CANDIDATES = 9
"""Number of candidate lags: zero, and eight steps."""

STEP = 0.005
"""Least spacing (s) of the candidate lags; chosen, the usual control period:
eight steps reach 40 ms."""

LOW, HIGH = 20.0, 60.0
"""Edges (rad/s) of the frequency band in which lags are estimated: winds are below,
noise of differences is above; chosen."""

FORGETTING, SLOWLY, OF_JOINTS, FIRST = 1.5, 0.35, 0.5, 20.0
"""Filter rates (1/s) of the mean residuals, and number of periods that count as seen
before the first one. The rates are the rotors' of a delay and where accelerations are
much smaller than modelled, the joints', which a push from below moves as a lag does.

With 0.5 for both of the rotors' rates, and 0.005 for ``PRIOR``, a noisy slow circle was
off by 1.65, 1.92 and 2.20 mm where commands became 20, 30 and 40 ms late, with these by
1.56, 1.72 and 1.98."""

ROBUST, FLOOR, GROWTH = 4.0, 0.01, 4.0
"""Residual with half weight over the scale; least scale ((rad/s^2)^2); largest growth
of the scale per period."""

PRIOR, SHARPNESS = 0.0075, 100.0
"""Penalty on the mean residual (0 to 1) for each step of lag; weight of the mean
residuals' relative differences."""

LEAD = 0.05
"""Largest excess of a penalised mean residual over the least one, and largest penalty.

So a delay that begins after minutes is found as soon as one that begins at once, in
tenths of a second; the number is chosen."""

OVERSTATED = 0.04
"""Least known delay (s) that is checked for being too long. Shorter ones are borne
where 5 ms are true, and flights with a true one would begin gently for nothing."""

GENTLE, SETTLING = 0.25, 1.5
"""Share of the bandwidths with which a flight with such a delay begins, and time (s)
until all of them: prediction over a delay that is not there shakes the vehicle, faster
than it is found with 0.4."""

LEARNING, KNOWN = 0.3, 0.05
"""Filter rate (1/s) of the accelerations' mean products; their initial value, of which
more would outweigh the small sizes in this band. Chosen."""

SMALLER, SLOW = 1.15, 1.35
"""Ratios of modelled to measured acceleration: up to the first a lag counts as delay
alone, from the second as none. Chosen: a model that is
wrong by some percent is no slow motor."""

OBEYING, WIDER = 2.0, 8.0
"""Rate (1/s) at which the share of the joints' squared accelerations that is measured
is found; times that share, the observer of the joints may be wider than that of the
torque. Joints that stick hardly accelerate: what their observer then finds sooner than
that of the torque is taken for a torque on the base, and the loop swings."""

LEAST = 1e-6
"""Least mean product of measured and modelled accelerations, as a divisor."""

IGNORED = 0.002
"""Lag (s) that is ignored: what the middle of a control period and rounding leave."""


@immutable
class LagGains(OptionalPart):
    """Constants of the lag estimate: lags that halve rotor and joint loop bandwidths,
    and spacing of candidate lags.

    ``earlier``: number of candidates by which the known delay may be too long.
    """

    base: Annotated[
        Scalar,
        positive(
            "s",
            "lag of the rotor loops that halves their bandwidth",
            effect="lower values slow the loops down sooner when a lag is found",
        ),
    ]
    joints: Annotated[
        Scalar,
        positive(
            "s",
            "lag of the joint loops that halves their bandwidth",
            effect="lower values slow the loops down sooner when a lag is found",
        ),
    ]
    stride: int
    earlier: int = 0
    held: bool = False

    @property
    def prices(self) -> tuple[float, ...]:
        """Penalty of each candidate lag, by its distance from none."""
        return tuple(
            structural(min(PRIOR * abs(j), LEAD))
            for j in range(-self.earlier, CANDIDATES)
        )

    def start(self, joints: int) -> LagMemory:
        """Initial internal state of the lag estimate, before the first measurement."""
        none = (0.0,) * (TILTS + joints)
        bank = Bank(paid=tuple(map(float, self.prices)), scale=0.0)
        return LagMemory(
            count=0.0,
            rates=none,
            disturbing=none,
            believed=(none,) * 3,
            measured=(none,) * 3,
            past=(none,) * (self.stride * (self.earlier + CANDIDATES - 1)),
            slow=(0.0,) * (2 * TILTS),
            base=bank,
            arm=bank,
            agreement=(KNOWN,) * TILTS,
            size=(KNOWN,) * TILTS,
            found=(0.0, 0.0),
        )

    def delay(self, memory: LagMemory, dt: Scalar) -> Scalar:
        """Command delay (s) that the law compensates by prediction: the estimated lag
        of the rotor loops.
        """
        return self.lags(memory, dt)[0]

    def adjust_gains(
        self, memory: LagMemory, par: CentroidalParameters, dt: Scalar
    ) -> CentroidalParameters:
        """Reduce the law's bandwidths and its model's joint damping for the estimated
        lags.
        """
        base, joints = self.shares(memory, dt)
        own = [joint.damping for joint in par.model.vehicle.joints]
        # the law makes up for the model's friction at the measured rate: where there is
        # none, that takes from the loop's damping, which a slower loop has less of
        par = at_shares(
            with_joint_damping(par, [mul(joints, damping) for damping in own]),
            base,
            joints,
        )
        most = par.observer.torque * maximum(1.0, WIDER * memory.obeyed)
        observer = replace(par.observer, joints=minimum(par.observer.joints, most))
        return replace(par, observer=observer)

    def shares(self, memory: LagMemory, dt: Scalar) -> tuple[Scalar, Scalar]:
        """Factors (0 to 1) on rotor and joint loop bandwidths for the lags that
        prediction does not compensate.
        """
        base, joints = self.lags(memory, dt)
        # arms that stand still do not show that the known delay is too long
        sooner = maximum(base, 0.0) if self.earlier else base
        joints = maximum(joints - sooner - IGNORED, 0.0)
        base = maximum(base * (1.0 - delay_share(memory)) - IGNORED, 0.0)
        shares = (
            divide(self.base, self.base + base),
            divide(self.joints, self.joints + joints),
        )
        if not self.earlier:
            return shares
        ramp = minimum(1.0, GENTLE + memory.count * (dt * ((1.0 - GENTLE) / SETTLING)))
        return shares[0] * ramp, shares[1] * ramp

    def lags(self, memory: LagMemory, dt: Scalar) -> tuple[Scalar, Scalar]:
        """Estimated lags (s) of the rotor loops and of the joint loops."""
        step = dt * self.stride
        return estimate(memory.base, step, self.earlier), estimate(
            memory.arm, step, self.earlier
        )

    def after(self, memory: LagMemory, step: Step, isolated: Scalar) -> LagMemory:
        """Lag estimate one period later; unchanged before the second measurement and in
        contact (``isolated`` 0).
        """
        if self.held:
            return memory
        update = step.seen.corrections
        measurement = step.measurement
        free = step.memory.free
        dt = step.dt
        running = where(step.memory.started > 0.5, 1.0, 0.0)
        rates = (measurement.rate.x, measurement.rate.y, *measurement.joint_rates)
        # the model's answer to what was sent, at the shortest candidate
        last = self.stride * self.earlier - step.par.delay_periods - 1
        sent = step.timing.past
        _, angular, joints = update.amid.accelerations(
            step.par.model, sent.squares[last], sent.efforts[last]
        )
        by_model = (angular.x, angular.y, *joints)
        corrections = (
            update.angular_correction.x,
            update.angular_correction.y,
            *update.joint_corrections,
        )
        own = differences(by_model, memory.disturbing)
        seen = [
            divide(sub(now, before), dt)
            for now, before in zip(rates, memory.rates, strict=True)
        ]
        believed = _in_row(memory.believed, own, running, dt)
        measured = _in_row(memory.measured, seen, running, dt)
        # what passed HIGH twice, less its own low pass at LOW
        band = differences(believed[1], believed[2])
        past = [
            band,
            *(
                memory.past[k - 1]
                for k in range(self.stride, len(memory.past) + 1, self.stride)
            ),
        ]
        learned = mul(running, isolated)
        # with a wrong model the phase of its errors wanders: evidence of longer
        rate = SLOWLY + (FORGETTING - SLOWLY) * delay_share(memory)
        first = divide(1.0, memory.count + FIRST)
        here = differences(measured[1], measured[2])
        groups = (
            (memory.base, slice(0, TILTS), rate),
            (memory.arm, slice(TILTS, None), OF_JOINTS),
        )
        base, arm = (
            _bank(
                bank,
                self.prices,
                here[p],
                [each[p] for each in past],
                learned * maximum(pace * dt, first),
                running * dt,
            )
            for bank, p, pace in groups
        )
        weights = weigh(memory.base)
        # in the order of `estimate`, so that the program computes this sum once
        inverse = divide(1.0, total(reversed(weights)))
        expected = [
            inner_product(weights, axis) * inverse
            for axis in zip(*(each[:TILTS] for each in past), strict=True)
        ]
        both = (*expected, *here[:TILTS])
        quick = differences(both, memory.slow)
        edge = running * low_pass_share(LOW, dt)
        # at a limit the observer's disturbance stands still, and what it lacks counts
        # as too small an answer
        share = learned * free[0] * (LEARNING * dt)
        floor = ROBUST * memory.base.scale + FLOOR
        agreement, size = [], []
        for k, (x, z) in enumerate(zip(quick[:TILTS], quick[TILTS:], strict=True)):
            # of both: of what was measured alone, a command that has not acted yet
            # would count without bound
            gain = divide(share, z * z + x * x + floor)
            agreement.append(memory.agreement[k] * (1.0 - share) + gain * (x * z))
            size.append(memory.size[k] * (1.0 - share) + gain * (x * x))
        asked, answered = (total(a * a for a in each[TILTS:]) for each in (band, here))
        # what a push adds to the answer is no sign of a joint that sticks
        missing = minimum(answered, asked) - memory.obeyed * asked
        return LagMemory(
            count=memory.count + running,
            obeyed=memory.obeyed
            + divide(learned * (OBEYING * dt), asked + FLOOR) * missing,
            rates=tuple(data(each) for each in rates),
            disturbing=tuple(
                d + mul(running, c)
                for d, c in zip(memory.disturbing, corrections, strict=True)
            ),
            believed=believed,
            measured=measured,
            past=(band, *memory.past[:-1]),
            slow=tuple(
                add(old, mul(edge, change))
                for old, change in zip(memory.slow, quick, strict=True)
            ),
            base=base,
            arm=arm,
            agreement=tuple(agreement),
            size=tuple(size),
            found=self.lags(memory, dt),
        )


@immutable
class Bank:
    """Residual statistics of the candidate lags for one group of axes."""

    paid: Annotated[
        Scalars,
        Unit("", "mean residual of each candidate lag with its penalty, 0 to 1"),
    ]
    scale: Annotated[Scalar, Unit("(rad/s^2)^2", "mean square of the residuals")]


@immutable
class LagMemory:
    """State of the lag estimate: filtered accelerations of roll, pitch and joints, and
    residual statistics.
    """

    count: Annotated[Scalar, Unit("", "number of periods so far")]
    rates: Annotated[
        Scalars, Unit("rad/s or m/s", "body and joint rates measured one period ago")
    ]
    disturbing: Annotated[
        Scalars, Unit("rad/s^2 or m/s^2", "accelerations by the observer's disturbance")
    ]
    believed: Annotated[
        tuple[Scalars, ...],
        Unit("rad/s^2 or m/s^2", "modelled accelerations, filtered three times"),
    ]
    measured: Annotated[
        tuple[Scalars, ...],
        Unit(
            "rad/s^2 or m/s^2",
            "accelerations by differences of measured rates, filtered three times",
        ),
    ]
    past: Annotated[
        tuple[Scalars, ...],
        Unit(
            "rad/s^2 or m/s^2", "modelled accelerations in the pass band, newest first"
        ),
    ]
    slow: Annotated[
        Scalars,
        Unit(
            "rad/s^2",
            "low-passed roll and pitch accelerations: modelled at the lag, measured",
        ),
    ]
    base: Bank
    arm: Bank
    agreement: Annotated[
        Scalars,
        Unit(
            "",
            "mean product of measured and modelled accelerations at the estimated lag,"
            " each axis",
        ),
    ]
    size: Annotated[
        Scalars,
        Unit(
            "",
            "mean square of the modelled accelerations at the estimated lag, each axis",
        ),
    ]
    obeyed: Annotated[
        Scalar,
        Unit(
            "", "share of the joints' modelled squared accelerations that is measured"
        ),
    ] = 1.0
    found: Annotated[
        tuple[Scalar, Scalar],
        Unit("s", "estimated lags of rotor and joint loops in use"),
    ]


def lag_gains(
    lags: tuple[Scalar, Scalar], control_period: float, delay_periods: int
) -> LagGains:
    """Constants of the lag estimate from two lags (s), for a control period (s) and a
    known delay that may be too long.

    The lags are those that halve the bandwidths of rotor and joint loops.
    """
    base, joints = lags
    # candidates are whole periods apart: a period longer than the step counts as one
    stride = max(1, round(STEP / control_period))
    # a whole number of periods times one rounds
    checked = delay_periods * control_period > OVERSTATED - 1e-9
    return LagGains(
        base=base,
        joints=joints,
        stride=stride,
        earlier=delay_periods // stride if checked else 0,
    )


def delay_share(memory: LagMemory) -> Scalar:
    """Fraction (0 to 1) of the rotors' lag that is a delay: none where accelerations
    are much smaller than modelled.
    """
    roll, pitch = (
        divide(s, maximum(a, LEAST))
        for s, a in zip(memory.size, memory.agreement, strict=True)
    )
    times = minimum(roll, pitch)
    return clip((SLOW - times) * (1.0 / (SLOW - SMALLER)), 0.0, 1.0)


def weigh(bank: Bank) -> list[Scalar]:
    """Weight of each candidate lag, its likelihood up to a common factor."""
    least = reduce(minimum, bank.paid)
    # 1 / (1 + x / 8)^8 for exp(-x), x from the likeliest lag on
    inverse = divide(0.125 * SHARPNESS, least + PRIOR)
    start = 1.0 - least * inverse
    weights = []
    for each in bank.paid:
        once = divide(1.0, each * inverse + start)
        twice = once * once
        weights.append((twice * twice) * (twice * twice))
    return weights


def estimate(bank: Bank, step: Scalar, earlier: int = 0) -> Scalar:
    """Estimated lag (s): likelihood-weighted mean of candidate lags ``step`` apart,
    ``earlier`` of them negative.
    """
    # sums of the weights of lags not below each: their sum counts each weight once for
    # each step of its lag
    above = list(accumulate(reversed(weigh(bank))))
    return step * add(
        divide(total(above[:-1]), above[-1]),
        structural(-float(earlier)) if earlier else 0,
    )


def _in_row(
    before: Sequence[Sequence[Scalar]],
    new: Sequence[Scalar],
    running: Scalar,
    dt: Scalar,
) -> tuple[Scalars, ...]:
    """States of three low-pass filters in series: two at the band's upper edge, one at
    its lower edge.

    ``running`` is 0 at the first measurement, which leaves them as they are.
    """
    # differences make noise grow with frequency; beyond HIGH two low passes outweigh it
    states = []
    for old, edge in zip(before, (HIGH, HIGH, LOW), strict=True):
        share = running * low_pass_share(edge, dt)
        new = tuple(o + share * (n - o) for o, n in zip(old, new, strict=True))
        states.append(new)
    return tuple(states)


def _bank(
    bank: Bank,
    prices: Sequence[float],
    seen: Sequence[Scalar],
    delayed: Sequence[Sequence[Scalar]],
    keep: Scalar,
    passed: Scalar,
) -> Bank:
    """Residual statistics of the candidate lags after one more measurement.

    Args:
        bank: one period earlier.
        prices: penalty of each candidate.
        seen: measured accelerations of the axes, in the pass band.
        delayed: modelled ones, a row for each candidate.
        keep: filter gain of the residuals in this period; 0 learns nothing.
        passed: that of their scale: dt times 1 1/s, or 0.
    """
    if not seen:
        return bank
    squares = [
        total((y - a) * (y - a) for y, a in zip(seen, each, strict=True))
        for each in delayed
    ]
    size = minimum(total(squares) * (1.0 / len(delayed)), GROWTH * (bank.scale + FLOOR))
    half = ROBUST * bank.scale + FLOOR
    rows = zip(bank.paid, squares, prices, strict=True)
    paid = [
        old + keep * (add(divide(e, e + half), price) - old) for old, e, price in rows
    ]
    # evidence that could grow on would take as long to be overturned as it took to grow
    most = reduce(minimum, paid) + LEAD
    return Bank(
        paid=tuple(minimum(each, most) for each in paid),
        scale=bank.scale + passed * (size - bank.scale),
    )
