"""The lag found in flight, on signals whose lag is known, and what it does to the
gains.
"""

import dataclasses
import math
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

import skyarm
from skyarm.algebra import Vec3
from skyarm.control.blocks.disturbance_observer import (
    ObserverCorrections,
    disturbance,
    first_observed,
    observe,
)
from skyarm.control.blocks.prediction import actuation
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal.lag_estimate import (
    CANDIDATES,
    IGNORED,
    LEAD,
    LagGains,
    LagMemory,
    delay_share,
    estimate,
    lag_gains,
)
from skyarm.control.laws.centroidal.make import make_centroidal
from skyarm.control.laws.centroidal.parameters import at_shares
from skyarm.control.model import Model
from skyarm.dynamics.actuators import Command
from skyarm.sensing.measurement import Measurement
from support.cases import sampled

DT = 0.005
GAINS = LagGains(base=0.02, joints=0.012, stride=1)
ZERO = Vec3(0.0, 0.0, 0.0)
MODEL = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"))


@dataclasses.dataclass
class Rates:
    """Of a measurement what the estimate reads."""

    rate: Vec3
    joint_rates: tuple[float, ...]


@dataclasses.dataclass
class Rows:
    """Of the actuators' past what the estimate reads."""

    squares: list
    efforts: list


def told_by(angular, joints, *corrections):
    """What the model tells: accelerations of the commands sent, and corrections of the
    disturbance.
    """
    amid = SimpleNamespace(
        accelerations=lambda model, squares, efforts: (None, angular, joints)
    )
    turned, bent = corrections
    return ObserverCorrections(
        amid=amid,
        innovation=None,
        known=1.0,
        beside=(),
        angular_correction=turned,
        joint_corrections=bent,
    )


def learn(gains, memory, told, measurement, started, free, isolated, dt):
    """The memory one period later, of what a step of the law tells."""
    before = SimpleNamespace(started=started, free=free)
    timing = SimpleNamespace(past=SimpleNamespace(squares=[0.0], efforts=[0.0]))
    # the model always tells of the newest command
    par, seen = (
        SimpleNamespace(model=None, delay_periods=gains.stride * gains.earlier),
        SimpleNamespace(corrections=told),
    )
    step = SimpleNamespace(
        par=par, seen=seen, measurement=measurement, memory=before, timing=timing, dt=dt
    )
    return gains.after(memory, step, isolated)


@cache
def memories(
    late,
    arm_late=None,
    *,
    seconds=8.0,
    active=3.0,
    noise=0.0,
    gust=None,
    free=(1.0, 1.0, 1.0),
    isolated=1.0,
    later=None,
    dt=DT,
    gains=GAINS,
    seed=4,
    disturbance=0.0,
    slower=None,
    weaker=1.0,
    begun=None,
    swing=None,
):
    """The memories of a flight whose accelerations of white noise arrive ``late``
    periods later, one a period.

    A gust is one push a second. Tests that ask for one flight, or for two instants of
    it, share it.

    ``later``: a time (s) and the lag in periods that holds from then on. ``slower``:
    time constant, s, of a further lag of first order. ``weaker``: times that
    accelerations are smaller. ``begun``: the memory at first. ``swing``: size and rate,
    rad/s, of an oscillation of the commands of which half is cancelled.
    """
    rng = np.random.default_rng(seed)
    n = round(seconds / dt)
    a = active * rng.normal(size=(n, 5))
    y = np.vstack([np.zeros((late, 5)), a[: n - late]])
    if arm_late is not None:
        y[:, 3:] = np.vstack([np.zeros((arm_late, 2)), a[: n - arm_late, 3:]])
    if later is not None:
        start = round(later[0] / dt)
        y[start:] = a[start - later[1] : n - later[1]]
    if slower is not None:
        share, held = 1.0 - math.exp(-dt / slower), np.zeros(5)
        for k in range(n):
            held = held + share * (y[k] - held)
            y[k] = held
    y /= np.array(weaker)
    if swing is not None:
        wave = swing[0] * np.sin(swing[1] * dt * np.arange(n))[:, None]
        a = a + wave
        y[late:] += 0.5 * wave[: n - late]
    # what the observer believes to disturb: part of what the model says, and told by
    # its changes
    steps = disturbance * rng.normal(size=(n, 5))
    believed = np.cumsum(steps, axis=0)
    if gust is not None:
        y[:: round(1.0 / dt)] += gust
    rates = np.cumsum(y * dt, axis=0) + noise * rng.normal(size=(n, 5))
    memory, found = begun or gains.start(2), []
    for k in range(n):
        model = a[k] + believed[k] - steps[k]
        told = told_by(
            Vec3(*model[:3]), tuple(model[3:]), Vec3(*steps[k, :3]), tuple(steps[k, 3:])
        )
        measured = Rates(rate=Vec3(*rates[k, :3]), joint_rates=tuple(rates[k, 3:]))
        memory = learn(
            gains, memory, told, measured, 0.0 if k == 0 else 1.0, free, isolated, dt
        )
        found.append(memory)
    return found


def flown(*given, **words):
    """The last memory of a flight."""
    return memories(*given, **words)[-1]


def test_of_the_first_measurement_nothing_is_learned_but_the_rates():
    first = GAINS.start(2)
    told = told_by(Vec3(7.0, 8.0, 9.0), (5.0, 6.0), Vec3(1.0, 1.0, 1.0), (1.0, 1.0))
    rates = (4.0, 3.0, 2.0, 1.0, -1.0)
    after = learn(
        GAINS,
        first,
        told,
        Rates(rate=Vec3(*rates[:3]), joint_rates=rates[3:]),
        0.0,
        (1.0,) * 3,
        1.0,
        DT,
    )
    kept = (*rates[:2], *rates[3:])  # of the yaw axis nothing is taken
    assert after == dataclasses.replace(first, rates=kept, found=after.found)
    assert after.found == pytest.approx((0.0, 0.0), abs=1e-9)


def lags(memory: LagMemory, dt=DT, gains=GAINS):
    return tuple(
        estimate(bank, dt * gains.stride, gains.earlier)
        for bank in (memory.base, memory.arm)
    )


@pytest.mark.parametrize("late", sampled(range(CANDIDATES), 4))
def test_a_whole_number_of_periods_is_found(late):
    assert lags(flown(late, seconds=2.5)) == pytest.approx(
        (late * DT, late * DT), abs=2e-4
    )


def test_rotors_and_joints_have_a_lag_of_their_own():
    assert lags(flown(2, 6, seconds=2.5)) == pytest.approx((2 * DT, 6 * DT), abs=2e-4)


def test_what_the_observer_believes_to_disturb_is_left_out():
    """It is an answer to what was measured, and would look like one: the first
    correction is not learned from.
    """
    assert lags(flown(3, seconds=2.5, disturbance=20.0)) == pytest.approx(
        (3 * DT, 3 * DT), abs=5e-4
    )


def test_it_is_found_under_the_noise_of_the_bench():
    """Rates of 0.01 rad/s of noise are accelerations of 2.8 rad/s^2 at 200 Hz, as large
    as what the loop does.
    """
    assert lags(flown(4, noise=0.01, seconds=5.0)) == pytest.approx(
        (0.02, 0.02), abs=0.003
    )


def test_a_longer_lag_than_the_longest_counts_as_that():
    # nothing fits: no lag, or the longest
    assert min(lags(flown(CANDIDATES + 1, seconds=2.5))) >= 0.0
    with_one_more = lags(flown(CANDIDATES - 1, seconds=2.5))
    assert with_one_more == pytest.approx(((CANDIDATES - 1) * DT,) * 2, abs=2e-4)


def written(a, y, earlier=0):
    """Residuals and found lag of rotors (roll, pitch) and joints, agreement and size,
    of whole records, by SciPy.
    """
    steps, filters = (
        np.arange(9 + earlier),
        {
            w: ([1.0 - math.exp(-w * DT)], [1.0, -math.exp(-w * DT)])
            for w in (20.0, 60.0)
        },
    )
    prices = np.minimum(0.0075 * abs(steps - earlier), 0.05)

    def band(x):
        upper = lfilter(*filters[60.0], lfilter(*filters[60.0], x, axis=0), axis=0)
        return upper - lfilter(*filters[20.0], upper, axis=0)

    def weights(paid):
        return (1.0 + 12.5 * (paid - paid.min()) / (paid.min() + 0.0075)) ** -8.0

    believed, measured = np.vstack([np.zeros((steps[-1], 4)), band(a)]), band(y)
    banks, clipped = [[prices, 0.0], [prices, 0.0]], 0
    agreement, size, slow = np.full(2, 0.05), np.full(2, 0.05), np.zeros((2, 2))
    for k, here in enumerate(measured):
        past = believed[k + steps[-1] - steps]
        delay = np.clip((1.35 - (size / agreement).min()) / 0.2, 0.0, 1.0)
        paid, scale = banks[0]
        both = np.array([weights(paid) @ past[:, :2] / weights(paid).sum(), here[:2]])
        expected, quick = both - slow
        slow = slow + (1.0 - math.exp(-20.0 * DT)) * (both - slow)
        gain = 0.3 * DT / (quick**2 + expected**2 + 4.0 * scale + 0.01)
        for i, pace in enumerate((0.35 + 1.15 * delay, 0.5)):
            paid, scale = banks[i]
            squares = ((here[2 * i : 2 * i + 2] - past[:, 2 * i : 2 * i + 2]) ** 2).sum(
                axis=1
            )
            share = squares / (squares + 4.0 * scale + 0.01)
            paid = paid + max(pace * DT, 1.0 / (k + 20.0)) * (share + prices - paid)
            clipped += squares.mean() > 4.0 * (scale + 0.01)
            scale = scale + DT * (min(squares.mean(), 4.0 * (scale + 0.01)) - scale)
            banks[i] = [np.minimum(paid, paid.min() + 0.05), scale]
        agreement = agreement + gain * expected * quick - 0.3 * DT * agreement
        size = size + gain * expected**2 - 0.3 * DT * size
    assert 100 < clipped < 2 * len(measured) - 100
    assert 0.1 < delay < 0.9
    found = [
        weights(paid) @ ((steps - earlier) * DT) / weights(paid).sum()
        for paid, _ in banks
    ]
    return banks, agreement, size, found


@pytest.mark.parametrize("earlier", [0, 4])
def test_the_filters_are_those_of_the_page(earlier):
    """Rotors 3 and joints 5 periods late, accelerations 1.3 times smaller than
    modelled, and a burst.
    """
    rng = np.random.default_rng(11)
    a = 10.0 * rng.normal(size=(400, 4))
    a[150:160] *= 20.0
    y = (
        np.column_stack([np.roll(a[:, :2], 3, axis=0), np.roll(a[:, 2:], 5, axis=0)])
        / 1.3
    )
    y[:5] = 0.0
    rates = np.vstack([np.zeros(4), np.cumsum(y, axis=0) * DT]) + 0.002 * rng.normal(
        size=(401, 4)
    )
    gains = dataclasses.replace(GAINS, earlier=earlier)
    memory = gains.start(2)
    for k, rate in enumerate(rates):
        model = a[max(k - 1, 0)]
        told = told_by(
            Vec3(*model[:2], 9.0), tuple(model[2:]), Vec3(0.0, 0.0, 0.0), (0.0, 0.0)
        )
        measured = Rates(rate=Vec3(*rate[:2], 7.0), joint_rates=tuple(rate[2:]))
        memory = learn(
            gains, memory, told, measured, 0.0 if k == 0 else 1.0, (1.0,) * 3, 1.0, DT
        )
    banks, agreement, size, found = written(a, np.diff(rates, axis=0) / DT, earlier)
    for bank, (paid, scale) in zip((memory.base, memory.arm), banks, strict=True):
        assert bank.paid == pytest.approx(paid, rel=1e-8)
        assert bank.scale == pytest.approx(scale, rel=1e-8)
    assert memory.agreement == pytest.approx(agreement, rel=1e-8)
    assert memory.size == pytest.approx(size, rel=1e-8)
    assert lags(memory, gains=gains) == pytest.approx(found, rel=1e-8)


@pytest.mark.parametrize(("told", "late"), [(9, 1), (13, 1), (9, 9), (9, 11)])
def test_a_known_delay_that_is_longer_than_the_true_one_is_a_lag_below_zero(told, late):
    """45 and 65 ms are told; 5 ms are true, or what is told, or 10 ms more."""
    gains = lag_gains((0.02, 0.012), DT, told)
    memory = dataclasses.replace(flown(late, seconds=1.2, gains=gains), count=400.0)
    assert lags(memory, gains=gains) == pytest.approx(
        ((late - told) * DT,) * 2, abs=3e-4
    )
    assert gains.delay(memory, DT) == pytest.approx((late - told) * DT, abs=3e-4)
    # what is predicted takes no bandwidth after the ramp, whichever sign it has
    assert gains.shares(memory, DT) == pytest.approx((1.0, 1.0), abs=0.02)


def test_an_arm_at_rest_takes_no_bandwidth_where_a_known_delay_is_too_long():
    """It shows no lag at all: 40 ms more than the rotors'. Later than told is another
    matter.
    """
    gains = lag_gains((0.02, 0.012), DT, 9)
    still = dataclasses.replace(
        flown(1, seconds=1.2, gains=gains), arm=gains.start(2).arm, count=400.0
    )
    base, joints = lags(still, gains=gains)
    assert (base, joints) == pytest.approx((-0.04, 0.0), abs=1e-3)
    assert gains.shares(still, DT)[1] == pytest.approx(1.0, abs=0.02)
    late = dataclasses.replace(still, arm=flown(11, seconds=1.2, gains=gains).arm)
    assert gains.shares(late, DT)[1] == pytest.approx(
        0.012 / (0.012 + 0.01 - IGNORED), rel=0.03
    )
    # one that is not checked is none of these
    assert GAINS.shares(dataclasses.replace(GAINS.start(2), count=1.0), DT) == (
        1.0,
        1.0,
    )


def test_a_flight_whose_known_delay_may_be_too_long_begins_gently():
    """With a quarter of the bandwidths, all of them after 1.5 s."""
    gains = lag_gains((0.02, 0.012), DT, 9)
    for seconds, share in ((0.0, 0.25), (0.75, 0.625), (1.5, 1.0), (3.0, 1.0)):
        memory = dataclasses.replace(gains.start(2), count=seconds / DT)
        assert gains.shares(memory, DT) == pytest.approx((share, share), rel=1e-9)
        assert GAINS.shares(
            dataclasses.replace(GAINS.start(2), count=seconds / DT), DT
        ) == (1.0, 1.0)


@pytest.mark.parametrize(
    ("period", "periods", "stride", "earlier"),
    [
        (0.005, 7, 1, 0),
        (0.005, 8, 1, 8),
        (0.005, 13, 1, 13),
        (0.001, 39, 5, 0),
        (0.001, 43, 5, 8),
        (0.02, 2, 1, 2),
    ],
)
def test_known_delays_of_40_ms_and_more_are_checked(period, periods, stride, earlier):
    gains = lag_gains((0.02, 0.012), period, periods)
    assert (gains.base, gains.joints, gains.stride, gains.earlier) == (
        0.02,
        0.012,
        stride,
        earlier,
    )
    prices = [min(0.0075 * abs(j), 0.05) for j in range(-earlier, 9)]
    assert gains.prices == pytest.approx(prices)
    first = gains.start(2)
    assert first.base.paid == pytest.approx(prices)
    assert len(first.past) == stride * (earlier + 8)
    assert estimate(first.base, period, earlier) == pytest.approx(0.0, abs=2e-8)


def test_the_observers_disturbance_is_the_sum_of_its_changes():
    """From the second measurement on."""
    told = told_by(Vec3(0.0, 0.0, 0.0), (0.0, 0.0), Vec3(1.0, 2.0, 3.0), (4.0, 5.0))
    still = Rates(rate=Vec3(0.0, 0.0, 0.0), joint_rates=(0.0, 0.0))
    memory = GAINS.start(2)
    for started, sums in (
        (0.0, (0.0,) * 4),
        (1.0, (1.0, 2.0, 4.0, 5.0)),
        (1.0, (2.0, 4.0, 8.0, 10.0)),
    ):
        memory = learn(GAINS, memory, told, still, started, (1.0,) * 3, 1.0, DT)
        assert memory.disturbing == sums


@pytest.mark.parametrize(("periods", "earlier"), [(0, 0), (2, 0), (2, 1), (2, 2)])
def test_the_model_answers_the_command_that_a_measurement_is_of(periods, earlier):
    """Squares and efforts as many periods before the newest as the shortest delay has
    that may be true.
    """
    gains = dataclasses.replace(GAINS, earlier=earlier)
    heard = []
    amid = SimpleNamespace(
        accelerations=lambda *told: (
            heard.append(told) or (None, Vec3(0.0, 0.0, 0.0), (0.0, 0.0))
        )
    )
    told = ObserverCorrections(
        amid=amid,
        innovation=None,
        known=1.0,
        beside=(),
        angular_correction=ZERO,
        joint_corrections=(0.0, 0.0),
    )
    step = SimpleNamespace(
        seen=SimpleNamespace(corrections=told),
        measurement=Rates(rate=Vec3(0.0, 0.0, 0.0), joint_rates=(0.0, 0.0)),
        memory=SimpleNamespace(started=1.0, free=(1.0,) * 3),
        dt=DT,
        par=SimpleNamespace(model="model", delay_periods=periods),
        timing=SimpleNamespace(
            past=Rows(["oldest", "older", "newest"], ["first", "second", "third"])
        ),
    )
    gains.after(gains.start(2), step, 1.0)
    least = periods - earlier
    assert heard == [
        (
            "model",
            ["newest", "older", "oldest"][least],
            ["third", "second", "first"][least],
        )
    ]


def test_without_motion_there_is_none():
    assert lags(flown(4, active=0.0, seconds=2.0)) == pytest.approx(
        (0.0, 0.0), abs=1e-6
    )


def test_gusts_are_no_lag():
    assert lags(flown(0, gust=50.0, noise=0.01, seconds=4.0)) == pytest.approx(
        (0.0, 0.0), abs=1e-3
    )


@pytest.mark.parametrize(
    ("late", "within"), sampled(((6, 0.35), (3, 0.5), (8, 0.35), (2, 0.6)), 3)
)
def test_a_lag_that_begins_late_is_found_soon(late, within):
    """However long there was none: evidence against it is bounded. A short lag leaves
    less evidence a second.

    The joints' evidence is forgotten at a third of the rate of the rotors'.
    """
    course = memories(0, later=(4.0, late), seconds=4.0 + 2.0 * within)
    soon, base, arm = (
        lags(course[round((4.0 + wait * within) / DT) - 1]) for wait in (0.8, 1.0, 2.0)
    )
    assert base[0] == pytest.approx(late * DT, abs=1e-3)
    assert arm[1] == pytest.approx(late * DT, abs=1e-3)
    assert soon == pytest.approx((late * DT, 0.0), abs=1e-3)


def test_accelerations_much_smaller_than_modelled_need_evidence_of_longer():
    """Errors of a wrong model turn the phase as a lag does; of a right one 30 ms are
    found within 0.35 s.
    """
    begun = dataclasses.replace(GAINS.start(2), agreement=(0.2, 0.2), size=(0.4, 0.4))
    late = memories(0, later=(4.0, 6), weaker=2.0, begun=begun, seconds=5.5)
    soon, late = late[round(4.45 / DT) - 1], late[-1]
    assert delay_share(soon) == 0.0
    assert lags(soon)[0] == pytest.approx(0.0, abs=1e-3)
    assert lags(late)[0] == pytest.approx(0.03, abs=1e-3)


def test_a_lag_that_ends_is_forgotten_as_soon():
    assert lags(flown(6, later=(2.0, 0), seconds=2.6)) == pytest.approx(
        (0.0, 0.0), abs=1e-3
    )


def test_no_lag_falls_further_behind_than_prices_alone_put_it():
    memory = flown(0, seconds=2.5)
    for bank in (memory.base, memory.arm):
        assert max(bank.paid) - min(bank.paid) <= LEAD + 1e-12
        assert bank.paid[0] == min(bank.paid)


@pytest.mark.parametrize("held", [0, 1])
def test_a_lag_is_found_as_soon_while_an_actuator_is_at_its_limit(held):
    """What it was sent within its limits is known: a loop that swings from limit to
    limit finds its lag.
    """
    free = tuple(0.0 if i == held else 1.0 for i in range(3))
    assert lags(flown(0, later=(2.0, 4), free=free, seconds=2.6)) == pytest.approx(
        (0.02, 0.02), abs=1e-3
    )


def test_at_a_limit_of_the_rotors_no_slow_actuator_is_learned():
    found = [
        flown(4, weaker=2.0, seconds=1.0, free=(held, 1.0, 1.0)) for held in (0.0, 1.0)
    ]
    assert (found[0].size, found[0].agreement) == (
        GAINS.start(2).size,
        GAINS.start(2).agreement,
    )
    assert delay_share(found[1]) < 1.0


def test_in_contact_no_lag_is_learned_and_the_observers_disturbance_is_followed():
    free, touching = (
        flown(4, isolated=share, seconds=1.0, disturbance=1.0) for share in (1.0, 0.0)
    )
    assert lags(touching) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert touching.disturbing == free.disturbing


def test_a_bank_of_two_periods_a_step_compares_with_every_other_period():
    """The third lag is that of six periods ago, where the model had what is measured
    now.
    """
    gains = dataclasses.replace(GAINS, stride=2)
    past, filtered = (
        tuple((float(k),) * 4 for k in range(16)),
        (
            (5.69,) * 4,
            (5.69,) * 4,
            (0.0,) * 4,
        ),
    )
    bank = dataclasses.replace(gains.start(2).base, scale=100.0)
    # 5.3 in the band a period later
    first = dataclasses.replace(
        gains.start(2), past=past, measured=filtered, base=bank, arm=bank
    )
    told = told_by(Vec3(0.0, 0.0, 0.0), (0.0, 0.0), Vec3(0.0, 0.0, 0.0), (0.0, 0.0))
    still = Rates(rate=Vec3(0.0, 0.0, 0.0), joint_rates=(0.0, 0.0))
    after = learn(gains, first, told, still, 1.0, (1.0,) * 3, 1.0, 0.0025)
    residuals = [np.subtract(each.paid, bank.paid) for each in (after.base, after.arm)]
    assert [int(np.argmin(each)) for each in residuals] == [3, 3]


@pytest.mark.thorough
def test_a_faster_loop_has_its_lags_as_far_apart():
    assert [
        lag_gains((1, 1), period, 0).stride for period in (0.02, 0.005, 0.0025, 0.001)
    ] == [1, 1, 2, 5]
    gains = dataclasses.replace(GAINS, stride=5)
    found = lags(flown(20, dt=0.001, gains=gains, seconds=3.0), dt=0.001, gains=gains)
    assert found == pytest.approx((0.02, 0.02), abs=1e-3)


@pytest.mark.parametrize("weaker", [0.7, 1.0, 1.1])
def test_a_delay_takes_no_bandwidth(weaker):
    """It is predicted; 10 % less torque than modelled is no sign of a slow actuator."""
    memory = flown(4, seconds=2.0, weaker=weaker)
    assert delay_share(memory) == pytest.approx(1.0, abs=0.02)
    assert GAINS.delay(memory, DT) == pytest.approx(0.02, abs=5e-4)
    assert GAINS.shares(memory, DT) == pytest.approx((1.0, 1.0), abs=0.02)
    assert GAINS.shares(GAINS.start(2), DT) == (1.0, 1.0)


def test_commands_that_have_not_acted_yet_are_no_slow_actuator():
    """A motion that begins at once: for 30 ms nothing answers, and what was asked for
    is large beside that.
    """
    assert delay_share(flown(6, seconds=0.4, active=30.0)) == 1.0


def test_a_slow_actuator_takes_the_bandwidth_that_halves_at_its_lag():
    """Poles at 20 rad/s leave 0.5 of what 35 rad/s ask for: more than 1.35 times less,
    and no delay.
    """
    # of what it knew at first it would keep a third for 7 s
    begun = dataclasses.replace(GAINS.start(2), agreement=(1e-3,) * 2, size=(1e-3,) * 2)
    memory = flown(0, seconds=3.0, slower=0.05, begun=begun)
    base, _ = lags(memory)
    assert 0.01 < base < 0.03
    assert delay_share(memory) == 0.0
    assert GAINS.shares(memory, DT)[0] == pytest.approx(0.02 / (0.02 + base - IGNORED))


def test_inertia_added_to_one_axis_is_no_slow_actuator():
    """A load that hangs on an arm of two pitch joints slows roll; slow motors slow
    pitch as well.
    """
    begun = dataclasses.replace(GAINS.start(2), agreement=(1e-3,) * 2, size=(1e-3,) * 2)
    one, both = (
        flown(4, seconds=3.0, weaker=w, begun=begun)
        for w in ((2.0, *[1.0] * 4), (2.0,) * 5)
    )
    assert delay_share(one) == pytest.approx(1.0, abs=0.02)
    assert GAINS.shares(one, DT)[0] == pytest.approx(1.0, abs=0.02)
    assert delay_share(both) == 0.0


def test_a_slow_swing_against_a_force_not_observed_yet_is_no_slow_actuator():
    """Commands of 6 rad/s that a disturbance cancels leave a half of them; noise in the
    band tells that of a lag.
    """
    begun = dataclasses.replace(GAINS.start(2), agreement=(1e-3,) * 2, size=(1e-3,) * 2)
    memory = flown(4, seconds=3.0, begun=begun, swing=(3.0, 6.0))
    assert delay_share(memory) == pytest.approx(1.0, abs=0.05)
    # as large at 35 rad/s it is one
    assert delay_share(flown(4, seconds=3.0, begun=begun, swing=(3.0, 35.0))) < 0.5


def test_joints_that_are_later_than_the_rotors_lose_the_bandwidth_for_the_difference():
    memory = flown(2, 6, seconds=2.5)
    assert GAINS.shares(memory, DT) == pytest.approx(
        (1.0, 0.012 / (0.012 + 0.02 - IGNORED)), rel=0.02
    )


@pytest.mark.parametrize("weaker", [0.3, 1.0, 6.0, 1e9])
def test_joints_that_stick_have_an_observer_no_wider_than_that_of_the_torque(weaker):
    """Joints that accelerate by more than modelled, as modelled, by a sixth of it, not
    at all.
    """
    memory = flown(0, weaker=(1.0,) * 3 + (weaker,) * 2, seconds=4.0)
    assert memory.obeyed == pytest.approx(min(1.0, 1.0 / weaker**2), abs=0.03)
    par = make_centroidal(MODEL, mode="tip", observer=[27.0, 31.0, 51.0, 60.0]).par
    observer = GAINS.adjust_gains(memory, par, DT).observer
    joint = GAINS.shares(memory, DT)[1]
    assert observer.torque == pytest.approx(31.0, rel=0.02)
    assert observer.joints == pytest.approx(
        min(51.0 * joint, observer.torque * max(1.0, 8.0 * memory.obeyed))
    )
    # joints that stand still tell nothing, nor do those of an arm in contact
    assert (
        flown(0, active=0.0, seconds=1.0).obeyed
        == flown(0, isolated=0.0, weaker=9.0, seconds=1.0).obeyed
        == 1.0
    )


def test_what_makes_up_for_friction_is_lowered_with_the_joints_bandwidth():
    """Where that friction is none, it takes from the damping of the loop, which is
    less.
    """
    memory, par = (
        flown(2, 6, seconds=2.5),
        make_centroidal(
            Model(vehicle=skyarm.load_vehicle("hummingbird_arm2_rotors"))
        ).par,
    )
    adjusted, share = GAINS.adjust_gains(memory, par, DT), GAINS.shares(memory, DT)[1]
    assert share < 0.5
    assert adjusted.joint_gains.damping == pytest.approx(
        [share * each for each in par.joint_gains.damping]
    )
    for link, own in zip(
        adjusted.model.vehicle.links, par.model.vehicle.links, strict=True
    ):
        assert own.joint.damping == 0.001
        assert link.joint.damping == pytest.approx(share * 0.001)


def test_gains_at_a_share_have_the_same_damping_ratio():
    par = make_centroidal(MODEL, mode="tip").par
    slow = at_shares(par, 0.5, 0.25)

    def ratio(stiffness, damping):
        return damping / (2.0 * math.sqrt(stiffness))

    for speed, of in (("velocity", "position"), ("rate", "attitude")):
        for axis in "xyz":
            k, d = (
                getattr(getattr(slow.base, of), axis),
                getattr(getattr(slow.base, speed), axis),
            )
            K, D = (
                getattr(getattr(par.base, of), axis),
                getattr(getattr(par.base, speed), axis),
            )
            assert ratio(k, d) == pytest.approx(ratio(K, D))
            assert k == pytest.approx(0.25 * K)
    assert slow.tip.position == pytest.approx(par.tip.position / 16.0)
    assert slow.joint_gains.damping == pytest.approx(
        [d / 4.0 for d in par.joint_gains.damping]
    )
    assert (slow.observer.force, slow.observer.joints) == (
        0.5 * par.observer.force,
        0.25 * par.observer.joints,
    )
    assert slow.observer.pose == par.observer.pose


def test_the_bandwidth_is_one_number():
    scaled = make_centroidal(MODEL, mode="tip", bandwidth=0.5).par
    assert scaled == at_shares(make_centroidal(MODEL, mode="tip").par, 0.5, 0.5)
    with pytest.raises(
        ControllerError, match=r"controller.bandwidth = 0: must be at least 0.01"
    ):
        make_centroidal(MODEL, bandwidth=0)


def test_a_lag_is_two_lengths():
    with pytest.raises(
        ControllerError, match="must be two lengths above 0, or twice 0"
    ):
        make_centroidal(MODEL, lag=(0.02, 0.0))


def test_the_observer_tells_by_how_much_its_disturbance_changes():
    """The innovation of the rates times L2 / dt, and the model's acceleration that they
    were foretold with.
    """
    par = make_centroidal(MODEL, mode="tip").par
    before = dataclasses.replace(
        first_observed(2, (500.0,) * 4, True),
        rate=Vec3(0.1, -0.2, 0.3),
        joint_rates=(0.2, -0.1),
    )
    measured = Measurement(
        **{
            **{
                name: getattr(before, name)
                for name in ("position", "quaternion", "velocity", "joints")
            }
        },
        rate=Vec3(0.4, 0.1, 0.2),
        specific_force=Vec3(0.0, 0.0, 9.81),
        joint_rates=(0.5, 0.3),
        rotor_speeds=(500.0,) * 4,
        time=0.0,
    )
    nothing = disturbance(before)
    command = Command(rotor_speeds=(500.0,) * 4, efforts=(0.0, 0.0))
    done = actuation(MODEL, before.rotor_speeds, command, DT)
    _, told = observe(
        MODEL, par.observer, before, measured, done, nothing, 1.0, (1.0,) * 3, DT
    )
    _, angular, joints = told.amid.accelerations(
        MODEL, (500.0**2,) * 4, command.efforts
    )
    for gain, rate, predicted, correction in (
        (
            par.observer.torque,
            measured.rate,
            before.rate + angular * DT,
            told.angular_correction,
        ),
        (
            par.observer.joints,
            measured.joint_rates,
            [r + a * DT for r, a in zip(before.joint_rates, joints, strict=True)],
            told.joint_corrections,
        ),
    ):
        share = (1.0 - math.exp(-gain * DT)) ** 2 / DT
        wanted = [share * (m - f) for m, f in zip(rate, predicted, strict=True)]
        assert list(correction) == pytest.approx(wanted)
