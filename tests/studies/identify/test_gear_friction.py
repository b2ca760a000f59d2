"""Dry friction of torque-driven joints under noisy rates: its mean by hand, noise by its spread, planted numbers."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from planted_servos import ONE
from planted_vehicles import NOMINAL, fly_designed, weighed
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.studies.identify.dry_friction import BLUR
from skyarm.studies.identify.identified_numbers import IdentifiedNumber, unresolved_friction
from skyarm.studies.identify.identified_parts import Surroundings
from skyarm.studies.identify.identify_vehicle import identify_vehicle
from skyarm.studies.identify.motion_model import Memo, Stretch, _joint_efforts
from skyarm.studies.identify.stretches import stretches_of
from skyarm.studies.identify.unknowns import unknowns_of

PERIOD, COULOMB, BEND = 0.01, 0.02, 0.05


def friction_of(joint_rates, noise=0.0, *, width=1, samples=1):
    """Friction of the first joint by its measured rates (N + 1,) alone, without torque."""
    size = len(joint_rates) - 1
    joint = dataclasses.replace(ONE.links[0].joint, coulomb=COULOMB, coulomb_rate=BEND, damping=0.0)
    arm = dataclasses.replace(ONE, links=(dataclasses.replace(ONE.links[0], joint=joint),))
    stretch = Stretch(
        name="made",
        start=0.0,
        period=PERIOD,
        samples=samples,
        fine=samples,
        width=width,
        commands=np.zeros((size * samples, 4)),
        rate=np.zeros((size + 1, 3)),
        specific_force=np.zeros((size, 3)),
        joints=np.zeros((size + 1, 1)),
        joint_rates=np.asarray(joint_rates)[:, None],
        efforts=np.zeros((size * samples, 1)),
        velocity=np.zeros((size, 3)),
        voltage=np.ones(size),
        rate_noise=np.array([noise]),
    )
    middle = 0.5 * (stretch.joint_rates[1:] + stretch.joint_rates[:-1])
    return _joint_efforts(arm, Surroundings(), stretch, slice(None), middle.T, Memo())[0][0]


def test_friction_is_the_mean_of_what_a_noisy_rate_may_be():
    """Of many rates with noise, the mean friction of those that were measured alike."""
    rng = np.random.default_rng(1)
    true = rng.uniform(-1.0, 1.0, 400_000)
    measured = true + rng.normal(scale=0.08, size=true.size)
    for value in (-0.2, -0.05, 0.02, 0.1, 0.3):
        alike = np.abs(measured - value) < 0.01
        mean = -COULOMB * np.tanh(true[alike] / BEND).mean()
        assert friction_of([value, value], 0.08)[0] == pytest.approx(mean, abs=0.03 * COULOMB)


@pytest.mark.parametrize(("width", "samples"), [(1, 1), (3, 2)])
def test_friction_is_the_mean_over_a_period_in_which_a_joint_turns_back(width, samples):
    """A rate that falls by 12 rad/s^2 through zero, by 1000 small steps; averaged by the encoders, too."""
    time = PERIOD * np.arange(-4.0, 5.0)
    found = friction_of(-12.0 * time, width=width, samples=samples)
    fine = np.linspace(-0.5, 0.5, 1001)
    box = fine * (width * PERIOD / samples if width > 1 else 0.0)
    around = (PERIOD * fine[:, None] + box[None, ::10]).ravel()
    for k, middle in enumerate(0.5 * (time[1:] + time[:-1])):
        exact = COULOMB * np.tanh(12.0 * (middle + around) / BEND).mean()
        assert found[k] == pytest.approx(exact, abs=0.04 * COULOMB)


@pytest.mark.parametrize("measured", [False, True])
def test_the_noise_of_a_mean_rate_is_seen_in_its_samples(measured):
    """Positions in steps of 1/4096 turn, or rates with white noise: against the true mean rate of each period."""
    rng, step = np.random.default_rng(2), 0.005
    time = step * np.arange(2001)
    angle, rate = np.sin(3.0 * time) + 0.3 * np.sin(7.0 * time), 3.0 * np.cos(3.0 * time) + 2.1 * np.cos(7.0 * time)
    tick = 2.0 * np.pi / 4096.0
    hover = np.sqrt(9.81 * float(ONE.mass) / 4.0 / float(ONE.rotors[0].thrust_coefficient))
    rows = {
        "gyro": np.zeros((2001, 3)),
        "accelerometer": np.tile([0.0, 0.0, 9.81], (2001, 1)),
        "rotor_speed_commands": np.full((2001, 4), hover),
        "joint_positions": angle[:, None] if measured else tick * np.round(angle / tick)[:, None],
    }
    if measured:
        rows["joint_rates"] = rate[:, None] + rng.normal(scale=0.05, size=(2001, 1))
    channels = {name: Channel(time=time, values=values, source=name) for name, values in rows.items()}
    (found,) = stretches_of(FlightData(name="a", file="a.csv", channels=channels), ONE)
    (exact,) = stretches_of(
        FlightData(
            name="a",
            file="a.csv",
            channels=channels
            | {
                "joint_positions": Channel(time=time, values=angle[:, None], source=""),
                "joint_rates": Channel(time=time, values=rate[:, None], source=""),
            },
        ),
        ONE,
    )
    assert found.rate_noise[0] == pytest.approx(np.std(found.dry_rates[0] - exact.dry_rates[0]), rel=0.2)
    assert exact.rate_noise[0] < 0.02 * found.rate_noise[0]


def test_friction_that_is_not_on_record_is_looked_for():
    words = {"curve": False, "velocity": False, "voltage": False, "driven": (True, True)}
    found = {each.name: each for each in unknowns_of(NOMINAL, **words)}
    body = NOMINAL.links[1].body
    dry = found["links.link2.joint.coulomb"]
    assert (dry.start, dry.positive) == (0.0, False)
    # a tenth of the link's weight at its centre of mass
    assert dry.spread == pytest.approx(0.1 * 9.81 * body.mass * abs(body.com.z))
    assert "links.link2.joint.coulomb_rate" not in found
    six = {
        each.name: each for each in unknowns_of(skyarm.load_vehicle("hexarotor_arm6"), **words | {"driven": [True] * 6})
    }
    record = skyarm.load_vehicle("hexarotor_arm6").links[0]
    assert six[f"links.{record.name}.joint.coulomb"].positive
    assert six[f"links.{record.name}.joint.coulomb_rate"].start == pytest.approx(0.5)


def planted_friction(seed, bend):
    """Numbers of friction of a planted vehicle behind 12 bits a turn, and what a designed flight shows of them."""
    draw = np.random.default_rng([seed, 3])
    more = {f"links.{link.name}.joint.coulomb": 0.005 * draw.uniform(0.5, 1.5) for link in NOMINAL.links}
    more |= {f"links.{link.name}.joint.coulomb_rate": bend for link in NOMINAL.links}
    numbers, vehicle, flight = fly_designed(seed, more=more)
    start = weighed(vehicle)
    joints = (dataclasses.replace(link.joint, coulomb_rate=bend) for link in start.links)
    links = tuple(dataclasses.replace(link, joint=joint) for link, joint in zip(start.links, joints, strict=True))
    start = dataclasses.replace(start, links=links)
    found = identify_vehicle(stretches_of(flight, start), start)
    names = [name for name in numbers if name.endswith(("coulomb", "damping"))]
    return [(numbers[name], found[name]) for name in names]


@pytest.mark.thorough
def test_planted_friction_is_found_behind_encoders():
    """Without any on record: medians of 3 % of it and of the damping, none is 5 % off; 85 % of 40 intervals cover."""
    pytest.importorskip("scipy", reason="needs the extra 'identify'")
    pairs = [pair for seed in range(10) for pair in planted_friction(seed, 0.1)]
    assert all(found.is_known for _, found in pairs)
    errors = [abs(found.value / truth - 1.0) for truth, found in pairs]
    assert np.median(errors) <= 0.03
    assert max(errors) <= 0.05
    assert np.mean([found.low <= truth <= found.high for truth, found in pairs]) >= 0.85


@pytest.mark.thorough
def test_friction_that_bends_within_a_tick_is_not_in_the_data():
    """Rounding is no white noise where a joint turns back: errors of 76 % had intervals of a few per cent."""
    pytest.importorskip("scipy", reason="needs the extra 'identify'")
    assert not any(found.is_known for seed in range(2) for _, found in planted_friction(seed, 0.01))


@pytest.mark.parametrize(("dry", "bend", "hidden"), [(0.002, 0.01, True), (0.002, 0.1, False), (-0.0005, 0.01, False)])
def test_friction_is_hidden_that_bends_within_the_noise_of_its_rate(dry, bend, hidden):
    """Where no dry friction shows, its sign's errors cannot pass for damping."""
    link = NOMINAL.links[0]
    names = [f"links.{link.name}.joint.{name}" for name in ("coulomb", "coulomb_rate", "damping")]
    numbers = {
        name: IdentifiedNumber(name=name, unit="", value=value, low=low, high=1.0, start=0.0, data_share=0.9)
        for name, value, low in zip(names, (0.003, bend, 0.001), (dry, 0.0, 0.0), strict=True)
    }
    assert unresolved_friction(numbers, NOMINAL.links[:1], [0.02]) == (set(names) if hidden else set())


def test_noise_is_not_taken_for_motion():
    """Steady rates with noise: their spread is that of the noise of the smoothed means alone, within 10 %."""
    rates = 0.5 + np.random.default_rng(5).normal(scale=0.05, size=(4001, 1))
    rows = {name: np.zeros((4000, 1)) for name in ("specific_force", "efforts", "commands", "velocity", "voltage")}
    # of means of two, smoothed by a parabola: (-3, 9, 29, 29, 9, -3) / 70
    noise = np.array([0.05 * np.sqrt(1862.0) / 70.0])
    steady = Stretch(
        name="made",
        start=0.0,
        period=PERIOD,
        fine=1,
        width=3,
        rate=np.zeros((4001, 3)),
        joints=rates,
        joint_rates=rates,
        rate_noise=noise,
        **rows,
    )
    means, spread = steady.dry_rates
    assert means.std() == pytest.approx(noise[0], rel=0.05)
    assert np.sqrt((spread**2).mean()) == pytest.approx(means.std(), rel=0.1)


def test_the_widening_is_that_of_a_sign():
    """E[sign(v + n)] is erf(v / (s sqrt 2)): the tanh with the same slope at zero."""
    assert pytest.approx(np.sqrt(2.0 / np.pi)) == 1.0 / BLUR
