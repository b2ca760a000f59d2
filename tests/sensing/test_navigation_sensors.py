"""Magnetometer, barometer and satellite navigation: truth by independent sources,
errors, flights and batches.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.records.coerce import RecordError
from skyarm.sensing.channel import Channel
from skyarm.sensing.navigation_sensors import (
    Barometer,
    Gnss,
    Magnetometer,
    standard_air,
)
from skyarm.simulate.loop import run_in_python
from support.components import same_logs
from support.flights import estimated
from support.vehicles import hummingbird_arm, tumbling

VEHICLE = hummingbird_arm()
STATE = tumbling(VEHICLE)
FORCE = Vec3(0.3, -0.2, 9.7)
ATTITUDE = Rotation.from_quat(
    [float(getattr(STATE.quaternion, axis)) for axis in "xyzw"]
)


def read(sensor, state=STATE, t=0.0, draws=()):
    """First reading of a sensor."""
    return sensor.measure(sensor.start(VEHICLE), t, state, FORCE, draws, 0.02)[1]


def test_a_magnetometer_reads_the_field_in_base_axes():
    reading = read(Magnetometer(north=0.2, west=-0.05, up=0.4, field=Channel()), t=1.5)
    assert reading.time == 1.5
    np.testing.assert_allclose(
        tuple(reading.field),
        ATTITUDE.inv().apply([0.2, -0.05, 0.4]),
        rtol=0,
        atol=1e-15,
    )


def test_a_level_compass_shows_north_ahead_to_the_right_and_to_the_left():
    """Facing north, the field points forward and down; facing west, north is to the
    right (-y); facing east, left.
    """
    for yaw, horizontal in (
        (0.0, (0.215, 0.0)),
        (np.pi / 2, (0.0, -0.215)),
        (-np.pi / 2, (0.0, 0.215)),
    ):
        facing = replace(
            STATE, quaternion=Quaternion.of_rotation_vector(Vec3(0.0, 0.0, yaw))
        )
        field = read(Magnetometer(field=Channel()), facing).field
        np.testing.assert_allclose(tuple(field), (*horizontal, -0.427), atol=1e-15)


def test_the_default_field_is_that_of_zurich():
    """World Magnetic Model 2020 by pygeomag 1.1.0 at 47.397742 N, 8.545594 E, 488 m,
    2020.5.

    It gives 0.215320 gauss horizontal and 0.430282 gauss down, and 2.86 degrees of
    declination, which is left out.
    """
    sensor = Magnetometer()
    assert (sensor.north, sensor.west, sensor.up) == pytest.approx(
        (0.21532, 0.0, -0.430282), abs=0.004
    )


def test_hard_iron_is_fixed_to_the_base():
    iron = (0.1, -0.2, 0.3)
    bare, with_iron = (
        read(Magnetometer(field=Channel(bias=bias))) for bias in ((), iron)
    )
    np.testing.assert_allclose(tuple(with_iron.field - bare.field), iron, atol=1e-15)


ATMOSPHERE = [
    (-500.0, 1074.779791, 18.250256),
    (0.0, 1013.25, 15.0),
    (1000.0, 898.762776, 8.501022),
    (2000.0, 795.014111, 2.004089),
    (5000.0, 540.482623, -17.474457),
    (10000.0, 264.998731, -49.897907),
]
"""Geometric height (m), pressure (hPa), temperature (degC) by ambiance 1.3.1, an
implementation of ICAO Doc 7488/3."""

PUBLISHED = [
    (0.0, 1013.25, 15.0),
    (1000.0, 898.75, 8.5),
    (5000.0, 540.20, -17.5),
    (11000.0, 226.32, -56.5),
]
"""Geopotential height (m), pressure (hPa), temperature (degC): tables of the ICAO
standard atmosphere."""


@pytest.mark.parametrize(("height", "pressure", "temperature"), ATMOSPHERE)
def test_pressure_and_temperature_are_those_of_the_standard_atmosphere(
    height, pressure, temperature
):
    """The numbers are rounded to 1e-6; those below sea level begin at a layer whose
    pressure has six digits.
    """
    aloft = replace(STATE, position=Vec3(3.0, -4.0, height - 300.0))
    reading = read(Barometer(altitude=300.0, pressure=Channel()), aloft, t=0.5)
    assert reading.time == 0.5
    assert reading.pressure == pytest.approx(
        pressure, abs=1e-6 if height >= 0.0 else 5e-4
    )
    assert reading.temperature == pytest.approx(temperature, abs=1e-6)


def test_the_world_s_origin_is_as_high_as_zurich_by_default():
    """At 488 m by ambiance: 955.987087 hPa, 11.828243 degrees Celsius."""
    reading = read(
        Barometer(pressure=Channel()), replace(STATE, position=Vec3(0.0, 0.0, 0.0))
    )
    assert (reading.pressure, reading.temperature) == pytest.approx(
        (955.987087, 11.828243), abs=1e-6
    )


@pytest.mark.parametrize(("geopotential", "pressure", "temperature"), PUBLISHED)
def test_pressure_and_temperature_are_those_of_the_tables(
    geopotential, pressure, temperature
):
    """By geopotential height H = r h / (r + h); the tables round to a hundredth of a
    hPa.
    """
    air = standard_air(6356766.0 * geopotential / (6356766.0 - geopotential))
    assert air == pytest.approx((pressure, temperature), abs=0.006)


def test_the_air_is_in_hydrostatic_balance():
    """Below the tropopause dp/dh = -p g(h) / (R T), with gravity that falls with
    height; differences over 2 m.
    """
    heights = np.linspace(-1000.0, 11000.0, 25)
    (below, above), (pressure, temperature) = (
        (standard_air(heights + d)[0] for d in (-1.0, 1.0)),
        standard_air(heights),
    )
    gravity = 9.80665 / (1.0 + heights / 6356766.0) ** 2
    expected = -pressure * gravity / (287.05287 * (temperature + 273.15))
    np.testing.assert_allclose((above - below) / 2.0, expected, rtol=1e-8)


def test_the_air_above_the_troposphere_is_that_of_its_end():
    """Tropopause of the tables: 226.32 hPa and -56.5 degrees Celsius at 11 019 m,
    geopotential 11 000 m.
    """
    for height in (11019.1, 12000.0, 1e6):
        assert standard_air(height) == pytest.approx((226.32, -56.5), abs=0.01)
    assert standard_air(10900.0)[1] > -55.9


def test_the_noise_of_pressure_is_that_of_a_tenth_of_a_metre():
    above, below = standard_air(0.05)[0], standard_air(-0.05)[0]
    assert Barometer().pressure.sigma == pytest.approx(below - above, rel=0.01)


def test_satellites_read_position_and_velocity_of_the_base():
    reading = read(
        Gnss(
            position=Channel(bias=(1.0, 2.0, 3.0)),
            velocity=Channel(bias=(0.1, 0.2, 0.3)),
        ),
        t=0.25,
    )
    assert reading.time == 0.25
    assert reading.position == STATE.position + Vec3(1.0, 2.0, 3.0)
    assert reading.velocity == STATE.velocity + Vec3(0.1, 0.2, 0.3)


@pytest.mark.parametrize(
    ("sensor", "frequency", "deviations"),
    [
        (Magnetometer(), 50.0, {"field": 0.005}),
        (Barometer(), 50.0, {"pressure": 0.012, "temperature": 0.0}),
        (Gnss(), 10.0, {"position": 0.02, "velocity": 0.05}),
    ],
)
def test_default_noise_has_the_deviation_that_the_page_states(
    sensor, frequency, deviations
):
    """40 000 lanes at once: the deviation of a sample is known to 0.35 %, five of these
    are allowed.
    """
    draws = np.random.default_rng(7).random((sensor.uniforms(VEHICLE), 40_000))
    reading, quiet = read(sensor, draws=tuple(draws)), read(_without_noise(sensor))
    assert sensor.frequency == frequency
    for name, wanted in deviations.items():
        noisy, true = (getattr(each, name) for each in (reading, quiet))
        for a, b in zip(
            *((each if isinstance(each, Vec3) else (each,)) for each in (noisy, true)),
            strict=True,
        ):
            assert np.std(a - b) == pytest.approx(wanted, rel=0.018)
            assert np.mean(a - b) == pytest.approx(0.0, abs=wanted / 40.0)


def _without_noise(sensor):
    return replace(
        sensor, **{name: Channel() for name, _, _ in sensor.examples(VEHICLE)}
    )


@pytest.mark.parametrize(
    ("kind", "wrong", "words"),
    [
        (Barometer, {"altitude": 11001.0}, "altitude = 11001.0: must be at most 11000"),
        (
            Barometer,
            {"altitude": -5001.0},
            "altitude = -5001.0: must be at least -5000",
        ),
        (Barometer, {"altitude": "high"}, "altitude = 'high': must be a number"),
        (Magnetometer, {"north": float("nan")}, "north = nan: must be"),
    ],
)
def test_a_wrong_number_is_refused_in_one_line(kind, wrong, words):
    with pytest.raises(RecordError, match=words) as refused:
        kind(**wrong)
    assert "\n" not in str(refused.value)


def test_biases_of_another_count_are_refused():
    for sensor, words in (
        (
            Magnetometer(field=Channel(bias=(0.1,))),
            r"field.bias = 1 numbers: must be 3, or none",
        ),
        (
            Barometer(pressure=Channel(bias=(0.1, 0.2))),
            r"pressure.bias = 2 numbers: must be 1, or none",
        ),
        (
            Gnss(velocity=Channel(bias=(0.1, 0.2))),
            r"velocity.bias = 2 numbers: must be 3, or none",
        ),
    ):
        with pytest.raises(RecordError, match=words):
            sensor.require_vehicle(VEHICLE)


def sensing():
    """A flight of 0.1 s with the three sensors beside those of a filter, by their names
    in a file.
    """
    return estimated(
        duration=0.1,
        sensors__mag={
            "kind": "magnetometer",
            "field": {"sigma": 0.005, "bias": [0.02, 0.0, -0.01]},
        },
        sensors__baro={"kind": "barometer", "altitude": 1500.0},
        sensors__satellites={"kind": "gnss", "latency": 0.05},
    )


def test_every_engine_reads_the_same_numbers():
    scenario = sensing()
    log = skyarm.run(scenario)
    assert same_logs(log, run_in_python(scenario))
    due = np.arange(20) // 4 * 4  # 50 Hz of 200 Hz
    R = Rotation.from_quat(log.quaternion[due][:, [1, 2, 3, 0]])
    off = (
        log.readings["mag"]["field"]
        - R.inv().apply([0.215, 0.0, -0.427])
        - [0.02, 0.0, -0.01]
    )
    assert 0.002 < off[::4].std() < 0.008  # five readings of three axes, 0.005 gauss
    heights = 1500.0 + log.position[due, 2]
    pressure, temperature = (
        np.array(each)
        for each in zip(*map(standard_air, heights.tolist()), strict=True)
    )
    np.testing.assert_allclose(
        log.readings["baro"]["temperature"], temperature, rtol=0, atol=1e-12
    )
    assert 0.0 < np.abs(log.readings["baro"]["pressure"] - pressure).max() < 0.05
    taken = np.maximum(0, np.arange(20) - 10) // 20 * 20
    assert (
        np.abs(log.readings["satellites"]["velocity"] - log.velocity[taken]).max()
        < 0.25
    )
    assert log.units["readings.mag.field"].words == "gauss, magnetic field, base axes"


def test_a_batch_reads_what_single_flights_read():
    """Lanes with their own field, altitude and noise: to the bit the flights one by
    one.
    """
    paths = [
        "sensors.mag.north",
        "sensors.baro.altitude",
        "sensors.satellites.velocity.sigma",
    ]
    values = np.array([[0.215, 1500.0, 0.05], [0.1, 20.0, 0.2]])
    scenario = sensing()
    batch = skyarm.Batch(scenario, paths, bit_exact=True, log_every=1)
    readings = batch.fly(
        dict(zip(paths, values.T, strict=True)), seed=scenario.seed
    ).log.readings
    for lane, (north, altitude, sigma) in enumerate(values):
        changed = {"mag": {"north": north}, "baro": {"altitude": altitude}}
        named = [
            replace(each, sensor=replace(each.sensor, **changed.get(each.name, {})))
            for each in scenario.sensors
        ]
        named[-1] = replace(
            named[-1],
            sensor=replace(named[-1].sensor, velocity=Channel(sigma=float(sigma))),
        )
        single = skyarm.run(
            replace(scenario, sensors=tuple(named), episode=lane)
        ).readings
        assert np.array_equal(
            np.stack(tuple(readings["mag"].field), -1)[lane], single["mag"]["field"]
        )
        assert np.array_equal(
            readings["baro"].pressure[lane], single["baro"]["pressure"]
        )
        assert np.array_equal(
            np.stack(tuple(readings["satellites"].velocity), -1)[lane],
            single["satellites"]["velocity"],
        )
