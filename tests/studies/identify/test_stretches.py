"""Stretches of a measured flight: commands held, sensors averaged alike, gaps and coasting motors left out."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest

import skyarm
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.studies.identify.logged_commands import period_note
from skyarm.studies.identify.sampled_series import position_differences
from skyarm.studies.identify.stretches import joint_rate_lag, joint_rates_note, stretches_of

VEHICLE = skyarm.load_vehicle("hummingbird")
HOVER = (9.81 * VEHICLE.mass / 4.0 / VEHICLE.rotors[0].thrust_coefficient) ** 0.5
RATE = 500.0


def channel(time, values):
    return Channel(time=time, values=np.asarray(values, dtype=float), source="made")


def flight(seconds=6.0, *, commands=None, kind="rotor_speed_commands", **more):
    time = 3.0 + np.arange(round(seconds * RATE) + 1) / RATE
    told = np.full((len(time), 4), HOVER) if commands is None else commands(time)
    gyro = np.stack([np.sin(time), 2.0 * np.sin(time), 3.0 * np.sin(time)], axis=1)
    channels = {
        "gyro": channel(time, gyro),
        "accelerometer": channel(time, gyro + np.array([0.0, 0.0, 9.81])),
        kind: channel(time, told),
    }
    return FlightData(name="made", file="made.csv", channels=channels | {k: make(time) for k, make in more.items()})


def test_periods_follow_the_lag_and_commands_a_finer_clock():
    """18.75 ms on the mean: 2.5 periods of it are 7.5 ms, four samples of 2 ms."""
    (stretch,) = stretches_of(flight(), VEHICLE)
    assert stretch.period == pytest.approx(0.008)
    assert (stretch.samples, stretch.fine, stretch.width) == (4, 4, 5)
    assert stretch.start == pytest.approx(3.5)
    assert stretch.commands == pytest.approx(HOVER)
    assert stretch.commands.shape == (stretch.size * 4, 4)
    assert stretch.rate.shape == (stretch.size + 1, 3)
    assert stretch.used.all()
    (short,) = stretches_of(flight(), VEHICLE, period=0.002, sections=[(4.0, 6.0)])
    assert (short.samples, short.width, short.start) == (1, 1, 4.0)
    instants = 4.0 + 0.002 * np.arange(short.size + 1)
    assert short.rate[:, 1] == pytest.approx(2.0 * np.sin(instants), abs=1e-5)
    assert short.specific_force[:, 2] == pytest.approx(9.81 + 3.0 * np.sin(instants[:-1] + 0.001), abs=1e-4)


def test_a_faster_accelerometer_does_not_put_vibration_into_slow_motion():
    """At 2 kHz a vibration of 499.7 Hz; at the gyro's 500 Hz it would look like 0.3 Hz."""

    def shaken(time):
        fine = np.arange(time[0], time[-1], 5e-4)
        slow = np.stack([0.0 * fine, 0.0 * fine, 9.81 + np.sin(fine)], axis=1)
        return channel(fine, slow + 2.0 * np.sin(2.0 * np.pi * 499.7 * fine)[:, None])

    (stretch,) = stretches_of(flight(accelerometer=shaken), VEHICLE, period=0.002)
    instants = stretch.start + 0.002 * (np.arange(stretch.size) + 0.5)
    assert np.abs(stretch.specific_force[:, 2] - 9.81 - np.sin(instants)).max() < 0.02
    assert np.abs(stretch.specific_force[:, 0]).max() < 0.02


def test_a_command_holds_from_its_own_instant_on():
    def step(time):
        return np.where(time < 5.0, HOVER, 1.1 * HOVER)[:, None].repeat(4, axis=1)

    (stretch,) = stretches_of(flight(commands=step), VEHICLE, period=0.01)
    when = stretch.start + 0.002 * np.arange(len(stretch.commands))
    assert when[np.argmax(stretch.commands[:, 0] > HOVER * 1.05)] == pytest.approx(5.0, abs=1e-6)


def swinging(time):
    """Commands whose sines are no whole parts of each other."""
    return HOVER + np.stack([20.0 * np.sin(w * time) for w in (2.0, 3.1, 4.3, 5.7)], axis=1)


def sampled_up(time, every, straight):
    """Samples of the swinging commands, one in ``every`` rows, held or joined by straight lines."""
    seldom = time[::every]
    if straight:
        return np.stack([np.interp(time, seldom, each) for each in swinging(seldom).T], axis=1)
    return np.repeat(swinging(seldom), every, axis=0)[: len(time)]


@pytest.mark.parametrize("straight", [True, False], ids=["straight", "held"])
@pytest.mark.parametrize(("every", "period"), [(50, 0.1), (25, 0.05), (10, 0.008), (1, 0.008)])
def test_periods_are_not_finer_than_commands_that_were_logged_seldom(every, period, straight):
    """At 20 Hz and less; commands at 50 Hz may be those of an autopilot, which are held."""
    measured = flight(commands=lambda time: sampled_up(time, every, straight))
    (stretch,) = stretches_of(measured, VEHICLE)
    assert stretch.period == pytest.approx(period)
    assert bool(period_note(measured, VEHICLE)) == (period > 0.01)
    if period > 0.01:
        assert f"period = {period:g} s" in period_note(measured, VEHICLE)
        step = stretch.period / stretch.fine
        middles = stretch.start + step * (np.arange(len(stretch.commands)) + 0.5)
        seldom = measured.start + period * np.arange(200)
        for told, each in zip(stretch.commands.T, swinging(seldom).T, strict=True):
            np.testing.assert_allclose(told, np.interp(middles, seldom, each), atol=1e-2)


def test_seldom_commands_of_a_topic_of_their_own_and_single_steps():
    time = 3.0 + 0.1 * np.arange(61)
    seldom = Channel(time=time, values=swinging(time), source="made")
    (stretch,) = stretches_of(flight().with_channels({"rotor_speed_commands": seldom}), VEHICLE)
    assert stretch.period == pytest.approx(0.1)

    def steps(time):
        return np.where((time % 1.7 < 0.5)[:, None], HOVER, 1.1 * HOVER) * np.ones(4)

    (stretch,) = stretches_of(flight(commands=steps), VEHICLE)
    assert stretch.period == pytest.approx(0.008)


def test_signals_are_shares_of_the_full_speed_and_a_coasting_motor_does_not_count():
    def signals(time):
        share = np.full((len(time), 4), HOVER / VEHICLE.rotors[0].max_speed)
        share[(time > 5.0) & (time < 5.1), 2] = 0.05
        return share

    (stretch,) = stretches_of(flight(commands=signals, kind="rotor_commands"), VEHICLE)
    assert np.median(stretch.commands) == pytest.approx(HOVER)
    at = stretch.start + stretch.period * np.arange(stretch.size)
    lost = at[~stretch.used]
    assert lost[0] == pytest.approx(5.0, abs=0.01)
    assert lost[-1] == pytest.approx(5.1 + 3.0 * 0.025, abs=0.015)
    (every,) = stretches_of(flight(commands=signals, kind="rotor_commands"), VEHICLE, coasting=0.0)
    assert every.used.all()


def test_what_does_not_fly_and_gaps_cut():
    def landed(time):
        return np.where((time > 4.0) & (time < 8.0), HOVER, 0.0)[:, None].repeat(4, axis=1)

    (stretch,) = stretches_of(flight(commands=landed), VEHICLE)
    assert stretch.start == pytest.approx(4.5, abs=0.1)
    assert stretch.start + stretch.seconds == pytest.approx(7.5, abs=0.1)
    whole = flight()
    gyro = whole["gyro"]
    kept = (gyro.time < 5.5) | (gyro.time > 5.7)
    cut = whole.with_channels({"gyro": Channel(time=gyro.time[kept], values=gyro.values[kept], source="made")})
    assert [round(each.start, 1) for each in stretches_of(cut, VEHICLE)] == [3.5, 5.7]


def test_speed_in_base_axes_and_voltage():
    """Turned by a quarter about the vertical: what flies along the world's x flies along the base's -y."""
    turn = np.array([0.5**0.5, 0.0, 0.0, 0.5**0.5])

    def attitude(time):
        signs = np.where(np.arange(len(time)) % 2, -1.0, 1.0)
        return channel(time, signs[:, None] * turn)

    held = flight(
        quaternion=attitude,
        velocity=lambda time: channel(time, np.tile([2.0, 0.0, 0.0], (len(time), 1))),
        voltage=lambda time: channel(time, np.full((len(time), 1), 11.1)),
    )
    (stretch,) = stretches_of(held, VEHICLE, full_voltage=12.0)
    assert stretch.velocity == pytest.approx(np.tile([0.0, -2.0, 0.0], (stretch.size, 1)))
    assert stretch.voltage == pytest.approx(11.1 / 12.0)
    (plain,) = stretches_of(held, VEHICLE)
    assert (plain.voltage == 1.0).all()


def test_joints_come_from_their_positions():
    arm = skyarm.load_vehicle("hummingbird_arm2_rotors")

    def swing(time):
        return channel(time, np.stack([np.sin(5.0 * time), np.cos(5.0 * time)], axis=1))

    told = {"joint_efforts": lambda time: channel(time, np.full((len(time), 2), 0.1))}
    (stretch,) = stretches_of(flight(joint_positions=swing, **told), arm, period=0.002)
    at = stretch.start + 0.002 * np.arange(stretch.size + 1)
    assert stretch.joint_rates[1:-1, 0] == pytest.approx(5.0 * np.cos(5.0 * at[1:-1]), abs=2e-3)
    assert stretch.efforts.shape == (stretch.size * stretch.fine, 2)
    assert (stretch.efforts == 0.1).all()


ENDLESS = tuple(dataclasses.replace(rotor, max_speed=float("inf")) for rotor in VEHICLE.rotors)


def of_commands(rotors, speed):
    return flight(commands=lambda time: np.full((len(time), rotors), speed))


def test_late_rates_of_joints_are_left_for_those_of_their_positions():
    """Differences to the sample before are half a sample late; measured rates are taken as they are."""
    arm = skyarm.load_vehicle("hummingbird_arm2_rotors")

    def swing(time):
        return np.stack([np.sin(9.0 * time), np.cos(7.0 * time)], axis=1)

    def of_rates(rates):
        made = flight(joint_positions=lambda t: channel(t, swing(t)), joint_rates=lambda t: channel(t, rates(t)))
        return stretches_of(made, arm, period=0.002)[0]

    late = of_rates(lambda t: (swing(t) - swing(t - 1.0 / RATE)) * RATE)
    at = late.start + 0.002 * np.arange(late.size + 1)
    assert late.joint_rates[1:-1, 0] == pytest.approx(9.0 * np.cos(9.0 * at[1:-1]), abs=5e-3)
    measured = of_rates(lambda t: np.stack([9.0 * np.cos(9.0 * t), -7.0 * np.sin(7.0 * t)], axis=1) + 0.01)
    assert measured.joint_rates[1:-1, 0] == pytest.approx(9.0 * np.cos(9.0 * at[1:-1]) + 0.01, abs=1e-4)


@pytest.mark.parametrize("noise", [0.0, 3e-4, 3e-3])
def test_good_rates_stay_under_encoder_noise_and_late_ones_are_told(noise):
    """At 200 Hz a noise of 3e-4 rad makes differences of positions noisier than half a sample's lag."""
    draw, step = np.random.default_rng(0), 0.005
    time = np.arange(0.0, 30.0, step)
    angle = 0.5 * np.sin(2.0 * np.pi * time) + noise * draw.normal(size=len(time))
    for late in (0.0, 0.5, 1.0):
        rate = np.pi * np.cos(2.0 * np.pi * (time - late * step)) + draw.normal(scale=1e-3, size=len(time))
        positions, rates = channel(time, angle[:, None]), channel(time, rate[:, None])
        lag, usual = joint_rate_lag(positions, rates)
        assert usual == pytest.approx(step)
        assert lag == pytest.approx(late * step, abs=0.02 * step)
        made = FlightData(name="made", file="", channels={"joint_positions": positions, "joint_rates": rates})
        note = joint_rates_note(made)
        assert bool(note) == (late > 0.0)
    assert re.match(r"made: joint_rates: (5|5\.1|4\.9) ms behind joint_positions: left out", note)


def test_a_period_on_the_edge_of_rounding_does_not_hang_on_the_last_bits():
    """7.5 ms on the mean at 200 Hz: one and a half samples."""
    periods = set()
    for stretch in (1.0 - 1e-12, 1.0, 1.0 + 1e-12):
        made = flight()
        rows = {
            name: channel(3.0 + (each.time[: 6 * 200] - 3.0) * 2.5 * stretch, each.values[: 6 * 200])
            for name, each in made.channels.items()
        }
        periods.add(round(stretches_of(made.with_channels(rows), VEHICLE)[0].period, 6))
    assert periods == {0.01}


@pytest.mark.parametrize(
    ("made", "vehicle", "message"),
    [
        (of_commands(3, HOVER), VEHICLE, "made: made: 3 rotors, vehicle 'hummingbird' has 4"),
        (of_commands(4, 0.0), VEHICLE, "made: no stretch of 1 s in the air without a gap"),
        (
            flight(kind="rotor_commands"),
            dataclasses.replace(VEHICLE, rotors=ENDLESS),
            "rotors.max_speed = inf: must be finite, the speed of the full signal of rotor_commands",
        ),
        (flight(), skyarm.load_vehicle("hummingbird_arm2_rotors"), "made: joint_positions: is not in this flight"),
    ],
)  # fmt: skip
def test_flights_that_do_not_fit_are_refused_in_one_line(made, vehicle, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}[^\n]*$"):
        stretches_of(made, vehicle)


def test_commands_are_finer_than_slow_samples():
    """Of motors of 12.5 ms up: 2.5 ms at most, a quarter of the 10 ms from sample to sample."""
    slow = flight()
    thinned = {
        name: Channel(time=each.time[::5], values=each.values[::5], source="made")
        for name, each in slow.channels.items()
    }
    (stretch,) = stretches_of(dataclasses.replace(slow, channels=thinned), VEHICLE)
    assert min(VEHICLE.rotors[0].time_constant_up, VEHICLE.rotors[0].time_constant_down) == 0.0125
    assert stretch.fine == 4 * stretch.samples


def test_a_velocity_keeps_its_size_between_attitudes_that_are_far_apart():
    """A coarse attitude that turns by 1.2 rad a sample: of what lies in between only the direction is rough."""

    def turning(time):
        coarse = time[::50]
        half = 6.0 * (coarse - coarse[0])
        return channel(coarse, np.stack([np.cos(half), np.sin(half), 0.0 * half, 0.0 * half], axis=1))

    def moving(time):
        return channel(time, np.tile([0.0, 3.0, 4.0], (len(time), 1)))

    (stretch,) = stretches_of(flight(velocity=moving, quaternion=turning), VEHICLE, period=0.002)
    assert np.linalg.norm(stretch.velocity, axis=1) == pytest.approx(5.0, rel=2e-3)


def test_rates_by_differences_are_those_of_a_fast_swing():
    """Of 2 Hz at 200 Hz: to 1e-5 of its rate, where those of second order are 7e-4 below."""
    time = 0.005 * np.arange(400)
    rate = 4.0 * np.pi * np.cos(4.0 * np.pi * time)
    found = position_differences(np.sin(4.0 * np.pi * time)[:, None])[:, 0] / 0.005
    assert np.abs(found - rate)[2:-2].max() < 1e-5 * rate.max()
    assert np.abs(np.gradient(np.sin(4.0 * np.pi * time), 0.005) - rate)[2:-2].max() > 5e-4 * rate.max()
